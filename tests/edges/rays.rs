//! Invalid rays miss; valid rays at the limits are answered as brute force does.

use hgrid_core::{Coherence, Config, Cull, Grid, Hit, Parameters, Ray, Strided, StridedMut};
use hgrid_tests::meshes::{Mesh, ball, soup};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle, rounds};

fn ask(mesh: &Mesh, rays: impl IntoIterator<Item = Ray>) -> usize {
    let view = mesh.view();
    let owned: Vec<Owned> =
        methods::configs().map(|config| Owned::build(&view, &config).unwrap()).collect();
    let grids: Vec<Grid<'_>> = owned.iter().map(|owned| owned.open(&view).unwrap()).collect();
    rays.into_iter().filter(|ray| oracle::check_all(&grids, ray)).count()
}

#[test]
fn rays_that_are_no_rays_miss() {
    let mesh = ball(4, 1.0);
    let sound = Ray::new([0.1, 0.2, 3.0], [0.0, 0.01, -1.0]);
    assert_eq!(ask(&mesh, [sound]), 1);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let mut rays = Vec::new();
    for axis in 0..3 {
        for value in bad {
            let (mut origin, mut direction) = (sound, sound);
            origin.origin[axis] = value;
            direction.direction[axis] = value;
            rays.extend([origin, direction]);
        }
    }
    rays.push(Ray { direction: [0.0, -0.0, 0.0], ..sound });
    rays.push(Ray { t_min: f32::NAN, ..sound });
    rays.push(Ray { t_max: f32::NAN, ..sound });
    rays.push(Ray { t_min: 2.0, t_max: 1.0, ..sound });
    rays.push(Ray { t_min: f32::INFINITY, ..sound });
    rays.push(Ray { t_max: f32::NEG_INFINITY, ..sound });
    assert_eq!(ask(&mesh, rays), 0);
    assert_eq!(ask(&mesh, [Ray { t_min: f32::NEG_INFINITY, ..sound }]), 1);
}

/// Rays from inside a mesh and from its surfaces, with a start before the origin, at it and behind it, and directions of
/// every length: what lies before the start is no hit, all else is.
#[test]
fn starts_lie_on_either_side_of_surfaces() {
    let mesh = ball(8, 0.0);
    let view = mesh.view();
    let mut random = Random(77);
    let mut rays = Vec::new();
    for round in 0..rounds(120) {
        let direction = random.point();
        let whole = Ray { t_min: f32::NEG_INFINITY, ..Ray::new(random.point(), direction) };
        // The origin lies inside the ball or on one of its triangles, where the whole line meets it.
        let found = oracle::hits_of(&view, &whole, Cull::None);
        let at = found.get(round % 3).map_or(0.0, |hit| hit.t);
        let origin = core::array::from_fn(|k| whole.origin[k] + at * direction[k]);
        let power = [0, 0, -125, 124, -140, 30][random.below(6)];
        let direction = direction.map(|d| d * 2.0_f32.powi(power));
        for start in [-3.0, -0.5, -1e-3, 0.0, 1e-6, 1e-3, 0.5] {
            let t_min = start * 2.0_f32.powi(-power);
            rays.push(Ray { t_min, ..Ray::new(origin, direction) });
        }
    }
    let count = rays.len();
    let hits = ask(&mesh, rays);
    assert!(hits > count / 2 && hits < count, "{hits} of {count}");
}

/// Directions with zero, negative zero, denormal and tiny components, alone and together.
#[test]
fn directions_along_axes_and_nearly_so() {
    let mesh = ball(8, 0.0);
    let tiny = [0.0, -0.0, 1e-45, -1e-45, 1e-38, 1e-20, -1e-12, 1e-7, 3e-6];
    let mut rays = Vec::new();
    let mut random = Random(31);
    for axis in 0..3 {
        for along in [1.0_f32, -1.0, 1e-30, -1e30] {
            for (i, &first) in tiny.iter().enumerate() {
                let second = tiny[(i * 5 + 2) % tiny.len()];
                let mut direction = [along, first * along.abs(), second * along.abs()];
                direction.rotate_right(axis);
                // On borders of cells, faces, edges and corners, and at no special place.
                for origin in [[0.0; 3], [0.25; 3], [1.0; 3], [-1.0, 1.0, 0.5], [-3.0, 0.5, 1.0]] {
                    rays.push(Ray::new(origin, direction));
                }
                rays.push(Ray::new(random.point(), direction));
            }
        }
    }
    assert!(ask(&mesh, rays.iter().copied()) > rays.len() / 4);
}

#[test]
fn origins_on_vertices_edges_and_faces() {
    origins_on_triangles(600);
}

#[test]
#[ignore = "slow: brute force from thousands of points"]
fn origins_on_many_vertices_edges_and_faces() {
    origins_on_triangles(3000);
}

fn origins_on_triangles(count: usize) {
    let mesh = ball(6, 1.0);
    let mut random = Random(37);
    let rays = (0..count).map(|i| {
        let triangle = mesh.indices[random.below(mesh.indices.len())];
        let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
        let origin = match i % 3 {
            0 => a,
            1 => std::array::from_fn(|k| f32::midpoint(a[k], b[k])),
            _ => std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0),
        };
        Ray::new(origin, random.point())
    });
    assert!(3 * ask(&mesh, rays.collect::<Vec<_>>()) > count);
}

#[test]
fn origins_far_away() {
    let mesh = ball(6, 1.0);
    let mut random = Random(41);
    let mut rays = Vec::new();
    // 2^29 extents are about 1e9: try distances around that, and up to the end of f32.
    let near = [5.0, 100.0, 1e4, 1e8, 3e8, 1e9, 1.1e9, 2e9, 1e10];
    let far = [1e20, 1e30, 1e31, 1e32, 1e35, 2e38];
    for distance in near.into_iter().chain(far) {
        for i in 0..rounds(7) {
            let (target, towards) = (random.point().map(|c| c * 0.5), random.point());
            let origin = std::array::from_fn(|k| target[k] - towards[k] * distance);
            rays.push(Ray::new(origin, towards));
            rays.push(Ray::new(origin, std::array::from_fn(|k| target[k] - origin[k])));
            rays.push(Ray { t_min: distance, ..Ray::new(origin, towards) });
            // Along an axis and along a diagonal, where the origin keeps all its digits.
            let mut along = [0.0; 3];
            along[i % 3] = if i % 2 == 0 { -1.0 } else { 1.0 };
            let origin = std::array::from_fn(|k| target[k] - along[k] * distance);
            rays.push(Ray::new(origin, along));
            let along = towards.map(f32::signum);
            let origin = std::array::from_fn(|k| -along[k] * distance);
            rays.push(Ray::new(origin, along));
        }
    }
    let count = rays.len();
    assert!(15 * ask(&mesh, rays) > 2 * count);
}

#[test]
fn directions_of_any_length_give_t_in_their_multiples() {
    let mesh = ball(6, 1.0);
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::default()).unwrap();
    let grid = owned.open(&view).unwrap();
    for exponent in -120..=120 {
        let length = 2_f32.powi(exponent);
        let ray = Ray::new([0.3, 0.1, 2.0], [0.0, 0.05, -1.0].map(|c| c * length));
        let unit = Ray::new([0.3, 0.1, 2.0], [0.0, 0.05, -1.0]);
        let (hit, expected) = (grid.intersect(&ray).unwrap(), grid.intersect(&unit).unwrap());
        assert_eq!((hit.t * length, hit.u, hit.v), (expected.t, expected.u, expected.v));
        assert_eq!(hit.primitive, expected.primitive);
    }
}

/// Along such a border a ray passes so many cells before it crosses the border that one rounding decides a step.
#[test]
fn rays_along_borders_that_they_hardly_cross() {
    rays_along_borders(20);
}

#[test]
#[ignore = "slow: brute force over many meshes"]
fn rays_along_borders_of_more_meshes() {
    rays_along_borders(60);
}

fn rays_along_borders(meshes: u64) {
    let mut random = Random(97);
    let mut hits = 0;
    for seed in 0..meshes {
        let mesh = soup(200, 0.15, seed);
        let view = mesh.view();
        for config in methods::configs() {
            let owned = Owned::build(&view, &config).unwrap();
            let grid = owned.open(&view).unwrap();
            let ((min, max), resolution) = (grid.bounds(), grid.resolution());
            for i in 0..120 {
                let axis = i % 3;
                let cells = resolution[axis] as usize;
                let border = random.below(cells + 1) as f32 / cells as f32;
                let mut origin = random.point().map(|c| 2.0 * c);
                origin[axis] = min[axis] + (max[axis] - min[axis]) * border;
                let target = mesh.positions[random.below(mesh.positions.len())];
                let mut direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
                let slope = 10_f32.powf(-5.0 - 3.0 * random.unit());
                direction[axis] = if i % 2 == 0 { slope } else { -slope };
                let ray = Ray::new(origin, direction);
                hits += u64::from(oracle::check(&grid, &ray));
            }
        }
    }
    assert!(hits > 50 * meshes, "{hits}");
}

/// A shadow ray may end exactly on a wall, and a path may start there. The corners of the wall's triangles lie at one
/// depth, but the computed depth of a hit may be rounded to either side of it.
#[test]
fn ranges_end_exactly_at_walls() {
    let mesh = ball(7, 0.0);
    let view = mesh.view();
    let mut random = Random(53);
    // From inside a cube, 128ths away from its faces, to the face ahead.
    let rays: Vec<_> = (0..rounds(128))
        .map(|round| {
            let mut part = |of: f32| (random.unit() * 128.0).floor() / 128.0 * of;
            let distance = part(1.0) + 0.25;
            let side = [1.0, -1.0][round % 2];
            let mut origin = [part(0.5), part(-0.5), side * (1.0 - distance)];
            let mut direction = [part(0.25), part(-0.25), side];
            origin.rotate_right(round % 3);
            direction.rotate_right(round % 3);
            let [t_min, t_max] = [
                [0.0, distance],
                [distance, f32::INFINITY],
                [distance, distance],
                [distance.next_down(), distance],
            ][round / 6 % 4];
            (Ray { origin, t_min, direction, t_max }, distance)
        })
        .collect();
    assert_eq!(ask(&mesh, rays.iter().map(|(ray, _)| *ray)), rays.len());
    for config in methods::configs() {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        let asked: Vec<Ray> = rays.iter().map(|(ray, _)| *ray).collect();
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let (mut hits, mut occluded) = (vec![Hit::MISS; asked.len()], vec![0_u8; asked.len()]);
            grid.intersect_n(&Strided::new(&asked), &mut StridedMut::new(&mut hits), coherence)
                .unwrap();
            grid.occluded_n(&Strided::new(&asked), &mut StridedMut::new(&mut occluded), coherence)
                .unwrap();
            assert!(occluded.iter().all(|&is_occluded| is_occluded == 1), "{config:?}");
            for ((ray, distance), hit) in rays.iter().zip(&hits) {
                assert_eq!(hit.t, *distance, "{config:?} {ray:?}");
                assert_eq!(Some(*hit), grid.intersect(ray), "{config:?} {ray:?}");
                let before = Ray { t_min: 0.0, t_max: distance.next_down(), ..*ray };
                assert!(!grid.occluded(&before), "{config:?} {before:?}");
            }
        }
    }
}

/// Many triangles are hit at t = 0, and the answer must be the one with the lowest id, whatever cells they
/// are in: vertices lie close to borders of cells, where a subgrid reaches farther than its cell.
#[test]
fn origins_on_vertices_that_many_triangles_share() {
    origins_on_shared_vertices(18);
}

#[test]
#[ignore = "slow: brute force over many meshes"]
fn origins_on_shared_vertices_of_more_meshes() {
    origins_on_shared_vertices(60);
}

fn origins_on_shared_vertices(rounds: usize) {
    let mut random = Random(43);
    let mut ties = 0;
    for round in 0..rounds {
        let vertices = [8, 100, 200][round % 3];
        let center = [[0.0; 3], random.point(), [100.0; 3]][round / 3 % 3];
        let mut mesh = Mesh::default();
        for _ in 0..vertices {
            let point = random.point().map(|x| (x * 4.0).round() / 4.0);
            mesh.positions.push(std::array::from_fn(|k| center[k] + point[k]));
        }
        for _ in 0..[253, 60, 500, 20][round % 4] {
            let a = random.below(vertices);
            let b = (a + 1 + random.below(4)) % vertices;
            let c = (b + 1 + random.below(4)) % vertices;
            mesh.indices.push([a, b, c].map(|vertex| vertex as u32));
        }
        let view = mesh.view();
        let mut rays = Vec::new();
        for _ in 0..60 {
            let origin = mesh.positions[random.below(vertices)];
            let towards = random.point();
            let along = [towards, towards.map(|x| (x * 2.0).round() / 2.0)][random.below(2)];
            rays.extend([0.0, -0.5].map(|t_min| Ray { t_min, ..Ray::new(origin, along) }));
        }
        let closest = |ray: &Ray| oracle::hits_of(&view, ray, Cull::None).first().copied();
        let expected: Vec<Hit> = rays.iter().map(|ray| closest(ray).unwrap_or(Hit::MISS)).collect();
        let density = [2.0, 8.0][round % 2];
        let shallow = Config::from(Parameters::Recursive { density, depth: 2 });
        for config in methods::configs_with(density).chain([shallow]) {
            let owned = Owned::build(&view, &config).unwrap();
            let grid = owned.open(&view).unwrap();
            let mut hits = vec![Hit::MISS; rays.len()];
            let (from, to) = (Strided::new(&rays), &mut StridedMut::new(&mut hits));
            grid.intersect_n(&from, to, Coherence::Coherent).unwrap();
            for ((ray, expected), in_batch) in rays.iter().zip(&expected).zip(&hits) {
                let hit = grid.intersect(ray).unwrap_or(Hit::MISS);
                assert_eq!(in_batch, expected, "{config:?} {ray:?}");
                assert_eq!(hit, *expected, "{config:?} {ray:?}");
                ties += usize::from(hit.t == 0.0);
            }
        }
    }
    assert!(3 * ties > 1000 * rounds, "{ties}");
}
