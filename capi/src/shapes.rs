//! Trees over the boxes of the caller's own shapes.

use core::ffi::c_void;
use core::mem::MaybeUninit;
use core::ptr::NonNull;

use hgrid_core::{QueryOptions, ShapeHit, ShapeTest, Shapes};

use crate::addresses::RawRegion;
use crate::blob_types::hgrid_refit_report;
use crate::query_types::{self, hgrid_coherence, hgrid_hit, hgrid_query_options, hgrid_ray};
use crate::raw;
use crate::raw::BatchArrays;
use crate::status::{HGRID_ERROR_NULL_ARGUMENT, HGRID_OK, hgrid_status};
use crate::types::{hgrid_config, hgrid_report};

/// The hit of a ray on a shape, as the caller's test says: 12 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_shape_hit {
    /// Distance in multiples of the ray's direction.
    pub t: f32,
    /// Yours: handed on in the hit.
    pub u: f32,
    /// Yours: handed on in the hit.
    pub v: f32,
}

/// The boxes of your own shapes (spheres, curves, height fields) and the test for them. Initialise it with
/// `HGRID_BOXES_INIT`.
///
/// The arrays are read where they lie, as those of a mesh, and stay unchanged for as long as the tree is queried. What
/// `context` points to must be there as long, too. The struct itself is only read during the call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_boxes {
    /// `sizeof(hgrid_boxes)`.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// The first box: six floats, two opposite corners, x, y, z each. It should hold all of its shape. A box with a
    /// number that is not finite, or beyond 2^120, leaves its shape out. NULL only without boxes.
    pub boxes: *const c_void,
    /// Bytes from one box to the next, at least 24; 0 means 24.
    pub box_stride: usize,
    /// Number of boxes, at most 2^31.
    pub count: usize,
    /// The first shape's mask, a `uint32_t`, or NULL, as those of a mesh.
    pub masks: *const c_void,
    /// Bytes from one mask to the next, at least 4; 0 means 4.
    pub mask_stride: usize,
    /// Tests a shape: writes `hit` and returns true if `ray` hits shape number `shape`. May be NULL: then nothing is
    /// hit.
    ///
    /// `ray` has the range that is left: `t_max` is that of the closest hit so far. An answer outside this range,
    /// infinite or NaN is no hit. The test is called on the thread that queries, on several at once if several query,
    /// for shapes whose box the ray meets and perhaps some others, roughly front to back, and for each shape at most
    /// once for each ray. It may query this tree and others, and must not be left by `longjmp` or by a C++ exception.
    pub test: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            shape: u32,
            ray: *const hgrid_ray,
            hit: *mut hgrid_shape_hit,
        ) -> bool,
    >,
    /// Yours: passed on to `test`.
    pub context: *mut c_void,
}

/// A built tree of shapes, their boxes and their test, ready for queries: a view, held by value as a `hgrid_grid`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_shapes {
    /// Private; some of its bytes may never have been written.
    pub opaque: [MaybeUninit<u64>; 64],
}

impl hgrid_shapes {
    /// The view of no shapes.
    pub const NONE: Self = Self { opaque: [MaybeUninit::zeroed(); 64] };
}

impl From<hgrid_shape_hit> for ShapeHit {
    fn from(hgrid_shape_hit { t, u, v }: hgrid_shape_hit) -> Self {
        Self { t, u, v }
    }
}

/// Builds a tree over the boxes of your own shapes: `hgrid_build` for shapes.
///
/// Memory is that of a build of as many triangles: `HGRID_INDEX_BOUND`, `HGRID_SCRATCH_BOUND`, `hgrid_bound`. The
/// method is `HGRID_METHOD_BVH`; quality, tasks and progress are as for a mesh.
///
/// `boxes` and `shapes` may not be NULL; `config` may be: the defaults. `index` and `scratch` may be NULL if their size
/// is 0. `report` may be NULL.
/// Returns `HGRID_OK` and writes the view to `shapes`; or returns the reason and leaves `shapes` as it was:
/// - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_MISALIGNED`,
///   `HGRID_ERROR_OVERLAP`;
/// - with the boxes: `HGRID_ERROR_INVALID_POSITIONS`, `HGRID_ERROR_INVALID_MASKS`,
///   `HGRID_ERROR_TOO_MANY_TRIANGLES`, `HGRID_ERROR_NON_FINITE` with `HGRID_BUILD_STRICT`;
/// - with the configuration: `HGRID_ERROR_INVALID_METHOD`, also for another method than bvh, and what
///   `hgrid_build` returns;
/// - with the memory: `HGRID_ERROR_INDEX_TOO_SMALL`, `HGRID_ERROR_SCRATCH_TOO_SMALL`.
///
/// The report is written in both cases; its `triangle` is the number of a shape.
///
/// Threads: as for `hgrid_build`.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_build_shapes(
    boxes: *const hgrid_boxes,
    config: *const hgrid_config,
    index: *mut c_void,
    index_bytes: usize,
    scratch: *mut c_void,
    scratch_bytes: usize,
    shapes: *mut hgrid_shapes,
    report: *mut hgrid_report,
) -> hgrid_status {
    let index = RawRegion { start: index, bytes: index_bytes };
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    let call = |report: &mut hgrid_report| {
        let to = NonNull::new(shapes).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        unsafe { raw::build_shapes(boxes, config, [index, scratch], to, report) }
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting(report, call) }
}

/// Opens a tree of shapes that was built earlier: `hgrid_open` for shapes.
///
/// No argument may be NULL. Returns `HGRID_OK` and writes the view to `shapes`; or returns what `hgrid_open` returns
/// (`HGRID_ERROR_OTHER_CONTENT` for a blob that is no tree of shapes), or `HGRID_ERROR_INVALID_POSITIONS` and
/// `HGRID_ERROR_INVALID_MASKS` for the boxes, and leaves `shapes` as it was.
///
/// Threads: any number of calls at once, also on the same blob, each with a view of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_open_shapes(
    blob: *const c_void,
    blob_bytes: usize,
    boxes: *const hgrid_boxes,
    shapes: *mut hgrid_shapes,
) -> hgrid_status {
    let (false, Some(to)) = (blob.is_null(), NonNull::new(shapes)) else {
        return HGRID_ERROR_NULL_ARGUMENT;
    };
    // SAFETY: the caller's promise.
    unsafe { raw::open_shapes(blob, blob_bytes, boxes, to) }.err().unwrap_or(HGRID_OK)
}

/// Gives a tree of shapes the boxes of shapes that moved: `hgrid_refit` for shapes.
///
/// `boxes`, `blob` and `shapes` may not be NULL; `report` may be. Returns `HGRID_OK` and writes the view to
/// `shapes`, or returns what `hgrid_refit` returns, and blob and `shapes` are as they were.
///
/// Threads: as for `hgrid_refit`.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_refit_shapes(
    boxes: *const hgrid_boxes,
    blob: *mut c_void,
    blob_bytes: usize,
    shapes: *mut hgrid_shapes,
    report: *mut hgrid_refit_report,
) -> hgrid_status {
    let blob = RawRegion { start: blob, bytes: blob_bytes };
    let call = |report: &mut hgrid_refit_report| {
        let to = NonNull::new(shapes).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        unsafe { raw::refit_shapes(boxes, blob, to, report) }
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting_refit(report, call) }
}

/// Proves that a blob is a tree of its boxes: `hgrid_validate` for shapes, in `HGRID_VALIDATE_BOUND(count)` bytes of
/// scratch.
///
/// Returns `HGRID_OK`, `HGRID_ERROR_CORRUPT`, `HGRID_ERROR_SCRATCH_TOO_SMALL`, `HGRID_ERROR_NOT_A_GRID` for a view of
/// zeros (`HGRID_SHAPES_INIT`), `HGRID_ERROR_OVERLAP` for scratch in the tree, its boxes, masks or view, or
/// `HGRID_ERROR_NULL_ARGUMENT`.
///
/// Threads: any number of calls and queries on the same tree at once, each with scratch of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_validate_shapes(
    shapes: *const hgrid_shapes,
    scratch: *mut c_void,
    scratch_bytes: usize,
) -> hgrid_status {
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    // SAFETY: the caller's promise.
    unsafe { raw::validate_shapes(shapes, scratch) }.err().unwrap_or(HGRID_OK)
}

/// Finds the closest shape that a ray hits.
///
/// Returns true and writes `hit`, with the number of the shape as `primitive` and `t`, `u` and `v` as the test said;
/// or returns false and writes nothing. Where several shapes are hit at the same `t`, the one with the lowest number
/// is reported. Of the options `mask`, `skip` and `counters` are used; `cull` and `filter` are ignored. `options` may
/// be NULL. With another NULL, a view of zeros, a tree without a test, or options that break the rules for structs
/// nothing is hit.
///
/// The test for discs that lie flat:
///
/// ```c
/// typedef struct {
///     float x, y, z, radius;
/// } disc;
///
/// static bool meets_disc(void *context, uint32_t shape, const hgrid_ray *ray, hgrid_shape_hit *hit)
/// {
///     const disc *d = (const disc *)context + shape;
///     const float t = (d->z - ray->origin[2]) / ray->direction[2];
///     const float x = ray->origin[0] + t * ray->direction[0] - d->x;
///     const float y = ray->origin[1] + t * ray->direction[1] - d->y;
///     hit->t = t, hit->u = x, hit->v = y;
///     return x * x + y * y <= d->radius * d->radius;
/// }
/// ```
///
/// Threads: any number of queries on the same tree at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_intersect_shapes(
    shapes: *const hgrid_shapes,
    ray: *const hgrid_ray,
    options: *const hgrid_query_options,
    hit: *mut hgrid_hit,
) -> bool {
    let Some(to) = NonNull::new(hit) else { return false };
    // SAFETY: the caller's promise.
    let Ok(Some(found)) = (unsafe { raw::query_shapes(shapes, ray, options, false) }) else {
        return false;
    };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to, found.into()) };
    true
}

/// Tells whether a ray hits any shape: what `hgrid_intersect_shapes` would return, but faster.
///
/// `options` may be NULL. With another NULL, and in all cases in which that function hits nothing, the answer is false.
///
/// Threads: any number of queries on the same tree at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluded_shapes(
    shapes: *const hgrid_shapes,
    ray: *const hgrid_ray,
    options: *const hgrid_query_options,
) -> bool {
    // SAFETY: the caller's promise.
    matches!(unsafe { raw::query_shapes(shapes, ray, options, true) }, Ok(Some(_)))
}

/// Finds the closest shape that each of many rays hits: what `hgrid_intersect_shapes` would find for each, bit for
/// bit, and sooner for rays near each other.
///
/// It is to shapes what `hgrid_intersect_n` is to a grid, and the rules for arrays, strides and coherence are the
/// same. A miss writes a hit, too. The test gets one ray and one shape at a time, each pair at most once; calls for
/// different rays alternate. It runs on the thread that calls.
///
/// ```c
/// static size_t trace_tile_of_shapes(const hgrid_shapes *shapes, const hgrid_ray rays[64], hgrid_hit hits[64])
/// {
///     size_t found = 0;
///     if (hgrid_intersect_shapes_n(shapes, rays, 0, hits, 0, 64, HGRID_COHERENCE_COHERENT, NULL) != HGRID_OK)
///         return 0;
///     for (size_t i = 0; i < 64; i++)
///         found += hits[i].primitive != HGRID_INVALID_ID;
///     return found;
/// }
/// ```
///
/// Of the options `mask`, `skip`, `counters` and `scratch` are used; with counters the rays are traced one by one.
///
/// With `count` 0 the arguments are checked and nothing is traced. Rays are read and hits are written in any order,
/// and a ray perhaps more than once, before its hit is written. `rays` and `hits` may be NULL if `count` is 0.
/// `options` may be NULL: the defaults. They are for all rays.
///
/// Returns `HGRID_OK` and has written all hits, or returns what `hgrid_intersect_n` returns and has written none;
/// `HGRID_ERROR_OVERLAP` also for `scratch` in the view, the blob or the boxes. A tree without a test hits nothing.
///
/// The call allocates nothing and needs at most 40 KiB of stack, and what the test needs.
///
/// Threads: any number of queries on the same tree at once; each thread with hits and counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_intersect_shapes_n(
    shapes: *const hgrid_shapes,
    rays: *const hgrid_ray,
    ray_stride: usize,
    hits: *mut hgrid_hit,
    hit_stride: usize,
    count: usize,
    coherence: hgrid_coherence,
    options: *const hgrid_query_options,
) -> hgrid_status {
    let call = || {
        let batch = BatchArrays::new((rays, ray_stride), (hits, hit_stride), count)?;
        let coherence = query_types::coherence(coherence)?;
        let trace = |shapes: &Shapes<'_>,
                     rays: &mut raw::RunningBatch<'_, hgrid_ray, hgrid_hit>,
                     options: &mut QueryOptions<'_>,
                     test: &mut ShapeTest<'_>| {
            shapes.intersect_batch(rays, coherence, options, test);
        };
        // SAFETY: the caller's promise.
        unsafe { raw::shapes_batch(shapes, &batch, options, trace) }
    };
    call().err().unwrap_or(HGRID_OK)
}

/// Tells for each of many rays whether it hits any shape: what `hgrid_occluded_shapes` would say for each, but faster.
///
/// Writes a byte for each ray, 1 if it hits anything and 0 if not, every `occluded_stride` bytes from `occluded` on.
/// All else is as with `hgrid_intersect_shapes_n`. `rays` and `occluded` may be NULL if `count` is 0, `options` may
/// be NULL. Returns `HGRID_OK` and has written all bytes, or returns what `hgrid_intersect_shapes_n` returns and has
/// written none.
///
/// Threads: any number of queries on the same tree at once; each thread with bytes and counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluded_shapes_n(
    shapes: *const hgrid_shapes,
    rays: *const hgrid_ray,
    ray_stride: usize,
    occluded: *mut u8,
    occluded_stride: usize,
    count: usize,
    coherence: hgrid_coherence,
    options: *const hgrid_query_options,
) -> hgrid_status {
    let call = || {
        let batch = BatchArrays::new((rays, ray_stride), (occluded, occluded_stride), count)?;
        let coherence = query_types::coherence(coherence)?;
        let trace = |shapes: &Shapes<'_>,
                     rays: &mut raw::RunningBatch<'_, hgrid_ray, u8>,
                     options: &mut QueryOptions<'_>,
                     test: &mut ShapeTest<'_>| {
            shapes.occluded_batch(rays, coherence, options, test);
        };
        // SAFETY: the caller's promise.
        unsafe { raw::shapes_batch(shapes, &batch, options, trace) }
    };
    call().err().unwrap_or(HGRID_OK)
}
