//! Comparison of the answers of two systems.

use hgrid_core::Hit;

use super::system::is_hit;

/// The largest distance between hits that count as the same, as a part of the mesh's diagonal.
const TOLERANCE: f64 = 1e-4;

/// The same as a part of the diagonal of a field of instances, if that is more: rounding errors grow with coordinates.
const TOLERANCE_OF_FIELD: f64 = 1e-6;

/// The part of the rays, in thousandths, that may differ before a system is marked.
const MARKED_ABOVE: u64 = 1;

/// Returns the largest distance between hits that count as the same, for a mesh and a scene with these diagonals.
#[must_use]
pub fn tolerance(of_mesh: f64, of_scene: f64) -> f64 {
    (TOLERANCE * of_mesh).max(TOLERANCE_OF_FIELD * of_scene)
}

/// Counts the rays whose answers differ: one hits and the other does not, or they hit at different distances.
/// Directions are about one long, so `t` is a length.
#[must_use]
pub fn differing_hits(expected: &[Hit], found: &[Hit], tolerance: f64) -> u64 {
    let is_same = |a: &Hit, b: &Hit| match (is_hit(a), is_hit(b)) {
        (true, true) => (f64::from(a.t) - f64::from(b.t)).abs() <= tolerance,
        (a, b) => a == b,
    };
    count(expected.iter().zip(found), |(a, b)| !is_same(a, b))
}

/// Counts the distances that differ: only one is finite, or they are too far apart.
#[must_use]
pub fn differing_distances(expected: &[f32], found: &[f32], tolerance: f64) -> u64 {
    let is_same = |a: f32, b: f32| match (a.is_finite(), b.is_finite()) {
        (true, true) => (f64::from(a) - f64::from(b)).abs() <= tolerance,
        (a, b) => a == b,
    };
    count(expected.iter().zip(found), |(&a, &b)| !is_same(a, b))
}

/// Counts the finite distances.
#[must_use]
pub fn finite(distances: &[f32]) -> u64 {
    count(distances.iter(), |distance| distance.is_finite())
}

/// Counts the answers that are not the same to the last bit.
#[must_use]
pub fn unequal<T: PartialEq>(expected: &[T], found: &[T]) -> u64 {
    count(expected.iter().zip(found), |(a, b)| a != b)
}

/// Counts the rays that hit.
#[must_use]
pub fn hits(hits: &[Hit]) -> u64 {
    count(hits.iter(), is_hit)
}

/// Returns true if so many differing rays are too many.
#[must_use]
pub const fn is_off(differing: u64, rays: u64) -> bool {
    differing * 1000 > rays * MARKED_ABOVE
}

fn count<T>(items: impl Iterator<Item = T>, is_counted: impl Fn(T) -> bool) -> u64 {
    items.map(|item| u64::from(is_counted(item))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misses_and_other_places_differ() {
        let hit = |t| Hit { t, u: 0.1, v: 0.1, primitive: 3 };
        let expected = [hit(1.0), hit(1.0), hit(1.0), Hit::MISS, Hit::MISS];
        let found = [hit(1.000_01), hit(1.1), Hit::MISS, hit(1.0), Hit::MISS];
        assert_eq!(differing_hits(&expected, &found, 1e-4), 3);
        assert_eq!(differing_hits(&expected, &found, 0.2), 2);
        assert_eq!(hits(&expected), 3);
        assert_eq!((unequal(&expected, &found), unequal(&found, &found)), (4, 0));
    }

    #[test]
    fn a_large_field_has_a_larger_tolerance() {
        for (of_scene, expected) in [(1.0, 1e-4), (100.0, 1e-4), (1000.0, 1e-3)] {
            assert!((tolerance(1.0, of_scene) / expected - 1.0).abs() < 1e-9, "{of_scene}");
        }
    }

    #[test]
    fn other_distances_differ() {
        let (none, expected) = (f32::INFINITY, [1.0, 1.0, 1.0, f32::INFINITY, f32::INFINITY]);
        let found = [1.000_01, 1.1, none, 1.0, none];
        assert_eq!(differing_distances(&expected, &found, 1e-4), 3);
        assert_eq!((finite(&expected), finite(&found)), (3, 3));
    }

    #[test]
    fn one_in_a_thousand_is_allowed() {
        assert!(!is_off(1, 1000) && is_off(2, 1000) && is_off(1, 999) && !is_off(0, 0));
    }
}
