//! Macrocell levels: bit arrays that overlay coarser and coarser grids (CP10 §3.2, Wald et al. 2006).
//!
//! ```text
//! level 0   the cells of the hashed grid, one domain bit each         303 x 213 x 135
//! level 1   one bit for factor^3 cells of level 0: any of them full?   51 x  36 x  23
//! level 2   one bit for factor^3 bits of level 1                        9 x   6 x   4
//! ```
//!
//! The levels end with the first that has at most [`FEW_CELLS`] cells, or with [`MAX_LEVELS`]. They follow each other
//! in one section, each starting at a new word; where one lies follows from the resolution and the factor.

use core::num::NonZeroU32;
use core::ops::Range;

use crate::bits::{WORD_BITS, extent, is_set, load, low_bits, set_range};
use crate::cell::CellRange;
use crate::invariant::OrBug;
use crate::limits::MAX_RESOLUTION;

/// A level of so few cells needs no coarser one above it.
const FEW_CELLS: u64 = 10_000;

/// The most levels: factor 6 needs at most 3. Small factors end with a level of more cells, but no
/// query has to set up a longer stack.
pub(super) const MAX_LEVELS: usize = 4;

/// One level: its resolution and where its words start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Level {
    pub(super) resolution: [u32; 3],
    start: u64,
}

impl Level {
    /// No level.
    const NONE: Self = Self { resolution: [0; 3], start: 0 };

    /// Number of cells.
    const fn cells(&self) -> u64 {
        let [x, y, z] = self.resolution;
        x as u64 * y as u64 * z as u64
    }

    /// Returns the place at which the next level's words start.
    const fn end(&self) -> u64 {
        self.start + self.cells().div_ceil(WORD_BITS as u64)
    }

    /// The bit of a cell among all words.
    #[inline(always)]
    fn bit(&self, [x, y, z]: [u32; 3]) -> usize {
        let [width, height, _] = self.resolution.map(|cells| cells as usize);
        (z as usize * height + y as usize) * width + x as usize + self.first_bit()
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the words are in memory")]
    const fn first_bit(&self) -> usize {
        self.start as usize * WORD_BITS
    }

    /// Returns true if any cell of a macrocell on the level above is full.
    fn any_in(&self, words: &[u64], [x, y, z]: [u32; 3], factor: u32) -> bool {
        let [width, height, depth] = self.resolution;
        let xs = span(x, factor, width);
        let row = |y, z| extent(words, self.bit([xs.start, y, z]), xs.len()).is_some();
        span(z, factor, depth).any(|z| span(y, factor, height).any(|y| row(y, z)))
    }
}

/// The cells below a macrocell on an axis that has so many.
fn span(macrocell: u32, factor: u32, end: u32) -> Range<u32> {
    macrocell * factor..(macrocell + 1).saturating_mul(factor).min(end)
}

/// The levels above a grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Levels {
    /// Level 1 first; level 0 is the grid itself.
    all: [Level; MAX_LEVELS],
    pub(super) count: usize,
    /// Words of all levels together.
    pub(super) words: u64,
    /// Cells of the level below in a macrocell, on each axis.
    pub(super) factor: NonZeroU32,
}

impl Levels {
    /// The levels above a grid with this resolution. A factor below 2 counts as 2.
    pub(super) const fn new(resolution: [u32; 3], factor: u32) -> Self {
        let nonzero = match NonZeroU32::new(factor) {
            Some(factor) if factor.get() > 1 => factor,
            _ => NonZeroU32::MIN.saturating_add(1),
        };
        let factor = nonzero.get();
        let mut levels =
            Self { all: [Level::NONE; MAX_LEVELS], count: 0, words: 0, factor: nonzero };
        let [mut x, mut y, mut z] = resolution;
        while levels.count < MAX_LEVELS {
            [x, y, z] = [x.div_ceil(factor), y.div_ceil(factor), z.div_ceil(factor)];
            let level = Level { resolution: [x, y, z], start: levels.words };
            levels.all[levels.count] = level;
            levels.count += 1;
            levels.words = level.end();
            if level.cells() <= FEW_CELLS {
                break;
            }
        }
        levels
    }

    /// Cells of the grid in a macrocell of a level, on each axis.
    #[inline(always)]
    pub(super) fn size(&self, level: usize) -> u32 {
        (0..level).fold(1, |size: u32, _| size.saturating_mul(self.factor.get()))
    }

    /// A level, 1 the finest.
    #[inline(always)]
    pub(super) fn level(&self, level: usize) -> Level {
        self.all.get(level.wrapping_sub(1)).copied().unwrap_or(Level::NONE)
    }

    /// Returns true if anything is in a macrocell.
    #[inline(always)]
    pub(super) fn is_full(&self, words: &[u64], level: usize, cell: [u32; 3]) -> bool {
        is_set(words, self.level(level).bit(cell))
    }

    /// Writes all levels, the finest from the domain bits of the grid, each other one from the
    /// level below it: the paper's bitmap scaling.
    pub(super) fn fill(&self, resolution: [u32; 3], domain_bits: &[u64], words: &mut [u64]) {
        words.fill(0);
        let mut below = Level { resolution, start: 0 };
        for (number, &level) in self.all.iter().enumerate().take(self.count) {
            let Some((lower, upper)) = usize::try_from(level.start)
                .ok()
                .and_then(|start| words.split_at_mut_checked(start))
                .or_bug("a level behind the words of all")
            else {
                return;
            };
            let from = if number == 0 { domain_bits } else { lower };
            scale_down(&below, from, &Level { start: 0, ..level }, upper, self.factor.get());
            below = level;
        }
    }

    /// The first word that [`fill`](Self::fill) would write otherwise; needs no memory.
    pub(super) fn first_wrong_word(
        &self,
        resolution: [u32; 3],
        domain_bits: &[u64],
        words: &[u64],
    ) -> Option<usize> {
        let mut below = (Level { resolution, start: 0 }, domain_bits);
        for number in 1..=self.count {
            let level = self.level(number);
            for cell in CellRange::all(level.resolution).cells() {
                let bit = level.bit(cell);
                if is_set(words, bit) != below.0.any_in(below.1, cell, self.factor.get()) {
                    return Some(bit / WORD_BITS);
                }
            }
            // No bit is set behind the last macrocell.
            let end = level.bit([0, 0, level.resolution[2]]);
            if extent(words, end, end.next_multiple_of(WORD_BITS) - end).is_some() {
                return Some(end / WORD_BITS);
            }
            below = (level, words);
        }
        None
    }
}

/// Sets the bit of every macrocell that has a bit set below it.
///
/// First the rows of cells in a row of macrocells are combined by OR, 64 cells at a time: a division for each full
/// cell takes longer.
fn scale_down(below: &Level, from: &[u64], above: &Level, to: &mut [u64], factor: u32) {
    let [width, height, depth] = below.resolution;
    let [columns, rows, layers] = above.resolution;
    for layer in 0..layers {
        for row in 0..rows {
            let mut any = [0; WIDEST];
            for z in span(layer, factor, depth) {
                for y in span(row, factor, height) {
                    or_row(&mut any, from, below.bit([0, y, z]), width as usize);
                }
            }
            for column in 0..columns {
                let cells = span(column, factor, width);
                if extent(&any, cells.start as usize, cells.len()).is_some() {
                    set_range(to, above.bit([column, row, layer]), 0);
                }
            }
        }
    }
}

/// Words of the longest row.
const WIDEST: usize = MAX_RESOLUTION as usize / WORD_BITS;

/// Combines a row of bits with others by OR.
fn or_row(any: &mut [u64; WIDEST], words: &[u64], bit: usize, width: usize) {
    debug_assert!(width <= WIDEST * WORD_BITS, "a row with too many cells");
    debug_assert!(bit + width <= words.len() * WORD_BITS, "a row behind the bits");
    for (word, from) in any.iter_mut().zip((0..width).step_by(WORD_BITS)) {
        *word |= load(words, bit + from) & low_bits(width - from);
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;

    #[test]
    fn levels_end_with_few_cells() {
        for resolution in [[1, 1, 1], [4, 4, 4], [5, 4, 4], [303, 213, 135], [4096, 4096, 4096]] {
            for factor in [2, 3, 6, 100] {
                let levels = Levels::new(resolution, factor);
                assert!(levels.count >= 1);
                let is_complete = levels.level(levels.count).cells() <= FEW_CELLS;
                assert!(
                    is_complete
                        || levels.count == MAX_LEVELS && factor <= 3
                        || resolution == [4096; 3]
                );
                let below = (1..levels.count).map(|number| levels.level(number).cells());
                assert!(below.into_iter().all(|cells| cells > FEW_CELLS));
            }
        }
    }

    /// The bits of some full cells, and whether a cell is full.
    fn full_cells(resolution: [u32; 3]) -> (Vec<u64>, impl Fn([u32; 3]) -> bool) {
        let full = |[x, y, z]: [u32; 3]| (x * 7 + y * 31 + z * 101).is_multiple_of(997);
        let grid = Level { resolution, start: 0 };
        let words = usize::try_from(grid.end()).unwrap();
        let mut bits = vec![0; words];
        for cell in cells(resolution) {
            bits[grid.bit(cell) / 64] |= u64::from(full(cell)) << (grid.bit(cell) % 64);
        }
        (bits, full)
    }

    fn cells([width, height, depth]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
        let row = move |y, z| (0..width).map(move |x| [x, y, z]);
        (0..depth).flat_map(move |z| (0..height).flat_map(move |y| row(y, z)))
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn a_macrocell_is_full_if_a_cell_below_it_is() {
        for resolution in [[131, 37, 50], [128, 40, 7], [4096, 9, 5], [5, 300, 64]] {
            let (domain_bits, full) = full_cells(resolution);
            for factor in [2, 3, 6, 64, 65, 5000] {
                let levels = Levels::new(resolution, factor);
                let mut words = vec![u64::MAX; usize::try_from(levels.words).unwrap()];
                levels.fill(resolution, &domain_bits, &mut words);
                for number in 1..=levels.count {
                    let size = factor.pow(u32::try_from(number).unwrap());
                    let level = levels.level(number);
                    let mut expected = vec![false; usize::try_from(level.cells()).unwrap()];
                    let at = |cell: [u32; 3]| Level { start: 0, ..level }.bit(cell);
                    for cell in cells(resolution).filter(|&cell| full(cell)) {
                        expected[at(cell.map(|at| at / size))] = true;
                    }
                    for cell in cells(level.resolution) {
                        let is_full = levels.is_full(&words, number, cell);
                        assert_eq!(is_full, expected[at(cell)], "{factor}: {number}, {cell:?}");
                    }
                }
                assert_eq!(levels.first_wrong_word(resolution, &domain_bits, &words), None);
            }
        }
        assert!(Levels::new([131, 37, 50], 2).count > 1);
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn every_wrong_bit_is_found() {
        let resolution = [131, 37, 50];
        let (domain_bits, _) = full_cells(resolution);
        let levels = Levels::new(resolution, 3);
        let mut words = vec![0; usize::try_from(levels.words).unwrap()];
        levels.fill(resolution, &domain_bits, &mut words);
        for word in 0..words.len() {
            for bit in 0..64 {
                words[word] ^= 1 << bit;
                assert_eq!(levels.first_wrong_word(resolution, &domain_bits, &words), Some(word));
                words[word] ^= 1 << bit;
            }
        }
    }
}
