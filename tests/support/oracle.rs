//! Brute force: every triangle, no structure, the lowest `t`, then the lowest id.
//!
//! This is what every query path must answer, bit for bit. It shares the ray-triangle test with the
//! library, because which side of an edge a ray passes is decided there once; that test itself is
//! held against exact arithmetic in `agree/exact.rs`.

use hgrid_core::{Counters, Cull, Grid, Hit, INVALID_ID, QueryOptions, Ray, TriangleTest, Verdict};

/// All hits of a ray with the grid's mesh, the nearest first.
pub fn all_hits(grid: &Grid<'_>, ray: &Ray, cull: Cull) -> Vec<Hit> {
    let Some(test) = TriangleTest::new(ray) else { return Vec::new() };
    let test = test.culling(cull);
    let mut hits = Vec::new();
    for id in 0..grid.mesh().triangle_count() {
        let triangle = grid.mesh().triangle(id).expect("the mesh is sound");
        // Skipped triangles are no triangles: say it here in other words than the library does.
        if triangle.iter().flatten().any(|c| c.is_nan() || c.abs() > hgrid_core::MAX_COORDINATE) {
            continue;
        }
        hits.extend(test.test(&triangle).map(|hit| hit.on(id)));
    }
    // Stable: at equal `t` the ids stay ascending.
    hits.sort_by(|a, b| a.t.partial_cmp(&b.t).expect("no hit is at NaN"));
    hits
}

/// The closest hit among all triangles of the grid's mesh.
pub fn brute_force(grid: &Grid<'_>, ray: &Ray) -> Option<Hit> {
    all_hits(grid, ray, Cull::None).first().copied()
}

/// Asks every entry point of a grid about a ray and compares with brute force.
///
/// # Panics
/// On the first difference, with the ray.
pub fn check(grid: &Grid<'_>, ray: &Ray) {
    let all = all_hits(grid, ray, Cull::None);
    let expected = all.first().copied();
    assert_eq!(grid.intersect(ray), expected, "intersect {:?} {ray:?}", grid.method());
    assert_eq!(grid.occluded(ray), expected.is_some(), "occluded {ray:?}");

    // Ranges that end at the hit, or next to it: the exact t lies on either side of the rounded one.
    if let Some(hit) = expected {
        let (before, behind) = (hit.t.next_down(), hit.t.next_up());
        for (t_min, t_max) in [
            (hit.t, hit.t),
            (ray.t_min, hit.t),
            (hit.t, ray.t_max),
            (ray.t_min, before),
            (behind, ray.t_max),
            (before, behind),
        ] {
            let part = Ray { t_min, t_max, ..*ray };
            let expected = brute_force(grid, &part);
            assert_eq!(grid.intersect(&part), expected, "part of the ray {part:?}");
            assert_eq!(grid.occluded(&part), expected.is_some(), "part of the ray {part:?}");
        }
    }
    // Without memory for more, the ray is walked again for each few hits: not with a million.
    if all.len() > 1000 {
        let mut hits = vec![Hit::MISS; all.len() + 1];
        let count = grid.intersect_all(ray, &mut QueryOptions::default(), &mut hits);
        assert_eq!(hits[..count], all, "intersect_all {ray:?}");
        return;
    }
    check_order(grid, ray, &all);
    check_selection(grid, ray, &all);
}

/// All hits, and filters that let the first few pass: in order, none twice.
fn check_order(grid: &Grid<'_>, ray: &Ray, all: &[Hit]) {
    for room in [0, 1, all.len(), all.len() + 2] {
        let mut hits = vec![Hit::MISS; room];
        let count = grid.intersect_all(ray, &mut QueryOptions::default(), &mut hits);
        assert_eq!(count, all.len(), "intersect_all {ray:?}");
        let known = room.min(count);
        assert_eq!(hits[..known], all[..known], "intersect_all, room for {room}, {ray:?}");
        assert!(hits[known..].iter().all(|hit| *hit == Hit::MISS));
    }
    for passed in [0, 1, all.len() / 2, all.len()] {
        let (mut shown, mut again) = (Vec::new(), Vec::new());
        let mut reject = |_, hit: &Hit| {
            shown.push(*hit);
            if shown.len() > passed { Verdict::Accept } else { Verdict::Reject }
        };
        let mut options = QueryOptions { filter: Some(&mut reject), ..QueryOptions::default() };
        assert_eq!(grid.intersect_with(ray, &mut options), all.get(passed).copied(), "{ray:?}");
        assert_eq!(shown, all[..(passed + 1).min(all.len())], "shown to the filter {ray:?}");

        let mut stop = |_, hit: &Hit| {
            again.push(*hit);
            if again.len() > passed { Verdict::AcceptAndStop } else { Verdict::Reject }
        };
        let mut options = QueryOptions { filter: Some(&mut stop), ..QueryOptions::default() };
        assert_eq!(grid.occluded_with(ray, &mut options), passed < all.len(), "{ray:?}");
        again.clear();
        let mut stop = |_, hit: &Hit| {
            again.push(*hit);
            if again.len() > passed { Verdict::AcceptAndStop } else { Verdict::Accept }
        };
        let mut options = QueryOptions { filter: Some(&mut stop), ..QueryOptions::default() };
        let count = grid.intersect_all(ray, &mut options, &mut []);
        assert_eq!(count, (passed + 1).min(all.len()), "accept and stop {ray:?}");
    }
}

/// Masks, culling, the triangle to skip, and the counters.
fn check_selection(grid: &Grid<'_>, ray: &Ray, all: &[Hit]) {
    let skip = all.first().map_or(INVALID_ID, |hit| hit.primitive);
    let front = all_hits(grid, ray, Cull::Back);
    for (mask, cull, skip) in [
        (u32::MAX, Cull::None, INVALID_ID),
        (u32::MAX, Cull::None, skip),
        (u32::MAX, Cull::Back, INVALID_ID),
        (u32::MAX, Cull::Front, skip),
        (1, Cull::None, INVALID_ID),
        (6, Cull::Back, skip),
        (0, Cull::None, INVALID_ID),
    ] {
        let is_seen = |id: u32| mask == u32::MAX || grid.mesh().mask(id) & mask != 0;
        let sees = |id: u32| id != skip && is_seen(id);
        // What shows its front and what shows its back are all there is, and nothing is both.
        let shows = |hit: &&Hit| match cull {
            Cull::None => true,
            Cull::Back => front.contains(hit),
            Cull::Front => !front.contains(hit),
        };
        let expected: Vec<Hit> =
            all.iter().filter(|hit| sees(hit.primitive)).filter(shows).copied().collect();
        let mut counters = Counters::default();
        let mut options =
            QueryOptions { mask, cull, skip, ..QueryOptions::counting(&mut counters) };
        let hit = grid.intersect_with(ray, &mut options);
        let is_occluded = grid.occluded_with(ray, &mut options);
        let count = grid.intersect_all(ray, &mut options, &mut []);
        assert!(counters.primitive_tests >= 3 * u64::from(hit.is_some()), "not counted {ray:?}");
        assert_eq!(hit, expected.first().copied(), "{mask} {cull:?} {skip} {ray:?}");
        assert_eq!(is_occluded, hit.is_some(), "{mask} {cull:?} {skip} {ray:?}");
        assert_eq!(count, expected.len(), "{mask} {cull:?} {skip} {ray:?}");
    }
}
