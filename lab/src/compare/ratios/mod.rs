//! Numbers of hgrid divided by those of a peer.
//!
//! Below one, hgrid is better, in every row. Runs with wrong answers are left out. All rows show the same
//! method of hgrid: the default one in either quality, or the first if that is not measured. A row shows a peer
//! in its fastest mode, unless it names a mode. Every comparison of builds has two rows: the first build and the
//! rebuild. A row with a best peer is left out if Embree took part, but not in a way that is best there.

mod entry;

use hgrid_core::Method;
use serde::Serialize;

use super::grid::HIGH;
use super::mode::Mode;
use super::numbers::{Kind, SystemNumbers};
use super::peers::Peer;
use super::workloads::Workload;
use crate::measure::median;
use entry::Entry;

/// One number of hgrid against one of a peer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ratio {
    /// The quantity that is compared.
    pub what: String,
    /// The method and mode of hgrid.
    pub hgrid: String,
    /// Median seconds of hgrid, or its bytes for each triangle, instance or sphere.
    pub value: f64,
    /// The peer and its mode.
    pub peer: String,
    /// The peer's number.
    pub peer_value: f64,
    /// The median over the repetitions of hgrid's number divided by the peer's.
    pub ratio: f64,
    /// The least ratio of a repetition.
    pub least: f64,
    /// The largest ratio of a repetition.
    pub most: f64,
}

impl Ratio {
    /// Returns all ratios for which the scene's systems have numbers.
    #[must_use]
    pub fn all(systems: &[SystemNumbers]) -> Vec<Self> {
        let (mut peers, methods): (Vec<_>, Vec<_>) =
            systems.iter().partition(|system| system.is_peer);
        // A structure that is wrong in all modes of a workload may have left out what is hard to build.
        peers.retain(|peer| peer.runs.iter().all(|run| peer.best(run.workload).is_some()));
        let is_default = |system: &&&SystemNumbers| is_default(&system.system);
        let Some(&hgrid) = methods.iter().find(is_default).or(methods.first()) else {
            return Vec::new();
        };
        let builds = builds(hgrid, &peers);
        let ratios = builds.into_iter().chain(queries(hgrid, &peers)).flatten();
        let names: Vec<_> = systems.iter().map(|system| &*system.system).collect();
        ratios.filter(|ratio| has_best_peer(&ratio.what, &names)).collect()
    }

    fn new(what: String, ours: &Entry<'_>, theirs: &Entry<'_>) -> Option<Self> {
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

/// Returns false for a row with a best peer if Embree took part, but not in a way that is best in such a row.
#[must_use]
pub fn has_best_peer(what: &str, systems: &[&str]) -> bool {
    let best = if what.contains("bytes") {
        [Peer::EmbreeCompact, Peer::EmbreeLowCompact]
    } else {
        [Peer::EmbreeLow, Peer::EmbreeDynamic]
    };
    let takes_part = best.iter().any(|peer| systems.contains(&peer.name()));
    let is_embree = systems.iter().any(|system| system.starts_with("embree"));
    takes_part || !is_embree || !what.contains("best peer")
}

/// Returns true if a system is the default method, in any quality.
fn is_default(system: &str) -> bool {
    system.strip_suffix(HIGH).unwrap_or(system) == Method::default().name()
}

/// Compares builds, first images and bytes.
fn builds(hgrid: &SystemNumbers, peers: &[&SystemNumbers]) -> Vec<Option<Ratio>> {
    let best = |kind| least(peers.iter().filter_map(|peer| Entry::image(peer, kind)));
    // Quality `high` is for scenes that are traced for long, as MEDIUM is.
    let (quality, builders) = if hgrid.system.ends_with(HIGH) {
        ("MEDIUM", [Peer::EmbreeMedium].as_slice())
    } else {
        ("LOW", [Peer::EmbreeLow, Peer::EmbreeDynamic].as_slice())
    };
    let build = |kind, words| {
        let entry = |&peer: &Peer| Some(Entry::build(find(peers, peer)?, kind));
        let theirs = least(builders.iter().filter_map(entry))?;
        let what = format!("build / {} {quality}: {words}", library(theirs.system));
        Ratio::new(what, &Entry::build(hgrid, kind), &theirs)
    };
    let image = |kind, words| {
        let what = format!("time to image / best peer: {words}");
        Ratio::new(what, &Entry::image(hgrid, kind)?, &best(kind)?)
    };
    let bytes = |what: &str, of: fn(&SystemNumbers) -> f64| {
        let entries = peers.iter().map(|peer| Entry::number(peer, of));
        let theirs = least(entries.filter(|entry| entry.value > 0.0))?;
        let what = format!("{what} per {} / best peer", hgrid.shown.item());
        Ratio::new(what, &Entry::number(hgrid, of), &theirs)
    };
    vec![
        build(Kind::Rebuild, REBUILD),
        build(Kind::First, FIRST),
        image(Kind::First, FIRST),
        image(Kind::Rebuild, REBUILD),
        bytes("index bytes", SystemNumbers::index_bytes_per_item),
        bytes("peak bytes", SystemNumbers::peak_bytes_per_item),
    ]
}

/// The two kinds of builds in words.
const FIRST: &str = "first in a new process";
const REBUILD: &str = "rebuild in memory that is kept";

/// Compares queries with Embree's.
fn queries(hgrid: &SystemNumbers, peers: &[&SystemNumbers]) -> Vec<Option<Ratio>> {
    let best = |peer: Peer, quality: &str, what: &str, workload| {
        let peer = find(peers, peer)?;
        let what = format!("{what} / {} {quality}, best mode", library(peer));
        Some((what, Entry::best(peer, workload)?))
    };
    let medium = |what: &str, workload| best(Peer::EmbreeMedium, "MEDIUM", what, workload);
    let single = || {
        let peer = find(peers, Peer::EmbreeMedium)?;
        let what = format!("single primary rays / {} MEDIUM, rtcIntersect1", library(peer));
        let entry = |system| Entry::run(system, Workload::Primary, Mode::Single);
        Ratio::new(what, &entry(hgrid)?, &entry(peer)?)
    };
    let coherent = || {
        let (what, theirs) = medium("coherent primary rays", Workload::Primary)?;
        Ratio::new(what, &Entry::in_mode(hgrid, Workload::Primary, Mode::Coherent)?, &theirs)
    };
    let secondary = |what, workload| {
        let (what, theirs) = medium(what, workload)?;
        Ratio::new(what, &Entry::best(hgrid, workload)?, &theirs)
    };
    let random = |peer, quality| {
        let (what, theirs) = best(peer, quality, "random rays in one call", Workload::Random)?;
        Ratio::new(what, &Entry::in_mode(hgrid, Workload::Random, Mode::Batch)?, &theirs)
    };
    let points = |what: &str, workload| {
        let peer = find(peers, Peer::EmbreeMedium)?;
        let what = format!("closest points, {what} / {} MEDIUM, rtcPointQuery", library(peer));
        Ratio::new(what, &Entry::best(hgrid, workload)?, &Entry::best(peer, workload)?)
    };
    vec![
        coherent(),
        single(),
        secondary("ambient occlusion", Workload::Ao),
        secondary("diffuse bounces", Workload::Bounce),
        random(Peer::EmbreeMedium, "MEDIUM"),
        random(Peer::EmbreeLow, "LOW"),
        points("near the surface", Workload::Near),
        points("far outside", Workload::Far),
    ]
}

/// Returns the entry with the least number.
fn least<'a>(entries: impl Iterator<Item = Entry<'a>>) -> Option<Entry<'a>> {
    entries.min_by(|a, b| a.value.total_cmp(&b.value))
}

/// Finds the numbers of a peer.
fn find<'a>(peers: &[&'a SystemNumbers], peer: Peer) -> Option<&'a SystemNumbers> {
    peers.iter().copied().find(|system| system.system == peer.name())
}

/// Returns the library and its version, or the name of the peer.
fn library(peer: &SystemNumbers) -> &str {
    peer.version.as_deref().unwrap_or(&peer.system)
}

#[cfg(test)]
mod tests {
    use super::super::mode::{Hint, Lanes};
    use super::super::numbers::{Build, Run};
    use super::super::shown::Shown;
    use super::*;

    /// Workload, mode, seconds in each repetition, rays that differ.
    type Timed<'a> = (Workload, Mode, &'a [f64], u64);

    /// Makes a system whose first builds take twice as long as its rebuilds.
    fn system(name: &str, rebuilds: &[f64], runs: &[Timed<'_>]) -> SystemNumbers {
        let run = |&(workload, mode, samples, differing): &Timed<'_>| Run {
            workload,
            mode,
            seconds: median(samples),
            samples: samples.to_vec(),
            page_faults: None,
            rays: 1000,
            hits: 500,
            differing,
        };
        let build = |factor: f64| {
            let samples: Vec<_> = rebuilds.iter().map(|seconds| factor * seconds).collect();
            Build { seconds: median(&samples), samples, page_faults: None }
        };
        let of_any_quality = name.strip_suffix(HIGH).unwrap_or(name);
        let is_peer = Method::ALL.iter().all(|method| method.name() != of_any_quality);
        SystemNumbers {
            system: name.to_owned(),
            version: name.starts_with("embree").then(|| "Embree 3.13.5".to_owned()),
            is_peer,
            first_build: build(2.0),
            rebuild: build(1.0),
            triangles: 100,
            shown: Shown::Mesh,
            index_bytes: match name {
                "tinybvh2" => 4000,
                _ if is_peer => 8000,
                _ => 1000,
            },
            peak_bytes: 10_000,
            runs: runs.iter().map(run).collect(),
        }
    }

    fn of<'a>(ratios: &'a [Ratio], words: &str) -> &'a Ratio {
        ratios.iter().find(|ratio| ratio.what.contains(words)).unwrap()
    }

    #[test]
    fn repetitions_are_compared_with_each_other() {
        // The second repetition is twice as slow; the third is three times as slow, for the peer only.
        let with = |name, builds: [f64; 3], renders: [f64; 3]| {
            system(name, &builds, &[(Workload::Primary, Mode::Single, &renders, 0)])
        };
        let systems = [
            with(Method::default().name(), [1.0, 2.0, 1.0], [2.0, 4.0, 2.0]),
            with("embree-low", [2.0, 4.0, 6.0], [2.0, 4.0, 6.0]),
        ];
        let ratios = Ratio::all(&systems);
        let Ratio { value, peer_value, ratio, least, most, .. } =
            *of(&ratios, "time to image / best peer: rebuild");
        assert_eq!([value, peer_value].map(f64::to_bits), [3.0f64, 8.0].map(f64::to_bits));
        let expected = [0.25, 0.75, 0.75];
        assert_eq!([least, ratio, most].map(f64::to_bits), expected.map(f64::to_bits));
        let first = of(&ratios, "time to image / best peer: first");
        assert!((first.ratio - 2.0 / 3.0).abs() < 1e-9, "{first:?}");
    }

    /// The first builds that exceed the repetitions count for images as they do for builds.
    #[test]
    fn all_first_builds_count_for_images() {
        let with = |name, builds: &[f64]| {
            let mut system = system(name, &[1.0], &[(Workload::Primary, Mode::Single, &[1.0], 0)]);
            system.first_build =
                Build { seconds: median(builds), samples: builds.to_vec(), page_faults: None };
            system
        };
        let systems = [
            with(Method::default().name(), &[9.0, 1.0, 1.0]),
            with("embree-low", &[3.0, 3.0, 3.0]),
        ];
        let ratios = Ratio::all(&systems);
        let image = of(&ratios, "time to image / best peer: first");
        let expected = [0.5, 0.5, 2.5].map(f64::to_bits);
        assert_eq!([image.least, image.ratio, image.most].map(f64::to_bits), expected);
    }

    #[test]
    fn the_default_method_meets_the_best_mode_of_each_peer() {
        let packet = Mode::Packet(Lanes::Eight, Hint::None);
        let stream = Mode::Stream(Hint::None);
        let systems = [
            system("one-level", &[0.1], &[(Workload::Primary, Mode::Single, &[0.5], 0)]),
            system(
                Method::default().name(),
                &[2.0],
                &[
                    (Workload::Primary, Mode::Single, &[2.5], 0),
                    (Workload::Primary, Mode::Coherent, &[1.0], 0),
                    (Workload::Ao, Mode::Batch, &[3.0], 0),
                    (Workload::Random, Mode::Single, &[5.0], 0),
                    (Workload::Random, Mode::Batch, &[6.0], 0),
                ],
            ),
            system(
                "embree-medium",
                &[5.0],
                &[
                    (Workload::Primary, Mode::Single, &[2.0], 1),
                    (Workload::Primary, packet, &[0.5], 0),
                    (Workload::Ao, Mode::Single, &[2.0], 0),
                    (Workload::Ao, stream, &[1.0], 0),
                    (Workload::Ao, packet, &[0.1], 2),
                ],
            ),
            system("embree-low", &[1.0], &[(Workload::Random, packet, &[4.0], 0)]),
            system("tinybvh2", &[1.0], &[(Workload::Primary, Mode::Single, &[0.1], 900)]),
        ];
        let ratios = Ratio::all(&systems);
        let is = |words: &str, which: [&str; 2], ratio: f64| {
            let found = of(&ratios, words);
            assert_eq!([&*found.hgrid, &*found.peer], which, "{words}");
            assert!((found.ratio - ratio).abs() < 1e-9, "{found:?}");
        };
        let name = Method::default().name();
        let with = |mode: &str| format!("{name}, {mode}");
        is("image / best peer: rebuild", [&with("coherent"), "embree-medium, packet8"], 3.0 / 5.5);
        is("image / best peer: first", [&with("coherent"), "embree-medium, packet8"], 5.0 / 10.5);
        is("build / Embree 3.13.5 LOW: rebuild", [name, "embree-low"], 2.0);
        assert!(ratios.iter().all(|ratio| !ratio.what.contains("bytes")));
        is("coherent primary", [&with("coherent"), "embree-medium, packet8"], 2.0);
        is("single primary", [&with("single"), "embree-medium, single"], 1.25);
        is("occlusion / Embree 3.13.5 MEDIUM", [&with("batch"), "embree-medium, stream"], 3.0);
        is("random", [&with("batch"), "embree-low, packet8"], 1.5);
        assert!(ratios.iter().all(|ratio| !ratio.what.contains("bounces")));
        assert!(Ratio::all(&systems[2..]).is_empty() && Ratio::all(&systems[..2]).is_empty());
    }

    #[test]
    fn a_peer_that_is_wrong_in_a_workload_has_no_rows() {
        let count = |differing: u64| {
            let with = |name, differing| {
                let ao: Timed<'_> = (Workload::Ao, Mode::Single, &[1.0], 0);
                let run: Timed<'_> = (Workload::Primary, Mode::Single, &[1.0], differing);
                system(name, &[1.0], &[ao, run])
            };
            let systems = [with(Method::default().name(), 0), with("embree-low", differing)];
            Ratio::all(&systems).len()
        };
        assert!(count(0) > 0);
        assert_eq!(count(900), 0);
    }

    #[test]
    fn a_best_peer_is_named_only_if_embree_took_part_at_its_best() {
        let name = Method::default().name();
        let all = |peers: &[&str]| {
            let names = core::iter::once(&name).chain(peers);
            let run: Timed<'_> = (Workload::Primary, Mode::Single, &[1.0], 0);
            let systems: Vec<_> = names.map(|name| system(name, &[1.0], &[run])).collect();
            Ratio::all(&systems)
        };
        let rows = |peers: &[&str]| {
            let ratios = all(peers);
            ["time to image / best peer", "bytes per triangle / best peer"]
                .map(|words| ratios.iter().filter(|ratio| ratio.what.contains(words)).count())
        };
        assert_eq!(rows(&["tinybvh2"]), [2, 2]);
        assert_eq!(rows(&["tinybvh2", "embree-medium"]), [0, 0]);
        assert_eq!(rows(&["embree-medium", "embree-dynamic"]), [2, 0]);
        assert_eq!(rows(&["embree-medium", "embree-compact"]), [0, 2]);
        assert_eq!(rows(&["embree-low", "embree-low-compact"]), [2, 2]);
        let ratios = all(&["embree-compact", "tinybvh2"]);
        let bytes = of(&ratios, "index bytes");
        assert_eq!((&*bytes.peer, bytes.ratio.to_bits()), ("tinybvh2", 0.25_f64.to_bits()));
    }

    #[test]
    fn a_tree_of_high_quality_is_compared_with_builds_of_medium() {
        let name = format!("{}{HIGH}", Method::default().name());
        let numbers =
            [("one-level", 9.0), (&*name, 2.0), ("embree-low", 1.0), ("embree-medium", 5.0)];
        let systems = numbers.map(|(name, seconds)| system(name, &[seconds], &[]));
        let ratios = Ratio::all(&systems);
        assert!((of(&ratios, "build / Embree 3.13.5 MEDIUM: rebuild").ratio - 0.4).abs() < 1e-9);
        assert!(ratios.iter().all(|ratio| !ratio.what.contains("LOW")));
    }
}
