//! Building a variable grid: a one-level plan, its lists in the scratch, then cell by cell into the pool.
//!
//! ```text
//! scratch | plan of the top | hash | references | owners of slots | rows, bits, slots of a subgrid |
//! index   | header | row_offsets | domain_bits | hash | pool, a bump allocator ->
//! ```
//!
//! The pool is filled in the order of the slots, so a list ends where the next one starts and
//! nothing is moved. When the pool runs out the build goes on planning subgrids and counting words:
//! at the end it knows, exactly, what index it would have needed. That is also how `sizes` answers.

use core::ops::Range;

use super::subgrid::{Frame, SubLayout};
use crate::aabb::Aabb;
use crate::arena::{Sizes, copy, section_bytes, split_mut};
use crate::bits::{WORD_BITS, each_one, halves};
use crate::blob::Header;
use crate::bump::{Bump, GRID, finish};
use crate::cell::{CellRange, Lattice};
use crate::config::{BuildFlags, Parameters};
use crate::control::Watch;
use crate::error::{ConfigField, Error, Region};
use crate::invariant::OrBug;
use crate::lists::pairs;
use crate::mesh::TriangleMesh;
use crate::one_level::{
    Layout, MeshSpread, PlacedBatch, Plan, Scratch, Spread, displace, fill, mark, slot,
};
use crate::survey::reference_limit;

/// The primitives of one cell over its subgrid.
struct CellSpread<'m> {
    mesh: &'m TriangleMesh<'m>,
    lattice: &'m Lattice,
    cell: [u32; 3],
    ids: &'m [u32],
    frame: Frame,
}

impl CellSpread<'_> {
    /// Returns the reach of a primitive, in cells of the top.
    fn reach(&self, id: u32) -> Option<Aabb> {
        let bounds = self.mesh.corners(id).and_then(Aabb::of);
        let bounds = bounds.or_bug("a list with a triangle that is not finite")?;
        Some(self.lattice.reach(&bounds))
    }
}

impl Spread for CellSpread<'_> {
    fn resolution(&self) -> [u32; 3] {
        self.frame.resolution
    }

    fn count(&self) -> u32 {
        u32::try_from(self.ids.len()).unwrap_or(u32::MAX)
    }

    #[inline(always)]
    fn range(&self, number: u32) -> Option<CellRange> {
        let id = *self.ids.get(number as usize).or_bug("a number behind the list")?;
        Some(self.frame.range(self.cell, &self.reach(id)?))
    }

    fn place(&self, numbers: Range<u32>, batch: &mut PlacedBatch) {
        batch.place_each(self, numbers);
    }
}

/// The scratch behind the plan of the top.
struct Lists<'s> {
    hash: &'s mut [u32],
    references: &'s mut [u32],
    /// The cell of every slot, or [`NOBODY`].
    owners: &'s mut [u32],
    rest: &'s mut [u8],
}

/// The owner of a slot that no cell uses.
const NOBODY: u32 = u32::MAX;

impl<'s> Lists<'s> {
    fn new(layout: &Layout, scratch: &'s mut [u8]) -> Option<Self> {
        let (hash, rest) = split_mut(scratch, u64::from(layout.hash_count) + 1)?;
        let (references, rest) = split_mut(rest, layout.reference_count.into())?;
        let (owners, rest) = split_mut(rest, layout.hash_count.into())?;
        Some(Self { hash, references, owners, rest })
    }
}

/// Bytes of scratch that are enough for a top with this layout, whatever its lists turn out to be.
const fn scratch_bytes_of(layout: &Layout, triangles: u32, density: f32) -> u64 {
    layout.scratch_bytes()
        + section_bytes::<u32>(layout.cells + 1)
        + section_bytes::<u32>(layout.reference_count as u64)
        + section_bytes::<u32>(layout.cells)
        + Layout::bound(triangles, density, 0).scratch_bytes()
}

/// The scratch that the build of a grid with this header takes.
pub(crate) const fn scratch_bytes(header: &Header) -> u64 {
    let Header { triangle_count, density, resolution, .. } = *header;
    let layout = Layout::new(resolution, 0, reference_limit(triangle_count), 0);
    scratch_bytes_of(&layout, triangle_count, density)
}

/// The most words of pool that so many references in the top can lead to.
///
/// A subgrid of n primitives has at most `density * n + 1` cells, each of which takes a bit, a slot
/// and at most a row, and [`reference_limit`] references.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a bound, rounded up")]
const fn pool_words(references: u32, density: f32, subdivide_above: u32) -> u32 {
    let per_reference = 2.1 * density as f64 + 16.0;
    let per_subgrid = 3.0 + 2.1 + 2.0 + reference_limit(0) as f64;
    let subgrids = references as f64 / (subdivide_above as f64 + 1.0);
    let words = references as f64 * per_reference + subgrids * per_subgrid;
    if words < GRID as f64 { words as u32 } else { GRID }
}

/// The most memory that a mesh with so many triangles can need.
pub(crate) const fn bound(triangles: u32, density: f32, subdivide_above: u32) -> (u64, u64) {
    let top = Layout::bound(triangles, density, 0);
    let pool_words = pool_words(top.reference_count, density, subdivide_above);
    let index_bytes = top.with_references(pool_words).index_bytes();
    (index_bytes, scratch_bytes_of(&top, triangles, density))
}

/// The memory that a mesh needs: exact if the scratch is large enough to plan in.
pub(crate) fn sizes(
    mesh: &TriangleMesh<'_>,
    density: f32,
    subdivide_above: u32,
    flags: BuildFlags,
    scratch: &mut [u8],
) -> Result<Sizes, Error> {
    let plan = TopPlan::new(mesh, density, flags, scratch, &Watch::none())?;
    let (top, scratch_bytes) = (plan.top.layout, plan.scratch_bytes);
    match run(mesh, subdivide_above, plan, &mut [], &Watch::none()) {
        Ok(header) => Sizes::new(header.blob_bytes, scratch_bytes, true),
        Err(Error::OutOfMemory { region: Region::Scratch, .. }) => {
            let pool_words = pool_words(top.reference_count, density, subdivide_above);
            let index_bytes = top.with_references(pool_words).index_bytes();
            Sizes::new(index_bytes, scratch_bytes, false)
        }
        Err(error) => Err(error),
    }
}

/// Builds into `index` and returns the part of it that is the blob.
pub(crate) fn build<'a>(
    mesh: &TriangleMesh<'_>,
    density: f32,
    subdivide_above: u32,
    flags: BuildFlags,
    index: &'a mut [u8],
    scratch: &mut [u8],
    watch: &Watch<'_>,
) -> Result<&'a [u8], Error> {
    let plan = TopPlan::new(mesh, density, flags, scratch, watch)?;
    let header = run(mesh, subdivide_above, plan, index, watch)?;
    finish(index, header)
}

/// The plan of the top, and the scratch that it was made in.
struct TopPlan<'s> {
    top: Plan<'s>,
    /// Enough for this mesh.
    scratch_bytes: u64,
    available_bytes: u64,
}

impl<'s> TopPlan<'s> {
    fn new(
        mesh: &TriangleMesh<'_>,
        density: f32,
        flags: BuildFlags,
        scratch: &'s mut [u8],
        watch: &Watch<'_>,
    ) -> Result<Self, Error> {
        let available_bytes = scratch.len() as u64;
        let top = Plan::new(mesh, density, flags, &(), scratch, watch)?;
        // Slots note their cell's number in a word.
        if top.layout.cells >= u64::from(NOBODY) {
            return Err(Error::InvalidConfig(ConfigField::Density));
        }
        let scratch_bytes = scratch_bytes_of(&top.layout, mesh.triangle_count(), density);
        Ok(Self { top, scratch_bytes, available_bytes })
    }
}

/// Builds as much as the index holds; the header says what all of it takes.
fn run(
    mesh: &TriangleMesh<'_>,
    subdivide_above: u32,
    plan: TopPlan<'_>,
    index: &mut [u8],
    watch: &Watch<'_>,
) -> Result<Header, Error> {
    let TopPlan { top: mut plan, scratch_bytes: needed_bytes, available_bytes } = plan;
    let too_small = Error::out_of_memory(Region::Scratch, needed_bytes, available_bytes);
    let Scratch { row_offsets: offsets, domain_bits, rest, .. } =
        plan.rows.take().ok_or(too_small)?;

    // Sort the triangles into the lists of the top, and find the longest.
    let lists = Lists::new(&plan.layout, rest).ok_or(too_small)?;
    let Lists { hash, references, owners, rest } = lists;
    fill(&MeshSpread::new(mesh, &plan.lattice), offsets, hash, references, &Watch::none())?;
    watch.at(0.5)?;
    debug_assert!(hash.is_sorted(), "a list that ends before it starts");
    let longest = pairs(hash).map(|(start, end)| end.wrapping_sub(start)).max().unwrap_or(0);
    // Arrays in which one subgrid after the other is planned.
    let mut bench = Layout::bound(longest, plan.density, 0).scratch(rest).ok_or(too_small)?;
    assign(plan.lattice.resolution, offsets, domain_bits, owners);

    // Cut the index into the sections of the top and the pool behind them, if it is large enough.
    let top = plan.layout.with_references(0);
    let split = usize::try_from(top.index_bytes()).ok();
    let (head, pool) = match split.and_then(|bytes| index.split_at_mut_checked(bytes)) {
        Some((head, pool)) => (top.sections_mut(head).or_bug("sections past their end"), pool),
        None => (None, &mut [][..]),
    };
    let mut pool = Bump::over(pool);
    let mut slots = head.map(|sections| {
        // Clear the header first: if the build ends with an error, the region must not open as a grid.
        sections.header.fill(0);
        copy(offsets, sections.row_offsets);
        copy(domain_bits, sections.domain_bits);
        sections.hash
    });

    // Move list after list into the pool, crowded ones as subgrids.
    let mut entry = |slot: usize, value: u32| {
        debug_assert!(slots.as_ref().is_none_or(|hash| slot < hash.len()), "a slot too many");
        if let Some(entry) = slots.as_mut().and_then(|hash| hash.get_mut(slot)) {
            *entry = value;
        }
    };
    let lists = pairs(hash).map(|(start, end)| {
        let list = references.get(start as usize..end as usize);
        list.or_bug("a list behind the references").unwrap_or_default()
    });
    let slot_count = plan.layout.hash_count;
    debug_assert!(owners.len() == slot_count as usize, "a slot without an owner");
    for (slot, (ids, &owner)) in lists.zip(&*owners).enumerate() {
        watch.step(u32::try_from(slot).unwrap_or(u32::MAX), slot_count, [0.5, 1.0])?;
        let start = pool.offset()?;
        debug_assert!(ids.is_empty() || owner != NOBODY, "a list of no cell");
        let cell = cell_of(owner, plan.lattice.resolution);
        let spread = CellSpread { mesh, lattice: &plan.lattice, cell, ids, frame: Frame::WHOLE };
        let is_crowded = ids.len() > subdivide_above as usize;
        if is_crowded && spread.subdivide(plan.density, &mut bench, &mut pool) {
            entry(slot, start | GRID);
            watch.between(u32::try_from(slot).unwrap_or(u32::MAX), slot_count, [0.5, 1.0])?;
        } else {
            entry(slot, start);
            // An exhausted pool is legal: it counts.
            if let Some(words) = pool.take(ids.len()) {
                copy(ids, words);
            }
        }
    }
    let pool_words = pool.offset()?;
    entry(owners.len(), pool_words);
    plan.layout = plan.layout.with_references(pool_words);
    Ok(plan.header(Parameters::Variable { density: plan.density, subdivide_above }, mesh))
}

/// Notes the cell of every slot.
fn assign([width, ..]: [u32; 3], row_offsets: &[i32], domain_bits: &[u64], owners: &mut [u32]) {
    owners.fill(NOBODY);
    for (row, &offset) in row_offsets.iter().enumerate() {
        let first = row * width as usize;
        each_one(domain_bits, first, width as usize, |x| {
            let owner = u32::try_from(x).ok().and_then(|x| owners.get_mut(slot(offset, x)?));
            debug_assert!(owner.is_some(), "a cell without a slot in the table");
            if let (Some(owner), Ok(cell)) = (owner, u32::try_from(first + x)) {
                *owner = cell;
            }
            true
        });
    }
}

/// The cell with this number, counted along x, then y, then z.
fn cell_of(number: u32, [width, height, _]: [u32; 3]) -> [u32; 3] {
    let row = number.checked_div(width).unwrap_or(0);
    [
        number.checked_rem(width).unwrap_or(0),
        row.checked_rem(height).unwrap_or(0),
        row.checked_div(height).unwrap_or(0),
    ]
}

impl CellSpread<'_> {
    /// Puts a subgrid of the primitives into the pool; `false` if it would gain too little.
    ///
    /// It must separate: the lists of its cells hold on average at most three quarters of the
    /// primitives. A pile of equal triangles stays a list.
    fn subdivide(mut self, density: f32, bench: &mut Scratch<'_>, pool: &mut Bump<'_>) -> bool {
        let Some(layout) = self.plan(density, bench) else { return false };
        // An exhausted pool is legal: it counts.
        let Some(words) = pool.take(layout.words()) else { return true };
        let Some(sections) = layout.sections_mut(words).or_bug("a subgrid larger than its words")
        else {
            return true;
        };
        let rows = bench.row_offsets.get(..sections.row_offsets.len());
        let rows = rows.or_bug("more rows than on the bench").unwrap_or_default();
        debug_assert!(
            sections.domain_bits.len() <= 2 * bench.domain_bits.len(),
            "more bits than on the bench"
        );
        for (to, from) in sections.row_offsets.iter_mut().zip(rows) {
            *to = from.cast_unsigned();
        }
        let halves = bench.domain_bits.iter().flat_map(|&word| halves(word));
        for (to, from) in sections.domain_bits.iter_mut().zip(halves) {
            *to = from;
        }
        let filled = fill(&self, rows, sections.hash, sections.references, &Watch::none());
        debug_assert!(filled.is_ok(), "a subgrid without its lists");
        if filled.is_err() {
            return false;
        }
        // The lists hold indices into the cell's list: replace them by its ids, which ascend as well.
        for reference in sections.references {
            let id = self.ids.get(*reference as usize).copied();
            *reference = id.or_bug("a number behind the list").unwrap_or(u32::MAX);
        }
        true
    }

    /// Plans a subgrid: its frame, and its rows on the bench.
    fn plan(&mut self, density: f32, bench: &mut Scratch<'_>) -> Option<SubLayout> {
        let reaches = self.ids.iter().filter_map(|&id| self.reach(id));
        let reach = reaches.reduce(|all, reach| all.union(&reach)).or_bug("an empty list")?;
        self.frame = Frame::around(&reach, self.cell);
        let count = u32::try_from(self.ids.len()).ok()?;

        // Settle the density as for the top.
        let mut density = f64::from(density);
        let (cells, reference_count) = loop {
            let is_refined = self.frame.refine(self.lattice.cell_size(), density, count);
            density *= 0.5;
            if !is_refined {
                continue;
            }
            let cells = self.frame.cells();
            let domain_bits = bench.domain_bits.get_mut(..cells.div_ceil(WORD_BITS));
            let domain_bits = domain_bits.or_bug("more cells than on the bench")?;
            let references = mark(self, domain_bits, reference_limit(count), &Watch::none());
            if let Some(references) = references.ok().or_bug("a plan that ends early")? {
                break (cells, references);
            }
        };
        let domain_bits =
            bench.domain_bits.get(..cells.div_ceil(WORD_BITS)).or_bug("too many cells")?;
        let lists: u32 = domain_bits.iter().map(|word| word.count_ones()).sum();
        if 4 * u64::from(reference_count) > 3 * u64::from(count) * u64::from(lists) {
            return None;
        }

        let [width, height, depth] = self.frame.resolution.map(|cells| cells as usize);
        let row_offsets = bench.row_offsets.get_mut(..height * depth).or_bug("too many rows")?;
        // Lend up to eight words more: first fit reads eight at a time, and the last ones one by one. Lend no more than
        // that: first fit clears what it gets.
        let enough = cells.div_ceil(WORD_BITS) + 1;
        let words = bench.occupied.len().min(enough + 8).max(enough);
        let occupied = bench.occupied.get_mut(..words).or_bug("more slots than on the bench")?;
        let hash_count = displace(bench.domain_bits, width, row_offsets, occupied);
        let hash_count = hash_count.or_bug("more slots than can be named")?;
        Some(SubLayout { frame: self.frame, hash_count, reference_count })
    }
}
