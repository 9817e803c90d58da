//! The range of t compared with exact fractions: a hit counts if the point where the line meets the plane is
//! in range, whatever t is rounded to.

use std::cmp::Ordering;

use hgrid_core::{Ray, TriangleTest};
use hgrid_tests::random::Random;
use num_rational::BigRational;

type Vector = [BigRational; 3];

fn number(x: f32) -> BigRational {
    BigRational::from_float(x).expect("finite")
}

fn vector(v: [f32; 3]) -> Vector {
    v.map(number)
}

fn minus(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|k| &a[k] - &b[k])
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    let term = |i: usize, j: usize| &a[i] * &b[j] - &a[j] * &b[i];
    [term(1, 2), term(2, 0), term(0, 1)]
}

fn dot(a: &Vector, b: &Vector) -> BigRational {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

/// Returns the t at which the line meets the plane, or `None` if it runs along the plane or the triangle has no area.
fn plane(ray: &Ray, triangle: &[[f32; 3]; 3]) -> Option<BigRational> {
    let [a, b, c] = triangle.map(vector);
    let normal = cross(&minus(&b, &a), &minus(&c, &a));
    let slope = dot(&normal, &vector(ray.direction));
    let height = dot(&normal, &minus(&a, &vector(ray.origin)));
    (slope != number(0.0)).then(|| height / slope)
}

/// Returns the exact t of each corner, along the ray's longest axis.
fn corners(ray: &Ray, triangle: &[[f32; 3]; 3]) -> [BigRational; 3] {
    let [x, y, z] = ray.direction.map(f32::abs);
    let axis = if x > y && x > z { 0 } else { 2 - usize::from(y > z) };
    triangle.map(|p| (number(p[axis]) - number(ray.origin[axis])) / number(ray.direction[axis]))
}

#[derive(Default)]
struct Seen {
    hits: usize,
    before: usize,
    behind: usize,
    /// Range ends within an ulp of t.
    close: usize,
}

/// Compares one answer with the exact one.
fn check(ray: &Ray, triangle: &[[f32; 3]; 3], seen: &mut Seen) {
    let whole = Ray { t_min: f32::NEG_INFINITY, t_max: f32::INFINITY, ..*ray };
    let line = TriangleTest::new(&whole).and_then(|test| test.test(triangle));
    let hit = TriangleTest::new(ray).and_then(|test| test.test(triangle));
    let Some(line) = line else {
        assert_eq!(hit, None, "{ray:?} {triangle:?}");
        return;
    };
    if let Some(hit) = hit {
        assert!(hit.t >= ray.t_min && hit.t <= ray.t_max, "{hit:?} {ray:?}");
        assert_eq!((hit.u, hit.v), (line.u, line.v));
        let clamped = line.t.clamp(ray.t_min, ray.t_max);
        assert_eq!(hit.t, clamped, "{ray:?} {triangle:?}");
    }
    let Some(t) = plane(ray, triangle) else { return };
    let ends = corners(ray, triangle);
    let [low, high] = [ray.t_min, ray.t_max].map(|end| end.clamp(f32::MIN, f32::MAX)).map(number);
    let is_between = ends.iter().all(|end| *end > low && *end < high);
    let expected = is_between || t >= low && t <= high;
    if is_between {
        assert!(hit.is_some(), "{ray:?} {triangle:?}");
    } else if hit.is_some() {
        assert!(expected, "{hit:?} is at {t}: {ray:?} {triangle:?}");
    } else if expected {
        // The test may leave out a triangle only if the ray grazes it: then its t is not the plane's.
        let (first, last) = (ends.iter().min().unwrap(), ends.iter().max().unwrap());
        let off = if number(line.t) > t { number(line.t) - &t } else { &t - number(line.t) };
        let rounding = number(line.t.abs()) * number(f32::EPSILON);
        assert!(off > (last - first) * number(1e-7) + rounding, "at {t}: {ray:?} {triangle:?}");
        return;
    }
    match hit {
        Some(_) => seen.hits += 1,
        None if t.cmp(&low) == Ordering::Less => seen.before += 1,
        None => seen.behind += 1,
    }
    let next_to =
        |end: f32| end.is_finite() && number(end.next_down()) <= t && t <= number(end.next_up());
    seen.close += usize::from(next_to(ray.t_min) || next_to(ray.t_max));
}

fn triangle(random: &mut Random, round: usize) -> [[f32; 3]; 3] {
    let [a, b, c] = [random.point(), random.point(), random.point()];
    match round % 4 {
        // Coordinates of few digits; small triangles; slivers; any triangles.
        0 => [a, b, c].map(|p| p.map(|x| (x * 4.0).round() / 4.0)),
        1 => [
            a,
            std::array::from_fn(|k| a[k] + b[k] * 1e-3),
            std::array::from_fn(|k| a[k] + c[k] * 1e-3),
        ],
        2 => [a, b, std::array::from_fn(|k| a[k] + (b[k] - a[k]) * 0.4 + c[k] * 1e-4)],
        _ => [a, b, c],
    }
}

/// Returns three consecutive numbers around a fraction.
fn around(t: &BigRational) -> [f32; 3] {
    // Bisect over the floats in their order.
    let mirrored = |bits: i32| if bits < 0 { i32::MIN.wrapping_sub(bits) } else { bits };
    let place = |x: f32| mirrored(x.to_bits().cast_signed());
    let at = |place: i32| f32::from_bits(mirrored(place).cast_unsigned());
    let (mut low, mut high) = (place(f32::MIN), place(f32::MAX));
    while i64::from(high) - i64::from(low) > 1 {
        let middle = i32::midpoint(low, high);
        *(if number(at(middle)) <= *t { &mut low } else { &mut high }) = middle;
    }
    [at(low).next_down(), at(low), at(high)]
}

#[test]
fn ends_next_to_the_plane_are_decided_exactly_at_every_scale() {
    ends_next_to_the_plane(400);
}

#[test]
#[ignore = "slow: a hundred thousand exact fractions"]
fn ends_next_to_the_planes_of_more_triangles_are_decided_exactly() {
    ends_next_to_the_plane(1500);
}

fn ends_next_to_the_plane(rounds: usize) {
    let mut random = Random(17);
    let mut seen = Seen::default();
    for scale in [1.0, 1e-30, 1e-10, 1e10, 1e30] {
        for round in 0..rounds {
            let triangle = triangle(&mut random, round);
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let [a, b, c] = triangle;
            let target: [f32; 3] =
                std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
            let distance = [1.0, 100.0, 1e-3, 0.0][random.below(4)];
            let origin: [f32; 3] =
                std::array::from_fn(|k| target[k] + random.point()[k] * distance);
            let mut direction = std::array::from_fn(|k| target[k] - origin[k]);
            if distance == 0.0 {
                direction = random.point();
            }
            if random.below(3) == 0 {
                // Nearly along the plane.
                direction = std::array::from_fn(|k| b[k] - a[k] + direction[k] * 1e-5);
            }
            let ray = Ray::new(origin.map(|x| x * scale), direction);
            let triangle = triangle.map(|p| p.map(|x| x * scale));
            check(&ray, &triangle, &mut seen);
            let Some(t) = plane(&ray, &triangle) else { continue };
            for end in around(&t) {
                check(&Ray { t_min: end, ..ray }, &triangle, &mut seen);
                check(&Ray { t_min: f32::NEG_INFINITY, t_max: end, ..ray }, &triangle, &mut seen);
                check(&Ray { t_min: end, t_max: end, ..ray }, &triangle, &mut seen);
            }
        }
    }
    let Seen { hits, before, behind, close } = seen;
    assert!(
        3 * hits.min(before) > 10 * rounds && 3 * behind > 4 * rounds && 3 * close > 20 * rounds,
        "{hits} {before} {behind} {close}"
    );
}

/// Rays of a renderer that, like pbrt, offsets origins along the normal by a proven bound of the point's
/// error and accepts every t above 0.
#[test]
fn rays_that_leave_by_a_proven_bound_do_not_come_back() {
    let mut random = Random(19);
    let (mut seen, mut left) = (Seen::default(), 0);
    for scale in [1.0, 1e-20, 1e5] {
        for round in 0..4000 {
            let shift = [0.0, 1.0, 30.0][random.below(3)];
            let triangle = triangle(&mut random, round).map(|p| p.map(|x| (x + shift) * scale));
            let [a, b, c] = triangle;
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            // The point in f32; its error is at most gamma(7) times the magnitudes of its terms.
            let gamma = 7.0 * f32::EPSILON / 2.0 * 1.01;
            let weights = [1.0 - u - v, u, v];
            let point: [f32; 3] =
                std::array::from_fn(|k| weights[0] * a[k] + weights[1] * b[k] + weights[2] * c[k]);
            let error: [f32; 3] = std::array::from_fn(|k| {
                gamma
                    * ((weights[0] * a[k]).abs()
                        + (weights[1] * b[k]).abs()
                        + (weights[2] * c[k]).abs())
            });
            let (e, f): ([f64; 3], [f64; 3]) = (
                std::array::from_fn(|k| f64::from(b[k]) - f64::from(a[k])),
                std::array::from_fn(|k| f64::from(c[k]) - f64::from(a[k])),
            );
            let n =
                [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
            let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length <= 0.0 {
                continue;
            }
            let n = n.map(|x| (x / length) as f32);
            let mut direction = random.point();
            let along: f32 = (0..3).map(|k| direction[k] * n[k]).sum();
            let n = if along < 0.0 { n.map(|x| -x) } else { n };
            if random.below(2) == 0 {
                direction = std::array::from_fn(|k| direction[k] - 0.9999 * along.abs() * n[k]);
            }
            let d: f32 = (0..3).map(|k| n[k].abs() * error[k]).sum();
            let origin: [f32; 3] = std::array::from_fn(|k| {
                let moved = point[k] + d * n[k];
                // Round away from the plane, as pbrt does.
                if n[k] > 0.0 {
                    moved.next_up()
                } else if n[k] < 0.0 {
                    moved.next_down()
                } else {
                    moved
                }
            });
            let ray = Ray::new(origin, direction);
            check(&ray, &triangle, &mut seen);
            // The ray starts above the plane and leads away from it.
            let leaves = plane(&ray, &triangle).is_some_and(|t| t < number(0.0));
            if leaves && round % 4 != 2 {
                left += 1;
                let hit = TriangleTest::new(&ray).and_then(|test| test.test(&triangle));
                assert_eq!(hit, None, "{ray:?} {triangle:?}");
            }
        }
    }
    assert!(left > 5000, "{left}");
}
