//! Splits a range of items into the children of a node.
//!
//! ```text
//! parts = [range]
//! until there are eight, or all are small: choose a part, split it in two (sah.rs)
//!     choose: of the parts that become nodes the one with the largest surface;
//!             if there are none, of the leaves the one with the largest surface times count
//!     from a level on, in the place of both: choose the part with the most items, split it in the middle
//! ```
//!
//! A part is a range of items; it has nothing to do with the parts of a joined mesh. An item is a triangle in a tree of
//! quality `high`, the root of a subtree in one of quality `fast`.

use core::ops::Range;

use crate::aabb::Aabb;
use crate::bvh::node::{WIDTH, corners};
use crate::bvh::sah::{Bins, Item, SplitInTwo, box_of};
use crate::invariant::OrBug;
use crate::simd::{SimdLevel, dispatch};

/// How ranges are split.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// A part of more items becomes a node.
    pub(crate) leaf: u32,
    /// A part of at most so many is never split.
    pub(crate) small: u32,
    /// Bins of an axis, at most.
    pub(crate) bins: usize,
    /// The level from which on each split is in the middle, so that the number of levels is bounded.
    pub(crate) halved_from: u32,
}

/// The parts of a range, which become the children of a node.
pub(crate) struct Parts {
    count: usize,
    /// Part `p` holds the items from `ends[p]` to `ends[p + 1]`.
    pub(crate) ends: [u32; WIDTH + 1],
    /// The box around the items of each part.
    pub(crate) boxes: [Aabb; WIDTH],
    /// Half the surface of each box.
    areas: [f32; WIDTH],
}

impl Parts {
    /// A single part, whose box is not known.
    const fn one(range: &Range<u32>) -> Self {
        let mut ends = [0; WIDTH + 1];
        (ends[0], ends[1]) = (range.start, range.end);
        Self { count: 1, ends, boxes: [Aabb::EMPTY; WIDTH], areas: [0.0; WIDTH] }
    }

    /// The items of each part.
    pub(crate) fn ranges(&self) -> impl Iterator<Item = Range<u32>> {
        let [_, ends @ ..] = &self.ends;
        self.ends.iter().zip(ends).map(|(&start, &end)| start..end).take(self.count)
    }

    /// The box around all items.
    pub(crate) fn bounds(&self) -> Aabb {
        self.boxes.iter().fold(Aabb::EMPTY, |all, part| all.union(part))
    }

    /// Puts two halves, which meet at `middle`, in the place of a part. The parts behind it move up by one.
    fn replace(&mut self, part: usize, middle: u32, boxes: [Aabb; 2], length_scale: f32) {
        for at in (part + 1..=self.count).rev() {
            self.ends[(at + 1) % (WIDTH + 1)] = self.ends[at % (WIDTH + 1)];
            self.boxes[at % WIDTH] = self.boxes[(at - 1) % WIDTH];
            self.areas[at % WIDTH] = self.areas[(at - 1) % WIDTH];
        }
        self.ends[(part + 1) % (WIDTH + 1)] = middle;
        for (at, bounds) in (part..).zip(boxes) {
            let [x, y, z] = (bounds.size() * length_scale).to_array();
            self.boxes[at % WIDTH] = bounds;
            self.areas[at % WIDTH] = x * y + y * z + z * x;
        }
        self.count += 1;
    }
}

/// Splits ranges into parts.
pub(crate) struct Splitter {
    limits: Limits,
    simd_level: SimdLevel,
    /// The factor that scales lengths before areas are computed from them.
    length_scale: f32,
    bins: Bins,
}

impl Splitter {
    /// A splitter of items within `bounds`.
    pub(crate) fn new(bounds: &Aabb, limits: Limits) -> Self {
        let length_scale = inverse_power(bounds.size().max_element());
        Self { limits, simd_level: SimdLevel::detect(), length_scale, bins: Bins::new() }
    }

    /// Splits a range into eight parts, or into fewer if all are small. Moves the items, so that each part is a range.
    /// The parts become the children of a node with `level` levels above.
    pub(crate) fn parts(&mut self, items: &mut [Item], range: &Range<u32>, level: u32) -> Parts {
        let halve = level >= self.limits.halved_from;
        let mut parts = Parts::one(range);
        while parts.count < WIDTH
            && let Some((part, range)) = self.choose(&parts, halve)
        {
            let items = items.get_mut(range.start as usize..range.end as usize);
            let Some(items) = items.or_bug("a part behind the items") else { break };
            let (count, boxes) = self.split(items, halve);
            parts.replace(part, range.start + count, boxes, self.length_scale);
        }
        if parts.count == 1 {
            // Only a range that is small from the start is not split: that of a tree over few items.
            let all = items.get(range.start as usize..range.end as usize);
            parts.boxes[0] = box_around(all.or_bug("a range behind the items").unwrap_or_default());
        }
        parts
    }

    /// Splits items in two, where the SAH cost is least or else in the middle; returns how many are in the first part,
    /// and the boxes of both.
    #[expect(clippy::cast_possible_truncation, reason = "a range has 32 bits")]
    fn split(&mut self, items: &mut [Item], halve: bool) -> (u32, [Aabb; 2]) {
        // Two items can be split in one way only.
        if !halve && items.len() > 2 {
            let (most_bins, length_scale) = (self.limits.bins, self.length_scale);
            let (items, bins) = (&mut *items, &mut self.bins);
            let split = SplitInTwo { items, most_bins, length_scale, bins };
            if let Some((middle, boxes)) = dispatch(self.simd_level, split) {
                return (middle as u32, boxes.map(|sides| corners(&sides)));
            }
        }
        let middle = items.len() / 2;
        let halves = items.split_at_checked(middle).or_bug("a middle behind the items");
        let (first, second) = halves.unwrap_or_default();
        (middle as u32, [box_around(first), box_around(second)])
    }

    /// Chooses the part to split next: of those that become nodes the one with the largest surface, then of leaves the
    /// one with the largest surface times count; where parts are halved, the one with the most items. `None` if all
    /// are small.
    fn choose(&self, parts: &Parts, halve: bool) -> Option<(usize, Range<u32>)> {
        let mut best = None;
        let mut most = (false, -1.0, 0);
        for ((at, range), area) in parts.ranges().enumerate().zip(parts.areas) {
            let count = range.end - range.start;
            if count <= self.limits.small {
                continue;
            }
            let is_node = count > self.limits.leaf;
            #[expect(clippy::cast_precision_loss, reason = "a priority")]
            let priority = match (halve, is_node) {
                (true, _) => 0.0,
                (false, true) => area,
                (false, false) => area * count as f32,
            };
            let priority = (is_node, priority, count);
            if priority > most {
                (best, most) = (Some((at, range)), priority);
            }
        }
        best
    }
}

/// The box around some items.
fn box_around(items: &[Item]) -> Aabb {
    items.iter().fold(Aabb::EMPTY, |all, item| all.union(&box_of(item)))
}

/// A power of two near the inverse of a length.
const fn inverse_power(length: f32) -> f32 {
    let exponent = length.to_bits() >> 23 & 0xff;
    let inverse = if exponent > 252 { 1 } else { 253 - exponent };
    f32::from_bits(if inverse < 1 { 1 } else { inverse } << 23)
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use glam::Vec3A;

    use super::*;
    use crate::bvh::sah::{ID, item};
    use crate::random;

    #[test]
    fn parts_hold_all_items_once_and_nothing_else_moves() {
        let mut state = 1;
        let everywhere = Aabb { min: Vec3A::splat(-1.0), max: Vec3A::splat(2.0) };
        for (leaf, small) in [(8, 4), (1, 1)] {
            let mut splitter =
                Splitter::new(&everywhere, Limits { leaf, small, bins: 16, halved_from: 1 });
            for (count, level) in (1..100).flat_map(|count| [(count, 0), (count, 1)]) {
                // In every third range all items have the same box, so that no bins tell them apart.
                let mut point =
                    || if count % 3 == 0 { Vec3A::ONE } else { random::point(&mut state) };
                let range = 5..5 + count;
                let before: Vec<Item> = (0..range.end + 5)
                    .map(|id| (id, point()))
                    .map(|(id, min)| item(&Aabb { min, max: min + 0.1 }, id, 1))
                    .collect();
                let mut items = before.clone();
                let parts = splitter.parts(&mut items, &range, level);
                let mut end = range.start;
                for (part, bounds) in parts.ranges().zip(&parts.boxes) {
                    assert!(part.start == end && part.end > end, "{count}");
                    let inside = &items[part.start as usize..part.end as usize];
                    assert_eq!(bounds, &box_around(inside), "{count}");
                    end = part.end;
                }
                assert_eq!(end, range.end);
                let most = parts.ranges().map(|part| part.end - part.start).max().unwrap();
                let least = parts.ranges().map(|part| part.end - part.start).min().unwrap();
                let parts = parts.ranges().count();
                assert!(parts == WIDTH || most <= small, "{count}");
                assert_eq!(parts == 1, count <= small);
                // Halves differ by one at most, and the largest is split first.
                assert!(level == 0 || most <= 2 * least + 1, "{count}");
                items[range.start as usize..range.end as usize].sort_by_key(|item| item[ID]);
                assert_eq!(items, before);
            }
        }
    }

    #[test]
    fn nodes_are_split_before_leaves_and_wide_parts_before_others() {
        let limits = Limits { leaf: 8, small: 4, bins: 16, halved_from: 1 };
        let splitter = Splitter::new(&Aabb { min: Vec3A::ZERO, max: Vec3A::ONE }, limits);
        // Parts of so many items with such surfaces; the part that is split next, and the one if parts are halved.
        let cases = [
            ([(8, 9.0), (9, 1.0), (3, 50.0), (5, 20.0)], [Some(1), Some(1)]),
            ([(10, 9.0), (9, 1.0), (9, 10.0), (5, 20.0)], [Some(2), Some(0)]),
            ([(8, 9.0), (8, 1.0), (3, 50.0), (5, 20.0)], [Some(3), Some(0)]),
            ([(4, 9.0), (1, 1.0), (3, 50.0), (2, 20.0)], [None, None]),
        ];
        for (sizes, chosen) in cases {
            let mut parts = Parts::one(&(0..0));
            parts.count = sizes.len();
            for (at, (count, area)) in sizes.into_iter().enumerate() {
                parts.ends[at + 1] = parts.ends[at] + count;
                parts.areas[at] = area;
            }
            for (halve, chosen) in [false, true].into_iter().zip(chosen) {
                let expected = chosen.map(|at| (at, parts.ends[at]..parts.ends[at + 1]));
                assert_eq!(splitter.choose(&parts, halve), expected);
            }
        }
    }
}
