//! Trees: the bounds from the number of triangles alone, on meshes that come nearest to them.

use std::thread;

use hgrid_core::{
    Config, Control, Error, Grid, Parameters, Quality, Region, Sizes, Task, TriangleMesh, sizes,
};
use hgrid_tests::copy::word;
use hgrid_tests::guarded::Guarded;
use hgrid_tests::meshes::{Mesh, soup};
use hgrid_tests::owned::{Owned, prove};

/// The offsets of the header's fields for the number of nodes and for the number of levels.
const NODE_COUNT: usize = 112;
const LEVELS: usize = 116;

fn config(quality: Quality) -> Config {
    Parameters::Bvh { quality }.into()
}

/// Does for trees what `every_size` does for all methods.
///
/// Ids lie in the index before the number of nodes is known, so an error may ask for more than is needed.
/// A build without crowded bins takes less scratch than the bound.
pub(crate) fn every_size(mesh: &TriangleMesh<'_>, config: &Config, step: usize) {
    let expected = Owned::build(mesh, config).unwrap();
    let exact = expected.bytes().len();
    let Sizes { scratch_bytes, .. } = sizes(mesh, config, &mut []).unwrap();
    let bound = Sizes::bound(mesh.triangle_count(), config).unwrap();
    let build = |index: &mut Guarded, scratch: &mut Guarded| {
        let result = Grid::build(*mesh, config, index.region(), scratch.region())
            .map(|grid| assert_eq!(grid.blob(), expected.bytes()));
        assert!(index.around_is_intact() && scratch.around_is_intact());
        result
    };
    let mut scratch = Guarded::new(scratch_bytes);
    for bytes in (0..exact + 200).step_by(step).chain([exact - 1, exact, exact + 1]) {
        let result = build(&mut Guarded::new(bytes), &mut scratch);
        assert_eq!(result.is_ok(), bytes >= exact, "{bytes} of {exact} bytes");
        let Err(error) = result else { continue };
        let Error::OutOfMemory { region: Region::Index, needed_bytes, available_bytes } = error
        else {
            panic!("{error:?}");
        };
        assert_eq!(available_bytes, bytes as u64);
        let enough = usize::try_from(needed_bytes).unwrap();
        assert!((exact..=bound.index_bytes).contains(&enough), "{enough} of {exact} bytes");
        assert_eq!(build(&mut Guarded::new(enough), &mut scratch), Ok(()), "{bytes} bytes");
    }

    let ends = [scratch_bytes.saturating_sub(1), scratch_bytes];
    for bytes in (0..scratch_bytes + 200).step_by(step).chain(ends) {
        let (mut index, mut scratch) = (Guarded::new(exact), Guarded::new(bytes));
        let answer = sizes(mesh, config, scratch.region()).unwrap();
        assert!(scratch.around_is_intact());
        assert_eq!(answer.scratch_bytes, scratch_bytes);
        assert_eq!(answer.is_exact, bytes >= scratch_bytes);
        let index_bytes = if answer.is_exact { exact } else { bound.index_bytes };
        assert_eq!(answer.index_bytes, index_bytes);
        let Err(error) = build(&mut index, &mut scratch) else { continue };
        let (needed_bytes, available_bytes) = (scratch_bytes as u64, bytes as u64);
        let region = Region::Scratch;
        assert_eq!(error, Error::OutOfMemory { region, needed_bytes, available_bytes });
        assert!(bytes < scratch_bytes && index.is_untouched(), "{bytes} bytes");
    }
}

/// Adds a small triangle around a point; its box has its centre at that point.
fn around(mesh: &mut Mesh, [x, y, z]: [f32; 3], size: f32) {
    mesh.push([[x - size, y - size, z], [x + size, y - size, z], [x, y + size, z]]);
}

/// Returns triangles of all sizes around one point.
fn one_centre(count: usize) -> Mesh {
    let mut mesh = Mesh::default();
    (0..count).for_each(|i| around(&mut mesh, [0.0; 3], 1.0 + i as f32));
    mesh
}

/// Returns a mesh in which each halving of space leaves all triangles but one in one half: nodes have seven
/// leaves of one triangle each, and all subtrees are as small as they can be.
fn one_by_one(count: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..count {
        // The corner of the scene, then points on the axes at powers of two from it.
        let mut center = [0.0; 3];
        if i % 31 > 0 {
            let step = i % 31 - 1;
            center[step % 3] = 0.5_f32.powi((step / 3) as i32);
        }
        around(&mut mesh, center, 1e-6);
    }
    mesh
}

/// Returns `count` triangles: a crowd in a corner and a triangle far away; all of that in a corner of
/// something larger with another triangle; and so on, `depth` times.
fn nested(count: usize, depth: i32) -> Mesh {
    let mut mesh = Mesh::default();
    for level in 0..depth {
        around(&mut mesh, [64_f32.powi(-level); 3], 64_f32.powi(-level) * 1e-3);
    }
    let inside = 64_f32.powi(-depth);
    let few = soup(count.saturating_sub(mesh.indices.len()), 0.01, 7);
    mesh.append(&few.map(|p| p.map(|c| (c + 1.0) * 0.5 * inside)));
    mesh
}

/// Returns a nested mesh with a layer of triangles, not one, at each distance, so that the sample of a division shows
/// it: no division but the last finds a dense box. If `is_alone`, a triangle lies far outside of each layer. Then each
/// division finds what lies inside it to be dense, and leaves that triangle.
fn nested_in_layers(count: usize, depth: i32, is_alone: bool) -> Mesh {
    let mut mesh = Mesh::default();
    for level in 0..depth {
        let at = 4096_f32.powi(-level);
        if is_alone {
            around(&mut mesh, [at * 64.0; 3], at * 1e-3);
        }
        (0..count / 32).for_each(|_| around(&mut mesh, [at; 3], at * 1e-3));
    }
    let inside = 4096_f32.powi(-depth);
    let few = soup(count.saturating_sub(mesh.indices.len()), 0.01, 7);
    mesh.append(&few.map(|p| p.map(|c| (c + 1.0) * 0.5 * inside)));
    mesh
}

/// Returns several nested meshes side by side.
fn many_nested(count: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..8 {
        let shift = [i & 1, i >> 1 & 1, i >> 2].map(|bit| bit as f32 * 1.5);
        let part = nested(count * (i + 1) / 8 - count * i / 8, 2 + (i as i32) % 3);
        mesh.append(&part.map(|p| std::array::from_fn(|axis| p[axis] + shift[axis])));
    }
    mesh
}

#[test]
fn crowds_leave_alone_what_they_do_not_need() {
    let mesh = nested(20_000, 2);
    let config = config(Quality::Fast);
    let bound = Sizes::bound(20_000, &config).unwrap();
    let [mut index, mut scratch] = [bound.index_bytes, bound.scratch_bytes].map(Guarded::new);
    let before = [&mut index, &mut scratch].map(|memory| memory.region().to_vec());
    let grid = Grid::build(mesh.view(), &config, index.region(), scratch.region()).unwrap();
    let used = grid.blob().len();
    assert!(used < 3 * bound.index_bytes / 4, "{used} of {} bytes", bound.index_bytes);
    assert_eq!(index.region()[used..], before[0][used..], "behind the blob");
    // Counts and entries take 8.2 bytes a triangle, and centres without room in the index 2.8. A second copy of the
    // entries would end at 16.2.
    let touched = scratch.region().iter().zip(&before[1]).rposition(|(now, then)| now != then);
    let touched = touched.expect("a build writes to its scratch");
    assert!(touched < 20_000 * 12, "{touched} of {} bytes", bound.scratch_bytes);
}

/// Builds in the memory of the bound, and returns the numbers of nodes and levels.
fn builds_in_its_bound(mesh: &Mesh, quality: Quality) -> [u32; 2] {
    let (view, config) = (mesh.view(), config(quality));
    let bound = Sizes::bound(view.triangle_count(), &config).unwrap();
    let (mut index, mut scratch) =
        (Guarded::new(bound.index_bytes), Guarded::new(bound.scratch_bytes));
    let exact = sizes(&view, &config, scratch.region()).unwrap();
    assert!(exact.is_exact && exact.index_bytes <= bound.index_bytes, "{exact:?} {bound:?}");
    let told = {
        let grid = Grid::build(view, &config, index.region(), scratch.region()).unwrap();
        assert_eq!(grid.blob_bytes(), exact.index_bytes);
        prove(&grid).unwrap();
        [NODE_COUNT, LEVELS].map(|at| word(grid.blob(), at))
    };
    assert!(index.around_is_intact() && scratch.around_is_intact());
    assert!((1..=64).contains(&told[1]), "{told:?}");
    told
}

#[test]
fn the_worst_meshes_stay_within_the_bound() {
    for count in 0..=300 {
        for mesh in [one_centre(count), one_by_one(count), soup(count, 0.01, count as u64)] {
            let [nodes, _] = builds_in_its_bound(&mesh, Quality::Fast);
            let (least, most) = (count.div_ceil(64), 1 + count / 7 + 4);
            assert!((least..=most).contains(&(nodes as usize)), "{nodes} for {count}");
        }
    }
    let mut deepest = 0;
    for count in [4095, 4096, 4097, 4319, 4320, 4321, 4400, 8192, 9001, 20_000, 100_000] {
        let mut meshes = vec![one_centre(count), one_by_one(count), many_nested(count)];
        meshes.extend((1..8).map(|depth| nested(count, depth)));
        meshes.extend((1..8).flat_map(|depth| {
            [false, true].map(|is_alone| nested_in_layers(count, depth, is_alone))
        }));
        for mesh in meshes {
            assert_eq!(mesh.indices.len(), count);
            let [nodes, levels] = builds_in_its_bound(&mesh, Quality::Fast);
            assert!((nodes as usize) < count / 7 + count / 40 + 20, "{nodes} for {count}");
            deepest = deepest.max(levels);
        }
    }
    assert!(deepest > 8, "{deepest}");
}

/// Returns the most nodes that a tree of high quality can have.
fn most_nodes(count: usize) -> u32 {
    count.saturating_sub(2).div_euclid(7).max(1) as u32
}

#[test]
fn the_worst_meshes_of_high_quality_reach_the_bound() {
    let build = |mesh: &Mesh| {
        let count = mesh.indices.len();
        let [nodes, levels] = builds_in_its_bound(mesh, Quality::High);
        assert!((count.div_ceil(64)..=most_nodes(count) as usize).contains(&(nodes as usize)));
        [nodes, levels]
    };
    for count in 1..=300 {
        for mesh in [one_centre(count), one_by_one(count), soup(count, 0.01, count as u64)] {
            build(&mesh);
        }
    }
    // The SAH cuts off one triangle at a time.
    for count in [9, 16, 23, 30, 37] {
        let mut mesh = Mesh::default();
        for i in 0..count {
            let at = 2_f32.powi(110 - 6 * i);
            around(&mut mesh, [at, 0.0, 0.0], at * 1e-3);
        }
        let [nodes, levels] = build(&mesh);
        assert_eq!([nodes, nodes], [most_nodes(mesh.indices.len()), levels], "{count}");
    }
    // Identical triangles: all leaves but one of each last node hold one triangle.
    let mut same = Mesh::default();
    (0..9 * 8_usize.pow(4)).for_each(|_| around(&mut same, [1.0; 3], 1.0));
    assert_eq!(build(&same), [4681, 5]);
    for count in [4096, 8192, 20_000] {
        build(&one_centre(count));
        build(&one_by_one(count));
        build(&many_nested(count));
        (1..8).for_each(|depth| assert!(build(&nested(count, depth))[1] < 20));
    }
}

/// Chains of crowds from 1e20 to 1e-20, each nearer to zero than the one before by a constant factor.
#[test]
fn trees_are_no_deeper_than_queries_are_prepared_for() {
    let (mut deepest, mut deepest_high) = (0, 0);
    for (copies, factor) in
        [(1, 0.5_f32), (113, 0.5), (225, 0.5), (225, 0.125), (113, 0.8), (450, 1e-2)]
    {
        let mut mesh = Mesh::default();
        let mut at = 1e20;
        while at > 1e-20 {
            (0..copies).for_each(|_| around(&mut mesh, [at, 0.0, 0.0], at * 1e-3));
            at *= factor;
        }
        deepest = deepest.max(builds_in_its_bound(&mesh, Quality::Fast)[1]);
        deepest_high = deepest_high.max(builds_in_its_bound(&mesh, Quality::High)[1]);
    }
    assert!((8..=35).contains(&deepest_high), "{deepest_high}");
    assert!((12..=64).contains(&deepest), "{deepest}");
}

/// Runs each task on its own thread.
fn on_threads(count: u32, task: &Task<'_>) {
    thread::scope(|scope| (0..count).for_each(|i| drop(scope.spawn(move || task(i)))));
}

fn backwards(count: u32, task: &Task<'_>) {
    (0..count).rev().for_each(task);
}

/// Returns five crowds far from each other, each dense in its middle: crowded bins with small bins in them.
fn crowds(count: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for crowd in 0..5_u8 {
        let size = count * usize::from(crowd + 1) / 5 - count * usize::from(crowd) / 5;
        let place = f32::from(crowd) * 1000.0;
        mesh.append(&soup(size, 1e-3, crowd.into()).map(|p| p.map(|c| place + c * c * c)));
    }
    mesh
}

#[test]
fn tasks_do_not_show() {
    do_tasks_show(&[2, 3]);
}

#[test]
#[ignore = "slow: a hundred builds of a hundred thousand triangles"]
fn tasks_do_not_show_in_other_meshes() {
    do_tasks_show(&[0, 1, 4, 5, 6]);
}

/// Any number of tasks makes the same blob, in scratch for that many tasks, for fewer, and for one. Takes the numbers
/// of the meshes to try.
fn do_tasks_show(which: &[usize]) {
    const COUNT: usize = 7 * 16_384 + 100;
    let mut behind = nested(COUNT - 5, 0).map(|p| p.map(|c| c * 1e-3));
    (0..5).for_each(|i| around(&mut behind, [1.0, i as f32, 1.0], 0.01));
    let mut mixed = soup(COUNT / 2, 0.01, 3);
    mixed.append(&many_nested(COUNT - COUNT / 2));
    let meshes = [
        soup(COUNT, 0.01, 1),
        behind,
        mixed,
        crowds(COUNT),
        one_centre(COUNT),
        nested(COUNT, 4),
        nested_in_layers(COUNT, 4, true),
    ];
    let qualities = Quality::ALL.iter().map(|&quality| config(quality));
    let all = meshes.iter().enumerate().filter(|(number, _)| which.contains(number));
    for ((number, mesh), config) in all.flat_map(|mesh| qualities.clone().map(move |of| (mesh, of)))
    {
        assert_eq!(mesh.indices.len(), COUNT);
        let view = mesh.view();
        let expected = Owned::build(&view, &config).unwrap();
        let bound = |tasks| Sizes::bound_parallel(COUNT as u32, &config, tasks).unwrap();
        for (tasks, run) in [2, 3, 7, 64].into_iter().zip([on_threads, backwards].iter().cycle()) {
            for memory in [tasks, 2, 1] {
                let (index_bytes, mut scratch_bytes) =
                    (bound(tasks).index_bytes, bound(memory).scratch_bytes);
                // Slightly more than two tasks need, and too little for more.
                if memory == 2 {
                    scratch_bytes += 1000;
                }
                let control = Control { tasks, run, progress: None };
                let (mut index, mut scratch) =
                    (Guarded::new(index_bytes), Guarded::new(scratch_bytes));
                let same = {
                    let (index, scratch) = (index.region(), scratch.region());
                    let grid = Grid::build_with(view, &config, index, scratch, &control);
                    grid.unwrap().blob() == expected.bytes()
                };
                assert!(same, "mesh {number}, {tasks} tasks, memory for {memory}");
                assert!(index.around_is_intact() && scratch.around_is_intact());
            }
        }
        // An index that holds only the tree is enough; the build then uses one task.
        let control = Control { tasks: 7, run: &on_threads, progress: None };
        let mut index = Guarded::new(expected.bytes().len());
        let mut scratch = Guarded::new(bound(7).scratch_bytes);
        let grid =
            Grid::build_with(view, &config, index.region(), scratch.region(), &control).unwrap();
        assert!(grid.blob() == expected.bytes(), "mesh {number}");
    }
}
