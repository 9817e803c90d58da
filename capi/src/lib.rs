//! The C ABI of hgrid.
//!
//! Every function checks what it was given, calls core, and writes the answer. The docs of all that
//! is public are the text of `include/hgrid.h`, which a test makes with cbindgen: they are written
//! for C readers, and the header's own head (in `cbindgen.toml`) holds the rules for pointers,
//! structs and threads that they rely on. `raw` holds every use of a caller's pointer.
//!
//! There is no allocation, no state and no thread here, and no panic that a caller could reach; a
//! test looks for the symbols of all but the state in the library. Core remembers in one byte which
//! vector instructions the processor has.
//!
//! That is the library without features. With `std` it also has `create`, which gets memory from the
//! caller's allocator or the system's and looks after the pointers to it.
#![no_std]

mod batch;
#[cfg(feature = "std")]
mod create;
mod input;
mod raw;
mod span;
mod status;
#[cfg(feature = "std")]
mod system;
mod types;
mod version;

use core::ffi::{c_char, c_void};
use core::ptr::{NonNull, null, null_mut};

use hgrid_core::{Grid, Hit, QueryOptions, Ray, Strided, StridedMut};

#[cfg(feature = "std")]
pub use crate::create::*;
pub use crate::status::*;
pub use crate::types::*;
pub use crate::version::*;

use crate::batch::Batch;
use crate::span::Region;
use crate::status::{status_of, text};
use crate::version::VERSION;

/// Nothing in this library or in core panics, so link-time optimisation drops this again.
#[panic_handler]
const fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// Tells how much memory a build of this mesh takes.
///
/// Without scratch (NULL, 0) the answer takes two passes over the triangles, or a few: the report's
/// `scratch_bytes` is what a build takes, `index_bytes` is enough, and `is_exact` is 0. How much
/// more than enough depends on the method: for a scan up to 2 times with one level, 4 with fixed, 6
/// with variable; with recursive and brick it is a bound that no mesh comes near.
///
/// With `scratch_bytes` of scratch the grid is planned there: `index_bytes` is exact and `is_exact`
/// is 1. That takes about half the time of a build; with recursive and brick, which have to build
/// the grid and keep nothing of it, all of that time. The scratch holds nothing of use afterwards.
///
/// `mesh` and `report` may not be NULL. `config` may be NULL: the defaults. Returns `HGRID_OK` or
/// the reason, with the triangle that is to blame in the report; scratch that is too small is no
/// error, and counts as none.
///
/// Threads: any number of calls at once, as long as each has a scratch and a report of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_sizes(
    mesh: *const hgrid_mesh,
    config: *const hgrid_config,
    scratch: *mut c_void,
    scratch_bytes: usize,
    report: *mut hgrid_report,
) -> hgrid_status {
    // SAFETY: the caller's promise.
    unsafe { hgrid_sizes_parallel(mesh, config, null(), scratch, scratch_bytes, report) }
}

/// Tells how much memory a build of this mesh takes that runs so many tasks at once: `hgrid_sizes`
/// for `hgrid_build_parallel`.
///
/// Each task takes scratch, for `HGRID_METHOD_BRICK`. The index is filled by all of them, and the one
/// that a build takes may be a little larger than with another number. With the other methods, and
/// with `parallel` NULL or `tasks` 0 or 1, the answer is that of `hgrid_sizes`. `run` is called for
/// the answer, too.
///
/// `mesh` and `report` may not be NULL. `config` may be NULL: the defaults. `parallel` may be NULL:
/// one task. Returns what `hgrid_sizes` returns, or `HGRID_ERROR_PARALLEL_FOR`.
///
/// Threads: any number of calls at once, as long as each has a scratch and a report of its own. The
/// call starts no thread; its tasks are called on those that `run` chooses.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_sizes_parallel(
    mesh: *const hgrid_mesh,
    config: *const hgrid_config,
    parallel: *const hgrid_parallel,
    scratch: *mut c_void,
    scratch_bytes: usize,
    report: *mut hgrid_report,
) -> hgrid_status {
    if report.is_null() {
        return HGRID_ERROR_NULL_ARGUMENT;
    }
    let none = Region { start: null_mut(), bytes: 0 };
    let scratch = Region { start: scratch, bytes: scratch_bytes };
    let call = |report: &mut hgrid_report| {
        // SAFETY: the caller's promise.
        unsafe { raw::input(mesh, config, parallel, [none, scratch]) }?.measure(report)
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting(report, call) }
}

/// Builds a grid in memory that the caller brings.
///
/// `index` keeps the grid (it is the blob afterwards), `scratch` is free again when the call
/// returns. Both start at a multiple of `HGRID_ALIGNMENT`, overlap neither each other nor the mesh
/// nor any struct of this call, and may hold anything before. `hgrid_sizes` tells how large they
/// must be, `HGRID_INDEX_BOUND` and `HGRID_SCRATCH_BOUND` how large is always enough with the
/// default configuration; what is more than needed is not touched. The same mesh and configuration
/// give the same bytes on every machine of the same byte order.
///
/// `mesh` and `grid` may not be NULL. `config` may be NULL: the defaults. `index` and `scratch` may
/// be NULL if their size is 0. `report` may be NULL.
///
/// Returns `HGRID_OK` and writes the view to `grid`, or returns the reason and leaves `grid` as it
/// was. The report is written in both cases: what was built; or, if a region is too small, what
/// both need; or the triangle that is to blame.
///
/// After an error `index` is as it was, with these exceptions: after `HGRID_ERROR_INDEX_TOO_SMALL`,
/// `HGRID_ERROR_INVALID_DENSITY` and `HGRID_ERROR_INVALID_CELL_SIZE`, `HGRID_METHOD_VARIABLE`,
/// `HGRID_METHOD_RECURSIVE` and `HGRID_METHOD_BRICK` may have left anything in it, so a grid that
/// lay there before is gone. They write as far as the index reaches and then go on counting: the
/// report's `index_bytes` is exact (with brick maybe only enough), and with so many the same call
/// succeeds.
///
/// Threads: any number of calls at once, as long as each has regions, a view and a report of its
/// own. The call starts no thread.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_build(
    mesh: *const hgrid_mesh,
    config: *const hgrid_config,
    index: *mut c_void,
    index_bytes: usize,
    scratch: *mut c_void,
    scratch_bytes: usize,
    grid: *mut hgrid_grid,
    report: *mut hgrid_report,
) -> hgrid_status {
    let none = null();
    // SAFETY: the caller's promise.
    unsafe {
        hgrid_build_parallel(
            mesh,
            config,
            none,
            index,
            index_bytes,
            scratch,
            scratch_bytes,
            grid,
            report,
        )
    }
}

/// Builds a grid on threads that the caller brings: `hgrid_build`, and byte by byte the same blob.
///
/// `parallel` says how many tasks the build is cut into and how they are run. The library knows no
/// threads: it calls `run`, on the thread that calls this function, and `run` calls the tasks, on the
/// threads of a pool or on new ones. With POSIX threads, one for each task:
///
/// ```c
/// typedef struct {
///     pthread_t thread;
///     bool has_thread;
///     hgrid_task task;
///     void *task_context;
///     uint32_t index;
/// } one_task;
///
/// static void *run_one(void *argument)
/// {
///     const one_task *one = (const one_task *)argument;
///     one->task(one->task_context, one->index);
///     return NULL;
/// }
///
/// static void run_on_threads(void *context, uint32_t count, hgrid_task task, void *task_context)
/// {
///     one_task all[HGRID_MAX_TASKS];
///     for (uint32_t i = 0; i < count; i++) {
///         all[i].task = task, all[i].task_context = task_context, all[i].index = i;
///         all[i].has_thread = pthread_create(&all[i].thread, NULL, run_one, &all[i]) == 0;
///         if (!all[i].has_thread)
///             run_one(&all[i]);
///     }
///     for (uint32_t i = 0; i < count; i++)
///         if (all[i].has_thread)
///             pthread_join(all[i].thread, NULL);
///     (void)context;
/// }
///
/// static hgrid_status build_on_threads(const hgrid_mesh *mesh, void *index, size_t index_bytes,
///                                      void *scratch, size_t scratch_bytes, hgrid_grid *grid)
/// {
///     const hgrid_config config = HGRID_CONFIG_INIT_BRICK;
///     hgrid_parallel parallel = HGRID_PARALLEL_INIT;
///     parallel.tasks = 8, parallel.run = run_on_threads;
///     return hgrid_build_parallel(mesh, &config, &parallel, index, index_bytes, scratch,
///                                 scratch_bytes, grid, NULL);
/// }
/// ```
///
/// Only `HGRID_METHOD_BRICK` is cut into tasks; the other methods never call `run`.
/// `hgrid_sizes_parallel` tells how much memory so many tasks take. Where there is less scratch, but
/// enough for fewer tasks, there are fewer; enough for one is what `hgrid_sizes` tells.
///
/// `mesh` and `grid` may not be NULL. `config` may be NULL: the defaults. `parallel` may be NULL: one
/// task, as with `tasks` 0 or 1; with more, its `run` may not be NULL. `index` and `scratch` may be
/// NULL if their size is 0. `report` may be NULL.
///
/// Returns what `hgrid_build` returns, or `HGRID_ERROR_PARALLEL_FOR` if `run` ran a task twice or not
/// at all; then the index may hold anything, and both regions can be used again.
///
/// Threads: any number of calls at once, as long as each has regions, a view and a report of its
/// own. The call starts no thread; its tasks are called on those that `run` chooses.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_build_parallel(
    mesh: *const hgrid_mesh,
    config: *const hgrid_config,
    parallel: *const hgrid_parallel,
    index: *mut c_void,
    index_bytes: usize,
    scratch: *mut c_void,
    scratch_bytes: usize,
    grid: *mut hgrid_grid,
    report: *mut hgrid_report,
) -> hgrid_status {
    let index = Region { start: index, bytes: index_bytes };
    let scratch = Region { start: scratch, bytes: scratch_bytes };
    let call = |report: &mut hgrid_report| {
        let to = NonNull::new(grid).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        let input = unsafe { raw::input(mesh, config, parallel, [index, scratch]) }?;
        let built = input.build(report)?;
        // SAFETY: the caller's promise.
        unsafe { raw::write_grid(to, &built) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting(report, call) }
}

/// Opens a blob that was built earlier, in another process or on another machine: O(1), no copy.
///
/// `blob` is the index of a build, or a copy of it, at a multiple of `HGRID_ALIGNMENT`: in memory,
/// in a mapped file, in flash. It is `index_bytes` of the build's report long; bytes behind it are
/// ignored. It says itself which method built it and how. The mesh is the one it was built for,
/// of which only the counts are compared.
///
/// What O(1) cannot see is not trusted: on damaged bytes, queries may answer wrongly, but they read
/// nothing outside the blob and the mesh and they end. `hgrid_validate` makes sure. The bytes must
/// not change while the grid is in use: a file that others may write is not for mapping, read it into
/// memory of your own.
///
/// No argument may be NULL. Returns `HGRID_OK` and writes the view to `grid`, or returns the reason
/// and leaves `grid` as it was.
///
/// Threads: any number of calls at once, also on the same blob, each with a view of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_open(
    blob: *const c_void,
    blob_bytes: usize,
    mesh: *const hgrid_mesh,
    grid: *mut hgrid_grid,
) -> hgrid_status {
    let (false, Some(to)) = (blob.is_null(), NonNull::new(grid)) else {
        return HGRID_ERROR_NULL_ARGUMENT;
    };
    // SAFETY: the caller's promise.
    match unsafe { raw::open(blob, blob_bytes, mesh) } {
        Ok(opened) => {
            // SAFETY: the caller's promise.
            unsafe { raw::write_grid(to, &opened) };
            HGRID_OK
        }
        Err(status) => status,
    }
}

/// Proves that a blob is the grid of its mesh, and so that every answer will be right.
///
/// Takes no memory and at most about the time of a build; with recursive several times as long, on
/// damaged bytes much longer. A grid that was just built needs no proof; a blob from a file, a
/// network or another process may.
///
/// Returns `HGRID_OK`; `HGRID_ERROR_CORRUPT`, or `HGRID_ERROR_INDEX_OUT_OF_RANGE` if it is the mesh
/// that is damaged; `HGRID_ERROR_NOT_A_GRID` for a view of zeros (`HGRID_GRID_INIT`);
/// `HGRID_ERROR_NULL_ARGUMENT`.
///
/// Threads: any number of calls and queries on the same grid at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_validate(grid: *const hgrid_grid) -> hgrid_status {
    // SAFETY: the caller's promise.
    match unsafe { raw::grid(grid) } {
        Ok(grid) => grid.validate().map_or_else(status_of, |()| HGRID_OK),
        Err(status) => status,
    }
}

/// Finds the closest triangle that a ray hits.
///
/// Returns true and writes `hit`; or returns false and writes nothing. Where several triangles are
/// hit at the same `t`, the one with the lowest number is reported. Both sides of a triangle count.
/// A ray through an edge or a vertex that triangles share hits at least one of them. A triangle
/// without area, or one that is seen exactly edge-on, is not hit.
///
/// `options` may be NULL: the defaults. With another NULL, with a view of zeros, or one never built or
/// opened, or with options that break the rules for structs, nothing is hit.
///
/// A query allocates nothing, needs at most about 4 KiB of stack and always ends: on one level
/// after no more steps than the three resolutions sum up to.
///
/// Threads: any number of queries on the same grid at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_intersect(
    grid: *const hgrid_grid,
    ray: *const hgrid_ray,
    options: *const hgrid_query_options,
    hit: *mut hgrid_hit,
) -> bool {
    let Some(to) = NonNull::new(hit) else { return false };
    let ask = |grid: &Grid<'_>, ray: &_, counters: Option<&mut _>| match counters {
        None => grid.intersect(ray),
        Some(counters) => grid.intersect_with(ray, &mut QueryOptions::counting(counters)),
    };
    // SAFETY: the caller's promise.
    let Some(found) = unsafe { raw::query(grid, ray, options, ask) }.flatten() else {
        return false;
    };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to, found.into()) };
    true
}

/// Tells whether a ray hits anything: what `hgrid_intersect` would return, but sooner.
///
/// This is the query for shadows and visibility. It stops at the first triangle it finds in the
/// ray's range, which need not be the closest.
///
/// `options` may be NULL: the defaults. With another NULL, with a view of zeros, or one never built or
/// opened, or with options that break the rules for structs, the answer is false.
///
/// Threads: any number of queries on the same grid at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluded(
    grid: *const hgrid_grid,
    ray: *const hgrid_ray,
    options: *const hgrid_query_options,
) -> bool {
    let ask = |grid: &Grid<'_>, ray: &_, counters: Option<&mut _>| match counters {
        None => grid.occluded(ray),
        Some(counters) => grid.occluded_with(ray, &mut QueryOptions::counting(counters)),
    };
    // SAFETY: the caller's promise.
    unsafe { raw::query(grid, ray, options, ask) }.unwrap_or(false)
}

/// Finds the closest triangle that each of many rays hits: what `hgrid_intersect` would find for
/// each, bit for bit, but sooner.
///
/// A ray lies every `ray_stride` bytes from `rays` on, and its hit goes to the same place of `hits`.
/// A miss writes a hit, too: with `primitive` equal to `HGRID_INVALID_ID`, `t` equal to `INFINITY`,
/// `u` and `v` equal to 0. Here is a tile of 8 x 8 pixels:
///
/// ```c
/// static size_t trace_tile(const hgrid_grid *grid, const hgrid_ray rays[64], float depth[64])
/// {
///     hgrid_hit hits[64];
///     size_t found = 0;
///     if (hgrid_intersect_n(grid, rays, 0, hits, 0, 64, HGRID_COHERENCE_COHERENT, NULL) != HGRID_OK)
///         return 0;
///     for (size_t i = 0; i < 64; i++) {
///         depth[i] = hits[i].t;
///         found += hits[i].primitive != HGRID_INVALID_ID;
///     }
///     return found;
/// }
/// ```
///
/// Rays and hits may lie in structs of yours, also in the same ones: with `struct {hgrid_ray ray;
/// hgrid_hit hit; int pixel;}` both strides are the size of the struct. A stride of 0 means side by
/// side. Neither array needs any alignment, and not a byte between its elements is read or written.
/// No hit may overlap a ray, its own or another; where the two arrays reach into each other, their
/// strides are the same. Nor do hits overlap anything else that the call uses.
///
/// `coherence` is what you know about the rays, one of `HGRID_COHERENCE_...`; it has no influence on
/// the hits. With `count` 0 nothing is done. Up to 64 rays are read before the first hit is written.
///
/// `rays` and `hits` may be NULL if `count` is 0. `options` may be NULL: the defaults. With counters
/// the work of all rays is added up, one ray after the other, which is slower.
///
/// Returns `HGRID_OK` and has written all hits, or returns the reason and has written none:
/// `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_STRUCT_SIZE` (the options),
/// `HGRID_ERROR_INVALID_RAYS` and `HGRID_ERROR_INVALID_ANSWERS` (a stride, or a count that is
/// impossible), `HGRID_ERROR_OVERLAP`, `HGRID_ERROR_INVALID_COHERENCE`. A ray that is none is no
/// error: it misses.
///
/// The call allocates nothing and needs at most about 16 KiB of stack.
///
/// Threads: any number of queries on the same grid at once; each thread with hits and counters of
/// its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_intersect_n(
    grid: *const hgrid_grid,
    rays: *const hgrid_ray,
    ray_stride: usize,
    hits: *mut hgrid_hit,
    hit_stride: usize,
    count: usize,
    coherence: hgrid_coherence,
    options: *const hgrid_query_options,
) -> hgrid_status {
    let call = || {
        let batch = Batch::new((rays, ray_stride), (hits, hit_stride), count)?;
        let coherence = types::coherence(coherence)?;
        let many = |grid: &Grid<'_>, rays: &[_], hits: &mut [_]| {
            grid.intersect_n(&Strided::new::<Ray>(rays), &mut StridedMut::new(hits), coherence)
        };
        let one = |grid: &Grid<'_>, ray: &_, counters: &mut _| {
            let options = &mut QueryOptions::counting(counters);
            grid.intersect_with(ray, options).unwrap_or(Hit::MISS)
        };
        // SAFETY: the caller's promise.
        unsafe { raw::batch(grid, &batch, options, Hit::MISS, many, one) }
    };
    call().err().unwrap_or(HGRID_OK)
}

/// Tells for each of many rays whether it hits anything: what `hgrid_occluded` would say for each,
/// but sooner.
///
/// Writes a byte for each ray, 1 if it hits anything and 0 if not, every `occluded_stride` bytes
/// from `occluded` on. All else is as with `hgrid_intersect_n`: strides, structs that hold a ray and
/// its byte, what may be NULL, coherence, options, statuses, stack. For the shadow rays of a tile,
/// towards one light:
///
/// ```c
/// static size_t count_lit(const hgrid_grid *grid, const hgrid_ray *rays, size_t count)
/// {
///     unsigned char occluded[64];
///     size_t lit = 0;
///     for (size_t first = 0; first < count; first += 64) {
///         const size_t n = count - first < 64 ? count - first : 64;
///         if (hgrid_occluded_n(grid, rays + first, 0, occluded, 0, n, HGRID_COHERENCE_COHERENT,
///                              NULL) != HGRID_OK)
///             return 0;
///         for (size_t i = 0; i < n; i++)
///             lit += !occluded[i];
///     }
///     return lit;
/// }
/// ```
///
/// Threads: any number of queries on the same grid at once; each thread with bytes and counters of
/// its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluded_n(
    grid: *const hgrid_grid,
    rays: *const hgrid_ray,
    ray_stride: usize,
    occluded: *mut u8,
    occluded_stride: usize,
    count: usize,
    coherence: hgrid_coherence,
    options: *const hgrid_query_options,
) -> hgrid_status {
    let call = || {
        let batch = Batch::new((rays, ray_stride), (occluded, occluded_stride), count)?;
        let coherence = types::coherence(coherence)?;
        let many = |grid: &Grid<'_>, rays: &[_], occluded: &mut [u8]| {
            grid.occluded_n(&Strided::new::<Ray>(rays), &mut StridedMut::new(occluded), coherence)
        };
        let one = |grid: &Grid<'_>, ray: &_, counters: &mut _| {
            u8::from(grid.occluded_with(ray, &mut QueryOptions::counting(counters)))
        };
        // SAFETY: the caller's promise.
        unsafe { raw::batch(grid, &batch, options, 0, many, one) }
    };
    call().err().unwrap_or(HGRID_OK)
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

/// The version of the library that is linked, to be compared with the `HGRID_VERSION` of the header
/// that was compiled against.
///
/// Threads: any number of calls at once.
#[unsafe(no_mangle)]
pub const extern "C" fn hgrid_version() -> u32 {
    HGRID_VERSION
}

/// The version of the library that is linked, as text: never NULL, static.
///
/// Threads: any number of calls at once.
#[unsafe(no_mangle)]
pub const extern "C" fn hgrid_version_string() -> *const c_char {
    VERSION.as_ptr()
}
