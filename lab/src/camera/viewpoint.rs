//! The default camera of a scene: it looks at things and into rooms.
//!
//! ```text
//! flat, as a map          from above, at an angle
//! a room with an open side    in through that side
//! a room                  from within: the place and the direction that see farthest
//! a sheet that faces x    from the right, a little above
//! a box                   so that three of its sides are seen
//! anything else           from the front, a little above
//! ```
//!
//! Seen from its middle, a room shows the fronts of its triangles, and a solid shows backs. Rays from the
//! middle tell them apart.

use hgrid_core::{Ray, SceneHit};

use super::view::{half_extent, is_flat};
use super::{Camera, Lens, Point, Up, View};
use crate::scene::Bounds;
use crate::vector::{Vector, offset, round};
use crate::world::World;

/// Rays from a point in all directions.
const AROUND: u16 = 256;

/// Level rays that look for an open side.
const LEVEL: u16 = 72;

/// The least part of all directions in which the middle of a room sees walls.
const ENCLOSED: f64 = 0.75;

/// The least number of level rays that pass through an open side.
const OPEN_SIDE: u16 = LEVEL / 12;

/// The view of a thing that is not flat.
const THING: View = View::Angles { azimuth: 15.0, elevation: 12.0 };

/// The view of a box. From the view of a thing, the front of a box would hide its other sides.
const BOX: View = View::Angles { azimuth: 30.0, elevation: 25.0 };

/// The places on each side of a box that are tried, as parts of its size, and the depth to which they lie on it.
const ON_SIDE: [f32; 3] = [0.1, 0.5, 0.9];
const BOX_DEPTH: f32 = 0.01;

/// The view of a sheet that stands on edge toward the viewer, and the largest part of its height and depth that
/// its width is: a wall that faces x.
const SHEET: View = View::Angles { azimuth: 75.0, elevation: 12.0 };
const SHEET_WIDTH: f64 = 0.05;

/// The view of a flat scene.
const MAP: View = View::Angles { azimuth: 25.0, elevation: 35.0 };

/// The lens of a room, from edge to edge in degrees.
const ROOM_DEGREES: &str = "70";

/// Places in a room, as parts of its size: along both level axes, and upward.
const ALONG: [f64; 5] = [0.12, 0.3, 0.5, 0.7, 0.88];
const UPWARD: [f64; 2] = [0.2, 0.35];

/// The directions in which the camera looks from each place.
const AZIMUTHS: u16 = 16;

/// Rays on each side of a coarse picture from a place.
const COARSE: u16 = 8;

/// Returns the camera that shows a part of a scene.
#[must_use]
pub fn choose(world: World<'_>, part: Bounds, is_all: bool, up: Up, lens: Option<Lens>) -> Camera {
    let outside = |view| Camera::framing_through(lens.unwrap_or_default(), part, view, up);
    if is_flat(part, up) {
        return outside(MAP);
    }
    let [x, y, z] = up.turned(half_extent(part)).map(f64::abs);
    if x < SHEET_WIDTH * y.min(z) {
        return outside(SHEET);
    }
    let Point(middle) = Point::centre_of(part);
    if !is_all || !is_in_room(world, middle) {
        return outside(if is_box(world, part) { BOX } else { THING });
    }
    match open_side(world, middle, up) {
        Some(azimuth) => outside(View::Angles { azimuth, elevation: 0.0 }),
        None => within(world, part, up, lens).unwrap_or_else(|| outside(THING)),
    }
}

/// Returns true if rays from outside meet a part on all six sides of its bounds.
fn is_box(world: World<'_>, (min, max): Bounds) -> bool {
    let places = || ON_SIDE.into_iter().flat_map(|u| ON_SIDE.map(|v| (u, v)));
    let is_side = |axis: usize, is_far: bool| {
        let size: [f32; 3] = core::array::from_fn(|axis| max[axis] - min[axis]);
        let mut direction = [0.0; 3];
        direction[axis] = if is_far { -1.0 } else { 1.0 };
        places().all(|(u, v)| {
            let mut origin = min;
            origin[axis] = if is_far { max[axis] + size[axis] } else { min[axis] - size[axis] };
            for (axis, part) in [((axis + 1) % 3, u), ((axis + 2) % 3, v)] {
                origin[axis] += part * size[axis];
            }
            let hit = world.closest(&Ray::new(origin, direction));
            hit.is_some_and(|hit| (hit.t - size[axis]).abs() <= BOX_DEPTH * size[axis])
        })
    };
    (0..3).all(|axis| is_side(axis, false) && is_side(axis, true))
}

/// Returns true if the fronts of triangles are around a point in nearly all directions.
fn is_in_room(world: World<'_>, point: Vector) -> bool {
    let (mut fronts, mut backs) = (0, 0);
    for number in 0..AROUND {
        let ray = Ray::new(round(point), round(spread(number)));
        let hit = world.closest(&ray).and_then(|hit| world.surface(&ray, &hit));
        match hit {
            Some(surface) if surface.is_front == 1 => fronts += 1,
            Some(_) => backs += 1,
            None => {}
        }
    }
    f64::from(fronts) >= ENCLOSED * f64::from(AROUND) && backs < AROUND / 8
}

/// Returns one of `AROUND` directions that are spread evenly over the unit sphere.
fn spread(number: u16) -> Vector {
    let height = (2.0 * f64::from(number) + 1.0) / f64::from(AROUND) - 1.0;
    let radius = (1.0 - height * height).sqrt();
    // The golden angle turns each direction from the one before.
    let (sin, cos) = (f64::from(number) * 2.399_963_229_728_653).sin_cos();
    [radius * cos, height, radius * sin]
}

/// Returns the middle, in degrees, of the widest run of level directions in which nothing is hit.
fn open_side(world: World<'_>, middle: Vector, up: Up) -> Option<f64> {
    let degrees = |at: u16| 360.0 * f64::from(at) / f64::from(LEVEL);
    let is_open: Vec<bool> = (0..LEVEL)
        .map(|at| {
            let toward = View::Angles { azimuth: degrees(at), elevation: 0.0 }.toward_eye();
            !world.occluded(&Ray::new(round(middle), round(up.turned_back(toward))))
        })
        .collect();
    let length = |start: u16| {
        let around = (0..LEVEL).map(|step| is_open[usize::from((start + step) % LEVEL)]);
        around.take_while(|&is_open| is_open).count()
    };
    // Of runs of equal length, the one nearest to the front wins.
    let from_front = |start: u16| start.min(LEVEL - start);
    let longest = (0..LEVEL).max_by_key(|&start| (length(start), LEVEL - from_front(start)))?;
    let length = u16::try_from(length(longest)).unwrap_or(LEVEL);
    (length >= OPEN_SIDE).then(|| degrees(longest) + 0.5 * degrees(length - 1))
}

/// Returns the camera in a room that sees farthest. The measure is the harmonic mean of distances, which one
/// close wall makes small.
fn within(world: World<'_>, part: Bounds, up: Up, lens: Option<Lens>) -> Option<Camera> {
    let lens = lens.or_else(|| ROOM_DEGREES.parse().ok())?;
    let (Point(middle), half) = (Point::centre_of(part), up.turned(half_extent(part)));
    let mut best: Option<(f64, Camera)> = None;
    for (x, z, y) in ALONG
        .into_iter()
        .flat_map(|x| ALONG.map(|z| (x, z)))
        .flat_map(|(x, z)| UPWARD.map(|y| (x, z, y)))
    {
        let at = [0, 1, 2].map(|axis| (2.0 * [x, y, z][axis] - 1.0) * half[axis].abs());
        let eye = offset(middle, 1.0, up.turned_back(at));
        if !is_in_room(world, eye) {
            continue;
        }
        for at in 0..AZIMUTHS {
            let azimuth = 360.0 * f64::from(at) / f64::from(AZIMUTHS);
            let away = View::Angles { azimuth, elevation: 0.0 }.toward_eye();
            let target = offset(eye, -1.0, up.turned_back(away));
            let camera = Camera::between(Point(eye), Point(target), up, lens);
            let score = openness(world, &camera);
            if best.as_ref().is_none_or(|&(most, _)| score > most) {
                best = Some((score, camera));
            }
        }
    }
    best.map(|(_, camera)| camera)
}

/// Returns the harmonic mean of the distances that a camera sees.
fn openness(world: World<'_>, camera: &Camera) -> f64 {
    let pixels = (0..COARSE).flat_map(|row| (0..COARSE).map(move |column| (column, row)));
    let nearness = pixels.map(|(column, row)| {
        let ray = camera.ray(column, row, COARSE);
        let Some(SceneHit { t, .. }) = world.closest(&ray) else { return 0.0 };
        1.0 / f64::from(t)
    });
    f64::from(COARSE * COARSE) / nearness.sum::<f64>().max(f64::MIN_POSITIVE)
}

/// Returns the eye of a camera and the direction of its view, for tests of where it looks.
#[cfg(test)]
fn ahead(camera: &Camera) -> (Vector, Vector) {
    let ray = camera.ray(0, 0, 1);
    (
        ray.origin.map(f64::from),
        crate::vector::unit(ray.direction.map(f64::from)).unwrap_or_default(),
    )
}

#[cfg(test)]
mod tests {
    use hgrid_core::{Config, Grid, TriangleMesh};

    use super::*;
    use crate::regions::Regions;
    use crate::scene::Scene;

    /// Makes a box of 8 x 3 x 4 whose fronts are inside, without some of its sides.
    fn room(without: &[usize]) -> Scene {
        let mut scene = Scene::default();
        let corner =
            |bits: u8| [0, 1, 2].map(|axis| [8.0, 3.0, 4.0][axis] * f32::from(bits >> axis & 1));
        scene.positions = (0..8).map(corner).collect();
        // -x, +x, -y, +y, -z, +z
        let sides =
            [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]];
        for (_, [a, b, c, d]) in sides.iter().enumerate().filter(|(at, _)| !without.contains(at)) {
            scene.indices.extend([[*a, *b, *c], [*a, *c, *d]]);
        }
        scene
    }

    fn chosen(scene: &Scene) -> (Vector, Vector) {
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).unwrap();
        let regions = Regions::build(mesh, &Config::default()).unwrap();
        let grid = Grid::open(&regions.index, mesh).unwrap();
        ahead(&choose(World::Mesh(&grid), scene.framed_bounds(), true, Up::Y, None))
    }

    #[test]
    fn a_wall_is_seen_from_its_broad_side() {
        for (without, axis) in [([1, 2, 3, 4, 5], 0), ([0, 1, 2, 3, 5], 2)] {
            let mut wall = room(&without);
            wall.positions.iter_mut().for_each(|corner| corner[axis] = 0.0);
            let (_, along) = chosen(&wall);
            assert!(along[axis] < -0.9, "{along:?}");
        }
    }

    #[test]
    fn rooms_are_seen_from_within_along_their_length() {
        let (eye, along) = chosen(&room(&[]));
        assert!((0..3).all(|axis| eye[axis] > 0.0 && eye[axis] < [8.0, 3.0, 4.0][axis]), "{eye:?}");
        assert!(along[0].abs() > 0.9, "{along:?}");
        // With its triangles reversed, the box is a solid.
        let mut solid = room(&[]);
        solid.indices.iter_mut().for_each(|triangle| triangle.swap(0, 1));
        let (eye, _) = chosen(&solid);
        assert!(eye[2] > 4.0, "{eye:?}");
    }

    #[test]
    fn boxes_show_three_sides_and_things_their_front() {
        let mut solid = room(&[]);
        solid.indices.iter_mut().for_each(|triangle| triangle.swap(0, 1));
        let (eye, along) = chosen(&solid);
        let is_past = (0..3).all(|axis| eye[axis] > 1.2 * [8.0, 3.0, 4.0][axis]);
        assert!(is_past && along[0] < -0.3 && along[1] < -0.3, "{eye:?} {along:?}");
        // A gable roof is no box.
        for corner in solid.positions.iter_mut().filter(|corner| corner[1] > 0.0) {
            corner[2] = 2.0;
        }
        let (_, along) = chosen(&solid);
        assert!(along[0] > -0.3 && along[2] < -0.9, "{along:?}");
    }

    #[test]
    fn open_rooms_are_looked_into() {
        for (side, axis, sign) in [(0, 0, 1.0), (1, 0, -1.0), (4, 2, 1.0), (5, 2, -1.0)] {
            let (eye, along) = chosen(&room(&[side]));
            assert!(along[axis] * sign > 0.95, "{side}: {along:?}");
            assert!(eye[axis] * sign < 0.0 || eye[axis] > 4.0, "{side}: {eye:?}");
        }
    }

    #[test]
    fn flat_scenes_are_seen_from_above_and_things_from_the_front() {
        let mut floor = room(&[0, 1, 3, 4, 5]);
        floor.positions.iter_mut().for_each(|corner| corner[1] *= 0.1);
        let (eye, along) = chosen(&floor);
        assert!(eye[1] > 1.0 && along[1] < -0.5, "{eye:?} {along:?}");
        let (_, along) = chosen(&Scene::load("procedural:knot:2000").unwrap());
        assert!(along[2] < -0.9 && along[1] < 0.0, "{along:?}");
    }
}
