//! Chords around rays that go together: between two planes of k all of them lie between a lower one
//! and an upper one, on u and on v.

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

/// The least and the greatest u and v of rays on two planes of k, by axis and plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extremes {
    pub(super) low: [[f32; 2]; 2],
    pub(super) high: [[f32; 2]; 2],
}

impl Extremes {
    /// Of no rays.
    pub(super) const NONE: Self =
        Self { low: [[f32::INFINITY; 2]; 2], high: [[f32::NEG_INFINITY; 2]; 2] };

    /// Those of these rays and others.
    #[inline(always)]
    pub(super) fn and(mut self, others: &Self) -> Self {
        for side in 0..2 {
            for plane in 0..2 {
                let (low, high) = (&mut self.low[side][plane], &mut self.high[side][plane]);
                (*low, *high) = (
                    lesser(*low, others.low[side][plane]),
                    greater(*high, others.high[side][plane]),
                );
            }
        }
        self
    }

    /// Whether the rays are nowhere on the planes more than so many cells apart.
    #[inline(always)]
    pub(super) fn are_within(&self, cells: f32) -> bool {
        let widths = self.high.as_flattened().iter().zip(self.low.as_flattened());
        widths.fold(true, |all, (high, low)| all & (0.0..=cells).contains(&(high - low)))
    }
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

    /// Chords around rays between two planes.
    #[inline(always)]
    pub(super) fn around(planes: [f32; 2], Extremes { low, high }: &Extremes) -> Self {
        let chords =
            |ends: &[[f32; 2]; 2]| [Chord::new(planes, ends[0]), Chord::new(planes, ends[1])];
        Self { low: chords(low), high: chords(high) }
    }

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
