//! The walk of one ray: from block to block, in full ones from brick to
//! brick, in full ones from cell to cell.

use fearless_simd::Simd;
use glam::Vec3A;

use super::layout::{BLOCK, mask, number};
use super::quarters::{Format, Missed};
use super::{Brick, Chunk, Content, Large};
use crate::cell::as_f32;
use crate::counters::Tally;
use crate::dda::{Line, NEVER, Step, Walk};
use crate::eight::{LANES, first_eight};
use crate::mesh::TriangleMesh;
use crate::search::{Outcome, Search};
use crate::simd::{HAS_VECTORS, Kernel};
use crate::triangle::TriangleTest;

/// A ray on its way, and what it is traced through.
#[derive(Debug)]
pub(crate) struct OneRay<'q, F, T> {
    brick: &'q Brick<'q>,
    mesh: &'q TriangleMesh<'q>,
    line: &'q Line,
    test: &'q TriangleTest,
    search: &'q mut F,
    tally: &'q mut T,
    format: Format,
    /// The distance at which the ray now ends.
    limit: f32,
    /// A ray meets every list at most once; damaged bytes may list everything in every cell.
    unread: usize,
}

/// A block, or a divided cell.
#[derive(Clone, Copy)]
struct Part<'a, 'l> {
    chunk: Chunk<'a>,
    line: &'l Line,
    /// Its first cell on the line's axes.
    corner: [u32; 3],
    /// Its last one.
    last: [u32; 3],
    /// The distances at which the line leaves it.
    exits: Vec3A,
    /// How often it may be divided: damaged bytes may say for ever.
    depth: u32,
}

// By reference: a copy, written as it is put together and read in
// larger pieces, would be waited for.
impl<F: Search, T: Tally> Kernel for &mut OneRay<'_, F, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        self.blocks(simd);
    }
}

impl<'q, F: Search, T: Tally> OneRay<'q, F, T> {
    /// A ray that was brought to the grid's box.
    #[inline(always)]
    pub(crate) const fn new(
        brick: &'q Brick<'q>,
        mesh: &'q TriangleMesh<'q>,
        line: &'q Line,
        test: &'q TriangleTest,
        search: &'q mut F,
        tally: &'q mut T,
    ) -> Self {
        let (format, limit, unread) = (brick.format, line.end, brick.list_words());
        Self { brick, mesh, line, test, search, tally, format, limit, unread }
    }

    /// Walks from block to block.
    #[inline(always)]
    fn blocks<S: Simd>(&mut self, simd: S) {
        let brick = self.brick;
        let large = brick.large();
        if !large.is_empty() {
            self.test(simd, large, Missed::NONE);
            if self.is_over() {
                return;
            }
        }
        let line = self.line;
        let last = brick.width.map(|blocks| blocks - 1);
        let mut walk = line.walk(0.0, as_f32(BLOCK), [0; 3], last, NEVER);
        loop {
            self.tally.cell_step();
            if let Some(chunk) = brick.block(walk.cell()) {
                if let Some(large) = chunk.large() {
                    let corner = walk.cell().map(|block| as_f32(block * BLOCK));
                    self.test_large(simd, &large, line, corner);
                }
                if chunk.mask != 0 && !self.is_over() {
                    let corner = walk.cell().map(|block| block * BLOCK);
                    let last =
                        core::array::from_fn(|axis| (corner[axis] + 15).min(brick.last[axis]));
                    let part = Part { chunk, line, corner, last, exits: walk.next, depth: 2 };
                    self.part(simd, &part, walk.entered);
                }
            }
            if walk.advance(self.limit) != Step::Inside {
                return;
            }
        }
    }

    /// Walks from brick to brick, from a distance on.
    #[inline(always)]
    fn part<S: Simd>(&mut self, simd: S, part: &Part<'_, '_>, from: f32) {
        let Part { chunk, line, corner, last, exits, .. } = *part;
        self.tally.grid_step();
        let mut walk = line.walk(from, 4.0, corner.map(|c| c >> 2), last.map(|c| c >> 2), exits);
        loop {
            self.tally.cell_step();
            let bit = number(walk.cell().map(|brick| (brick & 3) << 2)) >> 6;
            if chunk.mask >> bit & 1 != 0
                && let Some(brick) = chunk.brick(bit)
            {
                if let Some(large) = chunk.large_of(&brick, bit) {
                    self.test_large(simd, &large, line, corner.map(as_f32));
                }
                if mask(brick.mask) != 0 && !self.is_over() {
                    self.cells(simd, part, &brick, &walk);
                }
            }
            if walk.advance(self.limit) != Step::Inside {
                return;
            }
        }
    }

    /// Walks from cell to cell of the brick that a walk is in.
    #[inline(always)]
    fn cells<S: Simd>(
        &mut self,
        simd: S,
        part: &Part<'_, '_>,
        brick: &super::layout::Brick,
        around: &Walk,
    ) {
        let Part { chunk, line, last, depth, .. } = *part;
        self.tally.grid_step();
        let min = around.cell().map(|at| at << 2);
        let max = core::array::from_fn(|axis| (min[axis] + 3).min(last[axis]));
        let mut walk = line.walk(around.entered, 1.0, min, max, around.next);
        loop {
            self.tally.cell_step();
            let bit = number(walk.cell().map(|cell| cell & 3));
            if mask(brick.mask) >> bit & 1 != 0 {
                match chunk.content(brick, bit) {
                    Some(Content::List(references)) => {
                        // Four take one read, however many are missed. Without vectors they do not,
                        // but the counters are the same everywhere.
                        let missed = if references.len() > LANES / 2 {
                            self.missed(line, &walk)
                        } else {
                            Missed::NONE
                        };
                        self.test(simd, references, missed);
                    }
                    Some(Content::Chunk(chunk, cells)) if depth > 0 => {
                        let line = line.zoom(walk.cell().map(as_f32), [as_f32(cells); 3]);
                        let (corner, last, exits) = ([0; 3], [cells - 1; 3], walk.next);
                        let depth = depth - 1;
                        let part = Part { chunk, line: &line, corner, last, exits, depth };
                        self.divided(simd, &part, walk.entered);
                    }
                    _ => {}
                }
            }
            if walk.advance(self.limit) != Step::Inside {
                return;
            }
        }
    }

    /// Walks through a divided cell. It is one of [`cells`](Self::cells) that calls it, so it is
    /// not inlined and says once more what vectors it is compiled for.
    fn divided<S: Simd>(&mut self, simd: S, part: &Part<'_, '_>, from: f32) {
        simd.vectorize(
            #[inline(always)]
            || {
                if let Some(large) = part.chunk.large() {
                    self.test_large(simd, &large, part.line, [0.0; 3]);
                }
                if let Some(walk) = part.line.walk_in(from, part.last.map(|last| last + 1)) {
                    self.part(simd, part, walk.entered);
                }
            },
        );
    }

    /// Tests the ray against the triangles of a brick or a chunk that begins at a
    /// corner, if it comes near them.
    #[inline(always)]
    fn test_large<S: Simd>(&mut self, simd: S, large: &Large<'_>, line: &Line, corner: [f32; 3]) {
        if line.meets(&large.extent.reach(large.owner), corner, self.limit) {
            self.test(simd, large.ids, Missed::NONE);
        }
    }

    /// What the ray does not meet in the cell that a walk is in.
    #[inline(always)]
    fn missed(&self, line: &Line, walk: &Walk) -> Missed {
        let far = walk.next.min_element().min(self.limit);
        self.format.missed(line.quarters(walk.cell(), walk.entered, far))
    }

    /// Tests the ray against the triangles of a list, but for those that it misses.
    ///
    /// Out of line, or it would be several times in the walk; so it says once more
    /// what vectors it is compiled for.
    fn test<S: Simd>(&mut self, simd: S, references: &[u32], missed: Missed) {
        simd.vectorize(
            #[inline(always)]
            || {
                let Some(rest) = self.unread.checked_sub(references.len()) else {
                    self.limit = f32::NEG_INFINITY;
                    return;
                };
                self.unread = rest;
                if missed == Missed::NONE {
                    self.test_all(simd, references);
                } else {
                    self.test_some(simd, references, missed);
                }
            },
        );
    }

    #[inline(always)]
    fn test_all<S: Simd>(&mut self, simd: S, references: &[u32]) {
        for some in references.chunks(LANES) {
            let ids = first_eight(some).map(
                #[inline(always)]
                |reference| self.format.id(reference),
            );
            self.test_eight(simd, &ids, some.len());
            if self.is_over() {
                return;
            }
        }
    }

    #[inline(always)]
    fn test_some<S: Simd>(&mut self, simd: S, references: &[u32], missed: Missed) {
        /// References that are looked at in one go.
        const MOST: usize = 4 * LANES;
        for some in references.chunks(MOST) {
            // No branch tells who is missed: it would be as good as random.
            let any = self.format.id(some.first().copied().unwrap_or(0));
            let (mut ids, mut count) = ([any; MOST + LANES], 0);
            let mut take = |reference: u32, is_met: bool| {
                ids[count % MOST] = self.format.id(reference);
                count += usize::from(is_met);
            };
            let (eights, rest) =
                if HAS_VECTORS { some.as_chunks::<LANES>() } else { (&[][..], some) };
            for eight in eights {
                let others = missed.others(simd, *eight);
                for (lane, &reference) in (0_u32..).zip(eight) {
                    take(reference, others >> lane & 1 != 0);
                }
            }
            for &reference in rest {
                take(reference, !missed.contains(reference));
            }
            // What fills up the last eight is read, too: not one that was missed, far away in memory.
            let met = ids[0];
            if let Some(rest) = ids.get_mut(count..).and_then(|rest| rest.first_chunk_mut()) {
                *rest = [met; LANES];
            }
            for first in (0..count).step_by(LANES) {
                let Some(eight) = ids.get(first..).and_then(|ids| ids.first_chunk()) else { break };
                self.test_eight(simd, eight, count - first);
                if self.is_over() {
                    return;
                }
            }
        }
    }

    /// Tests the ray against the first `count` of eight triangles; the others may be read, too.
    #[inline(always)]
    fn test_eight<S: Simd>(&mut self, simd: S, ids: &[u32; LANES], count: usize) {
        self.tally.primitive_tests(count.min(LANES));
        let mut survivors = self.test.survivors_of(simd, self.mesh, ids, count);
        while survivors != 0 {
            let lane = survivors.trailing_zeros() as usize;
            survivors &= survivors - 1;
            let Some(&id) = ids.get(lane) else { break };
            match self.search.decide(self.test, self.mesh, id) {
                Outcome::Unchanged => {}
                Outcome::EndsAt(t) => self.limit = self.line.distance(t),
                Outcome::Done => {
                    self.limit = f32::NEG_INFINITY;
                    return;
                }
            }
        }
    }

    /// Whether the search is.
    #[inline(always)]
    const fn is_over(&self) -> bool {
        self.limit == f32::NEG_INFINITY
    }
}
