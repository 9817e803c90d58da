//! Scattered rays through a tree that exceeds the caches of a core: groups interleave them there.

use hgrid_core::{
    Coherence, Config, Cull, Grid, Hit, INVALID_ID, Method, QueryOptions, Ray, SimdLevel, Strided,
    StridedMut, Verdict,
};
use hgrid_tests::copy::Copy;
use hgrid_tests::meshes::{Mesh, soup};
use hgrid_tests::oracle;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;

use crate::batches::{bits, odd_rays};

/// Bytes of the largest tree whose scattered rays are traced alone.
const LARGE: usize = 1 << 20;

/// Returns small triangles, and larger ones around one point, at scales from 1 to 2^-90. Their boxes all hold the point,
/// so more of them wait for a ray from there than have room on its share of a stack.
fn large() -> Mesh {
    let mut random = Random(7);
    let mut mesh = soup(140_000, 0.01, 5);
    for scale in 0..90 {
        for _ in 0..64 {
            mesh.push(std::array::from_fn(|corner| {
                let mut at = random.point().map(|c| 0.02 * c - 0.1);
                at[corner] += 1.0;
                at.map(|c| c * 0.5_f32.powi(scale))
            }));
        }
    }
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
fn batch(grid: &Grid<'_>, rays: &[Ray], options: &mut QueryOptions<'_>) -> Vec<Hit> {
    let mut hits = vec![Hit { primitive: 7, ..Hit::MISS }; rays.len()];
    let answers = &mut StridedMut::new(&mut hits);
    grid.intersect_n_with(&Strided::new(rays), answers, Coherence::Coherent, options).unwrap();
    hits
}

#[test]
fn interleaved_rays_agree_with_each_alone() {
    let mesh = large();
    let masks: Vec<u32> = (0..mesh.view().triangle_count()).map(|id| 1 << (id % 3)).collect();
    let view = mesh.view().with_masks(Strided::new(&masks)).unwrap();
    let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
    assert!(owned.bytes().len() > LARGE + 1000, "{} bytes", owned.bytes().len());
    let grid = owned.open(&view).unwrap();
    let rays = rays();
    for ray in rays.iter().step_by(400) {
        oracle::check(&grid, ray);
    }
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
        for level in SimdLevel::available() {
            let found = batch(&grid.with_simd(level), &rays, &mut options);
            for ((ray, found), expected) in rays.iter().zip(&found).zip(&expected) {
                assert_eq!(bits(found), bits(expected), "{level:?} {mask} {cull:?} {ray:?}");
            }
        }
    }
    assert_eq!(different, 3, "each set of options changes something");
}

#[test]
fn interleaved_rays_end_in_damaged_trees() {
    let mesh = large();
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
    let (mut random, mut rays) = (Random(31), rays());
    rays.truncate(256);
    let sound = batch(&owned.open(&view).unwrap(), &rays, &mut QueryOptions::default());
    let mut different = 0;
    for round in 0..20 {
        let mut copy = Copy::of(owned.bytes());
        let words = copy.bytes().len() / 4;
        // The header stays as it is. Most nodes stand near the end, the root and its children before them.
        for _ in 0..10_usize.pow(round % 5) {
            let at = 4 * (32 + random.below(words - 32));
            let from = 4 * (32 + random.below(words - 32));
            let word = copy.word(from);
            copy.set_word(at, word);
        }
        // A blob opens if the padding of its sections is zero.
        let Ok(grid) = Grid::open(copy.bytes(), view) else { continue };
        different += usize::from(batch(&grid, &rays, &mut QueryOptions::default()) != sound);
    }
    assert!(different > 5, "{different} of 20 damaged trees answer otherwise");
}
