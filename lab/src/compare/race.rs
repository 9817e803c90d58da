//! All systems on one scene, in turn.
//!
//! ```text
//! a turn:        first build in a new process | build, rebuild, primary, ao, bounce, random, near, far
//! repetition 1:  turn of A | turn of B | ...
//! repetition 2:  turn of A | turn of B | ...                             medians of each
//! ```
//!
//! As in [`measure`](crate::measure), systems take turns, so that load on the machine disturbs all alike. A
//! structure is dropped before the next one is built. Arrays for answers and pixels are written once before
//! the clock runs, so that no time includes their page faults.

use core::cell::Cell;
use std::ffi::OsStr;

use anyhow::{Context as _, Result, ensure};

use super::first::{FirstBuild, FirstBuilds};
use super::input::Input;
use super::numbers::SystemNumbers;
use super::samples::{Record, RunRecord, Watch};
use super::shown::Shown;
use super::stage::Stage;
use super::system::{Bytes, System};
use super::workloads::{Amount, Rays, Workload};
use crate::camera::Up;
use crate::progress::Progress;

/// The least number of first builds of each system.
const FIRST_BUILDS: u32 = 3;

/// The plan of a race: the workloads, their amounts, and the repetitions.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Repetitions that times are medians of.
    pub repeat: u32,
    /// The workloads, in the order in which they run.
    pub workloads: Vec<Workload>,
    /// The amount of queries of each workload.
    pub amount: Amount,
    /// The content of each scene.
    pub shown: Shown,
    /// The function that builds for the first time.
    pub first: fn(&OsStr, Shown, Option<Up>, &dyn System) -> Result<FirstBuild>,
}

/// Builds and traces with every system.
///
/// # Errors
/// If a system cannot be built, or an answer of hgrid is not exactly that of another method.
pub fn race(
    input: &Input,
    rays: &Rays,
    systems: &[Box<dyn System>],
    plan: &Plan,
    first: &FirstBuilds<'_>,
    progress: &mut Progress,
) -> Result<Vec<SystemNumbers>> {
    let Plan { repeat, ref workloads, .. } = *plan;
    let mut stage = Stage::new(input, rays)?;
    let shown = input.shown();
    let records = systems.iter().map(|system| Record::new(system.as_ref(), workloads, shown));
    let mut records: Vec<_> = records.collect();
    for repetition in 1..=repeat {
        for (system, record) in systems.iter().zip(&mut records) {
            let name = system.name();
            progress.set_message(&format!("{name}, {repetition} of {repeat}"));
            let [is_first, is_last] = [repetition == 1, repetition == repeat];
            // The last repetition adds the builds that are missing from `FIRST_BUILDS`.
            let builds = if is_last { FIRST_BUILDS.saturating_sub(repeat) + 1 } else { 1 };
            for _ in 0..builds {
                let FirstBuild { seconds, page_faults } = first(system.as_ref())
                    .with_context(|| format!("cannot build with {name} for the first time"))?;
                record.first_build.add(seconds, page_faults);
            }
            turn(&mut stage, input, system.as_ref(), record, [is_first, is_last])
                .with_context(|| format!("cannot measure {name}"))?;
            progress.advance(1);
        }
    }
    Ok(records.into_iter().map(|record| record.numbers(rays, input)).collect())
}

/// Runs one rebuild, and each workload in each mode.
fn turn(
    stage: &mut Stage<'_>,
    input: &Input,
    system: &dyn System,
    record: &mut Record,
    [is_first, is_last]: [bool; 2],
) -> Result<()> {
    let Record { rebuild, bytes, runs, is_peer, .. } = record;
    let start = Cell::new(None);
    let mut begin = || start.set(Some((heap_before(), Watch::start())));
    system.rebuild(input, &mut begin, &mut |tracer| {
        let (before, watch) = start.take().context("a rebuild did not begin")?;
        let (seconds, faults) = watch.stop();
        rebuild.add(seconds, faults);
        let heap = heap_since(before);
        for run in &mut *runs {
            stage.trace(tracer, run);
            if is_first {
                stage.check(tracer, run, *is_peer);
                let RunRecord { workload, mode, differing, .. } = *run;
                let (workload, mode) = (workload.name(), mode.name());
                ensure!(
                    *is_peer || differing == 0,
                    "{differing} {workload} answers, asked as {mode}, differ from those of the \
                     default method: please report this scene"
                );
            }
        }
        if is_last {
            *bytes = tracer.bytes()?.unwrap_or(heap);
        }
        Ok(())
    })
}

/// Returns the bytes on the heap before a build, and starts a new peak.
fn heap_before() -> usize {
    #[cfg(feature = "embree")]
    return super::heap::start_peak();
    #[cfg(not(feature = "embree"))]
    0
}

/// Returns the bytes that a build has added to the heap since.
fn heap_since(before: usize) -> Bytes {
    #[cfg(feature = "embree")]
    return super::heap::since(before);
    #[cfg(not(feature = "embree"))]
    Bytes { index: 0, peak: before }
}

#[cfg(test)]
mod tests {
    use hgrid_core::{Hit, Ray};

    use super::*;
    use crate::camera::{Camera, Up, View};
    use crate::compare::methods;
    use crate::compare::mode::Mode;
    use crate::compare::system::{Tracer, Use, each};
    use crate::scene::Scene;
    use crate::tiles::Tiles;

    fn numbers(systems: &[Box<dyn System>], repeat: u32) -> Result<Vec<SystemNumbers>> {
        let scene = Scene::load("procedural:knot:2000").unwrap();
        let bounds = scene.bounds().unwrap();
        let camera = Camera::framing(bounds, View::ThreeQuarter, Up::Y);
        let input = Input::new(scene);
        let amount = Amount { random_rays: 1000, near_points: 100, far_points: 10 };
        let rays = Rays::new(&input, bounds, Tiles { camera, size: 40 }, amount).unwrap();
        let plan = Plan {
            repeat,
            workloads: Workload::ALL.to_vec(),
            amount,
            shown: Shown::Mesh,
            first: |_, _, _, _| Ok(FirstBuild { seconds: 1.0, page_faults: None }),
        };
        let first = |system: &dyn System| (plan.first)("".as_ref(), plan.shown, None, system);
        race(&input, &rays, systems, &plan, &first, &mut Progress::new("", 0))
    }

    /// A structure that misses everything.
    struct Blind {
        is_peer: bool,
    }

    impl System for Blind {
        fn name(&self) -> String {
            "blind".to_owned()
        }

        fn is_peer(&self) -> bool {
            self.is_peer
        }

        fn build(&self, _: &Input, then: &mut Use<'_>) -> Result<()> {
            then(self)
        }
    }

    impl Tracer for Blind {
        fn intersect(&self, _: Mode, rays: &[Ray], hits: &mut [Hit]) {
            each(rays, hits, |_| Hit::MISS);
        }

        fn occluded(&self, _: Mode, rays: &[Ray], occluded: &mut [u8]) {
            each(rays, occluded, |_| 0);
        }
    }

    #[test]
    fn all_methods_agree_and_have_all_numbers() {
        let systems = methods(&[]);
        let all = numbers(&systems, 3).unwrap();
        assert_eq!(all.len(), systems.len());
        for numbers in all {
            assert_eq!((numbers.first_build.samples.len(), numbers.rebuild.samples.len()), (3, 3));
            assert!(numbers.index_bytes > 0 && numbers.peak_bytes >= numbers.index_bytes);
            assert!(numbers.runs.len() >= 4);
            for run in &numbers.runs {
                assert_eq!((run.samples.len(), run.differing), (3, 0));
                let is_all = run.hits == run.rays;
                assert!(run.seconds > 0.0 && run.hits > 0, "{run:?}");
                assert_eq!(is_all, run.workload.asks_points(), "{run:?}");
            }
        }
    }

    #[test]
    fn a_peer_that_sees_nothing_is_marked_and_hgrid_may_not_be_blind() {
        let blind = numbers(&[Box::new(Blind { is_peer: true })], 1).unwrap();
        assert_eq!((blind[0].first_build.samples.len(), blind[0].rebuild.samples.len()), (3, 1));
        assert!(blind[0].runs.iter().all(|run| run.is_off() && run.hits == 0));
        let error = numbers(&[Box::new(Blind { is_peer: false })], 1).unwrap_err();
        assert!(format!("{error:#}").contains("primary answers"), "{error:#}");
    }
}
