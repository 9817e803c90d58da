//! Points for queries of the closest point of the surface.

use hgrid_core::{Grid, QueryOptions};

use super::random::Random;
use super::workloads::{Asked, narrow};
use crate::scene::Bounds;
use crate::vector::{Vector, length, offset, round};

/// The largest distance of near points from the surface, and the radius of their search, as parts of the
/// diagonal of the scene's box.
const NEAR: f64 = 0.01;
const NEAR_RADIUS: f64 = 0.1;

/// The least and the largest distance of far points from the middle of the box, and their radius, likewise.
const FAR: [f64; 2] = [1.0, 3.0];
const FAR_RADIUS: f64 = 4.0;

/// Points, and their distances to the surface by hgrid.
#[derive(Debug, PartialEq)]
pub struct Points {
    /// The radius of the search.
    pub radius: f32,
    /// Points and distances; a distance is infinite if the surface is outside the radius.
    pub asked: Asked<[f32; 3], f32>,
}

impl Points {
    /// Makes points near random triangles.
    pub(super) fn near(grid: &Grid<'_>, diagonal: f64, count: usize) -> Self {
        let mesh = grid.mesh();
        let mut random = Random::new(1);
        let points = (0..count).filter_map(|_| {
            let [a, b, c] = mesh.triangle(random.below(mesh.triangle_count()))?;
            let [a, b, c] = [a, b, c].map(|corner| corner.map(f64::from));
            let (u, v) = (random.next(), random.next());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let on = offset(a.map(|x| x * (1.0 - u - v)), u, b);
            let point = round(offset(offset(on, v, c), NEAR * diagonal, random.in_ball()));
            point.iter().all(|c| c.is_finite()).then_some(point)
        });
        Self::new(grid, points.collect(), NEAR_RADIUS * diagonal)
    }

    /// Makes points in all directions, far from the box.
    pub(super) fn far(grid: &Grid<'_>, (min, max): Bounds, diagonal: f64, count: usize) -> Self {
        let middle = [0, 1, 2].map(|axis| 0.5 * f64::from(min[axis]) + 0.5 * f64::from(max[axis]));
        let mut random = Random::new(2);
        let [least, most] = FAR;
        let points = (0..count).map(|_| {
            let toward = random.in_ball();
            let distance = diagonal * (least + (most - least) * random.next());
            round(offset(middle, distance / length(toward).max(f64::MIN_POSITIVE), toward))
        });
        Self::new(grid, points.collect(), FAR_RADIUS * diagonal)
    }

    fn new(grid: &Grid<'_>, points: Vec<[f32; 3]>, radius: f64) -> Self {
        let radius = narrow(radius);
        Self { radius, asked: Asked::new(points, |&point| distance(grid, point, radius)) }
    }
}

/// Returns the distance to the surface of a grid, infinite beyond the radius.
pub(super) fn distance(grid: &Grid<'_>, point: [f32; 3], radius: f32) -> f32 {
    let closest = grid.closest_point(point, radius, &mut QueryOptions::default());
    closest.map_or(f32::INFINITY, |closest| closest.distance)
}

impl Random {
    /// Returns a point of the unit ball.
    fn in_ball(&mut self) -> Vector {
        loop {
            let point = self.point(([-1.0; 3], [1.0; 3]));
            if length(point) <= 1.0 {
                return point;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use hgrid_core::{Config, TriangleMesh};

    use super::*;
    use crate::regions::Regions;
    use crate::scene::Scene;

    #[test]
    fn near_points_are_near_and_far_points_are_far_and_all_find_the_surface() {
        let scene = Scene::load("procedural:knot:2000").unwrap();
        let bounds = scene.bounds().unwrap();
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).unwrap();
        let regions = Regions::build(mesh, &Config::default()).unwrap();
        let grid = Grid::open(&regions.index, mesh).unwrap();
        let near = Points::near(&grid, 10.0, 200);
        let far = Points::far(&grid, bounds, 10.0, 50);
        assert_eq!((near.asked.answers.len(), far.asked.answers.len()), (200, 50));
        assert!(near.asked.answers.iter().all(|distance| (0.0..0.1001).contains(distance)));
        assert!(far.asked.answers.iter().all(|distance| (3.0..40.0).contains(distance)));
        assert!(distance(&grid, far.asked.questions[0], 1.0).is_infinite());
    }
}
