//! Many rays a call: Embree's streams.
//!
//! Embree works on 32 rays of a stream at a time, whatever its length; for any-hit queries without the
//! coherent flag it first gathers rays by octant. So the adapter hands over rays in lengths that stay in the
//! caches next to the core (40 KiB for closest hits), in one buffer for all of them.

use core::cell::RefCell;

use hgrid_core::{Hit, Ray};

use super::{NO_HIT, context, is_occluded, ray1};
use crate::compare::mode::Hint;
use crate::compare::peers::embree::device::Scene;
use crate::compare::peers::embree::ffi::{self, Ray1, RayHit1};

/// The number of rays in a call.
const LENGTH: u32 = 512;

/// Buffers for the rays of a call, kept from call to call.
pub(in super::super) struct Buffers {
    closest: RefCell<Vec<RayHit1>>,
    any: RefCell<Vec<Ray1>>,
}

impl Buffers {
    pub(in super::super) const fn new() -> Self {
        Self { closest: RefCell::new(Vec::new()), any: RefCell::new(Vec::new()) }
    }
}

impl Scene<'_> {
    /// `rtcIntersect1M` for all rays.
    pub(in super::super) fn intersect_stream(&self, hint: Hint, rays: &[Ray], hits: &mut [Hit]) {
        let mut context = context(hint);
        let mut asked = self.buffers().closest.borrow_mut();
        asked.resize(LENGTH as usize, NO_HIT);
        let chunks = rays.chunks(LENGTH as usize).zip(hits.chunks_mut(LENGTH as usize));
        for (rays, hits) in chunks {
            for (asked, ray) in asked.iter_mut().zip(rays) {
                asked.ask(ray);
            }
            // SAFETY: the scene is committed; the buffer holds as many structs of the header, contiguous and aligned.
            unsafe {
                ffi::rtcIntersect1M(
                    self.handle(),
                    &raw mut context,
                    asked.as_mut_ptr(),
                    length(rays),
                    size_of::<RayHit1>(),
                );
            };
            for (hit, asked) in hits.iter_mut().zip(&*asked) {
                *hit = asked.answer();
            }
        }
    }

    /// `rtcOccluded1M` for all rays.
    pub(in super::super) fn occluded_stream(&self, hint: Hint, rays: &[Ray], occluded: &mut [u8]) {
        let mut context = context(hint);
        let mut asked = self.buffers().any.borrow_mut();
        asked.resize(LENGTH as usize, NO_HIT.ray);
        let chunks = rays.chunks(LENGTH as usize).zip(occluded.chunks_mut(LENGTH as usize));
        for (rays, occluded) in chunks {
            for (asked, ray) in asked.iter_mut().zip(rays) {
                *asked = ray1(ray);
            }
            // SAFETY: as in `intersect_stream`.
            unsafe {
                ffi::rtcOccluded1M(
                    self.handle(),
                    &raw mut context,
                    asked.as_mut_ptr(),
                    length(rays),
                    size_of::<Ray1>(),
                );
            };
            for (answer, asked) in occluded.iter_mut().zip(&*asked) {
                *answer = is_occluded(asked.far).into();
            }
        }
    }
}

/// Returns the number of rays in a chunk, at most [`LENGTH`].
fn length(rays: &[Ray]) -> u32 {
    u32::try_from(rays.len()).map_or(LENGTH, |length| length.min(LENGTH))
}
