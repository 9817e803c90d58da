//! Finds the cells that each triangle of a mesh overlaps, eight triangles at a time.
//!
//! ```text
//! read the corners of eight triangles, and take their boxes
//! turn both ends of each box into cells
//! note the row of the first cell, its x, and how many more cells the box spans on each axis
//! ```
//!
//! A triangle that spans many cells, is not finite, or that wide reads cannot reach is looked at by itself.

use core::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u32x8};

use super::placed::{MORE_BITS, MOST_MORE, PlacedBatch, Spread};
use crate::aabb::Aabb;
use crate::cell::{CellRange, Lattice};
use crate::eight::LANES;
use crate::mesh::{TriangleMesh, WideMesh};
use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};
use crate::spans::Spans;

/// The triangles of a mesh over a lattice.
#[derive(Debug)]
pub(crate) struct MeshSpread<'m> {
    mesh: &'m TriangleMesh<'m>,
    lattice: &'m Lattice,
    wide: WideMesh<'m>,
}

impl<'m> MeshSpread<'m> {
    pub(crate) fn new(mesh: &'m TriangleMesh<'m>, lattice: &'m Lattice) -> Self {
        Self { mesh, lattice, wide: mesh.wide() }
    }
}

impl Spread for MeshSpread<'_> {
    fn resolution(&self) -> [u32; 3] {
        self.lattice.resolution
    }

    fn count(&self) -> u32 {
        self.mesh.triangle_count()
    }

    #[inline(always)]
    fn range(&self, number: u32) -> Option<CellRange> {
        let bounds = self.mesh.corners(number).and_then(Aabb::of)?;
        Some(self.lattice.range(&bounds))
    }

    fn place(&self, numbers: Range<u32>, batch: &mut PlacedBatch) {
        let (wide, first) = (self.wide, numbers.start);
        // In a joined mesh, read the part of the first triangle; triangles of others are placed one by one.
        let (wide, first) = if self.mesh.parts().is_empty() {
            (wide, first)
        } else {
            self.mesh.part_around(first).own(first)
        };
        if HAS_VECTORS && !wide.is_empty() {
            dispatch(SimdLevel::detect(), PlaceBatch { spread: self, wide, first, batch });
        } else {
            batch.place_each(self, numbers);
        }
    }
}

/// Placing a batch of triangles, eight at a time.
struct PlaceBatch<'f, 'm> {
    spread: &'f MeshSpread<'m>,
    wide: WideMesh<'m>,
    /// The first triangle, in the numbers of `wide`.
    first: u32,
    batch: &'f mut PlacedBatch,
}

impl Kernel for PlaceBatch<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { spread, wide, first, batch } = self;
        let spans = Spans::new(simd, spread.lattice);
        let [_, height, _] = spread.lattice.resolution;
        batch.is_placed = 0;
        let slots = batch.rows.iter_mut().zip(&mut batch.xs).zip(&mut batch.more);
        for (at, ((rows, xs), more)) in (0_u32..).step_by(LANES).zip(slots) {
            // Read eight triangles, and turn the ends of their boxes into cells.
            let ([x, y, z], is_finite) = spans.of(simd, &wide, first.wrapping_add(at));
            let (long, high, deep) = (x.last - x.first, y.last - y.first, z.last - z.first);
            let is_placed = (long | high | deep).simd_le(u32x8::splat(simd, MOST_MORE)) & is_finite;
            // Note the row and x of the first cell, and how many more there are on each axis.
            *rows = (y.first + z.first * height).into();
            *xs = x.first.into();
            *more = (long | (high << MORE_BITS) | (deep << (2 * MORE_BITS))).into();
            batch.is_placed |= is_placed.to_bitmask() << at;
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use glam::Vec3A;

    use super::*;
    use crate::cell::as_f32;
    use crate::cell::row;
    use crate::random;

    /// The rows of cells of a batch's primitives, and their number of cells.
    fn rows(
        batch: &PlacedBatch,
        spread: &MeshSpread<'_>,
        numbers: Range<u32>,
    ) -> (Vec<[usize; 4]>, u64) {
        let mut rows = Vec::new();
        batch.each_row::<false>(spread, numbers.clone(), |number, row, x, length| {
            rows.push([number as usize, row, x as usize, length as usize]);
        });
        (rows, batch.references(spread, numbers))
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn every_level_places_triangles_where_their_ranges_are() {
        // Most triangles are small, some span the box, some are not finite or have no vertices; one
        // has the last vertex, behind which nothing can be read.
        let mut state = 1_u32;
        let mut random = || random::next(&mut state) >> 8;
        let mut positions = Vec::new();
        for at in 0..65 {
            let mut coordinate = || as_f32(random() % 4096) / 4096.0;
            let center = [coordinate(), coordinate(), coordinate()];
            let size = if at % 9 == 4 { 2.0 } else { 0.1 };
            for _ in 0..3 {
                positions.push(center.map(|c| c + size * (coordinate() - 0.5)));
            }
        }
        positions[30] = [f32::NAN; 3];
        positions[60] = [0.5, f32::INFINITY, 0.5];
        let mut indices: Vec<_> =
            (0..65).map(|at| [0, 1, 2].map(|corner| 3 * at + corner)).collect();
        indices[17] = [0, 1, 195];
        let bounds = Aabb { min: Vec3A::ZERO, max: Vec3A::ONE };
        for resolution in [[8, 5, 3], [4096, 1, 1], [1, 4096, 1], [1, 1, 4096]] {
            let lattice = Lattice::new(bounds, resolution);
            for count in [0, 1, 63, 64, 65] {
                let mesh = TriangleMesh::new(&positions, &indices[..count]).unwrap();
                let spread = MeshSpread::new(&mesh, &lattice);
                for first in (0..spread.count()).step_by(64) {
                    let numbers = first..spread.count().min(first + 64);
                    let (mut expected, mut cells) = (Vec::new(), 0);
                    for number in numbers.clone() {
                        let Some(range) = spread.range(number) else { continue };
                        let CellRange { min, max } = range;
                        cells += range.count();
                        for z in min[2]..=max[2] {
                            for y in min[1]..=max[1] {
                                let length = max[0] - min[0] + 1;
                                let [x, length] = [min[0], length].map(|cells| cells as usize);
                                expected.push([
                                    number as usize,
                                    row(resolution[1], y, z),
                                    x,
                                    length,
                                ]);
                            }
                        }
                    }
                    let expected = (expected, cells);

                    let mut batch = PlacedBatch::empty();
                    batch.place_each(&spread, numbers.clone());
                    assert_eq!(rows(&batch, &spread, numbers.clone()), expected);
                    // Machines without vectors never run this kernel.
                    if !HAS_VECTORS {
                        continue;
                    }
                    for level in SimdLevel::available() {
                        dispatch(
                            level,
                            PlaceBatch {
                                spread: &spread,
                                wide: spread.wide,
                                first,
                                batch: &mut batch,
                            },
                        );
                        assert_eq!(rows(&batch, &spread, numbers.clone()), expected, "{level:?}");
                    }
                    let placed = batch.is_placed.count_ones();
                    let is_expected = if count > 1 && first == 0 { 40..=62 } else { 0..=1 };
                    assert!(is_expected.contains(&placed), "{placed} of {count}");
                }
            }
        }
    }
}
