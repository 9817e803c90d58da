//! A ray prepared for slab tests, and the error bounds of these tests.
//!
//! ```text
//! near = max over axes of (near side - origin) / direction     far = min over axes of (far side - origin) / direction
//! the box is met if near <= far, near <= end, far >= start
//! ```
//!
//! The test is done in f32 and must never miss a box that holds a hit:
//!
//! - **Relative errors.** A distance takes at most six roundings. So `far` is
//!   computed with an inverse direction that is larger by 2^-20, and the range of the ray is widened alike.
//! - **Absolute errors.** The margin of quantised boxes absorbs those where terms cancel ([`node`](super::node)).
//! - **Errors of a hit's `t`**, where the range begins or ends at one: it is off by less than 2^-23 of itself, and by
//!   2^-38 of the range of the corners' `t` ([`triangle`](crate::triangle)), which is at most the tree's extent. The
//!   relative margin covers the first; [`growth_of_range`] adds twice the second.
//! - **Zero directions.** Their inverse is [`STEEP`]. `validate` accepts no step below 2^-61 of the tree's extent and
//!   no margin below 2^-10 of a step ([`fine`](super::fine)): together 2^-71 of the extent. A ray starts at most 4.5
//!   extents from any side of the tree's box, so it moves along such an axis by less than 2^-72 of the extent before it
//!   has passed the tree. So a ray with a hit in a box starts at least 2^-72 of the extent inside, and leaves the box
//!   eight extents away or more, behind the tree; and a ray outside never enters. Products stay finite as long as the
//!   tree's extent is below 2^50; beyond, a NaN counts as a box that is met.
//! - **Far origins.** The ray starts at a point near the tree ([`Approach`]), which may be off the ray by
//!   `slack`; near sides are that much nearer, far sides farther.
//!
//! The direction is scaled by a power of two so that its largest component lies between 1 and 2, and the
//! range of the ray with it: distances are about those in the tree, whatever the direction's length.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8};
use glam::Vec3A;

use crate::aabb::{Aabb, greater, lesser};
use crate::approach::{Approach, FAR_EXTENTS};
use crate::extremes::Extremes;
use crate::filter::{NEARBY_LONG, NEARBY_SHORT, RayFilter};
use crate::ray::{Ray, round};
use crate::triangle::OF_CORNERS;

/// The inverse of a direction that is zero, or too small to divide by.
pub(crate) const STEEP: f32 = 32_768.0 * 1_048_576.0 * 1_048_576.0 * 1_048_576.0; // 2^75

/// The factor that widens far distances by their relative error: 1 + 2^-20.
pub(crate) const WIDER: f32 = 1.0 + 1.0 / 1_048_576.0;

/// The amount by which a ray starts earlier, relative to its start. [`WIDER`] moves a far side nearer if its distance
/// is negative; this is more than that.
pub(crate) const EARLIER: f32 = 2.0 * (WIDER - 1.0);

/// Returns the amount by which near sides are moved back where sides may lie behind the start: [`WIDER`] moves a far
/// side with a negative distance nearer, not farther. `distance` is that of the farthest corner of the tree's box.
#[inline(always)]
fn behind(distance: f32) -> f32 {
    2.0 * (WIDER - 1.0) * distance
}

/// More than what underflows on the way to a distance.
pub(crate) const TINY: f32 = f32::MIN_POSITIVE;

/// Returns the amount by which a range grows at both ends, in scaled distances, beside what is relative to the ends:
/// for the error of a `t`, and for underflow.
#[inline(always)]
fn growth_of_range(extent: f32, scale: f32) -> f32 {
    extent * OF_CORNERS + TINY * scale.max(1.0)
}

/// Returns a distance behind all hits that have this `t`. A hit may lie farther away than its `t`, which is rounded and
/// off by a share of the corners' range.
#[inline(always)]
pub(crate) fn end_behind(t: f32, scale: f32, extent: f32) -> f32 {
    let (end, growth) = (t * scale, growth_of_range(extent, scale));
    end + (end.abs() * (WIDER - 1.0) + growth)
}

/// [`end_behind`] of eight rays, with the same bits.
#[inline(always)]
pub(crate) fn ends_behind<S: Simd>(simd: S, t: [f32; 8], scale: [f32; 8], extent: f32) -> f32x8<S> {
    let scale = f32x8::simd_from(simd, scale);
    let end = f32x8::simd_from(simd, t) * scale;
    let growth = scale.greater(f32x8::splat(simd, 1.0)) * TINY + extent * OF_CORNERS;
    end + (end.abs() * (WIDER - 1.0) + growth)
}

/// A ray prepared for slab tests.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SlabRay {
    /// Start of the ray, moved by the slack so that near sides come nearer and far ones go farther.
    pub(crate) origin_near: Vec3A,
    pub(crate) origin_far: Vec3A,
    /// One over the scaled direction.
    pub(crate) inverse: Vec3A,
    /// The range in which boxes matter.
    pub(crate) start: f32,
    pub(crate) end: f32,
    /// The `t` of the start, and scaled distances for each unit of `t`.
    t: f64,
    scale: f64,
    /// The scale of a ray that starts at its origin; 0 of others.
    nearby: f32,
    /// The amount by which the range grows at both ends, from [`growth_of_range`].
    growth: f32,
}

impl SlabRay {
    /// An interval of a ray that starts near a box, and its filter for triangles there; `None` if it starts farther
    /// away, is empty or invalid, or has a very long or short direction.
    #[inline(always)]
    pub(crate) fn nearby(
        ray: &Ray,
        [begin, until]: [f32; 2],
        bounds: &Aabb,
    ) -> Option<(Self, RayFilter)> {
        let (origin, direction) = (Vec3A::from(ray.origin), Vec3A::from(ray.direction));
        let longest = direction.abs().max_element();
        let size = bounds.size();
        let extent = size.max_element();
        let away = (origin - (bounds.min + bounds.max) * 0.5).abs();
        let is_near = away.cmple(Vec3A::splat(FAR_EXTENTS * extent)).all();
        let is_ray = longest > NEARBY_SHORT && longest < NEARBY_LONG && begin <= until;
        // A NaN may hide beside the longest component.
        let is_number = direction.element_sum() <= f32::MAX;
        if !(is_near && is_ray && is_number) {
            return None;
        }
        let exponent = longest.to_bits() & 0x7f80_0000;
        let scale = f32::from_bits(exponent);
        let inverse_scale = f32::from_bits(0x7f00_0000 - exponent);
        let inverse = Vec3A::splat(scale) / direction;
        let steep = Vec3A::splat(STEEP);
        let inverse = Vec3A::select(inverse.abs().cmple(steep), inverse, steep.copysign(direction));
        let direction = direction * inverse_scale;
        // Widen the range: a t stands for all numbers that round to it, a tiny one for all below 2^-149. No product may
        // be denormal unless the ray is: some processors take 70 cycles for it. Use `max`, not `if`: an `if` becomes a
        // select, and the product that is not selected is computed, too.
        let start = lesser(begin * scale, f32::MAX);
        let end = greater(until * scale, -f32::MAX);
        let growth = growth_of_range(extent, scale);
        let distance = (away + size * 0.5).max_element();
        // Hits that lie behind the origin are those of a negative `t_min`, wherever this walk begins.
        let origin_near =
            if ray.t_min < 0.0 { moved_back(origin, behind(distance), inverse) } else { origin };
        let slab_ray = Self {
            origin_near,
            origin_far: origin,
            inverse,
            start: start - (start.abs() * EARLIER + growth),
            end: end + (end.abs() * (WIDER - 1.0) + growth),
            t: 0.0,
            scale: f64::from(scale),
            nearby: scale,
            growth,
        };
        let sum = direction.abs().element_sum();
        let filter = RayFilter::nearby(ray.origin, direction.to_array(), sum, distance, extent);
        Some((slab_ray, filter))
    }

    /// An interval of a ray that starts where its approach says.
    #[cold]
    #[inline(never)]
    pub(crate) fn new(ray: &Ray, [begin, until]: [f32; 2], approach: &Approach) -> Self {
        let [x, y, z] = ray.direction;
        let largest = f64::from(x.abs().max(y.abs()).max(z.abs()));
        // A power of two: the exponent of the largest component.
        let scale = f64::from_bits(largest.to_bits() & 0x7ff0_0000_0000_0000);
        let inverse = |d: f32| {
            let inverse = round(scale / f64::from(d));
            if inverse.abs() <= STEEP { inverse } else { STEEP.copysign(d) }
        };
        let inverse = Vec3A::new(inverse(x), inverse(y), inverse(z));
        let slack = approach.slack + behind(round(approach.reach.distance));
        let anchor = Vec3A::from(approach.anchor);
        let mut slab_ray = Self {
            origin_near: moved_back(anchor, slack, inverse),
            origin_far: moved_back(anchor, slack, -inverse),
            inverse,
            start: 0.0,
            end: 0.0,
            t: approach.t,
            scale,
            nearby: 0.0,
            growth: growth_of_range(round(approach.reach.extent), 1.0),
        };
        slab_ray.start = slab_ray.earliest(begin);
        slab_ray.end = slab_ray.latest(until);
        slab_ray
    }

    /// [`new`](Self::new) for a ray along which a `t` of its range or of a hit is `scale` times as large. In a tree of
    /// instances, the growth of their boxes covers the error of a `t`.
    #[cold]
    #[inline(never)]
    pub(crate) fn along(ray: &Ray, approach: &Approach, scale: f64) -> Self {
        let mut slab_ray = Self::new(ray, [ray.t_min, ray.t_max], approach);
        (slab_ray.t, slab_ray.scale) = (slab_ray.t / scale, slab_ray.scale * scale);
        (slab_ray.start, slab_ray.end) = (slab_ray.earliest(ray.t_min), slab_ray.latest(ray.t_max));
        slab_ray
    }

    /// A distance no farther than that of any number that rounds to `t`.
    fn earliest(&self, t: f32) -> f32 {
        let distance = round((f64::from(t.next_down()) - self.t) * self.scale);
        // Infinity minus its margin would be a NaN.
        let distance = lesser(distance, f32::MAX);
        (distance - distance.abs() * EARLIER) - self.growth
    }

    /// A distance no nearer than that of any number that rounds to `t`.
    #[inline(always)]
    pub(crate) fn latest(&self, t: f32) -> f32 {
        if self.nearby > 0.0 {
            // Compute it as [`nearby`](Self::nearby) does: the margin covers all that rounds to the same t.
            let distance = t * self.nearby;
            return distance + (distance.abs() * (WIDER - 1.0) + self.growth);
        }
        let distance = round((f64::from(t.next_up()) - self.t) * self.scale);
        (distance + distance.abs() * (WIDER - 1.0)) + self.growth
    }

    /// A `t` as a distance along the scaled direction, for a ray that starts at its origin.
    #[inline(always)]
    pub(crate) fn distance(&self, t: f32) -> f32 {
        t * self.nearby
    }

    /// The inverse direction for far sides.
    #[inline(always)]
    pub(crate) fn inverse_far(&self) -> Vec3A {
        self.inverse * WIDER
    }
}

/// Moves a point against a direction by at least an amount on each axis. The four operations round by at most 2^-24 of
/// both terms each, so that 2^-22 of them is added.
#[inline(always)]
fn moved_back(point: Vec3A, by: f32, inverse: Vec3A) -> Vec3A {
    let by = Vec3A::splat(by);
    point + (by + (point.abs() + by) * (2.0 * f32::EPSILON)).copysign(inverse)
}

/// The near side on each axis: 0 for the low side, [`FLIP`] for the high side.
pub(super) type NearSides = [usize; 3];

/// The distance in rows of a [`Node`](super::node::Node)'s bounds from the low side of an axis to its high side. XOR
/// with it swaps the sides.
pub(super) const FLIP: usize = 3;

/// Finds the near side on each axis.
#[inline(always)]
pub(super) fn flips_of(ray: &SlabRay) -> NearSides {
    ray.inverse.to_array().map(|inverse| if inverse < 0.0 { FLIP } else { 0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Kernel, SimdLevel, dispatch};

    const SCALES: [f32; 8] = [1e-37, 0.25, 0.5, 1.0, 2.0, 4.0, 1e6, 1e37];

    /// The ends of eight rays with hits at the same `t`, in a tree of an extent.
    struct Ends(f32, f32);

    impl Kernel for Ends {
        type Output = [f32; 8];
        const IS_WIDE: bool = true;

        fn run<S: Simd>(self, simd: S) -> [f32; 8] {
            ends_behind(simd, [self.0; 8], SCALES, self.1).into()
        }
    }

    #[test]
    fn ends_of_eight_rays_are_those_of_each() {
        for level in SimdLevel::available() {
            for t in [-3.0, -0.0, 0.0, 1e-40, 0.3, 7.0, f32::MAX, f32::INFINITY] {
                for extent in [1e-37, 1.7, 1e12] {
                    let eight = dispatch(level, Ends(t, extent)).map(f32::to_bits);
                    assert_eq!(eight, SCALES.map(|scale| end_behind(t, scale, extent).to_bits()));
                }
            }
        }
    }
}
