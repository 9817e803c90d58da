//! Up to 64 rays through the tree together.
//!
//! Each place on the stack has a child and the rays that met its box, one bit each. So a node is decoded and
//! a leaf's triangles are fetched once for all of them, and no ray waits for another.
//!
//! ```text
//! prepare the rays; if they start far apart, all are to be traced alone
//! stack = [(root, all rays)]
//! pop a child and its rays, without those that are done or end before it begins
//! node: decode the eight boxes
//!       few rays: intersect each with the eight boxes
//!       many:     intersect the beam of all rays with the eight boxes, then sixteen rays at a time with each
//!                 box that is left
//!       push the children with the rays that met them, those that begin nearest last
//! leaf: filter its triangles, all at once for each ray or eight rays at a time for each triangle;
//!       decide what passes in f64, eight pairs of a ray and a triangle at a time
//! ```
//!
//! The rays may go anywhere: rays of a camera share most nodes, rays from a surface share the first ones.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f32x16, mask32x16, u32x8};

use super::Bvh;
use super::boxes::{WideBoxes, bits};
use super::node::{Child, WIDTH};
use super::rays::{GROUP, OCTETS, Rays};
use super::walk::STACK;
use crate::aabb::Aabb;
use crate::eight::{Eight, first_eight};
use crate::extremes::Extremes;
use crate::mesh::TriangleMesh;
use crate::simd::{Kernel, SimdLevel, dispatch};

/// With more rays than this, the beam of all rays is tested before the rays.
const FEW_RAYS: u32 = 8;

/// Counts the vectors of eight rays that hold at least one of some rays.
#[inline(always)]
const fn octets(rays: u64) -> u32 {
    let pairs = rays | rays >> 1;
    let fours = pairs | pairs >> 2;
    ((fours | fours >> 4) & 0x0101_0101_0101_0101).count_ones()
}

/// A child that waits, and the rays that met it.
#[derive(Clone, Copy)]
pub(crate) struct GroupEntry {
    /// Node and slot.
    place: u32,
    /// The least distance at which one of the rays enters.
    near: f32,
    rays: u64,
}

impl GroupEntry {
    const NONE: Self = Self { place: 0, near: 0.0, rays: 0 };
}

/// The stack of a group.
pub(crate) struct Stack([GroupEntry; STACK]);

impl Stack {
    pub(crate) const fn new() -> Self {
        Self([GroupEntry::NONE; STACK])
    }
}

/// A group of rays, and the tree that they go through.
pub(crate) struct Group<'r> {
    pub(crate) bvh: &'r Bvh<'r>,
    pub(crate) mesh: &'r TriangleMesh<'r>,
    /// The box of the tree.
    pub(crate) bounds: &'r Aabb,
    pub(crate) rays: &'r mut Rays,
    pub(crate) stack: &'r mut Stack,
    /// Number of rays in the first slots.
    pub(crate) count: usize,
}

impl Group<'_> {
    /// Finds a hit of each ray; with `is_any` the first one ends it. Returns a mask of the rays that must be traced
    /// alone instead.
    ///
    /// Not generic over the batch: kernels are the largest functions of the library, and all batches of a program
    /// share them.
    #[inline(never)]
    pub(super) fn trace(&mut self, level: SimdLevel, is_any: bool) -> u64 {
        if is_any {
            dispatch(level, Descent::<true>(self))
        } else {
            dispatch(level, Descent::<false>(self))
        }
    }
}

/// The kernel over a group; with `ANY` the first hit of a ray ends it.
struct Descent<'r, 'g, const ANY: bool>(&'r mut Group<'g>);

impl<const ANY: bool> Kernel for Descent<'_, '_, ANY> {
    type Output = u64;
    const IS_WIDE: bool = true;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u64 {
        let Group { bounds, rays, count, .. } = self.0;
        let alone = rays.prepare(simd, *count, bounds);
        if rays.are_scattered(bounds) {
            return alone | rays.alive;
        }
        self.descend(simd);
        alone
    }
}

impl<const ANY: bool> Descent<'_, '_, ANY> {
    #[inline(always)]
    fn descend<S: Simd>(self, simd: S) {
        let Group { bvh, mesh, rays, stack, .. } = self.0;
        let stack = &mut stack.0;
        let mut budget = bvh.budget();
        let mut top = 0;
        let beam = rays.beam(simd);
        let (mut child, mut mask) = (Child::Inner(0), rays.alive);
        loop {
            let Some(rest) = budget.checked_sub(1) else { return };
            budget = rest;
            match child {
                Child::Inner(number) => {
                    let Some(node) = bvh.nodes.get(number as usize) else { return };
                    let boxes = WideBoxes::decode(simd, node, rays.center, rays.spread);
                    let count = mask.count_ones();
                    // Mask unused slots: their boxes are inside out, but this slab test sorts near and far side
                    // itself and would meet them.
                    let (mut some, mut all, mut enter) = (node.used(), 0, f32x8::splat(simd, 0.0));
                    if count > FEW_RAYS {
                        let beam = boxes.meet_beam(simd, &beam);
                        some &= beam.some;
                        (all, enter) = (some & beam.all, beam.enter);
                    }
                    let unsure = some & !all;
                    let mut met = if count <= octets(mask) * unsure.count_ones() {
                        one_by_one(simd, &boxes, rays, mask)
                    } else {
                        side_by_side(simd, &boxes, rays, mask, unsure)
                    };
                    met.add_all(all, mask, enter);
                    let Met { slots, rays: by, near } = met;
                    let mut slots = slots & some;
                    // Push what is met, the nearest last.
                    let base = top;
                    while slots != 0 {
                        let slot = slots.trailing_zeros();
                        slots &= slots - 1;
                        let (rays, near) = (by[slot as usize % WIDTH], near[slot as usize % WIDTH]);
                        let place = number << 3 | slot;
                        push::<ANY>(stack, &mut top, base, GroupEntry { place, near, rays });
                    }
                }
                Child::Leaf { first, count } => {
                    let ids = bvh.leaf(first, count);
                    if mask.count_ones() <= octets(mask) * count {
                        let lanes = bvh.eight(first).unwrap_or_else(|| first_eight(ids));
                        let triangles = Eight::of(simd, mesh, lanes, ids.len());
                        let mut rest = mask;
                        while rest != 0 {
                            let ray = rest.trailing_zeros();
                            rest &= rest - 1;
                            let filter = rays.filter(simd, ray);
                            let dropped = bits(filter.drops(&triangles.corners));
                            let mut survivors = !dropped & triangles.used;
                            while survivors != 0 {
                                let lane = survivors.trailing_zeros();
                                survivors &= survivors - 1;
                                let Some(&id) = ids.get(lane as usize) else { break };
                                rays.candidate::<S, ANY>(simd, mesh, ray, id);
                            }
                        }
                    } else {
                        for &id in ids {
                            let Some(triangle) = mesh.triangle(id) else { continue };
                            let corners = crate::filter::splat(simd, &triangle);
                            for (octet, first) in (0..OCTETS).zip((0..).step_by(8)) {
                                let of_octet = mask >> (8 * octet) & 0xff;
                                if of_octet == 0 {
                                    continue;
                                }
                                let dropped = bits(rays.filters(simd, octet).drops(&corners));
                                let mut survivors = of_octet & !u64::from(dropped);
                                while survivors != 0 {
                                    let ray = first + survivors.trailing_zeros();
                                    survivors &= survivors - 1;
                                    rays.candidate::<S, ANY>(simd, mesh, ray, id);
                                }
                            }
                        }
                    }
                    rays.decide::<S, ANY>(simd, mesh);
                }
            }
            // Pop the next child that a ray still has to look at.
            loop {
                let Some(below) = top.checked_sub(1) else { return };
                top = below;
                let Some(waiting) = stack.get(top) else { return };
                mask = waiting.rays & rays.alive;
                if !ANY && mask != 0 {
                    mask = rays.ending_behind(simd, waiting.near, mask);
                }
                if mask != 0 {
                    let (node, slot) = (waiting.place >> 3, waiting.place & 7);
                    let node = bvh.nodes.get(node as usize);
                    child = node.map_or(Child::NONE, |node| node.child(slot));
                    break;
                }
            }
        }
    }
}

/// What rays met of the boxes of a node.
struct Met {
    /// The boxes that any of them met, as bits.
    slots: u32,
    /// For each box the rays that met it, as bits, and where the first one enters.
    rays: [u64; WIDTH],
    near: [f32; WIDTH],
}

impl Met {
    /// Adds boxes that all rays meet, each with a lower bound of their entry distances.
    #[inline(always)]
    fn add_all<S: Simd>(&mut self, all: u32, rays: u64, enter: f32x8<S>) {
        self.slots |= all;
        let enter: [f32; WIDTH] = enter.into();
        let mut rest = all;
        while rest != 0 {
            let slot = rest.trailing_zeros() as usize % WIDTH;
            rest &= rest - 1;
            self.rays[slot] = rays;
            self.near[slot] = enter[slot];
        }
    }
}

/// Intersects few rays with all boxes of a node.
#[inline(always)]
fn one_by_one<S: Simd>(simd: S, boxes: &WideBoxes<f32x8<S>>, rays: &Rays, mask: u64) -> Met {
    let zero = u32x8::splat(simd, 0);
    let far_away = f32x8::splat(simd, f32::INFINITY);
    let mut least = far_away;
    let mut halves = [zero; 2];
    for (first, met_by) in (0..).step_by(32).zip(&mut halves) {
        let mut rest = mask >> first & 0xffff_ffff;
        while rest != 0 {
            let bit = rest.trailing_zeros();
            rest &= rest - 1;
            let (near, met) = boxes.meet(simd, &rays.slab(simd, first + bit));
            *met_by |= met.select(u32x8::splat(simd, 1 << bit), zero);
            least = least.lesser(met.select(near, far_away));
        }
    }
    let slots = !(halves[0] | halves[1]).simd_eq(zero);
    let [low, high]: [[u32; WIDTH]; 2] = [halves[0].into(), halves[1].into()];
    let mut masks = [0; WIDTH];
    for ((mask, low), high) in masks.iter_mut().zip(low).zip(high) {
        *mask = u64::from(low) | u64::from(high) << 32;
    }
    Met { slots: bits(slots), rays: masks, near: least.into() }
}

/// Intersects many rays with the boxes of a node that their beam meets, sixteen rays at a time.
#[inline(always)]
fn side_by_side<S: Simd>(
    simd: S,
    boxes: &WideBoxes<f32x8<S>>,
    rays: &Rays,
    mask: u64,
    met: u32,
) -> Met {
    let far_away = f32x16::splat(simd, f32::INFINITY);
    let sides = boxes.sides();
    let (mut slots, mut masks, mut nearest) = (0, [0; WIDTH], [f32::INFINITY; WIDTH]);
    let mut rest = met;
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % WIDTH;
        rest &= rest - 1;
        let child = WideBoxes::<f32x16<S>>::one(simd, &sides, slot);
        let mut least = far_away;
        for which in 0..GROUP / 16 {
            let of_sixteen = mask >> (16 * which) & 0xffff;
            if of_sixteen == 0 {
                continue;
            }
            let (near, met) = child.meet(simd, &rays.sixteen(simd, which));
            // An invalid ray may have a NaN distance.
            let met = met & mask32x16::from_bitmask(simd, of_sixteen);
            masks[slot] |= met.to_bitmask() << (16 * which);
            least = least.lesser(met.select(near, far_away));
        }
        nearest[slot] = least.reduce_min();
        slots |= u32::from(masks[slot] != 0) << slot;
    }
    Met { slots, rays: masks, near: nearest }
}

/// Pushes a child; for closest hits behind those of the same node that begin farther away.
#[inline(always)]
fn push<const ANY: bool>(
    stack: &mut [GroupEntry],
    top: &mut usize,
    base: usize,
    waiting: GroupEntry,
) {
    let mut at = *top;
    if at >= stack.len() {
        return;
    }
    *top += 1;
    while !ANY
        && at > base
        && let Some(&below) = stack.get(at - 1)
        && below.near < waiting.near
    {
        if let Some(slot) = stack.get_mut(at) {
            *slot = below;
        }
        at -= 1;
    }
    if let Some(slot) = stack.get_mut(at) {
        *slot = waiting;
    }
}

const _: () = assert!(GROUP == 8 * OCTETS);
