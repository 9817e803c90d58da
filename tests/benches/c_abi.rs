//! The time of a query through the C ABI over that of the Rust call, with the same grid and rays in one process.
//!
//! Analysis: the C side checks a tag, three pointers and the ray's bytes, and cannot be inlined; that is a
//! few nanoseconds on a query of some hundred. The library is the `libhgrid.so` that C programs link.

#![expect(clippy::expect_used, reason = "a bench that cannot start can only panic")]

use core::ffi::c_void;
use core::hint::black_box;
use core::ptr::null;
use std::time::Instant;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use hgrid_core::{Config, Hit, Method, Ray};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_lab::scene::Scene;
use hgrid_tests::artefact::shared_library;
use hgrid_tests::meshes::Mesh;
use hgrid_tests::owned::Owned;
use hgrid_tests::scans;
use libloading::{Library, Symbol};

/// Rays on a side of the picture.
const SIZE: u16 = 256;

/// Timed pairs of runs, one run of each side.
const PAIRS: usize = 201;

/// The C struct `hgrid_mesh`.
#[repr(C)]
struct CMesh {
    struct_size: u32,
    index_type: u32,
    positions: *const c_void,
    position_stride: usize,
    vertex_count: usize,
    indices: *const c_void,
    index_stride: usize,
    triangle_count: usize,
    masks: *const c_void,
    mask_stride: usize,
    parts: *const c_void,
    part_count: usize,
}

/// The C struct `hgrid_grid`.
#[repr(C)]
struct CGrid([u64; 64]);

type Open = unsafe extern "C" fn(*const u8, usize, *const CMesh, *mut CGrid) -> i32;
type Intersect = unsafe extern "C" fn(*const CGrid, *const Ray, *const c_void, *mut Hit) -> bool;

/// Returns the time of `one` over that of `other`: the median over pairs of consecutive runs, which other
/// load on the machine slows down alike.
fn ratio(one: impl Fn() -> usize, other: impl Fn() -> usize) -> f64 {
    let time = |what: &dyn Fn() -> usize| {
        let start = Instant::now();
        black_box(what());
        start.elapsed().as_secs_f64()
    };
    let mut ratios: Vec<_> = (0..PAIRS).map(|_| time(&one) / time(&other)).collect();
    ratios.sort_by(f64::total_cmp);
    ratios[PAIRS / 2]
}

fn c_abi(criterion: &mut Criterion) {
    let mesh = scans::load("bunny").unwrap_or_else(|| {
        let knot = Scene::load("procedural:knot:70k").expect("a procedural scene");
        Mesh { positions: knot.positions, indices: knot.indices }
    });
    // SAFETY: the library was built by this project, and loading it runs nothing.
    let library = unsafe { Library::new(shared_library()) }.expect("libhgrid.so");
    // SAFETY: include/hgrid.h declares the function with this type.
    let open: Symbol<'_, Open> = unsafe { library.get(b"hgrid_open") }.expect("hgrid_open");
    // SAFETY: as above.
    let intersect: Symbol<'_, Intersect> =
        unsafe { library.get(b"hgrid_intersect") }.expect("hgrid_intersect");

    for method in [Method::OneLevel, Method::Bvh] {
        let owned = Owned::build(&mesh.view(), &Config::new(method)).expect("a sound mesh");
        let view = mesh.view();
        let grid = owned.open(&view).expect("its mesh");
        let camera = Camera::framing(grid.bounds(), View::Front, Up::Y);
        let pixels = (0..SIZE).flat_map(|row| (0..SIZE).map(move |column| (column, row)));
        let rays: Vec<Ray> = pixels.map(|(column, row)| camera.ray(column, row, SIZE)).collect();

        let c_mesh = CMesh {
            struct_size: size_of::<CMesh>() as u32,
            index_type: 0,
            positions: mesh.positions.as_ptr().cast(),
            position_stride: 0,
            vertex_count: mesh.positions.len(),
            indices: mesh.indices.as_ptr().cast(),
            index_stride: 0,
            triangle_count: mesh.indices.len(),
            masks: null(),
            mask_stride: 0,
            parts: null(),
            part_count: 0,
        };
        let mut c_grid = CGrid([0; 64]);
        let (blob, bytes) = (grid.blob().as_ptr(), grid.blob().len());
        // SAFETY: the blob and the mesh outlive the view, and `c_grid` has room for it.
        let status = unsafe { open(blob, bytes, &raw const c_mesh, &raw mut c_grid) };
        assert_eq!(status, 0, "hgrid_open");

        let in_rust = || rays.iter().filter(|ray| grid.intersect(black_box(ray)).is_some()).count();
        let in_c = || {
            let mut hit = Hit::MISS;
            let call = |ray: &&Ray| {
                let ray: *const Ray = black_box(*ray);
                // SAFETY: an opened view, a ray, no options, room for a hit.
                unsafe { intersect(&raw const c_grid, ray, null(), &raw mut hit) }
            };
            rays.iter().filter(call).count()
        };
        assert_eq!(in_rust(), in_c());
        println!("{}: C takes {:.3} times as long as Rust", method.name(), ratio(in_c, in_rust));
        let mut group = criterion.benchmark_group(format!("intersect, {}", method.name()));
        group.sample_size(60).throughput(Throughput::Elements(rays.len() as u64));
        group.bench_function("Rust", |b| b.iter(in_rust));
        group.bench_function("C", |b| b.iter(in_c));
        group.finish();
    }
}

criterion_group!(benches, c_abi);
criterion_main!(benches);
