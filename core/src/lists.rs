//! Checks lists of ids: pairs each id with its neighbour, and tells whether they ascend.

/// Each number with the one behind it. (`windows` and `is_sorted` of the standard library keep code
/// to panic in a release build; this keeps none.)
pub(crate) fn pairs(numbers: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    numbers.iter().copied().zip(numbers.iter().skip(1).copied())
}

/// Returns true if every id is larger than the one before it: each is listed once.
pub(crate) fn ascends(ids: &[u32]) -> bool {
    pairs(ids).all(|(id, next)| id < next)
}
