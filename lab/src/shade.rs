//! Colours of hits: a grey solid, or its normals.
//!
//! Normals depend only on the triangle. They are computed in `f64` until they are unit vectors, so that they
//! are the same at every scene size; colours are `f32`. Every surface has two sides, because many files are
//! inconsistent about the front.
//!
//! Pixels are shaded 64 at a time in loops over numbers, which the compiler vectorises: tracing should
//! dominate the time of a picture.

use hgrid_core::{Hit, INVALID_ID, Ray, Triangle, TriangleMesh};

use crate::camera::Camera;
use crate::vector::{Vector, cross, length, offset, round, unit};

/// A colour as a PNG holds it.
pub type Rgb = [u8; 3];

/// Light from behind the viewer's left shoulder, as right, up and toward the eye.
const LIGHT: [f32; 3] = [-0.7, 0.8, 1.0];

/// The three lights on a surface, as linear red, green and blue.
const KEY: [f32; 3] = [0.62, 0.60, 0.56];
const SKY: [f32; 3] = [0.09, 0.11, 0.14];
const GROUND: [f32; 3] = [0.03, 0.027, 0.024];

/// The background at the upper and the lower edge, linear.
const ZENITH: [f32; 3] = [0.008, 0.018, 0.055];
const HORIZON: [f32; 3] = [0.22, 0.31, 0.44];

/// A function that computes the colours of rays with their hits.
pub type Shade = fn(&Shader<'_>, &[Ray], &[Hit], &mut [Rgb]);

/// Pixels that are shaded together.
const GROUP: usize = 64;

/// One number for each pixel of a group.
type Lanes<T> = [T; GROUP];

/// A shader of a mesh for the pictures of one camera.
#[derive(Debug, Clone, Copy)]
pub struct Shader<'a> {
    mesh: TriangleMesh<'a>,
    /// Unit vectors.
    axes: [[f32; 3]; 3],
    light: [f32; 3],
}

impl<'a> Shader<'a> {
    /// Makes a shader for hits of the camera's rays on a mesh.
    #[must_use]
    pub fn new(mesh: TriangleMesh<'a>, camera: &Camera) -> Self {
        Self { mesh, axes: camera.axes(), light: lamp(camera) }
    }

    /// Shades a grey solid in a lit room: writes the colours of rays with these hits, [`Hit::MISS`] for none.
    /// All three slices are equally long.
    pub fn diffuse(&self, rays: &[Ray], hits: &[Hit], colors: &mut [Rgb]) {
        let [_, up, _] = self.axes;
        self.shade(rays, hits, colors, |normal| {
            let key = dot(normal, self.light).max(0.0);
            let sky = 0.5 + 0.5 * dot(normal, up);
            [0, 1, 2].map(|c| KEY[c] * key + SKY[c] * sky + GROUND[c] * (1.0 - sky))
        });
    }

    /// Shades normals as colours: red to the right, green up, blue toward the viewer.
    pub fn normals(&self, rays: &[Ray], hits: &[Hit], colors: &mut [Rgb]) {
        self.shade(rays, hits, colors, |normal| {
            let along = self.axes.map(|axis| 0.5 + 0.5 * dot(normal, axis));
            // A screen takes the root of this.
            along.map(|part| part * part)
        });
    }

    /// Shades pixels with the light that `surface` returns for the normal on the viewer's side.
    #[inline(always)]
    fn shade(
        &self,
        rays: &[Ray],
        hits: &[Hit],
        colors: &mut [Rgb],
        surface: impl Fn([f32; 3]) -> [f32; 3],
    ) {
        debug_assert!(rays.len() == hits.len() && hits.len() == colors.len());
        let groups = rays.chunks(GROUP).zip(hits.chunks(GROUP)).zip(colors.chunks_mut(GROUP));
        for ((rays, hits), colors) in groups {
            let mut directions = [[0.0; GROUP]; 3];
            for (lane, ray) in (0..GROUP).zip(rays) {
                put(&mut directions, lane, ray.direction);
            }
            let mut light = [[0.0; GROUP]; 3];
            for lane in 0..GROUP {
                put(&mut light, lane, self.background(at(&directions, lane)));
            }
            // Many groups see only the background.
            if hits.iter().any(|hit| hit.primitive != INVALID_ID) {
                let seen = Seen::by(&self.mesh, hits);
                let normals = seen.normals(self.axes[2]);
                for lane in 0..GROUP {
                    let (direction, normal) = (at(&directions, lane), at(&normals, lane));
                    let is_away = dot(normal, direction) > 0.0;
                    let lit = surface(normal.map(|c| if is_away { -c } else { c }));
                    let sky = at(&light, lane);
                    put(&mut light, lane, if seen.is_hit[lane] { lit } else { sky });
                }
            }
            display(&light, colors);
        }
    }

    /// Returns the light of the background.
    #[inline(always)]
    fn background(&self, direction: [f32; 3]) -> [f32; 3] {
        background(self.axes[1], direction)
    }
}

/// Returns the direction toward the lamp of a camera, a unit vector.
#[must_use]
pub fn lamp(camera: &Camera) -> [f32; 3] {
    let [right, up, toward] = camera.axes();
    let along = |c: usize| right[c] * LIGHT[0] + up[c] * LIGHT[1] + toward[c] * LIGHT[2];
    let light = [0, 1, 2].map(along);
    let length = dot(light, light).sqrt();
    light.map(|c| c / length)
}

/// Returns the light of the background in a direction, in a picture whose upward direction is `up`.
#[inline(always)]
pub(crate) fn background(up: [f32; 3], direction: [f32; 3]) -> [f32; 3] {
    // The picture's edges are at about a third of the direction's length.
    let height = (0.5 + 1.4 * dot(direction, up)).clamp(0.0, 1.0);
    [0, 1, 2].map(|c| HORIZON[c] * (1.0 - height) + ZENITH[c] * height)
}

/// The triangles that the rays of a group see.
struct Seen {
    /// Their corners; 0 for a miss.
    corners: [[Lanes<f32>; 3]; 3],
    is_hit: Lanes<bool>,
}

impl Seen {
    fn by(mesh: &TriangleMesh<'_>, hits: &[Hit]) -> Self {
        let mut seen = Self { corners: [[[0.0; GROUP]; 3]; 3], is_hit: [false; GROUP] };
        for (lane, hit) in (0..GROUP).zip(hits) {
            if hit.primitive == INVALID_ID {
                continue;
            }
            let Some(triangle) = mesh.triangle(hit.primitive) else { continue };
            seen.is_hit[lane] = true;
            for (corners, corner) in seen.corners.iter_mut().zip(triangle) {
                put(corners, lane, corner);
            }
        }
        seen
    }

    /// Returns the unit normals on either side, or `instead` for a triangle without an area.
    fn normals(&self, instead: [f32; 3]) -> [Lanes<f32>; 3] {
        let mut normals = [[0.0; GROUP]; 3];
        for lane in 0..GROUP {
            let triangle = self.corners.each_ref().map(|corners| at(corners, lane));
            let along = cross_of(&triangle);
            let length = length(along);
            // One division instead of three: an error of an ulp of f64, which hardly ever shows in f32.
            let inverse = 1.0 / length;
            let normal = round(along.map(|c| c * inverse));
            put(&mut normals, lane, if length > 0.0 { normal } else { instead });
        }
        normals
    }
}

/// Returns the vector of a pixel.
#[inline(always)]
fn at(lanes: &[Lanes<f32>; 3], lane: usize) -> [f32; 3] {
    lanes.each_ref().map(|numbers| numbers[lane])
}

#[inline(always)]
fn put(lanes: &mut [Lanes<f32>; 3], lane: usize, vector: [f32; 3]) {
    for (numbers, number) in lanes.iter_mut().zip(vector) {
        numbers[lane] = number;
    }
}

#[inline(always)]
pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Converts linear light, which may be out of range, to a screen's values; a square root is close to a
/// screen's curve.
fn display(light: &[Lanes<f32>; 3], colors: &mut [Rgb]) {
    /// The number at which floats have no bits for fractions: adding it rounds, and leaves the integer in the
    /// low bits.
    const INTEGERS: f32 = 8_388_608.0; // 2^23
    let mut bytes = [[0; GROUP]; 3];
    for (byte, light) in bytes.as_flattened_mut().iter_mut().zip(light.as_flattened()) {
        let rounded = light.clamp(0.0, 1.0).sqrt() * 255.0 + INTEGERS;
        *byte = rounded.to_bits().to_le_bytes()[0];
    }
    for (lane, color) in colors.iter_mut().enumerate().take(GROUP) {
        *color = bytes.each_ref().map(|bytes| bytes[lane]);
    }
}

/// Returns the unit normal of a triangle, unless it has no area.
pub(crate) fn normal_of(triangle: &Triangle) -> Option<Vector> {
    unit(cross_of(triangle))
}

/// Returns the cross product of two edges, in `f64`: no area is too small or too large.
fn cross_of(triangle: &Triangle) -> Vector {
    let [a, b, c] = triangle.map(|corner| corner.map(f64::from));
    cross(offset(b, -1.0, a), offset(c, -1.0, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Up, View};
    use crate::scene::Scene;
    use crate::vector::dot;

    #[test]
    fn bytes_are_rounded_and_end_at_black_and_white() {
        let shown = |light: f32| {
            let mut colors = [[1; 3]; 2];
            display(&[[light; GROUP]; 3], &mut colors);
            assert!(colors.as_flattened().iter().all(|&byte| byte == colors[0][0]));
            colors[0][0]
        };
        assert_eq!([0.0, 0.25, 1.0].map(shown), [0, 128, 255]);
        assert_eq!([-0.1, 1.1, f32::INFINITY].map(shown), [0, 255, 255]);
        for byte in 0..=255_u8 {
            for off in [-0.49, 0.0, 0.49] {
                let near = ((f32::from(byte) + off) / 255.0).max(0.0);
                assert_eq!(shown(near * near), byte);
            }
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
    fn pixels_have_the_normals_of_their_triangles() {
        let corners = [[0.1, 0.2, 0.3], [1.0, 0.0, 0.7], [0.3, 1.0, 1.0f32]];
        for scale in [1e-40, 1e-30, 1.0, 1e30, 1e38] {
            let positions = corners.map(|corner| corner.map(|c| c * scale));
            let indices = [[0, 1, 2], [0, 1, 1]];
            let mesh = TriangleMesh::new(&positions, &indices).unwrap();
            let hits = [0, 1].map(|primitive| Hit { primitive, ..Hit::MISS });
            let normals = Seen::by(&mesh, &hits).normals([1.0, 2.0, 3.0]);
            let expected = round(normal_of(&positions).unwrap());
            let is_near = |(a, b): (f32, f32)| (a - b).abs() <= f32::EPSILON * b.abs();
            assert!(at(&normals, 0).into_iter().zip(expected).all(is_near), "{scale}");
            assert_eq!(at(&normals, 1).map(f32::to_bits), [1.0f32, 2.0, 3.0].map(f32::to_bits));
        }
    }

    #[test]
    fn both_sides_and_degenerate_triangles_have_a_colour() {
        let positions = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
        let camera = Camera::framing((positions[0], [1.0, 1.0, 0.0]), View::Front, Up::Y);
        let ray = camera.ray(0, 0, 1);
        let color = |shade: Shade, triangle: [u32; 3], hit: Hit| {
            let indices = [triangle];
            let shader = Shader::new(TriangleMesh::new(&positions, &indices).unwrap(), &camera);
            let mut colors = [[1; 3]];
            shade(&shader, &[ray], &[hit], &mut colors);
            colors[0]
        };
        let hit = Hit { t: 1.0, u: 0.2, v: 0.2, primitive: 0 };
        let (diffuse, normals): (Shade, Shade) = (
            |shader, rays, hits, colors| shader.diffuse(rays, hits, colors),
            |shader, rays, hits, colors| shader.normals(rays, hits, colors),
        );
        let colors = [[0, 1, 2], [0, 2, 1], [0, 0, 0]].map(|triangle| {
            assert_eq!(color(normals, triangle, hit), [128, 128, 255]);
            assert_ne!(color(diffuse, triangle, hit), color(diffuse, triangle, Hit::MISS));
            color(diffuse, triangle, hit)
        });
        assert!(colors[0] == colors[1] && colors[1] == colors[2]);
    }

    #[test]
    fn every_pixel_has_the_colour_that_it_has_alone() {
        let scene = Scene::load("procedural:knot:2000").unwrap();
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).unwrap();
        let camera = Camera::framing(scene.framed_bounds(), View::ThreeQuarter, Up::Y);
        let shader = Shader::new(mesh, &camera);
        let rays: Vec<_> = (0..150).map(|column| camera.ray(column, 70, 150)).collect();
        let hit = |primitive| Hit { primitive, ..Hit::MISS };
        let hits: Vec<_> =
            (0..150).map(|at| hit(if at % 3 == 0 { INVALID_ID } else { at })).collect();
        let mut together = vec![[1; 3]; 150];
        shader.diffuse(&rays, &hits, &mut together);
        for ((ray, hit), color) in rays.iter().zip(&hits).zip(&together) {
            let mut alone = [[1; 3]];
            shader.diffuse(&[*ray], &[*hit], &mut alone);
            assert_eq!(alone[0], *color);
        }
        let surfaces: Vec<_> = together.chunks_exact(3).map(|three| three[1]).collect();
        assert!(surfaces.iter().any(|color| *color != surfaces[0]));
    }
}
