//! Brute force: every triangle, no structure, the lowest `t`, then the lowest id.
//!
//! This is what every query path must answer, bit for bit. It shares the ray-triangle test with the
//! library, because which side of an edge a ray passes is decided there once; that test itself is
//! held against exact arithmetic in `agree/exact.rs`.

use hgrid_core::{Grid, Hit, Ray, TriangleMesh, TriangleTest};

/// The closest hit among all triangles of the grid's mesh.
pub fn brute_force(grid: &Grid<'_>, ray: &Ray) -> Option<Hit> {
    let test = TriangleTest::new(ray, grid.bounds())?;
    closest(grid.mesh(), &test)
}

fn closest(mesh: &TriangleMesh<'_>, test: &TriangleTest) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    for id in 0..mesh.triangle_count() {
        let triangle = mesh.triangle(id).expect("the mesh is sound");
        // Skipped triangles are no triangles: say it here in other words than the library does.
        if triangle.iter().flatten().any(|c| c.is_nan() || c.abs() > hgrid_core::MAX_COORDINATE) {
            continue;
        }
        let Some(hit) = test.test(&triangle) else { continue };
        let wins = match best {
            None => true,
            Some(best) => hit.t < best.t,
        };
        if wins {
            best = Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive: id });
        }
    }
    best
}

/// Asks every entry point of a grid about a ray and compares with brute force.
///
/// # Panics
/// On the first difference, with the ray.
pub fn check(grid: &Grid<'_>, ray: &Ray) {
    let expected = brute_force(grid, ray);
    let mut counters = hgrid_core::Counters::default();
    assert_eq!(grid.intersect(ray), expected, "intersect {ray:?}");
    assert_eq!(grid.intersect_counted(ray, &mut counters), expected, "intersect_counted {ray:?}");
    assert_eq!(grid.occluded(ray), expected.is_some(), "occluded {ray:?}");
    assert_eq!(grid.occluded_counted(ray, &mut counters), expected.is_some(), "counted {ray:?}");

    // What is closed at both ends can be narrowed down to the hit itself.
    if let Some(hit) = expected {
        let only = Ray { t_min: hit.t, t_max: hit.t, ..*ray };
        assert_eq!(grid.intersect(&only), expected, "t_min = t = t_max {ray:?}");
        assert!(grid.occluded(&only), "t_min = t = t_max {ray:?}");
        let before = Ray { t_max: hit.t.next_down(), ..*ray };
        assert_eq!(grid.intersect(&before), None, "before the hit {ray:?}");
        assert!(!grid.occluded(&before), "before the hit {ray:?}");
        let behind = Ray { t_min: hit.t.next_up(), ..*ray };
        assert_eq!(grid.intersect(&behind), brute_force(grid, &behind), "behind the hit {ray:?}");
    }
}
