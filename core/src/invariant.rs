//! `or_bug` marks an option that is `None` only if a builder has a bug, and names the broken invariant.

/// An option that is never `None` where builders are right.
pub(crate) trait OrBug {
    /// Returns the option as it is. A debug build panics if it is `None`, and names the broken invariant: a release
    /// build goes on, with a wrong grid. Not for what a caller's bytes or callbacks decide.
    fn or_bug(self, broken: &str) -> Self;
}

impl<T> OrBug for Option<T> {
    #[inline(always)]
    #[track_caller]
    fn or_bug(self, broken: &str) -> Self {
        debug_assert!(self.is_some(), "{broken}");
        self
    }
}
