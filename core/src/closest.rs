//! The point of a mesh that is closest to a point.
//!
//! A tree is searched nearest child first ([`bvh`](crate::bvh)). In a grid, a box around the point starts with the
//! cells next to the point and doubles until it holds a triangle. The last box reaches as far as the closest triangle
//! found.
//!
//! ```text
//! +-----------------------+
//! |       +-------+       |     found a in the second box, but b could be closer: the last box
//! |    a  |   x   |       |     reaches as far as a, all around
//! |       +-------+       |
//! +-----------------------+ b
//! ```

use glam::{DVec3, Vec3A};

use crate::aabb::Aabb;
use crate::counters::Counters;
use crate::grid::Grid;
use crate::mesh::Triangle;
use crate::options::{QueryOptions, Selection};
use crate::ray::{INVALID_ID, round};

/// The point of a mesh that is closest to a point: 28 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoint {
    /// The point, in scene units.
    pub position: [f32; 3],
    /// Distance from the given point, in scene units.
    pub distance: f32,
    /// Weight of the triangle's second vertex, 0 to 1.
    pub u: f32,
    /// Weight of the triangle's third vertex, 0 to 1.
    pub v: f32,
    /// Id of the triangle.
    pub primitive: u32,
}

impl ClosestPoint {
    /// The point of one triangle that is closest to a point. [`Grid::closest_point`] is the closest of these.
    ///
    /// `None` if a coordinate is not finite, a corner is beyond [`MAX_COORDINATE`](crate::MAX_COORDINATE), or the
    /// distance is above `f32::MAX`. A triangle without area has points, too.
    ///
    /// ```
    /// use hgrid_core::ClosestPoint;
    /// let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let point = ClosestPoint::on_triangle(&triangle, 7, [0.25, 0.5, 3.0]).unwrap();
    /// assert_eq!((point.distance, point.u, point.v, point.primitive), (3.0, 0.25, 0.5, 7));
    /// ```
    #[must_use]
    pub fn on_triangle(triangle: &Triangle, primitive: u32, point: [f32; 3]) -> Option<Self> {
        Self::on_corners(triangle.map(Vec3A::from_array), primitive, point)
    }

    #[inline(always)]
    fn on_corners(corners: [Vec3A; 3], primitive: u32, point: [f32; 3]) -> Option<Self> {
        Aabb::of(corners)?;
        let [a, b, c] = [corners[0].as_dvec3(), corners[1].as_dvec3(), corners[2].as_dvec3()];
        let p = DVec3::from_array(point.map(f64::from));
        let [v, w] = weights(a, b - a, c - a, p);
        let closest = a + (b - a) * v + (c - a) * w;
        let distance = round((closest - p).length());
        let position = closest.to_array().map(round);
        let (u, v) = (round(v), round(w));
        distance.is_finite().then_some(Self { position, distance, u, v, primitive })
    }

    /// Returns true if this point is reported rather than the other: closer, then of a lower id.
    fn is_closer(&self, other: &Self) -> bool {
        self.distance < other.distance
            || (self.distance <= other.distance && self.primitive < other.primitive)
    }

    /// Becomes the point of a selected triangle that is closest to a point, if it is closer.
    #[inline]
    fn offer(&mut self, id: u32, point: [f32; 3], selection: &Selection<'_>) {
        if selection.has(id)
            && let Some(corners) = selection.mesh.corners(id)
            && let Some(found) = Self::on_corners(corners, id, point)
            && found.is_closer(self)
        {
            *self = found;
        }
    }
}

/// The weights of b and c in the point of a triangle that is closest to p: a corner, or straight below p if that is
/// inside, or else on the closest of the edges. A triangle without area has only corners and edges.
///
/// The normal is off by about 2^-51 |ab| |ac|, so the place below p is off by about 2^-50 |p - a| over the sine of the
/// angle at a. If that angle is small ([`NARROW`]), every place inside is close to an edge, so the closer of both is
/// taken. Its distance, and that of a corner, is off by no more than 2^-25 of the larger of |p - a| and the longest
/// side.
fn weights(a: DVec3, ab: DVec3, ac: DVec3, p: DVec3) -> [f64; 2] {
    let ap = p - a;
    // `ab_c` is the product of edge ab with p - c, and so on; `ab_ac` that of two edges.
    let (ab_ab, ab_ac, ac_ac) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
    let (ab_a, ac_a) = (ab.dot(ap), ac.dot(ap));
    let (ab_b, ac_b) = (ab_a - ab_ab, ac_a - ab_ac);
    let (ab_c, ac_c) = (ab_a - ab_ac, ac_a - ac_ac);
    // Beyond a corner in the directions of both of its edges, that corner is the closest.
    if ab_a <= 0.0 && ac_a <= 0.0 {
        return [0.0, 0.0];
    }
    if ab_b >= 0.0 && ac_b <= ab_b {
        return [1.0, 0.0];
    }
    if ac_c >= 0.0 && ab_c <= ac_c {
        return [0.0, 1.0];
    }

    let normal = ab.cross(ac);
    let (of_b, of_c) = (normal.dot(ap.cross(ac)), normal.dot(ab.cross(ap)));
    let all = normal.length_squared();
    let is_inside = of_b > 0.0 && of_c > 0.0 && of_b + of_c < all;
    let below = [of_b / all, of_c / all];
    if is_inside && all > NARROW * (ab_ab * ac_ac) {
        return below;
    }

    let (bc, bp, cp) = (ac - ab, ap - ab, ap - ac);
    let along_bc = share(bc.dot(bp), -bc.dot(cp));
    let edges = [[share(ab_a, -ab_b), 0.0], [0.0, share(ac_a, -ac_c)], [1.0 - along_bc, along_bc]];
    let distance = |[v, w]: [f64; 2]| (ap - ab * v - ac * w).length_squared();
    let [first, second, third] = edges;
    let closer = |a, b| if distance(b) < distance(a) { b } else { a };
    let on_edge = closer(closer(first, second), third);
    if is_inside { closer(on_edge, below) } else { on_edge }
}

/// An angle is small if the square of its sine is at most this: 2^-20.
const NARROW: f64 = 1.0 / 1_048_576.0;

/// Returns the place on an edge, from 0 to 1, of a point that is this far behind
/// its start and before its end.
fn share(behind: f64, before: f64) -> f64 {
    if behind <= 0.0 {
        0.0
    } else if before <= 0.0 {
        1.0
    } else {
        behind / (behind + before)
    }
}

impl Grid<'_> {
    /// The point of the mesh that is closest to a point, and no farther than `max_distance`; where
    /// several triangles are equally close, that of the lowest id.
    ///
    /// [`Method::Bvh`](crate::Method::Bvh) visits the nodes that are no farther than the answer, wherever the point
    /// lies. With the other methods the time grows with the triangles in a cube around the point that reaches as far
    /// as the answer: few near the mesh, a good part of all far outside of it.
    ///
    /// Of the options, only the mask, the triangle to skip and the counters apply. A cell step is a list or a leaf, a
    /// grid step a node of a tree. A point or a distance that is NaN, an infinite point and a negative distance find
    /// nothing. A triangle whose distance is beyond the range of f32 is not found.
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// let closest = grid.closest_point([0.5, 0.25, 3.0], 10.0, &mut QueryOptions::default());
    /// let closest = closest.expect("3 away");
    /// assert_eq!((closest.distance, closest.position), (3.0, [0.5, 0.25, 0.0]));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn closest_point(
        &self,
        point: [f32; 3],
        max_distance: f32,
        options: &mut QueryOptions<'_>,
    ) -> Option<ClosestPoint> {
        let is_question = point.iter().all(|c| c.is_finite()) && max_distance >= 0.0;
        if !is_question {
            return None;
        }
        let selection = Selection::new(self.mesh(), options);
        let mut work = Counters::default();
        let farthest =
            ClosestPoint { distance: max_distance, primitive: INVALID_ID, ..ClosestPoint::NONE };
        let mut best = farthest;
        let test = |id: u32| {
            best.offer(id, point, &selection);
            best.distance
        };
        if !self.visit_nearest(point, max_distance, test, &mut work) {
            self.grow(point, &selection, &mut best, &mut work);
        }
        options.count(&work);
        (best.primitive != INVALID_ID).then_some(best)
    }

    /// Looks in boxes around a point that grow until nothing outside can be closer than `best`.
    fn grow(
        &self,
        point: [f32; 3],
        selection: &Selection<'_>,
        best: &mut ClosestPoint,
        work: &mut Counters,
    ) {
        // Begin with the cells around the point, or around the place where the box is closest to it.
        let center = DVec3::from_array(point.map(f64::from));
        let (min, max) = self.bounds();
        let [min, max] = [min, max].map(|corner| DVec3::from_array(corner.map(f64::from)));
        let outside = (min - center).max(center - max).max(DVec3::ZERO).max_element();
        // Grow by no less than what changes a sum in f64 so far out.
        let mut inside = f64::from(self.cell_size().max_element()).max(outside * LEAST_PART);
        let mut reach = outside + inside;
        loop {
            self.visit(&around(center, reach), &mut |ids| {
                work.cell_steps += 1;
                work.primitive_tests += ids.len() as u64;
                for &id in ids {
                    best.offer(id, point, selection);
                }
            });
            let is_all = (center - reach).cmple(min).all() && (center + reach).cmpge(max).all();
            // Include all points whose distance rounds to that of `best`, which is `max_distance` until a point is
            // found.
            let needed = f64::from(best.distance.next_up());
            if needed <= reach || is_all {
                break;
            }
            inside *= 2.0;
            reach =
                if best.primitive == INVALID_ID { (outside + inside).min(needed) } else { needed };
        }
    }
}

impl ClosestPoint {
    const NONE: Self =
        Self { position: [0.0; 3], distance: 0.0, u: 0.0, v: 0.0, primitive: INVALID_ID };
}

/// A smaller part of a distance may be lost when it is added to the distance.
const LEAST_PART: f64 = 1.0 / 1_125_899_906_842_624.0; // 2^-50

/// A cube around a point, rounded outwards.
fn around(center: DVec3, reach: f64) -> Aabb {
    let low = (center - reach).to_array().map(|c| round(c).next_down());
    let high = (center + reach).to_array().map(|c| round(c).next_up());
    Aabb { min: low.into(), max: high.into() }
}
