//! Random numbers for tests, the same in every run.

use glam::Vec3A;

/// The next number. Its high bits are more random than its low ones.
pub(crate) fn next(state: &mut u32) -> u32 {
    *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    *state
}

/// A point with coordinates from -1 to 1.
#[expect(clippy::cast_precision_loss, reason = "24 bits")]
pub(crate) fn point(state: &mut u32) -> Vec3A {
    Vec3A::from_array([0; 3].map(|_| (next(state) >> 8) as f32 / 8_388_608.0 - 1.0))
}
