//! The time of a ray.
//!
//! Analysis: coherent rays are those of a picture, row by row, so the ray before has loaded the cells and
//! triangles into the cache; incoherent rays go from one random point of the box to another, so on a mesh
//! larger than the cache each one waits for memory. The difference between the two is that wait.

#![expect(clippy::expect_used, reason = "a bench that cannot start can only panic")]

use core::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use hgrid_core::{Block, Config, Grid, Ray, TriangleMesh, sizes};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_lab::scene::Scene;

/// Rays along a side of the picture; the incoherent rays are as many as its pixels.
const SIZE: u16 = 128;

fn coherent(scene: &Scene) -> Vec<Ray> {
    let camera = Camera::framing(scene.framed_bounds(), View::Front, Up::Y);
    let pixels = (0..SIZE).flat_map(|row| (0..SIZE).map(move |column| (column, row)));
    pixels.map(|(column, row)| camera.ray(column, row, SIZE)).collect()
}

fn incoherent(scene: &Scene) -> Vec<Ray> {
    let (min, max) = scene.framed_bounds();
    // The fractional parts of multiples of irrational numbers: spread evenly, in no order.
    let point = |i: u16, shift: f32| -> [f32; 3] {
        let i = f32::from(i);
        let part = [0.754_877_7, 0.569_840_3, 0.381_966].map(|a: f32| (i * a + shift).fract());
        core::array::from_fn(|k| min[k] + (max[k] - min[k]) * part[k])
    };
    (0..SIZE * SIZE)
        .map(|i| {
            let (origin, target) = (point(i, 0.0), point(i, 0.37));
            Ray::new(origin, core::array::from_fn(|k| target[k] - origin[k]))
        })
        .collect()
}

fn query(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("query");
    group.sample_size(10);
    for triangles in [10_000, 100_000, 1_000_000] {
        let spec = format!("procedural:knot:{triangles}");
        let scene = Scene::load(&spec).expect("a procedural scene");
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).expect("a sound mesh");
        let config = Config::default();
        let need = sizes(&mesh, &config, &mut []).expect("a sound mesh");
        let mut index = vec![Block::ZERO; Block::count_for(need.index_bytes)];
        let mut scratch = vec![Block::ZERO; Block::count_for(need.scratch_bytes)];
        let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
        let grid = Grid::build(mesh, &config, index, scratch).expect("a sound mesh");

        for (name, rays) in [("coherent", coherent(&scene)), ("incoherent", incoherent(&scene))] {
            group.throughput(Throughput::Elements(rays.len() as u64));
            group.bench_function(BenchmarkId::new(format!("intersect {name}"), triangles), |b| {
                b.iter(|| {
                    rays.iter().filter(|ray| grid.intersect(black_box(ray)).is_some()).count()
                });
            });
            group.bench_function(BenchmarkId::new(format!("occluded {name}"), triangles), |b| {
                b.iter(|| rays.iter().filter(|ray| grid.occluded(black_box(ray))).count());
            });
        }
    }
    group.finish();
}

criterion_group!(benches, query);
criterion_main!(benches);
