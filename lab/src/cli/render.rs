//! The arguments of `hgrid render`.

use core::num::NonZero;
use std::ffi::OsString;
use std::path::PathBuf;
use std::thread;

use anyhow::{Result, ensure};
use clap::{Parser, ValueEnum};
use hgrid_core::{Config, Control, Method};

use super::values::{density, method_parser, picture_parser, thread_parser, whole};
use super::{DEFAULT_OUTPUT, DEFAULT_SCENE, Picture, Tuning};
use crate::heat::Counter;
use crate::light::Lights;

/// Samples of a pixel, and rays of ambient occlusion from each, of a picture by a tree.
const SAMPLES: u16 = 4;
const SKY_RAYS: u16 = 4;

/// The arguments of `hgrid render`.
#[derive(Debug, Parser)]
pub struct RenderArgs {
    /// A mesh file or procedural:NAME:TRIANGLES
    #[arg(default_value = DEFAULT_SCENE)]
    pub scene: OsString,
    /// The picture to write, as PNG
    #[arg(short, long, value_name = "FILE.png", default_value = DEFAULT_OUTPUT,
          value_parser = picture_parser())]
    pub output: PathBuf,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub picture: Picture,
    /// The quantity that the colours show
    #[arg(long, value_enum, default_value_t = Shading::Diffuse)]
    pub shading: Shading,
    /// Rays through each pixel, against jagged edges and noise, 1 to 1024 [default: 4; 1 for the four grids of the
    /// paper]
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true,
          value_parser = whole(1..=1024_u16))]
    samples: Option<u16>,
    /// Rays of ambient occlusion from each sample, 0 for none, at most 1024 [default: 16 divided by --samples, and at
    /// least 1; 0 for the four grids of the paper]
    #[arg(long, value_name = "RAYS", allow_negative_numbers = true,
          value_parser = whole(0..=1024_u16))]
    ao: Option<u16>,
    /// The lamp casts no shadows
    #[arg(long)]
    no_shadows: bool,
    /// For heat: the work that is shown [default: cost]
    #[arg(long, value_enum)]
    pub counter: Option<Counter>,
    /// For heat: the cost that is red, 1 or more, rounded up to a round number; give the same for pictures that are to
    /// be compared [default: what 99 of 100 rays take at most]
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, value_parser = whole(1..=u32::MAX))]
    pub heat_top: Option<u32>,
    /// The structure to build
    #[arg(long, value_parser = method_parser(), default_value = Method::default().name())]
    pub method: Method,
    /// Cells per triangle, for other methods than bvh, a number above 0 [default: the paper's for the method]
    #[arg(long, value_name = "CELLS", allow_negative_numbers = true, value_parser = density)]
    pub density: Option<f32>,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub tuning: Tuning,
    /// Threads that render and, for bvh, build, 1 to 64 [default: one for each core]
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, value_parser = thread_parser())]
    threads: Option<u32>,
    /// Print the numbers as a JSON object
    #[arg(long)]
    pub json: bool,
}

impl RenderArgs {
    /// Returns the configuration of the grid.
    #[must_use]
    pub fn config(&self) -> Config {
        self.tuning.config(self.method, self.density)
    }

    /// Refuses options that would have no effect.
    ///
    /// # Errors
    /// If there is one; the message names the option and its purpose.
    pub fn check(&self) -> Result<()> {
        ensure!(
            self.density.is_none() || self.config().parameters.density().is_some(),
            "--density is not for {}, which has none: name another --method, or leave it out",
            self.method.name()
        );
        self.picture.check()?;
        self.tuning.check("--method", &[self.method])?;
        let is_for = |option: &str, is_there: bool, shading: Shading, word: &str| {
            ensure!(
                !is_there || self.shading == shading,
                "{option} is for --shading {word}: leave one of them out"
            );
            Ok(())
        };
        is_for("--ao", self.ao.is_some(), Shading::Diffuse, "diffuse")?;
        is_for("--no-shadows", self.no_shadows, Shading::Diffuse, "diffuse")?;
        is_for("--counter", self.counter.is_some(), Shading::Heat, "heat")?;
        is_for("--heat-top", self.heat_top.is_some(), Shading::Heat, "heat")?;
        ensure!(
            self.samples.is_none() || self.shading != Shading::Heat,
            "--samples is not for --shading heat, which shows the work of one ray a pixel"
        );
        Ok(())
    }

    /// Returns true if meshes that stand more than once stay instances. Only diffuse pictures with bvh show
    /// them; otherwise they become triangles.
    #[must_use]
    pub fn takes_instances(&self) -> bool {
        self.method == Method::Bvh && self.shading == Shading::Diffuse
    }

    /// Rays through each pixel.
    #[must_use]
    pub fn samples(&self) -> u16 {
        let default = if self.method == Method::Bvh { SAMPLES } else { 1 };
        if self.shading == Shading::Heat { 1 } else { self.samples.unwrap_or(default) }
    }

    /// Returns the lights. By default a tree gets all of them, which takes it a few seconds. The four grids of the
    /// paper are slow for rays in all directions, and get shadows alone.
    #[must_use]
    pub fn lights(&self) -> Lights {
        if self.shading != Shading::Diffuse {
            return Lights::default();
        }
        let default = match self.method {
            Method::Bvh => (SAMPLES * SKY_RAYS).div_ceil(self.samples()),
            _ => 0,
        };
        Lights { has_shadows: !self.no_shadows, sky_rays: self.ao.unwrap_or(default) }
    }

    /// Threads that build and render.
    #[must_use]
    pub fn threads(&self) -> u32 {
        let cores = || thread::available_parallelism().map_or(1, NonZero::get);
        let most = Control::MAX_TASKS;
        self.threads.unwrap_or_else(|| u32::try_from(cores()).unwrap_or(most).min(most))
    }
}

/// The meaning of a picture's colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Shading {
    /// A grey solid under lamp and sky
    Diffuse,
    /// Surface normals: red to the right, green up, blue toward the viewer
    Normals,
    /// The work of each ray, from blue to red
    Heat,
}
