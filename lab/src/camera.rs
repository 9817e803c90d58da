//! One camera for all pictures and measurements: it frames any scene by itself.
//!
//! ```text
//!            up                       The eye stands where all eight corners of the scene's box
//!             |  / toward the eye     just fit: for each corner and both axes of the image,
//!             | /                     distance >= |x| / tangent + z. The presets need nothing but
//!    target --+----- right            + - * / and square roots, so a port gives the same rays.
//! ```
//!
//! Framing is done in `f64`, so that a scene of any size gives the same picture; rays are `f32`.
//! The scene's y axis is up unless the caller says z. Images are square.

use core::str::FromStr;

use anyhow::{Context as _, Error, Result, ensure};
use clap::ValueEnum;
use hgrid_core::Ray;

use crate::scene::Bounds;
use crate::vector::{Vector, cross, dot, offset, round, unit};

/// The tangent of half the field of view, which is 40 degrees.
const HALF_VIEW_TANGENT: f32 = 0.364;

/// How much larger than the box the picture is.
const MARGIN: f64 = 1.04;

/// A box lower than this part of its width is seen from above unless the caller says otherwise.
const FLAT: f64 = 0.25;

/// Which axis of the scene is up in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Up {
    /// As scans and most renderers have it.
    Y,
    /// As maps, machines and buildings have it; the front is -y.
    Z,
}

impl Up {
    /// A vector of the scene, turned so that y is up.
    fn turned(self, [x, y, z]: Vector) -> Vector {
        match self {
            Self::Y => [x, y, z],
            Self::Z => [x, z, -y],
        }
    }

    /// The vector of the scene that was turned.
    fn turned_back(self, [x, y, z]: Vector) -> Vector {
        match self {
            Self::Y => [x, y, z],
            Self::Z => [x, -z, y],
        }
    }
}

/// From which side to look; the axes are those of a scene whose y is up.
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
    /// From -y, with -z up in the picture.
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
    /// The view of a scene that nobody chose one for: from the front, or from above if it is flat.
    #[must_use]
    pub fn of(bounds: Bounds, up: Up) -> Self {
        let [x, y, z] = up.turned(half_extent(bounds)).map(f64::abs);
        if y < FLAT * x.max(z) { Self::ThreeQuarter } else { Self::Front }
    }

    /// The direction from the scene to the eye; any length.
    fn toward_eye(self) -> Vector {
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
                let [azimuth, elevation] = numbers(word).context(
                    "a view is front, back, left, right, top, bottom, three-quarter \
                     or AZIMUTH,ELEVATION in degrees",
                )?;
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
        numbers(word).map(Self).context("a point is X,Y,Z")
    }
}

/// Exactly `N` finite numbers between commas.
fn numbers<const N: usize>(word: &str) -> Result<[f64; N]> {
    let numbers = word.split(',').map(|number| number.trim().parse::<f64>());
    let numbers = numbers.collect::<Result<Vec<_>, _>>()?;
    ensure!(numbers.iter().all(|number| number.is_finite()), "not a finite number");
    <[f64; N]>::try_from(numbers).ok().with_context(|| format!("not {N} numbers"))
}

/// An eye and the directions of its picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    eye: [f32; 3],
    /// Unit vectors in scene space; the picture's edges are at a tangent of the half view.
    right: [f32; 3],
    up: [f32; 3],
    forward: [f32; 3],
}

impl Camera {
    /// The camera that sees all of a box, and not much else.
    #[must_use]
    pub fn framing(bounds: Bounds, view: View, up: Up) -> Self {
        let basis = Basis::new(view.toward_eye(), up);
        let Point(centre) = Point::centre_of(bounds);
        let half = half_extent(bounds);

        let mut distance = 0.0f64;
        for corner in 0..8 {
            let sign = [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 });
            let corner = [0, 1, 2].map(|axis| sign[axis] * half[axis]);
            let reach = dot(corner, basis.right).abs().max(dot(corner, basis.up).abs());
            let depth = dot(corner, basis.toward_eye);
            distance = distance.max(MARGIN * reach / f64::from(HALF_VIEW_TANGENT) + depth);
        }
        basis.camera(offset(centre, distance, basis.toward_eye))
    }

    /// The camera at a point, looking at another; straight down -z if the two are the same.
    #[must_use]
    pub fn between(Point(eye): Point, Point(target): Point, up: Up) -> Self {
        Basis::new(up.turned(offset(eye, -1.0, target)), up).camera(eye)
    }

    fn from_axes(eye: Vector, [right, up, toward_eye]: [Vector; 3]) -> Self {
        let forward = round(toward_eye.map(|c| -c));
        Self { eye: round(eye), right: round(right), up: round(up), forward }
    }

    /// Unit vectors to the picture's right, up, and toward the eye.
    #[must_use]
    pub fn axes(&self) -> [[f32; 3]; 3] {
        [self.right, self.up, self.forward.map(|c| -c)]
    }

    /// The ray through the centre of a pixel of a square picture, counted from its upper left.
    ///
    /// It starts at the eye and its direction is 1 to 1.13 long.
    #[inline]
    #[must_use]
    pub fn ray(&self, column: u16, row: u16, size: u16) -> Ray {
        self.ray_at(self.across(column, size), self.down(row, size))
    }

    /// What the rays of a column of pixels have in common: forward, and to the right.
    #[inline]
    pub(crate) fn across(&self, column: u16, size: u16) -> [f32; 3] {
        let x = (2.0 * f32::from(column) + 1.0 - f32::from(size)) * half_pixel(size);
        [0, 1, 2].map(|axis| self.forward[axis] + x * self.right[axis])
    }

    /// What the rays of a row of pixels have in common: upward.
    #[inline]
    pub(crate) fn down(&self, row: u16, size: u16) -> [f32; 3] {
        let y = (f32::from(size) - 2.0 * f32::from(row) - 1.0) * half_pixel(size);
        self.up.map(|c| y * c)
    }

    /// The ray of a column and a row.
    #[inline]
    pub(crate) fn ray_at(&self, across: [f32; 3], down: [f32; 3]) -> Ray {
        Ray::new(self.eye, [0, 1, 2].map(|axis| across[axis] + down[axis]))
    }
}

/// Half of a pixel's size on the plane at distance 1 from the eye.
fn half_pixel(size: u16) -> f32 {
    HALF_VIEW_TANGENT / f32::from(size)
}

/// A right-handed frame of unit vectors.
struct Basis {
    right: Vector,
    up: Vector,
    toward_eye: Vector,
}

impl Basis {
    /// The frame whose `right` is level, from a direction that was turned.
    fn new(toward_eye: Vector, up: Up) -> Self {
        let toward_eye = unit(toward_eye).unwrap_or([0.0, 0.0, 1.0]);
        let level = [toward_eye[2], 0.0, -toward_eye[0]];
        // Straight up and down, every direction is level.
        let right = unit(level).unwrap_or([1.0, 0.0, 0.0]);
        let [right, up, toward_eye] =
            [right, cross(toward_eye, right), toward_eye].map(|axis| up.turned_back(axis));
        Self { right, up, toward_eye }
    }

    fn camera(&self, eye: Vector) -> Camera {
        Camera::from_axes(eye, [self.right, self.up, self.toward_eye])
    }
}

/// Half of a box's size on each axis.
fn half_extent((min, max): Bounds) -> Vector {
    [0, 1, 2].map(|axis| 0.5 * f64::from(max[axis]) - 0.5 * f64::from(min[axis]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: Bounds = ([-1.0, 2.0, -3.0], [5.0, 2.5, 4.0]);

    const VIEWS: [&str; 9] =
        ["front", "back", "left", "right", "top", "bottom", "three-quarter", "30,20", "-200,-89.5"];

    /// The picture coordinates of a point, -1 to 1 inside the picture.
    fn project(camera: &Camera, point: Vector) -> [f64; 2] {
        let [right, up, toward] = camera.axes().map(|axis| axis.map(f64::from));
        let v = offset(point, -1.0, camera.eye.map(f64::from));
        let depth = -dot(v, toward) * f64::from(HALF_VIEW_TANGENT);
        assert!(depth > 0.0);
        [dot(v, right) / depth, dot(v, up) / depth]
    }

    fn corners((min, max): Bounds) -> impl Iterator<Item = Vector> {
        (0..8).map(move |corner| {
            [0, 1, 2].map(|axis| f64::from(if corner >> axis & 1 == 0 { min } else { max }[axis]))
        })
    }

    #[test]
    fn the_corners_just_fit() {
        for (view, up) in VIEWS.into_iter().flat_map(|view| [(view, Up::Y), (view, Up::Z)]) {
            let camera = Camera::framing(BOX, view.parse().unwrap(), up);
            let reach = corners(BOX)
                .flat_map(|corner| project(&camera, corner))
                .fold(0.0f64, |reach, c| reach.max(c.abs()));
            assert!((0.95..=1.0).contains(&reach), "{view}: {reach}");
        }
    }

    #[test]
    fn size_and_place_do_not_matter() {
        for view in VIEWS {
            let view = view.parse().unwrap();
            let pixel = |camera: Camera| camera.ray(7, 900, 1024).direction.map(f32::to_bits);
            let expected = pixel(Camera::framing(BOX, view, Up::Y));
            for scale in [1e-30f32, 1e30] {
                let (min, max) = BOX;
                let scaled = (min.map(|c| c * scale), max.map(|c| c * scale));
                let camera = Camera::framing(scaled, view, Up::Y);
                assert_eq!(pixel(camera), expected);
                for corner in corners(scaled) {
                    assert!(project(&camera, corner).iter().all(|c| c.abs() < 1.0));
                }
            }
        }
    }

    #[test]
    fn pixels_run_right_and_down() {
        let camera = Camera::framing(BOX, View::Front, Up::Y);
        let [near, far] = [camera.ray(0, 0, 2), camera.ray(1, 1, 2)].map(|ray| ray.direction);
        let half = HALF_VIEW_TANGENT / 2.0;
        assert_eq!([near, far], [[-half, half, -1.0], [half, -half, -1.0]]);
        let centre = Camera::framing(BOX, View::Top, Up::Y).ray(0, 0, 1);
        assert_eq!(centre, Ray::new([2.0, centre.origin[1], 0.5], [0.0, -1.0, 0.0]));
    }

    #[test]
    fn z_can_be_up() {
        let camera = Camera::framing(BOX, View::Front, Up::Z);
        let axes = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
        assert_eq!(camera, Camera { eye: camera.eye, ..Camera::from_axes([0.0; 3], axes) });
        let [eye, target] = [Point([0.0, -5.0, 0.0]), Point([0.0; 3])];
        assert_eq!(Camera::between(eye, target, Up::Z), Camera::from_axes(eye.0, axes));
    }

    #[test]
    fn an_empty_box_and_equal_points_give_finite_cameras() {
        let point = Point([1.0, 2.0, 3.0]);
        for camera in [
            Camera::framing(Bounds::default(), View::Left, Up::Y),
            Camera::between(point, point, Up::Z),
        ] {
            let ray = camera.ray(0, 0, 1);
            assert!(ray.origin.iter().chain(&ray.direction).all(|c| c.is_finite()));
        }
    }

    #[test]
    fn flat_scenes_are_seen_from_above() {
        assert_eq!(View::of(BOX, Up::Y), View::ThreeQuarter);
        assert_eq!(View::of(BOX, Up::Z), View::Front);
        assert_eq!(View::of(([0.0; 3], [1.0; 3]), Up::Y), View::Front);
        assert_eq!(View::of(Bounds::default(), Up::Y), View::Front);
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
