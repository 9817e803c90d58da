//! From bins of entries to roots: subtrees over up to `MOST_ROOT` triangles each. The tree on top
//! ([`top`](super::top)) treats each as one item.
//!
//! ```text
//! for each unit (a crowded bin, or bins side by side that pay for a root):
//!     crowded: a box of its own around the centres, new keys, new bins; then these
//!     else:    sort by key, cut where high bits of the key change, make a subtree of each part
//!
//! entries | records of roots | used up | this unit | later units      |
//! spare   |                            | the same unit, while it is binned again |
//! ```
//!
//! A unit's entries lie in one of the two arrays, and binning moves them to the other. The record of
//! a root is 112 bytes, written over entries that were used up: [`PRICE`](super::layout::PRICE) of them
//! for each root, 192 bytes.

#![expect(clippy::cast_possible_truncation, reason = "no more entries than ids have values")]

use core::ops::Range;

use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, transmute};

use crate::aabb::Aabb;
use crate::mesh::TriangleMesh;
use crate::simd::{SimdLevel, dispatch};

use super::key::{KEY_BITS, Keys};
use super::layout::{CROWD, DIVISIONS, Entry, LEAST_PIECE, MOST_ROOT, MOST_UNIT, PRICE, bin_bits};
use super::node::Node;
use super::sort::sort;
use super::subtree::{Build, Cut, Subtree};
use super::units::{Savings, starts};

/// The record of a root: its node, its box and its counts.
#[repr(C)]
#[derive(Debug, Clone, Copy, FromBytes, Immutable, IntoBytes)]
pub(crate) struct Record {
    pub(crate) node: Node,
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
    /// Triangles below it.
    pub(crate) count: u32,
    /// Levels of nodes.
    pub(crate) levels: u32,
}

/// A record in entries.
pub(crate) const RECORD: usize = size_of::<Record>() / size_of::<Entry>();

const _: () = assert!(size_of::<Record>() == 112 && RECORD <= PRICE);

impl Record {
    /// Writes it to the start of some entries, if it has room there.
    pub(crate) fn write(&self, entries: Option<&mut [Entry]>) {
        if let Some(slot) = entries.and_then(|entries| entries.first_chunk_mut::<RECORD>()) {
            *slot = transmute!(*self);
        }
    }
}

/// Copies elements to the start of others, as many as have room there.
pub(crate) fn copy<T: Copy>(from: &[T], to: Option<&mut [T]>) {
    for (slot, element) in to.into_iter().flatten().zip(from) {
        *slot = *element;
    }
}

/// The roots of a range of units.
pub(crate) struct Roots<'w> {
    pub(crate) mesh: &'w TriangleMesh<'w>,
    /// No step of a node is smaller than that of a box of this size.
    pub(crate) least: f32,
    /// Where the entries are, and where the records go.
    pub(crate) entries: &'w mut [Entry],
    /// The second buffer of the sort: as long as `entries`, or long enough for any unit that is sorted.
    pub(crate) spare: &'w mut [Entry],
    /// The ids, each at the place of its entry; empty if only the size is computed.
    pub(crate) ids: &'w mut [u32],
    /// Where the ids lie in the index.
    pub(crate) first: u32,
    /// Where the nodes go.
    pub(crate) nodes: &'w mut [Node],
    /// Where the nodes lie in the index.
    pub(crate) child: u32,
    /// One for each bin of the tree, so no fewer than any division of it has bins.
    counts: &'w mut [u32],
    subtree: &'w mut Subtree,
    level: SimdLevel,
    /// Nodes so far, whether or not there was room for them.
    pub(crate) node_count: u32,
    pub(crate) root_count: u32,
    /// The record of the last root.
    pub(crate) last: Record,
}

/// Where the entries of a unit lie.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    Entries,
    Spare,
}

impl<'w> Roots<'w> {
    #[expect(clippy::too_many_arguments, reason = "each is its own")]
    pub(crate) fn new(
        mesh: &'w TriangleMesh<'w>,
        least: f32,
        entries: &'w mut [Entry],
        spare: &'w mut [Entry],
        ids: &'w mut [u32],
        first: u32,
        nodes: &'w mut [Node],
        child: u32,
        counts: &'w mut [u32],
        subtree: &'w mut Subtree,
    ) -> Self {
        let last = Record::new_zeroed();
        let (node_count, root_count) = (0, 0);
        Self {
            mesh,
            least,
            entries,
            spare,
            ids,
            first,
            nodes,
            child,
            counts,
            subtree,
            level: SimdLevel::detect(),
            node_count,
            root_count,
            last,
        }
    }

    /// Makes the roots of a unit that lies `depth` divisions deep. Its bins are in order; the keys of one bin differ
    /// only in their lowest `shift` bits.
    pub(crate) fn unit(&mut self, range: Range<usize>, side: Side, shift: u32, depth: u32) {
        if range.len() > MOST_UNIT {
            let centers = self.centers(range.clone(), side);
            // Equal centres have no order but that of their ids.
            if depth < DIVISIONS && centers.size().max_element() > 0.0 {
                self.divide(range, side, &centers, depth);
            } else {
                self.cut(range, side);
            }
            return;
        }
        let (entries, spare) = match side {
            Side::Entries => {
                (self.entries.get_mut(range.clone()), spare_for(self.spare, &range, depth))
            }
            Side::Spare => (self.spare.get_mut(range.clone()), self.entries.get_mut(range.clone())),
        };
        if let (Some(entries), Some(spare)) = (entries, spare) {
            let differing = |[first, last]: [&Entry; 2]| 32 - (first[0] ^ last[0]).leading_zeros();
            let ends = entries.first().zip(entries.last());
            let bits = ends.map_or(0, |(first, last)| differing([first, last]));
            sort(entries, spare, bits.max(shift));
        }
        self.cut(range, side);
    }

    /// Makes roots of sorted entries: halves them where a high bit of the key changes, until parts
    /// are small enough.
    fn cut(&mut self, range: Range<usize>, side: Side) {
        let mut start = range.start;
        while start < range.end {
            let mut end = range.end;
            while end - start > MOST_ROOT {
                end = start + self.split(start..end, side);
            }
            self.root(start..end, side);
            start = end;
        }
    }

    /// Where to cut a range in two, none of them smaller than a piece.
    fn split(&self, range: Range<usize>, side: Side) -> usize {
        let entries = self.on(side).get(range).unwrap_or_default();
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
    fn root(&mut self, range: Range<usize>, side: Side) {
        let count = range.len() as u32;
        let first = self.first + range.start as u32;
        let child = self.child + self.node_count;
        let entries = match side {
            Side::Entries => self.entries.get(range.clone()),
            Side::Spare => self.spare.get(range.clone()),
        };
        let Some(entries) = entries else { return };
        let subtree = &mut *self.subtree;
        let (mesh, least, by) = (self.mesh, self.least, Cut::Keys);
        dispatch(self.level, Build { subtree, mesh, entries, first, child, least, by });
        copy(self.subtree.ids(), self.ids.get_mut(range));

        let below = self.subtree.below();
        copy(below, self.nodes.get_mut(self.node_count as usize..));
        self.node_count += below.len() as u32;
        let (node, &[x, y, z, _, u, v, w, _]) = self.subtree.root();
        let (min, max) = ([x, y, z], [-u, -v, -w]);
        let levels = self.subtree.levels();
        let record = Record { node: *node, min, max, count, levels };
        let start = self.root_count as usize * RECORD;
        record.write(self.entries.get_mut(start..));
        self.last = record;
        self.root_count += 1;
    }

    /// Bins a crowded unit by keys of its own, and makes the roots of its units.
    fn divide(&mut self, range: Range<usize>, side: Side, centers: &Aabb, depth: u32) {
        let keys = Keys::new(centers);
        let bits = bin_bits(range.len() as u64).min(KEY_BITS);
        let shift = KEY_BITS - bits;
        let (from, to, other) = match side {
            Side::Entries => (
                self.entries.get_mut(range.clone()),
                self.spare.get_mut(range.clone()),
                Side::Spare,
            ),
            Side::Spare => (
                self.spare.get_mut(range.clone()),
                self.entries.get_mut(range.clone()),
                Side::Entries,
            ),
        };
        let counts = self.counts.get_mut(..1 << bits);
        let (Some(from), Some(to), Some(counts)) = (from, to, counts) else { return };
        counts.fill(0);
        for entry in &mut *from {
            let bounds = self.mesh.corners(entry[1]).and_then(Aabb::of).unwrap_or(Aabb::EMPTY);
            entry[0] = keys.of(&bounds);
            if let Some(count) = counts.get_mut((entry[0] >> shift) as usize) {
                *count += 1;
            }
        }
        let mut next = starts(counts);
        for count in &mut *counts {
            let next = &mut next[usize::from(*count as usize <= CROWD)];
            *next += core::mem::replace(count, *next);
        }
        for entry in from {
            if let Some(head) = counts.get_mut((entry[0] >> shift) as usize) {
                if let Some(slot) = to.get_mut(*head as usize) {
                    *slot = *entry;
                }
                *head += 1;
            }
        }

        // Crowded bins come first, then all others in order.
        let mut savings = Savings::default();
        let mut start = range.start;
        while start < range.end {
            let mut end = self.bin_end(start..range.end, other, shift);
            if end - start <= CROWD {
                // Seams are counted from the first entry of the tree, not from that of this task.
                let before = self.first as usize;
                while end < range.end
                    && !savings.pay(&(before + start..before + end), range.end - end)
                {
                    end = self.bin_end(end..range.end, other, shift);
                }
            }
            self.unit(start..end, other, shift, depth + 1);
            start = end;
        }
    }

    /// Where the bin ends that begins with a range.
    fn bin_end(&self, range: Range<usize>, side: Side, shift: u32) -> usize {
        let entries = self.on(side).get(range.clone()).unwrap_or_default();
        let Some(first) = entries.first() else { return range.end };
        let bin = first[0] >> shift;
        let others = entries.iter().position(|entry| entry[0] >> shift != bin);
        others.map_or(range.end, |count| range.start + count)
    }

    /// The box of the centres of some triangles.
    fn centers(&self, range: Range<usize>, side: Side) -> Aabb {
        let mut centers = Aabb::EMPTY;
        for entry in self.on(side).get(range).unwrap_or_default() {
            let Some(bounds) = self.mesh.corners(entry[1]).and_then(Aabb::of) else { continue };
            let center = (bounds.min + bounds.max) * 0.5;
            centers.min = centers.min.min(center);
            centers.max = centers.max.max(center);
        }
        centers
    }

    fn on(&self, side: Side) -> &[Entry] {
        match side {
            Side::Entries => self.entries,
            Side::Spare => self.spare,
        }
    }
}

/// Returns the part of `spare` that a bin is sorted with: its start, which touches few pages, or, in a division,
/// where other bins lie in `spare`, the bin's own range.
fn spare_for<'b>(
    spare: &'b mut [Entry],
    range: &Range<usize>,
    depth: u32,
) -> Option<&'b mut [Entry]> {
    if depth > 0 { spare.get_mut(range.clone()) } else { spare.get_mut(..range.len()) }
}
