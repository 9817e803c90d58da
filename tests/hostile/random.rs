//! Random bytes: a fuzzer's first minute, the same every time. A small part runs under Miri, which sees
//! faults in the C entry points that a fuzzer does not.

use hgrid_tests::hostile::{Reached, build_mesh, c_abi_reach};
use hgrid_tests::random::Random;
use hgrid_tests::rounds;

/// Runs a target on `rounds` random inputs, of which many lead to a grid.
fn run(mut target: impl FnMut(&[u8]) -> bool, rounds: usize, bytes: usize) {
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

/// Runs programs, and returns the numbers of calls that succeeded.
fn run_programs(rounds: usize, bytes: usize) -> Reached {
    let mut sum = Reached::default();
    let program = |bytes: &[u8]| {
        let reached = c_abi_reach(bytes);
        sum.add(&reached);
        reached.is_settled
    };
    run(program, rounds, bytes);
    sum
}

/// A mesh takes up to 1700 bytes: with fewer, nearly all calls of a program have none left, and are builds.
#[test]
fn calls_from_c() {
    let (rounds, bytes) = if cfg!(miri) { (60, 600) } else { (rounds(250), 2400) };
    let reached = run_programs(rounds, bytes);
    let Reached { built, created, opened, packed, joined, asked, batches, .. } = reached;
    // A program builds and asks about sixteen times as often as it does anything else.
    let least = [built, asked].into_iter().map(|count| count / 16);
    let least = least.chain([created, opened, packed, joined, batches]).min();
    assert!(cfg!(miri) || least > Some(rounds / 20), "{reached:?}");
}

/// A number of calls that is small enough for each run of Miri.
#[test]
fn a_few_calls_from_c() {
    run_programs(2, 300);
}

#[test]
fn meshes() {
    run(build_mesh, if cfg!(miri) { 2 } else { rounds(125) }, 400);
}
