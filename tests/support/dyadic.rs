//! Numbers that are never rounded: an integer of any size times a power of two.

use std::cmp::Ordering;
use std::ops::{Add, Mul, Neg, Sub};

use num_bigint::{BigInt, Sign};

/// `number * 2^exponent`.
#[derive(Debug, Clone)]
pub struct Dyadic {
    number: BigInt,
    exponent: i32,
}

impl Dyadic {
    /// Returns a finite f64, exactly.
    ///
    /// # Panics
    /// If it is not finite.
    #[must_use]
    pub fn new(number: f64) -> Self {
        assert!(number.is_finite(), "{number}");
        let bits = number.to_bits();
        let (power, fraction) = ((bits >> 52 & 0x7ff) as i32, bits & ((1 << 52) - 1));
        let (magnitude, exponent) =
            if power == 0 { (fraction, -1074) } else { (fraction | 1 << 52, power - 1075) };
        let sign = if bits >> 63 == 0 { Sign::Plus } else { Sign::Minus };
        Self { number: BigInt::from_biguint(sign, magnitude.into()), exponent }
    }

    /// Returns the number times a power of two.
    #[must_use]
    pub fn scaled(mut self, power: i32) -> Self {
        self.exponent += power;
        self
    }

    /// Returns the absolute value.
    #[must_use]
    pub fn abs(self) -> Self {
        if self.sign() == Ordering::Less { -self } else { self }
    }

    /// Compares the number with 0.
    #[must_use]
    pub fn sign(&self) -> Ordering {
        match self.number.sign() {
            Sign::Minus => Ordering::Less,
            Sign::NoSign => Ordering::Equal,
            Sign::Plus => Ordering::Greater,
        }
    }

    fn sum(&self, other: &Self) -> Self {
        let exponent = self.exponent.min(other.exponent);
        let at = |number: &Self| &number.number << (number.exponent - exponent);
        Self { number: at(self) + at(other), exponent }
    }
}

impl Add for &Dyadic {
    type Output = Dyadic;

    fn add(self, other: Self) -> Dyadic {
        self.sum(other)
    }
}

impl Sub for &Dyadic {
    type Output = Dyadic;

    fn sub(self, other: Self) -> Dyadic {
        self.sum(&-other.clone())
    }
}

impl Mul for &Dyadic {
    type Output = Dyadic;

    fn mul(self, other: Self) -> Dyadic {
        Dyadic { number: &self.number * &other.number, exponent: self.exponent + other.exponent }
    }
}

impl Neg for Dyadic {
    type Output = Self;

    fn neg(self) -> Self {
        Self { number: -self.number, exponent: self.exponent }
    }
}

impl PartialEq for Dyadic {
    fn eq(&self, other: &Self) -> bool {
        (self - other).sign() == Ordering::Equal
    }
}

impl PartialOrd for Dyadic {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some((self - other).sign())
    }
}

#[test]
fn dyadics_are_exact() {
    let [one, tiny, third] = [1.0, f64::from_bits(1), 1.0 / 3.0].map(Dyadic::new);
    assert!(&one + &tiny > one && &(&one + &tiny) - &one == tiny);
    // Three times the f64 nearest to a third is not exactly 1.
    let three = Dyadic::new(3.0);
    assert_eq!((&(&three * &third) - &one).scaled(54), Dyadic::new(-1.0));
    assert_eq!(Dyadic::new(-2.5).abs(), Dyadic::new(5.0).scaled(-1));
    assert_eq!(Dyadic::new(-0.0).sign(), Ordering::Equal);
}
