//! The words of the command line. What they do is in the other modules.

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};
use hgrid_core::Method;

use crate::camera::{Point, Up, View};

/// The picture that is written when nobody names one.
pub const DEFAULT_OUTPUT: &str = "hgrid.png";

/// The scene that is rendered when nobody names one.
pub const DEFAULT_SCENE: &str = "procedural:knot:500K";

const EXAMPLES: &str = "\
Examples:
  hgrid                                      the built-in scene, to hgrid.png
  hgrid render bunny.ply -o bunny.png        a mesh of yours, seen from the front
  hgrid render bunny.ply --shading heat      what each ray costs, from blue to red
  hgrid render bunny.ply --density 8         more cells: fewer tests, more steps, more memory
  hgrid render procedural:stage --view 40,15
  hgrid render stadium.ply --up z --view three-quarter
  hgrid render sponza.ply --eye 0,3,0 --target 10,3,0
  hgrid render bunny.ply --repeat 9 --json   medians, for programs";

const SCENES: &str = "\
Scenes:
  FILE.ply, FILE.obj
  procedural:knot[:TRIANGLES]     a closed, finely bumped surface, like a scan
  procedural:stage[:TRIANGLES]    the same on a floor eighty times its size
  procedural:soup[:TRIANGLES]     a cube full of small triangles
  TRIANGLES is a number like 5000, 20K or 3M, up to 100M

Views:
  front, back, left, right, top, bottom, three-quarter,
  or AZIMUTH,ELEVATION in degrees: 0,0 is the front, 90,0 the right, 0,90 the top.
  Without one, scenes are seen from the front and flat ones from above.";

/// Hashed grids for ray tracing: build, render, measure.
#[derive(Debug, Parser)]
#[command(name = "hgrid", version, after_help = EXAMPLES)]
pub struct Cli {
    /// What to do; without it, the built-in scene is rendered.
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// What the program can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Renders a scene with one thread and one ray per pixel, and prints what it took
    #[command(after_help = SCENES, after_long_help = [SCENES, EXAMPLES].join("\n\n"))]
    Render(RenderArgs),
}

/// What to render and how.
#[derive(Debug, Parser)]
pub struct RenderArgs {
    /// A mesh file or procedural:NAME:TRIANGLES
    #[arg(default_value = DEFAULT_SCENE)]
    pub scene: String,
    /// The picture to write, as PNG
    #[arg(short, long, value_name = "FILE", default_value = DEFAULT_OUTPUT)]
    pub output: PathBuf,
    /// Pixels on each side
    #[arg(long, value_name = "PIXELS", default_value_t = 1024,
          value_parser = clap::value_parser!(u16).range(1..=16_384))]
    pub size: u16,
    /// The structure to build
    #[arg(long, value_enum, default_value_t = MethodName::OneLevel)]
    pub method: MethodName,
    /// Cells per triangle [default: the paper's for the method]
    #[arg(long, value_name = "CELLS", allow_negative_numbers = true)]
    pub density: Option<f32>,
    /// From which side to look
    #[arg(long, allow_hyphen_values = true)]
    pub view: Option<View>,
    /// Look from this point instead, as X,Y,Z
    #[arg(long, value_name = "X,Y,Z", conflicts_with = "view", allow_hyphen_values = true)]
    pub eye: Option<Point>,
    /// Look at this point [default: the middle of the scene]
    #[arg(long, value_name = "X,Y,Z", requires = "eye", allow_hyphen_values = true)]
    pub target: Option<Point>,
    /// Which axis of the scene is up
    #[arg(long, value_enum, default_value_t = Up::Y)]
    pub up: Up,
    /// What the colours mean
    #[arg(long, value_enum, default_value_t = Shading::Diffuse)]
    pub shading: Shading,
    /// Build and render so many times and report the medians
    #[arg(long, value_name = "TIMES", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeat: u32,
    /// Print the figures as a JSON object
    #[arg(long)]
    pub json: bool,
}

/// A structure by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodName {
    /// One grid, its empty cells compressed by row displacement
    OneLevel,
}

impl MethodName {
    /// The structure that the name means.
    #[must_use]
    pub const fn method(self) -> Method {
        match self {
            Self::OneLevel => Method::OneLevel,
        }
    }

    /// The name as it is written.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::OneLevel => "one-level",
        }
    }
}

/// What the colours of a picture mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Shading {
    /// A grey solid under a lamp
    Diffuse,
    /// Surface normals: red to the right, green up, blue toward the viewer
    Normals,
    /// Cell steps, grid steps and primitive tests of each ray, from blue to red
    Heat,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn bad_values_are_refused() {
        for words in [
            "--size 0",
            "--size 16385",
            "--repeat 0",
            "--view above",
            "--eye 1,2",
            "--target 1,2,3",
            "--eye 1,2,3 --view top",
            "--density many",
            "--method bvh",
        ] {
            let words = ["hgrid", "render"].into_iter().chain(words.split(' '));
            assert!(Cli::try_parse_from(words.clone()).is_err(), "{:?}", words.collect::<Vec<_>>());
        }
    }

    #[test]
    fn negative_values_are_values() {
        for words in ["--view -30,-20", "--eye -1,-2,-3 --target -1,0,0", "--density -1"] {
            let words = ["hgrid", "render"].into_iter().chain(words.split(' '));
            Cli::try_parse_from(words).unwrap();
        }
    }
}
