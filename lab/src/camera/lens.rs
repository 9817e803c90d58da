//! The field of view of a camera.

use core::str::FromStr;

use anyhow::{Error, Result, ensure};

/// The field of view of a square picture, from edge to edge: 40 degrees by default.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    half_view_tangent: f32,
}

impl Lens {
    /// The tangent of half the field of view.
    #[must_use]
    pub const fn tangent(self) -> f32 {
        self.half_view_tangent
    }
}

impl Default for Lens {
    fn default() -> Self {
        Self { half_view_tangent: 0.364 }
    }
}

impl FromStr for Lens {
    type Err = Error;

    #[expect(clippy::cast_possible_truncation, reason = "the rounding that is wanted")]
    fn from_str(word: &str) -> Result<Self> {
        let degrees: f64 = word.parse().unwrap_or(f64::NAN);
        ensure!(
            (1.0..=120.0).contains(&degrees),
            "a field of view is a number of degrees from 1 to 120"
        );
        Ok(Self { half_view_tangent: (0.5 * degrees).to_radians().tan() as f32 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_are_those_of_the_whole_picture() {
        let tangent = |word: &str| word.parse::<Lens>().unwrap().tangent();
        assert!((tangent("90") - 1.0).abs() < 1e-6);
        assert!((tangent("40") - Lens::default().tangent()).abs() < 1e-4);
        for word in ["", "wide", "0", "-40", "121", "nan"] {
            assert!(word.parse::<Lens>().is_err(), "{word}");
        }
    }
}
