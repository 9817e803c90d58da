//! Threads for parallel work.

use anyhow::{Context as _, Result};
use hgrid_core::Control;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// A number of threads, or only the calling one.
#[derive(Debug)]
pub struct Threads {
    pool: Option<ThreadPool>,
    count: u32,
}

impl Threads {
    /// Starts threads; for a count of one it starts none.
    ///
    /// # Errors
    /// If the system cannot start the threads.
    pub fn new(count: u32) -> Result<Self> {
        let pool = match usize::try_from(count) {
            Ok(0 | 1) => None,
            count => {
                let builder = ThreadPoolBuilder::new().num_threads(count?);
                Some(builder.build().context("cannot start threads")?)
            }
        };
        Ok(Self { pool, count: count.max(1) })
    }

    /// Returns the number of threads.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// Calls `build` with a control that runs tasks on these threads.
    pub fn parallel<R>(&self, build: impl FnOnce(&Control<'_>) -> R) -> R {
        let run = |count: u32, task: &(dyn Fn(u32) + Sync)| self.each(count, task);
        build(&Control { tasks: self.count, run: &run, progress: None })
    }

    /// Waits until all of them are awake. A processor that was asleep may need milliseconds, especially in a
    /// virtual machine: as long as a build.
    pub fn wake(&self) {
        if let Some(pool) = &self.pool {
            pool.broadcast(|_| ());
        }
    }

    /// Runs a task for every number below a count.
    pub fn each(&self, count: u32, task: impl Fn(u32) + Sync) {
        let task = &task;
        match &self.pool {
            Some(pool) => {
                pool.install(|| (0..count).into_par_iter().with_max_len(1).for_each(task));
            }
            None => (0..count).for_each(task),
        }
    }
}

#[cfg(test)]
mod tests {
    use core::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    #[test]
    fn every_task_is_done_once() {
        for count in [0, 1, 2, 5] {
            let threads = Threads::new(count).unwrap();
            assert_eq!(threads.count(), count.max(1));
            threads.wake();
            let done: [_; 100] = core::array::from_fn(|_| AtomicU32::new(0));
            threads.each(100, |index| {
                done[index as usize].fetch_add(1, Ordering::Relaxed);
            });
            assert!(done.iter().all(|done| done.load(Ordering::Relaxed) == 1));
            assert_eq!(threads.parallel(|parallel| parallel.tasks), count.max(1));
        }
    }
}
