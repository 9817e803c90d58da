//! A ray through shapes or a scene does no more than docs/bounds.md says, with a filter or without, alone or in a
//! batch: counted on trees that all lie at one place.

use hgrid_core::{
    Boxes, Coherence, Config, Counters, Instance, Method, Object, QueryOptions, Ray, RayF64, Scene,
    SceneHit, SceneOptions, ShapeHit, Shapes, Strided, StridedMut, Verdict,
};
use hgrid_tests::meshes::Mesh;
use hgrid_tests::owned::Owned;
use hgrid_tests::scenes::Built;

use super::bounds::{rays, tree_nodes};

/// Triangles of the mesh.
const TRIANGLES: u32 = 300;
const SHAPES: u32 = 200;
/// Instances of each object in the inner scene, and in the outer one.
const INNER: u32 = 20;
const OUTER: u32 = 7;

/// The bound of a ray: tests, leaves and nodes of one tree over so many items.
fn of_tree(items: u32) -> [u64; 3] {
    [items.into(), items.into(), tree_nodes(items.into())]
}

/// Adds so many times the bound of an object to that of a tree.
fn plus(tree: [u64; 3], times: u32, object: [u64; 3]) -> [u64; 3] {
    std::array::from_fn(|i| tree[i] + u64::from(times) * object[i])
}

fn hold(ray: &RayF64, work: &Counters, bound: [u64; 3]) {
    let done = [work.primitive_tests, work.cell_steps, work.grid_steps];
    assert!((0..3).all(|i| done[i] <= bound[i]), "{done:?} above {bound:?}, {ray:?}");
}

/// Walks of a grid whose filter rejects everything: for 1, 2, 4 and 8 hits, one for each sixteen after them, and one
/// that finds fewer than sixteen or none.
const WALKS: u64 = 4 + (TRIANGLES as u64 - 15) / 16 + 1;

/// Counts what a query of so many rays does in a scene whose filter rejects everything.
fn work_of_a_filter(ask: impl FnOnce(&mut SceneOptions<'_>)) -> Counters {
    let mut work = Counters::default();
    let reject = &mut |_: usize, _: &SceneHit| Verdict::Reject;
    let (filter, counters) = (Some(reject as &mut _), Some(&mut work));
    ask(&mut SceneOptions { filter, counters, ..SceneOptions::default() });
    work
}

/// Asks with a filter about each ray alone, and about all in batches, which do the same work. Returns the part of the
/// bound that the ray with the most tests reaches.
fn filters_hold(scene: &Scene<'_>, rays: &[RayF64], bound: [u64; 3]) -> f64 {
    let mut most = 0.0_f64;
    for is_any in [false, true] {
        let mut alone = Counters::default();
        for ray in rays {
            let work = work_of_a_filter(|options| {
                let is_hit = if is_any {
                    scene.occluded_with(ray, options)
                } else {
                    scene.intersect_with(ray, options).is_some()
                };
                assert!(!is_hit);
            });
            hold(ray, &work, bound);
            most = most.max(work.primitive_tests as f64 / bound[0] as f64);
            alone.add(&work);
        }
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let given = Strided::new(rays);
            let work = work_of_a_filter(|options| {
                if is_any {
                    let mut occluded = vec![1_u8; rays.len()];
                    let to = &mut StridedMut::new(&mut occluded);
                    scene.occluded_n_with(&given, to, coherence, options).unwrap();
                    assert!(occluded.iter().all(|&is_hit| is_hit == 0));
                } else {
                    let mut hits = vec![SceneHit { t: 0.0, ..SceneHit::MISS }; rays.len()];
                    let to = &mut StridedMut::new(&mut hits);
                    scene.intersect_n_with(&given, to, coherence, options).unwrap();
                    assert!(hits.iter().all(|hit| *hit == SceneHit::MISS));
                }
            });
            assert_eq!(work, alone, "{coherence:?}");
        }
    }
    most
}

/// Returns the rays of the meshes, and the same from far away and from where only f64 reaches.
fn all_rays() -> Vec<RayF64> {
    let near: Vec<RayF64> = rays().iter().map(RayF64::from).collect();
    let moved = |by: f64| near.iter().map(move |ray| back(ray, by));
    near.iter().copied().chain(moved(1e4)).chain(moved(1e12)).collect()
}

fn back(ray: &RayF64, by: f64) -> RayF64 {
    let along = |axis: usize| ray.origin[axis] - by * f64::from(ray.direction[axis]);
    RayF64 { origin: std::array::from_fn(along), ..*ray }
}

#[test]
fn a_ray_tests_each_shape_and_enters_each_instance_once() {
    let config = Config::new(Method::Bvh);
    let mut mesh = Mesh::default();
    for _ in 0..TRIANGLES {
        mesh.push([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]);
    }
    let view = mesh.view();
    let owned = Owned::build(&view, &config).unwrap();
    let grid = owned.open(&view).unwrap();
    let boxes = vec![[0.0, 0.0, 0.0, 1.0, 1.0, 0.5]; SHAPES as usize];
    let boxes = Boxes::new(&boxes).unwrap();
    let built = Built::shapes(boxes, &config).unwrap();
    let shapes = Shapes::open(built.bytes(), boxes).unwrap();

    // The shapes alone. The test misses them, so that no ray ends.
    for ray in rays() {
        for is_any in [false, true] {
            let (mut work, mut times) = (Counters::default(), vec![0; SHAPES as usize]);
            let mut miss = |id: u32, _: &Ray| -> Option<ShapeHit> {
                times[id as usize] += 1;
                None
            };
            let options = &mut QueryOptions::counting(&mut work);
            let is_hit = if is_any {
                shapes.occluded_with(&ray, options, &mut miss)
            } else {
                shapes.intersect_with(&ray, options, &mut miss).is_some()
            };
            assert!(!is_hit && times.iter().all(|&times| times <= 1), "{ray:?}");
            hold(&RayF64::from(&ray), &work, of_tree(SHAPES));
        }
    }

    // The mesh and the shapes in a scene, and all three in another, each at the same place many times.
    let miss = |_: u32, _: &Ray| -> Option<ShapeHit> { None };
    let instances = |objects: u32, each: u32| -> Vec<_> {
        (0..objects * each).map(|number| Instance::new(number % objects)).collect()
    };
    let objects = [Object::Grid(&grid), Object::Shapes(&shapes, &miss)];
    let built = Built::scene(&instances(2, INNER), &objects, &config).unwrap();
    let inner = built.open(&objects).unwrap();
    let objects = [objects[0], objects[1], Object::Scene(&inner)];
    let built = Built::scene(&instances(3, OUTER), &objects, &config).unwrap();
    let outer = built.open(&objects).unwrap();
    let of_objects = plus(of_tree(TRIANGLES), 1, of_tree(SHAPES));
    let of_inner = plus(of_tree(2 * INNER), INNER, of_objects);
    let of_outer = plus(plus(of_tree(3 * OUTER), OUTER, of_objects), OUTER, of_inner);
    let mut most = [0.0_f64; 2];
    for ray in all_rays() {
        for ((scene, bound), most) in [(&inner, of_inner), (&outer, of_outer)].iter().zip(&mut most)
        {
            for is_any in [false, true] {
                let mut work = Counters::default();
                let counters = Some(&mut work);
                let options = &mut SceneOptions { counters, ..SceneOptions::default() };
                if is_any {
                    let _ = scene.occluded_with(&ray, options);
                } else {
                    let _ = scene.intersect_with(&ray, options);
                }
                hold(&ray, &work, *bound);
                *most = most.max(work.primitive_tests as f64 / bound[0] as f64);
            }
        }
    }
    // Some ray meets everything.
    assert!(most.iter().all(|&most| most > 0.99), "{most:?}");

    // A filter multiplies the work in the mesh, and not that in the trees of the scenes and of the shapes.
    let of_objects = plus(of_tree(SHAPES), 1, of_tree(TRIANGLES).map(|most| WALKS * most));
    let of_inner = plus(of_tree(2 * INNER), INNER, of_objects);
    let of_outer = plus(plus(of_tree(3 * OUTER), OUTER, of_objects), OUTER, of_inner);
    let rays: Vec<_> = all_rays().into_iter().rev().step_by(15).collect();
    let most = [filters_hold(&inner, &rays, of_inner), filters_hold(&outer, &rays[..1], of_outer)];
    assert!(most.iter().all(|&most| most > 0.9), "{most:?}");
}
