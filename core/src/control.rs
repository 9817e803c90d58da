//! The caller's part in a running build: threads, and whether to go on.

use core::cell::Cell;
use core::fmt;

use crate::error::Error;

/// A function that a build hands to the caller's loop. It runs the task with the given number.
pub type Task<'t> = dyn Fn(u32) + Sync + 't;

/// The control of a build: the number of tasks, the threads, and the progress callback.
/// `Control::default()` is one task and no progress callback.
///
/// The grid has the same bits with any control.
///
/// ```
/// use hgrid_core::{Block, Config, Control, Grid, Method, TriangleMesh, sizes_with};
/// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
/// let config = Config::new(Method::Bvh);
///
/// let run = |count: u32, task: &(dyn Fn(u32) + Sync)| {
///     std::thread::scope(|scope| {
///         for index in 0..count {
///             scope.spawn(move || task(index));
///         }
///     });
/// };
/// let progress = |done: f32| {
///     eprint!("\r{:3.0} %", 100.0 * done);
///     true
/// };
/// let control = Control { tasks: 4, run: &run, progress: Some(&progress) };
/// let sizes = sizes_with(&mesh, &config, &mut [], &control)?;
/// let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
/// let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
/// let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
/// let grid = Grid::build_with(mesh, &config, index, scratch, &control)?;
/// assert_eq!(grid.mesh().triangle_count(), 1);
/// # Ok::<(), hgrid_core::Error>(())
/// ```
#[derive(Clone, Copy)]
pub struct Control<'c> {
    /// The most tasks that run at once, from 1 to [`MAX_TASKS`](Self::MAX_TASKS): other numbers are clamped. With
    /// [`Quality::Fast`](crate::Quality::Fast) each takes scratch of its own.
    pub tasks: u32,
    /// Calls the task with every number below the count exactly once, in any order, and
    /// returns when all calls have returned. A build calls it with counts from 2 to
    /// [`tasks`](Self::tasks), several times or, where the mesh or the scratch is small, never.
    ///
    /// On targets without atomic operations, and on microcontrollers, it is never called.
    pub run: &'c dyn for<'t> Fn(u32, &'t Task<'t>),
    /// Receives the part of the build that is done, from 0 to 1, and returns whether to go on. It is called on the
    /// thread that builds, with parts that grow from call to call. The last call of a build that succeeds has exactly
    /// 1, and its answer is ignored. After any other answer `false` the build ends with [`Error::Cancelled`], at the
    /// latest at the end of a pass over the mesh.
    ///
    /// Calls are not spread evenly: there is none while several tasks run, or while a tree of quality `high` gets its
    /// top nodes. Each may take most of the time of a build.
    ///
    /// [`sizes_with`](crate::sizes_with) does not call it.
    pub progress: Option<&'c dyn Fn(f32) -> bool>,
}

impl fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control")
            .field("tasks", &self.tasks)
            .field("progress", &self.progress.is_some())
            .finish_non_exhaustive()
    }
}

impl Default for Control<'_> {
    fn default() -> Self {
        Self::SERIAL
    }
}

impl Control<'_> {
    /// The most tasks at once.
    pub const MAX_TASKS: u32 = 64;

    /// One task at a time, without a progress callback.
    pub(crate) const SERIAL: Control<'static> = Control {
        tasks: 1,
        run: &|count, task| {
            for index in 0..count {
                task(index);
            }
        },
        progress: None,
    };
}

/// Places of a loop between two reports of progress: a millisecond or two.
pub(crate) const OFTEN: u32 = 1 << 16;

/// Smaller steps than this are not reported.
const LEAST: f32 = 1.0 / 256.0;

/// The progress of a build, and the callback that receives it.
pub(crate) struct Watch<'c> {
    progress: Option<&'c dyn Fn(f32) -> bool>,
    done: Cell<f32>,
}

impl<'c> Watch<'c> {
    /// A watch without a callback.
    pub(crate) const fn none() -> Self {
        Self { progress: None, done: Cell::new(f32::NEG_INFINITY) }
    }

    pub(crate) const fn new(control: &Control<'c>) -> Self {
        Self { progress: control.progress, done: Cell::new(f32::NEG_INFINITY) }
    }

    /// Reports that this much is done; an error if the caller cancels.
    pub(crate) fn at(&self, done: f32) -> Result<(), Error> {
        let Some(progress) = self.progress else { return Ok(()) };
        // Leave 1 to `end`, which reports it once, however a loop rounds.
        if done >= 1.0 {
            return Ok(());
        }
        // Report only steps of at least LEAST. Progress never decreases, even if a build starts again with coarser
        // cells.
        if done >= self.done.get() + LEAST {
            self.done.set(done);
            if !progress(done) {
                return Err(Error::Cancelled);
            }
        }
        Ok(())
    }

    /// Reports the progress of a part of the build, at some places of its loop.
    #[inline(always)]
    pub(crate) fn step(&self, place: u32, count: u32, [from, to]: [f32; 2]) -> Result<(), Error> {
        if place.is_multiple_of(OFTEN) { self.between(place, count, [from, to]) } else { Ok(()) }
    }

    /// Reports the progress of a part of the build.
    #[expect(clippy::cast_precision_loss, reason = "a share")]
    pub(crate) fn between(
        &self,
        place: u32,
        count: u32,
        [from, to]: [f32; 2],
    ) -> Result<(), Error> {
        self.at(from + (to - from) * (place as f32 / count.max(1) as f32))
    }

    /// Reports that all is done.
    pub(crate) fn end(&self) {
        if let Some(progress) = self.progress {
            progress(1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;
    use core::cell::RefCell;

    use super::*;

    #[test]
    fn one_is_reported_once_and_at_the_end() {
        let seen = RefCell::new(Vec::new());
        let progress = |done: f32| {
            seen.borrow_mut().push(done);
            // A build whose last part is done cannot be cancelled.
            done < 1.0
        };
        let control = Control { progress: Some(&progress), ..Control::SERIAL };
        let watch = Watch::new(&control);
        // A part without places, and places up to the end and behind it.
        for (place, count, part) in
            [(0, 0, [0.25, 0.5]), (1, 2, [0.5, 1.0]), (2, 2, [0.5, 1.0]), (3, 2, [0.5, 1.0])]
        {
            assert_eq!(watch.between(place, count, part), Ok(()));
        }
        watch.end();
        assert_eq!(seen.into_inner(), [0.25, 0.75, 1.0]);
    }
}
