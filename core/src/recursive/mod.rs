//! The recursive grid that the paper compares with: Manta's (Bigler 2006; resolution after Ize,
//! Shirley, Parker 2007), uncompressed, by default of depth 3.
//!
//! Every cell of a grid has an entry. A cell with more than [`FEW`] primitives holds a grid of its own, around the part
//! of the cell that they reach, if the depth allows it, the grid separates them, and the budget of looks lasts
//! ([`build`](mod@build)). Of the four grids this one takes the fewest tests and steps a ray, the longest build and the
//! most memory.
//!
//! Departures from Manta: the budget, a density that is halved where references exceed their limit, and margins that
//! cover rounding.
//!
//! ```text
//! blob | header | pool |
//! grid in the pool | origin 3 | scale 3 | resolution | entries, one a cell and one more | contents |
//!
//! entry[cell] .. entry[cell + 1]     the cell's part of the pool
//!   top bit of entry[cell] clear     primitive ids, ascending
//!   top bit set                      a grid
//! ```
//!
//! Origin and scale (cells for each cell of the root) are in the root's cells.

mod build;
mod node;
mod overlap;
mod validate;

use crate::aabb::Aabb;
use crate::arena::{section_bytes, split};
use crate::blob::{HEADER_BYTES, Header, corrupt};
use crate::cell::Lattice;
use crate::counters::Tally;
use crate::dda::{Line, Step};
use crate::error::Error;
use crate::limits::MAX_DEPTH;
use crate::visit::Visitor;
pub(crate) use build::{bound, build, scratch_bytes, sizes};
use node::{GridNode, NestedCell};

/// A cell with no more primitives than this is not divided.
const FEW: usize = 4;

/// A view of a built recursive grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Recursive<'a> {
    pool: &'a [u32],
}

impl<'a> Recursive<'a> {
    #[cfg(feature = "alloc")]
    pub(crate) const NOTHING: Self = Self { pool: &[] };

    /// The view of a blob, in O(1). Nothing behind the header is trusted, now or later.
    pub(crate) fn open(header: &Header, _: &Lattice, blob: &'a [u8]) -> Result<Self, Error> {
        let words = u64::from(header.reference_count);
        let is_whole = header.blob_bytes == HEADER_BYTES as u64 + section_bytes::<u32>(words);
        let pool =
            blob.get(HEADER_BYTES..).filter(|_| is_whole).and_then(|rest| split(rest, words));
        let (pool, _) = pool.ok_or(corrupt(core::mem::offset_of!(Header, blob_bytes)))?;
        Ok(Self { pool })
    }

    /// The most primitives that a ray is shown.
    pub(crate) const fn list_words(&self) -> usize {
        self.pool.len()
    }

    /// Shows the lists of all cells that a box, given in cells, meets; `false` if the visitor's budget is used up.
    pub(crate) fn visit(&self, reach: &Aabb, visitor: &mut Visitor<'_>) -> bool {
        GridNode::open(self.pool, 0)
            .is_none_or(|root| self.visit_node(&root, reach, MAX_DEPTH, visitor))
    }

    fn visit_node(
        &self,
        node: &GridNode,
        reach: &Aabb,
        depth: u32,
        visitor: &mut Visitor<'_>,
    ) -> bool {
        node.range(reach).cells().all(|cell| {
            visitor.spend(1)
                && match node.content(self.pool, cell) {
                    None => true,
                    Some(NestedCell::List(ids)) => visitor.list(ids),
                    Some(NestedCell::Grid(at)) => GridNode::open(self.pool, at)
                        .filter(|_| depth > 0)
                        .is_none_or(|inner| self.visit_node(&inner, reach, depth - 1, visitor)),
                }
        })
    }

    /// Walks the cells of a ray in order and shows `leaf` the primitives of each that has any; see
    /// [`OneLevel::traverse`](crate::one_level::OneLevel::traverse).
    #[inline(always)]
    pub(crate) fn traverse<T: Tally>(
        &self,
        line: &Line,
        tally: &mut T,
        mut leaf: impl FnMut(&[u32], &mut T) -> f32,
    ) {
        let Some(mut node) = GridNode::open(self.pool, 0) else { return };
        let Some(mut walk) = node.walk(line, 0.0) else { return };
        let mut limit = line.end;
        let mut around = [(node, walk); MAX_DEPTH as usize];
        let mut depth = 0;
        // A ray meets a cell at most once, and every cell has an entry; where damaged bytes nest
        // grids without end, the walk ends with the entries.
        for _ in 0..self.pool.len() {
            tally.cell_step();
            match node.content(self.pool, walk.cell()) {
                None => {}
                Some(NestedCell::List(ids)) => limit = leaf(ids, tally),
                Some(NestedCell::Grid(at)) => {
                    // Go down, unless the ray passes the grid within its cell.
                    let slot = around.get_mut(depth);
                    let inner = GridNode::open(self.pool, at);
                    let enter =
                        inner.and_then(|inner| Some((inner, inner.walk(line, walk.entered)?)));
                    if let (Some(slot), Some((inner, within))) = (slot, enter) {
                        tally.grid_step();
                        *slot = (node, walk);
                        (node, walk) = (inner, within);
                        depth += 1;
                        continue;
                    }
                }
            }
            // Take a step; where a grid or the ray ends, take it in the grid around it. A grid reaches beyond its
            // cell by the margin, so a ray that ends in it may go on in the cell around it.
            loop {
                match walk.advance(limit) {
                    Step::Inside => break,
                    Step::Outside | Step::Ended => {
                        match depth.checked_sub(1).and_then(|up| around.get(up)) {
                            Some(outer) => {
                                (node, walk) = *outer;
                                depth -= 1;
                            }
                            None => return,
                        }
                    }
                }
            }
        }
    }
}
