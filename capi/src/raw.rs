//! The only place where a caller's pointer becomes a reference or a value.
//!
//! # The contract with C
//!
//! Each function here needs what the header's section "Pointers" asks of the caller: a pointer is
//! NULL, or it is aligned for its type and points to as many bytes as its struct, or the size next
//! to it, says; those bytes are readable, and writable where the pointer is not `const`; and no
//! other thread writes them during the call, or reads them if the call writes.
//! "The caller's promise" in a SAFETY comment means this.
//!
//! # Memory that nobody has written yet
//!
//! A region may come straight from `malloc`. Rust forbids references to memory that *it* knows to
//! be uninitialised, because then the compiler may invent a value at each read. It has no such
//! knowledge here: the bytes come through a C ABI, from an allocation that it cannot see, and to it
//! they are bytes with some value. Filling the region with zeros first would buy nothing but a pass
//! over memory of which the grid may use a tenth. Nor does anything depend on those values: core
//! writes each word before it reads it, and a test watches that under valgrind.
//!
//! # Lifetimes
//!
//! A view outlives the call that made it, in memory that Rust does not own. `'static` stands for
//! "as long as the caller says": blob and mesh stay unchanged while the view is in use, and between
//! calls nothing here looks at them.

use core::ffi::c_void;
use core::ptr::NonNull;
use core::slice;

use hgrid_core::{Config, Counters, Error, Grid, Ray, Strided, Task, TriangleMesh};

use crate::batch::Batch;
use crate::input::Input;
use crate::span::{Region, Span};
use crate::status::{
    HGRID_ERROR_NOT_A_GRID, HGRID_ERROR_NULL_ARGUMENT, HGRID_ERROR_OVERLAP,
    HGRID_ERROR_STRUCT_SIZE, HGRID_OK, hgrid_status, status_of,
};
use crate::types::{
    Elements, hgrid_config, hgrid_counters, hgrid_grid, hgrid_mesh, hgrid_parallel,
    hgrid_query_options, hgrid_ray, hgrid_report, hgrid_task,
};

/// The most bytes that a reference may span.
const MAX_BYTES: usize = isize::MAX.unsigned_abs();

/// A larger `struct_size` is no struct of any version: it was never set.
const MAX_STRUCT_SIZE: usize = 4096;

/// What a [`hgrid_grid`] holds.
#[repr(C)]
struct View {
    tag: u64,
    grid: Grid<'static>,
}

/// The tag of a view that a build or an open has written; anything else is none.
const VIEW_TAG: u64 = u64::from_le_bytes(*b"hgridvw1");

const _: () = assert!(size_of::<View>() <= size_of::<hgrid_grid>());
const _: () = assert!(align_of::<View>() <= align_of::<hgrid_grid>());

/// Reads a number or a small struct.
///
/// # Safety
/// The caller's promise.
#[inline(always)]
pub(crate) unsafe fn read<T: Copy>(from: *const T) -> Result<T, hgrid_status> {
    if from.is_null() {
        return Err(HGRID_ERROR_NULL_ARGUMENT);
    }
    // SAFETY:
    // * not NULL, so aligned and readable by the caller's promise;
    // * all types read here are made of numbers and addresses: any bytes are a value.
    Ok(unsafe { from.read() })
}

/// Reads a struct that starts with its `struct_size`, which may be that of a later version.
///
/// # Safety
/// The caller's promise.
#[inline(always)]
pub(crate) unsafe fn read_sized<T: Copy>(from: *const T) -> Result<T, hgrid_status> {
    // SAFETY: the caller's promise; the size comes first.
    let size = unsafe { read(from.cast::<u32>()) }? as usize;
    if !(size_of::<T>()..=MAX_STRUCT_SIZE).contains(&size) {
        return Err(HGRID_ERROR_STRUCT_SIZE);
    }
    // SAFETY: the caller's promise; the struct says how many bytes it has.
    let bytes = unsafe { bytes(from.cast(), size) }?;
    if bytes.iter().skip(size_of::<T>()).any(|&byte| byte != 0) {
        return Err(HGRID_ERROR_STRUCT_SIZE);
    }
    // SAFETY: the caller's promise.
    unsafe { read(from) }
}

/// Writes a result.
///
/// # Safety
/// The caller's promise.
#[inline(always)]
pub(crate) unsafe fn write<T>(to: NonNull<T>, value: T) {
    // SAFETY: not NULL, so aligned and writable by the caller's promise.
    unsafe { to.write(value) }
}

/// Bytes to read. NULL is fine where there are none.
///
/// # Safety
/// The caller's promise.
unsafe fn bytes(start: *const c_void, count: usize) -> Result<&'static [u8], hgrid_status> {
    match (NonNull::new(start.cast_mut()), count) {
        (None, 0) => Ok(&[]),
        (None, _) => Err(HGRID_ERROR_NULL_ARGUMENT),
        (Some(start), _) => {
            // SAFETY:
            // * not NULL and readable by the caller's promise, bytes need no alignment;
            // * unchanged for as long as the reference lives: see "Lifetimes";
            // * no object is larger than half of the address space.
            Ok(unsafe { slice::from_raw_parts(start.as_ptr().cast(), count.min(MAX_BYTES)) })
        }
    }
}

/// Bytes to write. NULL is fine where there are none.
///
/// # Safety
/// The caller's promise, and no other reference to any of the bytes.
unsafe fn bytes_mut(start: *mut c_void, count: usize) -> Result<&'static mut [u8], hgrid_status> {
    match (NonNull::new(start), count) {
        (None, 0) => Ok(&mut []),
        (None, _) => Err(HGRID_ERROR_NULL_ARGUMENT),
        (Some(start), _) => {
            // SAFETY:
            // * not NULL and writable by the caller's promise, bytes need no alignment;
            // * values that nobody has written are fine: see "Memory that nobody has written yet";
            // * no other reference by this function's contract;
            // * no object is larger than half of the address space.
            Ok(unsafe { slice::from_raw_parts_mut(start.as_ptr().cast(), count.min(MAX_BYTES)) })
        }
    }
}

/// A mesh.
///
/// # Safety
/// The caller's promise.
unsafe fn mesh(mesh: &hgrid_mesh) -> Result<TriangleMesh<'static>, hgrid_status> {
    let [positions, indices] = [mesh.position_elements()?, mesh.index_elements()?];
    // SAFETY: the caller's promise.
    let positions = unsafe { strided(positions) }?;
    // SAFETY: the caller's promise.
    let indices = unsafe { strided(indices) }?;
    TriangleMesh::strided(positions, indices, mesh.index_type()?).map_err(status_of)
}

/// One array of a mesh.
///
/// # Safety
/// The caller's promise.
unsafe fn strided(elements: Elements) -> Result<Strided<'static>, hgrid_status> {
    let Elements { start, stride, count, bytes: size } = elements;
    // SAFETY: the caller's promise.
    let bytes = unsafe { bytes(start, size) }?;
    Ok(Strided { bytes, stride, count })
}

/// The configuration; NULL means the defaults.
///
/// # Safety
/// The caller's promise.
unsafe fn config(config: *const hgrid_config) -> Result<Config, hgrid_status> {
    if config.is_null() {
        return Ok(Config::default());
    }
    // SAFETY: the caller's promise.
    unsafe { read_sized(config) }?.to_core()
}

/// The caller's loop over tasks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Threads {
    /// 2 or more.
    pub(crate) tasks: u32,
    context: *mut c_void,
    run: unsafe extern "C" fn(*mut c_void, u32, hgrid_task, *mut c_void),
}

impl Threads {
    /// Has the caller's loop call a task with every number below the count.
    pub(crate) fn run(&self, count: u32, task: &Task<'_>) {
        // SAFETY: a function of this type by the caller's promise, and with `call` all it needs:
        // * `task` lives until this returns, and by the caller's promise no call comes later;
        // * it is `Sync`, so that calls may come at once, from any thread;
        // * core makes sure itself that one too many or too few do no harm.
        unsafe { (self.run)(self.context, count, call, (&raw const task).cast_mut().cast()) }
    }
}

/// What C gets for a task: calls the one whose address is the context.
///
/// # Safety
/// The context is NULL, or it came with this function and the [`Threads::run`] that passed it on has
/// not returned.
unsafe extern "C" fn call(task_context: *mut c_void, index: u32) {
    // SAFETY: `Threads::run` made it from the address of such a reference and is still running.
    if let Some(task) = unsafe { task_context.cast::<&Task<'_>>().as_ref() } {
        task(index);
    }
}

/// The caller's loop; `None` where nothing is to be parallel.
///
/// # Safety
/// The caller's promise.
unsafe fn threads(parallel: *const hgrid_parallel) -> Result<Option<Threads>, hgrid_status> {
    if parallel.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    let hgrid_parallel { tasks, context, run, .. } = unsafe { read_sized(parallel) }?;
    if tasks <= 1 {
        return Ok(None);
    }
    let run = run.ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
    Ok(Some(Threads { tasks, context, run }))
}

/// Index and scratch, once it is sure that they lie apart from each other and from the mesh.
///
/// # Safety
/// The caller's promise.
unsafe fn regions(
    mesh: &hgrid_mesh,
    [index, scratch]: [Region; 2],
) -> Result<[&'static mut [u8]; 2], hgrid_status> {
    let inputs = [mesh.position_elements()?, mesh.index_elements()?]
        .map(|elements| Span::new(elements.start, elements.bytes));
    let [index_span, scratch_span] = [index.span(), scratch.span()];
    let is_shared = |input: &Span| input.overlaps(index_span) || input.overlaps(scratch_span);
    if index_span.overlaps(scratch_span) || inputs.iter().any(is_shared) {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise; nothing else that this call reads or writes lies there.
    let index = unsafe { bytes_mut(index.start, index.bytes) }?;
    // SAFETY: the same.
    let scratch = unsafe { bytes_mut(scratch.start, scratch.bytes) }?;
    Ok([index, scratch])
}

/// What a build works on.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn input(
    description: *const hgrid_mesh,
    settings: *const hgrid_config,
    parallel: *const hgrid_parallel,
    memory: [Region; 2],
) -> Result<Input, hgrid_status> {
    // SAFETY: the caller's promise.
    let description = unsafe { read_sized(description) }?;
    // SAFETY: the caller's promise.
    let mesh = unsafe { mesh(&description) }?;
    // SAFETY: the caller's promise.
    let config = unsafe { config(settings) }?;
    // SAFETY: the caller's promise.
    let threads = unsafe { threads(parallel) }?;
    // SAFETY: the caller's promise.
    let [index, scratch] = unsafe { regions(&description, memory) }?;
    Ok(Input { mesh, config, threads, index, scratch })
}

/// The grid in a blob.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn open(
    blob: *const c_void,
    blob_bytes: usize,
    description: *const hgrid_mesh,
) -> Result<Grid<'static>, hgrid_status> {
    // SAFETY: the caller's promise.
    let description = unsafe { read_sized(description) }?;
    // SAFETY: the caller's promise.
    let mesh = unsafe { mesh(&description) }?;
    // SAFETY: the caller's promise.
    let blob = unsafe { bytes(blob, blob_bytes) }?;
    Grid::open(blob, mesh).map_err(status_of)
}

/// The grid of a view.
///
/// # Safety
/// The caller's promise; and a view with the right tag was written by [`write_grid`] or copied from
/// one that was, and its blob and its mesh are where they were.
#[inline(always)]
pub(crate) unsafe fn grid<'a>(grid: *const hgrid_grid) -> Result<&'a Grid<'static>, hgrid_status> {
    let view = grid.cast::<View>();
    // SAFETY: the caller's promise; the tag comes first.
    if unsafe { read(view.cast::<u64>()) }? != VIEW_TAG {
        return Err(HGRID_ERROR_NOT_A_GRID);
    }
    // SAFETY: not NULL, aligned as the assertions above say, and a view by its tag.
    let view = unsafe { &*view };
    Ok(&view.grid)
}

/// Makes a view.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn write_grid(to: NonNull<hgrid_grid>, grid: &Grid<'static>) {
    // SAFETY: large enough and aligned as the assertions above say.
    unsafe { write(to.cast(), View { tag: VIEW_TAG, grid: *grid }) }
}

/// Runs a call that tells what it found out, in a report that may be NULL.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn reporting(
    report: *mut hgrid_report,
    call: impl FnOnce(&mut hgrid_report) -> Result<(), hgrid_status>,
) -> hgrid_status {
    let Some(to) = NonNull::new(report) else {
        return call(&mut hgrid_report::empty(0)).err().unwrap_or(HGRID_OK);
    };
    // SAFETY: the caller's promise.
    let mut report = match unsafe { read_sized(report) } {
        Ok(report) => hgrid_report::empty(report.struct_size),
        Err(status) => return status,
    };
    let result = call(&mut report);
    // SAFETY: the caller's promise.
    unsafe { write(to, report) };
    result.err().unwrap_or(HGRID_OK)
}

/// Runs a query, counting if the options say so. `None` if there is nothing to ask.
///
/// # Safety
/// That of [`grid`].
#[inline(always)]
pub(crate) unsafe fn query<T>(
    view: *const hgrid_grid,
    ray: *const hgrid_ray,
    options: *const hgrid_query_options,
    ask: impl FnOnce(&Grid<'static>, &Ray, Option<&mut Counters>) -> T,
) -> Option<T> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }.ok()?;
    // SAFETY: the caller's promise.
    let ray = unsafe { read(ray) }.ok()?.into();
    // SAFETY: the caller's promise.
    let Some(counters) = unsafe { counters(options) }.ok()? else {
        return Some(ask(grid, &ray, None));
    };
    let mut work = Counters::default();
    let answer = ask(grid, &ray, Some(&mut work));
    // SAFETY: the caller's promise.
    unsafe { add(counters, &work) }.ok()?;
    Some(answer)
}

/// How many rays of a batch are read before their answers are written: a tile of 8 x 8. The buffers
/// are 3 KiB.
const CHUNK: usize = 64;

/// Runs a batch: `many` answers a chunk of rays, or `one` a single ray if the options say that work
/// is to be counted. `unanswered` is written nowhere.
///
/// # Safety
/// That of [`grid`]; and the elements of both arrays are the caller's to be read and written.
pub(crate) unsafe fn batch<A: Copy, T: From<A>>(
    view: *const hgrid_grid,
    batch: &Batch<T>,
    options: *const hgrid_query_options,
    unanswered: A,
    many: impl Fn(&Grid<'static>, &[Ray], &mut [A]) -> Result<(), Error>,
    one: impl Fn(&Grid<'static>, &Ray, &mut Counters) -> A,
) -> Result<(), hgrid_status> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    // SAFETY: the caller's promise.
    let counters = unsafe { counters(options) }?;
    let mut work = Counters::default();
    let mut rays = [Ray::new([0.0; 3], [0.0; 3]); CHUNK];
    let mut answers = [unanswered; CHUNK];
    for first in (0..batch.count).step_by(CHUNK) {
        let count = CHUNK.min(batch.count - first);
        let rays = rays.get_mut(..count).unwrap_or_default();
        let answers = answers.get_mut(..count).unwrap_or_default();
        for (index, ray) in (first..).zip(&mut *rays) {
            // SAFETY: within the array by its index, readable by this function's contract, and any
            // bytes are a ray.
            *ray = unsafe { batch.ray(index).read_unaligned() }.into();
        }
        if counters.is_some() {
            for (ray, answer) in rays.iter().zip(&mut *answers) {
                *answer = one(grid, ray, &mut work);
            }
        } else {
            many(grid, rays, answers).map_err(status_of)?;
        }
        for (index, &answer) in (first..).zip(&*answers) {
            // SAFETY: within the array by its index, writable by this function's contract.
            unsafe { batch.answer(index).write_unaligned(answer.into()) };
        }
    }
    let Some(counters) = counters else { return Ok(()) };
    // SAFETY: the caller's promise.
    unsafe { add(counters, &work) }
}

/// Adds the work of queries to the caller's.
///
/// # Safety
/// The caller's promise.
#[inline(always)]
unsafe fn add(to: NonNull<hgrid_counters>, work: &Counters) -> Result<(), hgrid_status> {
    // SAFETY: the caller's promise.
    let mut sum = unsafe { read(to.as_ptr()) }?;
    sum.add(work);
    // SAFETY: the caller's promise.
    unsafe { write(to, sum) };
    Ok(())
}

/// Where the options, which may be NULL, say that work is to be counted.
///
/// # Safety
/// The caller's promise.
#[inline(always)]
unsafe fn counters(
    options: *const hgrid_query_options,
) -> Result<Option<NonNull<hgrid_counters>>, hgrid_status> {
    if options.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    let options = unsafe { read_sized(options) }?;
    if options.reserved != 0 {
        return Err(HGRID_ERROR_STRUCT_SIZE);
    }
    Ok(NonNull::new(options.counters))
}
