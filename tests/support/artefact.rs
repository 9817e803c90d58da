//! The C library as its users get it, and the C compiler that links it.
//!
//! The library is built by the same cargo, in the release profile, once for each test program, into
//! a folder of its own below the target folder: a test program holds the lock of the outer one.
//! Each flavour has a folder, so that one does not take the place of the other.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, OnceLock};
use std::{env, fs};

use cc::Tool;

use crate::tools::{command, is_installed};

/// The root of the repository.
#[must_use]
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the repository")
}

/// A target folder that no other cargo of this test run works in.
#[must_use]
pub fn target_dir() -> PathBuf {
    let program = env::current_exe().expect("a test program knows its path");
    // target/PROFILE/deps/PROGRAM
    program.ancestors().nth(3).expect("cargo runs it in its target folder").join("artefacts")
}

/// A cargo command for this repository that nothing in the environment bends.
#[must_use]
pub fn bare_cargo(subcommand: &str) -> Command {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.arg(subcommand).arg("--offline").current_dir(root());
    for name in ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "CARGO_BUILD_TARGET"] {
        cargo.env_remove(name);
    }
    cargo
}

/// The same for one that compiles, into the target folder of the tests.
#[must_use]
pub fn cargo(subcommand: &str) -> Command {
    cargo_in(&target_dir(), subcommand)
}

/// The same with another target folder.
#[must_use]
pub fn cargo_in(target_dir: &Path, subcommand: &str) -> Command {
    let mut cargo = bare_cargo(subcommand);
    cargo.arg("--quiet").arg("--target-dir").arg(target_dir);
    cargo
}

/// The features that the library is built with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flavour {
    /// Nothing: what needs no operating system.
    Bare,
    /// The feature `malloc`: the same, and `hgrid_create`.
    Malloc,
}

impl Flavour {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Bare, Self::Malloc];

    /// Returns the arguments for cargo.
    #[must_use]
    pub fn features(self) -> &'static [&'static str] {
        match self {
            Self::Bare => &[],
            Self::Malloc => &["--features", "malloc"],
        }
    }

    /// Returns the folder of `libhgrid.a` and `libhgrid.so`, fresh from the compiler.
    pub fn dir(self) -> &'static Path {
        static DIRS: [OnceLock<PathBuf>; 2] = [const { OnceLock::new() }; 2];
        DIRS[self as usize].get_or_init(|| {
            let target = match self {
                Self::Bare => target_dir(),
                Self::Malloc => target_dir().join("malloc"),
            };
            let mut build = cargo_in(&target, "build");
            run(build.args(["--release", "-p", "hgrid-capi"]).args(self.features()));
            target.join("release")
        })
    }

    /// The static library.
    #[must_use]
    pub fn static_library(self) -> PathBuf {
        self.dir().join("libhgrid.a")
    }

    /// The shared library.
    #[must_use]
    pub fn shared_library(self) -> PathBuf {
        self.dir().join(format!("{}hgrid{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX))
    }
}

/// The static library with some of its methods: the names of features, between commas. It is compiled in a third of
/// the time, as only its answers count, not its size; without any LTO the core of Rust asks for a runtime.
///
/// # Panics
/// If it cannot be built or copied.
#[must_use]
pub fn library_with(features: &str) -> PathBuf {
    // All are built in one folder, so that they share what they depend on: one after the other.
    static FOLDER: Mutex<()> = Mutex::new(());
    let _turn = FOLDER.lock().expect("nobody panicked");
    let target = target_dir().join("methods");
    let mut build = cargo_in(&target, "rustc");
    build.args(["--release", "-p", "hgrid-capi", "--no-default-features", "--features", features]);
    build.args(["--lib", "--crate-type", "staticlib"]);
    build.env("CARGO_PROFILE_RELEASE_LTO", "thin").env("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "16");
    run(&mut build);
    let library = target.join(format!("{}.a", features.replace(',', "_")));
    fs::copy(target.join("release/libhgrid.a"), &library).expect("a copy");
    library
}

/// Returns the folder of the libraries of the usual flavour.
pub fn library_dir() -> &'static Path {
    Flavour::Bare.dir()
}

/// The usual static library.
#[must_use]
pub fn static_library() -> PathBuf {
    Flavour::Bare.static_library()
}

/// The usual shared library.
#[must_use]
pub fn shared_library() -> PathBuf {
    Flavour::Bare.shared_library()
}

/// The compiler that a build script would use, so `$CC` or `$CXX` if they are set.
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

/// The usual C compiler alone, for command lines as strangers write them.
#[must_use]
pub fn bare_compiler() -> Command {
    Command::new(tool(false).path())
}

fn usual_compiler(dialect: &str) -> Command {
    let tool = tool(is_cpp(dialect));
    // Not `to_command`: it sets the whole environment, which a failing test would print.
    let mut compiler = Command::new(tool.path());
    compiler.args(tool.args());
    warnings(compiler, dialect)
}

/// Returns whether a dialect is one of C++, like `c++17`, and not of C, like `c99`.
#[must_use]
pub fn is_cpp(dialect: &str) -> bool {
    dialect.starts_with("c++")
}

/// The usual C compiler for a dialect, with the header on its path and every warning an error.
///
/// # Panics
/// If the dialect is one of C++, whose compiler may be missing.
#[must_use]
pub fn compiler(dialect: &str) -> Command {
    assert!(!is_cpp(dialect), "cpp_compiler finds the compiler for {dialect}");
    usual_compiler(dialect)
}

/// The same for a dialect of C++, if there is a C++ compiler.
#[must_use]
pub fn cpp_compiler(dialect: &str) -> Option<Command> {
    assert!(is_cpp(dialect), "{dialect} is C");
    is_installed("c++").then(|| usual_compiler(dialect))
}

/// The same for clang and a dialect of either language.
#[must_use]
pub fn clang(dialect: &str) -> Option<Command> {
    let program = if is_cpp(dialect) { "clang++" } else { "clang" };
    is_installed("clang").then(|| warnings(command(program), dialect))
}

/// All compilers that there are for a dialect: the usual one and clang.
pub fn compilers(dialect: &str) -> impl Iterator<Item = Command> {
    let usual = if is_cpp(dialect) { cpp_compiler(dialect) } else { Some(usual_compiler(dialect)) };
    usual.into_iter().chain(clang(dialect))
}

/// The triple of this machine, as its Rust compiler tells it.
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
/// If it does not, with all that it said.
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
/// Kernels that scatter addresses widely put something where the sanitizer wants its own memory, so it
/// runs again without that.
#[must_use]
pub fn output_watching_threads(program: &mut Command) -> Option<Output> {
    let is_refused = |output: &Output| {
        let said = String::from_utf8_lossy(&output.stderr);
        // Of the sanitizer and of setarch.
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
