//! Trees of meshes that mix sizes answer as brute force does, take bytes in proportion to the triangles, and
//! test only a small part of the mesh for each ray.

use hgrid_core::{Config, Counters, Grid, Method, Parameters, Quality, QueryOptions, Ray};
use hgrid_tests::meshes::{Mesh, ball, soup};
use hgrid_tests::oracle;
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;

/// The most tests of a ray in a fast tree, and in one of high quality.
const fn most(fast: u64, high: u64) -> [(Quality, u64); 2] {
    [(Quality::Fast, fast), (Quality::High, high)]
}

/// Sends rays between points of the mesh's box, to vertices and along the axes. Asserts that the answers are
/// those of brute force and that no ray tests more than `tests` triangles, by the quality of the tree.
fn agrees(mesh: &Mesh, tests: [(Quality, u64); 2]) {
    let view = mesh.view();
    assert_eq!(tests.len(), Quality::ALL.len());
    for (quality, tests) in tests {
        let owned = Owned::build(&view, &Parameters::Bvh { quality }.into()).unwrap();
        let grid = owned.open(&view).unwrap();
        prove(&grid).unwrap();
        let bytes = owned.bytes().len();
        assert!(bytes <= 16 * mesh.indices.len() + 640, "{bytes} bytes");
        let mut hits = 0;
        let longest = rays(mesh, &grid, 150)
            .into_iter()
            .map(|ray| {
                hits += usize::from(oracle::check(&grid, &ray));
                let mut counters = Counters::default();
                let _ = grid.intersect_with(&ray, &mut QueryOptions::counting(&mut counters));
                counters.primitive_tests
            })
            .max();
        assert!(longest <= Some(tests), "{quality:?}: {longest:?} tests, {tests} expected");
        assert!(hits > 20, "{hits}");
    }
}

fn rays(mesh: &Mesh, grid: &Grid<'_>, count: usize) -> Vec<Ray> {
    let (min, max) = grid.bounds();
    let mut random = Random(79);
    (0..count)
        .map(|i| {
            let mut point = |reach: f32| -> [f32; 3] {
                std::array::from_fn(|k| {
                    let half = (max[k] - min[k]) / 2.0;
                    min[k] + half + half * reach * (random.unit() * 2.0 - 1.0)
                })
            };
            let (origin, mut target) = (point([1.0, 3.0][i % 2]), point(1.0));
            if i % 3 != 0 {
                let triangle = mesh.indices[i * 7919 % mesh.indices.len()];
                target = mesh.positions[triangle[i % 3] as usize];
            }
            if i % 5 == 0 {
                // A ray along an axis through the target.
                let axis = i / 5 % 3;
                let mut origin = target;
                origin[axis] = min[axis] - 1.0;
                let mut direction = [0.0, -0.0, 0.0];
                direction[axis] = 1.0;
                return Ray::new(origin, direction);
            }
            Ray::new(origin, std::array::from_fn(|k| target[k] - origin[k]))
        })
        .collect()
}

#[test]
fn a_detailed_ball_in_a_coarse_room() {
    let mut mesh = ball(2, 0.0).scaled(1000.0);
    mesh.append(&ball(30, 1.0));
    agrees(&mesh, most(200, 150));
}

/// A ball, a crowd in it, and a crowd in that.
#[test]
fn crowds_in_crowds() {
    let mut mesh = ball(20, 1.0);
    for (count, size) in [(3000, 0.02), (3000, 1e-3)] {
        mesh.append(&soup(count, 0.03, 5).map(|p| p.map(|c| 0.3 + size * c)));
    }
    agrees(&mesh, most(200, 200));

    // Rays inside the crowds.
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
    let grid = owned.open(&view).unwrap();
    let mut random = Random(83);
    for size in [0.02, 1e-3] {
        let mut hits = 0;
        for _ in 0..300 {
            let mut point = || random.point().map(|c| 0.3 + size * c);
            let (origin, target) = (point(), point());
            let ray = Ray::new(origin, std::array::from_fn(|k| target[k] - origin[k]));
            hits += usize::from(oracle::check(&grid, &ray));
        }
        assert!(hits > 100, "{hits}");
    }
}

#[test]
fn long_thin_triangles() {
    let mut random = Random(19);
    let mut mesh = Mesh::default();
    for i in 0..1500 {
        let a = random.point();
        let mut b = random.point();
        if i % 2 == 0 {
            // Along an axis.
            let x = b[i % 3];
            b = a;
            b[i % 3] = x;
        }
        mesh.push([a, b, b.map(|c| c + 1e-3)]);
    }
    agrees(&mesh, most(1000, 1000));
}

#[test]
fn a_soup_of_all_sizes() {
    let mut mesh = Mesh::default();
    for exponent in 0..8_u8 {
        let size = 2.0 * 0.3_f32.powi(exponent.into());
        mesh.append(&soup(20 + 40 * usize::from(exponent), size, exponent.into()));
    }
    agrees(&mesh, most(150, 150));
}

#[test]
fn one_huge_triangle_among_many_tiny_ones() {
    for huge in [3.0, 100.0] {
        let mut mesh = soup(6000, 0.01, 13);
        mesh.push([[-huge, -huge, 0.0], [huge, -huge, 0.1], [0.0, 2.0 * huge, -0.1]]);
        agrees(&mesh, most(100, 60));
    }
}

/// All triangles but one have nearly the same centre. A fast tree may test all of them.
#[test]
fn all_triangles_in_one_place() {
    let mut mesh = soup(2000, 0.05, 29).scaled(1e-3);
    mesh.push([[100.0; 3], [100.0; 3], [100.0, 100.0, 99.999]]);
    agrees(&mesh, most(2001, 200));
}

/// Vertices that no triangle uses change only their count in the header.
#[test]
fn stray_vertices_far_away() {
    let mesh = ball(20, 1.0);
    let mut stray = mesh.clone();
    stray.positions.extend([[1e6; 3], [-1e9, 0.0, 3.0], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0]]);
    agrees(&stray, most(50, 50));
    let [alone, strays] = [&mesh, &stray].map(|mesh| {
        let view = mesh.view();
        let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
        let grid = owned.open(&view).unwrap();
        (grid.bounds(), grid.inspect().content_hash, owned.bytes().len())
    });
    assert_eq!(alone, strays);
}

#[test]
fn a_crowd_in_a_flat_scene() {
    for axis in 0..3 {
        let mut mesh = soup(2000, 0.05, 3);
        mesh.append(&soup(6000, 0.05, 5).scaled(2e-3));
        // Rays in the plane meet most of the crowd.
        agrees(
            &mesh.map(|mut p| {
                p[axis] = 0.0;
                p
            }),
            most(4000, 600),
        );
    }
}
