//! Every number of a comparison, with the machine and the settings.

use std::ffi::{OsStr, OsString};
use std::path::Path;

use anyhow::{Context as _, Error, Result, ensure};
use hgrid_core::INVALID_ID;
use serde::Serialize;

use super::agreement::is_off;
use super::input::Input;
use super::mode::Mode;
use super::process::target;
use super::race::{Plan, race};
use super::ratios::Ratio;
use super::shown::Shown;
use super::system::System;
use super::workloads::{Rays, Workload};
use super::{charts, tables};
use crate::cli::Picture;
use crate::field::Field;
use crate::machine::Machine;
use crate::measure::{SceneFacts, in_turn, ratio};
use crate::notices::tell;
use crate::progress::Progress;
use crate::render::unseen;
use crate::scene::Scene;
use crate::table::display_name;

/// All systems on all scenes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The origin of the numbers.
    pub machine: Machine,
    /// The architecture and the vectors that the program was compiled for.
    pub target: String,
    /// Pixels on each side of the pictures.
    pub size: u16,
    /// Builds and runs that times are medians of.
    pub repeats: u32,
    /// The scenes, in the order of the command line.
    pub scenes: Vec<SceneNumbers>,
}

/// All systems on one scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneNumbers {
    /// The scene.
    #[serde(flatten)]
    pub facts: SceneFacts,
    /// The content that the systems built over.
    #[serde(flatten)]
    pub shown: Shown,
    /// The methods of hgrid, then the peers.
    pub systems: Vec<SystemNumbers>,
    /// Numbers of hgrid divided by those of a peer.
    pub ratios: Vec<Ratio>,
}

/// One system on one scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SystemNumbers {
    /// The system's name.
    pub system: String,
    /// The library and its version, if known.
    pub version: Option<String>,
    /// True if it is not hgrid.
    pub is_peer: bool,
    /// The first build in a new process.
    pub first_build: Build,
    /// The build in memory that an earlier build has written.
    pub rebuild: Build,
    /// Triangles of the mesh.
    pub triangles: u64,
    /// The content of the scene.
    #[serde(flatten)]
    pub shown: Shown,
    /// Bytes that queries need, without the mesh. With instances they are also without the structure of the
    /// mesh; with spheres, without the spheres.
    pub index_bytes: u64,
    /// The most bytes during the build, likewise.
    pub peak_bytes: u64,
    /// The runs of every workload, in every mode of the system.
    pub runs: Vec<Run>,
}

/// A build: from the mesh to a structure that answers queries.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Build {
    /// The median.
    pub seconds: f64,
    /// The times that it is the median of: one for each repetition, and at least three of first builds.
    pub samples: Vec<f64>,
    /// Pages that were first touched during the build: the median.
    pub page_faults: Option<u64>,
}

/// One of the two builds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The first in a new process.
    First,
    /// A later one, in memory that the program has kept.
    Rebuild,
}

/// One way to trace one workload.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Run {
    /// The workload.
    pub workload: Workload,
    /// The mode.
    pub mode: Mode,
    /// The median.
    pub seconds: f64,
    /// The times that it is the median of, one for each repetition.
    pub samples: Vec<f64>,
    /// Pages that were first touched during the run: the median.
    pub page_faults: Option<u64>,
    /// Rays that were traced, or points that were queried.
    pub rays: u64,
    /// Rays that hit, or points with a surface in their radius.
    pub hits: u64,
    /// Rays or points whose answer differs from that of hgrid.
    pub differing: u64,
}

impl Run {
    /// Returns true if so many answers differ that the time means little.
    #[must_use]
    pub const fn is_off(&self) -> bool {
        is_off(self.differing, self.rays)
    }
}

impl SystemNumbers {
    /// Returns the run of a workload in a mode.
    #[must_use]
    pub fn run(&self, workload: Workload, mode: Mode) -> Option<&Run> {
        self.runs.iter().find(|run| run.workload == workload && run.mode == mode)
    }

    /// Returns the fastest run of a workload whose answers are right.
    #[must_use]
    pub fn best(&self, workload: Workload) -> Option<&Run> {
        let runs = self.runs.iter().filter(|run| run.workload == workload && !run.is_off());
        runs.min_by(|a, b| a.seconds.total_cmp(&b.seconds))
    }

    /// Returns the builds of a kind.
    #[must_use]
    pub const fn build(&self, kind: Kind) -> &Build {
        match kind {
            Kind::First => &self.first_build,
            Kind::Rebuild => &self.rebuild,
        }
    }

    /// Returns the time of a build and of the primary rays, from a mesh in memory to a picture. Instances and
    /// spheres are not shaded, so they have none.
    #[must_use]
    pub fn time_to_image(&self, kind: Kind) -> Option<f64> {
        let run = self.best(Workload::Primary).filter(|_| self.shown == Shown::Mesh)?;
        Some(self.build(kind).seconds + run.seconds)
    }

    /// The number of triangles, instances or spheres that the structure is built over.
    #[must_use]
    pub const fn items(&self) -> u64 {
        self.shown.items(self.triangles)
    }

    /// Returns the bytes kept for each triangle, instance or sphere.
    #[must_use]
    pub fn index_bytes_per_item(&self) -> f64 {
        ratio(self.index_bytes, self.items())
    }

    /// Returns the most bytes during the build, likewise.
    #[must_use]
    pub fn peak_bytes_per_item(&self) -> f64 {
        ratio(self.peak_bytes, self.items())
    }
}

impl Comparison {
    /// Runs the race on each scene in turn. Returns the numbers of those that can be measured, and the errors of the
    /// others and of `keep` as one, if there are any. Calls `keep` after each scene with the numbers so far.
    ///
    /// # Errors
    /// If no scene can be measured.
    pub fn measure(
        scenes: &[OsString],
        systems: &[Box<dyn System>],
        picture: &Picture,
        plan: &Plan,
        keep: impl Fn(&Self) -> Result<()>,
    ) -> Result<(Self, Option<Error>)> {
        let turns = scenes.len() as u64 * systems.len() as u64 * u64::from(plan.repeat);
        let mut progress = Progress::new("starting", turns);
        let (machine, target, size, repeats) =
            (Machine::here(), target(), picture.size, plan.repeat);
        let mut all = Self { machine, target, size, repeats, scenes: Vec::new() };
        let failed = in_turn(scenes, |spec| {
            progress.set_scope(&display_name(&spec.to_string_lossy()));
            progress.set_message("preparing");
            let numbers = SceneNumbers::measure(spec, systems, picture, plan, &mut progress)
                .with_context(|| format!("cannot compare on `{}`", spec.display()))?;
            all.scenes.push(numbers);
            keep(&all)
        });
        match failed {
            Some(error) if all.scenes.is_empty() => Err(error),
            _ => Ok((all, failed)),
        }
    }

    /// Returns aligned tables, notes about their numbers, and their origin.
    #[must_use]
    pub fn text(&self) -> String {
        tables::text(self)
    }

    /// Returns the same as Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        tables::markdown(self)
    }

    /// Draws the charts into a folder.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn draw(&self, folder: &Path) -> Result<()> {
        charts::draw(self, folder)
    }
}

impl SceneNumbers {
    fn measure(
        spec: &OsStr,
        systems: &[Box<dyn System>],
        picture: &Picture,
        plan: &Plan,
        progress: &mut Progress,
    ) -> Result<Self> {
        let mut scene = Scene::load(spec)?;
        ensure!(!scene.indices.is_empty(), "no triangles: nothing to measure");
        tell(&scene);
        let bounds = scene.whole_bounds().context("no vertex with finite coordinates")?;
        let facts = SceneFacts::of(&scene);
        let shown = plan.shown;
        let field = Field::over(&scene, shown.instances(), picture.up);
        if let Some(field) = &field {
            field.frame(&mut scene);
        }
        let bounds = field.as_ref().map_or(bounds, Field::bounds);
        let tiles = picture.tiles(&scene)?;
        let reason = unseen(picture, &scene, None);
        let input = Input::of(scene, shown, field.as_ref());
        let rays = Rays::new(&input, bounds, tiles, plan.amount)?;
        let is_seen = rays.primary_hits.iter().any(|hit| hit.primitive != INVALID_ID);
        let of_camera = [Workload::Primary, Workload::Ao, Workload::Bounce];
        let needs_hits = plan.workloads.iter().any(|workload| of_camera.contains(workload));
        ensure!(is_seen || !needs_hits, reason);
        let first = |system: &dyn System| (plan.first)(spec, shown, picture.up, system);
        let systems = race(&input, &rays, systems, plan, &first, progress)?;
        let ratios = Ratio::all(&systems);
        Ok(Self { facts, shown, systems, ratios })
    }
}
