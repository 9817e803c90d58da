//! Grid and mesh in one blob, which opens without the caller's mesh.
//!
//! ```text
//! 0                 blob_bytes                                                      total_bytes
//! | header | grid   | positions    | indices      | masks           | parts         |
//!   says so           12 a vertex    12 a triangle  4 a triangle,     4 a part, if the
//!                                                   if it has any     mesh was joined
//! ```
//!
//! Every section starts at a multiple of 64, as in the grid, which is the one that was built but for its header. The
//! mesh is tight and its indices have 32 bits, whatever the caller's had. Parts that were joined become one mesh: of
//! each only the number of its first triangle is kept, so that [`TriangleMesh::locate`] answers as before. Opening
//! reads it where it lies, so there is still no copy and no allocation.

mod scene;

use core::mem::offset_of;

use zerocopy::IntoBytes;

use crate::arena::{align_up, check_alignment, first_mut, section_bytes};
use crate::blob::{BLOB_VERSION, HEADER_BYTES, HasMesh, Header, corrupt};
use crate::error::{Error, Region};
use crate::grid::Grid;
use crate::invariant::OrBug;
use crate::limits::{ALIGNMENT, MAX_TRIANGLES};
use crate::mesh::{IndexType, Strided, TriangleMesh};
use crate::method::{Content, Method};
use crate::scene::ends_of;
pub use scene::Member;

/// The data in the header of a blob, whether or not the rest of the blob is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlobInfo {
    /// The version of the format.
    pub version: u32,
    /// The primitives that it is built over.
    pub content: Content,
    /// The method that built it.
    pub method: Method,
    /// True if it is packed: the mesh, or all that a scene shows, is in it.
    pub has_mesh: bool,
    /// Vertices of its mesh; twice the number of shapes or instances; of a packed scene, the objects that
    /// [`Scene::open_packed`](crate::Scene::open_packed) takes room for.
    pub vertex_count: u64,
    /// Triangles of its mesh; shapes or instances; grids and scenes that a packed scene shows.
    pub triangle_count: u32,
    /// Bytes of the grid.
    pub grid_bytes: u64,
    /// Bytes of all of it: of the grid, and of what is packed with it.
    pub total_bytes: u64,
}

impl BlobInfo {
    /// Reads the first 128 bytes of a blob, which may lie anywhere: in a buffer that is filled from
    /// a file, before there is room for the rest.
    ///
    /// # Errors
    /// [`Error::NotAGrid`], [`Error::WrongByteOrder`], [`Error::UnsupportedVersion`],
    /// [`Error::Truncated`] if there are fewer bytes, [`Error::MethodRemoved`], [`Error::Corrupt`].
    ///
    /// ```
    #[doc = include_str!("../../doc/grid.txt")]
    /// let info = BlobInfo::peek(grid.blob())?;
    /// assert_eq!((info.method, info.triangle_count), (Method::Bvh, 1));
    /// assert!(!info.has_mesh && info.total_bytes == grid.blob_bytes() as u64);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn peek(bytes: &[u8]) -> Result<Self, Error> {
        let header = Header::peek(bytes)?;
        let method = Method::from_u32(header.method).ok_or(corrupt(offset_of!(Header, method)))?;
        let has_mesh = header.has_mesh()? != HasMesh::No;
        let content = header.content()?;
        let total_bytes = match content {
            Content::Instances => ends_of(&header).1,
            Content::Triangles | Content::Shapes => MeshSections::of(&header)?.end,
            Content::Packed => header.blob_bytes,
        };
        let Header { vertex_count, triangle_count, blob_bytes: grid_bytes, .. } = header;
        Ok(Self {
            version: BLOB_VERSION,
            content,
            method,
            has_mesh,
            vertex_count,
            triangle_count,
            grid_bytes,
            total_bytes,
        })
    }
}

/// The places of the mesh's arrays behind a grid, in bytes from the start of the blob.
struct MeshSections {
    positions: u64,
    indices: u64,
    masks: u64,
    parts: u64,
    end: u64,
}

impl MeshSections {
    fn of(header: &Header) -> Result<Self, Error> {
        let has_mesh = header.has_mesh()?;
        let triangles = u64::from(header.triangle_count);
        let positions = align_up(header.blob_bytes);
        if has_mesh == HasMesh::No {
            let end = header.blob_bytes;
            let [indices, masks, parts] = [positions; 3];
            return Ok(Self { positions, indices, masks, parts, end });
        }
        let indices = positions.saturating_add(section_bytes::<[f32; 3]>(header.vertex_count));
        let masks = indices.saturating_add(section_bytes::<[u32; 3]>(triangles));
        let mask_bytes =
            if has_mesh == HasMesh::WithMasks { section_bytes::<u32>(triangles) } else { 0 };
        let parts = masks.saturating_add(mask_bytes);
        let end = parts.saturating_add(section_bytes::<u32>(header.part_count().into()));
        Ok(Self { positions, indices, masks, parts, end })
    }
}

impl<'a> Grid<'a> {
    /// Bytes that [`pack`](Self::pack) writes.
    #[must_use]
    pub fn packed_bytes(&self) -> u64 {
        self.packed_sections().map_or(0, |sections| sections.end)
    }

    /// Returns where [`pack`](Self::pack) puts the mesh.
    fn packed_sections(&self) -> Result<MeshSections, Error> {
        MeshSections::of(&self.packed_header()?)
    }

    /// Writes grid and mesh as one blob for [`open_packed`](Self::open_packed), and returns the bytes of `to` that it
    /// takes.
    ///
    /// Of a joined mesh ([`TriangleMesh::join`]) the blob holds one mesh with the same triangles and numbers,
    /// and [`TriangleMesh::locate`] still tells which part a triangle is of.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] names the need, [`Error::Misaligned`] an address that is no multiple of [`ALIGNMENT`],
    /// [`Error::IndexOutOfRange`] a triangle without vertices. Nothing is written then.
    ///
    /// ```
    #[doc = include_str!("../../doc/grid.txt")]
    /// let mut memory = vec![Block::ZERO; Block::count_for(grid.packed_bytes() as usize)];
    /// let packed = grid.pack(Block::bytes_mut(&mut memory))?;
    ///
    /// // Store it, map it in another process, and there:
    /// let grid = Grid::open_packed(packed)?;
    /// assert!(grid.occluded(&Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0])));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn pack<'t>(&self, to: &'t mut [u8]) -> Result<&'t mut [u8], Error> {
        check_alignment(to, Region::Index)?;
        let header = self.packed_header()?;
        let sections = MeshSections::of(&header)?;
        let mesh = self.mesh();
        if let Some(triangle) = mesh.first_without_vertices() {
            return Err(Error::IndexOutOfRange { triangle });
        }
        let to = first_mut(to, sections.end, Region::Index)?;

        // Copy the grid, tell in its header what follows, and clear what the sections leave over.
        let mut out = Out { bytes: &mut *to };
        out.put(&header.to_bytes());
        out.put(
            self.blob().get(HEADER_BYTES..).or_bug("a grid without header").unwrap_or_default(),
        );
        out.pad();
        mesh.each_vertex(|vertex| out.put(vertex));
        out.pad();
        mesh.each_indices(|vertices| out.put(vertices.as_bytes()));
        out.pad();
        if mesh.has_masks() {
            (0..mesh.triangle_count()).for_each(|id| out.put(&mesh.mask(id).to_ne_bytes()));
            out.pad();
        }
        mesh.parts().iter().for_each(|part| out.put(&part.first().to_ne_bytes()));
        out.put(mesh.numbering().as_flattened());
        out.pad();
        Ok(to)
    }

    /// Opens a blob that [`pack`](Self::pack) wrote, in O(1): the mesh is its own.
    ///
    /// The remarks of [`open`](Self::open) on damaged bytes hold here, too; [`validate`](Self::validate) proves that
    /// the grid is one of the mesh behind it, whatever mesh that is.
    ///
    /// # Errors
    /// The errors of [`open`](Self::open), and [`Error::NoMesh`].
    ///
    /// ```
    #[doc = include_str!("../../doc/grid.txt")]
    /// let mut memory = vec![Block::ZERO; Block::count_for(grid.packed_bytes() as usize)];
    /// let packed = grid.pack(Block::bytes_mut(&mut memory))?;
    /// let grid = Grid::open_packed(packed)?;
    /// assert_eq!(grid.mesh().triangle(0), Some(positions));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn open_packed(blob: &'a [u8]) -> Result<Self, Error> {
        check_alignment(blob, Region::Index)?;
        let header = Header::peek(blob)?;
        if header.content()? != Content::Triangles {
            return Err(Error::OtherContent(header.content()?));
        }
        let has_mesh = header.has_mesh()?;
        if has_mesh == HasMesh::No {
            return Err(Error::NoMesh);
        }
        let MeshSections { positions, indices, masks, parts, end } = MeshSections::of(&header)?;
        let (needed_bytes, available_bytes) = (end, blob.len() as u64);
        let truncated = Error::Truncated { needed_bytes, available_bytes };
        let damaged = corrupt(offset_of!(Header, triangle_count));
        let section = |start: u64, count: u64, stride: usize| {
            let start = usize::try_from(start).ok()?;
            let count = usize::try_from(count).ok()?;
            let (bytes, rest) = blob.get(start..)?.split_at_checked(count.checked_mul(stride)?)?;
            let padding = bytes.len().next_multiple_of(ALIGNMENT) - bytes.len();
            let is_zero = rest.get(..padding)?.iter().all(|&byte| byte == 0);
            is_zero.then_some(Strided { bytes, stride, count })
        };
        if needed_bytes > available_bytes {
            return Err(truncated);
        }
        let triangles = u64::from(header.triangle_count);
        let positions = section(positions, header.vertex_count, 12).ok_or(damaged)?;
        let indices = section(indices, triangles, 12).ok_or(damaged)?;
        if indices.count > MAX_TRIANGLES {
            return Err(damaged);
        }
        let mut mesh = TriangleMesh::strided(positions, indices, IndexType::U32)?;
        if has_mesh == HasMesh::WithMasks {
            mesh = mesh.with_masks(section(masks, triangles, 4).ok_or(damaged)?)?;
        }
        let parts = section(parts, header.part_count().into(), 4).ok_or(damaged)?;
        if parts.count > 0 {
            mesh = mesh.numbered(parts.bytes.as_chunks().0);
        }
        Self::open(blob, mesh)
    }

    /// Proves that the parts of a packed mesh follow one another.
    pub(crate) fn check_parts(&self) -> Result<(), Error> {
        let numbering = self.mesh().numbering();
        let mut before = 0;
        for (at, first) in numbering.iter().enumerate() {
            let first = u32::from_ne_bytes(*first);
            let is_next = first >= before && (at > 0 || first == 0);
            if !is_next || first > self.mesh().triangle_count() {
                let MeshSections { parts, .. } = MeshSections::of(&self.packed_header()?)?;
                let offset = parts.saturating_add(at as u64 * size_of::<u32>() as u64);
                return Err(Error::Corrupt { offset });
            }
            before = first;
        }
        Ok(())
    }

    /// The grid's header, as it is in a blob with the mesh.
    fn packed_header(&self) -> Result<Header, Error> {
        let has_mesh = if self.mesh().has_masks() { HasMesh::WithMasks } else { HasMesh::Yes };
        let parts = self.mesh().parts().len().max(self.mesh().numbering().len());
        // The number fits: `join` limits it, and others come from a header.
        let parts = u32::try_from(parts).unwrap_or(0);
        Ok(Header::read(self.blob(), self.mesh())?.packed(has_mesh, parts))
    }
}

/// Bytes to be written, from the front to the back.
pub(crate) struct Out<'t> {
    pub(crate) bytes: &'t mut [u8],
}

impl Out<'_> {
    pub(crate) fn put(&mut self, bytes: &[u8]) {
        let rest = core::mem::take(&mut self.bytes);
        debug_assert!(bytes.len() <= rest.len(), "more bytes than were planned");
        if let Some((to, rest)) = rest.split_at_mut_checked(bytes.len()) {
            to.copy_from_slice(bytes);
            self.bytes = rest;
        }
    }

    /// Writes zeros up to the next section: the end is a multiple of [`ALIGNMENT`].
    pub(crate) fn pad(&mut self) {
        let padding = self.bytes.len() % ALIGNMENT;
        self.put([0; ALIGNMENT].get(..padding).unwrap_or_default());
    }
}
