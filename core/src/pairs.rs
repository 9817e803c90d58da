//! Eight pairs of a ray and a triangle, decided in f64 at once: the test of [`triangle`](crate::triangle) in eight
//! lanes, with the same bits.
//!
//! ```text
//! place   each corner, so that the ray is the z axis
//! edges   two edge functions of opposite signs: a miss; one that is small beside its products: unsure
//! depth   the corners' depths, weighted by the edge functions
//! range   all corners inside the ray's range: a hit; the hit clearly outside: a miss; else unsure
//! ```
//!
//! The lanes do the same operations in the same order, none of them fused. Where `triangle` would compute without
//! rounding, a lane is unsure, and the pair is decided alone: one in some hundreds.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f64x8, mask32x8, mask64x8};

use crate::eight::{Eight, LANES, columns};
use crate::mesh::TriangleMesh;
use crate::ray::{Hit, Ray};
use crate::triangle::{OUTSIDE, SMALL};

/// The decisions on eight pairs.
pub(crate) struct Decided {
    /// Lanes with a hit, as bits.
    pub(crate) hits: u32,
    /// Lanes that have to be decided alone.
    pub(crate) unsure: u32,
    /// Lanes whose ray comes from the triangle's front; without meaning where there is no hit.
    pub(crate) fronts: u32,
    t: [f32; LANES],
    u: [f32; LANES],
    v: [f32; LANES],
}

impl Decided {
    /// The hit of a lane that has one.
    #[inline(always)]
    pub(crate) fn hit(&self, lane: usize, primitive: u32) -> Hit {
        let lane = lane % LANES;
        Hit { t: self.t[lane], u: self.u[lane], v: self.v[lane], primitive }
    }
}

/// Decides the first `count` of eight pairs; the others are read, too.
///
/// `vectorize` makes the test a function of its own, compiled for the same instructions. A group decides in three
/// places, so the compiler calls it there instead of writing it out three times.
#[inline(always)]
pub(crate) fn decide<S: Simd>(
    simd: S,
    mesh: &TriangleMesh<'_>,
    rays: [&Ray; LANES],
    ids: [u32; LANES],
    count: usize,
) -> Decided {
    simd.vectorize(
        #[inline(always)]
        || decide_in_line(simd, mesh, rays, ids, count),
    )
}

#[inline(always)]
fn decide_in_line<S: Simd>(
    simd: S,
    mesh: &TriangleMesh<'_>,
    rays: [&Ray; LANES],
    ids: [u32; LANES],
    count: usize,
) -> Decided {
    let triangles = Eight::of(simd, mesh, ids, count);
    let (origin, t_min, direction, t_max) = columns(simd, rays);

    // Turn each lane so that its direction is longest along z.
    let turn = Turn::new(direction);
    let [ox, oy, oz] = wide(turn.to_z(origin));
    let [dx, dy, dz] = wide(turn.to_z(direction));
    let (shear_x, shear_y) = (dx / dz, dy / dz);
    let [a, b, c] = triangles.corners;
    let (origin, shear) = ([ox, oy, oz], [shear_x, shear_y]);
    let a = place(wide(turn.to_z(a)), origin, shear);
    let b = place(wide(turn.to_z(b)), origin, shear);
    let c = place(wide(turn.to_z(c)), origin, shear);

    // Compute the edge functions; drop lanes that have two of opposite signs.
    let zero = f64x8::splat(simd, 0.0);
    let ((u, u_small), (v, v_small), (w, w_small)) = (edge(c, b), edge(a, c), edge(b, a));
    let any_negative = u.simd_lt(zero) | v.simd_lt(zero) | w.simd_lt(zero);
    let any_positive = u.simd_gt(zero) | v.simd_gt(zero) | w.simd_gt(zero);
    let is_inside = !(any_negative & any_positive);
    let is_small = u_small | v_small | w_small;
    let area = u + v + w;
    let has_area = area.abs().simd_gt(zero) & area.abs().simd_lt(f64x8::splat(simd, f64::INFINITY));

    // Interpolate the depth.
    let share = f64x8::splat(simd, 1.0) / area;
    let weights = [u * share + zero, v * share + zero, w * share + zero];
    let depth = weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2];

    // Compare the corners' depths with the ends of the range, growing along the ray.
    let most = f32x8::splat(simd, f32::MAX);
    let t_min = t_min.simd_gt(-most).select(t_min, -most);
    let t_max = t_max.simd_lt(most).select(t_max, most);
    let length = dz.abs();
    let (from, to) = (numbers(t_min) * length, numbers(t_max) * length);
    let (low, high) = (a[2].min(b[2]).min(c[2]), a[2].max(b[2]).max(c[2]));
    let is_forward = dz.simd_gt(zero);
    let first = is_forward.select(low, -high);
    let last = is_forward.select(high, -low);
    let along = is_forward.select(depth, -depth);
    let is_between = first.simd_gt(from) & last.simd_lt(to);
    let outside = (last - first) * OUTSIDE;
    let is_close = last.simd_ge(from)
        & first.simd_le(to)
        & along.simd_ge(from - outside)
        & along.simd_le(to + outside);

    let of_count = (1_u32 << count.min(LANES)) - 1;
    let of_count = of_count & triangles.used;
    let candidates = is_inside & (is_small | (has_area & is_close));
    let sure = !is_small & is_between;
    Decided {
        hits: bits(candidates & sure) & of_count,
        unsure: bits(candidates & !sure) & of_count,
        fronts: !(bits(area.simd_gt(zero)) ^ bits(is_forward)),
        t: (rounded(depth / dz).max(t_min).min(t_max) + 0.0).into(),
        u: rounded(weights[1]).into(),
        v: rounded(weights[2]).into(),
    }
}

/// The lanes whose direction is longest along x, and those along y.
#[derive(Clone, Copy)]
struct Turn<S: Simd> {
    is_x: mask32x8<S>,
    is_y: mask32x8<S>,
}

impl<S: Simd> Turn<S> {
    #[inline(always)]
    fn new(direction: [f32x8<S>; 3]) -> Self {
        let [x, y, z] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        let is_x = x.simd_gt(y) & x.simd_gt(z);
        let is_y = !x.simd_gt(y) & y.simd_gt(z);
        Self { is_x, is_y }
    }

    /// The axes so that the longest is the last; the others follow cyclically.
    #[inline(always)]
    fn to_z(self, [x, y, z]: [f32x8<S>; 3]) -> [f32x8<S>; 3] {
        [self.choose(y, z, x), self.choose(z, x, y), self.choose(x, y, z)]
    }

    #[inline(always)]
    fn choose(self, of_x: f32x8<S>, of_y: f32x8<S>, of_z: f32x8<S>) -> f32x8<S> {
        self.is_x.select(of_x, self.is_y.select(of_y, of_z))
    }
}

// Functions, not closures: a closure gets the instructions of its caller only where it is inlined.

/// A corner relative to the ray, sheared so that the ray is the z axis.
#[inline(always)]
fn place<S: Simd>(
    [x, y, z]: [f64x8<S>; 3],
    origin: [f64x8<S>; 3],
    shear: [f64x8<S>; 2],
) -> [f64x8<S>; 3] {
    let (x, y, z) = (x - origin[0], y - origin[1], z - origin[2]);
    [x - shear[0] * z, y - shear[1] * z, z]
}

/// An edge function, and the lanes in which it is small beside its products.
#[inline(always)]
fn edge<S: Simd>(p: [f64x8<S>; 3], q: [f64x8<S>; 3]) -> (f64x8<S>, mask64x8<S>) {
    let product = p[0] * q[1];
    let edge = product - p[1] * q[0];
    (edge, edge.abs().simd_le(product.abs() * SMALL))
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "eight bits")]
fn bits<S: Simd>(mask: mask64x8<S>) -> u32 {
    mask.to_bitmask() as u32
}

#[inline(always)]
fn numbers<S: Simd>(lanes: f32x8<S>) -> f64x8<S> {
    let (low, high) = lanes.widen();
    low.combine(high)
}

/// The nearest f32s.
#[inline(always)]
fn rounded<S: Simd>(lanes: f64x8<S>) -> f32x8<S> {
    let (low, high) = lanes.split();
    low.narrow(high)
}

#[inline(always)]
fn wide<S: Simd>([x, y, z]: [f32x8<S>; 3]) -> [f64x8<S>; 3] {
    [numbers(x), numbers(y), numbers(z)]
}
