//! Random bytes: a fuzzer's first minute, the same every time. A small part runs under Miri, which sees
//! faults in the C entry points that a fuzzer does not.

use hgrid_tests::hostile::{build_mesh, c_abi};
use hgrid_tests::random::Random;
use hgrid_tests::rounds;

/// Runs a target on `rounds` random inputs, of which many lead to a grid.
fn run(target: fn(&[u8]) -> bool, rounds: usize, bytes: usize) {
    let mut grids = 0;
    for round in 0..rounds as u64 {
        let mut random = Random(round);
        let bytes: Vec<_> = (0..bytes / 8).flat_map(|_| random.bits().to_le_bytes()).collect();
        // Shown if the test fails.
        println!("round {round}");
        grids += usize::from(target(&bytes));
    }
    assert!(grids > rounds / 8, "{grids} of {rounds}");
}

#[test]
fn calls_from_c() {
    run(c_abi, if cfg!(miri) { 60 } else { rounds(250) }, 600);
}

/// A number of calls that is small enough for each run of Miri.
#[test]
fn a_few_calls_from_c() {
    run(c_abi, 3, 300);
}

#[test]
fn meshes() {
    run(build_mesh, if cfg!(miri) { 2 } else { rounds(125) }, 400);
}
