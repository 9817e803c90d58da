//! Many rays against triangles: rays side by side where a triangle is large, triangles side by side
//! where it is small.
//!
//! Rays side by side cost the same whether all sixteen meet a cell or one, so a triangle is tested
//! against all that are alive when the first cell with it has many rays, and not again for others,
//! unless the mailbox forgot it.
//!
//! Both do for every ray and triangle what [`TriangleTest`] does, so hits have the same bits.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x16};

use super::bundle::{Bundle, PerRay, RAYS, WIDTH, row_of};
use super::frusta::Frusta;
use crate::eight::{Eight, LANES, Row, load, transpose};
use crate::mesh::{Triangle, TriangleMesh};
use crate::options::Cull;
use crate::ray::{Hit, INVALID_ID, round};
use crate::triangle::{Axis, TriangleTest};

/// From so many rays on they are tested side by side. A choice by the number of rows and triangles
/// was no better.
const MANY: u32 = 8;

/// How many triangles a mailbox remembers.
const SLOTS: usize = 256;

/// Rays resolved at once.
const HALF: usize = WIDTH / 2;

/// What the rays of a bundle have hit.
#[derive(Debug)]
pub(super) struct Hits {
    /// The closest hit of each ray; its t is where the ray ends ([`Bundle::t_max`]).
    u: PerRay,
    v: PerRay,
    primitive: [u32; RAYS],
    frusta: Frusta,
    /// Whether these are around the bundle.
    is_surrounded: bool,
    /// Triangles that were tested against all rays that may meet them. Who comes later takes the
    /// place: a second test does no harm.
    mailbox: [u32; SLOTS],
}

impl Hits {
    /// Of no rays.
    pub(super) const EMPTY: Self = Self {
        u: [0.0; RAYS],
        v: [0.0; RAYS],
        primitive: [INVALID_ID; RAYS],
        frusta: Frusta::EMPTY,
        is_surrounded: false,
        mailbox: [INVALID_ID; SLOTS],
    };

    /// Forgets the rays and what they hit.
    pub(super) const fn clear(&mut self) {
        if self.is_surrounded {
            self.is_surrounded = false;
            self.mailbox = Self::EMPTY.mailbox;
        }
        self.u = Self::EMPTY.u;
        self.v = Self::EMPTY.v;
        self.primitive = Self::EMPTY.primitive;
    }

    /// The closest hits of four rays, or [`Hit::MISS`].
    #[inline(always)]
    pub(super) fn four<S: Simd>(&self, simd: S, bundle: &Bundle, four: usize) -> [Hit; 4] {
        let primitive: &PerRay = bytemuck::cast_ref(&self.primitive);
        let row = |numbers: &PerRay| {
            let rows: &[Row; RAYS / 4] = bytemuck::cast_ref(numbers);
            load(simd, &rows[four % (RAYS / 4)])
        };
        let [a, b, c, d] =
            transpose([row(&bundle.t_max), row(&self.u), row(&self.v), row(primitive)]);
        let hit = |hit: f32x4<S>| {
            let hit: Hit = bytemuck::cast(<[f32; 4]>::from(hit));
            if hit.primitive == INVALID_ID { Hit::MISS } else { hit }
        };
        [hit(a), hit(b), hit(c), hit(d)]
    }

    /// Tests rays of a bundle against the triangles of a list; if they are many, all rays that are
    /// alive.
    ///
    /// Out of line, or it would be on the stack once for each division of a cell; so it says once more
    /// what vectors it is compiled for.
    #[inline(never)]
    pub(super) fn test<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        bundle: &mut Bundle,
        mesh: &TriangleMesh<'_>,
        ids: &[u32],
        rays: u64,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                if rays.count_ones() < MANY {
                    for ids in ids.chunks(LANES) {
                        self.few::<S, ANY>(simd, bundle, mesh, ids, rays);
                    }
                    return;
                }
                if !self.is_surrounded {
                    self.is_surrounded = true;
                    self.frusta.surround(simd, bundle);
                }
                // Eight by eight those that were not tested yet.
                let (mut fresh, mut count) = ([ids.first().copied().unwrap_or(0); LANES], 0);
                for (place, &id) in ids.iter().enumerate() {
                    let slot = &mut self.mailbox[id as usize % SLOTS];
                    fresh[count % LANES] = id;
                    count += usize::from(*slot != id);
                    *slot = id;
                    if count == LANES || (count > 0 && place + 1 == ids.len()) {
                        self.many::<S, ANY>(simd, bundle, mesh, &fresh[..count.min(LANES)]);
                        count = 0;
                    }
                }
            },
        );
    }

    /// Tests all rays that are alive, side by side, against up to eight triangles one by one: those
    /// that the planes around the rays let through.
    #[inline(always)]
    fn many<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        bundle: &mut Bundle,
        mesh: &TriangleMesh<'_>,
        ids: &[u32],
    ) {
        let triangles = Eight::gather(simd, mesh, ids);
        let mut near = self.frusta.meet(simd, &triangles);
        while near != 0 {
            let place = near.trailing_zeros() as usize;
            near &= near - 1;
            let Some(&id) = ids.get(place) else { break };
            let Some(triangle) = mesh.triangle(id) else { continue };
            let rays = self.frusta.rays(simd, &triangle) & bundle.alive;
            let rays = if ANY { rays & bundle.members } else { rays };
            for axis in 0..3 {
                let rays = rays & bundle.longest[axis];
                if rays == 0 {
                    continue;
                }
                match axis {
                    0 => self.side_by_side::<S, 0, ANY>(simd, bundle, &triangle, id, rays),
                    1 => self.side_by_side::<S, 1, ANY>(simd, bundle, &triangle, id, rays),
                    _ => self.side_by_side::<S, 2, ANY>(simd, bundle, &triangle, id, rays),
                }
            }
        }
    }

    /// Tests rays one by one against up to eight triangles at once.
    #[inline(always)]
    fn few<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        bundle: &mut Bundle,
        mesh: &TriangleMesh<'_>,
        ids: &[u32],
        rays: u64,
    ) {
        let triangles = Eight::gather(simd, mesh, ids);
        let mut rest = if ANY { rays & bundle.members } else { rays };
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize % RAYS;
            rest &= rest - 1;
            let test = one(bundle, lane);
            let mut survivors = test.survivors(simd, &triangles);
            while survivors != 0 {
                let place = survivors.trailing_zeros() as usize;
                survivors &= survivors - 1;
                let Some(&id) = ids.get(place) else { break };
                // A miss is closer than nothing.
                let hit = test.decide(mesh, id);
                let best =
                    Hit { t: bundle.t_max[lane], primitive: self.primitive[lane], ..Hit::MISS };
                if hit.is_closer(&best) {
                    bundle.t_max[lane] = hit.t;
                    self.u[lane] = hit.u;
                    self.v[lane] = hit.v;
                    self.primitive[lane] = hit.primitive;
                    bundle.to[lane] =
                        bundle.zero[lane] + bundle.speed[lane] * hit.t + bundle.margin;
                    if ANY {
                        bundle.members &= !(1 << lane);
                        break;
                    }
                }
            }
        }
    }

    /// Tests rays with the same longest axis against one triangle.
    #[inline(always)]
    fn side_by_side<S: Simd, const AXIS: usize, const ANY: bool>(
        &mut self,
        simd: S,
        bundle: &mut Bundle,
        triangle: &Triangle,
        id: u32,
        rays: u64,
    ) {
        let [x, y, z] = [(AXIS + 1) % 3, (AXIS + 2) % 3, AXIS];
        for row in 0..RAYS / WIDTH {
            let here = rays >> (row * WIDTH) & 0xffff;
            if here == 0 {
                continue;
            }
            let first = row * WIDTH;

            let (ox, oy, oz) = (
                row_of(simd, &bundle.origin[x], first),
                row_of(simd, &bundle.origin[y], first),
                row_of(simd, &bundle.origin[z], first),
            );
            let (shear_x, shear_y) =
                (row_of(simd, &bundle.shear[0], first), row_of(simd, &bundle.shear[1], first));

            // Shear the corners, and drop the triangle where two edge functions have opposite signs.
            let (origin, shear) = ([ox, oy, oz], [shear_x, shear_y]);
            let [a, b, c] = triangle;
            let a = sheared::<S, AXIS>(simd, a, origin, shear);
            let b = sheared::<S, AXIS>(simd, b, origin, shear);
            let c = sheared::<S, AXIS>(simd, c, origin, shear);
            let u = c[0] * b[1] - c[1] * b[0];
            let v = a[0] * c[1] - a[1] * c[0];
            let w = b[0] * a[1] - b[1] * a[0];
            let zero = f32x16::splat(simd, 0.0);
            let any_negative = u.simd_lt(zero) | v.simd_lt(zero) | w.simd_lt(zero);
            let any_positive = u.simd_gt(zero) | v.simd_gt(zero) | w.simd_gt(zero);
            let survivors = !(any_negative & any_positive).to_bitmask() & here;
            if survivors == 0 {
                continue;
            }
            let corners: [[f32; WIDTH]; 6] =
                [a[0].into(), a[1].into(), b[0].into(), b[1].into(), c[0].into(), c[1].into()];
            let depths = [triangle[0][z], triangle[1][z], triangle[2][z]];
            for half in 0..2 {
                let survivors = (survivors >> (half * HALF) & 0xff) as u32;
                if survivors != 0 {
                    let first = first + half * HALF;
                    let mut sheared = [[0.0; HALF]; 6];
                    for (to, from) in sheared.iter_mut().zip(&corners) {
                        to.copy_from_slice(&from[half * HALF..][..HALF]);
                    }
                    let taken = self.resolve(bundle, &sheared, &depths, z, id, first, survivors);
                    if ANY {
                        bundle.members &= !(taken << first);
                    }
                }
            }
        }
    }

    /// Does what [`TriangleTest::resolve`] does, for eight rays from `first` on; tells which of them now
    /// have this hit.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "once, for three axes")]
    fn resolve(
        &mut self,
        bundle: &mut Bundle,
        [ax, ay, bx, by, cx, cy]: &[[f32; HALF]; 6],
        depths: &[f32; 3],
        z: usize,
        id: u32,
        first: usize,
        survivors: u32,
    ) -> u64 {
        let origin = eight_of(&bundle.origin[z], first);
        let direction = eight_of(&bundle.direction_z, first);
        let (t_min, best_t) = (eight_of(&bundle.t_min, first), eight_of(&bundle.t_max, first));
        let (best_u, best_v) = (eight_of(&self.u, first), eight_of(&self.v, first));
        let to = eight_of(&bundle.to, first);
        let (zero, speed) = (eight_of(&bundle.zero, first), eight_of(&bundle.speed, first));
        let best_id = eight_of(&self.primitive, first);
        let depths = [f64::from(depths[0]), f64::from(depths[1]), f64::from(depths[2])];
        let margin = bundle.margin;
        let (mut new_t, mut new_u, mut new_v) = (best_t, best_u, best_v);
        let (mut new_to, mut new_id, mut is_new) = (to, best_id, [0_u32; HALF]);
        #[expect(clippy::needless_bitwise_bool, reason = "no branch: lanes side by side")]
        for lane in 0..HALF {
            let (ax, ay) = (f64::from(ax[lane]), f64::from(ay[lane]));
            let (bx, by) = (f64::from(bx[lane]), f64::from(by[lane]));
            let (cx, cy) = (f64::from(cx[lane]), f64::from(cy[lane]));
            let u = cx * by - cy * bx;
            let v = ax * cy - ay * cx;
            let w = bx * ay - by * ax;
            let any_negative = (u < 0.0) | (v < 0.0) | (w < 0.0);
            let any_positive = (u > 0.0) | (v > 0.0) | (w > 0.0);
            let area = u + v + w;
            let is_area = (area.abs() > 0.0) & (area.abs() < f64::INFINITY);
            let share = 1.0 / area;
            let (u, v, w) = (u * share + 0.0, v * share + 0.0, w * share + 0.0);
            let origin = f64::from(origin[lane]);
            let depth =
                u * (depths[0] - origin) + v * (depths[1] - origin) + w * (depths[2] - origin);
            let t = round(depth / f64::from(direction[lane]));
            let is_hit = !(any_negative & any_positive)
                & is_area
                & (t >= t_min[lane])
                & (t.abs() < f32::INFINITY)
                & (survivors >> lane & 1 == 1);
            let is_closer = (t < best_t[lane]) | ((t <= best_t[lane]) & (id < best_id[lane]));
            let is_taken = is_hit & is_closer;
            new_t[lane] = if is_taken { t } else { best_t[lane] };
            new_u[lane] = if is_taken { round(v) } else { best_u[lane] };
            new_v[lane] = if is_taken { round(w) } else { best_v[lane] };
            new_id[lane] = if is_taken { id } else { best_id[lane] };
            let end = zero[lane] + speed[lane] * t + margin;
            new_to[lane] = if is_taken { end } else { to[lane] };
            is_new[lane] = u32::from(is_taken) << lane;
        }
        *eight_mut(&mut bundle.t_max, first) = new_t;
        *eight_mut(&mut self.u, first) = new_u;
        *eight_mut(&mut self.v, first) = new_v;
        *eight_mut(&mut self.primitive, first) = new_id;
        *eight_mut(&mut bundle.to, first) = new_to;
        u64::from(is_new.iter().fold(0, |all, ray| all | ray))
    }
}

/// The test of one ray.
#[inline(always)]
fn one(bundle: &Bundle, lane: usize) -> TriangleTest {
    let lane = lane % RAYS;
    let (axis, [x, y, z]) = if bundle.longest[0] >> lane & 1 == 1 {
        (Axis::X, [1, 2, 0])
    } else if bundle.longest[1] >> lane & 1 == 1 {
        (Axis::Y, [2, 0, 1])
    } else {
        (Axis::Z, [0, 1, 2])
    };
    TriangleTest {
        axis,
        anchor: [bundle.origin[x][lane], bundle.origin[y][lane], bundle.origin[z][lane]],
        shear: [bundle.shear[0][lane], bundle.shear[1][lane]],
        origin_z: f64::from(bundle.origin[z][lane]),
        direction_z: f64::from(bundle.direction_z[lane]),
        t_min: bundle.t_min[lane],
        t_max: bundle.t_max[lane],
        cull: Cull::None,
    }
}

/// Eight numbers from `first` on.
#[inline(always)]
fn eight_of<T: Copy>(array: &[T; RAYS], first: usize) -> [T; HALF] {
    array.as_chunks().0[first / HALF % (RAYS / HALF)]
}

#[inline(always)]
fn eight_mut<T: Copy>(array: &mut [T; RAYS], first: usize) -> &mut [T; HALF] {
    &mut array.as_chunks_mut().0[first / HALF % (RAYS / HALF)]
}

/// A corner relative to sixteen rays, sheared so that each of them is the z axis.
#[inline(always)]
fn sheared<S: Simd, const AXIS: usize>(
    simd: S,
    corner: &[f32; 3],
    [ox, oy, oz]: [f32x16<S>; 3],
    [shear_x, shear_y]: [f32x16<S>; 2],
) -> [f32x16<S>; 2] {
    let x = f32x16::splat(simd, corner[(AXIS + 1) % 3]) - ox;
    let y = f32x16::splat(simd, corner[(AXIS + 2) % 3]) - oy;
    let z = f32x16::splat(simd, corner[AXIS]) - oz;
    [x - shear_x * z, y - shear_y * z]
}
