//! Queries: rays, options and answers, by their addresses.
//!
//! "The caller's promise" is the contract at the head of `raw` (mod.rs).

use core::ptr::NonNull;

use hgrid_core::{
    ClosestPoint, Counters, Cull, Grid, Hit, QueryOptions, Ray, Surface, TriangleMesh, Verdict,
};

use super::batch::{BatchArrays, RunningBatch};
use super::{bytes_beside, bytes_mut, grid, read, read_sized, write};
use crate::addresses::RawRegion;
use crate::misuse::{CallersRay as _, checked};
use crate::query_types::{
    self, hgrid_counters, hgrid_hit, hgrid_point_query, hgrid_query_options, hgrid_ray, verdict,
};
use crate::status::{
    HGRID_ERROR_INVALID_ANSWERS, HGRID_ERROR_NULL_ARGUMENT, HGRID_ERROR_OVERLAP,
    HGRID_ERROR_STRUCT_SIZE, hgrid_status,
};
use crate::types::{Elements, hgrid_grid};

/// Reads the options of a query; `None` if all of them are the defaults.
///
/// # Safety
/// The caller's promise.
#[inline(always)]
unsafe fn options(options: *const hgrid_query_options) -> Result<Option<Asked>, hgrid_status> {
    // SAFETY: the caller's promise.
    let asked = unsafe { all_options(options) }?;
    Ok(asked.filter(|asked| !asked.options.are_default()))
}

/// Reads the options of a query; `None` if the caller gave none.
///
/// # Safety
/// The caller's promise.
#[inline(always)]
pub(super) unsafe fn all_options(
    options: *const hgrid_query_options,
) -> Result<Option<Asked>, hgrid_status> {
    if options.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    let options = unsafe { read_sized(options) }?;
    if options.reserved != 0 {
        return Err(HGRID_ERROR_STRUCT_SIZE);
    }
    Ok(Some(Asked { options, cull: options.cull()? }))
}

/// The options that a caller gave a query.
pub(super) struct Asked {
    pub(super) options: hgrid_query_options,
    cull: Cull,
}

impl Asked {
    /// Asks a question with the options as core knows them, and adds the work to the caller's.
    ///
    /// # Safety
    /// The caller's promise.
    pub(super) unsafe fn ask<T>(&self, ask: impl FnOnce(&mut QueryOptions<'_>) -> T) -> T {
        // SAFETY: this function's contract.
        unsafe { self.ask_and_see(None, |_| {}, ask) }
    }

    /// [`ask`](Self::ask) with `see`, which is shown what counts: what the caller's filter accepts, and the opaque
    /// triangles of the mesh if there is one.
    ///
    /// # Safety
    /// The caller's promise.
    unsafe fn ask_and_see<T>(
        &self,
        mesh: Option<&TriangleMesh<'_>>,
        mut see: impl FnMut(hgrid_hit),
        ask: impl FnOnce(&mut QueryOptions<'_>) -> T,
    ) -> T {
        let hgrid_query_options { mask, skip, context, filter, counters, .. } = self.options;
        let filter_mask = query_types::filter_mask(self.options.filter_mask);
        let mut work = Counters::default();
        let is_opaque = |hit: &Hit| {
            let mask = |mesh: &TriangleMesh<'_>| mesh.mask(hit.primitive);
            filter_mask != u32::MAX && mesh.is_some_and(|mesh| mask(mesh) & filter_mask == 0)
        };
        let mut offer = |ray: usize, offered: &Hit| {
            let hit = hgrid_hit::from(*offered);
            let verdict = match filter {
                Some(filter) if !is_opaque(offered) => {
                    // SAFETY: a function of this type by the caller's promise;
                    // the hit lives until it returns.
                    verdict(unsafe { filter(context, ray, &raw const hit) })
                }
                _ => Verdict::Accept,
            };
            if verdict != Verdict::Reject {
                see(hit);
            }
            verdict
        };
        let mut options = QueryOptions { mask, cull: self.cull, skip, ..QueryOptions::default() };
        if filter.is_some() {
            options.filter = Some(&mut offer);
            // With a mesh the opaque triangles have to be seen, too.
            options.filter_mask = if mesh.is_some() { u32::MAX } else { filter_mask };
        }
        if counters.is_null() {
            return ask(&mut options);
        }
        options.counters = Some(&mut work);
        let answer = ask(&mut options);
        if let Some(counters) = NonNull::new(counters) {
            // SAFETY: the caller's promise.
            unsafe { add(counters, &work) }
        }
        answer
    }
}

/// Runs a query, with options if there are any. An error if an argument is invalid.
///
/// # Safety
/// The contract of [`grid`].
#[inline(always)]
pub(crate) unsafe fn query<T>(
    view: *const hgrid_grid,
    ray: *const hgrid_ray,
    asked: *const hgrid_query_options,
    plain: impl FnOnce(&Grid<'static>, &Ray) -> T,
    with: impl FnOnce(&Grid<'static>, &Ray, &mut QueryOptions<'_>) -> T,
) -> Result<T, hgrid_status> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    // SAFETY: the caller's promise.
    let ray = unsafe { read(ray) }?.checked().into();
    // SAFETY: the caller's promise.
    match checked(unsafe { options(asked) })? {
        None => Ok(plain(grid, &ray)),
        // SAFETY: the caller's promise.
        Some(asked) => Ok(unsafe { asked.ask(|options| with(grid, &ray, options)) }),
    }
}

/// All hits of a ray, into memory for some of them; returns how many there are.
///
/// # Safety
/// The contract of [`grid`].
pub(crate) unsafe fn query_all(
    view: *const hgrid_grid,
    ray: *const hgrid_ray,
    asked: *const hgrid_query_options,
    hits: *mut hgrid_hit,
    capacity: usize,
) -> Result<usize, hgrid_status> {
    let elements = Elements::new(hits.cast(), 0, capacity, size_of::<hgrid_hit>());
    let bytes = elements.ok_or(HGRID_ERROR_INVALID_ANSWERS)?.bytes;
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    // SAFETY: the caller's promise.
    let ray = unsafe { read(ray) }?.checked().into();
    // SAFETY: the caller's promise.
    let asked = unsafe { options(asked) }?;
    if hits.is_null() && capacity > 0 {
        return Err(HGRID_ERROR_NULL_ARGUMENT);
    }
    if let Some(asked) = asked.as_ref().filter(|asked| asked.options.filter.is_some()) {
        // A filter may look at what it has accepted: so nothing refers to the hits while it runs.
        let mut count = 0;
        let see = |hit| {
            if count < capacity {
                // SAFETY: the caller's promise, and within the array.
                unsafe { hits.wrapping_add(count).write(hit) };
                count += 1;
            }
        };
        let all = |options: &mut QueryOptions<'_>| grid.intersect_all(&ray, options, &mut []);
        // SAFETY: the caller's promise.
        return Ok(unsafe { asked.ask_and_see(Some(grid.mesh()), see, all) });
    }
    // SAFETY: the caller's promise; hits overlap nothing else that the call uses.
    let hits = unsafe { bytes_mut(hits.cast(), bytes) }?;
    // SAFETY: any bytes are hits, and `Hit` is laid out as `hgrid_hit`; what is not aligned, which
    // by the caller's promise nothing is, is left out.
    let (_, hits, _) = unsafe { hits.align_to_mut::<Hit>() };
    let mut all = |options: &mut QueryOptions<'_>| grid.intersect_all(&ray, options, hits);
    match asked {
        None => Ok(all(&mut QueryOptions::default())),
        // SAFETY: the caller's promise.
        Some(asked) => Ok(unsafe { asked.ask(all) }),
    }
}

/// The closest point, as core finds it.
///
/// # Safety
/// The contract of [`grid`].
pub(crate) unsafe fn closest_point(
    view: *const hgrid_grid,
    query: *const hgrid_point_query,
    asked: *const hgrid_query_options,
) -> Result<Option<ClosestPoint>, hgrid_status> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    // SAFETY: the caller's promise.
    let hgrid_point_query { point, max_distance } = unsafe { read(query) }?;
    let find = |options: &mut QueryOptions<'_>| grid.closest_point(point, max_distance, options);
    // SAFETY: the caller's promise.
    match checked(unsafe { options(asked) })? {
        None => Ok(find(&mut QueryOptions::default())),
        // SAFETY: the caller's promise.
        Some(asked) => Ok(unsafe { asked.ask(find) }),
    }
}

/// Returns the point where a ray met a grid's mesh.
///
/// # Safety
/// The contract of [`grid`].
pub(crate) unsafe fn surface(
    view: *const hgrid_grid,
    ray: *const hgrid_ray,
    hit: *const hgrid_hit,
) -> Result<Option<Surface>, hgrid_status> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    // SAFETY: the caller's promise.
    let ray = unsafe { read(ray) }?.checked();
    // SAFETY: the caller's promise.
    let hit = unsafe { read(hit) }?;
    Ok(grid.mesh().surface(&ray.into(), &hit.into()))
}

/// The part of a grid's mesh that a triangle lies in, and the triangle's number there.
///
/// # Safety
/// The contract of [`grid`].
#[inline(always)]
pub(crate) unsafe fn locate(
    view: *const hgrid_grid,
    primitive: u32,
) -> Result<Option<(u32, u32)>, hgrid_status> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    Ok(grid.mesh().locate(primitive))
}

/// Runs a batch: `trace` gets the rays as core asks for them, and the caller's options.
///
/// # Safety
/// The contract of [`grid`]; and the elements of both arrays are the caller's to be read and written.
pub(crate) unsafe fn batch<T>(
    view: *const hgrid_grid,
    batch: &BatchArrays<hgrid_ray, T>,
    asked: *const hgrid_query_options,
    trace: impl FnOnce(&Grid<'static>, &mut RunningBatch<'_, hgrid_ray, T>, &mut QueryOptions<'_>),
) -> Result<(), hgrid_status> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    // SAFETY: the caller's promise.
    let asked = unsafe { all_options(asked) }?;
    // SAFETY: this function's contract, and any bytes are a ray.
    let mut arrays = unsafe { RunningBatch::new(batch) };
    let Some(asked) = asked else {
        trace(grid, &mut arrays, &mut QueryOptions::default());
        return Ok(());
    };
    let hgrid_query_options { scratch, scratch_bytes, .. } = asked.options;
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    if batch.overlaps(scratch.addresses()) {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: this function's contract, and no element of the batch lies there.
    let scratch = unsafe { bytes_beside(grid, scratch) }?;
    let trace = |options: &mut QueryOptions<'_>| {
        options.scratch = scratch;
        trace(grid, &mut arrays, options);
    };
    // SAFETY: the caller's promise.
    unsafe { asked.ask(trace) };
    Ok(())
}

/// Adds the work of queries to the caller's.
///
/// # Safety
/// The caller's promise.
pub(super) unsafe fn add(to: NonNull<hgrid_counters>, work: &Counters) {
    // SAFETY: the caller's promise: not NULL, so aligned and readable.
    let mut sum = Counters::from(unsafe { to.read() });
    sum.add(work);
    // SAFETY: the caller's promise.
    unsafe { write(to, sum.into()) };
}
