//! A number of a system, and its samples.
//!
//! Every repetition has a ratio of its own; the median of these is shown. A machine that others slow
//! down for a while slows down both sides of it, where medians of the times may come from different
//! whiles.

use super::super::mode::Mode;
use super::super::numbers::{Kind, Run, SystemNumbers};
use super::super::workloads::Workload;

/// A number and whose it is.
#[derive(Debug)]
pub(super) struct Entry<'a> {
    pub(super) system: &'a SystemNumbers,
    mode: Option<Mode>,
    pub(super) value: f64,
    /// The numbers of the repetitions; a single one where all have the same.
    pub(super) samples: Vec<f64>,
}

impl<'a> Entry<'a> {
    /// A number that all repetitions have.
    pub(super) fn number(system: &'a SystemNumbers, of: fn(&SystemNumbers) -> f64) -> Self {
        let value = of(system);
        Self { system, mode: None, value, samples: vec![value] }
    }

    /// A build.
    pub(super) fn build(system: &'a SystemNumbers, kind: Kind) -> Self {
        let build = system.build(kind);
        Self { system, mode: None, value: build.seconds, samples: build.samples.clone() }
    }

    /// A build and the fastest primary rays.
    pub(super) fn image(system: &'a SystemNumbers, kind: Kind) -> Option<Self> {
        let run = system.best(Workload::Primary)?;
        let builds = system.build(kind).samples.iter();
        let samples = builds.zip(&run.samples).map(|(build, run)| build + run).collect();
        Some(Self { system, mode: Some(run.mode), value: system.time_to_image(kind)?, samples })
    }

    /// The fastest mode of a workload.
    pub(super) fn best(system: &'a SystemNumbers, workload: Workload) -> Option<Self> {
        system.best(workload).map(|run| Self::of(system, run))
    }

    /// A workload in a mode.
    pub(super) fn run(system: &'a SystemNumbers, workload: Workload, mode: Mode) -> Option<Self> {
        let run = system.run(workload, mode).filter(|run| !run.is_off());
        run.map(|run| Self::of(system, run))
    }

    /// A workload in a mode, or ray by ray if the system has no such mode.
    pub(super) fn in_mode(
        system: &'a SystemNumbers,
        workload: Workload,
        mode: Mode,
    ) -> Option<Self> {
        Self::run(system, workload, mode).or_else(|| Self::run(system, workload, Mode::Single))
    }

    fn of(system: &'a SystemNumbers, run: &Run) -> Self {
        Self { system, mode: Some(run.mode), value: run.seconds, samples: run.samples.clone() }
    }

    /// The system and its mode.
    pub(super) fn name(&self) -> String {
        let mode = self.mode.map(|mode| format!(", {}", mode.name())).unwrap_or_default();
        format!("{}{mode}", self.system.system)
    }
}
