//! Queries and builds stay within the bounds of docs/bounds.md, counted and not timed, on the worst known meshes.
//!
//! The counters are those of queries with options. A plain query of one ray counts nothing: a unit test in
//! core/src/search.rs counts that its search does no more work.

use hgrid_core::{
    Block, Config, Counters, Grid, Hit, Method, Parameters, QueryOptions, Ray, Sizes, Verdict,
};
use hgrid_tests::meshes::{Mesh, ball, soup};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;

/// Triangles in each mesh.
const N: u32 = 1000;

/// The methods that have rows in docs/bounds.md.
const METHODS: [Method; 5] =
    [Method::OneLevel, Method::Fixed, Method::Variable, Method::Recursive, Method::Bvh];

/// Returns the meshes that make the most work for one method or another.
fn worst() -> Vec<(&'static str, Mesh)> {
    let n = N as usize;
    let mut random = Random(7);
    let mut all = Vec::new();
    let mut star = Mesh::default();
    let mut needles = Mesh::default();
    let mut slabs = Mesh::default();
    let mut strips = Mesh::default();
    let mut same = Mesh::default();
    let mut fan = Mesh::default();
    for at in 0..N {
        let share = at as f32 / N as f32;
        star.push([[0.0; 3], random.point(), random.point()]);
        let across = random.point().map(|c| c * 1e-3);
        needles.push([[-1.0; 3], [1.0; 3], across]);
        slabs.push([[-1.0, -1.0, share], [3.0, -1.0, share], [-1.0, 3.0, share]]);
        strips.push([[-1.0, share, 0.0], [1.0, share, 0.0], [1.0, share + 1e-3, 0.5]]);
        same.push([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]);
        let rim = |x: f32| [x, 1.0 - x * x, 0.1 * x];
        fan.push([[0.0, -1.0, 0.0], rim(2.0 * share - 1.0), rim(2.0 * share - 0.999)]);
    }
    all.extend([("star", star), ("needles", needles), ("slabs", slabs), ("strips", strips)]);
    all.extend([("same", same), ("fan", fan)]);
    let mut nested = Mesh::default();
    for scale in 0..10 {
        nested.append(&soup(n / 10, 0.2, 3).scaled(0.25_f32.powi(scale)));
    }
    all.push(("nested", nested));
    let mut huge = soup(n - 1, 1e-3, 5);
    huge.push([[-1e6, -1e6, 0.0], [1e6, -1e6, 0.0], [0.0, 1e6, 0.0]]);
    all.push(("huge", huge));
    all.push(("row", row()));
    all.push(("ball", ball(13, 1.0)));
    all
}

/// Returns needles that all lie in one row of cells.
fn row() -> Mesh {
    let mut row = Mesh::default();
    for _ in 0..N {
        row.push([[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1e-6, 0.0]]);
    }
    row
}

/// Returns rays along axes, rays through the middle, and some others.
pub(crate) fn rays() -> Vec<Ray> {
    let mut random = Random(11);
    let mut rays: Vec<_> = (0..24)
        .map(|_| {
            let (origin, to) = (random.point().map(|c| 3.0 * c), random.point().map(|c| 0.5 * c));
            Ray::new(origin, std::array::from_fn(|axis| to[axis] - origin[axis]))
        })
        .collect();
    for axis in 0..3 {
        for off in [0.0, 1e-7, 0.3] {
            let (mut origin, mut direction) = ([off; 3], [0.0; 3]);
            (origin[axis], direction[axis]) = (-4.0, 1.0);
            rays.push(Ray::new(origin, direction));
        }
    }
    rays.push(Ray::new([-4.0; 3], [1.0; 3]));
    rays.push(Ray::new([0.2, 0.2, -4.0], [0.0, 0.0, 1.0]));
    rays
}

/// Asserts that a ray did no more work than its row of the page allows.
fn hold(name: &str, grid: &Grid<'_>, work: &Counters, walks: u64) {
    let n = u64::from(grid.mesh().triangle_count());
    let steps: u64 = grid.resolution().iter().map(|&cells| u64::from(cells)).sum();
    let words = u64::from(grid.reference_count());
    let Counters { primitive_tests, cell_steps, grid_steps } = *work;
    let bounds = match grid.config().parameters {
        Parameters::OneLevel { .. } => [16 * n + 64, steps, 0],
        Parameters::Fixed { macrocell_factor, .. } => {
            let within = 3 * u64::from(macrocell_factor);
            [16 * n + 64, walks * steps + within * grid_steps, u64::MAX]
        }
        Parameters::Variable { .. } => [words, walks * steps + 765 * grid_steps, steps],
        Parameters::Recursive { .. } => [words, words, words],
        // A tree visits each node, leaf and triangle once.
        _ => [n, n, tree_nodes(n)],
    };
    let bounds = bounds.map(|bound| bound.saturating_mul(walks));
    let is_held =
        primitive_tests <= bounds[0] && cell_steps <= bounds[1] && grid_steps <= bounds[2];
    assert!(is_held, "{name}, {:?}: {work:?} above {bounds:?}", grid.method());
}

/// Returns the most nodes that a tree can have, rounded up (core/src/bvh/layout.rs).
pub(crate) fn tree_nodes(triangles: u64) -> u64 {
    triangles * 2457 / 16_800 + 11 * (5 * (triangles / 4097) + 1) / 7 + 4
}

#[test]
fn no_ray_does_more_than_its_bound() {
    let mut most = [[0.0_f64; 2]; 5];
    for (name, mesh) in worst() {
        for (method, most) in METHODS.into_iter().zip(&mut most) {
            let view = mesh.view();
            let owned = Owned::build(&view, &Config::new(method)).unwrap();
            let grid = owned.open(&view).unwrap();
            for ray in rays() {
                let mut work = Counters::default();
                let _ = grid.intersect_with(&ray, &mut QueryOptions::counting(&mut work));
                hold(name, &grid, &work, 1);
                most[0] = most[0].max(work.primitive_tests as f64 / f64::from(N));
                most[1] = most[1].max(work.cell_steps as f64 / f64::from(N));
                let mut work = Counters::default();
                let _ = grid.occluded_with(&ray, &mut QueryOptions::counting(&mut work));
                hold(name, &grid, &work, 1);
            }
        }
    }
    println!("tests and cell steps a triangle, at most: {most:.2?} of {METHODS:?}");
    // Some mesh reaches half of the bound.
    assert!(most[0][0] >= 8.0 && most[4][0] >= 0.5, "{most:?}");
}

#[test]
fn all_hits_take_one_walk_of_a_tree() {
    for (name, mesh) in worst() {
        let view = mesh.view();
        let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
        let grid = owned.open(&view).unwrap();
        for ray in rays() {
            let mut all = vec![Hit::MISS; mesh.indices.len() + 1];
            let count = grid.intersect_all(&ray, &mut QueryOptions::default(), &mut all);
            for room in [0, 1, 2, 15, 16, 17, 64, count.saturating_sub(1), count, count + 1] {
                let (mut hits, mut work) = (vec![Hit::MISS; room], Counters::default());
                let options = &mut QueryOptions::counting(&mut work);
                assert_eq!(grid.intersect_all(&ray, options, &mut hits), count);
                let kept = room.min(count);
                assert_eq!(hits[..kept], all[..kept], "{name}, {room} of {count}");
                assert!(hits[kept..].iter().all(|hit| *hit == Hit::MISS));
                hold(name, &grid, &work, 1);
                assert!(name != "same" || count == 0 || work.primitive_tests == u64::from(N));
            }
            // A filter sees the hits in order, whether there is room for all or not.
            for room in [3, count + 1] {
                let (mut hits, mut seen) = (vec![Hit::MISS; room], Vec::new());
                let mut filter = |_: usize, hit: &Hit| {
                    seen.push(*hit);
                    if hit.primitive.is_multiple_of(3) { Verdict::Accept } else { Verdict::Reject }
                };
                let options =
                    &mut QueryOptions { filter: Some(&mut filter), ..QueryOptions::default() };
                let accepted = grid.intersect_all(&ray, options, &mut hits);
                let expected: Vec<_> =
                    all[..count].iter().filter(|hit| hit.primitive % 3 == 0).collect();
                assert_eq!((accepted, &seen[..]), (expected.len(), &all[..count]), "{name}");
                assert!(hits.iter().zip(expected).all(|(hit, expected)| hit == expected));
            }
        }
    }
}

#[test]
fn all_hits_of_grids_take_a_walk_for_each_sixteen() {
    let (_, mesh) = worst().into_iter().find(|(name, _)| *name == "same").unwrap();
    let ray = Ray::new([0.2, 0.2, -4.0], [0.0, 0.0, 1.0]);
    for method in &METHODS[..4] {
        let view = mesh.view();
        let owned = Owned::build(&view, &Config::new(*method)).unwrap();
        let grid = owned.open(&view).unwrap();
        for room in [N as usize + 1, 64] {
            let (mut hits, mut work) = (vec![Hit::MISS; room], Counters::default());
            let options = &mut QueryOptions::counting(&mut work);
            assert_eq!(grid.intersect_all(&ray, options, &mut hits), N as usize);
            let walks = if room > N as usize { 1 } else { 2 + u64::from(N) / 16 };
            hold("same", &grid, &work, walks);
            // The bound is reached: all triangles lie at one t, so each walk meets them all.
            assert!(work.primitive_tests >= walks / 2 * u64::from(N), "{work:?}");
        }
    }
}

#[test]
fn walks_of_a_filter_grow_to_sixteen_hits() {
    let (_, mesh) = worst().into_iter().find(|(name, _)| *name == "same").unwrap();
    let ray = Ray::new([0.2, 0.2, -4.0], [0.0, 0.0, 1.0]);
    for method in METHODS {
        let view = mesh.view();
        let owned = Owned::build(&view, &Config::new(method)).unwrap();
        let grid = owned.open(&view).unwrap();
        let (mut room, mut one_walk) = (vec![Hit::MISS; N as usize + 1], Counters::default());
        let options = &mut QueryOptions::counting(&mut one_walk);
        assert_eq!(grid.intersect_all(&ray, options, &mut room), N as usize);

        let closest = |options: &mut QueryOptions<'_>| grid.intersect_with(&ray, options).is_some();
        let any = |options: &mut QueryOptions<'_>| grid.occluded_with(&ray, options);
        let all = |options: &mut QueryOptions<'_>| {
            grid.intersect_all(&ray, options, &mut [Hit::MISS; 3]) > 0
        };
        // Walks for 1, 2, 4 and 8 hits, one for each sixteen after them, and one that finds the rest.
        let full = u64::from(N) / 16 + 1;
        type Ask<'a> = &'a dyn Fn(&mut QueryOptions<'_>) -> bool;
        let queries: [(Ask<'_>, u64); 3] = [(&closest, 5 + full), (&any, 5 + full), (&all, full)];
        for (ask, walks) in queries {
            let (mut work, mut shown) = (Counters::default(), 0);
            let mut reject = |_: usize, _: &Hit| {
                shown += 1;
                Verdict::Reject
            };
            let options = QueryOptions::counting(&mut work);
            let is_hit = ask(&mut QueryOptions { filter: Some(&mut reject), ..options });
            assert_eq!((is_hit, shown), (false, N));
            let most = walks * one_walk.primitive_tests;
            assert!(work.primitive_tests <= most, "{method:?}: {work:?} above {most}");
            hold("same", &grid, &work, walks);
        }
    }
}

#[test]
fn no_point_does_more_than_its_bound() {
    let mut random = Random(13);
    for (name, mesh) in worst() {
        for method in METHODS {
            let view = mesh.view();
            let owned = Owned::build(&view, &Config::new(method)).unwrap();
            let grid = owned.open(&view).unwrap();
            for scale in [0.5, 2.0, 1e3, 1e9] {
                let (point, mut work) = (random.point().map(|c| c * scale), Counters::default());
                let options = &mut QueryOptions::counting(&mut work);
                assert!(grid.closest_point(point, f32::INFINITY, options).is_some());
                // A tree visits each node, leaf and triangle once. In a grid, a cube around the point grows
                // in at most sixteen steps, and each step may show each list once.
                if method == Method::Bvh {
                    hold(name, &grid, &work, 1);
                } else {
                    let most = 16 * u64::from(grid.reference_count());
                    assert!(work.primitive_tests <= most, "{name}, {method:?}: {work:?}");
                }
            }
        }
    }
}

#[test]
fn builds_stay_within_their_references() {
    for (name, mesh) in worst() {
        let n = u64::from(mesh.view().triangle_count());
        for method in METHODS {
            let view = mesh.view();
            let owned = Owned::build(&view, &Config::new(method)).unwrap();
            let grid = owned.open(&view).unwrap();
            let top = 16 * n + 64;
            let (counted, most) = match grid.config().parameters {
                // The references count, and not the words of subgrids. Each subgrid of k triangles has at most
                // 16 k + 64, where k is more than `subdivide_above`.
                Parameters::Variable { subdivide_above, .. } => {
                    let subgrids = top / (u64::from(subdivide_above) + 1);
                    (grid.inspect().reference_count, 16 * top + 64 * subgrids)
                }
                // Two words for each cell that the build may look at, and the root.
                Parameters::Recursive { .. } => {
                    let words = 2 * (512 * n + 65_536) + (28 + 16) * n + 129;
                    (grid.reference_count().into(), words)
                }
                Parameters::Bvh { .. } => (grid.reference_count().into(), n),
                _ => (grid.reference_count().into(), top),
            };
            assert!(counted <= most, "{name}, {method:?}: {counted} above {most}");
            println!(
                "{name} {method:?}: {} words a triangle",
                u64::from(grid.reference_count()) / n
            );
            let mut proof = vec![0; grid.validate_bytes()];
            grid.validate(&mut proof).unwrap();
        }
    }
}

#[test]
fn half_of_the_scratch_of_a_tree_is_not_enough() {
    let mesh = row();
    let config = Config::new(Method::Bvh);
    let bound = Sizes::bound(N, &config).unwrap();
    let mut index = vec![Block::ZERO; Block::count_for(bound.index_bytes)];
    let mut scratch = vec![Block::ZERO; Block::count_for(bound.scratch_bytes)];
    let mut build = |bytes: usize| {
        let index = Block::bytes_mut(&mut index);
        let scratch = &mut Block::bytes_mut(&mut scratch)[..bytes];
        Grid::build(mesh.view(), &config, index, scratch).is_ok()
    };
    assert!(build(bound.scratch_bytes) && !build(bound.scratch_bytes / 2));
}
