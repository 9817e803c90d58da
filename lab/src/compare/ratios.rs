//! hgrid divided by a peer: the numbers that decide whether it is worth its place.
//!
//! Less than one is better in every row. Runs whose answers are off take no part.
//!
//! Every repetition has a ratio of its own; the median of these is shown. A machine that others slow
//! down for a while slows down both sides of it, where medians of the times may come from different
//! whiles.

use serde::Serialize;

use super::numbers::{Run, SystemNumbers};
use super::peers::Peer;
use super::system::Mode;
use super::workloads::Workload;
use crate::measure::median;

/// One number of hgrid against one of a peer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ratio {
    /// What is compared.
    pub what: &'static str,
    /// The method and mode of hgrid.
    pub hgrid: String,
    /// Its number: seconds, the median; or bytes for each triangle.
    pub value: f64,
    /// The peer and its mode.
    pub peer: String,
    /// Its number.
    pub peer_value: f64,
    /// The first divided by the second in each repetition: the median.
    pub ratio: f64,
    /// The least of these.
    pub least: f64,
    /// The most.
    pub most: f64,
}

/// A number and whose it is.
#[derive(Debug)]
struct Entry<'a> {
    system: &'a SystemNumbers,
    mode: Option<Mode>,
    value: f64,
    /// The numbers of the repetitions; a single one where all have the same.
    samples: Vec<f64>,
}

impl Entry<'_> {
    fn name(&self) -> String {
        let mode = self.mode.map(|mode| format!(", {}", mode.name())).unwrap_or_default();
        format!("{}{mode}", self.system.system)
    }

    /// Another number of the same system.
    fn with(&self, value: fn(&SystemNumbers) -> f64) -> Self {
        let value = value(self.system);
        Self { system: self.system, mode: None, value, samples: vec![value] }
    }
}

impl Ratio {
    /// All that the systems of a scene allow.
    #[must_use]
    pub fn all(systems: &[SystemNumbers]) -> Vec<Self> {
        let (peers, hgrid): (Vec<_>, Vec<_>) = systems.iter().partition(|system| system.is_peer);
        let of = |peer: Peer| -> Vec<_> {
            peers.iter().copied().filter(|system| system.system == peer.name()).collect()
        };
        let (low, medium) = (of(Peer::EmbreeLow), of(Peer::EmbreeMedium));
        let fastest = [&hgrid, &peers].map(|systems| least(systems, time_to_image));
        let bytes =
            |value| fastest.each_ref().map(|entry| entry.as_ref().map(|entry| entry.with(value)));
        let primary = |system| best(system, Workload::Primary);
        let single_primary = |system| single(system, Workload::Primary);
        let random = |system| best(system, Workload::Random);
        let single_random = |system| single(system, Workload::Random);
        let index = bytes(SystemNumbers::index_bytes_per_triangle);
        let peak = bytes(SystemNumbers::peak_bytes_per_triangle);
        let rows = [
            ("time to image / best peer", fastest),
            ("index bytes per triangle of these", index),
            ("peak bytes per triangle of these", peak),
            (
                "coherent render / Embree MEDIUM, best",
                [least(&hgrid, primary), least(&medium, primary)],
            ),
            (
                "single-ray primary / Embree MEDIUM, rtcIntersect1",
                [least(&hgrid, single_primary), least(&medium, single_primary)],
            ),
            (
                "incoherent rays / Embree LOW, rtcIntersect1",
                [least(&hgrid, random), least(&low, single_random)],
            ),
        ];
        rows.into_iter()
            .filter_map(|(what, [ours, theirs])| Self::new(what, &ours?, &theirs?))
            .collect()
    }

    fn new(what: &'static str, ours: &Entry<'_>, theirs: &Entry<'_>) -> Option<Self> {
        let samples = ours.samples.iter().zip(&theirs.samples);
        let mut ratios: Vec<_> = samples.map(|(ours, theirs)| ours / theirs).collect();
        ratios.sort_by(f64::total_cmp);
        let (&least, &most) = ratios.first().zip(ratios.last())?;
        let (hgrid, peer) = (ours.name(), theirs.name());
        ratios.iter().all(|ratio| ratio.is_finite()).then_some(Self {
            what,
            hgrid,
            value: ours.value,
            peer,
            peer_value: theirs.value,
            ratio: median(&ratios),
            least,
            most,
        })
    }
}

fn time_to_image(system: &SystemNumbers) -> Option<Entry<'_>> {
    let run = system.best(Workload::Primary)?;
    let samples = system.build_samples.iter().zip(&run.samples).map(|(build, run)| build + run);
    let (mode, value) = (Some(run.mode), system.time_to_image()?);
    Some(Entry { system, mode, value, samples: samples.collect() })
}

fn best(system: &SystemNumbers, workload: Workload) -> Option<Entry<'_>> {
    system.best(workload).map(|run| of_run(system, run))
}

fn single(system: &SystemNumbers, workload: Workload) -> Option<Entry<'_>> {
    let run = system.run(workload, Mode::Single).filter(|run| !run.is_off());
    run.map(|run| of_run(system, run))
}

fn of_run<'a>(system: &'a SystemNumbers, run: &Run) -> Entry<'a> {
    Entry { system, mode: Some(run.mode), value: run.seconds, samples: run.samples.clone() }
}

/// The least value of all systems that have one.
fn least<'a>(
    systems: &[&'a SystemNumbers],
    value: impl Fn(&'a SystemNumbers) -> Option<Entry<'a>>,
) -> Option<Entry<'a>> {
    let values = systems.iter().filter_map(|system| value(system));
    values.min_by(|a, b| a.value.total_cmp(&b.value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(
        name: &str,
        is_peer: bool,
        build: f64,
        primary: &[(Mode, f64, u64)],
    ) -> SystemNumbers {
        let run = |&(mode, seconds, differing): &(Mode, f64, u64)| Run {
            workload: Workload::Primary,
            mode,
            seconds,
            samples: vec![seconds],
            page_faults: None,
            rays: 1000,
            hits: 500,
            differing,
        };
        SystemNumbers {
            system: name.to_owned(),
            is_peer,
            build_seconds: build,
            build_samples: vec![build],
            build_page_faults: None,
            triangles: 100,
            index_bytes: if is_peer { 8000 } else { 1000 },
            peak_bytes: 10_000,
            runs: primary.iter().map(run).collect(),
        }
    }

    #[test]
    fn repetitions_are_compared_with_each_other() {
        // A machine that is twice as slow in the second one, and three times for the peer in the third.
        let with = |name, is_peer, builds: [f64; 3], renders: [f64; 3]| {
            let primary = [(Mode::Single, median(&renders), 0)];
            let mut system = system(name, is_peer, median(&builds), &primary);
            system.build_samples = builds.to_vec();
            system.runs[0].samples = renders.to_vec();
            system
        };
        let systems = [
            with("brick", false, [1.0, 2.0, 1.0], [2.0, 4.0, 2.0]),
            with("embree-low", true, [2.0, 4.0, 6.0], [2.0, 4.0, 6.0]),
        ];
        let ratios = Ratio::all(&systems);
        let Ratio { value, peer_value, ratio, least, most, .. } = ratios[0];
        assert_eq!([value, peer_value].map(f64::to_bits), [3.0f64, 8.0].map(f64::to_bits));
        let expected = [0.25, 0.75, 0.75];
        assert_eq!([least, ratio, most].map(f64::to_bits), expected.map(f64::to_bits));
    }

    #[test]
    fn the_best_of_each_side_meet() {
        let systems = [
            system("one-level", false, 1.0, &[(Mode::Single, 3.0, 0)]),
            system("fixed", false, 2.0, &[(Mode::Single, 2.5, 0), (Mode::Coherent, 1.0, 0)]),
            system("embree-medium", true, 5.0, &[(Mode::Single, 2.0, 1), (Mode::Coherent, 1.0, 0)]),
            system("tinybvh2", true, 1.0, &[(Mode::Single, 0.1, 900)]),
        ];
        let ratios = Ratio::all(&systems);
        let of = |words: &str| ratios.iter().find(|ratio| ratio.what.contains(words));
        let image = of("time to image").unwrap();
        assert_eq!((&*image.hgrid, &*image.peer), ("fixed, coherent", "embree-medium, coherent"));
        assert!((image.ratio - 0.5).abs() < 1e-9);
        assert!((of("index bytes").unwrap().ratio - 0.125).abs() < 1e-9);
        assert!((of("coherent").unwrap().ratio - 1.0).abs() < 1e-9);
        assert!((of("single-ray").unwrap().ratio - 1.25).abs() < 1e-9);
        assert!(of("incoherent").is_none());
        assert!(Ratio::all(&systems[..2]).is_empty());
    }
}
