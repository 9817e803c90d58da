//! Embree 3: a device with one thread, the mesh's own arrays as shared buffers.
//!
//! ```text
//! mod     System and Tracer: which query for which mode
//! device  device and scene, with the bytes that Embree reports
//! query   rays in, answers out, one or sixteen at a time
//! ffi     the C header
//! ```

#![expect(unsafe_code, reason = "Embree is a C library")]

mod device;
mod ffi;
mod query;

use anyhow::Result;
use hgrid_core::{Hit, Ray};

use super::Peer;
use crate::compare::input::Input;
use crate::compare::system::{Bytes, Mode, System, Tracer, Use};
use crate::compare::workloads::Workload;
pub(super) use device::Quality;
use device::{Device, Scene};

/// Embree with one of its builders.
pub(super) struct Embree {
    peer: Peer,
    quality: Quality,
    device: Device,
}

impl Embree {
    /// Starts a device, which is not part of any build.
    pub(super) fn new(peer: Peer, quality: Quality) -> Result<Self> {
        Ok(Self { peer, quality, device: Device::new()? })
    }
}

impl System for Embree {
    fn name(&self) -> String {
        self.peer.name().to_owned()
    }

    fn modes(&self, workload: Workload) -> &'static [Mode] {
        match workload {
            Workload::Primary => &[Mode::Single, Mode::Coherent],
            Workload::Ao | Workload::Random => &[Mode::Single, Mode::Incoherent],
        }
    }

    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()> {
        then(&self.device.build(input, self.quality)?)
    }
}

impl Tracer for Scene<'_> {
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]) {
        match mode {
            Mode::Single => self.intersect_each(rays, hits),
            Mode::Coherent => self.intersect_packets(ffi::CONTEXT_COHERENT, rays, hits),
            Mode::Incoherent => self.intersect_packets(ffi::CONTEXT_INCOHERENT, rays, hits),
        }
    }

    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [bool]) {
        match mode {
            Mode::Single => self.occluded_each(rays, occluded),
            Mode::Coherent => self.occluded_packets(ffi::CONTEXT_COHERENT, rays, occluded),
            Mode::Incoherent => self.occluded_packets(ffi::CONTEXT_INCOHERENT, rays, occluded),
        }
    }

    fn bytes(&self) -> Result<Option<Bytes>> {
        Ok(Some(self.memory()))
    }
}
