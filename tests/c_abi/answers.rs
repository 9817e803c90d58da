//! Does C get what Rust gets, bit by bit?

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use hgrid_core::{Config, Counters, Hit, Method, QueryOptions, Ray};
use hgrid_tests::artefact::static_library;
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::methods::configs;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use tempfile::TempDir;

use crate::programs::compile;

/// Rays from around the cube from -1 to 1 towards points inside it, some of them short.
fn rays(count: usize) -> Vec<Ray> {
    let mut random = Random(7);
    let mut ray = || {
        let (from, to) = (random.point().map(|c| 3.0 * c), random.point());
        let direction = std::array::from_fn(|axis| to[axis] - from[axis]);
        let t_max = if random.below(4) == 0 { random.unit() } else { f32::INFINITY };
        Ray { t_max, ..Ray::new(from, direction) }
    };
    (0..count).map(|_| ray()).collect()
}

/// What `answers.c` fills a `hgrid_config` with.
fn words(config: &Config) -> [u32; 7] {
    let Config { method, density, macrocell_factor, subdivide_above, depth, cell_size, flags } =
        *config;
    let [density, cell_size] = [density, cell_size].map(f32::to_bits);
    let flags = flags.bits();
    [method as u32, density, macrocell_factor, subdivide_above, depth, cell_size, flags]
}

/// What `answers.c` reads.
fn question(config: &Config, mesh: &Mesh, rays: &[Ray]) -> Vec<u8> {
    let counts = [mesh.positions.len(), mesh.indices.len(), rays.len()].map(|n| n as u32);
    let numbers = words(config).into_iter().chain(counts);
    let mut bytes: Vec<u8> = numbers.flat_map(u32::to_ne_bytes).collect();
    bytes.extend(mesh.positions.iter().flatten().flat_map(|c| c.to_ne_bytes()));
    bytes.extend(mesh.indices.iter().flatten().flat_map(|i| i.to_ne_bytes()));
    for ray in rays {
        let Ray { origin: [a, b, c], t_min, direction: [x, y, z], t_max } = *ray;
        bytes.extend([a, b, c, t_min, x, y, z, t_max].iter().flat_map(|f| f.to_ne_bytes()));
    }
    bytes
}

/// What `answers.c` must write.
fn answer(config: &Config, mesh: &Mesh, rays: &[Ray]) -> Vec<u8> {
    let owned = Owned::build(&mesh.view(), config).expect("a sound mesh");
    let grid = owned.open(&mesh.view()).expect("its own mesh");
    let mut bytes = (grid.blob_bytes() as u64).to_ne_bytes().to_vec();
    bytes.extend(grid.blob());
    let mut counters = Counters::default();
    for ray in rays {
        let found = grid.intersect_with(ray, &mut QueryOptions::counting(&mut counters));
        let Hit { t, u, v, primitive } =
            found.unwrap_or(Hit { t: 0.0, u: 0.0, v: 0.0, primitive: 0 });
        bytes.extend([t, u, v].iter().flat_map(|f| f.to_ne_bytes()));
        let words = [primitive, found.is_some().into(), grid.occluded(ray).into()];
        bytes.extend(words.iter().flat_map(|w| w.to_ne_bytes()));
    }
    let Counters { primitive_tests, cell_steps, grid_steps } = counters;
    bytes.extend([primitive_tests, cell_steps, grid_steps].iter().flat_map(|n| n.to_ne_bytes()));
    // Both batches, whatever is known of the rays.
    for _ in 0..2 {
        for ray in rays {
            let Hit { t, u, v, primitive } = grid.intersect(ray).unwrap_or(Hit::MISS);
            bytes.extend([t, u, v].iter().flat_map(|f| f.to_ne_bytes()));
            bytes.extend(primitive.to_ne_bytes());
        }
        bytes.extend(rays.iter().map(|ray| u8::from(grid.occluded(ray))));
    }
    bytes
}

/// What a program answers to a question.
fn ask(program: &Path, question: Vec<u8>) -> Vec<u8> {
    let mut child = Command::new(program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    let writer = std::thread::spawn(move || stdin.write_all(&question));
    let output = child.wait_with_output().expect("the program ends");
    writer.join().expect("no panic").expect("the program reads everything");
    assert!(output.status.success(), "{}", output.status);
    output.stdout
}

#[test]
fn c_gets_the_bits_that_rust_gets() {
    let dir = TempDir::new().expect("a folder");
    let program = compile("answers", "c99", &["-O2"], &static_library(), dir.path());
    let rays = rays(2000);
    let meshes =
        [Mesh::default(), one_triangle(), ball(20, 1.0), soup(3000, 0.1, 1), soup(200, 2.0, 2)];
    let configs: Vec<_> = Method::ALL.iter().copied().map(Config::new).chain(configs()).collect();
    for (config, mesh) in configs.iter().flat_map(|c| meshes.iter().map(move |mesh| (c, mesh))) {
        let found = ask(&program, question(config, mesh, &rays));
        let triangles = mesh.indices.len();
        assert!(found == answer(config, mesh, &rays), "{triangles} triangles, {config:?}");
    }
}
