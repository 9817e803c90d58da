//! Whether a crowded cell is divided, and the entries that it then has.
//!
//! It is if its triangles are smaller than it, and its parts list fewer of them, or can be
//! divided again. What it then takes is paid for: each reference of a cell brings a share of
//! [`WORDS`] for each triangle of the mesh, of which the chunk of a divided cell takes its
//! words, and its own crowded cells share the rest. A cell whose share is too small is cut
//! into fewer parts, or not at all.

use fearless_simd::Simd;

use super::crowds::Crowd;
use super::frame::{Frame, Scene, classify};
use super::groups::Groups;
use super::layout::{BLOCK, Bench, Class, Entry, place};
use super::sort::{measure, tally};
use crate::cell::whole;

/// Words that all divided cells may take for each triangle of the mesh.
pub(super) const WORDS: u64 = 12;

/// The words that each of so many references brings.
pub(super) const fn share(triangles: u32, references: u64) -> u64 {
    match (WORDS * triangles as u64).checked_div(references) {
        Some(share) if share < WORDS => share,
        _ => WORDS,
    }
}

/// How a cell is divided: its triangles are sorted into this frame, in these groups, and
/// each reference has this share left.
pub(super) struct Plan {
    pub(super) frame: Frame,
    pub(super) groups: Groups,
    pub(super) share: u64,
}

/// Puts the triangles of a cell on the next bench, if to divide the cell gains
/// something and is paid for: the triangles are smaller than it, and its parts list
/// fewer of them or can be divided again.
pub(super) fn plan<S: Simd>(
    simd: S,
    scene: &Scene<'_>,
    frame: &Frame,
    crowd: Crowd<'_>,
    share: u64,
    benches: &mut [Bench<'_>],
) -> Option<Plan> {
    simd.vectorize(
        #[inline(always)]
        || {
            let (bench, deeper) = benches.split_first_mut()?;
            let listed = crowd.ids.len() as u64;
            let room = share * listed;
            let wanted = wanted(scene, frame, crowd.ids);
            let mut most = BLOCK.min(wanted);
            loop {
                let (inner, groups) = collect(scene, frame, crowd, most, bench)?;
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

/// Puts the triangles of a cell on a bench that is cut into so many cells an axis.
#[inline(always)]
fn collect(
    scene: &Scene<'_>,
    frame: &Frame,
    Crowd { cell, ids }: Crowd<'_>,
    cells: u32,
    bench: &mut Bench<'_>,
) -> Option<(Frame, Groups)> {
    if cells < 2 {
        return None;
    }
    let frame = frame.child(place(cell), cells);

    // They wait where cells will be counted, or behind those that are sorted; if there is
    // no room, each is made twice.
    let (sorted, behind) = bench.entries.split_at_mut_checked(ids.len())?;
    let in_cells: &mut [Entry] = bytemuck::try_cast_slice_mut(bench.cells).ok()?;
    let waiting = match in_cells.get_mut(..ids.len()) {
        Some(waiting) => waiting,
        None => behind.get_mut(..ids.len()).unwrap_or_default(),
    };
    let groups = if waiting.is_empty() {
        Groups::collect(|| ids.iter().filter_map(|&id| entry(scene, &frame, id)), sorted)
    } else {
        for (slot, &id) in waiting.iter_mut().zip(ids) {
            *slot = entry(scene, &frame, id)?;
        }
        Groups::collect(|| waiting.iter().copied(), sorted)
    };
    Some((frame, groups?))
}

/// Into how many cells an axis the triangles of a cell would divide it: as many as two of its usual
/// triangles are wide, but none so small that the margin counts.
fn wanted(scene: &Scene<'_>, frame: &Frame, ids: &[u32]) -> u32 {
    let margin = scene.lattice.margin().max_element();
    let width = (2.0 * usual_size(scene, ids)).max(4.0 * margin);
    whole(1.0 / (width * frame.scale))
}

/// The mean size of a sample of triangles, in cells of the lattice.
///
/// A few that are much larger do not count: they would keep a crowd of tiny ones together.
fn usual_size(scene: &Scene<'_>, ids: &[u32]) -> f32 {
    const SAMPLE: usize = 128;
    /// In means of all: up to an eighth of them may be as large as that.
    const LARGE: f32 = 8.0;
    let (mut sizes, mut count) = ([0.0; SAMPLE], 0);
    let sample = ids.iter().step_by(ids.len().div_ceil(SAMPLE) | 1);
    for reach in sample.filter_map(|&id| scene.reach(id)) {
        if let Some(slot) = sizes.get_mut(count) {
            *slot = reach.size().max_element();
            count += 1;
        }
    }
    let sizes = sizes.get(..count).unwrap_or_default();
    let mean_below = |limit: f32| {
        let (mut sum, mut count) = (0.0, 0.0);
        for &size in sizes {
            let counts = f32::from(u8::from(size <= limit));
            (sum, count) = (sum + size * counts, count + counts);
        }
        sum / count
    };
    mean_below(LARGE * mean_below(f32::INFINITY))
}

/// The entry of a triangle in a divided cell.
#[inline(always)]
fn entry(scene: &Scene<'_>, frame: &Frame, id: u32) -> Option<Entry> {
    let (range, quarters) = frame.range(&scene.reach(id)?);
    // No list of the lattice's blocks takes it: at most it is in the list of all of the cell.
    let class = classify(range.min, range.max, 1).unwrap_or(Class::Blocks);
    Some(Entry::new(scene.format().word(id, quarters), range.min, range.max, class))
}
