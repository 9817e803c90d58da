//! Whether a crowded cell is divided, and the entries that it then has.
//!
//! It is if its triangles are smaller than it, and its parts list fewer of them, or can be
//! divided again. What it then takes is paid for: each reference of a cell brings a share of
//! [`WORDS`] for each triangle of the mesh, of which the chunk of a divided cell takes its
//! words, and its own crowded cells share the rest. A cell whose share is too small is cut
//! into fewer parts, or not at all.

#![expect(clippy::cast_possible_truncation, reason = "numbers of cells")]

use fearless_simd::prelude::*;
use fearless_simd::{Simd, mask32x8, u32x8};

use super::frame::{Frame, Scene, classify};
use super::groups::Groups;
use super::layout::{AXES, BLOCK, Bench, Class, ENTRY_WORDS, Entry, place};
use super::sort::{measure, tally};

/// Words that all divided cells may take for each triangle of the mesh.
pub(super) const WORDS: u64 = 12;

/// The words that each of so many references brings.
pub(super) const fn share(triangles: u32, references: u64) -> u64 {
    match (WORDS * triangles as u64).checked_div(references) {
        Some(share) if share < WORDS => share,
        _ => WORDS,
    }
}

/// A crowded cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crowd {
    /// Its number.
    pub(super) cell: usize,
    /// Triangles that it lists.
    pub(super) listed: u32,
    /// Words that each of them brings.
    pub(super) share: u64,
}

/// How a cell is divided: its triangles are sorted into this frame, in these groups, and
/// each reference has this share left.
pub(super) struct Plan {
    pub(super) frame: Frame,
    pub(super) groups: Groups,
    pub(super) share: u64,
}

/// Shows the entries that a cell lists.
///
/// Every crowded cell looks at all entries of its block, so it looks at eight at once.
#[inline(always)]
fn each_of_cell<S: Simd>(simd: S, entries: &[Entry], cell: usize, mut visit: impl FnMut(Entry)) {
    let (eights, rest) = entries.as_chunks::<8>();
    for eight in eights {
        let mut listed = listed_of_eight(simd, eight, cell as u32);
        while listed != 0 {
            let bit = listed.trailing_zeros() as usize;
            listed &= listed - 1;
            if let Some(entry) = eight.get(bit) {
                visit(*entry);
            }
        }
    }
    of_cell(rest, cell).for_each(visit);
}

/// The entries that a cell lists, one by one.
fn of_cell(entries: &[Entry], cell: usize) -> impl Iterator<Item = Entry> + '_ {
    let cell = place(cell as u32);
    entries.iter().copied().filter(move |entry| {
        let (min, max) = (place(entry.min()), place(entry.max()));
        let holds = (0..3).all(|axis| (min[axis]..=max[axis]).contains(&cell[axis]));
        holds && entry.class() == Class::Cells
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
pub(super) fn count_of_cell<S: Simd>(simd: S, entries: &[Entry], cell: usize) -> u32 {
    simd.vectorize(
        #[inline(always)]
        || {
            let mut count = 0;
            each_of_cell(simd, entries, cell, |_| count += 1);
            count
        },
    )
}

/// Puts the triangles of a cell on the next bench, if to divide the cell gains
/// something and is paid for: the triangles are smaller than it, and its parts list
/// fewer of them or can be divided again.
pub(super) fn plan<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    frame: &Frame,
    entries: &[Entry],
    crowd: &Crowd,
    benches: &mut [Bench<'_>],
) -> Option<Plan> {
    simd.vectorize(
        #[inline(always)]
        || {
            let (bench, deeper) = benches.split_first_mut()?;
            let room = crowd.share * u64::from(crowd.listed);
            let mut most = BLOCK;
            loop {
                let (inner, groups, wanted) =
                    collect(simd, scene, frame, entries, crowd, most, bench)?;
                let sorted = bench.entries.get(..groups.count())?;
                let block = tally(
                    &groups,
                    sorted,
                    scene.format(),
                    bench.cells.first_chunk_mut()?,
                    bench.bricks,
                );
                let measure = measure(simd, bench.cells, bench.bricks, block);
                let Some(rest) = room.checked_sub(measure.words() as u64) else {
                    // Too many words: fewer parts.
                    most = inner.cells / 2;
                    continue;
                };
                let listed = u64::from(crowd.listed);
                let separates = 10 * u64::from(measure.longest.max(block)) <= 9 * listed;
                // Triangles so small that they all lie in one part are for the next division.
                let is_finer = wanted >= 2 * BLOCK && !deeper.is_empty();
                let is_no_more = u64::from(measure.references + measure.large) <= 2 * listed;
                let share = rest / u64::from(measure.references.max(1));
                let gains = separates || is_finer && is_no_more;
                break gains.then_some(Plan { frame: inner, groups, share });
            }
        },
    )
}

/// The whole part of a number; 0 if it is none.
#[expect(clippy::cast_sign_loss, reason = "saturates")]
const fn wholes(number: f64) -> u32 {
    number as u32
}

/// Puts the triangles of a cell on a bench, if they are small enough to divide it, into so many
/// cells an axis at most; tells into how many they would.
#[inline(always)]
fn collect<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    frame: &Frame,
    entries: &[Entry],
    &Crowd { cell, listed, .. }: &Crowd,
    most: u32,
    bench: &mut Bench<'_>,
) -> Option<(Frame, Groups, u32)> {
    // What the cell lists, and soon what its parts will, waits where cells will be counted, or
    // behind the entries, if there is room.
    let length = listed as usize;
    let (sorted, behind) = bench.entries.split_at_mut_checked(length)?;
    let in_cells: &mut [Entry] = bytemuck::try_cast_slice_mut(bench.cells).ok()?;
    let waiting = match in_cells.get_mut(..length) {
        Some(waiting) => waiting,
        None => behind.get_mut(..length).unwrap_or_default(),
    };
    let mut slots = waiting.iter_mut();
    each_of_cell(simd, entries, cell, |entry| {
        if let Some(slot) = slots.next() {
            *slot = entry;
        }
    });

    // As many cells as two of its mean triangles are wide, but none so
    // small that the margin counts.
    let format = scene.format();
    let mut sum = 0.0;
    let mut add = |entry: Entry| {
        if let Some(reach) = scene.reach(entry.id(format)) {
            sum += f64::from(reach.size().max_element());
        }
    };
    if waiting.is_empty() {
        of_cell(entries, cell).for_each(&mut add);
    } else {
        waiting.iter().copied().for_each(&mut add);
    }
    let mean = sum / f64::from(listed);
    let width = (2.0 * mean).max(4.0 * f64::from(scene.lattice.margin().max_element()));
    let count = wholes(1.0 / (width * f64::from(frame.scale)));
    let frame = frame.child(place(cell as u32), count.min(most));
    if count.min(most) < 2 {
        return None;
    }

    let entry = |around: Entry| {
        let id = around.id(format);
        let (range, halves) = frame.range(&scene.reach(id)?);
        // No list of the lattice's blocks takes it: at most it is in the list of all of the cell.
        let class = classify(range.min, range.max, 1).unwrap_or(Class::Blocks);
        Some(Entry::new(format.word(id, halves), range.min, range.max, class))
    };
    for slot in waiting.iter_mut() {
        *slot = entry(*slot)?;
    }
    let groups = if waiting.is_empty() {
        Groups::collect(|| of_cell(entries, cell).filter_map(entry), sorted)
    } else {
        Groups::collect(|| waiting.iter().copied(), sorted)
    };
    Some((frame, groups?, count))
}
