//! Brute force: every triangle, no structure, the lowest `t`, then the lowest id.
//!
//! Exact arithmetic decides which triangles a ray hits and whether they show their front ([`Line`]), and
//! checks the numbers of each hit. Only the last bits of `t`, `u` and `v`, which the documented rule leaves
//! open, come from the library's ray-triangle test. Every query must give the same bits.

use std::slice;

use hgrid_core::{
    Counters, Cull, Grid, Hit, INVALID_ID, QueryOptions, Ray, TriangleMesh, TriangleTest, Verdict,
};

use crate::reference::{Answer, Line};

/// A triangle's id and its corners.
type Numbered = (u32, [[f32; 3]; 3]);

/// Returns the triangles that the whole line of a ray passes through.
fn passed(mesh: &TriangleMesh<'_>, ray: &Ray) -> Vec<Numbered> {
    let whole = Ray { t_min: f32::NEG_INFINITY, t_max: f32::INFINITY, ..*ray };
    let Some(line) = Line::new(&whole) else { return Vec::new() };
    let triangle = |id| mesh.triangle(id).expect("the mesh is sound");
    let all = (0..mesh.triangle_count()).map(|id| (id, triangle(id)));
    all.filter(|(_, triangle)| line.passes(triangle)).collect()
}

/// Returns the hit with a triangle, if there is one, and true if it shows the front.
fn hit_on((id, triangle): &Numbered, line: &Line, ray: &Ray) -> Option<(Hit, bool)> {
    let answer = line.answer_of_passed(triangle);
    if answer == Answer::Miss {
        return None;
    }
    let hit = TriangleTest::new(ray).and_then(|test| test.test(triangle));
    let Some(hit) = hit else {
        assert_eq!(answer, Answer::Either, "missed {id} {triangle:?} {ray:?}");
        return None;
    };
    let hit = hit.on(*id);
    assert!(line.holds_numbers(triangle, &hit), "{hit:?} {triangle:?} {ray:?}");
    Some((hit, line.sees_front(triangle)))
}

/// Returns the hits among the triangles that the line of a ray passes through, the nearest first.
fn hits_among(passed: &[Numbered], ray: &Ray, cull: Cull) -> Vec<Hit> {
    let Some(line) = Line::new(ray) else { return Vec::new() };
    let mut hits = Vec::new();
    // A triangle equal to the one before it is hit in the same way.
    let mut last: Option<(&Numbered, Option<(Hit, bool)>)> = None;
    for numbered in passed {
        let found = match last {
            Some((before, found)) if before.1 == numbered.1 => {
                found.map(|(hit, is_front)| (Hit { primitive: numbered.0, ..hit }, is_front))
            }
            _ => hit_on(numbered, &line, ray),
        };
        last = Some((numbered, found));
        let is_shown = |is_front| match cull {
            Cull::None => true,
            Cull::Back => is_front,
            Cull::Front => !is_front,
        };
        hits.extend(found.filter(|(_, is_front)| is_shown(*is_front)).map(|(hit, _)| hit));
    }
    // The sort is stable: at equal `t` the ids stay ascending.
    hits.sort_by(|a, b| a.t.partial_cmp(&b.t).expect("no hit is at NaN"));
    hits
}

/// Returns all hits of a ray with a mesh, the nearest first.
pub fn hits_of(mesh: &TriangleMesh<'_>, ray: &Ray, cull: Cull) -> Vec<Hit> {
    hits_among(&passed(mesh, ray), ray, cull)
}

/// Returns the same for each way to cull: none, back and front.
pub fn hits_by_cull(mesh: &TriangleMesh<'_>, ray: &Ray) -> [Vec<Hit>; 3] {
    let passed = passed(mesh, ray);
    [Cull::None, Cull::Back, Cull::Front].map(|cull| hits_among(&passed, ray, cull))
}

/// Returns all hits of a ray with the mesh of a grid, the nearest first.
pub fn all_hits(grid: &Grid<'_>, ray: &Ray, cull: Cull) -> Vec<Hit> {
    hits_of(grid.mesh(), ray, cull)
}

/// Returns the closest hit among all triangles of the grid's mesh.
pub fn brute_force(grid: &Grid<'_>, ray: &Ray) -> Option<Hit> {
    all_hits(grid, ray, Cull::None).first().copied()
}

/// The answers of brute force about a ray.
struct Expected {
    ray: Ray,
    /// All hits, the nearest first, and those of them on the front of a triangle.
    all: Vec<Hit>,
    front: Vec<Hit>,
    /// Ranges that end at the closest hit or next to it, with the closest hit in each: the exact t may lie on
    /// either side of the rounded one.
    parts: Vec<(Ray, Option<Hit>)>,
}

impl Expected {
    fn new(mesh: &TriangleMesh<'_>, ray: &Ray) -> Self {
        let passed = passed(mesh, ray);
        let [all, front] = [Cull::None, Cull::Back].map(|cull| hits_among(&passed, ray, cull));
        let mut parts = Vec::new();
        if let Some(hit) = all.first() {
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
                parts.push((part, hits_among(&passed, &part, Cull::None).first().copied()));
            }
        }
        Self { ray: *ray, all, front, parts }
    }

    /// Compares every entry point of a grid with the answers.
    fn check(&self, grid: &Grid<'_>) {
        let Self { ray, all, front, parts } = self;
        let expected = all.first().copied();
        assert_eq!(grid.intersect(ray), expected, "intersect {:?} {ray:?}", grid.method());
        assert_eq!(grid.occluded(ray), expected.is_some(), "occluded {ray:?}");
        for (part, expected) in parts {
            assert_eq!(grid.intersect(part), *expected, "part of the ray {part:?}");
            assert_eq!(grid.occluded(part), expected.is_some(), "part of the ray {part:?}");
        }
        // With little room a grid walks again for each few hits, which takes too long for a million.
        if all.len() > 1000 {
            let mut hits = vec![Hit::MISS; all.len() + 1];
            let count = grid.intersect_all(ray, &mut QueryOptions::default(), &mut hits);
            assert_eq!(hits[..count], *all, "intersect_all {ray:?}");
            return;
        }
        check_order(grid, ray, all);
        check_selection(grid, ray, all, front);
    }
}

/// Asks every entry point of a grid about a ray and compares with brute force; returns true if the ray hits.
///
/// # Panics
/// On the first difference, with the ray.
pub fn check(grid: &Grid<'_>, ray: &Ray) -> bool {
    check_all(slice::from_ref(grid), ray)
}

/// Does the same for several grids of one mesh.
///
/// # Panics
/// If an answer differs (the message has the ray), or if there is no grid.
pub fn check_all(grids: &[Grid<'_>], ray: &Ray) -> bool {
    let first = grids.first().expect("a grid to check");
    let expected = Expected::new(first.mesh(), ray);
    grids.iter().for_each(|grid| expected.check(grid));
    !expected.all.is_empty()
}

/// Checks all hits, and filters that reject the first few: hits in order, none twice.
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

/// Checks masks, culling, the triangle to skip, and the counters. Of all hits, `front` are those on the front
/// of a triangle.
fn check_selection(grid: &Grid<'_>, ray: &Ray, all: &[Hit], front: &[Hit]) {
    let skip = all.first().map_or(INVALID_ID, |hit| hit.primitive);
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
        // Every hit shows either the front or the back of its triangle.
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
