//! `hgrid_create`: builds a grid in memory that the library allocates. Needs the feature `malloc`.
//!
//! It adds nothing to what [`hgrid_sizes`] and [`hgrid_build`] do: it asks for a bound, gets scratch, asks for the
//! exact size, gets memory for the index, and builds.
//!
//! # Ownership
//!
//! [`Allocation`] is one allocation and frees itself when it is dropped, so that no way out of
//! [`create`] leaks. A grid keeps one `Allocation`: it contains an [`Owned`] and behind it the index.
//! The `Owned` holds the `Allocation` that it lies in, until [`hgrid_destroy`] takes the `Allocation` out
//! and drops it.
//!
//! "The caller's promise" in a SAFETY comment is that of `raw`, and for an allocator what
//! [`hgrid_allocator`] asks of it.
//!
//! [`hgrid_sizes`]: crate::hgrid_sizes
//! [`hgrid_build`]: crate::hgrid_build

use core::ffi::c_void;
use core::ptr::{NonNull, null_mut};

use crate::addresses::RawRegion;
use crate::raw;
use crate::status::{
    HGRID_ERROR_MISALIGNED, HGRID_ERROR_NULL_ARGUMENT, HGRID_ERROR_OUT_OF_MEMORY,
    HGRID_ERROR_STRUCT_SIZE, hgrid_status,
};
use crate::system;
use crate::types::{HGRID_ALIGNMENT, hgrid_config, hgrid_grid, hgrid_mesh, hgrid_report};

/// The source of memory for `hgrid_create`. Initialise it with
/// `HGRID_ALLOCATOR_INIT` and set both functions.
///
/// The struct itself is only read during the call, but `hgrid_destroy` calls `release` with the
/// same `context`, so both must last as long as the grid. Neither function may be left by
/// `longjmp` or by a C++ exception.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_allocator {
    /// `sizeof(hgrid_allocator)`.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Yours: passed on to both functions.
    pub context: *mut c_void,
    /// Gives `bytes` bytes, never 0 of them, that start at a multiple of `alignment`, a power of
    /// two, and that nothing else uses until they are released. They may hold anything. NULL if
    /// there are no more. Called on the thread that calls `hgrid_create`. May not be NULL.
    pub allocate: Option<
        unsafe extern "C" fn(context: *mut c_void, bytes: usize, alignment: usize) -> *mut c_void,
    >,
    /// Takes back what `allocate` gave, with the `bytes` and the `alignment` that it was asked for.
    /// Called on the thread that calls `hgrid_create` or `hgrid_destroy`. May not be NULL.
    pub release: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            memory: *mut c_void,
            bytes: usize,
            alignment: usize,
        ),
    >,
}

/// Builds a grid in memory that the library gets itself: `hgrid_sizes`, without scratch and
/// with, and `hgrid_build`, in one call.
///
/// Only in libraries that were built with the feature `malloc`, and declared only where `HGRID_MALLOC` is
/// defined. It takes as long as those three calls. To build again for every frame, keep the memory and
/// call `hgrid_build`.
///
/// ```c
/// static size_t count_hits(const hgrid_mesh *mesh, const hgrid_ray *rays, size_t count)
/// {
///     hgrid_grid *grid;
///     if (hgrid_create(mesh, NULL, NULL, &grid, NULL) != HGRID_OK)
///         return 0;
///     hgrid_hit hit;
///     size_t found = 0;
///     for (size_t i = 0; i < count; i++)
///         found += hgrid_intersect(grid, &rays[i], NULL, &hit);
///     hgrid_destroy(grid);
///     return found;
/// }
/// ```
///
/// `allocator` says where memory comes from; NULL means the C library, as with `malloc`. It is
/// asked twice: for the scratch, which is given back before the call returns, and for the grid,
/// which takes what `hgrid_sizes` tells, to the byte, and less than 1 KiB for the view. The mesh
/// stays yours and where it is, as after `hgrid_build`.
///
/// `mesh` and `grid` may not be NULL. `config` may be NULL: the defaults. `allocator` may be NULL.
/// `report` may be NULL.
///
/// Returns `HGRID_OK` and writes the address of the view to `grid`; or returns the reason, has
/// given back all memory, and leaves `grid` as it was. `HGRID_ERROR_OUT_OF_MEMORY` says that the
/// allocator had no more, and the report how much was needed; `HGRID_ERROR_MISALIGNED` that what it
/// gave does not start at a multiple of the alignment. All else is what `hgrid_build` returns. The
/// report is that of `hgrid_build`.
///
/// Threads: any number of calls at once, if the allocator's functions allow it.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_create(
    mesh: *const hgrid_mesh,
    config: *const hgrid_config,
    allocator: *const hgrid_allocator,
    grid: *mut *mut hgrid_grid,
    report: *mut hgrid_report,
) -> hgrid_status {
    let call = |report: &mut hgrid_report| {
        let to = NonNull::new(grid).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        let allocator = unsafe { Allocator::of(allocator) }?;
        // SAFETY: the caller's promise.
        let created = unsafe { create(mesh, config, allocator, report) }?;
        // SAFETY: the caller's promise.
        unsafe { raw::write(to, created.as_ptr()) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting(report, call) }
}

/// Gives back all memory of a grid that `hgrid_create` made.
///
/// `grid` may be NULL: nothing happens. Otherwise it is what `hgrid_create` wrote, and is destroyed once: not the
/// view of a build or of an open, and no copy of a view. No query may run during the call, and copies of the view may
/// not be used afterwards.
///
/// Threads: any number of calls at once, each for a grid of its own, if the allocator's functions
/// allow it; on any thread, not only on the one that created the grid.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_destroy(grid: *mut hgrid_grid) {
    let Some(grid) = NonNull::new(grid) else { return };
    // SAFETY: the caller's promise: `create` made it, so there is an `Owned`, and it is destroyed
    // once, so its `Allocation` is still there.
    drop(unsafe { grid.cast::<Owned>().read() }.memory);
}

/// The head of a created grid, in front of its index: the view, where C looks for it, and the memory
/// that both lie in.
#[repr(C, align(64))]
struct Owned {
    view: hgrid_grid,
    memory: Allocation,
}

const _: () = assert!(align_of::<Owned>() == HGRID_ALIGNMENT);
const _: () = assert!(size_of::<Owned>() <= 1024);

/// Asks, gets memory, builds.
///
/// # Safety
/// The caller's promise.
unsafe fn create(
    mesh: *const hgrid_mesh,
    config: *const hgrid_config,
    allocator: Allocator,
    report: &mut hgrid_report,
) -> Result<NonNull<hgrid_grid>, hgrid_status> {
    let none = RawRegion { start: null_mut(), bytes: 0 };
    // Finds how much scratch is enough, and with it how much index the grid takes, to the byte.
    // SAFETY: the caller's promise.
    unsafe { raw::input(mesh, config, [none, none]) }?.measure(report)?;
    let scratch = Allocation::new(allocator, 0, report.scratch_bytes)?;
    // SAFETY: the caller's promise.
    unsafe { raw::input(mesh, config, [none, scratch.behind(0)]) }?.measure(report)?;

    let memory = Allocation::new(allocator, size_of::<Owned>(), report.index_bytes)?;
    let regions = [memory.behind(size_of::<Owned>()), scratch.behind(0)];
    // SAFETY: the caller's promise.
    let built = unsafe { raw::input(mesh, config, regions) }?.build(report)?;

    let owned = memory.start.cast::<Owned>();
    // SAFETY: `memory` has room for an `Owned`, aligned, and the index lies behind it.
    unsafe { owned.write(Owned { view: hgrid_grid::NONE, memory }) };
    // SAFETY: the view comes first in what was just written.
    unsafe { raw::write_grid(owned.cast(), &built) };
    Ok(owned.cast())
}

/// An [`hgrid_allocator`] that has both functions. Whoever made it promised that they keep its contract.
#[derive(Debug, Clone, Copy)]
struct Allocator {
    context: *mut c_void,
    allocate: unsafe extern "C" fn(*mut c_void, usize, usize) -> *mut c_void,
    release: unsafe extern "C" fn(*mut c_void, *mut c_void, usize, usize),
}

impl Allocator {
    /// The caller's; NULL means the system's.
    ///
    /// # Safety
    /// The caller's promise.
    unsafe fn of(allocator: *const hgrid_allocator) -> Result<Self, hgrid_status> {
        if allocator.is_null() {
            return Ok(Self { context: null_mut(), allocate: system::give, release: system::take });
        }
        // SAFETY: the caller's promise.
        let hgrid_allocator { reserved, context, allocate, release, .. } =
            unsafe { raw::read_sized(allocator) }?;
        if reserved != 0 {
            return Err(HGRID_ERROR_STRUCT_SIZE);
        }
        let allocate = allocate.ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        let release = release.ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        Ok(Self { context, allocate, release })
    }
}

/// One allocation, given back when this is dropped. It starts at a multiple of [`HGRID_ALIGNMENT`].
struct Allocation {
    allocator: Allocator,
    start: NonNull<c_void>,
    bytes: usize,
}

impl Allocation {
    /// Gets memory for `head` bytes and `body` more, which together are not 0.
    fn new(allocator: Allocator, head: usize, body: u64) -> Result<Self, hgrid_status> {
        let bytes = usize::try_from(body).ok().and_then(|body| body.checked_add(head));
        let bytes = bytes.ok_or(HGRID_ERROR_OUT_OF_MEMORY)?;
        // SAFETY: by the promise of the one who made the allocator; not 0 bytes, a power of two.
        let start = unsafe { (allocator.allocate)(allocator.context, bytes, HGRID_ALIGNMENT) };
        let start = NonNull::new(start).ok_or(HGRID_ERROR_OUT_OF_MEMORY)?;
        let memory = Self { allocator, start, bytes };
        if start.addr().get().is_multiple_of(HGRID_ALIGNMENT) {
            Ok(memory)
        } else {
            Err(HGRID_ERROR_MISALIGNED)
        }
    }

    /// All but the first so many bytes.
    fn behind(&self, head: usize) -> RawRegion {
        let start = self.start.as_ptr().wrapping_byte_add(head);
        RawRegion { start, bytes: self.bytes.saturating_sub(head) }
    }
}

impl Drop for Allocation {
    fn drop(&mut self) {
        let Self { allocator: Allocator { context, release, .. }, start, bytes } = *self;
        // SAFETY: by the promise of the one who made the allocator: what its `allocate` gave, with
        // the numbers that it got, and only here.
        unsafe { release(context, start.as_ptr(), bytes, HGRID_ALIGNMENT) }
    }
}
