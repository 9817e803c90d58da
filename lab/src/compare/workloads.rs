//! The rays that every system traces.
//!
//! Primary rays are made tile by tile while they are traced, as a renderer does. The others are
//! made once, beforehand: they are the same for all systems and in none of the times. Nothing here
//! depends on a clock or on the machine.

use anyhow::{Context as _, Result};
use clap::ValueEnum;
use hgrid_core::{Config, Grid, Hit, Method, Ray, TriangleMesh};
use serde::Serialize;

use super::input::Input;
use super::system::is_hit;
use crate::regions::Regions;
use crate::scene::Bounds;
use crate::shade::normal_of;
use crate::tiles::Tiles;
use crate::vector::{Vector, cross, dot, length, offset, round, unit};

/// The length of an ambient occlusion ray, as a part of the diagonal of the scene's box.
pub const AO_REACH: f64 = 0.1;

/// How far from its surface such a ray starts, likewise: far above rounding, far below triangles.
const AO_START: f64 = 1e-5;

/// What is asked of a system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Workload {
    /// One ray through every pixel, closest hit, shaded.
    Primary,
    /// Ambient occlusion: one short ray from every primary hit, any hit.
    Ao,
    /// Rays from one random point of the scene's box toward another, closest hit.
    Random,
}

impl Workload {
    /// In the order in which they are measured.
    pub const ALL: [Self; 3] = [Self::Primary, Self::Ao, Self::Random];

    /// The word that tables use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Ao => "ao",
            Self::Random => "random",
        }
    }
}

/// The rays of a scene, and the answers that hgrid gives.
#[derive(Debug)]
pub struct Rays {
    /// The picture of the primary rays.
    pub tiles: Tiles,
    /// One from every primary hit.
    pub ao: Vec<Ray>,
    /// From points toward points.
    pub random: Vec<Ray>,
    /// The answers to the primary rays, row by row.
    pub primary_hits: Vec<Hit>,
    /// The answers to the others, in their order.
    pub ao_occluded: Vec<bool>,
    /// The answers to the others, in their order.
    pub random_hits: Vec<Hit>,
    /// From the smallest to the largest coordinates of the scene.
    pub diagonal: f64,
}

impl Rays {
    /// Makes the rays with the help of a brick grid, which takes any scene.
    ///
    /// # Errors
    /// If the grid cannot be built, or the scene has no finite vertex.
    pub fn new(input: &Input, bounds: Bounds, tiles: Tiles, count: usize) -> Result<Self> {
        let mesh = input.mesh()?;
        let memory =
            Regions::build(mesh, &Config::new(Method::Brick)).context("no grid for the rays")?;
        let grid = Grid::open(&memory.index, mesh)?;
        let closest = |ray: &Ray| grid.intersect(ray).unwrap_or(Hit::MISS);

        let (min, max) = bounds;
        let extent = [0, 1, 2].map(|axis| f64::from(max[axis]) - f64::from(min[axis]));
        let diagonal = length(extent);
        let mut primary_hits = vec![Hit::MISS; tiles.pixels()];
        let mut ao = Vec::new();
        tiles.each(|rays, pixels| {
            for (ray, &pixel) in rays.iter().zip(pixels) {
                let hit = closest(ray);
                primary_hits[pixel] = hit;
                ao.extend(is_hit(&hit).then(|| ao_ray(mesh, ray, &hit, pixel, diagonal)).flatten());
            }
        });
        let random = random_rays(bounds, count);
        let ao_occluded = ao.iter().map(|ray| grid.occluded(ray)).collect();
        let random_hits = random.iter().map(closest).collect();
        Ok(Self { tiles, ao, random, primary_hits, ao_occluded, random_hits, diagonal })
    }

    /// How many rays a workload has.
    #[must_use]
    pub fn count(&self, workload: Workload) -> usize {
        match workload {
            Workload::Primary => self.primary_hits.len(),
            Workload::Ao => self.ao.len(),
            Workload::Random => self.random.len(),
        }
    }
}

/// A ray from a hit into the half space above its surface, by the cosine of the angle.
fn ao_ray(
    mesh: TriangleMesh<'_>,
    ray: &Ray,
    hit: &Hit,
    pixel: usize,
    diagonal: f64,
) -> Option<Ray> {
    let direction = ray.direction.map(f64::from);
    let normal = normal_of(&mesh.triangle(hit.primitive)?)?;
    let normal = if dot(normal, direction) > 0.0 { normal.map(|c| -c) } else { normal };

    // A point of the unit disk, lifted onto the hemisphere.
    let mut random = Random(pixel as u64);
    let (radius, angle) = (random.next().sqrt(), core::f64::consts::TAU * random.next());
    let height = (1.0 - radius * radius).max(0.0).sqrt();
    let side = if normal[0].abs() < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let side = unit(cross(normal, side))?;
    let other = cross(normal, side);
    let direction = offset(normal.map(|c| c * height), radius * angle.cos(), side);
    let direction = offset(direction, radius * angle.sin(), other);

    let point = offset(ray.origin.map(f64::from), f64::from(hit.t), ray.direction.map(f64::from));
    let origin = offset(point, AO_START * diagonal, normal);
    Some(Ray { t_max: narrow(AO_REACH * diagonal), ..Ray::new(round(origin), round(direction)) })
}

/// Rays of unit direction from one point of the box toward another, without an end.
fn random_rays((min, max): Bounds, count: usize) -> Vec<Ray> {
    let mut random = Random(0);
    let mut point = || -> Vector {
        [0, 1, 2].map(|axis| {
            let (min, max) = (f64::from(min[axis]), f64::from(max[axis]));
            min + (max - min) * random.next()
        })
    };
    let rays = (0..count).map(|_| {
        let (from, to) = (point(), point());
        // Two points are the same only in a box without a size; any direction does there.
        let direction = unit(offset(to, -1.0, from)).unwrap_or([0.0, 0.0, 1.0]);
        Ray::new(round(from), round(direction))
    });
    rays.collect()
}

/// Numbers from 0 to 1, always the same ones for the same start (`SplitMix64`).
struct Random(u64);

impl Random {
    #[expect(clippy::cast_precision_loss, reason = "53 bits are what an f64 has")]
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ mixed >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// The nearest length that a ray can have.
#[expect(clippy::cast_possible_truncation, reason = "the rounding that is wanted")]
fn narrow(length: f64) -> f32 {
    length as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Up, View};
    use crate::scene::Scene;

    fn rays(size: u16, count: usize) -> (Rays, Bounds) {
        let scene = Scene::load("procedural:knot:2000").unwrap();
        let bounds = scene.bounds().unwrap();
        let tiles = Tiles { camera: Camera::framing(bounds, View::ThreeQuarter, Up::Y), size };
        (Rays::new(&Input::new(scene), bounds, tiles, count).unwrap(), bounds)
    }

    #[test]
    fn rays_are_the_same_every_time() {
        let [(a, _), (b, _)] = [rays(40, 100), rays(40, 100)];
        assert_eq!((a.ao, a.random), (b.ao, b.random));
        assert_eq!(a.primary_hits, b.primary_hits);
        assert_eq!((a.ao_occluded, a.random_hits), (b.ao_occluded, b.random_hits));
    }

    #[test]
    fn counts_are_those_of_pixels_hits_and_points() {
        let (rays, _) = rays(43, 100);
        let hits = rays.primary_hits.iter().filter(|hit| is_hit(hit)).count();
        assert!((300..900).contains(&hits), "{hits}");
        let counts = Workload::ALL.map(|workload| rays.count(workload));
        assert_eq!(counts, [43 * 43, hits, 100]);
        assert_eq!((rays.ao_occluded.len(), rays.random_hits.len()), (hits, 100));
        let occluded = rays.ao_occluded.iter().filter(|&&is| is).count();
        assert!((hits / 50..hits).contains(&occluded), "{occluded} of {hits}");
    }

    #[test]
    fn rays_stay_where_they_belong() {
        let (rays, (min, max)) = rays(24, 500);
        for ray in &rays.random {
            assert!((0..3).all(|axis| (min[axis]..=max[axis]).contains(&ray.origin[axis])));
        }
        for ray in rays.ao.iter().chain(&rays.random) {
            let direction = ray.direction.map(f64::from);
            assert!((dot(direction, direction) - 1.0).abs() < 1e-5);
        }
        let reach = AO_REACH * rays.diagonal;
        assert!(rays.ao.iter().all(|ray| (f64::from(ray.t_max) / reach - 1.0).abs() < 1e-6));
    }
}
