//! The one-level hashed grid (Lagae and Dutré 2008; the paper's baseline).
//!
//! A grid with an index per cell and an index per reference, minus the empty cells: one bit tells
//! whether a cell has triangles, and only then is the cell looked up.
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
//! in the cache. What a cell costs is one bit and, if it is not empty, about 1.2 slots of 4 bytes.

mod build;
mod displacement;
mod layout;
mod validate;

use crate::bits::is_set;
use crate::blob::{Header, corrupt};
use crate::config::Config;
use crate::counters::Tally;
use crate::dda::Dda;
use crate::error::Error;
use crate::mesh::TriangleMesh;
use crate::sizes::Sizes;
pub(crate) use build::build;
use build::{Plan, reference_limit};
use layout::{Layout, Sections};

/// A view of a built one-level grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OneLevel<'a> {
    width: u32,
    height: u32,
    sections: Sections<'a>,
}

/// The row of the cells with this y and z.
#[inline(always)]
const fn row(height: u32, y: u32, z: u32) -> usize {
    z as usize * height as usize + y as usize
}

/// The slot of a cell in the hash table.
#[inline(always)]
fn slot(row_offset: i32, x: u32) -> Option<usize> {
    usize::try_from(row_offset.wrapping_add_unsigned(x)).ok()
}

/// The most memory that a mesh with so many triangles can need.
pub(crate) const fn bound(triangles: u32, density: f32) -> (u64, u64) {
    let layout = Layout::bound(triangles, density);
    (layout.index_bytes(), layout.scratch_bytes())
}

/// The scratch that a build with this resolution takes.
pub(crate) const fn scratch_bytes(resolution: [u32; 3]) -> u64 {
    Layout::new(resolution, 0, 0).scratch_bytes()
}

/// The memory that a mesh needs: exact if the scratch is large enough to plan in.
pub(crate) fn sizes(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    scratch: &mut [u8],
) -> Result<Sizes, Error> {
    let plan = Plan::new(mesh, config, scratch)?;
    Sizes::new(plan.layout.index_bytes(), plan.layout.scratch_bytes(), plan.is_exact())
}

impl<'a> OneLevel<'a> {
    /// The view of a blob, in O(1). Nothing behind the header is trusted, now or later.
    pub(crate) fn open(header: &Header, blob: &'a [u8]) -> Result<Self, Error> {
        let layout = Layout::new(header.resolution, header.hash_count, header.reference_count);
        let sections = layout
            .sections(blob)
            .filter(|_| header.blob_bytes == layout.index_bytes())
            .ok_or(corrupt(core::mem::offset_of!(Header, blob_bytes)))?;
        let [width, height, _] = header.resolution;
        Ok(Self { width, height, sections })
    }

    /// The primitive ids in a cell, ascending; `None` if it is empty.
    #[inline(always)]
    fn references(&self, [x, y, z]: [u32; 3]) -> Option<&'a [u32]> {
        let row = row(self.height, y, z);
        if !is_set(self.sections.domain_bits, row * self.width as usize + x as usize) {
            return None;
        }
        let slot = slot(*self.sections.row_offsets.get(row)?, x)?;
        let ends = self.sections.hash.get(slot..)?.first_chunk::<2>()?;
        self.sections.references.get(ends[0] as usize..ends[1] as usize)
    }

    /// Walks the cells of a ray in order and shows `leaf` the primitives of each that has any.
    ///
    /// `leaf` answers with the distance at which the ray now ends: the closest hit's, or less than
    /// any to stop at once.
    #[inline(always)]
    pub(crate) fn traverse<T: Tally>(
        &self,
        mut walk: Dda,
        tally: &mut T,
        mut leaf: impl FnMut(&[u32], &mut T) -> f32,
    ) {
        let mut limit = walk.end;
        loop {
            tally.cell_step();
            if let Some(references) = self.references(walk.cell) {
                limit = leaf(references, tally);
            }
            if !walk.advance(limit) {
                return;
            }
        }
    }
}
