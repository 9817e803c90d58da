//! Instances of a mesh in hgrid: a scene over the tree of the mesh, which is built once.

use core::cell::RefCell;

use anyhow::{Context as _, Result};
use hgrid_core::{Config, Grid, Hit, Instance, Object, Ray, Scene, SceneOptions, Sizes};

use super::grid::Call;
use super::input::Input;
use super::mode::Mode;
use super::system::{Bytes, Tracer, Use, each};
use crate::regions::Regions;
use crate::world::{SceneBatch, on_mesh};

/// Builds the mesh's tree and the scene, and calls `then` with the scene. With `start`, builds the scene
/// twice: calls `start` between the two, so that the second build alone is timed, in memory that the first
/// one has written.
pub(super) fn build(
    input: &Input,
    config: &Config,
    start: Option<&mut dyn FnMut()>,
    then: &mut Use<'_>,
) -> Result<()> {
    let (mesh, instances) = (input.mesh()?, input.instances());
    let regions = Regions::build(mesh, config)?;
    let grid = Grid::open(&regions.index, mesh)?;
    let objects = [Object::Grid(&grid)];
    let Regions { index, scratch } = &mut Regions::of(bound(instances, config)?)?;
    if let Some(start) = start {
        Scene::build(instances, &objects, config, index, scratch)?;
        start();
    }
    let scene = Scene::build(instances, &objects, config, index, scratch)?;
    then(&SceneTracer { scene, instances, config, memory: RefCell::default() })
}

/// Returns the memory that is enough for a scene of these instances.
fn bound(instances: &[Instance], config: &Config) -> Result<Sizes> {
    let count = u32::try_from(instances.len())?;
    Scene::bound(count, config).context("scenes are built with bvh, and of fewer instances")
}

struct SceneTracer<'a> {
    scene: Scene<'a>,
    instances: &'a [Instance],
    config: &'a Config,
    /// Memory to sort rays in, kept from call to call.
    memory: RefCell<Vec<u8>>,
}

impl Tracer for SceneTracer<'_> {
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]) {
        let Some(call) = Call::of(mode) else {
            return each(rays, hits, |ray| {
                self.scene.intersect(&ray.into()).map_or(Hit::MISS, on_mesh)
            });
        };
        let memory = &mut self.memory.borrow_mut();
        let scratch = call.memory(rays.len(), memory);
        let options = &mut SceneOptions { scratch, ..SceneOptions::default() };
        for (rays, answers) in rays.chunks(call.rays).zip(hits.chunks_mut(call.rays)) {
            let mut batch = SceneBatch { rays, answers, write: on_mesh };
            self.scene.intersect_batch(&mut batch, call.coherence, options);
        }
    }

    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [u8]) {
        let Some(call) = Call::of(mode) else {
            return each(rays, occluded, |ray| self.scene.occluded(&ray.into()).into());
        };
        let memory = &mut self.memory.borrow_mut();
        let scratch = call.memory(rays.len(), memory);
        let options = &mut SceneOptions { scratch, ..SceneOptions::default() };
        for (rays, answers) in rays.chunks(call.rays).zip(occluded.chunks_mut(call.rays)) {
            let mut batch = SceneBatch { rays, answers, write: u8::from };
            self.scene.occluded_batch(&mut batch, call.coherence, options);
        }
    }

    fn bytes(&self) -> Result<Option<Bytes>> {
        let Self { scene, instances, config, .. } = self;
        let index_bytes = scene.blob().len();
        let mut regions = Regions::counted(bound(instances, config)?)?;
        let Regions { index, scratch } = &mut regions;
        Scene::build(instances, scene.objects(), config, index, scratch)?;
        Ok(Some(Bytes { index: index_bytes, peak: regions.written_bytes(index_bytes) }))
    }
}
