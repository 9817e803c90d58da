//! Row displacement compression (Tarjan and Yao 1979, as used by Lagae and Dutré 2008).
//!
//! All rows of cells are slid over each other into one table so that no two non-empty cells share
//! a slot. The slot of a cell is then `row_offsets[row] + x`: one addition, no search.
//!
//! ```text
//! row 0   x . x x . .                offset 0
//! row 1   . x . . x .                offset 0      x of row 1 fall into holes of row 0
//! row 2           . x x . . x        offset 4
//! table   x x x x x x x . . x
//! ```
//!
//! Plain first fit tries every slot from the first free one: quadratic, minutes where the rest of a
//! build takes a second. It is linear because the search starts at most [`WINDOW_SLOTS`] and a word before the
//! end of the table, and fast because many offsets are tried at once: 64 for each word, 512 with
//! vectors. Rows keep their natural order: sorting them by length gains about 1 % of the table.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u64x8};

use crate::bits::{WORD_BITS, each_one, extent, load, low_bits};
use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};

/// Number of slots before the end of the table in which a row looks for holes.
///
/// More finds more holes and takes longer; core/DESIGN.md says how it was chosen.
const WINDOW_SLOTS: usize = 2048;

/// Finds an offset for every row and returns the number of slots, or `None` beyond `i32::MAX`.
///
/// `domain_bits` holds the rows, `width` bits each. `occupied` must have one bit for every cell and a word more, may
/// hold anything, and is left with the slots in use; bits behind the last slot mean nothing.
pub(crate) fn displace(
    domain_bits: &[u64],
    width: usize,
    row_offsets: &mut [i32],
    occupied: &mut [u64],
) -> Option<u32> {
    let has_vectors = HAS_VECTORS;
    let kernel = Displace { domain_bits, width, row_offsets, occupied, has_vectors };
    dispatch(SimdLevel::detect(), kernel)
}

struct Displace<'d> {
    domain_bits: &'d [u64],
    width: usize,
    row_offsets: &'d mut [i32],
    occupied: &'d mut [u64],
    /// True if eight words at once take less than one after the other.
    has_vectors: bool,
}

impl Kernel for Displace<'_> {
    type Output = Option<u32>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Self { domain_bits, width, row_offsets, occupied, has_vectors } = self;
        let mut slots = 0_usize;
        let (mut first_free_word, mut cleared) = (0, 0);
        for (row, offset) in row_offsets.iter_mut().enumerate() {
            let start = row * width;
            let Some((first, last)) = extent(domain_bits, start, width) else {
                *offset = 0;
                continue;
            };
            let row = CellRow { domain_bits, start: start + first, width: last - first + 1 };

            // Clear the words that a try at the end of the table reads: those of the row and a vector.
            let behind = slots / WORD_BITS + row.width.div_ceil(WORD_BITS) + WORDS;
            if cleared < behind {
                let end = occupied.len().min(behind + CLEARED_WORDS);
                // An empty range is legal: all words were cleared.
                occupied.get_mut(cleared..end).unwrap_or_default().fill(0);
                cleared = end.max(behind);
            }

            // Take the first hole in the window that the row fits into; behind the table it always does.
            let window = slots.saturating_sub(WINDOW_SLOTS) / WORD_BITS;
            let mut word = window.max(first_free_word);
            let slot = loop {
                let (fit, tried) = if has_vectors {
                    (row.fit_eight(simd, occupied, word), WORDS)
                } else {
                    (row.fit_one(occupied, word), 1)
                };
                if let Some(bit) = fit {
                    break word * WORD_BITS + bit;
                }
                word += tried;
            };
            *offset = i32::try_from(slot).ok()?.checked_sub_unsigned(u32::try_from(first).ok()?)?;

            // Put the row there.
            row.occupy(occupied, slot);
            slots = slots.max(slot + row.width);
            while occupied.get(first_free_word) == Some(&u64::MAX) {
                first_free_word += 1;
            }
        }
        i32::try_from(slots).ok()?.try_into().ok()
    }
}

/// Words that are cleared beyond those that are needed, so that it is seldom done: 512 bytes, an eighth of a page.
const CLEARED_WORDS: usize = 64;

/// Words in a vector.
const WORDS: usize = 8;

/// A row of cells among the domain bits, from the first full cell to the last.
#[derive(Clone, Copy)]
struct CellRow<'a> {
    domain_bits: &'a [u64],
    start: usize,
    width: usize,
}

impl CellRow<'_> {
    /// The first slot of a word at which the row fits, counted from the word on.
    #[inline(always)]
    fn fit_one(self, occupied: &[u64], word: usize) -> Option<usize> {
        let mut taken = 0;
        each_one(self.domain_bits, self.start, self.width, |x| {
            taken |= load(occupied, word * WORD_BITS + x);
            taken != u64::MAX
        });
        (taken != u64::MAX).then(|| taken.trailing_ones() as usize)
    }

    /// [`fit_one`](Self::fit_one) for eight words.
    #[inline(always)]
    fn fit_eight<S: Simd>(self, simd: S, occupied: &[u64], word: usize) -> Option<usize> {
        let full = u64x8::splat(simd, u64::MAX);
        let mut taken = u64x8::splat(simd, 0);
        for (at, from) in (0..self.width).step_by(WORD_BITS).enumerate() {
            let low = eight(simd, occupied, word + at);
            let high = eight(simd, occupied, word + at + 1);
            let mut rest = self.word(from);
            while rest != 0 {
                let bit = rest.trailing_zeros();
                rest &= rest - 1;
                // Shift by 63 and then by 1: a shift by 64 overflows.
                taken |= (low >> bit) | ((high << (63 - bit)) << 1);
                if taken.simd_eq(full).all_true() {
                    return None;
                }
            }
        }
        let taken: [u64; WORDS] = taken.into();
        let at = taken.iter().position(|&taken| taken != u64::MAX)?;
        Some(at * WORD_BITS + taken.get(at)?.trailing_ones() as usize)
    }

    /// Marks the slots that the row takes with its first cell at `slot`.
    #[inline(always)]
    fn occupy(self, occupied: &mut [u64], slot: usize) {
        for from in (0..self.width).step_by(WORD_BITS) {
            let ([low, high], at) = (bits_at(self.word(from), slot), (slot + from) / WORD_BITS);
            for (at, bits) in [(at, low), (at + 1, high)] {
                debug_assert!(bits == 0 || at < occupied.len(), "a row past the end of the table");
                if let Some(word) = occupied.get_mut(at) {
                    *word |= bits;
                }
            }
        }
    }

    /// 64 of its bits.
    #[inline(always)]
    fn word(self, from: usize) -> u64 {
        load(self.domain_bits, self.start + from) & low_bits(self.width - from)
    }
}

/// Bits moved up to a place in their word, and those that end up in the next one.
#[inline(always)]
const fn bits_at(bits: u64, place: usize) -> [u64; 2] {
    let shift = place % WORD_BITS;
    [bits << shift, bits >> 1 >> (WORD_BITS - 1 - shift)]
}

/// Eight words; zeros behind the end.
#[inline(always)]
fn eight<S: Simd>(simd: S, words: &[u64], at: usize) -> u64x8<S> {
    let eight = words.get(at..at.saturating_add(WORDS)).and_then(<[u64]>::first_chunk);
    u64x8::simd_from(simd, eight.copied().unwrap_or_else(|| last_eight(words, at)))
}

#[cold]
fn last_eight(words: &[u64], at: usize) -> [u64; WORDS] {
    core::array::from_fn(|lane| words.get(at + lane).copied().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::bits::is_set;

    /// Rows with bits from a small generator, about one in `sparsity` set.
    fn rows(cells: usize, sparsity: u64) -> Vec<u64> {
        let mut state = 1_u64;
        let mut bit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            u64::from((state >> 33).is_multiple_of(sparsity))
        };
        let mut words = vec![0; cells.div_ceil(64)];
        (0..cells).for_each(|cell| words[cell / 64] |= bit() << (cell % 64));
        words
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn no_two_cells_share_a_slot() {
        for (count, width, sparsity) in [(1, 64, 2), (50, 33, 1), (300, 100, 9), (2000, 250, 50)] {
            let domain_bits = rows(count * width, sparsity);
            let mut offsets = vec![0; count];
            let mut occupied = vec![u64::MAX; domain_bits.len() + 1];
            let slots = displace(&domain_bits, width, &mut offsets, &mut occupied).unwrap();
            let mut owner = vec![None; slots as usize];
            for (row, &offset) in offsets.iter().enumerate() {
                for x in 0..width {
                    if is_set(&domain_bits, row * width + x) {
                        let slot = usize::try_from(offset + i32::try_from(x).unwrap()).unwrap();
                        assert_eq!(owner[slot].replace((row, x)), None);
                    }
                }
            }
            assert!(owner.last().is_none_or(Option::is_some), "the last slot is in use");
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn every_level_takes_the_first_hole() {
        // Tables of a few words, and of many.
        for (count, width, sparsity) in
            [(1, 64, 2), (50, 33, 1), (300, 7, 3), (200, 100, 9), (2000, 250, 50), (60, 3000, 40)]
        {
            let domain_bits = rows(count * width, sparsity);

            // The naive way: slot by slot from the start of the window on.
            let (mut taken, mut slots) = (vec![false; count * width + 600], 0_usize);
            let mut expected = vec![0; count];
            for (row, offset) in expected.iter_mut().enumerate() {
                let ones: Vec<_> =
                    (0..width).filter(|x| is_set(&domain_bits, row * width + x)).collect();
                let Some(&first) = ones.first() else { continue };
                let window = slots.saturating_sub(WINDOW_SLOTS) / 64 * 64;
                let fits = |slot: &usize| ones.iter().all(|x| !taken[slot + x - first]);
                let slot = (window..taken.len()).find(fits).unwrap();
                for x in &ones {
                    taken[slot + x - first] = true;
                }
                slots = slots.max(slot + ones[ones.len() - 1] - first + 1);
                *offset = i32::try_from(slot).unwrap() - i32::try_from(first).unwrap();
            }

            let check = |run: &dyn Fn(Displace<'_>) -> Option<u32>, has_vectors| {
                let mut row_offsets = vec![0; count];
                let mut occupied = vec![u64::MAX; domain_bits.len() + 1];
                let found = run(Displace {
                    domain_bits: &domain_bits,
                    width,
                    row_offsets: &mut row_offsets,
                    occupied: &mut occupied,
                    has_vectors,
                });
                assert_eq!(found, u32::try_from(slots).ok());
                assert_eq!(row_offsets, expected);
                for (slot, &is_taken) in taken.iter().enumerate().take(slots) {
                    assert_eq!(is_set(&occupied, slot), is_taken);
                }
            };
            for level in SimdLevel::available() {
                for has_vectors in [false, true] {
                    check(&|kernel| dispatch(level, kernel), has_vectors);
                }
            }
        }
    }

    #[test]
    fn empty_rows_take_no_slot() {
        let mut offsets = [7; 3];
        assert_eq!(displace(&[0; 3], 64, &mut offsets, &mut [7; 4]), Some(0));
        assert_eq!(offsets, [0; 3]);
    }
}
