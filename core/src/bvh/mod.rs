//! A bounding volume hierarchy with eight children a node.
//!
//! Quality `fast` builds it from a grid of the triangles' centres, quality `high` by SAH over single triangles
//! ([`high`]). In the grid, every triangle belongs to one cell, by its centre; crowded cells get finer grids of their
//! own. Cells in Morton order are split into small subtrees, with a tree by SAH above them. A node keeps the boxes of
//! up to eight children in eight bits a side. Some nodes, mostly those with a thin child, keep them as f32, too
//! ([`fine`]). A leaf keeps up to eight ids. Triangles stay in the caller's mesh.
//!
//! ```text
//! blob | header | ids, those of a leaf side by side | nodes, the root first, siblings side by side | fine sides |
//! ```
//!
//! Each triangle stands in one leaf. So index and scratch are bounded by the number of triangles alone,
//! wherever the triangles lie ([`layout`]).
//!
//! The modules:
//!
//! ```text
//! format         node, fine, layout, validate
//! build          build: census (key), scatter, units, crowd (crowd_key), sort, subtrees (subtree), top, index;
//!                high/ for `high`; parts (sah) for top and high/
//! one ray        search, walk (slab, stack; shape_leaf for shapes)
//! batches        batch: order, rays (per_ray), group (boxes, met, group_leaf), interleave
//! points         nearest
//! moved meshes   refit
//! ```
//!
//! Terms of the build:
//!
//! - A *bin* is a cell of the grid. The high bits of a triangle's key choose it ([`key`]). The bins of [`sah`] are
//!   something else: intervals of an axis.
//! - An *entry* is the key and the id of a triangle ([`layout::Entry`]).
//! - A *unit* is a bin, or several that follow one another, whose entries are split into subtrees together ([`units`]).
//! - A bin is *crowded* if it has more than [`CROWD`](layout::CROWD) entries. It is a unit of its own. With more than
//!   [`MOST_UNIT`](layout::MOST_UNIT) entries it is divided: binned again, by keys of its own ([`crowd`]).
//! - A *subtree* holds the entries of a part of a unit ([`subtrees`]). A *root* is the top node of a subtree; the top
//!   node of the whole tree is called the root of the tree.
//! - A *seam* is a place between units where a task may end ([`units::is_seam`]).
//!
//! Sources: binning by Morton code with SAH on top, Pantaleoni and Luebke 2010 and Garanzha et al. 2011; SAH in bins,
//! Wald 2007; nodes with quantised boxes, Ylitie et al. 2017. Departures: bins are sorted in cache, no level of the
//! tree is bound to a level of the grid, and leaves hold ids, not triangles.

mod batch;
mod boxes;
mod build;
mod census;
mod crowd;
mod crowd_key;
mod fine;
mod group;
mod group_leaf;
mod high;
mod index;
mod interleave;
mod key;
mod layout;
mod met;
mod nearest;
mod node;
mod order;
mod parts;
mod per_ray;
mod rays;
mod refit;
mod sah;
mod scatter;
mod search;
mod shape_leaf;
mod slab;
mod sort;
mod stack;
mod subtree;
mod subtrees;
mod top;
mod units;
mod validate;
mod walk;

use crate::arena::{section_bytes, split};
use crate::blob::{HEADER_BYTES, Header, corrupt};
use crate::budget::Budget;
use crate::eight::first_eight;
use crate::error::Error;
use crate::simd::prefetch;
use crate::visit::Visitor;
pub(crate) use batch::Groups;
pub(crate) use build::{bound, build, sizes};
use fine::FineSides;
pub(crate) use group::{Group, Together};
pub(crate) use layout::LEVELS;
use node::{LEAF, Node};
pub(crate) use order::SortKey;
pub(crate) use per_ray::GROUP;
pub(crate) use rays::{Rays, lanes};
pub(crate) use refit::refit;
pub(crate) use search::Scope;
pub(crate) use stack::GroupStack;
use stack::{FEW_LEVELS, StackEntry, with_deep_stack, with_small_stack};
pub(crate) use validate::proof_bytes;

/// The scratch that the build of a tree with this header takes.
pub(crate) fn scratch_bytes(header: &Header) -> u64 {
    build::bytes(header.triangle_count, header.quality(), 1).1
}

/// A view of a built tree.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bvh<'a> {
    nodes: &'a [Node],
    fine: &'a [FineSides],
    ids: &'a [u32],
    /// Levels of nodes.
    levels: u32,
}

impl<'a> Bvh<'a> {
    /// A tree without nodes: nothing is hit.
    #[cfg(feature = "alloc")]
    pub(crate) const NOTHING: Self = Self { nodes: &[], fine: &[], ids: &[], levels: 0 };

    /// The view of a blob, in O(1). Nothing behind the header is trusted, now or later. Inlining it
    /// saves 170 bytes on a microcontroller.
    #[inline(always)]
    pub(crate) fn open(header: &Header, blob: &'a [u8]) -> Result<Self, Error> {
        let sections = blob.get(HEADER_BYTES..).and_then(|behind| {
            let (ids, behind) = split::<u32>(behind, header.reference_count.into())?;
            let (nodes, behind) = split::<Node>(behind, header.node_count.into())?;
            Some((ids, nodes, split::<FineSides>(behind, header.fine_count())?))
        });
        let (ids, nodes, (fine, rest)) =
            sections.ok_or(corrupt(core::mem::offset_of!(Header, blob_bytes)))?;
        if !rest.is_empty() {
            return Err(corrupt(core::mem::offset_of!(Header, blob_bytes)));
        }
        Ok(Self { nodes, fine, ids, levels: header.levels.min(LEVELS) })
    }

    /// Lends a stack for a point, or for a ray that has filled its first one. Most trees are shallow and get a small
    /// one, which takes less time to zero.
    #[inline(always)]
    pub(crate) fn with_stack<R>(&self, walk: impl FnOnce(&mut [StackEntry]) -> R) -> R {
        if self.levels <= FEW_LEVELS { with_small_stack(walk) } else { with_deep_stack(walk) }
    }

    /// The number of ids in all leaves.
    pub(crate) const fn list_words(&self) -> usize {
        self.ids.len()
    }

    /// The error for a word of the ids.
    const fn wrong_id(word: u64) -> Error {
        Error::Corrupt { offset: HEADER_BYTES as u64 + word * size_of::<u32>() as u64 }
    }

    /// The error for a node.
    fn wrong_node(&self, node: u32) -> Error {
        let nodes_at = HEADER_BYTES as u64 + section_bytes::<u32>(self.ids.len() as u64);
        Error::Corrupt { offset: nodes_at + u64::from(node) * size_of::<Node>() as u64 }
    }

    /// Nodes and leaves that a ray enters, at most: every node once, and eight leaves of each.
    #[inline(always)]
    const fn budget(&self) -> Budget {
        Budget::new(self.nodes.len() * 9)
    }

    /// Returns true if nodes and ids take more than so many bytes.
    const fn exceeds(&self, bytes: usize) -> bool {
        size_of_val(self.nodes) + size_of_val(self.ids) > bytes
    }

    /// Prefetches a node, or the ids of a leaf.
    #[inline(always)]
    fn prefetch(&self, child: node::Child) {
        match child {
            node::Child::Inner(number) => {
                if let Some(node) = self.nodes.get(number as usize) {
                    // A node may lie across two cache lines.
                    prefetch(&node.origin);
                    prefetch(&node.bounds[5]);
                }
            }
            node::Child::Leaf { first, .. } => {
                if let Some(id) = self.ids.get(first as usize) {
                    prefetch(id);
                }
            }
        }
    }

    /// The ids of a leaf; none where there is no such leaf.
    #[inline(always)]
    fn leaf(&self, first: u32, count: u32) -> &'a [u32] {
        let start = first as usize;
        let end = start.saturating_add((count as usize).min(LEAF));
        self.ids.get(start..end).unwrap_or_default()
    }

    /// The ids of a leaf, and more to fill eight lanes: those behind them where there are eight, which takes one read.
    #[inline(always)]
    fn lanes(&self, first: u32, ids: &[u32]) -> [u32; LEAF] {
        let eight = || self.ids.get(first as usize..)?.first_chunk().copied();
        eight().unwrap_or_else(|| first_eight(ids))
    }

    /// The fine sides of a node, if it has some.
    #[inline(always)]
    fn fine_sides(&self, node: &Node) -> Option<&'a FineSides> {
        // Ask the bit first: for most nodes that is all there is to do.
        if node.has_fine_sides() { self.fine.get(node.fine_index()) } else { None }
    }

    /// Passes all leaves to a visitor; `false` if its budget is used up.
    pub(crate) fn visit(&self, visitor: &mut Visitor<'_>) -> bool {
        self.nodes.iter().all(|node| {
            (0..8).all(|slot| match node.child(slot) {
                node::Child::Leaf { first, count } if count > 0 => {
                    visitor.list(self.leaf(first, count))
                }
                _ => true,
            })
        })
    }
}
