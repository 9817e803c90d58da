//! Builds for rendering: a grid, or a grid for each mesh and a scene of their instances.

use std::time::Instant;

use anyhow::{Context as _, Result};
use hgrid_core::{Config, Grid, Instance, Object, Scene as Instances, TriangleMesh};

use crate::regions::Regions;
use crate::scene::Scene;
use crate::scene::model::Model;
use crate::threads::Threads;
use crate::world::World;

/// Time and memory of a build.
pub(super) struct Built {
    pub(super) seconds: f64,
    pub(super) index_bytes: usize,
    pub(super) skipped_triangles: u64,
    pub(super) instances: usize,
}

/// Builds with a configuration, and with the density that was asked for if one was, and calls `then` with the result.
pub(super) fn build<T>(
    scene: &Scene,
    model: Option<&Model>,
    (config, density): (&Config, Option<f32>),
    threads: &Threads,
    then: impl FnOnce(World<'_>, Built) -> Result<T>,
) -> Result<T> {
    match model {
        None => build_mesh(scene, (config, density), threads, then),
        Some(model) => build_instances(model, config, threads, then),
    }
}

fn build_mesh<T>(
    scene: &Scene,
    (config, density): (&Config, Option<f32>),
    threads: &Threads,
    then: impl FnOnce(World<'_>, Built) -> Result<T>,
) -> Result<T> {
    let mut parts = scene.parts()?;
    let mesh = scene.mesh(&mut parts)?;
    let start = Instant::now();
    let index = threads.parallel(|parallel| Regions::fresh(mesh, config, parallel))?.index;
    let seconds = start.elapsed().as_secs_f64();
    let grid = Grid::open(&index, mesh)?;
    Regions::refuse_thinner(&grid, density)?;
    let built = Built {
        seconds,
        index_bytes: grid.blob_bytes(),
        skipped_triangles: grid.skipped_count().into(),
        instances: 0,
    };
    then(World::Mesh(&grid), built)
}

fn build_instances<T>(
    model: &Model,
    config: &Config,
    threads: &Threads,
    then: impl FnOnce(World<'_>, Built) -> Result<T>,
) -> Result<T> {
    let Model { meshes, instances, .. } = model;
    let has_triangles = |mesh: usize| meshes.get(mesh).is_some_and(|mesh| !mesh.indices.is_empty());
    let placed = instances.iter().filter(|(mesh, _)| has_triangles(*mesh));
    let placed = placed
        .map(|&(mesh, transform)| Ok(Instance::with_transform(u32::try_from(mesh)?, transform)));
    let placed = placed.collect::<Result<Vec<_>>>()?;

    let start = Instant::now();
    let meshes = meshes.iter().map(|mesh| TriangleMesh::new(&mesh.positions, &mesh.indices));
    let meshes = meshes.collect::<Result<Vec<_>, _>>()?;
    let indices = threads.parallel(|parallel| {
        let index = |&mesh| Ok(Regions::fresh(mesh, config, parallel)?.index);
        meshes.iter().map(index).collect::<Result<Vec<_>>>()
    })?;
    let grids = indices.iter().zip(&meshes).map(|(index, &mesh)| Grid::open(index, mesh));
    let grids = grids.collect::<Result<Vec<_>, _>>()?;
    let objects: Vec<_> = grids.iter().map(Object::Grid).collect();
    let count = u32::try_from(placed.len())?;
    let bound = Instances::bound_parallel(count, config, threads.count());
    let Regions { index, scratch } =
        &mut Regions::of(bound.context("more instances than a scene can have")?)?;
    let scene = threads.parallel(|parallel| {
        Instances::build_with(&placed, &objects, config, index, scratch, parallel)
    })?;
    let seconds = start.elapsed().as_secs_f64();

    let skipped = placed.iter().filter_map(|instance| grids.get(instance.object as usize));
    let built = Built {
        seconds,
        index_bytes: grids.iter().map(Grid::blob_bytes).sum::<usize>() + scene.blob().len(),
        skipped_triangles: skipped.map(|grid| u64::from(grid.skipped_count())).sum(),
        instances: placed.len(),
    };
    then(World::Instances(&scene), built)
}
