//! The lesser and the greater numbers of two vectors, by the quickest instruction of each machine.
//!
//! WebAssembly has two pairs of instructions. `f32x4.min` and `f32x4.max` keep every NaN, which takes an x86
//! processor seven instructions; `f32x4.pmin` and `f32x4.pmax` compare and choose, as x86 does in one. Slab tests
//! are made of these operations.

#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use core::arch::wasm32::{f32x4 as four, f32x4_extract_lane, f32x4_pmax, f32x4_pmin, v128};

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8, f32x16};

#[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
use crate::aabb::{greater, lesser};
#[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
use crate::simd::{HAS_VECTORS, inline_unless_small};

/// Chooses between the numbers of two vectors, lane by lane. Where one of them is a NaN, the result is the one of
/// `other`; with the vectors of Arm it is either, or a NaN.
pub(crate) trait Extremes {
    fn lesser(self, other: Self) -> Self;
    fn greater(self, other: Self) -> Self;
}

/// Vectors of any length: `fearless_simd` splits those that are too long for the machine.
#[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
macro_rules! implement {
    ($($vector:ident)*) => {$(
        impl<S: Simd> Extremes for $vector<S> {
            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                if HAS_VECTORS {
                    return self.min(other);
                }
                let (simd, mut lanes) = (self.simd, self.into());
                keep_lesser(&mut lanes, &other.into());
                Self::simd_from(simd, lanes)
            }

            #[inline(always)]
            fn greater(self, other: Self) -> Self {
                if HAS_VECTORS {
                    return self.max(other);
                }
                let (simd, mut lanes) = (self.simd, self.into());
                keep_greater(&mut lanes, &other.into());
                Self::simd_from(simd, lanes)
            }
        }
    )*};
}

#[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
inline_unless_small! {
    /// Chooses without vectors. `f32::min` also decides what a NaN gives, and takes three times the code.
    fn keep_lesser<const N: usize>(lanes: &mut [f32; N], others: &[f32; N]) {
        for (lane, &other) in lanes.iter_mut().zip(others) {
            *lane = lesser(*lane, other);
        }
    }

    fn keep_greater<const N: usize>(lanes: &mut [f32; N], others: &[f32; N]) {
        for (lane, &other) in lanes.iter_mut().zip(others) {
            *lane = greater(*lane, other);
        }
    }
}

/// Vectors of four lanes, and longer ones, which are split in halves.
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

/// The same lanes as a vector of the machine; this compiles to nothing.
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

#[cfg(test)]
#[cfg(not(target_arch = "aarch64"))]
mod tests {
    use super::*;
    use crate::simd::{HAS_VECTORS, Kernel, SimdLevel, dispatch};

    struct Both([f32; 16], [f32; 16]);

    impl Kernel for Both {
        type Output = [[f32; 16]; 2];

        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let [one, other] = [self.0, self.1].map(|lanes| f32x16::simd_from(simd, lanes));
            [one.lesser(other).into(), one.greater(other).into()]
        }
    }

    #[test]
    fn what_is_no_number_gives_the_other_operand() {
        let numbers = [-1.0, -0.0, 0.0, 2.0, f32::NAN];
        let is_quick = |&level: &SimdLevel| level > SimdLevel::Scalar || !HAS_VECTORS;
        for level in SimdLevel::available().filter(is_quick) {
            for a in numbers {
                for b in numbers {
                    let [least, most] = dispatch(level, Both([a; 16], [b; 16]));
                    let expected = [if a < b { a } else { b }, if a > b { a } else { b }];
                    for (found, expected) in [least, most].into_iter().zip(expected) {
                        assert_eq!(found.map(f32::to_bits), [expected.to_bits(); 16], "{a} {b}");
                    }
                }
            }
        }
    }
}
