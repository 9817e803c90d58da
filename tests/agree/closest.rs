//! The closest point, compared with a loop over all triangles and with a search by bisection.

use hgrid_core::{
    ClosestPoint, Config, Counters, Grid, INVALID_ID, Method, QueryOptions, SimdLevel, Strided,
};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::methods::configs;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;

/// Returns the closest point of all triangles for which `counts` is true.
fn brute_force(
    grid: &Grid<'_>,
    point: [f32; 3],
    max: f32,
    counts: impl Fn(u32) -> bool,
) -> Option<ClosestPoint> {
    let all = (0..grid.mesh().triangle_count()).filter(|&id| counts(id));
    let found = all
        .filter_map(|id| ClosestPoint::on_triangle(&grid.mesh().triangle(id).unwrap(), id, point));
    // Of equals, keep the first, which has the lowest id.
    let closest = found.reduce(|a, b| if b.distance < a.distance { b } else { a });
    closest.filter(|closest| closest.distance <= max)
}

/// Compares with brute force; returns true if a point is found.
fn check(grid: &Grid<'_>, point: [f32; 3], max: f32) -> bool {
    let expected = brute_force(grid, point, max, |_| true);
    let ask = |options: &mut QueryOptions<'_>| grid.closest_point(point, max, options);
    assert_eq!(ask(&mut QueryOptions::default()), expected, "{point:?} within {max}");

    // A point exactly at the limit counts; one beyond it does not.
    if let Some(closest) = expected {
        let mut options = QueryOptions::default();
        let exactly = grid.closest_point(point, closest.distance, &mut options);
        assert_eq!(exactly, expected, "{point:?} exactly as far");
        if closest.distance > 0.0 {
            let less = closest.distance.next_down();
            assert_eq!(grid.closest_point(point, less, &mut options), None, "{point:?} too far");
        }
    }

    // Leave out the closest triangle, and take only those with a certain mask.
    let skip = expected.map_or(INVALID_ID, |closest| closest.primitive);
    let mut counters = Counters::default();
    let mut options = QueryOptions { skip, mask: 2, ..QueryOptions::counting(&mut counters) };
    let found = ask(&mut options);
    let counts = |id| id != skip && grid.mesh().mask(id) & 2 != 0;
    assert_eq!(found, brute_force(grid, point, max, counts), "{point:?} without {skip}");
    assert!(found.is_none() || counters.primitive_tests > 0 && counters.cell_steps > 0);
    expected.is_some()
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
            let mut found = 0;
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
                found += usize::from(check(&grid, point, within));
            }
            assert!(found > 15 && found < 50, "{found}");
        }
    }
}

/// A small mesh far away: all distances round to the same number, so the lowest id wins, wherever it lies. A search
/// that ends at that number misses what lies behind it and rounds to it.
#[test]
fn of_distances_that_round_to_the_same_the_lowest_id_wins() {
    let mesh = soup(300, 0.1, 3).scaled(0.5_f32.powi(27));
    for first in 0..3 {
        let mut mesh = mesh.clone();
        mesh.indices.rotate_left(first);
        for config in configs() {
            let owned = Owned::build(&mesh.view(), &config).unwrap();
            let grid = owned.open(&mesh.view()).unwrap();
            for side in 0..6 {
                let mut point = [0.0; 3];
                point[side / 2] = [-1.0, 1.0][side % 2];
                let found = brute_force(&grid, point, f32::INFINITY, |_| true).unwrap();
                assert_eq!((found.distance, found.primitive), (1.0, 0));
                check(&grid, point, f32::INFINITY);
            }
        }
    }
}

/// The loops of the other tests ask by `ClosestPoint::on_triangle`, so they would repeat its mistake.
#[test]
fn a_triangle_beyond_the_range_is_not_found() {
    let mesh = one_triangle();
    let triangle = mesh.view().triangle(0).unwrap();
    for point in [[f32::MAX; 3], [-3e38, 0.0, 3e38], [f32::NAN, 0.0, 0.0], [f32::INFINITY; 3]] {
        assert_eq!(ClosestPoint::on_triangle(&triangle, 0, point), None, "{point:?}");
        for config in configs() {
            let owned = Owned::build(&mesh.view(), &config).unwrap();
            let grid = owned.open(&mesh.view()).unwrap();
            let options = &mut QueryOptions::default();
            assert_eq!(grid.closest_point(point, f32::INFINITY, options), None, "{point:?}");
        }
    }
    assert!(ClosestPoint::on_triangle(&triangle, 0, [f32::MAX, 0.0, 0.0]).is_some());
}

/// Asks a tree at every SIMD level: the answer and the work are the same.
fn check_levels(grid: &Grid<'_>, point: [f32; 3], within: f32) {
    let expected = brute_force(grid, point, within, |_| true);
    let mut work = None;
    for level in SimdLevel::available() {
        let mut counters = Counters::default();
        let mut options = QueryOptions::counting(&mut counters);
        let found = grid.with_simd(level).closest_point(point, within, &mut options);
        assert_eq!(found, expected, "{level:?} {point:?} within {within}");
        assert_eq!(*work.get_or_insert(counters), counters, "{level:?} {point:?}");
    }
}

#[test]
fn trees_find_it_with_all_vectors_wherever_the_point_is() {
    // Each triangle three times: of equals, the lowest id must win, not the first one visited.
    let mut thrice = ball(10, 1.0);
    let once = thrice.indices.clone();
    (0..2).for_each(|_| thrice.indices.extend(once.iter().rev()));
    // Tiny triangles among some that are far larger.
    let mut mixed = soup(300, 0.1, 5).scaled(1e-12);
    mixed.append(&soup(20, 1.0, 6).scaled(1e12));
    // Slivers, whose normals are ill-defined.
    let slivers = soup(500, 0.2, 8).map(|[x, y, z]| [x, y * 1e-7, z * 1e-7]);
    // Triangles that are not finite, which are in no leaf.
    let mut holed = soup(200, 0.1, 9);
    for (at, value) in [(0, f32::NAN), (100, f32::INFINITY), (200, -1e37)] {
        holed.positions[at][1] = value;
    }
    let scan = soup(4000, 0.02, 7);
    let scales = [1e-38, 1e-25, 1e-10, 1e20, 1e35];
    let scaled = scales.map(|scale| soup(300, 0.1, 10).scaled(scale));
    let away = [1e3, 1e7].map(|far| soup(300, 0.1, 11).map(|[x, y, z]| [x + far, y, z - far]));
    let meshes = [ball(20, 1.0), ball(9, 0.0), thrice, mixed, slivers, holed, scan];
    let mut random = Random(23);
    for mesh in meshes.iter().chain(&scaled).chain(&away) {
        let view = mesh.view();
        let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
        let grid = owned.open(&view).unwrap();
        let (min, max) = grid.bounds();
        let extent = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f32::max);
        for round in 0..120 {
            let width = [0.5, 1.0, 10.0, 1e3, 1e6][round % 5];
            let mut point: [f32; 3] = std::array::from_fn(|axis| {
                let center = 0.5 * min[axis] + 0.5 * max[axis];
                let point = center + extent * width * (2.0 * random.unit() - 1.0);
                point.clamp(-f32::MAX, f32::MAX)
            });
            // On the surface, and straight above a corner.
            let triangle = view.triangle(random.below(mesh.indices.len()) as u32).unwrap();
            let is_finite = triangle.iter().flatten().all(|c| c.abs() < 1e36);
            match round % 8 {
                0 if is_finite => point = triangle[round % 3],
                1 if is_finite => {
                    point = std::array::from_fn(|k| triangle.iter().map(|p| p[k] / 3.0).sum());
                }
                2 if is_finite => point[..2].copy_from_slice(&triangle[0][..2]),
                3 => point = std::array::from_fn(|axis| 0.5 * min[axis] + 0.5 * max[axis]),
                _ => {}
            }
            let expected = brute_force(&grid, point, f32::INFINITY, |_| true);
            let distance = expected.map_or(0.0, |closest| closest.distance);
            for within in [f32::INFINITY, distance, distance.next_down().max(0.0), extent] {
                check_levels(&grid, point, within);
            }
        }
        for point in [[f32::MAX; 3], [-f32::MAX, 0.0, f32::MAX], [0.0; 3], [1e-45; 3]] {
            check_levels(&grid, point, f32::INFINITY);
        }
    }
}

#[test]
fn a_tree_looks_at_little_near_the_surface_and_far_outside() {
    let mesh = ball(60, 1.0).map(|[x, y, z]| [x, 0.7 * y, 0.5 * z]);
    let owned = Owned::build(&mesh.view(), &Config::new(Method::Bvh)).unwrap();
    let grid = owned.open(&mesh.view()).unwrap();
    let mut random = Random(31);
    for width in [1.0_f32, 3.0, 30.0] {
        let mut counters = Counters::default();
        for _ in 0..100 {
            let point = random.point();
            let length = point.iter().map(|c| c * c).sum::<f32>().sqrt();
            let point = point.map(|c| c / length * width.max(1.1));
            let mut options = QueryOptions::counting(&mut counters);
            assert!(grid.closest_point(point, f32::INFINITY, &mut options).is_some());
        }
        // Each of the hundred queries could test 43 200 triangles.
        assert!(counters.primitive_tests < 100 * 600, "{width} {counters:?}");
        assert!(counters.grid_steps + counters.cell_steps < 100 * 300, "{width} {counters:?}");
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

/// The closest point of a triangle, found without a look at corners and edges: along a line through a
/// triangle the distance falls and then rises, and so does the least distance along parallel lines.
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
    let fibonacci = [[0.0, 0.0], [14_930_352.0, 9_227_465.0], [9_227_465.0, 5_702_887.0]]
        .map(|[x, y]: [f32; 2]| [x / 8_388_608.0, y / 8_388_608.0, 0.0]);
    let narrow = (
        [
            [-3.2937e-10, -9.720_700_6e-11, -3.2937e-10],
            [0.873_772, 0.637_119_8, 0.873_772],
            [0.818_412_54, 0.596_753_9, 0.818_412_54],
        ],
        [0.683_207_15, 0.490_193_6, 0.661_335_7],
    );
    let mut random = Random(5);
    for round in 0..10_000 {
        let mut corner = || random.point().map(|c| (c * 4.0).round() / 4.0);
        let mut triangle = [corner(), corner(), corner()];
        let mut point = random.point().map(|c| c * 2.0);
        let [a, b, c] = triangle;
        let part = random.unit();
        let between = |part: f32| std::array::from_fn(|k| a[k] + part * (b[k] - a[k]));
        match round % 10 {
            0 => triangle[2] = triangle[round / 10 % 2],
            // Slivers: the third corner lies on the edge between the others, or next to one of them.
            1 => triangle[2] = between(part),
            2 => triangle[2] = between(0.5),
            3 => triangle[2] = b.map(|x| x * (1.0 + 1e-7 * part)),
            4 => triangle[2] = std::array::from_fn(|k| b[k] + 1e-6 * c[k]),
            5 => triangle[2] = std::array::from_fn(|k| a[k] + 1e-4 * part * c[k]),
            // Corners of Fibonacci numbers: this triangle is 2^-48 as high as long.
            6 => triangle = fibonacci,
            // This triangle is 2^-42 as high as long: in f64 the place below the point is off by 2^-13 of its length.
            7 if round < 30 => (triangle, point) = narrow,
            _ => {}
        }
        triangle.rotate_left(round / 10 % 3);
        let [a, b, c] = triangle;
        // Put most points next to their sliver.
        if matches!(round % 10, 1..=6) && round % 4 != 0 {
            let part = random.unit();
            let near = random.point().map(|x| x * [1e-9, 1e-5, 1e-2][round / 30 % 3]);
            let across = std::array::from_fn::<_, 3, _>(|k| f32::midpoint(a[k], c[k]));
            point = std::array::from_fn(|k| across[k] + part * (b[k] - across[k]) + near[k]);
            // Next to the corner at zero, the coordinates of a point have more digits than those of the triangle.
            if round % 20 == 6 {
                point = near;
            }
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
        let allowed = 1e-7 + 6e-8 * expected;
        assert!((f64::from(found.distance) - expected).abs() < allowed, "{triangle:?} {point:?}");

        // The point lies where its coordinates say.
        let (u, v) = (f64::from(found.u), f64::from(found.v));
        assert!(u >= 0.0 && v >= 0.0 && u + v < 1.0 + 1e-6, "{found:?}");
        let position = found.position.map(f64::from);
        assert!((0..3).all(|k| (at(u, v)[k] - position[k]).abs() < 1e-6), "{found:?}");
        assert!((distance(position) - expected).abs() < 1e-6, "{found:?}");
    }
}
