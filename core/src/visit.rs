//! Visits the lists of all cells that a box overlaps, and of all leaves in a tree: for the queries
//! without a ray, closest point and statistics.

use crate::aabb::Aabb;
use crate::budget::Budget;

/// The box of all cells.
pub(crate) const EVERYWHERE: Aabb =
    Aabb { min: glam::Vec3A::NEG_INFINITY, max: glam::Vec3A::INFINITY };

/// A callback for lists of primitive ids, and how many words may still be read.
pub(crate) struct Visitor<'v> {
    budget: Budget,
    leaf: &'v mut dyn FnMut(&[u32]),
}

impl<'v> Visitor<'v> {
    pub(crate) fn new(words: usize, leaf: &'v mut dyn FnMut(&[u32])) -> Self {
        Self { budget: Budget::new(words), leaf }
    }

    /// Passes a list to the callback; `false` if less of the budget is left.
    #[must_use]
    pub(crate) fn list(&mut self, ids: &[u32]) -> bool {
        self.spend(ids.len()) && {
            (self.leaf)(ids);
            true
        }
    }

    /// Takes words that lead to lists off the budget; `false` if less is left.
    #[must_use]
    pub(crate) fn spend(&mut self, words: usize) -> bool {
        self.budget.take(words)
    }
}
