//! Compares the division routines for processors without a divide instruction with the processor's own division.

#[path = "../../capi/src/division.rs"]
mod shared;

use hgrid_tests::random::Random;
use shared::{divide, divide_signed};

/// Returns numbers of all sizes, among them those at the ends.
fn numbers() -> Vec<u64> {
    let mut random = Random(3);
    let mut all = vec![0, 1, 2, 3, u64::MAX, u64::MAX - 1, 1 << 63, (1 << 63) - 1, (1 << 63) + 1];
    for bits in 1..=64 {
        all.extend((0..4).map(|_| (random.bits() | 1 << 63) >> (64 - bits)));
    }
    all
}

#[test]
fn quotients_and_rests_are_those_of_the_processor() {
    for dividend in numbers() {
        for divisor in numbers().into_iter().filter(|&divisor| divisor != 0) {
            let expected = [dividend / divisor, dividend % divisor];
            assert_eq!(divide(dividend, divisor), expected, "{dividend} / {divisor}");
            let [a, b] = [dividend, divisor].map(u64::cast_signed);
            let expected = [a.wrapping_div(b), a.wrapping_rem(b)];
            assert_eq!(divide_signed(a, b), expected, "{a} / {b}");
        }
        // A division by zero has no defined result, but the function must return.
        let _ = divide(dividend, 0);
    }
}
