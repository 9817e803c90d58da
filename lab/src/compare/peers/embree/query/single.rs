//! One ray a call.

use hgrid_core::{Hit, Ray};

use super::{NO_HIT, context, is_occluded, ray1};
use crate::compare::mode::Hint;
use crate::compare::peers::embree::device::Scene;
use crate::compare::peers::embree::ffi;
use crate::compare::system::each;

impl Scene<'_> {
    /// `rtcIntersect1` for each ray.
    pub(in super::super) fn intersect_each(&self, rays: &[Ray], hits: &mut [Hit]) {
        let mut context = context(Hint::None);
        let mut asked = NO_HIT;
        each(rays, hits, |ray| {
            asked.ask(ray);
            // SAFETY: the scene is committed; both structs are those of the header, aligned.
            unsafe { ffi::rtcIntersect1(self.handle(), &raw mut context, &raw mut asked) };
            asked.answer()
        });
    }

    /// `rtcOccluded1` for each ray.
    pub(in super::super) fn occluded_each(&self, rays: &[Ray], occluded: &mut [u8]) {
        let mut context = context(Hint::None);
        each(rays, occluded, |ray| {
            let mut ray = ray1(ray);
            // SAFETY: as in `intersect_each`.
            unsafe { ffi::rtcOccluded1(self.handle(), &raw mut context, &raw mut ray) };
            is_occluded(ray.far).into()
        });
    }
}
