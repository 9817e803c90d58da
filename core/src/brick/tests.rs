//! Control builds: the same bits, memory to the byte, and loops that do not do what they should.

extern crate std;

use alloc::vec;
use alloc::vec::Vec;

use crate::arena::Block as Memory;
use crate::config::{BuildFlags, Config, Method};
use crate::control::Control;
use crate::error::{Error, Region};
use crate::grid::Grid;
use crate::mesh::{Strided, TriangleMesh};
use crate::ray::{Hit, Ray};
use crate::simd::HAS_VECTORS;
use crate::sizes::{Sizes, sizes_with};

type Mesh = (Vec<[f32; 3]>, Vec<[u32; 3]>);
type Loop = dyn Fn(u32, &(dyn Fn(u32) + Sync));

/// Triangles all over a cube, small and large, and a crowd of them in a corner.
fn soup(triangles: u32) -> Mesh {
    let mut state = 1_u64;
    #[expect(clippy::cast_precision_loss, reason = "24 bits")]
    let mut random = || {
        state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
        (state >> 40) as f32 / 16_777_216.0
    };
    let mut positions = Vec::new();
    for number in 0..triangles {
        let crowd = if number % 3 == 0 { 0.05 } else { 1.0 };
        let size = if number % 97 == 0 { 0.4 } else { 0.02 * crowd };
        let at = [0; 3].map(|_| crowd * random());
        positions.extend([0; 3].map(|_| at.map(|at| at + size * random())));
    }
    let indices = (0..triangles).map(|number| [3 * number, 3 * number + 1, 3 * number + 2]);
    (positions, indices.collect())
}

fn forward(count: u32, task: &(dyn Fn(u32) + Sync)) {
    (0..count).for_each(task);
}

fn backward(count: u32, task: &(dyn Fn(u32) + Sync)) {
    (0..count).rev().for_each(task);
}

fn odd_ones_first(count: u32, task: &(dyn Fn(u32) + Sync)) {
    (0..count).filter(|index| index % 2 == 1).for_each(task);
    (0..count).filter(|index| index % 2 == 0).for_each(task);
}

fn threads(count: u32, task: &(dyn Fn(u32) + Sync)) {
    std::thread::scope(|scope| {
        for index in 0..count {
            scope.spawn(move || task(index));
        }
    });
}

fn config() -> Config {
    Config::new(Method::Brick)
}

fn regions(index_bytes: usize, scratch_bytes: usize) -> [Vec<Memory>; 2] {
    [index_bytes, scratch_bytes].map(|bytes| vec![Memory::ZERO; Memory::count_for(bytes)])
}

/// The blob of a mesh, built in so many bytes.
fn blob(
    (positions, indices): &Mesh,
    parallel: &Control<'_>,
    bytes: (usize, usize),
) -> Result<Vec<u8>, Error> {
    let mesh = TriangleMesh::new(positions, indices)?;
    let [mut index, mut scratch] = regions(bytes.0, bytes.1);
    let (index, scratch) = (Memory::bytes_mut(&mut index), Memory::bytes_mut(&mut scratch));
    let grid = Grid::build_with(mesh, &config(), index, scratch, parallel)?;
    Ok(grid.blob().to_vec())
}

/// What a build is told to bring, and with that much scratch what it will take.
fn both_sizes(mesh: &Mesh, parallel: &Control<'_>) -> [Sizes; 2] {
    let mesh = TriangleMesh::new(&mesh.0, &mesh.1).unwrap();
    let enough = sizes_with(&mesh, &config(), &mut [], parallel).unwrap();
    let entries = 64 * (1 + mesh.triangle_count() as usize);
    let [_, mut scratch] = regions(0, enough.scratch_bytes + entries);
    let scratch = Memory::bytes_mut(&mut scratch);
    let exact = sizes_with(&mesh, &config(), scratch, parallel).unwrap();
    assert!(exact.is_exact && !enough.is_exact);
    assert!(exact.index_bytes <= enough.index_bytes);
    [enough, exact]
}

#[test]
fn bits_do_not_depend_on_the_tasks_nor_on_their_order() {
    // Two tasks and few triangles are enough for Miri to see what they share.
    let (meshes, most) = if cfg!(miri) { (&[40][..], 2) } else { (&[5000, 600, 1, 0][..], 9) };
    let mut meshes: Vec<_> = meshes.iter().map(|&triangles| soup(triangles)).collect();
    // Its neighbours in space follow one another: they are written eight at a time.
    if let [first, ..] = &meshes[..] {
        let (positions, mut indices) = first.clone();
        indices
            .sort_by_key(|&[corner, ..]| positions[corner as usize].map(|at| at.to_bits() >> 21));
        meshes.push((positions, indices));
    }
    for mesh in meshes {
        let tasks = if cfg!(miri) { most } else { 64 };
        let [enough, _] = both_sizes(&mesh, &Control { tasks, run: &forward, progress: None });
        let bytes = (enough.index_bytes, enough.scratch_bytes);
        let serial = blob(&mesh, &Control::SERIAL, bytes).unwrap();
        let many = [19, 64, 1000, u32::MAX].into_iter().filter(|_| most > 2);
        for tasks in (if cfg!(miri) { most } else { 0 }..=most).chain(many) {
            let loops: [&Loop; 4] = [&threads, &forward, &backward, &odd_ones_first];
            for run in loops.into_iter().take(if cfg!(miri) { 2 } else { 4 }) {
                let built = blob(&mesh, &Control { tasks, run, progress: None }, bytes).unwrap();
                assert!(built == serial, "{tasks} tasks, {} triangles", mesh.1.len());
            }
        }
    }
}

/// Shows the grid of a soup.
fn on_soup(ask: impl FnOnce(&Grid<'_>)) {
    let (positions, indices) = soup(3000);
    let mesh = TriangleMesh::new(&positions, &indices).unwrap();
    let sizes = sizes_with(&mesh, &config(), &mut [], &Control::SERIAL).unwrap();
    let [mut index, mut scratch] = regions(sizes.index_bytes, sizes.scratch_bytes);
    let (index, scratch) = (Memory::bytes_mut(&mut index), Memory::bytes_mut(&mut scratch));
    let grid = Grid::build(mesh, &config(), index, scratch).unwrap();
    ask(&grid);
}

/// The first ray of each run of answers and how many they are.
type Runs = Vec<(usize, usize)>;

/// What tiles answer; `None` on a machine without vectors.
fn traced<const ANY: bool>(grid: &Grid<'_>, rays: &[Ray]) -> Option<(Runs, Vec<Hit>)> {
    let (mut lengths, mut hits) = (Vec::new(), Vec::new());
    let is_done = grid.tiles::<ANY>(&Strided::new(rays), |first, found| {
        assert_eq!(first, hits.len());
        lengths.push((first, found.len()));
        hits.extend_from_slice(found);
    });
    assert_eq!(is_done, HAS_VECTORS);
    is_done.then_some((lengths, hits))
}

/// Tiles of 64 rays on a mesh, beside it, on it from another side, and a part of one beside it.
#[test]
#[cfg_attr(miri, ignore = "hours")]
fn tiles_that_test_nothing_are_answered_at_once() {
    let tile = |side: f32, axis: usize| {
        (0..64_u8).map(move |ray| {
            let [u, v] = [ray % 8, ray / 8].map(|at| side + 0.05 * f32::from(at));
            let (mut origin, mut direction) = ([u, v, -2.0], [0.01, 0.02, 1.0]);
            origin.rotate_left(axis);
            direction.rotate_left(axis);
            Ray::new(origin, direction)
        })
    };
    let rays = tile(0.3, 0).chain(tile(3.0, 0)).chain(tile(0.3, 1)).chain(tile(3.0, 0).take(40));
    let rays: Vec<_> = rays.collect();
    on_soup(|grid| {
        let Some((lengths, hits)) = traced::<false>(grid, &rays) else { return };
        let alone: Vec<_> =
            rays.iter().map(|ray| grid.intersect(ray).unwrap_or(Hit::MISS)).collect();
        assert_eq!(hits, alone);
        assert!(alone[..64] != [Hit::MISS; 64] && alone[128..192] != [Hit::MISS; 64]);
        assert!(lengths.contains(&(64, 64)) && lengths.contains(&(192, 40)), "{lengths:?}");
        assert!(!lengths.contains(&(0, 64)) && !lengths.contains(&(128, 64)));

        let Some((_, occluded)) = traced::<true>(grid, &rays) else { return };
        let occluded = occluded.iter().map(|hit| *hit != Hit::MISS);
        assert!(rays.iter().map(|ray| grid.occluded(ray)).eq(occluded));
    });
}

/// Rays that end before the grid test nothing; beside others that hit, they go with these where
/// all are close.
#[test]
#[cfg_attr(miri, ignore = "hours")]
fn bundles_go_together_where_they_are_close() {
    on_soup(|grid| {
        for (apart, are_together) in [(0.0001, true), (0.1, false)] {
            let ray = |ray: u8| {
                let [u, v] = [ray % 8, ray / 8].map(|at| 0.3 + apart * f32::from(at));
                let t_max = if ray < 64 { f32::INFINITY } else { 0.5 };
                Ray { t_max, ..Ray::new([u, v, -2.0], [0.0, 0.0, 1.0]) }
            };
            let rays: Vec<_> = (0..128).map(ray).collect();
            let Some((lengths, hits)) = traced::<false>(grid, &rays) else { return };
            assert_eq!(lengths.contains(&(64, 64)), !are_together, "{apart}: {lengths:?}");
            assert!(hits[..64] != [Hit::MISS; 64] && hits[64..] == [Hit::MISS; 64]);
        }
    });
}

/// With few triangles and with many: ids leave room for all quarters, for some, for halves, for
/// some halves or for nothing ([`quarters`](super::quarters)).
#[test]
#[cfg_attr(miri, ignore = "hours")]
fn rays_find_what_a_hashed_grid_finds() {
    let mut state = 7_u64;
    #[expect(clippy::cast_precision_loss, reason = "24 bits")]
    let mut random = || {
        state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
        (state >> 40) as f32 / 16_777_216.0
    };
    for triangles in [256, 1500, 6000, 20_000, 132_000, 1_050_000] {
        let (positions, indices) = soup(triangles);
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let [hashed, brick] = [Config::new(Method::OneLevel), config()].map(|config| {
            let sizes = sizes_with(&mesh, &config, &mut [], &Control::SERIAL).unwrap();
            let [mut index, mut scratch] = regions(sizes.index_bytes, sizes.scratch_bytes);
            let (index, scratch) = (Memory::bytes_mut(&mut index), Memory::bytes_mut(&mut scratch));
            Grid::build(mesh, &config, index, scratch).unwrap().blob().to_vec()
        });
        let open = |blob: &[u8]| {
            let mut memory = vec![Memory::ZERO; Memory::count_for(blob.len())];
            Memory::bytes_mut(&mut memory)[..blob.len()].copy_from_slice(blob);
            memory
        };
        let (hashed, brick) = (open(&hashed), open(&brick));
        let hashed = Grid::open(Memory::bytes(&hashed), mesh).unwrap();
        let brick = Grid::open(Memory::bytes(&brick), mesh).unwrap();
        brick.validate(&mut []).unwrap();
        let (mut hits, mut rays) = (0, 0);
        for at in positions.iter().step_by(3 * (triangles / 6000).max(1) as usize) {
            rays += 1;
            let from = [0; 3].map(|_| 1.4 * random() - 0.2);
            let past = at.map(|at| at + 0.01 * (random() - 0.5));
            let ray = Ray::new(from, core::array::from_fn(|axis| past[axis] - from[axis]));
            let expected = hashed.intersect(&ray);
            assert_eq!(brick.intersect(&ray), expected, "{triangles}: {ray:?}");
            assert_eq!(brick.occluded(&ray), expected.is_some());
            hits += usize::from(expected.is_some());
        }
        assert!(16 * hits > rays, "{hits} hits of {rays} rays at {triangles} triangles");
    }
}

#[test]
#[cfg_attr(miri, ignore = "hours; another test has threads")]
fn one_block_is_enough_for_many_tasks() {
    let (mut positions, indices) = soup(4000);
    for position in &mut positions {
        *position = position.map(f32::round);
    }
    let mesh = (positions, indices);
    let [enough, _] = both_sizes(&mesh, &Control { tasks: 9, run: &forward, progress: None });
    let bytes = (enough.index_bytes, enough.scratch_bytes);
    let serial = blob(&mesh, &Control::SERIAL, bytes).unwrap();
    assert!(
        blob(&mesh, &Control { tasks: 9, run: &threads, progress: None }, bytes).unwrap() == serial
    );
}

#[test]
#[cfg_attr(miri, ignore = "hours; another test has threads")]
fn sizes_hold_to_the_byte_with_any_number_of_tasks() {
    let mesh = soup(5000);
    let [_, alone] = both_sizes(&mesh, &Control::SERIAL);
    let bytes = (alone.index_bytes, alone.scratch_bytes);
    let serial = blob(&mesh, &Control::SERIAL, bytes).unwrap();
    for tasks in 1..=9 {
        let parallel = Control { tasks, run: &backward, progress: None };
        let [_, exact] = both_sizes(&mesh, &parallel);
        assert_eq!(exact.scratch_bytes, tasks as usize * alone.scratch_bytes);
        let bytes = (exact.index_bytes, exact.scratch_bytes);
        assert!(blob(&mesh, &parallel, bytes).unwrap() == serial);
        // With less there are fewer tasks, down to one.
        let less = (alone.index_bytes, exact.scratch_bytes - 64);
        if tasks > 1 {
            assert!(blob(&mesh, &parallel, less).unwrap() == serial);
        }
        let too_small = |bytes, region, needed: usize| {
            let (needed_bytes, available_bytes) = (needed as u64, needed as u64 - 64);
            let error = Error::OutOfMemory { region, needed_bytes, available_bytes };
            assert_eq!(blob(&mesh, &parallel, bytes), Err(error));
        };
        let index = (alone.index_bytes - 64, exact.scratch_bytes);
        too_small(index, Region::Index, alone.index_bytes);
        let scratch = (exact.index_bytes, alone.scratch_bytes - 64);
        too_small(scratch, Region::Scratch, alone.scratch_bytes);
    }
}

#[test]
#[cfg_attr(miri, ignore = "hours; another test has threads")]
fn a_build_counts_the_mesh_twice_at_most() {
    let counts = core::cell::RefCell::new(Vec::new());
    let run = |count: u32, task: &(dyn Fn(u32) + Sync)| {
        counts.borrow_mut().push(count);
        forward(count, task);
    };
    let parallel = Control { tasks: 64, run: &run, progress: None };

    // Of scratch for a few tasks the heads of all take too much.
    let mesh = soup(20_000);
    let [_, alone] = both_sizes(&mesh, &Control::SERIAL);
    let (index_bytes, scratch_bytes) = (2 * alone.index_bytes, alone.scratch_bytes);
    let serial = blob(&mesh, &Control::SERIAL, (index_bytes, scratch_bytes)).unwrap();
    for room in [1, 2, 3, 5, 20] {
        assert!(blob(&mesh, &parallel, (index_bytes, room * scratch_bytes)).unwrap() == serial);
        // A count, a pass and the sorting, both twice if a part had little room, the closing of gaps.
        let counts = counts.take();
        assert!(counts[0] == 64 && counts.len() <= 7, "{room}: {counts:?}");
        // As many sort as there is room for, or more than half of them; one is not handed out.
        let sorts = |count: u32| count as usize <= room && 2 * count as usize > room;
        let sorted = counts.iter().any(|&count| sorts(count));
        assert!(if room > 1 { sorted } else { counts == [64] }, "{room}: {counts:?}");
    }

    // Few triangles are not worth as many tasks as there is room for.
    let few = soup(600);
    let [enough, _] = both_sizes(&few, &parallel);
    counts.take();
    blob(&few, &parallel, (enough.index_bytes, 64 * enough.scratch_bytes)).unwrap();
    let counts = counts.take();
    assert!(counts.len() <= 6 && counts.iter().all(|&count| count == 2), "{counts:?}");
}

#[test]
#[cfg_attr(miri, ignore = "hours; another test has threads")]
fn a_bound_is_enough_for_all_tasks() {
    let mesh = soup(3000);
    for tasks in [1, 2, 7, 64] {
        let parallel = Control { tasks, run: &forward, progress: None };
        let bound = Sizes::bound_parallel(3000, &config(), tasks).unwrap();
        for sizes in both_sizes(&mesh, &parallel) {
            assert!(sizes.index_bytes <= bound.index_bytes);
            assert!(sizes.scratch_bytes <= bound.scratch_bytes);
        }
    }
    assert_eq!(Sizes::bound(3000, &config()), Sizes::bound_parallel(3000, &config(), 0));
}

#[test]
#[cfg_attr(miri, ignore = "hours; another test has threads")]
fn a_loop_that_does_not_run_every_task_once_is_an_error_and_leaves_no_grid() {
    let (positions, indices) = soup(5000);
    let mesh = TriangleMesh::new(&positions, &indices).unwrap();
    let good = Control { tasks: 4, run: &forward, progress: None };
    let [enough, _] = both_sizes(&(positions.clone(), indices.clone()), &good);
    let [mut index, mut scratch] = regions(enough.index_bytes, enough.scratch_bytes);
    let (index, scratch) = (Memory::bytes_mut(&mut index), Memory::bytes_mut(&mut scratch));
    let serial = Grid::build(mesh, &config(), index, scratch).unwrap().blob().to_vec();

    let calls = core::cell::Cell::new(0);
    for broken_call in 0..3 {
        let loops: [&Loop; 7] = [
            &|_, _| {},
            &|count, task| (1..count).for_each(task),
            &|count, task| (0..count - 1).for_each(task),
            &|count, task| (0..=count).for_each(task),
            &|count, task| (0..count).chain([0]).for_each(task),
            &|count, task| (0..count).for_each(|_| task(0)),
            &|_, task| task(u32::MAX),
        ];
        for broken in loops {
            calls.set(0);
            let run = |count: u32, task: &(dyn Fn(u32) + Sync)| {
                let call = calls.replace(calls.get() + 1);
                if call == broken_call { broken(count, task) } else { forward(count, task) }
            };
            let parallel = Control { tasks: 4, run: &run, progress: None };
            let built = Grid::build_with(mesh, &config(), index, scratch, &parallel);
            assert_eq!(built.err(), Some(Error::InvalidParallelFor));
            assert_eq!(calls.get(), broken_call + 1);
            assert!(broken_call == 0 || Grid::open(index, mesh).is_err());
            let again = Grid::build_with(mesh, &config(), index, scratch, &good).unwrap();
            assert!(again.blob() == serial);
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "hours; another test has threads")]
fn the_first_bad_triangle_is_named_whatever_the_tasks() {
    let (mut positions, mut indices) = soup(4000);
    positions[3 * 1700] = [f32::NAN; 3];
    positions[3 * 3200] = [f32::INFINITY; 3];
    let strict = Config { flags: BuildFlags::STRICT, ..config() };
    for tasks in [1, 3, 8] {
        let parallel = Control { tasks, run: &backward, progress: None };
        let error = |indices: &[[u32; 3]]| {
            let mesh = TriangleMesh::new(&positions, indices).unwrap();
            sizes_with(&mesh, &strict, &mut [], &parallel).err()
        };
        assert_eq!(error(&indices), Some(Error::NonFiniteTriangle { triangle: 1700 }));
        let vertex = core::mem::replace(&mut indices[900][1], u32::MAX);
        assert_eq!(error(&indices), Some(Error::IndexOutOfRange { triangle: 900 }));
        indices[900][1] = vertex;
    }
}
