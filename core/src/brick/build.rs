//! Building a brick grid: two passes over the triangles, then block after block in cache.
//!
//! ```text
//! settle    box, cell size; a census: entries per block            (size.rs, pass.rs, places.rs)
//! scatter   every triangle's entry to the bins of its blocks                (pass.rs, places.rs)
//! sort      each block's bin into its chunk of the pool                       (sort.rs, pool.rs)
//! close     the parts of the pool moved together                             (close.rs)
//!
//! index   | header | blocks | pool: large list | part of a task | part of a task |
//! scratch | heads of a task | heads of a task | benches of a task | benches of a task |
//! ```
//!
//! Each step is cut into tasks: the passes by triangles, the sorting by blocks. What a
//! task writes is the same however many there are: a bin has the entries of the first
//! triangles first, whoever brings them; a chunk is told where it starts but holds nothing
//! of it; and parts end up side by side.

#![expect(
    clippy::cast_possible_truncation,
    reason = "numbers of blocks and of words in a region, checked where they could be larger"
)]

use fearless_simd::Simd;

use super::budget::{clamped, enough_words, large_words, least_words, likely_words};
use super::close::close;
use super::divide::share;
use super::frame::{Frame, Scene};
use super::layout::{Benches, Block, ENTRY_WORDS};
use super::pass::{Ground, Scatter};
use super::pool::{Filled, Part, Pool};
use super::size::{Settled, Shares, settle_in};
use super::sort::sort;
use crate::arena::{ALIGNMENT, section_bytes, split_mut};
use crate::blob::{HEADER_BYTES, Header};
use crate::bump::{GRID, finish};
use crate::config::Config;
use crate::control::{Control, Watch};
use crate::error::{ConfigField, Error, Region};
use crate::mesh::TriangleMesh;
use crate::simd::{Kernel, SimdLevel, dispatch};
use crate::sizes::Sizes;
use crate::tasks::{Shared, run};

/// Room for as many tasks as there may be, or for one: it is on the stack. What has it is out of
/// line, so that who builds with one task does not have the room for all.
macro_rules! for_tasks {
    ($parallel:expr, $function:ident($($argument:expr),*)) => {
        if $parallel.tasks > 1 {
            $function::<{ Control::MAX_TASKS as usize }>($($argument),*, $parallel)
        } else {
            $function::<1>($($argument),*, $parallel)
        }
    };
}

/// The memory that a mesh needs: exact if the scratch is large enough to sort in.
pub(crate) fn sizes(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    scratch: &mut [u8],
    parallel: &Control<'_>,
) -> Result<Sizes, Error> {
    for_tasks!(parallel, sizes_in(mesh, config, scratch))
}

#[inline(never)]
fn sizes_in<const N: usize>(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    scratch: &mut [u8],
    parallel: &Control<'_>,
) -> Result<Sizes, Error> {
    let (settled, shares) = settle_in::<N>(mesh, config, scratch, parallel)?;
    let Settled { layout, census, .. } = &settled;
    let scratch_bytes = layout.scratch_bytes(shares.wanted);
    // With the bins in the scratch, too, the answer would be exact.
    let enough = scratch_bytes + section_bytes::<u32>(least_words(census));
    let bound = || {
        Sizes::new(
            layout.index_bytes(enough_words(mesh.triangle_count(), layout, census)),
            enough,
            false,
        )
    };
    let ground = settled.ground(mesh, config.flags);
    let Some((mut work, rest)) = Work::new(&ground, &settled, &shares, scratch, parallel) else {
        return bound();
    };
    // The rest of the scratch is a pool that ends too early: all is counted.
    let least = least_words(census);
    let words = words_of(rest).and_then(|words| words.get_mut(..usize::try_from(least).ok()?));
    let Some(words) = words else { return bound() };
    work.place(least);
    work.fill(&mut [], words, &Watch::none())?;
    Sizes::new(layout.index_bytes(work.most()), scratch_bytes, true)
}

/// Builds into `index` and returns the part of it that is the blob.
pub(crate) fn build<'a>(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    index: &'a mut [u8],
    scratch: &mut [u8],
    parallel: &Control<'_>,
    watch: &Watch<'_>,
) -> Result<&'a [u8], Error> {
    let header = match for_tasks!(parallel, build_in(mesh, config, index, scratch, watch)) {
        // The heads of many tasks left little room for benches: as many tasks as have both.
        Err(Error::OutOfMemory { region: Region::Scratch, needed_bytes, available_bytes })
            if parallel.tasks > 1 && available_bytes >= needed_bytes =>
        {
            let room = available_bytes / needed_bytes.max(1);
            let tasks = room.min(u64::from(clamped(parallel.tasks)) - 1) as u32;
            return build(mesh, config, index, scratch, &Control { tasks, ..*parallel }, watch);
        }
        built => built?,
    };
    finish(index, header)
}

/// Fills the index and returns the header that belongs there.
#[inline(never)]
fn build_in<const N: usize>(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    index: &mut [u8],
    scratch: &mut [u8],
    watch: &Watch<'_>,
    parallel: &Control<'_>,
) -> Result<Header, Error> {
    let available_bytes = scratch.len() as u64;
    let (settled, shares) = settle_in::<N>(mesh, config, scratch, parallel)?;
    let Settled { layout, census, .. } = &settled;
    let ground = settled.ground(mesh, config.flags);
    let work = Work::new(&ground, &settled, &shares, scratch, parallel);
    // Twice as many parts are worth another count.
    let needed_bytes = layout.scratch_bytes(1);
    let room = (available_bytes / needed_bytes.max(1)).min(shares.wanted.into());
    let Some((mut work, _)) = work.filter(|(work, _)| 2 * work.part_count as u64 > room) else {
        return Err(Error::OutOfMemory { region: Region::Scratch, needed_bytes, available_bytes });
    };

    // Cut the index; at least the bins must find room.
    let available_bytes = index.len() as u64;
    let too_small = |words| {
        let needed_bytes = layout.index_bytes(words);
        Error::OutOfMemory { region: Region::Index, needed_bytes, available_bytes }
    };
    let parts = index.split_at_mut_checked(HEADER_BYTES).and_then(|(header, behind)| {
        let (blocks, pool) = split_mut::<Block>(behind, layout.block_count())?;
        Some((header, blocks, words_of(pool)?))
    });
    let least = least_words(census);
    let Some((header, blocks, words)) = parts.filter(|(.., words)| words.len() as u64 >= least)
    else {
        return Err(too_small(enough_words(mesh.triangle_count(), layout, census)));
    };

    watch.at(0.4)?;
    // What was here is no grid any more, should the build end with an error.
    header.fill(0);
    let room = words.len() as u64;
    work.place(room);
    let mut taken = work.fill(blocks, words, watch)?;
    if taken.is_none() && work.most() <= room {
        // There is room for what each task needs, now that this is known.
        work.place_exactly();
        taken = work.fill(blocks, words, watch)?;
    }
    if taken.is_none() && work.part_count > 1 {
        work.cut(1);
        work.place(room);
        taken = work.fill(blocks, words, watch)?;
    }
    let Some(taken) = taken else { return Err(too_small(work.most())) };
    let mut header = Header::new(config, mesh, &settled.lattice);
    header.skipped_count = census.skipped;
    header.reference_count = taken;
    header.blob_bytes = layout.index_bytes(taken.into());
    Ok(header)
}

/// The words of a region, as far as whole sections go.
fn words_of(bytes: &mut [u8]) -> Option<&mut [u32]> {
    let whole = bytes.len() / ALIGNMENT * ALIGNMENT;
    bytemuck::try_cast_slice_mut(bytes.get_mut(..whole)?).ok()
}

/// What is left to do when a grid is settled.
struct Work<'w, const N: usize> {
    ground: &'w Ground<'w>,
    settled: &'w Settled,
    shares: &'w Shares<N>,
    parallel: &'w Control<'w>,
    /// For every task and block how many entries it has.
    heads: [&'w mut [u32]; N],
    benches: [Option<Benches<'w>>; N],
    parts: [Part; N],
    part_count: usize,
    /// How the parts were filled.
    filled: [Filled; N],
}

impl<'w, const N: usize> Work<'w, N> {
    /// Cuts the scratch and the blocks; `None` if there is no scratch for one task. What is left of
    /// the scratch is returned, too.
    fn new(
        ground: &'w Ground<'w>,
        settled: &'w Settled,
        shares: &'w Shares<N>,
        scratch: &'w mut [u8],
        parallel: &'w Control<'w>,
    ) -> Option<(Self, &'w mut [u8])> {
        if !settled.is_counted {
            return None;
        }
        let (heads, rest) = settled.layout.heads(scratch, shares.tasks)?;
        let (benches, rest) = settled.layout.benches(rest, shares.tasks);
        let part_count = benches.iter().flatten().count();
        let (parts, filled) = ([Part::default(); N], [Filled::default(); N]);
        let mut work =
            Self { ground, settled, shares, parallel, heads, benches, parts, part_count, filled };
        work.cut(part_count);
        (part_count > 0).then_some((work, rest))
    }

    /// Cuts the blocks into parts with about as many entries each.
    fn cut(&mut self, count: usize) {
        self.part_count = count;
        let all = self.settled.census.entries;
        let heads = self.heads.get(..self.shares.tasks as usize).unwrap_or_default();
        let (mut block, mut before) = (0, 0);
        for (number, part) in (1_u64..).zip(self.parts.iter_mut().take(count)) {
            let (first, start) = (block, before);
            let goal = all * number / count as u64;
            while block < self.settled.layout.block_count() as usize
                && (before < goal || number == count as u64)
            {
                before += entries(heads, block);
                block += 1;
            }
            *part = Part { blocks: [first, block], entries: before - start, ..Part::default() };
        }
    }

    /// Gives each part room in proportion to its entries: more than it probably needs, where there
    /// are several, and not so much that they lie far apart.
    fn place(&mut self, room: u64) {
        let census = &self.settled.census;
        let large = large_words(census);
        let most = u64::from(u32::MAX);
        let likely = likely_words(census).min(most);
        let mut room = room.min(most).saturating_sub(large);
        if self.part_count > 1 {
            room = room.min(likely + likely / 4);
        }
        let share = |words: u64, entries: u64| words * entries / census.entries.max(1);
        let (mut before, mut end) = (0, 0);
        let last = self.part_count.saturating_sub(1);
        for (number, part) in self.parts.iter_mut().enumerate().take(self.part_count) {
            part.start = end;
            part.taken = if number == 0 { large } else { 0 };
            before += part.entries;
            end = large + if number == last { room } else { share(room, before) };
            part.end = end;
            let likely = share(likely, part.entries).max(part.bin_words());
            part.bins = (part.start + part.taken + likely).min(end) - part.bin_words();
        }
    }

    /// Gives each part the room that it turned out to need.
    fn place_exactly(&mut self) {
        let mut end = 0;
        for (part, filled) in self.parts.iter_mut().zip(&self.filled).take(self.part_count) {
            part.start = end;
            end += filled.most;
            part.end = end;
            part.bins = end - part.bin_words();
        }
    }

    /// The words that all parts need.
    fn most(&self) -> u64 {
        self.filled.iter().map(|filled| filled.most).sum()
    }

    /// Scatters and sorts into the words, and returns how many of them are the pool; `None` if
    /// there were not enough for each part.
    fn fill(
        &mut self,
        blocks: &mut [Block],
        words: &mut [u32],
        watch: &Watch<'_>,
    ) -> Result<Option<u32>, Error> {
        // A head is a word's number, and so is the base of a block, but for a bit.
        let too_fine = Error::InvalidConfig(ConfigField::CellSize);
        let end = self.parts.iter().map(|part| part.bins + part.bin_words()).max();
        if end > Some(u32::MAX.into()) {
            return Err(too_fine);
        }
        self.scatter(words)?;
        watch.at(0.7)?;
        self.sort(blocks, words)?;
        self.recount();
        if self.filled.iter().any(|filled| filled.is_exhausted) {
            return Ok(None);
        }
        let parts = self.parts.iter().zip(&self.filled).take(self.part_count);
        let taken = close::<N>(parts, blocks, words, self.parallel)?;
        let taken = u32::try_from(taken).ok().filter(|taken| taken & GRID == 0);
        taken.map(Some).ok_or(too_fine)
    }

    /// Puts every triangle's entries into the bins of its blocks, and the largest
    /// triangles into the list of the grid.
    fn scatter(&mut self, words: &mut [u32]) -> Result<(), Error> {
        let tasks = self.shares.tasks;
        let heads = self.heads.get_mut(..tasks as usize).unwrap_or_default();
        for part in self.parts.iter().take(self.part_count) {
            let mut next = part.bins as u32;
            for block in part.blocks[0]..part.blocks[1] {
                for head in heads.iter_mut().filter_map(|heads| heads.get_mut(block)) {
                    next += core::mem::replace(head, next) * ENTRY_WORDS as u32;
                }
            }
        }
        if let Some(count) = words.first_mut() {
            *count = self.settled.census.large;
        }
        let words = Shared::new(words);
        let mut large = 1;
        let heads = heads.iter_mut().zip(&self.shares.censuses);
        let scatters = (0..tasks).zip(heads).map(|(task, (heads, census))| {
            let ids = Shares::<N>::ids(self.ground.mesh.triangle_count(), task, tasks);
            let first = large;
            large += census.large;
            Scatter { ids, heads, large: first, words }
        });
        let ground = self.ground;
        let results: [_; N] =
            run(self.parallel, scatters, |scatter: Scatter<'_, '_>| scatter.run(ground))?;
        results.into_iter().flatten().collect()
    }

    /// Sorts the bins of every part into chunks.
    fn sort(&mut self, blocks: &mut [Block], words: &mut [u32]) -> Result<(), Error> {
        let Self { ground, settled, heads, .. } = self;
        // The entries of the last task are the last ones of a block.
        let ends: &[u32] = match heads.get(self.shares.tasks as usize - 1) {
            Some(ends) => ends,
            None => &[],
        };
        let (mut blocks, mut words, mut at) = (blocks, words, 0);
        let parts = self.parts.iter().zip(self.benches.iter_mut().flatten()).take(self.part_count);
        let fills = parts.map(|(part, benches)| {
            let [first, last] = part.blocks;
            let mut cut = |end: u64| {
                let count = usize::try_from(end - at).unwrap_or(usize::MAX);
                at = end;
                let (cut, rest) =
                    core::mem::take(&mut words).split_at_mut_checked(count).unwrap_or_default();
                words = rest;
                cut
            };
            cut(part.start);
            let words = cut(part.end);
            let (own, rest) =
                core::mem::take(&mut blocks).split_at_mut_checked(last - first).unwrap_or_default();
            blocks = rest;
            let ends = ends.get(first..last).unwrap_or_default();
            Fill { ground, settled, part: *part, ends, benches, blocks: own, words }
        });
        let results =
            run(self.parallel, fills, |fill: Fill<'_, '_>| dispatch(SimdLevel::detect(), fill))?;
        self.filled = results.map(Option::unwrap_or_default);
        Ok(())
    }

    /// Turns heads that are the ends of bins back into numbers of entries.
    fn recount(&mut self) {
        if self.part_count < 2 {
            return;
        }
        let heads = self.heads.get_mut(..self.shares.tasks as usize).unwrap_or_default();
        for part in self.parts.iter().take(self.part_count) {
            let mut start = part.bins as u32;
            for block in part.blocks[0]..part.blocks[1] {
                for head in heads.iter_mut().filter_map(|heads| heads.get_mut(block)) {
                    let count = (*head - start) / ENTRY_WORDS as u32;
                    start = core::mem::replace(head, count);
                }
            }
        }
    }
}

/// The entries of a block.
fn entries(heads: &[&mut [u32]], block: usize) -> u64 {
    heads.iter().filter_map(|heads| heads.get(block)).map(|&count| u64::from(count)).sum()
}

/// Sorting the bins of a part into chunks.
struct Fill<'f, 's> {
    ground: &'f Ground<'f>,
    settled: &'f Settled,
    part: Part,
    /// For every block the word where its bin ends.
    ends: &'f [u32],
    benches: &'f mut Benches<'s>,
    blocks: &'f mut [Block],
    words: &'f mut [u32],
}

impl Kernel for Fill<'_, '_> {
    type Output = Filled;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Self { ground, settled, part, ends, benches, blocks, words } = self;
        let scene = Scene { mesh: ground.mesh, lattice: &settled.lattice };
        let share = share(scene.mesh.triangle_count(), settled.census.references);
        let [width, height, _] = settled.layout.blocks.map(|blocks| blocks.max(1));
        let mut start = part.bins as u32;
        let mut pool = Pool::new(&part, words);
        let mut slots = blocks.iter_mut();
        for (number, &end) in (part.blocks[0] as u32..).zip(ends) {
            let words = (end - start) as usize;
            start = end;
            let mut block = Block::default();
            if words > 0 {
                let bench = benches.first_mut().map(|bench| &mut *bench.entries);
                let groups = pool.read_bin(words, bench.unwrap_or_default()).unwrap_or_default();
                let at = [number % width, number / width % height, number / width / height];
                let frame = Frame::of_block(at);
                let sorted = sort(simd, &scene, &frame, benches, &groups, share, &mut pool);
                block = pool.placed(sorted.unwrap_or_default());
            }
            if let Some(slot) = slots.next() {
                *slot = block;
            }
        }
        pool.filled()
    }
}
