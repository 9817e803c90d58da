//! Which rays of a bundle meet a cell: rectangles of cells, a byte for each of their sides.
//!
//! Sixty-four rays are compared with a cell at once, so a side is the number of a cell in its part,
//! which has sixteen on an axis, and not a place.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u8x64};

use super::bundle::{Bundle, RAYS};

/// The whole part of a number, between 0 and 254; of a whole one perhaps one less, which the margin
/// allows. Without a cast, which would have to saturate lane by lane.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the low bits are what is wanted")]
fn byte(number: f32) -> u8 {
    let number = if number > 0.5 { number } else { 0.5 };
    let number = if number < 255.0 { number } else { 255.0 };
    // Adding 1.5 * 2^23 rounds to a whole number and leaves it in the low bits.
    ((number - 0.5) + 12_582_912.0).to_bits() as u8
}

/// The cells of a part that each ray may meet in a slice, on one axis, counted from 1: 0 is
/// outside, and so is all above the last one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    low: [u8; RAYS],
    high: [u8; RAYS],
}

impl Reach {
    /// Of no rays.
    pub(super) const NONE: Self = Self { low: [0; RAYS], high: [0; RAYS] };

    /// Sets them to those between two planes, `place` being where the cells are counted from.
    #[inline(always)]
    pub(super) fn set(
        &mut self,
        bundle: &Bundle,
        side: usize,
        planes: [f32; 2],
        place: impl Fn(f32) -> f32,
        margin: f32,
    ) {
        let Self { low, high } = self;
        let lines = bundle.start[side].iter().zip(&bundle.slope[side]);
        for (((start, slope), low), high) in lines.zip(low).zip(high) {
            let a = start + slope * planes[0];
            let b = start + slope * planes[1];
            *low = byte(place(if a < b { a } else { b }) + (1.0 - margin));
            *high = byte(place(if a < b { b } else { a }) + (1.0 + margin));
        }
    }

    /// The rays that meet a cell.
    #[inline(always)]
    pub(super) fn meets<S: Simd>(&self, simd: S, cell: u32) -> u64 {
        let cell = u8x64::splat(simd, (cell + 1).min(254) as u8);
        let low = u8x64::simd_from(simd, self.low).simd_le(cell);
        let high = u8x64::simd_from(simd, self.high).simd_ge(cell);
        (low & high).to_bitmask()
    }
}
