//! Division of whole numbers bit by bit, as on paper, for processors that cannot divide.

/// The quotient and the rest. A divisor of 0 gives a quotient without meaning, and no trap.
pub(crate) fn divide(dividend: u64, divisor: u64) -> [u64; 2] {
    // The rest is below the divisor, so twice the rest and a bit may need one bit more than there are.
    let (mut quotient, mut rest) = (0, 0_u64);
    for bit in (0..u64::BITS - dividend.leading_zeros()).rev() {
        let has_carry = rest >> 63 != 0;
        rest = rest << 1 | dividend >> bit & 1;
        if has_carry || rest >= divisor {
            rest = rest.wrapping_sub(divisor);
            quotient |= 1 << bit;
        }
    }
    [quotient, rest]
}

/// [`divide`] with signs: the quotient is rounded towards 0, and the rest has the dividend's sign.
pub(crate) fn divide_signed(dividend: i64, divisor: i64) -> [i64; 2] {
    let [quotient, rest] = divide(dividend.unsigned_abs(), divisor.unsigned_abs());
    let sign = |value: u64, is_negative| {
        if is_negative { value.wrapping_neg().cast_signed() } else { value.cast_signed() }
    };
    [sign(quotient, (dividend < 0) != (divisor < 0)), sign(rest, dividend < 0)]
}
