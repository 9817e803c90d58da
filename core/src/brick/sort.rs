//! Sorting the triangles of one block into its cells, all of it in the first cache.
//!
//! ```text
//! collect  entries with the same number of cells together
//! tally    for each cell, brick and the block: how many triangles it lists
//! measure  the masks; which cells are crowded and gain by being divided; how many words it takes
//! write    bricks, starts of cells, and from the entries once more the lists
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
use fearless_simd::{Simd, mask32x8, u32x8};
use glam::Vec3A;

use super::layout::{
    AXES, BLOCK, BLOCK_CELLS, Bench, Block, CHILD_WORDS, CROWDED, Class, ENTRY_WORDS, Entry,
    MASK_BITS, OTHERS, RECORD_WORDS, number, place,
};
use crate::aabb::Aabb;
use crate::bits::halves;
use crate::bump::GRID;
use crate::cell::Lattice;
use crate::mesh::TriangleMesh;

/// Where chunks go: words in order, up to a limit that may rise.
pub(super) trait Sink {
    /// The next `count` words, or `None` if they are only counted.
    fn take(&mut self, count: usize) -> Option<&mut [u32]>;

    /// Writes one word of the block's that was taken before.
    fn set(&mut self, at: u32, words: &[u32]);

    /// Where the next word goes, behind the start of the block.
    fn position(&self) -> u32;
}

/// The mesh in its lattice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scene<'m> {
    pub(super) mesh: &'m TriangleMesh<'m>,
    pub(super) lattice: &'m Lattice,
}

impl Scene<'_> {
    /// The box of a triangle in cells of the lattice, grown by the margin.
    #[inline(always)]
    fn reach(&self, id: u32) -> Option<Aabb> {
        let bounds = self.mesh.corners(id, Vec3A::new).and_then(Aabb::of)?;
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
        let origin = Vec3A::from_array(block.map(|at| crate::cell::as_f32(at * BLOCK)));
        Self { origin, scale: 1.0, cells: BLOCK }
    }

    /// The frame of one of its cells, cut into so many again.
    pub(super) fn child(&self, cell: [u32; 3], cells: u32) -> Self {
        let corner = Vec3A::from_array(cell.map(crate::cell::as_f32));
        Self {
            origin: self.origin + corner / self.scale,
            scale: self.scale * crate::cell::as_f32(cells),
            cells,
        }
    }

    /// The cells of the frame that a box in cells of the lattice overlaps.
    pub(super) fn range(&self, reach: &Aabb) -> crate::cell::CellRange {
        let zoom = |point: Vec3A| (point - self.origin) * self.scale;
        let reach = Aabb { min: zoom(reach.min), max: zoom(reach.max) };
        crate::cell::cells_between(reach, [self.cells; 3])
    }
}

/// How many cells hold a triangle with these first and last cells, or with a shift of 2 bricks, of 4
/// blocks.
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

/// How many words a chunk takes, and what for.
#[derive(Debug, Clone, Copy, Default)]
struct Measure {
    bricks: u32,
    cells: u32,
    /// Words of the cells' lists and records.
    lists: u32,
    /// Words of the lists of bricks and of the block, their lengths included.
    large: u32,
    /// Triangles for the whole block.
    block: u32,
    /// References in cells, divided or not.
    references: u32,
    /// The longest list of a cell.
    longest: u32,
    mask: u64,
}

impl Measure {
    const fn words(&self) -> usize {
        RECORD_WORDS * self.bricks as usize
            + self.cells as usize
            + (self.cells > 0) as usize
            + self.lists as usize
            + self.large as usize
    }
}

/// Sorts the entries of the first bench; what is crowded, on the benches behind it.
///
/// It calls itself, so it is not inlined and says once more what vectors it is compiled for.
pub(super) fn sort<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    frame: &Frame,
    benches: &mut [Bench<'_>],
    groups: &Groups,
    sink: &mut impl Sink,
) -> Option<Block> {
    simd.vectorize(
        #[inline(always)]
        || chunk(simd, scene, frame, benches, groups, sink),
    )
}

#[inline(always)]
fn chunk<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    frame: &Frame,
    benches: &mut [Bench<'_>],
    groups: &Groups,
    sink: &mut impl Sink,
) -> Option<Block> {
    let (bench, deeper) = benches.split_first_mut()?;
    let entries = bench.entries.get(..groups.count())?;
    let cells = bench.cells.first_chunk_mut()?;
    let block_count = tally(groups, entries, cells, bench.bricks);
    let mut measure = measure(simd, cells, bench.bricks, block_count);

    // Decide which cells are divided.
    let is_crowded = measure.longest > CROWDED && !deeper.is_empty();
    if is_crowded {
        bench.divided.fill(0);
        for (eighth, eight) in cells.as_chunks::<8>().0.iter().enumerate() {
            let mut crowded = crowded(simd, *eight);
            while crowded != 0 {
                let bit = crowded.trailing_zeros() as usize;
                crowded &= crowded - 1;
                let (number, listed) = (8 * eighth + bit, eight.get(bit).copied().unwrap_or(0));
                if plan(simd, scene, frame, entries, number, listed, deeper).is_none() {
                    continue;
                }
                measure.lists -= listed;
                measure.lists += CHILD_WORDS as u32;
                if let Some(divided) = bench.divided.get_mut(number / MASK_BITS) {
                    *divided |= 1 << (number % MASK_BITS);
                }
            }
        }
    }
    let divided: &[u64] = if is_crowded { bench.divided } else { &[] };

    let base = sink.position();
    if let Some(words) = sink.take(measure.words()) {
        write(simd, words, base, &measure, groups, entries, cells, bench.bricks, divided);
    }
    // The records of divided cells lie where the tally left the cursors of their cells.
    for (brick, &rest) in divided.iter().enumerate() {
        let mut rest = rest;
        while rest != 0 {
            let number = brick * MASK_BITS + rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let Some(cell) = cells.get(number) else { continue };
            let at = base + cell;
            let listed = count_of_cell(simd, entries, number);
            let Some((frame, groups)) = plan(simd, scene, frame, entries, number, listed, deeper)
            else {
                continue;
            };
            let block = sort(simd, scene, &frame, deeper, &groups, sink)?;
            let [low, high] = block.mask;
            sink.set(at, &[low, high, block.base, block.list, frame.cells]);
        }
    }
    let mask = halves(measure.mask);
    let list = if measure.block > 0 { base + measure.words() as u32 - measure.block } else { 0 };
    Some(Block { mask, base, list })
}

/// Which of eight cells are crowded.
#[inline(always)]
fn crowded<S: Simd>(simd: S, cells: [u32; 8]) -> u64 {
    u32x8::simd_from(simd, cells).simd_gt(u32x8::splat(simd, CROWDED)).to_bitmask()
}

/// Shows the entries that a cell lists.
///
/// Every crowded cell looks at all entries of its block, so it looks at eight at once.
#[inline(always)]
fn each_of_cell<S: Simd>(simd: S, entries: &[Entry], cell: usize, mut visit: impl FnMut(u32)) {
    let (eights, rest) = entries.as_chunks::<8>();
    for eight in eights {
        let mut listed = listed_of_eight(simd, eight, cell as u32);
        while listed != 0 {
            let bit = listed.trailing_zeros() as usize;
            listed &= listed - 1;
            if let Some(entry) = eight.get(bit) {
                visit(entry.id);
            }
        }
    }
    of_cell(rest, cell).for_each(visit);
}

/// The entries that a cell lists, one by one.
fn of_cell(entries: &[Entry], cell: usize) -> impl Iterator<Item = u32> + '_ {
    let cell = place(cell as u32);
    entries.iter().filter_map(move |entry| {
        let (min, max) = (place(entry.min()), place(entry.max()));
        let holds = (0..3).all(|axis| (min[axis]..=max[axis]).contains(&cell[axis]));
        (holds && entry.class() == Class::Cells).then_some(entry.id)
    })
}

/// Which of eight entries a cell lists.
#[inline(always)]
fn listed_of_eight<S: Simd>(simd: S, entries: &[Entry; 8], cell: u32) -> u64 {
    let words: &[[u32; 8]; ENTRY_WORDS] = bytemuck::cast_ref(entries);
    let cells = u32x8::simd_from(simd, words[0]).unzip_high(u32x8::simd_from(simd, words[1]));
    // An axis' bits are in order, though not side by side.
    let (min, max) = (cells, cells >> 12);
    let x = is_between(simd, min, max, cell, AXES[0]);
    let y = is_between(simd, min, max, cell, AXES[1]);
    let z = is_between(simd, min, max, cell, AXES[2]);
    let is_in_cells = (cells & Entry::CLASS).simd_eq(u32x8::splat(simd, 0));
    (x & y & z & is_in_cells).to_bitmask()
}

/// Whether a cell is between others on an axis.
#[inline(always)]
fn is_between<S: Simd>(simd: S, min: u32x8<S>, max: u32x8<S>, cell: u32, axis: u32) -> mask32x8<S> {
    let cell = u32x8::splat(simd, cell & axis);
    (min & axis).simd_le(cell) & cell.simd_le(max & axis)
}

/// How many entries a cell lists.
fn count_of_cell<S: Simd>(simd: S, entries: &[Entry], cell: usize) -> u32 {
    simd.vectorize(
        #[inline(always)]
        || {
            let mut count = 0;
            each_of_cell(simd, entries, cell, |_| count += 1);
            count
        },
    )
}

/// Puts the triangles of a cell on the next bench, if to divide the cell gains something: the
/// triangles are smaller than it, and its parts list fewer of them.
fn plan<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    frame: &Frame,
    entries: &[Entry],
    cell: usize,
    listed: u32,
    benches: &mut [Bench<'_>],
) -> Option<(Frame, Groups)> {
    simd.vectorize(
        #[inline(always)]
        || {
            let bench = benches.first_mut()?;
            let (frame, groups) = collect(simd, scene, frame, entries, cell, listed, bench)?;
            let Bench { cells, bricks, entries: inner, .. } = bench;
            let (inner, cells) = (inner.get(..groups.count())?, cells.first_chunk_mut()?);
            let block = tally(&groups, inner, cells, bricks);
            let measure = measure(simd, cells, bricks, block);
            let gains = u64::from(measure.references) <= 4 * u64::from(listed)
                && 10 * u64::from(measure.longest.max(block)) <= 9 * u64::from(listed);
            gains.then_some((frame, groups))
        },
    )
}

/// The whole part of a number; 0 if it is none.
#[expect(clippy::cast_sign_loss, reason = "saturates")]
const fn wholes(number: f64) -> u32 {
    number as u32
}

/// Puts the triangles of a cell on a bench, if they are small enough to divide it.
#[inline(always)]
fn collect<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    frame: &Frame,
    entries: &[Entry],
    cell: usize,
    listed: u32,
    bench: &mut Bench<'_>,
) -> Option<(Frame, Groups)> {
    // The ids, and soon the entries, wait where cells will be counted, if there is room.
    let waiting: &mut [Entry] = bytemuck::try_cast_slice_mut(bench.cells).ok()?;
    let waiting = waiting.get_mut(..listed as usize).unwrap_or_default();
    let mut slots = waiting.iter_mut();
    each_of_cell(simd, entries, cell, |id| {
        if let Some(slot) = slots.next() {
            slot.id = id;
        }
    });

    // As many cells as two of its mean triangles are wide, but none so small that the margin counts.
    let mut sum = 0.0;
    let mut add = |id: u32| {
        if let Some(reach) = scene.reach(id) {
            sum += f64::from(reach.size().max_element());
        }
    };
    if waiting.is_empty() {
        of_cell(entries, cell).for_each(&mut add);
    } else {
        for entry in waiting.iter() {
            add(entry.id);
        }
    }
    let mean = sum / f64::from(listed);
    let width = (2.0 * mean).max(4.0 * f64::from(scene.lattice.margin().max_element()));
    let count = wholes(1.0 / (width * f64::from(frame.scale)));
    let frame = frame.child(place(cell as u32), count.min(16));
    if count < 2 {
        return None;
    }

    let entry = |id: u32| {
        let range = frame.range(&scene.reach(id)?);
        // No list of the lattice's blocks takes it: at most it is in the list of all of the cell.
        let class = classify(range.min, range.max, 1).unwrap_or(Class::Blocks);
        Some(Entry::new(id, range.min, range.max, class))
    };
    for slot in waiting.iter_mut() {
        *slot = entry(slot.id)?;
    }
    let groups = if waiting.is_empty() {
        Groups::collect(|| of_cell(entries, cell).filter_map(entry), bench.entries)
    } else {
        Groups::collect(|| waiting.iter().copied(), bench.entries)
    };
    Some((frame, groups?))
}

/// Entries of a block, together those that have two cells on the same axes.
///
/// How many cells an entry has is as good as random, and a loop over them, or a choice between eight
/// ways, costs a mispredicted branch or two: more than all else together. Among equals there is
/// nothing to predict, a third of the time with the grouping in it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Groups {
    /// Where each group starts, and the end.
    starts: [u32; Self::COUNT + 1],
}

impl Groups {
    /// One for every set of axes, and one for entries that are in three cells on an axis or in none.
    const COUNT: usize = 1 + Self::OTHERS;
    const OTHERS: usize = OTHERS as usize;

    /// Puts entries that can be gone through twice where they are sorted.
    #[inline(always)]
    pub(super) fn collect<I: Iterator<Item = Entry>>(
        source: impl Fn() -> I,
        entries: &mut [Entry],
    ) -> Option<Self> {
        let mut counts = [0; Self::COUNT];
        for entry in source() {
            *counts.get_mut(entry.group() as usize)? += 1;
        }
        let mut starts = [0; Self::COUNT + 1];
        let mut start = 0;
        for (slot, count) in starts.iter_mut().zip(&mut counts) {
            *slot = start;
            start += core::mem::replace(count, start);
        }
        starts[Self::COUNT] = start;
        let mut cursors = counts;
        for entry in source() {
            let cursor = cursors.get_mut(entry.group() as usize)?;
            *entries.get_mut(*cursor as usize)? = entry;
            *cursor += 1;
        }
        Some(Self { starts })
    }

    /// Number of entries.
    pub(super) const fn count(&self) -> usize {
        self.starts[Self::COUNT] as usize
    }

    fn group<'e>(&self, group: usize, entries: &'e [Entry]) -> &'e [Entry] {
        let ends = self.starts.get(group).zip(self.starts.get(group + 1));
        let range = ends.map(|(&start, &end)| start as usize..end as usize);
        range.and_then(|range| entries.get(range)).unwrap_or_default()
    }

    /// Shows every cell of the small entries.
    #[inline(always)]
    fn each_small(&self, entries: &[Entry], mut visit: impl FnMut(usize, u32)) {
        let mut visit = |cell: u32, id: u32| visit(cell as usize, id);
        for entry in self.group(0, entries) {
            visit(entry.min(), entry.id);
        }
        for axis in [1, 2, 4] {
            for entry in self.group(axis, entries) {
                visit(entry.min(), entry.id);
                visit(entry.max(), entry.id);
            }
        }
        // Four cells: one of the two axes is x, or it is z.
        for (axes, axis) in [(3, AXES[0]), (5, AXES[2]), (6, AXES[2])] {
            for entry in self.group(axes, entries) {
                let (min, max) = (entry.min(), entry.max());
                let step = (min ^ max) & axis;
                for cell in [min, min ^ step, max ^ step, max] {
                    visit(cell, entry.id);
                }
            }
        }
        for entry in self.group(7, entries) {
            let (min, max) = (entry.min(), entry.max());
            let [x, y, z] = AXES.map(|axis| (min ^ max) & axis);
            for cell in [min, min ^ x, min ^ y, max ^ z, min ^ z, max ^ y, max ^ x, max] {
                visit(cell, entry.id);
            }
        }
    }
}

/// Counts how many triangles each cell and brick lists, and the block itself.
#[inline(always)]
fn tally(
    groups: &Groups,
    entries: &[Entry],
    cells: &mut [u32; BLOCK_CELLS],
    bricks: &mut [u32],
) -> u32 {
    cells.fill(0);
    bricks.fill(0);
    groups.each_small(entries, |cell, _| {
        if let Some(count) = cells.get_mut(cell) {
            *count += 1;
        }
    });
    let mut block = 0;
    for &entry in groups.group(Groups::OTHERS, entries) {
        match entry.class() {
            Class::Cells => each_cell(entry, |number| {
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

#[inline(always)]
fn each_cell(entry: Entry, mut visit: impl FnMut(usize)) {
    let (min, max) = (place(entry.min()), place(entry.max()));
    for z in min[2]..=max[2] {
        for y in min[1]..=max[1] {
            for x in min[0]..=max[0] {
                visit(number([x, y, z]) as usize);
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
fn measure<S: Simd>(simd: S, cells: &[u32], bricks: &[u32], block: u32) -> Measure {
    let mut measure = Measure { block, large: block + u32::from(block > 0), ..Measure::default() };
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
        measure.large += listed + u32::from(listed > 0);
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
    cells: &mut [u32; BLOCK_CELLS],
    bricks: &mut [u32],
    divided: &[u64],
) {
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
        let is_large = u32::from(*listed > 0);
        let list = is_large * (base + large_at + 1);
        for (at, word) in (brick_at..).zip([low, high, base + cell_at, list]) {
            put(words, at, word);
        }
        brick_at += RECORD_WORDS as u32;
        // Its own list: the length, then room for the ids.
        if *listed > 0 {
            put(words, large_at, *listed);
        }
        let next = large_at + is_large + *listed;
        *listed = large_at + is_large;
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
        put(words, large_at, measure.block);
        large_at += 1;
    }

    // The lists, group by group in the order of the ids.
    let mut others = entries;
    if divided.is_empty() {
        groups.each_small(entries, |cell, id| {
            if let Some(cursor) = cells.get_mut(cell) {
                put(words, *cursor, id);
                *cursor += 1;
            }
        });
        others = groups.group(Groups::OTHERS, entries);
    }
    for &entry in others {
        match entry.class() {
            Class::Cells => each_cell(entry, |number| {
                let bit = number % MASK_BITS;
                let is_divided =
                    divided.get(number / MASK_BITS).is_some_and(|cells| cells >> bit & 1 != 0);
                if let Some(cursor) = cells.get_mut(number).filter(|_| !is_divided) {
                    put(words, *cursor, entry.id);
                    *cursor += 1;
                }
            }),
            Class::Bricks => each_brick(entry, |number| {
                if let Some(cursor) = bricks.get_mut(number) {
                    put(words, *cursor, entry.id);
                    *cursor += 1;
                }
            }),
            Class::Blocks => {
                put(words, large_at, entry.id);
                large_at += 1;
            }
        }
    }
}
