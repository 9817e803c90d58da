//! Bundles of rays on their way through the grid together, slice by slice.
//!
//! The axis that the rays run along fastest becomes k. Between two planes of k, one cell apart, a
//! ray stays in a rectangle of u and v; where a cell that lists something meets rectangles, its
//! triangles are tested: against those rays if they are few, against all that may meet a triangle
//! if they are many ([`hits`](super::hits)). Along k there is nothing to search and no order to
//! keep but that of the slices: a ray is done when its closest hit lies before the next.
//!
//! ```text
//! k ->   | block slice: 16 cells | ...        per slice, from the bounds of all rays: which blocks,
//!        | | | |  brick slices               which bricks, which cells have anything
//!        |||||    cell slices                 per cell: which rays meet it, 64 at a time
//!
//! u  ----.____                               bounds: all rays lie between two chords, from the
//!    ----.    '----.____                     extremes on the first plane to those on the last
//! ```

use fearless_simd::Simd;

use super::bundle::{Bundle, RAYS, WIDTH};
use super::chords::{Bounds, Extremes};
use super::hits::{List, Tests, count_of};
use super::layout::{BLOCK, mask as mask_of, place};
use super::reach::Reach;
use super::view::{LAYERS, Part, View, layer};
use super::{Brick, Content, Large};
use crate::aabb::{greater, lesser};
use crate::bits::ones;
use crate::cell::{as_f32, whole};
use crate::mesh::TriangleMesh;

/// The most cells that rays may be apart.
const WIDEST: f32 = 64.0;

/// Bundles on their way through a grid together.
#[derive(Debug)]
pub(super) struct March<'t, 'a, const ANY: bool, const N: usize> {
    pub(super) brick: &'a Brick<'a>,
    pub(super) mesh: &'a TriangleMesh<'a>,
    pub(super) bundles: &'t mut [Bundle; N],
    pub(super) reach: &'t mut [[Reach; 2]; N],
    pub(super) tests: &'t mut Tests,
    /// Work that may still be done, about a primitive for a ray: damaged bytes may
    /// list everything in every cell.
    pub(super) unread: u64,
}

impl<'a, const ANY: bool, const N: usize> March<'_, 'a, ANY, N> {
    /// What all bundles have in common.
    #[inline(always)]
    fn leader(&self) -> &Bundle {
        const { assert!(N > 0) };
        &self.bundles[0]
    }

    /// Goes through the grid; `false` if the rays are too far apart for it.
    #[inline(always)]
    pub(super) fn go<S: Simd>(&mut self, simd: S) -> bool {
        let brick = self.brick;
        let leader = self.leader();
        let ([u, v, k], is_mirrored, width, margin) =
            (leader.axes(), leader.is_mirrored, leader.width, leader.margin);
        // Where the rays are inside on k; what the last block has too many is at its beginning if
        // k is mirrored.
        let depth = as_f32(brick.last[k] + 1);
        let inside = if is_mirrored { [width - depth, width] } else { [0.0, depth] };
        let mut planes = [f32::INFINITY, f32::NEG_INFINITY];
        for bundle in &*self.bundles {
            let (first, last) = bundle.ends(simd);
            planes = [lesser(planes[0], first), greater(planes[1], last)];
        }
        let planes = [greater(planes[0], inside[0]), lesser(planes[1], inside[1])];
        if planes[0] > planes[1] {
            return true;
        }
        let mut extremes = Extremes::NONE;
        for bundle in &*self.bundles {
            extremes = extremes.and(&bundle.extremes(simd, planes, 0..RAYS / WIDTH));
        }
        if !extremes.are_within(WIDEST) {
            return false;
        }
        let bounds = Bounds::around(planes, &extremes);
        self.unread = brick.list_words() as u64 * (RAYS * N) as u64;
        self.tests.clear(planes, bounds);
        for bundle in &mut *self.bundles {
            bundle.alive = bundle.members;
        }
        let large = brick.large();
        if !large.is_empty() {
            self.test(simd, large, [u64::MAX; N]);
        }

        let slice = |plane: f32| whole(plane) / BLOCK;
        for step in slice(planes[0])..=slice(planes[1]).min(brick.width[k] - 1) {
            let corner = as_f32(step * BLOCK);
            let planes = [corner.max(planes[0]), (corner + as_f32(BLOCK)).min(planes[1])];
            if self.left([u64::MAX; N]) == [0; N] {
                return true;
            }
            // Which bricks of which blocks lie beside each other on u and v.
            let bricks = |side: usize, axis: usize| {
                let (size, count) = (as_f32(BLOCK / 4), 4 * brick.width[axis]);
                bounds.cells(side, planes, size, count, margin)
            };
            let (Some(us), Some(vs)) = (bricks(0, u), bricks(1, v)) else { continue };
            for bundle in &mut *self.bundles {
                bundle.outlive(simd, planes[0]);
            }
            for at_v in vs[0] / 4..=vs[1] / 4 {
                for at_u in us[0] / 4..=us[1] / 4 {
                    let mut block = [0; 3];
                    block[u] = at_u;
                    block[v] = at_v;
                    block[k] = if is_mirrored { brick.width[k] - 1 - step } else { step };
                    let Some(chunk) = brick.block(block) else { continue };
                    let bricks = chunk.mask & layer(u, 4 * at_u, us) & layer(v, 4 * at_v, vs);
                    if bricks == 0 && chunk.list == 0 {
                        continue;
                    }
                    let corner = [as_f32(at_u * BLOCK), as_f32(at_v * BLOCK), corner];
                    let part = Part { chunk, bricks, corner, scale: 1.0, cells: BLOCK, depth: 2 };
                    self.through(simd, &part);
                }
            }
        }
        true
    }

    /// Goes through a part of the grid. It is part of itself where cells are divided, so it is not
    /// inlined and says once more what vectors it is compiled for.
    #[inline(never)]
    fn through<S: Simd>(&mut self, simd: S, part: &Part<'a>) {
        simd.vectorize(
            #[inline(always)]
            || {
                let view = View::new(self.leader(), self.tests.bounds, part);
                if let Some(large) = part.chunk.large() {
                    self.test_large(simd, &view, &large);
                }
                let slices = part.cells.div_ceil(4);
                for step in 0..slices {
                    self.bricks(simd, &view, view.in_order(step, slices));
                }
            },
        );
    }

    /// Goes through a slice of bricks.
    #[inline(always)]
    fn bricks<S: Simd>(&mut self, simd: S, view: &View<'a>, slice: u32) {
        let Part { chunk, bricks, cells, .. } = view.part;
        let [u, v, k] = view.axes();
        let in_slice = bricks & LAYERS[k][slice as usize & 3][slice as usize & 3];
        if in_slice == 0 {
            return;
        }
        let run = [4 * slice, (4 * slice + 4).min(cells)];
        let Some([us, vs]) = view.cells(run) else { return };
        let bricks = in_slice
            & layer(u, 0, us.map(|cell| cell >> 2))
            & layer(v, 0, vs.map(|cell| cell >> 2));
        if bricks == 0 || view.between(simd, self.bundles, run) == [0; N] {
            return;
        }
        let mut all_cells = 0;
        for bit in ones(bricks) {
            let Some(brick) = chunk.brick(bit) else { continue };
            all_cells |= mask_of(brick.mask);
            if let Some(large) = chunk.large_of(&brick, bit) {
                self.test_large(simd, view, &large);
            }
        }
        for step in 0..run[1] - run[0] {
            let cell = run[0] + view.in_order(step, run[1] - run[0]);
            if all_cells & LAYERS[k][cell as usize & 3][cell as usize & 3] != 0 {
                self.cells(simd, view, bricks, cell);
            }
        }
    }

    /// Goes through a slice of cells, those of some bricks.
    #[inline(always)]
    fn cells<S: Simd>(&mut self, simd: S, view: &View<'a>, bricks: u64, slice: u32) {
        let Part { chunk, depth, .. } = view.part;
        let [u, v, k] = view.axes();
        let run = [slice, slice + 1];
        let alive = view.between(simd, self.bundles, run);
        let Some([us, vs]) = view.cells(run).filter(|_| alive != [0; N]) else { return };
        let in_slice = LAYERS[k][slice as usize & 3][slice as usize & 3];
        let planes = view.planes(run);
        let mut is_reach_known = false;
        for bit in ones(bricks) {
            let Some(brick) = chunk.brick(bit) else { continue };
            let at = place(bit).map(|brick| 4 * brick);
            let cells = mask_of(brick.mask) & in_slice & layer(u, at[u], us) & layer(v, at[v], vs);
            if cells == 0 {
                continue;
            }
            for bit in ones(cells) {
                if !is_reach_known {
                    self.reach(simd, view, run);
                    is_reach_known = true;
                }
                let inside = place(bit);
                let [cell_u, cell_v] = [at[u] + inside[u], at[v] + inside[v]];
                let mut rays = alive;
                for (rays, [in_u, in_v]) in rays.iter_mut().zip(&*self.reach) {
                    *rays &= in_u.meets(simd, cell_u) & in_v.meets(simd, cell_v);
                }
                if rays == [0; N] {
                    continue;
                }
                match chunk.content(&brick, bit) {
                    Some(Content::List(references)) => self.test(simd, references, rays),
                    Some(Content::Chunk(chunk, cells)) if depth > 0 => {
                        let corner = view.corner([as_f32(cell_u), as_f32(cell_v), planes[0]]);
                        let (scale, depth) = (view.part.scale * as_f32(cells), depth - 1);
                        // Entering costs, too: damaged bytes may divide every cell.
                        self.spend((RAYS * N) as u64 * u64::from(1 + chunk.mask.count_ones()));
                        let bricks = chunk.mask;
                        self.through(simd, &Part { chunk, bricks, corner, scale, cells, depth });
                        is_reach_known = false;
                    }
                    _ => {}
                }
            }
        }
    }

    /// Tests the triangles of a brick or of all of a part, if the rays together come near the cells
    /// where they lie. Which of them do is not asked: that costs more than it spares.
    #[inline(always)]
    fn test_large<S: Simd>(&mut self, simd: S, view: &View<'a>, large: &Large<'a>) {
        let last = view.part.cells - 1;
        let cells = large.extent.cells(large.owner).map(|ends| ends.map(|cell| cell.min(last)));
        let [u, v, k] = view.axes();
        let run = [cells[k][0], cells[k][1] + 1];
        let alive = view.between(simd, self.bundles, run);
        let Some([us, vs]) = view.cells(run).filter(|_| alive != [0; N]) else { return };
        let overlap = |[a, b]: [u32; 2], [low, high]: [u32; 2]| a <= high && low <= b;
        if !(overlap(us, cells[u]) && overlap(vs, cells[v])) {
            return;
        }
        self.test(simd, large.ids, alive);
    }

    /// Sets what each ray may meet beside some cells on k.
    ///
    /// Out of line like [`through`](Self::through), where it would be three times.
    #[inline(never)]
    fn reach<S: Simd>(&mut self, simd: S, view: &View<'a>, run: [u32; 2]) {
        simd.vectorize(
            #[inline(always)]
            || {
                let planes = view.in_lattice(view.planes(run));
                let Part { corner, scale, .. } = view.part;
                for ([u, v], bundle) in self.reach.iter_mut().zip(&*self.bundles) {
                    u.set(bundle, 0, planes, |at| (at - corner[0]) * scale, view.margin);
                    v.set(bundle, 1, planes, |at| (at - corner[1]) * scale, view.margin);
                }
            },
        );
    }

    /// Pays for work; who cannot is done: only damaged bytes ask for so much.
    #[inline(always)]
    fn spend(&mut self, work: u64) {
        match self.unread.checked_sub(work) {
            Some(rest) => self.unread = rest,
            None => self.bundles.iter_mut().for_each(|bundle| bundle.members = 0),
        }
    }

    /// Those of some rays that are members and still look for a hit.
    #[inline(always)]
    fn left(&self, mut rays: [u64; N]) -> [u64; N] {
        for (rays, bundle) in rays.iter_mut().zip(&*self.bundles) {
            *rays &= bundle.members;
        }
        rays
    }

    /// Tests rays against the triangles of a list.
    #[inline(always)]
    fn test<S: Simd>(&mut self, simd: S, references: &[u32], rays: [u64; N]) {
        let rays = self.left(rays);
        // Only damaged bytes have an empty list; to look at it costs, too.
        self.spend(references.len().max(1) as u64 * u64::from(count_of(&rays)));
        let rays = self.left(rays);
        if rays != [0; N] {
            let list = List { references, format: self.brick.format, mesh: self.mesh };
            self.tests.test::<S, ANY, N>(simd, self.bundles, list, rays);
        }
    }
}
