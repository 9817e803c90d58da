//! Finds the cells of eight triangles at a time: the first step of a pass over a mesh.
//!
//! The result has the same bits as [`Lattice::range`] of each triangle: gather the corners, unite them to a box,
//! round its sides by an addition. A pass finds the cells of many triangles before it enters the first into
//! lists; the head of `one_level/placed.rs` tells why.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8, mask32x8, u32x8};

use crate::cell::{Lattice, WHOLE_BITS, WHOLE_SHIFT, as_f32};
use crate::eight::{RowBytes, corner, corners_of, join, load};
use crate::extremes::Extremes;
use crate::limits::MAX_COORDINATE;
use crate::mesh::WideMesh;

/// The first and the last cell of eight triangles on an axis.
#[derive(Clone, Copy)]
pub(crate) struct Span<S: Simd> {
    pub(crate) first: u32x8<S>,
    pub(crate) last: u32x8<S>,
}

/// The map from triangles to their cells.
#[derive(Clone, Copy)]
pub(crate) struct Spans<S: Simd> {
    axes: [AxisScale<S>; 3],
}

impl<S: Simd> Spans<S> {
    /// Spans in cells of a lattice.
    #[inline(always)]
    pub(crate) fn new(simd: S, lattice: &Lattice) -> Self {
        Self { axes: [0, 1, 2].map(|axis| AxisScale::new(simd, lattice, axis)) }
    }

    /// The cells of the triangles `first..first + 8` on each axis, and a mask of the triangles for which they are
    /// valid: those with finite corners that can be read this way. A triangle with the mesh's last vertex cannot.
    #[inline(always)]
    pub(crate) fn of(
        &self,
        simd: S,
        mesh: &WideMesh<'_>,
        first: u32,
    ) -> ([Span<S>; 3], mask32x8<S>) {
        let ([a, b, c], is_finite) = eight(simd, mesh, first);
        let [x, y, z] = &self.axes;
        let spans = [
            x.span(simd, a[0], b[0], c[0]),
            y.span(simd, a[1], b[1], c[1]),
            z.span(simd, a[2], b[2], c[2]),
        ];
        (spans, is_finite)
    }
}

/// Loads the corners of eight triangles that follow one another, by corner and axis. The mask has the triangles whose
/// corners are all finite.
#[inline(always)]
pub(crate) fn eight<S: Simd>(
    simd: S,
    mesh: &WideMesh<'_>,
    first: u32,
) -> ([[f32x8<S>; 3]; 3], mask32x8<S>) {
    let ([a, b, c], [d, e, f]) = (four(simd, mesh, first), four(simd, mesh, first.wrapping_add(4)));
    let (a, b, c) = (join(a, d), join(b, e), join(c, f));
    let limit = u32x8::splat(simd, MAX_COORDINATE.to_bits());
    let is_finite = largest(a).max(largest(b)).max(largest(c)).simd_le(limit);
    ([a, b, c], is_finite)
}

/// The largest magnitude of three coordinates, as bits: those of infinities and NaNs are larger than all others.
#[inline(always)]
fn largest<S: Simd>([x, y, z]: [f32x8<S>; 3]) -> u32x8<S> {
    let x = x.bitcast::<u32x8<S>>() & 0x7fff_ffff;
    let y = y.bitcast::<u32x8<S>>() & 0x7fff_ffff;
    let z = z.bitcast::<u32x8<S>>() & 0x7fff_ffff;
    x.max(y).max(z)
}

/// The corners of four triangles that follow one another, by corner and axis.
#[inline(always)]
fn four<S: Simd>(simd: S, mesh: &WideMesh<'_>, first: u32) -> [[f32x4<S>; 3]; 3] {
    if let Some([a, b, c, d]) = mesh.four(first) {
        let row = |row: &RowBytes| load(simd, row);
        return [
            corner([row(a[0]), row(b[0]), row(c[0]), row(d[0])]),
            corner([row(a[1]), row(b[1]), row(c[1]), row(d[1])]),
            corner([row(a[2]), row(b[2]), row(c[2]), row(d[2])]),
        ];
    }
    corners_of(simd, &read(mesh, first))
}

/// The corners of four triangles; NaNs for those that do not exist or cannot be read.
#[cold]
#[inline(never)]
fn read(mesh: &WideMesh<'_>, first: u32) -> [[RowBytes; 4]; 3] {
    let mut rows = [[[0xff; 16]; 4]; 3];
    let [a, b, c] = &mut rows;
    for (place, ((a, b), c)) in (0..4).zip(a.iter_mut().zip(b).zip(c)) {
        if let Some(corners) = mesh.corners(first.wrapping_add(place)) {
            [*a, *b, *c] = corners.map(|corner| *corner);
        }
    }
    rows
}

/// The map from coordinates on one axis to cells.
#[derive(Clone, Copy)]
struct AxisScale<S: Simd> {
    origin: f32x8<S>,
    cells_per_unit: f32x8<S>,
    margin: f32x8<S>,
    end: f32x8<S>,
}

impl<S: Simd> AxisScale<S> {
    #[inline(always)]
    fn new(simd: S, lattice: &Lattice, axis: usize) -> Self {
        Self {
            origin: f32x8::splat(simd, lattice.min[axis]),
            cells_per_unit: f32x8::splat(simd, lattice.scale()[axis]),
            margin: f32x8::splat(simd, lattice.margin()[axis]),
            end: f32x8::splat(simd, as_f32(lattice.resolution[axis]) - 0.5),
        }
    }

    #[inline(always)]
    fn span(&self, simd: S, a: f32x8<S>, b: f32x8<S>, c: f32x8<S>) -> Span<S> {
        let (min, max) = (a.lesser(b).lesser(c), a.greater(b).greater(c));
        let min = (min - self.origin) * self.cells_per_unit - self.margin;
        let max = (max - self.origin) * self.cells_per_unit + self.margin;
        Span { first: self.whole(simd, min), last: self.whole(simd, max) }
    }

    #[inline(always)]
    fn whole(&self, simd: S, position: f32x8<S>) -> u32x8<S> {
        let clamped = position.greater(f32x8::splat(simd, 0.0)).lesser(self.end);
        (clamped - 0.5 + WHOLE_SHIFT).bitcast::<u32x8<S>>() & WHOLE_BITS
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use glam::Vec3A;

    use super::*;
    use crate::aabb::Aabb;
    use crate::cell::CellRange;
    use crate::eight::LANES;
    use crate::mesh::TriangleMesh;
    use crate::random;
    use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};

    struct Of<'a>(&'a TriangleMesh<'a>, &'a Lattice, u32);

    impl Kernel for Of<'_> {
        type Output = [Option<CellRange>; LANES];

        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let Self(mesh, lattice, first) = self;
            let (spans, is_finite) = Spans::new(simd, lattice).of(simd, &mesh.wide(), first);
            let [x, y, z] = spans.map(|span| [<[u32; LANES]>::from(span.first), span.last.into()]);
            let bits = is_finite.to_bitmask();
            core::array::from_fn(|lane| {
                let [min, max] = [0, 1].map(|end| [x[end][lane], y[end][lane], z[end][lane]]);
                (bits >> lane & 1 == 1).then_some(CellRange { min, max })
            })
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn every_level_finds_the_cells_that_one_triangle_after_the_other_has() {
        // Machines without vectors never run this kernel.
        if !HAS_VECTORS {
            return;
        }
        // Corners on and beside borders of cells, outside, at the ends, and no numbers.
        let mut values = Vec::new();
        for border in 0_u8..=8 {
            let border = f32::from(border) * 0.75 - 3.0;
            values.extend([border, border.next_up(), border.next_down(), border + 0.3]);
        }
        values.extend([
            -0.0,
            -9.0,
            1e30,
            MAX_COORDINATE,
            -MAX_COORDINATE,
            MAX_COORDINATE.next_up(),
        ]);
        values.extend([f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-40]);
        let mut state = 1_u32;
        let mut value = || {
            let random = random::next(&mut state);
            // Mostly those in the box: one in ten triangles has one that is no number.
            let end = if random >> 29 == 0 { values.len() } else { 36 };
            values[(random >> 8) as usize % end]
        };
        let positions: Vec<_> = (0..6000).map(|_| [value(), value(), value()]).collect();
        let indices: Vec<_> =
            (0..6000).map(|at| [at, (at * 7 + 1) % 6000, at * 11 % 6003]).collect();
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let bounds = Aabb { min: Vec3A::splat(-3.0), max: Vec3A::splat(3.0) };
        for bounds in [bounds, Lattice::pad(&bounds)] {
            let lattice = Lattice::new(bounds, [8, 5, 1]);
            let (mut some, mut none) = (0, 0);
            // Also where fewer than eight triangles are left, and where `first + lane` wraps around.
            let ends = [5993, 5997, 5999, 6000, u32::MAX - 5];
            for first in (0..6000).step_by(LANES).chain(ends) {
                let found =
                    |level| dispatch(level, Of(&mesh, &lattice, first)).map(|found| (level, found));
                let found = SimdLevel::available().map(found);
                for (lane, (level, found)) in found.flat_map(|found| (0..).zip(found)) {
                    let id = u32::wrapping_add(first, lane);
                    let corners = mesh.triangle(id).map(|corners| corners.map(Vec3A::from_array));
                    let expected = corners.and_then(Aabb::of).map(|bounds| lattice.range(&bounds));
                    // The mesh's last vertex has nothing behind it, and is not read this way.
                    let is_last = indices.get(id as usize).is_some_and(|all| all.contains(&5999));
                    assert_eq!(found, expected.filter(|_| !is_last), "{level:?}: triangle {id}");
                    *if found.is_some() { &mut some } else { &mut none } += 1;
                }
            }
            assert!(some > 3000 && none > 300, "{some} {none}");
        }
    }
}
