//! Two instances with hits at the same `t`: that of the first instance counts, whichever of them is asked first. The
//! hit of the one that is asked first ends the walk through the other, and must not end it before a hit with the same
//! `t`. What lies behind the hit is neither walked nor shown to a filter.

use hgrid_core::{
    Config, Counters, Grid, Instance, Object, RayF64, Scene, SceneHit, SceneOptions, Verdict,
};
use hgrid_tests::meshes::{Mesh, soup};
use hgrid_tests::methods;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::{Built, scattered};

use super::grazing::compare;
use super::scenes::{Alone, ray, with_grids};

/// A triangle that no ray of these tests meets.
fn aside(x: f32, z: f32) -> [[f32; 3]; 3] {
    [[x, 1.0, z], [x, 0.9, z], [x - 0.1 * x.signum(), 1.0, z]]
}

/// Returns the mesh with one more triangle, so that its box begins elsewhere.
fn with(mesh: &Mesh, triangle: [[f32; 3]; 3]) -> Mesh {
    let mut mesh = mesh.clone();
    mesh.push(triangle);
    mesh
}

/// Calls `run` with a grid of each mesh, as objects.
fn built(meshes: &[Mesh], config: &Config, run: &mut dyn FnMut(&[Object<'_>])) {
    let views: Vec<_> = meshes.iter().map(Mesh::view).collect();
    let owned: Vec<_> = views.iter().map(|view| Owned::build(view, config).unwrap()).collect();
    let grids: Vec<Grid<'_>> =
        owned.iter().zip(&views).map(|(owned, view)| owned.open(view).unwrap()).collect();
    let objects: Vec<_> = grids.iter().map(Object::Grid).collect();
    run(&objects);
}

/// Compares all queries of two instances, in both orders, with each of them alone; returns the number of rays whose
/// hits in both have the same `t`.
fn ties(instances: &[Instance; 2], objects: &[Object<'_>], rays: &[RayF64]) -> usize {
    let [first, second] = *instances;
    compare(&[first, second], objects, rays);
    compare(&[second, first], objects, rays);
    let alone = Alone::new(instances, objects);
    let is_tie = |ray: &&RayF64| {
        let mut hits = Vec::new();
        alone.closest(objects, ray, |_, scene, ray| {
            let hit = scene.intersect(ray);
            hits.extend(hit.map(|hit| hit.t.to_bits()));
            hit
        });
        hits.len() == 2 && hits[0] == hits[1]
    };
    rays.iter().filter(is_tie).count()
}

/// Compares grids of two meshes at one place, by every method; more than `least` of the rays must have ties.
fn tie_at_one_place(meshes: &[Mesh; 2], rays: &[RayF64], least: usize) {
    for config in methods::configs() {
        built(meshes, &config, &mut |objects| {
            let ties = ties(&[Instance::new(0), Instance::new(1)], objects, rays);
            assert!(ties > least, "{ties} ties, {:?}", config.method());
        });
    }
}

/// Returns a ray from a point of a cube `far` times as wide as that from -1 to 1 to a point in that.
fn toward(random: &mut Random, far: f32) -> RayF64 {
    let (from, to) = (random.point().map(|c| far * c), random.point());
    RayF64::new(from.map(f64::from), [0, 1, 2].map(|k| to[k] - from[k]))
}

/// The hit often lies just behind the border of its cell.
#[test]
fn cells_are_walked_up_to_the_hit_of_another_instance() {
    let soup = soup(4000, 0.02, 3);
    let meshes = [with(&soup, aside(-1.2, 0.0)), with(&soup, aside(1.2, 0.0))];
    let mut random = Random(5);
    let rays: Vec<_> = (0..6000).map(|_| toward(&mut random, 3.0)).collect();
    tie_at_one_place(&meshes, &rays, 300);
}

/// The box around a flat mesh begins where its hits lie, up to the rounding of both.
#[test]
fn flat_boxes_are_met_at_the_hit_of_another_instance() {
    // So near zero that the margin of a box is small, and no difference to an origin is exact.
    const HEIGHT: f32 = 1e-3;
    let flat = soup(600, 0.1, 4).map(|[x, y, _]| [x, y, HEIGHT]);
    let meshes = [with(&flat, aside(-1.2, HEIGHT)), with(&flat, aside(1.2, HEIGHT))];
    let mut random = Random(6);
    let rays = |random: &mut Random| {
        // All rays of a group start in one place. These numbers make the roundings of a distance large: that of the
        // side, relative to the origin, and that of the inverse direction.
        let from = [random.unit(), random.unit(), 3.5 + 0.4 * random.unit()];
        let ray = |_| {
            let ([x, y, _], down) = (random.point(), 1.75 + 0.25 * random.unit());
            let direction = [x - from[0], y - from[1], -from[2]].map(|c| c * down / from[2]);
            RayF64::new(from.map(f64::from), direction)
        };
        (0..64).map(ray).collect::<Vec<_>>()
    };
    let rays: Vec<_> = (0..100).flat_map(|_| rays(&mut random)).collect();
    tie_at_one_place(&meshes, &rays, 1000);
}

/// From far away, places that differ round to the same `t`.
#[test]
fn places_that_differ_by_less_than_the_rounding_of_t_are_equally_close() {
    let mut square = Mesh::default();
    square.push([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]);
    square.push([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]]);
    // The box of one begins before the square, that of the other ends behind it.
    let meshes = [with(&square, aside(1.2, 0.5)), with(&square, aside(1.2, -0.5))];
    let mut random = Random(7);
    let ray = |_| {
        let [x, y, z] = random.point().map(f64::from);
        let [u, v, w] = random.point();
        RayF64::new([0.5 * x, 0.5 * y, 1000.0 + z], [1e-4 * u, 1e-4 * v, w - 1.5])
    };
    let rays: Vec<_> = (0..512).map(ray).collect();
    for config in methods::configs() {
        built(&meshes, &config, &mut |objects| {
            let mut all = 0;
            for by in [-3e-5, -1e-6, 1e-6, 3e-5] {
                let moved = Instance { translation: [0.0, 0.0, by], ..Instance::new(1) };
                all += ties(&[Instance::new(0), moved], objects, &rays);
            }
            assert!(all > 1000, "{all} ties, {:?}", config.method());
        });
    }
}

/// A wall stands in a cloud of triangles, with something in front of the cloud, so that the wall is asked first.
fn wall_in_cloud() -> [Mesh; 2] {
    let mut wall = Mesh::default();
    wall.push([[-9.0, -9.0, 0.5], [9.0, -9.0, 0.5], [0.0, 9.0, 0.5]]);
    wall.push(aside(1.2, 2.0));
    [wall, soup(400, 0.05, 8)]
}

fn down(random: &mut Random) -> RayF64 {
    let [x, y, _] = random.point().map(|c| f64::from(0.9 * c));
    RayF64::new([x, y, 3.0], [0.01, 0.02, -1.0])
}

#[test]
fn what_lies_behind_the_hit_of_another_instance_is_not_walked() {
    let meshes = wall_in_cloud();
    let work = |scene: &Scene<'_>| {
        let (mut work, mut random) = (Counters::default(), Random(9));
        for _ in 0..300 {
            let ray = down(&mut random);
            let counters = Some(&mut work);
            let _ =
                scene.intersect_with(&ray, &mut SceneOptions { counters, ..Default::default() });
        }
        work.primitive_tests + work.cell_steps + work.grid_steps
    };
    for config in methods::configs() {
        built(&meshes, &config, &mut |objects| {
            let scene = |instances: &[Instance]| {
                let built = Built::scene(instances, objects, &Config::default()).unwrap();
                work(&built.open(objects).unwrap())
            };
            let [wall, cloud] = [Instance::new(0), Instance::new(1)];
            let [both, wall, cloud] = [scene(&[wall, cloud]), scene(&[wall]), scene(&[cloud])];
            // A quarter of the cloud lies in front of the wall.
            assert!(2 * (both - wall) < cloud, "{both} {wall} {cloud}, {:?}", config.method());
        });
    }
}

#[test]
fn a_filter_does_not_see_what_lies_behind_a_hit_that_it_accepted() {
    let check = |scene: &Scene<'_>, rays: &[RayF64]| {
        let mut seen = 0;
        for ray in rays {
            let mut closest = f32::INFINITY;
            let mut filter = |_: usize, hit: &SceneHit| {
                assert!(hit.t <= closest + 1e-6 * closest.abs(), "{hit:?} behind {closest}");
                closest = closest.min(hit.t);
                seen += 1;
                Verdict::Accept
            };
            let filter = Some(&mut filter as &mut _);
            let _ = scene.intersect_with(ray, &mut SceneOptions { filter, ..Default::default() });
        }
        seen
    };
    let mut random = Random(10);
    let rays: Vec<_> = (0..500).map(|_| down(&mut random)).collect();
    for config in methods::configs() {
        built(&wall_in_cloud(), &config, &mut |objects| {
            let instances = [Instance::new(0), Instance::new(1)];
            let built = Built::scene(&instances, objects, &Config::default()).unwrap();
            let seen = check(&built.open(objects).unwrap(), &rays);
            assert!(seen > rays.len(), "{seen}");
        });
    }
    with_grids(|objects, _| {
        let instances = scattered(60, 3, 2.0, 12);
        let built = Built::scene(&instances, objects, &Config::default()).unwrap();
        let rays: Vec<_> = (0..600).map(|round| ray(&mut random, round, 3.0)).collect();
        assert!(check(&built.open(objects).unwrap(), &rays) > 100);
    });
}
