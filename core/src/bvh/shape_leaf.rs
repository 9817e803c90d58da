//! Leaves of a tree over shapes: tests a ray against the boxes of up to eight shapes, as it is tested against
//! the children of a node. [`walk`](super::walk) has this test with vectors, and that of triangles.
//!
//! A box is six numbers in the caller's memory, not quantised, so it has no margin of its own. Each side is
//! subtracted and multiplied with two roundings, which the wider inverse of far sides absorbs
//! ([`slab`](super::slab)). The inverse of a zero direction is finite, so a ray along a side would cross it at
//! distance 0: [`pad_of`] moves the crossing behind the tree.

use fearless_simd::{Simd, f32x4, f32x8};

use super::node::WIDTH;
use super::slab::{SlabRay, flips_of};
use crate::aabb::{Aabb, greater, lesser};
use crate::eight::{RowBytes, join, load, transpose};
use crate::extremes::Extremes;
use crate::mesh::{BOX_BYTES, TriangleMesh};
use crate::ray::INVALID_ID;

/// The least and the greatest corners of the boxes of a leaf. Unused lanes repeat other boxes.
#[inline(always)]
pub(super) fn boxes_of_leaf<S: Simd>(
    simd: S,
    mesh: &TriangleMesh<'_>,
    ids: &[u32],
) -> ([f32x8<S>; 3], [f32x8<S>; 3]) {
    let first = four(simd, mesh, ids);
    // Most leaves have four shapes or fewer: read no more.
    let ([a, b, c], [d, e, f]) = match ids.get(WIDTH / 2..) {
        Some(rest) if !rest.is_empty() => {
            let last = four(simd, mesh, rest);
            (join(first.0, last.0), join(first.1, last.1))
        }
        _ => (join(first.0, first.0), join(first.1, first.1)),
    };
    // Corners may come in any order.
    ([a.lesser(d), b.lesser(e), c.lesser(f)], [a.greater(d), b.greater(e), c.greater(f)])
}

/// The two corners of the first four boxes; of the last again where there are fewer.
#[inline(always)]
fn four<S: Simd>(simd: S, mesh: &TriangleMesh<'_>, ids: &[u32]) -> ([f32x4<S>; 3], [f32x4<S>; 3]) {
    let wide = mesh.wide();
    let last = ids.len().saturating_sub(1);
    let rows = |place: usize| {
        let id = ids.get(place.min(last)).copied().unwrap_or(INVALID_ID);
        let sides = wide.sides(id).or_else(|| mesh.box_bytes(id)).unwrap_or(&[0; BOX_BYTES]);
        let [first, last] = box_rows(sides);
        (load(simd, &first), load(simd, &last))
    };
    let (a, b, c, d) = (rows(0), rows(1), rows(2), rows(3));
    let [x, y, z, _] = transpose([a.0, b.0, c.0, d.0]);
    let [_, far_x, far_y, far_z] = transpose([a.1, b.1, c.1, d.1]);
    ([x, y, z], [far_x, far_y, far_z])
}

/// A box as two rows of four numbers that overlap: x y z X and z X Y Z.
#[inline(always)]
fn box_rows(sides: &[u8; BOX_BYTES]) -> [RowBytes; 2] {
    let rows = sides.first_chunk().zip(sides.last_chunk());
    rows.map_or([[0; 16]; 2], |(first, last)| [*first, *last])
}

/// 2^-40.
const PAD: f32 = 1.0 / (1_048_576.0 * 1_048_576.0);

/// Returns the distance by which the sides of boxes are moved outwards: 2^-40 of the tree's extent. Times the steepest
/// inverse, it is a distance far behind the tree.
#[inline(always)]
pub(super) fn pad_of(bounds: &Aabb) -> f32 {
    (bounds.size().max_element() * PAD).max(f32::MIN_POSITIVE)
}

/// Intersects a ray with the boxes of a leaf one by one, for machines without vectors. Returns a mask of the boxes that
/// it meets before its end, and the entry distances.
#[inline(never)]
pub(super) fn meet_leaf(
    ray: &SlabRay,
    mesh: &TriangleMesh<'_>,
    ids: &[u32],
    pad: f32,
    end: f32,
) -> (u32, [f32; WIDTH]) {
    let flips = flips_of(ray);
    let (origin_near, origin_far) = (ray.origin_near.to_array(), ray.origin_far.to_array());
    let (inverse, inverse_far) = (ray.inverse.to_array(), ray.inverse_far().to_array());
    let (mut met, mut nearest) = (0, [0.0; WIDTH]);
    for (lane, (&id, nearest)) in ids.iter().zip(&mut nearest).enumerate() {
        let Some([a, b, _]) = mesh.triangle(id) else { continue };
        let (mut near, mut far) = (ray.start, end);
        for axis in 0..3 {
            let (low, high) = (lesser(a[axis], b[axis]), greater(a[axis], b[axis]));
            let (first, last) = if flips[axis] == 0 { (low, high) } else { (high, low) };
            let pad = inverse_far[axis].abs() * pad;
            near = greater((first - origin_near[axis]) * inverse[axis] - pad, near);
            far = lesser((last - origin_far[axis]) * inverse_far[axis] + pad, far);
        }
        *nearest = near;
        let is_missed = near > far;
        met |= u32::from(!is_missed) << lane;
    }
    (met, nearest)
}

/// The nearest of the boxes that are met, the first of equals.
#[inline(always)]
pub(super) fn nearest_of(met: u32, near: &[f32; WIDTH]) -> usize {
    let mut nearest = met.trailing_zeros() as usize;
    let mut rest = met & met.wrapping_sub(1);
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize;
        rest &= rest - 1;
        if near[lane % WIDTH] < near[nearest % WIDTH] {
            nearest = lane;
        }
    }
    nearest
}
