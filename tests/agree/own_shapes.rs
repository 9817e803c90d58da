//! Shapes of the caller: every query agrees with a loop over all of them.

use std::collections::HashSet;
use std::sync::Mutex;

use hgrid_core::{
    BatchField, Boxes, Coherence, Config, Counters, Error, Hit, Instance, Object, Parameters,
    Quality, QueryOptions, Ray, RayF64, SceneHit, SceneOptions, ShapeHit, Shapes, Strided,
    StridedMut,
};
use hgrid_tests::random::Random;
use hgrid_tests::scenes::Built;
use zerocopy::IntoBytes;

use super::batches::{COHERENCES, odd_rays};

/// A sphere: center and radius.
type Sphere = [f32; 4];

fn spheres(count: usize, size: f32, seed: u64) -> Vec<Sphere> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let [x, y, z] = random.point();
            [x, y, z, size * (0.1 + random.unit())]
        })
        .collect()
}

fn box_of([x, y, z, r]: Sphere) -> [f32; 6] {
    let out = |c: f32, r: f32| if r > 0.0 { (c + r).next_up() } else { (c + r).next_down() };
    [out(x, -r), out(y, -r), out(z, -r), out(x, r), out(y, r), out(z, r)]
}

/// Returns the first point in range where a ray meets a sphere.
fn meet([x, y, z, r]: Sphere, ray: &Ray) -> Option<ShapeHit> {
    let at = [0, 1, 2].map(|k| f64::from(ray.origin[k]) - f64::from([x, y, z][k]));
    let d = ray.direction.map(f64::from);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (a, b, c) = (dot(d, d), dot(at, d), dot(at, at) - f64::from(r) * f64::from(r));
    let root = (b * b - a * c).sqrt();
    let places = [(-b - root) / a, (-b + root) / a].map(|t| t as f32);
    let t = places.into_iter().find(|t| (ray.t_min..=ray.t_max).contains(t))?;
    Some(ShapeHit { t, u: r, v: x })
}

fn ray(random: &mut Random, round: usize) -> Ray {
    let far = [0.5, 3.0, 50.0, 400.0][round % 4];
    let (from, to) = (random.point().map(|c| c * far), random.point());
    let direction = std::array::from_fn(|k| to[k] - from[k]);
    let mut ray = Ray::new(from, direction);
    match round % 5 {
        1 => ray.t_min = -0.5,
        2 => ray.t_max = 1.0,
        3 => ray.direction[round % 3] = 0.0,
        _ => {}
    }
    ray
}

#[test]
fn closest_and_any_are_those_of_a_loop_over_all_shapes() {
    for (count, size) in [(0, 1.0), (1, 1.0), (9, 0.3), (400, 0.1), (3000, 0.02)] {
        let all = spheres(count, size, 3);
        let boxes: Vec<_> = all.iter().copied().map(box_of).collect();
        let masks: Vec<u32> = (0..count).map(|id| 1 << (id % 3)).collect();
        let boxes = Boxes::new(&boxes).unwrap().with_masks(Strided::new(&masks)).unwrap();
        for quality in [Quality::Fast, Quality::High] {
            let config = Config::from(Parameters::Bvh { quality });
            let built = Built::shapes(boxes, &config).unwrap();
            let shapes = Shapes::open(built.bytes(), boxes).unwrap();
            assert_eq!(shapes.count() as usize, count);
            let (mut random, mut hits) = (Random(5), 0);
            for round in 0..400 {
                let ray = ray(&mut random, round);
                let mask = [u32::MAX, 1, 6][round % 3];
                let seen = |id: usize| mask == u32::MAX || masks[id] & mask != 0;
                let met =
                    all.iter().enumerate().filter(|(id, _)| seen(*id)).filter_map(
                        |(id, sphere)| meet(*sphere, &ray).map(|hit| (hit.t, id as u32)),
                    );
                let expected = met.reduce(|a, b| if b < a { b } else { a });

                let mut asked = HashSet::new();
                let mut test = |id: u32, part: &Ray| {
                    assert!(asked.insert(id), "shape {id} was tested twice");
                    assert_eq!((part.origin, part.direction), (ray.origin, ray.direction));
                    assert!(part.t_min == ray.t_min && part.t_max <= ray.t_max);
                    meet(all[id as usize], part)
                };
                let mut work = Counters::default();
                let mut options = QueryOptions { mask, ..QueryOptions::counting(&mut work) };
                let hit = shapes.intersect_with(&ray, &mut options, &mut test);
                assert_eq!(hit.map(|hit| (hit.t, hit.primitive)), expected, "{ray:?}");
                if let Some(hit) = hit {
                    assert_eq!(
                        [hit.v, hit.u],
                        [all[hit.primitive as usize][0], all[hit.primitive as usize][3]]
                    );
                }
                let tested = work.primitive_tests as usize;
                assert!(asked.len() <= tested && tested <= count, "{} {tested}", asked.len());
                let mut options = QueryOptions { mask, ..QueryOptions::default() };
                let mut test = |id: u32, part: &Ray| meet(all[id as usize], part);
                let is_hit = shapes.occluded_with(&ray, &mut options, &mut test);
                assert_eq!(is_hit, expected.is_some(), "{ray:?}");
                hits += usize::from(is_hit);
            }
            assert!(hits < 300 && (hits > 2 || count == 0), "{count}: {hits}");
        }
    }
}

/// Boxes that lie more than 65535 bytes apart are read in another way. Nothing follows the last box.
#[test]
fn boxes_at_any_stride_give_the_same_answers() {
    let qualities = Quality::ALL.iter().copied();
    for (count, quality) in (1..=9).flat_map(|count| qualities.clone().map(move |q| (count, q))) {
        let all = spheres(count, 0.5, count as u64);
        let mut random = Random(7);
        let rays: Vec<_> = (0..256).map(|round| ray(&mut random, round)).collect();
        let expected: Vec<_> = rays
            .iter()
            .map(|ray| {
                let hits = all.iter().zip(0_u32..);
                let hits = hits.filter_map(|(sphere, id)| Some((meet(*sphere, ray)?, id)));
                let nearest = hits.reduce(|a, b| if b.0.t < a.0.t { b } else { a });
                nearest.map_or(Hit::MISS, |(ShapeHit { t, u, v }, primitive)| Hit {
                    t,
                    u,
                    v,
                    primitive,
                })
            })
            .collect();
        let blocked: Vec<_> = expected.iter().map(|hit| u8::from(hit.t.is_finite())).collect();
        assert!(blocked.contains(&1) && blocked.contains(&0), "{count}");
        let mut first_asked = None;
        for stride in [24, 28, 65_535, 65_541] {
            let mut bytes = vec![0xff; (count - 1) * stride + 24];
            for (sphere, place) in all.iter().zip(bytes.chunks_mut(stride)) {
                place[..24].copy_from_slice(box_of(*sphere).as_bytes());
            }
            let boxes = Boxes::strided(Strided { bytes: &bytes, stride, count }).unwrap();
            let built = Built::shapes(boxes, &Parameters::Bvh { quality }.into()).unwrap();
            let shapes = Shapes::open(built.bytes(), boxes).unwrap();
            // The shapes that are asked, in their order, show what boxes were read.
            let mut asked = Vec::new();
            let mut test = |id: u32, part: &Ray| {
                asked.push(id);
                meet(all[id as usize], part)
            };
            for ((ray, expected), blocked) in rays.iter().zip(&expected).zip(&blocked) {
                let hit = shapes.intersect(ray, &mut test).unwrap_or(Hit::MISS);
                assert_eq!(hit, *expected, "{count} at {stride}: {ray:?}");
                let is_hit = shapes.occluded(ray, &mut test);
                assert_eq!(u8::from(is_hit), *blocked, "{count} at {stride}: {ray:?}");
            }
            for coherence in COHERENCES {
                let (given, mut hits) = (Strided::new(&rays), vec![Hit::MISS; rays.len()]);
                let options = &mut QueryOptions::default();
                let answers = &mut StridedMut::new(&mut hits);
                shapes.intersect_n_with(&given, answers, coherence, options, &mut test).unwrap();
                assert_eq!(hits, expected, "{count} at {stride}");
                let mut occluded = vec![7_u8; rays.len()];
                let answers = &mut StridedMut::new(&mut occluded);
                shapes.occluded_n_with(&given, answers, coherence, options, &mut test).unwrap();
                assert_eq!(occluded, blocked, "{count} at {stride}");
            }
            let first = first_asked.get_or_insert_with(|| asked.clone());
            assert!(asked == *first, "{count} at {stride}: other shapes are asked");
        }
    }
}

#[test]
fn hits_behind_the_origin_are_found_however_far_from_zero() {
    let mut random = Random(29);
    for offset in [0.0, 64.0, 1000.0, 1e5] {
        for round in 0..400 {
            // Boxes that are flat on one axis. A shape is the middle of its box.
            let axis = round % 3;
            let boxes: Vec<[f32; 6]> = (0..1 + round % 9)
                .map(|_| {
                    let middle = random.point().map(|c| offset + (c * 8.0).round());
                    let side = |k: usize, to: f32| middle[k] + if k == axis { 0.0 } else { to };
                    std::array::from_fn(|i| side(i % 3, [-1.0, 1.0][i / 3]))
                })
                .collect();
            let middle = |id: u32| {
                [0, 1, 2].map(|k| 0.5 * (boxes[id as usize][k] + boxes[id as usize][k + 3]))
            };
            let views = Boxes::new(&boxes).unwrap();
            let built = Built::shapes(views, &Config::default()).unwrap();
            let shapes = Shapes::open(built.bytes(), views).unwrap();
            // The ray passes through the middle of the first one at t = -3, without rounding.
            let direction = random.point().map(|c| (c * 4.0).round());
            if direction == [0.0; 3] {
                continue;
            }
            let target = middle(0);
            let origin = [0, 1, 2].map(|k| target[k] + 3.0 * direction[k]);
            let ray = Ray { t_min: -8.0, t_max: -2.0, ..Ray::new(origin, direction) };
            let mut test = |id: u32, _: &Ray| {
                (middle(id) == target).then_some(ShapeHit { t: -3.0, u: 0.0, v: 0.0 })
            };
            let hit = shapes.intersect(&ray, &mut test);
            assert_eq!(hit.map(|hit| hit.t), Some(-3.0), "{ray:?} {boxes:?}");
            assert!(shapes.occluded(&ray, &mut test));
            let (rays, mut hits) = ([ray; 9], [Hit::MISS; 9]);
            let (rays, answers) = (Strided::new(&rays), &mut StridedMut::new(&mut hits));
            let options = &mut QueryOptions::default();
            let coherence = Coherence::Coherent;
            shapes.intersect_n_with(&rays, answers, coherence, options, &mut test).unwrap();
            assert_eq!(hits, [hit.unwrap(); 9], "{ray:?} {boxes:?}");
        }
    }
}

#[test]
fn batches_answer_as_each_ray_alone() {
    for (count, size) in [(0, 1.0), (1, 1.0), (9, 0.3), (400, 0.1), (3000, 0.02)] {
        let all = spheres(count, size, 3);
        let boxes: Vec<_> = all.iter().copied().map(box_of).collect();
        let masks: Vec<u32> = (0..count).map(|id| 1 << (id % 3)).collect();
        let boxes = Boxes::new(&boxes).unwrap().with_masks(Strided::new(&masks)).unwrap();
        let built = Built::shapes(boxes, &Config::default()).unwrap();
        let shapes = Shapes::open(built.bytes(), boxes).unwrap();
        let mut random = Random(5);
        // A picture in tiles of 8 x 8, rays from one point, rays from anywhere, and odd ones.
        let pixel = |at: u16| {
            let [x, y] = [at % 8 + at / 64 % 8 * 8, at / 8 % 8 + at / 512 * 8].map(f32::from);
            Ray::new([0.1, 0.2, 4.0], [x / 40.0 - 0.8, y / 40.0 - 0.8, -4.0])
        };
        let mut rays: Vec<_> = (0..4096).map(pixel).collect();
        rays.extend((0..200).map(|_| Ray::new([0.3, 0.1, -0.2], random.point())));
        rays.extend((0..400).map(|round| ray(&mut random, round)));
        rays.extend(odd_rays());
        for (mask, skip) in [(u32::MAX, u32::MAX), (6, u32::MAX), (u32::MAX, 2)] {
            let test = &mut |id: u32, part: &Ray| meet(all[id as usize], part);
            let expected: Vec<_> = rays
                .iter()
                .map(|ray| {
                    let options = &mut QueryOptions { mask, skip, ..QueryOptions::default() };
                    shapes.intersect_with(ray, options, test).unwrap_or(Hit::MISS)
                })
                .collect();
            let blocked: Vec<_> = expected.iter().map(|hit| u8::from(hit.t.is_finite())).collect();
            assert!(count < 9 || blocked.iter().filter(|is| **is != 0).count() > 300);
            let mut memory = vec![0; 16 * rays.len() + 16];
            for coherence in COHERENCES {
                for lent in [0, 16 * rays.len() + 16] {
                    let scratch = &mut memory[..lent];
                    let options =
                        &mut QueryOptions { mask, skip, scratch, ..QueryOptions::default() };
                    let (given, mut hits) = (Strided::new(&rays), vec![Hit::MISS; rays.len()]);
                    let answers = &mut StridedMut::new(&mut hits);
                    shapes.intersect_n_with(&given, answers, coherence, options, test).unwrap();
                    assert_eq!(hits, expected);
                    let mut occluded = vec![7_u8; rays.len()];
                    let answers = &mut StridedMut::new(&mut occluded);
                    shapes.occluded_n_with(&given, answers, coherence, options, test).unwrap();
                    assert_eq!(occluded, blocked);
                }
            }
        }
        // With counters, a batch counts the work of each ray alone.
        let test = &mut |id: u32, part: &Ray| meet(all[id as usize], part);
        let (mut alone, mut together) = (Counters::default(), Counters::default());
        for ray in &rays {
            let _ = shapes.intersect_with(ray, &mut QueryOptions::counting(&mut alone), test);
        }
        let mut hits = vec![Hit::MISS; rays.len()];
        let (given, answers) = (Strided::new(&rays), &mut StridedMut::new(&mut hits));
        let options = &mut QueryOptions::counting(&mut together);
        shapes.intersect_n_with(&given, answers, Coherence::Coherent, options, test).unwrap();
        assert_eq!(together, alone);
        let mut three = [0_u8; 3];
        let answers = &mut StridedMut::new(&mut three);
        let options = &mut QueryOptions::default();
        let refused = shapes.occluded_n_with(&given, answers, Coherence::Coherent, options, test);
        assert_eq!(refused, Err(Error::InvalidBatch(BatchField::Answers)));
    }
}

#[test]
fn shapes_are_tested_once_for_each_ray() {
    let all = spheres(400, 0.1, 3);
    let boxes: Vec<_> = all.iter().copied().map(box_of).collect();
    let boxes = Boxes::new(&boxes).unwrap();
    let built = Built::shapes(boxes, &Config::default()).unwrap();
    let shapes = Shapes::open(built.bytes(), boxes).unwrap();
    // Rays side by side, then scattered ones, of which some start far away or with a negative `t_min`: groups hand
    // these back. All directions differ.
    let mut random = Random(17);
    let rays: Vec<_> = (0..640_u16)
        .map(|at| {
            let across = [0.05 * f32::from(at % 8), 0.005 * f32::from(at / 8), -4.0];
            if at < 320 {
                return Ray::new([0.0, 0.0, 4.0], across);
            }
            let (from, to) = (random.point(), random.point());
            let distance = if at % 8 == 0 { 1e5 } else { 1.0 };
            let along: [f32; 3] = std::array::from_fn(|k| to[k] - from[k]);
            let origin = std::array::from_fn(|k| to[k] - distance * along[k]);
            let t_min = if at % 8 == 1 { -1.0 } else { 0.0 };
            Ray { t_min, ..Ray::new(origin, along) }
        })
        .collect();
    let asked = Mutex::new(HashSet::new());
    let test = |id: u32, part: &Ray| {
        assert!(
            asked.lock().unwrap().insert((id, part.direction.map(f32::to_bits))),
            "shape {id} was tested twice for one ray"
        );
        meet(all[id as usize], part)
    };
    let objects = [Object::Shapes(&shapes, &test)];
    let scene = Built::scene(&[Instance::new(0)], &objects, &Config::default()).unwrap();
    let scene = scene.open(&objects).unwrap();
    let wide: Vec<_> = rays.iter().map(RayF64::from).collect();
    let (given, wide_given) = (Strided::new(&rays), Strided::new(&wide));
    // Any hit ends a ray, so fewer shapes are tested.
    let finish = |least: usize, name: &str| {
        let tests = asked.lock().unwrap().drain().count();
        assert!(tests > least, "{name}: {tests}");
    };
    for ray in &rays {
        let _ = shapes.intersect_with(ray, &mut QueryOptions::default(), &mut { test });
    }
    finish(500, "intersect_with");
    for ray in &rays {
        let _ = shapes.occluded_with(ray, &mut QueryOptions::default(), &mut { test });
    }
    finish(300, "occluded_with");
    for ray in &wide {
        let _ = scene.intersect(ray);
    }
    finish(500, "intersect in a scene");
    for ray in &wide {
        let _ = scene.occluded(ray);
    }
    finish(300, "occluded in a scene");
    let (mut hits, mut occluded) = (vec![Hit::MISS; rays.len()], vec![0_u8; rays.len()]);
    let mut found = vec![SceneHit::MISS; rays.len()];
    let mut memory = vec![0; 16 * rays.len()];
    for coherence in COHERENCES {
        for lent in [0, 16 * rays.len()] {
            let scratch = &mut memory[..lent];
            let options = &mut QueryOptions { scratch, ..QueryOptions::default() };
            let answers = &mut StridedMut::new(&mut hits);
            shapes.intersect_n_with(&given, answers, coherence, options, &mut { test }).unwrap();
            finish(500, "intersect_n");
            let answers = &mut StridedMut::new(&mut occluded);
            shapes.occluded_n_with(&given, answers, coherence, options, &mut { test }).unwrap();
            finish(300, "occluded_n");
            let scratch = &mut memory[..lent];
            let options = &mut SceneOptions { scratch, ..SceneOptions::default() };
            let answers = &mut StridedMut::new(&mut found);
            scene.intersect_n_with(&wide_given, answers, coherence, options).unwrap();
            finish(500, "intersect_n in a scene");
            let answers = &mut StridedMut::new(&mut occluded);
            scene.occluded_n_with(&wide_given, answers, coherence, options).unwrap();
            finish(300, "occluded_n in a scene");
        }
    }
}

#[test]
fn shapes_whose_boxes_a_ray_touches_are_offered() {
    // Boxes on a lattice of quarters, some flat, so that rays run along their faces, edges and corners.
    let mut random = Random(11);
    let mut quarter = || (random.below(9) as f32 - 4.0) * 0.25;
    let boxes: Vec<[f32; 6]> = (0..500)
        .map(|_| {
            let [x, y, z] = [quarter(), quarter(), quarter()];
            let [a, b, c] = [quarter(), quarter(), quarter()].map(|side| side.abs() * 0.5);
            // Opposite corners in either order.
            if a < 0.2 { [x, y, z, x + a, y + b, z + c] } else { [x + a, y, z + c, x, y + b, z] }
        })
        .collect();
    let view = Boxes::new(&boxes).unwrap();
    let built = Built::shapes(view, &Config::default()).unwrap();
    let shapes = Shapes::open(built.bytes(), view).unwrap();
    let mut touched = 0;
    for round in 0..2000 {
        let mut from = [quarter(), quarter(), quarter()];
        let mut direction = [quarter(), quarter(), quarter()];
        if round % 3 == 0 {
            direction[round % 2] = 0.0;
        }
        if round % 4 == 0 {
            from[2] = -8.0;
            direction = [0.0, 0.0, 1.0];
        }
        if direction == [0.0; 3] {
            continue;
        }
        let ray = Ray { t_max: [f32::INFINITY, 1.0][round % 2], ..Ray::new(from, direction) };
        let mut offered = vec![false; boxes.len()];
        let mut test = |id: u32, _: &Ray| {
            offered[id as usize] = true;
            None
        };
        assert!(shapes.intersect(&ray, &mut test).is_none());
        for (id, sides) in boxes.iter().enumerate() {
            // Sums of quarters are exact, and so are their quotients except for thirds, which f64 tells apart.
            let (mut near, mut far) = (f64::from(ray.t_min), f64::from(ray.t_max));
            for k in 0..3 {
                let (low, high) = (sides[k].min(sides[k + 3]), sides[k].max(sides[k + 3]));
                let [low, high] = [low, high].map(|side| f64::from(side - from[k]));
                let d = f64::from(direction[k]);
                if d == 0.0 {
                    if low > 0.0 || high < 0.0 {
                        far = f64::NEG_INFINITY;
                    }
                } else {
                    near = near.max((low / d).min(high / d));
                    far = far.min((low / d).max(high / d));
                }
            }
            assert!(near > far || offered[id], "shape {id} {sides:?} {ray:?}");
            touched += usize::from(near <= far);
        }
    }
    assert!(touched > 5000, "{touched}");
}

#[test]
fn an_answer_outside_the_range_is_no_hit() {
    let boxes = [[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]];
    let view = Boxes::new(&boxes).unwrap();
    let built = Built::shapes(view, &Config::default()).unwrap();
    let shapes = Shapes::open(built.bytes(), view).unwrap();
    let ray = Ray { t_max: 2.0, ..Ray::new([0.5, 0.5, -1.0], [0.0, 0.0, 1.0]) };
    for t in [-1.0, 2.5, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut test = |_: u32, _: &Ray| Some(ShapeHit { t, u: 0.0, v: 0.0 });
        assert_eq!(shapes.intersect(&ray, &mut test), None, "{t}");
        assert!(!shapes.occluded(&ray, &mut test), "{t}");
    }
    for t in [0.0, 1.5, 2.0] {
        let mut test = |_: u32, _: &Ray| Some(ShapeHit { t, u: 0.0, v: 0.0 });
        assert_eq!(shapes.intersect(&ray, &mut test).map(|hit| hit.t), Some(t));
    }
}

#[test]
fn a_test_is_told_the_closest_hit_so_far_and_of_equal_hits_the_first_shape_wins() {
    // Boxes that begin before or behind one another, and all reach beyond the hits.
    for towards in [0.01, -0.01] {
        let boxes: Vec<_> =
            (0..40_u8).map(|id| [0.0, 0.0, towards * f32::from(id), 1.0, 1.0, 5.0]).collect();
        let view = Boxes::new(&boxes).unwrap();
        let built = Built::shapes(view, &Config::default()).unwrap();
        let shapes = Shapes::open(built.bytes(), view).unwrap();
        for step in [0.0, 0.01] {
            let (mut closest, mut calls) = (f32::INFINITY, 0);
            let mut test = |id: u32, ray: &Ray| {
                assert_eq!(ray.t_max.to_bits(), closest.to_bits(), "shape {id}");
                let t = 4.0 + step * (id % 7 * 3 % 7) as f32;
                closest = closest.min(t);
                calls += 1;
                Some(ShapeHit { t, u: 0.0, v: 0.0 })
            };
            let ray = Ray::new([0.5, 0.5, -1.0], [0.0, 0.0, 1.0]);
            let hit = shapes.intersect(&ray, &mut test).map(|hit| (hit.t, hit.primitive));
            assert_eq!(hit, Some((4.0, 0)));
            assert_eq!(calls, 40);
        }
    }
}

#[test]
fn moved_shapes_are_found_after_a_refit() {
    let all = spheres(700, 0.05, 9);
    let boxes: Vec<_> = all.iter().copied().map(box_of).collect();
    let mut built = Built::shapes(Boxes::new(&boxes).unwrap(), &Config::default()).unwrap();
    let moved: Vec<Sphere> = all.iter().map(|&[x, y, z, r]| [y * 2.0, z - x, x, r]).collect();
    let boxes: Vec<_> = moved.iter().copied().map(box_of).collect();
    let view = Boxes::new(&boxes).unwrap();
    Shapes::refit(built.bytes_mut(), &view).unwrap();
    let shapes = Shapes::open(built.bytes(), view).unwrap();
    shapes.validate(&mut vec![0; shapes.validate_bytes()]).unwrap();
    let (mut random, mut hits) = (Random(2), 0);
    for round in 0..200 {
        let ray = ray(&mut random, round);
        let met = moved.iter().filter_map(|sphere| meet(*sphere, &ray).map(|hit| hit.t));
        let expected = met.reduce(f32::min);
        let mut test = |id: u32, part: &Ray| meet(moved[id as usize], part);
        assert_eq!(shapes.intersect(&ray, &mut test).map(|hit| hit.t), expected);
        hits += usize::from(expected.is_some());
    }
    assert!(hits > 10 && hits < 150, "{hits}");
}
