//! Any bytes as a blob: a grid that `validate` accepts answers as brute force does, and is one that a build makes,
//! except for the division of lists (variable) and the shape of trees (bvh).

use arbitrary::Unstructured;
use hgrid_core::Method;

use super::ask::agrees;
use super::damage::Damaged;
use crate::copy::{CHECKSUM, Copy, MESH};
use crate::owned::{Owned, prove};

/// Runs the target; see the head of this file. Returns true if a grid was queried.
pub fn run(data: &[u8]) -> bool {
    let mut u = Unstructured::new(data);
    let Ok(damaged) = Damaged::new(&mut u) else { return false };
    let Ok(grid) = damaged.open() else { return false };
    if prove(&grid).is_err() {
        return false;
    }
    agrees(&grid, &Damaged::rays(&mut u, &grid));

    // Builds do not set the field for the mesh after the grid, and `validate` does not check why a list was
    // not subdivided (see core/src/variable/validate.rs), or that a tree is the one of a build.
    let rebuilt = Owned::build(grid.mesh(), &grid.config()).expect("it says how it was built");
    let without = |bytes: &[u8]| {
        let mut copy = Copy::of(bytes);
        [MESH, CHECKSUM].into_iter().for_each(|at| copy.set_word(at, 0));
        copy
    };
    let is_same = without(rebuilt.bytes()).bytes() == without(grid.blob()).bytes();
    let may_differ = matches!(grid.method(), Method::Variable | Method::Bvh);
    assert!(is_same || may_differ, "valid, but not what a build makes");
    true
}
