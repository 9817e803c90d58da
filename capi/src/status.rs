//! The answers of calls: one pinned number for each cause, and what to do about it in words.
//!
//! The numbers are ABI. They have gaps between the groups and are never used for anything else.

use core::ffi::{CStr, c_char};

use hgrid_core::{BatchField, ConfigField, Error, MeshField, Region};

/// The result of a call: `HGRID_OK`, or a negative error. `hgrid_status_string` has the text of each.
#[allow(non_camel_case_types, reason = "the C name")]
pub type hgrid_status = i32;

/// Success.
pub const HGRID_OK: hgrid_status = 0;

/// A pointer is NULL that may not be.
pub const HGRID_ERROR_NULL_ARGUMENT: hgrid_status = -1;

/// A struct's `struct_size` is smaller than the struct, or above 4096, or larger than the struct and what is behind the
/// known fields is not zero; or the `reserved` field of a struct that the call reads is not 0; or, from `hgrid_join`,
/// the size puts the next mesh at an address that is not aligned. The usual cause is a struct that was not initialised
/// with its `_INIT` macro.
pub const HGRID_ERROR_STRUCT_SIZE: hgrid_status = -2;

/// The index, the scratch, the blob, or the room for a blob or for views does not start at a multiple of
/// `HGRID_ALIGNMENT`.
pub const HGRID_ERROR_MISALIGNED: hgrid_status = -3;

/// Memory that the call writes (an index, scratch, the room for a packed blob or its views, parts) overlaps other such
/// memory or what the call reads: a mesh, boxes, instances, objects, a blob, rays. Answers of a batch are compared with
/// its rays and its scratch alone. Calls that look through all that a scene shows return it, too, if a view was
/// overwritten so that more scenes stand inside one another than `HGRID_MAX_NESTING`.
pub const HGRID_ERROR_OVERLAP: hgrid_status = -4;

/// The index is too small, or the room for a packed blob or for views. The report says how many bytes it needs.
/// `hgrid_pack`, `hgrid_pack_scene` and `hgrid_open_packed_scene` have no report: they write the number to `bytes`.
///
/// With `HGRID_METHOD_ONE_LEVEL` and `HGRID_METHOD_FIXED` the index was not touched; with the other
/// methods the grid was written as far as it went, so the index may hold anything.
pub const HGRID_ERROR_INDEX_TOO_SMALL: hgrid_status = -10;

/// The scratch is too small. The report says how many bytes it needs. If the call has no report, its description says
/// how many.
pub const HGRID_ERROR_SCRATCH_TOO_SMALL: hgrid_status = -11;

/// The allocator has no more memory. The report says how many bytes index and scratch need.
pub const HGRID_ERROR_OUT_OF_MEMORY: hgrid_status = -12;

/// The position stride is below 12 bytes, or the box stride below 24, or the vertices or boxes do not fit into memory.
pub const HGRID_ERROR_INVALID_POSITIONS: hgrid_status = -20;

/// The index stride is below three indices, or the indices do not fit into memory.
pub const HGRID_ERROR_INVALID_INDICES: hgrid_status = -21;

/// The mesh's `index_type` is unknown to this version.
pub const HGRID_ERROR_INVALID_INDEX_TYPE: hgrid_status = -22;

/// There are more triangles, boxes or instances than the method takes, 2^31 for a tree and 4294967294 for the others;
/// or the arrays or the sizes do not fit into the machine's address space.
pub const HGRID_ERROR_TOO_MANY_TRIANGLES: hgrid_status = -23;

/// A triangle names a vertex that the mesh does not have. The report says which triangle.
pub const HGRID_ERROR_INDEX_OUT_OF_RANGE: hgrid_status = -24;

/// A triangle or a box has a number that is NaN, infinite or beyond 2^120, and `HGRID_BUILD_STRICT` is set; or, in a
/// refit with any flags, one that the build did not leave out has such a number now. The report says which.
pub const HGRID_ERROR_NON_FINITE: hgrid_status = -25;

/// The mask stride is below 4 bytes, or the masks do not fit into memory.
pub const HGRID_ERROR_INVALID_MASKS: hgrid_status = -26;

/// The parts are wrong: `hgrid_join` did not write them, or wrote them for other counts, or the mesh has arrays as
/// well. From `hgrid_join`: a mesh is joined itself, or the meshes or their vertices are too many.
pub const HGRID_ERROR_INVALID_PARTS: hgrid_status = -27;

/// The configuration's `method` is unknown to this version, or, for shapes and scenes, not `HGRID_METHOD_BVH`.
pub const HGRID_ERROR_INVALID_METHOD: hgrid_status = -30;

/// The density is NaN, infinite or not above 0, or asks for too much: more than 4096 cells on an
/// axis (1023 for `HGRID_METHOD_RECURSIVE`), or more than 8 GiB of ids and subgrids.
pub const HGRID_ERROR_INVALID_DENSITY: hgrid_status = -31;

/// The configuration's `flags` have a bit that this version does not know.
pub const HGRID_ERROR_INVALID_FLAGS: hgrid_status = -32;

/// The configuration's `macrocell_factor` is 0 or 1, and the method is `HGRID_METHOD_FIXED`.
pub const HGRID_ERROR_INVALID_MACROCELL_FACTOR: hgrid_status = -33;

/// The configuration's `depth` is 0 or above `HGRID_MAX_DEPTH`, and the method is
/// `HGRID_METHOD_RECURSIVE`.
pub const HGRID_ERROR_INVALID_DEPTH: hgrid_status = -34;

// -35 was an invalid cell_size, of a method that is no more.

/// The configuration's `run` did not run every task exactly once before it returned.
pub const HGRID_ERROR_PARALLEL_FOR: hgrid_status = -36;

/// The configuration's `progress` answered false. There is no grid.
pub const HGRID_ERROR_CANCELLED: hgrid_status = -37;

/// The method of the configuration, or of the blob, is none that this library was built with:
/// `hgrid_has_method` tells which are.
pub const HGRID_ERROR_METHOD_LEFT_OUT: hgrid_status = -38;

/// The configuration's `quality` is unknown to this version, and the method is `HGRID_METHOD_BVH`.
pub const HGRID_ERROR_INVALID_QUALITY: hgrid_status = -39;

/// The bytes, or the view, are not a grid.
pub const HGRID_ERROR_NOT_A_GRID: hgrid_status = -40;

/// The blob was built on a machine of the other byte order.
pub const HGRID_ERROR_WRONG_BYTE_ORDER: hgrid_status = -41;

/// The blob has a format of another version than `HGRID_BLOB_VERSION`.
pub const HGRID_ERROR_UNSUPPORTED_VERSION: hgrid_status = -42;

/// The bytes end before the blob does.
pub const HGRID_ERROR_TRUNCATED: hgrid_status = -43;

/// The blob was built for a mesh with another number of vertices or triangles, or for another number of instances; or,
/// from `hgrid_refit`, a triangle that the build left out is finite now.
pub const HGRID_ERROR_MESH_MISMATCH: hgrid_status = -44;

/// The blob contradicts itself or its mesh, or the objects of a scene changed after its build.
pub const HGRID_ERROR_CORRUPT: hgrid_status = -45;

/// The blob holds a grid and no mesh, and none was brought.
pub const HGRID_ERROR_NO_MESH: hgrid_status = -46;

/// The blob is no tree (`HGRID_METHOD_BVH`), or `hgrid_pack` wrote it: refit the tree, then pack it.
pub const HGRID_ERROR_CANNOT_REFIT: hgrid_status = -47;

/// The blob was built before 0.1.0 with the method brick, which was removed: build it with another method.
pub const HGRID_ERROR_METHOD_REMOVED: hgrid_status = -48;

/// The blob is built over other primitives: open it with the function for triangles, shapes or instances. Or a scene
/// that shows shapes was to be packed: shapes cannot be packed.
pub const HGRID_ERROR_OTHER_CONTENT: hgrid_status = -49;

/// The stride of a batch's rays is below the size of a ray, or the rays do not fit into memory.
pub const HGRID_ERROR_INVALID_RAYS: hgrid_status = -50;

/// The stride of a batch's answers is below the size of one, or the answers do not fit into memory.
pub const HGRID_ERROR_INVALID_ANSWERS: hgrid_status = -51;

/// The coherence is unknown to this version.
pub const HGRID_ERROR_INVALID_COHERENCE: hgrid_status = -52;

/// The options' `cull` is unknown to this version.
pub const HGRID_ERROR_INVALID_CULL: hgrid_status = -53;

/// An instance names an object that does not exist. The report's `triangle` is the number of the instance.
pub const HGRID_ERROR_INSTANCE_OBJECT: hgrid_status = -60;

/// The matrix of an instance has no inverse that float can hold, is not finite, or takes its object beyond 2^120. The
/// report's `triangle` says which instance.
pub const HGRID_ERROR_INSTANCE_MATRIX: hgrid_status = -61;

/// The instances of a scene name more objects than were brought.
pub const HGRID_ERROR_MISSING_OBJECTS: hgrid_status = -62;

/// More scenes stand inside one another than `HGRID_MAX_NESTING`.
pub const HGRID_ERROR_TOO_DEEP: hgrid_status = -63;

/// The status that stands for an error of core.
pub(crate) const fn status_of(error: Error) -> hgrid_status {
    match error {
        Error::OutOfMemory { region: Region::Index, .. } => HGRID_ERROR_INDEX_TOO_SMALL,
        Error::OutOfMemory { region: Region::Scratch, .. } => HGRID_ERROR_SCRATCH_TOO_SMALL,
        Error::Misaligned { .. } => HGRID_ERROR_MISALIGNED,
        Error::InvalidMesh(MeshField::Positions) => HGRID_ERROR_INVALID_POSITIONS,
        Error::InvalidMesh(MeshField::Indices) => HGRID_ERROR_INVALID_INDICES,
        Error::InvalidMesh(MeshField::Masks) => HGRID_ERROR_INVALID_MASKS,
        Error::InvalidMesh(MeshField::Parts) => HGRID_ERROR_INVALID_PARTS,
        Error::TooManyTriangles => HGRID_ERROR_TOO_MANY_TRIANGLES,
        Error::IndexOutOfRange { .. } => HGRID_ERROR_INDEX_OUT_OF_RANGE,
        Error::NonFiniteTriangle { .. } => HGRID_ERROR_NON_FINITE,
        Error::MethodLeftOut(_) => HGRID_ERROR_METHOD_LEFT_OUT,
        Error::MethodRemoved => HGRID_ERROR_METHOD_REMOVED,
        Error::InvalidConfig(ConfigField::Method) => HGRID_ERROR_INVALID_METHOD,
        Error::InvalidConfig(ConfigField::Density) => HGRID_ERROR_INVALID_DENSITY,
        Error::InvalidConfig(ConfigField::MacrocellFactor) => HGRID_ERROR_INVALID_MACROCELL_FACTOR,
        Error::InvalidConfig(ConfigField::Depth) => HGRID_ERROR_INVALID_DEPTH,
        Error::InvalidConfig(ConfigField::Flags) => HGRID_ERROR_INVALID_FLAGS,
        Error::InvalidParallelFor => HGRID_ERROR_PARALLEL_FOR,
        Error::Cancelled => HGRID_ERROR_CANCELLED,
        Error::NoMesh => HGRID_ERROR_NO_MESH,
        Error::InvalidBatch(BatchField::Rays) => HGRID_ERROR_INVALID_RAYS,
        Error::InvalidBatch(BatchField::Answers) => HGRID_ERROR_INVALID_ANSWERS,
        Error::NotAGrid => HGRID_ERROR_NOT_A_GRID,
        Error::WrongByteOrder => HGRID_ERROR_WRONG_BYTE_ORDER,
        Error::UnsupportedVersion { .. } => HGRID_ERROR_UNSUPPORTED_VERSION,
        Error::Truncated { .. } => HGRID_ERROR_TRUNCATED,
        Error::MeshMismatch => HGRID_ERROR_MESH_MISMATCH,
        Error::CannotRefit => HGRID_ERROR_CANNOT_REFIT,
        Error::OtherContent(_) => HGRID_ERROR_OTHER_CONTENT,
        Error::InstanceWithoutObject { .. } => HGRID_ERROR_INSTANCE_OBJECT,
        Error::InstanceWithoutInverse { .. } => HGRID_ERROR_INSTANCE_MATRIX,
        Error::MissingObjects { .. } => HGRID_ERROR_MISSING_OBJECTS,
        Error::TooDeep => HGRID_ERROR_TOO_DEEP,
        // The enum may grow for Rust callers; here the two crates are always of one version.
        Error::Corrupt { .. } | _ => HGRID_ERROR_CORRUPT,
    }
}

/// Returns what a status means and what to do.
#[expect(clippy::too_many_lines, reason = "one arm a status")]
pub(crate) const fn text(status: hgrid_status) -> &'static CStr {
    match status {
        HGRID_OK => c"success",
        HGRID_ERROR_NULL_ARGUMENT => {
            c"a pointer is NULL that may not be: an argument, an array of the mesh, or the \
              configuration's run where tasks is above 1"
        }
        HGRID_ERROR_STRUCT_SIZE => {
            c"wrong struct_size, or a reserved field that is not 0: use the struct's HGRID_..._INIT macro"
        }
        HGRID_ERROR_MISALIGNED => {
            c"misaligned region: start index, scratch and blob at a multiple of 64 bytes"
        }
        HGRID_ERROR_OVERLAP => {
            c"overlapping memory: keep index, scratch and mesh apart, and answers off their rays"
        }
        HGRID_ERROR_INDEX_TOO_SMALL => {
            c"index, room or views too small: bring the report's index_bytes, or what the call wrote to bytes"
        }
        HGRID_ERROR_SCRATCH_TOO_SMALL => {
            c"scratch too small: bring the report's scratch_bytes, or what the call's description asks for"
        }
        HGRID_ERROR_OUT_OF_MEMORY => {
            c"out of memory: the report says how many bytes index and scratch need"
        }
        HGRID_ERROR_INVALID_POSITIONS => {
            c"invalid positions: check vertex_count, and position_stride (0, or 12 and more); \
              of boxes count, and box_stride (0, or 24 and more)"
        }
        HGRID_ERROR_INVALID_INDICES => {
            c"invalid indices: check triangle_count, and index_stride (0, or three indices and more)"
        }
        HGRID_ERROR_INVALID_INDEX_TYPE => {
            c"unknown index_type: use HGRID_INDEX_U32 or HGRID_INDEX_U16"
        }
        HGRID_ERROR_TOO_MANY_TRIANGLES => {
            c"too many triangles, boxes or instances: a tree takes 2^31, other methods take 4294967294, \
              and memory must have addresses for them"
        }
        HGRID_ERROR_INDEX_OUT_OF_RANGE => {
            c"a vertex number is vertex_count or more (numbers begin at 0): repair the report's triangle"
        }
        HGRID_ERROR_NON_FINITE => {
            c"a coordinate is not finite: repair the report's triangle; a build without \
              HGRID_BUILD_STRICT leaves it out"
        }
        HGRID_ERROR_INVALID_MASKS => c"invalid masks: one for each triangle, and mask_stride 0, or 4 and more",
        HGRID_ERROR_INVALID_PARTS => {
            c"invalid parts: join meshes with arrays of their own by hgrid_join, \
              and change nothing of what it fills"
        }
        HGRID_ERROR_INVALID_METHOD => {
            c"unknown method: use one of HGRID_METHOD_..., for shapes and scenes HGRID_METHOD_BVH"
        }
        HGRID_ERROR_INVALID_DENSITY => {
            c"invalid density: above 0, and lower if the grid would become too fine or too large"
        }
        HGRID_ERROR_INVALID_FLAGS => c"unknown flag: use 0 or HGRID_BUILD_...",
        HGRID_ERROR_INVALID_MACROCELL_FACTOR => c"invalid macrocell_factor: 2 or more, usually 6",
        HGRID_ERROR_INVALID_DEPTH => c"invalid depth: 1 to HGRID_MAX_DEPTH, usually 3",
        HGRID_ERROR_PARALLEL_FOR => {
            c"tasks run twice or not at all: let run call each one once and wait for all of them"
        }
        HGRID_ERROR_CANCELLED => c"cancelled by the progress callback: there is no grid",
        HGRID_ERROR_METHOD_LEFT_OUT => {
            c"a method that this library was built without: take one that it has, or build the library with it"
        }
        HGRID_ERROR_INVALID_QUALITY => c"unknown quality: use one of HGRID_QUALITY_...",
        HGRID_ERROR_NO_MESH => {
            c"a blob without its mesh: bring the mesh it was built for, or pack both with hgrid_pack"
        }
        HGRID_ERROR_INVALID_CULL => c"unknown cull: use one of HGRID_CULL_...",
        HGRID_ERROR_NOT_A_GRID => {
            c"not a grid: the bytes or the view come from no build; build or open one first"
        }
        HGRID_ERROR_WRONG_BYTE_ORDER => {
            c"a blob of the other byte order: build it again on this machine"
        }
        HGRID_ERROR_METHOD_REMOVED => c"a blob of a method that was removed, brick: build it again",
        HGRID_ERROR_UNSUPPORTED_VERSION => c"a blob of another version: build it again",
        HGRID_ERROR_TRUNCATED => c"a truncated blob: bring all of its bytes",
        HGRID_ERROR_MESH_MISMATCH => {
            c"a blob of another mesh, or of a scene with another number of instances; or, in a refit, \
              a triangle that the build left out has finite vertices now: bring what it was built for, \
              or build it again"
        }
        HGRID_ERROR_CANNOT_REFIT => c"a blob that cannot be refitted: only trees can, and before they are packed",
        HGRID_ERROR_OTHER_CONTENT => {
            c"a blob of another kind: open grids with hgrid_open, shapes with hgrid_open_shapes, \
              scenes with hgrid_open_scene, packed scenes with hgrid_open_packed_scene; \
              scenes that show shapes cannot be packed"
        }
        HGRID_ERROR_INSTANCE_OBJECT => {
            c"an instance names an object that does not exist: the report's triangle is its number"
        }
        HGRID_ERROR_INSTANCE_MATRIX => {
            c"an instance is not finite, has no inverse, or lies too far out: \
              repair the one that the report's triangle names"
        }
        HGRID_ERROR_MISSING_OBJECTS => c"too few objects: bring those that the scene was built with",
        HGRID_ERROR_TOO_DEEP => c"too many scenes inside one another: HGRID_MAX_NESTING at most",
        HGRID_ERROR_CORRUPT => {
            c"a damaged blob, or one of another mesh: build it again; or a scene whose objects changed: refit it"
        }
        HGRID_ERROR_INVALID_RAYS => {
            c"invalid rays: check count; stride is 0 or at least sizeof(hgrid_ray), in scenes sizeof(hgrid_ray_f64)"
        }
        HGRID_ERROR_INVALID_ANSWERS => {
            c"invalid answers: check count; stride is 0 or at least the size of an answer"
        }
        HGRID_ERROR_INVALID_COHERENCE => c"unknown coherence: use one of HGRID_COHERENCE_...",
        _ => c"unknown status",
    }
}

/// Says in words what a status means and what to do.
///
/// Never NULL: a number that is no status gives "unknown status". The text is static, in English,
/// without a full stop; programs compare numbers, not texts.
///
/// Threads: any number of calls at once.
#[unsafe(no_mangle)]
pub const extern "C" fn hgrid_status_string(status: hgrid_status) -> *const c_char {
    text(status).as_ptr()
}
