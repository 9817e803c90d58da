//! The C structs of builds (meshes, configurations, reports, grids), and their conversion to the types of core.
//!
//! The docs here are the text of `hgrid.h`: they are written for C readers.

use core::ffi::c_void;
use core::mem::MaybeUninit;
use core::ptr::{null, null_mut};

use hgrid_core::{
    BuildFlags, Config, Control, Error, Grid, INVALID_ID, IndexType, MAX_TRIANGLES, Method,
    Parameters, Quality, Region, Scene, Sizes, Strided, TriangleMesh, sizes,
};

use crate::raw::parts_of;
use crate::status::{
    HGRID_ERROR_INVALID_FLAGS, HGRID_ERROR_INVALID_INDEX_TYPE, HGRID_ERROR_INVALID_INDICES,
    HGRID_ERROR_INVALID_MASKS, HGRID_ERROR_INVALID_METHOD, HGRID_ERROR_INVALID_POSITIONS,
    HGRID_ERROR_INVALID_QUALITY, HGRID_ERROR_NULL_ARGUMENT, HGRID_ERROR_STRUCT_SIZE,
    HGRID_ERROR_TOO_MANY_TRIANGLES, hgrid_status, status_of,
};

/// The alignment, in bytes, of these: index, every blob, the `views` of `hgrid_open_packed_scene`, and the scratch of
/// builds, `hgrid_sizes` and `hgrid_fit`. All other scratch may start anywhere.
pub const HGRID_ALIGNMENT: usize = 64;

/// The version of the blob format, the same for all methods. A blob of another version is refused:
/// build it again.
pub const HGRID_BLOB_VERSION: u32 = 4;

/// Indices of 32 bits: the default of `hgrid_mesh`.
pub const HGRID_INDEX_U32: u32 = 0;

/// Indices of 16 bits.
pub const HGRID_INDEX_U16: u32 = 1;

/// One hashed grid with a single cell size.
///
/// Choose it where memory is dear and the mesh is large: it takes the least for each triangle. It
/// is at its best where triangles are of similar size and everywhere, and slow where all detail is
/// in a few places of a large scene.
///
/// Memory: `HGRID_INDEX_BOUND_ONE_LEVEL` and `HGRID_SCRATCH_BOUND_ONE_LEVEL` hold for it. The build
/// plans every byte in the scratch before it writes the index.
pub const HGRID_METHOD_ONE_LEVEL: u32 = 1;

/// A hashed grid of many small cells, and above it levels of macrocells, whose bits tell which parts of space are
/// empty.
///
/// Rays cross empty space in large steps, and the small cells hold few triangles each. Among the four grids
/// of the paper it has the shortest time to a first image. `macrocell_factor` belongs to it.
///
/// Memory: one and a half to three times that of one level. The build plans every byte in the
/// scratch before it writes the index.
pub const HGRID_METHOD_FIXED: u32 = 2;

/// A hashed grid whose crowded cells hold hashed grids of their own: subgrids, cut to what is
/// there.
///
/// Choose it where detail is uneven but spread over the scene. Where all of it is in one spot of a
/// large scene, two levels are not enough: choose bvh. `subdivide_above` belongs to it.
///
/// Memory: four to seven times that of one level. The exact size takes a dry run: `hgrid_sizes` without scratch
/// answers with a generous bound, with scratch with the exact size.
pub const HGRID_METHOD_VARIABLE: u32 = 3;

/// Grids in the cells of grids, not hashed, as in the Manta ray tracer: what hashed grids are
/// compared with.
///
/// Of the four grids of the paper it has the fewest ray-triangle tests, and the longest build in the most memory by
/// far. Choose it to compare, or for a mesh that never changes where memory does not matter. `depth` belongs to it.
///
/// Memory: ten to thirteen times that of one level on scans, and about 530 bytes of scratch for each triangle. The
/// exact size takes a dry run. `hgrid_sizes` without scratch answers with a bound that no mesh comes near, up to 8
/// GiB: ask with scratch, which gives the exact size.
pub const HGRID_METHOD_RECURSIVE: u32 = 4;

/// A bounding volume hierarchy: each triangle lies in one leaf, and a node has up to eight children with tight boxes.
///
/// It is the default, for all rays and all scenes, with the smallest bound that is known before the build. `quality`
/// belongs to it. It has no cells, so `density` means nothing to it, and its resolution is 1 x 1 x 1.
///
/// Memory: on scans about 9 bytes a triangle. What it takes at most depends on the number of triangles
/// alone and is less than twice that: `HGRID_INDEX_BOUND` and `HGRID_SCRATCH_BOUND` hold for it
/// (`HGRID_BVH_HIGH_SCRATCH_BOUND` with `HGRID_QUALITY_HIGH`). `hgrid_sizes` without scratch answers with that
/// bound; with scratch it gives the exact size. With several tasks it answers with the bound in either case,
/// because tasks fill their parts of the index side by side. In a smaller index one task builds. A tree has no
/// more than 2^31 triangles.
///
/// The number 5 belonged to a method that was removed, and is not used again.
pub const HGRID_METHOD_BVH: u32 = 6;

/// The quality of a tree by default: the shortest build, in which triangles are binned by their centres and the
/// surface area heuristic (SAH) chooses the nodes above small groups of them.
///
/// Choose it for scenes that change, and for the first image.
pub const HGRID_QUALITY_FAST: u32 = 0;

/// The quality of a tree that is built with SAH at every node, down to single triangles.
///
/// Choose it for a scene that is traced for long. Most rays are answered sooner and the index is smaller; the build
/// takes several times as long. Measure it in architecture, where some rays take longer. It takes about 32 bytes of
/// scratch a triangle, whatever the number of tasks: `HGRID_INDEX_BOUND` and `HGRID_BVH_HIGH_SCRATCH_BOUND` hold for
/// it. All queries answer as with the other quality, and the blob has the same format.
pub const HGRID_QUALITY_HIGH: u32 = 1;

/// The most levels of a recursive grid.
pub const HGRID_MAX_DEPTH: u32 = 4;

/// A build flag: refuse a mesh with a triangle that is not finite, instead of leaving it out.
pub const HGRID_BUILD_STRICT: u32 = 1;

/// The most tasks that a parallel build runs at once.
pub const HGRID_MAX_TASKS: u32 = 64;

/// The value that `progress` of `hgrid_config` gets when the build is done.
pub const HGRID_PROGRESS_END: u32 = 1000;

const _: () = assert!(HGRID_ALIGNMENT == hgrid_core::ALIGNMENT);
const _: () = assert!(HGRID_BLOB_VERSION == hgrid_core::BLOB_VERSION);
const _: () = assert!(HGRID_METHOD_ONE_LEVEL == Method::OneLevel as u32);
const _: () = assert!(HGRID_METHOD_FIXED == Method::Fixed as u32);
const _: () = assert!(HGRID_METHOD_VARIABLE == Method::Variable as u32);
const _: () = assert!(HGRID_METHOD_RECURSIVE == Method::Recursive as u32);
const _: () = assert!(HGRID_METHOD_BVH == Method::Bvh as u32);
const _: () = assert!(HGRID_QUALITY_FAST == Quality::Fast as u32);
const _: () = assert!(HGRID_QUALITY_HIGH == Quality::High as u32);
const _: () = assert!(HGRID_MAX_DEPTH == hgrid_core::MAX_DEPTH);
const _: () = assert!(HGRID_MAX_TASKS == Control::MAX_TASKS);
const _: () = assert!(HGRID_BUILD_STRICT == BuildFlags::STRICT.bits());

/// A triangle mesh in the caller's memory. Initialise it with `HGRID_MESH_INIT`.
///
/// The arrays are read where they lie, never copied and never changed. The library reads nothing behind the
/// numbers of the last element. They need no alignment, so all may be fields of the caller's structs. The
/// bytes between two vertices may be read, and have no influence. Nobody may write them during a call: so
/// a batch's answers may not lie there.
///
/// Blob and view refer to the mesh: it stays unchanged for as long as the grid is queried. The
/// struct itself is only read during the call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_mesh {
    /// `sizeof(hgrid_mesh)`.
    pub struct_size: u32,
    /// `HGRID_INDEX_U32` or `HGRID_INDEX_U16`. The library cannot check that it fits the array.
    pub index_type: u32,
    /// The first vertex: three floats x, y, z, in scene units. NULL only without vertices.
    pub positions: *const c_void,
    /// Bytes from one vertex to the next, at least 12; 0 means 12.
    pub position_stride: usize,
    /// Number of vertices.
    pub vertex_count: usize,
    /// The first triangle: three vertex numbers, from 0. NULL only without triangles.
    pub indices: *const c_void,
    /// Bytes from one triangle to the next, at least three indices; 0 means exactly three indices.
    pub index_stride: usize,
    /// Number of triangles, a third of the number of indices: at most 2^31 for a tree, 4294967294 for other methods.
    pub triangle_count: usize,
    /// The first triangle's mask, a `uint32_t`, or NULL: queries with a mask of their own see a
    /// triangle if both have a bit in common. NULL means that every triangle has all bits.
    pub masks: *const c_void,
    /// Bytes from one mask to the next, at least 4; 0 means 4.
    pub mask_stride: usize,
    /// The meshes that `hgrid_join` made this one of, or NULL. With them there are no arrays, and nothing is set by
    /// hand.
    pub parts: *const hgrid_part,
    /// Number of parts.
    pub part_count: usize,
}

/// Memory for one of the meshes that `hgrid_join` joins. It is the caller's, as the mesh is.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_part {
    /// Private; it may hold anything before the call.
    pub opaque: [MaybeUninit<u64>; 24],
}

/// The configuration of a build: the method with its parameters, tasks and progress. Initialise it with
/// `HGRID_CONFIG_INIT`, which is also what NULL means, or with the macro of another method:
/// `HGRID_CONFIG_INIT_ONE_LEVEL`, `_FIXED`, `_VARIABLE`, `_RECURSIVE`.
///
/// Each macro sets all fields: to the paper's values, or to hgrid's own where the paper gives none. To change the
/// method later, set `method` and `density`: fields of other methods are ignored.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_config {
    /// `sizeof(hgrid_config)`.
    pub struct_size: u32,
    /// The structure to build: one of `HGRID_METHOD_...`, each of which says when to choose it.
    pub method: u32,
    /// Cells per triangle, above 0: 4 for one level and variable, 32 for fixed, 8 for recursive.
    /// More cells mean fewer tests, more steps, more memory. `HGRID_METHOD_BVH` has no cells
    /// and does not look at it.
    pub density: f32,
    /// For `HGRID_METHOD_FIXED`: cells of a level in one macrocell of the level above, on each
    /// axis; 2 or more, usually 6.
    pub macrocell_factor: u32,
    /// For `HGRID_METHOD_VARIABLE`: a cell with more triangles than this gets a subgrid, if that
    /// separates them; any number, usually 16.
    pub subdivide_above: u32,
    /// For `HGRID_METHOD_RECURSIVE`: levels of grids, 1 to `HGRID_MAX_DEPTH`, usually 3.
    pub depth: u32,
    /// 0. Another number is `HGRID_ERROR_STRUCT_SIZE`.
    pub reserved: u32,
    /// 0 or `HGRID_BUILD_STRICT`.
    pub flags: u32,
    /// For `HGRID_METHOD_BVH`: the most tasks that run at once, usually the number of cores. With `HGRID_QUALITY_FAST`
    /// each needs scratch, which `hgrid_bound` and `hgrid_sizes` include and `HGRID_SCRATCH_BOUND` does not; with less
    /// scratch the build runs fewer tasks, down to one. 0 and 1 mean a serial build; a number above `HGRID_MAX_TASKS`
    /// counts as `HGRID_MAX_TASKS`. Above 1 `run` may not be NULL, not even for `hgrid_bound` and `hgrid_fit`, which do
    /// not call it. The other methods build on the calling thread and ignore `tasks` and `run`.
    pub tasks: u32,
    /// For `HGRID_METHOD_BVH`: `HGRID_QUALITY_FAST`, which is 0, or `HGRID_QUALITY_HIGH`. The other methods do not
    /// look at it.
    pub quality: u32,
    /// Yours: passed on to `run` and `progress`.
    pub context: *mut c_void,
    /// Calls `task(task_context, index)` once for every `index` below `count`, in any order, on any
    /// threads, and returns when all these calls have returned: after a join, or after any other
    /// synchronisation by which the thread that leaves `run` sees what the other ones wrote. The
    /// library calls it on the thread that builds, with counts from 2 to `tasks`: several times, one
    /// after the other, or never: where the mesh or the scratch is small, on microcontrollers, and on processors
    /// without atomic operations. May be NULL with `tasks` 0 or 1, and with other methods. `hgrid_build` has
    /// an example.
    ///
    /// A task that is called twice, even at the same time, one that is never called, and an index
    /// that is not below `count` do no harm: the build ends with `HGRID_ERROR_PARALLEL_FOR`.
    /// The following cannot be detected and are undefined behaviour: a call of `task` that is made or still
    /// running after `run` has returned, or that gets another `task_context`; a `run` that is left by
    /// `longjmp` or by a C++ exception; a `run` that changes the mesh or the regions of the build.
    pub run: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            count: u32,
            task: hgrid_task,
            task_context: *mut c_void,
        ),
    >,
    /// Gets how much of a build is `done`, in thousandths from 0 to `HGRID_PROGRESS_END`, and returns true
    /// to continue or false to cancel. May be NULL. It is called on the thread that builds, a few times to
    /// a few hundred times. `done` grows from call to call; the last call of a build that succeeds gets
    /// `HGRID_PROGRESS_END`, and its result is ignored. After false the build ends with
    /// `HGRID_ERROR_CANCELLED`, after the current pass over the mesh at the latest. Calls are not spread
    /// evenly: there is none while several tasks run, or while a tree of `HGRID_QUALITY_HIGH` gets its top
    /// nodes. Each may take most of the time of a build. The callback may query and build other grids. It
    /// must not touch the regions of this build, change its mesh, or be left by `longjmp` or by a C++ exception.
    pub progress: Option<unsafe extern "C" fn(context: *mut c_void, done: u32) -> bool>,
}

/// A part of a build, as `run` of a `hgrid_config` gets it: a function of this library.
///
/// It may be called on any thread, on several at once, with the `task_context` that came
/// with it and an `index` below the `count` that came with it. It starts no thread,
/// waits for none, and never jumps out.
#[allow(non_camel_case_types, reason = "the C name")]
pub type hgrid_task = unsafe extern "C" fn(task_context: *mut c_void, index: u32);

/// The results of a build, or of a call that computes sizes. Initialise it with `HGRID_REPORT_INIT`.
///
/// Every call that takes a report sets all fields but `struct_size`, whether it succeeds or fails.
/// Fields that the call does not compute become 0, and `triangle` becomes `HGRID_INVALID_ID`.
/// `hgrid_inspect` has the statistics that take another pass over mesh and grid: triangles with two
/// equal corners, the first bad triangle, the longest list, a hash of the content.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_report {
    /// `sizeof(hgrid_report)`.
    pub struct_size: u32,
    /// 1 if `index_bytes` is what the index region needs, to the byte; 0 if it is only enough. After a
    /// build it is 1, and `index_bytes` is the size of the blob.
    pub is_exact: u32,
    /// Bytes that the index region needs; after a build, the size of the blob.
    pub index_bytes: u64,
    /// Bytes that the scratch region needs: exact for `HGRID_METHOD_ONE_LEVEL` and `HGRID_METHOD_FIXED`, and enough,
    /// not always exact, for the others. After a build with several tasks, whether it succeeds or fails, it is the need
    /// of a build with one task.
    pub scratch_bytes: u64,
    /// The first triangle that is to blame for the error, or `HGRID_INVALID_ID`. Of joined meshes it is counted
    /// through all of them.
    pub triangle: u32,
    /// Triangles left out because a coordinate is not finite, or beyond 2^120. Known
    /// after a build, as are all below.
    pub skipped_count: u32,
    /// Triangle ids in all cells or leaves together; for `HGRID_METHOD_VARIABLE` and
    /// `HGRID_METHOD_RECURSIVE` the words of 4 bytes that ids and subgrids take together.
    pub reference_count: u32,
    /// The density of the outermost grid: what was asked for, or a half, a quarter, ... of it where
    /// the mesh would have needed more than 16 references for each triangle. 0 for
    /// `HGRID_METHOD_BVH`, which has none.
    pub density: f32,
    /// Cells of the outermost grid on each axis, or of the finest level under macrocells; 1 for
    /// `HGRID_METHOD_BVH`.
    pub resolution: [u32; 3],
    /// 0.
    pub reserved: u32,
}

/// A built grid and its mesh, ready for queries: a view, held by value.
///
/// It owns nothing, so there is nothing to close or free, and it can be copied by assignment. It
/// holds the addresses of blob and mesh and is good for as long as both stay where they are,
/// unchanged. It means nothing in another process or a file: store the blob instead, and open it
/// there. A view that is all zero is recognised and answers every query with a miss.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_grid {
    /// Private; some of its bytes may never have been written.
    pub opaque: [MaybeUninit<u64>; 64],
}

impl hgrid_grid {
    /// The view of no grid.
    pub const NONE: Self = Self { opaque: [MaybeUninit::zeroed(); 64] };
}

impl hgrid_config {
    /// The defaults, which NULL means.
    #[expect(clippy::cast_possible_truncation, reason = "64 bytes")]
    pub(crate) const DEFAULT: Self = Self {
        struct_size: size_of::<Self>() as u32,
        method: HGRID_METHOD_BVH,
        density: 4.0,
        macrocell_factor: 6,
        subdivide_above: 16,
        depth: 3,
        reserved: 0,
        flags: 0,
        tasks: 1,
        quality: HGRID_QUALITY_FAST,
        context: null_mut(),
        run: None,
        progress: None,
    };

    /// Notes how much memory is enough for so many triangles.
    pub(crate) fn bound(
        self,
        triangle_count: usize,
        report: &mut hgrid_report,
    ) -> Result<(), hgrid_status> {
        let (config, tasks) = (self.to_core()?, self.task_count()?);
        // With an empty mesh only the configuration can be wrong.
        let nothing = TriangleMesh::new(&[], &[]).map_err(status_of)?;
        sizes(&nothing, &config, &mut []).map_err(status_of)?;
        let count = u32::try_from(triangle_count).ok().filter(|&c| c as usize <= MAX_TRIANGLES);
        let bound = count.and_then(|count| Sizes::bound_parallel(count, &config, tasks));
        report.note_sizes(&bound.ok_or(HGRID_ERROR_TOO_MANY_TRIANGLES)?);
        Ok(())
    }

    /// Notes how much memory is enough for a scene of so many instances.
    pub(crate) fn scene_bound(
        self,
        instance_count: usize,
        report: &mut hgrid_report,
    ) -> Result<(), hgrid_status> {
        let (config, tasks) = (self.to_core()?, self.task_count()?);
        if config.method() != Method::Bvh {
            return Err(HGRID_ERROR_INVALID_METHOD);
        }
        // Noted last: after an error the report is empty.
        let mut of_tree = hgrid_report::empty(report.struct_size);
        self.bound(instance_count, &mut of_tree)?;
        let count = u32::try_from(instance_count).ok();
        let bound = count.and_then(|count| Scene::bound_parallel(count, &config, tasks));
        report.note_sizes(&bound.ok_or(HGRID_ERROR_TOO_MANY_TRIANGLES)?);
        Ok(())
    }

    /// Returns the number of tasks that may run at once; more than one need `run`. The other methods
    /// have none, and a field of another method is not looked at.
    pub(crate) const fn task_count(&self) -> Result<u32, hgrid_status> {
        match (self.method, self.tasks, self.run) {
            (HGRID_METHOD_BVH, 2.., None) => Err(HGRID_ERROR_NULL_ARGUMENT),
            (HGRID_METHOD_BVH, tasks, _) => Ok(tasks),
            _ => Ok(1),
        }
    }

    /// The configuration as core knows it. Core checks the numbers.
    pub(crate) fn to_core(self) -> Result<Config, hgrid_status> {
        let Self { density, macrocell_factor, subdivide_above, depth, .. } = self;
        if self.reserved != 0 {
            return Err(HGRID_ERROR_STRUCT_SIZE);
        }
        // Report a wrong quality only if method and flags are right.
        let quality = Quality::from_u32(self.quality).ok_or(HGRID_ERROR_INVALID_QUALITY);
        let parameters = match self.method {
            HGRID_METHOD_ONE_LEVEL => Ok(Parameters::OneLevel { density }),
            HGRID_METHOD_FIXED => Ok(Parameters::Fixed { density, macrocell_factor }),
            HGRID_METHOD_VARIABLE => Ok(Parameters::Variable { density, subdivide_above }),
            HGRID_METHOD_RECURSIVE => Ok(Parameters::Recursive { density, depth }),
            HGRID_METHOD_BVH => quality.map(|quality| Parameters::Bvh { quality }),
            _ => return Err(HGRID_ERROR_INVALID_METHOD),
        };
        let flags = BuildFlags::from_bits(self.flags).ok_or(HGRID_ERROR_INVALID_FLAGS)?;
        Ok(Config { parameters: parameters?, flags })
    }
}

impl hgrid_report {
    /// The report of a call that found out nothing.
    pub(crate) const fn empty(struct_size: u32) -> Self {
        Self {
            struct_size,
            is_exact: 0,
            index_bytes: 0,
            scratch_bytes: 0,
            triangle: INVALID_ID,
            skipped_count: 0,
            reference_count: 0,
            density: 0.0,
            resolution: [0; 3],
            reserved: 0,
        }
    }

    /// Notes what a build needs.
    pub(crate) fn note_sizes(&mut self, sizes: &Sizes) {
        self.is_exact = sizes.is_exact.into();
        self.index_bytes = sizes.index_bytes as u64;
        self.scratch_bytes = sizes.scratch_bytes as u64;
    }

    /// Notes what was built.
    pub(crate) fn note_grid(&mut self, grid: &Grid<'_>) {
        self.is_exact = 1;
        self.index_bytes = grid.blob_bytes() as u64;
        self.scratch_bytes = grid.scratch_bytes();
        self.skipped_count = grid.skipped_count();
        self.reference_count = grid.reference_count();
        self.density = grid.config().parameters.density().unwrap_or(0.0);
        self.resolution = grid.resolution();
    }

    /// Notes what a build over shapes or instances made.
    pub(crate) const fn note_built(&mut self, blob: &[u8], bound: Option<Sizes>) {
        self.is_exact = 1;
        self.index_bytes = blob.len() as u64;
        self.resolution = [1; 3];
        if let Some(sizes) = bound {
            self.scratch_bytes = sizes.scratch_bytes as u64;
        }
    }

    /// Notes the error of a build over shapes or instances, and for the other region what is always enough.
    pub(crate) const fn note_unbuilt(
        &mut self,
        error: Error,
        bound: Option<Sizes>,
    ) -> hgrid_status {
        if let (Error::OutOfMemory { .. }, Some(sizes)) = (&error, bound) {
            self.index_bytes = sizes.index_bytes as u64;
            self.scratch_bytes = sizes.scratch_bytes as u64;
        }
        self.note_error(error)
    }

    /// Notes what was missing or which triangle is to blame, and passes the error on.
    pub(crate) const fn note_error(&mut self, error: Error) -> hgrid_status {
        match error {
            Error::OutOfMemory { region: Region::Index, needed_bytes, .. } => {
                self.index_bytes = needed_bytes;
            }
            Error::OutOfMemory { region: Region::Scratch, needed_bytes, .. } => {
                self.scratch_bytes = needed_bytes;
            }
            Error::IndexOutOfRange { triangle: number }
            | Error::NonFiniteTriangle { triangle: number }
            | Error::InstanceWithoutObject { instance: number }
            | Error::InstanceWithoutInverse { instance: number } => self.triangle = number,
            _ => {}
        }
        status_of(error)
    }
}

/// The place of the elements of one of the caller's arrays: numbers, nothing is read yet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Elements {
    pub(crate) start: *const c_void,
    pub(crate) stride: usize,
    pub(crate) count: usize,
    /// From the first element's first byte to the last element's last.
    pub(crate) bytes: usize,
}

impl Elements {
    /// `None` if the elements do not fit into memory.
    pub(crate) fn new(
        start: *const c_void,
        stride: usize,
        count: usize,
        size: usize,
    ) -> Option<Self> {
        let stride = if stride == 0 { size } else { stride };
        let bytes = match count.checked_sub(1) {
            Some(last) => last.checked_mul(stride)?.checked_add(size)?,
            None => 0,
        };
        isize::try_from(bytes).ok()?;
        Some(Self { start, stride, count, bytes })
    }
}

impl hgrid_mesh {
    /// Notes where a mesh lies.
    pub(crate) fn note(&mut self, mesh: &TriangleMesh<'_>) {
        let start = |array: &Strided<'_>| {
            if array.count > 0 { array.bytes.as_ptr().cast() } else { null() }
        };
        let (positions, indices, masks) = (mesh.positions(), mesh.triangles(), mesh.masks());
        *self = Self {
            struct_size: self.struct_size,
            index_type: match mesh.index_type() {
                IndexType::U32 => HGRID_INDEX_U32,
                IndexType::U16 => HGRID_INDEX_U16,
            },
            positions: start(&positions),
            position_stride: positions.stride,
            vertex_count: positions.count,
            indices: start(&indices),
            index_stride: indices.stride,
            triangle_count: indices.count,
            masks: start(&masks),
            mask_stride: masks.stride,
            parts: parts_of(mesh),
            part_count: mesh.parts().len(),
        };
        if self.has_parts() {
            self.vertex_count = mesh.vertex_count();
            self.triangle_count = mesh.triangle_count() as usize;
        }
    }

    /// Returns true if it is made of others.
    pub(crate) const fn has_parts(&self) -> bool {
        !self.parts.is_null() || self.part_count > 0
    }

    /// The width of the indices.
    pub(crate) fn index_type(&self) -> Result<IndexType, hgrid_status> {
        match self.index_type {
            HGRID_INDEX_U32 => Ok(IndexType::U32),
            HGRID_INDEX_U16 => Ok(IndexType::U16),
            _ => Err(HGRID_ERROR_INVALID_INDEX_TYPE),
        }
    }

    /// The vertices.
    pub(crate) fn position_elements(&self) -> Result<Elements, hgrid_status> {
        let Self { positions, position_stride, vertex_count, .. } = *self;
        Elements::new(positions, position_stride, vertex_count, size_of::<[f32; 3]>())
            .ok_or(HGRID_ERROR_INVALID_POSITIONS)
    }

    /// The triangles. Their number is checked first: no array of too many would fit into memory.
    pub(crate) fn index_elements(&self) -> Result<Elements, hgrid_status> {
        let Self { indices, index_stride, triangle_count, .. } = *self;
        let size = match self.index_type()? {
            IndexType::U32 => size_of::<[u32; 3]>(),
            IndexType::U16 => size_of::<[u16; 3]>(),
        };
        if triangle_count > MAX_TRIANGLES {
            return Err(HGRID_ERROR_TOO_MANY_TRIANGLES);
        }
        Elements::new(indices, index_stride, triangle_count, size)
            .ok_or(HGRID_ERROR_INVALID_INDICES)
    }

    /// The masks; none if there are none.
    pub(crate) fn mask_elements(&self) -> Result<Elements, hgrid_status> {
        let Self { masks, mask_stride, triangle_count, .. } = *self;
        let count = if masks.is_null() { 0 } else { triangle_count };
        Elements::new(masks, mask_stride, count, size_of::<u32>())
            .filter(|elements| count == 0 || elements.stride >= size_of::<u32>())
            .ok_or(HGRID_ERROR_INVALID_MASKS)
    }
}
