//! Every query that a grid answers: on any grid it must end with a possible answer, on a valid grid it must
//! give the answer of brute force.

use hgrid_core::{
    BlobInfo, ClosestPoint, Coherence, Counters, Cull, Error, Grid, Hit, INVALID_ID, Method,
    QueryOptions, Ray, SimdLevel, Strided, StridedMut, TriangleTest, Verdict,
};

use super::limits;
use super::rays::close;
use crate::copy::Copy;
use crate::oracle;
use crate::owned::prove;

const COHERENCES: [Coherence; 2] = [Coherence::Coherent, Coherence::Incoherent];

/// The number of rays for which every query runs; the other rays, which are tiles, only go through batches.
const ASKED_ALL: usize = 12;

/// Returns the SIMD levels worth a test: only trees have SIMD kernels.
fn levels(grid: &Grid<'_>) -> impl Iterator<Item = SimdLevel> {
    let all = grid.method() == Method::Bvh;
    SimdLevel::available().filter(move |level| all || *level == SimdLevel::detect())
}

/// Returns true if the ray hits the triangle of a hit exactly there, wherever the hit came from.
fn is_possible(grid: &Grid<'_>, ray: &Ray, hit: &Hit) -> bool {
    let test = TriangleTest::new(ray);
    let triangle = grid.mesh().triangle(hit.primitive);
    let found = test.zip(triangle).and_then(|(test, triangle)| test.test(&triangle));
    found
        .is_some_and(|found| bits(&Hit { t: found.t, u: found.u, v: found.v, ..*hit }) == bits(hit))
}

/// Returns the bits of a hit, which tell -0.0 from 0.0.
fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

/// Returns the answers of both batch queries.
fn batch(grid: &Grid<'_>, rays: &[Ray], coherence: Coherence) -> (Vec<Hit>, Vec<u8>) {
    let mut hits = vec![Hit { primitive: 7, ..Hit::MISS }; rays.len()];
    let mut occluded = vec![7; rays.len()];
    let strided = Strided::new(rays);
    grid.intersect_n(&strided, &mut StridedMut::new(&mut hits), coherence).expect("sound arrays");
    grid.occluded_n(&strided, &mut StridedMut::new(&mut occluded), coherence)
        .expect("sound arrays");
    (hits, occluded)
}

/// Queries a grid, whatever its bytes say: answers must name triangles that exist and that the ray hits,
/// after bounded work.
///
/// # Panics
/// If an answer is not possible.
pub fn ends(grid: &Grid<'_>, rays: &[Ray]) {
    let most = limits::most(grid);
    let is_bounded = |counters: &Counters| {
        counters.cell_steps <= most.cell_steps
            && counters.grid_steps <= most.grid_steps
            && counters.primitive_tests <= most.primitive_tests
    };
    for ray in rays {
        let mut counters = Counters::default();
        let hit = grid.intersect_with(ray, &mut QueryOptions::counting(&mut counters));
        assert!(is_bounded(&counters), "{counters:?} exceed {most:?} for {ray:?}");
        assert!(hit.is_none_or(|hit| is_possible(grid, ray, &hit)), "{hit:?} {ray:?}");
        assert_eq!(grid.intersect(ray).as_ref().map(bits), hit.as_ref().map(bits), "{ray:?}");
        let mut counters = Counters::default();
        let is_hit = grid.occluded_with(ray, &mut QueryOptions::counting(&mut counters));
        assert!(is_bounded(&counters), "{counters:?} exceed {most:?} for {ray:?}");
        assert_eq!(grid.occluded(ray), is_hit, "{ray:?}");
    }
    for ray in rays.iter().take(ASKED_ALL) {
        in_order(grid, ray);
        let found = closest(grid, ray);
        let is_possible =
            found.is_none_or(|found| on_triangle(grid, found.primitive, ray) == Some(found));
        assert!(is_possible, "{found:?} {ray:?}");
    }
    let statistics = grid.inspect();
    assert!(statistics.reference_count <= most.primitive_tests, "{statistics:?}");
    for coherence in COHERENCES {
        many(grid, rays, coherence);
    }
    // These rays all lie in a few cells, unlike any others, so that two groups are traced together.
    many(grid, &close(grid), Coherence::Coherent);
}

/// Runs batches: each ray must hit an existing triangle within the ray's range, or nothing.
fn many(grid: &Grid<'_>, rays: &[Ray], coherence: Coherence) {
    let (hits, occluded) = batch(grid, rays, coherence);
    for (ray, (hit, occluded)) in rays.iter().zip(hits.iter().zip(occluded)) {
        let is_miss = bits(hit) == bits(&Hit::MISS);
        // Tiles do not test whether a ray meets the leaf's box, and a damaged box may lie beside its triangles.
        let is_hit = hit.primitive < grid.mesh().triangle_count()
            && (ray.t_min..=ray.t_max).contains(&hit.t);
        assert!(is_miss || is_hit, "{coherence:?} {hit:?} {ray:?}");
        assert!(occluded <= 1, "{coherence:?} {ray:?}");
    }
}

/// Returns the closest point to a ray's origin, no farther than its end.
fn closest(grid: &Grid<'_>, ray: &Ray) -> Option<ClosestPoint> {
    grid.closest_point(ray.origin, ray.t_max, &mut QueryOptions::default())
}

/// Returns the closest point of one triangle to a ray's origin.
fn on_triangle(grid: &Grid<'_>, primitive: u32, ray: &Ray) -> Option<ClosestPoint> {
    ClosestPoint::on_triangle(&grid.mesh().triangle(primitive)?, primitive, ray.origin)
}

/// Returns the closest point of all triangles to a ray's origin, no farther than its end.
fn closest_of_all(grid: &Grid<'_>, ray: &Ray) -> Option<ClosestPoint> {
    let is_point = ray.origin.iter().all(|c| c.is_finite());
    let all = (0..grid.mesh().triangle_count()).filter_map(|id| on_triangle(grid, id, ray));
    let near = all.filter(|found| is_point && found.distance <= ray.t_max);
    near.reduce(|best, found| if found.distance < best.distance { found } else { best })
}

/// Checks queries for all hits, and for those that a filter accepts: each hit once, from near to far.
fn in_order(grid: &Grid<'_>, ray: &Ray) {
    let is_ordered = |hits: &[Hit]| {
        hits.windows(2).all(|pair| pair[0].is_closer(&pair[1]))
            && hits.iter().all(|hit| is_possible(grid, ray, hit))
    };
    let mut hits = [Hit::MISS; 5];
    let count = grid.intersect_all(ray, &mut QueryOptions::default(), &mut hits);
    assert!(count <= grid.mesh().triangle_count() as usize, "{ray:?}");
    assert!(is_ordered(&hits[..count.min(5)]), "{hits:?} {ray:?}");
    let mut shown = Vec::new();
    let mut filter = |_, hit: &Hit| {
        shown.push(*hit);
        [Verdict::Reject, Verdict::Reject, Verdict::Accept][shown.len() % 3]
    };
    let options = QueryOptions { mask: 5, cull: Cull::Back, skip: 3, ..QueryOptions::default() };
    let mut options = QueryOptions { filter: Some(&mut filter), ..options };
    let count = grid.intersect_all(ray, &mut options, &mut []);
    assert_eq!(count, (shown.len() + 1) / 3, "the filter accepts every third hit: {ray:?}");
    assert!(is_ordered(&shown), "{shown:?} {ray:?}");
    let is_seen = |hit: &Hit| hit.primitive != 3 && grid.mesh().mask(hit.primitive) & 5 != 0;
    assert!(shown.iter().all(is_seen), "{shown:?} {ray:?}");
}

/// Queries a valid grid: every answer must be that of brute force, bit for bit, at every SIMD level. Returns the
/// number of rays that hit.
///
/// # Panics
/// If an answer differs.
pub fn agrees(grid: &Grid<'_>, rays: &[Ray]) -> usize {
    let expected: Vec<Hit> =
        rays.iter().map(|ray| oracle::brute_force(grid, ray).unwrap_or(Hit::MISS)).collect();
    for ray in rays.iter().take(ASKED_ALL) {
        oracle::check(grid, ray);
        assert_eq!(closest(grid, ray), closest_of_all(grid, ray), "{ray:?}");
    }
    for level in levels(grid) {
        let grid = grid.with_simd(level);
        for (ray, expected) in rays.iter().zip(&expected) {
            let hit = grid.intersect(ray).unwrap_or(Hit::MISS);
            assert_eq!(bits(&hit), bits(expected), "{level:?} {ray:?}: {hit:?}, not {expected:?}");
        }
        for coherence in COHERENCES {
            let (hits, occluded) = batch(&grid, rays, coherence);
            for (i, (hit, expected)) in hits.iter().zip(&expected).enumerate() {
                let what = format!("{level:?} {coherence:?} ray {i} {:?}", rays[i]);
                assert_eq!(bits(hit), bits(expected), "{what}: {hit:?}, not {expected:?}");
                assert_eq!(occluded[i], u8::from(expected.primitive != INVALID_ID), "{what}");
            }
        }
    }
    ends(grid, rays);
    packs(grid, rays);
    expected.iter().filter(|hit| **hit != Hit::MISS).count()
}

/// Packs a valid grid with its mesh: the packed blob must open and give the same answers.
fn packs(grid: &Grid<'_>, rays: &[Ray]) {
    let bytes = usize::try_from(grid.packed_bytes()).expect("a small mesh");
    let mut copy = Copy::of(&vec![0xc7; bytes]);
    grid.pack(copy.bytes_mut()).expect("enough memory");
    let info = BlobInfo::peek(copy.bytes()).expect("a header");
    assert!(info.has_mesh && info.total_bytes == bytes as u64, "{info:?}");
    let packed = Grid::open_packed(copy.bytes()).expect("what was packed opens");
    prove(&packed).expect("what was packed is valid");
    assert_eq!(packed.inspect(), grid.inspect());
    for ray in rays {
        assert_eq!(packed.intersect(ray), grid.intersect(ray), "{ray:?}");
    }
    let short = Copy::of(&copy.bytes()[..bytes - 1]);
    assert!(matches!(Grid::open_packed(short.bytes()), Err(Error::Truncated { .. })));
}
