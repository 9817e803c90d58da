//! The ray-triangle test compared with exact integer arithmetic. Where that says "clearly inside", the test must
//! hit with the right numbers; where it says "clearly outside", it must miss.

use hgrid_core::{Ray, TriangleTest};
use hgrid_tests::random::Random;

type Point = [i128; 3];

fn sub(a: Point, b: Point) -> Point {
    std::array::from_fn(|k| a[k] - b[k])
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: Point, b: Point) -> i128 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

/// Returns the three signed volumes between ray and edges (weights of the vertices times `determinant`), the
/// determinant, and `t` times the determinant: all exact.
fn volumes(origin: Point, direction: Point, [a, b, c]: [Point; 3]) -> ([i128; 3], i128, i128) {
    let [a, b, c] = [a, b, c].map(|p| sub(p, origin));
    let weights =
        [dot(direction, cross(b, c)), dot(direction, cross(c, a)), dot(direction, cross(a, b))];
    (weights, weights.iter().sum(), dot(a, cross(b, c)))
}

/// Returns an upper bound of the number of multiples of the direction that a triangle spans.
fn reach_along(direction: Point, corners: [Point; 3]) -> f64 {
    let axis = (0..3).max_by_key(|&k| direction[k].abs()).unwrap();
    let (from, to) = (corners.iter().map(|p| p[axis]).min(), corners.iter().map(|p| p[axis]).max());
    (to.unwrap() - from.unwrap() + 1) as f64 / direction[axis].abs() as f64
}

fn random_point(random: &mut Random, width: i128) -> Point {
    std::array::from_fn(|_| {
        i128::from(random.bits() % u64::try_from(2 * width + 1).unwrap()) - width
    })
}

fn float(p: Point) -> [f32; 3] {
    p.map(|c| c as f32)
}

#[test]
fn clear_cases_are_right_and_exact() {
    let mut random = Random(1);
    let (mut inside, mut outside, mut edges) = (0, 0, 0);
    for round in 0..300_000 {
        let width = [4, 40, 4000][round % 3];
        let corners: [Point; 3] = std::array::from_fn(|_| random_point(&mut random, width));
        let origin = random_point(&mut random, width);
        // Aim half of the rays at the triangle: at a vertex, on an edge or inside.
        let direction = if round % 2 == 0 {
            random_point(&mut random, width)
        } else {
            let [i, j, k] = std::array::from_fn(|_| i128::from(random.bits() % 4));
            let sum = (i + j + k).max(1);
            let target: Point =
                std::array::from_fn(|x| corners[0][x] * i + corners[1][x] * j + corners[2][x] * k);
            std::array::from_fn(|x| target[x] - origin[x] * sum)
        };
        let (weights, determinant, distance) = volumes(origin, direction, corners);
        let ray = Ray::new(float(origin), float(direction));
        let test = TriangleTest::new(&ray);
        let hit = test.and_then(|test| test.test(&corners.map(float)));
        if determinant == 0 {
            continue;
        }
        let [a, b, c] = weights.map(|w| w as f64 / determinant as f64);
        let t = distance as f64 / determinant as f64;
        let least = a.min(b).min(c);
        // The shear moves the projected triangle by a few f64 roundings of the corners' distance; the smaller
        // the projection, the more that moves the weights.
        let reach = corners.iter().flat_map(|&p| sub(p, origin)).map(i128::abs).max().unwrap();
        let along = direction.map(i128::abs).into_iter().max().unwrap();
        let error = 32.0 * f64::EPSILON * (reach * reach * along) as f64 / determinant.abs() as f64;
        if least > error && t > 0.0 && error < 0.1 {
            let hit = hit.unwrap_or_else(|| panic!("missed {corners:?} by {ray:?}"));
            let rounding = f64::from(f32::EPSILON) / 2.0 * (1.0 + 1e-4);
            assert!((f64::from(hit.u) - b).abs() < error + rounding * b);
            assert!((f64::from(hit.v) - c).abs() < error + rounding * c);
            let depth = reach_along(direction, corners);
            let rounding = rounding * t;
            assert!(
                (f64::from(hit.t) - t).abs() < error * depth + rounding,
                "{} is not {t}",
                hit.t
            );
            inside += 1;
        } else if least < -error || t < -error * reach_along(direction, corners) {
            assert_eq!(hit, None, "hit {corners:?} by {ray:?} with {weights:?} of {determinant}");
            outside += 1;
        } else {
            edges += 1;
        }
    }
    assert!(inside > 10_000 && outside > 50_000 && edges > 1_000, "{inside} {outside} {edges}");
}
