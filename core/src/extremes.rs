//! The lesser and the greater numbers of two vectors, by the quickest instruction of each machine.
//!
//! WebAssembly has two pairs of instructions. `f32x4.min` and `f32x4.max` keep every NaN, which takes an x86
//! processor seven instructions; `f32x4.pmin` and `f32x4.pmax` compare and choose, as x86 does in one. Slab tests
//! are made of these operations.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8, f32x16};

/// Chooses between the numbers of two vectors, lane by lane. Where one of them is a NaN, the result is either, or a
/// NaN; on x86 and in WebAssembly it is the one of `other`.
pub(crate) trait Extremes {
    fn lesser(self, other: Self) -> Self;
    fn greater(self, other: Self) -> Self;
}

/// Vectors that the machine has, or that it takes apart by itself.
#[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
macro_rules! implement {
    ($($vector:ident)*) => {$(
        impl<S: Simd> Extremes for $vector<S> {
            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                self.min(other)
            }

            #[inline(always)]
            fn greater(self, other: Self) -> Self {
                self.max(other)
            }
        }
    )*};
}

/// Vectors of four lanes, and those that are two of half their length.
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
macro_rules! implement {
    ($four:ident $($vector:ident)*) => {
        impl<S: Simd> Extremes for $four<S> {
            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                lanes(self.simd, f32x4_pmin(vector(other), vector(self)))
            }

            #[inline(always)]
            fn greater(self, other: Self) -> Self {
                lanes(self.simd, f32x4_pmax(vector(other), vector(self)))
            }
        }

        $(impl<S: Simd> Extremes for $vector<S> {
            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                let ((a, b), (c, d)) = (self.split(), other.split());
                a.lesser(c).combine(b.lesser(d))
            }

            #[inline(always)]
            fn greater(self, other: Self) -> Self {
                let ((a, b), (c, d)) = (self.split(), other.split());
                a.greater(c).combine(b.greater(d))
            }
        })*
    };
}

implement!(f32x4 f32x8 f32x16);

#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use core::arch::wasm32::{f32x4 as four, f32x4_extract_lane, f32x4_pmax, f32x4_pmin, v128};

/// Lane by lane in the source; the compiler makes no instruction of it.
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
#[inline(always)]
fn vector<S: Simd>(lanes: f32x4<S>) -> v128 {
    let [a, b, c, d]: [f32; 4] = lanes.into();
    four(a, b, c, d)
}

#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
#[inline(always)]
fn lanes<S: Simd>(simd: S, vector: v128) -> f32x4<S> {
    let [a, b] = [f32x4_extract_lane::<0>(vector), f32x4_extract_lane::<1>(vector)];
    let [c, d] = [f32x4_extract_lane::<2>(vector), f32x4_extract_lane::<3>(vector)];
    f32x4::simd_from(simd, [a, b, c, d])
}
