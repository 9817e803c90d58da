//! The errors: one enum for all calls, with the numbers that help, without strings or allocation.
//!
//! A query of one ray has no error: a miss is not one, and a grid that was opened answers every ray.

use core::fmt;

use crate::limits;
use crate::method::{Content, Method};

/// A memory region that an error names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Region {
    /// The region that keeps the built grid.
    Index,
    /// The region that only the build needs.
    Scratch,
}

/// The part of a mesh description that an error names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshField {
    /// The vertices or boxes: their bytes end before the last one, or the stride is below 12 bytes, of boxes 24.
    Positions,
    /// The indices: their bytes end before the last triangle, or the stride is below three indices.
    Indices,
    /// The masks: there are not as many as triangles, their bytes end before the last, or
    /// the stride is below four bytes.
    Masks,
    /// The parts of a joined mesh: one of them is joined itself, they are not numbered, or
    /// there are more of them or of their vertices than a mesh may have.
    Parts,
}

/// An array of a batch of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BatchField {
    /// The rays.
    Rays,
    /// The hits, the bytes that tell what is occluded, or the ids of what blocks a ray.
    Answers,
}

/// The field of a [`Config`](crate::Config) that an error names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConfigField {
    /// No method of this version; or, for shapes and scenes, another than [`Method::Bvh`].
    Method,
    /// Zero, negative, NaN, or so large that an axis would need more than [`MAX_RESOLUTION`](limits::MAX_RESOLUTION)
    /// cells (1023 in a recursive grid), or ids and subgrids more than 8 GiB.
    Density,
    /// Below 2, for a method with macrocells.
    MacrocellFactor,
    /// 0 or above [`MAX_DEPTH`](limits::MAX_DEPTH), for a method with nested grids.
    Depth,
    /// A flag that this version does not know.
    Flags,
}

/// The reason why a call failed. Nothing outside the caller's regions was touched.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Error {
    /// A region is too small. With a region of `needed_bytes` the same call gets past this point.
    OutOfMemory {
        /// The region that is too small.
        region: Region,
        /// Bytes that the call needs in this region.
        needed_bytes: u64,
        /// Bytes that the region has.
        available_bytes: u64,
    },
    /// A region does not start at a multiple of [`ALIGNMENT`](limits::ALIGNMENT).
    Misaligned {
        /// The region that is misaligned.
        region: Region,
    },
    /// The mesh description contradicts itself.
    InvalidMesh(MeshField),
    /// More triangles, boxes or instances than the method takes: 2^31 in a tree, else [`limits::MAX_TRIANGLES`]; or
    /// they need more memory than the machine can address.
    TooManyTriangles,
    /// A triangle names a vertex that the mesh does not have.
    IndexOutOfRange {
        /// The first such triangle.
        triangle: u32,
    },
    /// A triangle has a NaN, infinite or too large coordinate, and
    /// [`BuildFlags::STRICT`](crate::BuildFlags::STRICT) was set.
    NonFiniteTriangle {
        /// The first such triangle.
        triangle: u32,
    },
    /// This library was built without the method, and can neither build nor open its grids: turn on
    /// the feature of its name.
    MethodLeftOut(Method),
    /// The grid was built before 0.1.0 with the method `brick`, which was removed: build the grid again.
    MethodRemoved,
    /// A field of the configuration is outside its range.
    InvalidConfig(ConfigField),
    /// The loop of a parallel build ran a task twice or not at all: see
    /// [`Control::run`](crate::Control::run). There is no grid.
    InvalidParallelFor,
    /// The caller's [`Control::progress`](crate::Control::progress) asked to stop. There is no grid.
    Cancelled,
    /// An array of a batch of rays has the wrong length or stride.
    InvalidBatch(BatchField),
    /// The bytes are not a grid.
    NotAGrid,
    /// The grid was built on a machine of the other byte order: build it again on this one.
    WrongByteOrder,
    /// The grid has a format that this version does not read: build it again.
    UnsupportedVersion {
        /// The format version in the blob.
        found: u32,
    },
    /// The bytes end before the grid does.
    Truncated {
        /// Bytes that the grid's header announces.
        needed_bytes: u64,
        /// Bytes that the caller brought.
        available_bytes: u64,
    },
    /// The blob holds a grid and no mesh: bring the mesh it was built for.
    NoMesh,
    /// The grid was built for a mesh with other triangle or vertex counts; or, in a refit, a triangle became
    /// finite that the build left out.
    MeshMismatch,
    /// The blob is built over other primitives than the call expects: open it as [`Content`] says.
    OtherContent(Content),
    /// An instance of a scene names an object that does not exist.
    InstanceWithoutObject {
        /// The first such instance.
        instance: u32,
    },
    /// The matrix of an instance has no inverse that f32 can hold, or it is not finite, or it takes its object beyond
    /// the largest coordinate.
    InstanceWithoutInverse {
        /// The first such instance.
        instance: u32,
    },
    /// The instances of a scene name more objects than it was opened with.
    MissingObjects {
        /// Objects that the scene needs.
        needed: u32,
        /// Objects that were given.
        available: u32,
    },
    /// More scenes stand inside one another than [`MAX_NESTING`](limits::MAX_NESTING).
    TooDeep,
    /// The grid is no tree, or its mesh is packed behind it: only trees without a mesh can be refitted.
    CannotRefit,
    /// The grid contradicts itself or its mesh.
    Corrupt {
        /// Place of the contradiction in the blob, in bytes from its start.
        offset: u64,
    },
}

impl fmt::Display for Region {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Index => "index",
            Self::Scratch => "scratch",
        })
    }
}

impl fmt::Display for Error {
    #[expect(clippy::too_many_lines, reason = "one arm an error")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::OutOfMemory { region, needed_bytes, available_bytes } => {
                write!(f, "the {region} region has {available_bytes} bytes and needs {needed_bytes}")
            }
            Self::Misaligned { region } => {
                write!(f, "the {region} region must start at a multiple of {}", limits::ALIGNMENT)
            }
            Self::InvalidMesh(MeshField::Positions) => {
                f.write_str("the position bytes end before the last vertex, or the stride is below 12, of boxes 24")
            }
            Self::InvalidMesh(MeshField::Indices) => f.write_str(
                "the index bytes end before the last triangle, or the stride is below three indices",
            ),
            Self::InvalidMesh(MeshField::Masks) => f.write_str(
                "there are not as many masks as triangles, their bytes end before the last, or the stride \
                 is below 4",
            ),
            Self::InvalidMesh(MeshField::Parts) => f.write_str(
                "a part of the mesh is joined itself, the parts are not numbered, or they or their vertices \
                 are too many",
            ),
            Self::TooManyTriangles => write!(
                f,
                "a tree takes at most 2^31 triangles, boxes or instances, other methods take {}",
                limits::MAX_TRIANGLES
            ),
            Self::IndexOutOfRange { triangle } => {
                write!(f, "triangle {triangle} names a vertex that the mesh does not have")
            }
            Self::NonFiniteTriangle { triangle } => {
                write!(f, "triangle {triangle} has a coordinate that is NaN, infinite or too large")
            }
            Self::InvalidBatch(BatchField::Rays) => {
                f.write_str("the ray bytes end before the last ray, or the stride is below 32, in scenes 48")
            }
            Self::InvalidBatch(BatchField::Answers) => f.write_str(
                "there are not as many answers as rays, their bytes end before the last, or the stride is \
                 below an answer",
            ),
            Self::MethodLeftOut(method) => {
                write!(f, "this library has no method {0}: turn on its feature {0}", method.name())
            }
            Self::OtherContent(Content::Triangles) => {
                f.write_str("the blob is a grid of triangles: open it as a grid")
            }
            Self::OtherContent(Content::Shapes) => {
                f.write_str("the blob is a tree of shapes: open it as shapes")
            }
            Self::OtherContent(Content::Instances) => {
                f.write_str("the blob is a scene of instances: open it as a scene")
            }
            Self::OtherContent(Content::Packed) => {
                f.write_str("the blob is a packed scene: open it as a packed scene")
            }
            Self::InstanceWithoutObject { instance } => {
                write!(f, "instance {instance} names an object that there is not")
            }
            Self::InstanceWithoutInverse { instance } => write!(
                f,
                "the matrix of instance {instance} is singular or not finite, or takes its object beyond {:e}",
                limits::MAX_COORDINATE
            ),
            Self::MissingObjects { needed, available } => {
                write!(f, "the scene needs {needed} objects and was given {available}")
            }
            Self::TooDeep => {
                write!(f, "more than {} scenes stand inside one another", limits::MAX_NESTING)
            }
            Self::MethodRemoved => {
                f.write_str("the grid was built with the method brick, which was removed: build it again")
            }
            Self::InvalidConfig(ConfigField::Method) => f.write_str("unknown method, or one without shapes and scenes"),
            Self::InvalidConfig(ConfigField::Density) => write!(
                f,
                "density must be above 0 and ask for at most {} cells on an axis, {} in a recursive \
                 grid, and 8 GiB of ids",
                limits::MAX_RESOLUTION,
                limits::MAX_RESOLUTION_OF_RECURSIVE
            ),
            Self::InvalidConfig(ConfigField::MacrocellFactor) => {
                f.write_str("macrocell_factor must be at least 2")
            }
            Self::InvalidConfig(ConfigField::Depth) => {
                write!(f, "depth must be 1 to {}", limits::MAX_DEPTH)
            }
            Self::InvalidConfig(ConfigField::Flags) => f.write_str("unknown build flag"),
            Self::InvalidParallelFor => {
                f.write_str("the parallel_for did not run every task exactly once")
            }
            Self::Cancelled => f.write_str("the build was cancelled by its progress callback"),
            Self::NotAGrid => f.write_str("the bytes are not a grid"),
            Self::WrongByteOrder => {
                f.write_str("the grid was built on a machine of the other byte order")
            }
            Self::UnsupportedVersion { found } => {
                write!(f, "the grid has format version {found}, this library reads another")
            }
            Self::Truncated { needed_bytes, available_bytes } => {
                write!(f, "the grid has {needed_bytes} bytes, of which {available_bytes} are here")
            }
            Self::NoMesh => f.write_str("the blob holds a grid and no mesh: bring its mesh"),
            Self::MeshMismatch => f.write_str("the grid was built for another mesh"),
            Self::CannotRefit => {
                f.write_str("only a tree can be refitted, and only without a packed mesh")
            }
            Self::Corrupt { offset } => write!(f, "the grid is damaged at byte {offset}"),
        }
    }
}

impl Error {
    /// A region with fewer bytes than a call needs.
    pub(crate) const fn out_of_memory(
        region: Region,
        needed_bytes: u64,
        available_bytes: u64,
    ) -> Self {
        Self::OutOfMemory { region, needed_bytes, available_bytes }
    }
}

impl core::error::Error for Error {}
