//! Loads eight triangles, or eight rays, into vectors.
//!
//! ```text
//! for each corner:  a row | x y z . | of each triangle, transposed:  x = | lane 0 | ... | lane 7 |
//!                                                                    y, z likewise
//! ```
//!
//! Rows are transposed in registers: a row that is copied through memory, or `map` over arrays of vectors, stores
//! pieces, and the load of the whole waits for these stores.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8, u8x16};
use zerocopy::{transmute, transmute_ref};

use crate::filter::RayFilter;
use crate::mesh::{LastPart, TriangleMesh};
use crate::ray::Ray;

/// Number of triangles that are tested at once.
pub(crate) const LANES: usize = 8;

/// Sixteen bytes that are loaded as four numbers: a vertex and what follows it, half a ray, a part of a box.
pub(crate) type RowBytes = [u8; 16];

/// Up to eight triangles, one a lane.
#[derive(Clone, Copy)]
pub(crate) struct Eight<S: Simd> {
    /// By corner, then axis.
    pub(crate) corners: [[f32x8<S>; 3]; 3],
    /// Bit `i`: lane `i` holds a triangle.
    pub(crate) used: u32,
}

impl<S: Simd> Eight<S> {
    /// The first `count` of eight triangles; the others are read, too.
    #[inline(always)]
    pub(crate) fn of(simd: S, mesh: &TriangleMesh<'_>, ids: [u32; LANES], count: usize) -> Self {
        let [i, j, k, l, m, n, o, p] = ids;
        // The part of a joined mesh that holds the triangle before.
        let mut last_part = None;
        let (low, used) = four(simd, mesh, [i, j, k, l], &mut last_part);
        let (high, used_high) = if count > LANES / 2 {
            four(simd, mesh, [m, n, o, p], &mut last_part)
        } else {
            (low, 0)
        };
        // Written out: arrays that are mapped live in memory.
        let ([a, b, c], [d, e, f]) = (low, high);
        let corners = [join(a, d), join(b, e), join(c, f)];
        let used = used | used_high << (LANES / 2);
        Self { corners, used: used & ((1 << count.min(LANES)) - 1) }
    }
}

/// The first eight of some ids; where there are fewer, the last once more: it is read, too.
///
/// They are read number by number, into registers: a load of a copied array would wait for its stores.
#[inline(always)]
pub(crate) fn first_eight(ids: &[u32]) -> [u32; LANES] {
    let last = ids.len().saturating_sub(1);
    let at = |place: usize| ids.get(place.min(last)).copied().unwrap_or(0);
    [at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7)]
}

/// Eight vertices from four and four.
#[inline(always)]
pub(crate) fn join<S: Simd>([x, y, z]: [f32x4<S>; 3], [u, v, w]: [f32x4<S>; 3]) -> [f32x8<S>; 3] {
    [x.combine(u), y.combine(v), z.combine(w)]
}

/// The corners of four triangles, by corner and axis, and the lanes that are used.
#[inline(always)]
fn four<'m, S: Simd>(
    simd: S,
    mesh: &TriangleMesh<'m>,
    ids: [u32; 4],
    last_part: &mut Option<LastPart<'m>>,
) -> ([[f32x4<S>; 3]; 3], u32) {
    let wide = mesh.wide();
    let rows = |id: u32| -> Option<[f32x4<S>; 3]> {
        let [a, b, c] = wide.corners(id)?;
        Some([load(simd, a), load(simd, b), load(simd, c)])
    };
    if let Some([a, b, c]) = rows(ids[0])
        && let Some([d, e, f]) = rows(ids[1])
        && let Some([g, h, i]) = rows(ids[2])
        && let Some([j, k, l]) = rows(ids[3])
    {
        let corners = [corner([a, d, g, j]), corner([b, e, h, k]), corner([c, f, i, l])];
        return (corners, 0xf);
    }
    let (rows, used) = read(mesh, ids, last_part);
    (corners_of(simd, &rows), used)
}

/// The corners of four triangles, by corner and axis, from their rows.
#[inline(always)]
pub(crate) fn corners_of<S: Simd>(simd: S, rows: &[[RowBytes; 4]; 3]) -> [[f32x4<S>; 3]; 3] {
    let row = |at: usize, lane: usize| load(simd, &rows[at][lane]);
    [
        corner([row(0, 0), row(0, 1), row(0, 2), row(0, 3)]),
        corner([row(1, 0), row(1, 1), row(1, 2), row(1, 3)]),
        corner([row(2, 0), row(2, 1), row(2, 2), row(2, 3)]),
    ]
}

/// x, y and z of four vertices.
#[inline(always)]
pub(crate) fn corner<S: Simd>(vertices: [f32x4<S>; 4]) -> [f32x4<S>; 3] {
    let [x, y, z, _] = transpose(vertices);
    [x, y, z]
}

/// Reads eight triangles, such as those of a joined mesh, if [`WideMesh::corners`](crate::mesh::WideMesh::corners)
/// cannot read all of them.
#[cold]
#[inline(never)]
fn read<'m>(
    mesh: &TriangleMesh<'m>,
    ids: [u32; 4],
    last_part: &mut Option<LastPart<'m>>,
) -> ([[RowBytes; 4]; 3], u32) {
    let is_joined = !mesh.parts().is_empty();
    let (mut rows, mut used) = ([[[0; 16]; 4]; 3], 0);
    let [a, b, c] = &mut rows;
    for (lane, (((id, a), b), c)) in ids.into_iter().zip(a).zip(b).zip(c).enumerate() {
        if is_joined {
            let mut found = last_part.and_then(|last_part| last_part.corners(id));
            if found.is_none() {
                let other = mesh.part_around(id);
                found = other.corners(id);
                *last_part = Some(other);
            }
            if let Some(corners) = found {
                [*a, *b, *c] = corners.map(|corner| *corner);
                used |= 1 << lane;
                continue;
            }
        }
        let Some(triangle) = mesh.triangle(id) else { continue };
        for (row, [x, y, z]) in [a, b, c].into_iter().zip(triangle) {
            *row = transmute!([x, y, z, 0.0_f32]);
        }
        used |= 1 << lane;
    }
    (rows, used)
}

impl RayFilter {
    /// Returns a mask of the triangles that are not dropped, tested one after the other: for machines without vectors.
    #[inline(never)]
    pub(crate) fn survivors(&self, mesh: &TriangleMesh<'_>, ids: &[u32]) -> u32 {
        let mut reader = mesh.reader();
        let mut passes = |id| reader.triangle(id).is_some_and(|triangle| self.passes(&triangle));
        (0..).zip(ids).fold(0, |bits, (lane, &id)| bits | u32::from(passes(id)) << (lane % 32))
    }
}

/// The numbers of four vectors, those of each place together.
#[inline(always)]
pub(crate) fn transpose<S: Simd>([a, b, c, d]: [f32x4<S>; 4]) -> [f32x4<S>; 4] {
    let (ac_xy, bd_xy) = (a.zip_low(c), b.zip_low(d));
    let (ac_z, bd_z) = (a.zip_high(c), b.zip_high(d));
    [ac_xy.zip_low(bd_xy), ac_xy.zip_high(bd_xy), ac_z.zip_low(bd_z), ac_z.zip_high(bd_z)]
}

/// Eight rays, number by number.
#[inline(always)]
#[expect(clippy::type_complexity, reason = "the fields of a ray")]
pub(crate) fn columns<S: Simd>(
    simd: S,
    rays: [&Ray; 8],
) -> ([f32x8<S>; 3], f32x8<S>, [f32x8<S>; 3], f32x8<S>) {
    let [q, r, s, t, u, v, w, x] = rays;
    let ([q, r, s, t], [u, v, w, x]) = (
        [halves(q), halves(r), halves(s), halves(t)],
        [halves(u), halves(v), halves(w), halves(x)],
    );
    let ([a, b, c, d], [e, f, g, h]) =
        (transpose(rows_of(simd, [q, r, s, t], 0)), transpose(rows_of(simd, [u, v, w, x], 0)));
    let ([i, j, k, l], [m, n, o, p]) =
        (transpose(rows_of(simd, [q, r, s, t], 1)), transpose(rows_of(simd, [u, v, w, x], 1)));
    (join([a, b, c], [e, f, g]), d.combine(h), join([i, j, k], [m, n, o]), l.combine(p))
}

/// A ray as two rows.
#[inline(always)]
fn halves(ray: &Ray) -> &[RowBytes; 2] {
    transmute_ref!(ray)
}

/// One half of four rays.
#[inline(always)]
fn rows_of<S: Simd>(simd: S, [a, b, c, d]: [&[RowBytes; 2]; 4], half: usize) -> [f32x4<S>; 4] {
    let half = half % 2;
    [load(simd, &a[half]), load(simd, &b[half]), load(simd, &c[half]), load(simd, &d[half])]
}

/// Sixteen bytes as four numbers.
#[inline(always)]
pub(crate) fn load<S: Simd>(simd: S, row: &RowBytes) -> f32x4<S> {
    u8x16::simd_from(simd, *row).bitcast()
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;
    use zerocopy::IntoBytes;

    use super::*;
    use crate::aabb::Aabb;
    use crate::approach::Approach;
    use crate::filter::Size;
    use crate::mesh::{IndexType, Strided, Triangle};
    use crate::ray::{Hit, Ray, round};
    use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};
    use crate::triangle::TriangleTest;
    use alloc::vec::Vec;

    /// Random numbers as in Marsaglia's xorshift.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> u32 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 >> 32) as u32
        }

        /// From -1 to 1, with few digits now and then: edges that meet rays exactly.
        fn coordinate(&mut self) -> f32 {
            let fine = f64::from(self.next()) / f64::from(u32::MAX) * 2.0 - 1.0;
            let x = if self.next().is_multiple_of(2) { fine } else { (fine * 4.0).round() / 4.0 };
            round(x)
        }

        fn point(&mut self) -> [f32; 3] {
            [self.coordinate(), self.coordinate(), self.coordinate()]
        }
    }

    /// Triangles of all kinds: large and small, no area, no numbers.
    fn triangles(random: &mut Random, scale: f32, count: usize) -> Vec<[f32; 3]> {
        let mut positions = Vec::new();
        for i in 0..count {
            let [a, b, c] = [random.point(), random.point(), random.point()];
            let near = |p: [f32; 3]| core::array::from_fn(|axis| a[axis] + p[axis] * 0.125);
            let mut triangle = match i % 7 {
                0 => [a, a, b],
                1 => [a, a, a],
                2 => [a, b, a.map(|x| x * 0.5)],
                3 | 4 => [a, near(b), near(c)],
                _ => [a, b, c],
            };
            for x in triangle.as_flattened_mut() {
                *x *= scale;
            }
            if i % 11 == 0 {
                let odd = [f32::NAN, f32::INFINITY, f32::MAX, -0.0, f32::from_bits(1)];
                triangle[i % 3][i / 3 % 3] = odd[i / 11 % 5];
            }
            positions.extend(triangle);
        }
        positions
    }

    fn bits(triangle: Triangle) -> [u32; 9] {
        let [a, b, c] = triangle.map(|corner| corner.map(f32::to_bits));
        [a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]]
    }

    type Answer = (u32, Vec<(usize, [u32; 3])>);

    #[derive(Clone, Copy)]
    struct Test<'a> {
        ray: &'a TriangleTest,
        mesh: &'a TriangleMesh<'a>,
        ids: &'a [u32],
    }

    impl Kernel for Test<'_> {
        type Output = Answer;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Answer {
            let Self { ray, mesh, ids } = self;
            let eight = Eight::of(simd, mesh, first_eight(ids), ids.len());
            let filter = ray.filter.line.splat(simd);
            let reach = f32x8::splat(simd, ray.filter.reach);
            let size = Size { reach, ..Size::new(filter.origin, &eight.corners) };
            let dropped = filter.drops(&eight.corners, &size).to_bitmask();
            let survivors = !u32::try_from(dropped).unwrap() & eight.used;
            let lanes = (0..LANES).filter(|lane| survivors >> lane & 1 == 1);
            let hits = lanes.filter_map(|lane| {
                let hit = ray.decide(mesh, ids[lane]);
                (hit.primitive == ids[lane]).then(|| (lane, hit_bits(hit)))
            });
            (survivors, hits.collect())
        }
    }

    fn hit_bits(hit: Hit) -> [u32; 3] {
        [hit.t, hit.u, hit.v].map(f32::to_bits)
    }

    /// Tests the triangles one by one.
    fn expected(test: &TriangleTest, mesh: &TriangleMesh<'_>, ids: &[u32]) -> Answer {
        let survivors = test.filter.survivors(mesh, ids);
        let mut hits = Vec::new();
        for (lane, &id) in ids.iter().enumerate() {
            let Some(triangle) = mesh.triangle(id) else { continue };
            assert_eq!(test.passes(&triangle), survivors >> lane & 1 == 1);
            hits.extend(test.test(&triangle).map(|hit| (lane, hit_bits(hit.on(id)))));
        }
        (survivors, hits)
    }

    #[test]
    fn every_level_finds_what_the_triangles_give_one_by_one() {
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let rounds = if cfg!(miri) { 10 } else { 600_usize };
        let (mut survivors, mut hits, mut others) = (0, 0, 0);
        for scale in [1e-38, 1e-30, 1e-18, 1.0, 1e18, 1e30, 1e36] {
            let positions = triangles(&mut random, scale, 200);
            let indices: Vec<[u32; 3]> = (0..200).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let mesh = TriangleMesh::new(&positions, &indices).unwrap();
            let bounds = Aabb { min: Vec3A::splat(-scale), max: Vec3A::splat(scale) };
            for round in 0..rounds {
                let target = positions[random.next() as usize % positions.len()];
                let origin = random.point().map(|x| x * scale * 2.0);
                let mut direction = match round % 3 {
                    // Into a corner, anywhere, along an axis.
                    0 => core::array::from_fn(|axis| target[axis] - origin[axis]),
                    1 => random.point(),
                    _ => [0.0; 3],
                };
                if round % 3 == 2 {
                    direction[round / 3 % 3] = if round % 2 == 0 { 1.0 } else { -1.0 };
                }
                let ray = Ray { t_min: f32::NEG_INFINITY, ..Ray::new(origin, direction) };
                let Some(approach) = Approach::new(&ray, &bounds) else { continue };
                let test = TriangleTest::from(&ray, &approach);

                // One to eight, some of which do not exist, sometimes more than eight.
                let ids: Vec<u32> = (0..round % 11).map(|_| random.next() % 220).collect();
                let expected = expected(&test, &mesh, &ids[..ids.len().min(LANES)]);
                // The filter promises nothing about triangles outside of the box.
                let is_inside = |(lane, _): &&(usize, [u32; 3])| {
                    let triangle = mesh.triangle(ids[*lane]).unwrap_or_default();
                    !triangle.as_flattened().iter().any(|x| x.is_finite() && x.abs() > scale)
                };
                let kernel = Test { ray: &test, mesh: &mesh, ids: &ids };
                // Machines without vectors filter triangle by triangle, as `expected` does.
                for level in SimdLevel::available() {
                    if !HAS_VECTORS {
                        break;
                    }
                    let answer = dispatch(level, kernel);
                    if level.fuses() {
                        let [found, hits] =
                            [&answer, &expected].map(|(_, hits)| hits.iter().filter(is_inside));
                        assert!(found.eq(hits), "{level:?} {scale} {ray:?} {ids:?}");
                        others += (answer.0 ^ expected.0).count_ones();
                    } else {
                        assert_eq!(answer, expected, "{level:?} {scale} {ray:?} {ids:?}");
                    }
                }
                survivors += expected.0.count_ones();
                hits += expected.1.len();
            }
        }
        assert!(survivors as usize > 2 * rounds && 4 * hits > rounds, "{survivors} {hits}");
        // Fused products let few other triangles pass.
        assert!(50 * others < survivors, "{others} of {survivors}");
    }

    #[test]
    fn lanes_and_corners_are_the_triangles_of_every_layout() {
        let mut random = Random(0x2545_f491_4f6c_dd1d);
        let positions = triangles(&mut random, 1.0, 9);
        let count = positions.len();
        let indices: Vec<[u32; 3]> = (0..40)
            .map(|i| match i % 8 {
                // Vertices that do not exist, the last one, and any.
                0 => [0, 1, 27],
                1 => [u32::MAX, 0, 1],
                2 => [0x5555_5556, 1, 2],
                3 => [26, 26, 26],
                _ => [random.next() % 27, random.next() % 27, random.next() % 27],
            })
            .collect();
        // Miri takes minutes for each.
        let strides = &[12, 13, 16, 32, 65_535, 65_536][..if cfg!(miri) { 2 } else { 6 }];
        for &position_stride in strides {
            let mut vertices = Vec::new();
            for position in &positions {
                vertices.resize(vertices.len().next_multiple_of(position_stride), 0xff);
                vertices.extend_from_slice(position.as_bytes());
            }
            for (index_type, size) in [(IndexType::U32, 12), (IndexType::U16, 6)] {
                let far = if cfg!(miri) { 100 } else { 65_536 };
                for index_stride in [size, size + 5, far] {
                    let mut bytes = Vec::new();
                    for triangle in &indices {
                        bytes.resize(bytes.len().next_multiple_of(index_stride), 0xff);
                        for index in triangle {
                            let low = u16::try_from(index & 0xffff).unwrap();
                            match index_type {
                                IndexType::U32 => bytes.extend(index.to_ne_bytes()),
                                IndexType::U16 => bytes.extend(low.to_ne_bytes()),
                            }
                        }
                    }
                    for behind in [0, 3, 100] {
                        let [mut vertices, mut bytes] = [vertices.clone(), bytes.clone()];
                        vertices.resize(vertices.len() + behind, 0);
                        bytes.resize(bytes.len() + behind, 0);
                        let array = |bytes, stride, count| Strided { bytes, stride, count };
                        let mesh = TriangleMesh::strided(
                            array(&vertices, position_stride, count),
                            array(&bytes, index_stride, indices.len()),
                            index_type,
                        );
                        check_reading(&mesh.unwrap());
                    }
                }
            }
        }
    }

    /// The lanes of some triangles, in bits.
    struct Gather<'a>(&'a TriangleMesh<'a>, &'a [u32]);

    impl Kernel for Gather<'_> {
        type Output = [Option<[u32; 9]>; LANES];

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let Eight { corners, used } =
                Eight::of(simd, self.0, first_eight(self.1), self.1.len());
            let lanes: [[[f32; LANES]; 3]; 3] = corners.map(|corner| corner.map(Into::into));
            core::array::from_fn(|lane| {
                let triangle = lanes.map(|corner| corner.map(|axis| axis[lane]));
                (used >> lane & 1 == 1).then(|| bits(triangle))
            })
        }
    }

    fn check_reading(mesh: &TriangleMesh<'_>) {
        let step = if cfg!(miri) { 19 } else { 1 };
        for first in (0..48).step_by(step) {
            let corners =
                mesh.corners(first).map(|corners| corners.map(|corner| corner.to_array()));
            assert_eq!(corners.map(bits), mesh.triangle(first).map(bits), "{first}");
            for length in 0..=8 {
                let ids: Vec<u32> = (first..first + length).collect();
                let expected = core::array::from_fn(|lane| {
                    ids.get(lane).and_then(|&id| mesh.triangle(id)).map(bits)
                });
                let held = dispatch(SimdLevel::detect(), Gather(mesh, &ids));
                assert_eq!(held, expected, "{ids:?}");
            }
        }
    }
}
