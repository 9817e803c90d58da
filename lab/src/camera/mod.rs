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

mod aim;
mod lens;
pub mod named;
mod view;
pub mod viewpoint;

use hgrid_core::Ray;

pub use aim::Aim;
pub use lens::Lens;
pub use view::{Point, Up, View};

use crate::scene::Bounds;
use crate::vector::{Vector, cross, dot, offset, round, unit};
use view::half_extent;
pub(crate) use view::is_flat;

/// The extent of the picture, as a multiple of the box's.
const MARGIN: f64 = 1.04;

/// An eye and the directions of its picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    eye: [f32; 3],
    /// Unit vectors in scene space; the picture's edges are at the tangent of half the field of view.
    right: [f32; 3],
    up: [f32; 3],
    forward: [f32; 3],
    lens: Lens,
}

impl Camera {
    /// Returns the camera that sees all of a box, and little else.
    #[must_use]
    pub fn framing(bounds: Bounds, view: View, up: Up) -> Self {
        Self::framing_through(Lens::default(), bounds, view, up)
    }

    /// Returns the same camera with another lens.
    #[must_use]
    pub fn framing_through(lens: Lens, bounds: Bounds, view: View, up: Up) -> Self {
        let basis = Basis::new(view.toward_eye(), up);
        let Point(centre) = Point::centre_of(bounds);
        let half = half_extent(bounds);

        let mut distance = 0.0f64;
        for corner in 0..8 {
            let sign = [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 });
            let corner = [0, 1, 2].map(|axis| sign[axis] * half[axis]);
            let reach = dot(corner, basis.right).abs().max(dot(corner, basis.up).abs());
            let depth = dot(corner, basis.toward_eye);
            distance = distance.max(MARGIN * reach / f64::from(lens.tangent()) + depth);
        }
        basis.camera(offset(centre, distance, basis.toward_eye), lens)
    }

    /// Returns the camera at a point that looks at another; straight down -z if the two are the same.
    #[must_use]
    pub fn between(Point(eye): Point, Point(target): Point, up: Up, lens: Lens) -> Self {
        Basis::new(up.turned(offset(eye, -1.0, target)), up).camera(eye, lens)
    }

    fn from_axes(eye: Vector, [right, up, toward_eye]: [Vector; 3], lens: Lens) -> Self {
        let forward = round(toward_eye.map(|c| -c));
        Self { eye: round(eye), right: round(right), up: round(up), forward, lens }
    }

    /// Unit vectors to the picture's right, up, and toward the eye.
    #[must_use]
    pub fn axes(&self) -> [[f32; 3]; 3] {
        [self.right, self.up, self.forward.map(|c| -c)]
    }

    /// The ray through the centre of a pixel of a square picture, counted from its upper left.
    ///
    /// It starts at the eye and its direction is 1 to 1.13 long, up to 2.7 through a wide lens.
    #[inline]
    #[must_use]
    pub fn ray(&self, column: u16, row: u16, size: u16) -> Ray {
        self.ray_at(self.across(column, size), self.down(row, size))
    }

    /// Returns the part of the rays' directions that a column of pixels shares: forward, and to the right.
    #[inline]
    pub(crate) fn across(&self, column: u16, size: u16) -> [f32; 3] {
        let x = (2.0 * f32::from(column) + 1.0 - f32::from(size)) * self.half_pixel(size);
        [0, 1, 2].map(|axis| self.forward[axis] + x * self.right[axis])
    }

    /// Returns the part of the rays' directions that a row of pixels shares: upward.
    #[inline]
    pub(crate) fn down(&self, row: u16, size: u16) -> [f32; 3] {
        let y = (f32::from(size) - 2.0 * f32::from(row) - 1.0) * self.half_pixel(size);
        self.up.map(|c| y * c)
    }

    /// Returns the vector that moves the directions of all rays by a part of a pixel, right and down.
    #[must_use]
    pub fn shift(&self, [right, down]: [f32; 2], size: u16) -> [f32; 3] {
        let pixel = 2.0 * self.half_pixel(size);
        [0, 1, 2].map(|axis| pixel * (right * self.right[axis] - down * self.up[axis]))
    }

    /// Returns the column and the row of the pixel that a ray goes through.
    pub(crate) fn pixel(&self, ray: &Ray, size: u16) -> [f32; 2] {
        let along =
            |axis: [f32; 3]| axis.iter().zip(ray.direction).map(|(a, d)| a * d).sum::<f32>();
        let [right, down] = [along(self.right), -along(self.up)];
        let half = self.half_pixel(size) * 2.0;
        [right, down].map(|c| c / half + 0.5 * f32::from(size) - 0.5)
    }

    /// The ray of a column and a row.
    #[inline]
    pub(crate) fn ray_at(&self, across: [f32; 3], down: [f32; 3]) -> Ray {
        Ray::new(self.eye, [0, 1, 2].map(|axis| across[axis] + down[axis]))
    }

    /// Half of a pixel's size on the plane at distance 1 from the eye.
    #[inline]
    fn half_pixel(&self, size: u16) -> f32 {
        self.lens.tangent() / f32::from(size)
    }
}

/// A right-handed frame of unit vectors.
struct Basis {
    right: Vector,
    up: Vector,
    toward_eye: Vector,
}

impl Basis {
    /// Makes the frame whose `right` is level, from a direction that was turned so that y is up.
    fn new(toward_eye: Vector, up: Up) -> Self {
        let toward_eye = unit(toward_eye).unwrap_or([0.0, 0.0, 1.0]);
        let level = [toward_eye[2], 0.0, -toward_eye[0]];
        // For a direction straight up or down, any `right` is level.
        let right = unit(level).unwrap_or([1.0, 0.0, 0.0]);
        let [right, up, toward_eye] =
            [right, cross(toward_eye, right), toward_eye].map(|axis| up.turned_back(axis));
        Self { right, up, toward_eye }
    }

    fn camera(&self, eye: Vector, lens: Lens) -> Camera {
        Camera::from_axes(eye, [self.right, self.up, self.toward_eye], lens)
    }
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
        let depth = -dot(v, toward) * f64::from(camera.lens.tangent());
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
        let lenses = [Lens::default(), "10".parse().unwrap(), "120".parse().unwrap()];
        let ways = VIEWS.into_iter().flat_map(|view| [(view, Up::Y), (view, Up::Z)]);
        for ((view, up), lens) in ways.flat_map(|way| lenses.map(|lens| (way, lens))) {
            let camera = Camera::framing_through(lens, BOX, view.parse().unwrap(), up);
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
        let half = Lens::default().tangent() / 2.0;
        assert_eq!([near, far], [[-half, half, -1.0], [half, -half, -1.0]]);
        let centre = Camera::framing(BOX, View::Top, Up::Y).ray(0, 0, 1);
        assert_eq!(centre, Ray::new([2.0, centre.origin[1], 0.5], [0.0, -1.0, 0.0]));
    }

    #[test]
    fn a_shift_by_a_pixel_gives_the_ray_beside() {
        let camera = Camera::framing(BOX, View::ThreeQuarter, Up::Z);
        let (ray, beside) = (camera.ray(3, 5, 9), camera.ray(4, 7, 9));
        let shift = camera.shift([1.0, 2.0], 9);
        for ((from, shift), to) in ray.direction.into_iter().zip(shift).zip(beside.direction) {
            assert!((from + shift - to).abs() < 1e-6);
        }
        let [column, row] = camera.pixel(&beside, 9);
        assert!((column - 4.0).abs() < 1e-4 && (row - 7.0).abs() < 1e-4);
    }

    #[test]
    fn z_can_be_up() {
        let camera = Camera::framing(BOX, View::Front, Up::Z);
        let axes = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
        assert_eq!(
            camera,
            Camera { eye: camera.eye, ..Camera::from_axes([0.0; 3], axes, Lens::default()) }
        );
        let [eye, target] = [Point([0.0, -5.0, 0.0]), Point([0.0; 3])];
        let lens = "90".parse().unwrap();
        let camera = Camera::between(eye, target, Up::Z, lens);
        assert_eq!(camera, Camera::from_axes(eye.0, axes, lens));
    }

    #[test]
    fn an_empty_box_and_equal_points_give_finite_cameras() {
        let point = Point([1.0, 2.0, 3.0]);
        for camera in [
            Camera::framing(Bounds::default(), View::Left, Up::Y),
            Camera::between(point, point, Up::Z, Lens::default()),
        ] {
            let ray = camera.ray(0, 0, 1);
            assert!(ray.origin.iter().chain(&ray.direction).all(|c| c.is_finite()));
        }
    }
}
