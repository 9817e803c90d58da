//! The queries that every system answers, and the answers that hgrid gives.
//!
//! Primary rays are made tile by tile during tracing, as in a renderer. The others are made once, beforehand;
//! they are the same for all systems, and no time includes them. Nothing here depends on a clock or on the
//! machine.

use anyhow::{Context as _, Result};
use clap::ValueEnum;
use hgrid_core::{Config, Control, Grid, Hit, Object, Ray, Scene, Shapes};
use serde::Serialize;

use super::agreement::tolerance;
use super::input::Input;
use super::points::Points;
use super::random::Random;
use super::shown::Shown;
use super::spheres::{self, Sphere};
use crate::field::Memory;
use crate::regions::Regions;
use crate::scene::Bounds;
use crate::shade::normal_of;
use crate::tiles::Tiles;
use crate::vector::{Vector, cross, dot, length, offset, round, unit};
use crate::world::on_mesh;

/// The length of an ambient occlusion ray, as a part of the diagonal of the scene's box, or of the mesh's
/// where the scene is a field of its instances.
pub const AO_REACH: f64 = 0.1;

/// The distance of such a ray's start from its surface, as a part of the diagonal of the scene's box, also where the
/// scene is a field: rounding errors grow with coordinates.
const AO_START: f64 = 1e-5;

/// The kinds of queries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Workload {
    /// One ray through every pixel, closest hit, shaded
    Primary,
    /// Ambient occlusion: one short ray from every primary hit, any hit
    Ao,
    /// Diffuse bounces: the rays of ao without an end, closest hit
    Bounce,
    /// Rays from one random point of the scene's box toward another, closest hit
    Random,
    /// Points near the surface, closest point of it
    Near,
    /// Points far outside of the scene, closest point of its surface
    Far,
}

impl Workload {
    /// All of them, in the order of measurement.
    pub const ALL: [Self; 6] =
        [Self::Primary, Self::Ao, Self::Bounce, Self::Random, Self::Near, Self::Far];

    /// Returns the word that tables use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Ao => "ao",
            Self::Bounce => "bounce",
            Self::Random => "random",
            Self::Near => "near",
            Self::Far => "far",
        }
    }

    /// Returns true if the queries are points, not rays.
    #[must_use]
    pub const fn asks_points(self) -> bool {
        matches!(self, Self::Near | Self::Far)
    }
}

/// The number of queries of each workload that does not depend on the picture's size.
#[derive(Debug, Clone, Copy)]
pub struct Amount {
    /// Rays between random points.
    pub random_rays: usize,
    /// Points near the surface.
    pub near_points: usize,
    /// Points far outside.
    pub far_points: usize,
}

impl Amount {
    /// The full amounts: as many random rays as a picture of 1024 x 1024 has. Far points are few, because a
    /// grid has to search much of the mesh for each.
    const FULL: Self = Self { random_rays: 1 << 20, near_points: 1 << 15, far_points: 1 << 11 };

    /// Returns the full amounts of these workloads, and 0 for the others.
    #[must_use]
    pub fn of(workloads: &[Workload]) -> Self {
        let full = |workload, count| if workloads.contains(&workload) { count } else { 0 };
        Self {
            random_rays: full(Workload::Random, Self::FULL.random_rays),
            near_points: full(Workload::Near, Self::FULL.near_points),
            far_points: full(Workload::Far, Self::FULL.far_points),
        }
    }
}

/// Queries, and hgrid's answers in their order.
#[derive(Debug, PartialEq)]
pub struct Asked<Q, A> {
    /// Rays or points.
    pub questions: Vec<Q>,
    /// The answers of the default method.
    pub answers: Vec<A>,
}

impl<Q, A> Asked<Q, A> {
    pub(super) fn new(questions: Vec<Q>, answer: impl Fn(&Q) -> A) -> Self {
        let answers = questions.iter().map(answer).collect();
        Self { questions, answers }
    }
}

/// The workloads of a scene.
#[derive(Debug)]
pub struct Rays {
    /// The picture of the primary rays.
    pub tiles: Tiles,
    /// The answers to the primary rays, row by row.
    pub primary_hits: Vec<Hit>,
    /// One ray from every primary hit, and 1 if it is occluded.
    pub ao: Asked<Ray, u8>,
    /// The same rays, unlimited.
    pub bounce: Asked<Ray, Hit>,
    /// Rays from random points toward others.
    pub random: Asked<Ray, Hit>,
    /// Points near the surface.
    pub near: Points,
    /// Points far outside.
    pub far: Points,
    /// The largest distance between hits, and between closest points, that count as the same.
    pub tolerance: f64,
}

impl Rays {
    /// Makes the rays with the help of the default method, which takes any scene.
    ///
    /// # Errors
    /// If the grid cannot be built, or the scene has no finite vertex.
    pub fn new(input: &Input, bounds: Bounds, tiles: Tiles, amount: Amount) -> Result<Self> {
        let mesh = input.mesh()?;
        let regions =
            Regions::build(mesh, &Config::default()).context("no structure for the rays")?;
        let grid = Grid::open(&regions.index, mesh)?;
        let objects = [Object::Grid(&grid)];
        let count = u32::try_from(input.instances().len())?;
        let (config, control) = (Config::default(), Control::default());
        let mut memory = Memory::new(count, &config, 1)?;
        let mut of_spheres = spheres::Memory::new(input.spheres(), &config)?;
        let asked = match input.shown() {
            Shown::Mesh => Asks::Mesh(grid),
            Shown::Instances(_) => {
                Asks::Field(memory.build(input.instances(), &objects, &config, &control)?)
            }
            Shown::Spheres => {
                let spheres = input.spheres();
                Asks::Spheres(of_spheres.build(spheres, &config)?, spheres)
            }
        };
        let closest = |ray: &Ray| asked.closest(ray).0;

        let diagonal = diagonal_of(bounds);
        let mut primary_hits = vec![Hit::MISS; tiles.pixels()];
        let mut bounce = Vec::new();
        tiles.each(|rays, pixels| {
            for (ray, &pixel) in rays.iter().zip(pixels) {
                let (hit, normal) = asked.closest(ray);
                primary_hits[pixel] = hit;
                bounce.extend(
                    normal.and_then(|normal| bounce_ray(normal, ray, &hit, pixel, diagonal)),
                );
            }
        });
        // A tenth of the mesh, not of the field: the rays find nearby occluders.
        let of_mesh = if count > 0 { diagonal_of(grid.bounds()) } else { diagonal };
        let t_max = narrow(AO_REACH * of_mesh);
        let ao = bounce.iter().map(|&ray| Ray { t_max, ..ray }).collect();
        Ok(Self {
            tiles,
            primary_hits,
            ao: Asked::new(ao, |ray| asked.occluded(ray).into()),
            bounce: Asked::new(bounce, closest),
            random: Asked::new(random_rays(bounds, amount.random_rays), closest),
            near: Points::near(&grid, diagonal, amount.near_points),
            far: Points::far(&grid, bounds, diagonal, amount.far_points),
            tolerance: tolerance(of_mesh, diagonal),
        })
    }

    /// Counts the rays or points of a workload.
    #[must_use]
    pub fn count(&self, workload: Workload) -> usize {
        match workload {
            Workload::Primary => self.primary_hits.len(),
            Workload::Ao => self.ao.questions.len(),
            Workload::Bounce => self.bounce.questions.len(),
            Workload::Random => self.random.questions.len(),
            Workload::Near => self.near.asked.questions.len(),
            Workload::Far => self.far.asked.questions.len(),
        }
    }
}

/// The structure that gives the answers: the default method on the mesh, a scene of its instances, or a tree
/// over spheres.
enum Asks<'a> {
    Mesh(Grid<'a>),
    Field(Scene<'a>),
    Spheres(Shapes<'a>, &'a [Sphere]),
}

impl Asks<'_> {
    /// Returns the closest hit, and the normal there unless its triangle has no area.
    fn closest(&self, ray: &Ray) -> (Hit, Option<Vector>) {
        match self {
            Self::Mesh(grid) => {
                let hit = grid.intersect(ray).unwrap_or(Hit::MISS);
                let triangle = grid.mesh().triangle(hit.primitive);
                (hit, triangle.and_then(|triangle| normal_of(&triangle)))
            }
            Self::Field(scene) => {
                let found = scene.intersect(&ray.into());
                let normal = found.and_then(|hit| scene.triangle_normal(&hit));
                (found.map_or(Hit::MISS, on_mesh), normal.map(|normal| normal.map(f64::from)))
            }
            Self::Spheres(shapes, spheres) => {
                let hit = shapes.intersect(ray, &mut spheres::test(spheres)).unwrap_or(Hit::MISS);
                let sphere = spheres.get(hit.primitive as usize);
                (hit, sphere.and_then(|sphere| sphere.normal_at(ray, hit.t)))
            }
        }
    }

    fn occluded(&self, ray: &Ray) -> bool {
        match self {
            Self::Mesh(grid) => grid.occluded(ray),
            Self::Field(scene) => scene.occluded(&ray.into()),
            Self::Spheres(shapes, spheres) => shapes.occluded(ray, &mut spheres::test(spheres)),
        }
    }
}

/// Returns the length of a box's diagonal.
fn diagonal_of((min, max): Bounds) -> f64 {
    length([0, 1, 2].map(|axis| f64::from(max[axis]) - f64::from(min[axis])))
}

/// Makes a ray from a hit into the half space above its surface, with a cosine distribution.
fn bounce_ray(normal: Vector, ray: &Ray, hit: &Hit, pixel: usize, diagonal: f64) -> Option<Ray> {
    let direction = ray.direction.map(f64::from);
    let normal = if dot(normal, direction) > 0.0 { normal.map(|c| -c) } else { normal };

    // A point of the unit disk, lifted onto the hemisphere.
    let mut random = Random::new(pixel as u64);
    let (radius, angle) = (random.next().sqrt(), core::f64::consts::TAU * random.next());
    let height = (1.0 - radius * radius).max(0.0).sqrt();
    let side = if normal[0].abs() < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let side = unit(cross(normal, side))?;
    let other = cross(normal, side);
    let direction = offset(normal.map(|c| c * height), radius * angle.cos(), side);
    let direction = offset(direction, radius * angle.sin(), other);

    let point = offset(ray.origin.map(f64::from), f64::from(hit.t), ray.direction.map(f64::from));
    let origin = offset(point, AO_START * diagonal, normal);
    Some(Ray::new(round(origin), round(direction)))
}

/// Makes rays of unit direction from one point of the box toward another, unlimited.
fn random_rays(bounds: Bounds, count: usize) -> Vec<Ray> {
    let mut random = Random::new(0);
    let rays = (0..count).map(|_| {
        let (from, to) = (random.point(bounds), random.point(bounds));
        // Two points are the same only if the box has no size; any direction will do then.
        let direction = unit(offset(to, -1.0, from)).unwrap_or([0.0, 0.0, 1.0]);
        Ray::new(round(from), round(direction))
    });
    rays.collect()
}

/// Rounds a length to that of a ray.
#[expect(clippy::cast_possible_truncation, reason = "the rounding that is wanted")]
pub(super) fn narrow(length: f64) -> f32 {
    length as f32
}

#[cfg(test)]
mod tests {
    use super::super::system::is_hit;
    use super::*;
    use crate::camera::{Camera, Up, View};
    use crate::scene::Scene;

    fn rays(size: u16, random_rays: usize) -> (Rays, Bounds) {
        let scene = Scene::load("procedural:knot:2000").unwrap();
        let bounds = scene.bounds().unwrap();
        let tiles = Tiles { camera: Camera::framing(bounds, View::ThreeQuarter, Up::Y), size };
        let amount = Amount { random_rays, near_points: 30, far_points: 20 };
        (Rays::new(&Input::new(scene), bounds, tiles, amount).unwrap(), bounds)
    }

    #[test]
    fn rays_are_the_same_every_time() {
        let [(a, _), (b, _)] = [rays(40, 100), rays(40, 100)];
        assert_eq!(a.primary_hits, b.primary_hits);
        assert_eq!((a.ao, a.bounce, a.random), (b.ao, b.bounce, b.random));
        assert_eq!((a.near, a.far), (b.near, b.far));
    }

    #[test]
    fn counts_are_those_of_pixels_hits_and_points() {
        let (rays, _) = rays(43, 100);
        let hits = rays.primary_hits.iter().filter(|hit| is_hit(hit)).count();
        assert!((300..900).contains(&hits), "{hits}");
        let counts = Workload::ALL.map(|workload| rays.count(workload));
        assert_eq!(counts, [43 * 43, hits, hits, 100, 30, 20]);
        assert_eq!((rays.ao.answers.len(), rays.random.answers.len()), (hits, 100));
        let occluded = rays.ao.answers.iter().map(|&is| usize::from(is)).sum();
        let bounced = rays.bounce.answers.iter().filter(|hit| is_hit(hit)).count();
        assert!((hits / 50..bounced).contains(&occluded), "{occluded}, {bounced} of {hits}");
        assert!(bounced < hits, "{bounced} of {hits}");
    }

    #[test]
    fn rays_stay_where_they_belong() {
        let (rays, (min, max)) = rays(24, 500);
        for ray in &rays.random.questions {
            assert!((0..3).all(|axis| (min[axis]..=max[axis]).contains(&ray.origin[axis])));
        }
        let Rays { ao, bounce, random, .. } = &rays;
        for ray in bounce.questions.iter().chain(&random.questions) {
            let direction = ray.direction.map(f64::from);
            assert!((dot(direction, direction) - 1.0).abs() < 1e-5);
        }
        let reach = AO_REACH * diagonal_of((min, max));
        for (short, long) in ao.questions.iter().zip(&bounce.questions) {
            assert!((f64::from(short.t_max) / reach - 1.0).abs() < 1e-6);
            assert_eq!(Ray { t_max: f32::INFINITY, ..*short }, *long);
        }
    }
}
