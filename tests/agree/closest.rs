//! The closest point, as a loop over all triangles finds it, and as a search by halving does.

use hgrid_core::{ClosestPoint, Counters, Grid, INVALID_ID, QueryOptions, Strided};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::methods::configs;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;

/// The closest of all triangles that count.
fn brute_force(
    grid: &Grid<'_>,
    point: [f32; 3],
    max: f32,
    counts: impl Fn(u32) -> bool,
) -> Option<ClosestPoint> {
    let all = (0..grid.mesh().triangle_count()).filter(|&id| counts(id));
    let found = all
        .filter_map(|id| ClosestPoint::on_triangle(&grid.mesh().triangle(id).unwrap(), id, point));
    // The first of equals, so the lowest id.
    let closest = found.reduce(|a, b| if b.distance < a.distance { b } else { a });
    closest.filter(|closest| closest.distance <= max)
}

fn check(grid: &Grid<'_>, point: [f32; 3], max: f32) {
    let expected = brute_force(grid, point, max, |_| true);
    let ask = |options: &mut QueryOptions<'_>| grid.closest_point(point, max, options);
    assert_eq!(ask(&mut QueryOptions::default()), expected, "{point:?} within {max}");

    // What is just as far as allowed counts, and nothing behind it.
    if let Some(closest) = expected {
        let mut options = QueryOptions::default();
        let exactly = grid.closest_point(point, closest.distance, &mut options);
        assert_eq!(exactly, expected, "{point:?} exactly as far");
        if closest.distance > 0.0 {
            let less = closest.distance.next_down();
            assert_eq!(grid.closest_point(point, less, &mut options), None, "{point:?} too far");
        }
    }

    // Without the closest one, and of those with a certain mask.
    let skip = expected.map_or(INVALID_ID, |closest| closest.primitive);
    let mut counters = Counters::default();
    let mut options = QueryOptions { skip, mask: 2, ..QueryOptions::counting(&mut counters) };
    let found = ask(&mut options);
    let counts = |id| id != skip && grid.mesh().mask(id) & 2 != 0;
    assert_eq!(found, brute_force(grid, point, max, counts), "{point:?} without {skip}");
    assert!(found.is_none() || counters.primitive_tests > 0 && counters.cell_steps > 0);
}

#[test]
fn every_method_finds_what_a_loop_finds() {
    let mut flat = Mesh::default();
    (0..30).for_each(|i| flat.push([[0.0, 0.0, 0.0], [1.0, i as f32, 0.0], [i as f32, 1.0, 0.0]]));
    let mut points = Mesh::default();
    (0..20).for_each(|i| points.push([[i as f32, (i * i) as f32, 1.0]; 3]));
    let far = ball(8, 1.0).map(|p| p.map(|c| c + 1e6));
    let cases = [
        one_triangle(),
        ball(12, 1.0),
        soup(400, 0.1, 3),
        soup(300, 2.0, 4),
        ball(8, 1.0).scaled(1e-30),
        ball(8, 1.0).scaled(1e30),
        far,
        flat,
        points,
    ];
    let mut random = Random(17);
    for mesh in cases {
        let masks: Vec<u32> = (0..).take(mesh.view().triangle_count() as usize).collect();
        let view = mesh.view().with_masks(Strided::new(&masks)).unwrap();
        for config in configs() {
            let owned = Owned::build(&view, &config).unwrap();
            let grid = owned.open(&view).unwrap();
            let (min, max) = grid.bounds();
            for round in 0..60 {
                // Inside, around, far away, and at a vertex.
                let width = [0.5, 1.5, 100.0][round % 3];
                let mut point: [f32; 3] = std::array::from_fn(|axis| {
                    let (center, half) = (0.5 * (min[axis] + max[axis]), max[axis] - min[axis]);
                    center + half * width * (2.0 * random.unit() - 1.0)
                });
                if round % 7 == 0 {
                    point = view.triangle(random.below(masks.len()) as u32).unwrap()[round % 3];
                }
                let extent = max[0] - min[0];
                let within = [f32::INFINITY, extent, 0.2 * extent, 0.0][round % 4];
                check(&grid, point, within);
            }
        }
    }
}

#[test]
fn a_question_that_is_none_finds_nothing() {
    let mesh = ball(6, 1.0);
    for config in configs() {
        let owned = Owned::build(&mesh.view(), &config).unwrap();
        let grid = owned.open(&mesh.view()).unwrap();
        let mut options = QueryOptions::default();
        for (point, max) in [
            ([f32::NAN, 0.0, 0.0], 1.0),
            ([0.0, f32::INFINITY, 0.0], f32::INFINITY),
            ([0.0; 3], f32::NAN),
            ([0.0; 3], -1.0),
        ] {
            assert_eq!(grid.closest_point(point, max, &mut options), None, "{point:?} {max}");
        }
        assert!(grid.closest_point([1e38, -1e38, 1e38], f32::INFINITY, &mut options).is_some());
    }
    let empty = Mesh::default();
    for config in configs() {
        let owned = Owned::build(&empty.view(), &config).unwrap();
        let grid = owned.open(&empty.view()).unwrap();
        let mut options = QueryOptions::default();
        assert_eq!(grid.closest_point([0.0; 3], f32::INFINITY, &mut options), None);
    }
}

/// The point of a triangle that is closest, found without looking at corners and
/// edges: on a line through a triangle the distance falls and then rises, so does the
/// least distance of parallel lines.
#[test]
fn the_point_of_a_triangle_is_the_closest_one() {
    fn least(distance: impl Fn(f64) -> f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..100 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if distance(a) < distance(b) { high = b } else { low = a }
        }
        distance(0.5 * (low + high))
    }
    let mut random = Random(5);
    for round in 0..2000 {
        let mut corner = || random.point().map(|c| (c * 4.0).round() / 4.0);
        let mut triangle = [corner(), corner(), corner()];
        let point = random.point().map(|c| c * 2.0);
        if round % 10 == 0 {
            triangle[2] = triangle[round % 2];
        }
        let found = ClosestPoint::on_triangle(&triangle, 7, point).unwrap();

        let at = |v: f64, w: f64| -> [f64; 3] {
            let [a, b, c] = triangle.map(|corner| corner.map(f64::from));
            std::array::from_fn(|k| a[k] + v * (b[k] - a[k]) + w * (c[k] - a[k]))
        };
        let distance = |to: [f64; 3]| {
            (0..3).map(|k| (to[k] - f64::from(point[k])).powi(2)).sum::<f64>().sqrt()
        };
        let expected = least(|v| least(|part| distance(at(v, (1.0 - v) * part))));
        assert!((f64::from(found.distance) - expected).abs() < 1e-6, "{triangle:?} {point:?}");

        // It is where it says.
        let (u, v) = (f64::from(found.u), f64::from(found.v));
        assert!(u >= 0.0 && v >= 0.0 && u + v < 1.0 + 1e-6, "{found:?}");
        let position = found.position.map(f64::from);
        assert!((0..3).all(|k| (at(u, v)[k] - position[k]).abs() < 1e-6), "{found:?}");
        assert!((distance(position) - expected).abs() < 1e-6, "{found:?}");
    }
}
