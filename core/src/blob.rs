//! The built grid as bytes: one header for every method, then the method's own sections.
//!
//! ```text
//! 0        128                                                    blob_bytes
//! | header | section | section | ...                              |
//! ```
//!
//! Every section starts at a multiple of 64 and is filled up with zeros. The header holds counts, never offsets: where
//! a section lies follows from the counts through the method's layout, the same one that answered how many bytes the
//! build needs. There is no pointer in it, so it can be copied, mapped from a file, sent, or put in flash. It is in the
//! byte order of its machine; the other order is recognised and refused.

use glam::Vec3A;
use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, transmute};

use crate::aabb::Aabb;
use crate::arena;
use crate::bits::halves;
use crate::cell::Lattice;
use crate::config::{BuildFlags, Parameters, density_is_valid};
use crate::control::Watch;
use crate::error::{Error, Region};
use crate::fnv::Fnv;
use crate::limits::{ALIGNMENT, MAX_RESOLUTION};
use crate::mesh::TriangleMesh;
use crate::method::{Content, Method, Quality, REMOVED_METHOD};
use crate::survey::Survey;

/// The version of the blob format. A blob of another version is refused.
pub const BLOB_VERSION: u32 = 4;

/// Bytes before the first section.
pub(crate) const HEADER_BYTES: usize = size_of::<Header>();

const MAGIC: [u8; 8] = *b"hgrid\r\n\x1a";
const BYTE_ORDER: u32 = 0x0102_0304;

/// The first 128 bytes of every blob.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, Immutable, IntoBytes)]
pub(crate) struct Header {
    magic: [u8; 8],
    byte_order: u32,
    version: u32,
    /// Bytes of the whole blob.
    pub(crate) blob_bytes: u64,
    /// Vertices of the mesh it was built for.
    pub(crate) vertex_count: u64,
    /// Triangles of the mesh it was built for, skipped ones included.
    pub(crate) triangle_count: u32,
    /// Triangles left out because a coordinate is not finite.
    pub(crate) skipped_count: u32,
    /// The method, as [`Method`] numbers them.
    pub(crate) method: u32,
    /// The density the grid was built with.
    pub(crate) density: f32,
    /// The box, pad included.
    pub(crate) bounds_min: [f32; 3],
    pub(crate) bounds_max: [f32; 3],
    /// Cells per axis.
    pub(crate) resolution: [u32; 3],
    /// Slots of the hash table; of a tree, nodes with fine sides.
    pub(crate) hash_count: u32,
    /// Primitive ids in all cells together, or words of the pool for a method that has one.
    pub(crate) reference_count: u32,
    /// Cells of a level in one of the level above, on each axis; 0 for a method without levels.
    pub(crate) macrocell_factor: u32,
    /// A cell with more primitives has a subgrid if that separates them; 0 for a method without subgrids.
    pub(crate) subdivide_above: u32,
    /// Levels of grids; 0 for a method without nested grids.
    pub(crate) depth: u32,
    /// The primitives that it is built over, as [`Content`] numbers them.
    content: u32,
    /// Two bits for [`HasMesh`]; above them the number of parts that the mesh was joined from, 0 if it was not.
    mesh: u32,
    /// Nodes of a tree; 0 for a method without nodes.
    pub(crate) node_count: u32,
    /// Levels of nodes.
    pub(crate) levels: u32,
    /// The quality of a tree, as [`Quality`] numbers them; 0 for a method without nodes.
    pub(crate) quality: u32,
    /// A hash of all bytes before it; `open` refuses a header with another.
    checksum: u32,
}

/// The mesh that a blob holds behind its grid, if any.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum HasMesh {
    /// Nothing: the caller has the mesh.
    No = 0,
    /// The grid's mesh.
    Yes = 1,
    /// The grid's mesh and the masks of the triangles.
    WithMasks = 2,
}

const _: () = assert!(HEADER_BYTES == 128 && HEADER_BYTES.is_multiple_of(ALIGNMENT));

impl Header {
    /// A header for a mesh; the counts that the build finds are the caller's to fill in.
    pub(crate) fn new(parameters: Parameters, mesh: &TriangleMesh<'_>, lattice: &Lattice) -> Self {
        let mut header = Self {
            magic: MAGIC,
            byte_order: BYTE_ORDER,
            version: BLOB_VERSION,
            method: parameters.method() as u32,
            density: parameters.density().unwrap_or(0.0),
            triangle_count: mesh.triangle_count(),
            vertex_count: mesh.vertex_count() as u64,
            content: mesh.content() as u32,
            bounds_min: lattice.min,
            bounds_max: lattice.max,
            resolution: lattice.resolution,
            ..Self::new_zeroed()
        };
        match parameters {
            Parameters::OneLevel { .. } => {}
            Parameters::Fixed { macrocell_factor: factor, .. } => header.macrocell_factor = factor,
            Parameters::Variable { subdivide_above: most, .. } => header.subdivide_above = most,
            Parameters::Recursive { depth, .. } => header.depth = depth,
            Parameters::Bvh { quality } => header.quality = quality as u32,
        }
        header
    }

    /// The parameters that the grid was built with.
    pub(crate) fn parameters(&self, method: Method) -> Parameters {
        let Self { density, macrocell_factor, subdivide_above, depth, .. } = *self;
        match method {
            Method::OneLevel => Parameters::OneLevel { density },
            Method::Fixed => Parameters::Fixed { density, macrocell_factor },
            Method::Variable => Parameters::Variable { density, subdivide_above },
            Method::Recursive => Parameters::Recursive { density, depth },
            Method::Bvh => Parameters::Bvh { quality: self.quality() },
        }
    }

    /// The quality of a tree.
    pub(crate) fn quality(&self) -> Quality {
        Quality::from_u32(self.quality).unwrap_or_default()
    }

    /// Nodes of a tree that have fine sides.
    pub(crate) const fn fine_count(&self) -> u64 {
        self.hash_count as u64
    }

    /// The header as the first bytes of a blob.
    pub(crate) fn to_bytes(mut self) -> [u8; HEADER_BYTES] {
        self.checksum = self.sum();
        transmute!(self)
    }

    /// A hash of the words before the checksum.
    fn sum(&self) -> u32 {
        let words: [u32; HEADER_BYTES / size_of::<u32>()] = transmute!(*self);
        let (_, words) = words.split_last().unwrap_or((&0, &[]));
        let mut sum = Fnv::new();
        for &word in words {
            sum.add(word);
        }
        let [low, high] = halves(sum.finish());
        low ^ high
    }

    /// Reads the header of foreign bytes and checks all that O(1) can: it is a grid of this version
    /// for a mesh of this size, and it is all there.
    pub(crate) fn read(bytes: &[u8], mesh: &TriangleMesh<'_>) -> Result<Self, Error> {
        arena::check_alignment(bytes, Region::Index)?;
        let header = Self::peek(bytes)?;
        if header.blob_bytes > bytes.len() as u64 {
            return Err(Error::Truncated {
                needed_bytes: header.blob_bytes,
                available_bytes: bytes.len() as u64,
            });
        }
        if header.content()? != mesh.content() {
            return Err(Error::OtherContent(header.content()?));
        }
        if header.triangle_count != mesh.triangle_count()
            || header.vertex_count != mesh.vertex_count() as u64
        {
            return Err(Error::MeshMismatch);
        }
        Ok(header)
    }

    /// Reads the header of foreign bytes; the rest of the blob may be missing.
    pub(crate) fn peek(bytes: &[u8]) -> Result<Self, Error> {
        let Ok((header, _)) = Self::read_from_prefix(bytes) else {
            return Err(if bytes.starts_with(&MAGIC) {
                Error::Truncated {
                    needed_bytes: HEADER_BYTES as u64,
                    available_bytes: bytes.len() as u64,
                }
            } else {
                Error::NotAGrid
            });
        };
        if header.magic != MAGIC {
            return Err(Error::NotAGrid);
        }
        if header.byte_order == BYTE_ORDER.swap_bytes() {
            return Err(Error::WrongByteOrder);
        }
        if header.byte_order != BYTE_ORDER {
            return Err(Error::NotAGrid);
        }
        if header.version != BLOB_VERSION {
            return Err(Error::UnsupportedVersion { found: header.version });
        }
        if header.checksum != header.sum() {
            return Err(corrupt(core::mem::offset_of!(Self, checksum)));
        }
        if header.method == REMOVED_METHOD {
            return Err(Error::MethodRemoved);
        }
        Ok(header)
    }

    /// Returns the content of the blob.
    pub(crate) fn content(&self) -> Result<Content, Error> {
        Content::from_u32(self.content).ok_or(corrupt(core::mem::offset_of!(Self, content)))
    }

    /// Returns whether the mesh lies behind the grid, and whether its masks do.
    pub(crate) fn has_mesh(&self) -> Result<HasMesh, Error> {
        match (self.mesh & 3, self.part_count()) {
            (0, 0) => Ok(HasMesh::No),
            (1, _) => Ok(HasMesh::Yes),
            (2, _) => Ok(HasMesh::WithMasks),
            _ => Err(corrupt(core::mem::offset_of!(Self, mesh))),
        }
    }

    /// Returns an error for what no build of a scene writes: another method than bvh, a mesh, skipped instances.
    pub(crate) const fn check_scene(&self) -> Result<(), Error> {
        if self.method != Method::Bvh as u32 {
            return Err(corrupt(core::mem::offset_of!(Self, method)));
        }
        if self.mesh != HasMesh::No as u32 {
            return Err(corrupt(core::mem::offset_of!(Self, mesh)));
        }
        if self.skipped_count != 0 {
            return Err(corrupt(core::mem::offset_of!(Self, skipped_count)));
        }
        Ok(())
    }

    /// Returns the number of parts that the mesh behind the grid was joined from; 0 if it was not.
    pub(crate) const fn part_count(&self) -> u32 {
        self.mesh >> 2
    }

    /// The header of the same grid with its mesh behind it, joined from so many parts.
    pub(crate) const fn packed(self, mesh: HasMesh, part_count: u32) -> Self {
        Self { mesh: mesh as u32 | part_count << 2, ..self }
    }

    /// The header of a packed scene, from the header of the scene alone.
    pub(crate) const fn holding(self, members: u32, references: u64, blob_bytes: u64) -> Self {
        Self {
            blob_bytes,
            vertex_count: references.saturating_add(members as u64),
            triangle_count: members,
            skipped_count: 0,
            reference_count: 0,
            content: Content::Packed as u32,
            mesh: HasMesh::Yes as u32,
            hash_count: 0,
            node_count: 0,
            levels: 0,
            ..self
        }
    }

    /// The lattice, if box and resolution can be one.
    pub(crate) fn lattice(&self) -> Result<Lattice, Error> {
        let bounds = Aabb { min: self.bounds_min.into(), max: self.bounds_max.into() };
        if !bounds.is_proper() {
            return Err(corrupt(core::mem::offset_of!(Self, bounds_min)));
        }
        if !self.resolution.iter().all(|r| (1..=MAX_RESOLUTION).contains(r)) {
            return Err(corrupt(core::mem::offset_of!(Self, resolution)));
        }
        Ok(Lattice::new(bounds, self.resolution))
    }

    /// Checks the header against the mesh: the skipped triangles, the box, the density, and the resolution that
    /// `rule` computes from the box's size and the number of finite triangles.
    pub(crate) fn check(
        &self,
        lattice: &Lattice,
        mesh: &TriangleMesh<'_>,
        rule: impl FnOnce(Vec3A, u32) -> Option<[u32; 3]>,
    ) -> Result<(), Error> {
        let survey = self.survey(lattice, mesh)?;
        if !density_is_valid(self.density) {
            return Err(corrupt(core::mem::offset_of!(Self, density)));
        }
        if rule(lattice.bounds().size(), survey.finite_count) != Some(lattice.resolution) {
            return Err(corrupt(core::mem::offset_of!(Self, resolution)));
        }
        Ok(())
    }

    /// Surveys the mesh; an error unless the header has as many skipped triangles and the same box.
    pub(crate) fn survey(
        &self,
        lattice: &Lattice,
        mesh: &TriangleMesh<'_>,
    ) -> Result<Survey, Error> {
        let survey = Survey::of(mesh, BuildFlags::empty(), &Watch::none())?;
        if self.skipped_count != survey.skipped_count {
            return Err(corrupt(core::mem::offset_of!(Self, skipped_count)));
        }
        if lattice.bounds() != Lattice::pad(&survey.bounds) {
            return Err(corrupt(core::mem::offset_of!(Self, bounds_min)));
        }
        Ok(survey)
    }

    /// Returns true if the fields that mean nothing to the method are zero, as a build leaves them.
    pub(crate) fn unused_is_zero(&self, method: Method) -> bool {
        let is_tree = method == Method::Bvh;
        (method == Method::Fixed || self.macrocell_factor == 0)
            && (method == Method::Variable || self.subdivide_above == 0)
            && (method == Method::Recursive || self.depth == 0)
            && (!is_tree || self.density.to_bits() == 0)
            && (is_tree || (self.node_count, self.levels, self.quality) == (0, 0, 0))
    }
}

/// The error for a contradiction at a byte of the blob.
pub(crate) const fn corrupt(offset: usize) -> Error {
    Error::Corrupt { offset: offset as u64 }
}
