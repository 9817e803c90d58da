//! Replays the faults that fuzzing found, and the inputs that it found worth keeping.
//!
//! The inputs worth keeping are in an archive for each target, corpus/TARGET.tar. The faults are files whose
//! names say what they did.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use hgrid_tests::hostile::{Reached, TARGETS, c_abi_reach};
use tar::Archive;

/// Returns the path of a file or folder beside this source.
fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("hostile").join(name)
}

/// Returns the names and bytes of a target's archive, in its order.
fn kept(target: &str) -> Vec<(String, Vec<u8>)> {
    let path = path("corpus").join(target).with_extension("tar");
    let mut archive = Archive::new(fs::File::open(path).expect("an archive for each target"));
    let entries = archive.entries().expect("an archive");
    let read = entries.map(|entry| {
        let mut entry = entry.expect("a whole archive");
        let name = entry.path().expect("a name").display().to_string();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).expect("a whole archive");
        (name, bytes)
    });
    read.collect()
}

/// Returns the names and bytes of the faults found in a target, if any.
fn found(target: &str) -> Vec<(String, Vec<u8>)> {
    let Ok(entries) = fs::read_dir(path("regressions").join(target)) else { return Vec::new() };
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| (file.display().to_string(), fs::read(file).unwrap())).collect()
}

/// Runs a target on inputs; returns the number of those that lead to a grid.
fn run_all(run: fn(&[u8]) -> bool, inputs: &[(String, Vec<u8>)]) -> usize {
    let leads = |(name, bytes): &&(String, Vec<u8>)| {
        // Shown if the test fails.
        println!("{name}");
        run(bytes)
    };
    inputs.iter().filter(leads).count()
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn what_fuzzing_kept_does_no_harm() {
    for target in TARGETS {
        println!("{}", target.name);
        let inputs = kept(target.name);
        let grids = run_all(target.run, &inputs);
        assert!(inputs.len() > 200 && 4 * grids > inputs.len(), "{grids} of {}", inputs.len());
    }
}

/// Programs that have no bytes left after a few calls reach little, and libFuzzer likes short inputs.
#[test]
#[cfg_attr(miri, ignore = "hours")]
fn the_programs_that_fuzzing_kept_reach_every_kind_of_call() {
    let mut sum = Reached::default();
    for (_, program) in kept("c_abi") {
        sum.add(&c_abi_reach(&program));
    }
    let Reached { built, created, opened, packed, joined, asked, batches, .. } = sum;
    let least = [built, opened, packed, joined, asked, batches].into_iter().min();
    assert!(created > 0 && least > Some(8), "{sum:?}");
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn what_fuzzing_found_does_no_harm_any_more() {
    let counts = TARGETS.map(|target| run_all(target.run, &found(target.name)));
    assert!(counts.iter().sum::<usize>() > 1, "{counts:?}");
}
