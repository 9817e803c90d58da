//! Drops triangles that the line of a ray meets before the ray starts, such as the one that the ray leaves.
//!
//! The [`filter`](crate::filter) keeps the triangle that a ray leaves, because the line of the ray meets it. The f64
//! test would compute nearly a whole hit before it rejects that triangle. This test rejects it in f32, if it is sure.
//!
//! ```text
//! g, e, f, q and det as in the filter    T = f . q    the line meets the triangle's plane at T / det
//! N = T - s det                          s: the start of the ray as a multiple of the scaled direction
//! drop if N is below -bound and det above error, or N above bound and det below -error
//! ```
//!
//! The claim: [`TriangleTest`](crate::triangle::TriangleTest) misses every triangle that is dropped here, if the filter
//! starts at the ray's own origin, without slack, and [`pays`] returned true for the box around all triangles. A NaN
//! compares false, and an infinite s makes the bound infinite: neither drops a triangle.
//!
//! # Proof
//!
//! Let G be the largest magnitude of a component of g, E that of e and f, and u = 2^-24. Components of d are below 2.
//!
//! ```text
//! error of   sum of its products   roundings of each product                            bound
//! T          6 G E^2               g 1, e 1, f 1, g * e 1, minus 1, q * f 1, sums 2     48 u G E^2
//! det        12 E^2                seven, as in the filter                              84 u E^2
//! N          those of T and of s det, a product 1, a difference 1                       54 u G E^2 + 108 u |s| E^2
//! ```
//!
//! The f64 test moves the corners by at most m on each of the two axes across the ray: 7 * 2^-53 of the distance of the
//! farthest corner, which is no more than the filter's M = G + E, nor than its X. Depths stay what they are. If no
//! corner lies before the start, neither does the point where the ray meets the moved triangle: N / det of that is not
//! negative. Else the test decides exactly, on the triangle as it is. The move changes T by at most 24 m E (G + E) and
//! det by at most 32 m E; the second order in m is below 28 m^2 (G + E) and 16 m^2.
//!
//! ```text
//! error    E (56 u E + 2^-45 M) + floor       2^-45 is more than 32 * 7 * 2^-53, so the second term covers the first
//!                                             order in m; floor is at least 28 m^2 + 2^-120, as it grows with X
//! bound    error (M + 2 |s|) + 2^-120         floor and 2^-120 cover what underflows
//! |det| must exceed 1.6 error: more than 84 u E^2 and its change, so that no move turns the triangle round
//! ```

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, mask32x8, u32x8};

use crate::aabb::Aabb;
use crate::filter::{LineFilter, Size, cross, dot, minus};

/// The largest extent of a box around all triangles with which T does not overflow: G is less than 2^41 then, because
/// no origin lies farther than [`FAR_EXTENTS`](crate::approach::FAR_EXTENTS) away, and E is at most 2^38.
const MOST_EXTENT: f32 = 262_144.0 * 1_048_576.0; // 2^38

/// 56 * 2^-24.
const UNITS: f32 = 56.0 / 16_777_216.0;
/// 32 times what moves the corners, in parts of M, and a little more: 2^-45.
const OF_REACH: f32 = 1.0 / (32.0 * 1_048_576.0 * 1_048_576.0);
/// More than what underflows: 2^-120.
const LEAST: f32 = f32::from_bits(0x0380_0000);

/// Returns true if the test is worth its time: the box around the origins of the rays meets the box around all
/// triangles, and T cannot overflow. Rays from outside leave no triangle.
#[inline(always)]
pub(crate) fn pays(bounds: &Aabb, origins: &Aabb) -> bool {
    bounds.meets(origins) && bounds.size().max_element() <= MOST_EXTENT
}

impl<S: Simd> LineFilter<f32x8<S>> {
    /// The lanes whose line meets its triangle before `start`, a distance along the scaled direction.
    ///
    /// It shares most terms with [`drops`](Self::drops). After that, the compiler computes only the others.
    #[inline(always)]
    pub(crate) fn passes_before(
        &self,
        simd: S,
        [a, b, c]: &[[f32x8<S>; 3]; 3],
        size: &Size<f32x8<S>>,
        start: f32x8<S>,
    ) -> mask32x8<S> {
        let g = minus(self.origin, *a);
        let e = minus(*b, *a);
        let f = minus(*c, *a);
        let det = dot(e, cross(self.direction, f));
        let ahead = (-start).mul_add(det, dot(f, cross(g, e)));

        let Size { longest, reach } = *size;
        let of_longest = longest.mul_add(f32x8::splat(simd, UNITS), reach * OF_REACH);
        let error = longest.mul_add(of_longest, self.floor);
        let bound = error.mul_add(reach + start.abs() * 2.0, f32x8::splat(simd, LEAST));
        // Change the sign where det is negative, as a division by det would.
        let sign = det.bitcast::<u32x8<S>>() & 0x8000_0000;
        let ahead = (ahead.bitcast::<u32x8<S>>() ^ sign).bitcast::<f32x8<S>>();
        ahead.simd_lt(-bound) & det.abs().simd_gt(error * 1.6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::approach::Reach;
    use crate::filter::{RayFilter, splat};
    use crate::mesh::Triangle;
    use crate::ray::Ray;
    use crate::samples::{Random, along, largest, line, triangle};
    use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};
    use crate::triangle::TriangleTest;

    /// A ray against a triangle in all lanes: true if it is dropped.
    struct Before<'a>(&'a RayFilter, &'a Triangle, f32);

    impl Kernel for Before<'_> {
        type Output = bool;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> bool {
            let Self(filter, triangle, start) = self;
            let start = f32x8::splat(simd, start);
            let corners = splat(simd, triangle);
            let filter = filter.line.splat(simd);
            let size = Size::new(filter.origin, &corners);
            let dropped = filter.passes_before(simd, &corners, &size, start).to_bitmask();
            assert!(dropped == 0 || dropped == 0xff, "{dropped:x}");
            dropped != 0
        }
    }

    /// The power of two that a direction is divided by for the filter.
    fn scale_of(direction: [f32; 3]) -> f32 {
        f32::from_bits(largest(&[direction]).to_bits() & 0x7f80_0000)
    }

    #[test]
    fn what_passes_before_the_start_is_missed_at_every_scale() {
        if !HAS_VECTORS {
            return;
        }
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let rounds = if cfg!(miri) { 30 } else { 600_000 };
        for scale in [1.0, 1e-30, 1e-9, 1e-3, 1e3, 1e11] {
            let (mut hits, mut before, mut drops) = (0, 0, 0);
            for _ in 0..rounds / 6 {
                let triangle = triangle(&mut random);
                let (origin, direction) = line(&mut random, &triangle);
                let shift = [0.0, 0.0, 100.0][random.below(3)];
                let place = |point: [f32; 3]| point.map(|x| (x + shift) * scale);
                let (triangle, origin) = (triangle.map(place), place(origin));
                let direction = direction.map(|d| d * [1.0, 1e-10, 1e10][random.below(3)]);
                if scale_of(direction) <= 0.0 {
                    continue;
                }
                // Start at the triangle, just before or behind it, at the origin, or anywhere.
                let whole = Ray { t_min: f32::NEG_INFINITY, ..Ray::new(origin, direction) };
                let Some(met) = TriangleTest::new(&whole).and_then(|test| test.test(&triangle))
                else {
                    continue;
                };
                let t_min = match random.below(12) {
                    8 => f32::MAX,
                    9 => f32::MIN,
                    10 => f32::from_bits(1),
                    11 => -f32::from_bits(1),
                    0 => met.t,
                    1 => met.t.next_up(),
                    2 => met.t.next_down(),
                    3 => met.t + met.t.abs() * 1e-6,
                    4 => met.t + met.t.abs() * 1e-3,
                    5 => 0.0,
                    6 => f32::NEG_INFINITY,
                    _ => met.t + met.t.abs(),
                };
                let ray = Ray { t_min, ..whole };
                let is_hit = TriangleTest::new(&ray).unwrap().test(&triangle).is_some();
                let [a, b, c] = triangle.map(glam::Vec3A::from_array);
                let bounds = Aabb { min: a.min(b).min(c), max: a.max(b).max(c) };
                let filter = RayFilter::new(direction, origin, 0.0, Reach::of(&bounds, origin));
                let start = t_min * scale_of(direction);
                for level in SimdLevel::available() {
                    let is_dropped = dispatch(level, Before(&filter, &triangle, start));
                    assert!(!(is_hit && is_dropped), "{level:?} {ray:?} {triangle:?}");
                    drops += u32::from(is_dropped && level == SimdLevel::detect());
                }
                hits += u32::from(is_hit);
                before += u32::from(!is_hit);
            }
            if cfg!(miri) {
                continue;
            }
            assert!(hits > 2000 && before > 2000, "{scale}: {hits} {before}");
            let is_in_range = (1e-9..=1e11).contains(&scale);
            assert!(!is_in_range || drops > before / 4, "{scale}: {drops} of {before}");
        }
    }

    #[test]
    fn the_test_pays_for_origins_inside_boxes_that_are_not_too_large() {
        let cube = |from: f32, to: f32| Aabb {
            min: glam::Vec3A::splat(from),
            max: glam::Vec3A::splat(to),
        };
        assert!(pays(&cube(-1.0, 1.0), &cube(1.0, 1.0)));
        assert!(pays(&cube(-1.0, 1.0), &cube(-3.0, 3.0)));
        assert!(!pays(&cube(-1.0, 1.0), &cube(1.5, 3.0)));
        assert!(pays(&cube(0.0, MOST_EXTENT), &cube(1.0, 1.0)));
        assert!(!pays(&cube(0.0, 2.0 * MOST_EXTENT), &cube(1.0, 1.0)));
    }

    /// A ray that starts a ten-thousandth of a small triangle's length above it does not test it.
    #[test]
    fn the_surface_that_a_ray_leaves_is_dropped() {
        if !HAS_VECTORS {
            return;
        }
        let mut random = Random(0x2545_f491_4f6c_dd1d);
        let bounds = Aabb { min: glam::Vec3A::splat(-1.0), max: glam::Vec3A::splat(1.0) };
        let mut drops = 0;
        for _ in 0..1000 {
            let a = random.point();
            let triangle = [a, along(a, [1.0, 0.0, 0.0], 1e-3), along(a, [0.0, 1.0, 0.0], 1e-3)];
            let direction = [random.coordinate(), random.coordinate(), 1.0];
            let origin = along(along(a, [0.3, 0.3, 0.0], 1e-3), [0.0, 0.0, 1.0], 1e-7);
            let filter = RayFilter::new(direction, origin, 0.0, Reach::of(&bounds, origin));
            drops += u32::from(dispatch(SimdLevel::detect(), Before(&filter, &triangle, 0.0)));
            // The same from the other side, and with a start behind the triangle.
            let [x, y, z] = along(along(a, [0.3, 0.3, 0.0], 1e-3), [0.0, 0.0, 1.0], -1e-3);
            let filter =
                RayFilter::new([0.0, 0.0, 1.0], [x, y, z], 0.0, Reach::of(&bounds, [x, y, z]));
            assert!(!dispatch(SimdLevel::detect(), Before(&filter, &triangle, 0.9e-3)));
            assert!(dispatch(SimdLevel::detect(), Before(&filter, &triangle, 1.1e-3)));
        }
        assert!(drops > 900, "{drops}");
    }
}
