//! The census: the key of every triangle, how many fall into each bin, and the box around all triangles.
//!
//! ```text
//! for each task:              a share of the triangles, and counts of its own
//!     for eight triangles:    load corners; find boxes; keys of their centres; count the bin of each key
//! ```

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8};
use glam::Vec3A;

use crate::aabb::Aabb;
use crate::config::BuildFlags;
use crate::control::Control;
use crate::error::Error;
use crate::extremes::Extremes;
use crate::invariant::OrBug;
use crate::mesh::Piece;
use crate::mesh::TriangleMesh;
use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};
use crate::spans::eight;
use crate::survey::finite_box;
use crate::tasks::{run, share, take};

use super::key::{KEY_BITS, Keys, NO_KEY};

/// The totals of a census; keys and counts are in the caller's arrays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Census {
    /// Triangles that go into the tree.
    pub(crate) finite: u32,
    /// The box around those in the tree.
    pub(crate) bounds: Aabb,
}

/// A task: some triangles, room for their keys, and its counts.
struct KeysTask<'w> {
    mesh: &'w TriangleMesh<'w>,
    flags: BuildFlags,
    rule: &'w Keys,
    first: u32,
    keys: &'w mut [u32],
    counts: &'w mut [u32],
    shift: u32,
    skipped: u32,
    bounds: Aabb,
}

/// Fills in the keys of all triangles. Counts the triangles of each bin, for each task by itself: the counts of one
/// task follow those of another.
pub(crate) fn count(
    mesh: &TriangleMesh<'_>,
    flags: BuildFlags,
    rule: &Keys,
    keys: &mut [u32],
    counts: &mut [u32],
    bits: u32,
    control: &Control<'_>,
) -> Result<Census, Error> {
    let tasks = counts.len() >> bits;
    let triangles = keys.len();
    let (mut rest, mut all_counts) = (keys, counts);
    let parts = (0..tasks).map(|task| {
        let counts = take(&mut all_counts, 1 << bits);
        let share = share(triangles, task, tasks);
        let keys = take(&mut rest, share.len());
        #[expect(clippy::cast_possible_truncation, reason = "numbers of triangles")]
        let first = share.start as u32;
        let (skipped, bounds) = (0, Aabb::EMPTY);
        KeysTask { mesh, flags, rule, first, keys, counts, shift: KEY_BITS - bits, skipped, bounds }
    });
    let level = SimdLevel::detect();
    let mut census = Census { finite: mesh.triangle_count(), bounds: Aabb::EMPTY };
    run(
        control,
        parts,
        |part| dispatch(level, part),
        |result| {
            let (skipped, bounds) = result?;
            census.finite -= skipped;
            census.bounds = census.bounds.union(&bounds);
            Ok(())
        },
    )?;
    Ok(census)
}

impl Kernel for KeysTask<'_> {
    type Output = Result<(u32, Aabb), Error>;

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Self::Output {
        let mut low = [f32x8::splat(simd, f32::INFINITY); 3];
        let mut high = [f32x8::splat(simd, f32::NEG_INFINITY); 3];
        let mut all_keys = core::mem::take(&mut self.keys);
        #[expect(clippy::cast_possible_truncation, reason = "triangles of the mesh")]
        let end = self.first + all_keys.len() as u32;
        for piece in self.mesh.pieces(self.first..end) {
            let wide = piece.mesh.wide();
            let keys = take(&mut all_keys, piece.triangles.len());
            let mut first = piece.triangles.start;
            let (eights, rest) = keys.as_chunks_mut::<8>();
            for keys in eights {
                let mut is_done = false;
                if HAS_VECTORS {
                    // Load the corners of eight triangles.
                    let ([a, b, c], is_finite) = eight(simd, &wide, first);
                    if is_finite.all_true() {
                        // Find their boxes, and grow the box of all.
                        let min = [
                            a[0].lesser(b[0]).lesser(c[0]),
                            a[1].lesser(b[1]).lesser(c[1]),
                            a[2].lesser(b[2]).lesser(c[2]),
                        ];
                        let max = [
                            a[0].greater(b[0]).greater(c[0]),
                            a[1].greater(b[1]).greater(c[1]),
                            a[2].greater(b[2]).greater(c[2]),
                        ];
                        low = [low[0].lesser(min[0]), low[1].lesser(min[1]), low[2].lesser(min[2])];
                        high = [
                            high[0].greater(max[0]),
                            high[1].greater(max[1]),
                            high[2].greater(max[2]),
                        ];
                        // Write the keys, and count the bin of each.
                        let twice = [min[0] + max[0], min[1] + max[1], min[2] + max[2]];
                        *keys = self.rule.of_eight(simd, twice).into();
                        for key in &*keys {
                            self.add(*key);
                        }
                        is_done = true;
                    }
                }
                // One by one if a corner is not finite or the triangles cannot be read as vectors.
                if !is_done {
                    self.one_by_one(&piece, first, keys)?;
                }
                first = first.wrapping_add(8);
            }
            self.one_by_one(&piece, first, rest)?;
        }
        debug_assert!(all_keys.is_empty(), "a triangle got no key");
        let least = |lanes: [f32; 8]| lanes.into_iter().fold(f32::INFINITY, f32::min);
        let most = |lanes: [f32; 8]| lanes.into_iter().fold(f32::NEG_INFINITY, f32::max);
        let low = low.map(|lanes| least(lanes.into()));
        let high = high.map(|lanes| most(lanes.into()));
        let bounds = Aabb { min: Vec3A::from_array(low), max: Vec3A::from_array(high) };
        Ok((self.skipped, self.bounds.union(&bounds)))
    }
}

impl KeysTask<'_> {
    #[inline(always)]
    fn add(&mut self, key: u32) {
        let count = self.counts.get_mut((key >> self.shift) as usize);
        if let Some(count) = count.or_bug("a key behind those of all bins") {
            *count += 1;
        }
    }

    /// Finds the keys of triangles one by one.
    #[inline(never)]
    fn one_by_one(&mut self, piece: &Piece<'_>, first: u32, keys: &mut [u32]) -> Result<(), Error> {
        for (own, key) in (first..).zip(keys) {
            let corners = piece.mesh.own_corners(own);
            if let Some(bounds) = finite_box(piece.first + own, corners, self.flags)? {
                self.bounds = self.bounds.union(&bounds);
                *key = self.rule.of(&bounds);
                self.add(*key);
            } else {
                *key = NO_KEY;
                self.skipped += 1;
            }
        }
        Ok(())
    }
}
