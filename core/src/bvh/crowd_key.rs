//! Keys of a crowded unit.
//!
//! A small object often shares its bin with a few triangles of its surroundings. In a grid over the centres of all, it
//! would lie in a few cells, which would have to be divided again. So a sample tells whether nearly all centres lie in
//! a box of less than a quarter of the length, the *dense box*. If so, there are two grids, each over the cube at the
//! least corner of its box:
//!
//! ```text
//! bit 27 of the key    bits 0 to 26
//! 0                    the cell of the grid over the dense box
//! 1                    the cell of the grid over all centres, for those that the first grid does not contain
//! ```
//!
//! So no bin holds centres of both kinds. Each grid has 512 cells an axis, not 1024: from 8192 entries on, the bits
//! that do not choose a bin are then sorted in two passes, not in four ([`sort`](super::sort)). If nearly all centres
//! do not lie so close together, there is one grid of 1024 cells an axis over all of them.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, u32x8};
use glam::Vec3A;

use super::key::{KEY_BITS, Keys};
use super::layout::{Entry, bin_bits};
use crate::aabb::Aabb;

/// Entries of a crowded unit, and two numbers for each: x and y of its centre, doubled, once they are known. Until an
/// entry has a new key, z stands in its place.
#[derive(Debug)]
pub(crate) struct CrowdPart<'w> {
    pub(crate) entries: &'w mut [Entry],
    pub(crate) xs: &'w mut [u32],
    pub(crate) ys: &'w mut [u32],
}

/// The map from centres in a crowded unit to keys.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CrowdKeys {
    /// The grid over all centres.
    all: Keys,
    /// The grid over the dense box, if there is one.
    dense: Option<Keys>,
}

/// Bits of a cell in one of two grids.
const CELL_BITS: u32 = 27;
/// The bit of the keys of centres outside of the dense box.
const OUTSIDE: u32 = 1 << CELL_BITS;

impl CrowdKeys {
    /// The keys of a unit whose parts hold its centres, doubled, given the box around the centres.
    pub(crate) fn new(parts: &[CrowdPart<'_>], centers: &Aabb) -> Self {
        let (all, dense) = (Keys::new(centers), dense_box(parts));
        if dense.size().max_element() * SMALLER >= centers.size().max_element() {
            return Self { all, dense: None };
        }
        Self { all: all.halved(), dense: Some(Keys::new(&dense).halved()) }
    }

    /// Bits of a key.
    pub(crate) const fn bits(&self) -> u32 {
        if self.dense.is_some() { CELL_BITS + 1 } else { KEY_BITS }
    }

    /// Bits of a key that choose the bin of one of so many entries. One more where half of the bins are for the few
    /// entries outside of the dense box.
    pub(crate) const fn bin_bits(&self, entries: usize) -> u32 {
        bin_bits(entries as u64) + self.dense.is_some() as u32
    }

    /// The bit in which the keys of centres in the dense box differ from the others; 0 if there is no dense box.
    pub(crate) const fn border(&self) -> u32 {
        if self.dense.is_some() { OUTSIDE } else { 0 }
    }

    /// The key of a box, given min + max.
    pub(crate) fn of_twice(&self, twice: Vec3A) -> u32 {
        let (grid, bit) = match &self.dense {
            Some(dense) if dense.contain(twice) => (dense, 0),
            _ => (&self.all, self.border()),
        };
        grid.of_twice(twice) | bit
    }

    /// The keys of eight centres: of each the same as [`of_twice`](Self::of_twice).
    #[inline(always)]
    pub(crate) fn of_eight<S: Simd>(&self, simd: S, twice: [f32x8<S>; 3]) -> u32x8<S> {
        let Some(dense) = &self.dense else { return self.all.of_eight(simd, twice) };
        let outside = self.all.of_eight(simd, twice) | OUTSIDE;
        dense.contain_eight(simd, twice).select(dense.of_eight(simd, twice), outside)
    }
}

/// The dense box is smaller than that of all centres by more than this factor: less than two cells long where a grid
/// has eight cells an axis.
const SMALLER: f32 = 4.0;

/// The number of centres in the sample, about.
const SAMPLE: usize = 128;

/// The growth of the sample's box on each side, in parts of its extent: more than the centres that are not in the
/// sample usually reach beyond it.
const GROWTH: f32 = 0.25;

/// The box around the centres of a sample, without the outermost on each side, grown. The sample depends on the places
/// of the centres in the unit, not on how they are divided into parts, which differs between tasks.
fn dense_box(parts: &[CrowdPart<'_>]) -> Aabb {
    let count: usize = parts.iter().map(|part| part.entries.len()).sum();
    let step = (count / SAMPLE).max(1);
    // The two outermost on each side.
    let (mut low, mut high) = ([Vec3A::INFINITY; 2], [Vec3A::NEG_INFINITY; 2]);
    let mut next = 0;
    for CrowdPart { entries, xs, ys } in parts {
        while let (Some(entry), Some(x), Some(y)) = (entries.get(next), xs.get(next), ys.get(next))
        {
            let center = Vec3A::from_array([*x, *y, entry[0]].map(f32::from_bits)) * 0.5;
            low = [low[0].min(center), low[1].min(low[0].max(center))];
            high = [high[0].max(center), high[1].max(high[0].min(center))];
            next += step;
        }
        next = next.saturating_sub(entries.len());
    }
    let [_, min] = low;
    let [_, max] = high;
    let growth = Vec3A::splat((max - min).max_element() * GROWTH);
    Aabb { min: min - growth, max: max + growth }
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::bvh::layout::CROWD;
    use crate::random;
    use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};
    use crate::tasks::take;

    /// Twice the centres of an object, one unit wide, and of `others` in a scene of a hundred units.
    fn centers(object: usize, others: usize) -> Vec<Vec3A> {
        let mut state = 1;
        let mut all: Vec<_> = (0..object + others).map(|_| random::point(&mut state)).collect();
        all[object..].iter_mut().for_each(|center| *center *= 100.0);
        // They lie among those of the object.
        for other in 0..others {
            all.swap(object + other, other * 41 % (object + others));
        }
        all
    }

    fn box_of(twice: &[Vec3A]) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for &twice in twice {
            bounds.min = bounds.min.min(twice * 0.5);
            bounds.max = bounds.max.max(twice * 0.5);
        }
        bounds
    }

    /// The keys of a unit that lies in three parts of these lengths, and the rest.
    fn keys(twice: &[Vec3A], lengths: [usize; 2]) -> CrowdKeys {
        let column =
            |axis: usize| -> Vec<u32> { twice.iter().map(|t| t[axis].to_bits()).collect() };
        let mut entries: Vec<Entry> = twice.iter().map(|t| [t[2].to_bits(), 0]).collect();
        let (mut xs, mut ys) = (column(0), column(1));
        let mut rest = (&mut entries[..], &mut xs[..], &mut ys[..]);
        let parts = [lengths[0], lengths[1], twice.len()].map(|length| {
            let length = length.min(rest.0.len());
            let [xs, ys] = [take(&mut rest.1, length), take(&mut rest.2, length)];
            CrowdPart { entries: take(&mut rest.0, length), xs, ys }
        });
        CrowdKeys::new(&parts, &box_of(twice))
    }

    #[test]
    fn an_object_among_a_few_others_is_divided_once() {
        let twice = centers(10_000, 50);
        let keys = keys(&twice, [0, 0]);
        let bits = keys.bin_bits(twice.len());
        // As many bins for the object as there would be for all, and as many for the others.
        assert_eq!((bits, keys.border()), (bin_bits(10_050) + 1, OUTSIDE));
        let mut counts = vec![0; 1 << bits];
        for &twice in &twice {
            let key = keys.of_twice(twice);
            counts[(key >> (keys.bits() - bits)) as usize] += 1;
            let is_near = twice.abs().max_element() <= 1.0;
            assert_eq!(key & OUTSIDE == 0, is_near, "{twice}");
        }
        assert!(counts.iter().all(|&count| count <= CROWD));
    }

    #[test]
    fn one_grid_is_for_centers_everywhere() {
        // In the last, the others are more than a few.
        for (object, others) in [(5000, 0), (0, 5000), (2500, 1000)] {
            let twice = centers(object, others);
            let (keys, grid) = (keys(&twice, [0, 0]), Keys::new(&box_of(&twice)));
            assert!(keys.dense.is_none(), "{object} {others}");
            assert!(twice.iter().all(|&twice| keys.of_twice(twice) == grid.of_twice(twice)));
        }
    }

    #[test]
    fn the_parts_of_a_unit_do_not_matter() {
        let twice = centers(5000, 60);
        let expected = keys(&twice, [0, 0]);
        for lengths in [[1, 0], [7, 1], [100, 38], [39, 39], [4999, 1], [0, 5000]] {
            let keys = keys(&twice, lengths);
            assert!(keys.dense.is_some());
            assert!(twice.iter().all(|&twice| keys.of_twice(twice) == expected.of_twice(twice)));
        }
    }

    struct Eight<'k>(&'k CrowdKeys, [Vec3A; 8]);

    impl Kernel for Eight<'_> {
        type Output = [u32; 8];

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [u32; 8] {
            let Self(keys, twice) = self;
            let lanes = |axis: usize| f32x8::simd_from(simd, twice.map(|twice| twice[axis]));
            keys.of_eight(simd, [lanes(0), lanes(1), lanes(2)]).into()
        }
    }

    /// Checks the keys of eight centres at once against those of each.
    fn check(keys: &CrowdKeys, twice: &[Vec3A]) {
        for eight in twice.as_chunks::<8>().0.iter().step_by(if cfg!(miri) { 50 } else { 1 }) {
            let expected = eight.map(|twice| keys.of_twice(twice));
            assert!(expected.iter().all(|key| key >> keys.bits() == 0));
            // Machines without vectors never run this kernel.
            for level in SimdLevel::available().filter(|_| HAS_VECTORS) {
                assert_eq!(dispatch(level, Eight(keys, *eight)), expected, "{level:?}");
            }
        }
    }

    #[test]
    fn every_kind_of_vectors_gives_the_same_keys() {
        for others in [0, 60] {
            // An object of each size, and one whose centres are the same.
            for (size, width) in [(1.0, 1.0), (1.0, 0.0), (1e-40, 1e-40), (1e34, 1e34)] {
                let mut twice = centers(5000, others);
                for twice in &mut twice {
                    let is_object = twice.abs().max_element() <= 1.0;
                    *twice *= if is_object { width } else { size };
                }
                let keys = keys(&twice, [0, 0]);
                assert_eq!(keys.dense.is_some(), others > 0);
                if let Some(dense) = &keys.dense {
                    twice.splice(..16, dense.ends());
                }
                check(&keys, &twice);
            }
        }
    }
}
