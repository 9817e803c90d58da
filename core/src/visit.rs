//! Visits the lists of all cells that a box overlaps, and of all leaves in a tree: for the queries
//! without a ray, closest point and statistics.

use crate::aabb::Aabb;

/// The box of all cells.
pub(crate) const EVERYWHERE: Aabb =
    Aabb { min: glam::Vec3A::NEG_INFINITY, max: glam::Vec3A::INFINITY };

/// A callback for lists of primitive ids, with a budget.
pub(crate) struct Visitor<'v> {
    /// Words that may still be read: damaged bytes may list everything in every cell.
    rest: usize,
    leaf: &'v mut dyn FnMut(&[u32]),
}

impl<'v> Visitor<'v> {
    /// A visitor with a budget of `words` words.
    pub(crate) fn new(words: usize, leaf: &'v mut dyn FnMut(&[u32])) -> Self {
        Self { rest: words, leaf }
    }

    /// Passes a list to the callback; `false` if the budget is used up.
    pub(crate) fn list(&mut self, ids: &[u32]) -> bool {
        self.spend(ids.len()) && {
            (self.leaf)(ids);
            true
        }
    }

    /// Takes words that lead to lists off the budget; `false` if it is used up.
    pub(crate) fn spend(&mut self, words: usize) -> bool {
        let rest = self.rest.checked_sub(words);
        self.rest = rest.unwrap_or(0);
        rest.is_some()
    }
}
