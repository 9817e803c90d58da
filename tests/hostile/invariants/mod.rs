//! Invariants of every blob that a build writes, broken one by one: opening or `validate` refuses the blob,
//! at an offset that belongs to the damage, and queries end in any case.
//!
//! The tests find the words by the format's description alone.

mod bvh;
mod forged;
mod hashed;
mod header;
mod recursive;
mod sections;
mod variable;

use std::ops::Range;

use hgrid_core::{Error, Grid, Ray};
use hgrid_tests::copy::Copy;
use hgrid_tests::hostile::{Seed, agrees, ends, fixed_rays};
use hgrid_tests::meshes::Mesh;
use hgrid_tests::owned::prove;

/// A row of a table: a name of the damage, the offsets where the error may point, and the change.
type Case<'c> = (&'c str, Range<usize>, Box<dyn Fn(&mut Copy) + 'c>);

/// Returns a row of a table.
fn case<'c>(what: &'c str, at: Range<usize>, change: impl Fn(&mut Copy) + 'c) -> Case<'c> {
    (what, at, Box::new(change))
}

/// Changes a blob, corrects its checksum, and asserts that it is refused at the right offset.
fn refused(seed: &Seed, cases: &[Case<'_>]) {
    let view = seed.mesh.view();
    for (what, at, change) in cases {
        let mut copy = Copy::of(&seed.blob);
        change(&mut copy);
        assert!(copy.bytes() != seed.blob, "{what}: nothing has changed");
        copy.sign();
        let result = Grid::open(copy.bytes(), view).and_then(|grid| {
            ends(&grid, &fixed_rays(grid.bounds(), 12));
            prove(&grid)
        });
        let method = seed.config.method();
        let is_there = matches!(result, Err(Error::Corrupt { offset })
            if usize::try_from(offset).is_ok_and(|offset| at.contains(&offset)));
        assert!(is_there, "{method:?}: {what}: {result:?}, expected at {at:?}");
    }
}

/// Sends fixed rays, and one to the middle of every seventh triangle of the mesh; most of the latter must hit.
fn answers_right(grid: &Grid<'_>, mesh: &Mesh) {
    agrees(grid, &fixed_rays(grid.bounds(), 60));
    let start = [3.0, -1.5, 2.0];
    let towards = |triangle: &[u32; 3]| {
        let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
        let middle = |k: usize| corners.iter().map(|corner| corner[k] / 3.0).sum::<f32>();
        Ray::new(start, std::array::from_fn(|k| middle(k) - start[k]))
    };
    let rays: Vec<_> = mesh.indices.iter().step_by(7).map(towards).collect();
    let hits = agrees(grid, &rays);
    assert!(2 * hits > rays.len(), "{hits} of {}", rays.len());
}
