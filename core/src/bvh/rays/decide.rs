//! The hits of a group's rays: decides triangles that passed the filter, and keeps the closest hit of each ray, or ends
//! the ray at the first.
//!
//! ```text
//! candidate       collect pairs of a ray and a triangle; decide eight at a time in f64
//! decide_octet    decide eight rays with a triangle in f64
//! block           end rays that the triangle blocks for sure
//! ```

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, mask32x8};
use zerocopy::transmute_ref;

use super::{PAIRS, Rays, lanes};
use crate::aabb::lesser;
use crate::bvh::per_ray::{GROUP, OCTETS, PerRay, get, put};
use crate::bvh::slab::{end_behind, ends_behind};
use crate::filter::RayFilter;
use crate::mesh::{Triangle, TriangleMesh};
use crate::pairs::{self, Triangles};
use crate::ray::{Hit, INVALID_ID, Ray};
use crate::triangle::TriangleTest;

/// The most pairs that are decided one by one.
const FEW_PAIRS: usize = 2;

impl Rays {
    /// Returns true if a triangle ends the rays that surely hit it: they see it, and no filter is asked about it.
    #[inline(always)]
    pub(crate) fn are_ended_by(&self, mesh: &TriangleMesh<'_>, id: u32) -> bool {
        self.may_block && self.choice.has(mesh, id) && !self.choice.asks(mesh, id)
    }

    /// Ends the rays, given as bits, that a triangle blocks. The `t` of the hit is not known.
    #[inline(always)]
    pub(crate) fn block(&mut self, rays: u64, id: u32) {
        self.alive &= !rays;
        for ray in lanes(rays) {
            let at = ray as usize % GROUP;
            self.hits[at] = Hit::somewhere(&self.given[at], id);
        }
    }

    /// Notes a pair that passed the filter.
    #[inline(always)]
    pub(crate) fn candidate<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        mesh: &TriangleMesh<'_>,
        ray: u32,
        id: u32,
    ) {
        if !self.choice.has(mesh, id) {
            return;
        }
        self.pair_lanes[self.pair_count % PAIRS] = ray;
        self.pair_ids[self.pair_count % PAIRS] = id;
        self.pair_count += 1;
        if self.pair_count == PAIRS {
            self.decide::<S, ANY>(simd, mesh);
        }
    }

    /// Decides the pairs that passed.
    #[inline(always)]
    pub(crate) fn decide<S: Simd, const ANY: bool>(&mut self, simd: S, mesh: &TriangleMesh<'_>) {
        let count = core::mem::take(&mut self.pair_count);
        if count <= FEW_PAIRS {
            for at in 0..count {
                self.decide_one::<ANY>(
                    mesh,
                    self.pair_lanes[at % PAIRS],
                    self.pair_ids[at % PAIRS],
                );
            }
            return;
        }
        self.decide_eight::<S, ANY>(simd, mesh, count);
    }

    /// Decides pairs side by side.
    #[inline(always)]
    fn decide_eight<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        mesh: &TriangleMesh<'_>,
        count: usize,
    ) {
        // Repeat the first pair where there are fewer: it is read already.
        for at in count..PAIRS {
            self.pair_lanes[at] = self.pair_lanes[0];
            self.pair_ids[at] = self.pair_ids[0];
        }
        let (of, ids) = (self.pair_lanes, self.pair_ids);
        let ray = |at: usize| &self.given[of[at] as usize % GROUP];
        let rays = [ray(0), ray(1), ray(2), ray(3), ray(4), ray(5), ray(6), ray(7)];
        let decided = pairs::decide(simd, mesh, rays, Triangles::Each { ids, count });
        for lane in lanes(decided.seen(self.choice.cull).into()) {
            let at = lane as usize % PAIRS;
            self.found::<ANY>(mesh, of[at], decided.hit(at, ids[at]));
        }
        for lane in lanes(decided.unsure.into()) {
            let at = lane as usize % PAIRS;
            self.decide_one::<ANY>(mesh, of[at], ids[at]);
        }
    }

    /// Decides a triangle, given with its id, for those of eight rays that passed its filter, as bits; `first` is the
    /// first of the eight.
    #[inline(always)]
    pub(crate) fn decide_octet<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        mesh: &TriangleMesh<'_>,
        first: u32,
        passed: u32,
        (id, triangle): (u32, &Triangle),
    ) {
        if !self.choice.has(mesh, id) {
            return;
        }
        let octet = first as usize / 8 % OCTETS;
        let rays = &self.given.as_chunks::<8>().0[octet];
        let triangles = Triangles::One { triangle, passed };
        let decided = pairs::decide(simd, mesh, rays.each_ref(), triangles);
        let mut closer = 0;
        for lane in lanes(decided.seen(self.choice.cull).into()) {
            let hit = decided.hit(lane as usize, id);
            if ANY {
                self.found::<ANY>(mesh, first + lane, hit);
                continue;
            }
            let best = &mut self.hits[(first + lane) as usize % GROUP];
            if hit.is_closer(best) {
                *best = hit;
                closer |= 1 << lane;
            }
        }
        if !ANY {
            // Move the ends of the rays that found a closer hit, all at once.
            let end = ends_behind(simd, decided.t, self.scale[octet], self.extent);
            let is_closer = mask32x8::from_bitmask(simd, closer);
            let end = is_closer.select(end, f32x8::simd_from(simd, self.end[octet]));
            self.end[octet] = end.into();
        }
        for lane in lanes(decided.unsure.into()) {
            self.decide_one::<ANY>(mesh, first + lane, id);
        }
    }

    /// Decides one pair.
    #[inline(never)]
    fn decide_one<const ANY: bool>(&mut self, mesh: &TriangleMesh<'_>, ray: u32, id: u32) {
        let at = ray as usize % GROUP;
        let test = TriangleTest::with(&self.given[at], RayFilter::NONE).culling(self.choice.cull);
        let hit = test.decide(mesh, id);
        if hit.primitive != INVALID_ID {
            self.found::<ANY>(mesh, ray, hit);
        }
    }

    /// Keeps a hit if it is the closest so far.
    ///
    /// With `ANY`, an opaque hit ends its ray. Of the hits that the filter callback must judge, the closest is kept,
    /// until an opaque hit replaces it.
    #[inline(always)]
    fn found<const ANY: bool>(&mut self, mesh: &TriangleMesh<'_>, ray: u32, hit: Hit) {
        let at = ray as usize % GROUP;
        if ANY && !self.choice.asks(mesh, hit.primitive) {
            self.hits[at] = hit;
            self.alive &= !(1 << at);
            return;
        }
        if !hit.is_closer(&self.hits[at]) || (ANY && self.alive >> at & 1 == 0) {
            return;
        }
        self.hits[at] = hit;
        if !ANY {
            self.end_at(ray, hit.t);
        }
    }

    /// Returns a ray up to its closest hit so far.
    pub(crate) fn rest(&self, ray: u32) -> Ray {
        let at = ray as usize % GROUP;
        let given = self.given[at];
        Ray { t_max: lesser(self.hits[at].t, given.t_max), ..given }
    }

    /// Keeps a hit with a shape if it is the closest so far; with `is_any` it ends its ray.
    pub(crate) fn keep(&mut self, ray: u32, hit: Hit, is_any: bool) {
        let best = &mut self.hits[ray as usize % GROUP];
        if !hit.is_closer(best) {
            return;
        }
        *best = hit;
        if is_any {
            self.finish(ray);
        } else {
            self.end_at(ray, hit.t);
        }
    }

    /// Ends each ray behind its `t` in `until`: farther hits do not matter. Call it before any hit is found. The range
    /// of a ray stays as it is and decides what is a hit. Lanes without a ray may hold anything.
    #[inline(always)]
    pub(crate) fn take_until<S: Simd>(&mut self, simd: S, until: &[f32; GROUP]) {
        let octets: &PerRay = transmute_ref!(until);
        for ((end, &scale), &t) in self.end.iter_mut().zip(&self.scale).zip(octets) {
            *end = ends_behind(simd, t, scale, self.extent).into();
        }
        for (hit, &t) in self.hits.iter_mut().zip(until) {
            hit.t = t;
        }
    }

    /// Ends a ray: nothing else matters to it.
    pub(crate) fn finish(&mut self, ray: u32) {
        self.alive &= !(1 << (ray % u64::BITS));
    }

    /// Ends a ray at a `t`.
    #[inline(always)]
    pub(crate) fn end_at(&mut self, ray: u32, t: f32) {
        let end = end_behind(t, get(&self.scale, ray), self.extent);
        put(&mut self.end, ray, end);
    }
}
