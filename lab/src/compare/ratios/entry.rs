//! A number of a system, with its samples.
//!
//! Every repetition has a ratio of its own; the table shows their median. Load on the machine slows down both
//! sides of such a ratio alike. Medians of times may come from different repetitions.

use super::super::mode::Mode;
use super::super::numbers::{Kind, Run, SystemNumbers};
use super::super::workloads::Workload;

/// A number with its system and mode.
#[derive(Debug)]
pub(super) struct Entry<'a> {
    pub(super) system: &'a SystemNumbers,
    mode: Option<Mode>,
    pub(super) value: f64,
    /// The samples of the repetitions, or a single one for a number that does not vary.
    pub(super) samples: Vec<f64>,
}

impl<'a> Entry<'a> {
    /// Makes an entry of a number that does not vary.
    pub(super) fn number(system: &'a SystemNumbers, of: fn(&SystemNumbers) -> f64) -> Self {
        let value = of(system);
        Self { system, mode: None, value, samples: vec![value] }
    }

    /// Makes the entry of a build.
    pub(super) fn build(system: &'a SystemNumbers, kind: Kind) -> Self {
        let build = system.build(kind);
        Self { system, mode: None, value: build.seconds, samples: build.samples.clone() }
    }

    /// Makes the entry of a build and the fastest primary rays.
    pub(super) fn image(system: &'a SystemNumbers, kind: Kind) -> Option<Self> {
        let run = system.best(Workload::Primary)?;
        let builds = system.build(kind).samples.iter();
        // First builds may outnumber the repetitions: the last run stands beside the further ones.
        let runs = run.samples.iter().chain(core::iter::repeat(run.samples.last()?));
        let samples = builds.zip(runs).map(|(build, run)| build + run).collect();
        Some(Self { system, mode: Some(run.mode), value: system.time_to_image(kind)?, samples })
    }

    /// Makes the entry of a workload's fastest mode.
    pub(super) fn best(system: &'a SystemNumbers, workload: Workload) -> Option<Self> {
        system.best(workload).map(|run| Self::of(system, run))
    }

    /// Makes the entry of a workload in a mode.
    pub(super) fn run(system: &'a SystemNumbers, workload: Workload, mode: Mode) -> Option<Self> {
        let run = system.run(workload, mode).filter(|run| !run.is_off());
        run.map(|run| Self::of(system, run))
    }

    /// Makes the entry of a workload in a mode, or ray by ray if the system lacks it.
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

    /// Returns the names of the system and its mode.
    pub(super) fn name(&self) -> String {
        let mode = self.mode.map(|mode| format!(", {}", mode.name())).unwrap_or_default();
        format!("{}{mode}", self.system.system)
    }
}
