//! A part of the grid as rays that go together see it: along the axes u, v and k, from its own corner
//! and in its own cells.

use fearless_simd::Simd;

use super::Chunk;
use super::bundle::{Bundle, below_three};
use super::chords::Bounds;
use crate::cell::as_f32;

/// A part of the grid that is cut into up to 16 cells an axis: a block, or a divided cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part<'a> {
    pub(super) chunk: Chunk<'a>,
    /// Its bricks that have anything, but for some that no ray meets.
    pub(super) bricks: u64,
    /// Its corner on u, v and k, in cells of the lattice.
    pub(super) corner: [f32; 3],
    /// Its cells in one of the lattice.
    pub(super) scale: f32,
    /// Its cells on an axis.
    pub(super) cells: u32,
    /// How often cells of it may be divided.
    pub(super) depth: u32,
}

/// A part as the rays see it: in its own cells, from its corner on.
pub(super) struct View<'a> {
    pub(super) part: Part<'a>,
    axes: [u8; 3],
    is_mirrored: bool,
    bounds: Bounds,
    pub(super) margin: f32,
}

impl<'a> View<'a> {
    #[inline(always)]
    pub(super) fn new(bundle: &Bundle, mut bounds: Bounds, part: &Part<'a>) -> Self {
        let [_, _, near] = part.corner;
        for side in 0..2 {
            for chord in [&mut bounds.low[side], &mut bounds.high[side]] {
                chord.start = (chord.at(near) - part.corner[side]) * part.scale;
            }
        }
        let (axes, is_mirrored) = (bundle.axes, bundle.is_mirrored);
        Self { part: *part, axes, is_mirrored, bounds, margin: bundle.margin * part.scale }
    }

    /// The planes of k between which cells lie, from the first to before the end.
    #[inline(always)]
    pub(super) fn planes(&self, [first, end]: [u32; 2]) -> [f32; 2] {
        let cells = self.part.cells;
        if self.is_mirrored {
            [as_f32(cells - end), as_f32(cells - first)]
        } else {
            [as_f32(first), as_f32(end)]
        }
    }

    /// The axes u, v and k.
    #[inline(always)]
    pub(super) fn axes(&self) -> [usize; 3] {
        below_three(self.axes)
    }

    /// A step in the order of k as one in that of cells.
    #[inline(always)]
    pub(super) const fn in_order(&self, step: u32, count: u32) -> u32 {
        if self.is_mirrored { count - 1 - step } else { step }
    }

    /// A place in cells of the lattice.
    #[inline(always)]
    pub(super) fn corner(&self, at: [f32; 3]) -> [f32; 3] {
        core::array::from_fn(|axis| self.part.corner[axis] + at[axis] / self.part.scale)
    }

    /// The cells on u and v that rays may meet beside some on k; `None` if they pass the part.
    #[inline(always)]
    pub(super) fn cells(&self, run: [u32; 2]) -> Option<[[u32; 2]; 2]> {
        let (planes, cells) = (self.planes(run), self.part.cells);
        let on = |side| self.bounds.cells(side, planes, 1.0, cells, self.margin);
        Some([on(0)?, on(1)?])
    }

    /// The rays of each bundle that look for hits beside some cells on k.
    #[inline(always)]
    pub(super) fn between<S: Simd, const N: usize>(
        &self,
        simd: S,
        bundles: &[Bundle; N],
        run: [u32; 2],
    ) -> [u64; N] {
        let planes = self.in_lattice(self.planes(run));
        let mut rays = [0; N];
        for (rays, bundle) in rays.iter_mut().zip(bundles) {
            *rays = bundle.between(simd, planes);
        }
        rays
    }

    /// Planes in cells of the lattice.
    #[inline(always)]
    pub(super) fn in_lattice(&self, [near, far]: [f32; 2]) -> [f32; 2] {
        let place = |plane: f32| self.part.corner[2] + plane / self.part.scale;
        [place(near), place(far)]
    }
}

/// For each axis and range of four places, the cells of a brick or
/// bricks of a block that lie there.
pub(super) const LAYERS: [[[u64; 4]; 4]; 3] = {
    let mut layers = [[[0; 4]; 4]; 3];
    let mut bit = 0;
    while bit < 64 {
        let at = [bit & 3, bit >> 2 & 3, bit >> 4];
        let mut axis = 0;
        while axis < 3 {
            let (mut first, mut last) = (0, 0);
            while first < 4 {
                if first <= at[axis] && at[axis] <= last {
                    layers[axis][first][last] |= 1 << bit;
                }
                last += 1;
                if last == 4 {
                    first += 1;
                    last = 0;
                }
            }
            axis += 1;
        }
        bit += 1;
    }
    layers
};

/// Of four places from `first` on, those inside a range; none if they are all outside.
#[inline(always)]
pub(super) fn layer(axis: usize, first: u32, [low, high]: [u32; 2]) -> u64 {
    if high < first || low > first + 3 {
        return 0;
    }
    let (low, high) = (low.saturating_sub(first), (high - first).min(3));
    LAYERS[axis % 3][(low & 3) as usize][(high & 3) as usize]
}
