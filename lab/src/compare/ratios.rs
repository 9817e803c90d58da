//! hgrid divided by a peer: the numbers that decide whether it is worth its place.
//!
//! Less than one is better in every row. Runs whose answers are off take no part.

use serde::Serialize;

use super::numbers::SystemNumbers;
use super::peers::Peer;
use super::system::Mode;
use super::workloads::Workload;

/// One number of hgrid against one of a peer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ratio {
    /// What is compared.
    pub what: &'static str,
    /// The method and mode of hgrid.
    pub hgrid: String,
    /// Its number: seconds, or bytes for each triangle.
    pub value: f64,
    /// The peer and its mode.
    pub peer: String,
    /// Its number.
    pub peer_value: f64,
    /// The first divided by the second.
    pub ratio: f64,
}

/// A number and whose it is.
#[derive(Debug, Clone, Copy)]
struct Entry<'a> {
    system: &'a SystemNumbers,
    mode: Option<Mode>,
    value: f64,
}

impl Entry<'_> {
    fn name(&self) -> String {
        let mode = self.mode.map(|mode| format!(", {}", mode.name())).unwrap_or_default();
        format!("{}{mode}", self.system.system)
    }

    /// Another number of the same system.
    fn with(self, value: fn(&SystemNumbers) -> f64) -> Self {
        Self { mode: None, value: value(self.system), ..self }
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
        let bytes = |value| fastest.map(|entry| entry.map(|entry| entry.with(value)));
        let primary = |system| best(system, Workload::Primary);
        let single_primary = |system| single(system, Workload::Primary);
        let random = |system| best(system, Workload::Random);
        let single_random = |system| single(system, Workload::Random);
        let rows = [
            ("time to image / best peer", fastest),
            ("index bytes per triangle of these", bytes(SystemNumbers::index_bytes_per_triangle)),
            ("peak bytes per triangle of these", bytes(SystemNumbers::peak_bytes_per_triangle)),
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
            .filter_map(|(what, [ours, theirs])| Self::new(what, ours?, theirs?))
            .collect()
    }

    fn new(what: &'static str, ours: Entry<'_>, theirs: Entry<'_>) -> Option<Self> {
        let (value, peer_value) = (ours.value, theirs.value);
        let ratio = value / peer_value;
        let (hgrid, peer) = (ours.name(), theirs.name());
        ratio.is_finite().then_some(Self { what, hgrid, value, peer, peer_value, ratio })
    }
}

fn time_to_image(system: &SystemNumbers) -> Option<Entry<'_>> {
    let mode = Some(system.best(Workload::Primary)?.mode);
    Some(Entry { system, mode, value: system.time_to_image()? })
}

fn best(system: &SystemNumbers, workload: Workload) -> Option<Entry<'_>> {
    let run = system.best(workload)?;
    Some(Entry { system, mode: Some(run.mode), value: run.seconds })
}

fn single(system: &SystemNumbers, workload: Workload) -> Option<Entry<'_>> {
    let run = system.run(workload, Mode::Single).filter(|run| !run.is_off())?;
    Some(Entry { system, mode: Some(run.mode), value: run.seconds })
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
    use super::super::numbers::Run;
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
