//! The pass over the triangles, twice: once to count the entries of each block, once to write them.
//!
//! Almost all triangles lie in at most two cells an axis, and most of these in one block. For them
//! everything is done in vectors ([`places`](super::places)), where there are any; what is larger, or
//! has no number, is looked at once more.

#![expect(clippy::cast_possible_truncation, reason = "eight triangles, the words of entries")]

use core::ops::Range;

use fearless_simd::Simd;
use glam::Vec3A;

use super::frame::{classify, lists, range};
use super::layout::{BLOCK, Class, ENTRY_WORDS, Entry};
use super::places::{BATCH, Places, straddling};
use super::quarters::{Format, Quarters};
use crate::aabb::Aabb;
use crate::cell::{CellRange, Lattice};
use crate::config::BuildFlags;
use crate::eight::LANES;
use crate::error::Error;
use crate::mesh::TriangleMesh;
use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};
use crate::spans::Spans;
use crate::tasks::Shared;

/// What the mesh will be in its blocks.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Census {
    /// Triangles in blocks: one that reaches into three counts three times.
    pub(super) entries: u64,
    /// Triangles in lists.
    pub(super) references: u64,
    /// Triangles too large for any list but the one of the grid.
    pub(super) large: u32,
    /// Triangles without finite coordinates.
    pub(super) skipped: u32,
}

impl Census {
    /// This and that of other triangles.
    pub(super) const fn plus(self, other: Self) -> Self {
        Self {
            entries: self.entries + other.entries,
            references: self.references + other.references,
            large: self.large + other.large,
            skipped: self.skipped + other.skipped,
        }
    }
}

/// What both passes go over.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ground<'g> {
    pub(super) mesh: &'g TriangleMesh<'g>,
    pub(super) lattice: &'g Lattice,
    /// Blocks per axis.
    pub(super) blocks: [u32; 3],
    /// A triangle in more blocks than this is in the list of the whole grid.
    pub(super) most_blocks: u64,
    pub(super) flags: BuildFlags,
}

/// Where a triangle belongs.
pub(super) struct Home {
    /// Its cells, and the quarters of the outermost.
    pub(super) range: CellRange,
    pub(super) quarters: Quarters,
    /// What lists it, if not the whole grid.
    pub(super) class: Option<Class>,
}

impl Home {
    /// That of a triangle with these corners; `None` if a coordinate is not finite.
    #[inline(always)]
    pub(super) fn of(lattice: &Lattice, most_blocks: u64, corners: [Vec3A; 3]) -> Option<Self> {
        let reach = lattice.reach(&Aabb::of(corners)?);
        let (range, quarters) = range(reach, lattice.resolution);
        Some(Self { range, quarters, class: classify(range.min, range.max, most_blocks) })
    }

    /// The part of it in a block that it reaches: its cells there, and the quarters.
    #[inline(always)]
    pub(super) fn in_block(&self, [x, y, z]: [u32; 3]) -> (CellRange, Quarters) {
        self.part([self.along(0, x), self.along(1, y), self.along(2, z)])
    }

    #[inline(always)]
    fn part(&self, [x, y, z]: [Along; 3]) -> (CellRange, Quarters) {
        let before = x.before | y.before << 1 | z.before << 2;
        let behind = x.behind | y.behind << 1 | z.behind << 2;
        let range = CellRange { min: [x.first, y.first, z.first], max: [x.last, y.last, z.last] };
        (range, self.quarters.through(before, behind))
    }

    /// An axis of the part in a block.
    #[inline(always)]
    fn along(&self, axis: usize, block: u32) -> Along {
        let (min, max) = (self.range.min[axis], self.range.max[axis]);
        let (is_first, is_last) = (min / BLOCK == block, max / BLOCK == block);
        Along {
            first: if is_first { min % BLOCK } else { 0 },
            last: if is_last { max % BLOCK } else { BLOCK - 1 },
            before: u32::from(!is_first),
            behind: u32::from(!is_last),
        }
    }
}

/// The cells of a triangle in a block along an axis, and whether it
/// has others before and behind them.
#[derive(Clone, Copy)]
struct Along {
    first: u32,
    last: u32,
    before: u32,
    behind: u32,
}

/// What is done with the entries of triangles.
trait Visit {
    /// An entry of a block.
    fn entry(&mut self, block: usize, entry: Entry);

    /// Eight entries of one block.
    fn run(&mut self, block: usize, entries: [Entry; LANES]);

    /// So many entries, and in how many lists their triangles will be.
    fn counted(&mut self, entries: u64, references: u64);

    /// A triangle for the list of the grid.
    fn large(&mut self, id: u32);

    /// A triangle that has no place.
    fn skipped(&mut self, id: u32) -> Result<(), Error>;
}

/// Visits the entries of triangles.
#[inline(always)]
fn visit<S: Simd, V: Visit, const ENTRIES: bool>(
    simd: S,
    ground: &Ground<'_>,
    ids: Range<u32>,
    visitor: &mut V,
) -> Result<(), Error> {
    let wide = ground.mesh.wide();
    if !HAS_VECTORS || wide.is_empty() {
        for id in ids {
            visit_any(simd, ground, id, visitor)?;
        }
        return Ok(());
    }

    let spans = Spans::new(simd, ground.lattice, 4);
    let format = Format::of(ground.mesh.triangle_count());
    let [x, y, z] = [1, ground.blocks[0], ground.blocks[0] * ground.blocks[1]];
    let offsets = [0, x, y, x + y, z, x + z, y + z, x + y + z];
    let mut batch = Places::new(format);
    let mut first = ids.start;
    while first < ids.end {
        let count = (ids.end - first).min(BATCH);
        batch.find::<S, ENTRIES>(simd, &spans, ground.blocks, &wide, first, count);
        visitor.counted(batch.plain.count_ones().into(), batch.lists.into());

        let mut at = 0;
        while at < count {
            let id = first + at;
            if batch.runs >> at & 1 == 1 {
                visitor.run(batch.block(at), batch.eight(at, id));
                at += LANES as u32;
                continue;
            }
            let (block, entry) = (batch.block(at), batch.entry(at, id));
            let (is_plain, is_simple) = (batch.plain >> at & 1 == 1, batch.simple >> at & 1 == 1);
            at += 1;
            if is_plain {
                visitor.entry(block, entry);
                continue;
            }
            if !is_simple {
                visit_any(simd, ground, id, visitor)?;
                continue;
            }
            // Each of its blocks: those on the far side of the axes of every subset. A plain one
            // of a batch that is not full has no axes, and one block.
            let (entry, straddles) = straddling(entry);
            visitor.counted(1 << straddles.count_ones(), entry.lists());
            let mut far = 0;
            loop {
                let offset = offsets.get(far as usize).copied().unwrap_or(0) as usize;
                visitor.entry(block + offset, entry.beside(straddles, far, format));
                if far == straddles {
                    break;
                }
                far = far.wrapping_sub(straddles) & straddles;
            }
        }
        first += count;
    }
    Ok(())
}

/// Visits the entries of a triangle wherever it lies.
#[inline(never)]
fn visit_any<S: Simd>(
    simd: S,
    ground: &Ground<'_>,
    id: u32,
    visitor: &mut impl Visit,
) -> Result<(), Error> {
    simd.vectorize(
        #[inline(always)]
        || {
            let format = Format::of(ground.mesh.triangle_count());
            let Some(corners) = ground.mesh.corners(id) else {
                return Err(Error::IndexOutOfRange { triangle: id });
            };
            let Some(home) = Home::of(ground.lattice, ground.most_blocks, corners) else {
                return visitor.skipped(id);
            };
            let CellRange { min, max } = home.range;
            let Some(class) = home.class else {
                visitor.large(id);
                return Ok(());
            };
            let (low, high) = (min.map(|cell| cell / BLOCK), max.map(|cell| cell / BLOCK));
            let blocks = CellRange { min: low, max: high };
            visitor.counted(blocks.count(), lists(min, max, class.shift()));
            for z in low[2]..=high[2] {
                let on_z = home.along(2, z);
                for y in low[1]..=high[1] {
                    let on_y = home.along(1, y);
                    for x in low[0]..=high[0] {
                        let block = x + ground.blocks[0] * (y + ground.blocks[1] * z);
                        let (part, quarters) = home.part([home.along(0, x), on_y, on_z]);
                        let word = format.word(id, quarters);
                        let entry = Entry::new(word, part.min, part.max, class);
                        visitor.entry(block as usize, entry);
                    }
                }
            }
            Ok(())
        },
    )
}

/// Counts the entries of every block, in `heads` if there is room.
pub(super) struct Count<'h> {
    pub(super) ids: Range<u32>,
    pub(super) heads: &'h mut [u32],
}

impl Count<'_> {
    pub(super) fn run(self, ground: &Ground<'_>) -> Result<Census, Error> {
        dispatch(SimdLevel::detect(), Pass { ground, work: self })
    }
}

/// A pass over triangles.
struct Pass<'g, W> {
    ground: &'g Ground<'g>,
    work: W,
}

/// A pass that counts.
struct Counting<'h> {
    heads: &'h mut [u32],
    census: Census,
    is_strict: bool,
}

impl Visit for Counting<'_> {
    #[inline(always)]
    fn entry(&mut self, block: usize, _: Entry) {
        if let Some(count) = self.heads.get_mut(block) {
            *count += 1;
        }
    }

    #[inline(always)]
    fn run(&mut self, block: usize, _: [Entry; LANES]) {
        if let Some(count) = self.heads.get_mut(block) {
            *count += LANES as u32;
        }
    }

    #[inline(always)]
    fn counted(&mut self, entries: u64, references: u64) {
        self.census.entries += entries;
        self.census.references += references;
    }

    fn large(&mut self, _: u32) {
        self.census.large += 1;
    }

    fn skipped(&mut self, id: u32) -> Result<(), Error> {
        if self.is_strict {
            return Err(Error::NonFiniteTriangle { triangle: id });
        }
        self.census.skipped += 1;
        Ok(())
    }
}

impl Kernel for Pass<'_, Count<'_>> {
    type Output = Result<Census, Error>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Count { ids, heads } = self.work;
        heads.fill(0);
        let is_strict = self.ground.flags.contains(BuildFlags::STRICT);
        let mut counting = Counting { heads, census: Census::default(), is_strict };
        visit::<S, _, false>(simd, self.ground, ids, &mut counting)?;
        Ok(counting.census)
    }
}

/// Writes every triangle's entries into the bins of its blocks, and the largest triangles into the
/// list of the grid. Afterwards a block's entries end at its head.
pub(super) struct Scatter<'h, 'w> {
    pub(super) ids: Range<u32>,
    /// For each block the word where the next entry goes.
    pub(super) heads: &'h mut [u32],
    /// The word where the next large triangle goes.
    pub(super) large: u32,
    pub(super) words: Shared<'w>,
}

impl Scatter<'_, '_> {
    pub(super) fn run(self, ground: &Ground<'_>) -> Result<(), Error> {
        dispatch(SimdLevel::detect(), Pass { ground, work: self })
    }
}

impl Visit for Scatter<'_, '_> {
    #[inline(always)]
    fn entry(&mut self, block: usize, entry: Entry) {
        if let Some(head) = self.heads.get_mut(block) {
            let (at, words) = (*head, entry.words());
            *head = at.wrapping_add(words.len() as u32);
            self.words.set(at as usize, words);
        }
    }

    #[inline(always)]
    fn run(&mut self, block: usize, entries: [Entry; LANES]) {
        if let Some(head) = self.heads.get_mut(block) {
            let words: [u32; LANES * ENTRY_WORDS] = bytemuck::cast(entries);
            let at = *head;
            *head = at.wrapping_add(words.len() as u32);
            self.words.set(at as usize, words);
        }
    }

    #[inline(always)]
    fn counted(&mut self, _: u64, _: u64) {}

    fn large(&mut self, id: u32) {
        self.words.set(self.large as usize, [id]);
        self.large = self.large.wrapping_add(1);
    }

    fn skipped(&mut self, _: u32) -> Result<(), Error> {
        Ok(())
    }
}

impl Kernel for Pass<'_, Scatter<'_, '_>> {
    type Output = Result<(), Error>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let mut scatter = self.work;
        visit::<S, _, true>(simd, self.ground, scatter.ids.clone(), &mut scatter)
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;
    use alloc::{format, vec};

    use fearless_simd::Fallback;

    use super::*;
    use crate::cell::as_f32;
    use crate::mesh::{IndexType, Strided};

    /// At a level, or in scalar lanes.
    fn at<K: Kernel>(level: Option<SimdLevel>, kernel: K) -> K::Output {
        match level {
            Some(level) => dispatch(level, kernel),
            None => kernel.run(Fallback::new()),
        }
    }

    /// Triangles one behind the other in rows through 3 x 2 x 2 blocks, three vertices each: most
    /// are small, some reach into several blocks or all, some have no number.
    fn positions(triangles: u32) -> Vec<[f32; 3]> {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            as_f32(state >> 8) / 16_777_216.0
        };
        let mut positions = Vec::new();
        for id in 0..triangles {
            let (row, place) = (id / 700, as_f32(id % 700));
            let center = [place * (48.0 / 700.0), 15.7 + 0.2 * as_f32(row), 9.0 * as_f32(row)];
            let size = match id % 89 {
                88 => 100.0,
                80 => 20.0,
                70..76 => 3.0,
                _ => 0.5,
            };
            for _ in 0..3 {
                positions.push(center.map(|at| at + size * (random() - 0.5)));
            }
            if id % 131 == 130 {
                positions[3 * id as usize + 1][id as usize % 3] = f32::NAN;
            }
        }
        positions
    }

    /// A census, what each task counted, and the words that were scattered.
    type Answer = ([u64; 4], Vec<Vec<u32>>, Vec<u32>);

    /// Both passes, by tasks that end at these triangles.
    fn answer(level: Option<SimdLevel>, ground: &Ground<'_>, ends: &[u32]) -> Answer {
        let blocks = ground.blocks.iter().product::<u32>() as usize;
        let mut census = Census::default();
        let (mut counts, mut start) = (Vec::new(), 0);
        for &end in ends {
            let mut heads = vec![0; blocks];
            let work = Count { ids: start..end, heads: &mut heads };
            let counted = at(level, Pass { ground, work }).unwrap();
            assert_eq!(heads.iter().map(|&count| u64::from(count)).sum::<u64>(), counted.entries);
            census = census.plus(counted);
            counts.push(heads);
            start = end;
        }

        let mut heads = counts.clone();
        let mut next = census.large;
        for block in 0..blocks {
            for heads in &mut heads {
                next += core::mem::replace(&mut heads[block], next) * ENTRY_WORDS as u32;
            }
        }
        let mut words = vec![0; next as usize];
        let shared = Shared::new(&mut words);
        let (mut start, mut large) = (0, 0);
        for (&end, heads) in ends.iter().zip(&mut heads) {
            let work = Scatter { ids: start..end, heads, large, words: shared };
            at(level, Pass { ground, work }).unwrap();
            let task = Count { ids: start..end, heads: &mut [] };
            large += at(level, Pass { ground, work: task }).unwrap().large;
            start = end;
        }
        let Census { entries, references, large, skipped } = census;
        ([entries, references, large.into(), skipped.into()], counts, words)
    }

    /// Triangles, from a mesh read one by one, have the same entries at every level, wherever batches
    /// and tasks end.
    #[test]
    #[cfg_attr(miri, ignore = "hours")]
    fn every_level_counts_and_writes_what_one_triangle_after_the_other_does() {
        let bounds = Aabb { min: Vec3A::ZERO, max: Vec3A::new(48.0, 32.0, 32.0) };
        let lattice = Lattice::new(bounds, [48, 32, 32]);
        // Ids of 256 triangles leave room for all quarters, of 2048 for some, of 20 000 for
        // halves.
        for count in [0, 1, 63, 64, 65, 200, 2048, 2100, 20_000] {
            let positions = positions(count);
            let indices: Vec<_> = (0..count).map(|id| [3 * id, 3 * id + 1, 3 * id + 2]).collect();
            let short: Vec<[u16; 3]> = indices
                .iter()
                .map(|triangle| triangle.map(|vertex| u16::try_from(vertex).unwrap()))
                .collect();
            let tight = TriangleMesh::new(&positions, &indices).unwrap();
            let (vertices, short) = (tight.positions(), Strided::new(&short));
            let one_by_one = TriangleMesh::strided(vertices, short, IndexType::U16).unwrap();
            assert!(one_by_one.wide().is_empty());

            let ground = |mesh| Ground {
                mesh,
                lattice: &lattice,
                blocks: [3, 2, 2],
                most_blocks: 8,
                flags: BuildFlags::empty(),
            };
            for ends in [&[count][..], &[1, 64, 101, count][..]] {
                let ends: Vec<_> = ends.iter().map(|&end| end.min(count)).collect();
                let expected = answer(None, &ground(&one_by_one), &ends);
                for level in [None].into_iter().chain(SimdLevel::available().map(Some)) {
                    let found = answer(level, &ground(&tight), &ends);
                    assert!(found == expected, "{level:?}, {count} triangles to {ends:?}");
                }
            }
            if count < 2000 {
                continue;
            }
            // All kinds were there.
            let ([_, _, large, skipped], ..) = answer(None, &ground(&tight), &[count]);
            assert!(large > 5 && skipped > 10, "{large} {skipped}");
            let simd = Fallback::new();
            let spans = Spans::new(simd, &lattice, 4);
            let mut batch = Places::new(Format::of(count));
            let (mut runs, mut straddling, mut others) = (0, 0, 0);
            for first in (0..count - BATCH).step_by(BATCH as usize) {
                let mesh = tight.wide();
                batch.find::<_, true>(simd, &spans, [3, 2, 2], &mesh, first, BATCH);
                runs += batch.runs.count_ones();
                straddling += (batch.simple & !batch.plain).count_ones();
                others += batch.simple.count_zeros();
            }
            let kinds = format!("{runs} {straddling} {others}");
            assert!(runs > 20 && straddling > 100 && others > 100, "{kinds}");
        }
    }
}
