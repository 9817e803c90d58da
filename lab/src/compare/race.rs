//! All systems on one scene, in turn.
//!
//! ```text
//! repetition 1:  build A, primary, ao, random with A | build B, ... | ...
//! repetition 2:  build A, primary, ao, random with A | build B, ... | ...    medians of each
//! ```
//!
//! As in [`measure`](crate::measure), taking turns lets a machine that others use disturb all
//! alike. A structure is dropped before the next is built. Arrays for answers and pixels are
//! written once before the clock runs, so that their pages are in nobody's time.

use core::hint::black_box;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use hgrid_core::Hit;

use super::agreement::{differing_hits, hits, unequal};
use super::input::Input;
use super::numbers::{Run, SystemNumbers};
use super::process::page_faults;
use super::system::{Bytes, Mode, System, Tracer};
use super::workloads::{Rays, Workload};
use crate::measure::median;
use crate::progress::Progress;
use crate::shade::{Rgb, Shader};
use crate::tiles::TILE_RAYS;

/// How often, and how many random rays.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Repetitions that times are medians of.
    pub repeat: u32,
    /// Rays between random points.
    pub random_rays: usize,
}

impl Plan {
    /// 2^20 random rays, as many as a picture of 1024 x 1024 has.
    #[must_use]
    pub const fn new(repeat: u32) -> Self {
        Self { repeat, random_rays: 1 << 20 }
    }
}

/// Builds and traces with every system.
///
/// # Errors
/// If a system cannot be built, or an answer of hgrid is not exactly that of another method.
pub fn race(
    input: &Input,
    rays: &Rays,
    systems: &[Box<dyn System>],
    repeat: u32,
    progress: &mut Progress,
) -> Result<Vec<SystemNumbers>> {
    let mut stage = Stage::new(input, rays)?;
    let mut records: Vec<_> = systems.iter().map(|system| Record::new(system.as_ref())).collect();
    for repetition in 1..=repeat {
        for (system, record) in systems.iter().zip(&mut records) {
            let name = system.name();
            progress.set_message(&format!("{name}, {repetition} of {repeat}"));
            stage
                .turn(system.as_ref(), record, [repetition == 1, repetition == repeat])
                .with_context(|| format!("cannot measure {name}"))?;
            progress.advance(1);
        }
    }
    let triangles = input.indices().len();
    Ok(records.into_iter().map(|record| record.numbers(rays, triangles)).collect())
}

/// Samples of a system.
struct Record {
    name: String,
    is_peer: bool,
    build: Samples,
    bytes: Bytes,
    runs: Vec<RunRecord>,
}

/// Samples of one way to trace one workload.
struct RunRecord {
    workload: Workload,
    mode: Mode,
    samples: Samples,
    hits: u64,
    differing: u64,
}

/// Times and page faults.
#[derive(Default)]
struct Samples {
    seconds: Vec<f64>,
    faults: Vec<u64>,
}

impl Samples {
    fn faults(&self) -> Option<u64> {
        let mut faults = self.faults.clone();
        faults.sort_unstable();
        faults.get(faults.len() / 2).copied()
    }
}

/// A clock and a counter of page faults.
struct Watch {
    faults: Option<u64>,
    start: Instant,
}

impl Watch {
    fn start() -> Self {
        Self { faults: page_faults(), start: Instant::now() }
    }

    fn stop(self, samples: &mut Samples) {
        samples.seconds.push(self.start.elapsed().as_secs_f64());
        let faults = self.faults.zip(page_faults());
        samples.faults.extend(faults.map(|(before, after)| after.saturating_sub(before)));
    }
}

impl Record {
    fn new(system: &dyn System) -> Self {
        let runs = Workload::ALL.into_iter().flat_map(|workload| {
            system.modes(workload).iter().map(move |&mode| RunRecord {
                workload,
                mode,
                samples: Samples::default(),
                hits: 0,
                differing: 0,
            })
        });
        Self {
            name: system.name(),
            is_peer: system.is_peer(),
            build: Samples::default(),
            bytes: Bytes { index: 0, peak: 0 },
            runs: runs.collect(),
        }
    }

    fn numbers(self, rays: &Rays, triangles: usize) -> SystemNumbers {
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
            is_peer: self.is_peer,
            build_seconds: median(&self.build.seconds),
            build_page_faults: self.build.faults(),
            build_samples: self.build.seconds,
            triangles: triangles as u64,
            index_bytes: self.bytes.index as u64,
            peak_bytes: self.bytes.peak as u64,
            runs: runs.collect(),
        }
    }
}

/// What all systems share.
struct Stage<'a> {
    input: &'a Input,
    rays: &'a Rays,
    shader: Shader<'a>,
    pixels: Vec<Rgb>,
    hits: Vec<Hit>,
    occluded: Vec<bool>,
}

impl<'a> Stage<'a> {
    fn new(input: &'a Input, rays: &'a Rays) -> Result<Self> {
        let shader = Shader::new(input.mesh()?, &rays.tiles.camera);
        let pixels = rays.primary_hits.len();
        Ok(Self {
            input,
            rays,
            shader,
            // Not zero: zeros may come as pages that nobody has touched.
            pixels: vec![[1; 3]; pixels],
            hits: vec![Hit::MISS; pixels.max(rays.random.len())],
            occluded: vec![true; rays.ao.len()],
        })
    }

    /// One build and one run of each kind.
    fn turn(
        &mut self,
        system: &dyn System,
        record: &mut Record,
        [is_first, is_last]: [bool; 2],
    ) -> Result<()> {
        let input = self.input;
        let Record { build, bytes, runs, is_peer, .. } = record;
        let before = heap_before();
        let mut watch = Some(Watch::start());
        system.build(input, &mut |tracer| {
            if let Some(watch) = watch.take() {
                watch.stop(build);
            }
            let heap = is_last.then(|| heap_since(before));
            for run in &mut *runs {
                self.trace(tracer, run);
                if is_first {
                    self.check(tracer, run, *is_peer);
                    let RunRecord { workload, mode, differing, .. } = *run;
                    let (workload, mode) = (workload.name(), mode.name());
                    ensure!(
                        *is_peer || differing == 0,
                        "{differing} {workload} rays, traced as {mode}, differ from those of the \
                         default method: please report this scene"
                    );
                }
            }
            if let Some(heap) = heap {
                *bytes = tracer.bytes()?.unwrap_or(heap);
            }
            Ok(())
        })
    }

    /// One timed run.
    fn trace(&mut self, tracer: &dyn Tracer, run: &mut RunRecord) {
        let Self { rays, shader, pixels, hits, occluded, .. } = self;
        let watch = Watch::start();
        match run.workload {
            Workload::Primary => {
                let mut hits = [Hit::MISS; TILE_RAYS];
                rays.tiles.fill(pixels, |rays, colors| {
                    let hits = &mut hits[..rays.len()];
                    tracer.intersect(run.mode, rays, hits);
                    shader.diffuse(rays, hits, colors);
                });
                black_box(&*pixels);
            }
            Workload::Ao => tracer.occluded(run.mode, &rays.ao, occluded),
            Workload::Random => {
                tracer.intersect(run.mode, &rays.random, &mut hits[..rays.random.len()]);
            }
        }
        watch.stop(&mut run.samples);
    }

    /// Compares the answers, those of hgrid to the last bit. Primary rays are traced again, because
    /// only their colours are kept.
    fn check(&mut self, tracer: &dyn Tracer, run: &mut RunRecord, is_peer: bool) {
        let Self { rays, hits: found, occluded, .. } = self;
        let expected = match run.workload {
            Workload::Primary => {
                let found = &mut found[..rays.primary_hits.len()];
                rays.tiles.fill(found, |rays, hits| tracer.intersect(run.mode, rays, hits));
                &rays.primary_hits
            }
            Workload::Ao => {
                run.hits = occluded.iter().map(|&is| u64::from(is)).sum();
                run.differing = unequal(&rays.ao_occluded, occluded);
                return;
            }
            Workload::Random => &rays.random_hits,
        };
        let found = &found[..expected.len()];
        run.hits = hits(found);
        run.differing = if is_peer {
            differing_hits(expected, found, rays.diagonal)
        } else {
            unequal(expected, found)
        };
    }
}

/// Bytes on the heap before a build.
fn heap_before() -> usize {
    #[cfg(feature = "peers")]
    return super::heap::start_peak();
    #[cfg(not(feature = "peers"))]
    0
}

/// Bytes that a build has put on the heap since.
fn heap_since(before: usize) -> Bytes {
    #[cfg(feature = "peers")]
    return super::heap::since(before);
    #[cfg(not(feature = "peers"))]
    Bytes { index: 0, peak: before }
}

#[cfg(test)]
mod tests {
    use hgrid_core::Ray;

    use super::*;
    use crate::camera::{Camera, Up, View};
    use crate::compare::methods;
    use crate::compare::system::{Use, each};
    use crate::scene::Scene;
    use crate::tiles::Tiles;

    fn numbers(systems: &[Box<dyn System>]) -> Result<Vec<SystemNumbers>> {
        let scene = Scene::load("procedural:knot:2000").unwrap();
        let bounds = scene.bounds().unwrap();
        let camera = Camera::framing(bounds, View::ThreeQuarter, Up::Y);
        let input = Input::new(scene);
        let rays = Rays::new(&input, bounds, Tiles { camera, size: 40 }, 1000).unwrap();
        race(&input, &rays, systems, 3, &mut Progress::new("", 0))
    }

    /// A structure that sees nothing.
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

        fn occluded(&self, _: Mode, rays: &[Ray], occluded: &mut [bool]) {
            each(rays, occluded, |_| false);
        }
    }

    #[test]
    fn all_methods_agree_and_have_all_numbers() {
        let systems = methods(&[]);
        let all = numbers(&systems).unwrap();
        assert_eq!(all.len(), systems.len());
        for numbers in all {
            assert_eq!(numbers.build_samples.len(), 3);
            assert!(numbers.index_bytes > 0 && numbers.peak_bytes >= numbers.index_bytes);
            assert!(numbers.runs.len() >= Workload::ALL.len());
            for run in &numbers.runs {
                assert_eq!((run.samples.len(), run.differing), (3, 0));
                assert!(run.seconds > 0.0 && run.hits > 0 && run.hits < run.rays, "{run:?}");
            }
        }
    }

    #[test]
    fn a_peer_that_sees_nothing_is_marked_and_hgrid_may_not_be_blind() {
        let blind = numbers(&[Box::new(Blind { is_peer: true })]).unwrap();
        assert!(blind[0].runs.iter().all(|run| run.is_off() && run.hits == 0));
        let error = numbers(&[Box::new(Blind { is_peer: false })]).unwrap_err();
        assert!(format!("{error:#}").contains("primary rays"), "{error:#}");
    }
}
