//! The C structs that tell about blobs: the report of a refit, what a header says, statistics.
//!
//! The docs here are the text of `hgrid.h`: they are written for C readers.

use hgrid_core::{BlobInfo, Content, Error, INVALID_ID, Refit, Statistics};

/// Reports what a refit did. Initialise it with `HGRID_REFIT_REPORT_INIT`.
///
/// The costs are those of the surface area heuristic (Goldsmith and Salmon 1987): how many nodes a random line
/// through the box of the tree visits and how many triangles it tests on average, added up.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_refit_report {
    /// `sizeof(hgrid_refit_report)`.
    pub struct_size: u32,
    /// The triangle, shape or instance that is to blame for an error, or `HGRID_INVALID_ID` if the error names none.
    /// `HGRID_ERROR_MESH_MISMATCH` names none.
    pub triangle: u32,
    /// The cost that the tree had; 0 after an error.
    pub cost_before: f64,
    /// The cost that the tree has now; 0 after an error.
    pub cost_after: f64,
}

/// A blob that is built over the triangles of a mesh: `hgrid_open`.
pub const HGRID_CONTENT_TRIANGLES: u32 = 0;

/// A blob that is built over shapes: `hgrid_open_shapes`.
pub const HGRID_CONTENT_SHAPES: u32 = 1;

/// A blob that is built over instances: `hgrid_open_scene`.
pub const HGRID_CONTENT_INSTANCES: u32 = 2;

/// A scene with all that it shows: `hgrid_open_packed_scene`.
pub const HGRID_CONTENT_PACKED_SCENE: u32 = 3;

/// The contents of a blob's header. Initialise it with `HGRID_BLOB_INFO_INIT`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_blob_info {
    /// `sizeof(hgrid_blob_info)`.
    pub struct_size: u32,
    /// The version of the format.
    pub version: u32,
    /// The method that built it: one of `HGRID_METHOD_...`.
    pub method: u32,
    /// 1 if the mesh is in it, as `hgrid_pack` writes it, or all that a scene shows; 0 if not.
    pub has_mesh: u32,
    /// Vertices of its mesh; twice the number of shapes or instances; of a packed scene, the objects that its views
    /// hold.
    pub vertex_count: u64,
    /// Triangles of its mesh; shapes or instances; grids and scenes that a packed scene shows.
    pub triangle_count: u64,
    /// Bytes of the grid.
    pub grid_bytes: u64,
    /// Bytes of all of it: of the grid, and of what is packed with it.
    pub total_bytes: u64,
    /// The kind of its content: one of `HGRID_CONTENT_...`.
    pub content: u32,
    /// 0.
    pub reserved: u32,
}

/// The statistics of a grid and its mesh. Initialise it with `HGRID_STATISTICS_INIT`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_statistics {
    /// `sizeof(hgrid_statistics)`.
    pub struct_size: u32,
    /// Triangles left out because a coordinate is not finite, or beyond 2^120.
    pub skipped_count: u32,
    /// Triangles of which two corners are the same point. They are in
    /// the grid, and no ray hits them.
    pub degenerate_count: u32,
    /// The first skipped or degenerate triangle, or `HGRID_INVALID_ID`.
    pub first_bad: u32,
    /// Lists of triangles: one for each cell that has any; the leaves of a tree.
    pub list_count: u64,
    /// Triangle ids in all lists together.
    pub reference_count: u64,
    /// Ids in the longest list.
    pub longest_list: u32,
    /// 0.
    pub reserved: u32,
    /// A hash of the method, the grid's box, its resolution and its lists in order, but not of the cells that they
    /// belong to. The same grid has the same hash on every platform, whatever its byte order. It does not protect
    /// against forgery.
    pub content_hash: u64,
}

const _: () = assert!(HGRID_CONTENT_TRIANGLES == Content::Triangles as u32);
const _: () = assert!(HGRID_CONTENT_SHAPES == Content::Shapes as u32);
const _: () = assert!(HGRID_CONTENT_INSTANCES == Content::Instances as u32);
const _: () = assert!(HGRID_CONTENT_PACKED_SCENE == Content::Packed as u32);

impl hgrid_refit_report {
    /// The report of a call that did nothing.
    pub(crate) const fn empty(struct_size: u32) -> Self {
        Self { struct_size, triangle: INVALID_ID, cost_before: 0.0, cost_after: 0.0 }
    }

    /// Notes the result of a refit.
    pub(crate) fn note(&mut self, refitted: &Result<Refit, Error>) {
        (self.triangle, self.cost_before, self.cost_after) = match *refitted {
            Ok(Refit { cost_before, cost_after }) => (INVALID_ID, cost_before, cost_after),
            Err(
                Error::IndexOutOfRange { triangle: number }
                | Error::NonFiniteTriangle { triangle: number }
                | Error::InstanceWithoutObject { instance: number }
                | Error::InstanceWithoutInverse { instance: number },
            ) => (number, 0.0, 0.0),
            Err(_) => (INVALID_ID, 0.0, 0.0),
        };
    }
}

impl hgrid_blob_info {
    /// Notes what a blob says.
    pub(crate) fn note(&mut self, info: &BlobInfo) {
        let BlobInfo { version, method, has_mesh, vertex_count, triangle_count, .. } = *info;
        let (has_mesh, triangle_count) = (has_mesh.into(), triangle_count.into());
        let BlobInfo { grid_bytes, total_bytes, content, .. } = *info;
        let (struct_size, method) = (self.struct_size, method as u32);
        *self = Self {
            struct_size,
            version,
            method,
            has_mesh,
            vertex_count,
            triangle_count,
            grid_bytes,
            total_bytes,
            content: content as u32,
            reserved: 0,
        };
    }
}

impl hgrid_statistics {
    /// Notes the statistics that were found.
    pub(crate) fn note(&mut self, found: &Statistics) {
        *self = Self {
            struct_size: self.struct_size,
            skipped_count: found.skipped_count,
            degenerate_count: found.degenerate_count,
            first_bad: found.first_bad,
            list_count: found.list_count,
            reference_count: found.reference_count,
            longest_list: found.longest_list,
            reserved: 0,
            content_hash: found.content_hash,
        };
    }
}
