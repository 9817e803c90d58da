//! A bound on the work of a traversal. Damaged bytes may lead in circles, or list everything in every cell: a traversal
//! takes from its budget whatever it reads, and ends when the budget is used up.

/// Nodes and leaves that a traversal may still enter, or words that it may still read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Budget(usize);

impl Budget {
    pub(crate) const fn new(work: usize) -> Self {
        Self(work)
    }

    /// Takes work off. Returns false and takes nothing if less is left: the traversal must end then.
    #[inline(always)]
    #[must_use]
    pub(crate) const fn take(&mut self, work: usize) -> bool {
        let Some(rest) = self.0.checked_sub(work) else { return false };
        self.0 = rest;
        true
    }

    /// Returns true if all of it is used up.
    pub(crate) const fn is_used_up(self) -> bool {
        self.0 == 0
    }
}
