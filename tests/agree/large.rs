//! Scattered rays through a tree that exceeds the caches of a core: groups interleave them there.

use hgrid_core::{
    Coherence, Config, Cull, Grid, Hit, INVALID_ID, Instance, Method, Object, QueryOptions, Ray,
    RayF64, Scene, SceneHit, SceneOptions, SimdLevel, Strided, StridedMut, Verdict,
};
use hgrid_tests::copy::{Copy, word};
use hgrid_tests::meshes::{Mesh, soup};
use hgrid_tests::oracle;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::Built;

use crate::batches::{COHERENCES, bits, odd_rays};

/// The size of the header.
const HEADER: usize = 128;
/// The size of a node, and where its first child, its low and its high sides stand in it.
const NODE: usize = 80;
const CHILD: usize = 16;
/// Where a node says whether it has fine sides, in the top bit; their size, and that of the least sides and of all.
const FIRST: usize = 20;
const FINE: usize = 196;
const FINE_LOW: usize = 96;
const FINE_SIDES: usize = 192;
/// Where the header has the number of fine sides and that of nodes.
const FINE_COUNT: usize = 84;
const NODE_COUNT: usize = 112;
const LOW: usize = 32;
const HIGH: usize = 56;

/// Returns small triangles, some of them twice, and larger ones around one point, at scales from 1 to 2^-119. Their
/// boxes all hold the point, so more of them wait for a ray from there than have room on its share of a stack.
fn large() -> Mesh {
    let mut random = Random(7);
    let mut mesh = soup(200_000, 0.01, 5);
    for scale in 0..120 {
        for _ in 0..64 {
            mesh.push(std::array::from_fn(|corner| {
                let mut at = random.point().map(|c| 0.02 * c - 0.1);
                at[corner] += 1.0;
                at.map(|c| c * 0.5_f32.powi(scale))
            }));
        }
    }
    // Both have the same `t`; the one with the lower id is hit.
    mesh.indices.extend_from_within(..40_000);
    assert!(mesh.indices.len() > 2 * 110_000, "the tree exceeds the caches by far");
    mesh
}

/// Returns rays that start anywhere and go anywhere, some of them odd, some from the point.
fn rays() -> Vec<Ray> {
    let mut random = Random(29);
    let odd = odd_rays();
    let ray = |i: usize| match i % 32 {
        7 => odd[i / 32 % odd.len()],
        21 => Ray::new([0.0; 3], random.point()),
        _ => Ray::new(random.point().map(|c| 1.2 * c), random.point()),
    };
    (0..4096).map(ray).collect()
}

/// Returns the hits of a batch.
fn batch(
    grid: &Grid<'_>,
    rays: &[Ray],
    coherence: Coherence,
    options: &mut QueryOptions<'_>,
) -> Vec<Hit> {
    let mut hits = vec![Hit { primitive: 7, ..Hit::MISS }; rays.len()];
    let answers = &mut StridedMut::new(&mut hits);
    grid.intersect_n_with(&Strided::new(rays), answers, coherence, options).unwrap();
    hits
}

#[test]
fn interleaved_rays_agree_with_each_alone() {
    let mesh = large();
    let masks: Vec<u32> = (0..mesh.view().triangle_count()).map(|id| 1 << (id % 3)).collect();
    let view = mesh.view().with_masks(Strided::new(&masks)).unwrap();
    let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
    let grid = owned.open(&view).unwrap();
    let rays = rays();
    let hits = rays.iter().step_by(600).filter(|ray| oracle::check(&grid, ray)).count();
    assert!(hits > 1 && hits < 7, "{hits}");
    let alone = |options: &mut QueryOptions<'_>| -> Vec<Hit> {
        rays.iter().map(|ray| grid.intersect_with(ray, options).unwrap_or(Hit::MISS)).collect()
    };
    let all = alone(&mut QueryOptions::default());
    let skip = all.iter().find(|hit| **hit != Hit::MISS).unwrap().primitive;
    let mut rejects_even = |_: usize, hit: &Hit| match hit.primitive % 2 {
        0 => Verdict::Reject,
        _ => Verdict::Accept,
    };
    let mut different = 0;
    for (mask, cull, skip, has_filter) in [
        (u32::MAX, Cull::None, INVALID_ID, false),
        (5, Cull::Back, INVALID_ID, false),
        (u32::MAX, Cull::Front, skip, false),
        (6, Cull::None, INVALID_ID, true),
    ] {
        let mut options = QueryOptions { mask, cull, skip, ..QueryOptions::default() };
        if has_filter {
            options.filter = Some(&mut rejects_even);
        }
        let expected = alone(&mut options);
        let hits = expected.iter().filter(|hit| **hit != Hit::MISS).count();
        assert!(hits > 500 && hits < rays.len() - 500, "{hits} of {}", rays.len());
        different += usize::from(expected != all);
        for (level, coherence) in
            SimdLevel::available().flat_map(|level| COHERENCES.map(|coherence| (level, coherence)))
        {
            let found = batch(&grid.with_simd(level), &rays, coherence, &mut options);
            for ((ray, found), expected) in rays.iter().zip(&found).zip(&expected) {
                let is_right = bits(found) == bits(expected);
                assert!(
                    is_right,
                    "{level:?} {coherence:?} {mask} {cull:?} {ray:?}: {found:?}, not {expected:?}"
                );
            }
        }
    }
    assert_eq!(different, 3, "each set of options changes something");
}

/// Rays that were hit before in another instance are interleaved, too, and end there.
#[test]
fn interleaved_rays_agree_in_scenes() {
    let mesh = large();
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
    let grid = owned.open(&view).unwrap();
    let objects = [Object::Grid(&grid)];
    let rays: Vec<_> = rays().iter().step_by(4).map(RayF64::from).collect();
    // Two stand at one place: where both are hit, the first of them is named.
    let [here, there] = [[0.0; 3], [0.3, -0.2, 0.1]]
        .map(|translation| Instance { translation, ..Instance::new(0) });
    for (instances, never) in
        [([here, there, here], 2), ([there, here, here], 2), ([here, here, there], 1)]
    {
        let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
        let scene: Scene<'_> = built.open(&objects).unwrap();
        let mut found = vec![SceneHit::MISS; rays.len()];
        let answers = &mut StridedMut::new(&mut found);
        let options = &mut SceneOptions::default();
        scene
            .intersect_n_with(&Strided::new(&rays), answers, Coherence::Coherent, options)
            .unwrap();
        let mut named = [0; 3];
        for (ray, found) in rays.iter().zip(&found) {
            let alone = scene.intersect(ray).unwrap_or(SceneHit::MISS);
            assert_eq!(*found, alone, "{ray:?}");
            if alone.path[0] != INVALID_ID {
                named[alone.path[0] as usize] += 1;
            }
        }
        for (number, &count) in named.iter().enumerate() {
            assert_eq!(count > 100, number != never, "{named:?}");
            assert_eq!(count == 0, number == never, "{named:?}");
        }
    }
}

#[test]
fn interleaved_rays_end_in_damaged_trees() {
    let mesh = large();
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
    let mut rays = rays();
    rays.truncate(64);
    let hits =
        |grid: &Grid<'_>| batch(grid, &rays, Coherence::Coherent, &mut QueryOptions::default());
    let sound = hits(&owned.open(&view).unwrap());
    // Nodes stand behind the ids, which are padded.
    let first = HEADER + (4 * mesh.indices.len()).next_multiple_of(64);
    let [nodes, fine_count] = [NODE_COUNT, FINE_COUNT].map(|at| word(owned.bytes(), at) as usize);
    let fine = first + (NODE * nodes).next_multiple_of(64);
    let end = fine + (FINE * fine_count).next_multiple_of(64);
    assert_eq!(end, owned.bytes().len());
    let has_fine = |node: &usize| word(owned.bytes(), first + NODE * node + FIRST) >> 31 == 1;
    assert_eq!((0..nodes).filter(has_fine).count(), fine_count);
    assert!(fine_count > 1, "{fine_count}");
    // All children are the root, and in the second round all boxes are met, too.
    for all_are_met in [false, true] {
        let mut copy = Copy::of(owned.bytes());
        for at in (0..nodes).map(|node| first + NODE * node) {
            copy.set_word(at + CHILD, 0);
            if all_are_met {
                copy.set(at + LOW, &[0; HIGH - LOW]);
                copy.set(at + HIGH, &[255; NODE - HIGH]);
            }
        }
        for at in (0..fine_count).map(|number| fine + FINE * number).filter(|_| all_are_met) {
            for side in (at..at + FINE_SIDES).step_by(4) {
                let bound = if side < at + FINE_LOW { -1e30_f32 } else { 1e30 };
                copy.set_word(side, bound.to_bits());
            }
        }
        let grid = Grid::open(copy.bytes(), view).unwrap();
        // Without a budget of nodes they would go in circles for ever.
        assert_ne!(hits(&grid), sound);
    }
    // Random words from elsewhere in the blob.
    let mut random = Random(31);
    let mut different = 0;
    for round in 0..10 {
        let mut copy = Copy::of(owned.bytes());
        let words = copy.bytes().len() / 4;
        for _ in 0..10_usize.pow(round % 5) {
            let at = first + 4 * random.below(words - first / 4);
            let word = copy.word(4 * random.below(words));
            copy.set_word(at, word);
        }
        // A blob opens if the padding of its sections is zero.
        let Ok(grid) = Grid::open(copy.bytes(), view) else { continue };
        different += usize::from(hits(&grid) != sound);
    }
    assert!(different > 1, "{different} of 10 damaged trees answer otherwise");
}
