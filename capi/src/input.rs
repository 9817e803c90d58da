//! What a build or a question for sizes works on, once every pointer is checked.

use hgrid_core::{Config, Error, Grid, Region, TriangleMesh, sizes};

use crate::status::hgrid_status;
use crate::types::hgrid_report;

/// Everything that goes in.
#[derive(Debug)]
pub(crate) struct Input {
    pub(crate) mesh: TriangleMesh<'static>,
    pub(crate) config: Config,
    pub(crate) index: &'static mut [u8],
    pub(crate) scratch: &'static mut [u8],
}

impl Input {
    /// Asks how much memory a build takes and notes the answer.
    pub(crate) fn measure(self, report: &mut hgrid_report) -> Result<(), hgrid_status> {
        let answer = sizes(&self.mesh, &self.config, self.scratch)
            .map_err(|error| report.note_error(error))?;
        report.note_sizes(&answer);
        Ok(())
    }

    /// Builds, and notes what was built or what was missing.
    pub(crate) fn build(self, report: &mut hgrid_report) -> Result<Grid<'static>, hgrid_status> {
        let Self { mesh, config, index, scratch } = self;
        match Grid::build(mesh, &config, index, scratch) {
            Ok(grid) => {
                report.note_grid(&grid);
                Ok(grid)
            }
            Err(error) => {
                // The error knows one region's need; the caller wants to bring both at once.
                if let Error::OutOfMemory { region, .. } = error {
                    if let Ok(enough) = sizes(&mesh, &config, &mut []) {
                        report.note_sizes(&enough);
                    }
                    report.is_exact = (region == Region::Index).into();
                }
                Err(report.note_error(error))
            }
        }
    }
}
