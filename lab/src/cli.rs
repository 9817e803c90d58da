//! The arguments of the command line. The other modules do the work.

pub mod blob;
mod help;
mod picture;
pub mod render;
mod tuning;
mod values;

use core::iter;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::ensure;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, CommandFactory as _, Parser, Subcommand};
use hgrid_core::{Config, Method, Quality};

use self::blob::{InfoArgs, PackArgs, ValidateArgs};
use self::help::{
    ANIMATE_EXAMPLES, COMPARE_EXAMPLES, EXAMPLES, FIGURES_EXAMPLES, INFO_EXAMPLES, PACK_EXAMPLES,
    RENDER_EXAMPLES, REPORT_EXAMPLES, SCENES, TABLE_EXAMPLES, VALIDATE_EXAMPLES, views,
};
pub use self::picture::Picture;
use self::render::RenderArgs;
pub use self::tuning::Tuning;
use self::values::{density, method_parser, output_parser, quality_parser, thread_parser, whole};
use crate::camera::Up;
use crate::compare::first::COMMAND as FIRST_BUILD;
use crate::compare::peers::Peer;
use crate::compare::shown::Shown;
use crate::compare::workloads::Workload;
use crate::scene::format::Format;

/// The picture that is written by default.
pub const DEFAULT_OUTPUT: &str = "hgrid.png";

/// The folder that figures are written into by default.
pub const DEFAULT_FOLDER: &str = "figures";

/// The scene that is rendered by default.
pub const DEFAULT_SCENE: &str = "procedural:knot:500K";

/// Ray tracing with trees and hashed grids: renders, packs, measures.
#[derive(Debug, Parser)]
#[command(
    name = "hgrid",
    version,
    after_help = EXAMPLES,
    override_usage = "hgrid [FILE] [OPTIONS]\n       hgrid COMMAND ..."
)]
pub struct Cli {
    /// The command to run.
    #[command(subcommand)]
    pub command: Command,
}

impl Cli {
    /// Parses the words after the program's name; without a command they are those of `render`.
    ///
    /// # Errors
    /// If the words are not understood or contradict each other, and if they ask for help or the version.
    pub fn of_words(words: impl IntoIterator<Item = OsString>) -> Result<Self, clap::Error> {
        let mut words: Vec<OsString> = words.into_iter().collect();
        let is_own = |word: &OsString| {
            let word = word.to_string_lossy();
            let flags = ["help", "-h", "--help", "-V", "--version"];
            flags.contains(&&*word) || Self::command().find_subcommand(&*word).is_some()
        };
        let parse = |words: &[OsString]| {
            Self::try_parse_from(iter::once("hgrid".into()).chain(words.iter().cloned()))
                .and_then(Self::checked)
                .map_err(|error| with_two_scenes(error, words))
        };
        if words.first().is_some_and(is_own) {
            return parse(&words);
        }
        let first = words.first().map(|word| word.to_string_lossy().into_owned());
        if let Some(word) = first.filter(|word| is_bare(word) && !Path::new(word).exists()) {
            let nearest = parse(&words).err().and_then(|error| nearest_command(&error));
            return Err(no_command(&word, nearest));
        }
        words.insert(0, "render".into());
        parse(&words)
    }

    /// Refuses options that have no effect or contradict each other.
    fn checked(self) -> Result<Self, clap::Error> {
        let (name, checked) = match &self.command {
            Command::Render(args) => ("render", args.check()),
            Command::Pack(args) => ("pack", args.check()),
            Command::Table(args) => ("table", args.race.check()),
            Command::Figures(args) => ("figures", args.check()),
            Command::Animate(args) => ("animate", args.check()),
            Command::Compare(args) => ("compare", args.check()),
            _ => return Ok(self),
        };
        let Err(error) = checked else { return Ok(self) };
        let mut cli = Self::command();
        // Sets the names that usages begin with.
        cli.build();
        let command = cli.find_subcommand_mut(name).map(|command| command.to_owned());
        Err(command.unwrap_or(cli).error(ErrorKind::ArgumentConflict, error))
    }
}

/// Tells how one picture shows two scenes, if an error is about the second scene of `render`.
fn with_two_scenes(mut error: clap::Error, words: &[OsString]) -> clap::Error {
    let [command, first, ..] = words else { return error };
    let first = first.to_string_lossy();
    if let Some(ContextValue::String(second)) = error.get(ContextKind::InvalidArg)
        && error.kind() == ErrorKind::UnknownArgument
        && command == "render"
        && !first.starts_with('-')
        && !second.starts_with('-')
    {
        let hint = format!("a picture has one scene: `{first}+{second}` shows both");
        let hints = ContextValue::StyledStrs(vec![hint.into()]);
        error.insert(ContextKind::Suggested, hints);
    }
    error
}

/// Returns true if a word may be meant as a command: it is no option, and has nothing that names of scenes have.
fn is_bare(word: &str) -> bool {
    word.chars().all(|c| c.is_ascii_alphabetic() || c == '-') && !word.starts_with('-')
}

/// Returns the error for a word that is neither a command nor a file; it lists the commands.
fn no_command(word: &str, nearest: Option<String>) -> clap::Error {
    let mut cli = Cli::command();
    // clap suggests words that share only a few letters, too.
    let nearest = nearest.filter(|name| name.chars().next() == word.chars().next());
    let hint = nearest.map(|name| format!(", the nearest command is `{name}`"));
    let shown = cli.get_subcommands().filter(|command| !command.is_hide_set());
    let names: Vec<_> = shown.map(|command| command.get_name().to_owned()).collect();
    let message = format!(
        "no command or file `{word}`{}; the commands are {}",
        hint.unwrap_or_default(),
        names.join(", ")
    );
    cli.error(ErrorKind::InvalidSubcommand, message)
}

/// The command that is spelt nearly as the one that an error is about.
fn nearest_command(error: &clap::Error) -> Option<String> {
    match error.get(ContextKind::SuggestedSubcommand)? {
        ContextValue::String(name) => Some(name.clone()),
        // The last one is the most alike.
        ContextValue::Strings(names) => names.last().cloned(),
        _ => None,
    }
}

/// The commands of the program.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Renders a scene, with shadows and ambient occlusion; the command may be left out
    #[command(after_help = [RENDER_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Render(RenderArgs),
    /// Says what is in a mesh file or a blob
    #[command(after_help = INFO_EXAMPLES)]
    Info(InfoArgs),
    /// Builds a grid and writes it with its mesh into one file, a blob
    #[command(after_help = [PACK_EXAMPLES, SCENES].join("\n\n"))]
    Pack(PackArgs),
    /// Proves that a blob is a grid of its mesh
    #[command(after_help = VALIDATE_EXAMPLES)]
    Validate(ValidateArgs),
    /// Measures every method on every scene: the paper's Table 1
    #[command(after_help = [TABLE_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Table(TableArgs),
    /// Measures and draws the paper's figures: times against density, and bars for every method
    #[command(after_help = [FIGURES_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Figures(FiguresArgs),
    /// Deforms a mesh, or moves instances of it, and builds and renders it again for every frame, in the same memory
    #[command(after_help = [ANIMATE_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Animate(AnimateArgs),
    /// Measures every method, and ray tracers of other libraries (peers), over the same rays
    #[command(after_help = [COMPARE_EXAMPLES, SCENES, &views()].join("\n\n"))]
    Compare(CompareArgs),
    /// Writes the tables and charts of README.md and docs/ from the results in lab/results
    #[command(after_help = REPORT_EXAMPLES)]
    Report(ReportArgs),
    /// Builds once with one system: `compare` starts a new process for each first build
    #[command(name = FIRST_BUILD, hide = true)]
    FirstBuild(FirstBuildArgs),
}

/// The arguments of `hgrid table`.
#[derive(Debug, Parser)]
pub struct TableArgs {
    /// Mesh files or procedural:NAME:TRIANGLES, one column each
    #[arg(required = true)]
    pub scenes: Vec<OsString>,
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

/// The arguments of `hgrid figures`.
#[derive(Debug, Parser)]
pub struct FiguresArgs {
    /// Mesh files or procedural:NAME:TRIANGLES, one group of bars each
    #[arg(required = true)]
    pub scenes: Vec<OsString>,
    /// The folder for the pictures and their numbers; it is made if it is missing
    #[arg(short, long, value_name = "DIR", default_value = DEFAULT_FOLDER, value_parser = output_parser())]
    pub output: PathBuf,
    /// The scene of figure 1 [default: the first one]
    #[arg(long, value_name = "SCENE")]
    pub figure1: Option<OsString>,
    /// The densities of figure 1, separated by commas; each is a number above 0
    #[arg(long, value_name = "CELLS", allow_negative_numbers = true, value_delimiter = ',', value_parser = density,
          default_values_t = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0])]
    pub densities: Vec<f32>,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub race: Race,
}

impl FiguresArgs {
    /// Refuses trees alone, densities named twice, and parameters of methods that do not compete.
    ///
    /// # Errors
    /// If there are such; the message says what to change.
    pub fn check(&self) -> anyhow::Result<()> {
        ensure!(
            self.race.configs().iter().any(|config| config.parameters.density().is_some()),
            "figure 1 shows densities, which bvh has none of: add another of --methods"
        );
        for (number, density) in self.densities.iter().enumerate() {
            let is_new = !self.densities[..number].contains(density);
            ensure!(is_new, "--densities has {density} twice: name each once");
        }
        self.race.check()
    }
}

/// The arguments of `hgrid animate`.
#[derive(Debug, Parser)]
pub struct AnimateArgs {
    /// A mesh file or procedural:NAME:TRIANGLES
    #[arg(default_value = DEFAULT_SCENE)]
    pub scene: OsString,
    /// Number of frames, 1 to 100000
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, default_value_t = 30,
          value_parser = whole(1..=100_000_u32))]
    pub frames: u32,
    /// The structure to build
    #[arg(long, value_parser = method_parser(), default_value = Method::default().name())]
    pub method: Method,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub tuning: Tuning,
    /// Show a field of so many moving instances of the mesh, in a scene that is built for every frame, too; at most
    /// 10000000
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, default_value_t = 0,
          value_parser = whole(0..=10_000_000_u32))]
    pub instances: u32,
    /// For `bvh`: build the tree of the first frame only; later frames update its boxes
    #[arg(long)]
    pub refit: bool,
    /// Threads that build, for `bvh`, and render, 1 to 64
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true,
          default_value_t = 1, value_parser = thread_parser())]
    pub threads: u32,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub picture: Picture,
    /// Print the numbers as a JSON object
    #[arg(long)]
    pub json: bool,
    /// Write every frame into this folder, as PNG; it is made if it is missing
    #[arg(short, long, value_name = "DIR", value_parser = output_parser())]
    pub output: Option<PathBuf>,
}

impl AnimateArgs {
    /// Refuses options that would have no effect.
    ///
    /// # Errors
    /// If there is one; the message names the option and its purpose.
    pub fn check(&self) -> anyhow::Result<()> {
        for (option, is_there) in [("--instances", self.instances > 0), ("--refit", self.refit)] {
            let is_known = !is_there || self.method == Method::Bvh;
            ensure!(is_known, "{option} is for --method bvh: ask for that, or leave out {option}");
        }
        ensure!(
            !self.refit || self.frames > 1,
            "--refit is for later frames than the first: ask for --frames 2 or more, or leave out --refit"
        );
        self.picture.check()?;
        self.tuning.check("--method", &[self.method])
    }
}

/// The arguments of `hgrid compare`.
#[derive(Debug, Parser)]
pub struct CompareArgs {
    /// Mesh files or procedural:NAME:TRIANGLES
    #[arg(required = true)]
    pub scenes: Vec<OsString>,
    /// The methods of hgrid, separated by commas [default: all]
    #[arg(long, value_name = "METHODS", value_delimiter = ',', value_parser = method_parser())]
    pub methods: Vec<Method>,
    /// For `bvh`: `high` takes a longer build, after which most rays are faster [default: fast]
    #[arg(long, value_name = "QUALITY", value_parser = quality_parser())]
    pub quality: Option<Quality>,
    /// The structures of other libraries, separated by commas [default: all that this program has, but for
    /// embree-high and embree-robust]
    #[arg(long, value_name = "PEERS", value_delimiter = ',', value_enum)]
    pub peers: Vec<Peer>,
    /// The rays and points to ask for, separated by commas [default: all]
    #[arg(long, value_name = "WORKLOADS", value_delimiter = ',', value_enum)]
    pub workloads: Vec<Workload>,
    /// Compare scenes of this many instances of the mesh, at most 10000000 (`bvh` and Embree only); 0 compares the mesh
    /// itself
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, default_value_t = 0, conflicts_with = "output",
          value_parser = whole(0..=10_000_000_u32))]
    pub instances: u32,
    /// Compare trees over spheres, a shape of the caller's own, in place of triangles (`bvh` and Embree only)
    #[arg(long, conflicts_with_all = ["instances", "output"])]
    pub spheres: bool,
    /// Build and trace so many times, 1 to 1000, taking turns, and report the medians
    #[arg(long, value_name = "TIMES", allow_negative_numbers = true, default_value_t = 5,
          value_parser = whole(1..=1000_u32))]
    pub repeat: u32,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub picture: Picture,
    /// Print Markdown
    #[arg(long)]
    pub markdown: bool,
    /// Write every number and the machine they come from to this file, after each scene
    #[arg(long, value_name = "FILE", value_parser = output_parser())]
    pub json: Option<PathBuf>,
    /// Draw charts into this folder, as SVG and PNG; it is made if it is missing
    #[arg(short, long, value_name = "DIR", value_parser = output_parser())]
    pub output: Option<PathBuf>,
}

impl CompareArgs {
    /// Refuses options of trees if no tree is built, and results that would overwrite a mesh.
    ///
    /// # Errors
    /// If there is one; the message names the option and its method.
    pub fn check(&self) -> anyhow::Result<()> {
        self.picture.check()?;
        let has_tree = self.methods.is_empty() || self.methods.contains(&Method::Bvh);
        ensure!(
            self.quality.is_none() || has_tree,
            "--quality is for --methods bvh: ask for that, or leave out --quality"
        );
        // In other commands --json takes no value, so users may type a mesh after it.
        if let Some(json) = &self.json {
            ensure!(
                Format::named(json).is_none(),
                "`{}` is named like a mesh: give --json a name like x.json",
                json.display()
            );
        }
        if let Some((option, _)) = self.shown().option() {
            ensure!(
                has_tree,
                "{option} compares bvh with Embree: add bvh to --methods, or leave out {option}"
            );
        }
        Ok(())
    }

    /// Returns the content of the scenes.
    #[must_use]
    pub const fn shown(&self) -> Shown {
        Shown::of(self.instances, self.spheres)
    }
}

/// The arguments of `hgrid report`.
#[derive(Debug, Parser)]
pub struct ReportArgs {
    /// The root of a checkout
    #[arg(default_value = ".")]
    pub root: PathBuf,
    /// Write nothing, and fail if a page is not what the results say
    #[arg(long)]
    pub check: bool,
}

/// The arguments of `hgrid first-build`.
#[derive(Debug, Parser)]
pub struct FirstBuildArgs {
    /// A mesh file or procedural:NAME:TRIANGLES
    pub scene: OsString,
    /// A method or a peer
    pub system: String,
    /// Build a scene of so many instances over it, too
    #[arg(long, default_value_t = 0)]
    pub instances: u32,
    /// Build over a sphere in place of each triangle
    #[arg(long, conflicts_with = "instances")]
    pub spheres: bool,
    /// Which axis of the scene is up, for the field of instances
    #[arg(long, value_enum)]
    pub up: Option<Up>,
}

impl FirstBuildArgs {
    /// Returns the content of the scene.
    #[must_use]
    pub const fn shown(&self) -> Shown {
        Shown::of(self.instances, self.spheres)
    }
}

/// The methods of a race, and its repetitions.
#[derive(Debug, Clone, Args)]
pub struct Race {
    /// The methods to build, separated by commas [default: all]
    #[arg(long, value_name = "METHODS", value_delimiter = ',', value_parser = method_parser())]
    methods: Vec<Method>,
    /// Build and render so many times, 1 to 1000, taking turns, and report the medians
    #[arg(long, value_name = "TIMES", allow_negative_numbers = true, default_value_t = 3,
          value_parser = whole(1..=1000_u32))]
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
    /// Refuses parameters of methods that do not compete.
    ///
    /// # Errors
    /// If there is one; the message names the parameter and its method.
    pub fn check(&self) -> anyhow::Result<()> {
        let methods: Vec<_> = self.configs().iter().map(Config::method).collect();
        ensure!(
            self.builders.threads == 1 || methods.contains(&Method::Bvh),
            "--threads is for --methods bvh: ask for that, or leave out --threads"
        );
        self.picture.check()?;
        self.tuning.check("--methods", &methods)
    }

    /// Returns a configuration for each method, at the paper's density.
    #[must_use]
    pub fn configs(&self) -> Vec<Config> {
        let methods = if self.methods.is_empty() { Method::ALL } else { &self.methods };
        methods.iter().map(|&method| self.tuning.config(method, None)).collect()
    }
}

/// The threads of builds.
#[derive(Debug, Clone, Copy, Args)]
pub struct Builders {
    /// Threads that build, 1 to 64, for `bvh`; the other methods, and all rays, have one
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true,
          default_value_t = 1, value_parser = thread_parser())]
    pub threads: u32,
}

#[cfg(test)]
mod tests;
