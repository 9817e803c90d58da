//! Spheres as user geometry: the functions that Embree calls for their boxes and hits.
//!
//! Embree hands over one ray, or a packet of rays that meet the box of a sphere, stored number by number. The
//! comparison only reads distance and primitive, so normals and instances stay as they are.

use core::ffi::{c_int, c_void};

use hgrid_core::Ray;

use crate::compare::input::Input;
use crate::compare::peers::embree::ffi::{BoundsArguments, ShapeArguments};
use crate::compare::spheres::Sphere;

/// The count of numbers of a ray, and of a ray with its hit.
const RAY: usize = 12;
const RAY_AND_HIT: usize = 20;

/// The rows of a ray's numbers: the first of three, or the only one.
const ORIGIN: usize = 0;
const NEAR: usize = 3;
const DIRECTION: usize = 4;
const FAR: usize = 8;

/// The rows of its hit's numbers.
const U: usize = 15;
const V: usize = 16;
const PRIMITIVE: usize = 17;
const GEOMETRY: usize = 18;

/// Writes the box of a sphere.
pub(in super::super) unsafe extern "C" fn bounds(arguments: *const BoundsArguments) {
    // SAFETY: Embree passes arguments that live as long as the call.
    let arguments = unsafe { &*arguments };
    // SAFETY: the user data is the input that `Device::build_spheres` gave, which outlives the scene.
    let input = unsafe { &*arguments.user.cast::<Input>() };
    let Some(sphere) = input.spheres().get(arguments.primitive as usize) else { return };
    // SAFETY: only this reference to the box is used during the call.
    let bounds = unsafe { &mut *arguments.bounds };
    let [x, y, z, to_x, to_y, to_z] = sphere.box_of();
    (bounds.lower, bounds.upper) = ([x, y, z], [to_x, to_y, to_z]);
}

/// Finds hits of rays on a sphere that are closer than the earlier ones.
pub(in super::super) unsafe extern "C" fn intersect(arguments: *const ShapeArguments) {
    // SAFETY: Embree passes arguments that live as long as the call.
    let arguments = unsafe { &*arguments };
    match arguments.lanes {
        1 => intersect_lanes::<1>(arguments),
        4 => intersect_lanes::<4>(arguments),
        8 => intersect_lanes::<8>(arguments),
        16 => intersect_lanes::<16>(arguments),
        // Embree's packets have no other lengths. Rays of another length would miss, and be counted as differing.
        _ => {}
    }
}

/// Marks the rays that a sphere occludes with a far end of minus infinity.
pub(in super::super) unsafe extern "C" fn occluded(arguments: *const ShapeArguments) {
    // SAFETY: Embree passes arguments that live as long as the call.
    let arguments = unsafe { &*arguments };
    match arguments.lanes {
        1 => occluded_lanes::<1>(arguments),
        4 => occluded_lanes::<4>(arguments),
        8 => occluded_lanes::<8>(arguments),
        16 => occluded_lanes::<16>(arguments),
        // As in `intersect`.
        _ => {}
    }
}

/// The numbers of rays: a row for each kind of number.
type Rows<const LANES: usize, const KINDS: usize> = [[u32; LANES]; KINDS];

fn intersect_lanes<const LANES: usize>(arguments: &ShapeArguments) {
    let ShapeArguments { primitive, geometry, .. } = *arguments;
    each_hit::<LANES, RAY_AND_HIT>(arguments, |rows, lane, t| {
        rows[FAR][lane] = t.to_bits();
        rows[U][lane] = 0.0_f32.to_bits();
        rows[V][lane] = 0.0_f32.to_bits();
        rows[PRIMITIVE][lane] = primitive;
        rows[GEOMETRY][lane] = geometry;
    });
}

fn occluded_lanes<const LANES: usize>(arguments: &ShapeArguments) {
    each_hit::<LANES, RAY>(arguments, |rows, lane, _| {
        rows[FAR][lane] = f32::NEG_INFINITY.to_bits();
    });
}

/// Tests a sphere for every active ray, and calls `found` for each hit.
#[inline(always)]
fn each_hit<const LANES: usize, const KINDS: usize>(
    arguments: &ShapeArguments,
    mut found: impl FnMut(&mut Rows<LANES, KINDS>, usize, f32),
) {
    let ShapeArguments { valid, user, rays, .. } = *arguments;
    let Some(sphere) = sphere(user, arguments.primitive) else { return };
    // SAFETY: there is a mark for each of the rays.
    let valid = unsafe { &*valid.cast::<[c_int; LANES]>() };
    // SAFETY: `KINDS` rows of `LANES` numbers follow one another, and only this reference to them is used
    // during the call.
    let rows = unsafe { &mut *rays.cast::<Rows<LANES, KINDS>>() };
    for (lane, mark) in valid.iter().enumerate() {
        if *mark == 0 {
            continue;
        }
        let number = |kind: usize| f32::from_bits(rows[kind][lane]);
        let three = |kind: usize| [number(kind), number(kind + 1), number(kind + 2)];
        let ray = Ray {
            origin: three(ORIGIN),
            t_min: number(NEAR),
            direction: three(DIRECTION),
            t_max: number(FAR),
        };
        if let Some(hit) = sphere.meet(&ray) {
            found(rows, lane, hit.t);
        }
    }
}

/// Returns the sphere with a number.
#[inline(always)]
fn sphere<'a>(user: *mut c_void, primitive: u32) -> Option<&'a Sphere> {
    // SAFETY: the user data is the input that `Device::build_spheres` gave, which outlives the scene.
    let input = unsafe { &*user.cast::<Input>() };
    input.spheres().get(primitive as usize)
}
