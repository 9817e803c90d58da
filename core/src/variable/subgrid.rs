//! A subgrid: the hashed grid of one crowded cell, in words of the pool.
//!
//! ```text
//! words | head 3 | row_offsets | domain bits   | hash             | references          |
//!                  1 a row       32 cells each   1 a slot, 1 more   to the end
//! head  | low x y z, width | high x y z, height | slots, depth      |    8 bits each, slots 24
//! ```
//!
//! The box of a subgrid is the part of the cell that the primitives reach, in 1/256 of the cell, rounded
//! outwards: so a ray crosses the empty part of the cell in one step, and three words hold it all.

use glam::Vec3A;

use crate::aabb::Aabb;
use crate::cell::{CellRange, as_f32, cells_between, row, woo};
use crate::dda::{CellWalk, Line};
use crate::lists::pairs;
use crate::one_level::{slot, slots_are_sound};
use crate::visit::Visitor;

/// The most cells of a subgrid on an axis.
const MAX_RESOLUTION: u32 = 255;

/// Parts of a cell that a subgrid's box is measured in.
const PARTS: f32 = 256.0;

const HEAD_WORDS: usize = 3;
const WORD_BITS: usize = u32::BITS as usize;

/// The place of a subgrid in its cell, and its resolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Frame {
    low: [u8; 3],
    high: [u8; 3],
    pub(super) resolution: [u32; 3],
}

impl Frame {
    /// All of a cell, uncut.
    pub(super) const WHOLE: Self = Self { low: [0; 3], high: [255; 3], resolution: [1; 3] };

    /// Number of cells.
    pub(super) fn cells(&self) -> usize {
        self.resolution.iter().map(|&cells| cells as usize).product()
    }

    /// The frame around the part of a cell that primitives reach; [`refine`](Self::refine) sets its resolution.
    pub(super) fn around(reach: &Aabb, cell: [u32; 3]) -> Self {
        let corner = Vec3A::from_array(cell.map(as_f32));
        let part = |position: Vec3A| {
            let inside = (position - corner).max(Vec3A::ZERO).min(Vec3A::ONE) * PARTS;
            inside.to_array()
        };
        let low = part(reach.min).map(|position| to_u8(position.min(PARTS - 1.0)));
        let high = part(reach.max).map(|position| to_u8(position.min(PARTS - 1.0)));
        Self { low, high: core::array::from_fn(|k| high[k].max(low[k])), resolution: [1; 3] }
    }

    /// Returns true if this is the frame around what primitives reach of a cell, whatever its resolution.
    pub(super) fn is_around(&self, reach: &Aabb, cell: [u32; 3]) -> bool {
        *self == Self { resolution: self.resolution, ..Self::around(reach, cell) }
    }

    /// Sets Woo's resolution for so many primitives in this box of a cell with this size; false if an axis would need
    /// too many cells.
    pub(super) fn refine(&mut self, cell_size: Vec3A, density: f64, primitives: u32) -> bool {
        let size = cell_size * self.parts();
        match woo(size, density, primitives) {
            Some(resolution) if resolution.iter().all(|&r| r <= MAX_RESOLUTION) => {
                self.resolution = resolution;
                true
            }
            _ => false,
        }
    }

    /// The box's extent, in 256ths of the cell.
    fn parts(&self) -> Vec3A {
        let parts =
            core::array::from_fn(|k| f32::from(self.high[k]) + 1.0 - f32::from(self.low[k]));
        Vec3A::from_array(parts)
    }

    /// The box's corner and its cells for each cell around it.
    fn zoom(&self, cell: [u32; 3]) -> (Vec3A, Vec3A) {
        let low = Vec3A::from_array(self.low.map(f32::from)) / PARTS;
        let origin = Vec3A::from_array(cell.map(as_f32)) + low;
        let scale = Vec3A::from_array(self.resolution.map(as_f32)) * PARTS / self.parts();
        (origin, scale)
    }

    /// The cells of the subgrid that a primitive of the cell reaches.
    #[inline]
    pub(super) fn range(&self, cell: [u32; 3], reach: &Aabb) -> CellRange {
        let (origin, scale) = self.zoom(cell);
        let within = Aabb { min: (reach.min - origin) * scale, max: (reach.max - origin) * scale };
        cells_between(within, self.resolution)
    }
}

/// The sizes of a subgrid.
#[derive(Debug, Clone, Copy)]
pub(super) struct SubLayout {
    pub(super) frame: Frame,
    pub(super) hash_count: u32,
    pub(super) reference_count: u32,
}

/// A subgrid's words while they are written.
pub(super) struct SubSectionsMut<'a> {
    pub(super) row_offsets: &'a mut [u32],
    pub(super) domain_bits: &'a mut [u32],
    pub(super) hash: &'a mut [u32],
    pub(super) references: &'a mut [u32],
}

impl SubLayout {
    fn rows(&self) -> usize {
        let [_, height, depth] = self.frame.resolution;
        height as usize * depth as usize
    }

    /// Words of the whole subgrid.
    pub(super) fn words(&self) -> usize {
        HEAD_WORDS
            + self.rows()
            + self.frame.cells().div_ceil(WORD_BITS)
            + self.hash_count as usize
            + 1
            + self.reference_count as usize
    }

    /// The sections of so many words, the head written.
    pub(super) fn sections_mut<'a>(&self, words: &'a mut [u32]) -> Option<SubSectionsMut<'a>> {
        let (head, rest) = words.split_first_chunk_mut::<HEAD_WORDS>()?;
        let (row_offsets, rest) = rest.split_at_mut_checked(self.rows())?;
        let (domain_bits, rest) =
            rest.split_at_mut_checked(self.frame.cells().div_ceil(WORD_BITS))?;
        let (hash, references) = rest.split_at_mut_checked(self.hash_count as usize + 1)?;
        let Frame { low, high, resolution: [width, height, depth] } = self.frame;
        *head = [
            u32::from_le_bytes([low[0], low[1], low[2], 0]) | width << 24,
            u32::from_le_bytes([high[0], high[1], high[2], 0]) | height << 24,
            self.hash_count | depth << 24,
        ];
        Some(SubSectionsMut { row_offsets, domain_bits, hash, references })
    }
}

/// A view of a subgrid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Subgrid<'a> {
    pub(super) frame: Frame,
    row_offsets: &'a [u32],
    domain_bits: &'a [u32],
    hash: &'a [u32],
    references: &'a [u32],
}

impl<'a> Subgrid<'a> {
    /// The view of a subgrid's words; `None` if they cannot be one.
    #[inline]
    pub(super) fn open(words: &'a [u32]) -> Option<Self> {
        let (head, rest) = words.split_first_chunk::<HEAD_WORDS>()?;
        let [[low @ .., width], [high @ .., height], [.., depth]] = head.map(u32::to_le_bytes);
        let resolution = [width, height, depth].map(u32::from);
        let frame = Frame { low, high, resolution };
        if resolution.contains(&0) || (0..3).any(|k| low[k] > high[k]) {
            return None;
        }
        let hash_count = head[2] & 0x00ff_ffff;
        let layout = SubLayout { frame, hash_count, reference_count: 0 };
        let (row_offsets, rest) = rest.split_at_checked(layout.rows())?;
        let (domain_bits, rest) = rest.split_at_checked(frame.cells().div_ceil(WORD_BITS))?;
        let (hash, references) = rest.split_at_checked(hash_count as usize + 1)?;
        Some(Self { frame, row_offsets, domain_bits, hash, references })
    }

    /// A walk along a line through this subgrid, or `None` if the line passes it.
    #[inline]
    pub(super) fn walk(&self, line: &Line, around: &CellWalk) -> Option<CellWalk> {
        let (origin, scale) = self.frame.zoom(around.cell());
        let zoomed = line.zoom(origin.to_array(), scale.to_array());
        zoomed.walk_in(around.entered, self.frame.resolution)
    }

    /// Shows the lists of all cells that a box meets, given in cells of the top.
    pub(super) fn visit(&self, around: [u32; 3], reach: &Aabb, visitor: &mut Visitor<'_>) -> bool {
        let range = self.frame.range(around, reach);
        range.cells().all(|cell| {
            // Spend a word for each row: cells here have bits, not words, and damaged bytes may have this subgrid in
            // many cells.
            let is_paid = cell[0] != range.min[0] || visitor.spend(1);
            is_paid && self.references(cell).is_none_or(|ids| visitor.list(ids))
        })
    }

    /// The primitive ids in a cell, ascending; `None` if it is empty.
    #[inline(always)]
    pub(super) fn references(&self, [x, y, z]: [u32; 3]) -> Option<&'a [u32]> {
        let [width, height, _] = self.frame.resolution;
        let row = row(height, y, z);
        let bit = row * width as usize + x as usize;
        let word = self.domain_bits.get(bit / WORD_BITS)?;
        if word >> (bit % WORD_BITS) & 1 == 0 {
            return None;
        }
        let slot = slot(self.row_offsets.get(row)?.cast_signed(), x)?;
        let ends = self.hash.get(slot..)?.first_chunk::<2>()?;
        self.references.get(ends[0] as usize..ends[1] as usize)
    }

    /// Primitive ids in all lists together.
    pub(super) const fn reference_count(&self) -> usize {
        self.references.len()
    }

    /// Cells that have a list.
    pub(super) fn list_count(&self) -> u32 {
        self.domain_bits.iter().map(|word| word.count_ones()).sum()
    }

    /// Returns true if its sections are as displaced rows leave them, whatever is listed.
    pub(super) fn is_sound(&self) -> bool {
        let hash = self.hash;
        let is_cut = hash.first() == Some(&0)
            && pairs(hash).all(|(start, end)| start <= end)
            && hash.last().is_some_and(|&end| end as usize == self.references.len())
            && !matches!(hash, [.., start, end] if start == end);
        let is_set = |bit: usize| {
            let word = self.domain_bits.get(bit / WORD_BITS);
            word.is_some_and(|word| word >> (bit % WORD_BITS) & 1 != 0)
        };
        let resolution @ [width, height, _] = self.frame.resolution;
        let cells = self.frame.cells();
        let is_full = pairs(hash).map(|(start, end)| start < end);
        is_cut
            && !(cells..cells.next_multiple_of(WORD_BITS)).any(is_set)
            && slots_are_sound(
                resolution,
                |row| self.row_offsets.get(row).map(|offset| offset.cast_signed()),
                |[x, y, z]| is_set(row(height, y, z) * width as usize + x as usize),
                is_full,
            )
    }
}

/// A number from 0 to 255 without its fraction.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
const fn to_u8(position: f32) -> u8 {
    position as u8
}
