//! The watertight ray-triangle test of Woop, Benthin and Wald (2013), in f64 and from the ray's own
//! origin: a hit is a function of the ray and the triangle, of nothing else.
//!
//! ```text
//! shear = (d.x / d.z, d.y / d.z)              z is the axis along which the direction d is longest,
//!                                             of equally long ones the last
//! each corner p:   z = p.z - o.z    x = (p.x - o.x) - shear.x * z    y = (p.y - o.y) - shear.y * z
//! U = c.x*b.y - c.y*b.x    V = a.x*c.y - a.y*c.x    W = b.x*a.y - b.y*a.x
//! hit if U, V, W have no two opposite signs, are not all 0, and t is in the range
//! t = (U a.z + V b.z + W c.z) / (U + V + W) / d.z    u = V / (U + V + W)    v = W / (U + V + W)
//! ```
//!
//! # Edges and vertices
//!
//! Each corner has one projection (x, y), which depends on the ray and the corner alone. On projections
//! the signs of U, V and W are exact. A rounded difference of two rounded products has the exact
//! sign or is 0, as rounding is monotonic; an edge function that is small beside its products is
//! computed again without rounding ([`difference`]). Triangles that share an edge or a vertex
//! share its projections, and what lies on an edge counts as inside, so no ray slips between them.
//!
//! # Errors
//!
//! L is the largest coordinate of a corner relative to the origin, Z the range of the corners' t.
//!
//! ```text
//! value      roundings                                              bound
//! x, y       p - o 1 on two axes, shear 1, product 1,               6 * 2^-53 L < 2^-50 L
//!            difference 2 (it may be 2 L)
//! U, V, W    two products 1 each, each below 2^11 times             2^-41 of the value; the sign is exact
//!            the value
//! u, v       V or W, the sum U + V + W, a division,                 2^-24 + 2^-38 of the value
//!            a product, and 1 to f32
//! t          U, V and W as weights of the corners' t, and 1 to f32  2^-24 |t| + 2^-38 (|t| + Z)
//! ```
//!
//! So a hit is that of a triangle whose corners lie up to 2^-50 L across the ray from where they should be, rounded to
//! f32. Corner and origin are f32: where their exponents differ by no more than 28, `p - o` is exact. From more than
//! 2^50 times as far away as the triangle is large, all corners may be projected to one point: a miss.
//!
//! # The range
//!
//! Next to an end of the range the rounded t must not decide: a ray must not hit the surface that it leaves. A
//! triangle with all corners between the ends is in, one with all corners outside is out. For any other triangle the
//! point T where the line meets its plane decides, exactly: in f64 with an error bound, and where that is not enough
//! without rounding ([`exact`]), for all finite numbers. For a triangle that the ray grazes, the mean of the corners'
//! t, weighted by U, V and W, may differ from T. It must be at most 2^-21 Z + 2^-49 M outside, where M is the largest
//! |t| of a corner; the second term is for roundings. The t that is reported lies in the range.

use core::cmp::Ordering;

use crate::aabb::{greater, lesser};
use crate::approach::Approach;
use crate::exact;
use crate::filter::RayFilter;
use crate::mesh::{Triangle, TriangleMesh};
use crate::options::Cull;
use crate::ray::{Hit, Ray, round};
use crate::simd::IS_SMALL;

/// The hit of a ray on a triangle, whether or not a closer one is hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleHit {
    /// Distance in multiples of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second vertex.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
}

impl TriangleHit {
    /// This hit as one of a mesh.
    #[inline(always)]
    #[must_use]
    pub const fn on(self, primitive: u32) -> Hit {
        Hit { t: self.t, u: self.u, v: self.v, primitive }
    }
}

/// A ray prepared for tests against many triangles.
#[derive(Debug, Clone, Copy)]
pub struct TriangleTest {
    /// Drops most triangles that are missed.
    pub(crate) filter: RayFilter,
    /// The axis along which the direction is longest; it becomes z.
    axis: Axis,
    /// The ray's own, with that axis as z.
    origin: [f32; 3],
    direction: [f32; 3],
    /// Direction x / z and y / z: at most 1.
    shear: [f64; 2],
    /// The finite part of the range of t; empty if there is none.
    t_min: f32,
    t_max: f32,
    cull: Cull,
}

/// The axis that becomes z; x and y follow cyclically.
#[derive(Debug, Clone, Copy)]
enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    #[inline(always)]
    const fn to_z<T: Copy>(self, [x, y, z]: [T; 3]) -> [T; 3] {
        match self {
            Self::X => [y, z, x],
            Self::Y => [z, x, y],
            Self::Z => [x, y, z],
        }
    }
}

/// An edge function that is smaller than this part of its products is computed without rounding.
pub(crate) const SMALL: f64 = 1.0 / (1 << 10) as f64;

/// The most that the depth of a hit may lie outside of the range, in parts of the difference between the corners'
/// depths, beside [`ROUNDINGS`].
pub(crate) const OUTSIDE: f64 = 1.0 / (1 << 21) as f64;
/// A bound of the roundings in a hit's depth and in its comparison with an end of the range, in parts of the largest
/// depth of a corner: one in a corner's depth, seven in their mean, one in the comparison. Without it, a wall that
/// faces the ray would be lost, because the difference between its depths is 0.
pub(crate) const ROUNDINGS: f64 = 8.0 * f64::EPSILON;

/// Twice the error of a hit's `t` that its corners cause, in parts of the range of their t: 2^-37. In scaled distances
/// that range is at most the extent of the scene. A traversal that ends or begins at such a `t` has to reach that much
/// farther to find all hits that are reported there. Only the reported `t` is bounded so, not the exact place that
/// decides the range.
pub(crate) const OF_CORNERS: f32 = 1.0 / (131_072.0 * 1_048_576.0);

/// Error bound of a determinant in f64, in parts of the sum of its terms' magnitudes: nine
/// roundings, and those of the sum. 2^-49.
const BOUND: f64 = 8.0 * f64::EPSILON;

impl TriangleTest {
    /// Prepares a ray for tests against triangles; `None` if it is invalid and hits nothing.
    ///
    /// ```
    /// use hgrid_core::{Ray, TriangleTest};
    /// let test = TriangleTest::new(&Ray::new([0.25, 0.25, 2.0], [0.0, 0.0, -1.0])).unwrap();
    /// let hit = test.test(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
    /// assert_eq!((hit.t, hit.u, hit.v), (2.0, 0.25, 0.25));
    /// ```
    #[must_use]
    pub fn new(ray: &Ray) -> Option<Self> {
        ray.is_valid().then(|| Self::with(ray, RayFilter::NONE))
    }

    /// Prepares a ray for tests against triangles in the box of its approach.
    ///
    /// Out of line, so that all kinds of queries share it: it takes two kilobytes where f64 is software.
    #[inline(never)]
    pub(crate) fn from(ray: &Ray, approach: &Approach) -> Self {
        let Approach { anchor, slack, reach, .. } = *approach;
        Self::with(ray, RayFilter::new(ray.direction, anchor, slack, reach))
    }

    /// Prepares a valid ray, with a filter for the triangles that it will be tested against.
    #[inline(always)]
    pub(crate) fn with(ray: &Ray, filter: RayFilter) -> Self {
        let [dx, dy, dz] = ray.direction.map(f32::abs);
        let axis = if dx > dy {
            if dx > dz { Axis::X } else { Axis::Z }
        } else if dy > dz {
            Axis::Y
        } else {
            Axis::Z
        };
        let direction = axis.to_z(ray.direction);
        let [x, y, z] = direction;
        Self {
            filter,
            axis,
            origin: axis.to_z(ray.origin),
            direction,
            shear: [f64::from(x) / f64::from(z), f64::from(y) / f64::from(z)],
            t_min: greater(ray.t_min, -f32::MAX),
            t_max: lesser(ray.t_max, f32::MAX),
            cull: Cull::None,
        }
    }

    /// The same test, in which some sides of triangles are not hit.
    ///
    /// ```
    /// use hgrid_core::{Cull, Ray, TriangleTest};
    /// let test = TriangleTest::new(&Ray::new([0.25, 0.25, 2.0], [0.0, 0.0, -1.0])).unwrap();
    /// let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// assert!(test.culling(Cull::Back).test(&triangle).is_some());
    /// assert!(test.culling(Cull::Front).test(&triangle).is_none());
    /// ```
    #[inline(always)]
    #[must_use]
    pub const fn culling(self, cull: Cull) -> Self {
        Self { cull, ..self }
    }

    /// The hit with this triangle, if its `t` lies in the ray's closed range.
    ///
    /// A function of the ray and the triangle, of nothing else. A triangle of no area, or seen exactly
    /// edge on, is not hit, up to the rounding of its corners' projections.
    #[inline(always)]
    #[must_use]
    pub fn test(&self, triangle: &Triangle) -> Option<TriangleHit> {
        if self.passes(triangle) { self.resolve(triangle) } else { None }
    }

    /// Returns true unless the filter drops the triangle.
    #[inline(always)]
    pub(crate) fn passes(&self, triangle: &Triangle) -> bool {
        self.filter.passes(triangle)
    }

    /// The hit with a triangle that passed, or [`Hit::MISS`].
    ///
    /// Out of line: it is rare, and inlined it would take registers from the filter. The triangle is read again and
    /// the hit is returned in registers, because a load that spans several stores waits for all of them.
    #[inline(never)]
    pub(crate) fn decide(&self, mesh: &TriangleMesh<'_>, id: u32) -> Hit {
        let hit = mesh.triangle(id).and_then(
            #[inline(always)]
            |triangle| self.resolve(&triangle),
        );
        hit.map_or(Hit::MISS, |hit| hit.on(id))
    }

    /// The hit of a ray with a triangle that passed a filter, or [`Hit::MISS`].
    ///
    /// Prepares the ray and tests in one function: a prepared test would go through memory, and the end of the ray
    /// would wait for it.
    #[inline(never)]
    pub(crate) fn decide_for(ray: &Ray, cull: Cull, mesh: &TriangleMesh<'_>, id: u32) -> Hit {
        let test = Self::with(ray, RayFilter::NONE).culling(cull);
        if IS_SMALL {
            return test.decide(mesh, id);
        }
        let hit = mesh.triangle(id).and_then(
            #[inline(always)]
            |triangle| test.resolve(&triangle),
        );
        hit.map_or(Hit::MISS, |hit| hit.on(id))
    }

    /// Decides in f64.
    #[inline(always)]
    fn resolve(&self, &[a, b, c]: &Triangle) -> Option<TriangleHit> {
        let triangle = [self.axis.to_z(a), self.axis.to_z(b), self.axis.to_z(c)];
        // Written out three times: the compiler does not inline `map` over arrays.
        let [a, b, c] = [self.shear(triangle[0]), self.shear(triangle[1]), self.shear(triangle[2])];

        // Compute the edge functions; drop what has two of opposite signs.
        let products =
            [[c[0] * b[1], c[1] * b[0]], [a[0] * c[1], a[1] * c[0]], [b[0] * a[1], b[1] * a[0]]];
        let mut edges = [
            products[0][0] - products[0][1],
            products[1][0] - products[1][1],
            products[2][0] - products[2][1],
        ];
        if is_outside(edges) {
            return None;
        }
        let is_small = |edge: usize| edges[edge].abs() <= SMALL * products[edge][0].abs();
        if is_small(0) || is_small(1) || is_small(2) {
            edges = exact_edges([a, b, c]);
            if is_outside(edges) {
                return None;
            }
        }
        let [u, v, w] = edges;
        let area = u + v + w;
        if !(area.is_finite() && area.abs() > 0.0) {
            return None;
        }

        // Positive if the vertices run clockwise around the z axis, seen from its positive end.
        let [_, _, z] = self.direction;
        let is_front = (area > 0.0) == (z > 0.0);
        match self.cull {
            Cull::Back if !is_front => return None,
            Cull::Front if is_front => return None,
            _ => {}
        }

        // Interpolate the depth. Adding zero turns -0 into 0.
        let share = 1.0 / area;
        let weights = [u * share + 0.0, v * share + 0.0, w * share + 0.0];
        let depth = weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2];

        // Compare the corners' depths with the range; if they lie on both sides of an end, compare the hit's.
        let depths = [a[2], b[2], c[2]];
        if !self.is_between(depths) && !self.is_in_range(&triangle, depths, depth) {
            return None;
        }
        let t = round(depth / f64::from(z));
        let t = lesser(greater(t, self.t_min), self.t_max) + 0.0;
        Some(TriangleHit { t, u: round(weights[1]), v: round(weights[2]) })
    }

    /// A corner relative to the ray, sheared so that the ray is the z axis.
    #[inline(always)]
    fn shear(&self, [x, y, z]: [f32; 3]) -> [f64; 3] {
        let x = f64::from(x) - f64::from(self.origin[0]);
        let y = f64::from(y) - f64::from(self.origin[1]);
        let z = f64::from(z) - f64::from(self.origin[2]);
        [x - self.shear[0] * z, y - self.shear[1] * z, z]
    }

    /// The depths at which the range begins and ends, growing along the ray. Exact.
    #[inline(always)]
    fn ends(&self) -> [f64; 2] {
        let length = f64::from(self.direction[2]).abs();
        [f64::from(self.t_min) * length, f64::from(self.t_max) * length]
    }

    /// The first and the last of some depths, growing along the ray.
    #[inline(always)]
    fn extremes(&self, [a, b, c]: [f64; 3]) -> [f64; 2] {
        let (low, high) = (lesser(a, lesser(b, c)), greater(a, greater(b, c)));
        if self.direction[2] > 0.0 { [low, high] } else { [-high, -low] }
    }

    /// Returns true if all corners lie in the range and none at an end of it.
    ///
    /// Rounding is monotonic and the ends are exact, so rounded depths compare as exact ones.
    #[inline(always)]
    fn is_between(&self, depths: [f64; 3]) -> bool {
        let ([from, to], [first, last]) = (self.ends(), self.extremes(depths));
        first > from && last < to
    }

    /// Returns true if a hit whose corners are not all in the range is in it.
    #[cold]
    #[inline(never)]
    fn is_in_range(&self, triangle: &Triangle, depths: [f64; 3], depth: f64) -> bool {
        let ([from, to], [first, last]) = (self.ends(), self.extremes(depths));
        let depth = if self.direction[2] > 0.0 { depth } else { -depth };
        let outside = OUTSIDE * (last - first) + ROUNDINGS * greater(first.abs(), last.abs());
        let is_close =
            last >= from && first <= to && depth >= from - outside && depth <= to + outside;
        let not_before = || match self.compare(triangle, self.t_min) {
            Some(order) => order != Ordering::Less,
            None => depth >= from,
        };
        let not_behind = || match self.compare(triangle, self.t_max) {
            Some(order) => order != Ordering::Greater,
            None => depth <= to,
        };
        is_close && (first > from || not_before()) && (last < to || not_behind())
    }

    /// Compares the `t` at which the line meets a triangle's plane with `t`; `None` if the line is parallel to the
    /// plane or the triangle has no area.
    fn compare(&self, triangle: &Triangle, t: f32) -> Option<Ordering> {
        let wide = |[x, y, z]: [f32; 3]| [f64::from(x), f64::from(y), f64::from(z)];
        let [a, b, c] = [wide(triangle[0]), wide(triangle[1]), wide(triangle[2])];
        let (origin, direction) = (wide(self.origin), wide(self.direction));
        let along = [0, 1, 2].map(|axis| f64::from(t) * direction[axis]);
        let (e, f) = (minus(b, a), minus(c, a));
        let start = minus(a, origin);

        // Multiply the normal by the direction and by the vector from the point at `t` to a corner; bound the errors
        // by the sums of the terms' magnitudes.
        let (left, right) = (cross_terms(e, f), cross_terms(f, e));
        let (normal, size) = (minus(left, right), magnitudes(left, right));
        let slope = dot(normal, direction);
        let height = dot(normal, minus(start, along));
        let slope_bound = BOUND * dot(size, magnitudes(direction, [0.0; 3]));
        let height_bound = BOUND * dot(size, magnitudes(start, along));
        // A bound of 0 means that all terms are 0.
        let is_sure = |value: f64, bound: f64| value.abs() > bound || bound <= 0.0;
        if !(is_sure(slope, slope_bound) && is_sure(height, height_bound)) {
            return exact::compare(self.origin, self.direction, triangle, t);
        }
        let order = height.partial_cmp(&0.0)?;
        match slope.partial_cmp(&0.0)? {
            Ordering::Less => Some(order.reverse()),
            Ordering::Equal => None,
            Ordering::Greater => Some(order),
        }
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn magnitudes(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0].abs() + b[0].abs(), a[1].abs() + b[1].abs(), a[2].abs() + b[2].abs()]
}

/// The terms of a cross product that are added; with the vectors exchanged, those subtracted.
fn cross_terms(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2], a[2] * b[0], a[0] * b[1]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns true if two edge functions have opposite signs. A NaN has none.
#[inline(always)]
#[expect(clippy::needless_bitwise_bool, reason = "one branch instead of six")]
fn is_outside([u, v, w]: [f64; 3]) -> bool {
    let any_negative = (u < 0.0) | (v < 0.0) | (w < 0.0);
    let any_positive = (u > 0.0) | (v > 0.0) | (w > 0.0);
    any_negative & any_positive
}

/// The edge functions of three projections, each with its exact sign and an error of a few roundings of itself.
#[cold]
#[inline(never)]
fn exact_edges([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    [
        difference([c[0], b[1]], [c[1], b[0]]),
        difference([a[0], c[1]], [a[1], c[0]]),
        difference([b[0], a[1]], [b[1], a[0]]),
    ]
}

/// The difference of two products, each of two numbers (Dekker 1971, Knuth 1997).
///
/// Exact but for a last rounding of the sum: nothing overflows, and nothing underflows, as projections
/// are 0 or larger than 2^-430.
fn difference(x: [f64; 2], y: [f64; 2]) -> f64 {
    let ([x, x_rest], [y, y_rest]) = (product(x), product(y));
    let [high, low] = sum(x, -y);
    let [middle, least] = sum(x_rest, -y_rest);
    let [high, rest] = sum(high, middle);
    high + (rest + (low + least))
}

/// The rounded sum of two numbers, and its error. Out of line: it is rare, and long where f64 is software.
#[inline(never)]
fn sum(a: f64, b: f64) -> [f64; 2] {
    let sum = a + b;
    let part = sum - a;
    [sum, (a - (sum - part)) + (b - part)]
}

/// The rounded product of two numbers, and its error. Out of line, too.
#[inline(never)]
fn product([a, b]: [f64; 2]) -> [f64; 2] {
    let product = a * b;
    let ([a, a_rest], [b, b_rest]) = (halves(a), halves(b));
    let rest = a_rest * b_rest - (((product - a * b) - a_rest * b) - a * b_rest);
    [product, rest]
}

/// A number as a sum of two with half of the digits.
fn halves(number: f64) -> [f64; 2] {
    let shifted = number * 134_217_729.0; // 2^27 + 1
    let high = shifted - (shifted - number);
    [high, number - high]
}
#[cfg(test)]
mod tests {
    use super::*;
    use crate::random;

    const UNIT: Triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    fn hit(ray: &Ray) -> Option<TriangleHit> {
        TriangleTest::new(ray)?.test(&UNIT)
    }

    #[test]
    fn weights_and_distance_are_exact() {
        for direction in [[0.0, 0.0, -1.0], [0.0, 0.0, -0.5], [0.0, 0.0, -1e-40]] {
            let ray = Ray::new([0.25, 0.5, 2.0], direction);
            let t = 2.0 / -f64::from(direction[2]);
            let hit = hit(&ray);
            if t > f64::from(f32::MAX) {
                assert_eq!(hit, None);
            } else {
                assert_eq!(hit, Some(TriangleHit { t: round(t), u: 0.25, v: 0.5 }));
            }
        }
    }

    #[test]
    fn the_range_is_closed_at_both_ends() {
        let ray = |t_min, t_max| Ray { t_min, t_max, ..Ray::new([0.25; 3], [0.0, 0.0, -2.0]) };
        let (below, above) = (0.125_f32.next_down(), 0.125_f32.next_up());
        assert!(hit(&ray(0.125, 0.125)).is_some());
        assert!(hit(&ray(0.0, below)).is_none() && hit(&ray(above, 1.0)).is_none());
        assert!(hit(&ray(-1.0, 0.125)).is_some() && hit(&ray(0.125, f32::INFINITY)).is_some());
    }

    /// Walls that face the ray, and nearly so: roundings of the depth must not decide.
    #[test]
    fn a_range_may_end_exactly_at_a_wall() {
        let mut state = 1;
        let (mut met, mut lost) = (0, [0; 2]);
        for round in 0..if cfg!(miri) { 60 } else { 6000 } {
            let mut number = |most: u8| {
                f32::from((random::next(&mut state) >> 24) as u8 % (2 * most + 1)) - f32::from(most)
            };
            // Corners at one depth or next to it, the origin near or so far that this is a rounding away.
            let (tilt, distance, slope) =
                [(0.0, 3.0, 0.25), (1e-6, 3.0, 0.0), (1e-9, 1e9, 0.0)][round % 3];
            let mut vector = |tilt: f32| [number(20), number(20), tilt * number(1)];
            let corners = [vector(tilt), vector(tilt), vector(tilt)];
            let [x, y, z] = vector(1.0);
            let (x, y, z) = (slope * x / 20.0, slope * y / 20.0, if z < 0.0 { -1.0 } else { 1.0 });
            let t = if round % 2 == 0 { distance } else { -distance };
            let [to_x, to_y, _] = vector(0.0).map(|c| c / 4.0);
            let turn = |[x, y, z]: [f32; 3]| [[x, y, z], [y, z, x], [z, x, y]][round / 3 % 3];
            let direction = turn([x, y, z]);
            let origin = turn([to_x - t * x, to_y - t * y, -t * z]);
            let triangle = corners.map(turn);
            let hits = |t_min, t_max| {
                let ray = Ray { origin, t_min, direction, t_max };
                TriangleTest::new(&ray).unwrap().test(&triangle).is_some()
            };
            if !hits(f32::NEG_INFINITY, f32::INFINITY) {
                continue;
            }
            met += 1;
            for end in [t, t.next_down(), t.next_up()] {
                let order = exact::compare(origin, direction, &triangle, end).unwrap();
                assert_eq!(hits(end, f32::INFINITY), order != Ordering::Less, "{round} {end}");
                assert_eq!(
                    hits(f32::NEG_INFINITY, end),
                    order != Ordering::Greater,
                    "{round} {end}"
                );
                lost[0] += u32::from(order == Ordering::Less);
                lost[1] += u32::from(order == Ordering::Greater);
            }
        }
        assert!(cfg!(miri) || met > 800 && lost.iter().all(|&lost| lost > 800), "{met} {lost:?}");
    }

    /// For every axis that the ray is nearly parallel to, and both ways along it.
    #[test]
    fn a_triangle_shows_its_front_where_its_corners_run_counter_clockwise() {
        for axis in 0..3 {
            for side in [-2.0, 2.0] {
                let turn = |[x, y, z]: [f32; 3]| match axis {
                    0 => [z, x, y],
                    1 => [y, z, x],
                    _ => [x, y, z],
                };
                let ray = Ray::new(turn([0.25, 0.25, side]), turn([0.0, 0.0, -side]));
                let test = TriangleTest::new(&ray).unwrap();
                let triangle = UNIT.map(turn);
                let is_hit = |cull| test.culling(cull).test(&triangle).is_some();
                assert!(is_hit(Cull::None));
                assert_eq!(is_hit(Cull::Back), side > 0.0, "axis {axis}, from {side}");
                assert_eq!(is_hit(Cull::Front), side < 0.0, "axis {axis}, from {side}");
            }
        }
    }

    #[test]
    fn edges_and_corners_belong_to_the_triangle() {
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)] {
            assert!(hit(&Ray::new([x, y, 1.0], [0.0, 0.0, -1.0])).is_some(), "{x} {y}");
            assert!(hit(&Ray::new([x, y, 1.0], [0.0, 0.0, 1.0])).is_none(), "{x} {y}");
        }
    }

    #[test]
    fn far_origins_hit_as_near_ones() {
        for distance in [1e3, 1e6, 1e9, 1e18] {
            let hit = hit(&Ray::new([0.25, 0.25, distance], [0.0, 0.0, -1.0]));
            assert_eq!(hit, Some(TriangleHit { t: distance, u: 0.25, v: 0.25 }));
        }
    }
}
