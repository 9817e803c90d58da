//! Sorting the triangles of one block into its cells, all of it in the first cache.
//!
//! ```text
//! collect  entries with the same number of cells together
//! tally    for each cell, brick and the block: how many triangles it lists
//! measure  the masks; how many words it takes
//! gather   what crowded cells list (crowds.rs); which of them gain by being divided (divide.rs)
//! write    bricks, starts of cells, and from the entries once more the lists; where they lie
//! divide   each crowded cell like a block of its own, up to 16 cells wide
//!
//! chunk | bricks | starts of cells, and the end | lists of cells | of bricks | of the block | chunks of cells
//! ```
//!
//! A divided cell has instead of its list a record: a block, and its cells per axis.

#![expect(
    clippy::cast_possible_truncation,
    reason = "numbers of cells, lengths of records, words of a block"
)]

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u32x8};

use super::crowds::Crowds;
use super::divide::{Plan, plan};
use super::extent::{EXTENT_WORDS, Extent, LIST_WORDS, Owner};
use super::frame::{Frame, Scene};
use super::groups::Groups;
use super::layout::{
    BLOCK_CELLS, Bench, Block, CHILD_WORDS, CROWDED, Class, Entry, MASK_BITS, RECORD_WORDS, number,
    place,
};
use super::pool::Pool;
use super::quarters::Format;
use crate::bits::{halves, ones};
use crate::bump::GRID;

/// How many words a chunk takes, and what for.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Measure {
    bricks: u32,
    cells: u32,
    /// Words of the cells' lists and records.
    lists: u32,
    /// Words of the lists of bricks and of the block, with what is before the ids.
    pub(super) large: u32,
    /// Triangles for the whole block.
    block: u32,
    /// References in cells, divided or not.
    pub(super) references: u32,
    /// The longest list of a cell.
    pub(super) longest: u32,
    mask: u64,
}

impl Measure {
    pub(super) const fn words(&self) -> usize {
        RECORD_WORDS * self.bricks as usize
            + self.cells as usize
            + (self.cells > 0) as usize
            + self.lists as usize
            + self.large as usize
    }
}

/// Sorts the entries of the first bench; what is crowded, on the benches behind it, if its share of
/// words for each reference lets it.
///
/// It calls itself, so it is not inlined and says once more what vectors it is compiled for.
pub(super) fn sort<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    frame: &Frame,
    benches: &mut [Bench<'_>],
    groups: &Groups,
    share: u64,
    pool: &mut Pool<'_>,
) -> Option<Block> {
    simd.vectorize(
        #[inline(always)]
        || chunk(simd, scene, frame, benches, groups, share, pool),
    )
}

#[inline(always)]
fn chunk<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    frame: &Frame,
    benches: &mut [Bench<'_>],
    groups: &Groups,
    share: u64,
    pool: &mut Pool<'_>,
) -> Option<Block> {
    let (bench, deeper) = benches.split_first_mut()?;
    let entries = bench.entries.get(..groups.count())?;
    let cells = bench.cells.first_chunk_mut()?;
    let format = scene.format();
    let block_count = tally(groups, entries, format, cells, bench.bricks);
    let mut measure = measure(simd, cells, bench.bricks, block_count);

    // Decide which cells are divided.
    let room = deeper.first_mut().map(|child| core::mem::take(&mut child.ids));
    let mut crowds = Crowds::new(entries, groups, format, room.unwrap_or_default());
    let is_crowded = measure.longest > CROWDED && !deeper.is_empty();
    if is_crowded {
        mark_crowded(simd, cells, bench.divided);
        crowds.each(bench.divided, Some(&*cells), deeper, |crowd, benches| {
            let gains = plan(simd, scene, frame, crowd, share, benches).is_some();
            if gains {
                measure.lists -= crowd.ids.len() as u32;
                measure.lists += CHILD_WORDS as u32;
            }
            gains
        });
    }
    let divided: &mut [u64] = if is_crowded { bench.divided } else { &mut [] };

    let base = pool.position();
    if let Some(words) = pool.take(measure.words()) {
        write(simd, words, base, &measure, groups, entries, format, cells, bench.bricks, divided);
        surround(scene, frame, words, &measure);
    }
    // The cursor of a divided cell stays where its record goes: the cells tell no counts any more.
    if is_crowded {
        crowds.each(divided, None, deeper, |crowd, benches| {
            let at = cells.get(crowd.cell as usize).map(|cell| base + cell);
            let plan = plan(simd, scene, frame, crowd, share, benches);
            if let Some((at, Plan { frame, groups, share })) = at.zip(plan)
                && let Some(block) = sort(simd, scene, &frame, benches, &groups, share, pool)
            {
                let [low, high] = block.mask;
                pool.set(at, &[low, high, block.base, block.list, frame.cells]);
            }
            true
        });
    }
    if let Some(child) = deeper.first_mut() {
        child.ids = crowds.into_room();
    }
    let mask = halves(measure.mask);
    let list = if measure.block > 0 { base + measure.words() as u32 - measure.block } else { 0 };
    Some(Block { mask, base, list })
}

/// Sets the bits of crowded cells.
#[inline(always)]
fn mark_crowded<S: Simd>(simd: S, cells: &[u32; BLOCK_CELLS], bits: &mut [u64]) {
    for (bits, cells) in bits.iter_mut().zip(cells.chunks_exact(MASK_BITS)) {
        let eights = cells.as_chunks::<8>().0.iter().enumerate();
        *bits = eights.fold(0, |bits, (row, &eight)| {
            let eight = u32x8::simd_from(simd, eight);
            bits | eight.simd_gt(u32x8::splat(simd, CROWDED)).to_bitmask() << (8 * row)
        });
    }
}

/// Counts how many triangles each cell and brick lists, and the block itself.
#[inline(always)]
pub(super) fn tally(
    groups: &Groups,
    entries: &[Entry],
    format: Format,
    cells: &mut [u32; BLOCK_CELLS],
    bricks: &mut [u32],
) -> u32 {
    cells.fill(0);
    bricks.fill(0);
    groups.each_small(entries, format, |cell, _| {
        if let Some(count) = cells.get_mut(cell) {
            *count += 1;
        }
    });
    let mut block = 0;
    for &entry in groups.group(Groups::OTHERS, entries) {
        match entry.class() {
            Class::Cells => each_cell(entry, format, |number, _| {
                if let Some(count) = cells.get_mut(number) {
                    *count += 1;
                }
            }),
            Class::Bricks => each_brick(entry, |number| {
                if let Some(count) = bricks.get_mut(number) {
                    *count += 1;
                }
            }),
            Class::Blocks => block += 1,
        }
    }
    block
}

/// Shows every cell of all entries that are listed by cells, and what it lists of them.
#[inline(always)]
pub(super) fn each_listed(
    groups: &Groups,
    entries: &[Entry],
    format: Format,
    mut visit: impl FnMut(usize, u32),
) {
    groups.each_small(entries, format, &mut visit);
    for &entry in groups.group(Groups::OTHERS, entries) {
        if entry.class() == Class::Cells {
            each_cell(entry, format, &mut visit);
        }
    }
}

/// Shows every cell of an entry, and what it lists of it.
#[inline(always)]
fn each_cell(entry: Entry, format: Format, mut visit: impl FnMut(usize, u32)) {
    let (min, max) = (place(entry.min()), place(entry.max()));
    // On which axes it is in a cell before this one, and in one behind it.
    let before = |axis: usize, at: u32| u32::from(at > min[axis]) << axis;
    let behind = |axis: usize, at: u32| u32::from(at < max[axis]) << axis;
    for z in min[2]..=max[2] {
        let on_z = entry.reference(format, before(2, z), behind(2, z));
        for y in min[1]..=max[1] {
            let on_y = format.through(on_z, before(1, y), behind(1, y));
            for x in min[0]..=max[0] {
                let on_x = format.through(on_y, before(0, x), behind(0, x));
                visit(number([x, y, z]) as usize, on_x);
            }
        }
    }
}

#[inline(always)]
fn each_brick(entry: Entry, mut visit: impl FnMut(usize)) {
    let (min, max) = (place(entry.min()).map(|c| c >> 2), place(entry.max()).map(|c| c >> 2));
    for z in min[2]..=max[2] {
        for y in min[1]..=max[1] {
            for x in min[0]..=max[0] {
                visit((number([x << 2, y << 2, z << 2]) >> 6) as usize);
            }
        }
    }
}

/// The cells of a brick that list something.
#[inline(always)]
fn occupancy<S: Simd>(simd: S, cells: &[u32]) -> u64 {
    let (eights, _) = cells.as_chunks::<8>();
    let none = u32x8::splat(simd, 0);
    eights.iter().enumerate().fold(0, |mask, (row, &eight)| {
        let is_empty = u32x8::simd_from(simd, eight).simd_eq(none).to_bitmask();
        mask | (!is_empty & 0xff) << (8 * row)
    })
}

/// How many words the lists take that a tally counted.
#[inline(always)]
pub(super) fn measure<S: Simd>(simd: S, cells: &[u32], bricks: &[u32], block: u32) -> Measure {
    let words = |listed: u32| listed + LIST_WORDS as u32 * u32::from(listed > 0);
    let mut measure = Measure { block, large: words(block), ..Measure::default() };
    let (mut sum, mut longest) = (u32x8::splat(simd, 0), u32x8::splat(simd, 0));
    for (brick, (cells, &listed)) in cells.chunks_exact(MASK_BITS).zip(bricks).enumerate() {
        let mask = occupancy(simd, cells);
        if mask == 0 && listed == 0 {
            continue;
        }
        measure.mask |= 1 << brick;
        measure.bricks += 1;
        measure.cells += mask.count_ones();
        for &eight in cells.as_chunks::<8>().0 {
            let eight = u32x8::simd_from(simd, eight);
            sum += eight;
            longest = longest.max(eight);
        }
        measure.large += words(listed);
    }
    let (sum, longest): ([u32; 8], [u32; 8]) = (sum.into(), longest.into());
    measure.references = sum.into_iter().sum();
    measure.longest = longest.into_iter().max().unwrap_or(0);
    measure.lists = measure.references;
    measure
}

#[inline(always)]
fn put(words: &mut [u32], at: u32, word: u32) {
    if let Some(slot) = words.get_mut(at as usize) {
        *slot = word;
    }
}

/// Writes a chunk that starts `base` words behind the start of its block. Cursors remain.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "what sorting a chunk has at hand")]
fn write<S: Simd>(
    simd: S,
    words: &mut [u32],
    base: u32,
    measure: &Measure,
    groups: &Groups,
    entries: &[Entry],
    format: Format,
    cells: &mut [u32; BLOCK_CELLS],
    bricks: &mut [u32],
    divided: &[u64],
) {
    // All of it in a row: lists are written here and there, and a store that waits for its part of
    // memory holds up those behind it.
    words.fill(0);

    let mut brick_at = 0;
    let mut cell_at = RECORD_WORDS as u32 * measure.bricks;
    let mut list_at = cell_at + measure.cells + u32::from(measure.cells > 0);
    let mut large_at = list_at + measure.lists;
    for (brick, (cells, listed)) in cells.chunks_exact_mut(MASK_BITS).zip(&mut *bricks).enumerate()
    {
        if measure.mask >> brick & 1 == 0 {
            continue;
        }
        // The brick.
        let mask = occupancy(simd, cells);
        let [low, high] = halves(mask);
        let head = if *listed > 0 { LIST_WORDS as u32 } else { 0 };
        let list = if *listed > 0 { base + large_at + head } else { 0 };
        for (at, word) in (brick_at..).zip([low, high, base + cell_at, list]) {
            put(words, at, word);
        }
        brick_at += RECORD_WORDS as u32;
        // Its own list: the length, then room for the ids.
        if *listed > 0 {
            put(words, large_at + EXTENT_WORDS as u32, *listed);
        }
        let next = large_at + head + *listed;
        *listed = large_at + head;
        large_at = next;
        // The starts of its cells' lists.
        let divided = divided.get(brick).copied().unwrap_or(0);
        let mut rest = mask;
        while rest != 0 {
            let bit = rest.trailing_zeros();
            rest &= rest - 1;
            let Some(cell) = cells.get_mut(bit as usize) else { break };
            let (length, tag) =
                if divided >> bit & 1 == 0 { (*cell, 0) } else { (CHILD_WORDS as u32, GRID) };
            put(words, cell_at, (base + list_at) | tag);
            *cell = list_at;
            cell_at += 1;
            list_at += length;
        }
    }
    if measure.cells > 0 {
        put(words, cell_at, base + list_at);
    }
    if measure.block > 0 {
        put(words, large_at + EXTENT_WORDS as u32, measure.block);
        large_at += LIST_WORDS as u32;
    }

    // The lists, group by group in the order of the ids.
    let mut others = entries;
    if divided.is_empty() {
        groups.each_small(entries, format, |cell, reference| {
            if let Some(cursor) = cells.get_mut(cell) {
                put(words, *cursor, reference);
                *cursor += 1;
            }
        });
        others = groups.group(Groups::OTHERS, entries);
    }
    for &entry in others {
        match entry.class() {
            Class::Cells => each_cell(entry, format, |number, reference| {
                let bit = number % MASK_BITS;
                let is_divided =
                    divided.get(number / MASK_BITS).is_some_and(|cells| cells >> bit & 1 != 0);
                if let Some(cursor) = cells.get_mut(number).filter(|_| !is_divided) {
                    put(words, *cursor, reference);
                    *cursor += 1;
                }
            }),
            Class::Bricks => each_brick(entry, |number| {
                if let Some(cursor) = bricks.get_mut(number) {
                    put(words, *cursor, entry.id(format));
                    *cursor += 1;
                }
            }),
            Class::Blocks => {
                put(words, large_at, entry.id(format));
                large_at += 1;
            }
        }
    }
}

/// Writes before each list of a brick, and of all of a chunk, where its triangles lie.
fn surround(scene: &Scene<'_>, frame: &Frame, words: &mut [u32], measure: &Measure) {
    let first = measure.words() - measure.large as usize;
    let Some((records, mut lists)) = words.split_at_mut_checked(first) else { return };
    let bricks = ones(measure.mask).zip(records.as_chunks::<RECORD_WORDS>().0);
    let bricks = bricks.filter_map(|(bit, &[.., list])| (list > 0).then_some(Owner::Brick(bit)));
    for owner in bricks.chain((measure.block > 0).then_some(Owner::Chunk)) {
        let Some(([first, last, count], rest)) = lists.split_first_chunk_mut() else { return };
        let Some((ids, rest)) = rest.split_at_mut_checked(*count as usize) else { return };
        [*first, *last] = Extent::of(scene, frame, owner, ids).words();
        lists = rest;
    }
}
