//! The words of the command line. What they do is in the other modules.

use std::path::PathBuf;

use anyhow::Result;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use hgrid_core::{Config, Control, Method, Quality};

use crate::camera::{Aim, Camera, Lens, Point, Up, View, named};
use crate::compare::first::COMMAND as FIRST_BUILD;
use crate::compare::peers::Peer;
use crate::compare::workloads::Workload;
use crate::heat::Counter;
use crate::scene::Scene;
use crate::tiles::Tiles;

/// The picture that is written when nobody names one.
pub const DEFAULT_OUTPUT: &str = "hgrid.png";

/// The folder that figures are written into when nobody names one.
pub const DEFAULT_FOLDER: &str = "figures";

/// The scene that is rendered when nobody names one.
pub const DEFAULT_SCENE: &str = "procedural:knot:500K";

const EXAMPLES: &str = "\
Examples:
  hgrid                                      the built-in scene, to hgrid.png
  hgrid render bunny.ply -o bunny.png        a mesh of yours, seen from the front
  hgrid render bunny.ply --shading heat      what each ray costs, from blue to red
  hgrid render bunny.ply+stadium.ply         the first in the middle of the second
  hgrid table bunny.ply dragon.ply           all methods side by side, as in the paper
  hgrid figures buddha.ply -o pictures       the paper's charts, as SVG and PNG
  hgrid animate bunny.ply --threads 4        a moving mesh, built again for every frame
  hgrid compare bunny.ply dragon.ply         hgrid and other ray tracers, over the same rays
  hgrid help render                          all about one command";

const RENDER_EXAMPLES: &str = "\
Examples:
  hgrid render bunny.ply -o bunny.png        a mesh of yours, seen from the front
  hgrid render bunny.ply --quality high      a longer build, rays that are faster
  hgrid render bunny.ply --method fixed --macrocell-factor 4
  hgrid render bunny.ply --shading heat      what each ray costs, from blue to red
  hgrid render bunny.ply --shading heat --counter primitive-tests --heat-top 50
  hgrid render procedural:stage --view 40,15
  hgrid render stadium.ply --up z --view three-quarter
  hgrid render sponza.ply --view inside      the same as --eye 0,3,0 --target 10,3,0
  hgrid render bunny.ply --repeat 9 --json   medians, for programs";

const TABLE_EXAMPLES: &str = "\
Examples:
  hgrid table bunny.ply dragon.ply buddha.ply
  hgrid table procedural:knot:100K --size 512 --repeat 9
  hgrid table sponza.ply --eye 0,3,0 --target 10,3,0 --fov 60
  hgrid table dragon.ply --methods one-level,fixed --macrocell-factor 4
  hgrid table dragon.ply --markdown > table.md
  hgrid table dragon.ply --json > table.json     every single time, and the machine

Close what else is running: the times are those of one thread, but for builds with --threads, and
they believe the clock.";

const FIGURES_EXAMPLES: &str = "\
Examples:
  hgrid figures bunny.ply dragon.ply buddha.ply -o pictures
  hgrid figures bunny.ply buddha.ply --figure1 buddha.ply --densities 1,4,16,64
  hgrid figures procedural:knot:100K --size 512 --repeat 1     a first impression

The folder then holds figure1 (times against density, one scene) and figure2 (memory and times of
every scene and method) as .svg, as .png and, the numbers alone, as .json.";

const COMPARE_EXAMPLES: &str = "\
Examples:
  hgrid compare bunny.ply dragon.ply buddha.ply
  hgrid compare dragon.ply --peers embree-low,embree-medium --workloads primary,ao,bounce
  hgrid compare sponza.ply --view inside
  hgrid compare bunny.ply dragon.ply --markdown --json compare.json -o pictures

This needs a program with the peers in it; docs/performance.md tells how they are set up and measured:
  apt-get install libembree-dev g++
  RUSTFLAGS='-C target-cpu=native' cargo run --release -p hgrid-lab --features peers -- compare ...";

const ANIMATE_EXAMPLES: &str = "\
Examples:
  hgrid animate dragon.ply                   30 frames, built and rendered with one thread
  hgrid animate dragon.ply --frames 100 --threads 4
  hgrid animate bunny.ply --method one-level --size 512
  hgrid animate bunny.ply -o frames          every frame as a picture, too";

const SCENES: &str = "\
Scenes:
  FILE.ply, FILE.obj
  procedural:knot[:TRIANGLES]     a closed, finely bumped surface, like a scan
  procedural:stage[:TRIANGLES]    the same on a floor eighty times its size
  procedural:soup[:TRIANGLES]     a cube full of small triangles
  A+B                             A in the middle of B, as bunny.ply+stadium.ply
  TRIANGLES is a number like 5000, 20K or 3M, up to 100M";

const VIEWS: &str = "\
Views:
  front, back, left, right, top, bottom, three-quarter,
  or AZIMUTH,ELEVATION in degrees: 0,0 is the front, 90,0 the right, 0,90 the top.
  Without one, scenes are seen from the front and flat ones from above.
  Instead of a view: a point to look --eye from, and one to look at (--target).
Named views:
";

/// What is said about views, and the named ones.
fn views() -> String {
    VIEWS.to_owned() + &named::list()
}

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
    #[command(after_help = [RENDER_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Render(RenderArgs),
    /// Measures every method on every scene: the paper's Table 1
    #[command(after_help = [TABLE_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Table(TableArgs),
    /// Measures and draws the paper's figures: times against density, and bars for every method
    #[command(after_help = [FIGURES_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Figures(FiguresArgs),
    /// Deforms a mesh and builds and renders it again for every frame, in the same memory
    #[command(after_help = [ANIMATE_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Animate(AnimateArgs),
    /// Measures every method and other ray tracers, its peers, over the same rays
    #[command(after_help = [COMPARE_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Compare(CompareArgs),
    /// Writes the tables and charts of README.md and docs/ from the results in lab/results
    Report(ReportArgs),
    /// Builds once with one system: `compare` starts a new process for each first build
    #[command(name = FIRST_BUILD, hide = true)]
    FirstBuild(FirstBuildArgs),
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
    /// The structure to build
    #[arg(long, value_parser = method_parser(), default_value = Method::default().name())]
    pub method: Method,
    /// Cells per triangle, for other methods than bvh [default: the paper's for the method]
    #[arg(long, value_name = "CELLS", allow_negative_numbers = true)]
    pub density: Option<f32>,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub tuning: Tuning,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub picture: Picture,
    /// What the colours mean
    #[arg(long, value_enum, default_value_t = Shading::Diffuse)]
    pub shading: Shading,
    /// For diffuse: the lamp casts shadows
    #[arg(long)]
    pub shadows: bool,
    /// For diffuse: ambient occlusion, so many rays from each hit look for sky and ground
    #[arg(long, value_name = "RAYS", default_value_t = 0,
          value_parser = clap::value_parser!(u16).range(0..=1024))]
    pub ao: u16,
    /// For heat: which work is shown [default: cost]
    #[arg(long, value_enum)]
    pub counter: Option<Counter>,
    /// For heat: the number that is red, to compare pictures [default: what 99 of 100 rays take]
    #[arg(long, value_name = "NUMBER")]
    pub heat_top: Option<u32>,
    /// Build and render so many times and report the medians
    #[arg(long, value_name = "TIMES", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeat: u32,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub builders: Builders,
    /// Print the numbers as a JSON object
    #[arg(long)]
    pub json: bool,
}

impl RenderArgs {
    /// The grid that the words ask for.
    #[must_use]
    pub fn config(&self) -> Config {
        let config = self.tuning.config(self.method);
        Config { density: self.density.unwrap_or(config.density), ..config }
    }
}

/// What to measure and how to print it.
#[derive(Debug, Parser)]
pub struct TableArgs {
    /// Mesh files or procedural:NAME:TRIANGLES, one column each
    #[arg(required = true)]
    pub scenes: Vec<String>,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub race: Race,
    /// Print Markdown, for a README
    #[arg(long, conflicts_with = "json")]
    pub markdown: bool,
    /// Print a JSON object with every number and the machine they come from
    #[arg(long)]
    pub json: bool,
}

/// What to draw and where to.
#[derive(Debug, Parser)]
pub struct FiguresArgs {
    /// Mesh files or procedural:NAME:TRIANGLES, one group of bars each
    #[arg(required = true)]
    pub scenes: Vec<String>,
    /// The folder for the pictures and their numbers; it is made if it is missing
    #[arg(short, long, value_name = "DIR", default_value = DEFAULT_FOLDER)]
    pub output: PathBuf,
    /// The scene of figure 1 [default: the first one]
    #[arg(long, value_name = "SCENE")]
    pub figure1: Option<String>,
    /// The densities of figure 1, between commas
    #[arg(long, value_name = "CELLS", value_delimiter = ',',
          default_values_t = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0])]
    pub densities: Vec<f32>,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub race: Race,
}

/// What to animate and how.
#[derive(Debug, Parser)]
pub struct AnimateArgs {
    /// A mesh file or procedural:NAME:TRIANGLES
    #[arg(default_value = DEFAULT_SCENE)]
    pub scene: String,
    /// How many frames
    #[arg(long, value_name = "NUMBER", default_value_t = 30,
          value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: u32,
    /// The structure to build
    #[arg(long, value_parser = method_parser(), default_value = Method::default().name())]
    pub method: Method,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub tuning: Tuning,
    /// Threads that build, for `bvh`, and render
    #[arg(long, value_name = "NUMBER", default_value_t = 1, value_parser = thread_parser())]
    pub threads: u32,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub picture: Picture,
    /// Print the numbers as a JSON object
    #[arg(long)]
    pub json: bool,
    /// Write every frame into this folder, as PNG; it is made if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
}

/// What to measure against what.
#[derive(Debug, Parser)]
pub struct CompareArgs {
    /// Mesh files or procedural:NAME:TRIANGLES
    #[arg(required = true)]
    pub scenes: Vec<String>,
    /// The structures of hgrid, between commas [default: all]
    #[arg(long, value_name = "METHODS", value_delimiter = ',', value_parser = method_parser())]
    pub methods: Vec<Method>,
    /// For `bvh`: `high` builds longer for rays that are faster
    #[arg(long, value_name = "QUALITY", value_parser = quality_parser(),
          default_value = Quality::default().name())]
    pub quality: Quality,
    /// The other structures, between commas [default: all that this program has]
    #[arg(long, value_name = "PEERS", value_delimiter = ',', value_enum)]
    pub peers: Vec<Peer>,
    /// What is asked of them, between commas [default: all]
    #[arg(long, value_name = "WORKLOADS", value_delimiter = ',', value_enum)]
    pub workloads: Vec<Workload>,
    /// Build and trace so many times, taking turns, and report the medians
    #[arg(long, value_name = "TIMES", default_value_t = 5,
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeat: u32,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub picture: Picture,
    /// Print Markdown
    #[arg(long)]
    pub markdown: bool,
    /// Write every number and the machine they come from to this file
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Draw charts into this folder, as SVG and PNG; it is made if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
}

/// Which pages to write.
#[derive(Debug, Parser)]
pub struct ReportArgs {
    /// The root of a checkout
    #[arg(default_value = ".")]
    pub root: PathBuf,
    /// Write nothing, and fail if a page is not what the results say
    #[arg(long)]
    pub check: bool,
}

/// What to build once.
#[derive(Debug, Parser)]
pub struct FirstBuildArgs {
    /// A mesh file or procedural:NAME:TRIANGLES
    pub scene: String,
    /// A method or a peer
    pub system: String,
}

/// Which methods compete, and how often.
#[derive(Debug, Clone, Args)]
pub struct Race {
    /// The structures to build, between commas [default: all]
    #[arg(long, value_name = "METHODS", value_delimiter = ',', value_parser = method_parser())]
    methods: Vec<Method>,
    /// Build and render so many times, taking turns, and report the medians
    #[arg(long, value_name = "TIMES", default_value_t = 3,
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeat: u32,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub builders: Builders,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub tuning: Tuning,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub picture: Picture,
}

impl Race {
    /// A configuration for each method, at the paper's density.
    #[must_use]
    pub fn configs(&self) -> Vec<Config> {
        let methods = if self.methods.is_empty() { Method::ALL } else { &self.methods };
        methods.iter().map(|&method| self.tuning.config(method)).collect()
    }
}

/// Who builds.
#[derive(Debug, Clone, Copy, Args)]
pub struct Builders {
    /// Threads that build, for `bvh`; the other methods, and all rays, have one
    #[arg(long, value_name = "NUMBER", default_value_t = 1, value_parser = thread_parser())]
    pub threads: u32,
}

/// Parameters of single methods; the others ignore them.
#[derive(Debug, Clone, Copy, Args)]
pub struct Tuning {
    /// For `fixed`: cells in a macrocell on each axis [default: the paper's, 6]
    #[arg(long, value_name = "CELLS")]
    pub macrocell_factor: Option<u32>,
    /// For `variable`: a cell with more triangles than this gets a subgrid [default: 16]
    #[arg(long, value_name = "TRIANGLES")]
    pub subdivide_above: Option<u32>,
    /// For `recursive`: levels of grids [default: the paper's, 3]
    #[arg(long, value_name = "LEVELS")]
    pub depth: Option<u32>,
    /// For `bvh`: `high` builds longer for rays that are faster [default: fast]
    #[arg(long, value_name = "QUALITY", value_parser = quality_parser())]
    pub quality: Option<Quality>,
}

impl Tuning {
    /// The method with these parameters and the paper's where none are given.
    #[must_use]
    pub fn config(&self, method: Method) -> Config {
        let default = Config::new(method);
        Config {
            macrocell_factor: self.macrocell_factor.unwrap_or(default.macrocell_factor),
            subdivide_above: self.subdivide_above.unwrap_or(default.subdivide_above),
            depth: self.depth.unwrap_or(default.depth),
            quality: self.quality.unwrap_or(default.quality),
            ..default
        }
    }
}

/// How large a picture is and from where it is taken.
#[derive(Debug, Clone, Copy, Args)]
pub struct Picture {
    /// Pixels on each side
    #[arg(long, value_name = "PIXELS", default_value_t = 1024,
          value_parser = clap::value_parser!(u16).range(1..=16_384))]
    pub size: u16,
    /// From which side to look, or a named view of the scene
    #[arg(long, allow_hyphen_values = true)]
    pub view: Option<Aim>,
    /// Look from this point instead, as X,Y,Z
    #[arg(long, value_name = "X,Y,Z", conflicts_with = "view", allow_hyphen_values = true)]
    pub eye: Option<Point>,
    /// Look at this point [default: the middle of the scene]
    #[arg(long, value_name = "X,Y,Z", requires = "eye", allow_hyphen_values = true)]
    pub target: Option<Point>,
    /// Degrees that the picture covers, from edge to edge [default: 40]
    #[arg(long, value_name = "DEGREES")]
    pub fov: Option<Lens>,
    /// Which axis of the scene is up
    #[arg(long, value_enum, default_value_t = Up::Y)]
    pub up: Up,
}

impl Picture {
    /// The picture of a scene: of all of it unless the words say otherwise.
    ///
    /// # Errors
    /// If the scene has no view of that name.
    pub fn tiles(&self, scene: &Scene) -> Result<Tiles> {
        let bounds = scene.framed_bounds();
        let (up, lens) = (self.up, self.fov.unwrap_or_default());
        let camera = if let Some(eye) = self.eye {
            Camera::between(eye, self.target.unwrap_or(Point::centre_of(bounds)), up, lens)
        } else {
            let aim = self.view.unwrap_or_else(|| Aim::Side(View::of(bounds, up)));
            aim.camera(scene, up, lens)?
        };
        Ok(Tiles { camera, size: self.size })
    }
}

/// What the colours of a picture mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Shading {
    /// A grey solid under a lamp
    Diffuse,
    /// Surface normals: red to the right, green up, blue toward the viewer
    Normals,
    /// The work of each ray, from blue to red
    Heat,
}

/// As many threads as a build can use.
fn thread_parser() -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(1..=i64::from(Control::MAX_TASKS))
}

/// A method by its name.
fn method_parser() -> impl TypedValueParser<Value = Method> {
    let names = Method::ALL.iter().copied().map(Method::name);
    PossibleValuesParser::new(names).try_map(|word| {
        let method = Method::ALL.iter().copied().find(|method| method.name() == word);
        method.ok_or("no such method")
    })
}

/// A quality by its name.
fn quality_parser() -> impl TypedValueParser<Value = Quality> {
    let names = Quality::ALL.iter().copied().map(Quality::name);
    PossibleValuesParser::new(names).try_map(|word| {
        let quality = Quality::ALL.iter().copied().find(|quality| quality.name() == word);
        quality.ok_or("no such quality")
    })
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
            "render --size 0",
            "render --size 16385",
            "render --repeat 0",
            "render --view above",
            "render --eye 1,2",
            "render --target 1,2,3",
            "render --eye 1,2,3 --view top",
            "render --fov 0",
            "compare a.ply --eye 1,2,3 --view inside",
            "render --density many",
            "render --method octree",
            "render --macrocell-factor -1",
            "table",
            "table a.ply --methods fixed,octree",
            "table a.ply --json --markdown",
            "compare",
            "compare a.ply --peers optix",
            "animate --frames 0",
            "animate --threads 65",
            "render --threads 0",
        ] {
            let words = ["hgrid"].into_iter().chain(words.split(' '));
            assert!(Cli::try_parse_from(words.clone()).is_err(), "{:?}", words.collect::<Vec<_>>());
        }
    }

    #[test]
    fn negative_values_are_values() {
        for words in [
            "--view -30,-20",
            "--eye -1,-2,-3 --target -1,0,0 --fov 60",
            "--view inside --fov 20.5",
            "--density -1",
        ] {
            let words = ["hgrid", "render"].into_iter().chain(words.split(' '));
            Cli::try_parse_from(words).unwrap();
        }
    }

    #[test]
    fn methods_have_their_names_and_all_compete_unless_some_are_named() {
        for &method in Method::ALL {
            let args = RenderArgs::parse_from(["hgrid", "--method", method.name()]);
            assert_eq!(args.config(), Config::new(method));
        }
        let methods = |words: &[&str]| -> Vec<Method> {
            let words = ["hgrid", "a.ply"].iter().chain(words);
            TableArgs::parse_from(words).race.configs().iter().map(|c| c.method).collect()
        };
        assert_eq!(methods(&[]), Method::ALL);
        assert_eq!(methods(&["--methods", "fixed,one-level"]), [Method::Fixed, Method::OneLevel]);
    }

    #[test]
    fn parameters_reach_the_configuration() {
        let words =
            "hgrid --macrocell-factor 4 --subdivide-above 9 --depth 2 --density 2 --quality high";
        let config = RenderArgs::parse_from(words.split(' ')).config();
        let expected = Config {
            macrocell_factor: 4,
            subdivide_above: 9,
            depth: 2,
            density: 2.0,
            quality: Quality::High,
            ..Config::default()
        };
        assert_eq!(config, expected);
    }
}
