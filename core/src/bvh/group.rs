//! Up to 64 rays through the tree together.
//!
//! Each place on the stack has a child and the rays that met its box, one bit each. So a node is decoded and
//! a leaf's triangles are fetched once for all of them, and a ray is tested only below boxes that it met.
//!
//! ```text
//! prepare the rays; if they start far apart and want their closest hits, interleave them (interleave.rs) or
//!     have them traced alone
//! stack = [(root, all rays)]
//! pop a child and its rays, without those that are done or end before it begins
//! node: decode the eight boxes
//!       more than eight rays: intersect the beam of the whole group with the eight boxes; it decides some for all rays
//!       then, whichever takes fewer vector tests:
//!           ray by ray: each with all eight boxes
//!           box by box: each that is undecided with sixteen rays at a time
//!       push the children with the rays that met them, for closest hits the nearest last; prefetch in a large tree
//! leaf: test its triangles, or offer its boxes (group_leaf.rs)
//! ```
//!
//! The rays may go anywhere: rays of a camera share most nodes, rays from a surface share the first ones.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f32x16, mask32x16, u32x8};
use zerocopy::{FromBytes, IntoBytes, transmute_mut};

use super::Bvh;
use super::boxes::{Beam, WideBoxes, bits};
use super::group_leaf::{BoxLeaves, Leaf, Leaves, Offer, Scattered, TriangleLeaves};
use super::interleave;
use super::node::{Child, WIDTH};
use super::rays::{GROUP, OCTETS, Rays};
use super::walk::{STACK, StackEntry};
use crate::aabb::Aabb;
use crate::extremes::Extremes;
use crate::mesh::TriangleMesh;
use crate::simd::{HAS_PREFETCH, Kernel, SimdLevel, dispatch};

/// With more rays than this, the beam of all rays is tested before the rays.
const FEW_RAYS: u32 = 8;

/// Rays are scattered, and share little, if some origins lie farther apart than this part of the scene.
const SCATTERED: f32 = 1.0 / 4.0;
/// The same for a tree that exceeds [`SHARED_CACHE`]: the nodes that rays share are a smaller part of all, so rays
/// count as scattered sooner.
const SCATTERED_IN_HUGE: f32 = 1.0 / 32.0;

/// A tree of more bytes than this does not fit into the caches of one core. A scan of 110 000 triangles has such a
/// tree.
const CORE_CACHES: usize = 1 << 20;
/// A tree of more bytes than this does not fit into the cache of all cores. A scan of 1.8 million triangles has such a
/// tree.
const SHARED_CACHE: usize = 16 << 20;

/// Returns true if rays are scattered and would wait for memory at each step of a tree.
fn wait_for_memory(rays: &Rays, bvh: &Bvh<'_>) -> bool {
    let part = if bvh.exceeds(SHARED_CACHE) { SCATTERED_IN_HUGE } else { SCATTERED };
    bvh.exceeds(CORE_CACHES) && rays.are_apart(part)
}

/// Counts the vectors of eight rays that hold at least one of some rays.
#[inline(always)]
pub(super) const fn octets(rays: u64) -> u32 {
    let pairs = rays | rays >> 1;
    let fours = pairs | pairs >> 2;
    ((fours | fours >> 4) & 0x0101_0101_0101_0101).count_ones()
}

/// A child that waits, and the rays that met it.
#[repr(C)]
#[derive(Clone, Copy, FromBytes, IntoBytes)]
pub(crate) struct GroupEntry {
    /// Node and slot.
    place: u32,
    /// The least distance at which one of the rays enters; any number if children may come in any order.
    near: f32,
    rays: u64,
}

impl GroupEntry {
    const NONE: Self = Self { place: 0, near: 0.0, rays: 0 };
}

/// The stack of a group.
pub(crate) struct Stack([GroupEntry; STACK]);

impl Stack {
    pub(crate) const fn new() -> Self {
        Self([GroupEntry::NONE; STACK])
    }

    /// Cuts the stack into shares for single rays.
    #[inline(always)]
    pub(super) fn shares(&mut self, size: usize) -> impl Iterator<Item = &mut [StackEntry]> {
        let entries: &mut [StackEntry; 2 * STACK] = transmute_mut!(&mut self.0);
        entries.chunks_exact_mut(size)
    }
}

/// A group of rays, and the tree that they go through.
pub(crate) struct Group<'r> {
    pub(crate) bvh: &'r Bvh<'r>,
    pub(crate) mesh: &'r TriangleMesh<'r>,
    /// The box of the tree.
    pub(crate) bounds: &'r Aabb,
    pub(crate) rays: &'r mut Rays,
    pub(crate) stack: &'r mut Stack,
    /// Number of rays in the first slots.
    pub(crate) count: usize,
    /// For each ray the largest `t` of a hit that matters; `None`: its `t_max`. If given, a ray without a hit ends with
    /// a miss whose `t` is this, not [`Hit::MISS`](crate::ray::Hit::MISS).
    pub(crate) until: Option<&'r [f32; GROUP]>,
}

impl Group<'_> {
    /// Finds a hit of each ray; with `is_any` the first one ends it. Returns a mask of the rays that must be traced
    /// alone instead.
    ///
    /// Not generic over the batch: kernels are the largest functions of the library, and all batches of a program
    /// share them.
    #[inline(never)]
    pub(crate) fn trace(&mut self, level: SimdLevel, is_any: bool) -> u64 {
        if is_any {
            dispatch(level, Descent { group: self, leaves: TriangleLeaves::<true> })
        } else {
            dispatch(level, Descent { group: self, leaves: TriangleLeaves::<false> })
        }
    }

    /// Calls `offer` with each box of a tree of boxes that rays meet, once and roughly front to back: its number,
    /// the rays as a mask, and all rays, so that it can end some. Returns what [`trace`](Self::trace) returns.
    #[inline(never)]
    pub(crate) fn offer(&mut self, level: SimdLevel, is_any: bool, offer: &mut Offer<'_>) -> u64 {
        dispatch(level, Descent { group: self, leaves: BoxLeaves { offer, is_any } })
    }
}

/// The kernel over a group.
struct Descent<'r, 'g, L> {
    group: &'r mut Group<'g>,
    leaves: L,
}

impl<L: Leaves> Kernel for Descent<'_, '_, L> {
    type Output = u64;
    const IS_WIDE: bool = true;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u64 {
        let Group { bvh, bounds, rays, count, until, .. } = &mut *self.group;
        let alone = rays.prepare(simd, *count, bounds);
        if let Some(until) = until {
            rays.take_until(until);
        }
        match self.leaves.scattered() {
            Scattered::Interleaved if wait_for_memory(rays, bvh) => {
                return alone | interleave::trace(simd, self.group);
            }
            Scattered::Interleaved | Scattered::Alone if rays.are_apart(SCATTERED) => {
                return alone | rays.alive;
            }
            _ => self.descend(simd),
        }
        alone
    }
}

impl<L: Leaves> Descent<'_, '_, L> {
    #[inline(always)]
    fn descend<S: Simd>(self, simd: S) {
        let Self { group: Group { bvh, mesh, bounds, rays, stack, .. }, mut leaves } = self;
        let stack = &mut stack.0;
        let mut budget = bvh.budget();
        let mut top = 0;
        let mut met = Met::NONE;
        let is_large = HAS_PREFETCH && bvh.exceeds(CORE_CACHES);
        let beam = rays.beam(simd);
        let (mut child, mut mask) = (Child::Inner(0), rays.alive);
        loop {
            let Some(rest) = budget.checked_sub(1) else { return };
            budget = rest;
            match child {
                Child::Inner(number) => {
                    let Some(node) = bvh.nodes.get(number as usize) else { return };
                    let boxes = WideBoxes::decode(simd, node, rays.center, rays.growth);
                    // Mask unused slots: their boxes are inside out, but this slab test sorts near and far side
                    // itself and would meet them.
                    met.meet(simd, &boxes, rays, &beam, mask, node.used(), !L::IS_ANY);
                    let Met { rays: by, near, .. } = &met;
                    let mut slots = met.slots;
                    // Push what is met, the nearest last.
                    let base = top;
                    while slots != 0 {
                        let slot = slots.trailing_zeros();
                        slots &= slots - 1;
                        let (rays, near) = (by[slot as usize % WIDTH], near[slot as usize % WIDTH]);
                        let place = number << 3 | slot;
                        push::<L>(stack, &mut top, base, GroupEntry { place, near, rays });
                        if is_large {
                            bvh.prefetch(node.child(slot));
                        }
                    }
                }
                Child::Leaf { first, count } => {
                    let leaf = Leaf { bvh, mesh, bounds, first, ids: bvh.leaf(first, count) };
                    leaves.enter(simd, &leaf, rays, &beam, mask);
                }
            }
            // Pop the next child that a ray still has to look at.
            loop {
                let Some(below) = top.checked_sub(1) else { return };
                top = below;
                let Some(waiting) = stack.get(top) else { return };
                mask = waiting.rays & rays.alive;
                if !L::IS_ANY && mask != 0 {
                    mask = rays.ending_behind(simd, waiting.near, mask);
                }
                if mask != 0 {
                    let (node, slot) = (waiting.place >> 3, waiting.place & 7);
                    let node = bvh.nodes.get(node as usize);
                    child = node.map_or(Child::NONE, |node| node.child(slot));
                    break;
                }
            }
        }
    }
}

/// The intersections of rays with up to eight boxes.
pub(super) struct Met {
    /// The boxes that any of them met, as bits.
    pub(super) slots: u32,
    /// For each box the rays that met it, as bits, and where the first one enters if that matters.
    pub(super) rays: [u64; WIDTH],
    pub(super) near: [f32; WIDTH],
}

impl Met {
    pub(super) const NONE: Self = Self { slots: 0, rays: [0; WIDTH], near: [0.0; WIDTH] };

    /// Intersects some rays of a group with the boxes that are used; finds entry distances only if they are wanted.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "each is its own")]
    pub(super) fn meet<S: Simd>(
        &mut self,
        simd: S,
        boxes: &WideBoxes<f32x8<S>>,
        rays: &Rays,
        beam: &Beam<S>,
        mask: u64,
        used: u32,
        wants_near: bool,
    ) {
        let count = mask.count_ones();
        let (mut some, mut all, mut enter) = (used, 0, f32x8::splat(simd, 0.0));
        // For more than a few rays, intersect the beam of the whole group with the boxes.
        if count > FEW_RAYS {
            let beam = boxes.meet_beam(simd, beam);
            some &= beam.some;
            (all, enter) = (some & beam.all, beam.enter);
        }
        // Ray by ray, each ray takes one test of all eight boxes. Box by box, each box that the beam left undecided
        // takes one test for every sixteen rays, which counts as two.
        let unsure = some & !all;
        if count <= octets(mask) * unsure.count_ones() {
            one_by_one(simd, boxes, rays, mask, wants_near, self);
        } else {
            side_by_side(simd, boxes, rays, mask, unsure, wants_near, self);
        }
        self.add_all(all, mask, enter);
        self.slots &= some;
    }

    /// Adds boxes that all rays meet, each with a lower bound of their entry distances.
    #[inline(always)]
    fn add_all<S: Simd>(&mut self, all: u32, rays: u64, enter: f32x8<S>) {
        self.slots |= all;
        let enter: [f32; WIDTH] = enter.into();
        let mut rest = all;
        while rest != 0 {
            let slot = rest.trailing_zeros() as usize % WIDTH;
            rest &= rest - 1;
            self.rays[slot] = rays;
            self.near[slot] = enter[slot];
        }
    }
}

/// Intersects rays with all eight boxes of a node, ray by ray.
#[inline(always)]
fn one_by_one<S: Simd>(
    simd: S,
    boxes: &WideBoxes<f32x8<S>>,
    rays: &Rays,
    mask: u64,
    wants_near: bool,
    met: &mut Met,
) {
    let zero = u32x8::splat(simd, 0);
    let far_away = f32x8::splat(simd, f32::INFINITY);
    let mut least = far_away;
    let mut halves = [zero; 2];
    for (first, met_by) in (0..).step_by(32).zip(&mut halves) {
        let mut rest = mask >> first & 0xffff_ffff;
        while rest != 0 {
            let bit = rest.trailing_zeros();
            rest &= rest - 1;
            let (near, met) = boxes.meet(simd, &rays.slab(simd, first + bit));
            *met_by |= met.select(u32x8::splat(simd, 1 << bit), zero);
            if wants_near {
                least = least.lesser(met.select(near, far_away));
            }
        }
    }
    let slots = !(halves[0] | halves[1]).simd_eq(zero);
    let [low, high]: [[u32; WIDTH]; 2] = [halves[0].into(), halves[1].into()];
    let mut masks = [0; WIDTH];
    for ((mask, low), high) in masks.iter_mut().zip(low).zip(high) {
        *mask = u64::from(low) | u64::from(high) << 32;
    }
    (met.slots, met.rays) = (bits(slots), masks);
    if wants_near {
        met.near = least.into();
    }
}

/// Intersects rays with the boxes of a node that the beam did not decide, box by box: sixteen rays at a time.
#[inline(always)]
fn side_by_side<S: Simd>(
    simd: S,
    boxes: &WideBoxes<f32x8<S>>,
    rays: &Rays,
    mask: u64,
    unsure: u32,
    wants_near: bool,
    met: &mut Met,
) {
    let far_away = f32x16::splat(simd, f32::INFINITY);
    let sides = boxes.sides();
    met.slots = 0;
    let mut rest = unsure;
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % WIDTH;
        rest &= rest - 1;
        let child = WideBoxes::<f32x16<S>>::one(simd, &sides, slot);
        let (mut by, mut least) = (0, far_away);
        for which in 0..GROUP / 16 {
            let of_sixteen = mask >> (16 * which) & 0xffff;
            if of_sixteen == 0 {
                continue;
            }
            let (near, is_met) = child.meet(simd, &rays.sixteen(simd, which));
            // Mask afterwards: an invalid ray has NaN distances and would count as a hit.
            let is_met = is_met & mask32x16::from_bitmask(simd, of_sixteen);
            by |= is_met.to_bitmask() << (16 * which);
            if wants_near {
                least = least.lesser(is_met.select(near, far_away));
            }
        }
        met.rays[slot] = by;
        if wants_near {
            met.near[slot] = least.reduce_min();
        }
        met.slots |= u32::from(by != 0) << slot;
    }
}

/// Pushes a child; for closest hits, above those of the same node that begin farther away.
#[inline(always)]
fn push<L: Leaves>(stack: &mut [GroupEntry], top: &mut usize, base: usize, waiting: GroupEntry) {
    let mut at = *top;
    if at >= stack.len() {
        return;
    }
    *top += 1;
    while !L::IS_ANY
        && at > base
        && let Some(&below) = stack.get(at - 1)
        && below.near < waiting.near
    {
        if let Some(slot) = stack.get_mut(at) {
            *slot = below;
        }
        at -= 1;
    }
    if let Some(slot) = stack.get_mut(at) {
        *slot = waiting;
    }
}

const _: () = assert!(GROUP == 8 * OCTETS);

#[cfg(test)]
mod tests {
    use alloc::vec;

    use glam::Vec3A;

    use super::super::node::Node;
    use super::*;
    use crate::options::Choice;
    use crate::ray::Ray;
    use crate::simd::dispatch;

    /// Prepares rays of which the last starts elsewhere than the others.
    struct Prepared<'a>(&'a mut Rays, f32);

    impl Kernel for Prepared<'_> {
        type Output = u64;

        fn run<S: Simd>(self, simd: S) -> u64 {
            let Self(rays, apart) = self;
            for (slot, ray) in rays.slots().iter_mut().enumerate() {
                let x = if slot == GROUP - 1 { apart } else { 0.0 };
                *ray = Ray::new([x, 0.0, 0.0], [0.5, 1.0, 0.25]);
            }
            let bounds = Aabb { min: Vec3A::splat(-8.0), max: Vec3A::splat(8.0) };
            rays.prepare(simd, GROUP, &bounds)
        }
    }

    #[test]
    fn scattered_rays_wait_for_memory_in_large_trees() {
        let nodes = vec![Node::EMPTY; SHARED_CACHE / size_of::<Node>() + 1];
        let few = CORE_CACHES / size_of::<Node>();
        // The scene is 16 wide: its quarter is 4, its thirty-second part 0.5.
        for (count, apart, waits) in [
            (few, 8.0, false),
            (few + 1, 8.0, true),
            (few + 1, 3.5, false),
            (nodes.len() - 1, 3.5, false),
            (nodes.len(), 3.5, true),
            (nodes.len(), 0.25, false),
        ] {
            let bvh = Bvh { nodes: &nodes[..count], ids: &[], levels: 1 };
            let mut rays = Rays::new(Choice::ALL);
            assert_eq!(dispatch(SimdLevel::detect(), Prepared(&mut rays, apart)), 0);
            assert_eq!(rays.alive, u64::MAX);
            assert_eq!(wait_for_memory(&rays, &bvh), waits, "{count} nodes, {apart} apart");
        }
    }
}
