//! Fine sides: the boxes of a node's children as f32, beside the eight bits a side of [`node`](super::node).
//!
//! A step is a 127th to a 254th of a node. A child that is thinner (a wall, a floor, a small object in a large scene)
//! gets a box that is one or two steps thick. Rays that start near the child then enter its box, and all that is below
//! it, though they do not come close. So a node with such a child gets a second set of sides, as long as there is room
//! for one in 2048 triangles. The root of the tree comes first, also without a thin child: rays often start at the
//! outer walls. A query may use either set: both hold all triangles.
//!
//! Quality `fast` gives fine sides to nodes above the roots of subtrees, nearest to the root of the tree first. Quality
//! `high` gives them to the top nodes, which are made before the triangles are divided among tasks.
//!
//! ```text
//! bvh: | ids | nodes | fine sides: 6 x 8 x f32 and the number of the node, for each node that has them |
//! ```
//!
//! Few nodes need them: in scans hardly any. [`most_fine`] bounds them for any mesh. Only nodes without leaves may have
//! them: such a node has no first id, so [`Node::first`] is free to tell which sides are its own.
//!
//! Sides keep a distance from the exact box, as a ray along a side would otherwise cross it at distance 0
//! ([`slab`](super::slab)): a build moves them by a 512th of a step, and by a bit of the coordinate; `validate` demands
//! a 1024th. Rounding needs no other margin here: a side minus an origin is rounded once, relative to the result.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8};
use glam::DVec3;
use zerocopy::{FromBytes, Immutable, IntoBytes};

use super::node::{Node, WIDTH};
use crate::aabb::Aabb;

/// The bit of [`Node::first`] that says that a node has fine sides; the other bits are their index. No index of an id
/// has it, as there are at most 2^31 ids.
const HAS_FINE: u32 = 1 << 31;

/// A child whose box is no thicker than so many steps is worth fine sides.
const THIN: u8 = 5;
/// A node counts on an axis if its boxes together are at least so many steps wide. A flat node does not: its step has
/// the least size.
const WIDE: u8 = 64;

/// Nodes with fine sides, at most: one for so many triangles.
const TRIANGLES_PER_FINE: u64 = 2048;

/// The most nodes with fine sides of a tree over so many triangles.
pub(crate) const fn most_fine(triangles: u64) -> u64 {
    triangles / TRIANGLES_PER_FINE
}

/// The distance of sides from the exact box in a build, in steps.
const MARGIN: f32 = 1.0 / 512.0;
/// The distance that they must have.
const LEAST_MARGIN: f64 = 1.0 / 1024.0;

/// Least x, y, z, then greatest x, y, z of each child.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, Immutable, IntoBytes)]
pub(crate) struct FineSides {
    sides: [[f32; WIDTH]; 6],
    /// The number of the node, so that no two nodes can have the same sides.
    node: u32,
}

const _: () = assert!(size_of::<FineSides>() == 196 && align_of::<FineSides>() == 4);

/// The exact box of a child: least x, y, z, then the negated greatest.
pub(crate) type ExactBox = [f32; 6];

/// The fine sides of a tree while it is built.
pub(crate) struct FineList<'f> {
    room: &'f mut [FineSides],
    count: usize,
}

impl<'f> FineList<'f> {
    pub(crate) fn new(room: &'f mut [FineSides]) -> Self {
        Self { room, count: 0 }
    }

    /// Begins anew.
    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// Gives the node with a number fine sides if they are worth it and there is room for them. All children of the
    /// node are nodes, and their boxes are exact.
    pub(crate) fn add(&mut self, number: u32, node: &mut Node, boxes: &[Aabb; WIDTH]) {
        if number > 0 && !node.is_worth_fine_sides() {
            return;
        }
        if let Some(sides) = self.room.get_mut(self.count) {
            *sides = FineSides { node: number, ..FineSides::NONE };
            let mut rest = node.inner();
            while let Some(slot) = next_slot(&mut rest) {
                let bounds = &boxes[slot];
                let ([x, y, z], [u, v, w]) = (bounds.min.to_array(), bounds.max.to_array());
                sides.set(node, slot, &[x, y, z, -u, -v, -w]);
            }
            #[expect(clippy::cast_possible_truncation, reason = "fewer than triangles")]
            let index = self.count as u32;
            node.first = HAS_FINE | index;
            self.count += 1;
        }
    }

    /// The sides that were added.
    pub(crate) fn finish(self) -> &'f [FineSides] {
        self.room.get(..self.count).unwrap_or_default()
    }
}

/// The lowest of the slots that are set in a mask, which loses it.
fn next_slot(rest: &mut u32) -> Option<usize> {
    let slot = rest.trailing_zeros();
    *rest &= rest.wrapping_sub(1);
    (slot < u32::BITS).then_some(slot as usize % WIDTH)
}

impl FineSides {
    /// The sides of a node without children: the boxes are inside out, so that no ray meets them.
    const NONE: Self = {
        let (least, greatest) = ([f32::MAX; WIDTH], [f32::MIN; WIDTH]);
        Self { sides: [least, least, least, greatest, greatest, greatest], node: u32::MAX }
    };

    /// Returns true if they name the node by its number, the node has no leaves, all sides are finite, and the boxes of
    /// children that are not there are inside out.
    pub(crate) fn are_of(&self, number: u32, node: &Node) -> bool {
        let is_inside_out = |slot: usize| {
            let none = Self::NONE.sides.map(|side| side[slot].to_bits());
            self.sides.map(|side| side[slot].to_bits()) == none
        };
        self.node == number
            && self.sides.iter().flatten().all(|side| side.is_finite())
            && node.counts == [0; WIDTH]
            && (0..WIDTH).all(|slot| node.inner() >> slot & 1 == 1 || is_inside_out(slot))
    }

    /// The box that child `slot` of the node may fill.
    pub(crate) fn holds(&self, node: &Node, slot: usize) -> (DVec3, DVec3) {
        let margin = DVec3::from(node.steps().map(f64::from)) * LEAST_MARGIN;
        let [a, b, c, d, e, f] = self.sides.map(|side| f64::from(side[slot % WIDTH]));
        (DVec3::new(a, b, c) + margin, DVec3::new(d, e, f) - margin)
    }

    /// Writes the sides of child `slot` of a node. Out of line, as few nodes have any.
    #[inline(never)]
    pub(crate) fn set(&mut self, node: &Node, slot: usize, exact: &ExactBox) {
        let margins = node.steps().map(|step| step * MARGIN);
        for (side, row) in self.sides.iter_mut().enumerate() {
            // Move all sides down: the greatest are negated.
            let moved = (exact[side] - margins[side % 3]).next_down();
            row[slot % WIDTH] = if side < 3 { moved } else { -moved };
        }
    }

    /// A side of eight boxes: 0, 1 and 2 are least x, y, z, and 3, 4 and 5 greatest.
    #[inline(always)]
    pub(crate) fn side<S: Simd>(&self, simd: S, side: usize) -> f32x8<S> {
        f32x8::simd_from(simd, self.sides[side % 6])
    }
}

impl Node {
    /// The index of the node's fine sides in the list, or one behind the end of any list if it has none.
    #[inline(always)]
    pub(crate) const fn fine_index(&self) -> usize {
        // Without the bit, the number is 2^31 or more.
        (self.first ^ HAS_FINE) as usize
    }

    /// Returns true if the node has fine sides.
    pub(crate) const fn has_fine_sides(&self) -> bool {
        self.first & HAS_FINE != 0
    }

    /// Returns true if a child is so thin on an axis that its quantised box may be many times as thick.
    fn is_worth_fine_sides(&self) -> bool {
        (0..3).any(|axis| self.is_thin_on(axis))
    }

    #[inline(never)]
    fn is_thin_on(&self, axis: usize) -> bool {
        let (low, high) = (&self.bounds[axis % 3], &self.bounds[axis % 3 + 3]);
        let (mut least, mut greatest, mut thinnest) = (u8::MAX, 0, u8::MAX);
        let mut rest = self.inner();
        while let Some(slot) = next_slot(&mut rest) {
            least = least.min(low[slot]);
            greatest = greatest.max(high[slot]);
            thinnest = thinnest.min(high[slot].wrapping_sub(low[slot]));
        }
        thinnest <= THIN && greatest.saturating_sub(least) >= WIDE
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use glam::Vec3A;

    use super::*;
    use crate::random;

    /// A node of eight small boxes in a large one, and these boxes.
    fn node(state: &mut u32, scale: f32, place: Vec3A) -> (Node, Aabb, [Aabb; WIDTH]) {
        let boxes = [0; WIDTH].map(|_| {
            let center = place + random::point(state) * scale;
            let half = random::point(state).abs() * scale * 0.01;
            Aabb { min: center - half, max: center + half }
        });
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, child| all.union(child));
        let mut node = Node::EMPTY;
        for slot in 0..WIDTH {
            node.set_inner(slot);
        }
        node.set_boxes(&bounds, &boxes, bounds.size().max_element() * 1e-10);
        (node, bounds, boxes)
    }

    /// The fine sides of a root.
    fn sides_of(node: &Node, boxes: &[Aabb; WIDTH]) -> FineSides {
        let mut room = [FineSides::NONE];
        let mut list = FineList::new(&mut room);
        let mut node = *node;
        list.add(0, &mut node, boxes);
        list.finish()[0]
    }

    #[test]
    fn they_hold_the_exact_boxes_with_a_margin_and_little_more() {
        let mut state = 1;
        for scale in [1e-28, 1e-10, 1.0, 1e10, 1e34] {
            for place in [Vec3A::ZERO, Vec3A::new(3.0, -50.0, 1000.0)] {
                for _ in 0..if cfg!(miri) { 1 } else { 200 } {
                    let (node, _, boxes) = node(&mut state, scale, place * scale);
                    let sides = sides_of(&node, &boxes);
                    let step = DVec3::from(node.steps().map(f64::from));
                    for (slot, exact) in boxes.iter().enumerate() {
                        let (min, max) = sides.holds(&node, slot);
                        let (low, high) = (exact.min.as_dvec3(), exact.max.as_dvec3());
                        assert!(min.cmple(low).all() && max.cmpge(high).all(), "{scale} {exact:?}");
                        // Where coordinates have few digits, a bit of one is a quarter of a step.
                        let slack = (low - min).max(max - high);
                        assert!(slack.cmple(0.5 * step).all(), "{scale} {exact:?}: {slack}");
                        let is_far = place != Vec3A::ZERO;
                        assert!(is_far || slack.cmple(0.01 * step).all(), "{exact:?}: {slack}");
                    }
                }
            }
        }
    }

    #[test]
    fn sides_that_are_too_close_hold_less_than_the_box() {
        let (node, _, boxes) = node(&mut 5, 1.0, Vec3A::ZERO);
        let (min, step) = (boxes[0].min.as_dvec3(), DVec3::from(node.steps().map(f64::from)));
        for (part, is_enough) in [(1.0 / 900.0, true), (1.0 / 1100.0, false)] {
            let mut sides = sides_of(&node, &boxes);
            for axis in 0..3 {
                sides.sides[axis][0] = (min - step * part).as_vec3().to_array()[axis];
            }
            let (low, _) = sides.holds(&node, 0);
            let held = low.cmple(min);
            assert_eq!([held.x, held.y, held.z], [is_enough; 3], "{part} of a step");
        }
    }

    #[test]
    fn nodes_have_them_whose_children_are_thin_and_so_has_the_root() {
        let (mut small, bounds, boxes) = node(&mut 7, 1.0, Vec3A::ZERO);
        // All children are wide but one.
        let wide = boxes.map(|child| Aabb { min: child.min - 0.1, max: child.max + 0.1 });
        let bounds = Aabb { min: bounds.min - 0.1, max: bounds.max + 0.1 };
        for (thickness, is_thin) in [(0.0, true), (0.01, true), (0.1, false)] {
            let mut boxes = wide;
            boxes[3].max.y = boxes[3].min.y + thickness;
            small.set_boxes(&bounds, &boxes, 1e-10);
            assert_eq!(small.is_worth_fine_sides(), is_thin, "{thickness}");
            let mut room = [FineSides::NONE; 2];
            let mut list = FineList::new(&mut room);
            let mut numbers = Vec::new();
            for number in [5, 0, 6, 7] {
                let mut node = small;
                list.add(number, &mut node, &boxes);
                if node.has_fine_sides() {
                    numbers.push(number);
                }
            }
            // There is room for two.
            assert_eq!(numbers, if is_thin { &[5, 0] } else { &[0][..] });
            let added = list.finish();
            assert!(added.iter().zip(&numbers).all(|(sides, &of)| sides.are_of(of, &small)));
            assert_eq!(added.len(), numbers.len());
        }
    }

    #[test]
    fn the_box_of_a_child_that_is_not_there_is_inside_out() {
        let (mut node, _, boxes) = node(&mut 3, 1.0, Vec3A::ZERO);
        node.word &= !(1 << (24 + 6));
        let mut sides = sides_of(&node, &boxes);
        assert!(sides.are_of(0, &node) && !sides.are_of(1, &node));
        sides.sides[4][6] = 1.0;
        assert!(!sides.are_of(0, &node));
    }
}
