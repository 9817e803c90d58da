//! Scattered rays of a group, interleaved: each goes its own way through the tree, and eight take turns.
//!
//! Rays that start far apart share few nodes and triangles. In a tree larger than the caches of a core, a ray traced
//! alone waits for memory at each step. Here a ray prefetches what its next step reads, while the others take their
//! steps.
//!
//! ```text
//! in turn, for each of eight rays:
//!     node    intersect the ray with its boxes, push those that it meets but the nearest, go on with that one
//!     leaf    first turn: prefetch the indices of its triangles; second: their corners; third: test them
//!     then    if there is no child to go on with, pop the nearest
//!             prefetch that child: a node, or the ids of a leaf
//!             if there is none, the next ray of the group takes these turns
//! ```
//!
//! This is asynchronous memory access chaining (Kocberber, Falsafi and Grot 2015), which they use for lookups in
//! databases.

use fearless_simd::Simd;

use super::Bvh;
use super::boxes::{WideBoxes, bits};
use super::group_leaf::{Leaf, filter_for_each};
use super::node::{Child, WIDTH};
use super::rays::Rays;
use super::stack::{GroupStack, STACK, StackEntry, pop, push};
use crate::aabb::Aabb;
use crate::budget::Budget;
use crate::mesh::TriangleMesh;
use crate::simd::prefetch;

/// Rays that take turns.
const IN_FLIGHT: usize = 8;

/// Children that may wait for each of them, in a share of the group's stack. Few trees need more; a ray that does is
/// traced alone.
const DEPTH: usize = 7 * 8;
const _: () = assert!(IN_FLIGHT * DEPTH <= 2 * STACK);

/// A ray on its way.
#[derive(Clone, Copy)]
struct Traveller {
    /// The slot in its group.
    ray: u32,
    /// The next child to enter; `None` if the ray is done.
    child: Option<Child>,
    /// Turns since this child was found.
    turns: u32,
    /// Children on the stack.
    top: usize,
    budget: Budget,
}

/// Finds the closest hit of each ray of a prepared group. Returns a mask of the rays that must be traced alone.
#[inline(always)]
pub(super) fn trace<S: Simd>(
    simd: S,
    bvh: &Bvh<'_>,
    mesh: &TriangleMesh<'_>,
    bounds: &Aabb,
    rays: &mut Rays,
    stack: &mut GroupStack,
) -> u64 {
    let (triangles, budget) = (mesh.wide(), bvh.budget());
    let start = |ray| Traveller { ray, child: Some(Child::Inner(0)), turns: 0, top: 0, budget };
    let mut travellers = [Traveller { child: None, ..start(0) }; IN_FLIGHT];
    let (mut queue, mut alone) = (rays.alive, 0);
    loop {
        let mut are_done = true;
        for (one, stack) in travellers.iter_mut().zip(stack.shares(DEPTH)) {
            if one.child.is_none() && queue != 0 {
                *one = start(queue.trailing_zeros());
                queue &= queue - 1;
            }
            let Some(child) = one.child else { continue };
            are_done = false;
            // A leaf takes three turns and counts once.
            let is_new = one.turns == 0;
            if is_new && !one.budget.take(1) {
                one.child = None;
                continue;
            }

            // Enter the child, or fetch what it holds.
            let next = match child {
                Child::Inner(number) => {
                    if one.top + (WIDTH - 1) > stack.len() {
                        alone |= 1 << one.ray;
                        one.child = None;
                        continue;
                    }
                    enter_node(simd, bvh, rays, one, stack, number)
                }
                Child::Leaf { first, count } => {
                    let ids = bvh.leaf(first, count);
                    one.turns += 1;
                    if one.turns < 3 && !triangles.is_empty() {
                        for &id in ids {
                            if one.turns == 1 {
                                triangles.indices(id).map(prefetch);
                            } else {
                                triangles.corners(id).map(|corners| corners.map(prefetch));
                            }
                        }
                        continue;
                    }
                    let leaf = Leaf { bvh, mesh, bounds, first, ids };
                    filter_for_each::<S, false>(simd, &leaf, rays, 1 << one.ray);
                    rays.decide::<S, false>(simd, mesh);
                    None
                }
            };

            // Fetch what its next turn reads.
            one.child = next.or_else(|| pop(bvh, stack, &mut one.top, rays.end_of(one.ray)));
            one.turns = 0;
            if let Some(child) = one.child {
                bvh.prefetch(child);
            }
        }
        if are_done {
            return alone;
        }
    }
}

/// Intersects a ray with the boxes of a node. Pushes those that it meets but the nearest, and returns that one.
#[inline(always)]
fn enter_node<S: Simd>(
    simd: S,
    bvh: &Bvh<'_>,
    rays: &Rays,
    one: &mut Traveller,
    stack: &mut [StackEntry],
    number: u32,
) -> Option<Child> {
    let node = bvh.nodes.get(number as usize)?;
    let boxes = WideBoxes::decode(simd, bvh, node, rays.center, rays.growth);
    let (near, met) = boxes.meet(simd, &rays.one(simd, one.ray));
    let near: [f32; WIDTH] = near.into();
    let near = |slot: u32| near[slot as usize % WIDTH];
    let mut rest = bits(met) & node.used();
    let mut nearest = rest.trailing_zeros();
    rest &= rest.wrapping_sub(1);
    let base = one.top;
    while rest != 0 {
        let mut slot = rest.trailing_zeros();
        rest &= rest - 1;
        if near(slot) < near(nearest) {
            core::mem::swap(&mut slot, &mut nearest);
        }
        push(stack, &mut one.top, base, number, slot, near(slot).to_bits());
    }
    (nearest < u32::BITS).then(|| node.child(nearest))
}
