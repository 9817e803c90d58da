//! Any bytes as a mesh and a configuration: the build takes exactly the memory that was announced, or fails
//! for a reason; the grid opens, is valid, and answers as brute force does.

use std::cell::Cell;

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_core::{
    Config, Control, Error, Grid, Method, Region, Sizes, TriangleMesh, sizes, sizes_with,
};

use super::ask::agrees;
use super::caller::Loop;
use super::memory::rarely;
use super::rays;
use super::shape::{Shape, config};
use crate::guarded::Guarded;
use crate::owned::prove;

/// The largest index or scratch that is built; larger ones are only sized.
const MOST_BYTES: usize = 1 << 20;

/// Runs the target; see the head of this file. Returns true if a grid was queried.
pub fn run(data: &[u8]) -> bool {
    let mut u = Unstructured::new(data);
    describe_and_build(&mut u).unwrap_or(false)
}

fn describe_and_build(u: &mut Unstructured<'_>) -> Result<bool> {
    let config = config(u)?;
    let (tasks, run) = (u32::arbitrary(u)? % 8, Loop::arbitrary(u)?);
    let shape = Shape::new(u)?;
    // Any strides and counts: they are refused, or describe a mesh that builds like any other.
    if rarely(u, 8)? {
        let numbers =
            <[usize; 4]>::arbitrary(u)?.map(|n| if n.leading_zeros() < 4 { n } else { n % 64 });
        let [stride, vertices, index_stride, triangles] = numbers;
        let view = shape.strided([stride, vertices], [index_stride, triangles]);
        return Ok(view.is_ok_and(|view| build(u, view, &config, tasks, run)));
    }
    let is_built = build(u, shape.view(), &config, tasks, run);
    // This comes last, so that bytes kept before it was added keep their meaning.
    if rarely(u, 3)? {
        let cuts = <[u8; 6]>::arbitrary(u)?;
        let count = u.int_in_range(0..=cuts.len())?;
        let mut parts = shape.parts(&cuts[..count]);
        let mesh = TriangleMesh::join(&mut parts).expect("sound meshes");
        build(u, mesh, &config, tasks, run);
    }
    Ok(is_built)
}

/// Builds a grid in several ways and queries it; returns false if none is built.
fn build(
    u: &mut Unstructured<'_>,
    mesh: TriangleMesh<'_>,
    config: &Config,
    tasks: u32,
    run: Loop,
) -> bool {
    let serial = |count: u32, task: &(dyn Fn(u32) + Sync)| (0..count).for_each(task);
    let honest = Control { tasks, run: &serial, progress: None };
    let caller = run.for_core();
    let odd = Control { tasks, run: &caller, progress: None };
    let Some((exact, mut scratch)) = sized(mesh, config, &honest) else { return false };

    // A loop that does not do its work is found out, or was not needed.
    if !run.is_right() {
        let mut index = Guarded::new(exact.index_bytes);
        let result = Grid::build_with(mesh, config, index.region(), scratch.region(), &odd);
        let is_told = matches!(result, Err(Error::InvalidParallelFor));
        let proof = result.and_then(|grid| prove(&grid));
        assert!(is_told || proof.is_ok(), "{run:?}: {proof:?}");
        assert!(index.around_is_intact() && scratch.around_is_intact());
    }

    // Build with one block too little, where the error tells the need; then with exactly enough.
    let mut small = Guarded::new(exact.index_bytes.saturating_sub(64));
    match Grid::build_with(mesh, config, small.region(), scratch.region(), &honest) {
        Err(Error::OutOfMemory { region: Region::Index, needed_bytes, .. }) => {
            assert!(needed_bytes >= exact.index_bytes as u64, "{needed_bytes} {exact:?}");
        }
        Ok(_) if !exact.is_exact => {}
        other => panic!("{other:?} in too little memory"),
    }
    assert!(small.around_is_intact() && scratch.around_is_intact());
    let mut index = Guarded::new(exact.index_bytes);
    let seen = Cell::new((0.0, 0_u32));
    let progress = |done: f32| {
        let (before, calls) = seen.get();
        assert!(before <= done && done <= 1.0, "{done} after {before}");
        seen.set((done, calls + 1));
        true
    };
    let watched = Control { progress: Some(&progress), ..honest };
    let blob = {
        let grid = Grid::build_with(mesh, config, index.region(), scratch.region(), &watched);
        grid.expect("enough memory").blob().to_vec()
    };
    let (done, calls) = seen.get();
    assert_eq!(done.to_bits(), 1.0_f32.to_bits(), "the last progress call is not 1");
    assert!(index.around_is_intact() && scratch.around_is_intact());

    // Stop at one of the calls: the build is cancelled, or complete already.
    if let Ok(at) = u.int_in_range(0..=calls) {
        let left = Cell::new(at);
        let progress = |_| left.replace(left.get().wrapping_sub(1)) != 0;
        let stopped = Control { progress: Some(&progress), ..honest };
        match Grid::build_with(mesh, config, index.region(), scratch.region(), &stopped) {
            Ok(grid) => assert!(at + 1 >= calls && grid.blob() == blob, "{at} of {calls}"),
            Err(error) => assert!(error == Error::Cancelled && at < calls, "{at} of {calls}"),
        }
        assert!(index.around_is_intact() && scratch.around_is_intact());
    }

    // Build without tasks, on the same memory with whatever is in it now: the bits must be the same.
    let alone = Grid::build(mesh, config, index.region(), scratch.region()).expect("enough memory");
    assert!(alone.blob() == blob, "the blob depends on the number of tasks");
    let copy = crate::copy::Copy::of(&blob);
    let grid = Grid::open(copy.bytes(), mesh).expect("what was built opens");
    prove(&grid).expect("what was built is valid");
    assert_eq!(grid.method(), config.method());
    let mut rays = rays::fixed_rays(grid.bounds(), 6);
    rays.extend(rays::chosen(u, &grid).unwrap_or_default());
    agrees(&grid, &rays);
    true
}

/// Returns the sizes of a build and its scratch; `None` if the build fails, or takes more memory than is built with.
fn sized(
    mesh: TriangleMesh<'_>,
    config: &Config,
    honest: &Control<'_>,
) -> Option<(Sizes, Guarded)> {
    let bound = Sizes::bound_parallel(mesh.triangle_count(), config, honest.tasks);
    let enough = match sizes_with(&mesh, config, &mut [], honest) {
        Ok(enough) => enough,
        Err(error) => {
            // If sizes fail, the build fails for the same reason.
            let (mut index, mut scratch) = (Guarded::new(4096), Guarded::new(4096));
            let result = Grid::build_with(mesh, config, index.region(), scratch.region(), honest);
            assert!(result.is_err_and(|again| is_same(error, again)), "{error:?}");
            assert!(index.around_is_intact() && scratch.around_is_intact());
            return None;
        }
    };
    if let Some(bound) = bound {
        assert!(enough.index_bytes <= bound.index_bytes, "{enough:?}, not {bound:?}");
        assert!(enough.scratch_bytes <= bound.scratch_bytes, "{enough:?}, not {bound:?}");
    }
    if enough.scratch_bytes > MOST_BYTES {
        return None;
    }
    let mut scratch = Guarded::new(enough.scratch_bytes);
    // The bound of a tree needs no look at the mesh; with several tasks the answer is a bound even if there
    // is scratch.
    let is_tree = config.method() == Method::Bvh;
    if is_tree && let Err(error) = sizes(&mesh, config, scratch.region()) {
        let is_odd =
            matches!(error, Error::IndexOutOfRange { .. } | Error::NonFiniteTriangle { .. });
        assert!(is_odd, "{error:?}");
        return None;
    }
    let exact = match sizes_with(&mesh, config, scratch.region(), honest) {
        Ok(exact) => exact,
        // An invalid configuration may only show in the full computation.
        Err(error) => {
            assert!(matches!(error, Error::InvalidConfig(_)), "{error:?}");
            return None;
        }
    };
    // With several tasks, the bound covers any mesh.
    let is_exact = !is_tree || honest.tasks < 2;
    assert!(exact.is_exact == is_exact && exact.index_bytes <= enough.index_bytes, "{exact:?}");
    assert!(exact.scratch_bytes <= enough.scratch_bytes, "{exact:?} {enough:?}");
    if exact.index_bytes > MOST_BYTES {
        return None;
    }
    Some((exact, scratch))
}

/// Returns true if the errors are equal, or if the second one, that of the build, is too little memory.
fn is_same(one: Error, other: Error) -> bool {
    one == other || matches!(other, Error::OutOfMemory { .. })
}
