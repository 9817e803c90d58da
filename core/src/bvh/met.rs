//! A group of rays against the boxes of a node: which rays meet which of them.
//!
//! ```text
//! more than eight rays: intersect the beam of the whole group with the eight boxes; it decides some for all rays
//! then, whichever takes fewer vector tests:
//!     ray by ray: each with all eight boxes
//!     box by box: each that is undecided with sixteen rays at a time
//! ```

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f32x16, mask32x16, u32x8};

use super::boxes::{Beam, FEW_RAYS, WideBoxes, bits};
use super::node::WIDTH;
use super::per_ray::GROUP;
use super::rays::Rays;
use crate::extremes::Extremes;

// Masks of rays are 64 bits, and `one_by_one` takes them in two halves.
const _: () = assert!(GROUP == 64);

/// Counts the vectors of eight rays that hold at least one of some rays.
#[inline(always)]
pub(super) const fn octets(rays: u64) -> u32 {
    let pairs = rays | rays >> 1;
    let fours = pairs | pairs >> 2;
    ((fours | fours >> 4) & 0x0101_0101_0101_0101).count_ones()
}

/// The intersections of rays with up to eight boxes.
pub(super) struct Met {
    /// The boxes that any of them met, as bits.
    pub(super) slots: u32,
    /// For each box the rays that met it, as bits, and where the first one enters if that matters.
    pub(super) rays: [u64; WIDTH],
    pub(super) near: [f32; WIDTH],
}

impl Met {
    pub(super) const NONE: Self = Self { slots: 0, rays: [0; WIDTH], near: [0.0; WIDTH] };

    /// Intersects some rays of a group with the boxes that are used; finds entry distances only if they are wanted.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "each is its own")]
    pub(super) fn meet<S: Simd>(
        &mut self,
        simd: S,
        boxes: &WideBoxes<f32x8<S>>,
        rays: &Rays,
        beam: &Beam<S>,
        mask: u64,
        used: u32,
        wants_near: bool,
    ) {
        let count = mask.count_ones();
        let (mut some, mut all, mut enter) = (used, 0, f32x8::splat(simd, 0.0));
        // For more than a few rays, intersect the beam of the whole group with the boxes.
        if count > FEW_RAYS {
            let beam = boxes.meet_beam(simd, beam);
            some &= beam.some;
            (all, enter) = (some & beam.all, beam.enter);
        }
        // Ray by ray, each ray takes one vector test of all eight boxes. Box by box, each box that the beam left
        // undecided takes one test for every eight rays, or for every sixteen if vectors have sixteen lanes.
        let unsure = some & !all;
        let octets = octets(mask);
        let vectors = if S::f32s::LEN < 16 { octets } else { octets.div_ceil(2) };
        if count <= vectors * unsure.count_ones() {
            one_by_one(simd, boxes, rays, mask, wants_near, self);
        } else {
            side_by_side(simd, boxes, rays, mask, unsure, wants_near, self);
        }
        self.add_all(all, mask, enter);
        self.slots &= some;
    }

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

/// Intersects rays with all eight boxes of a node, ray by ray.
#[inline(always)]
fn one_by_one<S: Simd>(
    simd: S,
    boxes: &WideBoxes<f32x8<S>>,
    rays: &Rays,
    mask: u64,
    wants_near: bool,
    met: &mut Met,
) {
    let zero = u32x8::splat(simd, 0);
    let far_away = f32x8::splat(simd, f32::INFINITY);
    let mut least = far_away;
    let mut halves = [zero; 2];
    for (first, met_by) in (0..).step_by(32).zip(&mut halves) {
        let mut rest = mask >> first & 0xffff_ffff;
        while rest != 0 {
            let bit = rest.trailing_zeros();
            rest &= rest - 1;
            let (near, met) = boxes.meet(simd, &rays.one(simd, first + bit));
            *met_by |= met.select(u32x8::splat(simd, 1 << bit), zero);
            if wants_near {
                least = least.lesser(met.select(near, far_away));
            }
        }
    }
    let slots = !(halves[0] | halves[1]).simd_eq(zero);
    let [low, high]: [[u32; WIDTH]; 2] = [halves[0].into(), halves[1].into()];
    let mut masks = [0; WIDTH];
    for ((mask, low), high) in masks.iter_mut().zip(low).zip(high) {
        *mask = u64::from(low) | u64::from(high) << 32;
    }
    (met.slots, met.rays) = (bits(slots), masks);
    if wants_near {
        met.near = least.into();
    }
}

/// Intersects rays with the boxes of a node that the beam did not decide, box by box: sixteen rays at a time.
#[inline(always)]
fn side_by_side<S: Simd>(
    simd: S,
    boxes: &WideBoxes<f32x8<S>>,
    rays: &Rays,
    mask: u64,
    unsure: u32,
    wants_near: bool,
    met: &mut Met,
) {
    let far_away = f32x16::splat(simd, f32::INFINITY);
    let sides = boxes.sides();
    met.slots = 0;
    let mut rest = unsure;
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % WIDTH;
        rest &= rest - 1;
        let child = WideBoxes::<f32x16<S>>::one(simd, &sides, slot);
        let (mut by, mut least) = (0, far_away);
        for which in 0..GROUP / 16 {
            let of_sixteen = mask >> (16 * which) & 0xffff;
            let (near, is_met) = child.meet(simd, &rays.sixteen(simd, which));
            // Mask afterwards: an invalid ray has NaN distances and would count as a hit.
            let is_met = is_met & mask32x16::from_bitmask(simd, of_sixteen);
            by |= is_met.to_bitmask() << (16 * which);
            if wants_near {
                least = least.lesser(is_met.select(near, far_away));
            }
        }
        met.rays[slot] = by;
        if wants_near {
            met.near[slot] = least.reduce_min();
        }
        met.slots |= u32::from(by != 0) << slot;
    }
}
