//! Four, eight or sixteen rays a call.

use core::ptr;

use hgrid_core::{Hit, Ray};

use super::{context, is_occluded};
use crate::compare::mode::{Hint, Lanes};
use crate::compare::peers::embree::device::Scene;
use crate::compare::peers::embree::ffi::{
    self, Hits, IntersectPacket, OccludedPacket, RayHits, Rays, Valid,
};

impl Scene<'_> {
    /// `rtcIntersect4`, `rtcIntersect8` or `rtcIntersect16` for each packet.
    pub(in super::super) fn intersect_packets(
        &self,
        lanes: Lanes,
        hint: Hint,
        rays: &[Ray],
        hits: &mut [Hit],
    ) {
        match lanes {
            Lanes::Four => self.intersect_packets_by(ffi::rtcIntersect4, hint, rays, hits),
            Lanes::Eight => self.intersect_packets_by(ffi::rtcIntersect8, hint, rays, hits),
            Lanes::Sixteen => self.intersect_packets_by(ffi::rtcIntersect16, hint, rays, hits),
        }
    }

    /// `rtcOccluded4`, `rtcOccluded8` or `rtcOccluded16` for each packet.
    pub(in super::super) fn occluded_packets(
        &self,
        lanes: Lanes,
        hint: Hint,
        rays: &[Ray],
        occluded: &mut [u8],
    ) {
        match lanes {
            Lanes::Four => self.occluded_packets_by(ffi::rtcOccluded4, hint, rays, occluded),
            Lanes::Eight => self.occluded_packets_by(ffi::rtcOccluded8, hint, rays, occluded),
            Lanes::Sixteen => self.occluded_packets_by(ffi::rtcOccluded16, hint, rays, occluded),
        }
    }

    fn intersect_packets_by<const LANES: usize>(
        &self,
        intersect: IntersectPacket<LANES>,
        hint: Hint,
        rays: &[Ray],
        hits: &mut [Hit],
    ) {
        let mut context = context(hint);
        let mut both = RayHits { rays: no_rays(), hits: no_hits() };
        for (rays, answers) in rays.chunks(LANES).zip(hits.chunks_mut(LANES)) {
            let valid = both.rays.set(rays);
            // Of a hit, Embree only needs the geometry to be invalid.
            both.hits.geometry = [ffi::INVALID_ID; LANES];
            // SAFETY: the scene is committed; the structs are those of the header, aligned; every lane has a mark.
            unsafe {
                intersect(
                    ptr::from_ref(&valid).cast(),
                    self.handle(),
                    &raw mut context,
                    &raw mut both,
                );
            };
            let RayHits { rays, hits } = &both;
            for (lane, answer) in answers.iter_mut().enumerate() {
                *answer = if hits.geometry[lane] == ffi::INVALID_ID {
                    Hit::MISS
                } else {
                    let (u, v) = (hits.u[lane], hits.v[lane]);
                    Hit { t: rays.far[lane], u, v, primitive: hits.primitive[lane] }
                };
            }
        }
    }

    fn occluded_packets_by<const LANES: usize>(
        &self,
        occlude: OccludedPacket<LANES>,
        hint: Hint,
        rays: &[Ray],
        occluded: &mut [u8],
    ) {
        let mut context = context(hint);
        let mut packet = no_rays();
        for (rays, answers) in rays.chunks(LANES).zip(occluded.chunks_mut(LANES)) {
            let valid = packet.set(rays);
            // SAFETY: as in `intersect_packets_by`.
            unsafe {
                occlude(
                    ptr::from_ref(&valid).cast(),
                    self.handle(),
                    &raw mut context,
                    &raw mut packet,
                );
            };
            for (answer, &far) in answers.iter_mut().zip(&packet.far) {
                *answer = is_occluded(far).into();
            }
        }
    }
}

/// Makes a packet without rays.
const fn no_rays<const LANES: usize>() -> Rays<LANES> {
    Rays {
        origin: [[0.0; LANES]; 3],
        near: [0.0; LANES],
        direction: [[0.0; LANES]; 3],
        time: [0.0; LANES],
        far: [0.0; LANES],
        mask: [u32::MAX; LANES],
        id: [0; LANES],
        flags: [0; LANES],
    }
}

impl<const LANES: usize> Rays<LANES> {
    /// Sets the next rays, up to `LANES`, axis by axis, and marks their lanes. Embree changes nothing but the far ends.
    fn set(&mut self, rays: &[Ray]) -> Valid<LANES> {
        let mut valid = Valid([0; LANES]);
        for (lane, ray) in rays.iter().enumerate().take(LANES) {
            valid.0[lane] = -1;
            for axis in 0..3 {
                self.origin[axis][lane] = ray.origin[axis];
                self.direction[axis][lane] = ray.direction[axis];
            }
            self.near[lane] = ray.t_min;
            self.far[lane] = ray.t_max;
        }
        valid
    }
}

/// Makes hits without a geometry, for Embree to fill in.
const fn no_hits<const LANES: usize>() -> Hits<LANES> {
    Hits {
        normal: [[0.0; LANES]; 3],
        u: [0.0; LANES],
        v: [0.0; LANES],
        primitive: [ffi::INVALID_ID; LANES],
        geometry: [ffi::INVALID_ID; LANES],
        instance: [ffi::INVALID_ID; LANES],
    }
}
