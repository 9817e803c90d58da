//! Many rays against triangles: eight triangles at once for a few rays, ray by ray for many.
//!
//! A triangle in a cell with many rays is tested against all that are alive, and not again for
//! others, unless the mailbox forgot it.
//!
//! For every ray and triangle [`TriangleTest`] decides, so hits have the same bits.

use fearless_simd::Simd;

use super::bundle::{Bundle, PerRay, RAYS};
use super::chords::Bounds;
use super::frusta::Frusta;
use super::quarters::Format;
use crate::aabb::greater;
use crate::eight::{Eight, LANES, first_eight};
use crate::filter::{RayFilter, Reach};
use crate::mesh::TriangleMesh;
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
                let mut rays = self.frusta.rays(simd, at, &triangle) & bundle.alive;
                while rays != 0 {
                    let lane = rays.trailing_zeros() as usize % RAYS;
                    rays &= rays - 1;
                    let test = bundle.one(lane);
                    if test.passes(&triangle) {
                        bundle.take::<ANY>(&test, mesh, id, lane);
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
                self.take::<ANY>(&test, mesh, id, lane);
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
        // A miss never takes the place of a hit.
        let hit = test.decide(mesh, id);
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
        let lane = lane % RAYS;
        let xyz = |rows: &[PerRay; 3]| [rows[0][lane], rows[1][lane], rows[2][lane]];
        let (origin, direction) = (xyz(&self.origin), xyz(&self.direction));
        let (t_min, t_max) = (self.t_min[lane], self.last[lane]);
        let reach = Reach::of(&self.bounds, origin);
        let filter = RayFilter::new(direction, origin, 0.0, reach);
        TriangleTest::with(&Ray { origin, t_min, direction, t_max }, filter)
    }
}

/// How many rays of all bundles these are.
#[inline(always)]
pub(super) fn count_of<const N: usize>(rays: &[u64; N]) -> u32 {
    rays.iter().map(|rays| rays.count_ones()).sum()
}
