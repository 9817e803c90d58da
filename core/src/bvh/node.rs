//! One node: the boxes of up to eight children in 80 bytes.
//!
//! ```text
//! origin 3 x f32 | word: exponents 3 x u8, inner u8 | child u32 | first u32 | counts 8 x u8 | bounds 6 x 8 x u8
//!
//! side of a box  = origin + bound * 2^(exponent - 127), on each axis
//! child s is       an inner node   if bit s of inner is set: nodes[child + set bits below s]
//!                  a leaf          if counts[s] > 0: ids[first + counts of the leaves before s ..]
//!                  not there       otherwise; its low sides lie above its high ones, so that single rays hardly ever
//!                                  meet it; a ray from far away may, as its margin is large, and finds a leaf without
//!                                  ids
//! ```
//!
//! A build makes the quantised box a sixty-fourth of a step larger than the exact one on each side. Rounding takes a
//! part of that; `validate` demands a 128th. This margin absorbs the rounding of `bound * step + (origin - ray origin)`
//! where the ray starts near the node: there the terms are below 2^9 steps, so three roundings are below 2^-13 steps.
//! Where the ray starts far away, the error is relative, and the far side of a slab test has a margin for it
//! ([`slab`](super::slab)).

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8, i32x8, u8x16, u16x8, u32x4, u32x8};
use glam::Vec3A;
use zerocopy::{FromBytes, Immutable, IntoBytes, transmute};

use crate::aabb::Aabb;
use crate::cell::WHOLE_SHIFT;
use crate::extremes::Extremes;

/// Children of a node.
pub(crate) const WIDTH: usize = 8;

/// Ids in a leaf, at most: one vector of triangles.
pub(crate) const LEAF: usize = 8;

/// Triangles that are read into one set of vectors: a leaf of fewer takes as long, one of more takes two sets. A part
/// of so many or fewer is small, and hardly ever split.
pub(crate) const SMALL_LEAF: usize = 4;

/// A box in one vector: least x, y, z, nothing, minus greatest x, y, z, nothing. So the union of two is one minimum.
pub(crate) type Sides = [f32; 8];

/// A box as two corners.
pub(crate) fn corners(sides: &Sides) -> Aabb {
    let [x, y, z, _, nx, ny, nz, _] = *sides;
    Aabb { min: Vec3A::new(x, y, z), max: Vec3A::new(-nx, -ny, -nz) }
}

/// Up to eight children and their boxes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromBytes, Immutable, IntoBytes)]
pub(crate) struct Node {
    /// The bits of three f32: the position of bound 0.
    pub(crate) origin: [u32; 3],
    /// From low to high byte: the step of each axis, a power of two, as the exponent bits of an f32; and
    /// the mask of inner children: bit `s` says that child `s` is a node.
    pub(crate) word: u32,
    /// The first child node; the others follow it.
    pub(crate) child: u32,
    /// Place of the first id of the first leaf; those of the others follow. In a node with [fine sides](super::fine):
    /// which of them are its own.
    pub(crate) first: u32,
    /// Number of ids of each leaf.
    pub(crate) counts: [u8; WIDTH],
    /// Least x, y, z, then greatest x, y, z of each child, in steps from the origin.
    pub(crate) bounds: [[u8; WIDTH]; 6],
}

const _: () = assert!(size_of::<Node>() == 80 && align_of::<Node>() == 4);

/// A child of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Child {
    /// The node with this number.
    Inner(u32),
    /// The ids from `first` on, `count` of them.
    Leaf { first: u32, count: u32 },
}

impl Child {
    /// No child.
    pub(crate) const NONE: Self = Self::Leaf { first: 0, count: 0 };
}

impl Node {
    /// A node without children.
    pub(crate) const EMPTY: Self = Self {
        origin: [0; 3],
        word: 0x0001_0101,
        child: 0,
        first: 0,
        counts: [0; WIDTH],
        bounds: [[0xff; WIDTH], [0xff; WIDTH], [0xff; WIDTH], [0; WIDTH], [0; WIDTH], [0; WIDTH]],
    };

    /// A node that waits for its children: the range that it will hold, and the levels above it.
    pub(crate) fn unbuilt(start: u32, end: u32, level: u32) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "below 64")]
        let counts = [level as u8, 0, 0, 0, 0, 0, 0, 0];
        Self { word: WAITING, child: start, first: end, counts, ..Self::EMPTY }
    }

    /// Returns the range of a node that waits, and the levels above it.
    pub(crate) fn waiter(&self) -> Option<[u32; 3]> {
        (self.word == WAITING).then_some([self.child, self.first, self.counts[0].into()])
    }

    /// Returns the position of bound 0.
    #[inline(always)]
    pub(crate) const fn origin(&self) -> [f32; 3] {
        let [x, y, z] = self.origin;
        [f32::from_bits(x), f32::from_bits(y), f32::from_bits(z)]
    }

    /// The step of each axis as exponent bits.
    #[inline(always)]
    pub(crate) const fn exponents(&self) -> [u8; 3] {
        let [x, y, z, _] = self.word.to_le_bytes();
        [x, y, z]
    }

    /// The size of a step on each axis.
    #[inline(always)]
    pub(crate) const fn steps(&self) -> [f32; 3] {
        let [x, y, z] = self.exponents();
        [step(x), step(y), step(z)]
    }

    /// The size of a step on each axis, in all lanes.
    #[inline(always)]
    pub(crate) fn wide_steps<S: Simd>(&self, simd: S) -> [f32x8<S>; 3] {
        // The exponents of x, y and z stand in the three low bytes.
        let word = u32x8::splat(simd, self.word);
        let exponents = [word << 23, word << 15, word << 7];
        let step = |axis: usize| (exponents[axis] & 0x7f80_0000).bitcast();
        [step(0), step(1), step(2)]
    }

    /// The children that are nodes, as bits.
    #[inline(always)]
    pub(crate) const fn inner(&self) -> u32 {
        self.word >> 24
    }

    /// The mask of inner children, and the first child node, in one load. With a load of the word alone, the compiler
    /// would share it with [`wide_steps`](Self::wide_steps) and move it from a scalar register to a vector.
    #[inline(always)]
    fn inner_and_child(&self) -> (u32, u32) {
        let pair = self.as_bytes().get(12..20).and_then(|bytes| bytes.first_chunk()).copied();
        let pair: [u32; 2] = transmute!(u64::from_ne_bytes(pair.unwrap_or_default()));
        (pair[0] >> 24, pair[1])
    }

    /// The children that exist, as bits.
    #[inline(always)]
    pub(crate) const fn used(&self) -> u32 {
        let counts = u64::from_le_bytes(self.counts);
        // Set the high bit of each byte that is not zero, then gather the high bits.
        let high = ((counts & 0x7f7f_7f7f_7f7f_7f7f) + 0x7f7f_7f7f_7f7f_7f7f) | counts;
        let bits = (high >> 7 & 0x0101_0101_0101_0101).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        self.inner() | bits as u32
    }

    /// Makes child `slot` a node.
    pub(crate) const fn set_inner(&mut self, slot: usize) {
        self.word |= 1 << (24 + slot % WIDTH);
    }

    /// Returns child `slot`. A slot that is not used is a leaf of no ids.
    #[inline(always)]
    pub(crate) fn child(&self, slot: u32) -> Child {
        let below = (1_u32 << (slot % 8)) - 1;
        let (inner, child) = self.inner_and_child();
        if inner >> (slot % 8) & 1 == 1 {
            return Child::Inner(child.wrapping_add((inner & below).count_ones()));
        }
        // Byte s of the product is the sum of the counts before s.
        let counts = u64::from_le_bytes(self.counts);
        let before = (counts << 8).wrapping_mul(0x0101_0101_0101_0101);
        let shift = 8 * (slot % 8);
        let first = self.first.wrapping_add((before >> shift & 0xff) as u32);
        Child::Leaf { first, count: (counts >> shift & 0xff) as u32 }
    }

    /// Writes the boxes of the children that exist; `bounds` holds them all, and `least` is
    /// [`least_node`] of the tree.
    pub(crate) fn set_boxes(&mut self, bounds: &Aabb, boxes: &[Aabb; WIDTH], least: f32) {
        self.frame(bounds, least);
        for (slot, child) in boxes.iter().enumerate() {
            if self.inner() >> slot & 1 == 1 || self.counts[slot] > 0 {
                self.set_box(slot, child);
            }
        }
    }

    /// Writes the same bits as [`set_boxes`](Self::set_boxes), all sides of a child at once. `used` has a bit for
    /// each child that exists.
    #[inline(always)]
    pub(crate) fn set_sides<S: Simd>(
        &mut self,
        simd: S,
        bounds: f32x8<S>,
        children: &[f32x8<S>; WIDTH],
        used: u32,
        least: f32,
    ) {
        // The frame of three axes at once.
        let (low, high) = bounds.split();
        let magnitude = low.abs().greater(high.abs());
        let extent = (f32x4::splat(simd, 0.0) - (low + high))
            .greater(magnitude * LEAST_STEPS)
            .greater(f32x4::splat(simd, least));
        let bits = (extent * f32x4::splat(simd, 1.0 / 254.0)).bitcast::<u32x4<S>>();
        let exponent = ((bits >> 23) & 0xff) + 1;
        let exponent = exponent.max(u32x4::splat(simd, 1)).min(u32x4::splat(simd, 253));
        let step = (exponent << 23).bitcast::<f32x4<S>>();
        let inverse = ((u32x4::splat(simd, 254) - exponent) << 23).bitcast::<f32x4<S>>();
        let origin = low - step * 0.25;
        let [x, y, z, _]: [u32; 4] = origin.bitcast::<u32x4<S>>().into();
        self.origin = [x, y, z];
        let [x, y, z, _]: [u32; 4] = exponent.into();
        self.word = self.word & 0xff00_0000 | x | y << 8 | z << 16;

        // Quantise: the high sides are those of the mirrored box, so their signs change at the end.
        let origin = origin.combine(f32x4::splat(simd, 0.0) - origin);
        let inverse = inverse.combine(inverse);
        let end = f32x4::splat(simd, 0.0).combine(f32x4::splat(simd, -255.0));
        let sign = f32x4::splat(simd, 1.0).combine(f32x4::splat(simd, -1.0));
        let unused = u32x4::splat(simd, 0xff).combine(u32x4::splat(simd, 0));
        let rule = Quantiser { origin, inverse, end, sign, unused };
        let first: [u32; 8] = rule.four(children, 0, used).into();
        let second: [u32; 8] = rule.four(children, 4, used).into();
        for (row, lane) in self.bounds.iter_mut().zip([0, 1, 2, 4, 5, 6]) {
            *row = (u64::from(first[lane]) | u64::from(second[lane]) << 32).to_le_bytes();
        }
    }

    /// Sets origin and steps so that bounds can hold a box, enlarged to `least` on axes where it is smaller.
    fn frame(&mut self, bounds: &Aabb, least: f32) {
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let mut exponents = [0; 4];
        for axis in 0..3 {
            // A quarter of a step must be no less than the rounding of coordinates.
            let magnitude = min[axis].abs().max(max[axis].abs());
            let extent = (max[axis] - min[axis]).max(magnitude * LEAST_STEPS).max(least);
            let exponent = exponent_for(extent);
            exponents[axis] = exponent;
            self.origin[axis] = (min[axis] - 0.25 * step(exponent)).to_bits();
        }
        self.word = self.word & 0xff00_0000 | u32::from_le_bytes(exponents);
    }

    /// Writes the box of child `slot`, which lies in the box that the frame was set for.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the low byte")]
    fn set_box(&mut self, slot: usize, bounds: &Aabb) {
        let inverse = Vec3A::from_array(self.exponents().map(inverse_step));
        let origin = Vec3A::from_array(self.origin());
        // Move by half a step and the margin, then round to nearest: this rounds outwards by at least the margin.
        let low = (bounds.min - origin) * inverse - Vec3A::splat(0.5 + MARGIN);
        let high = (bounds.max - origin) * inverse + Vec3A::splat(0.5 + MARGIN);
        let [low, high] = [low.max(Vec3A::ZERO), high.min(Vec3A::splat(255.0))];
        let [low, high] = [low, high].map(|at| (at + Vec3A::splat(WHOLE_SHIFT)).to_array());
        for axis in 0..3 {
            let [low, high] = [low[axis], high[axis]].map(|at| at.to_bits() as u8);
            if let Some(bound) = self.bounds[axis].get_mut(slot) {
                *bound = low;
            }
            if let Some(bound) = self.bounds[axis + 3].get_mut(slot) {
                *bound = high;
            }
        }
    }
}

/// The `word` of a node that waits for its children; no other node has it, as their exponents are not 0.
const WAITING: u32 = 0;

/// The map from the sides of a box to bytes: the three low ones, then the three high ones, mirrored.
struct Quantiser<S: Simd> {
    origin: f32x8<S>,
    inverse: f32x8<S>,
    end: f32x8<S>,
    sign: f32x8<S>,
    /// The sides of a child that does not exist.
    unused: u32x8<S>,
}

// Functions, not closures: a closure gets the instructions of its caller only where it is inlined.
impl<S: Simd> Quantiser<S> {
    /// The sides of four children, lane by lane the bytes of one word.
    #[inline(always)]
    fn four(&self, children: &[f32x8<S>; WIDTH], first: usize, used: u32) -> u32x8<S> {
        let a = self.one(children, first, used);
        let b = self.one(children, first + 1, used);
        let c = self.one(children, first + 2, used);
        let d = self.one(children, first + 3, used);
        (a | b << 8) | (c | d << 8) << 16
    }

    #[inline(always)]
    fn one(&self, children: &[f32x8<S>; WIDTH], slot: usize, used: u32) -> u32x8<S> {
        let at = (children[slot % WIDTH] - self.origin) * self.inverse - (0.5 + MARGIN);
        let bits = (at.greater(self.end) * self.sign + WHOLE_SHIFT).bitcast::<u32x8<S>>() & 0xff;
        if used >> slot & 1 == 1 { bits } else { self.unused }
    }
}

/// The least margin of a quantised box around the exact one, in steps.
const MARGIN: f32 = 1.0 / 64.0;
/// A box is at least this part of its coordinates wide, so that a quarter of a step is no less than their rounding.
const LEAST_STEPS: f32 = 254.0 / 2_097_152.0;

/// The least extent of a node in parts of the tree's: 254 steps of 2^-60.
const LEAST_NODE: f32 = 254.0 / (1_048_576.0 * 1_048_576.0 * 1_048_576.0); // 254 * 2^-60

/// The least extent that a node is quantised for, where it is called `least`: smaller boxes count as this large. So no
/// step is below 2^-60 of the tree's extent, and a finite number can stand for the inverse of a zero direction
/// ([`slab`](super::slab)).
pub(crate) fn least_node(bounds: &Aabb) -> f32 {
    bounds.size().max_element() * LEAST_NODE
}

/// Twice eight bytes as floats, such as two rows of sides.
#[inline(always)]
pub(crate) fn floats<S: Simd>(simd: S, low: [u8; 8], high: [u8; 8]) -> (f32x8<S>, f32x8<S>) {
    let both: [u8; 16] = transmute!([low, high]);
    let (low, high) = u8x16::simd_from(simd, both).widen();
    (eight_floats(low), eight_floats(high))
}

#[inline(always)]
fn eight_floats<S: Simd>(half: u16x8<S>) -> f32x8<S> {
    let (low, high) = half.widen();
    // Signed: one instruction, where the unsigned conversion is several.
    low.combine(high).bitcast::<i32x8<S>>().to_float()
}

/// Returns the exponent bits of a power of two: the next one above a 254th of an extent.
fn exponent_for(extent: f32) -> u8 {
    let least = extent * (1.0 / 254.0);
    let exponent = (least.to_bits() >> 23) & 0xff;
    // Take the next power of two, also if `least` is one itself.
    (exponent + 1).clamp(1, 253) as u8
}

/// A power of two from its exponent bits.
#[inline(always)]
const fn step(exponent: u8) -> f32 {
    f32::from_bits((exponent as u32) << 23)
}

/// One over a power of two from its exponent bits, which are at most 253.
#[inline(always)]
const fn inverse_step(exponent: u8) -> f32 {
    f32::from_bits((254_u32.saturating_sub(exponent as u32)) << 23)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::random;
    use crate::simd::{Kernel, SimdLevel, dispatch};

    #[test]
    fn used_children_are_nodes_and_leaves_with_ids() {
        let mut state = 1_u32;
        for _ in 0..if cfg!(miri) { 100 } else { 10_000 } {
            let mut node = Node::EMPTY;
            let mut expected = 0;
            for slot in 0..WIDTH {
                match random::next(&mut state) >> 30 {
                    0 => node.set_inner(slot),
                    1 => node.counts[slot] = (state >> 8 & 0xff) as u8,
                    _ => continue,
                }
                expected |= u32::from(state >> 30 == 0 || node.counts[slot] > 0) << slot;
            }
            assert_eq!(node.used(), expected, "{node:?}");
        }
    }

    /// The quantised box of a child, exactly, and a step.
    fn quantised(node: &Node, slot: usize) -> [DVec3; 3] {
        let vector = |all: [f32; 3]| Vec3A::from_array(all).as_dvec3();
        let (origin, step) = (vector(node.origin()), vector(node.steps()));
        let side = |first: usize| {
            DVec3::from_array([0, 1, 2].map(|axis| f64::from(node.bounds[first + axis][slot])))
        };
        [origin + side(0) * step, origin + side(3) * step, step]
    }

    #[test]
    fn boxes_hold_the_exact_ones_and_a_margin_at_any_scale_and_place() {
        let mut state = 1;
        let cases = if cfg!(miri) { 1 } else { 100 };
        for scale in [1e-38, 1e-30, 1e-10, 1.0, 1e10, 1e30, 1e36] {
            for place in [0.0, 1.0, 100.0, 1e6] {
                // Thin ones, too.
                for flat in [Vec3A::ONE, Vec3A::new(1.0, 1e-6, 1.0), Vec3A::new(0.0, 1.0, 0.0)] {
                    for _ in 0..cases {
                        let place = (random::point(&mut state) * place * scale)
                            .clamp(Vec3A::splat(-1e36), Vec3A::splat(1e36));
                        let boxes = [0; WIDTH].map(|_| {
                            let center = place + random::point(&mut state) * flat * scale * 0.2;
                            let half = random::point(&mut state).abs() * flat * scale * 0.1;
                            Aabb { min: center - half, max: center + half }
                        });
                        let all = boxes.iter().fold(Aabb::EMPTY, |all, child| all.union(child));
                        let least = all.size().max_element() * 1e-10;
                        let mut node = Node { counts: [1; WIDTH], ..Node::EMPTY };
                        node.set_boxes(&all, &boxes, least);
                        for (slot, exact) in boxes.iter().enumerate() {
                            let [min, max, step] = quantised(&node, slot);
                            // Smaller than the margin by the rounding of the build.
                            let margin = step / 128.0;
                            let is_held = (min + margin).cmple(exact.min.as_dvec3()).all()
                                && (max - margin).cmpge(exact.max.as_dvec3()).all();
                            assert!(is_held, "{scale} {exact:?}: {min} {max} {step}");
                            // And not much larger, where coordinates have digits to show it.
                            let slack =
                                (exact.min.as_dvec3() - min).max(max - exact.max.as_dvec3());
                            assert!(
                                slack.cmple(step * 2.0).all(),
                                "{scale} {exact:?}: {min} {max}"
                            );
                        }
                    }
                }
            }
        }
    }

    struct Set<'n> {
        node: &'n mut Node,
        bounds: Aabb,
        boxes: [Aabb; WIDTH],
        count: usize,
        least: f32,
    }

    impl Kernel for Set<'_> {
        type Output = ();

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) {
            let sides = |bounds: &Aabb| {
                let ([x, y, z], [u, v, w]) = (bounds.min.to_array(), (-bounds.max).to_array());
                f32x8::simd_from(simd, [x, y, z, 0.0, u, v, w, 0.0])
            };
            let boxes = self.boxes.map(|bounds| sides(&bounds));
            let used = (1 << self.count) - 1;
            self.node.set_sides(simd, sides(&self.bounds), &boxes, used, self.least);
        }
    }

    #[test]
    fn every_kind_of_vectors_writes_the_same_boxes() {
        let mut state = 7;
        for scale in [1e-38, 1e-30, 1.0, 1e10, 1e36] {
            for count in (1..=WIDTH).step_by(if cfg!(miri) { 7 } else { 1 }) {
                let boxes = [0; WIDTH].map(|_| {
                    let (center, half) =
                        (random::point(&mut state), random::point(&mut state).abs() * 0.1);
                    Aabb { min: (center - half) * scale, max: (center + half) * scale }
                });
                let used = boxes.iter().take(count);
                let bounds = used.fold(Aabb::EMPTY, |all, child| all.union(child));
                let least = bounds.size().max_element() * 1e-10;
                let mut node = Node { child: 5, first: 6, ..Node::EMPTY };
                node.set_inner(0);
                for counted in node.counts.iter_mut().take(count).skip(1) {
                    *counted = 3;
                }
                let mut expected = node;
                expected.set_boxes(&bounds, &boxes, least);
                for level in SimdLevel::available() {
                    let mut node = node;
                    dispatch(level, Set { node: &mut node, bounds, boxes, count, least });
                    assert_eq!(node, expected, "{level:?} {scale} {count}");
                }
            }
        }
    }

    #[test]
    fn children_follow_one_another() {
        let mut node = Node { child: 100, first: 50, ..Node::EMPTY };
        node.counts = [3, 0, 8, 0, 0, 1, 0, 0];
        node.set_inner(1);
        node.set_inner(4);
        let leaf = |first, count| Child::Leaf { first, count };
        assert_eq!(
            [0, 1, 2, 3, 4, 5].map(|slot| node.child(slot)),
            [
                leaf(50, 3),
                Child::Inner(100),
                leaf(53, 8),
                leaf(61, 0),
                Child::Inner(101),
                leaf(61, 1)
            ]
        );
        // Damaged bytes give numbers that wrap around: finding a child must not panic.
        node.counts = [0xff; WIDTH];
        (node.child, node.first) = (u32::MAX, u32::MAX);
        for slot in 0..8 {
            let _ = node.child(slot);
        }
    }
}
