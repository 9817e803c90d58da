//! The watertight ray-triangle test of Woop, Benthin and Wald (2013), exact at every scale.
//!
//! Shear space so that the ray becomes the z axis; then the ray hits a triangle if the origin lies
//! inside its 2D shadow, which three edge functions tell by their signs. Two triangles that share
//! an edge compute the same products for it in the other order, so no ray slips between them.
//!
//! ```text
//! for each corner p:  x = p.x - shear.x * p.z,  y = p.y - shear.y * p.z      (p relative to the ray)
//! U = c.x*b.y - c.y*b.x    V = a.x*c.y - a.y*c.x    W = b.x*a.y - b.y*a.x
//! hit if U, V, W have no two opposite signs and U + V + W is not 0
//! ```
//!
//! Here the f32 edge functions are only a filter. A rounded difference of two rounded products has
//! the exact sign or is zero, because rounding is monotonic; so strictly opposite signs are proof
//! of a miss, and everything else (a zero, an underflow at scale 1e-30, an overflow at 1e30) goes
//! on to f64, where products of f32 are exact and decide. That keeps neighbours consistent with
//! no threshold and no scale, and the survivors, about one a ray, get their `t` and weights without
//! further error than the f32 shear: hits compare equal where surfaces meet, and a ray's range can
//! be closed at both ends.

use crate::aabb::Aabb;
use crate::approach::Approach;
use crate::mesh::{Triangle, TriangleMesh};
use crate::options::Cull;
use crate::ray::{Hit, Ray, round};

/// Where a ray meets a triangle, before anyone asked whether it is the closest.
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
    /// The axis along which the direction is longest; it becomes z.
    pub(crate) axis: Axis,
    /// Where the sheared space has its origin: the ray's own, or closer to the box.
    pub(crate) anchor: [f32; 3],
    /// Direction x / z and y / z: at most 1.
    pub(crate) shear: [f32; 2],
    pub(crate) origin_z: f64,
    pub(crate) direction_z: f64,
    pub(crate) t_min: f32,
    pub(crate) t_max: f32,
    pub(crate) cull: Cull,
}

/// The axis that becomes z; x and y follow cyclically.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    #[inline(always)]
    pub(crate) const fn to_z<T: Copy>(self, [x, y, z]: [T; 3]) -> [T; 3] {
        match self {
            Self::X => [y, z, x],
            Self::Y => [z, x, y],
            Self::Z => [x, y, z],
        }
    }
}

impl TriangleTest {
    /// Prepares a ray for tests against triangles inside `bounds`
    /// (least and greatest corner, finite).
    ///
    /// `None` if the ray cannot hit anything there: it is invalid or passes the box.
    #[must_use]
    pub fn new(ray: &Ray, bounds: ([f32; 3], [f32; 3])) -> Option<Self> {
        let bounds = Aabb { min: bounds.0.into(), max: bounds.1.into() };
        Approach::new(ray, &bounds).map(|approach| Self::from(ray, &approach))
    }

    /// The same for a ray that was brought to its box.
    #[inline]
    pub(crate) fn from(ray: &Ray, approach: &Approach) -> Self {
        let [dx, dy, dz] = ray.direction.map(f32::abs);
        let axis = if dx > dy {
            if dx > dz { Axis::X } else { Axis::Z }
        } else if dy > dz {
            Axis::Y
        } else {
            Axis::Z
        };
        let [x, y, z] = axis.to_z(ray.direction);
        let [_, _, origin_z] = axis.to_z(ray.origin);
        Self {
            axis,
            anchor: axis.to_z(approach.anchor),
            shear: [x / z, y / z],
            origin_z: f64::from(origin_z),
            direction_z: f64::from(z),
            t_min: ray.t_min,
            t_max: ray.t_max,
            cull: Cull::None,
        }
    }

    /// The same test, that some sides of triangles pass.
    #[inline(always)]
    #[must_use]
    pub const fn culling(self, cull: Cull) -> Self {
        Self { cull, ..self }
    }

    /// The hit with this triangle, if its `t` lies in the ray's closed range.
    ///
    /// A triangle of no area, or seen exactly edge on, is not hit, up to the rounding of the shear.
    #[inline(always)]
    #[must_use]
    pub fn test(&self, triangle: &Triangle) -> Option<TriangleHit> {
        if self.passes(triangle) { self.resolve(triangle) } else { None }
    }

    /// Whether the filter lets a triangle through.
    #[inline(always)]
    pub(crate) fn passes(&self, triangle: &Triangle) -> bool {
        !is_dropped(self.sheared(triangle))
    }

    /// The hit with a triangle that passed, or [`Hit::MISS`].
    ///
    /// Out of line: rare, and inside it would take the registers from the filter. The triangle
    /// is read anew and the hit comes back in registers: what is stored number by number and
    /// loaded in pieces is waited for.
    #[inline(never)]
    pub(crate) fn decide(&self, mesh: &TriangleMesh<'_>, id: u32) -> Hit {
        let hit = mesh.triangle(id).and_then(
            #[inline(always)]
            |triangle| self.resolve(&triangle),
        );
        hit.map_or(Hit::MISS, |hit| hit.on(id))
    }

    /// The corners as the filter sees them.
    #[inline(always)]
    fn sheared(&self, &[a, b, c]: &Triangle) -> [[f32; 2]; 3] {
        [self.shear(a), self.shear(b), self.shear(c)]
    }

    /// A corner relative to the ray, sheared so that the ray is the z axis.
    #[inline(always)]
    fn shear(&self, corner: [f32; 3]) -> [f32; 2] {
        let [x, y, z] = self.axis.to_z(corner);
        let (x, y, z) = (x - self.anchor[0], y - self.anchor[1], z - self.anchor[2]);
        [x - self.shear[0] * z, y - self.shear[1] * z]
    }

    /// Decides in f64 what the filter let through.
    #[inline(always)]
    fn resolve(&self, triangle: &Triangle) -> Option<TriangleHit> {
        // Said for each: what is mapped over arrays is called, corner by corner.
        let wide = |[x, y]: [f32; 2]| [f64::from(x), f64::from(y)];
        let [a, b, c] = self.sheared(triangle);
        let (a, b, c) = (wide(a), wide(b), wide(c));

        // Compute the edge functions again: exact products, so the signs are exact.
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let area = u + v + w;
        if !(area.is_finite() && area.abs() > 0.0) {
            return None;
        }
        // Positive if the vertices run clockwise around the z axis, seen from its positive end.
        let is_front = (area > 0.0) == (self.direction_z > 0.0);
        match self.cull {
            Cull::Back if !is_front => return None,
            Cull::Front if is_front => return None,
            _ => {}
        }
        // Adding zero makes the negative zero of a vertex a plain one.
        let share = 1.0 / area;
        let weights = [u * share + 0.0, v * share + 0.0, w * share + 0.0];

        // Interpolate the depth from the ray's own origin, wherever the sheared space has its.
        let depth = |corner| {
            let [_, _, z] = self.axis.to_z(corner);
            f64::from(z) - self.origin_z
        };
        let [p, q, r] = *triangle;
        let depth = weights[0] * depth(p) + weights[1] * depth(q) + weights[2] * depth(r);
        let t = round(depth / self.direction_z);
        let hit = TriangleHit { t, u: round(weights[1]), v: round(weights[2]) };
        (t >= self.t_min && t <= self.t_max && t.is_finite()).then_some(hit)
    }
}

/// Whether two edge functions of a sheared triangle have opposite signs. A NaN has none.
#[inline(always)]
#[expect(clippy::needless_bitwise_bool, reason = "one branch instead of six")]
fn is_dropped([a, b, c]: [[f32; 2]; 3]) -> bool {
    let u = c[0] * b[1] - c[1] * b[0];
    let v = a[0] * c[1] - a[1] * c[0];
    let w = b[0] * a[1] - b[1] * a[0];
    let any_negative = (u < 0.0) | (v < 0.0) | (w < 0.0);
    let any_positive = (u > 0.0) | (v > 0.0) | (w > 0.0);
    any_negative & any_positive
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    const BOUNDS: ([f32; 3], [f32; 3]) = ([-0.1, -0.1, -0.1], [1.1, 1.1, 0.1]);

    fn hit(ray: &Ray) -> Option<TriangleHit> {
        TriangleTest::new(ray, BOUNDS)?.test(&UNIT)
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

    /// Whatever axis the ray is nearly parallel to, and whichever way it goes.
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
                let test = TriangleTest::new(&ray, ([-1.0; 3], [1.0; 3])).unwrap();
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
