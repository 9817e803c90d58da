//! The smallest example, and the Makefile that builds all of them.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::Command;

use hgrid_tests::artefact::{root, run, target_dir};
use hgrid_tests::copy::hash;
use hgrid_tests::tools::{command, is_installed};
use tempfile::TempDir;

use crate::hpp::HELLO;
use crate::ppm::Picture;
use crate::programs::{compile, example, raytracer};
use crate::scenes::{INSTANCES, SPHERES};

/// The output; the bytes are those of a tree, the method of a NULL configuration.
const PRINTED: &str = "built a grid of 320 bytes\n\
                       hit triangle 0 at t = 1, u = 0.25, v = 0.5\n";

/// The hash of the ray tracer's picture with soft light, by the Makefile.
const RAYTRACER: u64 = 0xc5db_19f9_72ad_7dd3;
/// The hash of its picture of the steps of rays.
const STEPS: u64 = 0xb20d_9dcc_5cdf_c365;

#[test]
fn minimal_prints_its_hit() {
    let dir = TempDir::new().expect("a folder");
    let program = dir.path().join("minimal");
    compile(&[example("minimal.c")], &[], &program);
    let output = run(&mut Command::new(program));
    assert_eq!(String::from_utf8(output.stdout).as_deref(), Ok(PRINTED));
}

/// Returns a command that makes targets in a folder.
fn make(targets: &[&OsStr], dir: &Path) -> Command {
    let mut make = command("make");
    make.arg("-C").arg(root().join("c_examples")).args(targets);
    // Remove variables that an outer make or cargo may have set. With other flags, cargo would replace the library
    // that other tests link.
    for name in ["MAKEFLAGS", "MAKELEVEL", "CFLAGS", "RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS"] {
        make.env_remove(name);
    }
    make.env("CARGO_TARGET_DIR", target_dir()).env("BUILD", dir).env("CARGO_NET_OFFLINE", "true");
    make
}

#[test]
fn the_makefile_builds_an_example() {
    if is_installed("make") {
        let dir = TempDir::new().expect("a folder");
        let program = dir.path().join("minimal");
        run(&mut make(&[program.as_os_str()], dir.path()));
        let printed = run(&mut Command::new(program)).stdout;
        assert_eq!(String::from_utf8(printed).as_deref(), Ok(PRINTED));
    }
}

#[test]
#[ignore = "slow: compiles all examples and draws large pictures"]
fn the_makefile_builds_and_runs_all() {
    if !is_installed("make") {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let mut make = make(&["run".as_ref()], dir.path());
    let [has_cpp, has_mpi] = ["c++", "mpi"].map(is_installed);
    for (has, name) in [(has_cpp, "CXX"), (has_mpi, "MPICC")] {
        if !has {
            make.env(name, "");
        }
    }
    let printed = String::from_utf8(run(&mut make).stdout).expect("text");
    assert!(printed.contains(PRINTED), "{printed}");
    assert!(printed.contains("triangles      500000\n"), "{printed}");
    assert_eq!(printed.contains(HELLO), has_cpp, "{printed}");
    let path = |name: &str| dir.path().join(name).with_extension("ppm");
    let bytes = |name: &str| fs::read(path(name)).expect("a picture");
    for (name, size) in
        [("raytracer", (512, 512)), ("steps", (1024, 1024 + 26 * 4)), ("mapped", (512, 512))]
    {
        let picture = Picture::load(&path(name));
        assert_eq!((picture.width, picture.height), size, "{name}");
    }
    // The Makefile promises the same bits on every machine.
    for (name, expected) in
        [("raytracer", RAYTRACER), ("steps", STEPS), ("spheres", SPHERES), ("instances", INSTANCES)]
    {
        let found = hash(&bytes(name));
        assert_eq!(found, expected, "{name}.ppm has changed: {found:#x}");
    }
    // Two processes, and the ranks of MPI, draw what the ray tracer draws alone.
    run(raytracer().args(["--size", "512", "--shadows", "-o"]).arg(path("alone")));
    assert!(bytes("mapped") == bytes("alone"), "mapped.ppm is another picture");
    assert_eq!(dir.path().join("mpi").exists(), has_mpi);
    assert_eq!(path("mpi").exists(), has_mpi);
    assert!(!has_mpi || bytes("mpi") == bytes("alone"), "mpi.ppm is another picture");
}
