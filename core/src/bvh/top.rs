//! The tree over the roots: binned SAH (Wald 2007), eight children a node.
//!
//! ```text
//! parts = [all roots]
//! until there are eight: split the part with the largest surface by binned SAH
//!                        (16 bins an axis, by centre; an item costs ceil(triangles / 4))
//! parts of one root become that root's node, the others nodes of their own, breadth first
//! ```
//!
//! At [`DEEP`] levels parts are halved instead, so that the number of levels is bounded.

use glam::Vec3A;
use zerocopy::{FromBytes, Immutable, IntoBytes};

use crate::aabb::Aabb;
use crate::invariant::OrBug;
use crate::simd::inline_unless_small;

use super::fine::FineList;
use super::layout::Entry;
use super::node::{Node, WIDTH};

/// A root, as the tree above sees it.
#[repr(C)]
#[derive(Debug, Clone, Copy, FromBytes, Immutable, IntoBytes)]
pub(crate) struct RootItem {
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
    /// Triangles below it.
    pub(crate) count: u32,
    /// The number of its record.
    pub(crate) record: u32,
}

/// An item in entries.
pub(crate) const ITEM: usize = size_of::<RootItem>() / size_of::<Entry>();

/// Levels from which on parts are halved.
const DEEP: u32 = 20;
const BINS: usize = 16;

impl RootItem {
    fn bounds(&self) -> Aabb {
        Aabb { min: Vec3A::from_array(self.min), max: Vec3A::from_array(self.max) }
    }

    /// Twice the centre.
    #[inline(always)]
    fn center(&self) -> Vec3A {
        Vec3A::from_array(self.min) + Vec3A::from_array(self.max)
    }

    /// The cost of entering it: its number of triangles divided by four, rounded up.
    #[inline(always)]
    fn cost(&self) -> f32 {
        as_cost(self.count)
    }
}

#[inline(always)]
#[expect(clippy::cast_precision_loss, reason = "a cost")]
fn as_cost(count: u32) -> f32 {
    count.div_ceil(4) as f32
}

/// Half the surface of a box; 0 of an empty one.
#[inline(always)]
fn surface(bounds: &Aabb) -> f32 {
    let size = bounds.size().max(Vec3A::ZERO).to_array();
    size[0] * size[1] + size[1] * size[2] + size[2] * size[0]
}

/// A range of items that becomes a child.
#[derive(Clone, Copy)]
struct ItemRange {
    start: u32,
    end: u32,
    bounds: Aabb,
    /// The surface of the part, or its number of items where parts are halved; negative if it has one item or none.
    priority: f32,
}

impl ItemRange {
    const NONE: Self = Self { start: 0, end: 0, bounds: Aabb::EMPTY, priority: -1.0 };

    #[expect(clippy::cast_precision_loss, reason = "a priority")]
    fn new(start: u32, end: u32, bounds: Aabb, halve: bool) -> Self {
        let priority = match end - start {
            0 | 1 => -1.0,
            count if halve => count as f32,
            _ => surface(&bounds),
        };
        Self { start, end, bounds, priority }
    }
}

/// The tree over the roots.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Top {
    /// The root of the whole tree.
    pub(crate) root: Node,
    /// The nodes below it, those of the roots included.
    pub(crate) count: u32,
    /// Levels of all nodes.
    pub(crate) levels: u32,
}

/// Makes the nodes over some items and writes all but the topmost to `nodes`. `record` returns the node of a subtree,
/// which becomes a child, and its levels. Returns `None` if `nodes` is too short.
///
/// `child` is where `nodes` will lie in the index; `least` is [`least_node`](super::node::least_node) of the tree.
pub(crate) fn build(
    items: &mut [RootItem],
    record: impl Fn(u32) -> (Node, u32),
    nodes: &mut [Node],
    child: u32,
    least: f32,
    fine: &mut FineList<'_>,
) -> Option<Top> {
    #[expect(clippy::cast_possible_truncation, reason = "fewer than triangles")]
    let item_count = items.len() as u32;
    fine.clear();
    // A node that waits keeps its range and level where its children will be.
    let mut root = Node::unbuilt(0, item_count, 0);
    let (mut count, mut levels) = (0, 0);
    // Start with the root, which is not among `nodes`.
    for at in (0_usize..).map(|at| at.checked_sub(1)) {
        let node = match at {
            None => &root,
            Some(at) if at < count as usize => nodes.get(at)?,
            Some(_) => break,
        };
        let Some([start, end, level]) = node.waiter() else { continue };
        let bounds = bounds_of(items, start, end);
        let parts = parts(items, ItemRange::new(start, end, bounds, level >= DEEP), level >= DEEP);
        let mut node = Node { child: child + count, ..Node::EMPTY };
        let mut boxes = [Aabb::EMPTY; WIDTH];
        let parts = parts.iter().zip(&mut boxes).enumerate();
        for (slot, (part, bounds)) in parts.filter(|(_, (part, _))| part.end > part.start) {
            node.set_inner(slot);
            *bounds = part.bounds;
            let below = match items.get(part.start as usize).or_bug("a part behind the items") {
                Some(item) if part.end - part.start == 1 => {
                    let (node, below) = record(item.record);
                    levels = levels.max(level + 1 + below);
                    node
                }
                _ => Node::unbuilt(part.start, part.end, level + 1),
            };
            *nodes.get_mut(count as usize)? = below;
            count += 1;
        }
        node.set_boxes(&bounds, &boxes, least);
        #[expect(clippy::cast_possible_truncation, reason = "fewer than triangles")]
        let number = at.map_or(0, |at| child + at as u32);
        fine.add(number, &mut node, &boxes);
        match at {
            None => root = node,
            Some(at) => *nodes.get_mut(at)? = node,
        }
    }
    Some(Top { root, count, levels })
}

inline_unless_small! {
    fn bounds_of(items: &[RootItem], start: u32, end: u32) -> Aabb {
        let items = items.get(start as usize..end as usize).or_bug("a part behind the items");
        items.unwrap_or_default().iter().fold(Aabb::EMPTY, |all, item| all.union(&item.bounds()))
    }
}

/// Cuts a range of items into eight parts, or into single items.
fn parts(items: &mut [RootItem], all: ItemRange, halve: bool) -> [ItemRange; WIDTH] {
    let mut parts = [ItemRange::NONE; WIDTH];
    parts[0] = all;
    for count in 1..WIDTH {
        let mut widest = 0;
        for (at, part) in parts.iter().enumerate().take(count) {
            if part.priority > parts[widest].priority {
                widest = at;
            }
        }
        let part = parts[widest];
        if part.end - part.start < 2 {
            break;
        }
        let range = part.start as usize..part.end as usize;
        let Some(items_of) = items.get_mut(range).or_bug("a part behind the items") else { break };
        let middle = cut(items_of, halve);
        #[expect(clippy::cast_possible_truncation, reason = "fewer than triangles")]
        let middle = part.start + middle as u32;
        parts[widest] =
            ItemRange::new(part.start, middle, bounds_of(items, part.start, middle), halve);
        parts[count] = ItemRange::new(middle, part.end, bounds_of(items, middle, part.end), halve);
    }
    parts
}

/// The box and the cost of the items in a bin.
#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    cost: f32,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, cost: 0.0 };
}

/// Cuts two or more items in two where the SAH cost is least; returns how many are in the first part.
fn cut(items: &mut [RootItem], halve: bool) -> usize {
    let half = items.len() / 2;
    if halve || items.len() < 3 {
        return half;
    }
    // Bin by centre.
    let mut centers = Aabb::EMPTY;
    for item in &*items {
        centers.min = centers.min.min(item.center());
        centers.max = centers.max.max(item.center());
    }
    #[expect(clippy::cast_precision_loss, reason = "sixteen")]
    let scale = (Vec3A::splat(BINS as f32 * 0.999) / centers.size()).min(Vec3A::splat(f32::MAX));
    let bin_of = |item: &RootItem| {
        ((item.center() - centers.min) * scale).to_array().map(
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "saturates"
            )]
            |at| (at as u32 as usize).min(BINS - 1),
        )
    };
    let mut bins = [[Bin::EMPTY; BINS]; 3];
    // Bins that are not empty, as bits.
    let mut used = [0_u32; 3];
    for item in &*items {
        let (bounds, cost) = (item.bounds(), item.cost());
        for ((bins, used), at) in bins.iter_mut().zip(&mut used).zip(bin_of(item)) {
            let bin = &mut bins[at % BINS];
            bin.bounds = bin.bounds.union(&bounds);
            bin.cost += cost;
            *used |= 1 << (at % BINS);
        }
    }
    // Sweep over each axis from both ends. Skip empty bins: a cut before one is a cut before the next that is not
    // empty.
    let mut best = (f32::INFINITY, 0, 0);
    for (axis, (bins, &used)) in bins.iter().zip(&used).enumerate() {
        let mut before = [0.0; BINS];
        let mut all = Bin::EMPTY;
        let mut rest = used;
        while rest != 0 {
            let at = rest.trailing_zeros() as usize % BINS;
            rest &= rest - 1;
            before[at] = surface(&all.bounds) * all.cost;
            all.bounds = all.bounds.union(&bins[at].bounds);
            all.cost += bins[at].cost;
        }
        let mut all = Bin::EMPTY;
        let mut rest = used & !1;
        while let Some(last) = rest.checked_ilog2() {
            rest ^= 1 << last;
            let at = last as usize % BINS;
            all.bounds = all.bounds.union(&bins[at].bounds);
            all.cost += bins[at].cost;
            let cost = before[at] + surface(&all.bounds) * all.cost;
            if before[at] > 0.0 && cost < best.0 {
                best = (cost, axis, at);
            }
        }
    }
    let (cost, axis, at) = best;
    if !cost.is_finite() {
        return half;
    }
    let middle = partition(items, |item| bin_of(item)[axis] < at);
    if middle == 0 || middle == items.len() { half } else { middle }
}

/// Moves items for which something holds before the others; returns how many there are.
fn partition(items: &mut [RootItem], is_first: impl Fn(&RootItem) -> bool) -> usize {
    let mut count = 0;
    for at in 0..items.len() {
        if items.get(at).is_some_and(&is_first) {
            // `get_disjoint_mut` refuses equal places, which need no swap.
            if let Ok([first, other]) = items.get_disjoint_mut([count, at]) {
                core::mem::swap(first, other);
            }
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::bvh::node::Child;

    /// The tree over items of these boxes, each a root with one level: every item once, in so many levels.
    fn build_over(boxes: &[Aabb]) -> u32 {
        let mut items: Vec<RootItem> = (0..)
            .zip(boxes)
            .map(|(record, bounds)| {
                let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
                RootItem { min, max, count: 100, record }
            })
            .collect();
        // A root says by its ids which one it is.
        let leaf = |record: u32| {
            (Node { first: record, counts: [1, 0, 0, 0, 0, 0, 0, 0], ..Node::EMPTY }, 1)
        };
        // A root and its part of the nodes above are 11 / 7 nodes (the layout proves it).
        let mut nodes = vec![Node::EMPTY; boxes.len() * 11 / 7];
        let mut fine = FineList::new(&mut []);
        let top = build(&mut items, leaf, &mut nodes, 1000, 1e-6, &mut fine).unwrap();
        let Top { root, count, levels } = top;
        // One less is too few.
        let mut few = vec![Node::EMPTY; count as usize - 1];
        assert!(build(&mut items, leaf, &mut few, 1000, 1e-6, &mut fine).is_none());
        let mut met = Vec::new();
        let mut todo = vec![(root, 1)];
        while let Some((node, level)) = todo.pop() {
            assert!(node.waiter().is_none() && level <= levels);
            for slot in 0..8 {
                match node.child(slot) {
                    Child::Inner(child) => todo.push((nodes[child as usize - 1000], level + 1)),
                    Child::Leaf { first, count: 1 } => met.push(first as usize),
                    Child::Leaf { .. } => {}
                }
            }
        }
        met.sort_unstable();
        assert!(met.into_iter().eq(0..boxes.len()));
        levels
    }

    fn cube(at: f32, half: f32) -> Aabb {
        let at = Vec3A::new(at, 0.5 * at, 0.0);
        Aabb { min: at - half, max: at + half }
    }

    #[test]
    fn every_root_is_below_it_once_and_levels_are_bounded() {
        let most = if cfg!(miri) { 100 } else { 5000 };
        for count in [2_usize, 3, 7, 8, 9, 64, 65, most] {
            #[expect(clippy::cast_precision_loss, reason = "small")]
            let row = |half: f32| (0..count).map(|i| cube(i as f32, half)).collect::<Vec<_>>();
            for half in [0.0, 0.4, 100.0] {
                assert!(build_over(&row(half)) <= 2 + count.ilog2());
            }
            // All in one place, where nothing tells them apart.
            build_over(&vec![cube(0.0, 1.0); count]);
            // Each half as large as the one before: SAH cuts off a few at a time.
            let nested: Vec<_> = (0..count.min(200))
                .map(|i| {
                    #[expect(clippy::cast_possible_truncation, reason = "small")]
                    #[expect(clippy::cast_possible_wrap, reason = "small")]
                    let size = power_of_two(-(i as i32));
                    cube(size, size * 0.1)
                })
                .collect();
            let levels = build_over(&nested);
            assert!(levels <= DEEP + 9 + 1, "{levels}");
        }
    }

    /// Two to the power of this.
    fn power_of_two(exponent: i32) -> f32 {
        let exponent = (127 + exponent).clamp(1, 254);
        f32::from_bits(exponent.cast_unsigned() << 23)
    }

    #[test]
    fn roots_without_a_surface_are_cut_in_halves() {
        for scale in [1e-38_f32, 1e-20, 1e20, 1e36] {
            let line: Vec<_> =
                (0_u8..100).map(|i| cube(f32::from(i) / 100.0 * scale, 0.0)).collect();
            assert!(build_over(&line) <= 9, "{scale}");
        }
    }
}
