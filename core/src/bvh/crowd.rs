//! Reads the triangles of a crowded unit: first the box around their centres, then their keys in that box.

use fearless_simd::{Simd, f32x4, f32x8};

use crate::aabb::Aabb;
use crate::eight::{LANES, corner, join, load};
use crate::extremes::Extremes;
use crate::invariant::OrBug;
use crate::mesh::{TriangleMesh, WideMesh, vector};
use crate::simd::{HAS_VECTORS, Kernel};

use super::key::Keys;
use super::layout::Entry;
use super::subtree::slow_bounds;

/// Finds the box around the centres of the triangles' boxes.
pub(crate) fn centers(mesh: &TriangleMesh<'_>, entries: &[Entry]) -> Aabb {
    let wide = mesh.wide();
    let mut centers = Aabb::EMPTY;
    for entry in entries {
        let Aabb { min, max } = bounds(mesh, &wide, entry[1]);
        let center = (min + max) * 0.5;
        centers.min = centers.min.min(center);
        centers.max = centers.max.max(center);
    }
    centers
}

/// Gives entries new keys, and counts those of each bin.
pub(crate) struct NewKeys<'w> {
    pub(crate) mesh: &'w TriangleMesh<'w>,
    pub(crate) entries: &'w mut [Entry],
    pub(crate) rule: &'w Keys,
    /// Lower bits of a key, which do not choose a bin.
    pub(crate) shift: u32,
    pub(crate) counts: &'w mut [u32],
}

impl Kernel for NewKeys<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { mesh, entries, rule, shift, counts } = self;
        let wide = mesh.wide();
        for entries in entries.chunks_mut(LANES) {
            if let Some([min, max]) = eight(simd, &wide, entries) {
                let keys: [u32; LANES] = rule.of_eight(simd, min, max).into();
                for (entry, key) in entries.iter_mut().zip(keys) {
                    entry[0] = key;
                }
            } else {
                one_by_one(mesh, entries, rule);
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

/// Gives new keys to entries that are fewer than eight, or cannot be read fast.
#[inline(never)]
fn one_by_one(mesh: &TriangleMesh<'_>, entries: &mut [Entry], rule: &Keys) {
    for entry in entries {
        entry[0] = rule.of(&slow_bounds(mesh, entry[1]));
    }
}

/// The least and the greatest corners of the boxes of eight triangles; `None` if there are fewer, or if some cannot
/// be read fast.
#[inline(always)]
fn eight<S: Simd>(simd: S, wide: &WideMesh<'_>, entries: &[Entry]) -> Option<[[f32x8<S>; 3]; 2]> {
    if !HAS_VECTORS {
        return None;
    }
    let [a, b, c, d, e, f, g, h] = entries.first_chunk::<LANES>()?;
    let (a, b) = (one(simd, wide, a)?, one(simd, wide, b)?);
    let (c, d) = (one(simd, wide, c)?, one(simd, wide, d)?);
    let (e, f) = (one(simd, wide, e)?, one(simd, wide, f)?);
    let (g, h) = (one(simd, wide, g)?, one(simd, wide, h)?);
    let min = join(corner([a[0], b[0], c[0], d[0]]), corner([e[0], f[0], g[0], h[0]]));
    let max = join(corner([a[1], b[1], c[1], d[1]]), corner([e[1], f[1], g[1], h[1]]));
    Some([min, max])
}

/// The least and the greatest corner of the box of a triangle.
#[inline(always)]
fn one<S: Simd>(simd: S, wide: &WideMesh<'_>, entry: &Entry) -> Option<[f32x4<S>; 2]> {
    let [a, b, c] = wide.corners(entry[1])?;
    let (a, b, c) = (load(simd, a), load(simd, b), load(simd, c));
    Some([a.lesser(b).lesser(c), a.greater(b).greater(c)])
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
    use crate::simd::{SimdLevel, dispatch};

    /// Numbers from -1 to 1.
    fn random(state: &mut u32) -> f32 {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        #[expect(clippy::cast_precision_loss, reason = "24 bits")]
        let unit = (*state >> 8) as f32 / 8_388_608.0;
        unit - 1.0
    }

    /// Checks keys and counts against those of each triangle alone.
    fn check(mesh: &TriangleMesh<'_>, ids: &[u32]) {
        let shift = 24;
        let entries: Vec<Entry> = ids.iter().map(|&id| [7, id]).collect();
        let rule = Keys::new(&centers(mesh, &entries));
        let (mut expected, mut expected_counts) = (entries.clone(), [0; 64]);
        for [key, id] in &mut expected {
            *key = rule.of(&Aabb::of(mesh.corners(*id).unwrap()).unwrap());
            expected_counts[(*key >> shift) as usize] += 1;
        }
        for level in SimdLevel::available() {
            let (mut entries, mut counts) = (entries.clone(), [0; 64]);
            let (all, counts_of) = (&mut *entries, &mut counts[..]);
            let keys = NewKeys { mesh, entries: all, rule: &rule, shift, counts: counts_of };
            dispatch(level, keys);
            assert_eq!((entries, counts), (expected.clone(), expected_counts), "{level:?}");
        }
    }

    #[test]
    fn keys_are_those_of_each_triangle_alone() {
        let mut state = 1;
        let positions: Vec<[f32; 3]> =
            (0..90).map(|_| [0; 3].map(|_| random(&mut state))).collect();
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
