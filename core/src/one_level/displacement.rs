//! Row displacement compression (Tarjan and Yao 1979, as used by Lagae and Dutré 2008).
//!
//! All rows of cells are slid over each other into one table so that no two non-empty cells share
//! a slot. The slot of a cell is then `row_offsets[row] + x`: one addition, no search.
//!
//! ```text
//! row 0   x . x x . .                offset 0
//! row 1     . x . . x .              offset 0      x of row 1 fall into holes of row 0
//! row 2           . x x . . x        offset 3
//! table   x x x x x ...
//! ```
//!
//! Plain first fit tries every slot from the first free one: quadratic, minutes where the rest of a
//! build takes a second. Two changes make it linear: 64 offsets are tried at once
//! with one word per set cell, and the search starts at most [`WINDOW_SLOTS`] before the end of the
//! table. Rows keep their natural order: sorting them by length gains about 1 % of the table.

use crate::bits::{WORD_BITS, each_one, extent, load};

/// How far back from the end of the table a row looks for holes.
///
/// More finds more holes and takes longer; lab/results/displacement.md has the sweep.
const WINDOW_SLOTS: usize = 2048;

/// Finds an offset for every row and returns the number of slots, or `None` beyond `i32::MAX`.
///
/// `domain_bits` holds the rows, `width` bits each; `occupied` must have one zero bit for every cell
/// and a word more, and is left with the slots in use.
pub(crate) fn displace(
    domain_bits: &[u64],
    width: usize,
    row_offsets: &mut [i32],
    occupied: &mut [u64],
) -> Option<u32> {
    let mut slots = 0_usize;
    let mut first_free_word = 0;
    for (row, offset) in row_offsets.iter_mut().enumerate() {
        let row = Row { domain_bits, start: row * width, width };
        let Some((first, last)) = extent(domain_bits, row.start, width) else {
            *offset = 0;
            continue;
        };

        // Take the first hole in the window that the row fits into; behind the table it always does.
        let window = slots.saturating_sub(WINDOW_SLOTS) / WORD_BITS;
        let mut word = window.max(first_free_word);
        let slot = loop {
            if let Some(bit) = row.fit(first, occupied, word) {
                break word * WORD_BITS + bit;
            }
            word += 1;
        };
        *offset = i32::try_from(slot).ok()?.checked_sub_unsigned(u32::try_from(first).ok()?)?;

        // Put the row there.
        row.each_one(|x| {
            let bit = slot + x - first;
            if let Some(word) = occupied.get_mut(bit / WORD_BITS) {
                *word |= 1 << (bit % WORD_BITS);
            }
            true
        });
        slots = slots.max(slot + last - first + 1);
        while occupied.get(first_free_word) == Some(&u64::MAX) {
            first_free_word += 1;
        }
    }
    i32::try_from(slots).ok()?.try_into().ok()
}

/// A row of cells among the domain bits.
#[derive(Clone, Copy)]
struct Row<'a> {
    domain_bits: &'a [u64],
    start: usize,
    width: usize,
}

impl Row<'_> {
    #[inline(always)]
    fn each_one(self, visit: impl FnMut(usize) -> bool) {
        each_one(self.domain_bits, self.start, self.width, visit);
    }

    /// The first of the 64 slots of a word at which the row fits when its bit `first` is put there.
    #[inline]
    fn fit(self, first: usize, occupied: &[u64], word: usize) -> Option<usize> {
        let mut taken = 0;
        self.each_one(|x| {
            taken |= load(occupied, word * WORD_BITS + x - first);
            taken != u64::MAX
        });
        (taken != u64::MAX).then(|| taken.trailing_ones() as usize)
    }
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
            let mut occupied = vec![0; domain_bits.len() + 1];
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
    fn empty_rows_take_no_slot() {
        let mut offsets = [7; 3];
        assert_eq!(displace(&[0; 3], 64, &mut offsets, &mut [0; 4]), Some(0));
        assert_eq!(offsets, [0; 3]);
    }
}
