//! What a build or a question for sizes works on, once every pointer is checked.

use hgrid_core::{
    Config, Error, Grid, Method, Parallel, Region, Task, TriangleMesh, sizes_parallel,
};

use crate::raw::Threads;
use crate::status::hgrid_status;
use crate::types::hgrid_report;

/// Everything that goes in.
#[derive(Debug)]
pub(crate) struct Input {
    pub(crate) mesh: TriangleMesh<'static>,
    pub(crate) config: Config,
    /// `None` for one task after the other.
    pub(crate) threads: Option<Threads>,
    pub(crate) index: &'static mut [u8],
    pub(crate) scratch: &'static mut [u8],
}

impl Input {
    /// Asks how much memory a build takes and notes the answer.
    pub(crate) fn measure(self, report: &mut hgrid_report) -> Result<(), hgrid_status> {
        let Self { mesh, config, threads, scratch, .. } = self;
        let answer =
            in_parallel(threads, |parallel| sizes_parallel(&mesh, &config, scratch, parallel));
        let answer = answer.map_err(|error| report.note_error(error))?;
        report.note_sizes(&answer);
        Ok(())
    }

    /// Builds, and notes what was built or what was missing.
    pub(crate) fn build(self, report: &mut hgrid_report) -> Result<Grid<'static>, hgrid_status> {
        let Self { mesh, config, threads, index, scratch } = self;
        let built = in_parallel(threads, |parallel| {
            Grid::build_parallel(mesh, &config, index, scratch, parallel)
        });
        match built {
            Ok(grid) => {
                report.note_grid(&grid);
                Ok(grid)
            }
            Err(error) => {
                // The error knows one region's need; the caller wants to bring both at once.
                if let Error::OutOfMemory { region, .. } = error {
                    let enough = in_parallel(None, |parallel| {
                        sizes_parallel(&mesh, &config, &mut [], parallel)
                    });
                    if let Ok(enough) = enough {
                        report.note_sizes(&enough);
                    }
                    // Without room for its bins, a brick grid names a bound like any other.
                    let is_exact = region == Region::Index && config.method != Method::Brick;
                    report.is_exact = is_exact.into();
                }
                Err(report.note_error(error))
            }
        }
    }
}

/// Shows `visit` how tasks are run.
fn in_parallel<T>(threads: Option<Threads>, visit: impl FnOnce(&Parallel<'_>) -> T) -> T {
    let tasks = threads.map_or(1, |threads| threads.tasks);
    let run = |count: u32, task: &Task<'_>| match threads {
        Some(threads) => threads.run(count, task),
        None => (0..count).for_each(task),
    };
    visit(&Parallel { tasks, run: &run })
}
