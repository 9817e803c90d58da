//! Outputs that take nothing or only a part, and pipes.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use hgrid_core::{Block, Config, Grid, Instance, Object, Scene, TriangleMesh};

use super::Folder;

fn full() -> io::Result<File> {
    File::options().write(true).open("/dev/full")
}

fn error(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn help_that_finds_no_room_is_an_error() {
    let folder = Folder::new("help").unwrap();
    for words in ["--help", "help render", "--version"] {
        let output = folder.command(words).stdout(full().unwrap()).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{words}");
        let said = error(&output);
        assert!(said.starts_with("error: cannot write to standard output: "), "{words}: {said}");
    }
    let output = folder.command("--help").output().unwrap();
    assert!(output.status.success() && output.stdout.starts_with(b"Ray tracing"));
    // Errors of words have a status of their own, even if nobody can read them.
    let output = folder.command("render --no").stderr(full().unwrap()).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn pictures_are_written_although_nobody_reads_their_number() {
    let folder = Folder::new("number").unwrap();
    let words = "animate a.obj --size 16 --frames 1 -o frames";
    let output = folder.command(words).stderr(full().unwrap()).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(folder.0.join("frames/frame-00000.png").exists());
}

/// A pipe that has a name gets the whole picture, and one that nobody reads to its end is an error.
#[test]
fn a_pipe_is_written_once() {
    let folder = Folder::new("pipe").unwrap();
    let made = Command::new("mkfifo").current_dir(&folder.0).arg("pipe").status().unwrap();
    assert!(made.success());
    let start = |words: &str| {
        folder.command(words).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let mut child = start("a.obj --size 16 -o pipe");
    let picture = fs::read(folder.0.join("pipe")).unwrap();
    if picture.is_empty() {
        child.kill().unwrap();
    }
    assert!(child.wait().unwrap().success() && picture.ends_with(b"IEND\xaeB`\x82"));
    // The blob is larger than what a pipe holds.
    let child = start("pack procedural:knot:20K -o pipe");
    drop(File::open(folder.0.join("pipe")).unwrap());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(error(&output).starts_with("error: cannot write `pipe`: "), "{}", error(&output));
}

#[test]
fn figures_that_cannot_be_written_are_not_measured() {
    let folder = Folder::new("figures").unwrap();
    fs::create_dir_all(folder.0.join("charts/figure2.json")).unwrap();
    let words = "figures a.obj --size 9 --repeat 1 --methods fixed --densities 4 -o charts";
    let output = folder.command(words).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let expected = "error: cannot write `charts/figure2.json`: it is a folder: name a file in it";
    assert!(error(&output).starts_with(expected), "{}", error(&output));
    assert!(!folder.0.join("charts/figure1.svg").exists());
}

#[test]
fn figures_overwrite_no_mesh() {
    let folder = Folder::new("mesh").unwrap();
    fs::write(folder.0.join("figure2.json"), "{ \"asset\": { \"version\": \"2.0\" } }").unwrap();
    for words in ["figure2.json", "a.obj --figure1 ./figure2.json"] {
        let output = folder.command(&format!("figures {words} -o .")).output().unwrap();
        let expected = "figure2.json` would be overwritten by its own figure: name another file";
        assert!(!output.status.success() && error(&output).contains(expected), "{output:?}");
    }
}

/// Densities that make the same grids would draw a figure without charts.
#[test]
fn figures_need_grids_that_differ() {
    let folder = Folder::new("same").unwrap();
    let figures = |densities: &str| {
        let words =
            format!("figures a.obj --size 9 --repeat 1 --methods fixed --densities {densities}");
        error(&folder.command(&words).output().unwrap())
    };
    let said = figures("4,4.001");
    assert!(
        said.contains("because all densities make the same grid: name a larger scene"),
        "{said}"
    );
    let said = figures("4,8,4");
    assert!(said.contains("--densities has 4 twice: name each once"), "{said}");
}

/// Writes a packed scene of two instances of a triangle.
fn pack_scene(path: &Path) -> Result<(), Box<dyn core::error::Error>> {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    let config = Config::default();
    let mut memory = [(); 4].map(|()| vec![Block::ZERO; 64]);
    let [index, scratch, scene, file] = memory.each_mut().map(|blocks| Block::bytes_mut(blocks));
    let grid = Grid::build(mesh, &config, index, scratch)?;
    let instances = [Instance::new(0), Instance::new(0)];
    let objects = [Object::Grid(&grid)];
    let scene = Scene::build(&instances, &objects, &config, scene, scratch)?;
    Ok(fs::write(path, scene.pack(file)?)?)
}

#[test]
fn a_packed_scene_takes_no_mesh() {
    let folder = Folder::new("scene").unwrap();
    pack_scene(&folder.0.join("b.hgrid")).unwrap();
    let output = folder.command("validate b.hgrid").output().unwrap();
    assert!(output.status.success(), "{}", error(&output));
    let output = folder.command("validate b.hgrid --mesh a.obj").output().unwrap();
    let expected = "error: `b.hgrid` is a packed scene, with its meshes in it: leave out --mesh\n";
    assert_eq!((output.status.code(), error(&output).as_str()), (Some(1), expected));
}
