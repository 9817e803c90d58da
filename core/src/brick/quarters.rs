//! In which quarters of its cell a triangle lies.
//!
//! A cell lists some eighteen triangles, and a ray that crosses it passes most of them at a
//! distance. The ids of a mesh of up to 2^20 triangles leave twelve bits of a word free: six
//! numbers. Three of them say on each axis how many quarters of the cell lie before the triangle's
//! box, three how many lie behind it. A ray is not tested against a triangle that begins behind it
//! or ends before it, and does not even load its corners.
//!
//! ```text
//! reference | upper bits: behind z y x, before z y x | lower bits: the same | id: 20 bits |
//! ```
//!
//! The longer ids of a larger mesh take these bits one after the other, from the right. A number
//! whose lower bit is taken counts halves, one without any bit nothing: the box seems larger than
//! it is. None is left beyond 2^31 triangles.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u32x8};

use crate::bits::halves;
use crate::eight::LANES;

/// Bits of an id beside all numbers.
const ID_BITS: u32 = 20;
/// Numbers in a word; their upper bits are the first ones.
const NUMBERS: u32 = 6;
/// How far the last quarter on an axis is shifted where it stands above the first.
pub(super) const LAST: u32 = 12;
/// The bits of both numbers of the first axis while they are put together: what lies before it in
/// the lower half, what lies behind it in the upper one.
const AXIS: u32 = (1 | 1 << NUMBERS) | (1 | 1 << NUMBERS) << LAST;
/// Those of what lies behind.
const BEHIND: u32 = numbers(0, 7);

/// The numbers of the first axis, for the quarter in which something begins and, four times as far
/// from one to the next, the one in which it ends.
const AXES: [u32; 16] = {
    let (mut axes, mut at) = ([0; 16], 0_u32);
    while at < 16 {
        let (before, behind) = (at & 3, 3 - (at >> 2));
        let (lower, upper) = (before & 1 | (behind & 1) << 3, before >> 1 | behind >> 1 << 3);
        axes[at as usize] = lower | upper << NUMBERS;
        at += 1;
    }
    axes
};

/// Bits without which so many ids are not different.
#[inline(always)]
const fn id_bits(triangles: u32) -> u32 {
    u32::BITS - triangles.saturating_sub(1).leading_zeros()
}

const _: () = assert!(id_bits(1 << 20) == 20 && id_bits((1 << 20) + 1) == 21);
const _: () = assert!(id_bits(1 << 31) == 31 && id_bits((1 << 31) + 1) == 32);

/// How words are read that have an id and perhaps numbers of quarters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Format {
    /// The bits of an id.
    ids: u32,
}

/// How many quarters of a cell lie before something on each axis, and how many behind it; the place
/// of these numbers in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Quarters(u32);

impl Quarters {
    /// Of what begins and ends in these quarters on each axis, counted from anywhere: of its first
    /// cell and its last.
    #[inline(always)]
    pub(super) fn new(first: [u32; 3], last: [u32; 3]) -> Self {
        let [x, y, z] = [0, 1, 2].map(
            #[inline(always)]
            |axis: usize| AXES[(first[axis] & 3 | (last[axis] & 3) << 2) as usize],
        );
        Self((x | y << 1 | z << 2) << ID_BITS)
    }

    /// Of what is in the cell before this one on some axes, too, and
    /// in the one behind it on others.
    #[inline(always)]
    pub(super) const fn through(self, before: u32, behind: u32) -> Self {
        Self(self.0 & !numbers(before, behind))
    }
}

/// The bits of numbers of what lies before, on some axes, and of what lies behind, on others.
#[inline(always)]
const fn numbers(before: u32, behind: u32) -> u32 {
    let numbers = before & 7 | (behind & 7) << 3;
    (numbers | numbers << NUMBERS) << ID_BITS
}

/// Of eight triangles the bits of words that are not ids. On each axis the first quarter is in the
/// lowest bits, the last one [`LAST`] bits above it, and up to four other bits above either.
#[inline(always)]
pub(super) fn quarters<S: Simd>(format: Format, [x, y, z]: [u32x8<S>; 3]) -> u32x8<S> {
    let x = (x | (x << (NUMBERS - 1))) & AXIS;
    let y = (y | (y << (NUMBERS - 1))) & AXIS;
    let z = (z | (z << (NUMBERS - 1))) & AXIS;
    let bits = x | (y << 1) | (z << 2);
    (((bits | (bits >> (LAST - 3))) << ID_BITS) ^ BEHIND) & format.quarters()
}

/// Which triangles something in a cell does not meet: those with a number above its limit, which is
/// how many quarters end before it does, or begin behind where it does.
///
/// The numbers whose limits have no upper bit, and above them those whose limits have no lower one;
/// both at the place of upper bits. In one word, so that it stays in a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Missed(u64);

impl Missed {
    /// Nothing is missed.
    pub(super) const NONE: Self = Self(0);

    #[inline(always)]
    const fn new(no_upper: u32, no_lower: u32) -> Self {
        Self(no_upper as u64 | (no_lower as u64) << u32::BITS)
    }

    /// Whether the triangle of a word is.
    #[inline(always)]
    pub(super) const fn contains(self, word: u32) -> bool {
        let [no_upper, no_lower] = halves(self.0);
        // More in the upper bit, or as much there and more in the lower.
        word & no_upper | (word | no_upper) & word << NUMBERS & no_lower != 0
    }

    /// Which of the triangles of eight words are not.
    #[inline(always)]
    pub(super) fn others<S: Simd>(self, simd: S, words: [u32; LANES]) -> u64 {
        let [no_upper, no_lower] = halves(self.0);
        let word = u32x8::simd_from(simd, words);
        let more = (word & no_upper) | ((word | no_upper) & (word << NUMBERS) & no_lower);
        more.simd_eq(u32x8::splat(simd, 0)).to_bitmask()
    }
}

impl Format {
    /// That of a mesh with so many triangles.
    #[inline(always)]
    pub(super) const fn of(triangles: u32) -> Self {
        /// Ids are this much longer than they need be: the unit tests of this crate have few
        /// triangles, and see many formats, from 256 triangles on.
        const MORE_BITS: u32 = if cfg!(test) { 12 } else { 0 };
        let bits = id_bits(triangles) + MORE_BITS;
        let bits = if bits < ID_BITS { ID_BITS } else { bits };
        Self { ids: if bits < u32::BITS { (1 << bits) - 1 } else { u32::MAX } }
    }

    /// The bits of a word that are the id.
    pub(super) const fn ids(self) -> u32 {
        self.ids
    }

    /// The bits of a word that are not.
    #[inline(always)]
    pub(super) const fn quarters(self) -> u32 {
        !self.ids
    }

    /// The word for a triangle.
    #[inline(always)]
    pub(super) const fn word(self, id: u32, quarters: Quarters) -> u32 {
        id | quarters.0 & self.quarters()
    }

    /// The id of a word.
    #[inline(always)]
    pub(super) const fn id(self, word: u32) -> u32 {
        word & self.ids
    }

    /// The word with what [`Quarters::through`] leaves.
    #[inline(always)]
    pub(super) const fn through(self, word: u32, before: u32, behind: u32) -> u32 {
        word & !(numbers(before, behind) & self.quarters())
    }

    /// What a line misses that reaches so far ([`Line::quarters`](crate::dda::Line::quarters)):
    /// `below[i]` are the numbers whose limit is less than `i + 1`.
    #[inline(always)]
    pub(super) const fn missed(self, below: [u32; 3]) -> Missed {
        let [one, two, three] = below;
        let upper = two << (ID_BITS + NUMBERS);
        let lower = (one | three & !two) << (ID_BITS + NUMBERS);
        Missed::new(upper & self.quarters(), lower & self.quarters() << NUMBERS)
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::Fallback;

    use super::*;

    /// The quarters from the first to the last of all, on one axis.
    const SPANS: [[u32; 2]; 10] =
        [[0, 0], [0, 1], [0, 2], [0, 3], [1, 1], [1, 2], [1, 3], [2, 2], [2, 3], [3, 3]];

    /// What [`Format::missed`] is given for a line from a quarter to another on an axis.
    fn below([first, last]: [u32; 2], axis: usize) -> [u32; 3] {
        [0, 1, 2].map(|at| u32::from(last <= at) << axis | u32::from(first >= 3 - at) << axis << 3)
    }

    /// Both ends of all axes: `span` on one, everything on the others.
    fn on(axis: usize, [first, last]: [u32; 2]) -> Quarters {
        let (mut low, mut high) = ([0; 3], [3; 3]);
        (low[axis], high[axis]) = (first, last);
        Quarters::new(low, high)
    }

    fn misses(missed: Missed, word: u32) -> bool {
        let others = missed.others(Fallback::new(), [0, word, 0, 0, 0, 0, 0, word]);
        assert!(matches!(others & 0b1000_0010, 0 | 0b1000_0010));
        assert_eq!(others & 2 == 0, missed.contains(word));
        missed.contains(word)
    }

    #[test]
    fn a_line_misses_what_it_has_no_quarter_in_common_with() {
        let format = Format::of(1);
        for (axis, other) in [(0, 1), (1, 2), (2, 0)] {
            for triangle in SPANS {
                let word = format.word(5, on(axis, triangle));
                assert_eq!(format.id(word), 5);
                for line in SPANS {
                    let apart = line[1] < triangle[0] || triangle[1] < line[0];
                    let missed = format.missed(below(line, axis));
                    assert_eq!(misses(missed, word), apart, "{triangle:?} {line:?}");
                    assert!(!misses(format.missed(below(line, other)), word));
                }
            }
        }
        assert_eq!(format.missed([0; 3]), Missed::NONE);
    }

    #[test]
    fn what_goes_on_is_in_all_quarters_on_that_side() {
        let format = Format::of(1);
        let quarters = |first, last| Quarters::new([first; 3], [last; 3]);
        assert_eq!(quarters(1, 2).through(7, 0), quarters(0, 2));
        assert_eq!(quarters(3, 3).through(0, 7), quarters(3, 3));
        assert_eq!(quarters(1, 2).through(0b001, 0b100), Quarters::new([0, 1, 1], [2, 2, 3]));
        let word = format.word(5, quarters(2, 2));
        assert_eq!(format.through(word, 2, 4), format.word(5, quarters(2, 2).through(2, 4)));
        // Quarters are counted from anywhere.
        assert_eq!(quarters(4 * 77 + 1, 4 * 78 + 2), quarters(1, 2));
    }

    #[test]
    fn eight_triangles_have_the_bits_of_each() {
        let simd = Fallback::new();
        for (round, triangles) in (0..).zip([1, 256, 1500, 6000, 20_000, 1 << 20]) {
            let format = Format::of(triangles);
            // Lane by lane and axis by axis other quarters, and other cells above them.
            let end = |lane: usize, axis: usize, side: usize| {
                let span = SPANS[(lane + 3 * axis + round) % SPANS.len()];
                span[side] | [0, 4, 36, 60, 8][(lane + axis + side) % 5]
            };
            let of = |axis| {
                let lanes = |lane| end(lane, axis, 0) | end(lane, axis, 1) << LAST;
                u32x8::simd_from(simd, core::array::from_fn::<_, LANES, _>(lanes))
            };
            let found: [u32; LANES] = quarters(format, [of(0), of(1), of(2)]).into();
            for (lane, found) in found.into_iter().enumerate() {
                let [first, last] = [0, 1].map(|side| [0, 1, 2].map(|axis| end(lane, axis, side)));
                assert_eq!(found, format.word(0, Quarters::new(first, last)));
            }
        }
    }

    #[test]
    fn longer_ids_take_bits_from_the_right() {
        let everything = Quarters::new([3; 3], [0; 3]);
        let mut triangles = 256_u32;
        for taken in 0..=12_usize {
            let format = Format::of(triangles);
            assert_eq!(
                format.quarters().count_ones() as usize,
                12 - taken,
                "{triangles} triangles"
            );
            assert_eq!(format.quarters().leading_ones() as usize, 12 - taken);
            assert_eq!(Format::of(triangles / 2 + 1).ids(), format.ids());

            // The longest id stays what it is beside all numbers.
            let id = format.ids();
            let word = format.word(id, everything);
            assert_eq!((format.id(word), format.through(word, 7, 7)), (id, id));

            // No line misses what it meets. It misses what is in the other half while there is the
            // upper bit of a number that tells, all others while there is the lower bit, too.
            for axis in 0..3 {
                for triangle in SPANS {
                    let word = format.word(id, on(axis, triangle));
                    for line in SPANS {
                        let missed = misses(format.missed(below(line, axis)), word);
                        let (behind, before) = (line[1] < triangle[0], triangle[1] < line[0]);
                        let halves = (line[1] < 2 && triangle[0] >= 2 && taken < 7 + axis)
                            || (triangle[1] < 2 && line[0] >= 2 && taken < 10 + axis);
                        let quarters = (behind && taken < 1 + axis) || (before && taken < 4 + axis);
                        assert_eq!(missed, halves || quarters, "{taken} {triangle:?} {line:?}");
                    }
                }
            }
            triangles *= 2;
        }
        assert_eq!(Format::of(u32::MAX - 1).ids(), u32::MAX);
    }
}
