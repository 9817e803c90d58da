//! The nodes over a few triangles in the order of their keys: what a root stands for.
//!
//! ```text
//! note between which neighbours keys differ first in bit 29, 28, ... 0
//! ranges = [all]
//! for each range of more than a leaf, breadth first:
//!     cut it in eight where neighbours differ in the highest bits; halve what has equal keys
//!     parts of a leaf's size or less become leaves, the others nodes
//! for each node, the last one first: gather the boxes of its leaves, quantise all eight, unite them
//! ```

#![expect(clippy::cast_possible_truncation, reason = "no more than MOST_ROOT triangles")]

use bytemuck::Zeroable;
use glam::Vec3A;

use crate::aabb::Aabb;
use crate::mesh::TriangleMesh;

use super::key::KEY_BITS;
use super::layout::{Entry, MOST_ROOT};
use super::node::{LEAF, Node, WIDTH};

/// Nodes of a subtree, at most.
const MOST_NODES: usize = MOST_ROOT / (WIDTH - 1) + 2;

/// The nodes of a subtree, the root first, each behind its parent.
pub(crate) struct Subtree {
    nodes: [Node; MOST_NODES],
    /// The boxes of the nodes; before they are known, the ranges of entries that the nodes hold.
    ranges: [Part; MOST_NODES],
    boxes: [Aabb; MOST_NODES],
    /// Levels above each node.
    above: [u8; MOST_NODES],
    count: usize,
    /// The ids of the leaves, one leaf behind the other.
    ids: [u32; MOST_ROOT],
    id_count: usize,
}

/// How ranges are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cut {
    /// Where the highest bit changes in which keys differ.
    Keys,
    /// In halves of whole leaves, the largest first: fewer nodes, worse boxes.
    Halves,
}

/// A range of entries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Part {
    start: u8,
    end: u8,
}

const _: () = assert!(MOST_ROOT <= u8::MAX as usize);

impl Part {
    const NONE: Self = Self { start: 0, end: 0 };

    const fn count(self) -> usize {
        (self.end - self.start) as usize
    }
}

/// Where keys change: bit `i` of number `b` says that the keys of entries `i` and `i + 1` differ, and in no
/// bit above `b`.
type Changes = [u128; KEY_BITS as usize];

const _: () = assert!(MOST_ROOT <= 1 + u128::BITS as usize);

/// Finds where the keys of entries in order change.
fn changes(entries: &[Entry]) -> Changes {
    let mut changes = [0; KEY_BITS as usize];
    for (at, (one, next)) in entries.iter().zip(entries.iter().skip(1)).enumerate().take(MOST_ROOT)
    {
        let differing = one[0] ^ next[0];
        if let Some(bit) = differing.checked_ilog2()
            && let Some(change) = changes.get_mut(bit as usize)
        {
            *change |= 1 << at;
        }
    }
    changes
}

impl Subtree {
    /// Zeros, which are written where it lies: anything else would be made elsewhere and copied.
    pub(crate) fn new() -> Self {
        Self {
            nodes: [Node::zeroed(); MOST_NODES],
            ranges: [Part::NONE; MOST_NODES],
            boxes: [Aabb { min: Vec3A::ZERO, max: Vec3A::ZERO }; MOST_NODES],
            above: [0; MOST_NODES],
            count: 0,
            ids: [0; MOST_ROOT],
            id_count: 0,
        }
    }

    /// The root and its box.
    pub(crate) const fn root(&self) -> (&Node, &Aabb) {
        (&self.nodes[0], &self.boxes[0])
    }

    /// Levels of nodes.
    pub(crate) fn levels(&self) -> u32 {
        let last = self.count.checked_sub(1).and_then(|last| self.above.get(last));
        last.map_or(0, |&above| u32::from(above) + 1)
    }

    /// The nodes below the root.
    pub(crate) fn below(&self) -> &[Node] {
        self.nodes.get(1..self.count).unwrap_or_default()
    }

    /// The ids of all leaves, in their order in the index.
    pub(crate) fn ids(&self) -> &[u32] {
        self.ids.get(..self.id_count).unwrap_or_default()
    }

    /// Makes the nodes over some entries, no more than [`MOST_ROOT`]. Their ids
    /// lie in the index from `first` on, the nodes below the root from `child` on. No step of a node is
    /// smaller than that of a box of size `least`.
    pub(crate) fn build(
        &mut self,
        mesh: &TriangleMesh<'_>,
        entries: &[Entry],
        [first, child]: [u32; 2],
        least: f32,
        by: Cut,
    ) {
        let changes = match by {
            Cut::Keys => changes(entries),
            Cut::Halves => [0; KEY_BITS as usize],
        };
        self.ranges[0] = Part { start: 0, end: entries.len().min(MOST_ROOT) as u8 };
        (self.count, self.id_count) = (1, 0);
        let mut at = 0;
        while at < self.count {
            self.cut(at, entries, &changes);
            at += 1;
        }
        // Quantise, children before parents.
        for at in (0..self.count).rev() {
            self.quantise(at, mesh, least);
        }
        // Name ids and nodes by where they lie in the index.
        for node in self.nodes.iter_mut().take(self.count) {
            node.first += first;
            node.child = (node.child + child).wrapping_sub(1);
        }
    }

    /// Cuts the range of a node into parts, writes the ids of those that are leaves and adds a node for
    /// each other.
    fn cut(&mut self, at: usize, entries: &[Entry], changes: &Changes) {
        let (Some(&range), Some(&above)) = (self.ranges.get(at), self.above.get(at)) else {
            return;
        };
        let parts = parts(range, changes);
        let (child, first) = (self.count as u32, self.id_count as u32);
        let mut node = Node { child, first, ..Node::EMPTY };
        for (slot, part) in parts.iter().enumerate().take_while(|(_, part)| part.count() > 0) {
            let places = (self.ranges.get_mut(self.count), self.above.get_mut(self.count));
            if part.count() > LEAF
                && let (Some(range_of), Some(above_of)) = places
            {
                (*range_of, *above_of) = (*part, above + 1);
                node.set_inner(slot);
                self.count += 1;
                continue;
            }
            node.counts[slot] = part.count() as u8;
            let range = entries.get(usize::from(part.start)..usize::from(part.end));
            let to = self.ids.get_mut(self.id_count..).unwrap_or_default();
            for (id, entry) in to.iter_mut().zip(range.unwrap_or_default()) {
                *id = entry[1];
            }
            self.id_count += part.count();
        }
        if let Some(slot) = self.nodes.get_mut(at) {
            *slot = node;
        }
    }

    /// Finds the boxes of a node's children, and its own.
    fn quantise(&mut self, at: usize, mesh: &TriangleMesh<'_>, least: f32) {
        let Some(node) = self.nodes.get_mut(at) else { return };
        let mut boxes = [Aabb::EMPTY; WIDTH];
        // Look at the triangles of all leaves in one loop: so their loads from memory overlap.
        let ends = node.ends();
        let mut slot = 0;
        let ids = self.ids.iter().skip(node.first as usize).take(usize::from(ends[WIDTH - 1]));
        for (at, &id) in (0..).zip(ids) {
            while ends[slot % WIDTH] <= at && slot < WIDTH - 1 {
                slot += 1;
            }
            let Some([a, b, c]) = mesh.corners(id) else { continue };
            let bounds_of = &mut boxes[slot % WIDTH];
            bounds_of.min = bounds_of.min.min(a.min(b).min(c));
            bounds_of.max = bounds_of.max.max(a.max(b).max(c));
        }
        let mut child = node.child as usize;
        let mut bounds = Aabb::EMPTY;
        for (slot, bounds_of) in boxes.iter_mut().enumerate() {
            if node.inner() >> slot & 1 == 1 {
                *bounds_of = self.boxes.get(child).copied().unwrap_or(Aabb::EMPTY);
                child += 1;
            }
            bounds = bounds.union(bounds_of);
        }
        node.set_boxes(&bounds, &boxes, least);
        if let Some(slot) = self.boxes.get_mut(at) {
            *slot = bounds;
        }
    }
}

/// Cuts a range into eight parts, or into single entries if there are fewer, in the order of the keys: where
/// keys change in the highest bits, and in the middle of what is left.
#[inline(always)]
fn parts(range: Part, changes: &Changes) -> [Part; WIDTH] {
    let mut parts = [Part::NONE; WIDTH];
    let mut start = range.start;
    let mut count = 0;
    let mut cuts = highest(range, changes);
    while cuts != 0 && count < WIDTH - 1 {
        let end = cuts.trailing_zeros() as u8 + 1;
        cuts &= cuts - 1;
        parts[count] = Part { start, end };
        start = end;
        count += 1;
    }
    parts[count] = Part { start, end: range.end };
    for count in count + 1..WIDTH {
        let mut largest = 0;
        for (at, part) in parts.iter().enumerate().take(count) {
            if part.count() > parts[largest].count() {
                largest = at;
            }
        }
        let Part { start, end } = parts[largest];
        if end < start + 2 {
            break;
        }
        // The parts behind it make room for its second half.
        let count = usize::from(end - start);
        let half = if count > LEAF { count.div_ceil(2).next_multiple_of(LEAF) } else { count / 2 };
        let middle = start + half as u8;
        parts[largest].end = middle;
        let mut next = Part { start: middle, end };
        for slot in parts.iter_mut().skip(largest + 1) {
            next = core::mem::replace(slot, next);
        }
    }
    parts
}

/// The seven changes in the highest bits inside a range, as bits; all of them if there are fewer.
#[inline(always)]
fn highest(range: Part, changes: &Changes) -> u128 {
    // A range of one entry or none has no inside.
    let Some(last) = range.end.checked_sub(1).filter(|&last| last > range.start) else { return 0 };
    let inside = (1_u128 << last) - (1 << range.start);
    let (mut chosen, mut left) = (0, WIDTH as u32 - 1);
    for change in changes.iter().rev() {
        let mut here = change & inside;
        if here.count_ones() >= left {
            for _ in 0..left {
                chosen |= here & here.wrapping_neg();
                here &= here - 1;
            }
            break;
        }
        left -= here.count_ones();
        chosen |= here;
    }
    chosen
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::bvh::layout::most_of_root;
    use crate::bvh::node::Child;

    /// Small triangles, one for each entry.
    fn mesh(count: usize) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let at = |i: usize| {
            #[expect(clippy::cast_precision_loss, reason = "small")]
            let x = i as f32;
            [[x, 0.0, 0.0], [x + 0.5, 0.0, 1.0], [x, 0.5, 0.0]]
        };
        let indices = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        ((0..count).flat_map(at).collect(), indices.collect())
    }

    /// Walks a subtree from its root, whose ids and nodes lie at 1000 and 500; returns the ids.
    fn walk(subtree: &Subtree, most_levels: u32) -> Vec<u32> {
        let (ids, below) = (subtree.ids(), subtree.below());
        let mut met = Vec::new();
        let mut todo = alloc::vec![(*subtree.root().0, 1)];
        let mut nodes = 0;
        while let Some((node, level)) = todo.pop() {
            nodes += 1;
            assert!(level <= most_levels);
            for slot in 0..8 {
                match node.child(slot) {
                    Child::Inner(child) => {
                        todo.push((below[child as usize - 500], level + 1));
                    }
                    Child::Leaf { first, count } => {
                        assert!(count as usize <= LEAF);
                        met.extend(&ids[first as usize - 1000..][..count as usize]);
                    }
                }
            }
        }
        assert_eq!(nodes, below.len() + 1);
        met
    }

    #[test]
    fn every_triangle_stands_in_one_leaf() {
        let (positions, indices) = mesh(MOST_ROOT);
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        // Far apart, equal, each half of the one before, and in no order.
        let keys: [fn(u32) -> u32; 4] = [
            |i| i << 20,
            |_| 7,
            |i| (1 << 29) >> (29 - i % 30),
            |i| i.wrapping_mul(0x9e37) & 0xfff,
        ];
        let mut subtree = Subtree::new();
        for count in (0..=MOST_ROOT).step_by(if cfg!(miri) { 41 } else { 1 }) {
            for (which, key) in keys.iter().enumerate() {
                let mut entries: Vec<Entry> = (0..count as u32).map(|id| [key(id), id]).collect();
                if which < 3 {
                    entries.sort_by_key(|entry| entry[0]);
                }
                for by in [Cut::Keys, Cut::Halves] {
                    subtree.build(&mesh, &entries, [1000, 500], 1e-6, by);
                    let mut ids = walk(&subtree, subtree.levels());
                    ids.sort_unstable();
                    assert!(ids.iter().copied().eq(0..count as u32), "{count} {which} {by:?}");
                    let most = count.saturating_sub(1) / 7 + 1;
                    assert!(subtree.below().len() < most.max(2), "{count} {which} {by:?}");
                    // Halves are cheap enough for the bound.
                    let is_cheap = subtree.below().len() <= most_of_root(count);
                    assert!(is_cheap || by == Cut::Keys, "{count} {which}");
                }
            }
        }
    }
}
