//! bvh: a binary tree by binned SAH over shapes that bound themselves.
//!
//! The library's triangle test sees front faces only, so the adapter has its own for both sides. Leaves come
//! in the order in which the ray enters their boxes; the search ends at the first box that begins beyond the
//! closest hit.

use ::bvh::aabb::{Aabb, Bounded};
use ::bvh::bounding_hierarchy::BHShape;
use ::bvh::bvh::Bvh;
use ::bvh::ray::Ray as BvhRay;
use anyhow::Result;
use hgrid_core::{Hit, Ray};
use nalgebra::{Point3, Vector3};

use super::Peer;
use crate::compare::input::Input;
use crate::compare::mode::Mode;
use crate::compare::system::{System, Tracer, Use, each};

/// The system of the library's only builder.
pub(super) struct BvhSystem(pub(super) Peer);

impl System for BvhSystem {
    fn name(&self) -> String {
        self.0.name().to_owned()
    }

    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()> {
        let shape = |(corners, id): ([[f32; 3]; 3], u32)| Shape {
            corners: corners.map(Point3::from),
            id,
            node: 0,
        };
        let mut shapes: Vec<_> = input.triangles().zip(0..).map(shape).collect();
        let bvh = Bvh::build(&mut shapes);
        then(&Built { bvh, shapes })
    }
}

/// A triangle as the library takes it: with its box and the index of its leaf.
struct Shape {
    corners: [Point3<f32>; 3],
    id: u32,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> Aabb<f32, 3> {
        let [a, b, c] = self.corners;
        Aabb::with_bounds(a.inf(&b).inf(&c), a.sup(&b).sup(&c))
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Shape {
    /// Returns the `t` of a hit from either side (Möller and Trumbore 1997).
    fn intersect(&self, ray: &BvhRay<f32, 3>) -> Option<f32> {
        let [a, b, c] = self.corners;
        let (ab, ac, ao) = (b - a, c - a, ray.origin - a);
        let p = ray.direction.cross(&ac);
        let inverse = 1.0 / ab.dot(&p);
        let u = ao.dot(&p) * inverse;
        let q = ao.cross(&ab);
        let v = ray.direction.dot(&q) * inverse;
        let t = ac.dot(&q) * inverse;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some(t)
    }
}

struct Built {
    bvh: Bvh<f32, 3>,
    shapes: Vec<Shape>,
}

impl Built {
    /// Returns the closest hit up to `t_max`, or the first one found if any will do.
    fn search(&self, ray: &BvhRay<f32, 3>, t_max: f32, is_any: bool) -> Option<Hit> {
        let mut closest = Hit { t: t_max, ..Hit::MISS };
        let mut is_found = false;
        for shape in self.bvh.nearest_traverse_iterator(ray, &self.shapes) {
            if let Some(t) = shape.intersect(ray).filter(|&t| t <= closest.t) {
                closest = Hit { t, primitive: shape.id, ..Hit::MISS };
                is_found = true;
                if is_any {
                    break;
                }
            } else if closest.t < f32::INFINITY {
                let slab = ray.intersection_slice_for_aabb(&shape.aabb());
                if slab.is_some_and(|(entry, _)| entry > closest.t) {
                    break;
                }
            }
        }
        is_found.then_some(closest)
    }
}

impl Tracer for Built {
    fn intersect(&self, _: Mode, rays: &[Ray], hits: &mut [Hit]) {
        each(rays, hits, |ray| self.search(&to_bvh(ray), ray.t_max, false).unwrap_or(Hit::MISS));
    }

    fn occluded(&self, _: Mode, rays: &[Ray], occluded: &mut [u8]) {
        each(rays, occluded, |ray| self.search(&to_bvh(ray), ray.t_max, true).is_some().into());
    }
}

/// Converts a ray. The library's own constructor would normalise the direction, which would change every `t`.
fn to_bvh(ray: &Ray) -> BvhRay<f32, 3> {
    let direction = Vector3::from(ray.direction);
    let inv_direction = direction.map(|c| 1.0 / c);
    BvhRay { origin: ray.origin.into(), direction, inv_direction }
}
