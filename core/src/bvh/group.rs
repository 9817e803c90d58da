//! Up to 64 rays through the tree together.
//!
//! Each entry on the stack has a child and the rays that met its box, one bit each. So a node is decoded and
//! a leaf's triangles are fetched once for all of them, and a ray is tested only below boxes that it met.
//!
//! ```text
//! prepare the rays; if they start far apart and want their closest hits, interleave them (interleave.rs) or
//!     have them traced alone
//! stack = [(root, all rays)]
//! pop a child and its rays, without those that are done or end before it begins
//! node: decode the eight boxes
//!       intersect the rays with them (met.rs)
//!       push the children with the rays that met them, for closest hits the nearest last; prefetch in a large tree
//! leaf: test its triangles, or offer its boxes (group_leaf.rs)
//! ```
//!
//! A group may hold any rays. Camera rays share most nodes; rays from a surface share those at the top.

use fearless_simd::Simd;

use super::Bvh;
use super::boxes::WideBoxes;
use super::group_leaf::{BoxLeaves, Leaf, Leaves, Offer, Scattered, TriangleLeaves};
use super::interleave;
use super::met::Met;
use super::node::{Child, WIDTH};
use super::per_ray::GROUP;
use super::rays::Rays;
use super::stack::{GroupEntry, GroupStack};
use crate::aabb::Aabb;
use crate::mesh::TriangleMesh;
use crate::ray::{Hit, Ray};
use crate::simd::{HAS_PREFETCH, HAS_VECTORS, Kernel, SimdLevel, dispatch};

/// Rays are scattered, and share little, if some origins lie farther apart than this part of the tree's extent.
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

/// A group of rays, and the tree that they go through.
pub(crate) struct Group<'r> {
    pub(crate) bvh: &'r Bvh<'r>,
    pub(crate) mesh: &'r TriangleMesh<'r>,
    /// The box of the tree.
    pub(crate) bounds: &'r Aabb,
    pub(crate) rays: &'r mut Rays,
    pub(crate) stack: &'r mut GroupStack,
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
    /// share them. No batch calls it without vectors, but rustc would compile its kernels nevertheless, for a minute.
    #[inline(never)]
    pub(crate) fn trace(&mut self, level: SimdLevel, is_any: bool) -> u64 {
        if !HAS_VECTORS {
            u64::MAX
        } else if is_any {
            dispatch(level, Descent { group: self, leaves: TriangleLeaves::<true> })
        } else {
            dispatch(level, Descent { group: self, leaves: TriangleLeaves::<false> })
        }
    }

    /// Calls `offer` with each box of a tree of boxes that rays meet, once and roughly front to back: its number,
    /// the rays as a mask, and all rays, so that it can end some. Returns what [`trace`](Self::trace) returns.
    #[inline(never)]
    pub(crate) fn offer(&mut self, level: SimdLevel, is_any: bool, offer: &mut Offer<'_>) -> u64 {
        if !HAS_VECTORS {
            // As in `trace`.
            return u64::MAX;
        }
        dispatch(level, Descent { group: self, leaves: BoxLeaves { offer, is_any } })
    }
}

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
        let Group { bvh, mesh, bounds, rays, stack, count, until } = &mut *self.group;
        let alone = rays.prepare(simd, *count, bounds);
        if let Some(until) = until {
            rays.take_until(simd, until);
        }
        match self.leaves.scattered() {
            Scattered::Interleaved if wait_for_memory(rays, bvh) => {
                return alone | interleave::trace(simd, bvh, mesh, bounds, rays, stack);
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
        let stack = stack.entries();
        let mut budget = bvh.budget();
        let mut top = 0;
        let mut met = Met::NONE;
        let is_large = HAS_PREFETCH && bvh.exceeds(CORE_CACHES);
        let beam = rays.beam(simd);
        rays.notice_camera(&beam);
        let (mut child, mut mask) = (Child::Inner(0), rays.alive);
        loop {
            if !budget.take(1) {
                return;
            }
            match child {
                Child::Inner(number) => {
                    let Some(node) = bvh.nodes.get(number as usize) else { return };
                    // Decode the boxes of the node, and intersect the rays with them.
                    let boxes = WideBoxes::decode(simd, bvh, node, rays.center, rays.growth);
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
                        let node_and_slot = number << 3 | slot;
                        push::<L>(stack, &mut top, base, GroupEntry { node_and_slot, near, rays });
                        if is_large {
                            bvh.prefetch(node.child(slot));
                        }
                    }
                }
                Child::Leaf { first, count } => {
                    // Test the triangles of the leaf, or offer its boxes.
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
                    let (node, slot) = (waiting.node_and_slot >> 3, waiting.node_and_slot & 7);
                    let node = bvh.nodes.get(node as usize);
                    child = node.map_or(Child::NONE, |node| node.child(slot));
                    break;
                }
            }
        }
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

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use fearless_simd::f32x8;
    use fearless_simd::prelude::*;
    use glam::Vec3A;

    use super::super::node::Node;
    use super::*;
    use crate::approach::Reach;
    use crate::filter::{RayFilter, Size, splat};
    use crate::options::Choice;
    use crate::ray::Ray;
    use crate::samples::Random;
    use crate::simd::dispatch;

    /// Prepares rays that start at one point, except for the last.
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
        // The tree is 16 wide: its quarter is 4, its thirty-second part 0.5.
        for (count, apart, waits) in [
            (few, 8.0, false),
            (few + 1, 8.0, true),
            (few + 1, 3.5, false),
            (nodes.len() - 1, 3.5, false),
            (nodes.len(), 3.5, true),
            (nodes.len(), 0.25, false),
        ] {
            let bvh = Bvh { nodes: &nodes[..count], fine: &[], ids: &[], levels: 1 };
            let mut rays = Rays::new(Choice::ALL);
            assert_eq!(dispatch(SimdLevel::detect(), Prepared(&mut rays, apart)), 0);
            assert_eq!(rays.alive, u64::MAX);
            assert_eq!(wait_for_memory(&rays, &bvh), waits, "{count} nodes, {apart} apart");
        }
    }

    /// Prepares rays of all directions that start up to so far apart. Compares their ranges, their sizes of triangles
    /// and their filters with those of each ray alone.
    struct Sizes<'a>(&'a mut Random, f32);

    impl Kernel for Sizes<'_> {
        type Output = ();

        fn run<S: Simd>(self, simd: S) {
            let Self(random, apart) = self;
            let mut rays = Rays::new(Choice::ALL);
            for ray in rays.slots() {
                *ray = Ray::new(random.point().map(|x| x * apart), random.point());
                ray.t_max = [1.5, f32::MAX, f32::INFINITY][random.below(3)];
            }
            let given: Vec<Ray> = rays.slots().to_vec();
            let bounds = Aabb { min: Vec3A::splat(-1.0), max: Vec3A::splat(1.0) };
            rays.prepare(simd, GROUP, &bounds);
            for (lane, ray) in (0..).zip(&given).filter(|(lane, _)| rays.alive >> lane & 1 == 1) {
                let its_own = |range: [f32x8<S>; 2]| {
                    range.map(|ends| <[f32; 8]>::from(ends)[lane as usize % 8].to_bits())
                };
                let range = its_own(rays.ranges_of(simd, lane as usize / 8));
                assert_eq!(its_own(rays.range_of(simd, lane)), range);
                let alone =
                    RayFilter::new(ray.direction, ray.origin, 0.0, Reach::of(&bounds, ray.origin));
                let filter = rays.filter(simd, lane);
                let first = |numbers: f32x8<S>| <[f32; 8]>::from(numbers)[0];
                assert!(
                    first(filter.rate) >= alone.line.rate
                        && first(filter.floor) >= alone.line.floor
                );
                let triangle = [random.point(), random.point(), random.point()];
                let corners = splat(simd, &triangle);
                let own = first(Size::new(filter.origin, &corners).reach);
                let of_one = first(rays.size_of(simd, &corners, 1 << lane).reach);
                assert_eq!(of_one.to_bits(), own.to_bits());
                // It may be rounded: the filter has room for that.
                assert!(first(rays.size_of(simd, &corners, u64::MAX).reach) >= own * 0.999_999);
            }
        }
    }

    #[test]
    fn a_group_filters_no_tighter_than_its_rays_alone() {
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        for apart in [0.0, 1e-3, 1.0, 8.0] {
            for _ in 0..if cfg!(miri) { 1 } else { 200 } {
                dispatch(SimdLevel::detect(), Sizes(&mut random, apart));
            }
        }
    }
}
