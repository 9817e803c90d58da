//! The lists of a grid that a box meets: for questions that are no rays.

use crate::aabb::Aabb;

/// All that there is, in cells.
pub(crate) const EVERYWHERE: Aabb =
    Aabb { min: glam::Vec3A::NEG_INFINITY, max: glam::Vec3A::INFINITY };

/// A list of primitives: words with an id each, and perhaps something above it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ids<'l> {
    words: &'l [u32],
    /// The bits of an id.
    mask: u32,
}

impl Ids<'_> {
    pub(crate) const fn len(self) -> usize {
        self.words.len()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = u32> {
        self.words.iter().map(|word| word & self.mask)
    }
}

/// Somebody who looks at lists of primitives.
pub(crate) struct Visitor<'v> {
    /// What may still be looked at: damaged bytes may list everything in every cell.
    rest: usize,
    /// The bits of an id.
    mask: u32,
    leaf: &'v mut dyn FnMut(Ids<'_>),
}

impl<'v> Visitor<'v> {
    /// Somebody who looks at no more than so many words.
    pub(crate) fn new(words: usize, leaf: &'v mut dyn FnMut(Ids<'_>)) -> Self {
        Self { rest: words, mask: u32::MAX, leaf }
    }

    /// Shows a list; `false` if that was enough.
    pub(crate) fn list(&mut self, ids: &[u32]) -> bool {
        self.spend(ids.len()) && {
            (self.leaf)(Ids { words: ids, mask: self.mask });
            true
        }
    }

    /// Says which bits of the words of all lists are ids.
    pub(crate) const fn ids_have(&mut self, mask: u32) {
        self.mask = mask;
    }

    /// Pays for looking at words that lead to lists; `false` if that was enough.
    pub(crate) fn spend(&mut self, words: usize) -> bool {
        let rest = self.rest.checked_sub(words);
        self.rest = rest.unwrap_or(0);
        rest.is_some()
    }
}
