//! Gives the triangles of a crowded unit new keys ([`crowd_key`](super::crowd_key)).
//!
//! ```text
//! centers     read each triangle once: store min + max of its box, find the box around all centres
//! keys        choose one grid or two, by a sample of the centres
//! new keys    for eight triangles: keys of their centres; count the bin of each
//! sort        move each entry to the next place of its bin, in the memory of the centres, then all back
//!
//! min + max (twice the centre) is stored: z in the entry, x and y in two arrays
//! ```

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, u32x8};
use glam::Vec3A;

use crate::aabb::Aabb;
use crate::eight::LANES;
use crate::invariant::OrBug;
use crate::mesh::{TriangleMesh, WideMesh, vector};
use crate::simd::{HAS_VECTORS, Kernel};

use super::crowd_key::{CrowdKeys, CrowdPart};
use super::layout::Entry;
use super::subtree::slow_bounds;

/// Finds the box around the centres of the triangles' boxes. Stores min + max of each box (twice the centre): x and
/// y in the room for them, z in place of the key. Out of line: few units are crowded, and inlined it would slow down
/// all others.
#[inline(never)]
pub(crate) fn centers(mesh: &TriangleMesh<'_>, parts: &mut [CrowdPart<'_>]) -> Aabb {
    let wide = mesh.wide();
    let mut centers = Aabb::EMPTY;
    for CrowdPart { entries, xs, ys } in parts {
        debug_assert!(xs.len() >= entries.len() && ys.len() >= entries.len(), "too little room");
        for ((entry, x), y) in entries.iter_mut().zip(xs.iter_mut()).zip(ys.iter_mut()) {
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
    pub(crate) part: CrowdPart<'w>,
    pub(crate) rule: &'w CrowdKeys,
    /// Number of low key bits that do not choose a bin.
    pub(crate) shift: u32,
    pub(crate) counts: &'w mut [u32],
}

impl Kernel for NewKeys<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { part: CrowdPart { entries, xs, ys }, rule, shift, counts } = self;
        debug_assert!(xs.len() >= entries.len() && ys.len() >= entries.len(), "no centres");
        let stored = xs.chunks(LANES).zip(ys.chunks(LANES));
        for (entries, (xs, ys)) in entries.chunks_mut(LANES).zip(stored) {
            // Replace the stored z of each entry by its new key.
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
            // Count the bin of each key.
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
fn one_by_one(entries: &mut [Entry], [xs, ys]: [&[u32]; 2], rule: &CrowdKeys) {
    for ((entry, &x), &y) in entries.iter_mut().zip(xs).zip(ys) {
        let twice = [x, y, entry[0]].map(f32::from_bits);
        entry[0] = rule.of_twice(Vec3A::from_array(twice));
    }
}

/// Sorts the entries of a crowded unit by their bins; in a bin they keep their order. `heads` holds the place where
/// each bin starts, and afterwards where it ends. Each entry moves to its place in the room of the centres, and back
/// from there.
pub(crate) fn sort_by_bin(mut parts: [CrowdPart<'_>; 3], heads: &mut [u32], shift: u32) {
    let second = parts[0].entries.len();
    let third = second + parts[1].entries.len();
    let starts = [0, second, third];
    for from in 0..parts.len() {
        for at in 0..parts[from].entries.len() {
            let Some(&[key, id]) = parts[from].entries.get(at) else { break };
            let head = heads.get_mut((key >> shift) as usize).or_bug("a key without a bin");
            let Some(head) = head else { continue };
            // Chosen by number, not by a branch, which would often be mispredicted.
            let place = *head as usize;
            let part = usize::from(place >= second) + usize::from(place >= third);
            let place = place - starts[part];
            let CrowdPart { xs, ys, .. } = &mut parts[part];
            let slots = xs.get_mut(place).zip(ys.get_mut(place)).or_bug("a bin is too small");
            if let Some((x, y)) = slots {
                (*x, *y) = (key, id);
            }
            *head += 1;
        }
    }
    for CrowdPart { entries, xs, ys } in parts {
        for ((entry, x), y) in entries.iter_mut().zip(&*xs).zip(&*ys) {
            *entry = [*x, *y];
        }
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
    use crate::tasks::take;

    /// Checks keys and counts against those of each triangle alone.
    fn check(mesh: &TriangleMesh<'_>, ids: &[u32]) {
        let shift = 24;
        let entries: Vec<Entry> = ids.iter().map(|&id| [7, id]).collect();
        let (mut noted, mut xs, mut ys) = (entries.clone(), ids.to_vec(), ids.to_vec());
        let part = CrowdPart { entries: &mut noted, xs: &mut xs, ys: &mut ys };
        let mut parts = [part];
        let centers = centers(mesh, &mut parts);
        let rule = CrowdKeys::new(&parts, &centers);
        let (mut expected, mut expected_counts) = (entries.clone(), [0; 64]);
        for [key, id] in &mut expected {
            let Aabb { min, max } = Aabb::of(mesh.corners(*id).unwrap()).unwrap();
            *key = rule.of_twice(min + max);
            expected_counts[(*key >> shift) as usize] += 1;
        }
        for level in SimdLevel::available() {
            let (mut entries, mut counts) = (noted.clone(), [0; 64]);
            let part = CrowdPart { entries: &mut entries, xs: &mut xs, ys: &mut ys };
            let keys = NewKeys { part, rule: &rule, shift, counts: &mut counts };
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

    #[test]
    fn entries_are_sorted_by_their_bins() {
        let mut state = 1;
        for count in [0, 1, 2, 3, 50, 1000] {
            let mut entries: Vec<Entry> =
                (0..count).map(|id| [random::next(&mut state) >> 27, id]).collect();
            let mut heads = [0; 16];
            for [key, _] in &entries {
                heads.iter_mut().skip((key >> 1) as usize + 1).for_each(|head| *head += 1);
            }
            let mut expected = entries.clone();
            expected.sort_by_key(|[key, _]| key >> 1);
            let (mut xs, mut ys) = (alloc::vec![0; entries.len()], alloc::vec![0; entries.len()]);
            let (count, mut rest) = (entries.len(), (&mut entries[..], &mut xs[..], &mut ys[..]));
            let parts = [count / 3, count / 5, count - count / 3 - count / 5].map(|count| {
                let (entries, xs, ys) = &mut rest;
                let [xs, ys] = [take(xs, count), take(ys, count)];
                CrowdPart { entries: take(entries, count), xs, ys }
            });
            sort_by_bin(parts, &mut heads, 1);
            assert_eq!(entries, expected);
        }
    }
}
