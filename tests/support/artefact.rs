//! The C library as its users get it, and the C compiler that links it.
//!
//! The library is built by the same cargo, in the release profile, once for each test program, into
//! a folder of its own below the target folder: a test program holds the lock of the outer one.
//! Each flavour has a folder, so that one does not take the place of the other.

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use cc::Tool;

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

/// What the library is built with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flavour {
    /// Nothing: what needs no operating system.
    NoStd,
    /// The feature `std`: the same, and `hgrid_create`.
    Std,
}

impl Flavour {
    /// Both.
    pub const ALL: [Self; 2] = [Self::NoStd, Self::Std];

    /// What to tell cargo.
    #[must_use]
    pub fn features(self) -> &'static [&'static str] {
        match self {
            Self::NoStd => &[],
            Self::Std => &["--features", "std"],
        }
    }

    /// Where `libhgrid.a` and `libhgrid.so` lie, fresh from the compiler.
    pub fn dir(self) -> &'static Path {
        static DIRS: [OnceLock<PathBuf>; 2] = [const { OnceLock::new() }; 2];
        DIRS[self as usize].get_or_init(|| {
            let target = match self {
                Self::NoStd => target_dir(),
                Self::Std => target_dir().join("std"),
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

/// The static library with some of its methods: the names of features, between commas.
#[must_use]
pub fn library_with(features: &str) -> PathBuf {
    let target = target_dir().join("methods").join(features.replace(',', "_"));
    let build = &mut cargo_in(&target, "build");
    build.args(["--release", "-p", "hgrid-capi", "--no-default-features", "--features", features]);
    run(build);
    target.join("release/libhgrid.a")
}

/// Where the libraries of the usual flavour lie.
pub fn library_dir() -> &'static Path {
    Flavour::NoStd.dir()
}

/// The usual static library.
#[must_use]
pub fn static_library() -> PathBuf {
    Flavour::NoStd.static_library()
}

/// The usual shared library.
#[must_use]
pub fn shared_library() -> PathBuf {
    Flavour::NoStd.shared_library()
}

/// A compiler for a dialect like `c99` or `c++17`, with the header on its path and every warning an
/// error: the one that a build script would use, so `$CC` or `$CXX` if they are set.
#[must_use]
pub fn compiler(dialect: &str) -> Command {
    static TOOLS: [OnceLock<Tool>; 2] = [const { OnceLock::new() }; 2];
    let is_cpp = dialect.starts_with("c++");
    let find = || {
        let mut build = cc::Build::new();
        build.host(host()).target(host()).opt_level(0).cargo_metadata(false).cpp(is_cpp);
        build.get_compiler()
    };
    let tool = TOOLS[usize::from(is_cpp)].get_or_init(find);
    // Not `to_command`: it sets the whole environment, which a failing test would print.
    let mut compiler = Command::new(tool.path());
    compiler.args(tool.args());
    warnings(compiler, dialect)
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

/// The same for a compiler by name.
#[must_use]
pub fn warnings(mut compiler: Command, dialect: &str) -> Command {
    compiler
        .arg(format!("-std={dialect}"))
        .args(["-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror", "-I"])
        .arg(root().join("include"));
    compiler
}

/// Whether there is a program of this name. If not, the test says so and goes on without it.
pub fn is_installed(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        println!("skipped: `{program}` is not installed");
    }
    found
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
