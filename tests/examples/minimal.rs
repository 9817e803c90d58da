//! The smallest example, and the Makefile that builds both.

use std::fs;
use std::process::Command;

use hgrid_tests::artefact::{is_installed, root, run, target_dir};
use tempfile::TempDir;

use crate::programs::{compile, example};

const PRINTED: &str = "built a grid of 384 bytes\n\
                       hit triangle 0 at t = 1, u = 0.25, v = 0.5\n";

#[test]
fn minimal_prints_its_hit() {
    let dir = TempDir::new().expect("a folder");
    let program = dir.path().join("minimal");
    compile(&[example("minimal.c")], &[], &program);
    let output = run(&mut Command::new(program));
    assert_eq!(String::from_utf8(output.stdout).as_deref(), Ok(PRINTED));
}

#[test]
fn the_makefile_builds_and_runs_both() {
    if !is_installed("make") {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let mut make = Command::new("make");
    make.arg("-C").arg(root().join("c_examples")).arg("run");
    // Not what the outer make or cargo of a test run may have set.
    for name in ["MAKEFLAGS", "MAKELEVEL", "CFLAGS", "RUSTFLAGS"] {
        make.env_remove(name);
    }
    make.env("CARGO_TARGET_DIR", target_dir())
        .env("BUILD", dir.path())
        .env("CARGO_NET_OFFLINE", "true");
    let printed = String::from_utf8(run(&mut make).stdout).expect("text");
    assert!(printed.contains(PRINTED), "{printed}");
    assert!(printed.contains("triangles      500000\n"), "{printed}");
    let picture = fs::read(dir.path().join("raytracer.ppm")).expect("the picture");
    assert!(picture.starts_with(b"P6\n1024 1024\n255\n"));
}
