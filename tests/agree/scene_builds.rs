//! A scene has the same bytes, whatever tasks build it and in however little memory.

use std::cell::Cell;

use hgrid_core::{Block, Config, Control, Grid, Object, Parameters, Quality, Scene, Task};
use hgrid_tests::scenes::{Built, scattered};

use crate::scenes::with_grids;

#[test]
fn tasks_do_not_change_a_scene() {
    with_grids(|objects, _| {
        let instances = scattered(120_000, 3, 10.0, 4);
        for quality in [Quality::Fast, Quality::High] {
            let config = Config::from(Parameters::Bvh { quality });
            let one = Built::scene(&instances, objects, &config).unwrap();
            for tasks in [2, 7] {
                let sizes = Scene::bound_parallel(120_000, &config, tasks).unwrap();
                let [mut index, mut scratch] = [sizes.index_bytes, sizes.scratch_bytes]
                    .map(|bytes| vec![Block::ZERO; Block::count_for(bytes)]);
                // Enough instances for seven tasks; the last one first.
                let calls = Cell::new(0);
                let run = |count: u32, task: &Task<'_>| {
                    calls.set(calls.get() + 1);
                    (0..count).rev().for_each(task);
                };
                let control = Control { tasks, run: &run, progress: None };
                let [index, scratch] = [&mut index, &mut scratch].map(|all| Block::bytes_mut(all));
                let scene =
                    Scene::build_with(&instances, objects, &config, index, scratch, &control);
                assert!(scene.unwrap().blob() == one.open(objects).unwrap().blob(), "{tasks}");
                assert!(calls.get() > 0, "{quality:?}");
            }
        }
    });
}

#[test]
fn exact_memory_does_not_change_a_scene() {
    with_grids(|objects, _| {
        let instances = scattered(300, 3, 10.0, 4);
        let config = Config::default();
        let one = Built::scene(&instances, objects, &config).unwrap();
        let scene = one.open(objects).unwrap();
        // Exactly as much memory as is needed.
        let mut exact = vec![Block::ZERO; Block::count_for(scene.blob().len())];
        let sizes = Scene::bound(300, &config).unwrap();
        let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
        let again = Scene::build(
            &instances,
            objects,
            &config,
            Block::bytes_mut(&mut exact),
            Block::bytes_mut(&mut scratch),
        )
        .unwrap();
        assert!(again.blob() == scene.blob());
    });
}

#[test]
fn a_grid_does_not_open_as_a_scene() {
    with_grids(|objects, _| {
        let grid: &Grid<'_> = match &objects[0] {
            Object::Grid(grid) => grid,
            _ => panic!("a grid"),
        };
        assert!(Scene::open(grid.blob(), objects).is_err());
    });
}
