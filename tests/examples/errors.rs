//! The ray tracer reports errors and exits with status 1; no file makes it crash.

use std::fs;
use std::path::Path;

use hgrid_tests::tools::skip;
use tempfile::TempDir;

use crate::pictures::{ascii, binary};
use crate::programs::{attempt, refusal, watched_raytracer};

/// Returns the ray tracer's error message about a file.
fn refusal_of(dir: &Path, contents: &[u8]) -> String {
    let path = dir.join("bad.ply");
    fs::write(&path, contents).expect("a file");
    refusal(watched_raytracer().arg(path).args(["--size", "4", "-o"]).arg(dir.join("none.ppm")))
}

fn replaced(from: &str, to: &str) -> Vec<u8> {
    let text = String::from_utf8(ascii()).expect("text");
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1).into_bytes()
}

#[test]
fn bad_arguments_are_refused() {
    // One of the cases begins to draw, and needs a place for its picture.
    let dir = TempDir::new().expect("a folder");
    for (words, message) in [
        (&["--size"][..], "--size needs a value"),
        (&["-o"], "-o needs a value"),
        (&["--size", "0"], "--size is a number from 1 to 16384, not `0`"),
        (&["--size", "-7"], "not `-7`"),
        (&["--size", "16385"], "not `16385`"),
        (&["--size", "12x"], "not `12x`"),
        (&["--size", "99999999999999999999"], "not `99999999999999999999`"),
        (&["--method"], "--method needs a value"),
        (&["--method", "octree"], "fixed, variable or recursive, not `octree`"),
        (&["--density"], "--density needs a value"),
        (&["--density", "0"], "--density is a number above 0, not `0`"),
        (&["--density", "-1"], "not `-1`"),
        (&["--density", "nan"], "not `nan`"),
        (&["--density", "4cells"], "not `4cells`"),
        (&["--method", "fixed", "--density", "inf"], "invalid density: above 0"),
        (&["--method", "brick"], "variable or recursive, not `brick`"),
        (&["--method", "bvh", "--density", "1"], "bvh has no density: leave out --density"),
        (&["--threads"], "--threads needs a value"),
        (&["--threads", "0"], "--threads is a number from 1 to 256, not `0`"),
        (&["--threads", "two"], "not `two`"),
        (&["--threads", ""], "not ``"),
        (&["--ao"], "--ao needs a value"),
        (&["--ao", "0"], "--ao is a number from 1 to 4096, not `0`"),
        (&["--ao", "5000"], "not `5000`"),
        (&["--heat"], "--heat needs a value"),
        (&["--heat", "triangles"], "--heat is tests or steps, not `triangles`"),
        (&["--fast"], "unknown option --fast: raytracer --help names all of them"),
        (&["-h"], "unknown option -h: raytracer --help names all of them"),
        (&["a.ply", "b.ply"], "one scene at a time: a.ply or b.ply?"),
        (&["a.ply", "-o", "a.ply"], "a.ply is read and would be overwritten: name another file"),
        (&["no/such/file.ply"], "no/such/file.ply: cannot be opened: No such file"),
        (
            &["--size", "4", "-o", "no/such/folder/a.ppm"],
            "no/such/folder/a.ppm: cannot be written: No such file",
        ),
        #[cfg(target_os = "linux")]
        (&["/tmp"], "/tmp: cannot be read: Is a directory"),
    ] {
        let said = refusal(watched_raytracer().current_dir(dir.path()).args(words));
        assert!(said.contains(message), "{words:?}: {said}");
    }
}

#[test]
fn a_full_disk_is_noticed() {
    if Path::new("/dev/full").exists() {
        let dir = TempDir::new().expect("a folder");
        let path = dir.path().join("house.ply");
        fs::write(&path, ascii()).expect("a file");
        let said = refusal(watched_raytracer().arg(path).args(["-o", "/dev/full"]));
        assert!(said.contains("/dev/full: cannot be written to the end"), "{said}");
    } else {
        skip("this system has no /dev/full");
    }
}

#[test]
fn bad_files_are_refused_with_the_reason() {
    let dir = TempDir::new().expect("a folder");
    let big_endian = "the format is `binary_big_endian`: convert it";
    for (contents, message) in [
        (Vec::new(), "not a PLY file: it is empty"),
        (b"solid house\n".to_vec(), "not a PLY file"),
        (b"ply\nformat ascii 1.0\n".to_vec(), "no end_header line"),
        (replaced("format ascii", "format binary_big_endian"), big_endian),
        (replaced("element face 7", "element face many"), "cannot read `element face many`"),
        (replaced("property int id", "property integer id"), "unknown type in `property integer"),
        (replaced("float y", "float w"), "the vertices have no x, y, z"),
        (replaced("element face 7", "element side 7"), "no triangles: it needs an element `face`"),
        (replaced("5 0 1 5 8 4", "5 0 1 5 8 door"), "has no number, in face 0 of 7"),
        (replaced("5 0 1 5 8 4", "-5 0 1 5 8 4"), "a list of length -5 in face 0"),
    ] {
        let said = refusal_of(dir.path(), &contents);
        assert!(said.contains(message), "{message}: {said}");
    }
    assert!(!dir.path().join("none.ppm").exists());
}

/// The reader passes these numbers on; the library finds the triangle that has them.
#[test]
fn vertices_that_do_not_exist_are_named_by_their_triangle() {
    let dir = TempDir::new().expect("a folder");
    for number in ["10", "-1", "4294967295", "5000000000", "nan"] {
        let contents = replaced("4 0 3 7 4 ", &format!("4 0 3 7 {number} "));
        let said = refusal_of(dir.path(), &contents);
        // The pentagons before it give three triangles each.
        assert!(
            said.contains("triangle 7: a vertex number is vertex_count or more"),
            "{number}: {said}"
        );
    }
}

/// Cuts files off at every `step`th byte, each of which must be refused.
fn truncated_files_are_refused(step: usize) {
    let dir = TempDir::new().expect("a folder");
    for whole in [ascii(), binary()] {
        // A text whose last number is cut short may still be valid.
        for end in (0..whole.len() - 4).step_by(step) {
            let said = refusal_of(dir.path(), &whole[..end]);
            assert!(said.contains("bad.ply: "), "{end}: {said}");
        }
    }
}

#[test]
fn truncated_files_are_refused_in_many_places() {
    truncated_files_are_refused(29);
}

#[test]
#[ignore = "slow: starts a program with sanitizers hundreds of times"]
fn truncated_files_are_refused_wherever_they_end() {
    truncated_files_are_refused(3);
}

#[test]
fn damaged_files_never_crash_it() {
    no_damage_crashes_it(19);
}

#[test]
#[ignore = "slow: starts a program with sanitizers hundreds of times"]
fn more_damaged_files_never_crash_it() {
    no_damage_crashes_it(5);
}

/// Flips a bit of every `step`th byte of files.
fn no_damage_crashes_it(step: usize) {
    let dir = TempDir::new().expect("a folder");
    let path = dir.path().join("damaged.ply");
    for whole in [ascii(), binary()] {
        for at in (0..whole.len()).step_by(step) {
            let mut damaged = whole.clone();
            damaged[at] ^= 1 << (at % 8);
            fs::write(&path, damaged).expect("a file");
            let output = dir.path().join("picture.ppm");
            attempt(watched_raytracer().arg(&path).args(["--size", "4", "-o"]).arg(output));
        }
    }
}
