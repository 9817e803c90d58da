//! The one-level hashed grid (Lagae and Dutré 2008; the paper's baseline).
//!
//! A compact grid keeps for each cell the place where its list starts, and the ids of all lists one after the other.
//! Here each cell has one bit, which tells whether the cell has triangles. Only the full cells have a place in a table.
//!
//! ```text
//! cell (x, y, z)      row  = y + resolution.y * z
//! bit x of row in domain_bits       0: empty, done
//! slot = row_offsets[row] + x       1: row displacement, see displacement.rs
//! hash[slot] .. hash[slot + 1]      the cell's part of
//! references                        primitive ids, ascending in every cell
//! ```
//!
//! Most cells of a scan are empty, so a ray mostly reads bits that lie next to each other and stay
//! in the cache. A cell costs one bit and, if it is not empty, about 1.2 slots of 4 bytes.

mod build;
mod displacement;
mod layout;
mod placed;
mod spread;
mod triangles;
mod validate;

use crate::aabb::Aabb;
use crate::arena::Sizes;
use crate::bits::{each_one, is_set};
use crate::blob::{Header, corrupt};
use crate::cell::{Lattice, cells_between, row};
use crate::config::BuildFlags;
use crate::control::Watch;
use crate::counters::Tally;
use crate::dda::{Line, NEVER, Step};
use crate::error::Error;
use crate::mesh::TriangleMesh;
use crate::visit::Visitor;
pub(crate) use build::{Overlay, Plan, build_under};
pub(crate) use displacement::displace;
use layout::Sections;
pub(crate) use layout::{Layout, Scratch, longest};
pub(crate) use placed::{PlacedBatch, Spread};
pub(crate) use spread::{fill, mark};
pub(crate) use triangles::MeshSpread;
pub(crate) use validate::{check_header, is_list_of, slots_are_sound};

/// A view of a built one-level grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OneLevel<'a> {
    /// The last cell on each axis.
    last: [u32; 3],
    pub(crate) sections: Sections<'a>,
}

/// The slot of a cell in the hash table.
#[inline(always)]
pub(crate) fn slot(row_offset: i32, x: u32) -> Option<usize> {
    usize::try_from(row_offset.wrapping_add_unsigned(x)).ok()
}

/// The most memory that a mesh with so many triangles can need.
pub(crate) const fn bound(triangles: u32, density: f32) -> (u64, u64) {
    Layout::bound(triangles, density, 0).bytes()
}

/// The scratch that the build of a grid with this header takes.
pub(crate) const fn scratch_bytes(header: &Header) -> u64 {
    Layout::new(header.resolution, 0, 0, 0).scratch_bytes()
}

/// The memory that a mesh needs: exact if the scratch is large enough to plan in.
pub(crate) fn sizes(
    mesh: &TriangleMesh<'_>,
    density: f32,
    flags: BuildFlags,
    scratch: &mut [u8],
) -> Result<Sizes, Error> {
    Plan::sizes(mesh, density, flags, &(), scratch)
}

/// Builds in as much memory as [`sizes`] says.
pub(crate) fn build<'a>(
    mesh: &TriangleMesh<'_>,
    density: f32,
    flags: BuildFlags,
    index: &'a mut [u8],
    scratch: &mut [u8],
    watch: &Watch<'_>,
) -> Result<&'a [u8], Error> {
    build_under(mesh, density, flags, &(), index, scratch, watch)
}

impl<'a> OneLevel<'a> {
    #[cfg(feature = "alloc")]
    pub(crate) const NOTHING: Self = Self { last: [0; 3], sections: Sections::NOTHING };

    /// The view of a blob, in O(1). Nothing behind the header is trusted, now or later.
    pub(crate) fn open(header: &Header, lattice: &Lattice, blob: &'a [u8]) -> Result<Self, Error> {
        Self::open_under(header, lattice, &(), blob)
    }

    /// [`open`](Self::open) with an overlay.
    pub(crate) fn open_under(
        header: &Header,
        lattice: &Lattice,
        overlay: &dyn Overlay,
        blob: &'a [u8],
    ) -> Result<Self, Error> {
        let Header { resolution, hash_count, reference_count, .. } = *header;
        let overlay_words = overlay.words(resolution);
        let layout = Layout::new(resolution, hash_count, reference_count, overlay_words);
        let sections = layout
            .sections(blob)
            .filter(|_| header.blob_bytes == layout.index_bytes())
            .ok_or(corrupt(core::mem::offset_of!(Header, blob_bytes)))?;
        Ok(Self { last: lattice.last(), sections })
    }

    /// The last cell on each axis.
    pub(crate) const fn last(&self) -> [u32; 3] {
        self.last
    }

    /// Words of all lists.
    pub(crate) const fn list_words(&self) -> usize {
        self.sections.references.len()
    }

    /// The primitive ids in a cell, ascending; `None` if it is empty.
    #[inline(always)]
    pub(crate) fn references(&self, cell: [u32; 3]) -> Option<&'a [u32]> {
        self.between(self.ends(cell)?)
    }

    /// The primitive ids between two ends.
    #[inline(always)]
    fn between(&self, [start, end]: [u32; 2]) -> Option<&'a [u32]> {
        self.sections.references.get(start as usize..end as usize)
    }

    /// Returns true if the domain bit of a cell is set.
    #[inline(always)]
    pub(crate) fn is_marked(&self, cell: [u32; 3]) -> bool {
        is_set(self.sections.domain_bits, self.bit(cell))
    }

    /// The bit of a cell among the domain bits.
    #[inline(always)]
    fn bit(&self, [x, y, z]: [u32; 3]) -> usize {
        let [width, height, _] = self.last.map(|last| last + 1);
        row(height, y, z) * width as usize + x as usize
    }

    /// The two words of the hash table that say where a cell's list lies; `None` if it is empty.
    #[inline(always)]
    pub(crate) fn ends(&self, cell: [u32; 3]) -> Option<[u32; 2]> {
        if self.is_marked(cell) { self.ends_of_marked(cell) } else { None }
    }

    /// [`ends`](Self::ends) of a cell whose domain bit is set.
    #[inline(always)]
    fn ends_of_marked(&self, [x, y, z]: [u32; 3]) -> Option<[u32; 2]> {
        let row = row(self.last[1] + 1, y, z);
        let slot = slot(*self.sections.row_offsets.get(row)?, x)?;
        self.sections.hash.get(slot..)?.first_chunk().copied()
    }

    /// Shows the lists of all cells that a box, given in cells, meets; `false` if the visitor's budget is used up.
    pub(crate) fn visit(&self, reach: &Aabb, visitor: &mut Visitor<'_>) -> bool {
        self.each_marked(reach, |cell| self.references(cell).is_none_or(|ids| visitor.list(ids)))
    }

    /// Calls `visit` with each marked cell that a box, given in cells, meets, until it returns false; returns false
    /// then.
    pub(crate) fn each_marked(
        &self,
        reach: &Aabb,
        mut visit: impl FnMut([u32; 3]) -> bool,
    ) -> bool {
        let range = cells_between(*reach, self.last.map(|last| last + 1));
        let [first, last] = [range.min[0], range.max[0]];
        for z in range.min[2]..=range.max[2] {
            for y in range.min[1]..=range.max[1] {
                let bit = self.bit([first, y, z]);
                let count = (last - first) as usize + 1;
                let mut goes_on = true;
                each_one(self.sections.domain_bits, bit, count, |x| {
                    let x = first + u32::try_from(x).unwrap_or(0);
                    goes_on = visit([x, y, z]);
                    goes_on
                });
                if !goes_on {
                    return false;
                }
            }
        }
        true
    }

    /// Walks the cells of a ray in order and shows `leaf` the primitives of each that has any.
    ///
    /// `leaf` returns the distance at which the ray now ends: that of the closest hit, or negative infinity to stop
    /// at once.
    #[inline(always)]
    pub(crate) fn traverse<T: Tally>(
        &self,
        line: &Line,
        tally: &mut T,
        mut leaf: impl FnMut(&[u32], &mut T) -> f32,
    ) {
        let mut limit = line.end;
        let mut walk = line.walk(0.0, 1.0, [0; 3], self.last, NEVER);
        let mut bit = self.bit(walk.cell());
        let [width, height, _] = self.last.map(|last| last as usize + 1);
        let moves = line.moves([1, width, width * height]);
        loop {
            tally.cell_step();
            // Show the list of the cell, if it has one.
            if is_set(self.sections.domain_bits, bit)
                && let Some(ends) = self.ends_of_marked(walk.cell())
                && let Some(references) = self.between(ends)
            {
                limit = leaf(references, tally);
            }
            // Step to the next cell, and to its bit.
            if walk.advance_far(limit, |axis| bit = bit.wrapping_add(moves[axis])) != Step::Inside {
                return;
            }
        }
    }
}
