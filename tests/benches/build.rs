//! Build times per triangle.
//!
//! Analysis: the time per element should be flat from the smallest mesh to the largest; a bend upwards comes
//! from the cache or from something that is not linear. For a tree, `sizes` without scratch only computes a
//! bound; `exact sizes` builds as far as is needed to know the bytes. The regions are written once before the
//! clock starts, so that first touches of fresh pages are not measured.

#![expect(clippy::expect_used, reason = "a bench that cannot start can only panic")]

use core::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use hgrid_core::{Block, Config, Grid, TriangleMesh, sizes};
use hgrid_lab::scene::Scene;

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("build");
    group.sample_size(10);
    for triangles in [10_000, 100_000, 1_000_000] {
        let spec = format!("procedural:knot:{triangles}");
        let scene = Scene::load(&spec).expect("a procedural scene");
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).expect("a sound mesh");
        let config = Config::default();
        let need = sizes(&mesh, &config, &mut []).expect("a sound mesh");
        let mut index = vec![Block::ZERO; Block::count_for(need.index_bytes)];
        let mut scratch = vec![Block::ZERO; Block::count_for(need.scratch_bytes)];

        group.throughput(Throughput::Elements(u64::from(mesh.triangle_count())));
        group.bench_function(BenchmarkId::new("sizes", triangles), |bencher| {
            bencher.iter(|| sizes(black_box(&mesh), &config, &mut []));
        });
        group.bench_function(BenchmarkId::new("exact sizes", triangles), |bencher| {
            bencher.iter(|| sizes(black_box(&mesh), &config, Block::bytes_mut(&mut scratch)));
        });
        group.bench_function(BenchmarkId::new("build", triangles), |bencher| {
            bencher.iter(|| {
                let (index, scratch) =
                    (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
                let grid = Grid::build(mesh, black_box(&config), index, scratch);
                grid.map(|grid| grid.blob_bytes())
            });
        });
    }
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);
