//! The boxes of a node or a leaf as numbers, and the slab tests of rays and beams against them.
//!
//! ```text
//! decode      side = byte * step + node's origin - origin of the group, or fine side - origin of the group
//! beam        all rays against eight boxes: which are met by none, which by all
//! one ray     against eight boxes
//! more rays   sixteen against one box
//! ```
//!
//! Groups use the slab test of [`slab`](super::slab), rounded differently. Let u = 2^-24, and measure from the
//! origin of the first ray that was ready. A distance is `side * inverse - origin * inverse`; the second product is
//! computed once a ray.
//!
//! ```text
//! relative to the distance   near: node's origin 1, sum 1, growth 1, product 1, sum 1, inverse 1    6 u
//!                            far: these, and the factor for far sides                               7 u
//! absolute                   origin 1, its product 1, and 4 of those above, relative to the origin  6 u * origin
//! ```
//!
//! Fine sides have one rounding less.
//!
//! The factor for far sides is 1 + 16 u, and boxes grow by 8 u times the largest coordinate of an origin. Products stay
//! finite, because trees with an extent of 2^48 and more are not traced in groups.
//!
//! The box that short rays sweep reaches on each axis from their origins to `direction * end + origin`. A hit lies
//! between these two, and in a box of the tree, up to roundings:
//!
//! ```text
//! of the end      origin 1, product 1, sum 1             2 u * length + 2 u * origin
//! of the box      node's origin 1, sum 1, growth 1       3 u * length + 3 u * origin
//! ```
//!
//! This is less than the 16 u by which ends are widened, and the 8 u by which boxes grow. What underflows is added to
//! the swept box.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, mask32x8};

use super::Bvh;
use super::node::{Node, WIDTH, floats};
use super::shape_leaf::boxes_of_leaf;
use super::slab::WIDER;
use crate::extremes::Extremes;
use crate::mesh::TriangleMesh;

/// Sides of eight boxes, or of one box in all lanes, by axis.
#[derive(Clone, Copy)]
pub(crate) struct WideBoxes<V> {
    low: [V; 3],
    high: [V; 3],
}

/// Rays for slab tests: one in all lanes, or one a lane.
#[derive(Clone, Copy)]
pub(crate) struct SlabRays<V> {
    /// Minus the origin times the inverse direction.
    pub(crate) offset: [V; 3],
    pub(crate) inverse: [V; 3],
    pub(crate) start: V,
    pub(crate) end: V,
}

/// With more rays than this, the beam of a group is tested before the rays.
pub(super) const FEW_RAYS: u32 = 8;

/// All rays of a group as intervals, in all lanes. On an axis on which directions have both signs, the
/// inverse directions are unbounded.
#[derive(Clone, Copy)]
pub(crate) struct Beam<S: Simd> {
    /// The ends of the interval. On a bounded axis, a ray from the first one reaches a side earlier than one from the
    /// second.
    pub(crate) origin: [[f32x8<S>; 2]; 3],
    pub(crate) inverse: [[f32x8<S>; 2]; 3],
    pub(crate) is_bounded: [bool; 3],
    /// The sign of the directions on a bounded axis: true if all are positive.
    pub(crate) is_positive: [bool; 3],
    /// The box around all rays, from their origins to their ends. If directions have both signs on an axis and all rays
    /// are short, it is tested in place of the intervals. It only tells the boxes that no ray meets.
    pub(crate) swept: Option<[[f32x8<S>; 2]; 3]>,
    pub(crate) start: f32x8<S>,
    pub(crate) end: f32x8<S>,
}

/// The boxes of a node that a beam meets.
pub(crate) struct BeamMet<S: Simd> {
    /// The boxes that at least one ray may meet, as bits.
    pub(crate) some: u32,
    /// The boxes that the line of every ray crosses behind its start, up to rounding, as bits. Ends do not count: a ray
    /// that ends before such a box only costs time.
    pub(crate) all: u32,
    /// For each box, a distance before which no ray enters it.
    pub(crate) enter: f32x8<S>,
}

impl<S: Simd> WideBoxes<f32x8<S>> {
    /// The eight boxes of a node relative to a point, grown on each side.
    #[inline(always)]
    pub(crate) fn decode(
        simd: S,
        bvh: &Bvh<'_>,
        node: &Node,
        center: [f32; 3],
        growth: f32,
    ) -> Self {
        let growth = f32x8::splat(simd, growth);
        let mut boxes = Self { low: [growth; 3], high: [growth; 3] };
        if let Some(fine) = bvh.fine_sides(node) {
            for axis in 0..3 {
                let center = f32x8::splat(simd, center[axis]);
                boxes.low[axis] = fine.side(simd, axis) - center - growth;
                boxes.high[axis] = fine.side(simd, axis + 3) - center + growth;
            }
            return boxes;
        }
        let (origin, steps) = (node.origin(), node.wide_steps(simd));
        // Turn the bytes of both sides of an axis into numbers.
        let [a, b, c, d, e, f] = node.bounds;
        let (rows, others, last) = (floats(simd, a, d), floats(simd, b, e), floats(simd, c, f));
        let rows = [rows, others, last];
        // Scale them, and move them to the origin of the group.
        for axis in 0..3 {
            let base = f32x8::splat(simd, origin[axis] - center[axis]);
            boxes.low[axis] = rows[axis].0 * steps[axis] + base - growth;
            boxes.high[axis] = rows[axis].1 * steps[axis] + base + growth;
        }
        boxes
    }

    /// The boxes of a leaf relative to a point, grown on each side. Unused lanes repeat other boxes of the leaf.
    #[inline(always)]
    pub(crate) fn of_leaf(
        simd: S,
        mesh: &TriangleMesh<'_>,
        ids: &[u32],
        center: [f32; 3],
        growth: f32,
    ) -> Self {
        let (mut low, mut high) = boxes_of_leaf(simd, mesh, ids);
        for axis in 0..3 {
            low[axis] = low[axis] - center[axis] - growth;
            high[axis] = high[axis] - center[axis] + growth;
        }
        Self { low, high }
    }

    /// The sides as arrays.
    #[inline(always)]
    pub(crate) fn sides(&self) -> [[f32; WIDTH]; 6] {
        let ([a, b, c], [d, e, f]) = (self.low, self.high);
        [a.into(), b.into(), c.into(), d.into(), e.into(), f.into()]
    }

    /// Intersects a beam with the boxes.
    #[inline(always)]
    pub(crate) fn meet_beam(&self, simd: S, beam: &Beam<S>) -> BeamMet<S> {
        if let Some([x, y, z]) = beam.swept {
            let some = self.meet_swept(x, 0) & self.meet_swept(y, 1) & self.meet_swept(z, 2);
            return BeamMet { some: bits(some), all: 0, enter: beam.start };
        }
        // Bound the distances at which the rays enter the boxes and leave them.
        let (mut enter, mut leave) = (beam.start, f32x8::splat(simd, f32::INFINITY));
        let (mut all_in, mut first_out) = (beam.start, leave);
        for axis in 0..3 {
            if !beam.is_bounded[axis] {
                all_in = f32x8::splat(simd, f32::INFINITY);
                continue;
            }
            let [early, late] = beam.origin[axis];
            let [least, most] = beam.inverse[axis];
            let (low, high) = (self.low[axis], self.high[axis]);
            let (near, far) = if beam.is_positive[axis] { (low, high) } else { (high, low) };
            // A distance is least for the origin that is early, and greatest for the late one.
            let (a, b) = ((near - early) * least, (near - early) * most);
            let (c, d) = ((near - late) * least, (near - late) * most);
            (enter, all_in) = (enter.greater(a.lesser(b)), all_in.greater(c.greater(d)));
            let (a, b) = ((far - early) * least, (far - early) * most);
            let (c, d) = ((far - late) * least, (far - late) * most);
            (first_out, leave) = (first_out.lesser(a.lesser(b)), leave.lesser(c.greater(d)));
        }
        let leave = (leave * f32x8::splat(simd, WIDER)).lesser(beam.end);
        BeamMet { some: bits(!enter.simd_gt(leave)), all: bits(all_in.simd_lt(first_out)), enter }
    }

    /// Returns the lanes whose box has a coordinate in an interval.
    #[inline(always)]
    fn meet_swept(&self, [low, high]: [f32x8<S>; 2], axis: usize) -> mask32x8<S> {
        self.low[axis].simd_le(high) & self.high[axis].simd_ge(low)
    }
}

impl<V> WideBoxes<V> {
    /// One of the boxes in all lanes.
    #[inline(always)]
    pub(crate) fn one<S: Simd>(simd: S, sides: &[[f32; WIDTH]; 6], slot: usize) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        let slot = slot % WIDTH;
        let [a, b, c, d, e, f] = sides;
        Self {
            low: [V::splat(simd, a[slot]), V::splat(simd, b[slot]), V::splat(simd, c[slot])],
            high: [V::splat(simd, d[slot]), V::splat(simd, e[slot]), V::splat(simd, f[slot])],
        }
    }

    /// Returns, for each lane, the distance at which the ray enters the box, and a mask of the lanes that meet.
    #[inline(always)]
    pub(crate) fn meet<S: Simd>(&self, simd: S, rays: &SlabRays<V>) -> (V, V::Mask)
    where
        V: SimdFloat<S, Element = f32> + Extremes,
    {
        let (x, y, z) = (self.cross(rays, 0), self.cross(rays, 1), self.cross(rays, 2));
        let near = x.0.greater(y.0).greater(z.0.greater(rays.start));
        let far = x.1.lesser(y.1).lesser(z.1) * V::splat(simd, WIDER);
        let far = far.lesser(rays.end);
        (near, !near.simd_gt(far))
    }

    /// Returns the distances at which rays cross the near and the far sides on an axis. Their last bits differ between
    /// machines that fuse the sum and others. No hit depends on them, only the order of boxes.
    #[inline(always)]
    fn cross<S: Simd>(&self, rays: &SlabRays<V>, axis: usize) -> (V, V)
    where
        V: SimdFloat<S, Element = f32> + Extremes,
    {
        let low = self.low[axis].mul_add(rays.inverse[axis], rays.offset[axis]);
        let high = self.high[axis].mul_add(rays.inverse[axis], rays.offset[axis]);
        (low.lesser(high), low.greater(high))
    }
}

/// A point in vectors.
#[inline(always)]
pub(crate) fn splat<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> [f32x8<S>; 3] {
    [f32x8::splat(simd, x), f32x8::splat(simd, y), f32x8::splat(simd, z)]
}

/// A mask as bits.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "eight bits")]
pub(crate) fn bits<S: Simd>(mask: mask32x8<S>) -> u32 {
    mask.to_bitmask() as u32
}
