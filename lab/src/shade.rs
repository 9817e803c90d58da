//! From hits to colours: a grey solid, or its normals.
//!
//! Normals come from the triangle alone, in `f64` until they are unit vectors, so that they are the
//! same at every scene size; colours are `f32`. Every surface has two sides, because many files
//! disagree with themselves about the front.

use glam::{DVec3, Vec3A};
use hgrid_core::{Hit, Ray, Triangle, TriangleMesh};

use crate::camera::Camera;
use crate::vector::{Vector, cross, offset, unit};

/// A colour as a PNG holds it.
pub type Rgb = [u8; 3];

/// Light from behind the viewer's left shoulder, as right, up and toward the eye.
const LIGHT: [f32; 3] = [-0.7, 0.8, 1.0];

/// The three lights on a surface, as linear red, green and blue.
const KEY: Vec3A = Vec3A::new(0.62, 0.60, 0.56);
const SKY: Vec3A = Vec3A::new(0.09, 0.11, 0.14);
const GROUND: Vec3A = Vec3A::new(0.03, 0.027, 0.024);

/// The background at the upper and the lower edge, linear.
const ZENITH: Vec3A = Vec3A::new(0.008, 0.018, 0.055);
const HORIZON: Vec3A = Vec3A::new(0.22, 0.31, 0.44);

/// What surfaces look like in a picture that a camera takes.
#[derive(Debug, Clone, Copy)]
pub struct Shader<'a> {
    mesh: TriangleMesh<'a>,
    /// Unit vectors.
    axes: [Vec3A; 3],
    light: Vec3A,
}

impl<'a> Shader<'a> {
    /// A shader for the hits that the camera's rays have on a mesh.
    #[must_use]
    pub fn new(mesh: TriangleMesh<'a>, camera: &Camera) -> Self {
        let axes = camera.axes().map(Vec3A::from_array);
        let [right, up, toward] = axes;
        let light = right * LIGHT[0] + up * LIGHT[1] + toward * LIGHT[2];
        Self { mesh, axes, light: light.normalize() }
    }

    /// A grey solid in a lit room.
    #[must_use]
    pub fn diffuse(&self, ray: &Ray, hit: Option<Hit>) -> Rgb {
        let Some(normal) = hit.and_then(|hit| self.normal(ray, hit)) else {
            return self.background(ray);
        };
        let key = normal.dot(self.light).max(0.0);
        let sky = 0.5 + 0.5 * normal.dot(self.axes[1]);
        display(KEY * key + SKY * sky + GROUND * (1.0 - sky))
    }

    /// The normal as a colour: red to the right, green up, blue toward the viewer.
    #[must_use]
    pub fn normals(&self, ray: &Ray, hit: Option<Hit>) -> Rgb {
        let Some(normal) = hit.and_then(|hit| self.normal(ray, hit)) else {
            return self.background(ray);
        };
        let along = Vec3A::from_array(self.axes.map(|axis| normal.dot(axis)));
        bytes(0.5 + 0.5 * along)
    }

    /// The unit normal on the viewer's side.
    fn normal(&self, ray: &Ray, hit: Hit) -> Option<Vec3A> {
        let normal = normal_of(&self.mesh.triangle(hit.primitive)?);
        let normal = normal.map_or(self.axes[2], |normal| DVec3::from_array(normal).as_vec3a());
        let is_away = normal.dot(Vec3A::from_array(ray.direction)) > 0.0;
        Some(if is_away { -normal } else { normal })
    }

    fn background(&self, ray: &Ray) -> Rgb {
        // The picture's edges are at about a third of the direction's length.
        let height = Vec3A::from_array(ray.direction).dot(self.axes[1]);
        display(HORIZON.lerp(ZENITH, (0.5 + 1.4 * height).clamp(0.0, 1.0)))
    }
}

/// The unit normal of a triangle, unless it has no area.
pub(crate) fn normal_of(triangle: &Triangle) -> Option<Vector> {
    let [a, b, c] = triangle.map(|corner| corner.map(f64::from));
    unit(cross(offset(b, -1.0, a), offset(c, -1.0, a)))
}

/// Linear light as a screen wants it; a square root is close to its curve.
fn display(color: Vec3A) -> Rgb {
    bytes(color.sqrt())
}

/// From 0 to 1 as 0 to 255.
fn bytes(color: Vec3A) -> Rgb {
    /// From here on a float has no bits for fractions, and ends with those of its integer.
    const INTEGERS: f32 = 8_388_608.0; // 2^23
    let rounded = color.clamp(Vec3A::ZERO, Vec3A::ONE) * 255.0 + INTEGERS;
    rounded.to_array().map(|c| c.to_bits().to_le_bytes()[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Up, View};
    use crate::vector::dot;

    #[test]
    fn bytes_are_rounded_and_end_at_black_and_white() {
        assert_eq!(bytes(Vec3A::new(0.0, 0.5, 1.0)), [0, 128, 255]);
        assert_eq!(bytes(Vec3A::new(-0.1, 1.1, f32::INFINITY)), [0, 255, 255]);
        for byte in 0..=255_u8 {
            let near = [-0.49, 0.0, 0.49].map(|off| (f32::from(byte) + off) / 255.0);
            assert_eq!(bytes(Vec3A::from_array(near)), [byte; 3]);
        }
    }

    #[test]
    fn normals_do_not_depend_on_the_size() {
        let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0f32]];
        for scale in [1e-40, 1e-30, 1.0, 1e30, 1e38] {
            let normal = normal_of(&triangle.map(|corner| corner.map(|c| c * scale))).unwrap();
            let expected = [0.0, -0.5f64.sqrt(), 0.5f64.sqrt()];
            assert!(dot(normal, expected) > 0.9999, "{scale}: {normal:?}");
        }
        assert_eq!(normal_of(&[[1.0; 3], [2.0; 3], [3.0; 3]]), None);
    }

    #[test]
    fn both_sides_and_degenerate_triangles_have_a_colour() {
        let positions = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
        let camera = Camera::framing((positions[0], [1.0, 1.0, 0.0]), View::Front, Up::Y);
        let ray = camera.ray(0, 0, 1);
        let colors = [[0, 1, 2], [0, 2, 1], [0, 0, 0]].map(|triangle| {
            let indices = [triangle];
            let shader = Shader::new(TriangleMesh::new(&positions, &indices).unwrap(), &camera);
            let hit = Some(Hit { t: 1.0, u: 0.2, v: 0.2, primitive: 0 });
            assert_eq!(shader.normals(&ray, hit), [128, 128, 255]);
            assert_ne!(shader.diffuse(&ray, hit), shader.diffuse(&ray, None));
            shader.diffuse(&ray, hit)
        });
        assert!(colors[0] == colors[1] && colors[1] == colors[2]);
    }
}
