//! Work cut into tasks that the caller runs, on threads of the caller's if it has any.
//!
//! Every task owns the data that it changes. The thread that runs a task takes it out of its slot: a second run finds
//! the slot empty, and a task that was never run is still there at the end. [`Shared`] holds words that all
//! tasks write, no two of them the same word.
//!
//! Work is not cut on targets without atomic operations, nor, to save flash, on microcontrollers.

use core::ops::Range;
#[cfg(target_has_atomic = "32")]
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

#[cfg(target_has_atomic = "32")]
use try_lock::TryLock;
#[cfg(target_has_atomic = "32")]
use zerocopy::{FromBytes, IntoBytes};

use crate::control::Control;
use crate::error::Error;
#[cfg(target_has_atomic = "32")]
use crate::invariant::OrBug;
use crate::simd::IS_SMALL;

/// The content of a task's slot.
#[cfg(target_has_atomic = "32")]
enum State<T, R> {
    /// There is no such task, it is being run, or its result was taken.
    Nothing,
    Task(T),
    Result(R),
}

/// Tasks that work is cut into, at most.
pub(crate) const MOST: usize =
    if IS_SMALL || cfg!(not(target_has_atomic = "32")) { 1 } else { Control::MAX_TASKS as usize };

/// The number of tasks that work is cut into. More than `most` would be too small to pay for a thread.
#[expect(clippy::cast_possible_truncation, reason = "MAX_TASKS at most")]
pub(crate) fn task_count(parallel: &Control<'_>, most: usize) -> u32 {
    let most = u32::try_from(most).unwrap_or(u32::MAX);
    parallel.tasks.min(most).clamp(1, MOST as u32)
}

/// Returns the share of a task, if `things` elements are divided evenly among `tasks` tasks.
#[expect(clippy::cast_possible_truncation, reason = "no more than there are things")]
pub(crate) fn share(things: usize, task: usize, tasks: usize) -> Range<usize> {
    let end =
        |of: usize| (things as u64 * of as u64).checked_div(tasks as u64).unwrap_or(0) as usize;
    end(task)..end(task + 1)
}

/// Takes the first elements of a slice.
#[expect(clippy::mut_mut, reason = "the slice becomes the rest of itself")]
pub(crate) fn take<'w, T>(rest: &mut &'w mut [T], count: usize) -> &'w mut [T] {
    debug_assert!(count <= rest.len(), "too few elements for a task");
    take_up_to(rest, count)
}

/// Takes the first elements of a slice, or all there are: a build may have less room for ids and nodes than it counts.
#[expect(clippy::mut_mut, reason = "the slice becomes the rest of itself")]
pub(crate) fn take_up_to<'w, T>(rest: &mut &'w mut [T], count: usize) -> &'w mut [T] {
    let count = count.min(rest.len());
    let (first, behind) = core::mem::take(rest).split_at_mut(count);
    *rest = behind;
    first
}

/// Runs tasks and hands their results to `take`, in the order of the tasks. After an error of `take` it gets no more of
/// them, and that error is returned.
///
/// If the caller's loop does not run every task once, `take` gets the results that there are, and the error is
/// [`Error::InvalidParallelFor`]. A single task is not handed to the loop.
#[inline(always)]
pub(crate) fn run<T: Send, R: Send>(
    parallel: &Control<'_>,
    mut tasks: impl ExactSizeIterator<Item = T>,
    work: impl Fn(T) -> R + Sync,
    mut take: impl FnMut(R) -> Result<(), Error>,
) -> Result<(), Error> {
    if MOST == 1 || tasks.len() < 2 {
        return tasks.next().map_or(Ok(()), |task| take(work(task)));
    }
    run_several(parallel, tasks, work, take)
}

/// [`run`] for several tasks. Out of line: the slots take stack only where it is called.
#[cfg(target_has_atomic = "32")]
#[inline(never)]
pub(crate) fn run_several<T: Send, R: Send>(
    parallel: &Control<'_>,
    mut tasks: impl Iterator<Item = T>,
    work: impl Fn(T) -> R + Sync,
    mut take: impl FnMut(R) -> Result<(), Error>,
) -> Result<(), Error> {
    // A loop: array functions write the code of a slot out for each of them.
    let mut slots = [const { Slot::new(State::Nothing) }; MOST];
    let mut count = 0;
    for (slot, task) in slots.iter_mut().zip(&mut tasks) {
        *slot = Slot::new(State::Task(task));
        count += 1;
    }
    debug_assert!(tasks.next().is_none(), "more tasks than slots");
    let is_broken = AtomicBool::new(false);
    let step = |index: u32| {
        let slot = slots.get(index as usize);
        let state = slot.and_then(|slot| slot.replace(State::Nothing)).unwrap_or(State::Nothing);
        match (state, slot) {
            (State::Task(task), Some(slot)) => {
                let result = work(task);
                // If the caller runs the task again meanwhile, that run finds the slot empty and sets `is_broken`.
                if slot.replace(State::Result(result)).is_none() {
                    is_broken.store(true, Ordering::Relaxed);
                }
            }
            _ => is_broken.store(true, Ordering::Relaxed),
        }
    };
    (parallel.run)(count, &step);
    let mut outcome = Ok(());
    for slot in slots.iter().take(count as usize) {
        match slot.replace(State::Nothing) {
            Some(State::Result(result)) => outcome = outcome.and_then(|()| take(result)),
            _ => is_broken.store(true, Ordering::Relaxed),
        }
    }
    if is_broken.into_inner() { Err(Error::InvalidParallelFor) } else { outcome }
}

/// Runs the only task: work is not cut.
#[cfg(not(target_has_atomic = "32"))]
pub(crate) fn run_several<T, R>(
    _: &Control<'_>,
    tasks: impl Iterator<Item = T>,
    work: impl Fn(T) -> R,
    take: impl FnMut(R) -> Result<(), Error>,
) -> Result<(), Error> {
    tasks.map(work).try_for_each(take)
}

/// A place from which one of several threads takes something.
#[cfg(target_has_atomic = "32")]
struct Slot<T>(TryLock<T>);

#[cfg(target_has_atomic = "32")]
impl<T> Slot<T> {
    const fn new(value: T) -> Self {
        Self(TryLock::new(value))
    }

    /// Swaps the value; `None` if another thread holds the lock, which only a second run of the same task can do.
    fn replace(&self, value: T) -> Option<T> {
        Some(core::mem::replace(&mut *self.0.try_lock()?, value))
    }
}

/// Words that several tasks write, no two of them the same.
#[cfg(target_has_atomic = "32")]
#[derive(Clone, Copy)]
pub(crate) struct Shared<'w>(&'w [AtomicU32]);

#[cfg(target_has_atomic = "32")]
impl<'w> Shared<'w> {
    pub(crate) fn new(words: &'w mut [u32]) -> Self {
        let words = <[AtomicU32]>::mut_from_bytes(words.as_mut_bytes()).ok();
        Self(words.or_bug("words are not aligned").map_or(&[], |words| words))
    }

    /// Writes words at a place; none if they do not fit.
    #[inline(always)]
    pub(crate) fn set<const N: usize>(&self, at: usize, words: [u32; N]) {
        // Slice once: a slice from `at` on and one of its start take two comparisons.
        let end = at.checked_add(N);
        let slots = end.and_then(|end| self.0.get(at..end)).or_bug("no task has such a word");
        for (slot, word) in slots.into_iter().flatten().zip(words) {
            slot.store(word, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    #[test]
    fn the_number_of_tasks_is_clamped() {
        let count = |tasks, most| task_count(&Control { tasks, ..Control::SERIAL }, most) as usize;
        assert_eq!([count(0, 9), count(9, 0), count(1, 9)], [1; 3]);
        assert_eq!([count(9, 3), count(3, 9)], [3.min(MOST); 2]);
        assert_eq!([count(65, 99), count(u32::MAX, usize::MAX)], [MOST; 2]);
    }

    /// Runs three tasks by a loop, and takes the results up to an error at one of them.
    fn taken(
        calls: impl Fn(u32, &dyn Fn(u32)),
        error_at: Option<u32>,
    ) -> (Vec<u32>, Result<(), Error>) {
        let mut results = Vec::new();
        let run_all = |count: u32, task: &(dyn Fn(u32) + Sync)| calls(count, &task);
        let control = Control { tasks: 3, run: &run_all, progress: None };
        let outcome = run(
            &control,
            [1, 2, 3].into_iter(),
            |task| 10 * task,
            |result| {
                results.push(result);
                if error_at == Some(result) { Err(Error::MeshMismatch) } else { Ok(()) }
            },
        );
        (results, outcome)
    }

    #[test]
    fn the_first_error_is_returned_and_ends_the_results() {
        if MOST < 3 {
            return;
        }
        let forwards = |count, task: &dyn Fn(u32)| (0..count).for_each(task);
        assert_eq!(taken(forwards, None), (Vec::from([10, 20, 30]), Ok(())));
        for (at, expected) in [(10, &[10][..]), (20, &[10, 20]), (30, &[10, 20, 30])] {
            let (results, outcome) = taken(forwards, Some(at));
            assert_eq!((&results[..], outcome), (expected, Err(Error::MeshMismatch)));
        }
    }

    #[test]
    fn a_loop_that_does_not_run_each_task_once_is_found_out() {
        if MOST < 3 {
            return;
        }
        for calls in [&[0, 1][..], &[], &[0, 2, 1, 1], &[0, 1, 2, 3], &[u32::MAX, 0, 1, 2]] {
            let (_, outcome) = taken(|_, task| calls.iter().for_each(|&at| task(at)), None);
            assert_eq!(outcome, Err(Error::InvalidParallelFor), "{calls:?}");
        }
        let backwards = taken(|count, task| (0..count).rev().for_each(task), None);
        assert_eq!(backwards, (Vec::from([10, 20, 30]), Ok(())));
    }
}
