//! A batch of 64 primitives, and the cells of each.
//!
//! The number of cells of a primitive is unpredictable, so a branch on it is often mispredicted, and the processor
//! discards its work on the next primitives. A pass therefore finds the cells of a whole batch first. Then it enters
//! the primitives into lists, and branches on numbers in the L1 cache.

use core::ops::Range;

use crate::cell::CellRange;
use crate::cell::row;
use crate::control::{OFTEN, Watch};
use crate::eight::LANES;
use crate::error::Error;

/// Primitives, by number, and the cells to which each belongs. Lists hold the numbers.
///
/// The passes take a trait object, so that their code is compiled once for all that is spread. They call `place` once
/// a batch, and `range` only for primitives that it did not place.
pub(crate) trait Spread {
    /// Cells per axis.
    fn resolution(&self) -> [u32; 3];

    /// How many numbers there are. Some primitives may have no cells.
    fn count(&self) -> u32;

    /// The cells of a primitive, if it has any. Every call answers the same.
    fn range(&self, number: u32) -> Option<CellRange>;

    /// Notes in a batch the cells of some primitives, no more than the batch holds: those that
    /// [`range`](Self::range) finds. It may leave out primitives, whose bits in `is_placed` stay 0.
    fn place(&self, numbers: Range<u32>, batch: &mut PlacedBatch);
}

/// The cells of a primitive: the row and the x of the first, and how many more there are on each axis.
#[derive(Debug, Clone, Copy)]
struct CellSpan {
    row: usize,
    x: u32,
    more: u32,
}

/// Bits of `more` for each axis: x in the lowest, then y, then z.
pub(super) const MORE_BITS: u32 = 10;
/// The most additional cells on an axis.
pub(super) const MOST_MORE: u32 = (1 << MORE_BITS) - 1;

/// One more cell on an axis, or on some.
const X: u32 = 1;
const Y: u32 = 1 << MORE_BITS;
const Z: u32 = 1 << (2 * MORE_BITS);
const XY: u32 = X | Y;
const XZ: u32 = X | Z;
const YZ: u32 = Y | Z;
const XYZ: u32 = X | Y | Z;

impl CellSpan {
    /// More cells on each axis.
    const fn more(self) -> [u32; 3] {
        [self.more & MOST_MORE, self.more >> MORE_BITS & MOST_MORE, self.more >> (2 * MORE_BITS)]
    }

    /// The number of cells.
    fn count(self) -> u64 {
        let [x, y, z] = self.more().map(|more| u64::from(more) + 1);
        x * y * z
    }
}

/// The cells of primitives side by side, in eights.
pub(crate) struct PlacedBatch {
    pub(super) rows: [[u32; LANES]; Self::EIGHTS],
    pub(super) xs: [[u32; LANES]; Self::EIGHTS],
    pub(super) more: [[u32; LANES]; Self::EIGHTS],
    /// A bit for each primitive that is placed. The cells of other primitives are not known here.
    pub(super) is_placed: u64,
}

/// Progress is reported only at the first primitive of a batch.
const _: () = assert!(OFTEN.is_multiple_of(PlacedBatch::SIZE));

impl PlacedBatch {
    /// Primitives of a batch: as many as `is_placed` has bits.
    const SIZE: u32 = u64::BITS;
    const EIGHTS: usize = Self::SIZE as usize / LANES;

    /// None is placed.
    pub(super) fn empty() -> Self {
        Self {
            rows: Default::default(),
            xs: Default::default(),
            more: Default::default(),
            is_placed: 0,
        }
    }

    /// Places all batches of primitives, from the first or from the last on, until `visit` returns false; returns
    /// false then.
    #[inline(always)]
    pub(super) fn each<const REVERSE: bool>(
        spread: &dyn Spread,
        watch: &Watch<'_>,
        share: [f32; 2],
        mut visit: impl FnMut(&Self, Range<u32>) -> bool,
    ) -> Result<bool, Error> {
        let mut batch = Self::empty();
        let count = spread.count();
        for done in (0..count).step_by(Self::SIZE as usize) {
            watch.step(done, count, share)?;
            let first = if REVERSE { (count - 1 - done) / Self::SIZE * Self::SIZE } else { done };
            let numbers = first..count.min(first.saturating_add(Self::SIZE));
            spread.place(numbers.clone(), &mut batch);
            if !visit(&batch, numbers) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The number of cells that primitives are in.
    #[inline(always)]
    pub(super) fn references(&self, spread: &dyn Spread, numbers: Range<u32>) -> u64 {
        let cells = |(lane, number)| match self.get(lane) {
            Some(placed) => placed.count(),
            None => spread.range(number).map_or(0, |range| range.count()),
        };
        numbers.enumerate().map(cells).sum()
    }

    /// Shows `visit` the rows of cells that primitives are in: the number of the primitive, the row,
    /// its first cell there and the number of cells.
    #[inline(always)]
    pub(super) fn each_row<const REVERSE: bool>(
        &self,
        spread: &dyn Spread,
        numbers: Range<u32>,
        mut visit: impl FnMut(u32, usize, u32, u32),
    ) {
        let [_, height, _] = spread.resolution();
        let (first, count) = (numbers.start, numbers.end - numbers.start);
        for at in 0..count {
            let lane = if REVERSE { count - 1 - at } else { at };
            let number = first + lane;
            let Some(placed) = self.get(lane as usize) else {
                let Some(CellRange { min, max }) = spread.range(number) else { continue };
                for z in min[2]..=max[2] {
                    for y in min[1]..=max[1] {
                        visit(number, row(height, y, z), min[0], max[0] - min[0] + 1);
                    }
                }
                continue;
            };
            let (row, x, height) = (placed.row, placed.x, height as usize);
            let mut show = |behind: &[usize], length: u32| {
                for behind in behind {
                    visit(number, row + behind, x, length);
                }
            };
            // Common shapes need no loops.
            match placed.more {
                0 => show(&[0], 1),
                X => show(&[0], 2),
                Y => show(&[0, 1], 1),
                Z => show(&[0, height], 1),
                XY => show(&[0, 1], 2),
                XZ => show(&[0, height], 2),
                YZ => show(&[0, 1, height, height + 1], 1),
                XYZ => show(&[0, 1, height, height + 1], 2),
                _ => {
                    let [wide, high, deep] = placed.more();
                    for z in 0..=deep as usize {
                        for y in 0..=high as usize {
                            show(&[z * height + y], wide + 1);
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> Option<CellSpan> {
        let row = *self.rows.as_flattened().get(lane)? as usize;
        let x = *self.xs.as_flattened().get(lane)?;
        let more = *self.more.as_flattened().get(lane)?;
        (self.is_placed >> lane & 1 == 1).then_some(CellSpan { row, x, more })
    }

    /// Places one primitive after the other.
    #[inline(always)]
    pub(crate) fn place_each(&mut self, spread: &impl Spread, numbers: Range<u32>) {
        let [_, height, _] = spread.resolution();
        self.is_placed = 0;
        let xs_and_more = self.xs.as_flattened_mut().iter_mut().zip(self.more.as_flattened_mut());
        let slots = self.rows.as_flattened_mut().iter_mut().zip(xs_and_more);
        for ((lane, number), (row, (x, more))) in numbers.enumerate().zip(slots) {
            let Some(CellRange { min, max }) = spread.range(number) else { continue };
            let [wide, high, deep] = core::array::from_fn(|axis| max[axis] - min[axis]);
            (*row, *x) = (min[2] * height + min[1], min[0]);
            *more = wide | high << MORE_BITS | deep << (2 * MORE_BITS);
            self.is_placed |= u64::from((wide | high | deep) <= MOST_MORE) << lane;
        }
    }
}
