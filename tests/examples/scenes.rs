//! Shapes and instances: the pictures of their examples, compared by a hash of their bytes.

use std::path::Path;
use std::process::Command;

use hgrid_tests::artefact::run;
use hgrid_tests::copy::hash;
use tempfile::TempDir;

use crate::programs::{compile, example};

/// Compiles an example, runs it with a name for the picture, and returns its output and the picture.
fn draw(name: &str, sources: &[&str], dir: &Path) -> (String, Vec<u8>) {
    let sources: Vec<_> = sources.iter().map(|source| example(source)).collect();
    let (program, picture) = (dir.join(name), dir.join("picture.ppm"));
    let flags = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    compile(&sources, &flags, &program);
    let printed = run(Command::new(program).arg(&picture)).stdout;
    let picture = std::fs::read(picture).expect("the picture");
    (String::from_utf8(printed).expect("text"), picture)
}

#[test]
fn spheres_are_drawn() {
    let dir = TempDir::new().expect("a folder");
    let (printed, picture) = draw("spheres", &["spheres.c", "memory.c", "picture.c"], dir.path());
    assert!(printed.starts_with("4000 spheres in 39296 bytes, wrote "), "{printed}");
    assert_eq!(hash(&picture), SPHERES, "the picture has changed");
}

#[test]
fn instances_are_drawn() {
    let dir = TempDir::new().expect("a folder");
    let sources =
        ["instances.c", "grid.c", "knot.c", "memory.c", "picture.c", "progress.c", "threads.c"];
    let (printed, picture) = draw("instances", &sources, dir.path());
    assert!(printed.starts_with("2306 instances in "), "{printed}");
    assert!(printed.contains(", 500002 triangles in memory, "), "{printed}");
    assert_eq!(hash(&picture), INSTANCES, "the picture has changed");
}

/// The hashes of the pictures, the same on every machine.
pub(crate) const SPHERES: u64 = 0x1f32_09fc_3d25_e416;
pub(crate) const INSTANCES: u64 = 0x1462_8e74_492e_8cf8;
