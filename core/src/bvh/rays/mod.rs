//! The rays of a group as a structure of arrays, and the hit found for each.
//!
//! ```text
//! prepare     find the rays that can hit; scale directions; bound the filter's error
//! beam        the interval of all origins and inverse directions, or the box around short rays
//! slabs, filters, starts and ends    of one ray in all lanes, or of eight or sixteen rays
//! hits        decide.rs
//! ```

mod decide;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f32x16, mask32x8, u32x8};
use glam::Vec3A;
use zerocopy::FromZeros;

use super::boxes::{Beam, FEW_RAYS, SlabRays, bits, splat};
use super::per_ray::{GROUP, OCTETS, PerRay, get, interval, octet_of, sixteen};
use super::slab::{EARLIER, STEEP, TINY, WIDER};
use crate::aabb::{Aabb, greater, lesser};
use crate::approach::FAR_EXTENTS;
use crate::eight::columns;
use crate::extremes::Extremes;
use crate::filter::{LineFilter, NEARBY_LONG, NEARBY_SHORT, Size, nearby_floor, rate};
use crate::options::{Choice, Cull};
use crate::range;
use crate::ray::{Hit, Ray};

/// Rays that go down together.
#[derive(FromZeros)]
pub(crate) struct Rays {
    /// Bit `i`: ray `i` is still on its way.
    pub(crate) alive: u64,
    /// The triangles that they see.
    choice: Choice,
    /// Raises `t_min` to 0. For rays that were moved to the box of the tree, so that nothing lies behind their origins.
    pub(crate) starts_at_box: bool,
    /// The most that origins may be off, as a length: they are given in f64 and were rounded. 0 for rays in f32.
    pub(crate) origin_error: f32,
    /// True if some origins lie inside the box, so that their rays may leave one of its triangles, and if the rays are
    /// not those of a camera.
    pub(super) may_leave: bool,
    /// True if a triangle may end the rays that surely hit it: they see both of its sides, and the tree is not too
    /// large for that test.
    pub(super) may_block: bool,
    /// The extent of the box that the rays were prepared for.
    extent: f32,
    /// The filter's floor in that box, and the largest rate of a ray.
    floor: f32,
    rate: f32,
    /// The point that boxes and origins are relative to: the origin of the first ray that was ready. It stays the same
    /// when that ray ends.
    pub(crate) center: [f32; 3],
    /// The largest magnitude of a coordinate of an origin relative to `center`.
    farthest: f32,
    /// The growth of boxes: eight roundings of `farthest`, and `origin_error`.
    pub(crate) growth: f32,
    inverse: [PerRay; 3],
    /// Minus the origin, relative to the centre, times the inverse direction.
    offset: [PerRay; 3],
    /// The least and the greatest coordinate of the origins, relative to the centre, on each axis.
    origins: [[f32; 2]; 3],
    start: PerRay,
    end: PerRay,
    /// For the filter, with origins that are not relative.
    anchor: [PerRay; 3],
    direction: [PerRay; 3],
    /// Factor from `t` to scaled distance.
    scale: PerRay,
    /// The start of each ray as a scaled distance, not widened.
    given_start: PerRay,
    given: [Ray; GROUP],
    /// The closest hit of each ray so far. Before the first it is a miss, of which
    /// [`take_until`](Self::take_until) may have set the `t`.
    pub(crate) hits: [Hit; GROUP],
    /// Pairs of a ray and a triangle that passed the filter.
    pair_lanes: [u32; PAIRS],
    pair_ids: [u32; PAIRS],
    pair_count: usize,
}

/// Eight roundings of a number, in parts of it.
const ROUNDINGS: f32 = 8.0 * UNIT;

/// In trees of larger extent, products with [`STEEP`] may overflow.
const MOST_EXTENT: f32 = 16_777_216.0 * 16_777_216.0; // 2^48

/// Pairs that are decided at once.
const PAIRS: usize = 8;

/// 2^-24: how much rounding to f32 changes a number, in parts of it.
const UNIT: f32 = 1.0 / 16_777_216.0;

/// More than what underflows on the way to the end of a ray and to a side of a box.
const UNDERFLOW: f32 = 8.0 * TINY;

impl Rays {
    /// No rays yet.
    #[inline(always)]
    pub(crate) fn new(choice: Choice) -> Self {
        // All zeros: the compiler fills a struct with these faster than one with other numbers.
        let mut rays = Self::new_zeroed();
        rays.choice = choice;
        rays
    }

    /// Returns the slots that rays are put in before [`prepare`](Self::prepare).
    pub(crate) fn slots(&mut self) -> &mut [Ray] {
        &mut self.given
    }

    /// Prepares the first `count` rays for triangles inside `bounds`. Returns a mask of the valid rays that must be
    /// traced alone: the origin is far away, the start is negative, or the direction is too long or too short for f32.
    #[inline(always)]
    pub(crate) fn prepare<S: Simd>(&mut self, simd: S, count: usize, bounds: &Aabb) -> u64 {
        let (mut alive, mut special) = (0, 0);
        let middle = ((bounds.min + bounds.max) * 0.5).to_array();
        let size = bounds.size();
        let extent = size.max_element();
        self.extent = extent;
        self.floor = nearby_floor(extent);
        self.may_block = self.choice.cull == Cull::None && extent <= range::MOST_EXTENT;
        // In a tree of huge extent no ray counts as near: all are traced alone.
        let near = if extent < MOST_EXTENT { FAR_EXTENTS * extent } else { -1.0 };
        let near = f32x8::splat(simd, near);
        let zero = f32x8::splat(simd, 0.0);
        let mut sum = zero;
        let finite = f32x8::splat(simd, f32::INFINITY);
        self.hits = [Hit::MISS; GROUP];
        self.pair_count = 0;
        for octet in 0..count.div_ceil(8).min(OCTETS) {
            let rays = self.given.as_chunks::<8>().0[octet];
            let (origin, t_min, direction, t_max) = columns(simd, rays.each_ref());
            let [x, y, z] = direction;
            let longest = x.abs().greater(y.abs()).greater(z.abs());

            // Find the rays that can hit anything, and those that must be traced alone.
            let [a, b, c] = origin;
            let is_finite = a.abs().simd_lt(finite)
                & b.abs().simd_lt(finite)
                & c.abs().simd_lt(finite)
                & longest.simd_lt(finite)
                & x.simd_eq(x)
                & y.simd_eq(y)
                & z.simd_eq(z);
            let is_valid = is_finite & longest.simd_gt(zero) & t_min.simd_le(t_max);
            let [a, b, c] = [(a - middle[0]).abs(), (b - middle[1]).abs(), (c - middle[2]).abs()];
            // `SlabRay` has a margin for boxes behind the start; groups have none.
            let start = if self.starts_at_box { t_min.greater(zero) } else { t_min };
            let is_near = a.greater(b).greater(c).simd_le(near)
                & start.simd_ge(zero)
                & longest.simd_gt(f32x8::splat(simd, NEARBY_SHORT))
                & longest.simd_lt(f32x8::splat(simd, NEARBY_LONG));
            let of_count = bits_below(count - 8 * octet);
            let valid = u64::from(bits(is_valid)) & of_count;
            let is_ready = is_valid & is_near;
            let ready = u64::from(bits(is_ready)) & of_count;
            alive |= ready << (8 * octet);
            special |= (valid & !ready) << (8 * octet);

            // Scale directions by powers of two: the largest component lies between 1 and 2.
            let exponent = longest.bitcast::<u32x8<S>>() & 0x7f80_0000;
            let scale = exponent.bitcast::<f32x8<S>>();
            let inverse_scale = (u32x8::splat(simd, 0x7f00_0000) - exponent).bitcast::<f32x8<S>>();
            let scaled = [x * inverse_scale, y * inverse_scale, z * inverse_scale];
            let [a, b, c] = scaled;
            sum = sum.greater(is_ready.select(a.abs() + b.abs() + c.abs(), zero));
            let steep = f32x8::splat(simd, STEEP);
            for axis in 0..3 {
                let direction = scaled[axis];
                let inverse = f32x8::splat(simd, 1.0) / direction;
                let is_less = inverse.abs().simd_le(steep);
                let inverse = is_less.select(inverse, steep.copysign(direction));
                self.inverse[axis][octet] = inverse.into();
                self.direction[axis][octet] = direction.into();
                self.anchor[axis][octet] = origin[axis].into();
            }
            // The caller's range is decided exactly: it needs no room for the error of a hit's `t`.
            let most = f32x8::splat(simd, f32::MAX);
            let (start, end) = ((start * scale).lesser(most), t_max * scale);
            let tiny = scale.greater(f32x8::splat(simd, 1.0)) * TINY;
            self.start[octet] = (start - (start.abs() * EARLIER + tiny)).into();
            self.end[octet] = (end + (end.abs() * (WIDER - 1.0) + tiny)).into();
            self.scale[octet] = scale.into();
            self.given_start[octet] = (t_min * scale).into();
        }
        self.rate = rate(sum.reduce_max());
        self.alive = alive;
        self.recenter(simd);
        let [x, y, z] = self.origins;
        let center = Vec3A::from(self.center);
        let (low, high) = (Vec3A::new(x[0], y[0], z[0]), Vec3A::new(x[1], y[1], z[1]));
        let origins = Aabb { min: center + low, max: center + high };
        self.may_leave = range::pays(bounds, &origins);
        special
    }

    /// Returns true if some origin lies farther from that of the first ray than a part of the extent.
    pub(super) fn are_apart(&self, part: f32) -> bool {
        self.farthest > part * self.extent
    }

    /// The end of a ray, as a distance.
    #[inline(always)]
    pub(super) fn end_of(&self, ray: u32) -> f32 {
        get(&self.end, ray)
    }

    /// Measures origins from that of the first ray. A ray that is not alive gets the numbers of the first, so that it
    /// widens no interval.
    #[inline(always)]
    fn recenter<S: Simd>(&mut self, simd: S) {
        let first = self.alive.trailing_zeros();
        self.center = self.given[first as usize % GROUP].origin;
        let mut farthest = 0.0;
        for axis in 0..3 {
            let zero = f32x8::splat(simd, 0.0);
            let (mut low, mut high) = (zero, zero);
            let center = f32x8::splat(simd, self.center[axis]);
            let inverse_of_first = f32x8::splat(simd, get(&self.inverse[axis], first));
            for octet in 0..OCTETS {
                let is_alive = mask32x8::from_bitmask(simd, self.alive >> (8 * octet));
                let origin = f32x8::simd_from(simd, self.anchor[axis][octet]) - center;
                let origin = is_alive.select(origin, zero);
                (low, high) = (low.lesser(origin), high.greater(origin));
                let inverse = f32x8::simd_from(simd, self.inverse[axis][octet]);
                let inverse = is_alive.select(inverse, inverse_of_first);
                self.inverse[axis][octet] = inverse.into();
                self.offset[axis][octet] = (-(origin * inverse)).into();
            }
            // The first ray's coordinate is 0.
            let (low, high) = (low.reduce_min(), high.reduce_max());
            self.origins[axis] = [low, high];
            farthest = greater(farthest, greater(-low, high));
        }
        self.farthest = farthest;
        self.growth = farthest * ROUNDINGS + self.origin_error;
    }

    /// All rays as one beam, before any of them is done.
    #[inline(always)]
    pub(crate) fn beam<S: Simd>(&self, simd: S) -> Beam<S> {
        // Find the intervals of the inverse directions, and the axes on which all have one sign.
        let [a, b, c] = self.origins;
        let [d, e, f] = &self.inverse;
        let inverses = [interval(simd, d), interval(simd, e), interval(simd, f)];
        let [x, y, z] = inverses;
        let is_positive = inverses.map(|[low, _]| low > 0.0);
        let is_bounded = inverses.map(|[low, high]| low > 0.0 || high < 0.0);
        // Order the origins: a ray from the first reaches a side earlier.
        let order = |[low, high]: [f32; 2], axis: usize| {
            if is_positive[axis] { [high, low] } else { [low, high] }
        };
        let (a, b, c) = (order(a, 0), order(b, 1), order(c, 2));
        // Find the first start and the last end.
        let first = f32x8::splat(simd, get(&self.start, self.alive.trailing_zeros()));
        let (mut start, mut end) = (first, first);
        for octet in 0..OCTETS {
            let is_alive = mask32x8::from_bitmask(simd, self.alive >> (8 * octet));
            let from = f32x8::simd_from(simd, self.start[octet]);
            let to = f32x8::simd_from(simd, self.end[octet]);
            start = start.lesser(is_alive.select(from, first));
            end = end.greater(is_alive.select(to, first));
        }
        let end = end.reduce_max();
        // Find the box around short rays, if directions have both signs on an axis.
        let mut swept = None;
        let is_tested = self.alive.count_ones() > FEW_RAYS;
        if is_tested && is_bounded != [true; 3] && end < self.extent {
            let [x, y, z] = self.swept(simd);
            swept = Some([ends(simd, x), ends(simd, y), ends(simd, z)]);
        }
        Beam {
            origin: [ends(simd, a), ends(simd, b), ends(simd, c)],
            inverse: [ends(simd, x), ends(simd, y), ends(simd, z)],
            is_bounded,
            is_positive,
            swept,
            start: f32x8::splat(simd, start.reduce_min()),
            end: f32x8::splat(simd, end),
        }
    }

    /// The box around all rays, from their origins to their ends, relative to the centre.
    #[inline(always)]
    fn swept<S: Simd>(&self, simd: S) -> [[f32; 2]; 3] {
        let mut swept = self.origins;
        for (axis, [least, most]) in swept.iter_mut().enumerate() {
            // The first ray starts at 0, so 0 widens nothing.
            let zero = f32x8::splat(simd, 0.0);
            let (mut low, mut high) = (zero, zero);
            for octet in 0..OCTETS {
                let is_alive = mask32x8::from_bitmask(simd, self.alive >> (8 * octet));
                let origin = f32x8::simd_from(simd, self.anchor[axis][octet]) - self.center[axis];
                let direction = f32x8::simd_from(simd, self.direction[axis][octet]);
                let end = direction * f32x8::simd_from(simd, self.end[octet]) + origin;
                let end = is_alive.select(end, zero);
                (low, high) = (low.lesser(end), high.greater(end));
            }
            *least = lesser(*least, low.reduce_min()) - UNDERFLOW;
            *most = greater(*most, high.reduce_max()) + UNDERFLOW;
        }
        swept
    }

    /// One ray in all lanes.
    #[inline(always)]
    pub(crate) fn one<S: Simd>(&self, simd: S, ray: u32) -> SlabRays<f32x8<S>> {
        let ([a, b, c], [d, e, f]) = (&self.offset, &self.inverse);
        SlabRays {
            offset: splat(simd, [get(a, ray), get(b, ray), get(c, ray)]),
            inverse: splat(simd, [get(d, ray), get(e, ray), get(f, ray)]),
            start: f32x8::splat(simd, get(&self.start, ray)),
            end: f32x8::splat(simd, get(&self.end, ray)),
        }
    }

    /// Sixteen rays.
    #[inline(always)]
    pub(crate) fn sixteen<S: Simd>(&self, simd: S, which: usize) -> SlabRays<f32x16<S>> {
        let ([a, b, c], [d, e, f]) = (&self.offset, &self.inverse);
        SlabRays {
            offset: [sixteen(simd, a, which), sixteen(simd, b, which), sixteen(simd, c, which)],
            inverse: [sixteen(simd, d, which), sixteen(simd, e, which), sixteen(simd, f, which)],
            start: sixteen(simd, &self.start, which),
            end: sixteen(simd, &self.end, which),
        }
    }

    /// The sizes of triangles as seen by a ray, or no less than as seen by any of the group if there are more.
    #[inline(always)]
    pub(crate) fn size_of<S: Simd>(
        &self,
        simd: S,
        corners: &[[f32x8<S>; 3]; 3],
        rays: u64,
    ) -> Size<f32x8<S>> {
        let one = self.given[rays.trailing_zeros() as usize % GROUP].origin;
        let is_one = rays & rays.wrapping_sub(1) == 0;
        let (origin, farthest) = if is_one { (one, 0.0) } else { (self.center, self.farthest) };
        let Size { longest, reach } = Size::new(splat(simd, origin), corners);
        Size { longest, reach: reach + farthest }
    }

    /// Notices the rays of a camera: they start at one point and run side by side, and leave no surface.
    #[inline(always)]
    pub(crate) fn notice_camera<S: Simd>(&mut self, beam: &Beam<S>) {
        self.may_leave &= self.farthest > 0.0 || beam.is_bounded != [true; 3];
    }

    /// The filter of one ray in all lanes.
    #[inline(always)]
    pub(crate) fn filter<S: Simd>(&self, simd: S, ray: u32) -> LineFilter<f32x8<S>> {
        let [d, e, f] = &self.direction;
        LineFilter {
            origin: splat(simd, self.given[ray as usize % GROUP].origin),
            direction: splat(simd, [get(d, ray), get(e, ray), get(f, ray)]),
            rate: f32x8::splat(simd, self.rate),
            slack: f32x8::splat(simd, 0.0),
            floor: f32x8::splat(simd, self.floor),
        }
    }

    /// The start of one ray in all lanes.
    #[inline(always)]
    pub(crate) fn start_of<S: Simd>(&self, simd: S, ray: u32) -> f32x8<S> {
        f32x8::splat(simd, get(&self.given_start, ray))
    }

    /// The filters of eight rays.
    #[inline(always)]
    pub(crate) fn filters<S: Simd>(&self, simd: S, octet: usize) -> LineFilter<f32x8<S>> {
        LineFilter {
            origin: octet_of(simd, &self.anchor, octet),
            direction: octet_of(simd, &self.direction, octet),
            rate: f32x8::splat(simd, self.rate),
            slack: f32x8::splat(simd, 0.0),
            floor: f32x8::splat(simd, self.floor),
        }
    }

    /// The starts of eight rays.
    #[inline(always)]
    pub(crate) fn starts_of<S: Simd>(&self, simd: S, octet: usize) -> f32x8<S> {
        f32x8::simd_from(simd, self.given_start[octet % OCTETS])
    }

    /// The range of one ray as distances, in all lanes, not widened.
    #[inline(always)]
    pub(crate) fn range_of<S: Simd>(&self, simd: S, ray: u32) -> [f32x8<S>; 2] {
        let t_max = self.given[ray as usize % GROUP].t_max;
        let end = f32x8::splat(simd, lesser(t_max, f32::MAX) * get(&self.scale, ray));
        [self.start_of(simd, ray), end]
    }

    /// The ranges of eight rays as distances, not widened.
    #[inline(always)]
    pub(crate) fn ranges_of<S: Simd>(&self, simd: S, octet: usize) -> [f32x8<S>; 2] {
        let octet = octet % OCTETS;
        let rays = &self.given.as_chunks::<8>().0[octet];
        let (_, _, _, t_max) = columns(simd, rays.each_ref());
        let scale = f32x8::simd_from(simd, self.scale[octet]);
        [self.starts_of(simd, octet), t_max.lesser(f32x8::splat(simd, f32::MAX)) * scale]
    }

    /// Returns the rays of a mask that reach a distance.
    #[inline(always)]
    pub(crate) fn ending_behind<S: Simd>(&self, simd: S, distance: f32, rays: u64) -> u64 {
        let distance = f32x16::splat(simd, distance);
        let mut behind = 0;
        for which in 0..GROUP / 16 {
            let is_behind = sixteen(simd, &self.end, which).simd_ge(distance);
            behind |= is_behind.to_bitmask() << (16 * which);
        }
        behind & rays
    }
}

/// The lanes of a mask.
pub(crate) fn lanes(mask: u64) -> impl Iterator<Item = u32> {
    let mut rest = mask;
    core::iter::from_fn(move || {
        let lane = rest.trailing_zeros();
        rest &= rest.wrapping_sub(1);
        (lane < u64::BITS).then_some(lane)
    })
}

/// A mask of so many low bits, eight at most.
#[inline(always)]
const fn bits_below(count: usize) -> u64 {
    if count >= 8 { 0xff } else { (1 << count) - 1 }
}

#[inline(always)]
fn ends<S: Simd>(simd: S, [low, high]: [f32; 2]) -> [f32x8<S>; 2] {
    [f32x8::splat(simd, low), f32x8::splat(simd, high)]
}
