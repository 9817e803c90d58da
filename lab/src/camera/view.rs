//! The direction from which a scene is seen: a side of it, or two angles; and the axis that is up.

use core::str::FromStr;

use anyhow::{Context as _, Error, Result, anyhow, ensure};
use clap::ValueEnum;

use crate::scene::{Bounds, Scene};
use crate::vector::{Vector, round, unit};

/// The views of any scene.
pub(super) const SIDES: &str =
    "front, back, left, right, top, bottom, three-quarter or AZIMUTH,ELEVATION in degrees";

/// A box lower than this part of its width is flat.
const FLAT: f64 = 0.25;

/// The axis of the scene that is up in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Up {
    /// As scans and most renderers have it.
    Y,
    /// As maps, machines and buildings have it; the front is -y.
    Z,
}

impl Up {
    /// Returns the axis that is up in a scene: the one of its format, or z if it lies flat on x and y.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let bounds = scene.framed_bounds();
        match scene.is_z_up {
            Some(true) => Self::Z,
            None if is_flat(bounds, Self::Z) && !is_flat(bounds, Self::Y) => Self::Z,
            Some(false) | None => Self::Y,
        }
    }

    /// Returns the direction that is up.
    pub(crate) fn direction(self) -> Vector {
        self.turned_back([0.0, 1.0, 0.0])
    }

    /// Turns a vector of the scene so that y is up.
    pub(crate) fn turned(self, [x, y, z]: Vector) -> Vector {
        match self {
            Self::Y => [x, y, z],
            Self::Z => [x, z, -y],
        }
    }

    /// Turns a vector whose y is up back into the scene: the inverse of `turned`.
    pub(crate) fn turned_back(self, [x, y, z]: Vector) -> Vector {
        match self {
            Self::Y => [x, y, z],
            Self::Z => [x, -z, y],
        }
    }
}

/// The side to look from; the axes are those of a scene whose y is up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum View {
    /// From +z, where scans that stand on the xz plane face.
    Front,
    /// From -z.
    Back,
    /// From -x.
    Left,
    /// From +x.
    Right,
    /// From +y, with -z up in the picture.
    Top,
    /// From -y, with +z up in the picture.
    Bottom,
    /// From the front, the right and above.
    ThreeQuarter,
    /// Degrees around the y axis from the front to the right, and degrees upward.
    Angles {
        /// 0 is the front, 90 the right.
        azimuth: f64,
        /// 0 is level, 90 the top.
        elevation: f64,
    },
}

impl View {
    /// The default view of a measurement: from the front, or if the scene is flat, from the front right and a little
    /// above.
    #[must_use]
    pub fn of(bounds: Bounds, up: Up) -> Self {
        if is_flat(bounds, up) { Self::ThreeQuarter } else { Self::Front }
    }

    /// The direction from a scene to the eye, as a unit vector of the scene.
    pub(crate) fn unit(self, up: Up) -> [f32; 3] {
        round(up.turned_back(unit(self.toward_eye()).unwrap_or_default()))
    }

    /// Returns the direction from the scene to the eye, of any length, in axes whose y is up.
    pub(super) fn toward_eye(self) -> Vector {
        match self {
            Self::Front => [0.0, 0.0, 1.0],
            Self::Back => [0.0, 0.0, -1.0],
            Self::Left => [-1.0, 0.0, 0.0],
            Self::Right => [1.0, 0.0, 0.0],
            Self::Top => [0.0, 1.0, 0.0],
            Self::Bottom => [0.0, -1.0, 0.0],
            Self::ThreeQuarter => [2.0, 1.5, 3.0],
            Self::Angles { azimuth, elevation } => {
                let (sin, cos) = azimuth.to_radians().sin_cos();
                let (rise, reach) = elevation.to_radians().sin_cos();
                [sin * reach, rise, cos * reach]
            }
        }
    }
}

/// Returns true if a box is much wider than high.
pub(crate) fn is_flat(bounds: Bounds, up: Up) -> bool {
    let [x, y, z] = up.turned(half_extent(bounds)).map(f64::abs);
    y < FLAT * x.max(z)
}

impl FromStr for View {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        Ok(match word {
            "front" => Self::Front,
            "back" => Self::Back,
            "left" => Self::Left,
            "right" => Self::Right,
            "top" => Self::Top,
            "bottom" => Self::Bottom,
            "three-quarter" => Self::ThreeQuarter,
            _ => {
                let angles = numbers(word);
                let [azimuth, elevation] = angles.map_err(|_| anyhow!("a view is {SIDES}"))?;
                ensure!(elevation.abs() <= 90.0, "ELEVATION is from -90 to 90 degrees");
                Self::Angles { azimuth, elevation }
            }
        })
    }
}

/// A point of the scene as `X,Y,Z`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point(pub Vector);

impl Point {
    /// The middle of a box.
    #[must_use]
    pub fn centre_of((min, max): Bounds) -> Self {
        Self([0, 1, 2].map(|axis| 0.5 * f64::from(min[axis]) + 0.5 * f64::from(max[axis])))
    }
}

impl FromStr for Point {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        let point = numbers(word).map(Self);
        point.map_err(|_| anyhow!("a point is three finite numbers between commas, like 0,3,-1.5"))
    }
}

/// Parses exactly `N` finite numbers between commas.
pub(super) fn numbers<const N: usize>(word: &str) -> Result<[f64; N]> {
    let numbers = word.split(',').map(|number| number.trim().parse::<f64>());
    let numbers = numbers.collect::<Result<Vec<_>, _>>()?;
    ensure!(numbers.iter().all(|number| number.is_finite()), "not a finite number");
    <[f64; N]>::try_from(numbers).ok().with_context(|| format!("not {N} numbers"))
}

/// Half of a box's size on each axis.
pub(super) fn half_extent((min, max): Bounds) -> Vector {
    [0, 1, 2].map(|axis| 0.5 * f64::from(max[axis]) - 0.5 * f64::from(min[axis]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: Bounds = ([-1.0, 2.0, -3.0], [5.0, 2.5, 4.0]);

    #[test]
    fn flat_scenes_are_seen_from_above() {
        assert_eq!(View::of(BOX, Up::Y), View::ThreeQuarter);
        assert_eq!(View::of(BOX, Up::Z), View::Front);
        assert_eq!(View::of(([0.0; 3], [1.0; 3]), Up::Y), View::Front);
        assert_eq!(View::of(Bounds::default(), Up::Y), View::Front);
    }

    #[test]
    fn z_is_up_where_the_format_says_so_or_the_scene_lies_on_x_and_y() {
        let scene = |bounds: Bounds, is_z_up| Scene {
            positions: vec![bounds.0, bounds.1],
            is_z_up,
            ..Scene::default()
        };
        let map = ([0.0; 3], [9.0, 7.0, 1.0]);
        assert_eq!(Up::of(&scene(map, None)), Up::Z);
        assert_eq!(Up::of(&scene(map, Some(false))), Up::Y);
        assert_eq!(Up::of(&scene(BOX, None)), Up::Y);
        assert_eq!(Up::of(&scene(BOX, Some(true))), Up::Z);
    }

    #[test]
    fn bad_words_are_refused() {
        for word in ["", "above", "1", "1,2,3", "1,", "nan,0", "0,91"] {
            assert!(word.parse::<View>().is_err(), "{word}");
        }
        for word in ["", "1,2", "1,2,3,4", "a,b,c", "1,2,inf"] {
            assert!(word.parse::<Point>().is_err(), "{word}");
        }
        assert_eq!("-1, 2,3e0".parse::<Point>().unwrap(), Point([-1.0, 2.0, 3.0]));
    }
}
