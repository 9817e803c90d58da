//! The only place where a caller's pointer becomes a reference or a value: here for builds and blobs, in `query` for
//! queries, in `parts` for arrays of meshes, in `shapes` and `scene` for shapes and scenes. (`create` reads the head of
//! a region, which it wrote itself.) `batch` checks the addresses of a batch before it reads them.
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

mod batch;
mod parts;
mod query;
mod scene;
mod shapes;

use core::ffi::c_void;
use core::mem::offset_of;
use core::ptr::{NonNull, null_mut};
use core::slice;

use hgrid_core::{BlobInfo, Config, Grid, Strided, Task, TriangleMesh};

pub(crate) use batch::{BatchArrays, RunningBatch};
pub(crate) use parts::{join, parts_of};
pub(crate) use query::{batch, closest_point, locate, query, query_all, surface};
pub(crate) use scene::{
    build_scene, open_packed_scene, open_scene, pack_scene, query_scene, refit_scene, scene,
    scene_batch, scene_instance, scene_locate, scene_normal, scene_surface, validate_scene,
    write_object,
};
pub(crate) use shapes::{
    build_shapes, open_shapes, query_shapes, refit_shapes, shapes, shapes_batch, validate_shapes,
};

use crate::addresses::{Addresses, RawRegion};
use crate::blob_types::hgrid_refit_report;
use crate::input::Input;
use crate::status::{
    HGRID_ERROR_NOT_A_GRID, HGRID_ERROR_NULL_ARGUMENT, HGRID_ERROR_OVERLAP,
    HGRID_ERROR_STRUCT_SIZE, HGRID_OK, hgrid_status, status_of,
};
use crate::types::{
    Elements, HGRID_PROGRESS_END, hgrid_config, hgrid_grid, hgrid_mesh, hgrid_report, hgrid_task,
};

/// The most bytes that a reference may span.
const MAX_BYTES: usize = isize::MAX.unsigned_abs();

/// A larger `struct_size` is no struct of any version: it was never set.
const MAX_STRUCT_SIZE: usize = 4096;

/// The content of a [`hgrid_grid`].
#[repr(C)]
struct StoredGrid {
    tag: u64,
    grid: Grid<'static>,
}

/// The tag of a view that a build or an open has written.
const VIEW_TAG: u64 = u64::from_le_bytes(*b"hgridvw1");

const _: () = assert!(size_of::<StoredGrid>() <= size_of::<hgrid_grid>());
const _: () = assert!(align_of::<StoredGrid>() <= align_of::<hgrid_grid>());

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

/// Regions to write, once it is sure that they lie apart from each other and from what is read.
///
/// # Safety
/// The caller's promise.
unsafe fn apart<const N: usize>(
    inputs: [Addresses; N],
    [one, other]: [RawRegion; 2],
) -> Result<[&'static mut [u8]; 2], hgrid_status> {
    let (first, second) = (one.addresses(), other.addresses());
    let is_shared = |input: &Addresses| input.overlaps(first) || input.overlaps(second);
    if first.overlaps(second) || inputs.iter().any(is_shared) {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise; nothing else that this call reads or writes lies there.
    let one = unsafe { bytes_mut(one.start, one.bytes) }?;
    // SAFETY: the same.
    let other = unsafe { bytes_mut(other.start, other.bytes) }?;
    Ok([one, other])
}

/// A mesh.
///
/// # Safety
/// The caller's promise.
unsafe fn mesh(mesh: &hgrid_mesh) -> Result<TriangleMesh<'static>, hgrid_status> {
    if mesh.has_parts() {
        // SAFETY: the caller's promise.
        return unsafe { parts::joined(mesh) };
    }
    let [positions, indices] = [mesh.position_elements()?, mesh.index_elements()?];
    let masks = mesh.mask_elements()?;
    // SAFETY: the caller's promise.
    let positions = unsafe { strided(positions) }?;
    // SAFETY: the caller's promise.
    let indices = unsafe { strided(indices) }?;
    // SAFETY: the caller's promise.
    let masks = unsafe { strided(masks) }?;
    let mesh = TriangleMesh::strided(positions, indices, mesh.index_type()?).map_err(status_of)?;
    if masks.count == 0 { Ok(mesh) } else { mesh.with_masks(masks).map_err(status_of) }
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

/// Reads the configuration of a build, as the caller says it; NULL means the defaults.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn settings(config: *const hgrid_config) -> Result<hgrid_config, hgrid_status> {
    if config.is_null() {
        return Ok(hgrid_config::DEFAULT);
    }
    // SAFETY: the caller's promise.
    unsafe { read_sized(config) }
}

/// Reads the configuration of a build, and its callbacks; NULL means the defaults and none.
///
/// # Safety
/// The caller's promise.
unsafe fn config(config: *const hgrid_config) -> Result<(Config, Caller), hgrid_status> {
    // SAFETY: the caller's promise.
    let config = unsafe { settings(config) }?;
    let hgrid_config { context, run, progress, .. } = config;
    let tasks = config.task_count()?;
    let run = run.filter(|_| tasks > 1);
    Ok((config.to_core()?, Caller { tasks, context, run, progress }))
}

/// The callbacks of a build: the loop over tasks, and the progress.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Caller {
    /// 2 or more if there is a loop.
    pub(crate) tasks: u32,
    context: *mut c_void,
    run: Option<unsafe extern "C" fn(*mut c_void, u32, hgrid_task, *mut c_void)>,
    progress: Option<unsafe extern "C" fn(*mut c_void, u32) -> bool>,
}

impl Caller {
    /// No callbacks.
    pub(crate) const NOBODY: Self =
        Self { tasks: 1, context: null_mut(), run: None, progress: None };

    /// Runs a task with every number below the count: by the caller's loop, or here if there is none.
    pub(crate) fn run(&self, count: u32, task: &Task<'_>) {
        let Some(run) = self.run else { return (0..count).for_each(task) };
        // SAFETY: a function of this type by the caller's promise, and with `call` all it needs:
        // * `task` lives until this returns, and by the caller's promise no call comes later;
        // * it is `Sync`, so that calls may come at once, from any thread;
        // * core makes sure itself that one too many or too few do no harm.
        unsafe { run(self.context, count, call, (&raw const task).cast_mut().cast()) }
    }

    /// Returns true if the caller wants to know how far a build is.
    pub(crate) const fn is_watching(&self) -> bool {
        self.progress.is_some()
    }

    /// Reports progress; false if the caller cancels.
    ///
    /// Core's steps are larger than a thousandth, so the whole numbers grow as its shares do.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "from 0 to 1000, and what is not whole was not done yet"
    )]
    pub(crate) fn progress(&self, done: f32) -> bool {
        let done = (done * HGRID_PROGRESS_END as f32) as u32;
        // SAFETY: a function of this type by the caller's promise.
        self.progress.is_none_or(|progress| unsafe { progress(self.context, done) })
    }
}

/// Calls the task whose address is the context: C gets this function for a task.
///
/// # Safety
/// The context is NULL, or it came with this function and the [`Caller::run`] that passed it on has
/// not returned.
unsafe extern "C" fn call(task_context: *mut c_void, index: u32) {
    // SAFETY: `Caller::run` made it from the address of such a reference and is still running.
    if let Some(task) = unsafe { task_context.cast::<&Task<'_>>().as_ref() } {
        task(index);
    }
}

/// Index and scratch, once it is sure that they lie apart from each other and from the mesh.
///
/// # Safety
/// The caller's promise.
unsafe fn regions(
    mesh: &TriangleMesh<'_>,
    [index, scratch]: [RawRegion; 2],
) -> Result<[&'static mut [u8]; 2], hgrid_status> {
    let [of_index, of_scratch] = [index.addresses(), scratch.addresses()];
    let is_shared = shares(mesh, of_index) || shares(mesh, of_scratch);
    if of_index.overlaps(of_scratch) || is_shared {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise; nothing else that this call reads or writes lies there.
    let index = unsafe { bytes_mut(index.start, index.bytes) }?;
    // SAFETY: the same.
    let scratch = unsafe { bytes_mut(scratch.start, scratch.bytes) }?;
    Ok([index, scratch])
}

/// Reads the input of a build.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn input(
    description: *const hgrid_mesh,
    settings: *const hgrid_config,
    memory: [RawRegion; 2],
) -> Result<Input, hgrid_status> {
    // SAFETY: the caller's promise.
    let description = unsafe { read_sized(description) }?;
    // SAFETY: the caller's promise.
    let mesh = unsafe { mesh(&description) }?;
    // SAFETY: the caller's promise.
    let (config, caller) = unsafe { config(settings) }?;
    // SAFETY: the caller's promise.
    let [index, scratch] = unsafe { regions(&mesh, memory) }?;
    Ok(Input { mesh, config, caller, index, scratch })
}

/// The grid in a blob, and its mesh: the caller's, or NULL for the blob's own.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn open(
    blob: *const c_void,
    blob_bytes: usize,
    description: *const hgrid_mesh,
) -> Result<Grid<'static>, hgrid_status> {
    if description.is_null() {
        // SAFETY: the caller's promise.
        let blob = unsafe { bytes(blob, blob_bytes) }?;
        return Grid::open_packed(blob).map_err(status_of);
    }
    // SAFETY: the caller's promise.
    let description = unsafe { read_sized(description) }?;
    // SAFETY: the caller's promise.
    let mesh = unsafe { mesh(&description) }?;
    // SAFETY: the caller's promise.
    let blob = unsafe { bytes(blob, blob_bytes) }?;
    Grid::open(blob, mesh).map_err(status_of)
}

/// Gives the tree in a blob the boxes of a mesh, notes what that did, and opens it.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn refit(
    description: *const hgrid_mesh,
    blob: RawRegion,
    report: &mut hgrid_refit_report,
) -> Result<Grid<'static>, hgrid_status> {
    if blob.start.is_null() {
        return Err(HGRID_ERROR_NULL_ARGUMENT);
    }
    // SAFETY: the caller's promise.
    let description = unsafe { read_sized(description) }?;
    // SAFETY: the caller's promise.
    let mesh = unsafe { mesh(&description) }?;
    // SAFETY: the caller's promise.
    let [blob, _] = unsafe { regions(&mesh, [blob, RawRegion::NONE]) }?;
    let refitted = hgrid_core::refit(blob, &mesh);
    report.note(&refitted);
    refitted.and_then(|_| Grid::open(blob, mesh)).map_err(status_of)
}

/// Runs a refit that fills a report, which may be NULL.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn reporting_refit(
    report: *mut hgrid_refit_report,
    call: impl FnOnce(&mut hgrid_refit_report) -> Result<(), hgrid_status>,
) -> hgrid_status {
    let mut noted = hgrid_refit_report::empty(0);
    let Some(to) = NonNull::new(report) else {
        return call(&mut noted).err().unwrap_or(HGRID_OK);
    };
    // SAFETY: the caller's promise.
    match unsafe { read_sized(report) } {
        Ok(given) => noted.struct_size = given.struct_size,
        Err(status) => return status,
    }
    let result = call(&mut noted);
    // SAFETY: the caller's promise.
    unsafe { write(to, noted) };
    result.err().unwrap_or(HGRID_OK)
}

/// Reads the header of a blob.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn peek(
    blob: *const c_void,
    blob_bytes: usize,
) -> Result<BlobInfo, hgrid_status> {
    // SAFETY: the caller's promise.
    BlobInfo::peek(unsafe { bytes(blob, blob_bytes) }?).map_err(status_of)
}

/// Writes a grid with its mesh, once it is sure that they lie elsewhere.
///
/// # Safety
/// The contract of [`grid`].
pub(crate) unsafe fn pack(grid: &Grid<'_>, to: RawRegion) -> Result<(), hgrid_status> {
    // SAFETY: the caller's promise.
    let to = unsafe { bytes_beside(grid, to) }?;
    grid.pack(to).map(|_| ()).map_err(status_of)
}

/// Proves that a grid is right, in scratch, once it is sure that this lies elsewhere.
///
/// # Safety
/// The contract of [`grid`].
pub(crate) unsafe fn validate(grid: &Grid<'_>, scratch: RawRegion) -> Result<(), hgrid_status> {
    // SAFETY: the caller's promise.
    let scratch = unsafe { bytes_beside(grid, scratch) }?;
    grid.validate(scratch).map_err(status_of)
}

/// Returns the addresses of some bytes.
fn addresses_of(bytes: &[u8]) -> Addresses {
    Addresses::new(bytes.as_ptr().cast(), bytes.len())
}

/// Returns the addresses of a view.
fn addresses_of_view<T: ?Sized>(view: &T) -> Addresses {
    Addresses::new(core::ptr::from_ref(view).cast(), size_of_val(view))
}

/// Returns the addresses of a caller's view `V`, by what stands in it behind its tag.
fn addresses_around<V, T>(inside: &T, tag_bytes: usize) -> Addresses {
    Addresses::new(core::ptr::from_ref(inside).wrapping_byte_sub(tag_bytes).cast(), size_of::<V>())
}

/// Returns true if a mesh reads something that lies in a range of addresses.
fn shares(mesh: &TriangleMesh<'_>, addresses: Addresses) -> bool {
    let has = |mesh: &TriangleMesh<'_>| {
        let arrays = [mesh.positions(), mesh.triangles(), mesh.masks()];
        arrays.into_iter().any(|array| addresses_of(array.bytes).overlaps(addresses))
    };
    if addresses.is_empty() {
        return false;
    }
    has(mesh)
        || addresses_of(mesh.numbering().as_flattened()).overlaps(addresses)
        || parts::addresses_of(mesh).overlaps(addresses)
        || mesh.parts().iter().any(|part| has(part.mesh()))
}

/// Bytes to write that lie in neither view nor blob nor mesh.
///
/// # Safety
/// The contract of [`grid`].
unsafe fn bytes_beside(grid: &Grid<'_>, to: RawRegion) -> Result<&'static mut [u8], hgrid_status> {
    let view = addresses_around::<hgrid_grid, _>(grid, offset_of!(StoredGrid, grid));
    let is_shared = view.overlaps(to.addresses())
        || addresses_of(grid.blob()).overlaps(to.addresses())
        || shares(grid.mesh(), to.addresses());
    if is_shared {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise; nothing else that this call reads lies there.
    unsafe { bytes_mut(to.start, to.bytes) }
}

/// The grid of a view.
///
/// # Safety
/// The caller's promise; and a view with the right tag was written by [`write_grid`] or copied from
/// one that was, and its blob and its mesh are where they were.
#[inline(always)]
pub(crate) unsafe fn grid<'a>(grid: *const hgrid_grid) -> Result<&'a Grid<'static>, hgrid_status> {
    let view = grid.cast::<StoredGrid>();
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
    unsafe { write(to.cast(), StoredGrid { tag: VIEW_TAG, grid: *grid }) }
}

/// Runs a call that fills a report, which may be NULL.
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

/// Fills a struct that starts with its `struct_size`, if `call` finds out what belongs there.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn filling<T: Copy>(
    to: *mut T,
    call: impl FnOnce(&mut T) -> Result<(), hgrid_status>,
) -> hgrid_status {
    // SAFETY: the caller's promise.
    let filled = unsafe { read_sized(to) }.and_then(|mut value| call(&mut value).map(|()| value));
    match (filled, NonNull::new(to)) {
        (Ok(value), Some(to)) => {
            // SAFETY: the caller's promise.
            unsafe { write(to, value) };
            HGRID_OK
        }
        (Err(status), _) => status,
        (_, None) => HGRID_ERROR_NULL_ARGUMENT,
    }
}
