//! Gives the triangles of a crowded unit new keys, in the box around their centres.
//!
//! ```text
//! centers     read each triangle once: store min + max of its box, find the box around all centres
//! new keys    for eight triangles: keys of their centres in that box; count the bin of each
//!
//! min + max (twice the centre) is stored in | entry: z, id | and in spare, for every eight entries | 8 x | 8 y |
//! ```

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, u32x8};
use glam::Vec3A;

use crate::aabb::Aabb;
use crate::eight::LANES;
use crate::invariant::OrBug;
use crate::mesh::{TriangleMesh, WideMesh, vector};
use crate::simd::{HAS_VECTORS, Kernel};

use super::key::Keys;
use super::layout::Entry;
use super::subtree::slow_bounds;

/// Finds the box around the centres of the triangles' boxes. Stores min + max of each box (twice the centre): x and
/// y in `spare`, z in place of the key. Out of line: few units are crowded, and inlined it would slow down all others.
#[inline(never)]
pub(crate) fn centers(mesh: &TriangleMesh<'_>, entries: &mut [Entry], spare: &mut [Entry]) -> Aabb {
    debug_assert!(spare.len() >= entries.len(), "too little room for the centres of a unit");
    let wide = mesh.wide();
    let mut centers = Aabb::EMPTY;
    for (entries, room) in entries.chunks_mut(LANES).zip(spare.chunks_mut(LANES)) {
        let (xs, ys) =
            room.as_flattened_mut().split_at_mut_checked(entries.len()).unwrap_or_default();
        for ((entry, x), y) in entries.iter_mut().zip(xs).zip(ys) {
            let Aabb { min, max } = bounds(mesh, &wide, entry[1]);
            let twice = min + max;
            [*x, *y, entry[0]] = twice.to_array().map(f32::to_bits);
            let center = twice * 0.5;
            centers.min = centers.min.min(center);
            centers.max = centers.max.max(center);
        }
    }
    centers
}

/// Gives entries new keys, from the sums that [`centers`] stored, and counts those of each bin.
pub(crate) struct NewKeys<'w> {
    pub(crate) entries: &'w mut [Entry],
    pub(crate) spare: &'w [Entry],
    pub(crate) rule: &'w Keys,
    /// Number of low key bits that do not choose a bin.
    pub(crate) shift: u32,
    pub(crate) counts: &'w mut [u32],
}

impl Kernel for NewKeys<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { entries, spare, rule, shift, counts } = self;
        debug_assert!(spare.len() >= entries.len(), "entries without centres");
        for (entries, stored) in entries.chunks_mut(LANES).zip(spare.chunks(LANES)) {
            let (xs, ys) =
                stored.as_flattened().split_at_checked(entries.len()).unwrap_or_default();
            match (entries.first_chunk(), xs.first_chunk(), ys.first_chunk()) {
                (Some(&[a, b, c, d, e, f, g, h]), Some(xs), Some(ys)) if HAS_VECTORS => {
                    let zs = [a[0], b[0], c[0], d[0], e[0], f[0], g[0], h[0]];
                    let twice = [numbers(simd, *xs), numbers(simd, *ys), numbers(simd, zs)];
                    let keys: [u32; LANES] = rule.of_eight(simd, twice).into();
                    for (entry, key) in entries.iter_mut().zip(keys) {
                        entry[0] = key;
                    }
                }
                _ => one_by_one(entries, [xs, ys], rule),
            }
            for entry in entries {
                let count = counts.get_mut((entry[0] >> shift) as usize);
                if let Some(count) = count.or_bug("a key behind those of all bins") {
                    *count += 1;
                }
            }
        }
    }
}

#[inline(always)]
fn numbers<S: Simd>(simd: S, bits: [u32; LANES]) -> f32x8<S> {
    u32x8::simd_from(simd, bits).bitcast()
}

/// Gives new keys to fewer than eight entries, or to those of machines without vectors.
#[inline(never)]
fn one_by_one(entries: &mut [Entry], [xs, ys]: [&[u32]; 2], rule: &Keys) {
    for ((entry, &x), &y) in entries.iter_mut().zip(xs).zip(ys) {
        let twice = [x, y, entry[0]].map(f32::from_bits);
        entry[0] = rule.of_twice(Vec3A::from_array(twice));
    }
}

/// The box of a triangle, which is known to be finite.
#[inline(always)]
fn bounds(mesh: &TriangleMesh<'_>, wide: &WideMesh<'_>, id: u32) -> Aabb {
    let Some([a, b, c]) = wide.corners(id) else { return slow_bounds(mesh, id) };
    let (a, b, c) = (vector(a), vector(b), vector(c));
    Aabb { min: a.min(b).min(c), max: a.max(b).max(c) }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::mesh::MeshPart;
    use crate::random;
    use crate::simd::{SimdLevel, dispatch};

    /// Checks keys and counts against those of each triangle alone.
    fn check(mesh: &TriangleMesh<'_>, ids: &[u32]) {
        let shift = 24;
        let entries: Vec<Entry> = ids.iter().map(|&id| [7, id]).collect();
        let (mut noted, mut spare) = (entries.clone(), entries.clone());
        let rule = Keys::new(&centers(mesh, &mut noted, &mut spare));
        let (mut expected, mut expected_counts) = (entries.clone(), [0; 64]);
        for [key, id] in &mut expected {
            *key = rule.of(&Aabb::of(mesh.corners(*id).unwrap()).unwrap());
            expected_counts[(*key >> shift) as usize] += 1;
        }
        for level in SimdLevel::available() {
            let (mut entries, mut counts) = (noted.clone(), [0; 64]);
            let (all, counts_of) = (&mut *entries, &mut counts[..]);
            let keys =
                NewKeys { entries: all, spare: &spare, rule: &rule, shift, counts: counts_of };
            dispatch(level, keys);
            assert_eq!((entries, counts), (expected.clone(), expected_counts), "{level:?}");
        }
    }

    #[test]
    fn keys_are_those_of_each_triangle_alone() {
        let mut state = 1;
        let positions: Vec<[f32; 3]> =
            (0..90).map(|_| random::point(&mut state).to_array()).collect();
        // The last triangle has the last vertex, which is not read fast.
        let indices: Vec<[u32; 3]> = (0..30).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let mut parts = [MeshPart::new(mesh), MeshPart::new(mesh)];
        let joined = TriangleMesh::join(&mut parts).unwrap();
        for count in [1, 7, 8, 9, 16, 17, 30] {
            let ids: Vec<u32> = (0..count).map(|i| i * 7 % 30).collect();
            check(&mesh, &ids);
            let ids: Vec<u32> = (0..count).map(|i| i * 11 % 60).collect();
            check(&joined, &ids);
        }
    }
}
