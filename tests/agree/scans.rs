//! Real scans: the picture that brute force makes, and no holes along any edge.

use std::collections::HashMap;
use std::thread;

use hgrid_core::{Config, Grid, Ray};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_lab::scene::{Bounds, Scene};
use hgrid_tests::meshes::Mesh;
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle, rounds, scans};

use crate::watertight;

/// Pixels along a side; brute force tests every triangle for every pixel.
const SIZE: u16 = 64;

/// Pixels along a side of the pictures that every `cargo test` makes.
const SMALL: u16 = 24;

fn agrees_on_a_picture(mesh: &Mesh, frame: Bounds, size: u16) {
    let view = mesh.view();
    let owned: Vec<Owned> =
        methods::configs().map(|config| Owned::build(&view, &config).unwrap()).collect();
    let grids: Vec<Grid<'_>> = owned.iter().map(|owned| owned.open(&view).unwrap()).collect();
    grids.iter().for_each(|grid| prove(grid).unwrap());
    let camera = Camera::framing(frame, View::Front, Up::Y);
    let hits = |rows: std::ops::Range<u16>| {
        let pixels = rows.flat_map(|row| (0..size).map(move |column| (column, row)));
        let rays = pixels.map(|(column, row)| camera.ray(column, row, size));
        rays.filter(|ray| {
            let expected = oracle::brute_force(&grids[0], ray);
            for grid in &grids {
                assert_eq!(grid.intersect(ray), expected, "{:?} {ray:?}", grid.method());
                assert_eq!(grid.occluded(ray), expected.is_some(), "{:?} {ray:?}", grid.method());
            }
            expected.is_some()
        })
        .count()
    };
    let (upper, lower) = thread::scope(|scope| {
        let upper = scope.spawn(|| hits(0..size / 2));
        (hits(size / 2..size), upper.join().unwrap())
    });
    let pixels = usize::from(size) * usize::from(size);
    assert!(20 * (upper + lower) > pixels, "the picture shows the scan: {upper} + {lower} pixels");
}

/// Aims rays at edges whose two triangles face the eye from the same side and not too flatly, and at vertices
/// with only such edges. The surface covers these points on all sides, so each ray must hit there or before.
fn has_no_holes(mesh: &Mesh, rays: usize) {
    let view = mesh.view();
    let owned: Vec<Owned> =
        methods::configs().map(|config| Owned::build(&view, &config).unwrap()).collect();
    let grids: Vec<Grid<'_>> = owned.iter().map(|owned| owned.open(&view).unwrap()).collect();
    let camera = Camera::framing(grids[0].bounds(), View::Front, Up::Y);
    let eye = camera.ray(0, 0, 1).origin;
    let edges = covered_edges(mesh, eye);
    let vertices = covered_vertices(mesh, &edges);
    assert!(!edges.is_empty() && !vertices.is_empty());
    let mut random = Random(23);
    let mut holes = 0;
    for i in 0..rays {
        let [a, b] = edges[random.below(edges.len())].map(|vertex| mesh.positions[vertex as usize]);
        // Stay farther from vertices than rounding moves the ray: beyond a vertex it may pass by the surface.
        let along = 0.001 + 0.998 * random.unit();
        let mut target: [f32; 3] = std::array::from_fn(|k| a[k] + (b[k] - a[k]) * along);
        if random.below(4) == 0 {
            target = mesh.positions[vertices[random.below(vertices.len())] as usize];
        }
        // Start at the eye or at a point between.
        let scale = [1.0, 0.5, 0.1][random.below(3)];
        let direction: [f32; 3] = std::array::from_fn(|k| (target[k] - eye[k]) * scale);
        let origin = std::array::from_fn(|k| target[k] - direction[k]);
        let hit = grids[i % grids.len()].intersect(&Ray::new(origin, direction));
        // Rounding may carry a grazing ray a little behind its target, but not to the scan's other side.
        holes += usize::from(!hit.is_some_and(|hit| hit.t <= 1.0 + 2e-3));
    }
    assert_eq!(holes, 0, "holes among {rays} rays at {} edges", edges.len());
}

fn covered_edges(mesh: &Mesh, eye: [f32; 3]) -> Vec<[u32; 2]> {
    let facing = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].map(f64::from));
        let sub = |p: [f64; 3], q: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| p[k] - q[k]) };
        let (e, f, d) = (sub(b, a), sub(c, a), sub(a, eye.map(f64::from)));
        let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
        let dot = |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| p[k] * q[k]).sum::<f64>();
        dot(n, d) / (dot(n, n) * dot(d, d)).sqrt()
    };
    // An edge counts if exactly two triangles share it and run along it in opposite directions.
    let mut sides: HashMap<[u32; 2], Vec<(bool, f64)>> = HashMap::new();
    for triangle in &mesh.indices {
        let cosine = facing(triangle);
        for k in 0..3 {
            let [a, b] = [triangle[k], triangle[(k + 1) % 3]];
            sides.entry([a.min(b), a.max(b)]).or_default().push((a < b, cosine));
        }
    }
    let mut edges: Vec<[u32; 2]> = sides
        .into_iter()
        .filter_map(|(edge, sides)| match sides.as_slice() {
            [(p, s), (q, t)] if p != q && s * t > 0.0 && s.abs().min(t.abs()) > 0.05 => Some(edge),
            _ => None,
        })
        .collect();
    edges.sort_unstable();
    edges
}

fn covered_vertices(mesh: &Mesh, edges: &[[u32; 2]]) -> Vec<u32> {
    let mut balance = vec![0_i32; mesh.positions.len()];
    edges.iter().flatten().for_each(|&vertex| balance[vertex as usize] += 1);
    let is_met = |vertex: &u32| balance[*vertex as usize] > 0;
    let met: Vec<u32> = (0..u32::try_from(balance.len()).unwrap()).filter(is_met).collect();
    mesh.indices.iter().flatten().for_each(|&vertex| balance[vertex as usize] -= 1);
    met.into_iter().filter(|&vertex| balance[vertex as usize] == 0).collect()
}

/// Returns true if triangles run along every edge once in each direction.
fn is_closed(mesh: &Mesh) -> bool {
    let mut passes: HashMap<[u32; 2], i32> = HashMap::new();
    for triangle in &mesh.indices {
        for k in 0..3 {
            *passes.entry([triangle[k], triangle[(k + 1) % 3]]).or_default() += 1;
        }
    }
    passes.iter().all(|(&[a, b], &count)| count == 1 && passes.get(&[b, a]) == Some(&1))
}

/// Asserts that rays from inside a closed scan, aimed at its vertices and edges, all hit something.
fn has_no_leaks(mesh: &Mesh, rays: usize) {
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::default()).unwrap();
    let grid = owned.open(&view).unwrap();
    let origin = watertight::inside(&grid).expect("a closed surface has an inside");
    assert_eq!(watertight::leaks(&grid, mesh, origin, rays, 29), 0);
}

fn scan(name: &str) {
    let Some(mesh) = scans::load(name) else { return };
    agrees_on_a_picture(&mesh, framed(&mesh), SIZE);
    has_no_holes(&mesh, 1_000_000);
    if is_closed(&mesh) {
        has_no_leaks(&mesh, 1_000_000);
    } else {
        println!("{name} is not closed: rays aimed at its edges from outside only");
    }
}

fn framed(mesh: &Mesh) -> Bounds {
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::default()).unwrap();
    owned.open(&view).unwrap().bounds()
}

fn knot(name: &str, size: u16, rays: usize) {
    let Scene { positions, indices, .. } = Scene::load(name).unwrap();
    let mesh = Mesh { positions, indices };
    agrees_on_a_picture(&mesh, framed(&mesh), size);
    has_no_holes(&mesh, rays);
}

#[test]
fn a_procedural_surface() {
    knot("procedural:knot:20000", SMALL, rounds(12_500));
}

#[test]
#[ignore = "slow: brute force over 50 000 triangles"]
fn larger_procedural_surfaces() {
    knot("procedural:knot:20000", SIZE, 50_000);
    knot("procedural:knot:50000", SIZE, 200_000);
}

#[test]
fn a_small_object_in_a_large_scene() {
    a_small_object(SMALL);
}

#[test]
#[ignore = "slow: brute force over 20 000 triangles"]
fn a_small_object_in_a_larger_picture() {
    a_small_object(SIZE);
}

fn a_small_object(size: u16) {
    let scene = Scene::load("procedural:stage:20000").unwrap();
    let frame = scene.framed_bounds();
    agrees_on_a_picture(&Mesh { positions: scene.positions, indices: scene.indices }, frame, size);
}

#[test]
#[ignore = "slow: brute force over a scan"]
fn bunny() {
    scan("bunny");
}

#[test]
#[ignore = "slow: brute force over a scan"]
fn dragon() {
    scan("dragon");
}

#[test]
#[ignore = "slow: brute force over a scan"]
fn buddha() {
    scan("buddha");
}

#[test]
#[ignore = "slow: brute force over a scan"]
fn sponza() {
    scan("sponza");
}
