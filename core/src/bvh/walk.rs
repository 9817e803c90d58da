//! Traverses the tree with a single ray, nearest child first; tests the triangles of leaves, or offers their shapes.
//!
//! ```text
//! node = root
//! loop: intersect the ray with the eight boxes of the node
//!       descend into the nearest child that is met, push the others, the nearest last
//!       a leaf: filter its triangles, all eight together; decide those that pass one by one in f64;
//!               a hit is the new end of the ray
//!       pop the next child that the ray enters before its end
//! ```
//!
//! Two things cost a ray more than its arithmetic. The address of the next node is known only once this one is tested:
//! [`predicted`] jumps to the child, so that the processor can guess it. And a stack for the deepest tree takes as long
//! to zero as a node to test: a ray begins on a short one, and [resumes](Resume) on a larger one if that is full.

use core::hint::black_box;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, u32x8};
use glam::Vec3A;

use super::Bvh;
use super::boxes::{bits, splat};
use super::fine::FineSides;
use super::node::{Child, Node, WIDTH, floats};
use super::shape_leaf::{boxes_of_leaf, meet_leaf, nearest_of, pad_of};
use super::slab::{FLIP, NearSides, SlabRay, flips_of};
use super::stack::{StackEntry, pop, push};
use crate::aabb::{Aabb, greater, lesser};
use crate::budget::Budget;
use crate::counters::Tally;
use crate::eight::Eight;
use crate::extremes::Extremes;
use crate::filter::{LineFilter, RayFilter, Size};
use crate::mesh::TriangleMesh;
use crate::options::Cull;
use crate::range;
use crate::ray::Ray;
use crate::search::{Outcome, Search};
use crate::simd::{HAS_VECTORS, Kernel};
use crate::triangle::TriangleTest;

/// The traversal of a single ray: the ray, and the search that receives its hits.
pub(crate) struct OneRay<'r, F, T> {
    pub(crate) bvh: &'r Bvh<'r>,
    pub(crate) mesh: &'r TriangleMesh<'r>,
    pub(crate) ray: &'r Ray,
    /// The interval of its range in which hits matter: from `t_min` or the last hit that was found before, to `t_max`
    /// or the closest hit in another instance.
    pub(crate) interval: [f32; 2],
    pub(crate) cull: Cull,
    /// The box of the tree.
    pub(crate) bounds: &'r Aabb,
    /// A ray from far away, which [`SlabRay::nearby`] cannot prepare, and its filter.
    pub(crate) afar: Option<&'r (SlabRay, RayFilter)>,
    pub(crate) search: &'r mut F,
    pub(crate) tally: &'r mut T,
    /// The place to resume at; `None` at the start.
    pub(crate) resume: Option<Resume>,
}

/// A ray and its stack.
pub(crate) struct Walk<'w, 'r, F, T> {
    pub(crate) one: &'w mut OneRay<'r, F, T>,
    pub(crate) stack: &'w mut [StackEntry],
}

/// The place where a walk goes on after its stack was full.
#[derive(Clone, Copy)]
pub(crate) struct Resume {
    /// The next node.
    number: u32,
    /// Children on the stack.
    top: usize,
    /// The end of the ray.
    end: f32,
    budget: Budget,
}

/// The outcome of a walk.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Walked {
    /// The ray has passed the tree, or the search is over.
    Through,
    /// [`SlabRay::nearby`] does not take the ray, mostly because it is far away. Nothing was traversed.
    TooFar,
    /// The stack has no room for the children of a node. The walk may go on with a larger one.
    Full,
}

/// The ray in vectors.
#[derive(Clone, Copy)]
struct Wide<S: Simd> {
    origin_near: [f32x8<S>; 3],
    origin_far: [f32x8<S>; 3],
    inverse_near: [f32x8<S>; 3],
    inverse_far: [f32x8<S>; 3],
    start: f32x8<S>,
    filter: LineFilter<f32>,
    /// The start of the ray as a distance, if it may leave a triangle.
    leaves_at: Option<f32>,
}

impl<S: Simd> Wide<S> {
    #[inline(always)]
    fn new(simd: S, ray: &SlabRay, filter: &RayFilter, leaves_at: Option<f32>) -> Self {
        Self {
            origin_near: splat(simd, ray.origin_near.to_array()),
            origin_far: splat(simd, ray.origin_far.to_array()),
            inverse_near: splat(simd, ray.inverse.to_array()),
            inverse_far: splat(simd, ray.inverse_far().to_array()),
            start: f32x8::splat(simd, ray.start),
            filter: filter.line,
            leaves_at,
        }
    }

    /// Filters the triangles of a leaf; returns a mask of those that pass.
    #[inline(always)]
    fn survivors(
        &self,
        simd: S,
        bvh: &Bvh<'_>,
        mesh: &TriangleMesh<'_>,
        first: u32,
        ids: &[u32],
    ) -> u32 {
        let triangles = Eight::of(simd, mesh, bvh.lanes(first, ids), ids.len());
        let corners = &triangles.corners;
        let filter = self.filter.splat(simd);
        let size = Size::new(filter.origin, corners);
        let mut passed = !bits(filter.drops(corners, &size)) & triangles.used;
        if passed != 0
            && let Some(start) = self.leaves_at
        {
            let start = f32x8::splat(simd, start);
            passed &= !bits(filter.passes_before(simd, corners, &size, start));
        }
        passed
    }

    /// Intersects the ray with the boxes of a node. Returns a mask of those that it enters before its end, and the
    /// entry distances.
    #[inline(always)]
    fn meet(
        &self,
        simd: S,
        node: &Node,
        fine: Option<&FineSides>,
        flips: NearSides,
        end: f32,
    ) -> (u32, f32x8<S>) {
        // Splat integers: floats would be loaded into one lane first and then broadcast.
        let [x, y, z] = node.origin;
        let origin = [u32x8::splat(simd, x), u32x8::splat(simd, y), u32x8::splat(simd, z)];
        let steps = node.wide_steps(simd);
        let mut distances = [(self.start, self.start); 3];
        for axis in 0..3 {
            let (near_side, far_side) = (axis + (flips[axis] & FLIP), axis + (!flips[axis] & FLIP));
            let (near, far) = match fine {
                None => {
                    let near = side(simd, node, near_side);
                    let far = side(simd, node, far_side);
                    let origin = origin[axis].bitcast::<f32x8<S>>();
                    // The product is exact, eight bits times a power of two: fused or not, the sum has the same bits.
                    let near = near.mul_add(steps[axis], origin - self.origin_near[axis]);
                    (near, far.mul_add(steps[axis], origin - self.origin_far[axis]))
                }
                Some(fine) => (
                    fine.side(simd, near_side) - self.origin_near[axis],
                    fine.side(simd, far_side) - self.origin_far[axis],
                ),
            };
            distances[axis] = (near * self.inverse_near[axis], far * self.inverse_far[axis]);
        }
        let [x, y, z] = distances;
        let near = x.0.greater(y.0).greater(z.0.greater(self.start));
        let far = x.1.lesser(y.1).lesser(z.1.lesser(f32x8::splat(simd, end)));
        (bits(!near.simd_gt(far)), near)
    }
}

impl<S: Simd> Wide<S> {
    /// Intersects the ray with the boxes of a leaf. Returns a mask of those that it enters before its end, and the
    /// entry distances.
    #[inline(always)]
    fn meet_leaf(
        &self,
        simd: S,
        mesh: &TriangleMesh<'_>,
        ids: &[u32],
        flips: NearSides,
        pad: f32,
        end: f32,
    ) -> (u32, [f32; WIDTH]) {
        let (low, high) = boxes_of_leaf(simd, mesh, ids);
        let mut distances = [(self.start, self.start); 3];
        for axis in 0..3 {
            let (low, high) = (low[axis], high[axis]);
            let (near, far) = if flips[axis] == 0 { (low, high) } else { (high, low) };
            let pad = self.inverse_far[axis].abs() * pad;
            let near = (near - self.origin_near[axis]) * self.inverse_near[axis] - pad;
            let far = (far - self.origin_far[axis]) * self.inverse_far[axis] + pad;
            distances[axis] = (near, far);
        }
        let [x, y, z] = distances;
        let near = x.0.greater(y.0).greater(z.0.greater(self.start));
        let far = x.1.lesser(y.1).lesser(z.1.lesser(f32x8::splat(simd, end)));
        let used = (1_u32 << ids.len().min(WIDTH)) - 1;
        (bits(!near.simd_gt(far)) & used, near.into())
    }
}

/// Pushes the children that a ray meets, except the nearest, and returns the slot of the nearest.
#[inline(always)]
fn push_others<S: Simd>(
    stack: &mut [StackEntry],
    top: &mut usize,
    node: u32,
    met: u32,
    near: f32x8<S>,
) -> u32 {
    let first = met.trailing_zeros();
    let others = met & met.wrapping_sub(1);
    if others == 0 {
        return predicted(first);
    }
    let near: [u32; WIDTH] = near.bitcast::<u32x8<S>>().into();
    let bits_at = |slot: u32| near[slot as usize % WIDTH];
    let at = |slot: u32| f32::from_bits(bits_at(slot));
    let second = others.trailing_zeros();
    let mut rest = others & (others - 1);
    let base = *top;
    if rest == 0 {
        // Branch: a select would wait for both distances.
        return if at(second) < at(first) {
            push(stack, top, base, node, first, bits_at(first));
            predicted(second)
        } else {
            push(stack, top, base, node, second, bits_at(second));
            predicted(first)
        };
    }
    let (mut nearest, mut other) = (first, second);
    if at(second) < at(first) {
        (nearest, other) = (second, first);
    }
    push(stack, top, base, node, other, bits_at(other));
    while rest != 0 {
        let mut slot = rest.trailing_zeros();
        rest &= rest - 1;
        if at(slot) < at(nearest) {
            core::mem::swap(&mut slot, &mut nearest);
        }
        push(stack, top, base, node, slot, bits_at(slot));
    }
    predicted(nearest)
}

/// Returns a slot by way of a jump, not as a number: the processor predicts the jump, and intersects the child's boxes
/// while it still waits for this node's. Rays that run side by side mostly take the same way; rays that have nothing
/// in common lose a little.
#[inline(always)]
fn predicted(slot: u32) -> u32 {
    if !HAS_VECTORS {
        return slot;
    }
    // Hide the numbers from the compiler: it would see that the jump changes nothing.
    match slot {
        0 => black_box(0),
        1 => black_box(1),
        2 => black_box(2),
        3 => black_box(3),
        4 => black_box(4),
        5 => black_box(5),
        6 => black_box(6),
        _ => black_box(7),
    }
}

/// Does the same as [`Wide::meet`] box by box, without fine sides, for machines without vectors.
#[inline(never)]
fn meet<S: Simd>(simd: S, ray: &SlabRay, node: &Node, end: f32) -> (u32, f32x8<S>) {
    let flips = flips_of(ray);
    let (origin, steps) = (node.origin(), node.steps());
    let (origin_near, origin_far) = (ray.origin_near.to_array(), ray.origin_far.to_array());
    let (inverse, inverse_far) = (ray.inverse.to_array(), ray.inverse_far().to_array());
    let (mut met, mut nearest) = (0, [0.0; WIDTH]);
    for (slot, nearest) in nearest.iter_mut().enumerate() {
        let (mut near, mut far) = (ray.start, end);
        for axis in 0..3 {
            let bound = |flip: usize| f32::from(row(node, axis, flip)[slot % WIDTH]);
            let near_side = bound(flips[axis]) * steps[axis] + (origin[axis] - origin_near[axis]);
            let far_side =
                bound(flips[axis] ^ FLIP) * steps[axis] + (origin[axis] - origin_far[axis]);
            near = greater(near_side * inverse[axis], near);
            far = lesser(far_side * inverse_far[axis], far);
        }
        *nearest = near;
        let is_missed = near > far;
        met |= u32::from(!is_missed) << slot;
    }
    (met, f32x8::simd_from(simd, nearest))
}

/// A side of eight boxes as numbers, in steps.
#[inline(always)]
fn side<S: Simd>(simd: S, node: &Node, side: usize) -> f32x8<S> {
    let row = node.bounds[side % 6];
    floats(simd, row, row).0
}

/// The row of a side. The mask shows the compiler that the row exists.
#[inline(always)]
fn row(node: &Node, axis: usize, flip: usize) -> [u8; WIDTH] {
    node.bounds[axis % 3 + (flip & FLIP)]
}

impl<F: Search, T: Tally> Kernel for &mut Walk<'_, '_, F, T> {
    type Output = Walked;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Walked {
        let Walk { one, stack } = self;
        let OneRay { bvh, mesh, ray, interval, cull, bounds, afar, search, tally, resume } = one;
        let (interval, cull, afar) = (*interval, *cull, *afar);
        // A copy of the view: behind a reference it would be read again after each store.
        let bvh = &Bvh { ..**bvh };
        let nearby =
            if afar.is_none() { SlabRay::nearby(ray, interval, bounds) } else { afar.copied() };
        let Some((slab_ray, filter)) = nearby else { return Walked::TooFar };
        let slab_ray = &slab_ray;
        // Boxes need no filter: the compiler drops its computation.
        let filter = if F::OF_BOXES { RayFilter::NONE } else { filter };
        // A ray from inside the box of the tree may leave a triangle.
        let origin = Vec3A::from(ray.origin);
        let may_leave = afar.is_none() && range::pays(bounds, &Aabb { min: origin, max: origin });
        let leaves_at = may_leave.then(|| slab_ray.distance(ray.t_min));
        // Hide the vectors from the compiler: it would compute in one lane and broadcast the result, which lengthens
        // the dependency chain from one node to the next.
        let wide = HAS_VECTORS.then(
            #[inline(always)]
            || Wide::new(simd, slab_ray, &filter, leaves_at),
        );
        let wide = wide.as_ref().map(black_box);
        let flips = flips_of(slab_ray);
        let start = Resume { number: 0, top: 0, end: slab_ray.end, budget: bvh.budget() };
        let Resume { number, mut top, mut end, mut budget } = resume.unwrap_or(start);
        let mut child = Child::Inner(number);
        loop {
            while let Child::Inner(number) = child {
                if top + (WIDTH - 1) > stack.len() {
                    *resume = Some(Resume { number, top, end, budget });
                    return Walked::Full;
                }
                tally.grid_step();
                let Some(node) = bvh.nodes.get(number as usize) else { return Walked::Through };
                if !budget.take(1) {
                    return Walked::Through;
                }
                // Intersect the ray with the eight boxes of the node.
                let (met, near) = match wide {
                    Some(ray) => ray.meet(simd, node, bvh.fine_sides(node), flips, end),
                    None => meet(simd, slab_ray, node, end),
                };
                if met == 0 {
                    // Pop the next child.
                    let Some(next) = pop(bvh, stack, &mut top, end) else { return Walked::Through };
                    child = next;
                    continue;
                }
                // Descend into the nearest, push the others.
                child = node.child(push_others(stack, &mut top, number, met, near));
            }

            // Filter the triangles of a leaf, all eight together. Decide those that pass one by one in f64.
            let Child::Leaf { first, count } = child else { continue };
            let ids = bvh.leaf(first, count);
            if !budget.take(1) {
                return Walked::Through;
            }
            tally.cell_step();
            tally.primitive_tests(ids.len());
            if F::OF_BOXES
                && offer_leaf(simd, wide, slab_ray, mesh, ids, flips, bounds, &mut end, *search)
            {
                return Walked::Through;
            }
            let mut survivors = match wide {
                _ if F::OF_BOXES => 0,
                Some(ray) => ray.survivors(simd, bvh, mesh, first, ids),
                None => filter.survivors(mesh, ids),
            };
            while survivors != 0 {
                let lane = survivors.trailing_zeros() as usize;
                survivors &= survivors - 1;
                let Some(&id) = ids.get(lane) else { break };
                match search.decided(TriangleTest::decide_for(ray, cull, mesh, id)) {
                    Outcome::Unchanged => {}
                    Outcome::EndsAt(t) => end = slab_ray.latest(t),
                    Outcome::Done => return Walked::Through,
                }
            }
            let Some(next) = pop(bvh, stack, &mut top, end) else { return Walked::Through };
            child = next;
        }
    }
}

/// Offers a search the shapes of a leaf whose boxes the ray meets, the nearest first, and moves the end of the
/// ray; returns true once the search is over.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "a part of the walk, with its variables")]
fn offer_leaf<S: Simd, F: Search>(
    simd: S,
    wide: Option<&Wide<S>>,
    ray: &SlabRay,
    mesh: &TriangleMesh<'_>,
    ids: &[u32],
    flips: NearSides,
    bounds: &Aabb,
    end: &mut f32,
    search: &mut F,
) -> bool {
    let pad = pad_of(bounds);
    let (mut met, near) = match wide {
        Some(ray) => ray.meet_leaf(simd, mesh, ids, flips, pad, *end),
        None => meet_leaf(ray, mesh, ids, pad, *end),
    };
    while met != 0 {
        let lane = nearest_of(met, &near);
        met &= !(1 << lane);
        let Some(&id) = ids.get(lane) else { break };
        let is_behind = near[lane % WIDTH] > *end;
        if is_behind {
            break;
        }
        match search.offer(id) {
            Outcome::Unchanged => {}
            Outcome::EndsAt(t) => *end = ray.latest(t),
            Outcome::Done => return true,
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::simd::{SimdLevel, dispatch};

    /// A node against a ray, with the vectors of a level.
    struct Both<'a>(&'a SlabRay, &'a Node, f32);

    impl Kernel for Both<'_> {
        type Output = [(u32, [f32; WIDTH]); 2];

        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let Self(ray, node, end) = self;
            let wide = Wide::new(simd, ray, &RayFilter::NONE, None).meet(
                simd,
                node,
                None,
                flips_of(ray),
                end,
            );
            let one_by_one = meet(simd, ray, node, end);
            [wide, one_by_one].map(|(met, near)| (met, near.into()))
        }
    }

    fn random(state: &mut u32) -> u32 {
        *state ^= *state << 13;
        *state ^= *state >> 17;
        *state ^= *state << 5;
        *state
    }

    #[test]
    fn boxes_are_met_alike_with_vectors_and_without() {
        let mut state = 1;
        let bounds = Aabb { min: Vec3A::splat(-2.0), max: Vec3A::splat(2.0) };
        let levels: Vec<_> = SimdLevel::available().collect();
        let (mut met_some, mut missed_some) = (0, 0);
        for _ in 0..if cfg!(miri) { 20 } else { 2000 } {
            let mut number = || {
                let [a, b, ..] = random(&mut state).to_le_bytes();
                f32::from(u16::from_le_bytes([a, b])) / 16_384.0 - 2.0
            };
            let origin = [number(), number(), number()];
            let mut direction = [number(), number(), number()];
            if origin[0] > 1.5 {
                direction[1] = 0.0;
            }
            let ray = Ray { t_min: 0.0, t_max: 3.0, ..Ray::new(origin, direction) };
            let mut node = Node { origin: [(-1.0_f32).to_bits(); 3], ..Node::EMPTY };
            // Steps of 2^-7: boxes within two units of the origin.
            node.word = node.word & 0xff00_0000 | 0x0078_7878;
            for slot in 0..WIDTH {
                for axis in 0..3 {
                    let [a, b, ..] = random(&mut state).to_le_bytes();
                    node.bounds[axis][slot] = a.min(b);
                    node.bounds[axis + 3][slot] = a.max(b);
                }
            }
            let Some((slab_ray, _)) = SlabRay::nearby(&ray, [0.0, 3.0], &bounds) else { continue };
            for &level in &levels {
                let [(met_wide, near_wide), (met, near)] =
                    dispatch(level, Both(&slab_ray, &node, slab_ray.end));
                assert_eq!(met_wide, met, "{level:?} {ray:?} {node:?}");
                for slot in (0..WIDTH).filter(|slot| met >> slot & 1 == 1) {
                    assert_eq!(near_wide[slot].to_bits(), near[slot].to_bits());
                    met_some += 1;
                }
                missed_some += WIDTH - met.count_ones() as usize;
            }
        }
        assert!(met_some > 100 && missed_some > 100);
    }
}
