//! The multi-level variable hashed grid (CP10 §3.1): crowded cells hold grids of their own.
//!
//! The top is a one-level grid, by default at density 4. A cell with more primitives than `subdivide_above` gets a
//! subgrid if that separates them, and else keeps its list. The subgrid is built by the same algorithm from the cell's
//! primitives, cut to the part of the cell that they reach. Two levels, as in the paper.
//!
//! ```text
//! blob | header | row_offsets | domain_bits | hash | pool |
//!
//! hash[slot] .. hash[slot + 1]      the cell's part of the pool
//!   top bit of hash[slot] clear     primitive ids, ascending
//!   top bit set                     a subgrid, see subgrid.rs
//! ```
//!
//! The paper names no threshold. 16 is the largest with which every scan gets subgrids. On all scenes but bunny, one
//! picture takes longer with subgrids than without (docs/paper.md).

mod build;
mod subgrid;
mod validate;

use crate::aabb::Aabb;
use crate::blob::Header;
use crate::bump::GRID;
use crate::cell::Lattice;
use crate::counters::Tally;
use crate::dda::{Line, NEVER, Step};
use crate::error::Error;
use crate::one_level::OneLevel;
use crate::visit::Visitor;
pub(crate) use build::{bound, build, scratch_bytes, sizes};
use subgrid::Subgrid;

/// The content of a cell of the top.
#[derive(Debug, Clone, Copy)]
enum CellContent<'a> {
    /// Primitive ids, ascending.
    List(&'a [u32]),
    /// The words of a subgrid.
    Subgrid(&'a [u32]),
}

/// A view of a built variable grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Variable<'a> {
    top: OneLevel<'a>,
}

impl<'a> Variable<'a> {
    #[cfg(feature = "alloc")]
    pub(crate) const NOTHING: Self = Self { top: OneLevel::NOTHING };

    /// The view of a blob, in O(1). Nothing behind the header is trusted, now or later.
    pub(crate) fn open(header: &Header, lattice: &Lattice, blob: &'a [u8]) -> Result<Self, Error> {
        Ok(Self { top: OneLevel::open(header, lattice, blob)? })
    }

    /// The most primitives that a ray is shown.
    pub(crate) const fn list_words(&self) -> usize {
        self.top.list_words()
    }

    /// Returns the content of a cell; `None` if it is empty.
    #[inline(always)]
    fn content(&self, cell: [u32; 3]) -> Option<CellContent<'a>> {
        let [start, end] = self.top.ends(cell)?;
        let part = (start & !GRID) as usize..(end & !GRID) as usize;
        let words = self.top.sections.references.get(part)?;
        Some(if start & GRID == 0 { CellContent::List(words) } else { CellContent::Subgrid(words) })
    }

    /// Shows the lists of all cells that a box, given in cells, meets; `false` if the visitor's budget is used up.
    pub(crate) fn visit(&self, reach: &Aabb, visitor: &mut Visitor<'_>) -> bool {
        self.top.each_marked(reach, |cell| match self.content(cell) {
            Some(CellContent::List(ids)) => visitor.list(ids),
            Some(CellContent::Subgrid(words)) => {
                Subgrid::open(words).is_none_or(|grid| grid.visit(cell, reach, visitor))
            }
            None => true,
        })
    }

    /// Walks the cells of a ray in order and shows `leaf` the primitives of each that has any; see
    /// [`OneLevel::traverse`].
    #[inline(always)]
    pub(crate) fn traverse<T: Tally>(
        &self,
        line: &Line,
        tally: &mut T,
        mut leaf: impl FnMut(&[u32], &mut T) -> f32,
    ) {
        let mut limit = line.end;
        let mut walk = line.walk(0.0, 1.0, [0; 3], self.top.last(), NEVER);
        // While the walk is in a subgrid: the subgrid, and the walk around it.
        let mut inside: Option<(Subgrid<'a>, _)> = None;
        loop {
            tally.cell_step();
            let content = match &inside {
                None => self.content(walk.cell()),
                Some((subgrid, _)) => subgrid.references(walk.cell()).map(CellContent::List),
            };
            match content {
                None => {}
                Some(CellContent::List(ids)) => limit = leaf(ids, tally),
                Some(CellContent::Subgrid(words)) => {
                    let subgrid = Subgrid::open(words);
                    let enter = subgrid.and_then(|grid| Some((grid, grid.walk(line, &walk)?)));
                    if let Some((subgrid, within)) = enter {
                        tally.grid_step();
                        inside = Some((subgrid, walk));
                        walk = within;
                        continue;
                    }
                }
            }
            // Take a step; where the subgrid or the ray ends, take it around the subgrid. A subgrid reaches beyond
            // its cell by the margin, so a ray that ends in it may go on in the cell.
            loop {
                let step = match &inside {
                    Some(_) => walk.advance(limit),
                    None => walk.advance_far(limit, |_| {}),
                };
                match step {
                    Step::Inside => break,
                    Step::Outside | Step::Ended => match inside.take() {
                        Some((_, around)) => walk = around,
                        None => return,
                    },
                }
            }
        }
    }
}
