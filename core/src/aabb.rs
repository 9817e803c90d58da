//! Axis-aligned boxes, in scene units or in cells, and the part of a line inside one.

use glam::Vec3A;

use crate::limits::MAX_COORDINATE;
use crate::simd::inline_unless_small;

/// An axis-aligned box: its least and its greatest corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Aabb {
    pub(crate) min: Vec3A,
    pub(crate) max: Vec3A,
}

impl Aabb {
    /// The box around nothing.
    pub(crate) const EMPTY: Self = Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY };

    inline_unless_small! {
        /// The box around a triangle, or `None` if one of its coordinates is not finite.
        pub(crate) fn of([a, b, c]: [Vec3A; 3]) -> Option<Self> {
            // `<=` fails on NaN, so one comparison refuses all that is not finite.
            let limit = Vec3A::splat(MAX_COORDINATE);
            let finite = a.abs().cmple(limit) & b.abs().cmple(limit) & c.abs().cmple(limit);
            finite.all().then(|| Self { min: a.min(b).min(c), max: a.max(b).max(c) })
        }
    }

    /// Returns the extent on each axis.
    #[inline(always)]
    pub(crate) fn size(&self) -> Vec3A {
        self.max - self.min
    }

    inline_unless_small! {
        /// The box around two boxes.
        pub(crate) fn union(&self, other: &Self) -> Self {
            Self { min: self.min.min(other.min), max: self.max.max(other.max) }
        }
    }

    /// Returns true if two boxes have a point in common.
    #[inline(always)]
    pub(crate) fn meets(&self, other: &Self) -> bool {
        (self.min.cmple(other.max) & other.min.cmple(self.max)).all()
    }

    /// Returns true if it is a finite box with an inside on every axis.
    pub(crate) fn is_proper(&self) -> bool {
        let limit = Vec3A::splat(2.0 * MAX_COORDINATE);
        let finite = self.min.abs().cmple(limit) & self.max.abs().cmple(limit);
        (finite & self.min.cmplt(self.max)).all()
    }

    /// The part `(near, far)` of a line inside the box, in multiples of its direction.
    ///
    /// `inverse` is one over the direction, infinite where a component is zero. The box, the origin and all other
    /// inverses are finite, so no product is a NaN.
    #[inline]
    pub(crate) fn clip(&self, origin: [f64; 3], inverse: [f64; 3]) -> Option<(f64, f64)> {
        let (min, max) = (self.min.to_array(), self.max.to_array());
        let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let (origin, inverse) = (origin[axis], inverse[axis]);
            let (low, high) = (f64::from(min[axis]) - origin, f64::from(max[axis]) - origin);
            if inverse.is_infinite() {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
            } else {
                // No branch: the sign of the direction is unpredictable.
                let (a, b) = (low * inverse, high * inverse);
                near = greater(near, lesser(a, b));
                far = lesser(far, greater(a, b));
            }
        }
        (near <= far).then_some((near, far))
    }
}

/// The lesser of two numbers, the second if one is NaN; in one instruction.
#[inline(always)]
pub(crate) fn lesser<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// The greater of two numbers, the second if one is NaN; in one instruction.
#[inline(always)]
pub(crate) fn greater<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}
