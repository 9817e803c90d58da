//! Two processes draw from one mapped file what one process draws from its memory.

use std::fs;
use std::path::Path;
use std::process::Command;

use hgrid_tests::artefact::run;
use hgrid_tests::tools::skip;
use tempfile::TempDir;

use crate::pictures::ascii;
use crate::programs::{compile, drawing, printed, raytracer, refusal, watched_mapped};

/// Returns the ray tracer's picture with shadows.
fn expected(dir: &Path, words: &[&str]) -> Vec<u8> {
    let path = dir.join("expected.ppm");
    run(raytracer().args(words).args(["--shadows", "-o"]).arg(&path));
    fs::read(path).expect("the picture")
}

#[test]
fn halves_from_two_processes_are_the_picture_of_one() {
    let dir = TempDir::new().expect("a folder");
    let program = dir.path().join("mapped");
    compile(&drawing(&["mapped.c"]), &[], &program);
    let [grid, picture] = ["grid.blob", "picture.ppm"].map(|name| dir.path().join(name));
    let said = printed(Command::new(&program).arg(&grid).arg("-o").arg(&picture));
    assert!(said.contains("and a mesh of 500000 triangles\n"), "{said}");
    assert!(said.contains("processes: 2\n"), "{said}");
    assert!(said.ends_with("picture of one process: the same, byte by byte\n"), "{said}");
    assert!(fs::read(picture).expect("the picture") == expected(dir.path(), &["--size", "512"]));
    assert!(!grid.exists(), "the grid's file is left");
}

/// A picture of one row has two parts, one of them empty.
#[test]
fn parts_of_any_size_make_a_picture() {
    let dir = TempDir::new().expect("a folder");
    let scene = dir.path().join("house.ply");
    fs::write(&scene, ascii()).expect("a file");
    let [grid, picture] = ["grid.blob", "picture.ppm"].map(|name| dir.path().join(name));
    for size in ["1", "2", "31"] {
        let mut mapped = watched_mapped();
        run(mapped.arg(&grid).arg(&scene).args(["--size", size, "-o"]).arg(&picture));
        let scene = scene.to_str().expect("a name in UTF-8");
        let expected = expected(dir.path(), &[scene, "--size", size]);
        assert!(fs::read(&picture).expect("the picture") == expected, "{size}");
        assert!(!grid.exists());
    }
}

#[test]
fn it_says_what_is_wrong_and_leaves_no_file() {
    let dir = TempDir::new().expect("a folder");
    fs::write(dir.path().join("precious"), "mine").expect("a file");
    fs::write(dir.path().join("house.ply"), ascii()).expect("a file");
    for (words, message) in [
        (&[][..], "where may the grid go? mapped GRID_FILE, a file that does not exist yet"),
        (&["precious", "house.ply"], "precious: exists already: name a file that may be made"),
        (&["no/such/folder/g", "house.ply"], "no/such/folder/g: cannot be made: No such file"),
        (&["g", "house.ply", "again.ply"], "and then again.ply?"),
        (&["g", "house.ply", "-o", "house.ply"], "house.ply is read and would be overwritten"),
        (&["mapped.ppm"], "mapped.ppm is read and would be overwritten: name another file"),
        (&["g", "none.ply"], "none.ply: cannot be opened"),
        (&["g", "house.ply", "-o", "no/picture.ppm"], "no/picture.ppm: cannot be written"),
        (&["g", "--size", "0"], "--size is a number from 1 to 16384, not `0`"),
        (&["g", "--size"], "--size needs a value"),
        (&["--quick"], "unknown option --quick: mapped --help names all of them"),
    ] {
        let said = refusal(watched_mapped().current_dir(dir.path()).args(words));
        assert!(said.contains(message), "{words:?}: {said}");
        assert!(!dir.path().join("g").exists(), "{words:?}");
    }
    assert_eq!(fs::read_to_string(dir.path().join("precious")).as_deref().ok(), Some("mine"));
    assert!(printed(watched_mapped().arg("--help")).contains("GRID_FILE must not exist"));
}

/// If a process cannot write its part, the program fails with an error.
#[test]
fn a_full_disk_is_noticed() {
    if !Path::new("/dev/full").exists() {
        skip("this system has no /dev/full");
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let grid = dir.path().join("grid.blob");
    let said = refusal(watched_mapped().arg(&grid).args(["--size", "8", "-o", "/dev/full"]));
    assert!(said.contains("/dev/full: cannot be written to the end"), "{said}");
    assert!(!grid.exists());
}
