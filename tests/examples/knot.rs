//! The built-in scene of the ray tracer is the same as the lab's.

use std::process::Command;

use hgrid_lab::scene::Scene;
use hgrid_tests::artefact::{root, run};
use tempfile::TempDir;

use crate::programs::{compile, example};

/// The lab's name for the scene that is built into the ray tracer.
pub(crate) const KNOT: &str = "procedural:knot:500K";

#[test]
fn the_knot_has_the_bits_of_the_labs() {
    let dir = TempDir::new().expect("a folder");
    let program = dir.path().join("knot_bits");
    let driver = root().join("tests/examples/knot_bits.c");
    compile(&[driver, example("knot.c"), example("memory.c")], &[], &program);
    let written = run(&mut Command::new(program)).stdout;

    let scene = Scene::load(KNOT).expect("a scene");
    let floats = scene.positions.iter().flatten().flat_map(|c| c.to_ne_bytes());
    let indices = scene.indices.iter().flatten().flat_map(|i| i.to_ne_bytes());
    assert!(written.iter().copied().eq(floats.chain(indices)));
}
