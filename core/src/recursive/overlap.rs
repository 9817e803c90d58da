//! Conservative triangle-box overlap in f32, after Akenine-Möller (2001).
//!
//! Departures: it tests ten of the thirteen axes, because the caller has compared the boxes, and it allows for
//! rounding.
//!
//! Coordinates are in the root's cells, so that lengths are of the order of one at any scale of the scene. Scaling
//! the axes does not change which triangles overlap which boxes.

use glam::Vec3A;

/// A triangle prepared for tests against many boxes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Overlap {
    corners: [Vec3A; 3],
    edges: [Vec3A; 3],
    normal: Vec3A,
    /// Error bound of the plane of a thin triangle, for each unit of distance from the triangle.
    slack: f32,
}

impl Overlap {
    pub(super) fn new(corners: [Vec3A; 3]) -> Self {
        let [a, b, c] = corners;
        let edges = [b - a, c - b, a - c];
        let reach = edges[0].abs().max_element() * edges[1].abs().max_element();
        let slack = 8.0 * f32::EPSILON * reach;
        Self { corners, edges, normal: edges[0].cross(edges[1]), slack }
    }

    /// Returns true if the triangle and a box share a point. The triangle's own box must overlap it.
    pub(super) fn with(&self, center: Vec3A, half: Vec3A) -> bool {
        let [a, b, c] = self.corners.map(|corner| corner - center);

        // The plane must cut the box.
        let slack = self.slack * a.abs().max_element();
        if self.normal.dot(a).abs() > half.dot(self.normal.abs()) + slack {
            return false;
        }
        // No axis across an edge of the triangle and one of the box may separate them: x, y and z of e.cross(unit) at
        // once.
        self.edges.iter().all(|&edge| {
            let [p, q, r] = [a, b, c].map(|corner| corner.cross(edge));
            let (min, max) = (p.min(q).min(r), p.max(q).max(r));
            let reach = across(half, edge.abs());
            !(min.cmpgt(reach) | max.cmplt(-reach)).any()
        })
    }
}

/// Returns the reach of a box along each axis `unit.cross(edge)`.
fn across(half: Vec3A, edge: Vec3A) -> Vec3A {
    Vec3A::new(
        half.y * edge.z + half.z * edge.y,
        half.z * edge.x + half.x * edge.z,
        half.x * edge.y + half.y * edge.x,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random;

    fn overlaps(triangle: [[f32; 3]; 3]) -> bool {
        Overlap::new(triangle.map(Vec3A::from_array)).with(Vec3A::ZERO, Vec3A::ONE)
    }

    #[test]
    fn clear_cases() {
        assert!(overlaps([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]));
        assert!(overlaps([[-9.0, -9.0, 0.5], [9.0, -9.0, 0.5], [0.0, 9.0, 0.5]]));
        // The box of the triangle overlaps, its plane passes the corner at a distance.
        assert!(!overlaps([[3.1, 0.0, 0.0], [0.0, 3.1, 0.0], [0.0, 0.0, 3.1]]));
        assert!(overlaps([[2.9, 0.0, 0.0], [0.0, 2.9, 0.0], [0.0, 0.0, 2.9]]));
        // The plane cuts the box, but an edge axis separates.
        assert!(!overlaps([[1.5, 0.9, 0.0], [0.9, 1.5, 0.0], [1.5, 1.5, 0.1]]));
    }

    /// Thin triangles far larger than the box, through a point of it.
    #[test]
    fn never_misses_a_sliver() {
        let mut state = 5_u32;
        let mut unit =
            || f32::from(u16::try_from(random::next(&mut state) >> 16).unwrap()) / 32768.0 - 1.0;
        for width in [1e-2, 1e-3, 1e-4, 1e-5] {
            for half in [0.1, 0.01] {
                for _ in 0..300 {
                    let mut point = || Vec3A::new(unit(), unit(), unit());
                    let (a, b, aside, at) =
                        (point() * 6.0, point() * 6.0, point() * width, point());
                    let triangle = [a, b, b + aside];
                    let (u, v) = (at.x.abs() * 0.5, at.y.abs() * 0.5);
                    let inside = a + (b - a) * u + (b + aside - a) * v;
                    let center = inside + at * half * 0.99;
                    let overlap = Overlap::new(triangle);
                    assert!(overlap.with(center, Vec3A::splat(half)), "{triangle:?} {center}");
                }
            }
        }
    }

    /// A grid of points of the triangle: if one is inside the box, they overlap.
    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn never_misses_a_point_inside() {
        let mut state = 3_u32;
        let mut unit =
            || f32::from(u16::try_from(random::next(&mut state) >> 16).unwrap()) / 8192.0 - 4.0;
        let (mut hits, mut misses) = (0, 0);
        for _ in 0..3000 {
            let triangle: [Vec3A; 3] = core::array::from_fn(|_| Vec3A::new(unit(), unit(), unit()));
            let [a, b, c] = triangle;
            let is_inside = (0..40_u16).any(|i| {
                (0..40 - i).any(|j| {
                    let (u, v) = (f32::from(i) / 39.0, f32::from(j) / 39.0);
                    (a + (b - a) * u + (c - a) * v).abs().max_element() <= 1.0
                })
            });
            let overlaps = Overlap::new(triangle).with(Vec3A::ZERO, Vec3A::ONE);
            assert!(!is_inside || overlaps);
            hits += u32::from(overlaps);
            misses += u32::from(!overlaps);
        }
        assert!(hits > 300 && misses > 300);
    }
}
