//! The brick grid: occupancy masks of 4^3 bits in blocks of 16^3 cells, ranks instead of a hash.
//!
//! What the paper's fixed grid does with macrocells and row displacement, done with the two
//! instructions that machines have for it: a mask of 64 cells answers which of them hold anything,
//! and the number of bits below a cell's bit is the place of its list. Nothing is searched for, and
//! what belongs to a block lies together.
//!
//! ```text
//! blob | header | blocks | pool |
//!
//! blocks   for each block of 16^3 cells: mask of its bricks, where its chunk lies, its list
//! pool     list of the grid, and the chunk of each block:
//!          | bricks: mask, cells, list | starts of cells, end | lists of cells | of bricks | of the block |
//!                                             (quarters and ids)              (extent, count, ids)
//! ```
//!
//! A cell is a few triangles wide, whatever their number ([`size`]). A triangle that would be in
//! too many cells is in the lists of bricks, of blocks, or of the grid: large ones cost little
//! memory. A crowded cell is divided like a block, up to 16 cells wide, twice at most ([`sort`]).

mod budget;
mod build;
mod bundle;
mod chords;
mod close;
mod crowds;
mod divide;
mod extent;
mod frame;
mod frusta;
mod groups;
mod hits;
mod layout;
mod march;
mod pass;
mod places;
mod pool;
mod quarters;
mod reach;
mod size;
mod sort;
#[cfg(test)]
mod tests;
mod tile;
mod validate;
mod view;
mod walk;

use core::slice::from_ref;

use fearless_simd::Simd;
use glam::Vec3A;

use crate::aabb::Aabb;
use crate::arena::split;
use crate::blob::{HEADER_BYTES, Header, corrupt};
use crate::cell::{CellRange, Lattice, as_f32, cells_between};
use crate::error::Error;
use crate::mesh::{Strided, TriangleMesh};
use crate::ray::Hit;
use crate::simd::Kernel;
use crate::visit::Visitor;
pub(crate) use budget::{bound, scratch_bytes_at_most};
pub(crate) use build::{build, sizes};
use bundle::{BUNDLES, RAYS};
use extent::{EXTENT_WORDS, Extent, Owner};
use layout::{Block, Layout};
use quarters::Format;
pub(crate) use walk::OneRay;

/// A view of a built brick grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Brick<'a> {
    blocks: &'a [Block],
    pool: &'a [u32],
    /// Blocks per axis.
    width: [u32; 3],
    /// The last cell on each axis.
    last: [u32; 3],
    format: Format,
}

impl<'a> Brick<'a> {
    /// The view of a blob, in O(1). Nothing behind the header is trusted, now or later.
    pub(crate) fn open(header: &Header, lattice: &Lattice, blob: &'a [u8]) -> Result<Self, Error> {
        let layout = Layout::new(lattice.resolution, 0);
        let words = header.reference_count.into();
        let sections = blob.get(HEADER_BYTES..).and_then(|behind| {
            let (blocks, behind) = split(behind, layout.block_count())?;
            Some((blocks, split(behind, words)?.0))
        });
        let (blocks, pool) = sections
            .filter(|_| header.blob_bytes == layout.index_bytes(words))
            .ok_or(corrupt(core::mem::offset_of!(Header, blob_bytes)))?;
        let format = Format::of(header.triangle_count);
        Ok(Self { blocks, pool, width: layout.blocks, last: lattice.last(), format })
    }

    /// The words of all lists and what leads to them: no ray is shown more primitives.
    pub(crate) const fn list_words(&self) -> usize {
        self.pool.len()
    }

    /// The block at a place, if it has anything.
    #[inline(always)]
    fn block(&self, [x, y, z]: [u32; 3]) -> Option<Chunk<'a>> {
        let block = *self.blocks.get((x + self.width[0] * (y + self.width[1] * z)) as usize)?;
        let words = self.pool.get(block.base as usize..)?;
        Some(Chunk { words, bricks: 0, mask: layout::mask(block.mask), list: block.list })
    }

    /// Shows the lists of all cells that a box meets, and of the bricks and blocks around them,
    /// given in cells; `false` if that was enough.
    pub(crate) fn visit(&self, reach: &Aabb, visitor: &mut Visitor<'_>) -> bool {
        let range = cells_between(*reach, self.last.map(|last| last + 1));
        let blocks = CellRange {
            min: range.min.map(|cell| cell / layout::BLOCK),
            max: range.max.map(|cell| cell / layout::BLOCK),
        };
        visitor.ids_have(self.format.ids());
        visitor.list(self.large())
            && blocks.cells().all(|block| {
                let Some(chunk) = self.block(block) else { return true };
                let corner = block.map(|at| as_f32(at * layout::BLOCK));
                let reach = Aabb {
                    min: reach.min - Vec3A::from_array(corner),
                    max: reach.max - Vec3A::from_array(corner),
                };
                chunk.visit(&reach, layout::BLOCK, 2, visitor)
            })
    }

    /// The primitives that are in no block.
    fn large(&self) -> &'a [u32] {
        list(self.pool, 1).unwrap_or_default()
    }
}

/// The hits of rays that see nothing.
static MISSES: [Hit; RAYS] = [Hit::MISS; RAYS];

/// Neighbouring rays on their way through a grid, up to 128 at a time.
#[derive(Debug)]
pub(crate) struct Tiles<'q, F, const ANY: bool> {
    pub(crate) brick: &'q Brick<'q>,
    pub(crate) lattice: &'q Lattice,
    pub(crate) mesh: &'q TriangleMesh<'q>,
    pub(crate) rays: &'q Strided<'q>,
    /// Gets the place of a ray and its hit and perhaps those of some next ones, up to all of a
    /// bundle, or no hit if the ray did not go with its tile.
    pub(crate) answer: F,
}

impl<F: FnMut(usize, &[Hit]), const ANY: bool> Kernel for Tiles<'_, F, ANY> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        let mut tile = tile::Tile::<ANY>::new(self.brick, self.lattice, self.mesh);
        for first in (0..self.rays.count).step_by(BUNDLES * RAYS) {
            let count = (BUNDLES * RAYS).min(self.rays.count - first);
            let members = tile.trace(simd, self.rays, first, count);
            for (place, members) in members.into_iter().enumerate().take(count.div_ceil(RAYS)) {
                let (first, count) = (first + place * RAYS, RAYS.min(count - place * RAYS));
                let bundle = tile.bundle(place);
                // As in an empty part of a picture: one answer, not sixteen.
                if !bundle.is_begun && members.count_ones() as usize == count {
                    (self.answer)(first, MISSES.get(..count).unwrap_or_default());
                    continue;
                }
                for four in 0..count.div_ceil(4) {
                    // Said in both ways: hits that are handed on as they are
                    // need not go through memory.
                    if members >> (4 * four) & 0xf == 0xf {
                        (self.answer)(first + 4 * four, &bundle.hits(simd, four));
                        continue;
                    }
                    for (lane, hit) in (4 * four..count).zip(&bundle.hits(simd, four)) {
                        let is_traced = members >> lane & 1 == 1;
                        (self.answer)(first + lane, if is_traced { from_ref(hit) } else { &[] });
                    }
                }
            }
        }
    }
}

/// The words of a block, and which of them are its own or those of one of its cells.
#[derive(Debug, Clone, Copy)]
struct Chunk<'a> {
    /// From the block's first word on.
    words: &'a [u32],
    /// Where its bricks lie.
    bricks: u32,
    /// The bricks that have anything.
    mask: u64,
    /// Where its list lies, plus 1.
    list: u32,
}

/// The list of ids behind its length, `at` being the place of the length plus 1; `None` for 0.
#[inline(always)]
fn list(words: &[u32], at: u32) -> Option<&[u32]> {
    let start = (at as usize).checked_sub(1)?;
    let (&length, ids) = words.get(start..)?.split_first()?;
    ids.get(..length as usize)
}

/// The primitives that belong to all of a brick or a chunk, and where in it they lie.
#[derive(Debug, Clone, Copy)]
struct Large<'a> {
    owner: Owner,
    extent: Extent,
    ids: &'a [u32],
}

impl<'a> Large<'a> {
    #[inline(always)]
    fn new(words: &'a [u32], at: u32, owner: Owner) -> Option<Self> {
        let ids = list(words, at)?;
        let start = (at as usize).checked_sub(1 + EXTENT_WORDS)?;
        let extent = words.get(start..)?.first_chunk::<EXTENT_WORDS>()?;
        Some(Self { owner, extent: bytemuck::cast(*extent), ids })
    }
}

/// What a cell holds.
#[derive(Debug, Clone, Copy)]
enum Content<'a> {
    /// Ids, and above them the [`quarters`].
    List(&'a [u32]),
    /// A divided cell, and how many cells it has on each axis.
    Chunk(Chunk<'a>, u32),
}

impl<'a> Chunk<'a> {
    /// The primitives that belong to all of it.
    #[inline(always)]
    fn large(&self) -> Option<Large<'a>> {
        Large::new(self.words, self.list, Owner::Chunk)
    }

    /// Those that belong to all of one of its bricks.
    #[inline(always)]
    fn large_of(&self, brick: &layout::Brick, bit: u32) -> Option<Large<'a>> {
        Large::new(self.words, brick.list, Owner::Brick(bit))
    }

    /// Shows the lists of all cells that a box meets, given in cells of the chunk, of which it has
    /// some on each axis and which may be divided so often.
    fn visit(&self, reach: &Aabb, cells: u32, depth: u32, visitor: &mut Visitor<'_>) -> bool {
        let range = cells_between(*reach, [cells; 3]);
        let bricks = CellRange {
            min: range.min.map(|cell| cell >> 2),
            max: range.max.map(|cell| cell >> 2),
        };
        self.large().is_none_or(|large| visitor.list(large.ids))
            && bricks.cells().all(|at| {
                let corner = at.map(|at| at << 2);
                let bit = layout::number(corner) >> 6;
                if self.mask >> bit & 1 == 0 {
                    return true;
                }
                let Some(brick) = self.brick(bit) else { return true };
                let inside = CellRange {
                    min: core::array::from_fn(|axis| range.min[axis].max(corner[axis])),
                    max: core::array::from_fn(|axis| range.max[axis].min(corner[axis] + 3)),
                };
                visitor.spend(1)
                    && self.large_of(&brick, bit).is_none_or(|large| visitor.list(large.ids))
                    && inside
                        .cells()
                        .all(|cell| self.visit_cell(&brick, cell, reach, depth, visitor))
            })
    }

    /// Shows what lists a cell has.
    fn visit_cell(
        &self,
        brick: &layout::Brick,
        cell: [u32; 3],
        reach: &Aabb,
        depth: u32,
        visitor: &mut Visitor<'_>,
    ) -> bool {
        let bit = layout::number(cell.map(|cell| cell & 3));
        if layout::mask(brick.mask) >> bit & 1 == 0 {
            return true;
        }
        match self.content(brick, bit) {
            Some(Content::List(references)) => visitor.list(references),
            Some(Content::Chunk(chunk, cells)) if depth > 0 && visitor.spend(1) => {
                let corner = Vec3A::from_array(cell.map(as_f32));
                let within = |position: Vec3A| (position - corner) * as_f32(cells);
                let reach = Aabb { min: within(reach.min), max: within(reach.max) };
                chunk.visit(&reach, cells, depth - 1, visitor)
            }
            _ => true,
        }
    }

    /// A brick that the mask has.
    #[inline(always)]
    fn brick(&self, bit: u32) -> Option<layout::Brick> {
        let rank = layout::rank(self.mask, bit);
        let at = (self.bricks as usize).checked_add(rank * layout::RECORD_WORDS)?;
        let words = self.words.get(at..)?.first_chunk::<{ layout::RECORD_WORDS }>()?;
        Some(bytemuck::cast(*words))
    }

    /// What a cell holds that the mask of its brick has.
    #[inline(always)]
    fn content(&self, brick: &layout::Brick, bit: u32) -> Option<Content<'a>> {
        let rank = layout::rank(layout::mask(brick.mask), bit);
        let at = (brick.cells as usize).checked_add(rank)?;
        let &[start, end] = self.words.get(at..)?.first_chunk()?;
        let part = (start & !crate::bump::GRID) as usize..(end & !crate::bump::GRID) as usize;
        let words = self.words.get(part)?;
        if start & crate::bump::GRID == 0 {
            return Some(Content::List(words));
        }
        let &[low, high, bricks, list, cells] = words.first_chunk()?;
        let chunk = Chunk { words: self.words, bricks, mask: layout::mask([low, high]), list };
        (2..=layout::BLOCK).contains(&cells).then_some(Content::Chunk(chunk, cells))
    }
}
