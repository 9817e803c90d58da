//! Meshes of odd shapes answer as brute force does and stay within their memory bounds.

use hgrid_core::{Block, Config, Grid, Parameters, Ray, Sizes};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle, rounds};

/// Compares rays through and around the mesh, from inside and outside its box, at its vertices and beside them.
/// At least `least` rays must hit.
fn agrees(mesh: &Mesh, least: usize) {
    let view = mesh.view();
    let build = |config: Config| {
        let owned = Owned::build(&view, &config).unwrap();
        let bound = Sizes::bound(view.triangle_count(), &config).unwrap();
        assert!(owned.bytes().len() <= bound.index_bytes);
        prove(&owned.open(&view).unwrap()).unwrap();
        owned
    };
    let owned: Vec<Owned> =
        [0.3, 4.0, 40.0].into_iter().flat_map(methods::configs_with).map(build).collect();
    let grids: Vec<Grid<'_>> = owned.iter().map(|owned| owned.open(&view).unwrap()).collect();
    let (min, max) = grids[0].bounds();
    let (mut random, mut hits) = (Random(43), 0);
    for i in 0..rounds(13) {
        let mut point = |reach: f32| -> [f32; 3] {
            std::array::from_fn(|k| {
                let half = max[k] / 2.0 - min[k] / 2.0;
                min[k] + half + half * reach * (random.unit() * 2.0 - 1.0)
            })
        };
        let (origin, mut target) = (point(if i % 2 == 0 { 1.0 } else { 3.0 }), point(1.0));
        if i % 3 == 0 && !mesh.positions.is_empty() {
            target = mesh.positions[i * 7 % mesh.positions.len()];
        }
        let direction = std::array::from_fn(|k| target[k] - origin[k]);
        hits += usize::from(oracle::check_all(&grids, &Ray::new(origin, direction)));
    }
    assert!(hits >= least, "{hits} hits, {least} expected");
}

#[test]
fn nothing() {
    agrees(&Mesh::default(), 0);
    let view_of_nothing = Mesh { positions: vec![[1.0; 3]], indices: Vec::new() };
    agrees(&view_of_nothing, 0);
    let mut only_nan = Mesh::default();
    only_nan.push([[f32::NAN; 3]; 3]);
    agrees(&only_nan, 0);
}

#[test]
fn one_and_a_few_triangles() {
    agrees(&one_triangle(), 3);
    for count in 2..10 {
        agrees(&soup(count, 0.5, count as u64), 1);
    }
}

/// Returns a mesh of `count` equal triangles.
fn stack(count: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for _ in 0..count {
        mesh.push([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]);
    }
    mesh
}

#[test]
#[ignore = "slow: half a million hits for each of many grids"]
fn many_identical_triangles() {
    agrees(&stack(2000), 3);
}

#[test]
fn identical_triangles_are_answered_by_the_first() {
    agrees(&stack(200), 3);
    let mesh = stack(2000);
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::default()).unwrap();
    let hit = owned.open(&view).unwrap().intersect(&Ray::new([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]));
    assert_eq!(hit.map(|hit| hit.primitive), Some(0));
}

#[test]
fn flat_scenes() {
    flat_scenes_at(&[0.0]);
}

#[test]
#[ignore = "slow: rays in the plane of everything need exact arithmetic most of the time"]
fn flat_scenes_at_all_heights() {
    flat_scenes_at(&[1.0, -1e10, 1e-30]);
}

fn flat_scenes_at(heights: &[f32]) {
    for axis in 0..3 {
        for &height in heights {
            let flat = soup(300, 0.1, 3).map(|mut p| {
                p[axis] = height;
                p
            });
            // At -1e10 the box is far wider than the mesh, so that few rays meet it.
            agrees(&flat, if height.abs() < 1e10 { 2 } else { 0 });
        }
        let line = soup(300, 0.1, 3).map(|p| {
            let mut q = [0.5; 3];
            q[axis] = p[axis];
            q
        });
        agrees(&line, 2);
    }
    agrees(&soup(100, 0.1, 3).map(|_| [1.0, 2.0, 3.0]), 0);
    agrees(&soup(100, 0.1, 3).map(|_| [0.0; 3]), 0);
}

#[test]
fn tiny_and_huge_scenes() {
    for scale in [1e-38, 1e-30, 1e-10, 1e10, 1e30, 1e36] {
        agrees(&soup(300, 0.1, 3).scaled(scale), 1);
        agrees(&ball(6, 1.0).scaled(scale), 3);
    }
}

#[test]
fn scenes_far_from_the_origin() {
    // At the last place the soup shrinks to a point and the ball to a line.
    for (shift, least) in [(1e2, [3, 6]), (1e4, [2, 6]), (1e6, [3, 6]), (1e10, [0, 1])] {
        agrees(&soup(300, 0.1, 3).map(|p| p.map(|c| c + shift)), least[0]);
        agrees(&ball(6, 1.0).map(|[x, y, z]| [x + shift, y, z - shift]), least[1]);
    }
}

#[test]
fn degenerate_triangles_are_never_hit() {
    let mut mesh = ball(4, 1.0);
    let sound = u32::try_from(mesh.indices.len()).unwrap();
    for i in 0..sound {
        mesh.indices.push([i, i, i + 1]);
        mesh.indices.push([i, i, i]);
    }
    mesh.indices.retain(|t| t.iter().all(|&i| (i as usize) < mesh.positions.len()));
    mesh.push([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
    agrees(&mesh, 6);
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::default()).unwrap();
    let grid = owned.open(&view).unwrap();
    let (mut random, mut hits) = (Random(3), 0);
    for _ in 0..2000 {
        let hit = grid.intersect(&Ray::new(random.point().map(|c| c * 2.0), random.point()));
        assert!(hit.is_none_or(|hit| hit.primitive < sound));
        hits += usize::from(hit.is_some());
    }
    assert!(hits > 100, "{hits}");
}

#[test]
fn one_huge_triangle_among_many_tiny_ones() {
    let mut mesh = soup(3000, 0.01, 13);
    mesh.push([[-100.0, -100.0, 0.0], [100.0, -100.0, 0.1], [0.0, 200.0, -0.1]]);
    agrees(&mesh, 3);
}

#[test]
fn long_thin_triangles_and_triangles_that_span_the_scene() {
    let mut random = Random(19);
    let mut needles = Mesh::default();
    for _ in 0..500 {
        let (a, b) = (random.point(), random.point());
        needles.push([a, b, b.map(|c| c + 1e-3)]);
    }
    agrees(&needles, 1);
    agrees(&soup(500, 2.0, 19), 6);
}

#[test]
fn dense_rows_and_a_crowded_corner() {
    agrees(&soup(5000, 0.02, 29), 1);
    let mut crowded = soup(2000, 0.001, 29).scaled(0.01);
    crowded.append(&ball(2, 0.0));
    agrees(&crowded, 6);
}

/// A grid that would need more references than allowed is built with a lower density and reports it: building
/// with the reported configuration gives the same grid, and so does the scratch that the grid reports.
#[test]
fn a_mesh_of_spanning_triangles_lowers_the_density() {
    let mesh = soup(300, 2.0, 23);
    let view = mesh.view();
    let depths = 1..=hgrid_core::MAX_DEPTH;
    let recursive = depths.map(|depth| Parameters::Recursive { density: 64.0, depth }.into());
    for config in methods::configs_with(64.0).chain(recursive) {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        prove(&grid).unwrap();
        if let Some(density) = grid.config().parameters.density() {
            let ratio = 64.0 / density;
            assert!(
                ratio.log2().fract() == 0.0,
                "the density was divided by {ratio}, no power of two"
            );
            // A deep recursive grid has few cells at the root, however many triangles there are.
            let is_deep =
                matches!(config.parameters, Parameters::Recursive { depth, .. } if depth > 1);
            assert!(ratio > 1.0 || is_deep, "{config:?}");
        }
        let rebuilt = Owned::build(&view, &grid.config()).unwrap();
        assert_eq!(rebuilt.bytes(), owned.bytes(), "{config:?}");
        let reported = usize::try_from(grid.scratch_bytes()).unwrap();
        let [mut index, mut scratch] =
            [owned.bytes().len(), reported].map(|bytes| vec![Block::ZERO; Block::count_for(bytes)]);
        let scratch = &mut Block::bytes_mut(&mut scratch)[..reported];
        let again = Grid::build(view, &config, Block::bytes_mut(&mut index), scratch).unwrap();
        assert_eq!(again.blob(), owned.bytes(), "{config:?}");
        let mut random = Random(71);
        let mut hits = 0;
        for _ in 0..100 {
            let ray = Ray::new(random.point().map(|c| c * 4.0), random.point());
            hits += usize::from(oracle::check(&grid, &ray));
        }
        assert!(hits > 10 && hits < 90, "{hits}");
    }
}
