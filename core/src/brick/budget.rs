//! How much memory a brick grid may need: before the mesh was looked at, and when its triangles are
//! counted but not yet sorted.

use super::divide;
use super::extent::EXTENT_WORDS;
use super::layout::{ENTRY_WORDS, Layout, MASK_BITS, RECORD_WORDS};
use super::pass::Census;
use super::size::{MOST_LARGE, block_limit, reference_limit};
use crate::arena::section_bytes;
use crate::control::Control;

/// Words for the list of the whole grid.
pub(super) const fn large_words(census: &Census) -> u64 {
    1 + census.large as u64
}

/// Words without which the triangles cannot even be scattered.
pub(super) const fn least_words(census: &Census) -> u64 {
    large_words(census) + census.entries * ENTRY_WORDS as u64
}

/// Words that the chunks of scans take, and a little more.
pub(super) const fn likely_words(census: &Census) -> u64 {
    let likely = census.references + census.references / 7 + 64;
    let least = census.entries * ENTRY_WORDS as u64;
    if likely > least { likely } else { least }
}

/// The most words that so many references of so many triangles in so many blocks can take.
///
/// A reference takes two words if it is the only one of its list: one more for where the list
/// starts, or how long it is. A brick has a record, a chunk the end of its cells, and either may
/// have a list with an extent. A bin that was not read yet takes no more: two words an entry, which
/// is a reference at least. Divided cells have words of their own.
const fn words_for(triangles: u32, references: u64, blocks: u64, large: u64) -> u64 {
    let of_blocks = MASK_BITS as u64 * blocks;
    let bricks = if of_blocks < references { of_blocks } else { references };
    let heads = (RECORD_WORDS + EXTENT_WORDS) as u64 * bricks + (1 + EXTENT_WORDS) as u64 * blocks;
    1 + large + 2 * references + heads + divide::WORDS * triangles as u64
}

/// Words that are enough for a mesh, whatever comes out when it is sorted.
pub(super) fn enough_words(triangles: u32, layout: &Layout, census: &Census) -> u64 {
    let blocks = layout.block_count();
    words_for(triangles, census.references, blocks, census.large.into()).max(least_words(census))
}

/// The most memory that a mesh with so many triangles can need.
pub(crate) const fn bound(triangles: u32, tasks: u32) -> (u64, u64) {
    let (references, blocks) = (reference_limit(triangles), block_limit(triangles));
    let words = words_for(triangles, references, blocks, MOST_LARGE as u64);
    let layout = Layout::largest(blocks, triangles);
    let bins = 1 + MOST_LARGE as u64 + references * ENTRY_WORDS as u64;
    let scratch = layout.scratch_bytes(clamped(tasks)) + section_bytes::<u32>(bins);
    (layout.index_bytes(words), scratch)
}

/// A number of tasks that there can be.
pub(super) const fn clamped(tasks: u32) -> u32 {
    if tasks > Control::MAX_TASKS {
        Control::MAX_TASKS
    } else if tasks == 0 {
        1
    } else {
        tasks
    }
}

/// The most scratch that a build by one task takes for a grid with so many cells.
pub(crate) const fn scratch_bytes_at_most(resolution: [u32; 3], triangles: u32) -> u64 {
    Layout::new(resolution, triangles).scratch_bytes(1)
}
