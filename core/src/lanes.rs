//! Numbers that the [`filter`](crate::filter) works on: one f32, or eight.

use core::ops::{Add, Mul, Sub};

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, mask32x8};

use crate::aabb::{greater, lesser};
use crate::extremes::Extremes;

/// One number, or one in each of eight lanes.
pub(crate) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// An answer in each lane.
    type Mask;

    fn magnitude(self) -> Self;

    /// Multiplies by a number and adds another; fused where the machine does both at once.
    fn times_plus(self, factor: Self, summand: Self) -> Self;

    /// Multiplies by a number and subtracts another; fused likewise.
    fn times_minus(self, factor: Self, subtrahend: Self) -> Self;

    /// The greater of two numbers. With a NaN among them it is any number or NaN.
    fn or_greater(self, other: Self) -> Self;

    /// Returns true if one of three numbers is below `-error` and one above `error`. `edges[2]` is NaN if one of the
    /// others is, and then the answer is false.
    fn are_opposite(edges: [Self; 3], error: Self) -> Self::Mask;
}

impl Lanes for f32 {
    type Mask = bool;

    #[inline(always)]
    fn magnitude(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, summand: Self) -> Self {
        self * factor + summand
    }

    #[inline(always)]
    fn times_minus(self, factor: Self, subtrahend: Self) -> Self {
        self * factor - subtrahend
    }

    #[inline(always)]
    fn or_greater(self, other: Self) -> Self {
        greater(self, other)
    }

    #[inline(always)]
    fn are_opposite([u, v, w]: [Self; 3], error: Self) -> bool {
        // `lesser` and `greater` give the second number if either is NaN, so a NaN in w is left out.
        lesser(w, lesser(u, v)) < -error && greater(w, greater(u, v)) > error
    }
}

impl<S: Simd> Lanes for f32x8<S> {
    type Mask = mask32x8<S>;

    #[inline(always)]
    fn magnitude(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, summand: Self) -> Self {
        self.mul_add(factor, summand)
    }

    #[inline(always)]
    fn times_minus(self, factor: Self, subtrahend: Self) -> Self {
        self.mul_sub(factor, subtrahend)
    }

    #[inline(always)]
    fn or_greater(self, other: Self) -> Self {
        self.greater(other)
    }

    #[inline(always)]
    fn are_opposite([u, v, w]: [Self; 3], error: Self) -> mask32x8<S> {
        // With a NaN among them, both are a NaN or the same number: one comparison is false.
        w.lesser(u.lesser(v)).simd_lt(-error) & w.greater(u.greater(v)).simd_gt(error)
    }
}
