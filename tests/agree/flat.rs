//! Rays that start on flat meshes, or next to them. The `t` of a hit is off by a part of its triangle there, however
//! close the hit is, and boxes of triangles in a plane through zero are the thinnest that there are.

use hgrid_core::{
    Coherence, Config, Grid, Hit, Instance, Object, Parameters, Quality, QueryOptions, Ray, RayF64,
    Scene, SceneHit, SceneOptions, Strided, StridedMut, Verdict,
};
use hgrid_tests::meshes::Mesh;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::Built;
use hgrid_tests::{methods, oracle};

/// Returns triangles that overlap in a plane through zero, across an axis, and perhaps one beside it.
fn flat(random: &mut Random, axis: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for _ in 0..1 + random.below(12) {
        let corner = |_: usize| {
            let mut corner = random.point().map(|c| (c * 24.0).round() / 8.0);
            corner[axis] = 0.0;
            corner
        };
        mesh.push(std::array::from_fn(corner));
    }
    if random.below(3) == 0 {
        mesh.push([random.point(), random.point(), random.point()]);
    }
    mesh
}

/// Returns a ray that starts in the plane or next to it.
fn ray(random: &mut Random, axis: usize) -> Ray {
    let mut origin = random.point();
    origin[axis] = [0.0, 1e-16, 1e-12, 1e-9, -1e-12][random.below(5)];
    let mut direction = random.point();
    // Some run nearly along the plane.
    direction[axis] *= [-1.0, -1e-6, -1e-9, 1.0][random.below(4)];
    let t_min = [0.0, -1.0][random.below(2)];
    Ray { t_min, ..Ray::new(origin, direction) }
}

/// Checks that a filter that rejects all hits is asked about each of them, the nearest first.
fn check_filter(grid: &Grid<'_>, ray: &Ray, all: &[Hit]) {
    let mut seen = Vec::new();
    let mut filter = |_: usize, hit: &Hit| {
        seen.push(*hit);
        Verdict::Reject
    };
    let options = &mut QueryOptions { filter: Some(&mut filter), ..QueryOptions::default() };
    assert_eq!(grid.intersect_with(ray, options), None);
    assert_eq!(seen, all, "{:?} {ray:?}", grid.method());
}

#[test]
fn every_query_agrees_with_brute_force_next_to_flat_meshes() {
    agrees_next_to_flat_meshes(75);
}

#[test]
#[ignore = "slow: brute force over many meshes"]
fn every_query_agrees_with_brute_force_next_to_more_flat_meshes() {
    agrees_next_to_flat_meshes(300);
}

fn agrees_next_to_flat_meshes(rounds: usize) {
    let high = Config::from(Parameters::Bvh { quality: Quality::High });
    let mut random = Random(17);
    let mut hits = 0;
    for round in 0..rounds {
        let axis = round % 3;
        let mesh = flat(&mut random, axis);
        let mesh = mesh.view();
        let configs = methods::configs().chain([high]);
        let built: Vec<_> = configs.map(|config| Owned::build(&mesh, &config).unwrap()).collect();
        let grids: Vec<_> = built.iter().map(|built| built.open(&mesh).unwrap()).collect();
        let rays: Vec<_> = (0..24).map(|_| ray(&mut random, axis)).collect();
        for ray in &rays {
            let all = oracle::all_hits(&grids[0], ray, hgrid_core::Cull::None);
            hits += all.len();
            oracle::check_all(&grids, ray);
            for grid in &grids {
                check_filter(grid, ray, &all);
            }
        }
        for grid in &grids {
            let mut found = vec![Hit::MISS; rays.len()];
            let answers = &mut StridedMut::new(&mut found);
            grid.intersect_n(&Strided::new(&rays), answers, Coherence::Coherent).unwrap();
            for (ray, found) in rays.iter().zip(&found) {
                let expected = oracle::brute_force(grid, ray).unwrap_or(Hit::MISS);
                assert_eq!(*found, expected, "{:?} {ray:?}", grid.method());
            }
        }
    }
    assert!(3 * hits > 50 * rounds, "{hits} hits");
}

#[test]
fn the_first_of_the_instances_at_one_place_is_hit() {
    let mut random = Random(23);
    let mut hits = 0;
    for _ in 0..200 {
        let triangle = [random.point(), random.point(), random.point()];
        let mut mesh = Mesh::default();
        mesh.push(triangle);
        let mesh = mesh.view();
        let built = Owned::build(&mesh, &Config::default()).unwrap();
        let grid = built.open(&mesh).unwrap();
        let objects = [Object::Grid(&grid)];
        let instances: Vec<_> = (0..9)
            .map(|number| {
                let x = if number % 4 == 0 { 0.0 } else { 3.0 * f64::from(number) };
                Instance { translation: [x, 0.0, 0.0], ..Instance::new(0) }
            })
            .collect();
        let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
        let scene: Scene<'_> = built.open(&objects).unwrap();
        // Start just before a point of the triangle, as a ray from its surface does.
        let rays: Vec<_> = (0..64)
            .map(|_| {
                let (u, v) = (0.1 + 0.4 * random.unit(), 0.1 + 0.4 * random.unit());
                let [a, b, c] = triangle;
                let (direction, back) = (random.point(), [1e-7, 1e-9, 1e-12][random.below(3)]);
                let at = |k: usize| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]);
                Ray::new([0, 1, 2].map(|k| at(k) - back * direction[k]), direction)
            })
            .collect();
        let wide: Vec<_> = rays.iter().map(RayF64::from).collect();
        let mut found = vec![SceneHit::MISS; rays.len()];
        let answers = &mut StridedMut::new(&mut found);
        let options = &mut SceneOptions::default();
        scene
            .intersect_n_with(&Strided::new(&wide), answers, Coherence::Coherent, options)
            .unwrap();
        for ((ray, wide), found) in rays.iter().zip(&wide).zip(&found) {
            let alone = scene.intersect(wide).unwrap_or(SceneHit::MISS);
            assert_eq!(*found, alone, "{ray:?}");
            // The first instance is where the grid is. Others may be closer, but for those at the same place.
            if let Some(own) = grid.intersect(ray) {
                assert!(alone.t <= own.t, "{ray:?}");
                let is_own = alone.t >= own.t;
                assert!(!is_own || alone.path[0] == 0, "{ray:?}");
                hits += usize::from(is_own);
            }
        }
    }
    assert!(hits > 3000, "{hits} hits");
}
