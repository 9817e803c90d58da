//! Builds with a progress callback: progress grows to exactly 1, and the callback may cancel.

use std::cell::{Cell, RefCell};

use hgrid_core::{Block, Config, Control, Error, Grid, Parameters, Quality, Sizes, sizes};
use hgrid_tests::meshes::{Mesh, ball, one_triangle};
use hgrid_tests::methods::configs;
use hgrid_tests::owned::prove;

/// Returns memory for a grid, aligned to 64 bytes.
fn region(bytes: usize) -> Vec<Block> {
    vec![Block::ZERO; Block::count_for(bytes)]
}

/// Calls `visit` with memory for a grid of each method.
fn each(mesh: &Mesh, mut visit: impl FnMut(&Config, &mut [Block], &mut [Block])) {
    for config in configs() {
        let Sizes { index_bytes, scratch_bytes, .. } =
            sizes(&mesh.view(), &config, &mut []).unwrap();
        visit(&config, &mut region(index_bytes), &mut region(scratch_bytes));
    }
}

#[test]
fn what_is_done_grows_to_exactly_one() {
    for mesh in [Mesh::default(), one_triangle(), ball(40, 1.0)] {
        each(&mesh, |config, index, scratch| {
            let seen = RefCell::new(Vec::new());
            let progress = |done: f32| {
                seen.borrow_mut().push(done);
                true
            };
            let control = Control { progress: Some(&progress), ..Control::default() };
            let (index, scratch) = (Block::bytes_mut(index), Block::bytes_mut(scratch));
            Grid::build_with(mesh.view(), config, index, scratch, &control).unwrap();
            let seen = seen.into_inner();
            assert_eq!((seen[0], seen[seen.len() - 1]), (0.0, 1.0), "{config:?}");
            assert!(seen.is_sorted_by(|before, after| before < after), "{seen:?}");
        });
    }
}

/// Reports of a build of a tree in one task are at most a fifth of the whole apart, with quality `high` a quarter.
#[test]
fn what_is_done_of_a_tree_grows_in_small_steps() {
    let mesh = ball(40, 1.0);
    each(&mesh, |config, index, scratch| {
        let most = match config.parameters {
            Parameters::Bvh { quality: Quality::Fast } => 0.21,
            Parameters::Bvh { .. } => 0.26,
            _ => return,
        };
        let last = Cell::new(0.0);
        let progress = |done: f32| {
            assert!(done - last.replace(done) < most, "{config:?}: {done}");
            true
        };
        let control = Control { progress: Some(&progress), ..Control::default() };
        let (index, scratch) = (Block::bytes_mut(index), Block::bytes_mut(scratch));
        Grid::build_with(mesh.view(), config, index, scratch, &control).unwrap();
    });
}

#[test]
fn a_build_can_be_cancelled_at_any_call_and_begun_again() {
    let mesh = ball(20, 1.0);
    each(&mesh, |config, index, scratch| {
        let build = |index: &mut [_], scratch: &mut [_], enough: u32| {
            let calls = Cell::new(0);
            let progress = |done: f32| {
                assert!(calls.get() <= enough, "called again after it had enough");
                calls.set(calls.get() + 1);
                // The answer to the last call is ignored.
                calls.get() <= enough && done < 1.0
            };
            let control = Control { progress: Some(&progress), ..Control::default() };
            let (index, scratch) = (Block::bytes_mut(index), Block::bytes_mut(scratch));
            let built = Grid::build_with(mesh.view(), config, index, scratch, &control);
            (built.map(|grid| grid.blob().to_vec()), calls.get())
        };
        let (expected, calls) = build(index, scratch, u32::MAX);
        let expected = expected.unwrap();
        assert!(calls > 3, "{config:?}: {calls} calls");
        for enough in (0..calls - 1).step_by((calls / 8).max(1) as usize) {
            assert_eq!(build(index, scratch, enough).0, Err(Error::Cancelled), "{config:?}");
        }
        assert_eq!(build(index, scratch, u32::MAX).0.unwrap(), expected, "{config:?}");
    });
}

/// After a failed build, however far it got, a region that held a grid holds that grid or none. A header
/// before the lists of another grid would pass for a mixture of both.
#[test]
fn what_is_left_of_a_build_is_the_old_grid_or_none() {
    let old = ball(6, 1.0);
    let new = old.map(|[x, y, z]| [3.0 * y, 3.0 * z, 3.0 * x]);
    each(&old, |config, index, scratch| {
        let (index, scratch) = (Block::bytes_mut(index), Block::bytes_mut(scratch));
        let need = sizes(&new.view(), config, scratch).unwrap().index_bytes;
        let mut check = |index: &mut [u8], enough: u32, room: usize| {
            Grid::build(old.view(), config, index, scratch).unwrap();
            let calls = Cell::new(0);
            let progress = |_| {
                calls.set(calls.get() + 1);
                calls.get() <= enough
            };
            let control = Control { progress: Some(&progress), ..Control::default() };
            let room = &mut index[..room];
            let is_built = Grid::build_with(new.view(), config, room, scratch, &control).is_ok();
            if let Ok(left) = Grid::open(index, old.view()) {
                assert!(is_built || prove(&left) == Ok(()), "{config:?}: {enough} calls");
            }
            is_built
        };
        let enough = index.len();
        let calls = (0..1000).find(|&calls| check(index, calls, enough));
        assert!(calls.is_some_and(|calls| calls > 2), "{config:?}: {calls:?}");
        for part in 0..40 {
            check(index, u32::MAX, need * part / 40);
        }
    });
}
