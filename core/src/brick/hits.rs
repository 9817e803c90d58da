//! Many rays against triangles: eight triangles at once for a few rays, ray by ray for many.
//!
//! A triangle in a cell with many rays is tested against all that are alive, and not again for
//! others, unless the mailbox forgot it.
//!
//! For every ray and triangle [`TriangleTest`] decides, so hits have the same bits.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8};

use super::bundle::{Bundle, PerRay, RAYS};
use super::chords::Bounds;
use super::frusta::Frusta;
use super::quarters::Format;
use crate::aabb::greater;
use crate::eight::{Eight, LANES, first_eight};
use crate::filter::{self, Filter, RayFilter, Reach};
use crate::mesh::{Triangle, TriangleMesh};
use crate::pairs;
use crate::ray::{Hit, Ray};
use crate::triangle::TriangleTest;

/// From so many rays on, all that are alive are tested. A choice by the number of rows and triangles
/// was no better.
const MANY: u32 = 8;

/// How many triangles a mailbox remembers.
const SLOTS: usize = 256;

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
                        bundle.begin();
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

    /// Tests all rays that are alive, one by one, against up to eight triangles: those that the planes
    /// around the rays let through.
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
            for (at, bundle) in bundles.iter_mut().enumerate() {
                let rays = self.frusta.rays(simd, at, &triangle) & bundle.alive;
                bundle.all::<S, ANY>(simd, mesh, id, &triangle, rays);
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
                self.take::<ANY>(&test, mesh, id, lane);
            }
        }
    }

    /// Tests rays against one triangle, eight at a time.
    #[inline(always)]
    fn all<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        mesh: &TriangleMesh<'_>,
        id: u32,
        triangle: &Triangle,
        rays: u64,
    ) {
        let corners = filter::splat(simd, triangle);
        let (mut lanes, mut count) = ([0; LANES], 0);
        for first in (0..RAYS).step_by(LANES) {
            let some = rays >> first & 0xff;
            if some == 0 {
                continue;
            }
            let dropped = self.filter(simd, first).drops(&corners).to_bitmask();
            let mut survivors = some & !dropped;
            while survivors != 0 {
                lanes[count % LANES] = first + survivors.trailing_zeros() as usize;
                count += 1;
                survivors &= survivors - 1;
                if count == LANES {
                    self.decide::<S, ANY>(simd, mesh, id, lanes, count);
                    count = 0;
                }
            }
        }
        if count > 0 {
            self.decide::<S, ANY>(simd, mesh, id, lanes, count);
        }
    }

    /// The filters of eight rays.
    #[inline(always)]
    fn filter<S: Simd>(&self, simd: S, first: usize) -> Filter<f32x8<S>> {
        let [a, b, c] = &self.origin;
        let [d, e, f] = &self.direction;
        let origin = [eight(simd, a, first), eight(simd, b, first), eight(simd, c, first)];
        let direction = [eight(simd, d, first), eight(simd, e, first), eight(simd, f, first)];
        Filter::of_eight(simd, origin, direction, &self.bounds)
    }

    /// Decides up to eight rays and a triangle at once.
    #[inline(always)]
    fn decide<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        mesh: &TriangleMesh<'_>,
        id: u32,
        lanes: [usize; LANES],
        count: usize,
    ) {
        let ray = |at: usize| self.ray(lanes[at % LANES]);
        let rays = [ray(0), ray(1), ray(2), ray(3), ray(4), ray(5), ray(6), ray(7)];
        let decided = pairs::decide(simd, mesh, rays.each_ref(), [id; LANES], count);
        for (at, lane) in lanes.into_iter().enumerate().take(count) {
            if decided.hits >> at & 1 == 1 {
                self.keep::<ANY>(decided.hit(at, id), lane % RAYS);
            } else if decided.unsure >> at & 1 == 1 {
                let test = TriangleTest::with(&rays[at % LANES], RayFilter::NONE);
                self.take::<ANY>(&test, mesh, id, lane % RAYS);
            }
        }
    }

    /// Keeps the hit of a ray with a triangle if it is closer.
    #[inline(always)]
    fn take<const ANY: bool>(
        &mut self,
        test: &TriangleTest,
        mesh: &TriangleMesh<'_>,
        id: u32,
        lane: usize,
    ) {
        // Met in a cell before, or any hit was enough.
        if id == self.primitive[lane] || ANY && self.members >> lane & 1 == 0 {
            return;
        }
        self.keep::<ANY>(test.decide(mesh, id), lane);
    }

    /// Keeps a hit if it is closer. A miss never takes the place of a hit.
    #[inline(always)]
    fn keep<const ANY: bool>(&mut self, hit: Hit, lane: usize) {
        let best = Hit { t: self.t_max[lane], primitive: self.primitive[lane], ..Hit::MISS };
        if hit.is_closer(&best) {
            self.t_max[lane] = hit.t;
            self.u[lane] = hit.u;
            self.v[lane] = hit.v;
            self.primitive[lane] = hit.primitive;
            self.to[lane] = self.zero[lane] + self.speed[lane] * hit.t + self.margin;
            if ANY {
                self.members &= !(1 << lane);
            }
        }
    }

    /// The test of one ray.
    #[inline(always)]
    fn one(&self, lane: usize) -> TriangleTest {
        let ray = self.ray(lane);
        let reach = Reach::of(&self.bounds, ray.origin);
        let filter = RayFilter::new(ray.direction, ray.origin, 0.0, reach);
        TriangleTest::with(&ray, filter)
    }

    /// One ray, as it was given.
    #[inline(always)]
    fn ray(&self, lane: usize) -> Ray {
        let lane = lane % RAYS;
        let xyz = |rows: &[PerRay; 3]| [rows[0][lane], rows[1][lane], rows[2][lane]];
        let (origin, direction) = (xyz(&self.origin), xyz(&self.direction));
        Ray { origin, t_min: self.t_min[lane], direction, t_max: self.last[lane] }
    }
}

/// A number of eight rays.
#[inline(always)]
fn eight<S: Simd>(simd: S, row: &PerRay, first: usize) -> f32x8<S> {
    f32x8::simd_from(simd, row.as_chunks::<LANES>().0[first / LANES % (RAYS / LANES)])
}

/// How many rays of all bundles these are.
#[inline(always)]
pub(super) fn count_of<const N: usize>(rays: &[u64; N]) -> u32 {
    rays.iter().map(|rays| rays.count_ones()).sum()
}
