//! Accesses that find something by an invariant of the code around them, whatever a caller passes.

pub(crate) trait OrBug {
    /// Itself. A debug build panics where nothing was found, and says which invariant is broken: to go on would
    /// make a wrong grid in silence. Never for bytes or callbacks that come from a caller.
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
