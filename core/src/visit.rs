//! The lists of a grid that a box meets: for questions that are no rays.

use crate::aabb::Aabb;

/// All that there is, in cells.
pub(crate) const EVERYWHERE: Aabb =
    Aabb { min: glam::Vec3A::NEG_INFINITY, max: glam::Vec3A::INFINITY };

/// Somebody who looks at lists of primitives.
pub(crate) struct Visitor<'v> {
    /// What may still be looked at: damaged bytes may list everything in every cell.
    rest: usize,
    leaf: &'v mut dyn FnMut(&[u32]),
}

impl<'v> Visitor<'v> {
    /// Somebody who looks at no more than so many words.
    pub(crate) fn new(words: usize, leaf: &'v mut dyn FnMut(&[u32])) -> Self {
        Self { rest: words, leaf }
    }

    /// Shows a list; `false` if that was enough.
    pub(crate) fn list(&mut self, ids: &[u32]) -> bool {
        self.spend(ids.len()) && {
            (self.leaf)(ids);
            true
        }
    }

    /// Pays for looking at words that lead to lists; `false` if that was enough.
    pub(crate) fn spend(&mut self, words: usize) -> bool {
        let rest = self.rest.checked_sub(words);
        self.rest = rest.unwrap_or(0);
        rest.is_some()
    }
}
