//! No ray leaves a closed mesh without a hit: from inside, every direction hits, above all those aimed at
//! edges and vertices.

use hgrid_core::{Grid, Ray};
use hgrid_lab::scene::Scene;
use hgrid_tests::meshes::{Mesh, ball};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::{methods, rounds};

/// Aims rays from `origin`, which the closed mesh surrounds, at random edges and vertices. Returns the number
/// of rays that hit nothing.
pub(crate) fn leaks(
    grid: &Grid<'_>,
    mesh: &Mesh,
    origin: [f32; 3],
    rays: usize,
    seed: u64,
) -> usize {
    let mut random = Random(seed);
    (0..rays)
        .filter(|i| {
            let triangle = mesh.indices[random.below(mesh.indices.len())];
            let [a, b] =
                [random.below(3), random.below(3)].map(|k| mesh.positions[triangle[k] as usize]);
            // Aim every second ray exactly at a vertex.
            let along = if i % 2 == 0 { 0.0 } else { random.unit() };
            let target: [f32; 3] = std::array::from_fn(|k| a[k] + (b[k] - a[k]) * along);
            let direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
            let ray = Ray::new(origin, direction);
            let hit = grid.intersect(&ray);
            assert_eq!(grid.occluded(&ray), hit.is_some(), "{ray:?}");
            hit.is_none()
        })
        .count()
}

fn assert_watertight(mesh: &Mesh, origin: [f32; 3], rays: usize) {
    let view = mesh.view();
    for config in [1.0, 4.0, 32.0].into_iter().flat_map(methods::configs_with) {
        let owned = Owned::build(&view, &config).unwrap();
        assert_eq!(leaks(&owned.open(&view).unwrap(), mesh, origin, rays, 11), 0, "{config:?}");
    }
}

#[test]
fn cubes_and_balls_have_no_leaks_at_any_scale_or_place() {
    cubes_and_balls_have_no_leaks(&[1.0, 1e-30], &[30_000.0]);
}

#[test]
#[ignore = "slow: a hundred grids"]
fn cubes_and_balls_have_no_leaks_at_more_scales_and_places() {
    cubes_and_balls_have_no_leaks(&[1e-20, 3e7, 1e30], &[1.0, 100.0]);
}

fn cubes_and_balls_have_no_leaks(scales: &[f32], shifts: &[f32]) {
    for roundness in [0.0, 1.0] {
        let mesh = ball(24, roundness);
        for &scale in scales {
            let origin = [0.11, -0.07, 0.3].map(|c| c * scale);
            assert_watertight(&mesh.scaled(scale), origin, rounds(1250));
        }
        for &shift in shifts {
            let mesh = mesh.map(|p| p.map(|c| c + shift));
            assert_watertight(&mesh, [0.11 + shift, shift - 0.07, 0.3 + shift], rounds(1250));
        }
    }
}

#[test]
fn a_cube_of_two_triangles_a_side_has_no_leaks() {
    let mesh = ball(1, 0.0);
    assert_eq!(mesh.indices.len(), 12);
    assert_watertight(&mesh, [0.0; 3], rounds(1250));
    assert_watertight(&mesh, [0.5, -0.25, 0.75], rounds(1250));
}

#[test]
fn a_surface_like_a_scan_has_no_leaks() {
    let scene = Scene::load("procedural:knot:20000").unwrap();
    let mesh = Mesh { positions: scene.positions, indices: scene.indices };
    let view = mesh.view();
    for config in methods::configs() {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        let origin = inside(&grid).expect("a closed surface has an inside");
        assert_eq!(leaks(&grid, &mesh, origin, rounds(12_500), 5), 0, "{config:?}");
    }
}

/// Returns a point inside a closed surface: halfway between the points where a line enters and leaves it.
pub(crate) fn inside(grid: &Grid<'_>) -> Option<[f32; 3]> {
    let (min, max) = grid.bounds();
    let mut random = Random(17);
    (0..1000).find_map(|_| {
        let mut point =
            || -> [f32; 3] { std::array::from_fn(|k| min[k] + (max[k] - min[k]) * random.unit()) };
        let (target, mut origin) = (point(), point());
        origin[2] = max[2] + (max[2] - min[2]);
        let direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
        let enters = grid.intersect(&Ray::new(origin, direction))?;
        let behind = Ray { t_min: enters.t + 1e-4, ..Ray::new(origin, direction) };
        let leaves = grid.intersect(&behind)?;
        let t = (enters.t + leaves.t) / 2.0;
        (leaves.t - enters.t > 0.01).then(|| std::array::from_fn(|k| origin[k] + direction[k] * t))
    })
}
