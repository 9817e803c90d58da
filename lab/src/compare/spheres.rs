//! Spheres in place of triangles: a user-defined shape, and hgrid's tree over them.
//!
//! ```text
//! triangle -> sphere -> box: hgrid writes all boxes into memory, Embree asks for them one by one
//!                    -> meet: the test by which all systems find hits
//! ```

use core::cell::RefCell;

use anyhow::{Context as _, Result};
use hgrid_core::{
    Boxes, Config, Hit, QueryOptions, Ray, ShapeHit, Shapes, Sizes, Strided, StridedMut, Triangle,
};
use memmap2::MmapMut;

use super::grid::Call;
use super::input::Input;
use super::mode::Mode;
use super::system::{Bytes, Tracer, Use, each};
use super::workloads::narrow;
use crate::regions::{Regions, memory};
use crate::shade::normal_of;
use crate::vector::{Vector, dot, length, offset, round, unit};

/// Bytes of a box: six floats.
const BOX_BYTES: usize = 24;

/// A sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    center: [f32; 3],
    /// The radius; a sphere of radius zero is never hit.
    radius: f32,
}

impl Sphere {
    /// Makes the sphere around the mean of a triangle's corners. The radius is half of its longest edge, or
    /// zero if the triangle has no area or is not finite.
    #[must_use]
    pub fn of(triangle: &Triangle) -> Self {
        let corners = triangle.map(|corner| corner.map(f64::from));
        let [a, b, c] = corners;
        let center = round([0, 1, 2].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0));
        let edges = [(a, b), (b, c), (c, a)].map(|(from, to)| length(offset(to, -1.0, from)));
        let radius = narrow(0.5 * edges.into_iter().fold(0.0, f64::max));
        let is_finite = corners.as_flattened().iter().all(|c| c.is_finite()) && radius.is_finite();
        let is_round = is_finite && normal_of(triangle).is_some();
        Self { center, radius: if is_round { radius } else { 0.0 } }
    }

    /// Returns the box: least x, y, z, then greatest, rounded outward.
    #[must_use]
    pub fn box_of(&self) -> [f32; 6] {
        let [low, high] = [
            self.center.map(|c| (c - self.radius).next_down()),
            self.center.map(|c| (c + self.radius).next_up()),
        ];
        [low[0], low[1], low[2], high[0], high[1], high[2]]
    }

    /// Finds the first of the two places where a ray meets the sphere that lies in the ray's range.
    #[inline]
    #[must_use]
    pub fn meet(&self, ray: &Ray) -> Option<ShapeHit> {
        let direction = ray.direction.map(f64::from);
        let at = self.away(ray.origin.map(f64::from));
        let radius = f64::from(self.radius);
        let (a, b, c) =
            (dot(direction, direction), dot(at, direction), dot(at, at) - radius * radius);
        let square = b * b - a * c;
        if square < 0.0 || radius <= 0.0 {
            return None;
        }
        let root = square.sqrt();
        let places = [(-b - root) / a, (-b + root) / a].map(narrow);
        let t = places.into_iter().find(|t| (ray.t_min..=ray.t_max).contains(t))?;
        Some(ShapeHit { t, u: 0.0, v: 0.0 })
    }

    /// Returns the unit normal where a ray hits the sphere.
    pub(super) fn normal_at(&self, ray: &Ray, t: f32) -> Option<Vector> {
        let [origin, direction] = [ray.origin, ray.direction].map(|v| v.map(f64::from));
        unit(self.away(offset(origin, f64::from(t), direction)))
    }

    /// Returns the vector from the centre to a point.
    #[inline]
    fn away(&self, point: Vector) -> Vector {
        [0, 1, 2].map(|axis| point[axis] - f64::from(self.center[axis]))
    }
}

/// Memory for a tree over spheres and for their boxes.
pub(super) struct Memory {
    boxes: MmapMut,
    regions: Regions,
}

impl Memory {
    /// Allocates enough for these spheres.
    pub(super) fn new(spheres: &[Sphere], config: &Config) -> Result<Self> {
        let regions = Regions::of(bound(spheres, config)?)?;
        Ok(Self { boxes: memory(BOX_BYTES * spheres.len())?, regions })
    }

    /// Writes the boxes and builds.
    pub(super) fn build(&mut self, spheres: &[Sphere], config: &Config) -> Result<Shapes<'_>> {
        let Self { boxes, regions: Regions { index, scratch } } = self;
        for (sphere, place) in spheres.iter().zip(boxes.as_chunks_mut::<BOX_BYTES>().0) {
            let sides = place.as_chunks_mut::<4>().0;
            for (side, number) in sides.iter_mut().zip(sphere.box_of()) {
                *side = number.to_ne_bytes();
            }
        }
        let boxes = Strided { bytes: boxes, stride: BOX_BYTES, count: spheres.len() };
        Ok(Shapes::build(Boxes::strided(boxes)?, config, index, scratch)?)
    }
}

/// Returns the memory that is enough for a tree over these spheres.
fn bound(spheres: &[Sphere], config: &Config) -> Result<Sizes> {
    let count = u32::try_from(spheres.len())?;
    Sizes::bound(count, config).context("too many spheres")
}

/// Builds a tree over the spheres and calls `then` with it. With `start`, builds it twice: calls `start`
/// between the two, so that the second build alone is timed, in memory that the first one has written.
pub(super) fn build(
    input: &Input,
    config: &Config,
    start: Option<&mut dyn FnMut()>,
    then: &mut Use<'_>,
) -> Result<()> {
    let spheres = input.spheres();
    let mut memory = Memory::new(spheres, config)?;
    if let Some(start) = start {
        memory.build(spheres, config)?;
        start();
    }
    let shapes = memory.build(spheres, config)?;
    then(&SphereTracer { shapes, spheres, config, memory: RefCell::default() })
}

struct SphereTracer<'a> {
    shapes: Shapes<'a>,
    spheres: &'a [Sphere],
    config: &'a Config,
    /// Memory to sort rays in, kept from call to call.
    memory: RefCell<Vec<u8>>,
}

/// Returns the test of spheres.
pub(super) fn test(spheres: &[Sphere]) -> impl FnMut(u32, &Ray) -> Option<ShapeHit> + '_ {
    |id, ray| spheres.get(id as usize)?.meet(ray)
}

impl Tracer for SphereTracer<'_> {
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]) {
        let test = &mut test(self.spheres);
        let Some(call) = Call::of(mode) else {
            return each(rays, hits, |ray| self.shapes.intersect(ray, test).unwrap_or(Hit::MISS));
        };
        let memory = &mut self.memory.borrow_mut();
        let scratch = call.memory(rays.len(), memory);
        let options = &mut QueryOptions { scratch, ..QueryOptions::default() };
        for (rays, hits) in rays.chunks(call.rays).zip(hits.chunks_mut(call.rays)) {
            let (rays, answers) = (&Strided::new(rays), &mut StridedMut::new(&mut *hits));
            if self.shapes.intersect_n_with(rays, answers, call.coherence, options, test).is_err() {
                hits.fill(Hit::MISS);
            }
        }
    }

    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [u8]) {
        let test = &mut test(self.spheres);
        let Some(call) = Call::of(mode) else {
            return each(rays, occluded, |ray| self.shapes.occluded(ray, test).into());
        };
        let memory = &mut self.memory.borrow_mut();
        let scratch = call.memory(rays.len(), memory);
        let options = &mut QueryOptions { scratch, ..QueryOptions::default() };
        for (rays, occluded) in rays.chunks(call.rays).zip(occluded.chunks_mut(call.rays)) {
            let (rays, answers) = (&Strided::new(rays), &mut StridedMut::new(&mut *occluded));
            if self.shapes.occluded_n_with(rays, answers, call.coherence, options, test).is_err() {
                occluded.fill(0);
            }
        }
    }

    /// Returns the bytes of the tree and of the boxes, which traversal reads.
    fn bytes(&self) -> Result<Option<Bytes>> {
        let Self { shapes, spheres, config, .. } = self;
        let (index, boxes) = (shapes.blob().len(), BOX_BYTES * spheres.len());
        let regions = Regions::counted(bound(spheres, config)?)?;
        let mut memory = Memory { regions, ..Memory::new(spheres, config)? };
        memory.build(spheres, config)?;
        let peak = memory.regions.written_bytes(index);
        Ok(Some(Bytes { index: index + boxes, peak: peak + boxes }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::shown::Shown;
    use crate::scene::Scene;

    const TRIANGLE: Triangle = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

    #[test]
    fn a_sphere_follows_from_its_triangle() {
        let sphere = Sphere::of(&TRIANGLE);
        assert_eq!(sphere, Sphere { center: [1.0, 4.0 / 3.0, 0.0], radius: 2.5 });
        let nan = f32::NAN;
        let far = 3e38;
        for triangle in [
            [TRIANGLE[0]; 3],
            [[0.0; 3], [1.0, 2.0, 3.0], [2.0, 4.0, 6.0]],
            [TRIANGLE[0], TRIANGLE[1], [nan, 4.0, 0.0]],
            [TRIANGLE[0], TRIANGLE[1], [0.0, f32::INFINITY, 0.0]],
            [[-far; 3], [far; 3], [far, -far, far]],
        ] {
            let sphere = Sphere::of(&triangle);
            assert_eq!(sphere.radius.to_bits(), 0, "{triangle:?}");
            let ray = Ray::new([-9.0, -9.0, 0.0], [9.0, 9.0, 0.0]);
            assert_eq!(sphere.meet(&ray), None);
            let through = Ray { origin: sphere.center.map(|c| c - 1.0), ..ray };
            assert_eq!(sphere.meet(&Ray { direction: [1.0; 3], ..through }), None);
        }
    }

    #[test]
    fn boxes_hold_their_spheres() {
        let scene = Scene::load("procedural:soup:3000").unwrap();
        let input = Input::of(scene, Shown::Spheres, None);
        assert_eq!(input.spheres().len(), 3000);
        for sphere in input.spheres() {
            let sides = sphere.box_of().map(f64::from);
            for axis in 0..3 {
                let (c, r) = (f64::from(sphere.center[axis]), f64::from(sphere.radius));
                assert!(r > 0.0 && sides[axis] < c - r && sides[axis + 3] > c + r, "{sphere:?}");
                // The error is at most a few steps of a coordinate.
                let most = 4.0 * f64::from(f32::EPSILON) * (c.abs() + r);
                assert!(sides[axis] > c - r - most && sides[axis + 3] < c + r + most);
            }
        }
    }

    #[test]
    fn the_first_place_in_the_range_is_the_hit() {
        let sphere = Sphere { center: [1.0, 2.0, 3.0], radius: 2.0 };
        let ray = Ray { t_min: 0.0, ..Ray::new([1.0, 2.0, -3.0], [0.0, 0.0, 2.0]) };
        let t = |ray: Ray| sphere.meet(&ray).map(|hit| (hit.t, hit.u, hit.v));
        assert_eq!(t(ray), Some((2.0, 0.0, 0.0)));
        assert_eq!(t(Ray { t_min: 2.0, ..ray }), Some((2.0, 0.0, 0.0)));
        assert_eq!(t(Ray { t_min: 2.1, ..ray }), Some((4.0, 0.0, 0.0)));
        assert_eq!(t(Ray { t_min: 4.1, ..ray }), None);
        assert_eq!(t(Ray { t_max: 1.9, ..ray }), None);
        assert_eq!(t(Ray { origin: [3.1, 2.0, -3.0], ..ray }), None);
        assert_eq!(t(Ray { direction: [0.0; 3], ..ray }), None);
        assert_eq!(sphere.normal_at(&ray, 2.0), Some([0.0, 0.0, -1.0]));
    }

    #[test]
    fn a_tree_answers_as_a_loop_over_all_spheres() {
        let input = Input::of(Scene::load("procedural:soup:400").unwrap(), Shown::Spheres, None);
        let (spheres, config) = (input.spheres(), Config::default());
        let mut memory = Memory::new(spheres, &config).unwrap();
        let shapes = memory.build(spheres, &config).unwrap();
        let mut hits = 0;
        for number in 0..200_u8 {
            let [x, y] = [number % 20, number / 20 * 2].map(|c| f32::from(c) * 0.1 - 0.95);
            let ray = Ray::new([x, y, 9.0], [0.01, 0.02, -1.0]);
            let all = spheres.iter().filter_map(|sphere| sphere.meet(&ray).map(|hit| hit.t));
            let found = shapes.intersect(&ray, &mut test(spheres)).map(|hit| hit.t);
            assert_eq!(found, all.reduce(f32::min));
            hits += u32::from(found.is_some());
        }
        assert!(hits > 20, "{hits}");
    }
}
