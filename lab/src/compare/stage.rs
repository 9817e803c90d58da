//! One system at a time over all workloads: timed runs, and their answers.

use core::hint::black_box;

use anyhow::Result;
use hgrid_core::{Hit, Ray};

use super::agreement::{differing_distances, differing_hits, finite, hits, unequal};
use super::input::Input;
use super::mode::Mode;
use super::points::Points;
use super::samples::{RunRecord, Watch};
use super::shown::Shown;
use super::system::Tracer;
use super::workloads::{Rays, Workload};
use crate::shade::{Rgb, Shader};
use crate::tiles::TILE_RAYS;

/// The queries that all systems share, and buffers for answers.
pub(super) struct Stage<'a> {
    rays: &'a Rays,
    /// The shader of the mesh; none for instances and spheres, which are not shaded.
    shader: Option<Shader<'a>>,
    pixels: Vec<Rgb>,
    hits: Vec<Hit>,
    occluded: Vec<u8>,
    distances: Vec<f32>,
}

impl<'a> Stage<'a> {
    pub(super) fn new(input: &'a Input, rays: &'a Rays) -> Result<Self> {
        let pixels = rays.primary_hits.len();
        let shader = Shader::new(input.mesh()?, &rays.tiles.camera);
        let shader = (input.shown() == Shown::Mesh).then_some(shader);
        Ok(Self {
            rays,
            shader,
            // Not zero: zeroed memory may have pages that were never touched.
            pixels: vec![[1; 3]; pixels],
            hits: vec![Hit::MISS; pixels.max(rays.random.questions.len())],
            occluded: vec![1; rays.ao.questions.len()],
            distances: vec![
                1.0;
                rays.near.asked.questions.len().max(rays.far.asked.questions.len())
            ],
        })
    }

    /// Times one run.
    pub(super) fn trace(&mut self, tracer: &dyn Tracer, run: &mut RunRecord) {
        let Self { rays, shader, pixels, hits, occluded, distances } = self;
        let mode = run.mode;
        let watch = Watch::start();
        match run.workload {
            Workload::Primary => {
                if let Some(shader) = shader {
                    let mut hits = [Hit::MISS; TILE_RAYS];
                    rays.tiles.fill(pixels, |rays, colors| {
                        let hits = &mut hits[..rays.len()];
                        tracer.intersect(mode, rays, hits);
                        shader.diffuse(rays, hits, colors);
                    });
                    black_box(&*pixels);
                } else {
                    primary_hits(tracer, mode, rays, hits);
                }
            }
            Workload::Ao => tracer.occluded(mode, &rays.ao.questions, occluded),
            Workload::Bounce => closest_hits(tracer, mode, &rays.bounce.questions, hits),
            Workload::Random => closest_hits(tracer, mode, &rays.random.questions, hits),
            Workload::Near => closest_points(tracer, &rays.near, distances),
            Workload::Far => closest_points(tracer, &rays.far, distances),
        }
        let (seconds, faults) = watch.stop();
        run.samples.add(seconds, faults);
    }

    /// Compares the answers of the last run; those of hgrid must be the same to the last bit.
    pub(super) fn check(&mut self, tracer: &dyn Tracer, run: &mut RunRecord, is_peer: bool) {
        let rays = self.rays;
        match run.workload {
            Workload::Primary => {
                // The run kept only the colours of the hits.
                primary_hits(tracer, run.mode, rays, &mut self.hits);
                self.check_hits(&rays.primary_hits, run, is_peer);
            }
            Workload::Ao => {
                run.hits = self.occluded.iter().map(|&is| u64::from(is)).sum();
                run.differing = unequal(&rays.ao.answers, &self.occluded);
            }
            Workload::Bounce => self.check_hits(&rays.bounce.answers, run, is_peer),
            Workload::Random => self.check_hits(&rays.random.answers, run, is_peer),
            Workload::Near => self.check_distances(&rays.near, run, is_peer),
            Workload::Far => self.check_distances(&rays.far, run, is_peer),
        }
    }

    fn check_hits(&self, expected: &[Hit], run: &mut RunRecord, is_peer: bool) {
        let found = &self.hits[..expected.len()];
        run.hits = hits(found);
        run.differing = if is_peer {
            differing_hits(expected, found, self.rays.tolerance)
        } else {
            unequal(expected, found)
        };
    }

    fn check_distances(&self, points: &Points, run: &mut RunRecord, is_peer: bool) {
        let expected = &points.asked.answers;
        let found = &self.distances[..expected.len()];
        run.hits = finite(found);
        run.differing = if is_peer {
            differing_distances(expected, found, self.rays.tolerance)
        } else {
            unequal(expected, found)
        };
    }
}

/// Traces the primary rays for their closest hits, row by row into the first places.
fn primary_hits(tracer: &dyn Tracer, mode: Mode, rays: &Rays, hits: &mut [Hit]) {
    let hits = &mut hits[..rays.primary_hits.len()];
    rays.tiles.fill(hits, |rays, hits| tracer.intersect(mode, rays, hits));
}

/// Traces rays for their closest hits, into the first places.
fn closest_hits(tracer: &dyn Tracer, mode: Mode, rays: &[Ray], hits: &mut [Hit]) {
    tracer.intersect(mode, rays, &mut hits[..rays.len()]);
}

/// Finds the distances of points, likewise.
fn closest_points(tracer: &dyn Tracer, points: &Points, distances: &mut [f32]) {
    let questions = &points.asked.questions;
    tracer.closest_points(questions, points.radius, &mut distances[..questions.len()]);
}
