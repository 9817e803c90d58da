//! The side of a plane on which a point of a ray lies, decided exactly for all finite f32 numbers.
//!
//! ```text
//! n = (b - a) x (c - a) = a x b + b x c + c x a
//! the line meets the plane at     T = n . (a - o) / n . d
//! so   T - t  has the sign of     n . (a - o - t d) / n . d
//!
//! n . d                = S(d)                                 S(x) = |b c x| + |c a x| + |a b x|
//! n . (a - o - t d)    = |a b c| - S(o) - t S(d)              |x y z|: the determinant
//! ```
//!
//! Every term is a product of up to four f32 numbers: an integer of 96 bits times a power of two. A
//! [`Sum`] adds such terms without rounding. It has as many bits as any of them needs.

use core::cmp::Ordering;

use crate::mesh::Triangle;

/// An f32 as `mantissa * 2^(exponent - 149)`.
#[derive(Debug, Clone, Copy)]
struct Number {
    mantissa: i32,
    exponent: u32,
}

impl Number {
    const ONE: Self = Self { mantissa: 1, exponent: 149 };

    const fn new(number: f32) -> Self {
        let bits = number.to_bits();
        let (power, fraction) = (bits >> 23 & 0xff, bits & 0x007f_ffff);
        let (magnitude, exponent) =
            if power == 0 { (fraction, 0) } else { (fraction | 0x0080_0000, power - 1) };
        let magnitude = magnitude.cast_signed();
        let mantissa = if bits >> 31 == 0 { magnitude } else { -magnitude };
        Self { mantissa, exponent }
    }

    const fn negated(self) -> Self {
        Self { mantissa: -self.mantissa, ..self }
    }
}

type Vector = [Number; 3];

#[inline(never)]
fn vector([x, y, z]: [f32; 3]) -> Vector {
    [Number::new(x), Number::new(y), Number::new(z)]
}

/// Four exponents of at most 254, 96 bits, and room for the sum of 42 terms.
const LIMBS: usize = 36;

/// A sum of products of four numbers, as an integer in units of 2^-596: 32 bits a limb, and room
/// for carries, which are left until the end.
struct Sum([i64; LIMBS]);

impl Sum {
    /// Adds `scale * x * y * z`. Out of line, as all functions here, to save code.
    #[inline(never)]
    fn add(&mut self, scale: Number, x: Number, y: Number, z: Number) {
        let factor = |number: Number| i128::from(number.mantissa);
        let product = factor(scale) * factor(x) * factor(y) * factor(z);
        let exponent = scale.exponent + x.exponent + y.exponent + z.exponent;
        let sign = if product < 0 { -1 } else { 1 };
        let mut rest = product.unsigned_abs();
        let limbs = self.0.get_mut((exponent / 32) as usize..).unwrap_or_default();
        for place in 0..3 {
            let Some([low, high]) = limbs.get_mut(place..).and_then(<[i64]>::first_chunk_mut)
            else {
                return;
            };
            let part = (rest & 0xffff_ffff) << (exponent % 32);
            #[expect(clippy::cast_possible_truncation, reason = "64 bits")]
            let part = part as u64;
            *low += sign * (part & 0xffff_ffff).cast_signed();
            *high += sign * (part >> 32).cast_signed();
            rest >>= 32;
        }
    }

    /// Adds a multiple of a determinant.
    #[inline(never)]
    fn add_determinant(&mut self, scale: Number, x: Vector, y: Vector, z: Vector) {
        if scale.mantissa == 0 {
            return;
        }
        let negated = scale.negated();
        self.add(scale, x[0], y[1], z[2]);
        self.add(scale, x[1], y[2], z[0]);
        self.add(scale, x[2], y[0], z[1]);
        self.add(negated, x[0], y[2], z[1]);
        self.add(negated, x[1], y[0], z[2]);
        self.add(negated, x[2], y[1], z[0]);
    }

    /// Adds a multiple of S(x): the product of the triangle's normal and a vector.
    #[inline(never)]
    fn add_normal_product(&mut self, scale: Number, [a, b, c]: [Vector; 3], x: Vector) {
        self.add_determinant(scale, b, c, x);
        self.add_determinant(scale, c, a, x);
        self.add_determinant(scale, a, b, x);
    }

    /// The sum compared with 0.
    #[inline(never)]
    fn sign(&self) -> Ordering {
        let (mut carry, mut rest) = (0, 0);
        for limb in &self.0 {
            let limb = limb + carry;
            rest |= limb & 0xffff_ffff;
            carry = limb >> 32;
        }
        // Carried, no limb is negative, so the carry out of the last one has the sign.
        if carry < 0 { Ordering::Less } else { (carry | rest).cmp(&0) }
    }
}

/// Compares the `t` at which a line meets a triangle's plane with `t`; `None` if the line is parallel to the plane or
/// the triangle has no area.
#[cold]
#[inline(never)]
pub(crate) fn compare(
    origin: [f32; 3],
    direction: [f32; 3],
    triangle: &Triangle,
    t: f32,
) -> Option<Ordering> {
    let corners @ [a, b, c] = [vector(triangle[0]), vector(triangle[1]), vector(triangle[2])];
    let (origin, direction) = (vector(origin), vector(direction));
    let mut along = Sum([0; LIMBS]);
    along.add_normal_product(Number::ONE, corners, direction);
    let mut ahead = Sum([0; LIMBS]);
    ahead.add_determinant(Number::ONE, a, b, c);
    ahead.add_normal_product(Number::ONE.negated(), corners, origin);
    ahead.add_normal_product(Number::new(t).negated(), corners, direction);
    match along.sign() {
        Ordering::Less => Some(ahead.sign().reverse()),
        Ordering::Equal => None,
        Ordering::Greater => Some(ahead.sign()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random;

    fn sum(terms: &[[f32; 4]]) -> Ordering {
        let mut sum = Sum([0; LIMBS]);
        for term in terms {
            let [a, b, c, d] = term.map(Number::new);
            sum.add(a, b, c, d);
        }
        sum.sign()
    }

    #[test]
    fn sums_have_the_sign_of_their_smallest_part() {
        let (huge, tiny) = (f32::MAX, f32::from_bits(1));
        assert_eq!(sum(&[]), Ordering::Equal);
        assert_eq!(sum(&[[huge; 4], [-huge, huge, huge, huge]]), Ordering::Equal);
        for sign in [1.0, -1.0] {
            let order = if sign > 0.0 { Ordering::Greater } else { Ordering::Less };
            let least = [tiny, tiny, tiny, sign * tiny];
            assert_eq!(sum(&[least]), order);
            assert_eq!(sum(&[[huge; 4], least, [huge, -huge, huge, huge]]), order);
            assert_eq!(sum(&[least, [huge, huge, huge, -sign * huge]]), order.reverse());
            // Add as many terms as there ever are, with carries everywhere.
            let mut many = alloc::vec![[huge, huge, huge, sign * huge]; 21];
            many.extend([[huge, -huge, huge, sign * huge]; 21]);
            assert_eq!(sum(&many), Ordering::Equal);
            many.push(least);
            assert_eq!(sum(&many), order);
            many.rotate_left(20);
            assert_eq!(sum(&many), order);
        }
    }

    /// Against whole numbers of 128 bits, at scales from the smallest to the largest.
    #[test]
    fn planes_are_where_whole_numbers_say() {
        let mut state = 1_u32;
        let mut number = |width: u32| {
            i16::try_from((random::next(&mut state) >> 8) % (2 * width + 1)).unwrap()
                - i16::try_from(width).unwrap()
        };
        let mut seen = [0; 4];
        for round in 0..20_000 {
            let width = [2, 4, 9, 100][round % 4];
            let mut vector = || [number(width), number(width), number(width)];
            let [a, b, c, o, d] = core::array::from_fn(|_| vector());
            let t = number(3);
            let wide = |v: [i16; 3]| v.map(i64::from);
            let minus = |a: [i16; 3], b: [i16; 3]| [0, 1, 2].map(|k| wide(a)[k] - wide(b)[k]);
            let (e, f) = (minus(b, a), minus(c, a));
            let n =
                [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
            let dot = |v: [i64; 3]| n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
            let slope = dot(wide(d));
            let height = dot([0, 1, 2].map(|k| minus(a, o)[k] - i64::from(t) * wide(d)[k]));
            let expected = (slope != 0).then(|| (height * slope.signum()).cmp(&0));
            for scale in [f32::from_bits(1), 1.0, 3.0, f32::from_bits(0x7800_0000)] {
                let float = |v: [i16; 3]| v.map(|x| f32::from(x) * scale);
                let found = compare(float(o), float(d), &[a, b, c].map(float), t.into());
                assert_eq!(found, expected, "{a:?} {b:?} {c:?} {o:?} {d:?} {t} {scale}");
            }
            seen[expected.map_or(3, |order| (order as i8 + 1).unsigned_abs().into())] += 1;
        }
        assert!(seen.iter().all(|&count| count > 200), "{seen:?}");
    }
}
