//! The point where a ray met the mesh, and the origins of the next rays.
//!
//! A hit's point is off its triangle by rounding, so a ray that starts there may hit the triangle that it leaves. A ray
//! that starts above the plane and leaves it does not: the triangle test decides exactly on which side of `t_min` the
//! plane is met. How far above depends on the triangle and the point alone, not on the scene's scale:
//!
//! ```text
//! corners relative to the point, L the largest coordinate of these:
//!   the point, in f64, is off the plane by                    6 * 2^-53 L
//!   a triangle seen edge on may be hit from as far off as     2^-50 L      (triangle.rs)
//!   the origin of the next ray is lifted by                   2^-20 L
//! ```
//!
//! The lift is larger than necessary, for renderers that round the origin again. The origin is rounded away from the
//! plane on each axis, so rounding takes nothing from the lift.

use glam::DVec3;

use crate::mesh::TriangleMesh;
use crate::ray::{Hit, Ray, round};

/// A point of a mesh where a ray met it: 52 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// The point, in scene units; on the triangle but for the rounding to f32.
    pub position: [f32; 3],
    /// The triangle's normal, of length 1, on the side that the ray came from.
    pub normal: [f32; 3],
    /// Origin for rays that leave on that side: reflections, and rays to lights.
    pub above: [f32; 3],
    /// Origin for rays that go on through the triangle.
    pub below: [f32; 3],
    /// 1 if the ray met the front, from which the vertices appear counter-clockwise, else 0.
    pub is_front: u32,
}

/// The amount by which an origin is lifted, in parts of the distance from the point to the farthest corner, measured
/// along one axis.
const LIFT: f64 = 1.0 / (1 << 20) as f64;

/// A few times the resolution of f32 near zero.
const LEAST: f64 = 1e-44;

impl TriangleMesh<'_> {
    /// The point where a ray met this mesh, with origins for the rays that leave it; `None` if the hit
    /// names no triangle, as [`Hit::MISS`], or the ray has no direction.
    ///
    /// A ray from `above` to that side of the triangle's plane does not hit the triangle, nor one from
    /// `below` to the other side: with `t_min` 0, at any scale, in single queries and batches. Rays
    /// nearly along the plane may, as the normal is rounded.
    ///
    /// The normal of a triangle without area, or of a needle thinner than 1e-9 of its length, is not reliable; where
    /// there is none, it faces the ray. `is_front` agrees with [`Cull`](crate::Cull), except for rays that see the
    /// triangle nearly edge on.
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
    /// let hit = grid.intersect(&ray).expect("in front of the camera");
    /// let surface = grid.mesh().surface(&ray, &hit).expect("a hit");
    /// assert_eq!((surface.normal, surface.is_front), ([0.0, 0.0, 1.0], 1));
    ///
    /// let to_light = Ray::new(surface.above, [0.5, 0.0, 0.1]);
    /// assert!(!grid.occluded(&to_light));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Option<Surface> {
        let Facet { point, normal, lift, is_front } = Facet::new(self, wide(ray.direction), hit)?;
        let start = |lift: DVec3| {
            let ([x, y, z], [u, v, w]) = (point.to_array(), lift.to_array());
            [lifted(x, u), lifted(y, v), lifted(z, w)]
        };
        Some(Surface {
            position: point.to_array().map(round),
            normal: normal.to_array().map(round),
            above: start(normal * lift),
            below: start(normal * -lift),
            is_front: is_front.into(),
        })
    }
}

/// The triangle of a hit.
pub(crate) struct Facet {
    /// The point where the ray met it.
    pub(crate) point: DVec3,
    /// Of length 1, on the side that the ray came from.
    pub(crate) normal: DVec3,
    /// The distance of origins from the plane.
    pub(crate) lift: f64,
    pub(crate) is_front: bool,
}

impl Facet {
    /// `along` is the direction of the ray.
    pub(crate) fn new(mesh: &TriangleMesh<'_>, along: DVec3, hit: &Hit) -> Option<Self> {
        let [a, b, c] = mesh.triangle(hit.primitive)?.map(wide);
        let (ab, ac) = (b - a, c - a);
        // In f64 no area of an f32 triangle underflows.
        let cross = ab.cross(ac);
        let facing = -along.try_normalize()?;
        let front = cross.try_normalize().unwrap_or(facing);
        let is_front = front.dot(along) <= 0.0;
        let normal = if is_front { front } else { -front };

        let point = a + ab * f64::from(hit.u) + ac * f64::from(hit.v);
        let farthest = [a, b, c].map(|corner| (corner - point).abs().max_element());
        let farthest = farthest.into_iter().fold(0.0, f64::max);
        Some(Self { point, normal, lift: farthest * LIFT + LEAST, is_front })
    }
}

fn wide(xyz: [f32; 3]) -> DVec3 {
    DVec3::from_array(xyz.map(f64::from))
}

/// The f32 that is next to a coordinate with its lift, and not short of it.
fn lifted(coordinate: f64, lift: f64) -> f32 {
    let nearest = round(coordinate + lift);
    // Subtract first: a sum far from the origin loses the lift.
    let missing = (coordinate - f64::from(nearest)) + lift;
    if lift > 0.0 && missing > 0.0 {
        nearest.next_up()
    } else if lift < 0.0 && missing < 0.0 {
        nearest.next_down()
    } else {
        nearest
    }
}

const _: () = assert!(size_of::<Surface>() == 52);
