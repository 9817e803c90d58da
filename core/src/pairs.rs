//! Eight pairs of a ray and a triangle, decided in f64 at once: the test of [`triangle`](crate::triangle) in eight
//! lanes, with the same bits.
//!
//! ```text
//! shear   each corner, so that the ray is the z axis
//! edges   two edge functions of opposite signs: a miss; one that is small beside its products: unsure
//! depth   the corners' depths, weighted by the edge functions
//! range   all corners inside the ray's range, or the hit clearly inside: a hit; the hit clearly outside: a miss;
//!         else unsure
//! ```
//!
//! The lanes do the same operations in the same order, none of them fused. Where `triangle` would compute without
//! rounding, a lane is unsure, and the pair is decided alone: one in some hundreds.
//!
//! # Hits clearly inside
//!
//! If corners lie on both sides of an end of the range, or at it, the point T where the line meets the triangle's plane
//! decides exactly (the head of `triangle`). Let S = |U + V + W|, P the largest x or y of a projection, D the largest
//! |z|, Q = P + D, and R the difference between the corners' z. No coordinate of a corner relative to the origin is
//! larger than Q, because the shear is at most 1. T is the mean of the corners, weighted by the edge functions of
//! projections without error. Let N be how much one of these differs from the computed one.
//!
//! ```text
//! N                projections move by 2^-50 Q: 4 * 2^-50 Q^2 and a little; and 2^-41 of the value
//! 3 N < 2^-21 S    if S >= 2^-24 Q^2: 3 * 4 * 2^-50 * 2^24 < 2^-22
//! weighted sum     of the corners' distances from the end: changes by at most 3 N R, because no corner is farther
//!                  than R from the end, so by less than 2^-21 R S
//! mean             its own roundings are less than 2^-48 D
//! ```
//!
//! So if S >= 2^-24 Q^2 ([`WIDE`]), and the computed depth is 2^-21 R ([`OUTSIDE`]) and 2^-36 D ([`CLEAR`]) away from
//! the end, the sum has the sign of the computed one, and T lies on the same side.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f64x8, mask32x8, mask64x8};

use crate::eight::{Eight, LANES, columns};
use crate::filter::splat;
use crate::mesh::{Triangle, TriangleMesh};
use crate::options::Cull;
use crate::ray::{Hit, Ray};
use crate::triangle::{OUTSIDE, ROUNDINGS, SMALL};

/// The least S for which the depth may decide, in parts of the square of Q.
const WIDE: f64 = 1.0 / (1 << 24) as f64;
/// The least distance of the depth from an end, in parts of D, beside [`OUTSIDE`] of R.
const CLEAR: f64 = 1.0 / (65_536.0 * 1_048_576.0);

/// The decisions on eight pairs.
pub(crate) struct Decided {
    /// Lanes with a hit, as bits.
    hits: u32,
    /// Lanes that have to be decided alone.
    pub(crate) unsure: u32,
    /// Lanes whose ray comes from the triangle's front; without meaning where there is no hit.
    fronts: u32,
    /// The `t` of each hit; any number in other lanes.
    pub(crate) t: [f32; LANES],
    u: [f32; LANES],
    v: [f32; LANES],
}

impl Decided {
    /// The lanes with a hit on a side of the triangle that is not culled.
    #[inline(always)]
    pub(crate) const fn seen(&self, cull: Cull) -> u32 {
        match cull {
            Cull::None => self.hits,
            Cull::Back => self.hits & self.fronts,
            Cull::Front => self.hits & !self.fronts,
        }
    }

    /// The hit of a lane that has one.
    #[inline(always)]
    pub(crate) fn hit(&self, lane: usize, primitive: u32) -> Hit {
        let lane = lane % LANES;
        Hit { t: self.t[lane], u: self.u[lane], v: self.v[lane], primitive }
    }
}

/// The triangles of eight pairs.
#[derive(Clone, Copy)]
pub(crate) enum Triangles<'t> {
    /// A triangle for each pair, and how many of the first pairs count. The others are read, too.
    Each { ids: [u32; LANES], count: usize },
    /// The same triangle for all pairs, and those that passed its filter, as bits. No others count.
    One { triangle: &'t Triangle, passed: u32 },
}

/// Decides up to eight pairs.
///
/// `vectorize` makes the test a function of its own, compiled for the same instructions. A group decides in several
/// places, so the compiler calls it there instead of writing it out each time.
#[inline(always)]
pub(crate) fn decide<S: Simd>(
    simd: S,
    mesh: &TriangleMesh<'_>,
    rays: [&Ray; LANES],
    triangles: Triangles<'_>,
) -> Decided {
    simd.vectorize(
        #[inline(always)]
        || decide_in_line(simd, mesh, rays, triangles),
    )
}

#[inline(always)]
fn decide_in_line<S: Simd>(
    simd: S,
    mesh: &TriangleMesh<'_>,
    rays: [&Ray; LANES],
    triangles: Triangles<'_>,
) -> Decided {
    let Eight { corners: [a, b, c], used } = match triangles {
        Triangles::Each { ids, count } => Eight::of(simd, mesh, ids, count),
        Triangles::One { triangle, passed } => {
            Eight { corners: splat(simd, triangle), used: passed }
        }
    };
    let (origin, t_min, direction, t_max) = columns(simd, rays);

    // Turn each lane so that its direction is longest along z.
    let turn = Turn::new(direction);
    let [ox, oy, oz] = wide(turn.to_z(origin));
    let [dx, dy, dz] = wide(turn.to_z(direction));
    let (shear_x, shear_y) = (dx / dz, dy / dz);
    let (origin, shear) = ([ox, oy, oz], [shear_x, shear_y]);
    let a = sheared(wide(turn.to_z(a)), origin, shear);
    let b = sheared(wide(turn.to_z(b)), origin, shear);
    let c = sheared(wide(turn.to_z(c)), origin, shear);

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
    let deepest = first.abs().max(last.abs());
    let outside = (last - first) * OUTSIDE + deepest * ROUNDINGS;
    let is_close = last.simd_ge(from)
        & first.simd_le(to)
        & along.simd_ge(from - outside)
        & along.simd_le(to + outside);

    let candidates = is_inside & (is_small | (has_area & is_close));
    let mut sure = !is_small & is_between;
    if bits(candidates & !sure) & used != 0 {
        // Some triangles reach beyond an end. Their hits may lie clearly inside.
        let width = widest(a).max(widest(b)).max(widest(c)) + deepest;
        let margin = outside + deepest * CLEAR;
        let is_clear = (first.simd_gt(from) | along.simd_gt(from + margin))
            & (last.simd_lt(to) | along.simd_lt(to - margin));
        let is_wide = area.abs().simd_ge(width * width * WIDE);
        sure |= !is_small & is_wide & is_clear;
    }
    Decided {
        hits: bits(candidates & sure) & used,
        unsure: bits(candidates & !sure) & used,
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
fn sheared<S: Simd>(
    [x, y, z]: [f64x8<S>; 3],
    origin: [f64x8<S>; 3],
    shear: [f64x8<S>; 2],
) -> [f64x8<S>; 3] {
    let (x, y, z) = (x - origin[0], y - origin[1], z - origin[2]);
    [x - shear[0] * z, y - shear[1] * z, z]
}

/// The larger coordinate of a sheared corner across the ray.
#[inline(always)]
fn widest<S: Simd>([x, y, _]: [f64x8<S>; 3]) -> f64x8<S> {
    x.abs().max(y.abs())
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

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::samples::{Random, along, line, triangle};
    use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};
    use crate::triangle::TriangleTest;

    /// Eight rays, each with the triangle of its lane; then all with the first triangle.
    #[derive(Clone, Copy)]
    struct Lanes<'a>(&'a [Ray; LANES], &'a [Triangle; LANES], &'a TriangleMesh<'a>);

    impl Kernel for Lanes<'_> {
        type Output = [Decided; 2];
        const IS_WIDE: bool = true;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [Decided; 2] {
            let Self(rays, [triangle, ..], mesh) = self;
            let each = Triangles::Each { ids: [0, 1, 2, 3, 4, 5, 6, 7], count: LANES };
            let one = Triangles::One { triangle, passed: 0xff };
            [each, one].map(|triangles| decide(simd, mesh, rays.each_ref(), triangles))
        }
    }

    fn alone(ray: &Ray, triangle: &Triangle) -> Option<[u32; 3]> {
        let hit = TriangleTest::new(ray)?.test(triangle)?;
        Some([hit.t, hit.u, hit.v].map(f32::to_bits))
    }

    /// A range that begins or ends at a `t`, near it, or anywhere, and sometimes at the largest numbers.
    fn range(random: &mut Random, t: f32) -> [f32; 2] {
        let beside =
            [0.0, 1e-9, -1e-9, 1e-7, -1e-7, 1e-6, -1e-6, 1e-3, -1e-3, 0.5][random.below(10)];
        let end = [t + t.abs() * beside, t.next_up(), t.next_down(), 0.0][random.below(4)];
        let [first, last] =
            [[f32::NEG_INFINITY, f32::INFINITY], [f32::MIN, f32::MAX]][random.below(2)];
        [[end, last], [first, end], [end, t + 1.0], [0.0, end]][random.below(4)]
    }

    /// Makes eight pairs in each round. Decides them at each level, and the eight rays with the first triangle. Checks
    /// those that are sure, and adds up the hits and the unsure lanes.
    fn check(
        rounds: u32,
        mut make: impl FnMut() -> ([Ray; LANES], [Triangle; LANES]),
    ) -> (u32, u32) {
        let rounds = if cfg!(miri) { 20 } else { rounds };
        let indices: Vec<[u32; 3]> = (0..8).map(|id| [3 * id, 3 * id + 1, 3 * id + 2]).collect();
        let (mut hits, mut unsure) = (0, 0);
        for (rays, triangles) in (0..rounds).map(|_| make()) {
            let mesh = TriangleMesh::new(triangles.as_flattened(), &indices).unwrap();
            for level in SimdLevel::available() {
                let [each, first] = dispatch(level, Lanes(&rays, &triangles, &mesh));
                let all = |decided, one| (0..LANES).map(move |lane| (decided, lane, lane * one));
                for (decided, lane, at) in all(&each, 1).chain(all(&first, 0)) {
                    let (ray, triangle) = (&rays[lane], &triangles[at]);
                    let is = |bits: u32| bits >> lane & 1 == 1;
                    // A group holds valid rays alone.
                    if !ray.is_valid() {
                        continue;
                    }
                    if is(decided.unsure) {
                        unsure += 1;
                        continue;
                    }
                    let hit = decided.hit(lane, 0);
                    let found = is(decided.hits).then(|| [hit.t, hit.u, hit.v].map(f32::to_bits));
                    assert_eq!(found, alone(ray, triangle), "{level:?} {ray:?} {triangle:?}");
                    hits += u32::from(found.is_some());
                }
            }
        }
        (hits, unsure)
    }

    /// The margins are larger than any error that turns up here: only the proof bounds them.
    #[test]
    fn lanes_that_are_sure_give_what_each_pair_gives_alone() {
        if !HAS_VECTORS {
            return;
        }
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let (hits, unsure) = check(30_000, || {
            // Near the origin or far from it, tiny or huge.
            let shift = [0.0, 0.0, 100.0, 1e5][random.below(4)];
            let scale = [1.0, 1.0, 1e-20, 1e15][random.below(4)];
            let moved = |point: [f32; 3]| point.map(|x| (x + shift) * scale);
            let near: [Triangle; LANES] = core::array::from_fn(|_| triangle(&mut random));
            let triangles = near.map(|triangle| triangle.map(moved));
            let rays = near.map(|near| {
                let (origin, direction) = line(&mut random, &near);
                let length = [1.0, 1.0, 1e-36, 1e20][random.below(4)];
                let ray = Ray::new(moved(origin), direction.map(|d| d * length));
                let whole = Ray { t_min: f32::NEG_INFINITY, ..ray };
                let triangle = near.map(moved);
                let met = TriangleTest::new(&whole).and_then(|test| test.test(&triangle));
                let [t_min, t_max] = range(&mut random, met.map_or(1.0, |met| met.t));
                Ray { t_min, t_max, ..whole }
            });
            (rays, triangles)
        });
        assert!(cfg!(miri) || (hits > 10_000 && unsure > 10_000), "{hits} {unsure}");
    }

    /// Rays that start among the corners of a triangle, as they do near a wall.
    #[test]
    fn hits_clearly_inside_the_range_are_sure_though_corners_are_not() {
        if !HAS_VECTORS {
            return;
        }
        let mut random = Random(0x2545_f491_4f6c_dd1d);
        let (hits, unsure) = check(2000, || {
            let triangles: [Triangle; LANES] =
                core::array::from_fn(|_| [random.point(), random.point(), random.point()]);
            let rays = triangles.map(|[a, b, c]| {
                let target = along(along(along([0.0; 3], a, 0.3), b, 0.3), c, 0.4);
                let direction = random.point();
                Ray::new(along(target, direction, -0.2), direction)
            });
            (rays, triangles)
        });
        assert!(unsure < hits / 50, "{hits} {unsure}");
    }
}
