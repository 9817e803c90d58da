//! Embree 3: a device with one thread, the mesh's own arrays as shared buffers, a geometry for each instance
//! of the mesh, and a user geometry for spheres.
//!
//! ```text
//! mod     System and Tracer: which query for which mode
//! device  device and scene, with the bytes that Embree reports
//! query   rays in, answers out: one by one, in packets, in streams
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
use crate::compare::mode::{Hint, Lanes, Mode};
use crate::compare::shown::Shown;
use crate::compare::system::{Bytes, System, Tracer, Use, warm_up};
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
    /// Starts a device, outside of every timed build.
    pub(super) fn new(peer: Peer, quality: Quality) -> Result<Self> {
        Ok(Self { peer, quality, device: Device::new()? })
    }
}

/// The calls without a hint, for instances. With a hint of coherence, `rtcOccluded16` of version 3.13.5 does
/// not return from some packets of rays at instances.
const UNHINTED: &[Mode] = &[
    Mode::Single,
    Mode::Packet(Lanes::Four, Hint::None),
    Mode::Packet(Lanes::Eight, Hint::None),
    Mode::Packet(Lanes::Sixteen, Hint::None),
    Mode::Stream(Hint::None),
];

/// Every call for rays that Embree has: the fastest one depends on scene and machine.
const ALL: &[Mode] = &[
    Mode::Single,
    Mode::Packet(Lanes::Four, Hint::None),
    Mode::Packet(Lanes::Eight, Hint::None),
    Mode::Packet(Lanes::Sixteen, Hint::None),
    Mode::Packet(Lanes::Four, Hint::Coherent),
    Mode::Packet(Lanes::Eight, Hint::Coherent),
    Mode::Packet(Lanes::Sixteen, Hint::Coherent),
    Mode::Stream(Hint::None),
    Mode::Stream(Hint::Coherent),
];

impl System for Embree {
    fn name(&self) -> String {
        self.peer.name().to_owned()
    }

    fn version(&self) -> Option<String> {
        Some(format!("Embree {}", self.device.version()))
    }

    fn modes(&self, workload: Workload, shown: Shown) -> &'static [Mode] {
        match shown {
            Shown::Mesh if workload.asks_points() => &[Mode::Single],
            _ if workload.asks_points() => &[],
            Shown::Mesh | Shown::Spheres => ALL,
            Shown::Instances(_) => UNHINTED,
        }
    }

    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()> {
        let Self { device, quality, .. } = self;
        match input.shown() {
            Shown::Mesh => then(&device.build(input, *quality)?),
            Shown::Instances(_) => {
                let mesh = device.build(input, *quality)?;
                then(&device.build_instances(&mesh, *quality)?)
            }
            Shown::Spheres => then(&device.build_spheres(input, *quality)?),
        }
    }

    fn rebuild(&self, input: &Input, start: &mut dyn FnMut(), then: &mut Use<'_>) -> Result<()> {
        let Self { device, quality, .. } = self;
        let of_instances = input.shown().instances() > 0;
        let mesh = of_instances.then(|| device.build(input, *quality)).transpose()?;
        let build = || match &mesh {
            Some(mesh) => device.build_instances(mesh, *quality),
            None if input.shown() == Shown::Spheres => device.build_spheres(input, *quality),
            None => device.build(input, *quality),
        };
        if matches!(quality, Quality::Dynamic) {
            let scene = build()?;
            warm_up(|| scene.rebuild())?;
            start();
            scene.rebuild()?;
            return then(&scene);
        }
        warm_up(|| build().map(drop))?;
        start();
        then(&build()?)
    }
}

impl Tracer for Scene<'_> {
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]) {
        match mode {
            Mode::Packet(lanes, hint) => self.intersect_packets(lanes, hint, rays, hits),
            Mode::Stream(hint) => self.intersect_stream(hint, rays, hits),
            Mode::Single | Mode::Coherent | Mode::Batch => self.intersect_each(rays, hits),
        }
    }

    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [u8]) {
        match mode {
            Mode::Packet(lanes, hint) => self.occluded_packets(lanes, hint, rays, occluded),
            Mode::Stream(hint) => self.occluded_stream(hint, rays, occluded),
            Mode::Single | Mode::Coherent | Mode::Batch => self.occluded_each(rays, occluded),
        }
    }

    fn closest_points(&self, points: &[[f32; 3]], radius: f32, distances: &mut [f32]) {
        self.distances(points, radius, distances);
    }

    fn bytes(&self) -> Result<Option<Bytes>> {
        self.memory().map(Some)
    }
}
