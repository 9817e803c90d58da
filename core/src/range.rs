//! The filter's tests of a ray's range, in f32: triangles that the line of the ray meets before the ray starts, such as
//! the one that it leaves, and those that the ray hits for sure.
//!
//! The [`filter`](crate::filter) keeps the triangle that a ray leaves, because the line of the ray meets it. The f64
//! test would compute nearly a whole hit before it rejects that triangle. The first test rejects it, if it is sure. The
//! second is for rays that only need to know whether anything blocks them: a triangle that surely does is not tested in
//! f64.
//!
//! ```text
//! g, e, f, q, det, U, V and W as in the filter    T = f . q    the line meets the triangle's plane at T / det
//! N(s) = T - s det                                s: a distance, as a multiple of the scaled direction
//! error, bound(s)                                 for det and N(s); U, V and W have the filter's error
//!
//! met before the start    N(start) is below -bound and det above 1.6 error; or the same with all signs changed
//! surely hit              U, V and W are above the filter's error, N(start) is above bound and N(end) below -bound;
//!                         or the same with all signs changed
//! ```
//!
//! The claims: [`TriangleTest`](crate::triangle::TriangleTest) misses every triangle that is met before the start, and
//! hits, from one side or the other, every one that is surely hit. Both hold if the filter starts at the ray's own
//! origin, without slack, and no extent of the box around all triangles exceeds [`MOST_EXTENT`]. If a corner has a NaN,
//! T is one, and an infinite start makes the bound infinite: then no test says anything.
//!
//! # Proof
//!
//! Let G be the largest magnitude of a component of g, E that of e and f, M = G + E as in the filter, and u = 2^-24.
//! Components of d are below 2.
//!
//! ```text
//! error of   sum of its products   roundings of each product                            bound
//! T          6 G E^2               g 1, e 1, f 1, g * e 1, minus 1, q * f 1, sums 2     48 u G E^2
//! det        12 E^2                seven, as in the filter                              84 u E^2
//! N          those of T and of s det, a product 1, a difference 1                       54 u G E^2 + 108 u |s| E^2
//! ```
//!
//! The f64 test moves the corners across the ray, on each of two axes by at most m = 7 * 2^-53 times the distance of
//! the farthest corner. That distance exceeds neither the filter's M nor its X. Depths stay what they are.
//!
//! **Met before the start.** If no corner lies before the start, neither does the point where the ray meets the moved
//! triangle: N / det of that is not negative. Else the test decides exactly, on the triangle as it is. The move changes
//! T by at most 24 m E (G + E) and det by at most 32 m E; the second order in m is below 28 m^2 (G + E) and 16 m^2.
//!
//! ```text
//! error    E (56 u E + 2^-45 M) + floor       2^-45 is more than 32 * 7 * 2^-53, so the second term covers the first
//!                                             order in m; floor is at least 28 m^2 + 2^-120, as it grows with X
//! bound    error (M + 2 |s|) + 2^-120         floor and 2^-120 cover what underflows, also in s
//! |det| must exceed 1.6 error: more than 84 u E^2 and its change, so that no move turns the triangle round
//! ```
//!
//! **Surely hit.** If U, V and W are computed to be above the filter's error, they are positive: those of the triangle
//! as it is, because then no rounding of W acts on a value above det; and those of the moved triangle, because the ray
//! lies among its corners, as the filter's proof demands. So the f64 test finds the ray inside. It compares the point
//! where the line meets the plane with both ends of the range exactly; the signs of N say with what result. Last, it
//! demands that the mean of the corners' depths, weighted by the edge functions, lies in the range, or outside by at
//! most 2^-21 R and 2^-49 of the largest depth, where R is the difference between the depths. The exact mean of the
//! triangle as it is lies inside, and the computed one is close to it:
//!
//! ```text
//! corners   U + V + W is computed to be above 3 * 29 u E M, so 69 u E M < det < 13 E^2: M < 2^22 E, and m < 2^-28 E
//! mean      an edge function moves by less than 17 m E, and rounds by 2^-41 of itself; all three are weights, and on
//!           the sheared plane their sum is at least det / 2: the mean moves by less than 6 * 17 m E R / det + 2^-40 R,
//!           which is less than 2^-25 R; its own roundings are below 2^-48 M
//! margin    bound exceeds the error of N by 2 u E^2 M: the exact mean is 2^-27 M or more away from the ends
//! ```
//!
//! An infinite end would make the bound infinite. A hit is no farther away than M, because a component of d is at least
//! 1: so an end beyond 4 M counts as 4 M.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, mask32x8, u32x8};

use crate::aabb::Aabb;
use crate::extremes::Extremes;
use crate::filter::{LineFilter, Size, cross, dot, minus};

/// The largest extent of a box around all triangles with which neither T nor s det overflows: G is less than 2^41 then,
/// because no origin lies farther than [`FAR_EXTENTS`](crate::approach::FAR_EXTENTS) away, and E is at most 2^38.
pub(crate) const MOST_EXTENT: f32 = 262_144.0 * 1_048_576.0; // 2^38

/// 56 * 2^-24.
const UNITS: f32 = 56.0 / 16_777_216.0;
/// 32 times what moves the corners, in parts of M, and a little more: 2^-45.
const OF_REACH: f32 = 1.0 / (32.0 * 1_048_576.0 * 1_048_576.0);
/// More than what underflows: 2^-120.
const LEAST: f32 = f32::from_bits(0x0380_0000);

/// Returns true if the search for triangles that are met before the start is worth its time: the box around the origins
/// of the rays meets the box around all triangles, and T cannot overflow. Rays from outside leave no triangle.
#[inline(always)]
pub(crate) fn pays(bounds: &Aabb, origins: &Aabb) -> bool {
    bounds.meets(origins) && bounds.size().max_element() <= MOST_EXTENT
}

/// The places where lines meet the planes of triangles.
struct Crossing<S: Simd> {
    /// T.
    depth: f32x8<S>,
    det: f32x8<S>,
    error: f32x8<S>,
    /// M.
    reach: f32x8<S>,
}

impl<S: Simd> Crossing<S> {
    #[inline(always)]
    fn new(
        simd: S,
        line: &LineFilter<f32x8<S>>,
        [a, b, c]: &[[f32x8<S>; 3]; 3],
        size: &Size<f32x8<S>>,
    ) -> Self {
        let g = minus(line.origin, *a);
        let e = minus(*b, *a);
        let f = minus(*c, *a);
        let Size { longest, reach } = *size;
        let of_longest = longest.mul_add(f32x8::splat(simd, UNITS), reach * OF_REACH);
        Self {
            depth: dot(f, cross(g, e)),
            det: dot(e, cross(line.direction, f)),
            error: longest.mul_add(of_longest, line.floor),
            reach,
        }
    }

    /// N of a distance and its bound. N has its sign changed where det is negative, as a division by det would: it is
    /// positive where the line meets the plane behind the distance.
    #[inline(always)]
    fn behind(&self, simd: S, distance: f32x8<S>) -> [f32x8<S>; 2] {
        let behind = (-distance).mul_add(self.det, self.depth);
        let sign = self.det.bitcast::<u32x8<S>>() & 0x8000_0000;
        let behind = (behind.bitcast::<u32x8<S>>() ^ sign).bitcast();
        let least = f32x8::splat(simd, LEAST);
        [behind, self.error.mul_add(self.reach + distance.abs() * 2.0, least)]
    }
}

impl<S: Simd> LineFilter<f32x8<S>> {
    /// The lanes whose line meets its triangle before `start`, a distance along the scaled direction.
    ///
    /// It shares most terms with [`drops`](Self::drops). After that, the compiler computes only the others.
    #[inline(always)]
    pub(crate) fn passes_before(
        &self,
        simd: S,
        corners: &[[f32x8<S>; 3]; 3],
        size: &Size<f32x8<S>>,
        start: f32x8<S>,
    ) -> mask32x8<S> {
        let crossing = Crossing::new(simd, self, corners, size);
        let [behind, bound] = crossing.behind(simd, start);
        behind.simd_lt(-bound) & crossing.det.abs().simd_gt(crossing.error * 1.6)
    }

    /// The lanes whose ray surely hits its triangle, from whichever side, between two distances along the scaled
    /// direction.
    ///
    /// The other tests compute most of its terms, too, so the compiler computes only the rest.
    #[inline(always)]
    pub(crate) fn surely_hits(
        &self,
        simd: S,
        corners: &[[f32x8<S>; 3]; 3],
        size: &Size<f32x8<S>>,
        [start, end]: [f32x8<S>; 2],
    ) -> mask32x8<S> {
        let ([u, v, w], error) = (self.edges(corners), self.error(size));
        let (least, greatest) = (w.lesser(u.lesser(v)), w.greater(u.greater(v)));
        let is_inside = least.simd_gt(error) | greatest.simd_lt(-error);

        let crossing = Crossing::new(simd, self, corners, size);
        let [from_start, bound_of_start] = crossing.behind(simd, start);
        let [from_end, bound_of_end] = crossing.behind(simd, end.lesser(size.reach * 4.0));
        is_inside & from_start.simd_gt(bound_of_start) & from_end.simd_lt(-bound_of_end)
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::aabb::{greater, lesser};
    use crate::approach::Reach;
    use crate::filter::{RayFilter, splat};
    use crate::mesh::Triangle;
    use crate::ray::Ray;
    use crate::samples::{Random, along, largest, line, triangle};
    use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};
    use crate::triangle::TriangleTest;

    /// A ray against a triangle in all lanes, with its range as distances. Tells if the ray meets it before the start,
    /// and if the ray surely hits it.
    #[derive(Clone, Copy)]
    struct InRange<'a>(&'a RayFilter, &'a Triangle, [f32; 2]);

    impl Kernel for InRange<'_> {
        type Output = [bool; 2];

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [bool; 2] {
            let Self(filter, triangle, range) = self;
            let [start, end] = range.map(|distance| f32x8::splat(simd, distance));
            let corners = splat(simd, triangle);
            let filter = filter.line.splat(simd);
            let size = Size::new(filter.origin, &corners);
            let before = filter.passes_before(simd, &corners, &size, start).to_bitmask();
            let hits = filter.surely_hits(simd, &corners, &size, [start, end]).to_bitmask();
            [before, hits].map(|lanes| {
                assert!(lanes == 0 || lanes == 0xff, "{lanes:x}");
                lanes != 0
            })
        }
    }

    fn is_before(filter: &RayFilter, triangle: &Triangle, start: f32) -> bool {
        let [is_before, _] =
            dispatch(SimdLevel::detect(), InRange(filter, triangle, [start, f32::INFINITY]));
        is_before
    }

    /// The power of two that a direction is divided by for the filter.
    fn scale_of(direction: [f32; 3]) -> f32 {
        f32::from_bits(largest(&[direction]).to_bits() & 0x7f80_0000)
    }

    /// An end of a range: at a `t`, just before or behind it, at the origin, or anywhere.
    fn end_near(random: &mut Random, t: f32) -> f32 {
        match random.below(14) {
            0 => t,
            1 => t.next_up(),
            2 => t.next_down(),
            3 => t + t.abs() * 1e-6,
            4 => t + t.abs() * 1e-3,
            5 => t - t.abs() * 1e-6,
            6 => t - t.abs() * 1e-3,
            7 => 0.0,
            8 => f32::MAX,
            9 => f32::MIN,
            10 => f32::from_bits(1),
            11 => -f32::from_bits(1),
            12 => f32::NEG_INFINITY,
            _ => t + t.abs(),
        }
    }

    /// Counts random rays.
    #[derive(Default)]
    struct Found {
        /// Rays that hit their triangle.
        hits: u32,
        /// Rays that `surely_hits` finds to hit their triangle.
        sure: u32,
        /// Rays whose line meets the triangle before they start.
        before: u32,
        /// Rays that `passes_before` finds to meet the triangle before they start.
        dropped: u32,
    }

    #[test]
    fn what_is_known_of_a_range_is_so_at_every_scale() {
        if !HAS_VECTORS {
            return;
        }
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let rounds = if cfg!(miri) { 30 } else { 1_400_000 };
        for scale in [1.0, 1e-30, 1e-12, 1e-9, 1e-3, 1e3, 1e11] {
            let mut found = Found::default();
            for _ in 0..rounds / 7 {
                let triangle = triangle(&mut random);
                let (origin, direction) = line(&mut random, &triangle);
                let shift = [0.0, 0.0, 100.0][random.below(3)];
                let place = |point: [f32; 3]| point.map(|x| (x + shift) * scale);
                let (triangle, origin) = (triangle.map(place), place(origin));
                let direction = direction.map(|d| d * [1.0, 1e-10, 1e10][random.below(3)]);
                if scale_of(direction) <= 0.0 {
                    continue;
                }
                let whole = Ray { t_min: f32::NEG_INFINITY, ..Ray::new(origin, direction) };
                let met = TriangleTest::new(&whole).and_then(|test| test.test(&triangle));
                let t = met.map_or(1.0, |met| met.t);
                let (t_min, t_max) = (end_near(&mut random, t), end_near(&mut random, t));
                let t_max =
                    if random.below(2) == 0 { f32::INFINITY } else { greater(t_min, t_max) };
                let ray = Ray { t_min, t_max, ..whole };
                let is_hit =
                    TriangleTest::new(&ray).is_some_and(|test| test.test(&triangle).is_some());

                // The line meets the triangle, and the end of the range does not exclude the hit.
                let is_before_start = !is_hit && met.is_some() && t_max == f32::INFINITY;

                let [a, b, c] = triangle.map(glam::Vec3A::from_array);
                let bounds = Aabb { min: a.min(b).min(c), max: a.max(b).max(c) };
                let filter = RayFilter::new(direction, origin, 0.0, Reach::of(&bounds, origin));
                let range = [t_min, lesser(t_max, f32::MAX)].map(|t| t * scale_of(direction));
                for level in SimdLevel::available() {
                    let [is_before, is_sure] = dispatch(level, InRange(&filter, &triangle, range));
                    assert!(!(is_hit && is_before), "{level:?} {ray:?} {triangle:?}");
                    assert!(is_hit || !is_sure, "{level:?} {ray:?} {triangle:?}");
                    if level == SimdLevel::detect() {
                        found.sure += u32::from(is_sure);
                        found.dropped += u32::from(is_before && is_before_start);
                    }
                }
                found.hits += u32::from(is_hit);
                found.before += u32::from(is_before_start);
            }
            if cfg!(miri) {
                continue;
            }
            let Found { hits, sure, before, dropped } = found;
            assert!(hits > 2000 && before > 2000, "{scale}: {hits} {before}");
            let is_in_range = (1e-9..=1e11).contains(&scale);
            assert!(!is_in_range || dropped > before / 4, "{scale}: {dropped} of {before}");
            // Many lines meet an edge or an end of the range.
            assert!(!is_in_range || sure > hits / 8, "{scale}: {sure} of {hits}");
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
            drops += u32::from(is_before(&filter, &triangle, 0.0));
            // The same from the other side, and with a start behind the triangle.
            let [x, y, z] = along(along(a, [0.3, 0.3, 0.0], 1e-3), [0.0, 0.0, 1.0], -1e-3);
            let filter =
                RayFilter::new([0.0, 0.0, 1.0], [x, y, z], 0.0, Reach::of(&bounds, [x, y, z]));
            assert!(!is_before(&filter, &triangle, 0.9e-3));
            assert!(is_before(&filter, &triangle, 1.1e-3));
        }
        assert!(drops > 900, "{drops}");
    }

    /// Of rays through the inside of small triangles nearly all surely hit them, and none that ends before.
    #[test]
    fn most_hits_are_sure() {
        if !HAS_VECTORS {
            return;
        }
        let mut random = Random(0x2545_f491_4f6c_dd1d);
        let bounds = Aabb { min: glam::Vec3A::splat(-1.0), max: glam::Vec3A::splat(1.0) };
        let mut all = [0; 3];
        for _ in 0..1000 {
            let a = random.point();
            let (b, c) = (along(a, random.point(), 1e-3), along(a, random.point(), 1e-3));
            let target: [f32; 3] =
                core::array::from_fn(|axis| 0.4 * a[axis] + 0.3 * b[axis] + 0.3 * c[axis]);
            let origin = random.point().map(|x| 2.0 * x);
            let direction = core::array::from_fn(|axis| target[axis] - origin[axis]);
            let filter = RayFilter::new(direction, origin, 0.0, Reach::of(&bounds, origin));
            for (count, end) in all.iter_mut().zip([f32::INFINITY, 1.01, 0.99]) {
                let range = [0.0, end * scale_of(direction)];
                let [_, is_sure] =
                    dispatch(SimdLevel::detect(), InRange(&filter, &[a, b, c], range));
                *count += u32::from(is_sure);
            }
        }
        assert!(all[0] > 900 && all[1] > 800 && all[2] == 0, "{all:?}");
    }

    #[test]
    fn nothing_is_known_of_corners_that_are_no_numbers() {
        if !HAS_VECTORS {
            return;
        }
        let whole: Triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let reach = Reach { distance: 4.0, extent: 1.0 };
        for direction in [[0.0, 0.0, 1.0], [0.1, 0.2, -1.0]] {
            let origin = core::array::from_fn(|axis| [0.25, 0.25, 0.0][axis] - direction[axis]);
            let filter = RayFilter::new(direction, origin, 0.0, reach);
            for start in [0.0, 2.0] {
                let known = |triangle: &Triangle| {
                    let kernel = InRange(&filter, triangle, [start, f32::INFINITY]);
                    SimdLevel::available().map(|level| dispatch(level, kernel)).collect::<Vec<_>>()
                };
                assert!(known(&whole).iter().all(|known| *known == [start > 1.0, start < 1.0]));
                for number in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                    for at in 0..9 {
                        let mut triangle = whole;
                        triangle[at / 3][at % 3] = number;
                        let known = known(&triangle);
                        assert!(known.iter().all(|known| *known == [false; 2]), "{number} at {at}");
                    }
                }
            }
        }
    }
}
