//! One node: the boxes of up to eight children in 80 bytes.
//!
//! ```text
//! origin 3 x f32 | word: exponents 3 x u8, inner u8 | child u32 | first u32 | counts 8 x u8 | bounds 6 x 8 x u8
//!
//! side of a box  = origin + bound * 2^(exponent - 127), on each axis
//! child s is       an inner node   if bit s of inner is set: nodes[child + set bits below s]
//!                  a leaf          if counts[s] > 0: ids[first + counts of the leaves before s ..]
//!                  not there       otherwise; its box is inside out, so rays do not meet it
//! ```
//!
//! The quantised box holds the exact one and at least a sixty-fourth of a step more on each side.
//! That absorbs the rounding of `bound * step + (origin - ray origin)` where the ray starts near the
//! node: there the terms are below 2^9 steps, so three roundings are below 2^-13 steps. Where the ray
//! starts far away, the error is relative, and the far side of a slab test has a margin for it
//! ([`slab`](super::slab)).

use bytemuck::{Pod, Zeroable};
use glam::Vec3A;

use crate::aabb::Aabb;

/// Children of a node.
pub(crate) const WIDTH: usize = 8;

/// Ids in a leaf, at most: one vector of triangles.
pub(crate) const LEAF: usize = 8;

/// Up to eight children and their boxes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub(crate) struct Node {
    /// The bits of three f32: where bound 0 lies.
    pub(crate) origin: [u32; 3],
    /// From low to high byte: the step of each axis, a power of two, as the exponent bits of an f32; and
    /// the mask of inner children: bit `s` says that child `s` is a node.
    pub(crate) word: u32,
    /// The first child node; the others follow it.
    pub(crate) child: u32,
    /// Where the ids of the first leaf lie; those of the others follow them.
    pub(crate) first: u32,
    /// Ids of each leaf.
    pub(crate) counts: [u8; WIDTH],
    /// Least x, y, z, then greatest x, y, z of each child, in steps from the origin.
    pub(crate) bounds: [[u8; WIDTH]; 6],
}

const _: () = assert!(size_of::<Node>() == 80 && align_of::<Node>() == 4);

/// What a child is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Child {
    /// The node with this number.
    Inner(u32),
    /// The ids from `first` on, `count` of them.
    Leaf { first: u32, count: u32 },
}

impl Child {
    /// No child.
    pub(crate) const NONE: Self = Self::Leaf { first: 0, count: 0 };
}

impl Node {
    /// A node without children.
    pub(crate) const EMPTY: Self = Self {
        origin: [0; 3],
        word: 0x0001_0101,
        child: 0,
        first: 0,
        counts: [0; WIDTH],
        bounds: [[0xff; WIDTH], [0xff; WIDTH], [0xff; WIDTH], [0; WIDTH], [0; WIDTH], [0; WIDTH]],
    };

    /// Where bound 0 lies.
    #[inline(always)]
    pub(crate) const fn origin(&self) -> [f32; 3] {
        let [x, y, z] = self.origin;
        [f32::from_bits(x), f32::from_bits(y), f32::from_bits(z)]
    }

    /// The step of each axis as exponent bits.
    #[inline(always)]
    pub(crate) const fn exponents(&self) -> [u8; 3] {
        let [x, y, z, _] = self.word.to_le_bytes();
        [x, y, z]
    }

    /// The size of a step on each axis.
    #[inline(always)]
    pub(crate) const fn steps(&self) -> [f32; 3] {
        let [x, y, z] = self.exponents();
        [step(x), step(y), step(z)]
    }

    /// The children that are nodes, as bits.
    #[inline(always)]
    pub(crate) const fn inner(&self) -> u32 {
        self.word >> 24
    }

    /// Makes child `slot` a node.
    pub(crate) const fn set_inner(&mut self, slot: usize) {
        self.word |= 1 << (24 + slot % WIDTH);
    }

    /// What child `slot` is. A slot that is not used is a leaf of no ids.
    #[inline(always)]
    pub(crate) const fn child(&self, slot: u32) -> Child {
        let below = (1_u32 << (slot % 8)) - 1;
        let inner = self.inner();
        if inner >> (slot % 8) & 1 == 1 {
            return Child::Inner(self.child.wrapping_add((inner & below).count_ones()));
        }
        // Byte s of the product is the sum of the counts before s.
        let counts = u64::from_le_bytes(self.counts);
        let before = (counts << 8).wrapping_mul(0x0101_0101_0101_0101);
        let shift = 8 * (slot % 8);
        let first = self.first.wrapping_add((before >> shift & 0xff) as u32);
        Child::Leaf { first, count: (counts >> shift & 0xff) as u32 }
    }

    /// Writes the boxes of the children that there are, which `bounds` holds. No step is smaller than
    /// that of a box of size `least`.
    pub(crate) fn set_boxes(&mut self, bounds: &Aabb, boxes: &[Aabb; WIDTH], least: f32) {
        self.frame(bounds, least);
        for (slot, child) in boxes.iter().enumerate() {
            if self.inner() >> slot & 1 == 1 || self.counts[slot] > 0 {
                self.set_box(slot, child);
            }
        }
    }

    /// Sets where bounds are measured from: steps that hold a box, none below `least` in size.
    fn frame(&mut self, bounds: &Aabb, least: f32) {
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let mut exponents = [0; 4];
        for axis in 0..3 {
            // A quarter of a step must show beside the coordinates.
            let magnitude = min[axis].abs().max(max[axis].abs());
            let extent = (max[axis] - min[axis]).max(magnitude * LEAST_STEPS).max(least);
            let exponent = exponent_for(extent);
            exponents[axis] = exponent;
            self.origin[axis] = (min[axis] - 0.25 * step(exponent)).to_bits();
        }
        self.word = self.word & 0xff00_0000 | u32::from_le_bytes(exponents);
    }

    /// Writes the box of child `slot`, which lies in the box that the frame was set for.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the low byte")]
    fn set_box(&mut self, slot: usize, bounds: &Aabb) {
        let inverse = Vec3A::from_array(self.exponents().map(inverse_step));
        let origin = Vec3A::from_array(self.origin());
        // Rounding half a step and the margin away is rounding outwards by at least the margin.
        let low = (bounds.min - origin) * inverse - Vec3A::splat(0.5 + MARGIN);
        let high = (bounds.max - origin) * inverse + Vec3A::splat(0.5 + MARGIN);
        let [low, high] = [low.max(Vec3A::ZERO), high.min(Vec3A::splat(255.0))];
        let [low, high] = [low, high].map(|at| (at + Vec3A::splat(SHIFT)).to_array());
        for axis in 0..3 {
            let [low, high] = [low[axis], high[axis]].map(|at| at.to_bits() as u8);
            if let Some(bound) = self.bounds[axis].get_mut(slot) {
                *bound = low;
            }
            if let Some(bound) = self.bounds[axis + 3].get_mut(slot) {
                *bound = high;
            }
        }
    }
}

/// By how much of a step a quantised box is larger than the exact one, at least.
const MARGIN: f32 = 1.0 / 64.0;
/// A box is at least this part of its coordinates wide, so that a quarter of a step is no less than
/// their rounding.
const LEAST_STEPS: f32 = 254.0 / 2_097_152.0;
/// What is added to round to a whole number, which then stands in the low bits.
const SHIFT: f32 = 12_582_912.0; // 1.5 * 2^23

/// The exponent bits of the smallest power of two of which 254 make up an extent.
fn exponent_for(extent: f32) -> u8 {
    let least = extent * (1.0 / 254.0);
    let exponent = (least.to_bits() >> 23) & 0xff;
    // The next power of two; one is at least that large if there is a fraction or not.
    (exponent + 1).clamp(1, 253) as u8
}

/// A power of two from its exponent bits.
#[inline(always)]
const fn step(exponent: u8) -> f32 {
    f32::from_bits((exponent as u32) << 23)
}

/// One over a power of two from its exponent bits, which are at most 253.
#[inline(always)]
const fn inverse_step(exponent: u8) -> f32 {
    f32::from_bits((254_u32.saturating_sub(exponent as u32)) << 23)
}
