//! A batch in a scene answers as each of its rays alone, bit for bit, whatever the scene shows, however far
//! from zero it lies, and at every SIMD level.

use hgrid_core::{
    BatchField, Boxes, Coherence, Config, Counters, Cull, Error, Instance, Object, Ray, RayF64,
    Scene, SceneHit, SceneOptions, ShapeHit, Shapes, SimdLevel, Strided, StridedMut, TriangleMesh,
    Verdict,
};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::{Built, scattered};

use super::batches::{COHERENCES, odd_rays};
use super::scenes::{enter, ray, spread_masks, with_grids};

/// Returns rays of every kind: tiles of cameras near and far, rays from one place, rays from anywhere, and odd ones.
fn rays(scene: &Scene<'_>, width: f64) -> Vec<RayF64> {
    let mut rays: Vec<RayF64> = Vec::new();
    let bounds = scene.bounds();
    for (view, size) in [(View::Front, 24_u16), (View::ThreeQuarter, 40), (View::Top, 200)] {
        let camera = Camera::framing(bounds, view, Up::Y);
        let at = |i: u16| (i % 16, i / 16);
        rays.extend((0..256).map(|i| RayF64::from(&camera.ray(at(i).0, at(i).1, size))));
    }
    // Rays as from a surface: neighbouring origins that f32 cannot represent. At least half of them have an end.
    let mut random = Random(11);
    for long in [f32::INFINITY, 0.3, f32::INFINITY, 0.1] {
        let from = random.point().map(|c| f64::from(c) * width);
        rays.extend((0..128).map(|i| {
            let from = [from[0] + 1e-3 * f64::from(i) + 1e-11, from[1], from[2]];
            let t_max = [long, 0.5][i as usize % 2] * width as f32;
            RayF64 { t_max, ..RayF64::new(from, random.point()) }
        }));
    }
    rays.extend((0..300).map(|round| ray(&mut random, round, width as f32)));
    rays.extend(odd_rays().iter().map(RayF64::from));
    rays
}

/// The bits of a hit.
fn bits(hit: &SceneHit) -> ([u32; 4], [u32; 4]) {
    ([hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive], hit.path)
}

/// Compares all batch queries with each ray alone, and returns the number of hits.
fn compare(scene: &Scene<'_>, rays: &[RayF64]) -> usize {
    let mut hits = 0;
    for (mask, cull) in [(u32::MAX, Cull::None), (6, Cull::None), (u32::MAX, Cull::Back)] {
        let alone = |ray| {
            let mut options = SceneOptions { mask, cull, ..SceneOptions::default() };
            scene.intersect_with(ray, &mut options)
        };
        let alone: Vec<_> = rays.iter().map(alone).collect();
        hits += alone.iter().flatten().count();
        // With all bits, a query sees an instance whose mask has none.
        for hit in alone.iter().flatten() {
            let shown = scene.instance(hit.path[0]).unwrap().mask;
            assert!(mask == u32::MAX || shown & mask != 0, "{hit:?}");
        }
        let expected: Vec<_> =
            alone.iter().map(|hit| bits(&hit.unwrap_or(SceneHit::MISS))).collect();
        let blocked: Vec<u8> = alone.iter().map(|hit| u8::from(hit.is_some())).collect();
        let mut memory = vec![0; 16 * rays.len() + 16];
        for level in SimdLevel::available() {
            let scene = scene.with_simd(level);
            for coherence in COHERENCES {
                for lent in [0, 16 * rays.len() + 16] {
                    let scratch = &mut memory[..lent];
                    let options =
                        &mut SceneOptions { mask, cull, scratch, ..SceneOptions::default() };
                    let (given, mut found) = (Strided::new(rays), vec![SceneHit::MISS; rays.len()]);
                    let answers = &mut StridedMut::new(&mut found);
                    scene.intersect_n_with(&given, answers, coherence, options).unwrap();
                    for (place, (found, expected)) in found.iter().zip(&expected).enumerate() {
                        let ray = rays[place];
                        assert_eq!(bits(found), *expected, "{level:?} {coherence:?} {ray:?}");
                    }
                    let mut occluded = vec![7_u8; rays.len()];
                    let answers = &mut StridedMut::new(&mut occluded);
                    scene.occluded_n_with(&given, answers, coherence, options).unwrap();
                    assert_eq!(occluded, blocked, "{level:?} {coherence:?}");
                }
            }
        }
    }
    hits
}

#[test]
fn batches_in_scenes_of_grids_answer_as_each_ray_alone() {
    with_grids(|objects, _| {
        for (count, width) in [(0, 1.0), (1, 1.0), (7, 3.0), (60, 6.0), (150, 200.0)] {
            let mut instances = scattered(count, 3, width, 8);
            spread_masks(&mut instances);
            // Let pairs of instances share a place: the first of each pair is reported.
            for second in count / 2..count {
                let Instance { id, mask, .. } = instances[second];
                instances[second] = Instance { id, mask, ..instances[second - count / 2] };
            }
            let built = Built::scene(&instances, objects, &Config::default()).unwrap();
            let scene = built.open(objects).unwrap();
            let rays = rays(&scene, width);
            let hits = compare(&scene, &rays);
            assert!(count == 0 || width > 10.0 || hits > 100, "{hits} hits");
            let hits = rays.iter().filter_map(|ray| scene.intersect(ray));
            let without_bits = hits.filter(|hit| instances[hit.path[0] as usize].mask == 0);
            assert!(count < 60 || width > 10.0 || without_bits.count() > 10);
        }
    });
}

#[test]
fn batches_far_from_zero_answer_as_each_ray_alone() {
    with_grids(|objects, _| {
        let instances = scattered(60, 3, 6.0, 8);
        let here = Built::scene(&instances, objects, &Config::default()).unwrap();
        let near = rays(&here.open(objects).unwrap(), 6.0);
        for offset in [1e4, 1e6, 1e8] {
            let moved = |at: [f64; 3]| at.map(|c| c + offset);
            let mut instances = instances.clone();
            for instance in &mut instances {
                instance.translation = moved(instance.translation);
            }
            let built = Built::scene(&instances, objects, &Config::default()).unwrap();
            let scene = built.open(objects).unwrap();
            let far: Vec<_> =
                near.iter().map(|ray| RayF64 { origin: moved(ray.origin), ..*ray }).collect();
            let hits = compare(&scene, &far);
            assert!(hits > 200, "{hits} hits, {offset}");
        }
    });
}

#[test]
fn batches_meet_what_is_smaller_than_the_rounding_of_their_origins() {
    with_grids(|objects, _| {
        let mut random = Random(17);
        // Specks near zero in a scene that is a few units wide.
        let aside = |x, y| Instance { translation: [x, y, 0.0], ..Instance::new(0) };
        let mut instances = vec![aside(3.0, -3.0), aside(-3.0, 3.0)];
        let mut specks = scattered(64, 1, 1e-3, 6);
        for speck in &mut specks {
            let size = 1e-10;
            speck.linear = [[size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]];
        }
        instances.extend(&specks);
        let built = Built::scene(&instances, objects, &Config::default()).unwrap();
        let scene = built.open(objects).unwrap();
        // A ray through a speck, from an origin that f64 can represent and f32 cannot.
        let ray = |speck: &Instance| {
            let direction = random.point().map(|c| 1.0 + 1e-3 * c);
            let origin = std::array::from_fn(|k| speck.translation[k] - f64::from(direction[k]));
            RayF64 { t_min: 0.5, ..RayF64::new(origin, direction) }
        };
        let rays: Vec<_> = specks.iter().map(ray).collect();
        let hits = compare(&scene, &rays);
        assert!(hits > 2 * rays.len(), "{hits} hits");
    });
}

/// From so far away, the origin that the object sees is rounded to a place behind its only surface.
#[test]
fn batches_from_many_extents_away_answer_as_each_ray_alone() {
    let corners = [[-1.0, -1.0, 0.3], [1.0, -1.0, 0.3], [1.0, 1.0, 0.3], [-1.0, 1.0, 0.3]];
    let mesh = TriangleMesh::new(&corners, &[[0, 1, 2], [2, 3, 0]]).unwrap();
    let owned = Owned::build(&mesh, &Config::default()).unwrap();
    let grid = owned.open(&mesh).unwrap();
    // The same square as a shape, in a box that holds its hits with their rounding.
    let view = Boxes::new(&[[-1.0, -1.0, 0.299, 1.0, 1.0, 0.301]]).unwrap();
    let tree = Built::shapes(view, &Config::default()).unwrap();
    let shapes = Shapes::open(tree.bytes(), view).unwrap();
    let square = |_: u32, ray: &Ray| {
        let [x, y, z] = ray.origin;
        let [u, v, w] = ray.direction;
        let t = (0.3 - z) / w;
        let is_inside = (x + t * u).abs() < 1.0 && (y + t * v).abs() < 1.0;
        is_inside.then_some(ShapeHit { t, u: 0.0, v: 0.0 })
    };
    for distance in [1e8, 1e10, 1e11, 1e12, 1e13, 1e14] {
        // The second instance makes the scene so wide that its rays are not remote.
        let aside = Instance { translation: [distance, 0.0, 0.0], ..Instance::new(0) };
        let objects = [Object::Grid(&grid), Object::Shapes(&shapes, &square)];
        let linear = [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5]];
        let scaled =
            |object, x| Instance { linear, translation: [x, 0.0, 0.0], ..Instance::new(object) };
        let instances = [Instance::new(0), scaled(0, 4.0), scaled(1, 8.0), aside];
        let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
        let scene = built.open(&objects).unwrap();
        let mut random = Random(18);
        let ray = |i: u32| {
            let [x, y, z] = random.point().map(f64::from);
            let x = x + 10.0 * f64::from(i % 3);
            let [u, v, _] = random.point().map(|c| c * (0.4 / distance) as f32);
            RayF64::new([0.4 * x, 0.4 * y, 0.3 * distance + z], [u, v, z as f32 - 2.0])
        };
        let rays: Vec<_> = (0..512).map(ray).collect();
        let hits = compare(&scene, &rays);
        assert!(hits > rays.len(), "{hits} hits, {distance}");
    }
}

#[test]
fn batches_in_scenes_of_shapes_and_scenes_answer_as_each_ray_alone() {
    with_grids(|objects, _| {
        let boxes = [[-1.0, -1.0, -1.0, 1.0, 1.0, 1.0], [3.0, -1.0, -1.0, 5.0, 1.0, 1.0]];
        let view = Boxes::new(&boxes).unwrap();
        let tree = Built::shapes(view, &Config::default()).unwrap();
        let test = |id: u32, ray: &Ray| enter(&boxes[id as usize], ray);
        let shapes = Shapes::open(tree.bytes(), view).unwrap();
        let inner = scattered(5, 3, 2.0, 31);
        let inner_built = Built::scene(&inner, objects, &Config::default()).unwrap();
        let inner_scene = inner_built.open(objects).unwrap();
        let all =
            [objects[0], Object::Shapes(&shapes, &test), Object::Scene(&inner_scene), objects[2]];
        let mut instances = scattered(40, 4, 12.0, 33);
        spread_masks(&mut instances);
        let built = Built::scene(&instances, &all, &Config::default()).unwrap();
        let scene = built.open(&all).unwrap();
        let hits = compare(&scene, &rays(&scene, 12.0));
        assert!(hits > 200, "{hits} hits");
    });
}

#[test]
fn filters_and_counters_see_the_rays_of_a_batch_in_order() {
    with_grids(|objects, _| {
        let instances = scattered(60, 3, 6.0, 8);
        let built = Built::scene(&instances, objects, &Config::default()).unwrap();
        let scene = built.open(objects).unwrap();
        let rays = rays(&scene, 6.0);
        let accepts = |hit: &SceneHit| (hit.primitive + hit.path[0]).is_multiple_of(3);
        let verdict = |hit: &SceneHit| if accepts(hit) { Verdict::Accept } else { Verdict::Reject };

        let mut work = Counters::default();
        let alone: Vec<_> = rays
            .iter()
            .map(|ray| {
                let mut filter = |_: usize, hit: &SceneHit| verdict(hit);
                let (filter, counters) = (Some(&mut filter as &mut _), Some(&mut work));
                let mut options = SceneOptions { filter, counters, ..SceneOptions::default() };
                scene.intersect_with(ray, &mut options).unwrap_or(SceneHit::MISS)
            })
            .collect();
        for coherence in COHERENCES {
            let (mut last, mut counted) = (0, Counters::default());
            let mut filter = |place: usize, hit: &SceneHit| {
                assert!(place >= last, "{place} after {last}");
                last = place;
                verdict(hit)
            };
            let (filter, counters) = (Some(&mut filter as &mut _), Some(&mut counted));
            let mut options = SceneOptions { filter, counters, ..SceneOptions::default() };
            let (given, mut found) = (Strided::new(&rays), vec![SceneHit::MISS; rays.len()]);
            scene
                .intersect_n_with(&given, &mut StridedMut::new(&mut found), coherence, &mut options)
                .unwrap();
            assert_eq!(found, alone);
            assert_eq!(counted, work);
            assert!(last > rays.len() / 2);
        }
    });
}

#[test]
fn arrays_that_do_not_fit_are_refused() {
    with_grids(|objects, _| {
        let built = Built::scene(&[Instance::new(0)], objects, &Config::default()).unwrap();
        let scene = built.open(objects).unwrap();
        let rays = [RayF64::new([0.0, 0.0, 5.0], [0.0, 0.0, -1.0]); 4];
        let narrow = rays.map(|ray| Ray { t_min: ray.t_min, ..Ray::new([0.0; 3], ray.direction) });
        let marked = SceneHit { primitive: 77, ..SceneHit::MISS };
        let mut hits = [marked; 4];
        let options = &mut SceneOptions::default();
        let coherence = Coherence::Coherent;

        let mut ask = |rays: &Strided<'_>, count: usize| {
            let answers = &mut StridedMut::new(&mut hits[..count]);
            scene.intersect_n_with(rays, answers, coherence, options)
        };
        let refused = |field| Err(Error::InvalidBatch(field));
        assert_eq!(ask(&Strided::new(&rays), 3), refused(BatchField::Answers));
        // A stride of 32 bytes is too small for rays of 48.
        assert_eq!(ask(&Strided::new(&narrow), 4), refused(BatchField::Rays));
        assert!(hits.iter().all(|hit| hit == &marked));
        let mut occluded = [7_u8; 5];
        let answers = &mut StridedMut::new(&mut occluded);
        let answer = scene.occluded_n_with(&Strided::new(&rays), answers, coherence, options);
        assert_eq!((answer, occluded), (refused(BatchField::Answers), [7; 5]));
        let answers = &mut StridedMut::new(&mut occluded[..4]);
        scene.occluded_n_with(&Strided::new(&rays), answers, coherence, options).unwrap();
        assert_eq!(occluded, [1, 1, 1, 1, 7]);
    });
}
