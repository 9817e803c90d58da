//! Where the triangles of a batch lie: what a pass finds before it visits any of them.
//!
//! ```text
//! blocks | quarters of the first cell and the last | number of the first cell's block |
//! cells  | axes on which the last cell is in the next block | cells, as an entry has them |
//! ```
//!
//! The number of a block fits into the bits of an id, which are twenty or more: there is at most one
//! block for 32 triangles, and eight more.
//!
//! While places are found nothing is called but for triangles that cannot be read, so that all
//! constants stay in vector registers, and nothing depends on how many cells and blocks a triangle
//! has: that is as good as random.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u32x8};

use super::layout::{Entry, GROUP};
use super::quarters::{Format, LAST, quarters};
use crate::eight::LANES;
use crate::mesh::WideMesh;
use crate::spans::{Span, Spans};

/// Triangles of a batch.
pub(super) const BATCH: u32 = 64;
const ROWS: usize = BATCH as usize / LANES;
/// The first of three bits above the group of simple triangles.
const STRADDLES: u32 = GROUP + 3;

/// Where the triangles of a batch lie.
pub(super) struct Places {
    format: Format,
    blocks: [[u32; LANES]; ROWS],
    cells: [[u32; LANES]; ROWS],
    /// Which of them are in at most two cells an axis. The others are not found. Bits behind the
    /// last triangle mean nothing.
    pub(super) simple: u64,
    /// Which of these are in one block; none in a batch that is not full.
    pub(super) plain: u64,
    /// Which eights are plain and in the same block: bits of their first triangles.
    pub(super) runs: u64,
    /// How many lists the plain ones will be in.
    pub(super) lists: u32,
}

/// First and last quarters of cells on an axis, and the cells.
#[derive(Clone, Copy)]
struct Cells<S: Simd> {
    quarters: Span<S>,
    min: u32x8<S>,
    max: u32x8<S>,
}

impl<S: Simd> Cells<S> {
    #[inline(always)]
    fn of(quarters: Span<S>) -> Self {
        Self { quarters, min: quarters.first >> 2, max: quarters.last >> 2 }
    }

    /// Whether the second cell is in the next block: the lowest bit of
    /// the block's number then differs.
    #[inline(always)]
    fn straddles(self) -> u32x8<S> {
        ((self.min ^ self.max) >> 4) & 1
    }

    /// The first quarter and the last in a block, [`LAST`] bits apart: at either end two bits for
    /// the brick, two for the cell in it, two for the quarter.
    #[inline(always)]
    fn ends(self) -> u32x8<S> {
        (self.quarters.first & 63) | ((self.quarters.last & 63) << LAST)
    }
}

/// What an axis adds to the cells of an entry, if it is x: the bits for the cell and, apart from
/// them, those for the brick.
#[inline(always)]
fn inside<S: Simd>(ends: u32x8<S>) -> u32x8<S> {
    ((ends >> 2) & 0x3003) | ((ends & 0x3_0030) << 2)
}

/// What the entries of a triangle have in common, and the axes on which it straddles.
#[inline(always)]
pub(super) const fn straddling(entry: Entry) -> (Entry, u32) {
    let [id, cells] = entry.words();
    (Entry::of(id, cells & !(7 << STRADDLES)), cells >> STRADDLES)
}

impl Places {
    /// Of no triangles yet, for a mesh whose ids are written so.
    #[inline(always)]
    pub(super) const fn new(format: Format) -> Self {
        let none = [[0; LANES]; ROWS];
        Self { format, blocks: none, cells: none, simple: 0, plain: 0, runs: 0, lists: 0 }
    }

    /// Finds the places of `count` triangles from `first` on. Without `ENTRIES`, for who only
    /// counts, quarters and the cells inside their blocks are left out.
    ///
    /// What works on vectors is a function, always inlined: closures and arrays' own
    /// functions are not, and what is not inlined is not compiled for the level.
    #[inline(always)]
    pub(super) fn find<S: Simd, const ENTRIES: bool>(
        &mut self,
        simd: S,
        spans: &Spans<S>,
        [width, height, _]: [u32; 3],
        mesh: &WideMesh<'_>,
        first: u32,
        count: u32,
    ) {
        (self.simple, self.plain) = (0, 0);
        let none = u32x8::splat(simd, 0);
        let mut sum = none;
        let rows = self.blocks.iter_mut().zip(&mut self.cells);
        for (at, (blocks, cells)) in (0_u32..).step_by(LANES).zip(rows) {
            let ([x, y, z], is_finite) = spans.of(simd, mesh, first.wrapping_add(at));
            let [x, y, z] = [Cells::of(x), Cells::of(y), Cells::of(z)];
            let [two_x, two_y, two_z] = [x.max - x.min, y.max - y.min, z.max - z.min];
            let is_simple = (two_x | two_y | two_z).simd_le(u32x8::splat(simd, 1)) & is_finite;
            let straddles = x.straddles() | (y.straddles() << 1) | (z.straddles() << 2);
            let is_plain = straddles.simd_eq(none) & is_simple;

            let block = (x.min >> 4) + ((y.min >> 4) + (z.min >> 4) * height) * width;
            let group = two_x | (two_y << 1) | (two_z << 2);
            let place = (group << GROUP) | (straddles << STRADDLES);
            if ENTRIES {
                let ends = [x.ends(), y.ends(), z.ends()];
                let [x, y, z] = ends;
                let inside = inside(x) | (inside(y) << 2) | (inside(z) << 4);
                *blocks = (block | quarters(self.format, ends)).into();
                *cells = (place | inside).into();
            } else {
                (*blocks, *cells) = (block.into(), place.into());
            }

            // Twice as many lists for each axis with two cells.
            let lists = two_x + 1;
            let lists = lists + (lists & (none - two_y));
            let lists = lists + (lists & (none - two_z));
            sum += is_plain.select(lists, none);
            self.simple |= is_simple.to_bitmask() << at;
            self.plain |= is_plain.to_bitmask() << at;
        }
        let sum: [u32; LANES] = sum.into();
        self.lists = sum.iter().sum();
        self.runs = 0;
        if count < BATCH {
            // Those behind the last one are in the sum.
            (self.plain, self.lists) = (0, 0);
        } else {
            self.find_runs(simd);
        }
    }

    /// Finds runs, where there are many: elsewhere, a branch for them costs more than they save.
    ///
    /// Triangles that follow one another are often in the same block, and each waits for the count
    /// of the one before it.
    #[inline(always)]
    fn find_runs<S: Simd>(&mut self, simd: S) {
        const MANY: usize = ROWS * 3 / 4;
        let format = self.format;
        let is_likely = |row: &&[u32; LANES]| (row[0] ^ row[LANES - 1]) & format.ids() == 0;
        if self.blocks.iter().filter(is_likely).count() < MANY {
            return;
        }
        for (at, row) in (0_u32..).step_by(LANES).zip(&self.blocks) {
            let blocks = u32x8::simd_from(simd, *row) & format.ids();
            let is_same = blocks.simd_eq(u32x8::splat(simd, format.id(row[0])));
            let is_run = is_same.to_bitmask() & self.plain >> at & 0xff == 0xff;
            self.runs |= u64::from(is_run) << at;
        }
    }

    /// The first block of a triangle.
    #[inline(always)]
    pub(super) fn block(&self, at: u32) -> usize {
        self.format.id(self.blocks.as_flattened()[(at % BATCH) as usize]) as usize
    }

    /// The entry of a plain triangle; of a straddling one what [`straddling`] takes, of one that is
    /// not simple nothing of use.
    #[inline(always)]
    pub(super) fn entry(&self, at: u32, id: u32) -> Entry {
        let at = (at % BATCH) as usize;
        let (block, cells) = (self.blocks.as_flattened()[at], self.cells.as_flattened()[at]);
        Entry::of(id | block & self.format.quarters(), cells)
    }

    /// The entries of a run.
    #[inline(always)]
    pub(super) fn eight(&self, at: u32, id: u32) -> [Entry; LANES] {
        let entry = |lane| self.entry(at + lane, id + lane);
        [entry(0), entry(1), entry(2), entry(3), entry(4), entry(5), entry(6), entry(7)]
    }
}
