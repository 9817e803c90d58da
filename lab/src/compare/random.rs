//! Pseudorandom numbers, the same in every run.

use crate::scene::Bounds;
use crate::scene::noise::SplitMix64;
use crate::vector::Vector;

/// A generator of numbers from 0 to 1, which only depend on its start.
pub(super) struct Random(SplitMix64);

impl Random {
    pub(super) const fn new(start: u64) -> Self {
        Self(SplitMix64::new(start))
    }

    pub(super) fn next(&mut self) -> f64 {
        self.0.next_unit()
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
