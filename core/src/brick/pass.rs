//! The pass over the triangles, twice: once to count the entries of each block, once to write them.
//!
//! Almost all triangles lie in at most two cells an axis, and most of these in one block. For them
//! everything is done in vectors ([`places`](super::places)); what is larger, or has no number, is
//! looked at once more.

#![expect(
    clippy::cast_possible_truncation,
    reason = "the few triangles of a batch, the words of entries"
)]

use core::ops::Range;

use fearless_simd::Simd;
use glam::{Vec3A, Vec4};

use super::frame::{classify, lists, range};
use super::halves::{Format, Halves};
use super::layout::{BLOCK, Class, Entry};
use super::places::{BATCH, Places, straddling};
use crate::aabb::Aabb;
use crate::cell::{CellRange, Lattice};
use crate::config::BuildFlags;
use crate::eight::LANES;
use crate::error::Error;
use crate::mesh::TriangleMesh;
use crate::simd::{Kernel, SimdLevel, dispatch};
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
    /// Its cells, and the halves of the outermost.
    pub(super) range: CellRange,
    pub(super) halves: Halves,
    /// What lists it, if not the whole grid.
    pub(super) class: Option<Class>,
}

impl Home {
    /// That of a triangle with these corners; `None` if a coordinate is not finite.
    #[inline(always)]
    pub(super) fn of(lattice: &Lattice, most_blocks: u64, corners: [Vec3A; 3]) -> Option<Self> {
        let reach = lattice.reach(&Aabb::of(corners)?);
        let (range, halves) = range(reach, lattice.resolution);
        Some(Self { range, halves, class: classify(range.min, range.max, most_blocks) })
    }

    /// The part of it in a block that it reaches: its cells there, and the halves.
    #[inline(always)]
    pub(super) fn in_block(&self, [x, y, z]: [u32; 3]) -> (CellRange, Halves) {
        self.part([self.along(0, x), self.along(1, y), self.along(2, z)])
    }

    #[inline(always)]
    fn part(&self, [x, y, z]: [Along; 3]) -> (CellRange, Halves) {
        let before = x.before | y.before << 1 | z.before << 2;
        let behind = x.behind | y.behind << 1 | z.behind << 2;
        let range = CellRange { min: [x.first, y.first, z.first], max: [x.last, y.last, z.last] };
        (range, self.halves.through(before, behind))
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
    fn listed(&mut self, entries: u64, references: u64);

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
    let spans = Spans::new(simd, ground.lattice, 2);
    let format = Format::of(ground.mesh.triangle_count());
    let wide = ground.mesh.wide();
    let [x, y, z] = [1, ground.blocks[0], ground.blocks[0] * ground.blocks[1]];
    let offsets = [0, x, y, x + y, z, x + z, y + z, x + y + z];
    let mut batch = Places::NONE;
    let mut first = ids.start;
    while first < ids.end {
        let count = (ids.end - first).min(BATCH);
        batch.find::<S, ENTRIES>(simd, &spans, ground.blocks, &wide, first, count);
        batch.find_runs(simd);
        visitor.listed(batch.plain.count_ones().into(), batch.lists.into());

        let mut at = 0;
        while at < count {
            let id = first + at;
            if batch.runs >> at & 1 == 1 {
                visitor.run(batch.block(at), batch.eight(at, id, format));
                at += LANES as u32;
                continue;
            }
            let (block, entry) = (batch.block(at), batch.entry(at, id, format));
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
            // Each of its blocks: those on the far side of the axes of every subset.
            let (entry, straddles) = straddling(entry);
            visitor.listed(1 << straddles.count_ones(), entry.lists());
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
            let corners = match ground.mesh.wide().corners(id) {
                Some([a, b, c]) => Some([vector(a), vector(b), vector(c)]),
                None => ground.mesh.corners(id, Vec3A::new),
            };
            let Some(corners) = corners else {
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
            visitor.listed(blocks.count(), lists(min, max, class.shift()));
            for z in low[2]..=high[2] {
                let on_z = home.along(2, z);
                for y in low[1]..=high[1] {
                    let on_y = home.along(1, y);
                    for x in low[0]..=high[0] {
                        let block = x + ground.blocks[0] * (y + ground.blocks[1] * z);
                        let (part, halves) = home.part([home.along(0, x), on_y, on_z]);
                        let word = format.word(id, halves);
                        let entry = Entry::new(word, part.min, part.max, class);
                        visitor.entry(block as usize, entry);
                    }
                }
            }
            Ok(())
        },
    )
}

/// A corner from its bytes and those behind it.
#[inline(always)]
fn vector(bytes: &[u8; 16]) -> Vec3A {
    let row: [f32; 4] = bytemuck::cast(*bytes);
    Vec3A::from_vec4(Vec4::from_array(row))
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
    fn listed(&mut self, entries: u64, references: u64) {
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
            self.words.set(at, words);
        }
    }

    #[inline(always)]
    fn run(&mut self, block: usize, [a, b, c, d, e, f, g, h]: [Entry; LANES]) {
        if let Some(head) = self.heads.get_mut(block) {
            let ([a, i], [b, j], [c, k], [d, l]) = (a.words(), b.words(), c.words(), d.words());
            let ([e, m], [f, n], [g, o], [h, p]) = (e.words(), f.words(), g.words(), h.words());
            let words = [a, i, b, j, c, k, d, l, e, m, f, n, g, o, h, p];
            let at = *head;
            *head = at.wrapping_add(words.len() as u32);
            self.words.set(at, words);
        }
    }

    #[inline(always)]
    fn listed(&mut self, _: u64, _: u64) {}

    fn large(&mut self, id: u32) {
        self.words.set(self.large, [id]);
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
