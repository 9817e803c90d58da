//! From bins of entries to subtrees over up to `MOST_SUBTREE` triangles each. The tree on top ([`top`](super::top))
//! treats each as one item.
//!
//! ```text
//! for each unit (a crowded bin, or bins side by side with enough triangles for a subtree):
//!     too large to sort: new keys, in one grid or two over its centres, and new bins; then their units
//!     else: sort by key, split where high bits of the key change or in the middle, make a subtree of each part
//!           (of a large mesh: prefetch the unit's indices before the sort, its corners behind it)
//!
//! entries | records of roots | used up | this unit | later units |
//! spare   | centres of a crowded unit, then second buffer of the sorts | untouched |
//! ```
//!
//! A centre of a crowded unit has three numbers. The first replaces the key. The other two are stored in memory that
//! the build writes later in any case. One lies where the id will be. The other lies where nodes will be; if these are
//! too few, where the ids of later units will be; and then in `spare`. Once the entries have new keys, no centre is
//! needed any more, and the same memory is the second buffer when they are sorted by bins.
//!
//! The record of a root is 112 bytes, written over entries that were used up:
//! [`TRIANGLES_PER_SUBTREE`] of them for each subtree, 192 bytes.

#![expect(clippy::cast_possible_truncation, reason = "no more entries than ids have values")]

use core::ops::Range;

use zerocopy::{FromBytes, Immutable, IntoBytes, transmute};

use crate::aabb::Aabb;
use crate::arena::whole;
use crate::invariant::OrBug;
use crate::mesh::TriangleMesh;
use crate::simd::{HAS_PREFETCH, SimdLevel, dispatch, prefetch};
use crate::tasks::take;

use super::crowd::{self, NewKeys, sort_by_bin};
use super::crowd_key::{CrowdKeys, CrowdPart};
use super::layout::{
    CROWD, DIVISIONS, Entry, LEAST_PIECE, MOST_SUBTREE, MOST_UNIT, TRIANGLES_PER_SUBTREE,
};
use super::node::{LEAF, Node, WIDTH};
use super::sort::sort;
use super::subtree::{Build, SplitRule, Subtree};
use super::units::{SubtreeBudget, starts};

/// The record of a root: its node, its box and its counts.
#[repr(C)]
#[derive(Debug, Clone, Copy, FromBytes, Immutable, IntoBytes)]
pub(crate) struct RootRecord {
    pub(crate) node: Node,
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
    /// Triangles below it.
    pub(crate) count: u32,
    /// Levels of nodes.
    pub(crate) levels: u32,
}

/// The keys that a crowded unit was binned by.
struct Binned {
    /// Number of low key bits that do not choose a bin.
    shift: u32,
    /// The bit in which entries in the dense box differ from the others; 0 if there is no dense box.
    border: u32,
}

/// A record in entries.
pub(crate) const RECORD: usize = size_of::<RootRecord>() / size_of::<Entry>();

/// Triangles of the largest mesh whose units are read without prefetches: more do not fit into the caches of one core.
const CACHED_TRIANGLES: u32 = 150_000;

const _: () = assert!(size_of::<RootRecord>() == 112 && RECORD <= TRIANGLES_PER_SUBTREE);

impl RootRecord {
    /// Writes it to the start of some entries, if it has room there.
    pub(crate) fn write(&self, entries: Option<&mut [Entry]>) {
        if let Some(slot) = entries.and_then(|entries| entries.first_chunk_mut::<RECORD>()) {
            *slot = transmute!(*self);
        }
    }
}

/// Copies elements to the start of others, as many as have room there.
fn copy_what_fits<T: Copy>(from: &[T], to: Option<&mut [T]>) {
    for (slot, element) in to.into_iter().flatten().zip(from) {
        *slot = *element;
    }
}

/// The subtrees of a range of units.
pub(crate) struct Subtrees<'w> {
    pub(crate) mesh: &'w TriangleMesh<'w>,
    /// [`least_node`](super::node::least_node) of the tree.
    pub(crate) least: f32,
    /// The entries, over which the records are written.
    pub(crate) entries: &'w mut [Entry],
    /// Room for the entries of any unit that is sorted: as long as `entries` if units are crowded.
    pub(crate) spare: &'w mut [Entry],
    /// The ids, each at the place of its entry; until then, centres of crowded units. Empty without an index, or in one
    /// that is too small.
    pub(crate) ids: &'w mut [u32],
    /// Place of the first id in the index.
    pub(crate) first: u32,
    /// Destination of the nodes; until then, of centres of crowded units.
    pub(crate) nodes: &'w mut [Node],
    /// The number of the first of the nodes in the index.
    pub(crate) child: u32,
    /// Counters for bins: one for each bin of the tree, and a division never has more bins.
    pub(super) counts: &'w mut [u32],
    pub(super) subtree: &'w mut Subtree,
    pub(super) simd_level: SimdLevel,
    /// Nodes so far, whether or not there was room for them.
    pub(crate) node_count: u32,
    pub(crate) subtree_count: u32,
    /// The record of the last root.
    pub(crate) last: RootRecord,
}

impl Subtrees<'_> {
    /// Makes the subtrees of a unit that lies `depth` divisions deep. Its bins are in order; the keys of one bin differ
    /// only in their lowest `shift` bits.
    pub(crate) fn unit(&mut self, range: Range<usize>, shift: u32, depth: u32) {
        debug_assert!(range.end <= self.entries.len(), "a unit behind the entries");
        if range.len() > MOST_UNIT {
            if depth < DIVISIONS {
                let mesh = self.mesh;
                let centers = crowd::centers(mesh, &mut self.crowd(&range).0);
                if centers.size().max_element() > 0.0 {
                    self.divide(range, &centers, depth);
                    return;
                }
            }
            // Equal centres keep the order of their ids. So do units that are still crowded: their keys are not in
            // order, and each split would look for a change of bits anew.
            for entry in self.entries.get_mut(range.clone()).into_iter().flatten() {
                entry[0] = 0;
            }
        } else {
            self.sort(&range, shift, depth);
        }
        self.make_subtrees(range);
    }

    /// Sorts the entries of a unit, and prefetches its triangles. Out of line: nested divisions would each keep its
    /// variables on the stack.
    #[inline(never)]
    fn sort(&mut self, range: &Range<usize>, shift: u32, depth: u32) {
        let entries = self.entries.get_mut(range.clone());
        let spare = self.spare.get_mut(..range.len()).or_bug("no room to sort");
        let (Some(entries), Some(spare)) = (entries, spare) else { return };
        let (Some(&first), Some(&last)) = (entries.first(), entries.last()) else { return };
        let differing = first[0] ^ last[0];
        // The triangles of a division have just been read.
        let is_far = depth == 0 && self.mesh.triangle_count() > CACHED_TRIANGLES;
        let near = (HAS_PREFETCH && is_far).then(|| self.mesh.part_around(first[1]));
        if let Some(near) = near {
            for &[_, id] in &*entries {
                let (wide, own) = near.own(id);
                wide.indices(own).map(prefetch);
            }
        }
        sort(self.simd_level, entries, spare, (32 - differing.leading_zeros()).max(shift));
        if let Some(near) = near {
            for &[_, id] in &*entries {
                near.corners(id).map(|corners| corners.map(prefetch));
            }
        }
    }

    /// Makes subtrees of the entries of a unit, which are sorted by key. A range of more than [`MOST_SUBTREE`] entries
    /// is split in two: where the highest bit changes in which the keys of its ends differ, or in the middle if they
    /// are equal. No part has fewer than [`LEAST_PIECE`] entries.
    ///
    /// A unit that is still too large after [`DIVISIONS`] divisions is halved by ids, which makes worse boxes.
    fn make_subtrees(&mut self, range: Range<usize>) {
        // In order, this ends after at most one split for each bit of a key, and one for each halving.
        debug_assert!(
            self.entries
                .get(range.clone())
                .is_some_and(|unit| unit.is_sorted_by_key(|entry| entry[0])),
            "keys out of order"
        );
        let mut start = range.start;
        while start < range.end {
            let mut end = range.end;
            while end - start > MOST_SUBTREE {
                end = start + self.split(start..end);
            }
            self.make_subtree(start..end);
            start = end;
        }
    }

    /// Splits a range in two and returns the length of the first part. No part has fewer than [`LEAST_PIECE`] entries.
    fn split(&self, range: Range<usize>) -> usize {
        let entries = self.entries.get(range).unwrap_or_default();
        debug_assert!(entries.len() > MOST_SUBTREE, "too few entries to split");
        let (Some(first), Some(last)) = (entries.first(), entries.last()) else { return 0 };
        let differing = first[0] ^ last[0];
        let middle = if differing == 0 {
            entries.len() / 2
        } else {
            let bit = 1 << differing.ilog2();
            entries.partition_point(|entry| entry[0] & bit == 0)
        };
        middle.min(entries.len().saturating_sub(LEAST_PIECE)).max(LEAST_PIECE)
    }

    /// Makes the subtree of a few entries, and leaves a record of it.
    fn make_subtree(&mut self, range: Range<usize>) {
        let count = range.len() as u32;
        let first = self.first + range.start as u32;
        let child = self.child + self.node_count;
        debug_assert!(range.end <= self.entries.len(), "a subtree behind the entries");
        let Some(entries) = self.entries.get(range.clone()) else { return };
        // Make the subtree, and copy its ids and nodes to the index.
        let subtree = &mut *self.subtree;
        let (mesh, least, by) = (self.mesh, self.least, SplitRule::Keys);
        dispatch(self.simd_level, Build { subtree, mesh, entries, first, child, least, by });
        // Too little room for ids and nodes is legal: they are counted.
        copy_what_fits(self.subtree.ids(), self.ids.get_mut(range.clone()));

        let below = self.subtree.below();
        copy_what_fits(below, self.nodes.get_mut(self.node_count as usize..));
        self.node_count += below.len() as u32;
        // Write the record over entries that are used up.
        let (node, &[x, y, z, _, u, v, w, _]) = self.subtree.root();
        let (min, max) = ([x, y, z], [-u, -v, -w]);
        let levels = self.subtree.levels();
        let record = RootRecord { node: *node, min, max, count, levels };
        let start = self.subtree_count as usize * RECORD;
        // The only subtree of a task may have fewer entries than its record takes.
        let is_only = self.subtree_count == 0 && range.end == self.entries.len();
        debug_assert!(is_only || start + RECORD <= range.end, "a record over entries to come");
        record.write(self.entries.get_mut(start..));
        self.last = record;
        self.subtree_count += 1;
    }

    /// Bins a crowded unit by keys of its own, and makes the subtrees of its units.
    fn divide(&mut self, range: Range<usize>, centers: &Aabb, depth: u32) {
        let Binned { shift, border } = self.bin(&range, centers);
        let (mut budget, mut side) = (SubtreeBudget::default(), 0);
        let mut start = range.start;
        while start < range.end {
            let first = self.entries.get(start).map_or(0, |entry| entry[0]);
            if first & border != side {
                // The balance starts again: with what the many entries of the dense box left, each of the few others
                // would be a subtree by itself.
                (budget, side) = (SubtreeBudget::default(), first & border);
            }
            let mut end = self.bin_end(start..range.end, shift);
            if end - start <= CROWD {
                // Seams are counted from the first entry of the tree, not from that of this task.
                let before = self.first as usize;
                while end < range.end
                    && !budget.take_subtrees(&(before + start..before + end), range.end - end)
                {
                    end = self.bin_end(end..range.end, shift);
                }
            }
            self.unit(start..end, shift, depth + 1);
            start = end;
        }
    }

    /// Sorts a crowded unit into bins, by keys of its own. Out of line, as [`sort`]: nested divisions would each keep
    /// its variables on the stack.
    #[inline(never)]
    fn bin(&mut self, range: &Range<usize>, centers: &Aabb) -> Binned {
        let simd_level = self.simd_level;
        let (parts, counts) = self.crowd(range);
        let rule = &CrowdKeys::new(&parts, centers);
        // No more bins than the tree has: there are counts for so many.
        let most = counts.len().checked_ilog2().or_bug("no counts").unwrap_or(0);
        let bits = rule.bin_bits(range.len()).min(most);
        let shift = rule.bits() - bits;
        let binned = Binned { shift, border: rule.border() };

        // Find new keys, and count those of each bin.
        let Some(counts) = counts.get_mut(..1 << bits) else { return binned };
        counts.fill(0);
        for part in parts {
            dispatch(simd_level, NewKeys { part, rule, shift, counts: &mut *counts });
        }

        // Sort the entries by their bins, crowded bins first.
        let (parts, counts) = self.crowd(range);
        let Some(counts) = counts.get_mut(..1 << bits) else { return binned };
        let mut next = starts(counts);
        for count in &mut *counts {
            let next = &mut next[usize::from(*count as usize <= CROWD)];
            *next += core::mem::replace(count, *next);
        }
        sort_by_bin(parts, counts, shift);
        binned
    }

    /// Returns the entries of a crowded unit in three parts, with room for two numbers for each, and the counts of all
    /// bins. The room of the parts is where nodes will be, where later ids will be, and in `spare`.
    #[inline(never)]
    fn crowd(&mut self, range: &Range<usize>) -> ([CrowdPart<'_>; 3], &mut [u32]) {
        // A tree has at least one node for every 64 triangles, and `nodes` begins behind its root. A write to later
        // nodes could change bytes behind a small blob.
        let nodes = (self.entries.len() / (WIDTH * LEAF)).saturating_sub(1);
        let nodes = self.nodes.get_mut(self.node_count as usize..nodes).unwrap_or_default();
        let mut spare = self.spare.as_flattened_mut();
        let entries = self.entries.get_mut(range.clone()).or_bug("a unit behind the entries");
        let mut entries = entries.unwrap_or_default();
        let mut ids = self.ids.get_mut(range.start..).unwrap_or_default();
        let mut xs = if ids.len() >= entries.len() {
            take(&mut ids, entries.len())
        } else {
            // Without an index, or in one that is too small, there is no room for ids.
            take(&mut spare, entries.len())
        };
        let parts = [whole::<u32>(nodes.as_mut_bytes()), ids, spare].map(|ys| {
            let count = ys.len().min(entries.len());
            CrowdPart { entries: take(&mut entries, count), xs: take(&mut xs, count), ys }
        });
        debug_assert!(entries.is_empty(), "no room for the centres of a unit");
        (parts, self.counts)
    }

    /// Finds the end of the bin at the start of a range.
    fn bin_end(&self, range: Range<usize>, shift: u32) -> usize {
        let entries = self.entries.get(range.clone()).unwrap_or_default();
        let Some(first) = entries.first().or_bug("a bin without entries") else { return range.end };
        let bin = first[0] >> shift;
        let others = entries.iter().position(|entry| entry[0] >> shift != bin);
        others.map_or(range.end, |count| range.start + count)
    }
}
