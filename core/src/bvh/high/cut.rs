//! Cuts a range of triangles in two where the SAH cost is least (Wald 2007).
//!
//! ```text
//! for each triangle:  bin of its centre on each axis; grow the bins' boxes, count
//! for each axis:      sweep from both ends; cost of a cut = area * count, summed over both sides
//! for each triangle:  swap it to the first part, or leave it; grow the box of its part's centres
//! ```
//!
//! A box is one vector: least x, y, z and minus greatest x, y, z. So the union of two boxes is one minimum,
//! and the vector minus itself with its halves swapped is twice the centre.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8, mask32x8, u32x8};

use crate::bvh::node::Sides;
use crate::cell::WHOLE_SHIFT;
use crate::extremes::Extremes;
use crate::invariant::OrBug;
use crate::simd::{HAS_VECTORS, inline_unless_small};

/// A triangle during a build, as bits: the least corner of its box, its id, the negated greatest corner, 0.
pub(super) type TriangleItem = [u32; 8];

/// Index of the id in an item.
pub(super) const ID: usize = 3;

/// The box of nothing.
pub(super) const NOTHING: Sides = [f32::INFINITY; 8];

/// The boxes of some triangles, and of twice their centres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    pub(super) bounds: Sides,
    pub(super) centers: Sides,
}

impl Extent {
    pub(super) const NOTHING: Self = Self { bounds: NOTHING, centers: NOTHING };

    inline_unless_small! {
        /// The extent of some triangles.
        pub(super) fn of<S: Simd>(simd: S, items: &[TriangleItem]) -> Self {
            let mut bounds = f32x8::splat(simd, f32::INFINITY);
            let mut centers = bounds;
            for item in items {
                let sides = load(simd, item);
                bounds = bounds.lesser(sides);
                centers = centers.lesser(center(sides));
            }
            Self { bounds: bounds.into(), centers: centers.into() }
        }
    }
}

/// Bins of an axis, at most.
const MOST_BINS: usize = 32;

/// The bins of a range on each axis.
#[repr(C, align(32))]
pub(super) struct Bins {
    /// Keeps the boxes off multiples of 16 bytes, where items lie: some processors (Zen 4) let the load of an item
    /// wait for a store to a box if their addresses differ by a multiple of 4096.
    _off: [u32; 2],
    boxes: [[Sides; MOST_BINS]; 3],
    counts: [[u32; MOST_BINS]; 3],
}

/// An item in a vector.
#[inline(always)]
fn wide<S: Simd>(simd: S, item: &TriangleItem) -> u32x8<S> {
    u32x8::simd_from(simd, *item)
}

/// The box of an item without its id, which may be a denormal number: these are slow.
#[inline(always)]
fn sides_of<S: Simd>(simd: S, item: u32x8<S>) -> f32x8<S> {
    let word = u32::MAX;
    let mask = u32x8::simd_from(simd, [word, word, word, 0, word, word, word, 0]);
    (item & mask).bitcast()
}

/// The box of an item.
#[inline(always)]
fn load<S: Simd>(simd: S, item: &TriangleItem) -> f32x8<S> {
    sides_of(simd, wide(simd, item))
}

/// Twice the centre of a box, and minus that.
#[inline(always)]
fn center<S: Simd>(sides: f32x8<S>) -> f32x8<S> {
    let (low, high) = sides.split();
    sides - high.combine(low)
}

/// Half the surface of a box whose lengths are multiplied by `scale`.
#[inline(always)]
pub(super) fn area<S: Simd>(simd: S, sides: f32x8<S>, scale: f32) -> f32 {
    let (low, high) = sides.split();
    let size: [f32; 4] = ((low + high) * f32x4::splat(simd, scale)).into();
    size[0] * size[1] + size[1] * size[2] + size[2] * size[0]
}

/// The cost of so many triangles.
#[inline(always)]
#[expect(clippy::cast_precision_loss, reason = "a cost")]
const fn as_cost(count: u32) -> f32 {
    count as f32
}

/// The map from centres to bins.
struct BinScale {
    /// The least corner of the box of twice the centres.
    low: [f32; 3],
    /// Bins for each unit of length; `f32::MAX` where all centres have the same coordinate.
    scale: [f32; 3],
    /// Bins of each axis.
    count: usize,
}

impl BinScale {
    #[inline(always)]
    fn new(items: usize, centers: &Sides) -> Self {
        let count = bin_count(items);
        let [x, y, z, _, nx, ny, nz, _] = *centers;
        // Keep every place below the number of bins, in spite of rounding.
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let bins = count as f32 * 0.999;
        let extents = [0.0 - (x + nx), 0.0 - (y + ny), 0.0 - (z + nz)];
        let [a, b, c] = extents.map(|extent| bins / extent);
        let scale = [a.min(f32::MAX), b.min(f32::MAX), c.min(f32::MAX)];
        Self { low: [x, y, z], scale, count }
    }

    /// The bins of an item on each axis.
    #[inline(always)]
    fn bins_of<S: Simd>(&self, simd: S, sides: f32x8<S>) -> [usize; 3] {
        let ([x, y, z], [a, b, c]) = (self.low, self.scale);
        let (min, max) = sides.split();
        let low = f32x4::simd_from(simd, [x, y, z, 0.0]);
        let scale = f32x4::simd_from(simd, [a, b, c, 0.0]);
        let places = ((min - max) - low) * scale - f32x4::splat(simd, 0.5);
        let [x, y, z, _]: [f32; 4] = (places + f32x4::splat(simd, WHOLE_SHIFT)).into();
        [bin(x), bin(y), bin(z)]
    }

    /// The bin of an item on one axis.
    #[inline(always)]
    fn bin_of(&self, item: &TriangleItem, axis: usize) -> usize {
        let twice = f32::from_bits(item[axis % 3]) - f32::from_bits(item[4 + axis % 3]);
        let place = (twice - self.low[axis % 3]) * self.scale[axis % 3] - 0.5;
        bin(place + WHOLE_SHIFT)
    }
}

/// The bin of a place to which [`WHOLE_SHIFT`] was added.
#[inline(always)]
const fn bin(place: f32) -> usize {
    place.to_bits() as usize % MOST_BINS
}

/// A split of a range: the bins of an axis from one on are the second part.
///
/// The upper half is the cost as bits, and below are the axis and how much the bin lacks to 255. So the least of all is
/// that of least cost, of equal ones that of the first axis, then of the last bin; and there is no branch to predict.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Split(u64);

impl Split {
    /// Greater than all of finite cost, and less than those whose cost is NaN.
    const NONE: Self = Self((f32::INFINITY.to_bits() as u64) << 32);

    /// `cost` is not negative, or NaN.
    #[inline(always)]
    fn new(axis: usize, bin: usize, cost: f32) -> Self {
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
    pub(super) const fn new() -> Self {
        Self { _off: [0; 2], boxes: [[NOTHING; MOST_BINS]; 3], counts: [[0; MOST_BINS]; 3] }
    }

    /// Cuts some items in two and returns how many are in the first part, and the extents of both; `None` if no bins
    /// tell them apart. Lengths are multiplied by `scale` before areas are computed.
    #[inline(always)]
    pub(super) fn cut<S: Simd>(
        &mut self,
        simd: S,
        items: &mut [TriangleItem],
        centers: &Sides,
        scale: f32,
    ) -> Option<(usize, [Extent; 2])> {
        let rule = BinScale::new(items.len(), centers);
        self.fill(simd, items, &rule);
        let place = self.best(simd, &rule, scale)?;
        let mut bounds = [f32x8::splat(simd, f32::INFINITY); 2];
        for (at, bin) in self.boxes[place.axis()].iter().enumerate().take(rule.count) {
            grow(simd, &mut bounds, at < place.bin(), f32x8::simd_from(simd, *bin));
        }
        let (middle, [first, second]) = partition(simd, items, &rule, &place);
        let [a, b] = bounds;
        let extents = [
            Extent { bounds: a.into(), centers: first.into() },
            Extent { bounds: b.into(), centers: second.into() },
        ];
        (middle > 0 && middle < items.len()).then_some((middle, extents))
    }

    /// Grows the boxes of the bins, and counts.
    #[inline(always)]
    fn fill<S: Simd>(&mut self, simd: S, items: &[TriangleItem], rule: &BinScale) {
        for (boxes, counts) in self.boxes.iter_mut().zip(&mut self.counts) {
            for (bin, counted) in boxes.iter_mut().zip(counts).take(rule.count) {
                (*bin, *counted) = (NOTHING, 0);
            }
        }
        for item in items {
            let sides = load(simd, item);
            let [x, y, z] = rule.bins_of(simd, sides);
            for (axis, at) in [(0, x), (1, y), (2, z)] {
                let bin = &mut self.boxes[axis][at % MOST_BINS];
                *bin = f32x8::simd_from(simd, *bin).lesser(sides).into();
                self.counts[axis][at % MOST_BINS] += 1;
            }
        }
    }

    /// Sweeps over each axis from both ends, for the cut of least cost.
    #[inline(always)]
    fn best<S: Simd>(&self, simd: S, rule: &BinScale, scale: f32) -> Option<Split> {
        debug_assert!(rule.count <= MOST_BINS, "more bins than there is room for");
        let mut best = Split::NONE;
        for (axis, (boxes, counts)) in self.boxes.iter().zip(&self.counts).enumerate() {
            if rule.scale[axis % 3] >= f32::MAX {
                continue;
            }
            // Costs of what is before each bin; NaN where nothing is, infinity times zero.
            let mut costs = [f32::NAN; MOST_BINS];
            let (mut all, mut sum) = (f32x8::splat(simd, f32::INFINITY), 0);
            let bins = boxes.iter().zip(counts).take(rule.count);
            for ((bin, counted), cost) in bins.zip(&mut costs) {
                *cost = area(simd, all, scale) * as_cost(sum);
                all = all.lesser(f32x8::simd_from(simd, *bin));
                sum += counted;
            }
            // Then of what is behind.
            let (mut all, mut sum) = (f32x8::splat(simd, f32::INFINITY), 0);
            for bin in (1..rule.count).rev() {
                let places = (boxes.get(bin), counts.get(bin), costs.get(bin));
                let (Some(bounds), Some(counted), Some(before)) = places else { continue };
                all = all.lesser(f32x8::simd_from(simd, *bounds));
                sum += counted;
                let cost = before + area(simd, all, scale) * as_cost(sum);
                best = best.min(Split::new(axis, bin, cost));
            }
        }
        (best < Split::NONE).then_some(best)
    }
}

/// Brings the items before a cut to the front; returns how many there are, and the boxes of twice the centres.
#[inline(always)]
fn partition<S: Simd>(
    simd: S,
    items: &mut [TriangleItem],
    rule: &BinScale,
    cut: &Split,
) -> (usize, [f32x8<S>; 2]) {
    let nothing = f32x8::splat(simd, f32::INFINITY);
    let (mut centers, mut middle) = ([nothing; 2], 0);
    // The first item behind the first part.
    let mut other = wide(simd, items.first().unwrap_or(&[0; 8]));
    for at in 0..items.len() {
        debug_assert!(middle <= at, "more items in the first part than were looked at");
        let Some(item) = items.get(at) else { break };
        let is_first = rule.bin_of(item, cut.axis()) < cut.bin();
        let item = wide(simd, item);
        let center = center(sides_of(simd, item));
        grow(simd, &mut centers, is_first, center);
        if !HAS_VECTORS {
            if is_first {
                put(items, at, other);
                put(items, middle, item);
                middle += 1;
                other = wide(simd, items.get(middle).unwrap_or(&[0; 8]));
            }
            continue;
        }
        // No branch: the side of an item is unpredictable.
        let mask = mask32x8::splat(simd, is_first);
        put(items, at, mask.select(other, item));
        put(items, middle, mask.select(item, other));
        // Keep `other` in a register. Loaded again from the place where it was just stored, it would make each item
        // wait for the one before.
        let next = wide(simd, items.get(middle + 1).unwrap_or(&[0; 8]));
        other = mask.select(next, other);
        middle += usize::from(is_first);
    }
    (middle, centers)
}

/// Grows the first or the second of two boxes. With vectors both stay in registers.
#[inline(always)]
fn grow<S: Simd>(simd: S, boxes: &mut [f32x8<S>; 2], is_first: bool, by: f32x8<S>) {
    if !HAS_VECTORS {
        let side = &mut boxes[usize::from(!is_first)];
        *side = side.lesser(by);
        return;
    }
    let (mask, nothing) = (mask32x8::splat(simd, is_first), f32x8::splat(simd, f32::INFINITY));
    boxes[0] = boxes[0].lesser(mask.select(by, nothing));
    boxes[1] = boxes[1].lesser(mask.select(nothing, by));
}

/// Stores an item.
#[inline(always)]
fn put<S: Simd>(items: &mut [TriangleItem], at: usize, item: u32x8<S>) {
    if let Some(slot) = items.get_mut(at).or_bug("a place behind the items") {
        *slot = item.into();
    }
}

/// Bins of each axis for so many items.
const fn bin_count(items: usize) -> usize {
    match items {
        0..=32 => 8,
        33..=256 => 16,
        _ => MOST_BINS,
    }
}
