//! Rows: one number for each ray of a group, in vectors of eight or sixteen rays.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f32x16};
use zerocopy::{transmute_mut, transmute_ref};

use crate::extremes::Extremes;

/// Rays of a group, at most.
pub(crate) const GROUP: usize = 64;
/// Vectors of eight rays.
pub(super) const OCTETS: usize = GROUP / 8;

/// A row: one number for each ray.
pub(super) type PerRay = [[f32; 8]; OCTETS];

/// The least and the greatest number of a row.
#[inline(always)]
pub(super) fn interval<S: Simd>(simd: S, row: &PerRay) -> [f32; 2] {
    let first = f32x8::simd_from(simd, row[0]);
    let (mut low, mut high) = (first, first);
    for octet in row.iter().skip(1) {
        let numbers = f32x8::simd_from(simd, *octet);
        (low, high) = (low.lesser(numbers), high.greater(numbers));
    }
    [low.reduce_min(), high.reduce_max()]
}

/// Eight rays of three rows.
#[inline(always)]
pub(super) fn octet_of<S: Simd>(simd: S, rows: &[PerRay; 3], octet: usize) -> [f32x8<S>; 3] {
    let octet = octet % OCTETS;
    let [a, b, c] = rows;
    [
        f32x8::simd_from(simd, a[octet]),
        f32x8::simd_from(simd, b[octet]),
        f32x8::simd_from(simd, c[octet]),
    ]
}

/// Sixteen rays of a row.
#[inline(always)]
pub(super) fn sixteen<S: Simd>(simd: S, row: &PerRay, which: usize) -> f32x16<S> {
    let rows: &[[f32; 16]; OCTETS / 2] = transmute_ref!(row);
    f32x16::simd_from(simd, rows[which % (OCTETS / 2)])
}

/// Sets the number of a ray.
#[inline(always)]
pub(super) fn put(row: &mut PerRay, ray: u32, number: f32) {
    let row: &mut [f32; GROUP] = transmute_mut!(row);
    row[ray as usize % GROUP] = number;
}

/// The number of a ray.
#[inline(always)]
pub(super) fn get(row: &PerRay, ray: u32) -> f32 {
    // Use a flat array, which takes one index, not two.
    let row: &[f32; GROUP] = transmute_ref!(row);
    row[ray as usize % GROUP]
}
