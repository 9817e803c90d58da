//! A batch of rays, group by group.
//!
//! ```text
//! for each window of rays, as many as there is memory to sort:
//!     sort them if they are scattered (order.rs)
//!     for each 64: trace them as a group (group.rs), answer each in its place; those that cannot go along, alone
//! ```

use super::Bvh;
use super::group::{Group, Stack};
use super::order::{self, SortKey, Sorted};
use super::rays::{GROUP, Rays};
use crate::aabb::Aabb;
use crate::filter::RayFilter;
use crate::mesh::TriangleMesh;
use crate::options::{Choice, Cull};
use crate::ray::{Hit, INVALID_ID, Ray};
use crate::simd::SimdLevel;
use crate::triangle::TriangleTest;

/// A batch as the loop over its groups sees it.
pub(crate) trait Together {
    /// Number of rays.
    fn count(&self) -> usize;

    /// The ray at a place.
    fn ray(&self, place: usize) -> Ray;

    /// Loads the ray at a place into a lane of the next group, and returns it. Lanes are filled one after the other.
    #[inline(always)]
    fn load(&mut self, _lane: usize, place: usize) -> Ray {
        self.ray(place)
    }

    /// Traces a group. Returns a mask of the rays that must be traced alone.
    #[inline(always)]
    fn trace(&mut self, group: &mut Group<'_>, level: SimdLevel, is_any: bool) -> u64 {
        group.trace(level, is_any)
    }

    /// Answers for a ray that was traced with others: its lane in the group, and its hit or [`Hit::MISS`].
    fn found(&mut self, place: usize, lane: usize, hit: &Hit);

    /// Traces a ray alone, and answers for it.
    fn alone(&mut self, place: usize);

    /// Returns true if [`alone`](Self::alone) and [`ask`](Self::ask) have to be called in the order of
    /// places: a filter is asked there.
    #[inline(always)]
    fn keeps_order(&self) -> bool {
        false
    }

    /// Returns true if the filter has to be asked about the first hit of a ray.
    #[inline(always)]
    fn asks(&self, _hit: &Hit) -> bool {
        false
    }

    /// Asks the filter about the first hit of a ray, goes on alone if it wants another, and answers.
    fn ask(&mut self, _place: usize, _hit: &Hit) {}
}

/// The rays of a batch, which go in groups.
pub(crate) struct Groups<'r, C> {
    pub(crate) bvh: &'r Bvh<'r>,
    pub(crate) mesh: &'r TriangleMesh<'r>,
    pub(crate) bounds: Aabb,
    pub(crate) choice: Choice,
    /// The memory to sort rays in; empty if rays keep their order.
    pub(crate) memory: &'r mut [SortKey],
    pub(crate) batch: &'r mut C,
}

impl<C: Together> Groups<'_, C> {
    /// Answers all rays; with `is_any` the first hit of a ray ends it.
    #[inline(always)]
    pub(crate) fn trace(self, level: SimdLevel, is_any: bool) {
        let Self { bvh, mesh, bounds, choice, memory, batch } = self;
        let (mut rays, mut stack) = (Rays::new(choice), Stack::new());
        let (rays, stack) = (&mut rays, &mut stack);
        let mut group = Group { bvh, mesh, bounds: &bounds, rays, stack, count: 0, until: None };
        let mut places = [0; GROUP];
        let window = order::window(memory);
        let all = batch.count();
        let mut first = 0;
        while first < all {
            // Sort a window of rays, or take all of them as they are.
            let of_window = if window > 0 { window.min(all - first) } else { all };
            let mut order = if window > 0 {
                order::sort(batch, first, of_window, &bounds, memory)
            } else {
                None
            };
            for start in (0..of_window).step_by(GROUP) {
                group.count = (of_window - start).min(GROUP);
                let slots = places.iter_mut().zip(group.rays.slots()).enumerate();
                for (lane, (place, ray)) in slots.take(group.count) {
                    let at = start + lane;
                    *place = first + order.as_ref().map_or(at, |order| order.place(at));
                    *ray = batch.load(lane, *place);
                }
                let alone = batch.trace(&mut group, level, is_any);
                for (lane, &place) in places.iter().enumerate().take(group.count) {
                    let (is_alone, hit) = (alone >> lane & 1 != 0, &group.rays.hits[lane % GROUP]);
                    if !is_alone && !batch.asks(hit) {
                        batch.found(place, lane, hit);
                    } else if batch.keeps_order()
                        && let Some(order) = &mut order
                    {
                        order.defer(
                            place - first,
                            if is_alone { INVALID_ID } else { hit.primitive },
                        );
                    } else if is_alone {
                        batch.alone(place);
                    } else {
                        batch.ask(place, hit);
                    }
                }
            }
            if batch.keeps_order()
                && let Some(order) = &order
            {
                take_turns(batch, mesh, choice.cull, order, first);
            }
            first += of_window;
        }
    }
}

/// Finishes the rays of a sorted window that wait for the filter, in the caller's order.
#[inline(never)]
fn take_turns(
    batch: &mut impl Together,
    mesh: &TriangleMesh<'_>,
    cull: Cull,
    order: &Sorted<'_>,
    first: usize,
) {
    for (at, id) in order.deferred() {
        let place = first + at;
        // This gives the same bits as the group did.
        let test = TriangleTest::with(&batch.ray(place), RayFilter::NONE).culling(cull);
        let hit = if id == INVALID_ID { Hit::MISS } else { test.decide(mesh, id) };
        if hit.primitive == INVALID_ID {
            batch.alone(place);
        } else {
            batch.ask(place, &hit);
        }
    }
}
