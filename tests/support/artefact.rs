//! The C library as users get it, and the C compiler that links it.
//!
//! The same cargo builds the library, in the release profile. It works in a folder below the target folder,
//! because a test program holds the lock of the target folder itself. Each set of features has a folder of its own:
//! in one folder, each library would replace the one before and be built again in the next run. The folder starts as
//! a copy with compiled dependencies.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::{env, fs};

use cc::Tool;

use crate::tools::{command, is_installed};

/// Returns the root of the repository.
#[must_use]
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the repository")
}

/// Returns a target folder that no other cargo of this test run uses.
#[must_use]
pub fn target_dir() -> PathBuf {
    let program = env::current_exe().expect("a test program knows its path");
    // target/PROFILE/deps/PROGRAM
    program.ancestors().nth(3).expect("cargo runs it in its target folder").join("artefacts")
}

/// Returns a cargo command for this repository without settings from the environment.
#[must_use]
pub fn bare_cargo(subcommand: &str) -> Command {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.arg(subcommand).arg("--offline").current_dir(root());
    for name in ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "CARGO_BUILD_TARGET"] {
        cargo.env_remove(name);
    }
    cargo
}

/// Returns a cargo command that compiles into the target folder of the tests.
#[must_use]
pub fn cargo(subcommand: &str) -> Command {
    cargo_in(&target_dir(), subcommand)
}

/// Returns the same with another target folder.
#[must_use]
pub fn cargo_in(target_dir: &Path, subcommand: &str) -> Command {
    let mut cargo = bare_cargo(subcommand);
    cargo.arg("--quiet").arg("--target-dir").arg(target_dir);
    cargo
}

/// A set of features that the library is built with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flavour {
    /// No features: a library that needs no operating system.
    Bare,
    /// The feature `malloc`, which adds `hgrid_create`.
    Malloc,
}

impl Flavour {
    /// Both flavours.
    pub const ALL: [Self; 2] = [Self::Bare, Self::Malloc];

    /// Returns the arguments for cargo.
    #[must_use]
    pub fn features(self) -> &'static [&'static str] {
        match self {
            Self::Bare => &[],
            Self::Malloc => &["--features", "malloc"],
        }
    }

    /// Builds the flavour, and returns the folder of `libhgrid.a` and `libhgrid.so`.
    pub fn dir(self) -> &'static Path {
        static DIRS: [OnceLock<PathBuf>; 2] = [const { OnceLock::new() }; 2];
        DIRS[self as usize].get_or_init(|| match self {
            Self::Bare => build(&target_dir(), &[]),
            Self::Malloc => build_beside("malloc", self.features()),
        })
    }

    /// Builds the static library with the dev profile, whose assertions stay on. They do not depend on its other
    /// settings, so the quickest ones serve.
    ///
    /// # Panics
    /// If cargo fails.
    pub fn debug_build(self) -> &'static DebugBuild {
        static BUILDS: [OnceLock<DebugBuild>; 2] = [const { OnceLock::new() }; 2];
        BUILDS[self as usize].get_or_init(|| debug_build(self))
    }

    /// Returns the path of the static library.
    #[must_use]
    pub fn static_library(self) -> PathBuf {
        self.dir().join(STATIC_LIBRARY)
    }

    /// Returns the path of the shared library.
    #[must_use]
    pub fn shared_library(self) -> PathBuf {
        self.dir().join(shared_library_name())
    }
}

/// A static library as a debug build makes it.
#[derive(Debug)]
pub struct DebugBuild {
    /// The path of the library.
    pub library: PathBuf,
    /// The libraries that rustc would tell a C programmer to link, separated by spaces.
    pub links: String,
}

const STATIC_LIBRARY: &str = "libhgrid.a";

fn shared_library_name() -> String {
    format!("{}hgrid{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX)
}

/// Builds the library with some of its methods: the names of features, separated by commas. Returns the path of
/// the static library.
#[must_use]
pub fn library_with(features: &str) -> PathBuf {
    let arguments = ["--no-default-features", "--features", features];
    build_beside(&features.replace(',', "_"), &arguments).join(STATIC_LIBRARY)
}

/// Builds the library with some of its methods, as [`library_with`] does, but with less optimisation, which takes less
/// time. Returns the path of the static library.
#[must_use]
pub fn plain_library_with(features: &str) -> PathBuf {
    let plain = ["hgrid-core", "hgrid-capi"]
        .map(|package| format!("profile.release.package.{package}.opt-level=1"));
    let [core, library] = &plain;
    let arguments =
        ["--no-default-features", "--features", features, "--config", core, "--config", library];
    build_beside(&format!("{}_plain", features.replace(',', "_")), &arguments).join(STATIC_LIBRARY)
}

fn debug_build(flavour: Flavour) -> DebugBuild {
    // Both flavours share compiled dependencies, and so the path of the library.
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let target = target_dir().join("debug_builds");
    let mut rustc = cargo_in(&target, "rustc");
    rustc.args(["-p", "hgrid-capi", "--crate-type", "staticlib"]).args(flavour.features());
    let others = ["package.glam.opt-level=0", "package.libm.opt-level=0"];
    let settings = ["opt-level=0", "panic='abort'"].into_iter().chain(others);
    for setting in settings.map(|setting| format!("profile.dev.{setting}")) {
        rustc.args(["--config", &setting]);
    }
    rustc.args(["--", "--print", "native-static-libs"]);
    let told = String::from_utf8(run(&mut rustc).stderr).expect("text");
    let links: Vec<_> =
        told.lines().filter_map(|line| line.split_once("native-static-libs:")).collect();
    let [(_, links)] = links[..] else { panic!("{told}") };
    let library = target.join(format!("{flavour:?}.a"));
    fs::copy(target.join("debug").join(STATIC_LIBRARY), &library).expect("a library");
    DebugBuild { library, links: links.trim().to_owned() }
}

/// Builds both libraries with some features in a folder of this name, and returns their folder.
fn build_beside(name: &str, features: &[&str]) -> PathBuf {
    let dir = target_dir().join("libraries").join(name);
    start_with(&dir.join("release"), library_dir);
    build(&dir, features)
}

/// Builds both libraries with some features in a target folder, and returns their folder.
fn build(target_dir: &Path, features: &[&str]) -> PathBuf {
    run(cargo_in(target_dir, "build").args(["--release", "-p", "hgrid-capi"]).args(features));
    target_dir.join("release")
}

/// Copies a target folder of cargo, unless the copy is there, so that dependencies are not compiled again. `compiled`
/// returns the folder once no cargo works in it. It is not called if the copy is there, so nobody waits for a build.
///
/// # Panics
/// If there is no such folder, or the copy cannot be written.
pub fn start_with<P: AsRef<Path>>(copy: &Path, compiled: impl FnOnce() -> P) {
    let parent = copy.parent().expect("a folder in another");
    fs::create_dir_all(parent).expect("a folder");
    let place = File::create(parent.join("lock")).expect("a lock");
    place.lock().expect("a turn");
    if !copy.is_dir() {
        // An interrupted run may have left a part of a copy.
        let part = parent.join("part");
        run(Command::new("rm").arg("-rf").arg(&part));
        // cargo goes by the times of files, which -p keeps.
        run(Command::new("cp").arg("-pR").arg(compiled().as_ref()).arg(&part));
        fs::rename(part, copy).expect("a folder");
    }
}

/// Returns the folder of the libraries of the usual flavour.
pub fn library_dir() -> &'static Path {
    Flavour::Bare.dir()
}

/// Returns the usual static library.
#[must_use]
pub fn static_library() -> PathBuf {
    Flavour::Bare.static_library()
}

/// Returns the usual shared library.
#[must_use]
pub fn shared_library() -> PathBuf {
    Flavour::Bare.shared_library()
}

/// Returns the compiler that a build script would use: `$CC` or `$CXX` if they are set.
fn tool(is_cpp: bool) -> &'static Tool {
    static TOOLS: [OnceLock<Tool>; 2] = [const { OnceLock::new() }; 2];
    TOOLS[usize::from(is_cpp)].get_or_init(|| {
        let mut build = cc::Build::new();
        build.host(host()).target(host()).opt_level(0).cargo_metadata(false).cpp(is_cpp);
        build.get_compiler()
    })
}

/// Returns the path of the usual C++ compiler, if there is one.
pub(crate) fn cpp_path() -> &'static Path {
    tool(true).path()
}

/// Returns the usual C compiler without flags, for command lines as users write them.
#[must_use]
pub fn bare_compiler() -> Command {
    Command::new(tool(false).path())
}

fn usual_compiler(dialect: &str) -> Command {
    let tool = tool(is_cpp(dialect));
    // `to_command` would set the whole environment, which a failing test would print.
    let mut compiler = Command::new(tool.path());
    compiler.args(tool.args());
    warnings(compiler, dialect)
}

/// Returns true if a dialect is one of C++, like `c++17`, and not of C, like `c99`.
#[must_use]
pub fn is_cpp(dialect: &str) -> bool {
    dialect.starts_with("c++")
}

/// Returns the usual C compiler for a dialect, with the header on its path and every warning an error.
///
/// # Panics
/// If the dialect is one of C++, whose compiler may be missing.
#[must_use]
pub fn compiler(dialect: &str) -> Command {
    assert!(!is_cpp(dialect), "cpp_compiler finds the compiler for {dialect}");
    usual_compiler(dialect)
}

/// Returns the same for a dialect of C++, if there is a C++ compiler.
#[must_use]
pub fn cpp_compiler(dialect: &str) -> Option<Command> {
    assert!(is_cpp(dialect), "{dialect} is C");
    is_installed("c++").then(|| usual_compiler(dialect))
}

/// Returns the same with clang for a dialect of either language.
#[must_use]
pub fn clang(dialect: &str) -> Option<Command> {
    let program = if is_cpp(dialect) { "clang++" } else { "clang" };
    is_installed("clang").then(|| warnings(command(program), dialect))
}

/// Returns all available compilers for a dialect: the usual one and clang.
pub fn compilers(dialect: &str) -> impl Iterator<Item = Command> {
    let usual = if is_cpp(dialect) { cpp_compiler(dialect) } else { Some(usual_compiler(dialect)) };
    usual.into_iter().chain(clang(dialect))
}

/// Returns the target triple of this machine, as rustc gives it.
fn host() -> &'static str {
    static HOST: OnceLock<String> = OnceLock::new();
    HOST.get_or_init(|| {
        let rustc = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let version = String::from_utf8(run(Command::new(rustc).arg("-vV")).stdout).expect("text");
        let host = version.lines().find_map(|line| line.strip_prefix("host: "));
        host.expect("rustc names its host").to_owned()
    })
}

/// Sets a dialect, the path of the header, and every warning as an error.
#[must_use]
pub fn warnings(mut compiler: Command, dialect: &str) -> Command {
    compiler
        .arg(format!("-std={dialect}"))
        .args(["-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror", "-I"])
        .arg(root().join("include"));
    compiler
}

/// Runs a command that must succeed.
///
/// # Panics
/// If it fails; the message contains all its output.
pub fn run(command: &mut Command) -> Output {
    let output = output(command);
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    assert!(output.status.success(), "{command:?}: {}\n{out}{err}", output.status);
    output
}

/// Runs a command that may fail.
///
/// # Panics
/// If there is no such program.
pub fn output(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"))
}

/// Runs a program that was compiled with `ThreadSanitizer`; `None` where the kernel does not let it run.
///
/// Kernels that scatter addresses widely may use addresses that the sanitizer needs, so the program runs
/// again without address randomisation.
#[must_use]
pub fn output_watching_threads(program: &mut Command) -> Option<Output> {
    let is_refused = |output: &Output| {
        let said = String::from_utf8_lossy(&output.stderr);
        // Messages of the sanitizer and of setarch.
        ["unexpected memory mapping", "personality"].iter().any(|words| said.contains(words))
    };
    let first = output(program);
    if !is_refused(&first) {
        return Some(first);
    }
    let mut fixed = Command::new("setarch");
    fixed.arg("-R").arg(program.get_program()).args(program.get_args());
    fixed.output().ok().filter(|second| !is_refused(second))
}
