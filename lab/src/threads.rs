//! Threads for the work that can use them.

use anyhow::{Context as _, Result};
use hgrid_core::Control;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// A number of threads, or only the one that calls.
#[derive(Debug)]
pub struct Threads {
    pool: Option<ThreadPool>,
    count: u32,
}

impl Threads {
    /// Starts threads; one is there already.
    ///
    /// # Errors
    /// If the system gives no threads.
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

    /// Shows them to a build.
    pub fn parallel<R>(&self, build: impl FnOnce(&Control<'_>) -> R) -> R {
        let run = |count: u32, task: &(dyn Fn(u32) + Sync)| self.each(count, task);
        build(&Control { tasks: self.count, run: &run, progress: None })
    }

    /// Returns when all of them are awake. A processor that has slept for a while may take
    /// milliseconds, on a virtual machine above all: as long as a build.
    pub fn wake(&self) {
        if let Some(pool) = &self.pool {
            pool.broadcast(|_| ());
        }
    }

    /// Does a task for every number below a count.
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
