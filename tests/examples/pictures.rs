//! The ray tracer's pictures are the lab's, byte by byte, from every form of a file.

use std::fs;
use std::path::Path;

use hgrid_core::{Config, Hit, Method, TriangleMesh};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_lab::scene::Scene;
use hgrid_lab::shade::Shader;
use hgrid_tests::artefact::run;
use hgrid_tests::owned::Owned;
use tempfile::TempDir;

use crate::knot::KNOT;
use crate::programs::{raytracer, watched_raytracer};

const SIZE: u16 = 64;

/// Returns the lab's picture as a PPM file, and the number of rays that hit.
fn expected(scene: &Scene) -> (Vec<u8>, usize) {
    expected_at(scene, SIZE)
}

/// Returns the same for a picture of `size` pixels on each side.
fn expected_at(scene: &Scene, size: u16) -> (Vec<u8>, usize) {
    let mesh = TriangleMesh::new(&scene.positions, &scene.indices).expect("a sound mesh");
    let owned = Owned::build(&mesh, &Config::default()).expect("a sound mesh");
    let grid = owned.open(&mesh).expect("its own mesh");
    let bounds = scene.framed_bounds();
    let camera = Camera::framing(bounds, View::of(bounds, Up::Y), Up::Y);
    let shader = Shader::new(mesh, &camera);

    let mut hits = 0;
    let mut picture = format!("P6\n{size} {size}\n255\n").into_bytes();
    for (row, column) in (0..size).flat_map(|row| (0..size).map(move |column| (row, column))) {
        let ray = camera.ray(column, row, size);
        let hit = grid.intersect(&ray);
        hits += usize::from(hit.is_some());
        let mut color = [[0; 3]];
        shader.diffuse(&[ray], &[hit.unwrap_or(Hit::MISS)], &mut color);
        picture.extend(color[0]);
    }
    (picture, hits)
}

#[test]
fn the_built_in_scene_looks_as_in_the_lab() {
    let dir = TempDir::new().expect("a folder");
    let path = dir.path().join("knot.ppm");
    let mut raytracer = raytracer();
    let printed = run(raytracer.args(["--size", &SIZE.to_string(), "-o"]).arg(&path)).stdout;
    let printed = String::from_utf8(printed).expect("text");
    let (picture, hits) = expected(&Scene::load(KNOT).expect("a scene"));
    assert!(fs::read(&path).expect("the picture") == picture);
    let rays = usize::from(SIZE) * usize::from(SIZE);
    assert!(hits > rays / 4 && hits < rays / 2);
    assert!(printed.contains(&format!("hits           {hits} of {rays} rays\n")), "{printed}");
    for line in ["scratch bytes  ", "sizes          ", "build          ", "render         "] {
        assert!(printed.contains(line), "{line} is missing in {printed}");
    }
}

#[test]
fn every_method_draws_the_same_picture() {
    let dir = TempDir::new().expect("a folder");
    let path = dir.path().join("house.ply");
    fs::write(&path, ascii()).expect("a file");
    let path = path.to_str().expect("a name in UTF-8");
    draw_the_same_picture(&Scene::load(path).expect("a sound file"), &[path]);
}

#[test]
#[ignore = "slow: builds ten grids of 500 000 triangles"]
fn every_method_draws_the_same_picture_of_the_knot() {
    draw_the_same_picture(&Scene::load(KNOT).expect("a scene"), &[]);
}

/// Compares the pictures of a scene that the ray tracer takes by some words.
fn draw_the_same_picture(scene: &Scene, words: &[&str]) {
    let dir = TempDir::new().expect("a folder");
    let path = dir.path().join("picture.ppm");
    let mesh = TriangleMesh::new(&scene.positions, &scene.indices).expect("a sound mesh");
    let (picture, _) = expected(scene);
    for config in Method::ALL.iter().copied().map(Config::new) {
        let name = config.method().name();
        let mut raytracer = raytracer();
        raytracer.args(words).args(["--size", &SIZE.to_string(), "--method", name, "-o"]);
        raytracer.arg(&path);
        let printed = String::from_utf8(run(&mut raytracer).stdout).expect("text");
        assert!(fs::read(&path).expect("the picture") == picture, "{name}");

        let owned = Owned::build(&mesh, &config).expect("a sound mesh");
        let built = owned.open(&mesh).expect("its own mesh").config();
        let density = built.parameters.density();
        // A small mesh may lower the density.
        let is_small = mesh.triangle_count() < 1000;
        assert!(is_small || density == config.parameters.density(), "{name}: {density:?}");
        let cells = density.map_or(String::new(), |density| format!("density        {density}\n"));
        let bytes = format!("index bytes    {}\n", owned.bytes().len());
        for line in [format!("method         {name}\n"), cells, bytes] {
            assert!(printed.contains(&line), "{line} is missing in {printed}");
        }
    }
}

#[test]
fn density_is_passed_on() {
    let dir = TempDir::new().expect("a folder");
    for (words, lines) in [
        (["--density", "2.5", "fixed"], "method         fixed\ndensity        2.5\n"),
        (["--density", "3.5", "one-level"], "method         one-level\ndensity        3.5\n"),
    ] {
        let [option, value, method] = words;
        let mut raytracer = raytracer();
        raytracer.args([option, value, "--method", method, "--size", "8", "-o"]);
        let printed = run(raytracer.arg(dir.path().join("knot.ppm"))).stdout;
        let printed = String::from_utf8(printed).expect("text");
        assert!(printed.contains(lines), "{printed}");
    }
}

/// Tiles at the right and lower edges are cut off.
#[test]
fn a_picture_of_any_size_is_complete() {
    let dir = TempDir::new().expect("a folder");
    let path = dir.path().join("house.ply");
    fs::write(&path, ascii()).expect("a file");
    let scene = Scene::load(path.to_str().expect("a name in UTF-8")).expect("a sound file");
    for size in [1, 7, 9, 30] {
        let output = dir.path().join("picture.ppm");
        run(watched_raytracer().arg(&path).args(["--size", &size.to_string(), "-o"]).arg(&output));
        assert!(fs::read(output).expect("the picture") == expected_at(&scene, size).0, "{size}");
    }
}

/// The vertices of a house without a floor: two gable walls, two side walls, a roof of two quads.
const VERTICES: [[f32; 3]; 10] = [
    [0.0, 0.0, 0.0],
    [2.0, 0.0, 0.0],
    [2.0, 0.0, 3.0],
    [0.0, 0.0, 3.0],
    [0.0, 1.5, 0.0],
    [2.0, 1.5, 0.0],
    [2.0, 1.5, 3.0],
    [0.0, 1.5, 3.0],
    [1.0, 2.25, 0.0],
    [1.0, 2.25, 3.0],
];

/// The faces of the house: pentagons, quads, and a triangle that is also a part of the first pentagon.
const FACES: [&[u8]; 7] = [
    &[0, 1, 5, 8, 4],
    &[3, 2, 6, 9, 7],
    &[0, 3, 7, 4],
    &[1, 2, 6, 5],
    &[4, 7, 9, 8],
    &[5, 6, 9, 8],
    &[0, 4, 8],
];

/// Returns the house as text, faces before vertices, with a comment and an element that the loader skips.
pub(crate) fn ascii() -> Vec<u8> {
    let mut text = String::from(
        "ply\r\nformat ascii 1.0\r\ncomment made by hand\r\nelement face 7\r\n\
         property list uint8 int32 vertex_index\r\nproperty uchar red\r\n\
         element edge 2\r\nproperty list uchar float weights\r\nproperty int id\r\n\
         element vertex 10\r\nproperty double z\r\nproperty float y\r\nproperty float x\r\n\
         end_header\r\n",
    );
    for face in FACES {
        text += &format!("{} ", face.len());
        face.iter().for_each(|corner| text += &format!("{corner} "));
        text += "200\r\n";
    }
    text += "2 0.5 0.25 7\r\n0 8\r\n";
    VERTICES.iter().for_each(|[x, y, z]| text += &format!("{z} {y} {x}\r\n"));
    text.into_bytes()
}

/// Returns the house in binary form, with normals as doubles, lists counted by `int` and material names as lists.
pub(crate) fn binary() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nobj_info made by hand\n\
        element vertex 10\nproperty float x\nproperty float32 y\nproperty float z\n\
        property double nx\nproperty short confidence\n\
        element face 7\nproperty list uchar ushort texture\nproperty float area\n\
        property list int uint vertex_indices\nend_header\n"
        .to_vec();
    for vertex in VERTICES {
        bytes.extend(vertex.iter().flat_map(|c| c.to_le_bytes()));
        bytes.extend(1.0f64.to_le_bytes());
        bytes.extend((-3i16).to_le_bytes());
    }
    for face in FACES {
        bytes.extend([2, 1, 0, 2, 0]);
        bytes.extend(0.5f32.to_le_bytes());
        bytes.extend((face.len() as i32).to_le_bytes());
        bytes.extend(face.iter().flat_map(|&corner| u32::from(corner).to_le_bytes()));
    }
    bytes
}

/// Renders a file with the ray tracer that has sanitizers.
fn render(dir: &Path, name: &str, bytes: &[u8]) -> Vec<u8> {
    let (input, output) = (dir.join(name), dir.join("picture.ppm"));
    fs::write(&input, bytes).expect("a file");
    let size = SIZE.to_string();
    run(watched_raytracer().arg(&input).arg("-o").arg(&output).args(["--size", &size]));
    fs::read(output).expect("the picture")
}

#[test]
fn every_form_of_a_file_gives_the_picture() {
    let dir = TempDir::new().expect("a folder");
    let fan = |face: &[u8]| -> Vec<[u32; 3]> {
        face[1..].windows(2).map(|edge| [face[0], edge[0], edge[1]].map(u32::from)).collect()
    };
    let indices = FACES.iter().flat_map(|face| fan(face)).collect();
    let scene = Scene { positions: VERTICES.to_vec(), indices, ..Scene::default() };
    let (picture, hits) = expected(&scene);
    assert!(hits > 500);
    assert!(render(dir.path(), "ascii.ply", &ascii()) == picture);
    assert!(render(dir.path(), "binary.ply", &binary()) == picture);
}

#[test]
fn a_flat_and_an_empty_scene_have_pictures() {
    let dir = TempDir::new().expect("a folder");
    let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                  property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
                  end_header\n0 0 0\n9 0 0\n9 0 9\n0 0 9\n";
    let flat = format!("{header}4 0 1 2 3\n");
    let empty = header.replace("face 1", "face 0").replace("vertex 4", "vertex 0");
    for (name, text) in [("flat.ply", flat.as_str()), ("empty.ply", empty.as_str())] {
        let drawn = render(dir.path(), name, text.as_bytes());
        let path = dir.path().join(name);
        let scene = Scene::load(path.to_str().expect("a name in UTF-8")).expect("a sound file");
        assert!(drawn == expected(&scene).0, "{name}");
    }
}
