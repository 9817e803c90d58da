//! Where a triangle belongs: its cells in a block or a divided cell, their quarters, and which lists
//! take it.

use glam::Vec3A;

use super::layout::{BLOCK, Class};
use super::quarters::{Format, Quarters};
use crate::aabb::Aabb;
use crate::cell::{CellRange, Lattice, as_f32, cells_between};
use crate::mesh::TriangleMesh;

/// The mesh in its lattice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scene<'m> {
    pub(super) mesh: &'m TriangleMesh<'m>,
    pub(super) lattice: &'m Lattice,
}

impl Scene<'_> {
    /// How the mesh's ids are written.
    #[inline(always)]
    pub(super) const fn format(&self) -> Format {
        Format::of(self.mesh.triangle_count())
    }

    /// The box of a triangle in cells of the lattice, grown by the margin.
    #[inline(always)]
    pub(super) fn reach(&self, id: u32) -> Option<Aabb> {
        let bounds = self.mesh.corners(id).and_then(Aabb::of)?;
        Some(self.lattice.reach(&bounds))
    }
}

/// The cells that a block, or a divided cell, is cut into, measured in cells of the lattice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// The first corner.
    pub(super) origin: Vec3A,
    /// Cells of the frame in one of the lattice.
    pub(super) scale: f32,
    /// Cells per axis.
    pub(super) cells: u32,
}

impl Frame {
    /// The frame of a block.
    pub(super) fn of_block(block: [u32; 3]) -> Self {
        let origin = Vec3A::from_array(block.map(|at| as_f32(at * BLOCK)));
        Self { origin, scale: 1.0, cells: BLOCK }
    }

    /// The frame of one of its cells, cut into so many again.
    pub(super) fn child(&self, cell: [u32; 3], cells: u32) -> Self {
        let corner = Vec3A::from_array(cell.map(as_f32));
        Self { origin: self.origin + corner / self.scale, scale: self.scale * as_f32(cells), cells }
    }

    /// A box in cells of the lattice, in those of the frame.
    pub(super) fn zoom(&self, reach: &Aabb) -> Aabb {
        let zoom = |point: Vec3A| (point - self.origin) * self.scale;
        Aabb { min: zoom(reach.min), max: zoom(reach.max) }
    }

    /// The cells of the frame that a box in cells of the lattice overlaps,
    /// and the quarters of the outermost.
    pub(super) fn range(&self, reach: &Aabb) -> (CellRange, Quarters) {
        range(self.zoom(reach), [self.cells; 3])
    }
}

/// The cells that a box overlaps which is given in cells; those at the border if it lies outside.
/// And the quarters in which it begins and ends.
#[inline(always)]
pub(super) fn range(reach: Aabb, resolution: [u32; 3]) -> (CellRange, Quarters) {
    let quarters = Aabb { min: reach.min * 4.0, max: reach.max * 4.0 };
    let CellRange { min, max } = cells_between(quarters, resolution.map(|cells| 4 * cells));
    let range = CellRange { min: min.map(|first| first >> 2), max: max.map(|last| last >> 2) };
    (range, Quarters::new(min, max))
}

/// How many cells hold a triangle with these first and last cells, or with
/// a shift of 2 bricks, of 4 blocks.
#[inline(always)]
pub(super) fn lists(min: [u32; 3], max: [u32; 3], shift: u32) -> u64 {
    let along = |axis: usize| u64::from((max[axis] >> shift) - (min[axis] >> shift)) + 1;
    along(0) * along(1) * along(2)
}

/// Which lists take a triangle with these cells; `None` if it would be in too many blocks.
#[inline(always)]
pub(super) fn classify(min: [u32; 3], max: [u32; 3], most_blocks: u64) -> Option<Class> {
    let [x, y, z] = core::array::from_fn(|axis| max[axis].wrapping_sub(min[axis]));
    if x | y | z <= 1 || lists(min, max, 0) <= MOST_LISTS {
        Some(Class::Cells)
    } else if lists(min, max, 2) <= MOST_LISTS {
        Some(Class::Bricks)
    } else {
        (lists(min, max, 4) <= most_blocks).then_some(Class::Blocks)
    }
}

/// The most cells, or bricks, that list a triangle.
pub(super) const MOST_LISTS: u64 = 32;
/// The most blocks.
pub(super) const MOST_BLOCKS: u64 = 512;
