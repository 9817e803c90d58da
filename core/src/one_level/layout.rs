//! The size of a one-level grid and the places of its sections: one struct knows both.
//!
//! ```text
//! index    | header | row_offsets | domain_bits | hash       | references | overlay |
//!            128 B    i32 a row     1 bit a cell  u32 a slot   u32 each     none, or what a
//!                                                                           structure above adds
//! scratch  | row_offsets | domain_bits | occupied  |
//!            i32 a row     1 bit a cell  1 bit a slot
//! ```
//!
//! A row is the cells of one (y, z), x ascending; the bits of the rows follow each other without a
//! gap. The scratch needs only the resolution, so it is known before the first cell is marked; the
//! index needs the two counts that the marking and the row displacement find.

use crate::arena::{section_bytes, split, split_mut};
use crate::bits::WORD_BITS;
use crate::blob::HEADER_BYTES;
use crate::cell::cube_root;
use crate::limits::MAX_RESOLUTION;
use crate::survey::reference_limit;

/// The counts from which all sizes follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Layout {
    /// Rows of cells.
    pub(crate) rows: u64,
    /// Cells, and the most slots that row displacement can use.
    pub(crate) cells: u64,
    /// Slots of the hash table.
    pub(crate) hash_count: u32,
    /// Primitive ids in all cells together.
    pub(crate) reference_count: u32,
    /// Words that a structure above this one keeps behind it.
    pub(crate) overlay_words: u64,
}

/// The sections of an index, behind its header.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sections<'a> {
    pub(crate) row_offsets: &'a [i32],
    pub(crate) domain_bits: &'a [u64],
    pub(crate) hash: &'a [u32],
    pub(crate) references: &'a [u32],
    pub(crate) overlay: &'a [u64],
}

impl Sections<'_> {
    #[cfg(feature = "alloc")]
    pub(crate) const NOTHING: Self =
        Self { row_offsets: &[], domain_bits: &[], hash: &[], references: &[], overlay: &[] };
}

/// The same sections while they are written.
#[derive(Debug)]
pub(crate) struct SectionsMut<'a> {
    pub(crate) header: &'a mut [u8; HEADER_BYTES],
    pub(crate) row_offsets: &'a mut [i32],
    pub(crate) domain_bits: &'a mut [u64],
    pub(crate) hash: &'a mut [u32],
    pub(crate) references: &'a mut [u32],
    pub(crate) overlay: &'a mut [u64],
}

/// The sections of the scratch region.
#[derive(Debug)]
pub(crate) struct Scratch<'a> {
    pub(crate) row_offsets: &'a mut [i32],
    pub(crate) domain_bits: &'a mut [u64],
    pub(crate) occupied: &'a mut [u64],
    /// The bytes behind them.
    pub(crate) rest: &'a mut [u8],
}

/// The most cells on an axis of a grid of so many triangles, up to rounding.
pub(crate) const fn longest(triangles: u32, density: f32) -> f64 {
    cube_root(density as f64 * triangles as f64).min(MAX_RESOLUTION as f64)
}

impl Layout {
    /// The layout of a grid with this resolution and these counts.
    pub(crate) const fn new(
        resolution: [u32; 3],
        hash_count: u32,
        reference_count: u32,
        overlay_words: u64,
    ) -> Self {
        let rows = resolution[1] as u64 * resolution[2] as u64;
        let cells = rows * resolution[0] as u64;
        Self { rows, cells, hash_count, reference_count, overlay_words }
    }

    /// A layout that is at least as large as that of any mesh with so many triangles.
    ///
    /// With `n = cbrt(density * triangles)` no axis has more than `n` cells, and the longest has
    /// them all; so there are at most `n^3` cells in `n^2` rows.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounded down")]
    pub(crate) const fn bound(triangles: u32, density: f32, overlay_words: u64) -> Self {
        let longest = longest(triangles, density);
        let cells = (longest * longest * longest) as u64 + 1;
        let rows = (longest * longest) as u64 + 1;
        Self {
            rows,
            cells,
            hash_count: if cells < u32::MAX as u64 { cells as u32 } else { u32::MAX },
            reference_count: reference_limit(triangles),
            overlay_words,
        }
    }

    /// The same layout with other references.
    pub(crate) const fn with_references(self, reference_count: u32) -> Self {
        Self { reference_count, ..self }
    }

    /// Bytes of the blob, and bytes that the build needs beside it.
    pub(crate) const fn bytes(&self) -> (u64, u64) {
        (self.index_bytes(), self.scratch_bytes())
    }

    /// Bytes of the blob, header included.
    pub(crate) const fn index_bytes(&self) -> u64 {
        HEADER_BYTES as u64
            + section_bytes::<i32>(self.rows)
            + section_bytes::<u64>(self.domain_words())
            + section_bytes::<u32>(self.hash_count as u64 + 1)
            + section_bytes::<u32>(self.reference_count as u64)
            + section_bytes::<u64>(self.overlay_words)
    }

    /// Bytes that the build needs beside the index.
    pub(crate) const fn scratch_bytes(&self) -> u64 {
        section_bytes::<i32>(self.rows)
            + section_bytes::<u64>(self.domain_words())
            + section_bytes::<u64>(self.occupied_words())
    }

    /// One bit a cell.
    const fn domain_words(&self) -> u64 {
        self.cells.div_ceil(WORD_BITS as u64)
    }

    /// One bit a slot, and a word so that a row may be tried at any bit of the last one.
    const fn occupied_words(&self) -> u64 {
        self.cells.div_ceil(WORD_BITS as u64) + 1
    }

    /// Returns true if the number of every cell's bit fits a word of this machine.
    fn is_addressable(&self) -> bool {
        usize::try_from(self.cells + 2 * WORD_BITS as u64).is_ok()
    }

    /// The sections of a blob.
    pub(crate) fn sections<'a>(&self, blob: &'a [u8]) -> Option<Sections<'a>> {
        self.is_addressable().then_some(())?;
        let (row_offsets, rest) = split(blob.get(HEADER_BYTES..)?, self.rows)?;
        let (domain_bits, rest) = split(rest, self.domain_words())?;
        let (hash, rest) = split(rest, u64::from(self.hash_count) + 1)?;
        let (references, rest) = split(rest, self.reference_count.into())?;
        let (overlay, _) = split(rest, self.overlay_words)?;
        Some(Sections { row_offsets, domain_bits, hash, references, overlay })
    }

    /// The sections of a blob for writing, their padding zeroed.
    pub(crate) fn sections_mut<'a>(&self, blob: &'a mut [u8]) -> Option<SectionsMut<'a>> {
        let (header, rest) = blob.split_first_chunk_mut()?;
        let (row_offsets, rest) = split_mut(rest, self.rows)?;
        let (domain_bits, rest) = split_mut(rest, self.domain_words())?;
        let (hash, rest) = split_mut(rest, u64::from(self.hash_count) + 1)?;
        let (references, rest) = split_mut(rest, self.reference_count.into())?;
        let (overlay, _) = split_mut(rest, self.overlay_words)?;
        Some(SectionsMut { header, row_offsets, domain_bits, hash, references, overlay })
    }

    /// The sections of a scratch region.
    pub(crate) fn scratch<'a>(&self, bytes: &'a mut [u8]) -> Option<Scratch<'a>> {
        self.is_addressable().then_some(())?;
        let (row_offsets, rest) = split_mut(bytes, self.rows)?;
        let (domain_bits, rest) = split_mut(rest, self.domain_words())?;
        let (occupied, rest) = split_mut(rest, self.occupied_words())?;
        Some(Scratch { row_offsets, domain_bits, occupied, rest })
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;
    use crate::Block;

    #[test]
    fn the_sections_fill_exactly_the_bytes_that_the_layout_asks_for() {
        for resolution in [[1, 1, 1], [64, 3, 5], [65, 1, 1], [200, 7, 1], [1, 100, 100]] {
            for (hash, references) in [(0, 0), (1, 7), (1000, 12345)] {
                let layout = Layout::new(resolution, hash, references, u64::from(hash % 7));
                let bytes = usize::try_from(layout.index_bytes()).unwrap();
                let mut blob = vec![Block::ZERO; Block::count_for(bytes)];
                let blob = Block::bytes_mut(&mut blob);
                assert_eq!(blob.len(), bytes);
                assert!(layout.sections(blob).is_some() && layout.sections_mut(blob).is_some());
                let short = blob.len() - crate::ALIGNMENT;
                assert!(layout.sections(&blob[..short]).is_none());
            }
        }
    }

    #[test]
    fn the_bound_holds_for_every_shape() {
        for triangles in [0, 1, 2, 7, 100, 12_345, 1_000_000] {
            for density in [0.01, 1.0, 4.0, 32.0] {
                let bound = Layout::bound(triangles, density, 0);
                for size in [[1.0, 1.0, 1.0], [1.0, 0.5, 0.0], [1e-3, 1.0, 0.1], [1.0, 1.0, 1e-9]] {
                    let size = glam::Vec3A::from_array(size);
                    let resolution = crate::cell::woo(size, f64::from(density), triangles).unwrap();
                    let most = u32::try_from(Layout::new(resolution, 0, 0, 0).cells).unwrap();
                    let limit = reference_limit(triangles);
                    let layout = Layout::new(resolution, most, limit, 0);
                    assert!(layout.index_bytes() <= bound.index_bytes());
                    assert!(layout.scratch_bytes() <= bound.scratch_bytes());
                }
            }
        }
    }
}
