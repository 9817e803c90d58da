//! obvhs: a two-wide tree by PLOC and reinsertion, turned into a compressed eight-wide one.
//!
//! Users of the library keep their own triangles, in the order of the leaves and in the form of its triangle
//! test. So they are part of the structure here.

use core::time::Duration;

use ::obvhs::BvhBuildParams;
use ::obvhs::cwbvh::CwBvh;
use ::obvhs::cwbvh::builder::build_cwbvh_from_tris;
use ::obvhs::ray::{Ray as ObvhsRay, RayHit};
use ::obvhs::rt_triangle::RtTriangle;
use ::obvhs::triangle::Triangle;
use anyhow::Result;
use glam::Vec3A;
use hgrid_core::{Hit, Ray};

use super::Peer;
use crate::compare::input::Input;
use crate::compare::mode::Mode;
use crate::compare::system::{System, Tracer, Use, each};

/// A preset of the library's builder.
pub(super) struct Obvhs {
    peer: Peer,
    params: BvhBuildParams,
}

impl Obvhs {
    /// Returns the fastest preset that improves its tree, which the library recommends.
    pub(super) const fn fast(peer: Peer) -> Self {
        Self { peer, params: BvhBuildParams::very_fast_build() }
    }

    /// Returns the preset of the highest quality.
    pub(super) const fn slow(peer: Peer) -> Self {
        Self { peer, params: BvhBuildParams::very_slow_build() }
    }
}

impl System for Obvhs {
    fn name(&self) -> String {
        self.peer.name().to_owned()
    }

    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()> {
        let triangle = |corners: [[f32; 3]; 3]| {
            let [v0, v1, v2] = corners.map(Vec3A::from);
            Triangle { v0, v1, v2 }
        };
        let triangles: Vec<_> = input.triangles().map(triangle).collect();
        let bvh = build_cwbvh_from_tris(&triangles, self.params, &mut Duration::default());
        let in_leaf_order = bvh.primitive_indices.iter();
        let in_leaf_order = in_leaf_order.map(|&id| RtTriangle::from(&triangles[id as usize]));
        let leaves = in_leaf_order.collect();
        drop(triangles);
        then(&Built { bvh, leaves })
    }
}

struct Built {
    bvh: CwBvh,
    leaves: Vec<RtTriangle>,
}

impl Tracer for Built {
    fn intersect(&self, _: Mode, rays: &[Ray], hits: &mut [Hit]) {
        each(rays, hits, |ray| {
            let mut hit = RayHit::none();
            let is_hit = self
                .bvh
                .ray_traverse(to_obvhs(ray), &mut hit, |ray, at| self.leaves[at].intersect(ray));
            if !is_hit {
                return Hit::MISS;
            }
            Hit {
                t: hit.t,
                primitive: self.bvh.primitive_indices[hit.primitive_id as usize],
                ..Hit::MISS
            }
        });
    }

    fn occluded(&self, _: Mode, rays: &[Ray], occluded: &mut [u8]) {
        each(rays, occluded, |ray| {
            let is_free =
                self.bvh.ray_traverse_miss(to_obvhs(ray), |ray, at| self.leaves[at].intersect(ray));
            (!is_free).into()
        });
    }
}

fn to_obvhs(ray: &Ray) -> ObvhsRay {
    ObvhsRay::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}
