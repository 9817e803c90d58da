//! A group of rays in a leaf.
//!
//! ```text
//! triangles   filter them, all at once for each ray or eight rays at a time for each triangle;
//!             for any hit, end the rays that a triangle surely blocks (range.rs);
//!             decide what else passes in f64: eight rays with a triangle if many of them pass its filter,
//!             else eight pairs of a ray and a triangle
//! boxes       intersect them as the boxes of a node; offer each that rays meet, the nearest first
//! ```

use fearless_simd::Simd;

use super::Bvh;
use super::boxes::{Beam, WideBoxes, bits};
use super::met::{Met, octets};
use super::per_ray::OCTETS;
use super::rays::Rays;
use super::shape_leaf::{nearest_of, pad_of};
use crate::aabb::Aabb;
use crate::eight::Eight;
use crate::mesh::TriangleMesh;
use crate::simd::HAS_PREFETCH;

/// If so many of eight rays pass the filter of a triangle, they are decided at once.
const MANY: u32 = 4;

/// A leaf that some rays of a group enter.
pub(super) struct Leaf<'r> {
    pub(super) bvh: &'r Bvh<'r>,
    pub(super) mesh: &'r TriangleMesh<'r>,
    /// The box of the tree.
    pub(super) bounds: &'r Aabb,
    /// Place of the first id among those of the tree.
    pub(super) first: u32,
    pub(super) ids: &'r [u32],
}

/// The treatment of rays that start far apart.
#[derive(Clone, Copy)]
pub(super) enum Scattered {
    /// As any group: rays for any hit share the first nodes, and many end soon.
    Together,
    /// Interleaved if they wait for memory, else alone.
    Interleaved,
    /// Each alone.
    Alone,
}

/// The content of the leaves of a tree.
pub(super) trait Leaves {
    /// True if children may come in any order: the first hit of each ray ends it.
    const IS_ANY: bool;

    /// Tells how rays that start far apart are traced.
    fn scattered(&self) -> Scattered;

    /// Lets the rays of a mask enter a leaf.
    fn enter<S: Simd>(
        &mut self,
        simd: S,
        leaf: &Leaf<'_>,
        rays: &mut Rays,
        beam: &Beam<S>,
        mask: u64,
    );
}

/// Triangles, which are tested; with `ANY` the first hit of a ray ends it.
pub(super) struct TriangleLeaves<const ANY: bool>;

impl<const ANY: bool> Leaves for TriangleLeaves<ANY> {
    const IS_ANY: bool = ANY;

    #[inline(always)]
    fn scattered(&self) -> Scattered {
        match ANY {
            true => Scattered::Together,
            false if HAS_PREFETCH => Scattered::Interleaved,
            false => Scattered::Alone,
        }
    }

    #[inline(always)]
    fn enter<S: Simd>(
        &mut self,
        simd: S,
        leaf: &Leaf<'_>,
        rays: &mut Rays,
        _: &Beam<S>,
        mask: u64,
    ) {
        let Leaf { mesh, ids, .. } = *leaf;
        if mask.count_ones() as usize <= octets(mask) as usize * ids.len() {
            // Few rays: filter all triangles of the leaf for each ray.
            filter_for_each::<S, ANY>(simd, leaf, rays, mask);
        } else {
            // Many rays: filter each triangle for eight rays at a time.
            for &id in ids {
                let Some(triangle) = mesh.triangle(id) else { continue };
                let corners = crate::filter::splat(simd, &triangle);
                let size = rays.size_of(simd, &corners, mask);
                let may_block = ANY && rays.are_ended_by(mesh, id);
                for (octet, first) in (0..OCTETS).zip((0..).step_by(8)) {
                    // Leave out rays that another triangle of the leaf has ended.
                    let left = if ANY { mask & rays.alive } else { mask };
                    let of_octet = u32::from(left.to_le_bytes()[octet]);
                    if of_octet == 0 {
                        continue;
                    }
                    let filter = rays.filters(simd, octet);
                    let mut dropped = filter.drops(&corners, &size);
                    if rays.may_leave {
                        let start = rays.starts_of(simd, octet);
                        dropped |= filter.passes_before(simd, &corners, &size, start);
                    }
                    let mut survivors = of_octet & !bits(dropped);
                    if may_block && survivors != 0 {
                        let range = rays.ranges_of(simd, octet);
                        let hits = filter.surely_hits(simd, &corners, &size, range);
                        let blocked = survivors & bits(hits);
                        rays.block(u64::from(blocked) << first, id);
                        survivors &= !blocked;
                    }
                    if survivors.count_ones() >= MANY {
                        rays.decide_octet::<S, ANY>(simd, mesh, first, survivors, (id, &triangle));
                        continue;
                    }
                    while survivors != 0 {
                        let ray = first + survivors.trailing_zeros();
                        survivors &= survivors - 1;
                        rays.candidate::<S, ANY>(simd, mesh, ray, id);
                    }
                }
            }
        }
        // Decide in f64 what passed.
        rays.decide::<S, ANY>(simd, mesh);
    }
}

/// Filters all triangles of a leaf at once for each ray of a mask. Notes what passes; with `ANY` ends the rays that a
/// triangle surely blocks.
#[inline(always)]
pub(super) fn filter_for_each<S: Simd, const ANY: bool>(
    simd: S,
    leaf: &Leaf<'_>,
    rays: &mut Rays,
    mask: u64,
) {
    let Leaf { bvh, mesh, first, ids, .. } = *leaf;
    let triangles = Eight::of(simd, mesh, bvh.lanes(first, ids), ids.len());
    let size = rays.size_of(simd, &triangles.corners, mask);
    let mut rest = mask;
    while rest != 0 {
        let ray = rest.trailing_zeros();
        rest &= rest - 1;
        // Drop the triangles beside the ray, and those that it meets before its start.
        let filter = rays.filter(simd, ray);
        let mut dropped = filter.drops(&triangles.corners, &size);
        if rays.may_leave {
            let start = rays.start_of(simd, ray);
            dropped |= filter.passes_before(simd, &triangles.corners, &size, start);
        }
        let mut survivors = !bits(dropped) & triangles.used;
        // End the ray if a triangle surely blocks it.
        if ANY && survivors != 0 && rays.may_block {
            let range = rays.range_of(simd, ray);
            let hits = filter.surely_hits(simd, &triangles.corners, &size, range);
            let blocker = (survivors & bits(hits)).trailing_zeros() as usize;
            if let Some(&id) = ids.get(blocker)
                && rays.are_ended_by(mesh, id)
            {
                rays.block(1 << ray, id);
                continue;
            }
        }
        // Note the pairs that are left.
        while survivors != 0 {
            let lane = survivors.trailing_zeros();
            survivors &= survivors - 1;
            let Some(&id) = ids.get(lane as usize) else { break };
            rays.candidate::<S, ANY>(simd, mesh, ray, id);
        }
    }
}

/// Takes the number of a box, the rays that meet it as a mask, and all rays of the group.
pub(crate) type Offer<'o> = dyn FnMut(u32, u64, &mut Rays) + 'o;

/// Boxes, which are offered.
pub(super) struct BoxLeaves<'o, 'f> {
    pub(super) offer: &'o mut Offer<'f>,
    /// True if the first hit of a ray ends it.
    pub(super) is_any: bool,
}

impl Leaves for BoxLeaves<'_, '_> {
    // Near to far for any hit, too: one kernel serves both.
    const IS_ANY: bool = false;

    #[inline(always)]
    fn scattered(&self) -> Scattered {
        if self.is_any { Scattered::Together } else { Scattered::Alone }
    }

    #[inline(always)]
    fn enter<S: Simd>(
        &mut self,
        simd: S,
        leaf: &Leaf<'_>,
        rays: &mut Rays,
        beam: &Beam<S>,
        mask: u64,
    ) {
        let Leaf { mesh, bounds, ids, .. } = *leaf;
        // A box in the caller's memory has no margin of its own, unlike one of a node.
        let growth = rays.growth + pad_of(bounds);
        let boxes = WideBoxes::of_leaf(simd, mesh, ids, rays.center, growth);
        let used = (1_u32 << ids.len().min(8)) - 1;
        let mut met = Met::NONE;
        met.meet(simd, &boxes, rays, beam, mask, used, true);
        let Met { mut slots, rays: by, near } = met;
        while slots != 0 {
            let slot = nearest_of(slots, &near) % by.len();
            slots &= !(1 << slot);
            let left = rays.ending_behind(simd, near[slot], by[slot] & rays.alive);
            if left != 0
                && let Some(&number) = ids.get(slot)
            {
                (self.offer)(number, left, rays);
            }
        }
    }
}
