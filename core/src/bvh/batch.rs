//! A batch of rays, group by group.
//!
//! ```text
//! for each window of rays, as many as there is memory to sort:
//!     sort them if they are scattered (order.rs)
//!     for each 64: trace them as a group (group.rs), then those alone that it left; answer each ray
//! ```

use super::Bvh;
use super::group::{Group, Together};
use super::order::{self, SortKey, Sorted};
use super::per_ray::GROUP;
use super::rays::Rays;
use super::stack::GroupStack;
use crate::aabb::Aabb;
use crate::filter::RayFilter;
use crate::mesh::TriangleMesh;
use crate::options::{Choice, Cull};
use crate::ray::{Hit, INVALID_ID};
use crate::simd::SimdLevel;
use crate::triangle::TriangleTest;

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
        let (mut rays, mut stack) = (Rays::new(choice), GroupStack::new());
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
                        let id = if is_alone { INVALID_ID } else { hit.primitive };
                        order.defer(place - first, id);
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
                finish_deferred(batch, mesh, choice.cull, order, first);
            }
            first += of_window;
        }
    }
}

/// Finishes the rays of a sorted window that wait for the filter, in the caller's order.
#[inline(never)]
fn finish_deferred(
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
