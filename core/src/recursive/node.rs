//! One grid of the recursion: seven words in the pool, then its entries.

use glam::Vec3A;

use crate::aabb::Aabb;
use crate::bump::GRID;
use crate::cell::{CellRange, as_f32, cells_between, row};
use crate::dda::{CellWalk, Line};
use crate::limits::MAX_RESOLUTION_OF_RECURSIVE;

pub(super) const HEAD_WORDS: usize = 7;
const RESOLUTION_BITS: u32 = (MAX_RESOLUTION_OF_RECURSIVE + 1).ilog2();

/// The content of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) enum NestedCell<'a> {
    /// Primitive ids, ascending.
    List(&'a [u32]),
    /// Start of its grid in the pool.
    Grid(usize),
}

/// A grid: where it lies and how finely it is cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GridNode {
    /// Start of its entries in the pool.
    entries: usize,
    /// Least corner, in cells of the root.
    pub(super) origin: [f32; 3],
    /// Cells of this grid for each cell of the root.
    pub(super) scale: [f32; 3],
    pub(super) resolution: [u32; 3],
}

impl GridNode {
    /// A grid whose words start at `at`.
    pub(super) fn new(at: usize, min: Vec3A, max: Vec3A, resolution: [u32; 3]) -> Self {
        let cells = Vec3A::from_array(resolution.map(as_f32));
        Self {
            entries: at.saturating_add(HEAD_WORDS),
            origin: min.to_array(),
            scale: (cells / (max - min)).to_array(),
            resolution,
        }
    }

    /// The outermost grid, whose cells are the unit of all others.
    pub(super) fn root(resolution: [u32; 3]) -> Self {
        Self::new(0, Vec3A::ZERO, Vec3A::from_array(resolution.map(as_f32)), resolution)
    }

    /// The head of its words.
    pub(super) fn head(&self) -> [u32; HEAD_WORDS] {
        let ([a, b, c], [d, e, f]) = (self.origin.map(f32::to_bits), self.scale.map(f32::to_bits));
        let [x, y, z] = self.resolution;
        [a, b, c, d, e, f, x | y << RESOLUTION_BITS | z << (2 * RESOLUTION_BITS)]
    }

    /// The grid whose words start at `at`; `None` if they cannot be one.
    #[inline]
    pub(super) fn open(pool: &[u32], at: usize) -> Option<Self> {
        let [a, b, c, d, e, f, cells] = *pool.get(at..)?.first_chunk::<HEAD_WORDS>()?;
        let axis = |shift: u32| cells >> shift & MAX_RESOLUTION_OF_RECURSIVE;
        let resolution = [axis(0), axis(RESOLUTION_BITS), axis(2 * RESOLUTION_BITS)];
        let node = Self {
            entries: at + HEAD_WORDS,
            origin: [a, b, c].map(f32::from_bits),
            scale: [d, e, f].map(f32::from_bits),
            resolution,
        };
        let end = node.entries.checked_add(node.cells())?;
        let is_sound = end < pool.len()
            && node.origin.iter().all(|o| o.is_finite())
            && node.scale.iter().all(|&s| s > 0.0 && s.is_finite())
            && !resolution.contains(&0);
        is_sound.then_some(node)
    }

    /// Number of cells.
    pub(super) fn cells(&self) -> usize {
        self.resolution.iter().map(|&cells| cells as usize).product()
    }

    /// Returns the start of its cells' contents in the pool.
    pub(super) fn contents(&self) -> usize {
        self.entries.saturating_add(self.cells()).saturating_add(1)
    }

    /// Returns the start of a cell's content in the pool, or the end of the last one if the number is one too many.
    pub(super) fn start(&self, pool: &[u32], number: usize) -> Option<usize> {
        Some((pool.get(self.entries.checked_add(number)?)? & !GRID) as usize)
    }

    /// The box of a cell, in cells of the root.
    pub(super) fn cell_box(&self, cell: [u32; 3]) -> Aabb {
        let size = 1.0 / Vec3A::from_array(self.scale);
        let min = Vec3A::from_array(self.origin) + Vec3A::from_array(cell.map(as_f32)) * size;
        Aabb { min, max: min + size }
    }

    /// A walk through this grid along a line of the root, from `entered` or where it enters.
    #[inline]
    pub(super) fn walk(&self, line: &Line, entered: f32) -> Option<CellWalk> {
        line.zoom(self.origin, self.scale).walk_in(entered, self.resolution)
    }

    /// The cells that a box meets, given in cells of the root.
    pub(super) fn range(&self, reach: &Aabb) -> CellRange {
        let (origin, scale) = (Vec3A::from_array(self.origin), Vec3A::from_array(self.scale));
        let within = |position: Vec3A| (position - origin) * scale;
        cells_between(Aabb { min: within(reach.min), max: within(reach.max) }, self.resolution)
    }

    /// Returns the content of a cell; `None` if it is empty.
    #[inline(always)]
    pub(super) fn content<'a>(
        &self,
        pool: &'a [u32],
        [x, y, z]: [u32; 3],
    ) -> Option<NestedCell<'a>> {
        let [width, height, _] = self.resolution;
        let cell = row(height, y, z) * width as usize + x as usize;
        let ends = pool.get(self.entries.checked_add(cell)?..)?.first_chunk::<2>()?;
        let (start, end) = ((ends[0] & !GRID) as usize, (ends[1] & !GRID) as usize);
        if ends[0] & GRID != 0 {
            Some(NestedCell::Grid(start))
        } else if start < end {
            pool.get(start..end).map(NestedCell::List)
        } else {
            None
        }
    }
}
