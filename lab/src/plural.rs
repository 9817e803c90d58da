//! Counts in sentences: one triangle, many triangles.

use indicatif::HumanCount;

/// Returns the noun for a count: the singular or the plural.
pub(crate) fn noun<'n>(count: impl TryInto<u64>, one: &'n str, many: &'n str) -> &'n str {
    if count.try_into().is_ok_and(|count| count == 1) { one } else { many }
}

/// Returns a count with its noun.
pub(crate) fn counted(count: impl TryInto<u64>, one: &str, many: &str) -> String {
    let count = count.try_into().unwrap_or(u64::MAX);
    format!("{} {}", HumanCount(count), noun(count, one, many))
}

/// Returns a count of triangles.
pub(crate) fn triangles(count: impl TryInto<u64>) -> String {
    counted(count, "triangle", "triangles")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_is_singular() {
        assert_eq!(
            [0, 1, 2, 1000].map(triangles),
            ["0 triangles", "1 triangle", "2 triangles", "1,000 triangles"]
        );
        assert_eq!(
            [1, 3].map(|count| counted(count, "vertex", "vertices")),
            ["1 vertex", "3 vertices"]
        );
    }
}
