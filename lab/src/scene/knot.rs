//! A closed, finely bumped tube along a trefoil: a stand-in for a scan, at any triangle count.
//!
//! ```text
//!   around the tube: columns ->           the curve winds 2 times around the axis of a torus
//!   +---+---+---+                         while it winds 3 times around the torus' own tube, so
//!   | / | / | / |  rows along the curve   the torus' normal and the curve's tangent are a frame
//!   +---+---+---+  both directions wrap   that closes after one turn without a twist
//! ```
//!
//! Every vertex has six triangles, there are no poles and no seams, and the shape does not depend
//! on the triangle count. Only IEEE + - * / and square roots, in `f64`, rounded once at the end:
//! the same vertices on every platform, and no trigonometry to port.

use super::Scene;
use super::noise::noise;
use crate::progress::Progress;
use crate::vector::{Vector, cross, dot, offset, round};

/// The torus, the distance of the curve from the torus' core, and the tube around the curve.
const TORUS_RADIUS: f64 = 1.0;
const STRAND_RADIUS: f64 = 0.45;
const TUBE_RADIUS: f64 = 0.26;

/// The length of the curve divided by the tube's circumference, rounded, which makes quads near-square.
const ROWS_PER_COLUMN: u32 = 10;

/// Bumps: the frequency and the height of the coarsest octave, the number of octaves, and the height of each
/// as a part of the one before. The frequency doubles from octave to octave.
const BUMP_FREQUENCY: f64 = 3.0;
const BUMP_HEIGHT: f64 = 0.08;
const BUMP_OCTAVES: u32 = 6;
const BUMP_GAIN: f64 = 0.45;

/// Returns the rows and columns of near-square quads for which `2 * rows * columns` is closest to `triangles`.
pub(super) fn size(triangles: u32) -> (u32, u32) {
    let quads = (triangles / 2).max(1);
    let square = (quads / ROWS_PER_COLUMN).isqrt().max(3);
    let candidates = square - square / 4..=square + square / 4;
    let rows = |columns: u32| ((quads + columns / 2) / columns).max(3);
    let columns = candidates
        .min_by_key(|&columns| (quads.abs_diff(columns * rows(columns)), columns.abs_diff(square)))
        .unwrap_or(square);
    (rows(columns), columns)
}

/// Makes the knot around the origin, about three and a half units wide, facing +z.
pub(super) fn make(rows: u32, columns: u32) -> Scene {
    let mut progress = Progress::new("generating", u64::from(rows));
    let mut scene = Scene::default();
    let count = rows as usize * columns as usize;
    scene.positions.reserve_exact(count);
    scene.indices.reserve_exact(2 * count);
    for row in 0..rows {
        let station = Station::new(circle(row, rows));
        for column in 0..columns {
            scene.positions.push(round(station.point(circle(column, columns))));
        }
        let (here, next) = (row * columns, (row + 1) % rows * columns);
        for column in 0..columns {
            let beside = (column + 1) % columns;
            let [a, b, c, d] = [here + column, here + beside, next + beside, next + column];
            scene.indices.extend([[a, b, c], [a, c, d]]);
        }
        progress.advance(1);
    }
    scene
}

/// The curve at one row: its point and the frame of the tube there.
struct Station {
    centre: Vector,
    normal: Vector,
    binormal: Vector,
}

impl Station {
    /// Returns the station at an angle that goes once around while the curve closes.
    fn new(angle: [f64; 2]) -> Self {
        let [cos2, sin2] = turn(angle, angle);
        let [cos3, sin3] = turn([cos2, sin2], angle);
        let reach = TORUS_RADIUS + STRAND_RADIUS * cos3;
        let normal = [cos3 * cos2, cos3 * sin2, sin3];
        let tangent = [
            -2.0 * reach * sin2 - 3.0 * STRAND_RADIUS * sin3 * cos2,
            2.0 * reach * cos2 - 3.0 * STRAND_RADIUS * sin3 * sin2,
            3.0 * STRAND_RADIUS * cos3,
        ];
        let length = dot(tangent, tangent).sqrt();
        // The normal of the torus is orthogonal to every curve on it: no correction is needed.
        let binormal = cross(tangent, normal).map(|c| c / length);
        Self { centre: [reach * cos2, reach * sin2, STRAND_RADIUS * sin3], normal, binormal }
    }

    /// Returns the point of the surface at an angle around the tube.
    fn point(&self, [cos, sin]: [f64; 2]) -> Vector {
        let outward = offset(self.normal.map(|c| cos * c), sin, self.binormal);
        let smooth = offset(self.centre, TUBE_RADIUS, outward);
        offset(smooth, bumps(smooth), outward)
    }
}

/// Returns the height of the bumps at a point of the smooth tube.
fn bumps(point: Vector) -> f64 {
    let (mut sum, mut frequency, mut height) = (0.0, BUMP_FREQUENCY, BUMP_HEIGHT);
    for _ in 0..BUMP_OCTAVES {
        sum += height * noise(point.map(|c| c * frequency));
        frequency *= 2.0;
        height *= BUMP_GAIN;
    }
    sum
}

/// Returns point `i` of `n` on the unit circle, almost equally spaced.
///
/// Each quadrant is the rational curve `(1 - t^2, 2 t) / (1 + t^2)`, where `t` would be the tangent of half
/// the angle. A polynomial approximates that tangent: it meets 0 and 1, and its slopes there make the spacing
/// the same on both sides of a quadrant's end.
fn circle(i: u32, n: u32) -> [f64; 2] {
    let quadrant = 4 * i / n;
    let f = f64::from(4 * i - quadrant * n) / f64::from(n);
    let f2 = f * f;
    let t = f * (0.785 + f2 * (0.144 + f2 * 0.071));
    let t2 = t * t;
    let (cos, sin) = ((1.0 - t2) / (1.0 + t2), 2.0 * t / (1.0 + t2));
    match quadrant {
        0 => [cos, sin],
        1 => [-sin, cos],
        2 => [-cos, -sin],
        _ => [sin, -cos],
    }
}

/// Returns the sum of two angles, each given as cosine and sine.
fn turn([a, b]: [f64; 2], [c, d]: [f64; 2]) -> [f64; 2] {
    [a * c - b * d, a * d + b * c]
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    #[test]
    fn round_counts_are_met_exactly() {
        for triangles in [20_000, 100_000, 1_000_000, 10_000_000, 100_000_000] {
            let (rows, columns) = size(triangles);
            assert_eq!(2 * rows * columns, triangles);
            assert!((5..=20).contains(&(rows / columns)), "{rows} x {columns}");
        }
        assert_eq!(size(0), (3, 3));
    }

    #[test]
    fn the_surface_is_closed() {
        for (rows, columns) in [(3, 3), (4, 5), (60, 7)] {
            let scene = make(rows, columns);
            let mut edges = HashMap::new();
            for [a, b, c] in scene.indices {
                for edge in [[a, b], [b, c], [c, a]] {
                    *edges.entry(edge).or_insert(0) += 1;
                }
            }
            assert!(edges.iter().all(|(&[a, b], &n)| n == 1 && edges.get(&[b, a]) == Some(&1)));
            assert_eq!(edges.len(), 2 * 3 * (rows * columns) as usize);
        }
    }

    #[test]
    fn triangles_face_outward() {
        let (rows, columns) = (400, 40);
        let scene = make(rows, columns);
        let volume: f64 = scene
            .indices
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|i| scene.positions[i as usize].map(f64::from));
                dot(a, cross(b, c)) / 6.0
            })
            .sum();
        assert!((3.0..5.0).contains(&volume), "{volume}");
    }

    #[test]
    fn circles_are_round_and_even() {
        let n = 1000;
        let step = core::f64::consts::TAU / f64::from(n);
        for i in 0..n {
            let (here, next) = (circle(i, n), circle((i + 1) % n, n));
            assert!((here[0] * here[0] + here[1] * here[1] - 1.0).abs() < 1e-15);
            let chord = (next[0] - here[0]).hypot(next[1] - here[1]);
            assert!((chord / step - 1.0).abs() < 0.01, "{i}: {}", chord / step);
        }
        assert_eq!([circle(0, 8), circle(2, 8)], [[1.0, 0.0], [-0.0, 1.0]]);
    }

    #[test]
    fn the_tube_closes_without_a_twist() {
        let (first, last) = (Station::new(circle(0, 10_000)), Station::new(circle(9999, 10_000)));
        assert!(
            dot(first.normal, last.normal) > 0.999 && dot(first.binormal, last.binormal) > 0.999
        );
    }
}
