//! The triangles of a mesh over the cells of a lattice, placed eight at a time.

use core::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u32x8};
use glam::Vec3A;

use super::placed::{Batch, MORE_BITS, MOST_MORE};
use super::spread::Spread;
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
    fn id(&self, place: u32) -> u32 {
        place
    }

    #[inline(always)]
    fn range(&self, place: u32) -> Option<CellRange> {
        let bounds = self.mesh.corners(place, Vec3A::new).and_then(Aabb::of)?;
        Some(self.lattice.range(&bounds))
    }

    #[inline(always)]
    fn find(&self, places: Range<u32>, batch: &mut Batch) {
        if HAS_VECTORS && !self.wide.is_empty() {
            dispatch(SimdLevel::detect(), Find { spread: self, first: places.start, batch });
        } else {
            batch.find(self, places);
        }
    }
}

/// Finding the cells of a batch of triangles, eight at a time.
struct Find<'f, 'm> {
    spread: &'f MeshSpread<'m>,
    first: u32,
    batch: &'f mut Batch,
}

impl Kernel for Find<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { spread, first, batch } = self;
        let spans = Spans::new(simd, spread.lattice, 1);
        let [_, height, _] = spread.lattice.resolution;
        batch.placed = 0;
        let slots = batch.rows.iter_mut().zip(&mut batch.xs).zip(&mut batch.more);
        for (at, ((rows, xs), more)) in (0_u32..).step_by(LANES).zip(slots) {
            let ([x, y, z], is_finite) = spans.of(simd, &spread.wide, first.wrapping_add(at));
            let (wide, high, deep) = (x.last - x.first, y.last - y.first, z.last - z.first);
            let is_placed = (wide | high | deep).simd_le(u32x8::splat(simd, MOST_MORE)) & is_finite;
            *rows = (y.first + z.first * height).into();
            *xs = x.first.into();
            *more = (wide | (high << MORE_BITS) | (deep << (2 * MORE_BITS))).into();
            batch.placed |= is_placed.to_bitmask() << at;
        }
    }
}
