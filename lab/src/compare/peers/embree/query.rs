//! Queries: rays in, answers out. Rays are turned into Embree's here, inside the measured time.

use core::ptr;

use hgrid_core::{Hit, Ray};

use super::device::Scene;
use super::ffi::{self, Context, Hit1, Hit16, LANES, Ray1, Ray16, RayHit1, RayHit16, Valid};
use crate::compare::system::each;

fn context(flags: u32) -> Context {
    Context { flags, filter: None, inst_id: [ffi::INVALID_ID] }
}

impl Scene<'_> {
    /// `rtcIntersect1` for each ray.
    pub(super) fn intersect_each(&self, rays: &[Ray], hits: &mut [Hit]) {
        let mut context = context(ffi::CONTEXT_INCOHERENT);
        each(rays, hits, |ray| {
            let hit = Hit1 {
                normal: [0.0; 3],
                u: 0.0,
                v: 0.0,
                primitive: ffi::INVALID_ID,
                geometry: ffi::INVALID_ID,
                instance: ffi::INVALID_ID,
            };
            let mut both = RayHit1 { ray: ray1(ray), hit };
            // SAFETY: the scene is committed; both structs are those of the header, aligned.
            unsafe { ffi::rtcIntersect1(self.handle(), &raw mut context, &raw mut both) };
            let RayHit1 { ray, hit } = both;
            if hit.geometry == ffi::INVALID_ID {
                Hit::MISS
            } else {
                Hit { t: ray.far, u: hit.u, v: hit.v, primitive: hit.primitive }
            }
        });
    }

    /// `rtcOccluded1` for each ray.
    pub(super) fn occluded_each(&self, rays: &[Ray], occluded: &mut [bool]) {
        let mut context = context(ffi::CONTEXT_INCOHERENT);
        each(rays, occluded, |ray| {
            let mut ray = ray1(ray);
            // SAFETY: as in `intersect_each`.
            unsafe { ffi::rtcOccluded1(self.handle(), &raw mut context, &raw mut ray) };
            is_occluded(ray.far)
        });
    }

    /// `rtcIntersect16` for sixteen rays at a time.
    pub(super) fn intersect_packets(&self, flags: u32, rays: &[Ray], hits: &mut [Hit]) {
        let mut context = context(flags);
        for (rays, hits) in rays.chunks(LANES).zip(hits.chunks_mut(LANES)) {
            let (valid, ray) = ray16(rays);
            let hit = Hit16 {
                normal: [[0.0; LANES]; 3],
                u: [0.0; LANES],
                v: [0.0; LANES],
                primitive: [ffi::INVALID_ID; LANES],
                geometry: [ffi::INVALID_ID; LANES],
                instance: [ffi::INVALID_ID; LANES],
            };
            let mut both = RayHit16 { ray, hit };
            // SAFETY: as in `intersect_each`; there is a mask for every lane.
            unsafe {
                ffi::rtcIntersect16(
                    ptr::from_ref(&valid).cast(),
                    self.handle(),
                    &raw mut context,
                    &raw mut both,
                );
            };
            let RayHit16 { ray, hit } = both;
            for (lane, place) in hits.iter_mut().enumerate() {
                *place = if hit.geometry[lane] == ffi::INVALID_ID {
                    Hit::MISS
                } else {
                    let (u, v) = (hit.u[lane], hit.v[lane]);
                    Hit { t: ray.far[lane], u, v, primitive: hit.primitive[lane] }
                };
            }
        }
    }

    /// `rtcOccluded16` for sixteen rays at a time.
    pub(super) fn occluded_packets(&self, flags: u32, rays: &[Ray], occluded: &mut [bool]) {
        let mut context = context(flags);
        for (rays, occluded) in rays.chunks(LANES).zip(occluded.chunks_mut(LANES)) {
            let (valid, mut ray) = ray16(rays);
            // SAFETY: as in `intersect_packets`.
            unsafe {
                ffi::rtcOccluded16(
                    ptr::from_ref(&valid).cast(),
                    self.handle(),
                    &raw mut context,
                    &raw mut ray,
                );
            };
            for (place, &far) in occluded.iter_mut().zip(&ray.far) {
                *place = is_occluded(far);
            }
        }
    }
}

/// Embree answers with a far end of minus infinity.
fn is_occluded(far: f32) -> bool {
    far < 0.0
}

fn ray1(ray: &Ray) -> Ray1 {
    let Ray { origin, t_min: near, direction, t_max: far } = *ray;
    Ray1 { origin, near, direction, time: 0.0, far, mask: u32::MAX, id: 0, flags: 0 }
}

/// Up to sixteen rays, axis by axis.
fn ray16(rays: &[Ray]) -> (Valid, Ray16) {
    let mut valid = Valid([0; LANES]);
    let mut packet = Ray16 {
        origin: [[0.0; LANES]; 3],
        near: [0.0; LANES],
        direction: [[0.0; LANES]; 3],
        time: [0.0; LANES],
        far: [0.0; LANES],
        mask: [u32::MAX; LANES],
        id: [0; LANES],
        flags: [0; LANES],
    };
    for (lane, ray) in rays.iter().enumerate().take(LANES) {
        valid.0[lane] = -1;
        for axis in 0..3 {
            packet.origin[axis][lane] = ray.origin[axis];
            packet.direction[axis][lane] = ray.direction[axis];
        }
        packet.near[lane] = ray.t_min;
        packet.far[lane] = ray.t_max;
    }
    (valid, packet)
}
