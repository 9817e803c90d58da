//! A ray as boxes see it: what a slab test needs, and how far it may be off.
//!
//! ```text
//! near = max over axes of (near side - origin) / direction     far = min over axes of (far side - origin) / direction
//! the box is met if near <= far, near <= end, far >= start
//! ```
//!
//! The test is done in f32 and must never miss a box that holds a hit:
//!
//! - **Relative errors.** A side is subtracted, multiplied and added with at most six roundings. So `far` is
//!   computed with an inverse direction that is larger by 2^-20, and the range of the ray is widened alike.
//! - **Absolute errors** where the terms cancel: absorbed by the margin of quantised boxes ([`node`](super::node)).
//! - **Zero directions.** Their inverse is [`STEEP`]: no box is thinner than 2^-60 of the scene and its margin is
//!   2^-6 of a step, so a ray inside one leaves it behind the end of the scene, and one outside never
//!   enters. Products stay finite as long as the scene is smaller than 2^50; beyond, a NaN counts as a
//!   box that is met.
//! - **Far origins.** The ray starts at a point near the scene ([`Approach`]), which may be off the ray by
//!   `slack`; near sides are that much nearer, far sides farther.
//!
//! The direction is scaled by a power of two so that its largest component lies between 1 and 2, and the
//! range of the ray with it: distances are about those of the scene, whatever the direction's length.

use crate::approach::Approach;
use crate::ray::{Ray, round};

/// The inverse of a direction that is zero, or as good as zero.
pub(crate) const STEEP: f32 = 32_768.0 * 1_048_576.0 * 1_048_576.0 * 1_048_576.0; // 2^75

/// What errors are relative to: 1 + 2^-20.
const WIDER: f32 = 1.0 + 1.0 / 1_048_576.0;

/// A ray, ready for boxes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slab {
    /// Where the ray starts, moved by the slack towards far sides and near sides.
    pub(crate) origin_near: [f32; 3],
    pub(crate) origin_far: [f32; 3],
    /// One over the scaled direction.
    pub(crate) inverse: [f32; 3],
    /// The range in which boxes matter.
    pub(crate) start: f32,
    pub(crate) end: f32,
    /// The `t` of the start, and scaled distances for each unit of `t`.
    t: f64,
    scale: f64,
}

impl Slab {
    /// A ray that was brought to the scene.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, approach: &Approach) -> Self {
        let [x, y, z] = ray.direction;
        let largest = f64::from(x.abs().max(y.abs()).max(z.abs()));
        // A power of two: the exponent of the largest component.
        let scale = f64::from_bits(largest.to_bits() & 0x7ff0_0000_0000_0000);
        let inverse = |d: f32| {
            let inverse = round(scale / f64::from(d));
            if inverse.abs() <= STEEP { inverse } else { STEEP.copysign(d) }
        };
        let inverse = [inverse(x), inverse(y), inverse(z)];
        let mut slab = Self {
            origin_near: approach.anchor,
            origin_far: approach.anchor,
            inverse,
            start: 0.0,
            end: 0.0,
            t: approach.t,
            scale,
        };
        slab.start = slab.earliest(ray.t_min);
        slab.end = slab.latest(ray.t_max);
        slab
    }

    /// A distance no farther than a `t` and all that rounds to it.
    #[inline(always)]
    fn earliest(&self, t: f32) -> f32 {
        let distance = round((f64::from(t.next_down()) - self.t) * self.scale);
        (distance - distance.abs() * (WIDER - 1.0)).next_down()
    }

    /// A distance no nearer than a `t` and all that rounds to it.
    #[inline(always)]
    pub(crate) fn latest(&self, t: f32) -> f32 {
        let distance = round((f64::from(t.next_up()) - self.t) * self.scale);
        (distance + distance.abs() * (WIDER - 1.0)).next_up()
    }

    /// The inverse direction for far sides.
    #[inline(always)]
    pub(crate) fn inverse_far(&self) -> [f32; 3] {
        self.inverse.map(|inverse| inverse * WIDER)
    }
}
