//! Rays of all kinds: those that a fuzzer chooses, and a fixed set.

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_core::{Grid, Ray, TriangleMesh};

use crate::random::Random;

/// The most rays at once, enough for a tile of two groups and two more rays.
const MOST: usize = if cfg!(miri) { 9 } else { 130 };

/// A way to choose the numbers of a ray.
#[derive(Debug, Clone, Arbitrary)]
enum Kind {
    /// Any bits.
    Any([f32; 8]),
    /// From a point in or around the grid's box, in a direction of small integers.
    Around { at: [i8; 3], towards: [i8; 3] },
    /// Through a point of a triangle, with integer weights, from a number of directions away.
    Through { triangle: u16, weights: [u8; 2], towards: [i8; 3], back: i8 },
    /// Along an axis through a vertex.
    Along { triangle: u16, corner: u8, axis: u8, back: i8 },
    /// From one vertex to another.
    Between { from: u16, to: u16, corners: u8 },
    /// Neighbours like the pixels of a picture, this many.
    Tile { at: [i8; 3], towards: [i8; 3], spread: u8, count: u8 },
}

/// The range of a ray.
#[derive(Debug, Clone, Copy, Arbitrary)]
enum Part {
    Ahead,
    All,
    Between(i8, u8),
    Any(f32, f32),
}

/// One ray or several.
#[derive(Debug, Clone, Arbitrary)]
struct Shot {
    kind: Kind,
    part: Part,
}

/// Returns the rays that the bytes describe.
pub(super) fn chosen(u: &mut Unstructured<'_>, grid: &Grid<'_>) -> Result<Vec<Ray>> {
    let mut rays = Vec::new();
    for _ in 0..u.int_in_range(0..=11)? {
        let shot = Shot::arbitrary(u)?;
        shot.rays(grid, &mut rays);
    }
    rays.truncate(MOST);
    Ok(rays)
}

impl Shot {
    fn rays(&self, grid: &Grid<'_>, rays: &mut Vec<Ray>) {
        let mesh = grid.mesh();
        let from = |origin, direction| Ray { ..Ray::new(origin, direction) };
        let before = rays.len();
        match self.kind {
            Kind::Any([x, y, z, t_min, dx, dy, dz, t_max]) => {
                rays.push(Ray { origin: [x, y, z], t_min, direction: [dx, dy, dz], t_max });
            }
            Kind::Around { at, towards } => {
                rays.push(from(around(grid, at), towards.map(f32::from)))
            }
            Kind::Through { triangle, weights, towards, back } => {
                let [a, b, c] = corners(mesh, triangle);
                let [u, v] = weights.map(|w| f32::from(w) / 255.0);
                let at: [f32; 3] =
                    std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
                rays.push(away(at, towards.map(f32::from), back));
            }
            Kind::Along { triangle, corner, axis, back } => {
                let at = corners(mesh, triangle)[usize::from(corner) % 3];
                let mut direction = [0.0, -0.0, 0.0];
                direction[usize::from(axis) % 3] = if axis < 128 { 1.0 } else { -1.0 };
                rays.push(away(at, direction, back));
            }
            Kind::Between { from: first, to, corners: which } => {
                let from_at = corners(mesh, first)[usize::from(which) % 3];
                let to_at = corners(mesh, to)[usize::from(which / 3) % 3];
                let direction = std::array::from_fn(|k| to_at[k] - from_at[k]);
                rays.push(from(from_at, direction));
            }
            Kind::Tile { at, towards, spread, count } => {
                let (origin, towards) = (around(grid, at), towards.map(f32::from));
                for pixel in 0..count % 129 {
                    let [x, y] =
                        [pixel % 8, pixel / 8].map(|i| f32::from(i) * f32::from(spread) / 32.0);
                    let [a, b, c] = towards;
                    rays.push(from(origin, [a + x, b + y, c - x * 0.5]));
                }
            }
        }
        for ray in &mut rays[before..] {
            match self.part {
                Part::Ahead => {}
                Part::All => ray.t_min = f32::NEG_INFINITY,
                Part::Between(start, length) => {
                    ray.t_min = f32::from(start) / 16.0;
                    ray.t_max = ray.t_min + f32::from(length) / 16.0;
                }
                Part::Any(t_min, t_max) => (ray.t_min, ray.t_max) = (t_min, t_max),
            }
        }
    }
}

/// Returns a full tile of rays from beside the grid's box through its middle. Neighbours differ by a
/// ten-thousandth of the way, so they are in the same cells of all but the finest grids.
pub(super) fn close(grid: &Grid<'_>) -> [Ray; 128] {
    let (from, to) = (around(grid, [-96, -80, -48]), around(grid, [0; 3]));
    std::array::from_fn(|ray| {
        let [x, y] = [ray % 8, ray / 8].map(|i| 1e-4 * i as f32);
        let [a, b, c] = std::array::from_fn(|k| to[k] - from[k]);
        Ray::new(from, [a + x * b, b + y * c, c - x * a])
    })
}

/// Returns a point in the grid's box, or around it up to the box's width.
fn around(grid: &Grid<'_>, at: [i8; 3]) -> [f32; 3] {
    let (min, max) = grid.bounds();
    std::array::from_fn(|k| {
        let half = 0.5 * max[k] - 0.5 * min[k];
        min[k] + half + half * (f32::from(at[k]) / 32.0)
    })
}

/// Returns a ray through a point, which starts `back` directions before it.
fn away(at: [f32; 3], direction: [f32; 3], back: i8) -> Ray {
    let back = f32::from(back) / 8.0;
    Ray::new(std::array::from_fn(|k| at[k] - direction[k] * back), direction)
}

fn corners(mesh: &TriangleMesh<'_>, triangle: u16) -> [[f32; 3]; 3] {
    let count = mesh.triangle_count().max(1);
    mesh.triangle(u32::from(triangle) % count).unwrap_or_default()
}

/// Returns the fixed rays: across the box, at the mesh, along axes, and invalid ones; half of them neighbours.
#[must_use]
pub fn fixed_rays(bounds: ([f32; 3], [f32; 3]), count: usize) -> Vec<Ray> {
    let (min, max) = bounds;
    let center: [f32; 3] = std::array::from_fn(|k| 0.5 * min[k] + 0.5 * max[k]);
    let half: [f32; 3] = std::array::from_fn(|k| 0.5 * max[k] - 0.5 * min[k]);
    let mut random = Random(47);
    let mut point = |reach: f32| {
        let point = random.point();
        std::array::from_fn(|k| center[k] + half[k] * reach * point[k])
    };
    let mut rays = Vec::with_capacity(count);
    for i in 0..count {
        let origin: [f32; 3] = point([1.0, 2.5][i % 2]);
        let target: [f32; 3] = point(0.9);
        let mut ray = Ray::new(origin, std::array::from_fn(|k| target[k] - origin[k]));
        match i % 8 {
            0 => ray.direction = [half[0], -0.0, 0.0],
            1 => ray.direction = [0.0, -half[1], half[2]],
            2 => ray.t_min = f32::NEG_INFINITY,
            3 => ray.t_max = 1.0,
            _ => {
                // A tile: one origin and neighbouring directions.
                let step = |k: usize| half[k] * [0.0, 0.01, -0.02, 0.03][(i + k) % 4];
                ray.origin = std::array::from_fn(|k| center[k] - [3.0, 2.5, 1.5][k] * half[k]);
                ray.direction =
                    std::array::from_fn(|k| [3.0, 2.5, 1.5][k] * half[k] + 3.0 * step(k));
            }
        }
        rays.push(ray);
    }
    // Put in invalid rays now and then.
    let odd = [
        [f32::NAN, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, -0.0, 0.0, 1.0],
        [1e30, 1e30, 1e30, 0.0, -1.0, -1.0, -1.0, f32::INFINITY],
        [0.0, 0.0, 0.0, -1e30, 1e-45, 1e-45, 1.0, 1e30],
        [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.5],
    ];
    for (slot, [x, y, z, t_min, dx, dy, dz, t_max]) in rays.iter_mut().skip(6).step_by(13).zip(odd)
    {
        *slot = Ray { origin: [x, y, z], t_min, direction: [dx, dy, dz], t_max };
    }
    rays
}
