//! Where everything lies: the blocks, bricks, cells and lists of a
//! grid, and the scratch of a build.
//!
//! A block is 16 cells wide, a brick 4. A cell's number in its block is its brick's number and its
//! number in the brick, so that 64 numbers in a row are one occupancy mask:
//!
//! ```text
//! number  zz yy xx | zz yy xx
//!         brick      cell in the brick
//! ```

#![expect(
    clippy::cast_possible_truncation,
    reason = "at most 2^24 blocks and as many tasks as asked for"
)]

use bytemuck::{Pod, Zeroable};

use super::crowds::HEAD_WORDS;
use super::quarters::Format;
use crate::arena::{section_bytes, split_mut};
use crate::blob::HEADER_BYTES;

/// Cells of a block on each axis.
pub(super) const BLOCK: u32 = 16;
/// Bricks of a block, and cells of a brick.
pub(super) const MASK_BITS: usize = 64;
/// Cells of a block.
pub(super) const BLOCK_CELLS: usize = 4096;

/// What the index has of a block, and the pool of a cell that is divided like one.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Block {
    /// A bit for each brick that has anything; lower half, upper half.
    pub(super) mask: [u32; 2],
    /// Where its words start: in the pool for a block, behind the start of its block for a cell.
    pub(super) base: u32,
    /// Where the length of the list of primitives that belong to the whole block lies behind the
    /// start of the block, plus 1; 0 if there is none.
    pub(super) list: u32,
}

/// What the pool has of a brick.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Brick {
    /// A bit for each cell that has primitives.
    pub(super) mask: [u32; 2],
    /// Where the starts of its cells' lists lie, behind the start of the block.
    pub(super) cells: u32,
    /// Where the length of the list of primitives that belong to the whole
    /// brick lies, plus 1; 0 if none.
    pub(super) list: u32,
}

/// Words of a [`Block`] and of a [`Brick`].
pub(super) const RECORD_WORDS: usize = 4;
/// Words of a divided cell's record: a [`Block`], and its cells per axis.
pub(super) const CHILD_WORDS: usize = RECORD_WORDS + 1;

/// Both halves of a mask.
#[inline(always)]
pub(super) fn mask([low, high]: [u32; 2]) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

/// How many of a mask's bits lie below a bit.
#[inline(always)]
pub(super) const fn rank(mask: u64, bit: u32) -> usize {
    (mask & ((1 << bit) - 1)).count_ones() as usize
}

/// The number of a cell in its block, or with a shift of 2 that of a brick.
#[inline(always)]
pub(super) const fn number([x, y, z]: [u32; 3]) -> u32 {
    (x & 0xc) << 4 | (x & 3) | (y & 0xc) << 6 | (y & 3) << 2 | (z & 0xc) << 8 | (z & 3) << 4
}

/// The place of a cell in its block, from its number.
#[inline(always)]
pub(super) const fn place(number: u32) -> [u32; 3] {
    [
        (number >> 4 & 0xc) | (number & 3),
        (number >> 6 & 0xc) | (number >> 2 & 3),
        (number >> 8 & 0xc) | (number >> 4 & 3),
    ]
}

/// A triangle in a block: its id, what it is listed for, and its cells there.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Entry {
    /// And above it, if there is room, the quarters of its first and its last cell.
    id: u32,
    /// First and last cell in twelve bits each, then the class, then the group.
    cells: u32,
}

/// Words of an [`Entry`].
pub(super) const ENTRY_WORDS: usize = 2;

/// What lists a triangle: each of its cells, bricks or blocks, so that a large one is in few lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Class {
    /// Every cell it may touch.
    Cells = 0,
    /// Every brick.
    Bricks = 1,
    /// Every block.
    Blocks = 2,
}

impl Class {
    /// How far cells are shifted for what lists the class.
    #[inline(always)]
    pub(super) const fn shift(self) -> u32 {
        2 * self as u32
    }
}

impl Entry {
    /// A triangle with its cells in a block, both ends included and below 16; above the
    /// id its quarters, if there is room.
    #[inline(always)]
    pub(super) const fn new(id: u32, min: [u32; 3], max: [u32; 3], class: Class) -> Self {
        let [x, y, z] =
            [max[0].wrapping_sub(min[0]), max[1].wrapping_sub(min[1]), max[2].wrapping_sub(min[2])];
        let is_small = x | y | z <= 1 && matches!(class, Class::Cells);
        let group = if is_small { x | y << 1 | z << 2 } else { OTHERS };
        let cells = number(min) | number(max) << 12;
        Self { id, cells: cells | (class as u32) << 24 | group << GROUP }
    }

    /// An entry from its words.
    #[inline(always)]
    pub(super) const fn of(id: u32, cells: u32) -> Self {
        Self { id, cells }
    }

    /// The part in one of its blocks of an entry in two cells an axis: `straddles` are the axes on
    /// which the second cell is the first of the next block, `far`
    /// those on which this is the block.
    #[inline(always)]
    pub(super) const fn beside(self, straddles: u32, far: u32, format: Format) -> Self {
        /// The bits of each set of axes at either end.
        const ENDS: [u32; 8] = {
            let mut ends = [0; 8];
            let mut axes = 0;
            while axes < 8 {
                let mut axis = 0;
                while axis < 3 {
                    if axes >> axis & 1 == 1 {
                        ends[axes] |= AXES[axis] | AXES[axis] << 12;
                    }
                    axis += 1;
                }
                axes += 1;
            }
            ends
        };
        let near = ENDS[(straddles & !far & 7) as usize];
        let others = !(ENDS[(straddles & 7) as usize] | straddles << GROUP);
        let id = format.through(self.id, straddles & far, straddles & !far);
        Self { id, cells: self.cells & others | near }
    }

    /// Its words.
    #[inline(always)]
    pub(super) const fn words(self) -> [u32; ENTRY_WORDS] {
        [self.id, self.cells]
    }

    #[inline(always)]
    pub(super) const fn id(self, format: Format) -> u32 {
        format.id(self.id)
    }

    /// What a cell lists of it, if it is in the cell before that one on some axes, too, and
    /// in the one behind it on others.
    #[inline(always)]
    pub(super) const fn reference(self, format: Format, before: u32, behind: u32) -> u32 {
        format.through(self.id, before, behind)
    }

    #[inline(always)]
    pub(super) const fn class(self) -> Class {
        match self.cells >> 24 & 3 {
            0 => Class::Cells,
            1 => Class::Bricks,
            _ => Class::Blocks,
        }
    }

    /// The axes on which it is in two cells, a bit for each, if it is in cells and in no more than
    /// two on any; [`OTHERS`] if not.
    #[inline(always)]
    pub(super) const fn group(self) -> u32 {
        self.cells >> GROUP
    }

    /// How many lists it is in, if its group is not [`OTHERS`].
    #[inline(always)]
    pub(super) const fn lists(self) -> u64 {
        1 << (self.group() & 7).count_ones()
    }

    /// The number of the first cell.
    #[inline(always)]
    pub(super) const fn min(self) -> u32 {
        self.cells & 0xfff
    }

    /// The number of the last cell.
    #[inline(always)]
    pub(super) const fn max(self) -> u32 {
        self.cells >> 12 & 0xfff
    }
}

/// The bits of a cell's number that belong to each axis.
pub(super) const AXES: [u32; 3] = [0x0c3, 0x30c, 0xc30];

/// The first bit of [`Entry::group`].
pub(super) const GROUP: u32 = 26;
/// The group of entries that are not alike.
pub(super) const OTHERS: u32 = 8;

/// What is known of a grid's memory before its triangles are sorted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// Blocks per axis.
    pub(super) blocks: [u32; 3],
    /// Triangles in the fullest block.
    pub(super) fullest: u32,
}

/// How often a cell can be divided.
pub(super) const MAX_CHILDREN: usize = 2;
/// A cell with more triangles is divided if that separates them, or lets the next division do so.
pub(super) const CROWDED: u32 = 128;

/// Where a task sorts: a bench for blocks, and one for each depth of divided cells.
pub(super) type Benches<'s> = [Bench<'s>; 1 + MAX_CHILDREN];

/// Where one block after the other is sorted.
#[derive(Debug, Default)]
pub(super) struct Bench<'s> {
    /// For every cell its number of triangles, then where its next one goes.
    pub(super) cells: &'s mut [u32],
    /// The same for every brick.
    pub(super) bricks: &'s mut [u32],
    /// The cells that are divided.
    pub(super) divided: &'s mut [u64],
    /// The triangles.
    pub(super) entries: &'s mut [Entry],
    /// On the bench of a divided cell what the crowded cells around it list.
    pub(super) ids: &'s mut [u32],
}

impl<'s> Bench<'s> {
    fn take(scratch: &'s mut [u8], entries: u64, ids: u64) -> Option<(Self, &'s mut [u8])> {
        let (cells, rest) = split_mut(scratch, BLOCK_CELLS as u64)?;
        let (bricks, rest) = split_mut(rest, MASK_BITS as u64)?;
        let (divided, rest) = split_mut(rest, MASK_BITS as u64)?;
        let (entries, rest) = split_mut(rest, entries)?;
        let (ids, rest) = split_mut(rest, ids)?;
        Some((Self { cells, bricks, divided, entries, ids }, rest))
    }

    const fn bytes(entries: u64, ids: u64) -> u64 {
        section_bytes::<u32>(BLOCK_CELLS as u64)
            + section_bytes::<u32>(MASK_BITS as u64)
            + section_bytes::<u64>(MASK_BITS as u64)
            + section_bytes::<Entry>(entries)
            + section_bytes::<u32>(ids)
    }
}

impl Layout {
    /// The layout for so many cells per axis, if no block has more triangles than that.
    pub(super) const fn new(resolution: [u32; 3], fullest: u32) -> Self {
        let [x, y, z] = resolution;
        let blocks = [x.div_ceil(BLOCK), y.div_ceil(BLOCK), z.div_ceil(BLOCK)];
        Self { blocks, fullest }
    }

    /// The largest layout with so many blocks.
    pub(super) const fn largest(blocks: u64, triangles: u32) -> Self {
        let blocks = [blocks as u32, 1, 1];
        Self { blocks, fullest: triangles }
    }

    /// Number of blocks: at most 2^24.
    pub(super) const fn block_count(&self) -> u64 {
        self.blocks[0] as u64 * self.blocks[1] as u64 * self.blocks[2] as u64
    }

    /// Bytes before the pool.
    pub(super) const fn head_bytes(&self) -> u64 {
        HEADER_BYTES as u64 + section_bytes::<Block>(self.block_count())
    }

    /// Bytes of a blob with so many words in its pool.
    pub(super) const fn index_bytes(&self, words: u64) -> u64 {
        self.head_bytes() + section_bytes::<u32>(words)
    }

    /// Bytes of scratch for so many tasks: each has heads and benches.
    pub(super) const fn scratch_bytes(&self, tasks: u32) -> u64 {
        (tasks as u64).saturating_mul(self.heads_bytes() + self.benches_bytes())
    }

    /// How deep blocks of this grid may be divided, and the block itself.
    const fn depth(&self) -> usize {
        if self.fullest > CROWDED { 1 + MAX_CHILDREN } else { 1 }
    }

    /// Entries and ids of a bench: no cell lists more than the fullest block.
    const fn bench(&self, depth: usize) -> [u64; 2] {
        let entries = self.fullest as u64;
        [entries, if depth == 0 { 0 } else { entries + HEAD_WORDS as u64 }]
    }

    /// Bytes of the benches of one task.
    const fn benches_bytes(&self) -> u64 {
        let (mut bytes, mut depth) = (0, 0);
        while depth < self.depth() {
            let [entries, ids] = self.bench(depth);
            bytes += Bench::bytes(entries, ids);
            depth += 1;
        }
        bytes
    }

    /// Bytes of the heads of one task.
    const fn heads_bytes(&self) -> u64 {
        section_bytes::<u32>(self.block_count())
    }

    /// How many of so many tasks find room for their heads.
    pub(super) const fn tasks_in(&self, scratch: &[u8], tasks: u32) -> u32 {
        match (scratch.len() as u64).checked_div(self.heads_bytes()) {
            Some(room) if room < tasks as u64 => room as u32,
            _ => tasks,
        }
    }

    /// Cuts the heads from the scratch: for every task and block how many entries it
    /// has, then where the next one goes.
    pub(super) fn heads<'s, const N: usize>(
        &self,
        mut scratch: &'s mut [u8],
        tasks: u32,
    ) -> Option<([&'s mut [u32]; N], &'s mut [u8])> {
        let mut all: [&mut [u32]; N] = core::array::from_fn(|_| Default::default());
        for heads in all.iter_mut().take(tasks as usize) {
            (*heads, scratch) = split_mut(scratch, self.block_count())?;
        }
        Some((all, scratch))
    }

    /// Cuts the benches of as many of so many tasks as there is room for from the rest.
    pub(super) fn benches<'s, const N: usize>(
        &self,
        mut rest: &'s mut [u8],
        tasks: u32,
    ) -> ([Option<Benches<'s>>; N], &'s mut [u8]) {
        let bytes = usize::try_from(self.benches_bytes()).unwrap_or(usize::MAX);
        let mut all = [const { None }; N];
        for benches in all.iter_mut().take(tasks as usize) {
            if rest.len() < bytes {
                break;
            }
            let (mut part, behind) =
                core::mem::take(&mut rest).split_at_mut_checked(bytes).unwrap_or_default();
            rest = behind;
            let mut taken = Benches::default();
            for (depth, bench) in taken.iter_mut().enumerate().take(self.depth()) {
                let [entries, ids] = self.bench(depth);
                let Some((cut, behind)) = Bench::take(part, entries, ids) else { break };
                (*bench, part) = (cut, behind);
            }
            *benches = Some(taken);
        }
        (all, rest)
    }
}
