//! Sorts the entries of a unit by their keys: a radix sort from the low bits up, stable, in the cache.
//!
//! ```text
//! up to 24 entries   insertion
//! more               an even number of passes, so that the entries end where they began; each pass:
//!                    count the entries of each digit, sum up the counts, move the entries
//! ```
//!
//! The caller tells how many low bits may differ within the unit; only these are sorted by.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u16x8};

use super::layout::{Entry, MOST_UNIT};
use crate::invariant::OrBug;
use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch, inline_unless_small};

/// Few entries are sorted by insertion.
const FEW: usize = 24;
/// Bits of a key that one pass sorts by.
const PASS_BITS: u32 = 9;
const COUNTS: usize = 1 << PASS_BITS;

const _: () = assert!(MOST_UNIT <= u16::MAX as usize, "a count has sixteen bits");

/// Sorts entries by the lowest `bits` bits of their keys; the others are the same in all. Equal keys
/// keep their order. There are no more than [`MOST_UNIT`] entries, and `spare` has room for as many.
#[inline(never)]
pub(crate) fn sort(level: SimdLevel, entries: &mut [Entry], spare: &mut [Entry], bits: u32) {
    if entries.len() <= FEW {
        insert(entries);
        return;
    }
    debug_assert!(spare.len() >= entries.len(), "too little room to sort");
    let Some(spare) = spare.get_mut(..entries.len()) else { return };
    // Two passes bring the entries back to where they were.
    let passes = bits.div_ceil(2 * PASS_BITS) * 2;
    let mut shift = 0;
    for _ in 0..passes / 2 {
        let width = bits.div_ceil(passes).min(PASS_BITS);
        pass(level, entries, spare, shift, width);
        pass(level, spare, entries, shift + width, width);
        shift += 2 * width;
    }
}

inline_unless_small! {
    /// Moves entries to another place, in the order of some bits of their keys.
    fn pass(level: SimdLevel, from: &[Entry], to: &mut [Entry], shift: u32, width: u32) {
        let mut heads = [0_u16; COUNTS];
        let mask = (1 << width) - 1;
        let digit = |entry: &Entry| (entry[0] >> shift & mask) as usize % COUNTS;
        // Count the entries of each digit.
        for entry in from {
            heads[digit(entry)] += 1;
        }
        // Sum up the counts: where each digit starts.
        dispatch(level, Sums { heads: &mut heads, digits: 1 << width });
        // Move the entries.
        for entry in from {
            let head = &mut heads[digit(entry)];
            if let Some(slot) = to.get_mut(*head as usize).or_bug("a digit has too many entries") {
                *slot = *entry;
            }
            *head = head.wrapping_add(1);
        }
    }
}

/// Replaces the counts of the first digits by places: each is the sum of the counts before it.
struct Sums<'a> {
    heads: &'a mut [u16; COUNTS],
    /// Number of digits.
    digits: usize,
}

impl Kernel for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { heads, digits } = self;
        if !HAS_VECTORS {
            let mut end = 0;
            for head in heads.iter_mut().take(digits) {
                end += core::mem::replace(head, end);
            }
            return;
        }
        let none = u16x8::splat(simd, 0);
        let mut end = none;
        for eight in heads.as_chunks_mut::<8>().0.iter_mut().take(digits.div_ceil(8)) {
            // Sum up within the vector: add the sums one, two and four lanes below.
            let counts = u16x8::simd_from(simd, *eight);
            let mut sums = counts + simd.slide_u16x8::<7>(none, counts);
            sums += simd.slide_u16x8::<6>(none, sums);
            sums += simd.slide_u16x8::<4>(none, sums);
            // Write the places, and move the end on.
            *eight = (end + (sums - counts)).into();
            end += u16x8::splat(simd, sums[7]);
        }
    }
}

/// Sorts a few entries by all bits of their keys.
fn insert(entries: &mut [Entry]) {
    for at in 1..entries.len() {
        let mut hole = at;
        while let Some([before, entry]) =
            hole.checked_sub(1).and_then(|b| entries.get_mut(b..=hole)?.first_chunk_mut::<2>())
        {
            if before[0] <= entry[0] {
                break;
            }
            core::mem::swap(before, entry);
            hole -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::random;

    #[test]
    fn entries_are_in_the_order_of_their_keys_and_then_as_they_were() {
        let mut state = 1_u32;
        for count in [0, 1, 2, 23, 24, 25, 100, u32::try_from(MOST_UNIT).unwrap()] {
            for bits in [1, 4, 12, 15, 18, 30] {
                let entries: Vec<Entry> = (0..count)
                    .map(|id| {
                        // Few different keys, so that many are equal; and the same bits above.
                        [
                            ((random::next(&mut state) >> 7) % (count / 2 + 1))
                                .wrapping_mul(0x0101_0101)
                                % (1 << bits),
                            id,
                        ]
                    })
                    .collect();
                let mut expected = entries.clone();
                expected.sort_by_key(|entry| entry[0]);
                let mut spare = entries.clone();
                for level in SimdLevel::available() {
                    let mut sorted = entries.clone();
                    sort(level, &mut sorted, &mut spare, bits);
                    assert_eq!(sorted, expected, "{count} {bits} {level:?}");
                }
            }
        }
    }
}
