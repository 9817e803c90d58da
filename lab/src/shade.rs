//! From hits to colours: a grey solid, or its normals.
//!
//! Normals come from the triangle alone, in `f64`, so that they are the same at every scene size.
//! Every surface has two sides, because many files disagree with themselves about the front.

use hgrid_core::{Hit, Ray, Triangle, TriangleMesh};

use crate::camera::Camera;
use crate::vector::{Vector, cross, dot, offset, unit};

/// A colour as a PNG holds it.
pub type Rgb = [u8; 3];

/// Light from behind the viewer's left shoulder, as right, up and toward the eye.
const LIGHT: Vector = [-0.7, 0.8, 1.0];

/// The three lights on a surface, as linear red, green and blue.
const KEY: Vector = [0.62, 0.60, 0.56];
const SKY: Vector = [0.09, 0.11, 0.14];
const GROUND: Vector = [0.03, 0.027, 0.024];

/// The background at the upper and the lower edge, linear.
const ZENITH: Vector = [0.008, 0.018, 0.055];
const HORIZON: Vector = [0.22, 0.31, 0.44];

/// What surfaces look like in a picture that a camera takes.
#[derive(Debug, Clone, Copy)]
pub struct Shader<'a> {
    mesh: TriangleMesh<'a>,
    /// Unit vectors.
    axes: [Vector; 3],
    light: Vector,
}

impl<'a> Shader<'a> {
    /// A shader for the hits that the camera's rays have on a mesh.
    #[must_use]
    pub fn new(mesh: TriangleMesh<'a>, camera: &Camera) -> Self {
        let axes = camera.axes().map(|axis| axis.map(f64::from));
        let [right, up, toward] = axes;
        let light = offset(offset(right.map(|c| c * LIGHT[0]), LIGHT[1], up), LIGHT[2], toward);
        Self { mesh, axes, light: unit(light).unwrap_or(toward) }
    }

    /// A grey solid in a lit room.
    #[must_use]
    pub fn diffuse(&self, ray: &Ray, hit: Option<Hit>) -> Rgb {
        let Some(normal) = hit.and_then(|hit| self.normal(ray, hit)) else {
            return self.background(ray);
        };
        let key = dot(normal, self.light).max(0.0);
        let sky = 0.5 + 0.5 * dot(normal, self.axes[1]);
        display([0, 1, 2].map(|i| key * KEY[i] + sky * SKY[i] + (1.0 - sky) * GROUND[i]))
    }

    /// The normal as a colour: red to the right, green up, blue toward the viewer.
    #[must_use]
    pub fn normals(&self, ray: &Ray, hit: Option<Hit>) -> Rgb {
        let Some(normal) = hit.and_then(|hit| self.normal(ray, hit)) else {
            return self.background(ray);
        };
        self.axes.map(|axis| byte(0.5 + 0.5 * dot(normal, axis)))
    }

    /// The unit normal on the viewer's side.
    fn normal(&self, ray: &Ray, hit: Hit) -> Option<Vector> {
        let normal = normal_of(&self.mesh.triangle(hit.primitive)?).unwrap_or(self.axes[2]);
        let is_away = dot(normal, ray.direction.map(f64::from)) > 0.0;
        Some(if is_away { normal.map(|c| -c) } else { normal })
    }

    fn background(&self, ray: &Ray) -> Rgb {
        // The picture's edges are at about a third of the direction's length.
        let height = dot(ray.direction.map(f64::from), self.axes[1]);
        let t = (0.5 + 1.4 * height).clamp(0.0, 1.0);
        display([0, 1, 2].map(|i| HORIZON[i] + (ZENITH[i] - HORIZON[i]) * t))
    }
}

/// The unit normal of a triangle, unless it has no area.
pub(crate) fn normal_of(triangle: &Triangle) -> Option<Vector> {
    let [a, b, c] = triangle.map(|corner| corner.map(f64::from));
    unit(cross(offset(b, -1.0, a), offset(c, -1.0, a)))
}

/// Linear light as a screen wants it; a square root is close to its curve.
fn display(color: Vector) -> Rgb {
    color.map(|c| byte(c.max(0.0).sqrt()))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before")]
fn byte(c: f64) -> u8 {
    (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Up, View};

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
