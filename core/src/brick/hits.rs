//! Many rays against triangles: rays side by side where a triangle is large, triangles side by side
//! where it is small.
//!
//! Rays side by side cost the same whether all sixteen meet a cell or one, so a triangle is tested
//! against all that are alive when the first cell with it has many rays, and not again for others,
//! unless the mailbox forgot it.
//!
//! Both do for every ray and triangle what [`TriangleTest`] does, so hits have the same bits.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f32x16, f64x8, mask32x8, mask64x8, u32x8};

use super::bundle::{Bundle, PerRay, RAYS, WIDTH, row_of};
use super::chords::Bounds;
use super::frusta::Frusta;
use super::quarters::Format;
use crate::aabb::greater;
use crate::eight::{Eight, LANES, first_eight};
use crate::mesh::{Triangle, TriangleMesh};
use crate::options::Cull;
use crate::ray::Hit;
use crate::triangle::{Axis, TriangleTest};

/// From so many rays on they are tested side by side. A choice by the number of rows and triangles
/// was no better.
const MANY: u32 = 8;

/// How many triangles a mailbox remembers.
const SLOTS: usize = 256;

/// Rays resolved at once.
const PART: usize = WIDTH / 2;

/// Triangles of a mesh that some rays may meet.
#[derive(Debug, Clone, Copy)]
pub(super) struct List<'a> {
    pub(super) references: &'a [u32],
    pub(super) format: Format,
    pub(super) mesh: &'a TriangleMesh<'a>,
}

/// What was tested against the rays of bundles that go together.
#[derive(Debug)]
pub(super) struct Tests {
    /// The planes of k between which all rays have their hits, and the chords around them there.
    planes: [f32; 2],
    pub(super) bounds: Bounds,
    frusta: Frusta,
    /// Whether these are around the bundles; until a triangle is tested, around earlier ones.
    is_surrounded: bool,
    /// Triangles that were tested against all rays that may meet them, their ids with all bits
    /// inverted: 0 is none. Who comes later takes the place: a second test does no harm.
    mailbox: [u32; SLOTS],
}

impl Tests {
    /// Nothing: zeros, as in [`Bundle::EMPTY`].
    pub(super) const NONE: Self = Self {
        planes: [0.0; 2],
        bounds: Bounds::NONE,
        frusta: Frusta::EMPTY,
        is_surrounded: false,
        mailbox: [0; SLOTS],
    };

    /// Forgets everything: other rays go through the grid now, between these planes and chords.
    #[inline(always)]
    pub(super) fn clear(&mut self, planes: [f32; 2], bounds: Bounds) {
        (self.planes, self.bounds) = (planes, bounds);
        if self.is_surrounded {
            self.is_surrounded = false;
            self.mailbox.fill(0);
        }
    }

    /// Tests rays of bundles between planes against a list of triangles; if they are many, all rays
    /// that are alive.
    ///
    /// Out of line, or it would be on the stack once for each division of a cell; so it says once
    /// more what vectors it is compiled for.
    #[inline(never)]
    pub(super) fn test<S: Simd, const ANY: bool, const N: usize>(
        &mut self,
        simd: S,
        bundles: &mut [Bundle; N],
        List { references, format, mesh }: List<'_>,
        rays: [u64; N],
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                if bundles.first().is_some_and(|bundle| !bundle.is_begun) {
                    for bundle in &mut *bundles {
                        bundle.begin(simd);
                    }
                }
                if count_of(&rays) < MANY {
                    for some in references.chunks(LANES) {
                        let ids = first_eight(some).map(
                            #[inline(always)]
                            |reference| format.id(reference),
                        );
                        let triangles = Eight::of(simd, mesh, ids, some.len());
                        for (bundle, rays) in bundles.iter_mut().zip(rays) {
                            bundle.few::<S, ANY>(simd, mesh, &ids, &triangles, rays);
                        }
                    }
                    return;
                }
                if !self.is_surrounded {
                    self.is_surrounded = true;
                    self.frusta.surround(simd, bundles, self.planes, self.bounds);
                }
                // Where triangles are large, many lie behind what was hit. To look for that costs, too.
                let mut far = f32::INFINITY;
                if references.len() > LANES {
                    far = f32::NEG_INFINITY;
                    for bundle in &*bundles {
                        far = greater(far, bundle.farthest(simd));
                    }
                }
                // Eight by eight those that were not tested yet.
                let first = format.id(references.first().copied().unwrap_or(0));
                let (mut fresh, mut count) = ([first; LANES], 0);
                for (place, &reference) in references.iter().enumerate() {
                    let id = format.id(reference);
                    let slot = &mut self.mailbox[id as usize % SLOTS];
                    fresh[count % LANES] = id;
                    count += usize::from(*slot != !id);
                    *slot = !id;
                    if count == LANES || (count > 0 && place + 1 == references.len()) {
                        self.many::<S, ANY, N>(
                            simd,
                            bundles,
                            mesh,
                            &fresh[..count.min(LANES)],
                            far,
                        );
                        count = 0;
                    }
                }
            },
        );
    }

    /// Tests all rays that are alive, side by side, against up to eight triangles one by one: those
    /// that the planes around the rays let through.
    #[inline(always)]
    fn many<S: Simd, const ANY: bool, const N: usize>(
        &self,
        simd: S,
        bundles: &mut [Bundle; N],
        mesh: &TriangleMesh<'_>,
        ids: &[u32],
        far: f32,
    ) {
        let triangles = Eight::gather(simd, mesh, ids);
        let mut near = self.frusta.meet(simd, &triangles, far);
        while near != 0 {
            let place = near.trailing_zeros() as usize;
            near &= near - 1;
            let Some(&id) = ids.get(place) else { break };
            let Some(triangle) = mesh.triangle(id) else { continue };
            let nearest = self.frusta.nearest(&triangle);
            for (at, bundle) in bundles.iter_mut().enumerate() {
                let rays = self.frusta.rays(simd, at, &triangle) & bundle.alive;
                let rays = if ANY { rays & bundle.members } else { rays };
                for axis in 0..3 {
                    let rays = rays & bundle.longest[axis];
                    if rays == 0 {
                        continue;
                    }
                    match axis {
                        0 => bundle.side_by_side::<S, 0, ANY>(simd, &triangle, nearest, id, rays),
                        1 => bundle.side_by_side::<S, 1, ANY>(simd, &triangle, nearest, id, rays),
                        _ => bundle.side_by_side::<S, 2, ANY>(simd, &triangle, nearest, id, rays),
                    }
                }
            }
        }
    }
}

impl Bundle {
    /// Tests rays one by one against up to eight triangles at once.
    #[inline(always)]
    fn few<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        mesh: &TriangleMesh<'_>,
        ids: &[u32; LANES],
        triangles: &Eight<S>,
        rays: u64,
    ) {
        let mut rest = if ANY { rays & self.members } else { rays };
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize % RAYS;
            rest &= rest - 1;
            let test = self.one(lane);
            let mut survivors = test.survivors(simd, triangles);
            while survivors != 0 {
                let place = survivors.trailing_zeros() as usize;
                survivors &= survivors - 1;
                let Some(&id) = ids.get(place) else { break };
                // Met in a cell before.
                if id == self.primitive[lane] {
                    continue;
                }
                // A miss never takes the place of a hit.
                let hit = test.decide(mesh, id);
                let best =
                    Hit { t: self.t_max[lane], primitive: self.primitive[lane], ..Hit::MISS };
                if hit.is_closer(&best) {
                    self.t_max[lane] = hit.t;
                    self.u[lane] = hit.u;
                    self.v[lane] = hit.v;
                    self.primitive[lane] = hit.primitive;
                    self.to[lane] = self.zero[lane] + self.speed[lane] * hit.t + self.margin;
                    if ANY {
                        self.members &= !(1 << lane);
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
        triangle: &Triangle,
        nearest: f32,
        id: u32,
        rays: u64,
    ) {
        let [x, y, z] = [(AXIS + 1) % 3, (AXIS + 2) % 3, AXIS];
        for row in 0..RAYS / WIDTH {
            let here = rays >> (row * WIDTH) & 0xffff;
            if here == 0 {
                continue;
            }

            // Leave out who has a hit before the triangle begins.
            let first = row * WIDTH;
            let to = row_of(simd, &self.to, first);
            let here = here & to.simd_ge(f32x16::splat(simd, nearest)).to_bitmask();
            if here == 0 {
                continue;
            }

            let (ox, oy, oz) = (
                row_of(simd, &self.origin[x], first),
                row_of(simd, &self.origin[y], first),
                row_of(simd, &self.origin[z], first),
            );
            let (shear_x, shear_y) =
                (row_of(simd, &self.aim[0], first), row_of(simd, &self.aim[1], first));

            // Shear the corners, and drop the triangle where two edge
            // functions have opposite signs.
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
            let depths = [triangle[0][z], triangle[1][z], triangle[2][z]].map(f64::from);
            for part in 0..WIDTH / PART {
                let survivors = survivors >> (part * PART) & ((1 << PART) - 1);
                if survivors != 0 {
                    let first = first + part * PART;
                    let taken = self.resolve(simd, &corners, depths, z, id, first, survivors);
                    if ANY {
                        self.members &= !(taken << first);
                    }
                }
            }
        }
    }

    /// Does what [`TriangleTest::resolve`] does for eight rays from `first` on, of whose row the
    /// corners are, and keeps the hits that are closer; tells which of the rays now have this hit.
    ///
    /// Where an edge function is infinite or no number, or all three are 0, t is no number, and no
    /// comparison with it holds. Else the area is finite, and 0 only where two have opposite signs.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "once, for three axes")]
    fn resolve<S: Simd>(
        &mut self,
        simd: S,
        corners: &[[f32; WIDTH]; 6],
        depths: [f64; 3],
        z: usize,
        id: u32,
        first: usize,
        survivors: u64,
    ) -> u64 {
        let row = |array: &PerRay| f32x8::simd_from(simd, part_of(array, first / PART));
        let corner =
            |at: usize| widened(f32x8::simd_from(simd, part_of(&corners[at], first / PART)));
        let corners = [corner(0), corner(1), corner(2), corner(3), corner(4), corner(5)];
        let origin = widened(row(&self.origin[z]));
        let direction = widened(row(&self.aim[2]));
        let met = Met::of(corners, depths, origin, direction);
        let t = narrowed(met.t);
        let survivors = survivors & !met.outside.to_bitmask();

        // Take what is closer. Read all before anything is written, and write first what needs no
        // choice: or the compiler makes masked stores (core/DESIGN.md).
        let (best_t, best_u, best_v) = (row(&self.t_max), row(&self.u), row(&self.v));
        let best_id = u32x8::simd_from(simd, part_of(&self.primitive, first / PART));
        let new_id = u32x8::splat(simd, id);
        let is_closer = t.simd_lt(best_t) | (t.simd_le(best_t) & new_id.simd_lt(best_id));
        let is_hit = t.simd_ge(row(&self.t_min)) & t.abs().simd_lt(f32::INFINITY);
        let taken = is_hit & is_closer;
        let taken = taken & mask32x8::from_bitmask(simd, survivors);
        let t = taken.select(t, best_t);
        let u = taken.select(narrowed(met.weights[0]), best_u);
        let v = taken.select(narrowed(met.weights[1]), best_v);
        let end = row(&self.zero) + row(&self.speed) * t + self.margin;
        *part_mut(&mut self.to, first / PART) = end.into();
        *part_mut(&mut self.t_max, first / PART) = t.into();
        *part_mut(&mut self.u, first / PART) = u.into();
        *part_mut(&mut self.v, first / PART) = v.into();
        *part_mut(&mut self.primitive, first / PART) = taken.select(new_id, best_id).into();
        taken.to_bitmask()
    }

    /// The test of one ray.
    #[inline(always)]
    fn one(&self, lane: usize) -> TriangleTest {
        let lane = lane % RAYS;
        let (axis, [x, y, z]) = if self.longest[0] >> lane & 1 == 1 {
            (Axis::X, [1, 2, 0])
        } else if self.longest[1] >> lane & 1 == 1 {
            (Axis::Y, [2, 0, 1])
        } else {
            (Axis::Z, [0, 1, 2])
        };
        TriangleTest {
            axis,
            anchor: [self.origin[x][lane], self.origin[y][lane], self.origin[z][lane]],
            shear: [self.aim[0][lane], self.aim[1][lane]],
            origin_z: f64::from(self.origin[z][lane]),
            direction_z: f64::from(self.aim[2][lane]),
            t_min: self.t_min[lane],
            t_max: self.t_max[lane],
            cull: Cull::None,
        }
    }
}

/// How many rays of all bundles these are.
#[inline(always)]
pub(super) fn count_of<const N: usize>(rays: &[u64; N]) -> u32 {
    rays.iter().map(|rays| rays.count_ones()).sum()
}

/// Eight numbers with twice the digits.
#[inline(always)]
fn widened<S: Simd>(row: f32x8<S>) -> f64x8<S> {
    let (low, high) = row.widen();
    low.combine(high)
}

/// Eight numbers rounded to half of the digits.
#[inline(always)]
fn narrowed<S: Simd>(row: f64x8<S>) -> f32x8<S> {
    let (low, high) = row.split();
    low.narrow(high)
}

/// Where eight rays meet a triangle.
struct Met<S: Simd> {
    /// Whether two edge functions have opposite signs.
    outside: mask64x8<S>,
    /// The weights of the second corner and of the third.
    weights: [f64x8<S>; 2],
    t: f64x8<S>,
}

impl<S: Simd> Met<S> {
    #[inline(always)]
    fn of(
        [ax, ay, bx, by, cx, cy]: [f64x8<S>; 6],
        [a, b, c]: [f64; 3],
        origin: f64x8<S>,
        direction: f64x8<S>,
    ) -> Self {
        // The edge functions again: exact products, so the signs are exact.
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let outside = u.min(v).min(w).simd_lt(0.0) & u.max(v).max(w).simd_gt(0.0);

        // Weights, and with them the depth.
        let share = 1.0 / (u + v + w);
        let (u, v, w) = (u * share + 0.0, v * share + 0.0, w * share + 0.0);
        let depth = u * (a - origin) + v * (b - origin) + w * (c - origin);
        Self { outside, weights: [v, w], t: depth / direction }
    }
}

/// Eight numbers of an array; behind its end it begins anew.
#[inline(always)]
fn part_of<T: Copy, const N: usize>(array: &[T; N], part: usize) -> [T; PART] {
    array.as_chunks().0[part % (N / PART)]
}

#[inline(always)]
fn part_mut<T>(array: &mut [T; RAYS], part: usize) -> &mut [T; PART] {
    &mut array.as_chunks_mut().0[part % (RAYS / PART)]
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
