//! The closest point of the surface. Embree finds the triangles, and the caller computes the distance to
//! each: in f32 here, as in Embree's own example.

use core::ffi::c_void;
use core::ptr;

use glam::Vec3A;

use crate::compare::input::Input;
use crate::compare::peers::embree::device::Scene;
use crate::compare::peers::embree::ffi::{self, PointArguments, PointContext, PointQuery};

impl Scene<'_> {
    /// `rtcPointQuery` for each point.
    pub(in super::super) fn distances(
        &self,
        points: &[[f32; 3]],
        radius: f32,
        distances: &mut [f32],
    ) {
        let mut context = PointContext {
            world_to_instance: [0.0; 16],
            instance_to_world: [0.0; 16],
            inst_id: [ffi::INVALID_ID],
            stack_size: 0,
        };
        let user: *mut c_void = ptr::from_ref(self.input()).cast_mut().cast();
        for (&point, distance) in points.iter().zip(distances) {
            let mut query = PointQuery { point, time: 0.0, radius };
            // SAFETY: the scene is committed; the structs are those of the header, aligned; `closer`
            // only reads the input, which outlives the scene.
            let is_found = unsafe {
                ffi::rtcPointQuery(self.handle(), &raw mut query, &raw mut context, closer, user)
            };
            *distance = if is_found { query.radius } else { f32::INFINITY };
        }
    }
}

/// Shrinks the radius if a triangle is closer, and returns true if it is.
unsafe extern "C" fn closer(arguments: *mut PointArguments) -> bool {
    // SAFETY: nothing else uses the arguments that Embree passes.
    let arguments = unsafe { &*arguments };
    // SAFETY: the pointer is the one that `distances` gave.
    let input = unsafe { &*arguments.user.cast::<Input>() };
    // SAFETY: the query lives as long as the call, and only this reference to it is used during the call.
    let query = unsafe { &mut *arguments.query };
    let Some(&triangle) = input.indices().get(arguments.primitive as usize) else { return false };
    let corners = triangle.map(|at| input.positions().get(at as usize).copied());
    let [Some(a), Some(b), Some(c)] = corners else { return false };
    let point = Vec3A::from(query.point);
    let distance = closest_on([a, b, c].map(Vec3A::from), point).distance(point);
    let is_closer = distance < query.radius;
    if is_closer {
        query.radius = distance;
    }
    is_closer
}

/// Returns the point of a triangle that is closest to a point (Ericson 2005, 5.1.5).
fn closest_on([a, b, c]: [Vec3A; 3], p: Vec3A) -> Vec3A {
    let (ab, ac) = (b - a, c - a);
    let ap = p - a;
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + d1 / (d1 - d3) * ab;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + d2 / (d2 - d6) * ac;
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
    }
    let inverse = 1.0 / (va + vb + vc);
    a + vb * inverse * ab + vc * inverse * ac
}
