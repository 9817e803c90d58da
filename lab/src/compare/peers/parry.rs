//! parry3d: the binary tree of a collision library, over the caller's mesh.
//!
//! The library's `TriMesh` copies the mesh and has one builder. Its tree alone takes boxes and either
//! builder, and calls back for the hit of a triangle.

use anyhow::Result;
use hgrid_core::{Hit, Ray};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::{Ray as ParryRay, RayCast as _};
use parry3d::shape::Triangle;

use super::Peer;
use crate::compare::input::Input;
use crate::compare::mode::Mode;
use crate::compare::system::{System, Tracer, Use, each};

/// One of the library's builders.
pub(super) struct Parry {
    peer: Peer,
    strategy: BvhBuildStrategy,
}

impl Parry {
    /// Returns the faster builder.
    pub(super) const fn binned(peer: Peer) -> Self {
        Self { peer, strategy: BvhBuildStrategy::Binned }
    }

    /// Returns the builder of higher quality.
    pub(super) const fn ploc(peer: Peer) -> Self {
        Self { peer, strategy: BvhBuildStrategy::Ploc }
    }
}

impl System for Parry {
    fn name(&self) -> String {
        self.peer.name().to_owned()
    }

    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()> {
        let boxes = input.triangles().map(|[a, b, c]| {
            let bound = |of: fn(f32, f32) -> f32| {
                Vector::from([0, 1, 2].map(|axis| of(of(a[axis], b[axis]), c[axis])))
            };
            Aabb::new(bound(f32::min), bound(f32::max))
        });
        let bvh = Bvh::from_iter(self.strategy, boxes.enumerate());
        then(&Built { bvh, positions: input.positions(), indices: input.indices() })
    }
}

struct Built<'a> {
    bvh: Bvh,
    positions: &'a [[f32; 3]],
    indices: &'a [[u32; 3]],
}

impl Built<'_> {
    fn triangle(&self, id: u32) -> Triangle {
        let corner = |at: u32| Vector::from(self.positions[at as usize]);
        let [a, b, c] = self.indices[id as usize].map(corner);
        Triangle::new(a, b, c)
    }
}

impl Tracer for Built<'_> {
    fn intersect(&self, _: Mode, rays: &[Ray], hits: &mut [Hit]) {
        each(rays, hits, |ray| {
            let (ray, t_max) = to_parry(ray);
            let hit = self.bvh.cast_ray(&ray, t_max, |id, closest| {
                self.triangle(id).cast_local_ray(&ray, closest, false)
            });
            hit.map_or(Hit::MISS, |(primitive, t)| Hit { t, primitive, ..Hit::MISS })
        });
    }

    fn occluded(&self, _: Mode, rays: &[Ray], occluded: &mut [u8]) {
        each(rays, occluded, |ray| {
            let (ray, t_max) = to_parry(ray);
            // The library has no any-hit query: a hit at a distance closer than any box ends the search.
            let hit = self.bvh.cast_ray(&ray, t_max, |id, closest| {
                self.triangle(id).cast_local_ray(&ray, closest, false).map(|_| f32::MIN)
            });
            hit.is_some().into()
        });
    }
}

/// Converts a ray, and the end of its range: the largest finite number replaces infinity.
fn to_parry(ray: &Ray) -> (ParryRay, f32) {
    (ParryRay::new(ray.origin.into(), ray.direction.into()), ray.t_max.min(f32::MAX))
}
