//! Random small meshes whose coordinates are snapped to quarters of a cell, and rays between
//! snapped points: most rays run along a cell border, an edge or a vertex.

use hgrid_core::{Config, Method, Parameters, Ray, Strided};
use hgrid_tests::meshes::Mesh;
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::{oracle, rounds, setting};
use proptest::prelude::*;

/// The width of the scene in quarters of a unit; the scene is 4 units wide. At the densities below, a cell is
/// 1 unit, half of one, or two.
const WIDTH: i32 = 16;

fn snapped() -> impl Strategy<Value = [f32; 3]> {
    [0..=WIDTH, 0..=WIDTH, 0..=WIDTH].prop_map(|p| p.map(|c| c as f32 / 4.0))
}

/// Triangles with corners anywhere, and small triangles.
fn triangles() -> impl Strategy<Value = Vec<[[f32; 3]; 3]>> {
    let anywhere = [snapped(), snapped(), snapped()];
    let small = (snapped(), prop::array::uniform6(-2..=2_i32)).prop_map(|(a, d)| {
        let near = |i: usize| std::array::from_fn(|k| a[k] + d[i + k % 3] as f32 / 4.0);
        [a, near(0), near(3)]
    });
    prop::collection::vec(prop_oneof![anywhere, small], 1..40)
}

/// Rays from a snapped point or far behind it, towards a snapped point or along an axis.
fn rays() -> impl Strategy<Value = Vec<Ray>> {
    let axis = (0..3_usize, prop::bool::ANY).prop_map(|(axis, up)| {
        let mut direction = [0.0, -0.0, 0.0];
        direction[axis] = if up { 1.0 } else { -1.0 };
        direction
    });
    let ends = prop_oneof![
        3 => Just((0.0, f32::INFINITY)),
        1 => (-8..8_i32, 0..16_i32).prop_map(|(a, b)| (a as f32 / 4.0, (a + b) as f32 / 4.0)),
    ];
    let length = prop_oneof![4 => Just(1.0), 1 => Just(1e-20), 1 => Just(1e20), 1 => Just(3.0)];
    let distance = prop_oneof![4 => Just(0.0), 2 => Just(3.0), 1 => Just(64.0), 1 => Just(1e6)];
    let towards = (snapped(), snapped(), axis, prop::bool::ANY, length, distance, ends);
    let ray = towards.prop_map(|(from, to, axis, along_axis, length, distance, (t_min, t_max))| {
        let direction: [f32; 3] =
            if along_axis { axis } else { std::array::from_fn(|k| to[k] - from[k]) };
        let origin = std::array::from_fn(|k| from[k] - direction[k] * distance);
        let scaled = |t: f32| if t.is_finite() { t / length } else { t };
        Ray {
            origin,
            t_min: scaled(t_min),
            direction: direction.map(|d| d * length),
            t_max: scaled(t_max),
        }
    });
    prop::collection::vec(ray, 1..30)
}

/// Returns the number of cases: `PROPTEST_CASES`, or as many as take a second or two.
fn cases() -> u32 {
    setting("PROPTEST_CASES", rounds(375) as u64).try_into().expect("a count that fits")
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), ..ProptestConfig::default() })]

    #[test]
    fn every_entry_point_agrees(
        triangles in triangles(),
        rays in rays(),
        method in prop::sample::select(Method::ALL),
        factor in 2..7_u32,
        density in prop_oneof![Just(0.05_f32), Just(1.0), Just(4.0), Just(13.0), Just(64.0)],
        scale in prop_oneof![4 => Just(1.0_f32), 1 => Just(1e-30), 1 => Just(1e30), 1 => Just(0.3)],
    ) {
        let mut mesh = Mesh::default();
        triangles.into_iter().for_each(|triangle| mesh.push(triangle));
        let mesh = mesh.scaled(scale);
        let masks: Vec<u32> = (0..).take(mesh.view().triangle_count() as usize).collect();
        let view = mesh.view().with_masks(Strided::new(&masks)).unwrap();
        let parameters = match Parameters::new(method).with_density(density) {
            Parameters::Fixed { .. } => Parameters::Fixed { density, macrocell_factor: factor },
            Parameters::Variable { .. } => Parameters::Variable { density, subdivide_above: factor },
            others => others,
        };
        let config = Config::from(parameters);
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        prove(&grid).unwrap();
        for ray in rays {
            let ray = Ray { origin: ray.origin.map(|c| c * scale), ..ray };
            let direction = ray.direction.map(|c| c * scale);
            oracle::check(&grid, &Ray { direction, ..ray });
            oracle::check(&grid, &ray);
        }
    }
}
