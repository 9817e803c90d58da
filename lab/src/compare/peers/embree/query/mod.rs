//! Queries: rays in, answers out. Rays are converted to Embree's here, inside the measured time.
//!
//! ```text
//! single   rtcIntersect1, rtcOccluded1
//! packet   rtcIntersect4, 8 and 16, rtcOccluded4, 8 and 16
//! stream   rtcIntersect1M, rtcOccluded1M
//! point    rtcPointQuery
//! sphere   the functions by which Embree tests spheres
//! ```

mod packet;
mod point;
mod single;
mod sphere;
mod stream;

use hgrid_core::{Hit, Ray};

use super::ffi::{self, Context, Hit1, Ray1, RayHit1};
use crate::compare::mode::Hint;

pub(super) use sphere::{bounds, intersect, occluded};
pub(super) use stream::Buffers;

/// Returns the context for all rays of a call.
fn context(hint: Hint) -> Context {
    let flags = match hint {
        Hint::None => ffi::CONTEXT_INCOHERENT,
        Hint::Coherent => ffi::CONTEXT_COHERENT,
    };
    Context { flags, filter: None, inst_id: [ffi::INVALID_ID] }
}

const fn ray1(ray: &Ray) -> Ray1 {
    let Ray { origin, t_min: near, direction, t_max: far } = *ray;
    Ray1 { origin, near, direction, time: 0.0, far, mask: u32::MAX, id: 0, flags: 0 }
}

/// A ray without an answer.
const NO_HIT: RayHit1 = RayHit1 {
    ray: ray1(&Ray { origin: [0.0; 3], t_min: 0.0, direction: [0.0; 3], t_max: 0.0 }),
    hit: Hit1 {
        normal: [0.0; 3],
        u: 0.0,
        v: 0.0,
        primitive: ffi::INVALID_ID,
        geometry: ffi::INVALID_ID,
        instance: ffi::INVALID_ID,
    },
};

impl RayHit1 {
    /// Sets the next ray. Of a hit, Embree only needs the geometry to be invalid.
    fn ask(&mut self, ray: &Ray) {
        self.ray = ray1(ray);
        self.hit.geometry = ffi::INVALID_ID;
    }

    /// Returns the answer.
    fn answer(&self) -> Hit {
        let Self { ray, hit } = self;
        if hit.geometry == ffi::INVALID_ID {
            Hit::MISS
        } else {
            Hit { t: ray.far, u: hit.u, v: hit.v, primitive: hit.primitive }
        }
    }
}

/// Returns true if the ray is occluded: Embree then sets the far end to minus infinity.
fn is_occluded(far: f32) -> bool {
    far < 0.0
}
