//! Moves the start of a ray from far away to the scene's box, so that traversal and filter compute at the
//! scale of the box.
//!
//! The distance between a cell's border and an origin a million extents away is rounded too coarsely to tell cells
//! apart. So a ray from far away gets a new origin where it enters the box, the anchor, computed in f64; the
//! traversal and the f32 filter start there. `t` is still measured from the ray's own origin, and the triangle test
//! works from there, too.
//!
//! ```text
//! distance of the origin   starts at      the walk and the filter are off the ray of the triangle test by
//! up to 4 extents          the origin     nothing
//! up to 2^29               the anchor     slack: 2^-23 of the anchor's coordinates + 2^-49 of the distance
//! beyond                   no traversal   more than the margin of the cells, so the caller tests all triangles
//! ```
//!
//! Slack: half an ulp of the anchor on each of two axes that the shear adds, 2^-23; the roundings in
//! `near * direction`, 2^-51 of the distance; those of the triangle test, 6 * 2^-53.

use glam::Vec3A;

use crate::aabb::{Aabb, greater};
use crate::ray::{Ray, RayF64, round};

/// Origins farther than this many extents from the box's centre are moved.
///
/// Up to here the rounding of `vertex - origin` stays far below the margin by which triangles are
/// spread over cells (see [`cell`](crate::cell)).
pub(crate) const FAR_EXTENTS: f32 = 4.0;

/// Origins farther than this are remote: 2^-49 of such a distance is 2^-20 of an extent.
const REMOTE_EXTENTS: f64 = (1 << 29) as f64;

/// The most that a ray from afar may be off, in parts of its distance: 2^-49.
const OFF: f64 = 8.0 * f64::EPSILON;

/// A ray without a range, in f64.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LineF64 {
    pub(crate) origin: [f64; 3],
    pub(crate) direction: [f64; 3],
}

impl From<&RayF64> for LineF64 {
    fn from(ray: &RayF64) -> Self {
        Self { origin: ray.origin, direction: ray.direction.map(f64::from) }
    }
}

/// The distance of triangles from a point, and their extent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reach {
    /// The most that a coordinate of a corner differs from the point's.
    pub(crate) distance: f64,
    /// The most that a coordinate differs between corners of a triangle.
    pub(crate) extent: f64,
}

impl Reach {
    /// Returns the reach of triangles in a box.
    #[inline(always)]
    pub(crate) fn of(bounds: &Aabb, point: [f32; 3]) -> Self {
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let (mut distance, mut extent) = (0.0, 0.0);
        for axis in 0..3 {
            let at = f64::from(point[axis]);
            let (low, high) = (f64::from(min[axis]), f64::from(max[axis]));
            distance = greater(distance, greater((low - at).abs(), (high - at).abs()));
            extent = greater(extent, high - low);
        }
        Self { distance, extent }
    }
}

/// The start of a ray at a box, and its error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Approach {
    /// The ray's origin, or a point of the ray at the box if that is far away.
    pub(crate) anchor: [f32; 3],
    /// The `t` of the anchor.
    pub(crate) t: f64,
    /// Distance from the anchor at which the ray's line enters the box, in multiples of its direction.
    pub(crate) near: f64,
    /// Distance at which it leaves the box.
    pub(crate) far: f64,
    /// One over the direction.
    pub(crate) inverse: [f64; 3],
    /// The most that the line through the anchor may be off the ray that the triangle test sees, on each
    /// axis of a plane across the ray's longest axis, in scene units.
    pub(crate) slack: f32,
    /// Reach of the box from the anchor.
    pub(crate) reach: Reach,
    /// True if the ray starts so far away that a traversal would not be exact enough: all triangles have to be tested.
    pub(crate) is_remote: bool,
}

impl Approach {
    /// Finds where a ray starts at a box; `None` if the ray is not valid or its line misses the box.
    #[inline]
    pub(crate) fn new(ray: &Ray, bounds: &Aabb) -> Option<Self> {
        if !ray.is_valid() {
            return None;
        }
        let [x, y, z] = ray.direction;
        let inverse = [1.0 / f64::from(x), 1.0 / f64::from(y), 1.0 / f64::from(z)];
        let center = (bounds.min + bounds.max) * 0.5;
        let distance = (Vec3A::from_array(ray.origin) - center).abs().max_element();
        if distance <= FAR_EXTENTS * bounds.size().max_element() {
            let (near, far) = bounds.clip(ray.origin.map(f64::from), inverse)?;
            let reach = Reach::of(bounds, ray.origin);
            let (anchor, t, slack) = (ray.origin, 0.0, 0.0);
            return Some(Self { anchor, t, near, far, inverse, slack, reach, is_remote: false });
        }
        let line =
            LineF64 { origin: ray.origin.map(f64::from), direction: ray.direction.map(f64::from) };
        Self::from_afar(ray, &line, bounds, inverse)
    }

    /// Finds where a line starts at a box that holds boxes, not triangles; `ray` is the line rounded to f32. `near`
    /// and `far` may be 0, because nothing reads them.
    #[inline(never)]
    pub(crate) fn of_line(ray: &Ray, line: &LineF64, bounds: &Aabb) -> Option<Self> {
        if !ray.is_valid() {
            return None;
        }
        let LineF64 { origin, direction } = *line;
        let inverse = direction.map(|d| 1.0 / d);
        let center = ((bounds.min + bounds.max) * 0.5).to_array();
        let away = |axis: usize| (origin[axis] - f64::from(center[axis])).abs();
        let distance = greater(away(0), greater(away(1), away(2)));
        let extent = bounds.size().max_element();
        // The ray passes no more than five extents on each axis. Its direction was rounded by half an ulp on two: on
        // this axis and on the one of the shear.
        let bent = 5.0 * extent * f32::EPSILON;
        if distance > f64::from(FAR_EXTENTS * extent) {
            let approach = Self::from_afar(ray, line, bounds, inverse)?;
            return Some(Self { slack: (approach.slack + bent).next_up(), ..approach });
        }
        let [x, y, z] = ray.origin.map(f32::abs);
        // The origin was rounded by half an ulp of a coordinate.
        let slack = (greater(x, greater(y, z)) * f32::EPSILON + bent).next_up();
        let reach = Reach::of(bounds, ray.origin);
        let (anchor, t, near, far) = (ray.origin, 0.0, 0.0, 0.0);
        Some(Self { anchor, t, near, far, inverse, slack, reach, is_remote: false })
    }

    /// The approach of a ray whose origin is far away.
    #[cold]
    #[inline(never)]
    fn from_afar(ray: &Ray, line: &LineF64, bounds: &Aabb, inverse: [f64; 3]) -> Option<Self> {
        let LineF64 { origin, direction } = *line;
        // In f64: the distance may be larger than any f32.
        let from_origin = Reach::of(bounds, ray.origin);
        let off = from_origin.distance * OFF;
        if from_origin.distance > REMOTE_EXTENTS * from_origin.extent {
            // Grow the box by the error of the ray and by the f32 rounding of the grown corners.
            let coordinate = bounds.min.abs().max(bounds.max.abs());
            let growth = Vec3A::splat(round(2.0 * off)) + coordinate * (4.0 * f32::EPSILON);
            let bounds = Aabb { min: bounds.min - growth, max: bounds.max + growth };
            let (near, far) = bounds.clip(origin, inverse)?;
            let (anchor, t, slack, reach) = (ray.origin, 0.0, round(2.0 * off), from_origin);
            return Some(Self { anchor, t, near, far, inverse, slack, reach, is_remote: true });
        }
        let (t, _) = bounds.clip(origin, inverse)?;
        let at = |axis: usize| round(origin[axis] + t * direction[axis]);
        let anchor = [at(0), at(1), at(2)];
        let (near, far) = bounds.clip(anchor.map(f64::from), inverse)?;
        let [x, y, z] = anchor.map(|coordinate| f64::from(coordinate.abs()));
        let slack = greater(x, greater(y, z)) * f64::from(f32::EPSILON) + off;
        let slack = round(slack).next_up();
        let reach = Reach::of(bounds, anchor);
        Some(Self { anchor, t, near, far, inverse, slack, reach, is_remote: false })
    }
}
