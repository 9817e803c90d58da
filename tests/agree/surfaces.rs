//! Rays that leave a surface do not hit the triangle where they start, and on a convex mesh they hit nothing.

use hgrid_core::{Coherence, Config, Grid, Hit, Method, QueryOptions, Ray, Strided, StridedMut};
use hgrid_core::{Surface, TriangleTest};
use hgrid_tests::meshes::{Mesh, ball};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;

pub(crate) type Vector = [f64; 3];

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the triangle's normal, of any length.
fn normal_of(triangle: &[[f32; 3]; 3]) -> Vector {
    let [a, b, c] = triangle.map(|corner| corner.map(f64::from));
    let (u, v): (Vector, Vector) =
        (std::array::from_fn(|i| b[i] - a[i]), std::array::from_fn(|i| c[i] - a[i]));
    std::array::from_fn(|i| u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3])
}

/// Returns a direction on one side of a plane; half of them run nearly along it.
pub(crate) fn leaving(random: &mut Random, normal: Vector, side: f64) -> [f32; 3] {
    loop {
        let mut direction = random.point();
        if random.bits().is_multiple_of(2) {
            // Reduce the part along the normal to a thousandth or a millionth.
            let share = 1.0 - 0.001_f64.powi(1 + random.below(2) as i32);
            let part = dot(direction.map(f64::from), normal) / dot(normal, normal) * share;
            let along: [f64; 3] = std::array::from_fn(|i| part * normal[i]);
            direction = std::array::from_fn(|i| (f64::from(direction[i]) - along[i]) as f32);
        }
        let height = dot(direction.map(f64::from), normal) * side;
        // A direction closer to the plane than its own rounding is on neither side.
        if height > 1e-7 * dot(normal, normal).sqrt() {
            return direction;
        }
    }
}

/// Returns triangles of all shapes, some far from the origin: soups, slivers and needles.
fn triangle(random: &mut Random, scale: f32) -> [[f32; 3]; 3] {
    let place = if random.bits().is_multiple_of(2) { [0.0; 3] } else { random.point() };
    let size = [1.0, 1e-2, 1e-4][random.below(3)];
    let flat = [1.0, 1e-3][random.below(2)];
    let [a, b, c] = [random.point(), random.point(), random.point()];
    if random.below(4) == 0 {
        // A triangle across an axis and far out on it: its size is down to 2^-40 of the distance.
        let (axis, size) = (random.below(3), 0.5_f32.powi(random.below(41) as i32));
        return [a, b, c].map(|p| {
            std::array::from_fn(|i| if i == axis { place[axis] } else { p[i] * size } * scale)
        });
    }
    let c: [f32; 3] = std::array::from_fn(|i| a[i] + (b[i] - a[i]) * 0.4 + c[i] * flat);
    [a, b, c].map(|p| std::array::from_fn(|i| (place[i] + p[i] * size) * scale))
}

/// Returns a hit somewhere on a triangle, a ray, and the surface at the hit.
fn surface_on(random: &mut Random, mesh: &Mesh, primitive: u32) -> Option<(Hit, Ray, Surface)> {
    let (u, v) = (random.unit(), random.unit());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    // Take a corner or a point on an edge now and then.
    let (u, v) = [(u, v), (0.0, v), (u, 0.0), (0.0, 0.0)][random.below(8).saturating_sub(4)];
    let hit = Hit { t: 1.0, u, v, primitive };
    let ray = Ray::new([0.0; 3], random.point());
    mesh.view().surface(&ray, &hit).map(|surface| (hit, ray, surface))
}

#[test]
fn the_triangle_that_a_ray_leaves_is_not_hit_at_any_scale() {
    let mut random = Random(3);
    let mut count = 0;
    for scale in [1.0, 1e-30, 1e-20, 1e-6, 1e6, 1e20, 1e30] {
        for _ in 0..20_000 {
            let triangle = triangle(&mut random, scale);
            let mut mesh = Mesh::default();
            mesh.push(triangle);
            let normal = normal_of(&triangle);
            let Some((_, ray, surface)) = surface_on(&mut random, &mesh, 0) else { continue };
            let side = if dot(ray.direction.map(f64::from), normal) <= 0.0 { 1.0 } else { -1.0 };
            assert_eq!(surface.is_front, u32::from(side > 0.0));
            assert!(dot(surface.normal.map(f64::from), normal) * side > 0.0);
            for (start, side) in [(surface.above, side), (surface.below, -side)] {
                let leaves = Ray::new(start, leaving(&mut random, normal, side));
                let hit = TriangleTest::new(&leaves).and_then(|test| test.test(&triangle));
                assert_eq!(hit, None, "{leaves:?} {triangle:?} {surface:?}");
                count += 1;
            }
        }
    }
    assert!(count > 200_000, "{count}");
}

fn grid_of<'a>(owned: &'a mut Option<Owned>, mesh: &'a Mesh, method: Method) -> Grid<'a> {
    let view = mesh.view();
    let owned = owned.insert(Owned::build(&view, &Config::new(method)).unwrap());
    owned.open(&view).unwrap()
}

/// Twenty triangles around a point.
fn icosahedron() -> Mesh {
    const LONG: f32 = 1.618_034;
    let corners = |i: usize| {
        let (a, b) = ([-1.0, 1.0][i & 1], [-LONG, LONG][i >> 1 & 1]);
        [[a, b, 0.0], [0.0, a, b], [b, 0.0, a]][i >> 2]
    };
    let positions: Vec<[f32; 3]> = (0..12).map(corners).collect();
    let distance = |i: usize, j: usize| -> f32 {
        positions[i].iter().zip(positions[j]).map(|(a, b)| (a - b) * (a - b)).sum()
    };
    let is_edge = |i, j| (distance(i, j) - 4.0).abs() < 0.1;
    let mut mesh = Mesh { positions: positions.clone(), indices: Vec::new() };
    for (i, j, k) in
        (0..12).flat_map(|i| (i..12).flat_map(move |j| (j..12).map(move |k| (i, j, k))))
    {
        if is_edge(i, j) && is_edge(j, k) && is_edge(k, i) {
            let corners = [i, j, k].map(|corner| positions[corner]);
            let out = dot(normal_of(&corners), corners[0].map(f64::from)) > 0.0;
            let [i, j, k] = [i, j, k].map(|corner| corner as u32);
            mesh.indices.push(if out { [i, j, k] } else { [i, k, j] });
        }
    }
    assert_eq!(mesh.indices.len(), 20);
    mesh
}

/// Counts the rays that leave a convex mesh and still hit it; none should.
fn blocked(mesh: &Mesh, method: Method, coherence: Coherence) -> usize {
    let mut owned = None;
    let grid = grid_of(&mut owned, mesh, method);
    let mut random = Random(5);
    let mut rays = Vec::new();
    for _ in 0..20_000 {
        let primitive = random.below(mesh.indices.len()) as u32;
        let Some((.., surface)) = surface_on(&mut random, mesh, primitive) else { continue };
        // Fronts face outwards.
        let start = if surface.is_front == 1 { surface.above } else { surface.below };
        let normal = normal_of(&grid.mesh().triangle(primitive).unwrap());
        rays.push(Ray::new(start, leaving(&mut random, normal, 1.0)));
    }
    assert!(rays.len() > 10_000);
    let mut hits = vec![Hit::MISS; rays.len()];
    grid.intersect_n(&Strided::new(&rays), &mut StridedMut::new(&mut hits), coherence).unwrap();
    hits.iter().filter(|hit| hit.t < f32::INFINITY).count()
}

/// Leaving rays also miss the neighbours of their triangle, in the same plane or behind an edge.
#[test]
fn a_convex_mesh_hides_nothing_from_itself() {
    for mesh in [ball(24, 0.0), icosahedron()] {
        for (scale, shift) in [(1.0, 0.0), (1e-20, 0.0), (1e20, 0.0), (1.0, 1.0), (1.0, 100.0)] {
            let mesh = mesh.map(|p| p.map(|c| c * scale + shift));
            for method in [Method::Bvh, Method::OneLevel] {
                for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                    let count = blocked(&mesh, method, coherence);
                    assert_eq!(count, 0, "{method:?} {coherence:?} {scale} {shift}");
                }
            }
        }
    }
}

#[test]
fn a_miss_has_no_surface_and_a_triangle_without_area_one_that_faces_the_ray() {
    let mut mesh = Mesh::default();
    mesh.push([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
    let ray = Ray::new([0.5, 0.0, 1.0], [0.0, 0.0, -1.0]);
    let on = |primitive| mesh.view().surface(&ray, &Hit { t: 1.0, u: 0.5, v: 0.0, primitive });
    assert_eq!([on(1), mesh.view().surface(&ray, &Hit::MISS)], [None; 2]);
    // Without area any normal that faces the ray is valid.
    assert_eq!(on(0).map(|surface| surface.normal), Some([0.0, 0.0, 1.0]));
    // A ray with an invalid direction has no surface, on triangles with area or without.
    mesh.push([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    for direction in [[0.0; 3], [f32::NAN, 0.0, 1.0], [0.0, f32::INFINITY, 0.0]] {
        let ray = Ray { direction, ..ray };
        let on = |primitive| mesh.view().surface(&ray, &Hit { t: 1.0, u: 0.5, v: 0.0, primitive });
        assert_eq!([on(0), on(1)], [None; 2], "{direction:?}");
    }
}

/// Through a ball: a ray from `below` the first hit meets the other side where the whole ray leaves it.
#[test]
fn a_ray_that_goes_on_meets_the_other_side() {
    let mesh = ball(24, 1.0);
    let mut owned = None;
    let grid = grid_of(&mut owned, &mesh, Method::Bvh);
    let mut random = Random(7);
    for _ in 0..20_000 {
        let ([x, y, z], to) = (random.point(), random.point().map(|c| c * 0.3));
        let origin = [x, y, z + 3.0];
        let ray = Ray::new(origin, std::array::from_fn(|i| to[i] - origin[i]));
        let mut hits = [Hit::MISS; 8];
        let count = grid.intersect_all(&ray, &mut QueryOptions::default(), &mut hits);
        let surface = grid.mesh().surface(&ray, &hits[0]).expect("a hit");
        assert!(count >= 2 && surface.is_front == 1);
        let inside = grid.intersect(&Ray { origin: surface.below, ..ray }).expect("a closed ball");
        assert!((inside.t + hits[0].t - hits[count - 1].t).abs() < 1e-4);
    }
}
