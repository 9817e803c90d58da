//! Keys of triangles: the Morton code of the cell in which the centre of the box lies.
//!
//! A cube around the box of the mesh, or around centres of a divided bin ([`crowd_key`](super::crowd_key)), is cut into
//! 1024 cells an axis, or 512 ([`halved`](Keys::halved)); the bits of each axis are interleaved, x highest. Sorted by
//! key, triangles are in the order of a grid of grids of grids: cells that share their first `3 k` bits share a cell of
//! the grid of `2^k` cells an axis.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, mask32x8, u32x8};
use glam::Vec3A;

use crate::aabb::Aabb;
use crate::cell::WHOLE_SHIFT;
use crate::extremes::Extremes;
use crate::simd::inline_unless_small;

/// Bits of a key in a grid of 1024 cells an axis.
pub(crate) const KEY_BITS: u32 = 30;

/// In place of a key, for a triangle with a corner that is not finite.
pub(crate) const NO_KEY: u32 = u32::MAX;

/// The map from boxes to keys.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Keys {
    /// The least corner of the cube, doubled as centres are.
    origin: Vec3A,
    /// Cells per unit, halved because centres are doubled.
    scale: f32,
    /// The largest position on an axis, half a cell into the last cell.
    end: f32,
}

/// Cells on an axis, unless halved.
const CELLS: f32 = 1024.0;
const CELL_BITS: u32 = 0x3ff;

impl Keys {
    /// Keys for boxes whose centres lie in `centers`. If that is a single point or empty, all boxes get the same key.
    pub(crate) fn new(centers: &Aabb) -> Self {
        let extent = centers.size().max_element();
        // Keep it finite: zero times infinity is a NaN.
        let scale = (0.5 * CELLS / extent).min(MOST_SCALE);
        let is_box = extent >= 0.0;
        let origin = if is_box { centers.min + centers.min } else { Vec3A::ZERO };
        Self { origin, scale: if is_box { scale } else { 0.0 }, end: CELLS - 0.5 }
    }

    /// The key of a box.
    #[inline(always)]
    pub(crate) fn of(&self, bounds: &Aabb) -> u32 {
        self.of_twice(bounds.min + bounds.max)
    }

    inline_unless_small! {
        /// The key of a box, given min + max.
        pub(crate) fn of_twice(&self, twice: Vec3A) -> u32 {
            interleave(self.position(twice).max(Vec3A::ZERO).min(Vec3A::splat(self.end)))
        }
    }

    /// The keys in a grid of half as many cells an axis, each twice as wide.
    pub(crate) fn halved(self) -> Self {
        Self { scale: 0.5 * self.scale, end: 0.5 * CELLS - 0.5, ..self }
    }

    /// The cells between the origin and a centre on each axis, given min + max of the box.
    #[inline(always)]
    fn position(&self, twice: Vec3A) -> Vec3A {
        (twice - self.origin) * self.scale
    }

    /// Returns true if a centre lies in the grid, but not in the outer half of a last cell, given min + max of the box.
    pub(crate) fn contain(&self, twice: Vec3A) -> bool {
        let position = self.position(twice);
        (position.cmpge(Vec3A::ZERO) & position.cmple(Vec3A::splat(self.end))).all()
    }

    /// Finds which of eight centres lie in the grid, as [`contain`](Self::contain).
    #[inline(always)]
    pub(crate) fn contain_eight<S: Simd>(&self, simd: S, twice: [f32x8<S>; 3]) -> mask32x8<S> {
        let (zero, end) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, self.end));
        let x = self.positions(simd, 0, twice[0]);
        let y = self.positions(simd, 1, twice[1]);
        let z = self.positions(simd, 2, twice[2]);
        let not_before = x.simd_ge(zero) & y.simd_ge(zero) & z.simd_ge(zero);
        not_before & x.simd_le(end) & y.simd_le(end) & z.simd_le(end)
    }

    /// Twice the centres at both ends of the grid's diagonal, and those next to them.
    #[cfg(test)]
    pub(crate) fn ends(&self) -> [Vec3A; 16] {
        let last = self.origin + self.end / self.scale;
        core::array::from_fn(|i| {
            let end = if i % 2 == 0 { self.origin } else { last };
            let step: fn(f32) -> f32 = [f32::next_down, |x| x, f32::next_up][i / 2 % 3];
            Vec3A::from_array(end.to_array().map(step))
        })
    }

    #[inline(always)]
    fn positions<S: Simd>(&self, simd: S, axis: usize, twice: f32x8<S>) -> f32x8<S> {
        let origin = f32x8::splat(simd, self.origin[axis]);
        (twice - origin) * f32x8::splat(simd, self.scale)
    }

    /// The keys of eight centres: of each the same as [`of_twice`](Self::of_twice).
    #[inline(always)]
    pub(crate) fn of_eight<S: Simd>(&self, simd: S, twice: [f32x8<S>; 3]) -> u32x8<S> {
        let x = self.axis(simd, 0, twice[0]);
        let y = self.axis(simd, 1, twice[1]);
        let z = self.axis(simd, 2, twice[2]);
        (x << 2) | (y << 1) | z
    }

    #[inline(always)]
    fn axis<S: Simd>(&self, simd: S, axis: usize, twice: f32x8<S>) -> u32x8<S> {
        let position = self.positions(simd, axis, twice);
        spread_eight(position.greater(f32x8::splat(simd, 0.0)).lesser(f32x8::splat(simd, self.end)))
    }
}

/// The Morton code of a position in cells.
#[inline(always)]
fn interleave(position: Vec3A) -> u32 {
    let [x, y, z] = ((position - Vec3A::splat(0.5)) + Vec3A::splat(WHOLE_SHIFT))
        .to_array()
        .map(|cell| spread(cell.to_bits() & CELL_BITS));
    x << 2 | y << 1 | z
}

/// The largest scale for which a coordinate's cell is finite in the box. The positions of centres outside may be
/// infinite.
const MOST_SCALE: f32 = 1e38;

/// The cells of eight positions, each as ten bits with two zeros before each.
#[inline(always)]
fn spread_eight<S: Simd>(position: f32x8<S>) -> u32x8<S> {
    let mut bits = ((position - 0.5) + WHOLE_SHIFT).bitcast::<u32x8<S>>() & CELL_BITS;
    bits = (bits | bits << 16) & 0x0300_00ff;
    bits = (bits | bits << 8) & 0x0300_f00f;
    bits = (bits | bits << 4) & 0x030c_30c3;
    (bits | bits << 2) & 0x0924_9249
}

/// Ten bits with two zeros before each.
#[inline(always)]
const fn spread(cell: u32) -> u32 {
    let mut bits = cell;
    bits = (bits | bits << 16) & 0x0300_00ff;
    bits = (bits | bits << 8) & 0x0300_f00f;
    bits = (bits | bits << 4) & 0x030c_30c3;
    (bits | bits << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::random;
    use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};

    struct Eight<'k> {
        keys: &'k Keys,
        boxes: [Aabb; 8],
    }

    impl Kernel for Eight<'_> {
        type Output = [u32; 8];

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [u32; 8] {
            let lanes = |side: fn(&Aabb) -> Vec3A| {
                [0, 1, 2].map(|axis| f32x8::simd_from(simd, self.boxes.map(|b| side(&b)[axis])))
            };
            let (min, max) = (lanes(|b| b.min), lanes(|b| b.max));
            self.keys.of_eight(simd, [min[0] + max[0], min[1] + max[1], min[2] + max[2]]).into()
        }
    }

    #[test]
    fn every_kind_of_vectors_gives_the_same_keys() {
        let mut state = 1;
        for scale in [1.0, 1e-38, 1e-30, 1e10, 1e36] {
            for flat in [Vec3A::ONE, Vec3A::new(1.0, 0.0, 1.0), Vec3A::ZERO] {
                let centers = Aabb { min: -flat * scale, max: flat * scale };
                let keys = Keys::new(&centers);
                for _ in 0..if cfg!(miri) { 2 } else { 200 } {
                    // Some centres lie outside of the box, as those of triangles do that the build leaves out.
                    let boxes = [0; 8].map(|_| {
                        let (center, half) =
                            (random::point(&mut state) * 1.2, random::point(&mut state).abs());
                        let (center, half) = (center * flat * scale, half * scale * 0.1);
                        Aabb { min: center - half, max: center + half }
                    });
                    let expected = boxes.map(|bounds| keys.of(&bounds));
                    assert!(expected.iter().all(|&key| key < 1 << KEY_BITS));
                    for level in SimdLevel::available() {
                        // Machines without vectors never run this kernel.
                        if !HAS_VECTORS {
                            break;
                        }
                        let keys = dispatch(level, Eight { keys: &keys, boxes });
                        assert_eq!(keys, expected, "{level:?} {scale}");
                    }
                }
            }
        }
    }

    #[test]
    fn keys_are_in_the_order_of_cells() {
        let centers = Aabb { min: Vec3A::ZERO, max: Vec3A::splat(1024.0) };
        let keys = Keys::new(&centers);
        let key = |x: f32, y: f32, z: f32| {
            let point = Vec3A::new(x, y, z);
            keys.of(&Aabb { min: point, max: point })
        };
        assert_eq!(key(0.0, 0.0, 0.0), 0);
        assert_eq!([key(0.0, 0.0, 1.5), key(0.0, 1.5, 0.0), key(1.5, 0.0, 0.0)], [1, 2, 4]);
        assert_eq!(key(1024.0, 1024.0, 1024.0), (1 << KEY_BITS) - 1);
        let diagonal: Vec<u32> =
            (0_u8..100).map(|i| key(f32::from(i) * 10.0 + 0.5, 0.5, 0.5)).collect();
        assert!(diagonal.is_sorted_by(|a, b| a < b));
    }

    #[test]
    fn a_point_and_nothing_have_keys() {
        let point = Aabb { min: Vec3A::splat(7.0), max: Vec3A::splat(7.0) };
        assert_eq!(Keys::new(&point).of(&point), 0);
        assert!(Keys::new(&Aabb::EMPTY).of(&point) < 1 << KEY_BITS);
    }
}
