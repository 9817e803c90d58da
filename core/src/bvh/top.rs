//! The tree over the roots: binned SAH (Wald 2007), eight children a node.
//!
//! ```text
//! parts = [all roots]
//! until there are eight: split the part with the largest surface by binned SAH (parts.rs)
//!                        (16 bins an axis at most, by centre; an item costs ceil(triangles / 4));
//!                        from level 20 on: split the part with the most roots in the middle
//! parts of one root become that root's node, the others nodes of their own, breadth first
//! ```

use crate::aabb::Aabb;
use crate::invariant::OrBug;

use super::fine::FineList;
use super::layout::Entry;
use super::node::{Node, least_node};
use super::parts::{Limits, Splitter};
use super::sah::{ID, Item};

/// An item in entries.
pub(crate) const ITEM: usize = size_of::<Item>() / size_of::<Entry>();

/// How ranges of roots are split. More bins make rays no faster.
const LIMITS: Limits = Limits { leaf: 1, small: 1, bins: 16, halved_from: 20 };

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

/// Makes the nodes over some items, the roots of a tree with this box, and writes all but the topmost to `nodes`.
/// `record` returns the node of a subtree, which becomes a child, and its levels. Returns `None` if `nodes` is too
/// short.
///
/// `child` is where `nodes` will lie in the index.
pub(crate) fn build(
    items: &mut [Item],
    bounds: &Aabb,
    record: impl Fn(u32) -> (Node, u32),
    nodes: &mut [Node],
    child: u32,
    fine: &mut FineList<'_>,
) -> Option<Top> {
    #[expect(clippy::cast_possible_truncation, reason = "fewer than triangles")]
    let item_count = items.len() as u32;
    fine.clear();
    let mut splitter = Splitter::new(bounds, LIMITS);
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
        // Split the range of a node that waits, and make a child of each part.
        let parts = splitter.parts(items, &(start..end), level);
        let mut node = Node { child: child + count, ..Node::EMPTY };
        for (slot, part) in parts.ranges().enumerate() {
            node.set_inner(slot);
            let below = match items.get(part.start as usize).or_bug("a part behind the items") {
                Some(item) if part.len() == 1 => {
                    let (node, below) = record(item[ID]);
                    levels = levels.max(level + 1 + below);
                    node
                }
                _ => Node::unbuilt(part.start, part.end, level + 1),
            };
            *nodes.get_mut(count as usize)? = below;
            count += 1;
        }
        // Quantise the boxes, and write the node.
        node.set_boxes(&parts.bounds(), &parts.boxes, least_node(bounds));
        #[expect(clippy::cast_possible_truncation, reason = "fewer than triangles")]
        let number = at.map_or(0, |at| child + at as u32);
        fine.add(number, &mut node, &parts.boxes);
        match at {
            None => root = node,
            Some(at) => *nodes.get_mut(at)? = node,
        }
    }
    Some(Top { root, count, levels })
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use glam::Vec3A;

    use super::*;
    use crate::bvh::node::Child;
    use crate::bvh::sah::item;

    /// The tree over items of these boxes, each a root with one level: every item once, in so many levels.
    fn build_over(boxes: &[Aabb]) -> u32 {
        let mut items: Vec<Item> =
            (0..).zip(boxes).map(|(record, bounds)| item(bounds, record, 25)).collect();
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, one| all.union(one));
        // A root says by its ids which one it is.
        let leaf = |record: u32| {
            (Node { first: record, counts: [1, 0, 0, 0, 0, 0, 0, 0], ..Node::EMPTY }, 1)
        };
        // A root and its share of the nodes above are 11 / 7 nodes (the layout proves it).
        let mut nodes = vec![Node::EMPTY; boxes.len() * 11 / 7];
        let mut fine = FineList::new(&mut []);
        let top = build(&mut items, &bounds, leaf, &mut nodes, 1000, &mut fine).unwrap();
        let Top { root, count, levels } = top;
        // One less is too few.
        let mut few = vec![Node::EMPTY; count as usize - 1];
        assert!(build(&mut items, &bounds, leaf, &mut few, 1000, &mut fine).is_none());
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
            // Each half as large as the one before: SAH splits off a few at a time.
            let nested: Vec<_> = (0..count.min(200))
                .map(|i| {
                    #[expect(clippy::cast_possible_truncation, reason = "small")]
                    #[expect(clippy::cast_possible_wrap, reason = "small")]
                    let size = power_of_two(-(i as i32));
                    cube(size, size * 0.1)
                })
                .collect();
            let levels = build_over(&nested);
            assert!(levels <= LIMITS.halved_from + 9 + 1, "{levels}");
        }
    }

    /// Two to the power of this.
    fn power_of_two(exponent: i32) -> f32 {
        let exponent = (127 + exponent).clamp(1, 254);
        f32::from_bits(exponent.cast_unsigned() << 23)
    }

    #[test]
    fn lines_of_any_scale_take_few_levels() {
        for scale in [1e-38_f32, 1e-20, 1.0, 1e20, 1e36] {
            let line: Vec<_> =
                (0_u8..100).map(|i| cube(f32::from(i) / 100.0 * scale, 0.0)).collect();
            assert!(build_over(&line) <= 9, "{scale}");
            // Boxes on an axis have no surface at all, so that all splits cost the same.
            let on_axis = line.iter().map(|point| point.min * Vec3A::X);
            let on_axis: Vec<_> = on_axis.map(|at| Aabb { min: at, max: at }).collect();
            assert!(build_over(&on_axis) <= 9, "{scale}");
        }
    }
}
