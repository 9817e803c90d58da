//! Splits items in two where the SAH cost is least (Wald 2007).
//!
//! ```text
//! for each item:  grow the box of the centres, which the bins divide
//! for each item:  bin of its centre on each axis; grow the bins' boxes, add its cost
//! for each axis:  sweep from both ends; cost of a split = area * cost of the items, summed over both sides
//! for each item:  move it to the first part or the second
//! ```
//!
//! A box is one vector: least x, y, z and minus greatest x, y, z. So the union of two boxes is one minimum,
//! and the vector minus itself with its halves swapped is twice the centre.

use core::mem::offset_of;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8, u32x8};
use glam::Vec3A;
use zerocopy::FromZeros;

use crate::aabb::Aabb;
use crate::bvh::node::{Sides, corners};
use crate::cell::WHOLE_SHIFT;
use crate::extremes::Extremes;
use crate::invariant::OrBug;
use crate::simd::{HAS_VECTORS, Kernel};

/// A box during a build, as bits: the least corner, a number of the caller's, the negated greatest corner, the cost of
/// entering it.
pub(crate) type Item = [u32; 8];

/// Index of the number in an item.
pub(crate) const ID: usize = 3;

/// Index of the cost in an item.
const COST: usize = 7;

/// Makes an item.
#[inline(always)]
pub(crate) fn item(bounds: &Aabb, id: u32, cost: u32) -> Item {
    // Turn -0 into 0, so that the order of a union does not matter.
    let [x, y, z] = (bounds.min + Vec3A::ZERO).to_array().map(f32::to_bits);
    let [nx, ny, nz] = (-(bounds.max + Vec3A::ZERO)).to_array().map(f32::to_bits);
    [x, y, z, id, nx, ny, nz, cost]
}

/// The box of an item.
pub(crate) fn box_of(item: &Item) -> Aabb {
    corners(&item.map(f32::from_bits))
}

/// The box of nothing.
const NOTHING: Sides = [f32::INFINITY; 8];

/// Bins of an axis, at most.
pub(crate) const MOST_BINS: usize = 32;

const _: () = assert!(MOST_BINS <= 0xff, "a split has eight bits for a bin");

/// The items of a bin: the sum of their costs, and the box around their boxes.
///
/// A bin has a cache line of its own, so that no box lies across two. The box is off the multiples of 16 bytes, where
/// the loads of items begin: some processors (Zen 4) let the load of an item wait for a store to a box if their
/// addresses differ by a multiple of 4096.
#[repr(C, align(64))]
#[derive(Debug, Clone, Copy, FromZeros)]
struct Bin {
    cost: u32,
    /// Moves the box off the multiples of 16 bytes.
    _off: u32,
    bounds: Sides,
}

const _: () = assert!(size_of::<Bin>() == 64 && offset_of!(Bin, bounds) % 16 == 8);

/// The bins of a range on each axis.
#[derive(FromZeros)]
pub(crate) struct Bins([[Bin; MOST_BINS]; 3]);

/// The box of an item. Clears id and cost: as floats they may be denormal, and those are slow.
#[inline(always)]
fn load<S: Simd>(simd: S, item: &Item) -> f32x8<S> {
    let word = u32::MAX;
    let mask = u32x8::simd_from(simd, [word, word, word, 0, word, word, word, 0]);
    (u32x8::simd_from(simd, *item) & mask).bitcast()
}

/// Twice the centre of a box, and minus that.
#[inline(always)]
fn twice_center<S: Simd>(sides: f32x8<S>) -> f32x8<S> {
    let (low, high) = sides.split();
    sides - high.combine(low)
}

/// The box of twice the centres of some items.
#[inline(always)]
fn box_of_centers<S: Simd>(simd: S, items: &[Item]) -> f32x8<S> {
    let mut centers = f32x8::splat(simd, f32::INFINITY);
    // Unite four centres first: a minimum with the box waits for the one before it.
    let (fours, rest) = if HAS_VECTORS { items.as_chunks::<4>() } else { (&[][..], items) };
    for [a, b, c, d] in fours {
        let [a, b] = [twice_center(load(simd, a)), twice_center(load(simd, b))];
        let [c, d] = [twice_center(load(simd, c)), twice_center(load(simd, d))];
        centers = centers.lesser(a.lesser(b).lesser(c.lesser(d)));
    }
    for item in rest {
        centers = centers.lesser(twice_center(load(simd, item)));
    }
    centers
}

/// Half the surface of a box whose lengths are multiplied by `length_scale`.
#[inline(always)]
fn area<S: Simd>(simd: S, sides: f32x8<S>, length_scale: f32) -> f32 {
    let (low, high) = sides.split();
    let size: [f32; 4] = ((low + high) * f32x4::splat(simd, length_scale)).into();
    size[0] * size[1] + size[1] * size[2] + size[2] * size[0]
}

/// A cost as a factor.
#[inline(always)]
#[expect(clippy::cast_precision_loss, reason = "a cost")]
const fn as_factor(cost: u32) -> f32 {
    cost as f32
}

/// The map from centres to bins.
struct BinScale {
    /// The least corner of the box of twice the centres.
    low: [f32; 4],
    /// Bins for each unit of length; `f32::MAX` where all centres have the same coordinate.
    scale: [f32; 4],
    /// Bins of each axis.
    count: usize,
}

impl BinScale {
    #[inline(always)]
    fn new<S: Simd>(simd: S, count: usize, centers: f32x8<S>) -> Self {
        // Keep every position below the number of bins, in spite of rounding.
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let bins = f32x4::splat(simd, count as f32 * 0.999);
        let (low, high) = centers.split();
        let scale = bins / (f32x4::splat(simd, 0.0) - (low + high));
        let scale = scale.lesser(f32x4::splat(simd, f32::MAX));
        Self { low: low.into(), scale: scale.into(), count }
    }

    /// The bins of an item on each axis.
    #[inline(always)]
    fn bins_of<S: Simd>(&self, simd: S, sides: f32x8<S>) -> [usize; 3] {
        let (min, max) = sides.split();
        let (low, scale) = (f32x4::simd_from(simd, self.low), f32x4::simd_from(simd, self.scale));
        let positions = ((min - max) - low) * scale - f32x4::splat(simd, 0.5);
        let [x, y, z, _]: [f32; 4] = (positions + f32x4::splat(simd, WHOLE_SHIFT)).into();
        [bin(x), bin(y), bin(z)]
    }

    /// The bin of an item on one axis.
    #[inline(always)]
    fn bin_of(&self, item: &Item, axis: usize) -> usize {
        let twice = f32::from_bits(item[axis % 3]) - f32::from_bits(item[4 + axis % 3]);
        let position = (twice - self.low[axis % 3]) * self.scale[axis % 3] - 0.5;
        bin(position + WHOLE_SHIFT)
    }
}

/// The bin of a position to which [`WHOLE_SHIFT`] was added.
#[inline(always)]
const fn bin(position: f32) -> usize {
    position.to_bits() as usize % MOST_BINS
}

/// A split of a range: an axis, and the bin on it at which the second part begins.
///
/// A split is one number, so that the least can be found without a branch. Its highest bits are those of the cost; then
/// come the axis and 255 minus the bin. Among splits of equal cost, that on the first axis is the least, then that at
/// the last bin.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Split(u64);

impl Split {
    /// Greater than any split of finite cost, and less than one whose cost is infinite or NaN.
    const NONE: Self = Self((f32::INFINITY.to_bits() as u64) << 32);

    /// Makes a split. Costs are in the order of their bits if they have no sign; only a NaN may have one. An area has
    /// none: it is the sum of the products of three numbers in pairs, which cannot all be -0.
    #[inline(always)]
    fn new(axis: usize, bin: usize, cost: f32) -> Self {
        debug_assert!(cost.is_nan() || cost.is_sign_positive(), "a cost with a sign");
        Self(u64::from(cost.to_bits()) << 32 | (axis << 8 | (0xff - bin)) as u64)
    }

    fn axis(self) -> usize {
        (self.0 >> 8 & 0xff) as usize % 3
    }

    fn bin(self) -> usize {
        0xff - (self.0 & 0xff) as usize
    }
}

impl Bins {
    /// Bins of zeros: the compiler clears them where they lie, without a copy. [`fill`](Self::fill) sets a bin before
    /// it is read.
    pub(crate) fn new() -> Self {
        Self::new_zeroed()
    }

    /// Empties the bins, then adds each item to one bin of each axis.
    #[inline(always)]
    fn fill<S: Simd>(&mut self, simd: S, items: &[Item], rule: &BinScale) {
        for bins in &mut self.0 {
            for bin in bins.iter_mut().take(rule.count) {
                (bin.bounds, bin.cost) = (NOTHING, 0);
            }
        }
        for item in items {
            let sides = load(simd, item);
            let [x, y, z] = rule.bins_of(simd, sides);
            for (axis, at) in [(0, x), (1, y), (2, z)] {
                let bin = &mut self.0[axis][at % MOST_BINS];
                bin.bounds = f32x8::simd_from(simd, bin.bounds).lesser(sides).into();
                bin.cost += item[COST];
            }
        }
    }

    /// Sweeps over each axis from both ends, for the split of least cost.
    #[inline(always)]
    fn best<S: Simd>(&self, simd: S, rule: &BinScale, length_scale: f32) -> Option<Split> {
        debug_assert!(rule.count <= MOST_BINS, "more bins than there is room for");
        let mut best = Split::NONE;
        for (axis, bins) in self.0.iter().enumerate() {
            if rule.scale[axis % 3] >= f32::MAX {
                continue;
            }
            // Find the costs of what is before each bin. The cost of nothing is infinity times zero, which is NaN; no
            // split with it is less than `NONE`.
            let mut costs = [f32::NAN; MOST_BINS];
            let (mut all, mut sum) = (f32x8::splat(simd, f32::INFINITY), 0);
            for (bin, cost) in bins.iter().take(rule.count).zip(&mut costs) {
                *cost = area(simd, all, length_scale) * as_factor(sum);
                all = all.lesser(f32x8::simd_from(simd, bin.bounds));
                sum += bin.cost;
            }
            // Add those of what is behind.
            let (mut all, mut sum) = (f32x8::splat(simd, f32::INFINITY), 0);
            for at in (1..rule.count).rev() {
                let (Some(bin), Some(before)) = (bins.get(at), costs.get(at)) else { continue };
                all = all.lesser(f32x8::simd_from(simd, bin.bounds));
                sum += bin.cost;
                let cost = before + area(simd, all, length_scale) * as_factor(sum);
                best = best.min(Split::new(axis, at, cost));
            }
        }
        (best < Split::NONE).then_some(best)
    }
}

/// Splits items in two; returns how many are in the first part, and the boxes of both parts. `None` if no bins tell the
/// items apart.
pub(crate) struct SplitInTwo<'w> {
    pub(crate) items: &'w mut [Item],
    /// Bins of an axis, at most.
    pub(crate) most_bins: usize,
    /// The factor that scales lengths before areas are computed from them.
    pub(crate) length_scale: f32,
    /// Bins that other splits may have used.
    pub(crate) bins: &'w mut Bins,
}

impl Kernel for SplitInTwo<'_> {
    type Output = Option<(usize, [Sides; 2])>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Self { items, most_bins, length_scale, bins } = self;
        // Bin the items by their centres.
        let count = bin_count(items.len()).min(most_bins);
        let rule = BinScale::new(simd, count, box_of_centers(simd, items));
        bins.fill(simd, items, &rule);
        // Find the cheapest split, and the boxes of its parts.
        let split = bins.best(simd, &rule, length_scale)?;
        let bins = bins.0[split.axis()].get(..rule.count).unwrap_or_default();
        let parts = bins.split_at_checked(split.bin()).or_bug("a split behind the bins");
        let (first, second) = parts.unwrap_or_default();
        let boxes = [union(simd, first), union(simd, second)];
        // Move the items.
        let middle = partition(simd, items, &rule, &split);
        debug_assert!(middle > 0 && middle < items.len(), "a part without items");
        Some((middle, boxes))
    }
}

/// Brings the items before a split to the front; returns how many there are.
///
/// This is Lomuto's partition as one cycle of moves. The first item is set aside and leaves a gap. Each step moves the
/// item behind the first part into the gap, and puts the item behind the gap in its place, which leaves the next gap.
/// The first part grows if that item belongs to it. No branch depends on the part of an item, as it is unpredictable.
/// A choice between two items would become a masked store where the compiler may use AVX-512, and the next loads would
/// wait for it.
#[inline(always)]
fn partition<S: Simd>(simd: S, items: &mut [Item], rule: &BinScale, split: &Split) -> usize {
    let Some(&start) = items.first() else { return 0 };
    let mut middle = 0;
    for gap in 0..items.len() {
        debug_assert!(middle <= gap, "the first part reaches behind the gap");
        // The first item comes last: its place was the first gap.
        let item = items.get(gap + 1).unwrap_or(&start);
        let is_first = rule.bin_of(item, split.axis()) < split.bin();
        let item = u32x8::simd_from(simd, *item);
        let Some(other) = items.get(middle).or_bug("an index behind the items") else { break };
        put(items, gap, u32x8::simd_from(simd, *other));
        put(items, middle, item);
        middle += usize::from(is_first);
    }
    middle
}

/// Stores an item.
#[inline(always)]
fn put<S: Simd>(items: &mut [Item], at: usize, item: u32x8<S>) {
    if let Some(slot) = items.get_mut(at).or_bug("an index behind the items") {
        *slot = item.into();
    }
}

/// The box around the boxes of some bins.
#[inline(always)]
fn union<S: Simd>(simd: S, bins: &[Bin]) -> Sides {
    let mut bounds = f32x8::splat(simd, f32::INFINITY);
    for bin in bins {
        bounds = bounds.lesser(f32x8::simd_from(simd, bin.bounds));
    }
    bounds.into()
}

/// Bins of each axis for so many items.
const fn bin_count(items: usize) -> usize {
    match items {
        0..=32 => 8,
        33..=256 => 16,
        _ => MOST_BINS,
    }
}

#[cfg(test)]
mod tests {
    use alloc::format;
    use alloc::vec::Vec;
    use core::array;

    use super::*;
    use crate::random;
    use crate::simd::{SimdLevel, dispatch};

    /// Finds the box of twice the centres of some items, then splits them, with bins that earlier splits have used.
    struct SplitOf<'a>(&'a mut [Item], &'a mut Bins);

    impl Kernel for SplitOf<'_> {
        type Output = (Sides, Option<(usize, [Sides; 2])>);

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let Self(items, bins) = self;
            let centers = box_of_centers(simd, items).into();
            let (most_bins, length_scale) = (MOST_BINS, LENGTH_SCALE);
            (centers, SplitInTwo { items, most_bins, length_scale, bins }.run(simd))
        }
    }

    const LENGTH_SCALE: f32 = 0.125;

    fn sides_of_item(item: &Item) -> Sides {
        let [x, y, z, _, u, v, w, _] = item.map(f32::from_bits);
        [x, y, z, 0.0, u, v, w, 0.0]
    }

    /// The box of some items, and the cost of entering them.
    fn box_and_cost(items: &[Item]) -> (Sides, f32) {
        let bounds = least(items.iter().map(sides_of_item));
        let size = |axis: usize| (bounds[axis] + bounds[axis + 4]) * LENGTH_SCALE;
        let (x, y, z) = (size(0), size(1), size(2));
        let cost: u32 = items.iter().map(|item| item[COST]).sum();
        (bounds, (x * y + y * z + z * x) * as_factor(cost))
    }

    /// The least number in each lane.
    fn least(sides: impl Iterator<Item = Sides>) -> Sides {
        sides.fold(NOTHING, |all, one| array::from_fn(|lane| all[lane].min(one[lane])))
    }

    /// The box of twice the centres of some items.
    fn naive_box_of_centers(items: &[Item]) -> Sides {
        least(
            items.iter().map(sides_of_item).map(|[x, y, z, _, u, v, w, _]| {
                [x - u, y - v, z - w, 0.0, u - x, v - y, w - z, 0.0]
            }),
        )
    }

    /// The map from centres to bins.
    fn naive_rule(items: &[Item]) -> BinScale {
        let (count, centers) = (bin_count(items.len()), naive_box_of_centers(items));
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let scale = |axis: usize| count as f32 * 0.999 / -(centers[axis] + centers[axis + 4]);
        let scale = array::from_fn(|axis| scale(axis).abs().min(f32::MAX));
        BinScale { low: array::from_fn(|axis| centers[axis]), scale, count }
    }

    /// Makes the same split, found by trying each; of equal ones that of the first axis, then of the last bin. Leaves
    /// both parts in the order of their ids.
    fn naive(items: &mut [Item]) -> Option<(usize, [Sides; 2])> {
        let rule = naive_rule(items);
        let mut best = (f32::INFINITY, 0, 0);
        for axis in (0..3).filter(|&axis| rule.scale[axis] < f32::MAX) {
            for bin in (1..rule.count).rev() {
                let is_first = |item: &&Item| rule.bin_of(item, axis) < bin;
                let (first, second): (Vec<_>, Vec<_>) = items.iter().partition(is_first);
                if first.is_empty() || second.is_empty() {
                    continue;
                }
                let cost = box_and_cost(&first).1 + box_and_cost(&second).1;
                if cost < best.0 {
                    best = (cost, axis, bin);
                }
            }
        }
        let (cost, axis, bin) = best;
        if cost.is_infinite() {
            return None;
        }
        let is_first = |item: &Item| rule.bin_of(item, axis) < bin;
        let middle = items.iter().filter(|item| is_first(item)).count();
        items.sort_by_key(|item| (!is_first(item), item[ID]));
        Some((middle, [box_and_cost(&items[..middle]).0, box_and_cost(&items[middle..]).0]))
    }

    #[test]
    fn the_cheapest_split_is_found_alike_with_all_vectors() {
        let mut state = 1;
        let mut bins = Bins::new();
        // The first count uses all bins. Later splits must not read what it left there.
        for count in [400_u32, 2, 5, 7, 8, 9, 32, 33, 100, 256, 257, 259] {
            // Coordinates of few bits make ties. In the last three kinds the centres lie in a plane, on a line and in
            // one place.
            for (steps, flat) in [(1e6, 3), (8.0, 3), (2.0, 3), (8.0, 2), (8.0, 1), (8.0, 0)] {
                let mut number = |axis: u8| {
                    let number = (random::point(&mut state).x * steps).floor() / steps;
                    if axis < flat { number } else { 0.5 }
                };
                let items: Vec<Item> = (0..count)
                    .map(|id| {
                        let min = Vec3A::new(number(0), number(1), number(2));
                        let size = Vec3A::new(number(0), number(1), number(2)).abs();
                        item(&Aabb { min, max: min + size }, id, 1 + id % 3)
                    })
                    .collect();
                let centers = naive_box_of_centers(&items);
                let mut expected = items.clone();
                let found = naive(&mut expected);
                assert_eq!(found.is_none(), flat == 0, "{count}, {steps}, {flat}");
                let middle = found.map_or(count as usize, |(middle, _)| middle);
                let mut order: Option<Vec<Item>> = None;
                for level in SimdLevel::available() {
                    let mut items = items.clone();
                    let (centers_of, split) = dispatch(level, SplitOf(&mut items, &mut bins));
                    let case = format!("{level:?}, {count}, {steps}, {flat}");
                    assert_eq!((centers_of, split), (centers, found), "{case}");
                    // All levels leave the items in the same order.
                    assert_eq!(order.get_or_insert_with(|| items.clone()), &items, "{case}");
                    let (first, second) = items.split_at_mut(middle);
                    first.sort_by_key(|item| item[ID]);
                    second.sort_by_key(|item| item[ID]);
                    assert_eq!(items, expected, "{case}");
                }
            }
        }
    }

    #[test]
    fn a_split_that_is_less_is_cheaper_or_comes_first() {
        let in_order = [(0, 31, 1.0), (0, 30, 1.0), (1, 9, 1.0), (0, 1, 1.5), (2, 1, f32::MAX)];
        let splits = in_order.map(|(axis, bin, cost)| Split::new(axis, bin, cost));
        assert!(splits.is_sorted_by(|a, b| a < b) && splits[4] < Split::NONE);
        for (split, (axis, bin, _)) in splits.iter().zip(in_order) {
            assert_eq!((split.axis(), split.bin()), (axis, bin));
        }
        for cost in [f32::INFINITY, f32::NAN, -f32::NAN] {
            assert!(Split::new(0, 31, cost) > Split::NONE);
        }
    }
}
