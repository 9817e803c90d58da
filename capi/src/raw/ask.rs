//! Queries: rays, options and answers, by their addresses.
//!
//! "The caller's promise" is the contract at the head of the module above.

use core::ptr::NonNull;

use hgrid_core::{
    ClosestPoint, Counters, Cull, Error, Grid, Hit, QueryOptions, Ray, Surface, Verdict,
};

use super::{bytes_mut, grid, read, read_sized, write};
use crate::batch::Batch;
use crate::questions::{hgrid_counters, hgrid_hit, hgrid_query_options, hgrid_ray, verdict};
use crate::status::{
    HGRID_ERROR_INVALID_ANSWERS, HGRID_ERROR_NULL_ARGUMENT, hgrid_status, status_of,
};
use crate::types::{Elements, hgrid_grid};

/// The options of a query, `None` if they are the defaults.
///
/// # Safety
/// The caller's promise.
#[inline(always)]
unsafe fn options(options: *const hgrid_query_options) -> Result<Option<Asked>, hgrid_status> {
    if options.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    let options = unsafe { read_sized(options) }?;
    let cull = options.cull()?;
    Ok(if options.are_default() { None } else { Some(Asked { options, cull }) })
}

/// What a caller told a query.
struct Asked {
    options: hgrid_query_options,
    cull: Cull,
}

impl Asked {
    /// Asks a question with the options as core knows them, about the ray at a place of its batch,
    /// and adds the work to the caller's.
    ///
    /// # Safety
    /// The caller's promise.
    unsafe fn ask<T>(&self, ray: usize, ask: impl FnOnce(&mut QueryOptions<'_>) -> T) -> T {
        // SAFETY: this function's contract.
        unsafe { self.ask_and_see(ray, |_| {}, ask) }
    }

    /// The same; `see` is shown what the caller's filter accepts.
    ///
    /// # Safety
    /// The caller's promise.
    unsafe fn ask_and_see<T>(
        &self,
        ray: usize,
        mut see: impl FnMut(hgrid_hit),
        ask: impl FnOnce(&mut QueryOptions<'_>) -> T,
    ) -> T {
        let hgrid_query_options { mask, skip, context, filter, counters, .. } = self.options;
        let mut work = Counters::default();
        let mut offer = |hit: &Hit| {
            let hit = hgrid_hit::from(*hit);
            let Some(filter) = filter else { return Verdict::Accept };
            // SAFETY: a function of this type by the caller's promise;
            // the hit lives until it returns.
            let verdict = verdict(unsafe { filter(context, ray, &raw const hit) });
            if verdict != Verdict::Reject {
                see(hit);
            }
            verdict
        };
        let mut options = QueryOptions { mask, cull: self.cull, skip, ..QueryOptions::default() };
        if filter.is_some() {
            options.filter = Some(&mut offer);
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

/// Runs a query, with options if there are any. An error if there is nothing to ask.
///
/// # Safety
/// That of [`grid`].
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
    let ray = unsafe { read(ray) }?.into();
    // SAFETY: the caller's promise.
    match unsafe { options(asked) }? {
        None => Ok(plain(grid, &ray)),
        // SAFETY: the caller's promise.
        Some(asked) => Ok(unsafe { asked.ask(0, |options| with(grid, &ray, options)) }),
    }
}

/// All hits of a ray, into memory for some of them; returns how many there are.
///
/// # Safety
/// That of [`grid`].
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
    let ray = unsafe { read(ray) }?.into();
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
        return Ok(unsafe { asked.ask_and_see(0, see, all) });
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
        Some(asked) => Ok(unsafe { asked.ask(0, all) }),
    }
}

/// The closest point, as core finds it.
///
/// # Safety
/// That of [`grid`].
pub(crate) unsafe fn closest(
    view: *const hgrid_grid,
    point: *const f32,
    max_distance: f32,
    asked: *const hgrid_query_options,
) -> Result<Option<ClosestPoint>, hgrid_status> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    // SAFETY: the caller's promise: three of them.
    let point = unsafe { read(point.cast::<[f32; 3]>()) }?;
    let find = |options: &mut QueryOptions<'_>| grid.closest_point(point, max_distance, options);
    // SAFETY: the caller's promise.
    match unsafe { options(asked) }? {
        None => Ok(find(&mut QueryOptions::default())),
        // SAFETY: the caller's promise.
        Some(asked) => Ok(unsafe { asked.ask(0, find) }),
    }
}

/// Where a ray met a grid's mesh.
///
/// # Safety
/// That of [`grid`].
pub(crate) unsafe fn surface(
    view: *const hgrid_grid,
    ray: *const hgrid_ray,
    hit: *const hgrid_hit,
) -> Result<Option<Surface>, hgrid_status> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    // SAFETY: the caller's promise.
    let ray = unsafe { read(ray) }?;
    // SAFETY: the caller's promise.
    let hit = unsafe { read(hit) }?;
    Ok(grid.mesh().surface(&ray.into(), &hit.into()))
}

/// How many rays of a batch are read before their answers are written: as many as go through a grid
/// together. The buffers are 6 KiB.
const CHUNK: usize = 128;

/// Runs a batch: `many` answers a chunk of rays, or with options `one` a single ray.
/// `unanswered` is written nowhere.
///
/// # Safety
/// That of [`grid`]; and the elements of both arrays are the caller's to be read and written.
pub(crate) unsafe fn batch<A: Copy, T: From<A>>(
    view: *const hgrid_grid,
    batch: &Batch<T>,
    asked: *const hgrid_query_options,
    unanswered: A,
    many: impl Fn(&Grid<'static>, &[Ray], &mut [A]) -> Result<(), Error>,
    one: impl Fn(&Grid<'static>, &Ray, &mut QueryOptions<'_>) -> A,
) -> Result<(), hgrid_status> {
    // SAFETY: this function's contract.
    let grid = unsafe { grid(view) }?;
    // SAFETY: the caller's promise.
    let asked = unsafe { options(asked) }?;
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
        match &asked {
            None => many(grid, rays, answers).map_err(status_of)?,
            Some(asked) => {
                for (index, (ray, answer)) in (first..).zip(rays.iter().zip(&mut *answers)) {
                    // SAFETY: the caller's promise.
                    *answer = unsafe { asked.ask(index, |options| one(grid, ray, options)) };
                }
            }
        }
        for (index, &answer) in (first..).zip(&*answers) {
            // SAFETY: within the array by its index, writable by this function's contract.
            unsafe { batch.answer(index).write_unaligned(answer.into()) };
        }
    }
    Ok(())
}

/// Adds the work of queries to the caller's.
///
/// # Safety
/// The caller's promise.
unsafe fn add(to: NonNull<hgrid_counters>, work: &Counters) {
    // SAFETY: the caller's promise: not NULL, so aligned and readable.
    let mut sum = Counters::from(unsafe { to.read() });
    sum.add(work);
    // SAFETY: the caller's promise.
    unsafe { write(to, sum.into()) };
}
