//! Builds a subtree: the nodes over up to 128 triangles that are sorted by their keys.
//!
//! ```text
//! read the box of each triangle
//! note in which bit neighbours' keys differ first
//! ranges = [all]
//! for each range of more than a leaf, breadth first:
//!     split it in eight where neighbours differ in the highest bits, but no small part; halve what has equal keys
//!     parts of a leaf's size or less become leaves, the others nodes
//! for each node, last first: the box of a child is the union of its triangles' boxes, or its node's box;
//!                            quantise all eight
//! ```
//!
//! A part is small if it has four triangles or fewer. A query reads four at once, so two leaves of two take twice as
//! long as one of four. Two bits split small parts, too, because triangles that differ in them may lie far apart: the
//! highest that changes in the range, and the next lower one that changes anywhere in the subtree.
//!
//! A subtree over `m` triangles has one node, or (m - 1) / 7 at most. Let `a` nodes have nodes among their children,
//! and `b` have none. Each of the `a` has eight children. Of these 8 a children, a + b - 1 are nodes (all but the
//! root); the others are leaves of one triangle or more. Each of the `b` has nine triangles or more, unless it is the
//! only node. So m >= 8 a - (a + b - 1) + 9 b, and a + b <= (m - 1 - b) / 7. A subtree with too many nodes for the
//! memory bound is split again, by halves only.
//!
//! All triangles of a subtree are read in one loop, so that their loads from memory overlap. A branch on the
//! number of triangles in a leaf would mispredict. So the box of a leaf is always the union of eight boxes.

#![expect(clippy::cast_possible_truncation, reason = "no more than MOST_SUBTREE triangles")]

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8, u8x64};
use zerocopy::{FromZeros, transmute};

use crate::aabb::Aabb;
use crate::eight::load;
use crate::extremes::Extremes;
use crate::invariant::OrBug;
use crate::mesh::TriangleMesh;
use crate::simd::{HAS_VECTORS, Kernel};

use super::layout::{Entry, MOST_SUBTREE, most_of_subtree};
use super::node::{LEAF, Node, SMALL_LEAF, Sides, WIDTH, corners};

/// Nodes of a subtree, at most, and one to spare.
const MOST_NODES: usize = MOST_SUBTREE / (WIDTH - 1) + 1;

/// The boxes of nodes lie behind those of triangles in [`Subtree::boxes`].
const OF_NODES: usize = MOST_SUBTREE;
const BOXES: usize = MOST_SUBTREE + MOST_NODES;

const _: () = assert!(MOST_NODES <= MOST_SUBTREE && LEAF <= 8);

/// The nodes of a subtree, the root first, each behind its parent.
pub(crate) struct Subtree {
    nodes: [Node; MOST_NODES],
    /// The ranges of entries that the children of each node hold.
    children: [[EntryRange; WIDTH]; MOST_NODES],
    /// The range of each node.
    ranges: [EntryRange; MOST_NODES],
    /// Levels above each node.
    above: [u8; MOST_NODES],
    /// The highest number that `changes` may have inside each range.
    tops: [u8; MOST_NODES],
    count: usize,
    /// The boxes of the triangles, then those of the nodes.
    boxes: [Sides; BOXES],
    /// The ids of the entries, and room to read eight from any of them.
    sources: [u32; MOST_SUBTREE + LEAF],
    /// The ids of the leaves, one leaf behind the other, and room to write eight behind any of them.
    ids: [u32; MOST_SUBTREE + LEAF],
    id_count: usize,
    /// One more than the highest bit in which the keys of entries `i` and `i + 1` differ, or 0.
    changes: [u8; MOST_SUBTREE],
    /// For each number, its places in `changes`, as bits. Only entries of numbers that occur are up to date.
    places: [u128; 32],
}

/// The rule by which ranges are split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SplitRule {
    /// Between neighbours whose keys differ in the highest bits.
    Keys,
    /// In halves of whole leaves, the largest first: fewer nodes, worse boxes.
    Halves,
}

/// Entries of a part that is small, at most.
const SMALL: u8 = SMALL_LEAF as u8;
/// The number of bits of the keys that may split small parts, too: the highest that changes in the range, and the next
/// lower that changes anywhere in the subtree.
const FREE_BITS: u32 = 2;

/// A range of entries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct EntryRange {
    start: u8,
    end: u8,
}

const _: () = assert!(MOST_SUBTREE <= u8::MAX as usize && MOST_SUBTREE == 128);

impl EntryRange {
    const NONE: Self = Self { start: 0, end: 0 };

    const fn count(self) -> usize {
        (self.end - self.start) as usize
    }
}

/// Makes the nodes over some entries, no more than [`MOST_SUBTREE`]. Their ids lie in the index from `first` on, the
/// nodes below the root from `child` on. `least` is [`least_node`](super::node::least_node) of the tree. Where splits
/// by keys make more nodes than the layout has room for, ranges are halved.
pub(crate) struct Build<'w> {
    pub(crate) subtree: &'w mut Subtree,
    pub(crate) mesh: &'w TriangleMesh<'w>,
    pub(crate) entries: &'w [Entry],
    pub(crate) first: u32,
    pub(crate) child: u32,
    pub(crate) least: f32,
    /// The rule to split by at first.
    pub(crate) by: SplitRule,
}

impl Kernel for Build<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { subtree, mesh, entries, first, child, least, mut by } = self;
        debug_assert!(entries.len() <= MOST_SUBTREE, "too many entries for a subtree");
        let entries = entries.get(..entries.len().min(MOST_SUBTREE)).unwrap_or_default();
        subtree.read(simd, mesh, entries);
        loop {
            subtree.shape(simd, by);
            if by == SplitRule::Halves || subtree.count <= 1 + most_of_subtree(entries.len()) {
                break;
            }
            by = SplitRule::Halves;
        }
        debug_assert!(subtree.id_count == entries.len(), "a subtree without some of its entries");
        // Quantise, children before parents.
        for at in (0..subtree.count).rev() {
            subtree.quantise(simd, at, [first, child], least);
        }
    }
}

impl Subtree {
    /// Returns all zeros, which the compiler writes in place; any other value would be made elsewhere and copied.
    pub(crate) fn new() -> Self {
        Self {
            nodes: [Node::new_zeroed(); MOST_NODES],
            children: [[EntryRange::NONE; WIDTH]; MOST_NODES],
            ranges: [EntryRange::NONE; MOST_NODES],
            above: [0; MOST_NODES],
            tops: [0; MOST_NODES],
            count: 0,
            boxes: [[0.0; 8]; BOXES],
            sources: [0; MOST_SUBTREE + LEAF],
            ids: [0; MOST_SUBTREE + LEAF],
            id_count: 0,
            changes: [0; MOST_SUBTREE],
            places: [0; 32],
        }
    }

    /// The root and its box.
    pub(crate) const fn root(&self) -> (&Node, &Sides) {
        (&self.nodes[0], &self.boxes[OF_NODES])
    }

    /// Levels of nodes.
    pub(crate) fn levels(&self) -> u32 {
        let last = self.count.checked_sub(1).and_then(|last| self.above.get(last));
        last.map_or(0, |&above| u32::from(above) + 1)
    }

    /// The nodes below the root.
    pub(crate) fn below(&self) -> &[Node] {
        self.nodes.get(1..self.count).or_bug("no root").unwrap_or_default()
    }

    /// The ids of all leaves, in their order in the index.
    pub(crate) fn ids(&self) -> &[u32] {
        self.ids.get(..self.id_count).or_bug("too many ids").unwrap_or_default()
    }

    /// Reads ids, boxes and where keys change.
    #[inline(always)]
    fn read<S: Simd>(&mut self, simd: S, mesh: &TriangleMesh<'_>, entries: &[Entry]) {
        let mut near = mesh.part_around(entries.first().map_or(0, |entry| entry[1]));
        for (entry, (id, sides)) in entries.iter().zip(self.sources.iter_mut().zip(&mut self.boxes))
        {
            *id = entry[1];
            let mut found = near.corners(entry[1]);
            if found.is_none() {
                near = mesh.part_around(entry[1]);
                found = near.corners(entry[1]);
            }
            let Some([a, b, c]) = found else {
                *sides = slow_sides(mesh, entry[1]);
                continue;
            };
            let (a, b, c) = (load(simd, a), load(simd, b), load(simd, c));
            let low: f32x4<S> = a.lesser(b).lesser(c);
            let high: f32x4<S> = a.greater(b).greater(c);
            // Store all eight numbers at once: a load that spans two stores would wait for both.
            low.combine(f32x4::splat(simd, 0.0) - high).store_slice(sides);
        }
        let count = entries.len();
        self.changes = [0; MOST_SUBTREE];
        for (change, (one, next)) in
            self.changes.iter_mut().zip(entries.iter().zip(entries.iter().skip(1)))
        {
            *change = (32 - (one[0] ^ next[0]).leading_zeros()) as u8;
        }
        self.ranges[0] = EntryRange { start: 0, end: count as u8 };
    }

    /// Splits all ranges of more than a leaf, breadth first.
    #[inline(always)]
    fn shape<S: Simd>(&mut self, simd: S, by: SplitRule) {
        if by == SplitRule::Halves {
            self.changes = [0; MOST_SUBTREE];
        }
        let bits = if HAS_VECTORS { self.find_places(simd) } else { self.find_places_one_by_one() };
        (self.count, self.id_count) = (1, 0);
        self.tops[0] = 31;
        let mut at = 0;
        while at < self.count {
            self.split(at, bits);
            at += 1;
        }
    }

    /// Finds where keys change in each bit. Returns the bits in which any do, as a mask.
    #[inline(always)]
    fn find_places<S: Simd>(&mut self, simd: S) -> u32 {
        let bits = self.changes.iter().fold(0_u32, |bits, &bit| bits | 1 << (bit % 32)) & !1;
        let [low, high]: [[u8; 64]; 2] = transmute!(self.changes);
        let [low, high] = [u8x64::simd_from(simd, low), u8x64::simd_from(simd, high)];
        let mut rest = bits;
        while rest != 0 {
            let bit = rest.trailing_zeros();
            rest &= rest - 1;
            let number = u8x64::splat(simd, bit as u8);
            let [low, high] = [low.simd_eq(number), high.simd_eq(number)].map(SimdMask::to_bitmask);
            self.places[bit as usize % 32] = u128::from(low) | u128::from(high) << 64;
        }
        bits
    }

    /// Does the same for machines without vectors.
    #[inline(never)]
    fn find_places_one_by_one(&mut self) -> u32 {
        self.places = [0; 32];
        let (mut bits, mut place) = (0, 1);
        for &bit in &self.changes {
            self.places[usize::from(bit % 32)] |= place;
            bits |= 1 << (bit % 32);
            place <<= 1;
        }
        bits & !1
    }

    /// Splits the range of a node into parts, writes the ids of those that are leaves and adds a node for each other.
    #[inline(always)]
    fn split(&mut self, at: usize, bits: u32) {
        debug_assert!(at < self.count && self.count <= MOST_NODES, "a node behind the last");
        let (Some(&range), Some(&above), Some(&top)) =
            (self.ranges.get(at), self.above.get(at), self.tops.get(at))
        else {
            return;
        };
        let (parts, top) = parts(range, bits & (u32::MAX >> (31 - top % 32)), &self.places);
        let (child, first) = (self.count as u32, self.id_count as u32);
        let mut node = Node { child, first, ..Node::EMPTY };
        for (slot, part) in parts.iter().enumerate() {
            let count = part.count();
            if count > LEAF {
                debug_assert!(self.count < MOST_NODES, "a subtree has too many nodes");
                let next = self.count;
                let slots = (self.ranges.get_mut(next), self.above.get_mut(next));
                if let ((Some(range_of), Some(above_of)), Some(top_of)) =
                    (slots, self.tops.get_mut(next))
                {
                    (*range_of, *above_of, *top_of) = (*part, above + 1, top);
                    node.set_inner(slot);
                    self.count += 1;
                }
                continue;
            }
            // Copy eight ids; the next leaf overwrites those beyond `count`.
            node.counts[slot] = count as u8;
            let from = self.sources.get(usize::from(part.start)..);
            let to = self.ids.get_mut(self.id_count..);
            if let (Some(from), Some(to)) = (
                from.and_then(|from| from.first_chunk::<LEAF>()).or_bug("a leaf behind all ids"),
                to.and_then(|to| to.first_chunk_mut()).or_bug("no room for the ids of a leaf"),
            ) {
                *to = *from;
            }
            self.id_count += count;
        }
        if let Some(slot) = self.nodes.get_mut(at) {
            *slot = node;
        }
        if let Some(slot) = self.children.get_mut(at) {
            *slot = parts;
        }
    }

    /// Finds the boxes of a node's children, and its own, and names ids and nodes by where they lie in the index.
    #[inline(always)]
    fn quantise<S: Simd>(&mut self, simd: S, at: usize, starts: [u32; 2], least: f32) {
        debug_assert!(at < self.count && self.count <= MOST_NODES, "a node behind the last");
        let (Some(node), Some(parts)) = (self.nodes.get_mut(at), self.children.get(at)) else {
            return;
        };
        let mut bounds = f32x8::splat(simd, f32::INFINITY);
        let mut boxes = [bounds; WIDTH];
        let mut child = node.child as usize;
        let mut used = 0;
        for (part, sides) in parts.iter().zip(&mut boxes) {
            let (start, count) = (usize::from(part.start), part.count());
            if count == 0 {
                break;
            }
            // Unite eight boxes, as branches on the kind and size of a child would mispredict: a leaf repeats its last
            // box, a node its only one.
            let is_node = count > LEAF;
            let (first, last) = if is_node { (OF_NODES + child, 0) } else { (start, count - 1) };
            child += usize::from(is_node);
            for lane in 0..LEAF {
                let of_one = self.boxes.get(first + lane.min(last)).copied();
                debug_assert!(of_one.is_some(), "a child without a box");
                *sides = sides.lesser(f32x8::simd_from(simd, of_one.unwrap_or([f32::INFINITY; 8])));
            }
            bounds = bounds.lesser(*sides);
            used += 1;
        }
        // Without vectors, eight lanes one after the other are more code.
        if HAS_VECTORS {
            node.set_sides(simd, bounds, &boxes, (1 << used) - 1, least);
        } else {
            let mut children = [Aabb::EMPTY; WIDTH];
            for (child, sides) in children.iter_mut().zip(boxes) {
                *child = corners(&sides.into());
            }
            node.set_boxes(&corners(&bounds.into()), &children, least);
        }
        node.first += starts[0];
        node.child = (node.child + starts[1]).wrapping_sub(1);
        if let Some(slot) = self.boxes.get_mut(OF_NODES + at) {
            *slot = bounds.into();
        }
    }
}

/// The box of a triangle that cannot be read with vectors.
#[cold]
#[inline(never)]
pub(crate) fn slow_bounds(mesh: &TriangleMesh<'_>, id: u32) -> Aabb {
    let bounds = mesh.corners(id).and_then(Aabb::of);
    bounds.or_bug("a triangle of the tree is not finite").unwrap_or(Aabb::EMPTY)
}

/// [`slow_bounds`] as sides.
#[cold]
#[inline(never)]
fn slow_sides(mesh: &TriangleMesh<'_>, id: u32) -> Sides {
    let bounds = slow_bounds(mesh, id);
    let ([x, y, z], [u, v, w]) = (bounds.min.to_array(), (-bounds.max).to_array());
    [x, y, z, 0.0, u, v, w, 0.0]
}

/// Splits a range, in the order of the keys, into eight parts, or into fewer if all are small: where keys change in the
/// highest bits; then it halves the largest part. Also returns the lowest bit that [`highest`] looked at.
#[inline(always)]
fn parts(range: EntryRange, bits: u32, places: &[u128; 32]) -> ([EntryRange; WIDTH], u8) {
    let mut parts = [EntryRange::NONE; WIDTH];
    let mut start = range.start;
    let mut count = 0;
    let (mut splits, top) = highest(range, bits, places);
    while splits != 0 && count < WIDTH - 1 {
        let end = splits.trailing_zeros() as u8 + 1;
        splits &= splits - 1;
        parts[count] = EntryRange { start, end };
        start = end;
        count += 1;
    }
    parts[count] = EntryRange { start, end: range.end };
    for count in count + 1..WIDTH {
        let mut largest = 0;
        for (at, part) in parts.iter().enumerate().take(count) {
            if part.count() > parts[largest].count() {
                largest = at;
            }
        }
        let EntryRange { start, end } = parts[largest];
        if end <= start + SMALL {
            break;
        }
        // The parts behind it make room for its second half.
        let count = usize::from(end - start);
        let half = if count > LEAF { count.div_ceil(2).next_multiple_of(LEAF) } else { count / 2 };
        let middle = start + half as u8;
        parts[largest].end = middle;
        let mut next = EntryRange { start: middle, end };
        for slot in parts.iter_mut().skip(largest + 1) {
            next = core::mem::replace(slot, next);
        }
    }
    (parts, top)
}

/// Finds up to seven places inside a range at which to split it: those where the highest bits of the keys change.
/// Leaves out places that would split a small part, except for the first [`FREE_BITS`] bits. Returns a mask of the
/// places, and the lowest bit of the keys that was looked at.
#[inline(always)]
fn highest(range: EntryRange, bits: u32, places: &[u128; 32]) -> (u128, u8) {
    // A range of one entry or none has no inside.
    let Some(last) = range.end.checked_sub(1).filter(|&last| last > range.start) else {
        return (0, 0);
    };
    let (first, last) = (1_u128 << range.start, 1_u128 << last);
    let inside = last - first;
    let (mut chosen, mut left, mut free) = (0, WIDTH as u32 - 1, FREE_BITS);
    let (mut bits, mut lowest) = (bits, 0);
    while let Some(bit) = bits.checked_ilog2() {
        bits ^= 1 << bit;
        lowest = bit as u8;
        let mut open = inside & !chosen;
        if free == 0 {
            open &= !inside_small(chosen << 1 | first, chosen | last);
            if open == 0 {
                break;
            }
        }
        let mut here = places[bit as usize % 32] & open;
        free -= u32::from(free > 0 && (chosen | here) != 0);
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
    (chosen, lowest)
}

/// The places inside small parts, given the first and the last entry of each part.
#[inline(always)]
const fn inside_small(first: u128, last: u128) -> u128 {
    // A place is the entry before it. The part is small if its last entry is no more than three behind its first.
    let (one, two, three) = (last >> 1, last >> 2, last >> 3);
    first & (one | two | three) | first << 1 & (one | two) | first << 2 & one
}

const _: () = assert!(SMALL == 4, "three shifts find parts of four entries");

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::bvh::layout::most_of_subtree;
    use crate::bvh::node::Child;
    use crate::random;
    use crate::simd::{SimdLevel, dispatch};

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
        let (positions, indices) = mesh(MOST_SUBTREE);
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        // Far apart, equal, each half of the one before, and in no order.
        let keys: [fn(u32) -> u32; 4] = [
            |i| i << 20,
            |_| 7,
            |i| (1 << 29) >> (29 - i % 30),
            |i| i.wrapping_mul(0x9e37) & 0xfff,
        ];
        let mut subtree = Subtree::new();
        for count in (0..=MOST_SUBTREE).step_by(if cfg!(miri) { 41 } else { 1 }) {
            for (which, key) in keys.iter().enumerate() {
                let mut entries: Vec<Entry> = (0..count as u32).map(|id| [key(id), id]).collect();
                if which < 3 {
                    entries.sort_by_key(|entry| entry[0]);
                }
                for by in [SplitRule::Keys, SplitRule::Halves] {
                    let (subtree, mesh, entries) = (&mut subtree, &mesh, &*entries);
                    let (first, child, least) = (1000, 500, 1e-6);
                    let build = Build { subtree, mesh, entries, first, child, least, by };
                    dispatch(SimdLevel::detect(), build);
                    let mut ids = walk(subtree, subtree.levels());
                    ids.sort_unstable();
                    assert!(ids.iter().copied().eq(0..count as u32), "{count} {which} {by:?}");
                    let most = (count.saturating_sub(1) / 7).max(1);
                    assert!(subtree.below().len() < most, "{count} {which} {by:?}");
                    // Halves are cheap enough for the bound.
                    assert!(subtree.below().len() <= most_of_subtree(count), "{count} {which}");
                }
            }
        }
    }

    /// The places where keys change, found with vectors: the bits that change, and the places of each of them.
    struct Places<'a>(&'a mut Subtree);

    impl Kernel for Places<'_> {
        type Output = Vec<u128>;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Vec<u128> {
            let bits = self.0.find_places(simd);
            of_bits(self.0, bits)
        }
    }

    fn of_bits(subtree: &Subtree, bits: u32) -> Vec<u128> {
        let of_bit = |bit: usize| (bits >> bit & 1 == 1).then_some(subtree.places[bit]);
        (0..32).filter_map(of_bit).chain([bits.into()]).collect()
    }

    #[test]
    fn places_are_found_alike_with_vectors_and_without() {
        let mut state = 1;
        for most in [1, 2, 9, 31] {
            let mut subtree = Subtree::new();
            subtree.changes =
                [(); MOST_SUBTREE].map(|()| ((random::next(&mut state) >> 8) % most) as u8);
            let bits = subtree.find_places_one_by_one();
            let expected = of_bits(&subtree, bits);
            for level in SimdLevel::available() {
                subtree.places = [0; 32];
                let found = dispatch(level, Places(&mut subtree));
                assert_eq!(found, expected, "{level:?}, {most}");
            }
        }
    }
}
