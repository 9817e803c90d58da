//! Chords around the rays of a tile: between two planes of k all of them lie between a lower one and
//! an upper one, on u and on v.

use crate::aabb::{greater, lesser};
use crate::cell::as_f32;

/// Chords around the rays, on u and v.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) low: [Chord; 2],
    pub(super) high: [Chord; 2],
}

/// A line in the plane of k and u, or k and v.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chord {
    pub(super) start: f32,
    pub(super) slope: f32,
}

impl Chord {
    /// A chord of what lies at `a` on plane `from` and at `b` on plane `to`.
    pub(super) fn new([from, to]: [f32; 2], [a, b]: [f32; 2]) -> Self {
        let slope = if to > from { (b - a) / (to - from) } else { 0.0 };
        Self { start: a - slope * from, slope }
    }

    #[inline(always)]
    pub(super) fn at(self, plane: f32) -> f32 {
        self.start + self.slope * plane
    }
}

impl Bounds {
    /// Around nothing.
    pub(super) const NONE: Self = {
        let none = Chord { start: 0.0, slope: 0.0 };
        Self { low: [none; 2], high: [none; 2] }
    };

    /// The first and the last of `count` cells on an axis that rays may meet between two planes,
    /// each cell `size` wide; `None` if they pass all of them. Chords are numbers.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub(super) fn cells(
        &self,
        axis: usize,
        planes: [f32; 2],
        size: f32,
        count: u32,
        margin: f32,
    ) -> Option<[u32; 2]> {
        let low = planes.map(|plane| self.low[axis].at(plane));
        let high = planes.map(|plane| self.high[axis].at(plane));
        let low = (lesser(low[0], low[1]) - margin) / size;
        let high = (greater(high[0], high[1]) + margin) / size;
        if high < 0.0 || low >= as_f32(count) {
            return None;
        }
        Some([low as u32, (high as u32).min(count - 1)])
    }
}
