//! A loop over tasks as a caller may write it, right or wrong.

use arbitrary::Arbitrary;
use hgrid_core::Task;

/// A way to run the tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Arbitrary)]
pub(super) enum Loop {
    Forwards,
    Backwards,
    /// Runs one task a second time.
    Twice(u8),
    /// Leaves one task out.
    Not(u8),
    /// Runs a task with an index out of range.
    Beyond(u32),
}

impl Loop {
    /// Runs tasks.
    pub(super) fn run(self, count: u32, task: impl Fn(u32)) {
        let one = |which: u8| u32::from(which) % count.max(1);
        match self {
            Self::Forwards => (0..count).for_each(task),
            Self::Backwards => (0..count).rev().for_each(task),
            Self::Twice(which) => (0..count).chain([one(which)]).for_each(task),
            Self::Not(which) => (0..count).filter(|&i| i != one(which)).for_each(task),
            Self::Beyond(which) => (0..count).chain([which]).for_each(task),
        }
    }

    /// Returns the loop in the form that core takes.
    pub(super) fn for_core(self) -> impl for<'t> Fn(u32, &'t Task<'t>) {
        move |count, task| self.run(count, task)
    }

    /// Returns true if each task runs exactly once.
    pub(super) const fn is_right(self) -> bool {
        matches!(self, Self::Forwards | Self::Backwards)
    }
}
