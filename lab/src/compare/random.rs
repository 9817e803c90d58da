//! Pseudorandom numbers, the same in every run.

use crate::scene::Bounds;
use crate::vector::Vector;

/// A generator of numbers from 0 to 1, which only depend on its start (`SplitMix64`).
pub(super) struct Random(u64);

impl Random {
    pub(super) const fn new(start: u64) -> Self {
        Self(start)
    }

    #[expect(clippy::cast_precision_loss, reason = "53 bits are what an f64 has")]
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ mixed >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a whole number below another, or 0 if that is 0.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below a u32")]
    pub(super) fn below(&mut self, limit: u32) -> u32 {
        (self.next() * f64::from(limit)) as u32
    }

    /// Returns a point of a box.
    pub(super) fn point(&mut self, (min, max): Bounds) -> Vector {
        [0, 1, 2].map(|axis| {
            let (min, max) = (f64::from(min[axis]), f64::from(max[axis]));
            min + (max - min) * self.next()
        })
    }
}
