//! The memory that a tree takes, and the place of everything in it.
//!
//! ```text
//! index    | header 128 B | ids: u32 a triangle | nodes: 80 B each | fine sides: 196 B each |
//! scratch  | counts of the bins, for each task  | entries: 8 B a triangle | spare: 8 B a triangle |
//! ```
//!
//! The bounds of quality `fast` depend on the number `n` of triangles alone ([`high`](super::high) has its own):
//!
//! - A node of a subtree has eight children, or none that are nodes. So a subtree over `m` triangles has no more than
//!   (m - 1) / 7 nodes below its root ([`subtree`](super::subtree)).
//! - Let `R` be the number of roots. Above them, `a` nodes have eight children. `b` nodes have fewer, and all their
//!   children are roots. Then `R >= 7 a + b` and `b <= R / 2`, so `a + b <= 4 R / 7`. So each root costs at most
//!   1 + 4/7 = 11/7 nodes, itself included.
//! - There is no more than one subtree for [`TRIANGLES_PER_SUBTREE`] triangles ([`units`](super::units)). The rest of
//!   [`NODES_PER_TRIANGLE`] is left for the nodes below roots: a subtree that would have more is built
//!   again by halving its entries ([`most_of_subtree`]).
//! - A unit may have too few triangles for a subtree if it is the last one behind the crowded bins, or the last one of
//!   a division of a crowded bin. Each such unit adds one subtree. A crowded bin has more than [`CROWD`] triangles, and
//!   divisions nest at most [`DIVISIONS`] deep.
//!
//! Each bin has a count for every task and one in total, and there is at most one bin for sixteen triangles, or a
//! single one. A unit is sorted with `spare` as the second buffer, of as many entries. More of it is needed by
//! several tasks, for the centres of crowded bins that have no room in the index (8 bytes a triangle without an index),
//! and for keys and the tree on top where the index has no room for them.
//!
//! So two linear functions bound the index and the scratch of a build with one task (in C `HGRID_INDEX_BOUND`,
//! 16 n + 640, and `HGRID_SCRATCH_BOUND`, 17 n + 320; a test compares them for many `n`):
//!
//! ```text
//! late       <= 5 n / 4097 + 1                      subtrees behind crowded bins, see above
//! nodes      <= 0.14625 n + 1 + 11 late / 7 + 3     1 as the first term is rounded up; 3 are to spare
//! fine       <= n / 2048                             none below 2048 triangles
//! index       = 128 + 4 n + 80 nodes + 196 fine, and paddings of at most 60, 48 and 60
//!            <= 15.7 n + 636                        n < 2048: one late subtree has one node; 11 / 7 is rounded down
//!            <= 15.8 n + 696 <= 16 n + 640          n < 4097: the same
//!            <= 15.96 n + 742 <= 16 n + 640         otherwise
//! scratch     = 2 x 4 bins + 8 n + 8 n, and 4 paddings of at most 60; one bin, or 16 triangles or more a bin
//!            <= 16.5 n + 248
//! ```

use crate::arena::section_bytes;
use crate::blob::HEADER_BYTES;

use super::fine::FineSides;
use super::node::Node;

/// Levels of nodes, at most. Quality `fast` makes up to 47: 20 by SAH and 9 that halve ranges of roots
/// ([`top`](super::top)), and 18 of a subtree, which has at most 18 nodes ([`subtree`](super::subtree)). Quality `high`
/// makes up to 35 ([`high`](super::high)). The rest is reserve.
pub(crate) const LEVELS: u32 = 64;

/// Triangles for each subtree, at least, on average.
pub(crate) const TRIANGLES_PER_SUBTREE: usize = 24;

/// Triangles of a subtree, at most.
pub(crate) const MOST_SUBTREE: usize = 128;

/// Triangles of each subtree of a unit that has more than [`MOST_SUBTREE`], at least.
pub(crate) const LEAST_PIECE: usize = 32;

const _: () = assert!(TRIANGLES_PER_SUBTREE <= LEAST_PIECE && 2 * LEAST_PIECE <= MOST_SUBTREE);

/// Nodes for each triangle, in parts of [`WHOLE`], that roots and the nodes above and below them may cost: 0.14625, or
/// 11.7 bytes. With 4 bytes of ids, 0.16 of late subtrees and 0.1 of fine sides an index takes less than 16 bytes a
/// triangle.
const NODES_PER_TRIANGLE: u32 = 2457;
/// A multiple of 7 * 24, so that 11/7 nodes for 24 triangles are a whole number of parts.
const WHOLE: u32 = 16_800;

/// The part of [`NODES_PER_TRIANGLE`] for the nodes below the roots.
#[expect(clippy::cast_possible_truncation, reason = "a small constant")]
const NODES_PER_TRIANGLE_BELOW: u32 =
    NODES_PER_TRIANGLE - WHOLE * 11 / 7 / TRIANGLES_PER_SUBTREE as u32;

/// The most nodes below the root of a subtree of so many triangles.
pub(crate) const fn most_of_subtree(triangles: usize) -> usize {
    debug_assert!(triangles <= MOST_SUBTREE, "too many triangles for a subtree");
    NODES_PER_TRIANGLE_BELOW as usize * triangles / WHOLE as usize
}

/// Bins with more entries are crowded: they come first. Those with more than [`MOST_UNIT`] are divided.
pub(crate) const CROWD: usize = 4096;

/// Entries of a unit of bins that is not divided, at most: a bin, and before and behind it fewer entries than a subtree
/// needs.
pub(crate) const MOST_UNIT: usize = CROWD + 2 * TRIANGLES_PER_SUBTREE;

/// Divisions of a bin inside one another, at most.
pub(crate) const DIVISIONS: u32 = 5;

/// The most bits of a key that choose a bin.
const MOST_BITS: u32 = 18;

/// The entry of a triangle during a build: its key, then its id.
pub(crate) type Entry = [u32; 2];

/// The most triangles of a tree: it then has fewer than 2^29 nodes, and a place on the stack of a query has 32 bits for
/// the number of a node and a slot of three bits.
pub(crate) const MOST_TRIANGLES: u32 = 1 << 31;

/// Bits of a key that choose one of the bins for so many triangles: sixteen or more a bin on average.
pub(crate) const fn bin_bits(triangles: u64) -> u32 {
    let mut bits = 0;
    while bits < MOST_BITS && 16 << (bits + 3) <= triangles {
        bits += 3;
    }
    bits
}

/// Subtrees behind crowded bins, at most.
#[expect(clippy::cast_possible_truncation, reason = "a small constant")]
const fn late_subtrees(triangles: u32) -> u32 {
    DIVISIONS * (triangles / (CROWD as u32 + 1)) + 1
}

/// So many parts of [`WHOLE`] for each triangle, in sum and rounded up. Computed in 32 bits: to divide 64, a
/// microcontroller calls a function of a kilobyte.
const fn parts_of(triangles: u32, parts: u32) -> u32 {
    triangles / WHOLE * parts + (triangles % WHOLE * parts).div_ceil(WHOLE)
}

/// The most nodes below the roots of subtrees that hold so many triangles.
pub(crate) const fn most_below(triangles: u32) -> u32 {
    parts_of(triangles, NODES_PER_TRIANGLE_BELOW)
}

/// The most nodes of a tree over so many triangles.
pub(crate) const fn most_nodes(triangles: u32) -> u32 {
    // Three are to spare.
    parts_of(triangles, NODES_PER_TRIANGLE) + 11 * late_subtrees(triangles) / 7 + 3
}

/// Bytes of an index with so many ids, nodes and fine sides.
pub(crate) const fn index_bytes(ids: u64, nodes: u64, fine: u64) -> u64 {
    HEADER_BYTES as u64
        + section_bytes::<u32>(ids)
        + section_bytes::<Node>(nodes)
        + section_bytes::<FineSides>(fine)
}

/// Bytes of the counts of all bins for so many tasks.
const fn count_bytes(triangles: u64, tasks: u64) -> u64 {
    (tasks + 1) * section_bytes::<u32>(1 << bin_bits(triangles))
}

/// Bytes of scratch: for counts, entries and a `spare` of so many entries.
pub(crate) const fn scratch_bytes(triangles: u64, tasks: u64, spare: u64) -> u64 {
    count_bytes(triangles, tasks)
        + section_bytes::<Entry>(triangles)
        + section_bytes::<Entry>(spare)
}

/// Entries of the `spare` of a single task, as long as no bin is crowded.
pub(crate) const fn small_spare(triangles: u64) -> u64 {
    if (MOST_UNIT as u64) < triangles { MOST_UNIT as u64 } else { triangles }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_those_of_all_triangles_at_once() {
        let whole = [1, 2, 127, 255_652].map(|wholes| wholes * WHOLE);
        let near = whole.iter().flat_map(|&triangles| [triangles - 1, triangles, triangles + 1]);
        for triangles in near.chain([0, 1, 9, 4097, 1 << 31, u32::MAX]) {
            for parts in [NODES_PER_TRIANGLE, NODES_PER_TRIANGLE_BELOW] {
                let all = (u64::from(triangles) * u64::from(parts)).div_ceil(WHOLE.into());
                assert_eq!(u64::from(parts_of(triangles, parts)), all, "{triangles}");
            }
        }
    }
}
