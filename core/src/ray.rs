//! Rays and hits: the two structs that cross every boundary, laid out as C sees them.

use glam::Vec3A;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// The id that no primitive has.
pub const INVALID_ID: u32 = u32::MAX;

/// A ray, or the part of it between `t_min` and `t_max`: 32 bytes in DXR order.
///
/// The direction has any length, and every `t` is a multiple of it. A hit is accepted for `t_min <= t <= t_max`,
/// closed at both ends, and decided exactly: see [`Hit`]. A ray with a NaN anywhere, an infinite origin or direction,
/// a zero direction or `t_min > t_max` hits nothing.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, Immutable, IntoBytes, KnownLayout)]
pub struct Ray {
    /// The point at which `t` is 0, in scene units.
    pub origin: [f32; 3],
    /// Smallest accepted `t`; negative reaches behind the origin.
    pub t_min: f32,
    /// Direction, any length but zero.
    pub direction: [f32; 3],
    /// Largest accepted `t`; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// A ray from `origin` along `direction` that accepts every hit at `t >= 0`.
    ///
    /// ```
    /// let ray = hgrid_core::Ray::new([0.0, 0.0, 5.0], [0.0, 0.0, -1.0]);
    /// assert_eq!((ray.t_min, ray.t_max), (0.0, f32::INFINITY));
    /// ```
    #[must_use]
    pub const fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    }

    /// Returns true if this ray can hit anything at all: finite, not null, a range that is not empty.
    #[inline]
    pub(crate) fn is_valid(&self) -> bool {
        let (origin, direction) =
            (Vec3A::from_array(self.origin), Vec3A::from_array(self.direction));
        origin.is_finite()
            && direction.is_finite()
            && direction.cmpne(Vec3A::ZERO).any()
            && self.t_min <= self.t_max
    }
}

/// A ray whose origin is given in f64: 48 bytes, for scenes in which f32 is too coarse for an origin.
///
/// At 1e7 units from the scene's origin, f32 resolves one unit, f64 a billionth. Direction, range and what makes a
/// ray miss everything are as for a [`Ray`]; a ray whose origin overflows f32 misses everything, too.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, Immutable, IntoBytes, KnownLayout)]
pub struct RayF64 {
    /// The point at which `t` is 0, in scene units.
    pub origin: [f64; 3],
    /// Direction, any length but zero.
    pub direction: [f32; 3],
    /// Smallest accepted `t`.
    pub t_min: f32,
    /// Largest accepted `t`; may be infinite.
    pub t_max: f32,
    /// Not read.
    pub reserved: u32,
}

impl From<&Ray> for RayF64 {
    fn from(&Ray { origin, t_min, direction, t_max }: &Ray) -> Self {
        Self { origin: origin.map(f64::from), direction, t_min, t_max, reserved: 0 }
    }
}

impl RayF64 {
    /// A ray from `origin` along `direction` that accepts every hit at `t >= 0`.
    #[must_use]
    pub const fn new(origin: [f64; 3], direction: [f32; 3]) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f32::INFINITY, reserved: 0 }
    }

    /// Returns true if the origin is the same in f32.
    pub(crate) fn is_exact(&self) -> bool {
        self.origin.map(|c| f64::from(round(c)).to_bits()) == self.origin.map(f64::to_bits)
    }

    /// The same ray from the nearest origin in f32.
    pub(crate) fn rounded(&self) -> Ray {
        let Self { origin, direction, t_min, t_max, .. } = *self;
        Ray { origin: origin.map(round), t_min, direction, t_max }
    }
}

/// The hit of a ray on a triangle: 16 bytes.
///
/// The point is `origin + t * direction`, and also `(1 - u - v) * a + u * b + v * c` for the
/// triangle's vertices `a`, `b`, `c`, up to rounding. A hit is a function of the ray and the triangle
/// alone: other triangles, the method and the box of the grid do not change a bit of it.
///
/// There is no epsilon. Let L be the largest difference of a coordinate between the origin and a vertex, Z the range
/// of `t` between the vertices. The hit is that of a triangle whose vertices lie up to 2^-50 L across the ray from
/// where they are. Of this hit `u` and `v` are off by no more than (2^-24 + 2^-38) of their value, `t` by no more
/// than 2^-24 |t| + 2^-38 (|t| + Z); below 1.2e-38 by 2^-149. Triangles that share a vertex move it alike, so no ray
/// slips between them.
///
/// The range is decided exactly, for all finite numbers, by the point where the ray's line meets the plane of the
/// vertices as they are: a ray that starts above a plane and leaves it does not hit it, however close it starts. An
/// end of the range needs this decision only if it lies between the least and the largest `t` of the vertices, or at
/// one of them. Where a ray grazes a triangle, the `t` that follows from `u` and `v` may differ from that of the plane.
/// If the former lies outside of the range by no more than 2^-21 Z + 2^-49 T, where T is the largest |t| of a vertex,
/// the end of the range is reported. If it lies farther outside, there is no hit. The reported `t` is rounded, so a
/// range that ends at it may leave out the same hit. A ray from more than 2^50 times as far away as a triangle is large
/// may miss it. The proof is the head of `triangle.rs`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, Immutable, IntoBytes, KnownLayout)]
pub struct Hit {
    /// Distance in multiples of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second vertex, 0 to 1.
    pub u: f32,
    /// Weight of the triangle's third vertex, 0 to 1.
    pub v: f32,
    /// Id of the triangle: its position in the index buffer.
    pub primitive: u32,
}

impl Hit {
    /// The hit that a batch writes for a ray that hits nothing.
    pub const MISS: Self = Self { t: f32::INFINITY, u: 0.0, v: 0.0, primitive: INVALID_ID };

    /// A hit somewhere on a known triangle: its `t` is the start of the ray.
    #[inline(always)]
    pub(crate) const fn somewhere(ray: &Ray, primitive: u32) -> Self {
        Self { t: ray.t_min, u: 0.0, v: 0.0, primitive }
    }

    /// Returns true if this hit is reported rather than the other: smaller `t`, then smaller id.
    #[inline(always)]
    #[must_use]
    pub const fn is_closer(&self, other: &Self) -> bool {
        self.t < other.t || (self.t <= other.t && self.primitive < other.primitive)
    }
}

/// The nearest f32.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "rounding is what this is for")]
pub(crate) const fn round(x: f64) -> f32 {
    x as f32
}

const _: () =
    assert!(size_of::<Ray>() == 32 && size_of::<Hit>() == 16 && size_of::<RayF64>() == 48);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_miss_is_closer_than_nothing() {
        for t in [0.0, 1.0, f32::MAX, f32::INFINITY, f32::NAN] {
            for primitive in [0, INVALID_ID] {
                assert!(
                    !Hit::MISS.is_closer(&Hit { t, primitive, ..Hit::MISS }),
                    "{t} {primitive}"
                );
            }
        }
    }
}
