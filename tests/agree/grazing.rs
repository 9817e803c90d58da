//! Rays along the planes of triangles, in scenes of instances. The exact place where such a ray meets a plane decides
//! whether it hits, and lies far from the `t` that is reported. So the hit of one instance must not take that of
//! another out of the range, in whatever order they are asked.

use hgrid_core::{
    Coherence, Config, Instance, Method, Object, Ray, RayF64, Scene, SceneHit, SceneOptions,
    Strided, StridedMut, Verdict,
};
use hgrid_tests::meshes::Mesh;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::{Built, matrix};

use super::scenes::Alone;

/// A triangle, and a ray in its plane.
const TRIANGLE: [[f32; 3]; 3] = [
    [0.710_768_1, 0.924_573_6, 0.807_008_56],
    [0.074_594_85, -0.511_200_4, -0.185_341_08],
    [-0.570_870_04, 0.816_388_4, 0.489_859_37],
];
const ORIGIN: [f32; 3] = [0.077_972_31, 0.064_153_84, 0.162_899_69];
const DIRECTION: [f32; 3] = [-0.575_077_3, 0.252_325_6, 0.039_451_715];

/// Returns a triangle next to the known one, or anywhere.
fn triangle(random: &mut Random) -> [[f32; 3]; 3] {
    let near = random.below(2) == 0;
    TRIANGLE.map(|corner| {
        let by = random.point();
        std::array::from_fn(|k| if near { corner[k] + by[k] / 64.0 } else { by[k] })
    })
}

/// Returns a ray that starts on a triangle and runs along its plane. Of many points and directions, their rounding
/// leaves these the nearest to it.
fn along([a, b, c]: [[f32; 3]; 3], random: &mut Random) -> Ray {
    let minus = |p: [f32; 3], q: [f32; 3]| [0, 1, 2].map(|k| f64::from(p[k]) - f64::from(q[k]));
    let (e, f) = (minus(b, a), minus(c, a));
    let normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    let height = |[x, y, z]: [f64; 3]| (normal[0] * x + normal[1] * y + normal[2] * z).abs();
    let mut nearest = |from: [f32; 3], start: f32, width: f32| {
        let mut candidate = |_: usize| {
            let (u, v) = (start + width * random.unit(), start + width * random.unit());
            let along = |k: usize| f64::from(u) * e[k] + f64::from(v) * f[k];
            let point = [0, 1, 2].map(|k| (f64::from(from[k]) + along(k)) as f32);
            (height(minus(point, from)), point)
        };
        (0..64).map(&mut candidate).min_by(|p, q| p.0.total_cmp(&q.0)).unwrap().1
    };
    let mut ray = Ray::new(nearest(a, 0.0, 0.5), nearest([0.0; 3], -0.5, 1.0));
    match random.below(6) {
        0 => ray.t_min = -1.0,
        1 => ray.t_max = random.unit(),
        _ => {}
    }
    ray
}

/// Returns an instance that leaves its object where it is, moves it a little or far, or turns it.
fn placed(objects: usize, random: &mut Random) -> Instance {
    let instance = Instance::new(u32::try_from(random.below(objects)).unwrap());
    let moved = |by: f64, random: &mut Random| random.point().map(|c| f64::from(c) * by);
    match random.below(8) {
        0..3 => instance,
        3 => Instance { translation: moved(1e-7, random), ..instance },
        4 => Instance { translation: moved(0.1, random), ..instance },
        5 => Instance { translation: moved(9.0, random), ..instance },
        // Twice the size around zero, with the triangle in a plane next to its own.
        6 => Instance { linear: [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]], ..instance },
        _ => Instance { linear: matrix(random), ..instance },
    }
}

/// Compares all queries of a scene with the answers of its instances alone; returns the number of hits.
pub(crate) fn compare(instances: &[Instance], objects: &[Object<'_>], rays: &[RayF64]) -> usize {
    let alone = Alone::new(instances, objects);
    let built = Built::scene(instances, objects, &Config::default()).unwrap();
    let scene = built.open(objects).unwrap();
    let expected: Vec<_> = rays
        .iter()
        .map(|ray| alone.closest(objects, ray, |_, scene, ray| scene.intersect(ray)))
        .collect();
    for (ray, expected) in rays.iter().zip(&expected) {
        assert_eq!(scene.intersect(ray), *expected, "{ray:?} {instances:?}");
        assert_eq!(scene.occluded(ray), expected.is_some(), "{ray:?} {instances:?}");
        // Queries with a filter walk another way.
        let mut accept = |_: usize, _: &SceneHit| Verdict::Accept;
        let options = &mut SceneOptions { filter: Some(&mut accept), ..SceneOptions::default() };
        assert_eq!(scene.intersect_with(ray, options), *expected, "{ray:?} {instances:?}");
    }
    let mut found = vec![SceneHit::MISS; rays.len()];
    let (given, answers) = (Strided::new(rays), &mut StridedMut::new(&mut found));
    let options = &mut SceneOptions::default();
    scene.intersect_n_with(&given, answers, Coherence::Coherent, options).unwrap();
    for ((ray, found), expected) in rays.iter().zip(&found).zip(&expected) {
        assert_eq!(*found, expected.unwrap_or(SceneHit::MISS), "{ray:?} {instances:?}");
    }
    expected.iter().flatten().count()
}

#[test]
fn a_grazed_instance_is_hit_whatever_was_hit_before() {
    let mut random = Random(31);
    let mut hits = 0;
    for round in 0..40 {
        let corners = if round == 0 { TRIANGLE } else { triangle(&mut random) };
        let mut mesh = Mesh::default();
        mesh.push(corners);
        // In some rounds the tree has more than one leaf.
        for _ in 0..[0, 0, 30][round % 3] {
            let (center, corner) = (random.point(), |by: [f32; 3]| by.map(|c| 0.1 * c));
            let other = [random.point(), random.point(), random.point()].map(corner);
            mesh.push(other.map(|p| [0, 1, 2].map(|k| center[k] + p[k])));
        }
        let mesh = mesh.view();
        let methods = [Method::Bvh, Method::OneLevel];
        let built = methods.map(|method| Owned::build(&mesh, &Config::new(method)).unwrap());
        let grids = [built[0].open(&mesh).unwrap(), built[1].open(&mesh).unwrap()];

        let mut rays: Vec<_> = (0..32).map(|_| along(corners, &mut random)).collect();
        rays[0] = if round == 0 { Ray::new(ORIGIN, DIRECTION) } else { rays[0] };
        let rays: Vec<_> = rays.iter().map(RayF64::from).collect();

        // One of the objects is a scene of its own.
        let grids = [Object::Grid(&grids[0]), Object::Grid(&grids[1])];
        let inner: Vec<_> = (0..3).map(|_| placed(grids.len(), &mut random)).collect();
        hits += compare(&inner, &grids, &rays);
        let inner = Built::scene(&inner, &grids, &Config::default()).unwrap();
        let inner: Scene<'_> = inner.open(&grids).unwrap();
        let objects = [grids[0], grids[0], grids[1], Object::Scene(&inner)];
        let count = 2 + random.below(7);
        let mut instances: Vec<_> =
            (0..count).map(|_| placed(objects.len(), &mut random)).collect();
        hits += compare(&instances, &objects, &rays);
        instances.reverse();
        hits += compare(&instances, &objects, &rays);
    }
    assert!(hits > 500, "{hits} hits");
}
