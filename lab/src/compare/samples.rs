//! Samples that are recorded while the systems take turns.

use std::time::Instant;

use super::input::Input;
use super::mode::Mode;
use super::numbers::{Build, Run, SystemNumbers};
use super::process::page_faults;
use super::shown::Shown;
use super::system::{Bytes, System};
use super::workloads::{Rays, Workload};
use crate::measure::median;

/// Samples of a system.
pub(super) struct Record {
    pub(super) name: String,
    pub(super) version: Option<String>,
    pub(super) is_peer: bool,
    pub(super) first_build: Samples,
    pub(super) rebuild: Samples,
    pub(super) bytes: Bytes,
    pub(super) runs: Vec<RunRecord>,
}

/// Samples of one way to trace one workload.
pub(super) struct RunRecord {
    pub(super) workload: Workload,
    pub(super) mode: Mode,
    pub(super) samples: Samples,
    pub(super) hits: u64,
    pub(super) differing: u64,
}

/// Times and page faults.
#[derive(Default)]
pub(super) struct Samples {
    seconds: Vec<f64>,
    faults: Vec<u64>,
}

impl Samples {
    /// Adds a time, and the page faults during it if they are known.
    pub(super) fn add(&mut self, seconds: f64, faults: Option<u64>) {
        self.seconds.push(seconds);
        self.faults.extend(faults);
    }

    /// Returns the median of the page faults: of an even number, the mean of the middle two, rounded up.
    fn faults(&self) -> Option<u64> {
        let mut faults = self.faults.clone();
        faults.sort_unstable();
        let middle = |at: usize| faults.get(at).copied();
        let (low, high) = (middle(faults.len().checked_sub(1)? / 2)?, middle(faults.len() / 2)?);
        Some(low + (high - low).div_ceil(2))
    }

    fn build(self) -> Build {
        let (seconds, page_faults) = (median(&self.seconds), self.faults());
        Build { seconds, samples: self.seconds, page_faults }
    }
}

/// A clock and a counter of page faults.
pub(super) struct Watch {
    faults: Option<u64>,
    start: Instant,
}

impl Watch {
    pub(super) fn start() -> Self {
        Self { faults: page_faults(), start: Instant::now() }
    }

    /// Returns the seconds and the page faults since the start.
    pub(super) fn stop(&self) -> (f64, Option<u64>) {
        let seconds = self.start.elapsed().as_secs_f64();
        let faults = self.faults.zip(page_faults());
        (seconds, faults.map(|(before, after)| after.saturating_sub(before)))
    }
}

impl Record {
    /// Makes an empty record for the workloads in every mode of the system.
    pub(super) fn new(system: &dyn System, workloads: &[Workload], shown: Shown) -> Self {
        let runs = workloads.iter().flat_map(|&workload| {
            system.modes(workload, shown).iter().map(move |&mode| RunRecord {
                workload,
                mode,
                samples: Samples::default(),
                hits: 0,
                differing: 0,
            })
        });
        Self {
            name: system.name(),
            version: system.version(),
            is_peer: system.is_peer(),
            first_build: Samples::default(),
            rebuild: Samples::default(),
            bytes: Bytes { index: 0, peak: 0 },
            runs: runs.collect(),
        }
    }

    /// Returns the medians and the samples.
    pub(super) fn numbers(self, rays: &Rays, input: &Input) -> SystemNumbers {
        let runs = self.runs.into_iter().map(|run| Run {
            workload: run.workload,
            mode: run.mode,
            seconds: median(&run.samples.seconds),
            page_faults: run.samples.faults(),
            samples: run.samples.seconds,
            rays: rays.count(run.workload) as u64,
            hits: run.hits,
            differing: run.differing,
        });
        SystemNumbers {
            system: self.name,
            version: self.version,
            is_peer: self.is_peer,
            first_build: self.first_build.build(),
            rebuild: self.rebuild.build(),
            triangles: input.indices().len() as u64,
            shown: input.shown(),
            index_bytes: self.bytes.index as u64,
            peak_bytes: self.bytes.peak as u64,
            runs: runs.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_faults_are_medians() {
        for (faults, expected) in [
            (&[][..], None),
            (&[7], Some(7)),
            (&[900, 0, 900, 0], Some(450)),
            (&[3, 1, 2], Some(2)),
            (&[4, 1, 2, 1], Some(2)),
        ] {
            let mut samples = Samples::default();
            for &count in faults {
                samples.add(1.0, Some(count));
            }
            assert_eq!(samples.faults(), expected, "{faults:?}");
        }
    }
}
