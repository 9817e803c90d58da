//! Some rays of a tile as arrays: one number of all of them side by side.
//!
//! Along one axis, k, all rays of a bundle run forward (it is mirrored if they run
//! backward), at least half as fast as along any other. So they can be written as lines
//! over k: `u = start + slope * k`.

use core::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x16, mask32x16, u32x4};
use glam::Vec3A;

use super::Brick;
use super::chords::Extremes;
use super::layout::BLOCK;
use crate::aabb::{Aabb, greater, lesser};
use crate::approach::FAR_EXTENTS;
use crate::cell::{Lattice, as_f32};
use crate::eight::{Row, load, transpose};
use crate::mesh::Strided;
use crate::ray::{Hit, INVALID_ID, Ray, round};

/// Rays in a bundle.
pub(crate) const RAYS: usize = 64;

/// Speeds, in cells for each unit of t, with which lines can be computed.
const LEAST_SPEED: f32 = 1e-30;
const MOST_SPEED: f32 = 1e30;

/// Bundles in a tile, at most.
pub(crate) const BUNDLES: usize = 2;

/// A number for each ray.
pub(super) type PerRay = [f32; RAYS];

/// Up to 64 rays, and those of them that run along one axis.
#[derive(Debug)]
pub(super) struct Bundle {
    /// By axis.
    pub(super) origin: [PerRay; 3],
    /// By axis.
    pub(super) direction: [PerRay; 3],
    /// The grid's box.
    pub(super) bounds: Aabb,
    pub(super) t_min: PerRay,
    /// Where a ray ends: the t of its closest hit, if it has any.
    pub(super) t_max: PerRay,
    /// Where it ended before it had any, once a triangle was tested.
    pub(super) last: PerRay,
    /// The rest of these hits, once a triangle was tested; until then that of earlier rays.
    pub(super) u: PerRay,
    pub(super) v: PerRay,
    pub(super) primitive: [u32; RAYS],
    /// Whether one was; until then there are directions.
    pub(super) is_begun: bool,
    /// Bit `i`: ray `i` is one of them.
    pub(super) members: u64,
    /// Members that had not ended where the slice of blocks at hand begins.
    pub(super) alive: u64,
    /// The axes u, v and k.
    pub(super) axes: [u8; 3],
    /// Whether k counts from the grid's far end.
    pub(super) is_mirrored: bool,
    /// u and v on the plane k = 0, in cells, and what they grow by from plane to plane.
    pub(super) start: [PerRay; 2],
    pub(super) slope: [PerRay; 2],
    /// k at t = 0, and for each unit of t.
    pub(super) zero: PerRay,
    pub(super) speed: PerRay,
    /// k where the rays start, and where they end.
    pub(super) from: PerRay,
    pub(super) to: PerRay,
    /// How far off places may be, in cells: as much as a triangle's box is grown by.
    pub(super) margin: f32,
    /// The grid's first corner, cells for each unit, and k of its far end.
    pub(super) corner: [f32; 3],
    pub(super) rate: [f32; 3],
    pub(super) width: f32,
}

/// Axes as places in arrays of three: said again so that the compiler knows, and checks nothing.
#[inline(always)]
pub(super) fn below_three([u, v, k]: [u8; 3]) -> [usize; 3] {
    [usize::from(u % 3), usize::from(v % 3), usize::from(k % 3)]
}

/// Sixteen rays at once.
pub(super) const WIDTH: usize = 16;

/// Sixteen numbers from `first` on.
#[inline(always)]
pub(super) fn row_of<S: Simd>(simd: S, array: &PerRay, first: usize) -> f32x16<S> {
    let rows = array.as_chunks::<WIDTH>().0;
    f32x16::simd_from(simd, rows[first / WIDTH % (RAYS / WIDTH)])
}

/// The same to be written.
#[inline(always)]
fn row_mut(array: &mut PerRay, first: usize) -> &mut [f32; WIDTH] {
    &mut array.as_chunks_mut().0[first / WIDTH % (RAYS / WIDTH)]
}

/// Bit `i` for ray `i` of sixteen from `first` on.
#[inline(always)]
fn rays_of<S: Simd>(mask: mask32x16<S>, first: usize) -> u64 {
    (mask.to_bitmask() & 0xffff) << (first % RAYS)
}

/// Sixteen rays from `first` on, of which some belong to a bundle; for the others one stands in.
#[derive(Clone, Copy)]
struct Belonging<S: Simd> {
    is_member: mask32x16<S>,
    first: usize,
    stand_in: usize,
}

impl<S: Simd> Belonging<S> {
    /// Their numbers.
    #[inline(always)]
    fn of(self, simd: S, array: &PerRay) -> f32x16<S> {
        let stand_in = f32x16::splat(simd, array[self.stand_in % RAYS]);
        self.is_member.select(row_of(simd, array, self.first), stand_in)
    }
}

/// A ray as its origin and `t_min`, and its direction and `t_max`.
#[inline(always)]
fn halves(ray: &[u8; 32]) -> [&Row; 2] {
    let (near, far) = ray.split_at(16);
    [near, far].map(|half| half.first_chunk().unwrap_or(&[0; 16]))
}

/// The least of sixteen numbers.
#[inline(always)]
fn least<S: Simd>(numbers: f32x16<S>) -> f32 {
    let (a, b) = numbers.split();
    let (a, b) = a.min(b).split();
    let [a, b, c, d]: [f32; 4] = a.min(b).into();
    lesser(lesser(a, b), lesser(c, d))
}

/// The greatest of sixteen numbers.
#[inline(always)]
fn most<S: Simd>(numbers: f32x16<S>) -> f32 {
    let (a, b) = numbers.split();
    let (a, b) = a.max(b).split();
    let [a, b, c, d]: [f32; 4] = a.max(b).into();
    greater(greater(a, b), greater(c, d))
}

impl Bundle {
    /// No rays: zeros, which are written without being read from anywhere.
    pub(super) const EMPTY: Self = Self {
        origin: [[0.0; RAYS]; 3],
        direction: [[0.0; RAYS]; 3],
        bounds: Aabb { min: Vec3A::ZERO, max: Vec3A::ZERO },
        t_min: [0.0; RAYS],
        t_max: [0.0; RAYS],
        last: [0.0; RAYS],
        u: [0.0; RAYS],
        v: [0.0; RAYS],
        primitive: [0; RAYS],
        is_begun: false,
        members: 0,
        alive: 0,
        axes: [0; 3],
        is_mirrored: false,
        start: [[0.0; RAYS]; 2],
        slope: [[0.0; RAYS]; 2],
        zero: [0.0; RAYS],
        speed: [0.0; RAYS],
        from: [0.0; RAYS],
        to: [0.0; RAYS],
        margin: 0.0,
        corner: [0.0; 3],
        rate: [0.0; 3],
        width: 0.0,
    };

    /// Replaces the rays by `count` of the caller's, and makes those that run along the same axis
    /// as the first valid one the members.
    ///
    /// Out of line, or its variables would be on the stack all the way; so it says once more what
    /// vectors it is compiled for.
    #[inline(never)]
    pub(super) fn load<S: Simd>(
        &mut self,
        simd: S,
        brick: &Brick<'_>,
        lattice: &Lattice,
        rays: &Strided<'_>,
        first: usize,
        count: usize,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                (self.members, self.is_begun) = (0, false);
                let Some(leader) = self.read(simd, rays, first, count) else { return };
                let [x, y, z] = [leader[0].abs(), leader[1].abs(), leader[2].abs()];
                match (x >= y && x >= z, y >= z) {
                    (true, _) => self.along::<0, S>(simd, brick, lattice, leader),
                    (_, true) => self.along::<1, S>(simd, brick, lattice, leader),
                    _ => self.along::<2, S>(simd, brick, lattice, leader),
                }
            },
        );
    }

    /// Reads rays by axes, and gives the direction of the first valid one.
    #[inline(always)]
    fn read<S: Simd>(
        &mut self,
        simd: S,
        rays: &Strided<'_>,
        first: usize,
        count: usize,
    ) -> Option<[f32; 3]> {
        let mut leader = None;
        let tight = rays.tight(first, count).as_chunks::<4>().0;
        for four in 0..RAYS / 4 {
            let at = 4 * four;
            let four_rays = if let Some([a, b, c, d]) = tight.get(four) {
                [a, b, c, d]
            } else {
                // Zeros where there are no more: such a ray is none, and what earlier rays left
                // is gone.
                let ray = |lane: usize| -> &[u8; 32] {
                    let place = (at + lane < count).then_some(first + at + lane);
                    place.and_then(|place| rays.element(place)).unwrap_or(&[0; 32])
                };
                [ray(0), ray(1), ray(2), ray(3)]
            };
            if leader.is_none() {
                let rays = four_rays.iter().map(|&&ray| bytemuck::cast::<[u8; 32], Ray>(ray));
                leader = rays.filter(Ray::is_valid).map(|ray| ray.direction).next();
            }
            let [a, b, c, d] = four_rays;
            let half = |ray, half: usize| load(simd, halves(ray)[half]);
            let row = |at: usize| [half(a, at), half(b, at), half(c, at), half(d, at)];
            let set = |column: &mut PerRay, four_rays: f32x4<S>| {
                if let Some(slot) = column.as_chunks_mut().0.get_mut(four) {
                    *slot = four_rays.into();
                }
            };
            let [x, y, z, t_min] = transpose(row(0));
            set(&mut self.origin[0], x);
            set(&mut self.origin[1], y);
            set(&mut self.origin[2], z);
            set(&mut self.t_min, t_min);
            let [x, y, z, t_max] = transpose(row(1));
            set(&mut self.direction[0], x);
            set(&mut self.direction[1], y);
            set(&mut self.direction[2], z);
            set(&mut self.t_max, t_max);
        }
        leader
    }

    /// Makes the rays that run along an axis lines over it.
    #[inline(always)]
    fn along<const K: usize, S: Simd>(
        &mut self,
        simd: S,
        brick: &Brick<'_>,
        lattice: &Lattice,
        leader: [f32; 3],
    ) {
        self.axes = match K {
            0 => [1, 2, 0],
            1 => [2, 0, 1],
            _ => [0, 1, 2],
        };
        self.is_mirrored = leader[K] < 0.0;
        self.corner = lattice.min;
        self.rate = [0, 1, 2].map(|axis| round(lattice.cells_per_unit(axis)));
        self.width = as_f32(brick.width[K] * BLOCK);
        self.margin = lattice.margin().max_element();
        let bounds = lattice.bounds();
        self.bounds = bounds;
        let center = ((bounds.min + bounds.max) * 0.5).to_array();
        let splat = |number: f32| f32x16::splat(simd, number);
        let (reach, zero) = (splat(FAR_EXTENTS * bounds.size().max_element()), splat(0.0));
        let sign = splat(if self.is_mirrored { -1.0 } else { 1.0 });
        for first in (0..RAYS).step_by(WIDTH) {
            let ox = row_of(simd, &self.origin[0], first);
            let oy = row_of(simd, &self.origin[1], first);
            let oz = row_of(simd, &self.origin[2], first);
            let dx = row_of(simd, &self.direction[0], first);
            let dy = row_of(simd, &self.direction[1], first);
            let dz = row_of(simd, &self.direction[2], first);
            let t_min = row_of(simd, &self.t_min, first);
            let t_max = row_of(simd, &self.t_max, first);
            let [x, y, z] = [dx.abs(), dy.abs(), dz.abs()];

            // Who belongs to the bundle: runs along the axis, from
            // nearby, with numbers that are some.
            let along = [dx, dy, dz][K] * sign;
            let speed = along * splat(self.rate[K]);
            let is_near = (ox - splat(center[0])).abs().simd_le(reach)
                & (oy - splat(center[1])).abs().simd_le(reach)
                & (oz - splat(center[2])).abs().simd_le(reach);
            let rate = [splat(self.rate[0]), splat(self.rate[1]), splat(self.rate[2])];
            let fastest = (x * rate[0]).max(y * rate[1]).max(z * rate[2]);
            let is_along = along.simd_ge(splat(0.5) * x.max(y).max(z))
                & speed.simd_gt(splat(LEAST_SPEED))
                & fastest.simd_lt(splat(MOST_SPEED));
            let is_ray = (dx * zero + dy * zero + dz * zero).simd_ge(zero) & t_min.simd_le(t_max);
            let is_member = is_near & is_along & is_ray;
            self.members |= rays_of(is_member, first);
            *row_mut(&mut self.speed, first) = is_member.select(speed, zero).into();
        }
        if self.members != 0 {
            self.draw::<K, S>(simd);
        }
    }

    /// Writes the members as lines in cells, k growing. The others get a
    /// member's line, so that bounds need no mask.
    #[inline(always)]
    fn draw<const K: usize, S: Simd>(&mut self, simd: S) {
        let stand_in = self.members.trailing_zeros() as usize % RAYS;
        let splat = |number: f32| f32x16::splat(simd, number);
        let (corner, rate, speed) = (&self.corner, &self.rate, self.speed[stand_in]);
        let [u, v] = [(K + 1) % 3, (K + 2) % 3];
        for first in (0..RAYS).step_by(WIDTH) {
            let is_member = row_of(simd, &self.speed, first).simd_gt(splat(0.0));
            let rays = Belonging { is_member, first, stand_in };
            let speed = is_member.select(row_of(simd, &self.speed, first), splat(speed));
            let zero = (rays.of(simd, &self.origin[K]) - splat(corner[K])) * splat(rate[K]);
            let zero = if self.is_mirrored { splat(self.width) - zero } else { zero };
            let inverse = splat(1.0) / speed;
            let from = zero + speed * rays.of(simd, &self.t_min) - splat(self.margin);
            let to = zero + speed * rays.of(simd, &self.t_max) + splat(self.margin);
            let slope_u = rays.of(simd, &self.direction[u]) * splat(rate[u]) * inverse;
            let slope_v = rays.of(simd, &self.direction[v]) * splat(rate[v]) * inverse;
            let at_u = (rays.of(simd, &self.origin[u]) - splat(corner[u])) * splat(rate[u]);
            let at_v = (rays.of(simd, &self.origin[v]) - splat(corner[v])) * splat(rate[v]);
            let (start_u, start_v) = (at_u - slope_u * zero, at_v - slope_v * zero);
            *row_mut(&mut self.zero, first) = zero.into();
            *row_mut(&mut self.from, first) = from.into();
            *row_mut(&mut self.to, first) = to.into();
            *row_mut(&mut self.slope[0], first) = slope_u.into();
            *row_mut(&mut self.slope[1], first) = slope_v.into();
            *row_mut(&mut self.start[0], first) = start_u.into();
            *row_mut(&mut self.start[1], first) = start_v.into();
        }
    }

    /// Makes ready for the first triangle: no ray has hit anything.
    #[inline(always)]
    pub(super) fn begin(&mut self) {
        self.is_begun = true;
        self.u.fill(0.0);
        self.v.fill(0.0);
        self.primitive.fill(INVALID_ID);
        self.last = self.t_max;
    }

    /// The closest hits of four rays, or [`Hit::MISS`].
    #[inline(always)]
    pub(super) fn hits<S: Simd>(&self, simd: S, four: usize) -> [Hit; 4] {
        if !self.is_begun {
            return [Hit::MISS; 4];
        }
        let place = four % (RAYS / 4);
        let primitive = self.primitive.as_chunks::<4>().0[place];
        let is_miss = u32x4::simd_from(simd, primitive).simd_eq(INVALID_ID);
        let row = |numbers: &PerRay| f32x4::simd_from(simd, numbers.as_chunks::<4>().0[place]);
        // u and v of a miss are 0 already.
        let t = is_miss.select(f32x4::splat(simd, Hit::MISS.t), row(&self.t_max));
        let primitive = u32x4::simd_from(simd, primitive).bitcast();
        let [a, b, c, d] = transpose([t, row(&self.u), row(&self.v), primitive]);
        // Written out: arrays that are mapped live in memory.
        let hit = |hit: f32x4<S>| bytemuck::cast(<[f32; 4]>::from(hit));
        [hit(a), hit(b), hit(c), hit(d)]
    }

    /// Whether the rays run along the same axis as others.
    #[inline(always)]
    pub(super) fn runs_along(&self, others: &Self) -> bool {
        (self.axes, self.is_mirrored) == (others.axes, others.is_mirrored)
    }

    /// How far apart, in cells, this bundle's first ray and the last one of another are half way
    /// through the grid: the corners of a tile, or members that stand in for them.
    #[inline(always)]
    pub(super) fn distance(&self, other: &Self) -> f32 {
        let half = self.width * 0.5;
        let on = |side: usize| {
            let first = self.start[side][0] + self.slope[side][0] * half;
            (first - other.start[side][RAYS - 1] - other.slope[side][RAYS - 1] * half).abs()
        };
        greater(on(0), on(1))
    }

    /// The axes u, v and k.
    #[inline(always)]
    pub(super) fn axes(&self) -> [usize; 3] {
        below_three(self.axes)
    }

    /// The first k of any member, and the last, before any has a hit: after a hit the end of who
    /// does not belong may be no number.
    #[inline(always)]
    pub(super) fn ends<S: Simd>(&self, simd: S) -> (f32, f32) {
        let rows = |array: &PerRay| {
            let [a, b, c, d] = core::array::from_fn(|row| row_of(simd, array, row * WIDTH));
            [a, b, c, d]
        };
        let [a, b, c, d] = rows(&self.from);
        let first = least(a.min(b).min(c.min(d)));
        let [a, b, c, d] = rows(&self.to);
        (first, most(a.max(b).max(c.max(d))))
    }

    /// Between where the members of some rows are on two planes.
    #[inline(always)]
    pub(super) fn extremes<S: Simd>(
        &self,
        simd: S,
        planes: [f32; 2],
        rows: Range<usize>,
    ) -> Extremes {
        let mut extremes = Extremes::NONE;
        for side in 0..2 {
            for (end, plane) in planes.into_iter().enumerate() {
                let plane = f32x16::splat(simd, plane);
                let mut lowest = f32x16::splat(simd, f32::INFINITY);
                let mut highest = f32x16::splat(simd, f32::NEG_INFINITY);
                for row in rows.clone() {
                    let start = row_of(simd, &self.start[side], row * WIDTH);
                    let slope = row_of(simd, &self.slope[side], row * WIDTH);
                    let at = start + slope * plane;
                    lowest = lowest.min(at);
                    highest = highest.max(at);
                }
                extremes.low[side][end] = least(lowest);
                extremes.high[side][end] = most(highest);
            }
        }
        extremes
    }

    /// Marks those alive that have not ended before a plane.
    #[inline(always)]
    pub(super) fn outlive<S: Simd>(&mut self, simd: S, near: f32) {
        let near = f32x16::splat(simd, near);
        let mut alive = 0;
        for first in (0..RAYS).step_by(WIDTH) {
            alive |= rays_of(row_of(simd, &self.to, first).simd_ge(near), first);
        }
        self.alive = self.members & alive;
    }

    /// The last k at which any member ends.
    #[inline(always)]
    pub(super) fn farthest<S: Simd>(&self, simd: S) -> f32 {
        // Who does not belong may end at what is no number.
        let row = |row| {
            let to = row_of(simd, &self.to, row * WIDTH);
            let nowhere = f32x16::splat(simd, f32::NEG_INFINITY);
            to.simd_ge(nowhere).select(to, nowhere)
        };
        most(row(0).max(row(1)).max(row(2).max(row(3))))
    }

    /// The members between two planes, unless they have ended before.
    #[inline(always)]
    pub(super) fn between<S: Simd>(&self, simd: S, [near, far]: [f32; 2]) -> u64 {
        let (near, far) = (f32x16::splat(simd, near), f32x16::splat(simd, far));
        let mut between = 0;
        for first in (0..RAYS).step_by(WIDTH) {
            let from = row_of(simd, &self.from, first);
            let to = row_of(simd, &self.to, first);
            between |= rays_of(from.simd_le(far) & to.simd_ge(near), first);
        }
        self.members & between
    }
}
