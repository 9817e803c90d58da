//! The triangles that may be closest to a point: nearest child first.
//!
//! ```text
//! node = root
//! loop: bound the distances from the point to the eight boxes of the node
//!       descend into the nearest child within reach, push the others
//!       a leaf of one triangle, or of two unless the last bounds dropped one: test them in f64
//!       another: bound the distances to its triangles at once, test those within reach in f64, nearest first
//!       pop what is still within reach
//! ```
//!
//! Distances are squared and in f32. A bound must never drop a triangle that the test in f64 would report:
//!
//! - **Range.** Coordinates are scaled by a power of two, so that the farthest side of the tree's box is one to
//!   two away. No square overflows, and what underflows in one is below [`TINY`].
//! - **Boxes.** A side relative to the point has two roundings. Where the node lies within 2^9 steps of the point, they
//!   are below 2^-13 steps, which the margin of quantised boxes absorbs ([`node`](super::node)). Sides that are not
//!   quantised ([`fine`](super::fine)) have one rounding. Elsewhere terms lose no more than a bit by cancelling: 3 *
//!   2^-24 of the side, 9 * 2^-24 of the squared distance.
//! - **Triangles.** A scalar product of corners with a direction has four roundings a term ([`DOTS`] is
//!   twice that), and what is computed from it has eight.
//! - **Reach.** Five roundings: with those above they are below 2^-20 ([`WIDER`]).
//! - **The test** reports a point that is off the triangle by less than 2^-45 of the largest coordinate. So
//!   the distance that it reports may be smaller by that, and the reach grows by `slack`.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8};

use super::Bvh;
use super::boxes::{bits, splat};
use super::node::{Child, Node, WIDTH, floats};
use super::shape_leaf::nearest_of;
use super::slab::{TINY, WIDER};
use super::stack::{StackEntry, entry, pop};
use crate::aabb::{Aabb, greater};
use crate::counters::Tally;
use crate::eight::Eight;
use crate::extremes::Extremes;
use crate::filter::minus;
use crate::mesh::TriangleMesh;
use crate::simd::Kernel;

/// Error bound of a scalar product, in parts of the product of the vectors' sums of magnitudes.
const DOTS: f32 = 1.0 / 2_097_152.0; // 2^-21
/// The most by which the test in f64 may report a point as too near, in parts of the largest coordinate: 32 times the
/// 2^-45 of above.
const SLACK: f32 = 1.0 / 1_048_576.0 / 1_048_576.0; // 2^-40

/// The search for the triangle that is closest to a point.
pub(crate) struct ClosestSearch<'r, F, T> {
    pub(crate) bvh: &'r Bvh<'r>,
    pub(crate) mesh: &'r TriangleMesh<'r>,
    /// The box of the tree.
    pub(crate) bounds: &'r Aabb,
    pub(crate) point: [f32; 3],
    /// Triangles that are farther do not matter.
    pub(crate) within: f32,
    /// Tests a triangle; returns how far triangles matter from then on.
    pub(crate) test: F,
    pub(crate) tally: &'r mut T,
    pub(crate) stack: &'r mut [StackEntry],
}

/// A point that distances are measured from.
#[derive(Clone, Copy)]
struct Point {
    at: [f32; 3],
    /// A power of two by which coordinates are multiplied.
    scale: f32,
    slack: f32,
}

impl Point {
    #[inline(always)]
    fn new(point: [f32; 3], bounds: &Aabb) -> Self {
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        // Find the distance to the farthest side of the tree's box, and its largest coordinate.
        let (mut farthest, mut largest) = (0.0, 0.0);
        for axis in 0..3 {
            // Quarters do not overflow.
            let [at, min, max] = [point[axis], min[axis], max[axis]].map(|side| 0.25 * side);
            farthest = greater(farthest, greater((at - min).abs(), (at - max).abs()));
            largest = greater(largest, greater(min.abs(), max.abs()));
        }
        // One over the power of two below the farthest quarter.
        let exponent = (farthest.to_bits() >> 23).clamp(1, 253);
        let scale = f32::from_bits((254 - exponent) << 23) * 0.25;
        Self { at: point.map(|at| at * scale), scale, slack: largest * scale * (4.0 * SLACK) }
    }

    /// An upper bound of the squares of all distances that round to this one.
    #[inline(always)]
    fn reach(&self, distance: f32) -> f32 {
        let distance = distance.next_up() * self.scale + self.slack;
        distance * distance * WIDER + TINY
    }
}

/// The squared distances from the point to the boxes of a node.
#[inline(always)]
fn boxes<S: Simd>(simd: S, bvh: &Bvh<'_>, node: &Node, point: &Point) -> f32x8<S> {
    let scale = f32x8::splat(simd, point.scale);
    let mut away = [scale; 3];
    if let Some(fine) = bvh.fine_sides(node) {
        for (axis, away) in away.iter_mut().enumerate() {
            let at = f32x8::splat(simd, point.at[axis]);
            let (low, high) = (fine.side(simd, axis), fine.side(simd, axis + 3));
            *away = outside(simd, low * scale - at, high * scale - at);
        }
        return dot(away, away);
    }
    let (origin, steps) = (node.origin(), node.wide_steps(simd));
    let [a, b, c, d, e, f] = node.bounds;
    let rows = [floats(simd, a, d), floats(simd, b, e), floats(simd, c, f)];
    for axis in 0..3 {
        let step = steps[axis] * scale;
        let base = f32x8::splat(simd, origin[axis] * point.scale - point.at[axis]);
        let (low, high) = rows[axis];
        away[axis] = outside(simd, low * step + base, high * step + base);
    }
    dot(away, away)
}

/// Eight vectors, by axis.
type Vectors<S> = [f32x8<S>; 3];

/// Lower bounds of the squared distances from the point to eight triangles.
///
/// Take the plane that is perpendicular to a direction and goes through the triangle's nearest corner along it. The
/// whole triangle lies behind this plane, so its distance is a lower bound. Two directions are tried: to the nearest
/// point of an edge, and the normal. One of them leads to the closest point, so the bound is tight up to rounding.
#[inline(always)]
fn triangles<S: Simd>(simd: S, corners: &[Vectors<S>; 3], point: &Point) -> f32x8<S> {
    let (scale, at) = (f32x8::splat(simd, point.scale), splat(simd, point.at));
    let [a, b, c] = *corners;
    let a = [a[0] * scale - at[0], a[1] * scale - at[1], a[2] * scale - at[2]];
    let b = [b[0] * scale - at[0], b[1] * scale - at[1], b[2] * scale - at[2]];
    let c = [c[0] * scale - at[0], c[1] * scale - at[1], c[2] * scale - at[2]];
    let (ab, ac, bc) = (minus(b, a), minus(c, a), minus(c, b));
    let edge = nearer(nearer(on_edge(simd, a, ab), on_edge(simd, a, ac)), on_edge(simd, b, bc));
    let normal = cross(ab, ac);
    let far = sum(a).greater(sum(b)).greater(sum(c)) * f32x8::splat(simd, DOTS);
    let corners = [a, b, c];
    across(simd, edge, &corners, far).greater(across(simd, normal, &corners, far))
}

// The products of the filter would not do: some machines fuse them, and counters must be the same on all machines.

#[inline(always)]
fn cross<S: Simd>(a: Vectors<S>, b: Vectors<S>) -> Vectors<S> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn dot<S: Simd>(a: Vectors<S>, b: Vectors<S>) -> f32x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The point of an edge that is closest to zero, about.
#[inline(always)]
fn on_edge<S: Simd>(simd: S, from: Vectors<S>, along: Vectors<S>) -> Vectors<S> {
    let share = -dot(from, along) / dot(along, along);
    let share = share.greater(f32x8::splat(simd, 0.0)).lesser(f32x8::splat(simd, 1.0));
    let [x, y, z] = along;
    [from[0] + share * x, from[1] + share * y, from[2] + share * z]
}

/// The vector that is shorter, in each lane.
#[inline(always)]
fn nearer<S: Simd>(one: Vectors<S>, other: Vectors<S>) -> Vectors<S> {
    let is_other = dot(other, other).simd_lt(dot(one, one));
    [
        is_other.select(other[0], one[0]),
        is_other.select(other[1], one[1]),
        is_other.select(other[2], one[2]),
    ]
}

/// Lower bounds of the squared distances from zero to triangles: those of the planes that are perpendicular to the
/// direction and go through the nearest corner of each. `far` is [`DOTS`] times the largest sum of magnitudes of a
/// corner.
#[inline(always)]
fn across<S: Simd>(
    simd: S,
    direction: Vectors<S>,
    [a, b, c]: &[Vectors<S>; 3],
    far: f32x8<S>,
) -> f32x8<S> {
    let (a, b, c) = (dot(direction, *a), dot(direction, *b), dot(direction, *c));
    let (low, high) = (a.lesser(b).lesser(c), a.greater(b).greater(c));
    let gap = low.greater(-high) - sum(direction) * far;
    let gap = gap.greater(f32x8::splat(simd, 0.0));
    (gap * gap - f32x8::splat(simd, 64.0 * TINY)) / dot(direction, direction)
}

/// The sum of the magnitudes of the components.
#[inline(always)]
fn sum<S: Simd>([x, y, z]: Vectors<S>) -> f32x8<S> {
    x.abs() + y.abs() + z.abs()
}

/// Returns the distance of zero from each interval, 0 inside.
#[inline(always)]
fn outside<S: Simd>(simd: S, low: f32x8<S>, high: f32x8<S>) -> f32x8<S> {
    low.greater(-high).greater(f32x8::splat(simd, 0.0))
}

impl<F: FnMut(u32) -> f32, T: Tally> Kernel for &mut ClosestSearch<'_, F, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let ClosestSearch { bvh, mesh, bounds, point, within, test, tally, stack } = self;
        let point = Point::new(*point, bounds);
        let mut reach = point.reach(*within);
        // Bounding a leaf costs as much as testing one triangle. It drops most pairs of a scan, but none of two
        // triangles that share the closest corner. So a leaf of two is bounded only if the last bounds dropped a
        // triangle, and in a tree whose leaves hold no more than two none is.
        let mut unbounded = 2;
        let mut top = 0;
        let mut budget = bvh.budget();
        let mut child = Child::Inner(0);
        loop {
            if !budget.take(1) {
                return;
            }
            match child {
                Child::Inner(number) => {
                    tally.grid_step();
                    let Some(node) = bvh.nodes.get(number as usize) else { return };
                    // Bound the distances to the boxes of the node.
                    let away = boxes(simd, bvh, node, &point);
                    let beyond = away.simd_gt(f32x8::splat(simd, reach));
                    let mut rest = !bits(beyond) & node.used();
                    if rest != 0 {
                        let away: [f32; WIDTH] = away.into();
                        let at = |slot: u32| away[slot as usize % WIDTH];
                        // Descend into the nearest, push the others in any order: few of them are within
                        // reach when they are popped.
                        let mut nearest = rest.trailing_zeros();
                        rest &= rest - 1;
                        while rest != 0 {
                            let mut other = rest.trailing_zeros();
                            rest &= rest - 1;
                            if at(other) < at(nearest) {
                                core::mem::swap(&mut other, &mut nearest);
                            }
                            let Some(place) = stack.get_mut(top) else { return };
                            *place = entry(number, other, at(other).to_bits());
                            top += 1;
                        }
                        child = node.child(nearest);
                        continue;
                    }
                }
                Child::Leaf { first, count } => {
                    let ids = bvh.leaf(first, count);
                    tally.cell_step();
                    tally.primitive_tests(ids.len());
                    // Test the triangles of a small leaf; of a larger one, bound the distances first.
                    if ids.len() <= unbounded {
                        for &id in ids {
                            reach = point.reach(test(id));
                        }
                    } else {
                        let lanes = bvh.lanes(first, ids);
                        let eight = Eight::of(simd, mesh, lanes, ids.len());
                        let away = triangles(simd, &eight.corners, &point);
                        let mut rest = !bits(away.simd_gt(f32x8::splat(simd, reach))) & eight.used;
                        unbounded = if rest == eight.used { 2 } else { 1 };
                        let away: [f32; WIDTH] = away.into();
                        while rest != 0 {
                            // The nearest first: it may show that the others are too far.
                            let lane = nearest_of(rest, &away);
                            rest &= !(1 << lane);
                            // Continue, do not break: a lane whose bound is NaN must be tested, too.
                            if away[lane % WIDTH] > reach {
                                continue;
                            }
                            let Some(&id) = ids.get(lane) else { break };
                            reach = point.reach(test(id));
                        }
                    }
                }
            }
            // Pop what is within reach.
            let Some(next) = pop(bvh, stack, &mut top, reach) else { return };
            child = next;
        }
    }
}
