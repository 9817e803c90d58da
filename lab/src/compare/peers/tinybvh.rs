//! tinybvh: binned SAH or spatial splits; traced two-wide as built, or eight-wide after a conversion.
//!
//! The wrapper tinybvh-rs has no any-hit query, so closest hits answer those. It has no smallest `t` either;
//! all rays of the workloads start at 0. Large builds start threads, which share one core here (see
//! `process`).

use anyhow::{Result, anyhow};
use hgrid_core::{Hit, Ray};
use tinybvh_rs::{INFINITE, Intersection, Intersector, Ray as TinyRay, bvh};

use super::Peer;
use crate::compare::heap;
use crate::compare::input::Input;
use crate::compare::mode::Mode;
use crate::compare::system::{Bytes, System, Tracer, Use, each};

/// A tree with two children a node, which reads the positions in place.
pub(super) struct Tinybvh2(pub(super) Peer);

impl System for Tinybvh2 {
    fn name(&self) -> String {
        self.0.name().to_owned()
    }

    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()> {
        let before = heap::in_use();
        let positions = positions(input);
        let bvh = bvh::BVH::new(positions.as_slice().into()).map_err(|error| anyhow!("{error}"))?;
        let index = heap::in_use().saturating_sub(before);
        then(&Built { bvh, bytes: Bytes { index, peak: index } })
    }
}

/// A tree with eight children a node, which keeps its own triangles.
#[cfg(target_feature = "avx2")]
pub(super) struct Tinybvh8 {
    pub(super) peer: Peer,
    /// True if nodes may split triangles.
    pub(super) is_hq: bool,
}

#[cfg(target_feature = "avx2")]
impl System for Tinybvh8 {
    fn name(&self) -> String {
        self.peer.name().to_owned()
    }

    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()> {
        use tinybvh_rs::{bvh8_cpu, mbvh};

        /// The most triangles in a leaf of the eight-wide layout.
        const LEAF: u32 = 4;

        let before = heap::in_use();
        let positions = positions(input);
        let build = if self.is_hq { bvh::BVH::new_hq } else { bvh::BVH::new };
        let mut bvh = build(positions.as_slice().into()).map_err(|error| anyhow!("{error}"))?;
        bvh.split_leaves(LEAF);
        let wide = mbvh::BVH::new(&bvh);
        let eight = bvh8_cpu::BVH::new(&wide).map_err(|error| anyhow!("{error}"))?;
        let peak = heap::in_use().saturating_sub(before);
        drop(wide);
        drop(bvh);
        drop(positions);
        let index = heap::in_use().saturating_sub(before);
        then(&Built { bvh: eight, bytes: Bytes { index, peak } })
    }
}

/// Returns three corners for each triangle, sixteen bytes each.
fn positions(input: &Input) -> Vec<[f32; 4]> {
    input.triangles().flatten().map(|[x, y, z]| [x, y, z, 0.0]).collect()
}

struct Built<T> {
    bvh: T,
    bytes: Bytes,
}

impl<T: Intersector> Tracer for Built<T> {
    fn intersect(&self, _: Mode, rays: &[Ray], hits: &mut [Hit]) {
        each(rays, hits, |ray| {
            let found = closest(&self.bvh, ray);
            if found.t < ray.t_max.min(INFINITE) {
                Hit { t: found.t, u: found.u, v: found.v, primitive: found.prim }
            } else {
                Hit::MISS
            }
        });
    }

    fn occluded(&self, _: Mode, rays: &[Ray], occluded: &mut [u8]) {
        each(rays, occluded, |ray| (closest(&self.bvh, ray).t < ray.t_max.min(INFINITE)).into());
    }

    fn bytes(&self) -> Result<Option<Bytes>> {
        Ok(Some(self.bytes))
    }
}

/// A ray with the size and alignment of the C++ type, which are twice those of the wrapper's type. The
/// wrapper's constructor is C++ and would write past the smaller type, so it is not called.
#[repr(C, align(64))]
struct Roomy {
    ray: TinyRay,
    _rest: [u64; 8],
}

/// The mask that sees everything; the C++ type stores it after the origin.
const SEES_ALL: u32 = 0xffff;

/// Returns the closest hit.
#[inline]
fn closest(bvh: &impl Intersector, ray: &Ray) -> Intersection {
    /// The library takes a component no larger than this for zero.
    const LEAST: f32 = 1e-12;
    let reciprocal = |c: f32| {
        if c.abs() > LEAST {
            1.0 / c
        } else if c >= 0.0 {
            INFINITE
        } else {
            -INFINITE
        }
    };
    let ray = TinyRay {
        origin: ray.origin,
        padding_0: SEES_ALL,
        dir: ray.direction,
        padding_1: 0,
        r_d: ray.direction.map(reciprocal),
        padding_2: 0,
        hit: Intersection { t: ray.t_max.min(INFINITE), ..Intersection::default() },
    };
    let mut roomy = Roomy { ray, _rest: [0; 8] };
    bvh.intersect(&mut roomy.ray);
    roomy.ray.hit
}
