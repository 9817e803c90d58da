//! The inputs of a build or a size query, after every pointer was checked, and the calls to core
//! with them.

use hgrid_core::{
    Config, Control, Error, Grid, Method, Region, Task, TriangleMesh, fit, sizes_with,
};

use crate::raw::Caller;
use crate::status::hgrid_status;
use crate::types::hgrid_report;

/// The checked input of a call.
#[derive(Debug)]
pub(crate) struct Input {
    pub(crate) mesh: TriangleMesh<'static>,
    pub(crate) config: Config,
    pub(crate) caller: Caller,
    pub(crate) index: &'static mut [u8],
    pub(crate) scratch: &'static mut [u8],
}

impl Input {
    /// Asks how much memory a build takes and notes the answer.
    pub(crate) fn measure(self, report: &mut hgrid_report) -> Result<(), hgrid_status> {
        let Self { mesh, config, caller, scratch, .. } = self;
        let answer = controlled(caller, |control| sizes_with(&mesh, &config, scratch, control));
        let answer = answer.map_err(|error| report.note_error(error))?;
        report.note_sizes(&answer);
        Ok(())
    }

    /// Looks for the finest grid that fits, and notes what it takes or what the coarsest one would.
    pub(crate) fn fit(
        self,
        index_bytes: usize,
        report: &mut hgrid_report,
    ) -> Result<Config, hgrid_status> {
        let Self { mesh, config, scratch, .. } = self;
        let fitted = fit(&mesh, &config, index_bytes, scratch);
        let (config, sizes) = fitted.map_err(|error| report.note_error(error))?;
        report.note_sizes(&sizes);
        Ok(config)
    }

    /// Builds, and notes what was built or what was missing.
    pub(crate) fn build(self, report: &mut hgrid_report) -> Result<Grid<'static>, hgrid_status> {
        let Self { mesh, config, caller, index, scratch } = self;
        let built =
            controlled(caller, |control| Grid::build_with(mesh, &config, index, scratch, control));
        match built {
            Ok(grid) => {
                report.note_grid(&grid);
                Ok(grid)
            }
            Err(error) => {
                // The error knows one region's need; the caller wants to bring both at once.
                if let Error::OutOfMemory { region, .. } = error {
                    let enough = controlled(Caller::NOBODY, |control| {
                        sizes_with(&mesh, &config, &mut [], control)
                    });
                    if let Ok(enough) = enough {
                        report.note_sizes(&enough);
                    }
                    // Without room for bins or ids, trees name a bound.
                    let is_bound = config.method() == Method::Bvh;
                    let is_exact = region == Region::Index && !is_bound;
                    report.is_exact = is_exact.into();
                }
                Err(report.note_error(error))
            }
        }
    }
}

/// Calls `visit` with a control that calls the caller's functions.
pub(crate) fn controlled<T>(caller: Caller, visit: impl FnOnce(&Control<'_>) -> T) -> T {
    let run = |count: u32, task: &Task<'_>| caller.run(count, task);
    let progress = |done: f32| caller.progress(done);
    let progress: Option<&dyn Fn(f32) -> bool> =
        if caller.is_watching() { Some(&progress) } else { None };
    visit(&Control { tasks: caller.tasks, run: &run, progress })
}
