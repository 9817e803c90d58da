//! Grows the nodes over a range of triangles from the root down, each with eight children.
//!
//! ```text
//! stack = [[all triangles]]
//! take the next range of the entry on top; drop the entry if it has none
//! split it until there are eight parts, or all have four triangles or fewer (parts.rs)
//!     a part of a leaf's size:                write its ids
//!     a part of at most `wait` triangles:     leave it to a task
//! push the other parts as one entry; quantise the boxes, write the node
//! ```

use zerocopy::{FromBytes, Immutable, IntoBytes};

use crate::aabb::Aabb;
use crate::bvh::fine::FineList;
use crate::bvh::layout::LEVELS;
use crate::bvh::node::{LEAF, Node, SMALL_LEAF, WIDTH, least_node};
use crate::bvh::parts::{Limits, Splitter};
use crate::bvh::sah::{ID, Item, MOST_BINS};
use crate::invariant::OrBug;

/// How ranges of triangles are split.
const LIMITS: Limits =
    Limits { leaf: LEAF as u32, small: SMALL_LEAF as u32, bins: MOST_BINS, halved_from: 24 };

/// Levels of nodes, at most. Where parts are halved, a level divides a range by eight, so ten levels reach the leaves
/// from 2^31 triangles; one is to spare.
const MOST_LEVELS: u32 = LIMITS.halved_from + 11;

const _: () = assert!(MOST_LEVELS <= LEVELS);

/// A range of triangles over which nodes are to be made.
pub(super) struct Grow<'w, 'f> {
    /// The box of the tree.
    pub(super) bounds: &'w Aabb,
    /// The triangles, in any order that the mesh alone determines.
    pub(super) items: &'w mut [Item],
    /// Levels of nodes above.
    pub(super) level: u32,
    /// A range of at most this many triangles is left to a task: its node stores the range, if there is room
    /// for the node.
    pub(super) wait: u32,
    /// Destination of fine sides, for the top nodes.
    pub(super) fine: Option<&'w mut FineList<'f>>,
    /// Destination of the nodes below the root.
    pub(super) nodes: &'w mut [Node],
    /// The number of the first of them in the index.
    pub(super) child: u32,
    /// Destination of the ids of leaves.
    pub(super) ids: &'w mut [u32],
    /// Place of the first of them in the index.
    pub(super) first: u32,
}

/// The result of [`Grow`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Grown {
    pub(super) root: Node,
    /// Nodes below the root, whether or not there was room for them.
    pub(super) nodes: u32,
    /// Ids in leaves.
    pub(super) ids: u32,
    /// Levels of nodes, with those above.
    pub(super) levels: u32,
}

/// A node to be made.
#[derive(Clone, Copy)]
struct Job {
    /// Destination of the node: 0 for the root, `i + 1` for [`Grow::nodes`]`[i]`.
    place: u32,
    start: u32,
    end: u32,
    /// Levels of nodes above.
    level: u32,
}

/// The children of a node.
#[derive(Clone, Copy)]
struct Siblings {
    /// Child `s` holds the items from `ends[s]` to `ends[s + 1]`.
    ends: [u32; WIDTH + 1],
    /// Destination of the first child that is a node, as in [`Job::place`]. The other nodes follow it.
    place: u32,
    /// The children that are nodes, as bits.
    nodes: u32,
    /// The nodes that are still to be made here, as bits. The others exist already, or a task makes them.
    to_make: u32,
}

impl Siblings {
    const NONE: Self = Self { ends: [0; WIDTH + 1], place: 0, nodes: 0, to_make: 0 };

    /// Takes the first child that is still to be made, if there is one. Above it are `level` levels of nodes.
    fn next(&mut self, level: u32) -> Option<Job> {
        if self.to_make == 0 {
            return None;
        }
        let slot = self.to_make.trailing_zeros() as usize % WIDTH;
        self.to_make &= self.to_make - 1;
        let before = self.nodes & ((1 << slot) - 1);
        let place = self.place + before.count_ones();
        Some(Job { place, start: self.ends[slot], end: self.ends[slot + 1], level })
    }
}

impl Grow<'_, '_> {
    /// Makes the nodes. Out of line, so that the bins of the top are off the stack when those below are made.
    #[inline(never)]
    pub(super) fn run(mut self) -> Grown {
        let mut grown = Grown { root: Node::EMPTY, nodes: 0, ids: 0, levels: self.level + 1 };
        let mut splitter = Splitter::new(self.bounds, LIMITS);
        let least = least_node(self.bounds);
        // One entry a level: under the nodes of an entry are those of the next. The first entry holds the root alone.
        let mut stack = [Siblings::NONE; MOST_LEVELS as usize];
        #[expect(clippy::cast_possible_truncation, reason = "no more than ids have values")]
        let end = self.items.len() as u32;
        stack[0] = Siblings { nodes: 1, to_make: 1, ..Siblings::NONE };
        stack[0].ends[1] = end;
        let mut depth = 1;
        while let Some(siblings) =
            u32::checked_sub(depth, 1).and_then(|last| stack.get_mut(last as usize))
        {
            // Take a range, and split it into up to eight parts.
            let Some(job) = siblings.next(self.level + depth - 1) else {
                depth -= 1;
                continue;
            };
            grown.levels = grown.levels.max(job.level + 1);
            let parts = splitter.parts(self.items, &(job.start..job.end), job.level);
            let mut node = Node {
                child: self.child + grown.nodes,
                first: self.first + grown.ids,
                ..Node::EMPTY
            };
            // Write the ids of leaves, leave ranges to tasks, note the others.
            let mut below = Siblings { ends: parts.ends, place: grown.nodes + 1, ..Siblings::NONE };
            for (slot, part) in parts.ranges().enumerate() {
                let count = part.end - part.start;
                if count <= LEAF as u32 {
                    #[expect(clippy::cast_possible_truncation, reason = "eight at most")]
                    let in_leaf = count as u8;
                    node.counts[slot % WIDTH] = in_leaf;
                    let items = self.items.get(part.start as usize..part.end as usize);
                    debug_assert!(items.is_some(), "a leaf behind the items");
                    // Too little room for ids is legal: they are counted.
                    let ids = self.ids.get_mut(grown.ids as usize..).unwrap_or_default();
                    for (id, item) in ids.iter_mut().zip(items.unwrap_or_default()) {
                        *id = item[ID];
                    }
                    grown.ids += count;
                    continue;
                }
                node.set_inner(slot);
                // Too little room for nodes is legal: they are counted.
                match self.nodes.get_mut(grown.nodes as usize) {
                    Some(unbuilt) if count <= self.wait => {
                        *unbuilt = Node::unbuilt(part.start, part.end, job.level + 1);
                    }
                    _ => below.to_make |= 1 << (slot % WIDTH),
                }
                grown.nodes += 1;
            }
            below.nodes = node.inner();
            if below.to_make != 0
                && let Some(slot) = stack.get_mut(depth as usize).or_bug("too many levels")
            {
                *slot = below;
                depth += 1;
            }
            // Quantise the boxes, and write the node.
            node.set_boxes(&parts.bounds(), &parts.boxes, least);
            self.add_fine_sides(&job, &mut node, &parts.boxes);
            match job.place.checked_sub(1) {
                None => grown.root = node,
                Some(place) => {
                    if let Some(slot) = self.nodes.get_mut(place as usize) {
                        *slot = node;
                    }
                }
            }
        }
        grown
    }

    /// Gives fine sides to a node, if it is one of the top nodes, none of its children is a leaf, and one of them is
    /// thin.
    #[inline(never)]
    fn add_fine_sides(&mut self, job: &Job, node: &mut Node, boxes: &[Aabb; WIDTH]) {
        // Without room for nodes, ranges do not wait: choose the same nodes as with room.
        let is_top = job.place == 0 || job.end - job.start > self.wait;
        if let Some(fine) = &mut self.fine
            && is_top
            && node.counts == [0; WIDTH]
        {
            let number = job.place.checked_sub(1).map_or(0, |place| self.child + place);
            fine.add(number, node, boxes);
        }
    }
}

/// The nodes that wait in a tree, in the order of their triangles.
#[derive(Clone, Copy)]
pub(super) struct Cursor {
    /// Siblings that are still to be looked at: the first, and where they end.
    levels: [[u32; 2]; MOST_LEVELS as usize + 1],
    depth: usize,
}

/// A node that waits: its number, its range and the levels above it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Waiter {
    pub(super) place: u32,
    pub(super) start: u32,
    pub(super) end: u32,
    pub(super) level: u32,
}

impl Cursor {
    /// A cursor before the first of them.
    pub(super) fn new() -> Self {
        let mut levels = [[0; 2]; MOST_LEVELS as usize + 1];
        levels[0] = [0, 1];
        Self { levels, depth: 1 }
    }

    /// The next node that waits among the first nodes of a tree.
    pub(super) fn next(&mut self, nodes: &[Node]) -> Option<Waiter> {
        loop {
            let level = self.levels.get_mut(self.depth.checked_sub(1)?)?;
            let [place, end] = *level;
            if place >= end {
                self.depth -= 1;
                continue;
            }
            level[0] += 1;
            // A node for which there was no room is legal: its range did not wait.
            let Some(node) = nodes.get(place as usize) else { continue };
            if let Some([start, end, level]) = node.waiter() {
                return Some(Waiter { place, start, end, level });
            }
            let below = [node.child, node.child + node.inner().count_ones()];
            *self.levels.get_mut(self.depth).or_bug("a node below the most levels")? = below;
            self.depth += 1;
        }
    }
}

/// The result of a task for one range, written over the first items of the range.
#[repr(C)]
#[derive(Debug, Clone, Copy, FromBytes, Immutable, IntoBytes)]
pub(super) struct RangeRecord {
    pub(super) root: Node,
    /// Nodes below the root.
    pub(super) nodes: u32,
    pub(super) levels: u32,
    pub(super) unused: [u32; 2],
}

/// A record in items.
pub(super) const RECORD: usize = size_of::<RangeRecord>() / size_of::<Item>();

const _: () = assert!(size_of::<RangeRecord>() == RECORD * size_of::<Item>() && RECORD <= LEAF);
