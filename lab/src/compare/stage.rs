//! One system at a time over all workloads: runs that are timed, and their answers.

use core::hint::black_box;

use anyhow::Result;
use hgrid_core::{Hit, Ray};

use super::agreement::{differing_hits, hits, unequal};
use super::input::Input;
use super::mode::Mode;
use super::samples::{RunRecord, Watch};
use super::system::Tracer;
use super::workloads::{Rays, Workload};
use crate::shade::{Rgb, Shader};
use crate::tiles::TILE_RAYS;

/// What all systems share: rays, and room for answers.
pub(super) struct Stage<'a> {
    rays: &'a Rays,
    shader: Shader<'a>,
    pixels: Vec<Rgb>,
    hits: Vec<Hit>,
    occluded: Vec<u8>,
}

impl<'a> Stage<'a> {
    pub(super) fn new(input: &'a Input, rays: &'a Rays) -> Result<Self> {
        let pixels = rays.primary_hits.len();
        Ok(Self {
            rays,
            shader: Shader::new(input.mesh()?, &rays.tiles.camera),
            // Not zero: zeros may come as pages that nobody has touched.
            pixels: vec![[1; 3]; pixels],
            hits: vec![Hit::MISS; pixels.max(rays.random.questions.len())],
            occluded: vec![1; rays.ao.questions.len()],
        })
    }

    /// One timed run.
    pub(super) fn trace(&mut self, tracer: &dyn Tracer, run: &mut RunRecord) {
        let Self { rays, shader, pixels, hits, occluded } = self;
        let mode = run.mode;
        let watch = Watch::start();
        match run.workload {
            Workload::Primary => {
                let mut hits = [Hit::MISS; TILE_RAYS];
                rays.tiles.fill(pixels, |rays, colors| {
                    let hits = &mut hits[..rays.len()];
                    tracer.intersect(mode, rays, hits);
                    shader.diffuse(rays, hits, colors);
                });
                black_box(&*pixels);
            }
            Workload::Ao => tracer.occluded(mode, &rays.ao.questions, occluded),
            Workload::Bounce => closest_hits(tracer, mode, &rays.bounce.questions, hits),
            Workload::Random => closest_hits(tracer, mode, &rays.random.questions, hits),
        }
        let (seconds, faults) = watch.stop();
        run.samples.add(seconds, faults);
    }

    /// Compares the answers of the run before, those of hgrid to the last bit. Primary rays are
    /// traced again, because only their colours are kept.
    pub(super) fn check(&mut self, tracer: &dyn Tracer, run: &mut RunRecord, is_peer: bool) {
        let Self { rays, hits: found, occluded, .. } = self;
        let expected = match run.workload {
            Workload::Primary => {
                let found = &mut found[..rays.primary_hits.len()];
                rays.tiles.fill(found, |rays, hits| tracer.intersect(run.mode, rays, hits));
                &rays.primary_hits
            }
            Workload::Ao => {
                run.hits = occluded.iter().map(|&is| u64::from(is)).sum();
                run.differing = unequal(&rays.ao.answers, occluded);
                return;
            }
            Workload::Bounce => &rays.bounce.answers,
            Workload::Random => &rays.random.answers,
        };
        let found = &found[..expected.len()];
        run.hits = hits(found);
        run.differing = if is_peer {
            differing_hits(expected, found, rays.diagonal)
        } else {
            unequal(expected, found)
        };
    }
}

/// The closest hits of rays, in the first places.
fn closest_hits(tracer: &dyn Tracer, mode: Mode, rays: &[Ray], hits: &mut [Hit]) {
    tracer.intersect(mode, rays, &mut hits[..rays.len()]);
}
