//! Bit sets in rows of 64-bit words.

use crate::invariant::OrBug;

/// Bits in a word.
pub(crate) const WORD_BITS: usize = 64;

/// Sets `bit` and the `more` bits behind it, which lie inside `words`.
#[inline(always)]
pub(crate) fn set_range(words: &mut [u64], bit: usize, more: usize) {
    let (mut word, mut shift, mut left) = (bit / WORD_BITS, bit % WORD_BITS, more);
    // Nearly every range ends in the word it starts in: this loop runs once.
    loop {
        let room = WORD_BITS - 1 - shift;
        let mask = (u64::MAX >> (WORD_BITS - 1 - left.min(room))) << shift;
        let Some(bits) = words.get_mut(word).or_bug("a range of bits past the end") else { return };
        *bits |= mask;
        if left <= room {
            return;
        }
        (word, shift, left) = (word + 1, 0, left - room - 1);
    }
}

/// A word as two, the lower bits first.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "that is how to take the lower half")]
pub(crate) const fn halves(word: u64) -> [u32; 2] {
    [word as u32, (word >> 32) as u32]
}

/// Returns true if a bit is set; a bit past the end is not.
#[inline(always)]
pub(crate) fn is_set(words: &[u64], bit: usize) -> bool {
    words.get(bit / WORD_BITS).is_some_and(|word| word >> (bit % WORD_BITS) & 1 != 0)
}

/// The 64 bits from `bit` on; bits past the end are zero.
#[inline(always)]
pub(crate) fn load(words: &[u64], bit: usize) -> u64 {
    let (word, shift) = (bit / WORD_BITS, bit % WORD_BITS);
    let low = words.get(word).copied().unwrap_or(0) >> shift;
    let high = words.get(word + 1).copied().unwrap_or(0);
    // Shift by 63 and then by 1: a shift by 64 overflows.
    low | (high << (WORD_BITS - 1 - shift)) << 1
}

/// Calls `visit` with each set bit of the `count` bits from `bit` on, ascending and numbered from 0, until it returns
/// false.
#[inline(always)]
pub(crate) fn each_one(
    words: &[u64],
    bit: usize,
    count: usize,
    mut visit: impl FnMut(usize) -> bool,
) {
    for from in (0..count).step_by(WORD_BITS) {
        let mut rest = load(words, bit + from) & low_bits(count - from);
        while rest != 0 {
            if !visit(from + rest.trailing_zeros() as usize) {
                return;
            }
            rest &= rest - 1;
        }
    }
}

/// The first and the last set bit of the `count` bits from `bit` on, numbered from 0.
#[inline]
pub(crate) fn extent(words: &[u64], bit: usize, count: usize) -> Option<(usize, usize)> {
    let mut extent = None;
    for from in (0..count).step_by(WORD_BITS) {
        let rest = load(words, bit + from) & low_bits(count - from);
        if rest != 0 {
            let first = from + rest.trailing_zeros() as usize;
            let last = from + WORD_BITS - 1 - rest.leading_zeros() as usize;
            extent = Some((extent.map_or(first, |(first, _)| first), last));
        }
    }
    extent
}

/// The `count` lowest bits set; all of them from 64 on.
#[inline(always)]
pub(crate) const fn low_bits(count: usize) -> u64 {
    if count < WORD_BITS { (1 << count) - 1 } else { u64::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ones(words: &[u64], bit: usize, count: usize) -> alloc::vec::Vec<usize> {
        let mut found = alloc::vec::Vec::new();
        each_one(words, bit, count, |one| {
            found.push(one);
            true
        });
        let ends = found.first().copied().zip(found.last().copied());
        assert_eq!(extent(words, bit, count), ends);
        found
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn ranges_set_exactly_their_bits() {
        for from in 0..200 {
            for to in from..200 {
                let mut row = [0u64; 4];
                set_range(&mut row, from, to - from);
                assert!(ones(&row, 0, 256).into_iter().eq(from..=to), "{from}..={to}");
                assert!(
                    ones(&row, 3, 200).into_iter().eq((from..=to)
                        .filter_map(|one| one.checked_sub(3))
                        .filter(|&one| one < 200))
                );
                assert!((0..256).all(|bit| is_set(&row, bit) == (from..=to).contains(&bit)));
            }
        }
    }

    #[test]
    #[cfg(debug_assertions)]
    #[should_panic(expected = "a range of bits past the end")]
    fn a_range_past_the_end_is_a_bug() {
        set_range(&mut [0u64; 1], 62, 5);
    }

    #[test]
    #[cfg(not(debug_assertions))]
    fn what_is_past_the_end_is_dropped() {
        let mut row = [0u64; 1];
        set_range(&mut row, 62, 5);
        set_range(&mut row, 64, 0);
        assert_eq!(row, [3 << 62]);
    }

    #[test]
    fn load_reads_any_64_bits() {
        let words = [0x0123_4567_89ab_cdef, 0xfedc_ba98_7654_3210];
        for bit in 0..140 {
            let expected =
                (0..64).fold(0u64, |sum, i| sum | u64::from(is_set(&words, bit + i)) << i);
            assert_eq!(load(&words, bit), expected, "bit {bit}");
        }
    }
}
