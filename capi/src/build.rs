//! The functions that join meshes, tell how much memory a build takes, and build.

use core::ffi::c_void;
use core::ptr::{NonNull, null_mut};

use crate::addresses::RawRegion;
use crate::raw;
use crate::status::{HGRID_ERROR_NULL_ARGUMENT, hgrid_status};
use crate::types::{hgrid_config, hgrid_grid, hgrid_mesh, hgrid_part, hgrid_report};

/// Joins meshes: describes several of them as one, for a grid of them all.
///
/// Nothing is copied. Each mesh keeps its arrays, with strides and an index type of its own, and with masks or
/// without. The triangles are numbered through all meshes, in the order of the array: a hit names one by that number,
/// and `hgrid_locate` tells which mesh it is of and which triangle there. Where several triangles are hit at the same
/// `t`, the one of the first mesh counts. So a grid of joined meshes is, byte by byte, that of one mesh with the same
/// triangles, and each ray takes one walk. One mesh alone is read faster than joined ones: the part of a triangle has
/// to be found, in a binary search.
///
/// ```c
/// static hgrid_status build_both(const hgrid_mesh meshes[2], hgrid_part parts[2], void *index,
///                                size_t index_bytes, void *scratch, size_t scratch_bytes,
///                                hgrid_grid *grid)
/// {
///     hgrid_mesh joined = HGRID_MESH_INIT;
///     const hgrid_status status = hgrid_join(meshes, 2, parts, &joined);
///     if (status != HGRID_OK)
///         return status;
///     return hgrid_build(&joined, NULL, index, index_bytes, scratch, scratch_bytes, grid, NULL);
/// }
/// ```
///
/// `meshes` are `count` structs side by side, all with the same `struct_size`, none of them joined itself. They are
/// only read during the call. `parts` is memory for as many parts, which may hold anything before; it overlaps neither
/// the structs nor their arrays. It belongs to the mesh: it stays where it is, unchanged, for as long as a grid of the
/// joined mesh is queried, as the arrays do. Both may be NULL if `count` is 0: that is a mesh without triangles.
/// `joined` was initialised with `HGRID_MESH_INIT` and is good for every call that takes a mesh. It holds the number of
/// all triangles and vertices, and `parts`. It has no arrays, and its strides mean nothing. Every call that takes it,
/// `hgrid_open` too, first reads all parts. After vertices moved, the same joined mesh is good for `hgrid_refit` and
/// for another build; after arrays moved or counts changed, join the meshes again.
///
/// The report of a build that fails names the triangle to blame by its number in the joined mesh: subtract the
/// triangle counts of the meshes before its own.
///
/// Returns `HGRID_OK` and fills `joined`, or returns the reason and leaves it as it was; then `parts` may hold
/// anything:
/// - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_OVERLAP`;
/// - with one of the meshes: `HGRID_ERROR_INVALID_POSITIONS`, `HGRID_ERROR_INVALID_INDICES`,
///   `HGRID_ERROR_INVALID_INDEX_TYPE`, `HGRID_ERROR_INVALID_MASKS`;
/// - with all of them: `HGRID_ERROR_TOO_MANY_TRIANGLES`, and `HGRID_ERROR_INVALID_PARTS` if one is joined itself, or
///   if they are more than 2^30 - 1 or have more than 2^32 - 1 vertices together.
///
/// Threads: any number of calls at once, each with parts and a joined mesh of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_join(
    meshes: *const hgrid_mesh,
    count: usize,
    parts: *mut hgrid_part,
    joined: *mut hgrid_mesh,
) -> hgrid_status {
    let call = |joined: &mut hgrid_mesh| {
        // SAFETY: the caller's promise.
        joined.note(&unsafe { raw::join(meshes, count, parts) }?);
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { raw::filling(joined, call) }
}

/// Tells how much memory is enough for any mesh with so many triangles, wherever they
/// lie: O(1), nothing is looked at.
///
/// `HGRID_INDEX_BOUND` and `HGRID_SCRATCH_BOUND` are the same for the default configuration as constants, rounded up
/// a little; with bvh and `tasks` above 1 the scratch is larger. The bound exceeds the need by a factor that
/// depends on the method: a scan takes a sixth of it or less with one level, six tenths with bvh; with recursive it
/// is too large to be of use.
///
/// `config` may be NULL: the defaults. `report` may not be NULL. Returns `HGRID_OK`, and the report
/// has `index_bytes` and `scratch_bytes`; or what is wrong:
/// - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`,
///   `HGRID_ERROR_TOO_MANY_TRIANGLES`, also if the sizes do not fit the machine's address space;
/// - with the configuration: `HGRID_ERROR_INVALID_METHOD`, `HGRID_ERROR_METHOD_LEFT_OUT`,
///   `HGRID_ERROR_INVALID_DENSITY`, `HGRID_ERROR_INVALID_FLAGS`,
///   `HGRID_ERROR_INVALID_MACROCELL_FACTOR`, `HGRID_ERROR_INVALID_DEPTH`,
///   `HGRID_ERROR_INVALID_QUALITY`.
///
/// Threads: any number of calls at once, each with a report of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_bound(
    triangle_count: usize,
    config: *const hgrid_config,
    report: *mut hgrid_report,
) -> hgrid_status {
    if report.is_null() {
        return HGRID_ERROR_NULL_ARGUMENT;
    }
    let call = |report: &mut hgrid_report| {
        // SAFETY: the caller's promise.
        unsafe { raw::settings(config) }?.bound(triangle_count, report)
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting(report, call) }
}

/// Tells how much memory a build of this mesh takes.
///
/// Without scratch (NULL, 0) the report's `scratch_bytes` and `index_bytes` are enough for a build, and
/// `is_exact` is 0. With bvh the answer is that of `hgrid_bound`: the triangles are not read, so a vertex number out of
/// range is found by the build. The other methods take two passes over the triangles, or a few. How much more
/// than enough the index is depends on the method: for a scan up to 2 times with one level, 4 with
/// fixed, 6 with variable, 2 with bvh; with recursive it is a bound that no mesh comes near.
///
/// With `scratch_bytes` of scratch the grid is planned there: `index_bytes` is exact and `is_exact`
/// is 1. That takes about half the time of a build; with recursive and bvh, which have to build
/// the grid and keep nothing of it, all of that time. The scratch holds nothing of use afterwards.
///
/// With `tasks` above 1 in the configuration, the sizes are those of a build with so many tasks: with
/// `HGRID_QUALITY_FAST` each takes scratch, and all of them fill the index, which may be a little larger. With bvh the
/// sizes are then bounds for any mesh, and `is_exact` is 0. The call uses neither `run` nor `progress`.
///
/// `mesh` and `report` may not be NULL. `config` may be NULL: the defaults. `scratch` may be NULL
/// if its size is 0; scratch that is too small is no error, and counts as none.
///
/// Returns `HGRID_OK`; or what is wrong, with the triangle that is to blame in the report:
/// - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_MISALIGNED`,
///   `HGRID_ERROR_OVERLAP`;
/// - with the mesh: `HGRID_ERROR_INVALID_POSITIONS`, `HGRID_ERROR_INVALID_INDICES`,
///   `HGRID_ERROR_INVALID_INDEX_TYPE`, `HGRID_ERROR_INVALID_MASKS`, `HGRID_ERROR_INVALID_PARTS`,
///   `HGRID_ERROR_TOO_MANY_TRIANGLES`, `HGRID_ERROR_INDEX_OUT_OF_RANGE`, `HGRID_ERROR_NON_FINITE`;
/// - with the configuration: `HGRID_ERROR_INVALID_METHOD`, `HGRID_ERROR_METHOD_LEFT_OUT`,
///   `HGRID_ERROR_INVALID_DENSITY`, `HGRID_ERROR_INVALID_FLAGS`,
///   `HGRID_ERROR_INVALID_MACROCELL_FACTOR`, `HGRID_ERROR_INVALID_DEPTH`,
///   `HGRID_ERROR_INVALID_QUALITY`.
///
/// Threads: any number of calls at once, as long as each has a scratch and a report of its own. The
/// call starts no thread.
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
    if report.is_null() {
        return HGRID_ERROR_NULL_ARGUMENT;
    }
    let none = RawRegion { start: null_mut(), bytes: 0 };
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    let call = |report: &mut hgrid_report| {
        // SAFETY: the caller's promise.
        unsafe { raw::input(mesh, config, [none, scratch]) }?.measure(report)
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting(report, call) }
}

/// Looks for the finest grid that fits into a budget.
///
/// `fitted` becomes a copy of `config` with a density whose index fits into `index_bytes`, as a rule at most a step
/// below the highest one. It is found in steps down from that of `config`. A step divides the number of cells by 1.41.
/// A tree (`HGRID_METHOD_BVH`) has no cells: it fits or does not. The call does the work of `hgrid_sizes` about a dozen
/// times, and at most 22 times. A density that is too fine for a build counts as one that does not fit.
///
/// The search relies on coarser grids being smaller. But a coarser grid may take more memory than one a few steps
/// finer. Then the density may be several steps too low, and a budget that only the finer grid fits into may be
/// refused.
///
/// Bring as much scratch as `hgrid_sizes` without scratch returns. With less, the grid may become coarser
/// than the index requires: with `HGRID_METHOD_ONE_LEVEL` and `HGRID_METHOD_FIXED` the bound of a grid must
/// fit, with the other methods the scratch must be large enough to plan a grid. If it is too small for all
/// densities, the call returns `HGRID_ERROR_SCRATCH_TOO_SMALL`. The scratch holds nothing of use
/// afterwards.
///
/// `mesh` and `fitted` may not be NULL. `config` may be NULL: the defaults; and it may be
/// the same as `fitted`. Initialise `fitted` before the call, even if it is `config`. `report` may be NULL,
/// and so may `scratch` if its size is 0.
///
/// Returns `HGRID_OK`, and the report says what the fitted grid takes; or
/// `HGRID_ERROR_INDEX_TOO_SMALL`, and its `index_bytes` is what the coarsest grid takes; or
/// `HGRID_ERROR_SCRATCH_TOO_SMALL`, and its `scratch_bytes` is what it takes; or what `hgrid_sizes`
/// returns. After an error `fitted` is as it was. `run` and `progress` are not called, and the
/// sizes are those of one task. `fitted` has `tasks`, `run`, `progress` and `context` of `config`;
/// before a build with several tasks ask `hgrid_sizes` what these take.
///
/// Threads: any number of calls at once, as long as each has a scratch, a configuration
/// to write and a report of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_fit(
    mesh: *const hgrid_mesh,
    config: *const hgrid_config,
    index_bytes: usize,
    scratch: *mut c_void,
    scratch_bytes: usize,
    fitted: *mut hgrid_config,
    report: *mut hgrid_report,
) -> hgrid_status {
    let none = RawRegion { start: null_mut(), bytes: 0 };
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    let call = |report: &mut hgrid_report| {
        let to = NonNull::new(fitted).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // Require room for all fields of this version: all are written.
        // SAFETY: the caller's promise.
        let hgrid_config { struct_size, .. } = unsafe { raw::read_sized(fitted) }?;
        // SAFETY: the caller's promise.
        let found =
            unsafe { raw::input(mesh, config, [none, scratch]) }?.fit(index_bytes, report)?;
        // SAFETY: the caller's promise.
        let mut config = unsafe { raw::settings(config) }?;
        config.struct_size = struct_size;
        config.density = found.parameters.density().unwrap_or(config.density);
        // SAFETY: the caller's promise.
        unsafe { raw::write(to, config) };
        Ok(())
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
/// was: `HGRID_ERROR_INDEX_TOO_SMALL`, `HGRID_ERROR_SCRATCH_TOO_SMALL`, `HGRID_ERROR_CANCELLED`, or
/// what `hgrid_sizes` returns. The report is written in both cases: what was built; or, if a region
/// is too small, what both need; or the triangle that is to blame.
///
/// After an error `index` is unchanged, except in these cases, in which it may hold anything: after any error with
/// `HGRID_METHOD_BVH`; with all methods after `HGRID_ERROR_CANCELLED`; with `HGRID_METHOD_VARIABLE` and
/// `HGRID_METHOD_RECURSIVE` after `HGRID_ERROR_INDEX_TOO_SMALL` and `HGRID_ERROR_INVALID_DENSITY`. In these cases
/// queries on views of the grid that lay there before are safe, but answer wrongly. Clear such views, also `grid` if it
/// was one: `view = (hgrid_grid)HGRID_GRID_INIT`.
///
/// If the index is too small, bvh, variable and recursive go on without writing, to compute the size: the report's
/// `index_bytes` is exact (with bvh maybe only enough), and the same call with that much succeeds.
///
/// A build allocates nothing and needs at most 18 KiB of stack, as `hgrid_sizes`, `hgrid_fit`,
/// `hgrid_validate` and `hgrid_inspect` do; with `tasks` above 1 at most 96 KiB, and each task 13
/// KiB where it is called; all beside what `run` and `progress` take (measured on x86-64).
///
/// # A build on threads
///
/// The library knows no threads. With `tasks` and `run` in the configuration, a build with
/// `HGRID_METHOD_BVH` is cut into tasks: the library calls `run`, on the thread that calls this function, and `run`
/// calls the tasks, on the threads of a pool or on new ones. The blob is the same, byte for byte.
/// With POSIX threads, one for each task:
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
///     hgrid_config config = HGRID_CONFIG_INIT;
///     config.tasks = 8, config.run = run_on_threads;
///     return hgrid_build(mesh, &config, index, index_bytes, scratch, scratch_bytes, grid, NULL);
/// }
/// ```
///
/// `hgrid_sizes` with the same configuration tells how much memory so many tasks take. Where there
/// is less scratch, but enough for fewer tasks, there are fewer. `HGRID_ERROR_PARALLEL_FOR` says
/// that `run` ran a task twice or not at all; then the index may hold anything, and both regions
/// can be used again, as after `HGRID_ERROR_CANCELLED`.
///
/// Threads: any number of calls at once, as long as each has regions, a view and a report of its
/// own. The call starts no thread; its tasks are called on those that `run` chooses.
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
    let index = RawRegion { start: index, bytes: index_bytes };
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    let call = |report: &mut hgrid_report| {
        let to = NonNull::new(grid).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        let built = unsafe { raw::input(mesh, config, [index, scratch]) }?.build(report)?;
        // SAFETY: the caller's promise.
        unsafe { raw::write_grid(to, &built) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting(report, call) }
}
