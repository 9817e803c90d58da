//! Rays that leave a surface of a scene do not hit it, wherever its instance stands and however it is transformed.

use hgrid_core::{
    Config, Instance, Object, RayF64, Scene, SceneHit, SceneOptions, SceneSurface, TriangleMesh,
    Verdict,
};
use hgrid_tests::meshes::ball;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::{Built, scattered};

use crate::scenes::{ray, with_grids};
use crate::surfaces::{Vector, dot, leaving};

/// Asks for the closest hit with one triangle of a scene.
fn meets(scene: &Scene<'_>, ray: &RayF64, of: &SceneHit) -> bool {
    let mut only = |_: usize, hit: &SceneHit| {
        let is_same = (hit.path, hit.primitive) == (of.path, of.primitive);
        if is_same { Verdict::Accept } else { Verdict::Reject }
    };
    let mut options = SceneOptions { filter: Some(&mut only), ..SceneOptions::default() };
    scene.intersect_with(ray, &mut options).is_some()
}

/// The starts above and below, each with a direction that leaves on its side.
fn rays_from(random: &mut Random, surface: &SceneSurface) -> [RayF64; 2] {
    let normal = surface.normal.map(f64::from);
    let mut from = |start, side| loop {
        let direction = leaving(random, normal, side);
        // The object sees a direction that is nearly along the plane on either side.
        let along = direction.map(f64::from);
        if dot(along, normal).abs() > 1e-4 * dot(along, along).sqrt() {
            return RayF64::new(start, direction);
        }
    };
    [from(surface.above, 1.0), from(surface.below, -1.0)]
}

#[test]
fn the_triangle_that_a_ray_leaves_is_not_hit() {
    with_grids(|objects, _| {
        let (mut count, mut back_count) = (0, 0);
        for far in [0.0, 1e3, 1e9, 1e12] {
            let inner = scattered(3, 3, 2.0, 61);
            let inner_built = Built::scene(&inner, objects, &Config::default()).unwrap();
            let inner_scene = inner_built.open(objects).unwrap();
            let outer_objects = [Object::Scene(&inner_scene), objects[0], objects[1]];
            let mut outer = scattered(24, 3, 6.0, 62);
            let moved = |at: Vector| at.map(|c| c + far);
            outer
                .iter_mut()
                .for_each(|instance| instance.translation = moved(instance.translation));
            let built = Built::scene(&outer, &outer_objects, &Config::default()).unwrap();
            let scene = built.open(&outer_objects).unwrap();
            let mut random = Random(63);
            for round in 0..2000 {
                let near = ray(&mut random, 5 * round + round % 3, 6.0);
                let ray = RayF64 { origin: moved(near.origin), t_min: 0.0, ..near };
                let Some(hit) = scene.intersect(&ray) else { continue };
                let surface = scene.surface(&ray, &hit).unwrap();
                let front = scene.triangle_normal(&hit).unwrap();
                let is_front = dot(front.map(f64::from), surface.normal.map(f64::from)) > 0.0;
                assert_eq!(surface.is_front == 1, is_front, "{hit:?} {surface:?}");
                let away = dot(surface.normal.map(f64::from), ray.direction.map(f64::from));
                assert!(
                    away <= 1e-6
                        * dot(ray.direction.map(f64::from), ray.direction.map(f64::from)).sqrt()
                );
                // The position is where `t` says, but for the rounding of `t` and of the scene's coordinates.
                let slack = 1e-5 * (1.0 + far * 1e-10) * (1.0 + f64::from(hit.t).abs());
                for axis in 0..3 {
                    let at = ray.origin[axis] + f64::from(hit.t) * f64::from(ray.direction[axis]);
                    let length = f64::from(ray.direction[axis].abs()).max(1.0);
                    assert!(
                        (at - surface.position[axis]).abs() < slack * length,
                        "{ray:?} {surface:?}"
                    );
                }
                for leaves in rays_from(&mut random, &surface) {
                    assert!(!meets(&scene, &leaves, &hit), "{leaves:?} {hit:?} {surface:?}");
                    count += 1;
                }
                // The test can fail: most rays back to the triangle hit it.
                let [x, y, z] = surface.normal;
                let back = RayF64::new(surface.above, [-x, -y, -z]);
                back_count += usize::from(meets(&scene, &back, &hit));
            }
        }
        assert!(count > 3000 && back_count > count / 3, "{back_count} back of {count}");
    });
}

#[test]
fn a_convex_object_hides_nothing_from_itself() {
    let mesh = ball(24, 0.0);
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::default()).unwrap();
    let grid = owned.open(&view).unwrap();
    let objects = [Object::Grid(&grid)];
    let mut random = Random(64);
    for far in [0.0, 1e4, 1e8, 1e11] {
        let mut blocked = 0;
        for instance in scattered(12, 1, 3.0, 65) {
            let translation = instance.translation.map(|c| c + far);
            let instances = [Instance { translation, ..instance }];
            let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
            let scene = built.open(&objects).unwrap();
            for _ in 0..500 {
                let [from, to] = [random.point(), random.point()].map(|p| p.map(f64::from));
                let direction = std::array::from_fn(|k| (to[k] - 9.0 * from[k]) as f32);
                let origin = std::array::from_fn(|k| translation[k] + 9.0 * from[k]);
                let ray = RayF64::new(origin, direction);
                let Some(hit) = scene.intersect(&ray) else { continue };
                let surface = scene.surface(&ray, &hit).unwrap();
                // Fronts are outside.
                let [above, below] = rays_from(&mut random, &surface);
                let (out, inside) =
                    if surface.is_front == 1 { (above, below) } else { (below, above) };
                assert!(!scene.occluded(&out), "{far} {instance:?} {out:?} {surface:?}");
                blocked += usize::from(scene.occluded(&inside));
            }
        }
        assert!(blocked > 100, "{blocked}");
    }
}

/// A matrix that turns.
fn turn(random: &mut Random) -> [Vector; 3] {
    let [a, b, _] = random.point().map(|angle| f64::from(angle) * 3.0);
    let ((sin, cos), (tilt_sin, tilt_cos)) = (a.sin_cos(), b.sin_cos());
    [
        [cos, -sin, 0.0],
        [sin * tilt_cos, cos * tilt_cos, -tilt_sin],
        [sin * tilt_sin, cos * tilt_sin, tilt_cos],
    ]
}

fn product(a: &[Vector; 3], b: &[Vector; 3]) -> [Vector; 3] {
    a.map(|row| [0, 1, 2].map(|k| row[0] * b[0][k] + row[1] * b[1][k] + row[2] * b[2][k]))
}

/// Triangles across `axis`, at most about 1 from the origin.
fn across(axis: Vector, random: &mut Random) -> Vec<[[f32; 3]; 3]> {
    let mut triangle = || {
        let middle = random.point();
        [(); 3].map(|()| {
            let side = random.point().map(|c| 0.3 * f64::from(c));
            let along = dot(side, axis);
            [0, 1, 2].map(|k| (f64::from(middle[k]) + side[k] - along * axis[k]) as f32)
        })
    };
    (0..30).map(|_| triangle()).collect()
}

/// Rule 6 of docs/renderers.md: offsets that a renderer computes itself, in an instance that is as large as `stretch`
/// and `condition` times thinner on one axis. The triangles face its longest axis: there a rounded inverse, which mixes
/// the axes, moves them by most. Returns how many rays left a triangle, and how many of them hit it.
fn own_offsets(
    [stretch, condition, distance]: [f64; 3],
    rule: impl Fn(f64, f64) -> f64,
) -> (usize, usize) {
    let mut random = Random(66);
    let least_angle = 1e-4_f64.max(0.5_f64.powi(23) * condition);
    let (mut count, mut hit_count) = (0, 0);
    for _ in 0..60 {
        let inner = turn(&mut random);
        let scales = [stretch, stretch / condition.sqrt(), stretch / condition];
        let scaled = [0, 1, 2].map(|row: usize| inner[row].map(|c| c * scales[row]));
        let linear = product(&turn(&mut random), &scaled).map(|row| row.map(|c| c as f32));
        let triangles = across(inner[0], &mut random);
        let positions = triangles.concat();
        let indices: Vec<[u32; 3]> =
            (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let view = TriangleMesh::new(&positions, &indices).unwrap();
        let owned = Owned::build(&view, &Config::default()).unwrap();
        let grid = owned.open(&view).unwrap();
        let objects = [Object::Grid(&grid)];
        let translation = random.point().map(|c| distance * f64::from(c));
        let instances = [Instance { linear, translation, ..Instance::new(0) }];
        let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
        let scene = built.open(&objects).unwrap();
        let to_scene = |v: Vector| linear.map(|row| dot(row.map(f64::from), v));
        let corners = |axis: usize| positions.iter().map(move |p| f64::from(p[axis]));
        let [low, high] =
            [f64::min, f64::max].map(|pick| [0, 1, 2].map(|k| corners(k).reduce(pick).unwrap()));
        let extent = (0..3).map(|k| high[k] - low[k]).reduce(f64::max).unwrap();
        let largest = low.iter().chain(&high).map(|c| c.abs()).reduce(f64::max).unwrap();
        for _ in 0..500 {
            let [from, to] = [random.point(), random.point()].map(|p| p.map(f64::from));
            let from = to_scene(from.map(|c| 2.0 * c));
            let origin = [0, 1, 2].map(|k| from[k] + translation[k]);
            let ray = RayF64::new(origin, to_scene(to).map(|c| c as f32));
            let Some(hit) = scene.intersect(&ray) else { continue };
            let normal = scene.triangle_normal(&hit).unwrap().map(f64::from);
            let side = -dot(normal, ray.direction.map(f64::from)).signum();
            let [a, b, c] = triangles[hit.primitive as usize];
            let [u, v] = [hit.u, hit.v].map(f64::from);
            let weighted = |k: usize| {
                (1.0 - u - v) * f64::from(a[k]) + u * f64::from(b[k]) + v * f64::from(c[k])
            };
            let point = to_scene([0, 1, 2].map(weighted));
            let point = [0, 1, 2].map(|k| point[k] + translation[k]);
            let far = point.iter().chain(&translation).map(|c| c.abs()).fold(0.0, f64::max);
            let offset = side * rule(extent + largest, far);
            let start = [0, 1, 2].map(|k| point[k] + offset * normal[k]);
            let leaves = loop {
                let direction = leaving(&mut random, normal, side);
                let along = direction.map(f64::from);
                if dot(along, normal).abs() > least_angle * dot(along, along).sqrt() {
                    break RayF64::new(start, direction);
                }
            };
            count += 1;
            hit_count += usize::from(meets(&scene, &leaves, &hit));
        }
    }
    (count, hit_count)
}

#[test]
fn offsets_as_the_page_for_renderers_gives_them_are_enough() {
    let (base, far_base) = (0.5_f64.powi(19), 0.5_f64.powi(49));
    for stretch in [1e-3, 1.0, 1e3] {
        for condition in [1.0, 30.0, 1000.0, 3000.0] {
            for distance in [0.0, 3.0, 1e6, 1e10] {
                let size = |e: f64| stretch * (base + 0.5_f64.powi(22) * condition) * e;
                let place = [stretch, condition, distance * stretch];
                let (count, hit_count) = own_offsets(place, |e, far| size(e) + far_base * far);
                assert!(count > 300 && hit_count == 0, "{place:?}: {hit_count} of {count}");
            }
        }
    }
    // Neither the stretch nor the condition number nor the distance can be left out.
    assert!(own_offsets([1e3, 1.0, 3e3], |e, _| base * e).1 > 50);
    assert!(own_offsets([1.0, 3000.0, 3.0], |e, _| base * e).1 > 5);
    assert!(own_offsets([1.0, 1.0, 1e12], |e, _| base * e).1 > 5);
}

#[test]
fn what_is_no_triangle_has_no_surface() {
    with_grids(|objects, _| {
        let instances = [Instance::new(0), Instance { translation: [1e20; 3], ..Instance::new(0) }];
        let built = Built::scene(&instances, objects, &Config::default()).unwrap();
        let scene = built.open(objects).unwrap();
        let ray = RayF64::new([0.0, 0.0, 9.0], [0.0, 0.0, -1.0]);
        let hit = scene.intersect(&ray).unwrap();
        assert!(scene.surface(&ray, &hit).is_some());
        assert_eq!(scene.surface(&ray, &SceneHit::MISS), None);
        assert_eq!(scene.surface(&ray, &SceneHit { primitive: 1 << 30, ..hit }), None);
        assert_eq!(scene.surface(&RayF64::new(ray.origin, [0.0; 3]), &hit), None);
        assert_eq!(scene.surface(&RayF64::new(ray.origin, [f32::NAN; 3]), &hit), None);
        // No two places of f64 lie within an object so far away.
        let path = [1, u32::MAX, u32::MAX, u32::MAX];
        assert_eq!(scene.surface(&ray, &SceneHit { path, ..hit }), None);
    });
}
