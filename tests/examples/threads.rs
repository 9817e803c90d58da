//! The picture does not depend on the number of threads that draw it.

use std::fs;
use std::path::Path;
use std::process::Command;

use hgrid_tests::artefact::{output_watching_threads, run};
use hgrid_tests::tools::{is_installed, skip};
use tempfile::TempDir;

use crate::pictures::ascii;
use crate::programs::{raytracer, raytracer_with};

/// Returns the file that a command writes with a number of threads.
fn drawn(mut program: Command, threads: u32, options: &[&str], dir: &Path) -> Vec<u8> {
    let path = dir.join("picture.ppm");
    program.args(["--threads", &threads.to_string(), "-o"]).arg(&path).args(options);
    run(&mut program);
    fs::read(path).expect("the picture")
}

#[test]
fn any_number_of_threads_draws_the_same_picture() {
    let dir = TempDir::new().expect("a folder");
    for options in [
        // None of these sizes is a multiple of a tile.
        &["--size", "100", "--shadows", "--ao", "3", "--method", "bvh"][..],
        &["--size", "61", "--heat", "tests", "--shadows"],
        &["--size", "99", "--heat", "steps", "--ao", "2"],
        &["--size", "3"],
    ] {
        let one = drawn(raytracer(), 1, options, dir.path());
        for threads in [2, 5] {
            let many = drawn(raytracer(), threads, options, dir.path());
            assert!(many == one, "{threads} threads: {options:?}");
        }
    }
}

#[test]
fn its_threads_do_not_race() {
    if !is_installed("tsan") {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let scene = dir.path().join("house.ply");
    fs::write(&scene, ascii()).expect("a file");
    let program = raytracer_with("threads", &["-g", "-fsanitize=thread"]);
    let mut raytracer = Command::new(program);
    raytracer.arg(&scene).args(["--size", "90", "--shadows", "--ao", "2", "--threads", "4"]);
    raytracer.args(["--method", "bvh", "--progress", "-o"]).arg(dir.path().join("picture.ppm"));
    let Some(output) = output_watching_threads(&mut raytracer) else {
        skip("ThreadSanitizer cannot run on this kernel");
        return;
    };
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !said.contains("ThreadSanitizer"), "{said}");
}
