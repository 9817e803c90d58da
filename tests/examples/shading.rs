//! Shadows and ambient occlusion are where independent rays find them.
//!
//! The rays of these tests start and scatter by formulas of their own, so the pictures agree up to a few
//! pixels along the borders of shadows, and up to noise.

use std::path::Path;

use hgrid_core::{Config, Grid, Ray, TriangleMesh};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_lab::scene::Scene;
use hgrid_tests::artefact::run;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use tempfile::TempDir;

use crate::ppm::{Picture, save};
use crate::programs::raytracer;

const SIZE: u16 = 96;

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn unit(v: Vector) -> Vector {
    v.map(|c| c / dot(v, v).sqrt())
}

fn add(a: Vector, amount: f64, b: Vector) -> Vector {
    [0, 1, 2].map(|i| a[i] + amount * b[i])
}

/// Returns a floor with a lid above it: so flat that the camera looks down on them.
fn floor_and_lid() -> Scene {
    let square = |half: f32, y: f32| {
        [[-half, y, -half], [half, y, -half], [half, y, half], [-half, y, half]]
    };
    let positions = [square(2.0, 0.0), square(1.2, 0.8)].concat();
    let indices = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    Scene { positions, indices, ..Scene::default() }
}

/// Returns a ball of flat triangles: no part of it hides another part of its front.
fn ball(radius: f32) -> Scene {
    let (rings, around) = (24u32, 48u32);
    let mut positions = vec![[0.0, radius, 0.0], [0.0, -radius, 0.0]];
    for ring in 1..rings {
        let tilt = std::f32::consts::PI * ring as f32 / rings as f32;
        for step in 0..around {
            let turn = std::f32::consts::TAU * step as f32 / around as f32;
            let unit = [tilt.sin() * turn.cos(), tilt.cos(), tilt.sin() * turn.sin()];
            positions.push(unit.map(|c| c * radius));
        }
    }
    let at = |ring: u32, step: u32| 2 + (ring - 1) * around + step % around;
    let mut indices = Vec::new();
    for step in 0..around {
        indices.push([0, at(1, step), at(1, step + 1)]);
        indices.push([1, at(rings - 1, step), at(rings - 1, step + 1)]);
        for ring in 1..rings - 1 {
            let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(r, s)| at(ring + r, step + s));
            indices.push([corners[0], corners[1], corners[2]]);
            indices.push([corners[0], corners[2], corners[3]]);
        }
    }
    Scene { positions, indices, ..Scene::default() }
}

/// Returns the ray tracer's picture of a scene.
fn drawn(dir: &Path, scene: &Path, options: &[&str]) -> Picture {
    let output = dir.join("picture.ppm");
    let size = SIZE.to_string();
    run(raytracer().arg(scene).arg("-o").arg(&output).args(["--size", &size]).args(options));
    Picture::load(&output)
}

/// Returns the camera that the ray tracer uses.
fn camera_of(scene: &Scene) -> Camera {
    let bounds = scene.framed_bounds();
    Camera::framing(bounds, View::of(bounds, Up::Y), Up::Y)
}

/// A pixel that shows a surface: the point just above it, and the normal towards the eye.
struct Seen {
    pixel: usize,
    above: Vector,
    normal: Vector,
}

/// Returns the pixels that show a surface.
fn look(grid: &Grid<'_>, camera: &Camera) -> Vec<Seen> {
    let pixels = (0..SIZE).flat_map(|row| (0..SIZE).map(move |column| (row, column)));
    let seen = pixels.enumerate().filter_map(|(pixel, (row, column))| {
        let ray = camera.ray(column, row, SIZE);
        let hit = grid.intersect(&ray)?;
        let [a, b, c] = grid.mesh().triangle(hit.primitive)?.map(|corner| corner.map(f64::from));
        let (u, v) = (add(b, -1.0, a), add(c, -1.0, a));
        let cross = [0, 1, 2].map(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            u[j] * v[k] - u[k] * v[j]
        });
        let direction = ray.direction.map(f64::from);
        let side = if dot(cross, direction) > 0.0 { -1.0 } else { 1.0 };
        let normal = unit(cross).map(|c| c * side);
        let point = add(ray.origin.map(f64::from), f64::from(hit.t), direction);
        Some(Seen { pixel, above: add(point, 1e-4, normal), normal })
    });
    seen.collect()
}

/// Returns a ray from a point, up to a distance.
fn from(above: Vector, direction: Vector, reach: f64) -> Ray {
    let mut ray = Ray::new(above.map(|c| c as f32), direction.map(|c| c as f32));
    ray.t_max = reach as f32;
    ray
}

/// Returns the direction to the lamp, which is behind the viewer's left shoulder.
fn toward_lamp(camera: &Camera) -> Vector {
    let [right, up, toward] = camera.axes().map(|axis| axis.map(f64::from));
    unit(add(add(right.map(|c| -0.7 * c), 0.8, up), 1.0, toward))
}

#[test]
fn shadows_fall_where_something_hides_the_lamp() {
    let dir = TempDir::new().expect("a folder");
    let scene = floor_and_lid();
    let path = save(dir.path(), &scene);
    let plain = drawn(dir.path(), &path, &[]);
    let shadowed = drawn(dir.path(), &path, &["--shadows"]);

    let mesh = TriangleMesh::new(&scene.positions, &scene.indices).expect("a sound mesh");
    let owned = Owned::build(&mesh, &Config::default()).expect("a sound mesh");
    let grid = owned.open(&mesh).expect("its own mesh");
    let camera = camera_of(&scene);
    let lamp = toward_lamp(&camera);

    let (mut in_shadow, mut in_light, mut wrong) = (0, 0, 0);
    for seen in look(&grid, &camera) {
        // A surface that faces away from the lamp has no light to lose.
        if dot(seen.normal, lamp) < 0.01 {
            assert_eq!(plain.pixels[seen.pixel], shadowed.pixels[seen.pixel]);
            continue;
        }
        let is_dark = grid.occluded(&from(seen.above, lamp, f64::INFINITY));
        in_shadow += usize::from(is_dark);
        in_light += usize::from(!is_dark);
        wrong += usize::from((plain.pixels[seen.pixel] != shadowed.pixels[seen.pixel]) != is_dark);
    }
    assert!(in_shadow > 300 && in_light > 300, "{in_shadow} {in_light}");
    assert!(wrong <= 2, "{wrong} of {in_shadow} and {in_light}");
}

/// Returns the share of the sky that a pixel in the shadow sees, from its red: the inverse of the formula in light.c.
fn open_of(red: u8, normal: Vector, camera: &Camera) -> f64 {
    let sky = 0.5 + 0.5 * dot(normal, camera.axes()[1].map(f64::from));
    let light = (f64::from(red) / 255.0).powi(2);
    light / (2.2 * (sky * 0.09 + (1.0 - sky) * 0.03))
}

#[test]
fn the_sky_is_hidden_as_far_as_random_rays_say() {
    let dir = TempDir::new().expect("a folder");
    let scene = floor_and_lid();
    let path = save(dir.path(), &scene);
    let picture = drawn(dir.path(), &path, &["--shadows", "--ao", "512"]);

    let mesh = TriangleMesh::new(&scene.positions, &scene.indices).expect("a sound mesh");
    let owned = Owned::build(&mesh, &Config::default()).expect("a sound mesh");
    let grid = owned.open(&mesh).expect("its own mesh");
    let camera = camera_of(&scene);
    let lamp = toward_lamp(&camera);
    // Half the radius of the box, which is 4 x 0.8 x 4.
    let reach = 0.5 * f64::sqrt(4.0 + 0.16 + 4.0);

    let mut random = Random(1);
    let mut differences = Vec::new();
    let mut darkest = 1.0f64;
    for seen in look(&grid, &camera) {
        let is_dark =
            dot(seen.normal, lamp) <= 0.0 || grid.occluded(&from(seen.above, lamp, f64::INFINITY));
        if !is_dark || seen.pixel % 7 != 0 {
            continue;
        }
        // A point on the unit sphere, moved by the normal: such directions are distributed by the cosine.
        let mut rays = (0..).map(|_| random.point().map(f64::from));
        let open = (0..512).filter(|_| {
            let point = rays.find(|p| dot(*p, *p) < 1.0 && dot(*p, *p) > 1e-6).expect("endless");
            let direction = unit(add(unit(point), 1.0, seen.normal));
            !grid.occluded(&from(seen.above, direction, reach))
        });
        let expected = open.count() as f64 / 512.0;
        darkest = darkest.min(expected);
        differences.push(open_of(picture.pixels[seen.pixel][0], seen.normal, &camera) - expected);
    }
    let count = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / count;
    let worst = differences.iter().fold(0.0f64, |worst, d| worst.max(d.abs()));
    assert!(count > 50.0 && darkest < 0.6, "{count} {darkest}");
    assert!(mean.abs() < 0.01 && worst < 0.1, "{mean} {worst}");
}

/// A ray that starts on a surface must not hit that surface, at any scale.
#[test]
fn a_ball_casts_no_shadow_on_itself() {
    let dir = TempDir::new().expect("a folder");
    for radius in [1e-20, 1.0, 1e20] {
        let path = save(dir.path(), &ball(radius));
        let plain = drawn(dir.path(), &path, &[]);
        assert!(drawn(dir.path(), &path, &["--shadows"]) == plain, "{radius}");
        let open = drawn(dir.path(), &path, &["--ao", "1"]);
        assert!(open != plain);
        for rays in ["2", "7", "32"] {
            assert!(drawn(dir.path(), &path, &["--ao", rays]) == open, "{radius}, {rays} rays");
        }
    }
}
