//! Where in its brick or chunk the triangles of a list lie.
//!
//! The list of a cell is for whoever crosses the cell. That of a brick or a chunk has triangles
//! which many rays pass at a distance: along a wall, above the ground. So it begins with their box:
//!
//! ```text
//! list | first | last | count | ids |
//!      first, last: x, y, z in ten bits each, in 1024ths of the brick or of 16 cells of the chunk
//! ```

use bytemuck::{Pod, Zeroable};
use glam::Vec3A;

use super::frame::{Frame, Scene};
use super::layout::{BLOCK, place};
use crate::aabb::Aabb;
use crate::cell::{as_f32, cells_between};

/// Words before the ids of a list: its extent, and how many there are.
pub(super) const LIST_WORDS: usize = EXTENT_WORDS + 1;
pub(super) const EXTENT_WORDS: usize = 2;

/// Parts of a brick, or of a chunk, on each axis.
const PARTS: u32 = 1 << BITS;
const BITS: u32 = 10;

/// The parts on each axis in which triangles lie, both ends included.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Extent {
    first: u32,
    last: u32,
}

/// What has a list: a brick, by its number, or all of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Owner {
    /// A brick.
    Brick(u32),
    /// A chunk.
    Chunk,
}

impl Owner {
    /// Its first cell in the chunk, and the cells on an axis.
    #[inline(always)]
    const fn cells(self) -> ([u32; 3], u32) {
        match self {
            Self::Brick(number) => {
                let [x, y, z] = place(number);
                ([x << 2, y << 2, z << 2], 4)
            }
            Self::Chunk => ([0; 3], BLOCK),
        }
    }
}

impl Extent {
    /// That of some triangles in a part of a frame.
    pub(super) fn of(scene: &Scene<'_>, frame: &Frame, owner: Owner, ids: &[u32]) -> Self {
        let (corner, cells) = owner.cells();
        let (corner, unit) = (Vec3A::from_array(corner.map(as_f32)), as_f32(PARTS / cells));
        let (mut first, mut last) = ([PARTS - 1; 3], [0; 3]);
        for reach in ids.iter().filter_map(|&id| scene.reach(id)) {
            let reach = frame.zoom(&reach);
            let parts = Aabb { min: (reach.min - corner) * unit, max: (reach.max - corner) * unit };
            let range = cells_between(parts, [PARTS; 3]);
            for axis in 0..3 {
                first[axis] = range.min[axis].min(first[axis]);
                last[axis] = range.max[axis].max(last[axis]);
            }
        }
        Self { first: pack(first), last: pack(last) }
    }

    /// Its words.
    pub(super) const fn words(self) -> [u32; EXTENT_WORDS] {
        [self.first, self.last]
    }

    /// The box, in cells of the chunk.
    #[inline(always)]
    pub(super) fn reach(self, owner: Owner) -> Aabb {
        let (corner, cells) = owner.cells();
        let (corner, part) = (Vec3A::from_array(corner.map(as_f32)), as_f32(cells) / as_f32(PARTS));
        let (first, last) = (unpack(self.first).map(as_f32), unpack(self.last).map(as_f32));
        let (first, last) = (Vec3A::from_array(first), Vec3A::from_array(last) + 1.0);
        Aabb { min: corner + first * part, max: corner + last * part }
    }

    /// The first and the last cell of the chunk on each axis.
    #[inline(always)]
    pub(super) fn cells(self, owner: Owner) -> [[u32; 2]; 3] {
        let (corner, cells) = owner.cells();
        let shift = (PARTS / cells).trailing_zeros();
        let (first, last) = (unpack(self.first), unpack(self.last));
        core::array::from_fn(|axis| {
            [corner[axis] + (first[axis] >> shift), corner[axis] + (last[axis] >> shift)]
        })
    }
}

const fn pack([x, y, z]: [u32; 3]) -> u32 {
    x | y << BITS | z << (2 * BITS)
}

#[inline(always)]
const fn unpack(parts: u32) -> [u32; 3] {
    [parts & (PARTS - 1), parts >> BITS & (PARTS - 1), parts >> (2 * BITS) & (PARTS - 1)]
}
