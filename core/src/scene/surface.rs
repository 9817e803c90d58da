//! The point where a ray met a triangle of an instance, and the origins of the next rays.
//!
//! As in a single mesh ([`surface`](crate::surface)), an origin lies above the triangle's plane, in the space of its
//! object. But the query of the next ray moves the origin from the scene into this space and rounds it to f32, which
//! may put it below the plane. So `surface` does the same to each origin beforehand, and doubles its lift until it
//! stays above:
//!
//! ```text
//! lift = that of an origin in the mesh
//! loop: origin = point + lift * normal, moved to the scene
//!       seen   = origin, moved to the object as a query does
//!       done if seen is less than half the lift from where it should be; else lift = 2 * lift
//! ```

use glam::DVec3;

use super::instance::StoredInstance;
use super::{InstancePath, Object, Scene, SceneHit};
use crate::approach::LineF64;
use crate::ray::{Hit, RayF64, round};
use crate::surface::Facet;

/// A point of a scene where a ray met a triangle: 88 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneSurface {
    /// The point, in the scene.
    pub position: [f64; 3],
    /// Origin for rays that leave on the side that the ray came from: reflections, and rays to lights.
    pub above: [f64; 3],
    /// Origin for rays that go on through the triangle.
    pub below: [f64; 3],
    /// The triangle's normal in the scene, of length 1, on the side that the ray came from.
    pub normal: [f32; 3],
    /// 1 if the ray met the triangle's front, else 0; an instance that mirrors does not turn it.
    pub is_front: u32,
}

impl Scene<'_> {
    /// The point where a ray met a triangle of this scene, with origins for the rays that leave it.
    ///
    /// `None` if the hit names no triangle, if the ray has no direction, or if coordinates are too coarse to tell the
    /// sides of the triangle apart: f64 at this distance from the scene's origin, or f32 in the object.
    ///
    /// A ray from `above` to that side of the triangle's plane does not hit the triangle, nor one from `below` to the
    /// other side: with `t_min` 0, at any place in the scene, in single queries and batches. Rays nearly along the
    /// plane, as the object sees them, may hit it, because normal and direction are rounded. An origin is lifted as in
    /// a mesh, or by up to four times the rounding error of its transformation, if that is more. Do not round an origin
    /// to f32: it may lie below the plane then. What [`TriangleMesh::surface`](crate::TriangleMesh::surface) says
    /// about triangles without area holds here, too.
    ///
    /// ```
    #[doc = include_str!("../../doc/scene.txt")]
    /// let ray = RayF64::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
    /// let hit = scene.intersect(&ray).expect("in front of the camera");
    /// let surface = scene.surface(&ray, &hit).expect("a triangle");
    /// assert_eq!((surface.normal, surface.is_front), ([0.0, 0.0, 1.0], 1));
    ///
    /// let to_light = RayF64::new(surface.above, [0.5, 0.0, 0.1]);
    /// assert!(!scene.occluded(&to_light));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn surface(&self, ray: &RayF64, hit: &SceneHit) -> Option<SceneSurface> {
        let path = self.path(hit)?;
        let Object::Grid(grid) = path.object else { return None };
        let along = DVec3::from_array(path.line(&LineF64::from(ray)).direction);
        let SceneHit { t, u, v, primitive, .. } = *hit;
        let facet = Facet::new(grid.mesh(), along, &Hit { t, u, v, primitive })?;
        let (min, max) = grid.bounds();
        let extent = (0..3).map(|axis| f64::from(max[axis] - min[axis])).fold(0.0, f64::max);
        Some(SceneSurface {
            position: path.to_scene(facet.point)?.to_array(),
            above: path.start(&facet, 1.0, extent)?.to_array(),
            below: path.start(&facet, -1.0, extent)?.to_array(),
            normal: path.normal(facet.normal)?.to_array().map(round),
            is_front: facet.is_front.into(),
        })
    }
}

impl InstancePath<'_> {
    /// A line of the scene as the object sees it.
    fn line(&self, line: &LineF64) -> LineF64 {
        self.instances().fold(*line, |line, instance| instance.line(&line))
    }

    /// A point of the object in the scene.
    fn to_scene(&self, point: DVec3) -> Option<DVec3> {
        self.instances().rev().try_fold(point, |point, instance| instance.point(point))
    }

    /// A normal of the object in the scene, of length 1.
    pub(super) fn normal(&self, normal: DVec3) -> Option<DVec3> {
        // Normalize at each instance: scales would multiply.
        let turned = |normal, instance: &StoredInstance| instance.normal(normal).try_normalize();
        self.instances().rev().try_fold(normal, turned)
    }

    /// The origin on a side of a facet, 1 above and -1 below.
    fn start(&self, facet: &Facet, side: f64, extent: f64) -> Option<DVec3> {
        let mut lift = facet.lift;
        // A lift larger than the object is of no use: give up.
        while lift <= extent {
            let wanted = facet.point + facet.normal * (side * lift);
            let start = self.to_scene(wanted)?;
            let line = LineF64 { origin: start.to_array(), direction: [0.0; 3] };
            let seen = self.line(&line).origin.map(|c| f64::from(round(c)));
            if DVec3::from_array(seen).distance(wanted) < 0.5 * lift {
                return Some(start);
            }
            lift *= 2.0;
        }
        None
    }
}

const _: () = assert!(size_of::<SceneSurface>() == 88);
