//! A hit depends on the ray and the triangle only, not on the other triangles, the grid's box, the method or
//! the entry point.

use hgrid_core::{Coherence, Config, Cull, Grid, Hit, QueryOptions, Ray, Strided, StridedMut};
use hgrid_tests::meshes::{Mesh, ball, soup};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle};

fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

/// Returns the hits of a ray with the first `count` triangles, found one by one.
fn expected(mesh: &Mesh, count: usize, ray: &Ray) -> Vec<Hit> {
    let first = Mesh { indices: mesh.indices[..count].to_vec(), ..mesh.clone() };
    oracle::hits_of(&first.view(), ray, Cull::None)
}

fn check_all(grid: &Grid<'_>, ray: &Ray, count: usize, expected: &[Hit]) {
    let mut hits = vec![Hit::MISS; 64];
    let found = grid.intersect_all(ray, &mut QueryOptions::default(), &mut hits);
    let of_first = hits[..found.min(64)].iter().filter(|hit| (hit.primitive as usize) < count);
    let found: Vec<[u32; 4]> = of_first.map(bits).collect();
    assert_eq!(found, expected.iter().map(bits).collect::<Vec<_>>(), "{ray:?}");
}

/// Returns rays that start inside, at the border, near four extents away, where origins begin to be moved,
/// and farther; they aim at vertices or beside them.
fn rays(random: &mut Random, mesh: &Mesh, count: usize) -> Vec<Ray> {
    (0..count)
        .map(|i| {
            let distance = [1.0, 3.9, 4.1, 9.0, 1e3, 1e6, 1e8][i % 7];
            let origin = random.point().map(|x| x * distance);
            let target = mesh.positions[random.below(mesh.positions.len())];
            let beside = [0.0, 1e-6, 1e-2, 0.3][random.below(4)];
            let by = random.point().map(|x| x * beside);
            let direction = std::array::from_fn(|k| target[k] + by[k] - origin[k]);
            Ray { t_min: [0.0, -1.0][i % 2], ..Ray::new(origin, direction) }
        })
        .collect()
}

#[test]
fn other_triangles_and_other_boxes_do_not_change_a_bit() {
    let mut random = Random(11);
    let mut count = 0;
    for mesh in [soup(40, 0.5, 3), ball(3, 1.0), soup(60, 0.05, 5)] {
        let triangles = mesh.indices.len();
        let rays = rays(&mut random, &mesh, 350);
        let all: Vec<Vec<Hit>> = rays.iter().map(|ray| expected(&mesh, triangles, ray)).collect();
        // The same triangles in boxes of other sizes and places.
        let mut meshes = vec![mesh];
        for size in [1.5_f32, 8.0, 300.0, 1e5] {
            let mut other = meshes[0].clone();
            let far = [size, 0.7 * size, -size];
            other.push([far, far.map(|x| x * 0.9), [size, 0.0, 0.0]]);
            meshes.push(other);
        }
        for config in methods::configs() {
            for mesh in &meshes {
                let view = mesh.view();
                let owned = Owned::build(&view, &config).unwrap();
                let grid = owned.open(&view).unwrap();
                for (ray, hits) in rays.iter().zip(&all) {
                    check_all(&grid, ray, triangles, hits);
                }
                check_entry_points(&grid, mesh, &rays);
            }
        }
        count += all.iter().map(Vec::len).sum::<usize>();

        // Each triangle alone.
        let mesh = &meshes[0];
        for id in 0..triangles.min(12) {
            let mut one = Mesh::default();
            one.push(mesh.view().triangle(id as u32).unwrap());
            for config in methods::configs() {
                let view = one.view();
                let owned = Owned::build(&view, &config).unwrap();
                let grid = owned.open(&view).unwrap();
                for (ray, hits) in rays.iter().zip(&all) {
                    let hit = hits.iter().find(|hit| hit.primitive as usize == id);
                    let hit = hit.map(|hit| bits(&Hit { primitive: 0, ..*hit }));
                    assert_eq!(grid.intersect(ray).as_ref().map(bits), hit, "{ray:?}");
                }
            }
        }
    }
    assert!(count > 700, "{count}");
}

/// Checks single rays and batches, coherent or not, with options and without.
fn check_entry_points(grid: &Grid<'_>, mesh: &Mesh, rays: &[Ray]) {
    let closest = |ray: &Ray| {
        let hits = expected(mesh, mesh.indices.len(), ray);
        hits.first().map_or(bits(&Hit::MISS), bits)
    };
    let expected: Vec<[u32; 4]> = rays.iter().map(closest).collect();
    let one = |ray: &Ray| bits(&grid.intersect(ray).unwrap_or(Hit::MISS));
    assert_eq!(rays.iter().map(one).collect::<Vec<_>>(), expected);
    let with = |ray: &Ray| {
        bits(&grid.intersect_with(ray, &mut QueryOptions::default()).unwrap_or(Hit::MISS))
    };
    assert_eq!(rays.iter().map(with).collect::<Vec<_>>(), expected);
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        let mut hits = vec![Hit::MISS; rays.len()];
        let (from, to) = (Strided::new(rays), &mut StridedMut::new(&mut hits));
        grid.intersect_n(&from, to, coherence).unwrap();
        assert_eq!(hits.iter().map(bits).collect::<Vec<_>>(), expected);
        let mut occluded = vec![7_u8; rays.len()];
        grid.occluded_n(&from, &mut StridedMut::new(&mut occluded), coherence).unwrap();
        let is_hit = |hit: &[u32; 4]| u8::from(*hit != bits(&Hit::MISS));
        assert_eq!(occluded, expected.iter().map(is_hit).collect::<Vec<_>>());
    }
}

/// With little room a query may walk again from the last hit that it reported; it must find the other hits unchanged.
#[test]
fn hits_are_the_same_however_many_are_asked_for_at_once() {
    let mesh = soup(300, 1.5, 7);
    let view = mesh.view();
    let (mut random, mut most) = (Random(13), 0);
    for config in methods::configs_with(1.0).chain([Config::default()]) {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        for ray in rays(&mut random, &mesh, 40) {
            let expected = expected(&mesh, mesh.indices.len(), &ray);
            most = most.max(expected.len());
            for room in [1, 5, 16, 17, 40, expected.len() + 1] {
                let mut hits = vec![Hit::MISS; room];
                let count = grid.intersect_all(&ray, &mut QueryOptions::default(), &mut hits);
                assert_eq!(count, expected.len());
                let known = room.min(count);
                let found: Vec<_> = hits[..known].iter().map(bits).collect();
                assert_eq!(found, expected[..known].iter().map(bits).collect::<Vec<_>>());
            }
        }
    }
    assert!(most > 40, "{most}");
}
