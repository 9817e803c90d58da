//! Scenes: every query agrees with a loop over all instances, and with the triangles moved in f64.

use hgrid_core::{
    BlobInfo, Block, Boxes, Config, Counters, Grid, Instance, Method, Object, Parameters, Quality,
    Ray, RayF64, Scene, SceneHit, SceneOptions, ShapeHit, Shapes, TriangleMesh,
};
use hgrid_tests::meshes::{Mesh, ball, soup};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::{Built, packed, prove_packed, scattered, with_packed};

/// Calls `run` with objects to show: grids of two methods.
pub(crate) fn with_grids(run: impl FnOnce(&[Object<'_>], &[Mesh])) {
    let meshes = [ball(6, 1.0), soup(200, 0.2, 5), soup(60, 0.5, 6).scaled(0.1)];
    let methods = [Method::Bvh, Method::OneLevel, Method::Bvh];
    let views: Vec<TriangleMesh<'_>> = meshes.iter().map(Mesh::view).collect();
    let owned: Vec<Owned> = views
        .iter()
        .zip(methods)
        .map(|(mesh, method)| Owned::build(mesh, &Config::new(method)).unwrap())
        .collect();
    let grids: Vec<Grid<'_>> =
        owned.iter().zip(&views).map(|(owned, mesh)| owned.open(mesh).unwrap()).collect();
    let objects: Vec<Object<'_>> = grids.iter().map(Object::Grid).collect();
    run(&objects, &meshes);
}

pub(crate) fn ray(random: &mut Random, round: usize, width: f32) -> RayF64 {
    let far = [0.5, 2.0, 30.0, 3e4, 1e9][round % 5] * width;
    let (from, to) = (random.point().map(|c| c * far), random.point().map(|c| c * width));
    let mut ray = Ray::new(from, std::array::from_fn(|k| to[k] - from[k]));
    match round % 7 {
        1 => ray.t_min = -0.5,
        2 => ray.t_max = 1.0,
        3 => ray.direction[round % 3] = 0.0,
        4 => ray.direction = ray.direction.map(|d| d * 1e-12),
        5 => ray.direction = ray.direction.map(|d| d * 1e9),
        _ => {}
    }
    let mut ray = RayF64::from(&ray);
    if round % 2 == 1 {
        // An origin that f32 cannot represent.
        ray.origin = ray.origin.map(|c| c * (1.0 + 1e-9) + 1e-9);
    }
    ray
}

/// The instances of a scene, each in a scene of its own.
pub(crate) struct Alone(Vec<Built>);

impl Alone {
    pub(crate) fn new(instances: &[Instance], objects: &[Object<'_>]) -> Self {
        let alone = |instance: &Instance| {
            Built::scene(std::slice::from_ref(instance), objects, &Config::default()).unwrap()
        };
        Self(instances.iter().map(alone).collect())
    }

    /// Returns the closest hit among the answers of all instances.
    pub(crate) fn closest<'o>(
        &self,
        objects: &'o [Object<'o>],
        ray: &RayF64,
        mut ask: impl FnMut(u32, &Scene<'_>, &RayF64) -> Option<SceneHit>,
    ) -> Option<SceneHit> {
        let hits = (0..).zip(&self.0).filter_map(|(number, built)| {
            let mut hit = ask(number, &built.open(objects).unwrap(), ray)?;
            hit.path[0] = number;
            Some(hit)
        });
        hits.reduce(|a, b| if b.is_closer(&a) { b } else { a })
    }
}

/// Gives instances one of three masks, and every fifth a mask without bits.
pub(crate) fn spread_masks(instances: &mut [Instance]) {
    for instance in instances {
        instance.mask = if instance.id % 5 == 4 { 0 } else { 1 << (instance.id % 3) };
    }
}

#[test]
fn a_scene_answers_as_each_of_its_instances_alone() {
    with_grids(|objects, _| {
        for (count, width) in [(0, 1.0), (1, 1.0), (7, 3.0), (60, 6.0), (150, 200.0)] {
            let mut instances = scattered(count, 3, width, 8);
            spread_masks(&mut instances);
            // Put two instances in the same place: the first of them is reported.
            if let [first, .., last] = &mut instances[..] {
                *last = Instance { id: last.id, ..*first };
            }
            // Alone, each has all bits, so that only this test looks at masks.
            let seen = |instance: &Instance| Instance { mask: u32::MAX, ..*instance };
            let alone = Alone::new(&instances.iter().map(seen).collect::<Vec<_>>(), objects);
            for quality in [Quality::Fast, Quality::High] {
                let config = Config::from(Parameters::Bvh { quality });
                let built = Built::scene(&instances, objects, &config).unwrap();
                let scene = built.open(objects).unwrap();
                let mut random = Random(5);
                let (mut hits, mut without_bits) = (0, 0);
                for round in 0..300 {
                    let ray = ray(&mut random, round, width as f32);
                    let expected =
                        alone.closest(objects, &ray, |_, scene, ray| scene.intersect(ray));
                    let hit = scene.intersect(&ray);
                    assert_eq!(hit, expected, "{ray:?}");
                    assert_eq!(scene.occluded(&ray), expected.is_some(), "{ray:?}");
                    hits += usize::from(hit.is_some());
                    let mask_hit = hit.map(|hit| instances[hit.path[0] as usize].mask);
                    without_bits += usize::from(mask_hit == Some(0));

                    let mask = [1, 2, 6, u32::MAX - 1][round % 4];
                    let with_mask = |scene: &Scene<'_>, ray: &RayF64| {
                        let mut work = Counters::default();
                        let counters = Some(&mut work);
                        let mut options =
                            SceneOptions { mask, counters, ..SceneOptions::default() };
                        scene.intersect_with(ray, &mut options)
                    };
                    let expected = alone.closest(objects, &ray, |number, scene, ray| {
                        let is_seen = instances[number as usize].mask & mask != 0;
                        if is_seen { scene.intersect(ray) } else { None }
                    });
                    assert_eq!(with_mask(&scene, &ray), expected);
                    let mut options = SceneOptions { mask, ..SceneOptions::default() };
                    assert_eq!(scene.occluded_with(&ray, &mut options), expected.is_some());
                }
                assert!(count < 7 || width > 10.0 || hits > 20, "{hits} hits");
                assert!(count < 60 || width > 10.0 || without_bits > 2, "{without_bits}");
            }
        }
    });
}

#[test]
fn a_scene_answers_as_triangles_that_were_moved_in_f64() {
    with_grids(|objects, _| {
        let width = 4.0;
        let instances = scattered(40, 3, width, 21);
        let built = Built::scene(&instances, objects, &Config::default()).unwrap();
        let scene = built.open(objects).unwrap();
        let moved = flattened(&instances, objects, &|object| match object {
            Object::Grid(grid) => Shown::Mesh(*grid.mesh()),
            _ => panic!("a grid"),
        });
        let mut random = Random(6);
        let mut hits = 0;
        for round in 0..400 {
            let ray = ray(&mut random, 5 * (round / 4) + round % 3, width as f32);
            let hit = scene.intersect(&ray);
            let mut is_confirmed = hit.is_none();
            for Moved { path, id, corners, .. } in &moved {
                let Some((t, inside)) = meet(corners, &ray) else { continue };
                let slack = 1e-4 * (1.0 + t.abs());
                if let Some(hit) = hit
                    && (hit.path, hit.primitive) == (*path, *id)
                {
                    is_confirmed |= inside > -1e-3 && (f64::from(hit.t) - t).abs() <= slack;
                }
                let (least, most) = (f64::from(ray.t_min) + slack, f64::from(ray.t_max) - slack);
                let end = hit.map_or(f64::INFINITY, |hit| f64::from(hit.t));
                assert!(
                    inside < 1e-3 || t < least || t > most || end <= t + slack,
                    "instance {path:?} triangle {id} at {t}, found {hit:?} {ray:?}"
                );
            }
            assert!(is_confirmed, "{hit:?} {ray:?}");
            hits += usize::from(hit.is_some());
        }
        assert!(hits > 50, "{hits}");
    });
}

/// The mesh or the instances that an object shows.
enum Shown<'o> {
    Mesh(TriangleMesh<'o>),
    Scene(&'o [Instance], &'o [Object<'o>]),
}

/// A triangle in the coordinates of the outermost scene.
struct Moved {
    path: [u32; 4],
    id: u32,
    corners: [[f64; 3]; 3],
    /// The normal, of any length, as the triangle's own mesh has it.
    normal: [f64; 3],
}

/// Returns all triangles of some instances, moved in f64.
fn flattened<'o>(
    instances: &[Instance],
    objects: &[Object<'o>],
    show: &dyn Fn(&Object<'o>) -> Shown<'o>,
) -> Vec<Moved> {
    let mut all = Vec::new();
    for (number, instance) in (0..).zip(instances) {
        let rows = instance.linear.map(|row| row.map(f64::from));
        let turn = |p: [f64; 3]| rows.map(|[a, b, c]| a * p[0] + b * p[1] + c * p[2]);
        let mirrors = dot(rows[0], cross(rows[1], rows[2])).signum();
        let place = |Moved { path: [a, b, c, _], id, corners, normal }| {
            let corners = corners.map(|p| {
                let p = turn(p);
                std::array::from_fn(|k| p[k] + instance.translation[k])
            });
            // Take the normal of the moved corners, and flip it where the matrix mirrors.
            let [p, q, r] = &corners;
            let flat = cross(minus(q, p), minus(r, p));
            let before = cross(turn(across(normal)[0]), turn(across(normal)[1]));
            let sign = mirrors * dot(flat, before).signum();
            Moved { path: [number, a, b, c], id, corners, normal: flat.map(|c| c * sign) }
        };
        match show(&objects[instance.object as usize]) {
            Shown::Mesh(mesh) => all.extend((0..mesh.triangle_count()).map(|id| {
                let corners = mesh.triangle(id).unwrap().map(|p| p.map(f64::from));
                let [a, b, c] = &corners;
                let normal = cross(minus(b, a), minus(c, a));
                place(Moved { path: [u32::MAX; 4], id, corners, normal })
            })),
            Shown::Scene(inner, objects) => {
                all.extend(flattened(inner, objects, show).into_iter().map(place));
            }
        }
    }
    all
}

/// Returns two directions that span the plane with this normal.
fn across(normal: [f64; 3]) -> [[f64; 3]; 2] {
    let [x, y, z] = normal.map(f64::abs);
    let axis = if x <= y && x <= z {
        [1.0, 0.0, 0.0]
    } else if y <= z {
        [0.0, 1.0, 0.0]
    } else {
        [0.0, 0.0, 1.0]
    };
    let first = cross(axis, normal);
    [first, cross(normal, first)]
}

fn minus(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns the t at which a line meets the plane of a triangle, and the least weight of a corner there;
/// `None` if the line nearly runs along the plane.
fn meet([a, b, c]: &[[f64; 3]; 3], ray: &RayF64) -> Option<(f64, f64)> {
    let d = ray.direction.map(f64::from);
    let (ab, ac, from) = (minus(b, a), minus(c, a), minus(&ray.origin, a));
    let (p, q) = (cross(d, ac), cross(from, ab));
    let determinant = dot(ab, p);
    let size = (dot(ab, ab) * dot(ac, ac) * dot(d, d)).sqrt();
    if determinant.abs() < 1e-4 * size {
        return None;
    }
    let (u, v) = (dot(from, p) / determinant, dot(d, q) / determinant);
    Some((dot(ac, q) / determinant, u.min(v).min(1.0 - u - v)))
}

#[test]
fn far_from_the_origin_a_scene_answers_as_at_the_origin() {
    with_grids(|objects, _| {
        // Translations that stay exact in f64 after any of these offsets is added.
        let rounded = |c: f64| (c * 1024.0).round() / 1024.0;
        let mut instances = scattered(50, 3, 5.0, 4);
        for instance in &mut instances {
            instance.translation = instance.translation.map(rounded);
        }
        let here = Built::scene(&instances, objects, &Config::default()).unwrap();
        for offset in [1e4, 1e7, 1e12] {
            let mut moved = instances.clone();
            for instance in &mut moved {
                instance.translation = instance.translation.map(|c| c + offset);
            }
            let there = Built::scene(&moved, objects, &Config::default()).unwrap();
            let mut random = Random(3);
            let mut hits = 0;
            for round in 0..200 {
                let mut ray = ray(&mut random, 5 * round + round % 2, 5.0);
                ray.origin = ray.origin.map(rounded);
                let far = RayF64 { origin: ray.origin.map(|c| c + offset), ..ray };
                let expected = here.open(objects).unwrap().intersect(&ray);
                assert_eq!(there.open(objects).unwrap().intersect(&far), expected, "{offset}");
                hits += usize::from(expected.is_some());
            }
            assert!(hits > 20);
        }
    });
}

#[test]
fn scenes_in_scenes_name_the_way_to_the_hit() {
    with_grids(|objects, _| {
        let inner = scattered(5, 3, 2.0, 31);
        let inner_built = Built::scene(&inner, objects, &Config::default()).unwrap();
        let inner_scene = inner_built.open(objects).unwrap();
        let middle_objects = [Object::Scene(&inner_scene), objects[0]];
        let middle = scattered(4, 2, 5.0, 32);
        let middle_built = Built::scene(&middle, &middle_objects, &Config::default()).unwrap();
        let middle_scene = middle_built.open(&middle_objects).unwrap();
        let outer_objects = [Object::Scene(&middle_scene), objects[1]];
        let outer = scattered(16, 2, 6.0, 33);
        let built = Built::scene(&outer, &outer_objects, &Config::default()).unwrap();
        let scene = built.open(&outer_objects).unwrap();
        let alone = Alone::new(&outer, &outer_objects);
        let mut random = Random(9);
        let mut depths = [0; 4];
        for round in 0..1500 {
            let ray = ray(&mut random, 5 * round + round % 4, 6.0);
            let expected =
                alone.closest(&outer_objects, &ray, |_, scene, ray| scene.intersect(ray));
            let hit = scene.intersect(&ray);
            assert_eq!(hit, expected, "{ray:?}");
            assert_eq!(scene.occluded(&ray), hit.is_some());
            let Some(hit) = hit else { continue };
            let depth = hit.path.iter().filter(|&&number| number != u32::MAX).count();
            depths[depth] += 1;
            let Some(Object::Grid(grid)) = scene.object_of(&hit) else { panic!("a grid") };
            assert!(hit.primitive < grid.mesh().triangle_count());
            let number = hit.path[depth - 1] as usize;
            let instances = [&outer, &middle, &inner][depth - 1];
            assert_eq!(scene.instance_of(&hit).unwrap().id, instances[number].id);
            for (level, instances) in [&outer, &middle, &inner].into_iter().enumerate() {
                let id = (level < depth).then(|| instances[hit.path[level] as usize].id);
                assert_eq!(scene.instance_at(&hit, level).map(|instance| instance.id), id);
            }
            let normal = scene.triangle_normal(&hit).unwrap();
            let length: f32 = normal.iter().map(|c| c * c).sum();
            assert!((length - 1.0).abs() < 1e-5);
        }
        assert!(depths[1..].iter().all(|&hits| hits > 2), "{depths:?}");

        // Pack three grids and two scenes, each once, into one blob, and open it elsewhere with bytes after it.
        let mut file = packed(&scene).unwrap();
        file.extend([Block::ZERO; 2]);
        let file = Block::bytes(&file);
        let info = BlobInfo::peek(file).unwrap();
        assert_eq!((info.triangle_count, info.vertex_count), (5, 5 + 3 + 2 + 2));
        assert_eq!(info.total_bytes, scene.packed_bytes());
        prove_packed(file).unwrap();
        with_packed(file, |opened| {
            let opened = opened.unwrap();
            assert_eq!(opened.blob(), scene.blob());
            for round in 0..1500 {
                let ray = ray(&mut random, 5 * round + round % 4, 6.0);
                let hit = opened.intersect(&ray);
                assert_eq!(hit, scene.intersect(&ray));
                assert_eq!(opened.occluded(&ray), hit.is_some());
                let normal = |scene: &Scene<'_>| scene.triangle_normal(&hit?);
                assert_eq!(normal(&opened), normal(&scene));
            }
            // Packing the opened scene again gives the same bytes.
            let again = packed(&opened).unwrap();
            assert!(Block::bytes(&again) == &file[..file.len() - 128]);
        });

        // One more scene around it is allowed; two are not.
        let once = [Object::Scene(&scene)];
        let built = Built::scene(&[Instance::new(0)], &once, &Config::default()).unwrap();
        let scene = built.open(&once).unwrap();
        let twice = [Object::Scene(&scene)];
        let error = Built::scene(&[Instance::new(0)], &twice, &Config::default()).unwrap_err();
        assert_eq!(error, hgrid_core::Error::TooDeep);
    });
}

#[test]
fn rays_from_afar_hit_what_stands_in_scenes_in_scenes() {
    with_grids(|objects, _| {
        let inner = scattered(3, 3, 2.0, 51);
        let inner_built = Built::scene(&inner, objects, &Config::default()).unwrap();
        let inner_scene = inner_built.open(objects).unwrap();
        let middle_objects = [Object::Scene(&inner_scene), objects[0]];
        let middle = scattered(4, 2, 5.0, 52);
        let middle_built = Built::scene(&middle, &middle_objects, &Config::default()).unwrap();
        let middle_scene = middle_built.open(&middle_objects).unwrap();
        let outer_objects = [Object::Scene(&middle_scene), objects[1]];
        let outer = scattered(8, 2, 6.0, 53);
        let built = Built::scene(&outer, &outer_objects, &Config::default()).unwrap();
        let scene = built.open(&outer_objects).unwrap();
        let moved = flattened(&outer, &outer_objects, &|object| match object {
            Object::Grid(grid) => Shown::Mesh(*grid.mesh()),
            Object::Scene(found) if std::ptr::eq(*found, &raw const middle_scene) => {
                Shown::Scene(&middle, &middle_objects)
            }
            _ => Shown::Scene(&inner, objects),
        });
        let depth_of = |path: &[u32; 4]| path.iter().filter(|&&number| number != u32::MAX).count();
        let by_depth = [1, 2, 3]
            .map(|depth| moved.iter().filter(|moved| depth_of(&moved.path) == depth).collect());
        let by_depth: [Vec<&Moved>; 3] = by_depth;
        let mut random = Random(7);
        for distance in [1.0, 1e2, 1e4, 1e6, 1e8] {
            let mut depths = [0; 4];
            for round in 0..120 {
                // Aim at the middle of a triangle from a distance of so many units.
                let near = &by_depth[round / 3 % 3];
                let aim = near[random.below(near.len())];
                let [a, b, c] = aim.corners;
                let middle: [f64; 3] = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
                let size = [1e-20, 1.0, 1e12][round % 3];
                let direction = random.point().map(|c| c * size);
                let back =
                    distance / dot(direction.map(f64::from), direction.map(f64::from)).sqrt();
                let ray = RayF64 {
                    origin: std::array::from_fn(|k| middle[k] - f64::from(direction[k]) * back),
                    ..RayF64::new([0.0; 3], direction)
                };
                // Allow for the rounding of t and of the ray's position.
                let slack = 1e-6 * back + 1e-4 * back / distance;
                let hit = scene.intersect(&ray);
                assert_eq!(scene.occluded(&ray), hit.is_some());
                let mut is_confirmed = hit.is_none();
                for Moved { path, id, corners, normal } in &moved {
                    let Some((t, inside)) = meet(corners, &ray) else { continue };
                    if let Some(hit) = hit
                        && (hit.path, hit.primitive) == (*path, *id)
                    {
                        is_confirmed |= inside > -1e-3 && (f64::from(hit.t) - t).abs() <= slack;
                        let found = scene.triangle_normal(&hit).unwrap().map(f64::from);
                        let cosine = dot(found, *normal) / dot(*normal, *normal).sqrt();
                        assert!(cosine > 1.0 - 1e-3, "{cosine} {hit:?}");
                    }
                    let end = hit.map_or(f64::INFINITY, |hit| f64::from(hit.t));
                    assert!(
                        inside < 1e-3 || t < slack || end <= t + slack,
                        "{path:?} triangle {id} at {t}, found {hit:?} {ray:?}"
                    );
                }
                assert!(is_confirmed, "{hit:?} {ray:?}");
                if let Some(hit) = hit {
                    depths[depth_of(&hit.path)] += 1;
                }
            }
            assert!(depths[1..].iter().all(|&hits| hits > 5), "{depths:?}");
        }
    });
}

/// Returns the point where a ray enters a box that stands for a shape, computed in f64.
pub(crate) fn enter(sides: &[f32; 6], ray: &Ray) -> Option<ShapeHit> {
    let (mut near, mut far) = (f64::from(ray.t_min), f64::from(ray.t_max));
    for k in 0..3 {
        let d = f64::from(ray.direction[k]);
        let at = |side: usize| (f64::from(sides[side]) - f64::from(ray.origin[k])) / d;
        let (a, b) = (at(k), at(k + 3));
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    (near <= far).then_some(ShapeHit { t: near as f32, u: 0.5, v: 0.25 })
}

#[test]
fn shapes_stand_in_scenes() {
    let boxes = [[-1.0, -1.0, -1.0, 1.0, 1.0, 1.0], [3.0, -1.0, -1.0, 5.0, 1.0, 1.0]];
    let view = Boxes::new(&boxes).unwrap();
    let tree = Built::shapes(view, &Config::default()).unwrap();
    let test = |id: u32, ray: &Ray| enter(&boxes[id as usize], ray);
    let shapes = Shapes::open(tree.bytes(), view).unwrap();
    let objects = [Object::Shapes(&shapes, &test)];
    let instances = scattered(20, 1, 20.0, 2);
    let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
    let scene = built.open(&objects).unwrap();
    let alone = Alone::new(&instances, &objects);
    let mut random = Random(1);
    let mut hits = 0;
    for round in 0..400 {
        let ray = ray(&mut random, 5 * round + round % 4, 20.0);
        let hit = scene.intersect(&ray);
        assert_eq!(hit, alone.closest(&objects, &ray, |_, scene, ray| scene.intersect(ray)));
        assert_eq!(scene.occluded(&ray), hit.is_some());
        if let Some(hit) = hit {
            assert_eq!([hit.u, hit.v], [0.5, 0.25]);
            assert!(ray.t_min <= hit.t && hit.t <= ray.t_max);
            hits += 1;
        }
    }
    assert!(hits > 40, "{hits}");
}

#[test]
fn moved_instances_are_found_after_a_refit() {
    with_grids(|objects, _| {
        let first = scattered(80, 3, 10.0, 41);
        let second = scattered(80, 3, 10.0, 42);
        let mut built = Built::scene(&first, objects, &Config::default()).unwrap();
        let before = built.bytes().to_vec();
        let still = Scene::refit(built.bytes_mut(), &first, objects).unwrap();
        assert_eq!(still.cost_before.to_bits(), still.cost_after.to_bits());
        assert!(built.bytes() == before, "instances that did not move");
        let moved = Scene::refit(built.bytes_mut(), &second, objects).unwrap();
        assert!(moved.cost_after > moved.cost_before);
        let anew = Built::scene(&second, objects, &Config::default()).unwrap();
        let scene = built.open(objects).unwrap();
        scene.validate(&mut vec![0; scene.validate_bytes()]).unwrap();
        let (mut random, mut hits) = (Random(3), 0);
        for round in 0..200 {
            let ray = ray(&mut random, round, 10.0);
            let hit = scene.intersect(&ray);
            assert_eq!(hit, anew.open(objects).unwrap().intersect(&ray));
            hits += usize::from(hit.is_some());
        }
        assert!(hits > 20, "{hits}");
    });
}
