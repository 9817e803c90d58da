//! In which halves of its cell a triangle lies.
//!
//! A cell lists some eighteen triangles, and a ray that crosses it passes most of them at a
//! distance. The ids of a mesh of up to 2^26 triangles leave six bits of a word free. They say on
//! which axes the triangle's box is in one half of the cell only. A ray that crosses only the other
//! half there is not tested against the triangle, and does not even load its corners.
//!
//! ```text
//! reference | in the lower half: z y x | in the upper half: z y x | id: 26 bits |
//! ray       | in the upper half: z y x | in the lower half: z y x |                  a common bit: they do not meet
//! ```
//!
//! Each bit is of use without the others. The longer ids of a larger mesh take them one after the
//! other, from the right, and leave none beyond 2^31 triangles.

/// Bits of an id beside all halves.
pub(super) const ID_BITS: u32 = 26;

/// Bits without which so many ids are not different.
#[inline(always)]
const fn id_bits(triangles: u32) -> u32 {
    u32::BITS - triangles.saturating_sub(1).leading_zeros()
}

const _: () = assert!(id_bits(1 << 26) == 26 && id_bits((1 << 26) + 1) == 27);
const _: () = assert!(id_bits(1 << 31) == 31 && id_bits((1 << 31) + 1) == 32);

/// How words are read that have an id and perhaps halves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Format {
    /// The bits of an id.
    ids: u32,
}

/// The axes, a bit for each, on which something is in the upper half of a cell only, and those on
/// which it is in the lower half only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Halves(u32);

impl Halves {
    /// From axes in the upper half and axes in the lower half.
    #[inline(always)]
    pub(super) const fn new(upper: u32, lower: u32) -> Self {
        Self(upper & 7 | (lower & 7) << 3)
    }

    /// Of what is in the cell before this one on some axes, too, and
    /// in the one behind it on others.
    #[inline(always)]
    pub(super) const fn through(self, before: u32, behind: u32) -> Self {
        Self(self.0 & !Self::new(before, behind).0)
    }
}

impl Format {
    /// That of a mesh with so many triangles.
    #[inline(always)]
    pub(super) const fn of(triangles: u32) -> Self {
        /// Ids are this much longer than they need be: the unit tests of this crate have few
        /// triangles, and see all formats, from 2048 triangles on.
        const MORE_BITS: u32 = if cfg!(test) { 15 } else { 0 };
        let bits = id_bits(triangles) + MORE_BITS;
        let bits = if bits < ID_BITS { ID_BITS } else { bits };
        Self { ids: if bits < u32::BITS { (1 << bits) - 1 } else { u32::MAX } }
    }

    /// The bits of a word that are the id.
    pub(super) const fn ids(self) -> u32 {
        self.ids
    }

    /// The bits of a word that are halves.
    #[inline(always)]
    pub(super) const fn halves(self) -> u32 {
        !self.ids
    }

    /// The word for a triangle.
    #[inline(always)]
    pub(super) const fn word(self, id: u32, halves: Halves) -> u32 {
        id | halves.0 << ID_BITS & self.halves()
    }

    /// The id of a word.
    #[inline(always)]
    pub(super) const fn id(self, word: u32) -> u32 {
        word & self.ids
    }

    /// The word with what [`Halves::through`] leaves.
    #[inline(always)]
    pub(super) const fn through(self, word: u32, before: u32, behind: u32) -> u32 {
        word & !(Halves::new(before, behind).0 << ID_BITS & self.halves())
    }

    /// The bits of words of triangles that something in these halves does not meet.
    #[inline(always)]
    pub(super) const fn missed(self, Halves(halves): Halves) -> u32 {
        (halves >> 3 | halves << 3) << ID_BITS & self.halves()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVERYWHERE: Halves = Halves::new(0, 0);

    #[test]
    fn a_ray_in_the_other_half_of_any_axis_misses() {
        let format = Format::of(1);
        let word = format.word(5, Halves::new(0b001, 0b100));
        assert_eq!(format.id(word), 5);
        let meets = |upper, lower| word & format.missed(Halves::new(upper, lower)) == 0;
        assert!(meets(0, 0) && meets(0b011, 0b100) && meets(0b010, 0b100));
        assert!(!meets(0, 0b001) && !meets(0b100, 0) && !meets(0b111, 0));
    }

    #[test]
    fn what_goes_on_is_in_both_halves() {
        let format = Format::of(1);
        let halves = Halves::new(0b001, 0b100);
        assert_eq!(halves.through(0b001, 0b100), EVERYWHERE);
        assert_eq!(halves.through(0b100, 0b001), halves);
        let word = format.word(5, halves);
        assert_eq!(format.through(word, 0b001, 0), format.word(5, halves.through(0b001, 0)));
    }

    #[test]
    fn longer_ids_take_bits_from_the_right() {
        let everything = Halves::new(7, 7);
        let mut triangles = 2048_u32;
        for taken in 0..=6 {
            let format = Format::of(triangles);
            assert_eq!(format.halves().count_ones(), 6 - taken, "{triangles} triangles");
            assert_eq!(format.halves().leading_ones(), 6 - taken);
            assert_eq!(Format::of(triangles / 2 + 1).ids(), format.ids());

            // The longest id stays what it is beside all halves, and those of which there is no
            // word left miss nothing.
            let id = format.ids();
            let word = format.word(id, everything);
            assert_eq!((format.id(word), format.through(word, 7, 7)), (id, id));
            for bit in 0..6 {
                let ray = Halves::new((1 << bit) >> 3, (1 << bit) & 7);
                assert_eq!(word & format.missed(ray) != 0, bit >= taken, "{taken}, {bit}");
            }
            triangles *= 2;
        }
        assert_eq!(Format::of(u32::MAX - 1).ids(), u32::MAX);
    }
}
