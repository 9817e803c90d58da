//! Random numbers with the same bits everywhere: a sequence, and a field over space.
//!
//! Both use one 64-bit mixer (`SplitMix64`, Steele, Lea and Flood 2014). So scenes need only integer
//! arithmetic and IEEE + - * /, and can be ported to another language line by line.

/// The odd number next to 2^64 divided by the golden ratio.
const GOLDEN_GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// A sequence of random numbers.
#[derive(Debug)]
pub(crate) struct SplitMix64(u64);

impl SplitMix64 {
    pub(crate) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns the next number, in `0..1`.
    pub(crate) fn next_unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(GOLDEN_GAMMA);
        unit(mix(self.0))
    }
}

/// Mixes bits: every bit of the result depends on every bit of `z`.
const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Converts 53 of the bits to a number in `0..1`.
#[expect(clippy::cast_precision_loss, reason = "53 bits are what an f64 holds")]
const fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// Returns value noise: random values at the points of the integer lattice, smooth in between; `-1..1`.
pub(super) fn noise(point: [f64; 3]) -> f64 {
    let cell = point.map(f64::floor);
    let [fx, fy, fz] = [0, 1, 2].map(|axis| fade(point[axis] - cell[axis]));
    let [x, y, z] = cell.map(lattice);
    let row = |y: u64, z: u64| lerp(value(x, y, z), value(x.wrapping_add(1), y, z), fx);
    let (y1, z1) = (y.wrapping_add(1), z.wrapping_add(1));
    lerp(lerp(row(y, z), row(y1, z), fy), lerp(row(y, z1), row(y1, z1), fy), fz)
}

/// Converts a whole coordinate to an integer; negative ones wrap around.
#[expect(clippy::cast_possible_truncation, reason = "scenes span a few thousand lattice points")]
const fn lattice(coordinate: f64) -> u64 {
    (coordinate as i64).cast_unsigned()
}

/// Returns the value at a lattice point, in `-1..1`.
fn value(x: u64, y: u64, z: u64) -> f64 {
    let key = x
        .wrapping_mul(GOLDEN_GAMMA)
        .wrapping_add(y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f))
        .wrapping_add(z.wrapping_mul(0x1656_67b1_9e37_79f9));
    2.0 * unit(mix(key)) - 1.0
}

/// Returns the smooth step from 0 at 0 to 1 at 1, with level ends.
fn fade(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}

fn lerp(from: f64, to: f64, t: f64) -> f64 {
    from + (to - from) * t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_published_one() {
        assert_eq!(mix(1_234_567u64.wrapping_add(GOLDEN_GAMMA)), 6_457_827_717_110_365_317);
    }

    #[test]
    fn noise_is_continuous_across_cells() {
        let below = 1.0 - 1e-9;
        for axis in 0..3 {
            let mut point = [0.3, -0.6, 0.9];
            point[axis] = below;
            let left = noise(point);
            point[axis] = 1.0;
            assert!((noise(point) - left).abs() < 1e-6);
        }
        assert!((noise([-2.0, 5.0, 7.0]) - value(2u64.wrapping_neg(), 5, 7)).abs() < 1e-15);
    }
}
