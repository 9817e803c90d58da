//! Bringing a ray to a box, so that what follows works at the box's scale.
//!
//! A vertex minus an origin a million extents away has lost all that tells cells and edges apart.
//! So a ray from far away gets a new origin where it enters the box, computed in f64; walk and
//! triangle test start there. Only `t` is still measured from the ray's own origin.

use glam::Vec3A;

use crate::aabb::Aabb;
use crate::ray::{Ray, round};

/// Origins farther than this many extents from the box's centre are moved.
///
/// Up to here the rounding of `vertex - origin` stays far below the margin by which triangles are
/// spread over cells (see [`cell`](crate::cell)).
pub(crate) const FAR_EXTENTS: f32 = 4.0;

/// Where a ray meets a box.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Approach {
    /// The ray's origin, or a point of the ray at the box if that is far away.
    pub(crate) anchor: [f32; 3],
    /// The `t` of the anchor.
    pub(crate) t: f64,
    /// Where the ray's line enters the box, in multiples of its direction from the anchor.
    pub(crate) near: f64,
    /// Where it leaves the box.
    pub(crate) far: f64,
    /// One over the direction.
    pub(crate) inverse: [f64; 3],
}

impl Approach {
    /// Brings a ray to a box; `None` if it is no valid ray or its line passes the box.
    #[inline]
    pub(crate) fn new(ray: &Ray, bounds: &Aabb) -> Option<Self> {
        if !ray.is_valid() {
            return None;
        }
        let [x, y, z] = ray.direction;
        let inverse = [1.0 / f64::from(x), 1.0 / f64::from(y), 1.0 / f64::from(z)];
        let (near, far) = bounds.clip(ray.origin, inverse)?;
        let center = (bounds.min + bounds.max) * 0.5;
        let distance = (Vec3A::from_array(ray.origin) - center).abs().max_element();
        if distance <= FAR_EXTENTS * bounds.size().max_element() {
            return Some(Self { anchor: ray.origin, t: 0.0, near, far, inverse });
        }
        let anchor = core::array::from_fn(|axis| {
            round(f64::from(ray.origin[axis]) + near * f64::from(ray.direction[axis]))
        });
        let t = near;
        let (near, far) = bounds.clip(anchor, inverse)?;
        Some(Self { anchor, t, near, far, inverse })
    }
}
