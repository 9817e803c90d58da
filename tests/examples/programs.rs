//! The examples, compiled as their Makefile does.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use hgrid_tests::artefact::{compiler, compilers, output, root, run, static_library};
use tempfile::TempDir;

/// The sources of drawing that all such programs share.
const DRAWING: [&str; 11] = [
    "camera.c",
    "grid.c",
    "knot.c",
    "light.c",
    "memory.c",
    "options.c",
    "picture.c",
    "ply.c",
    "progress.c",
    "render.c",
    "threads.c",
];

/// Sanitizers for faults that a program would not notice by itself.
const WATCHED: [&str; 3] = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

/// Compiles sources of `c_examples/` and others into a program.
pub(crate) fn compile(sources: &[PathBuf], flags: &[&str], program: &Path) {
    link(compiler("c99"), sources, flags, program);
}

/// Does the same with another compiler.
pub(crate) fn link(mut compiler: Command, sources: &[PathBuf], flags: &[&str], program: &Path) {
    compiler.args(["-O2", "-ffp-contract=off", "-pthread"]).args(flags);
    compiler.arg("-I").arg(root().join("c_examples")).args(sources);
    run(compiler.arg(static_library()).arg("-lm").arg("-o").arg(program));
}

/// Returns the path of a source of `c_examples/`.
pub(crate) fn example(name: &str) -> PathBuf {
    root().join("c_examples").join(name)
}

/// Returns the sources of a program that draws.
pub(crate) fn drawing(more: &[&str]) -> Vec<PathBuf> {
    DRAWING.iter().chain(more).map(|name| example(name)).collect()
}

/// Makes a program in cargo's folder for files of tests, in place of that of an earlier run, and returns its path. Each
/// process makes its own, which never lies there in part: another may run the one before meanwhile.
pub(crate) fn kept(path: &str, make: impl FnOnce(&Path)) -> PathBuf {
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("examples").join(path);
    let parent = program.parent().expect("a folder");
    fs::create_dir_all(parent).expect("a folder");
    let dir = TempDir::new_in(parent).expect("a folder");
    let new = dir.path().join("program");
    make(&new);
    fs::rename(new, &program).expect("a program");
    program
}

/// Returns the ray tracer, compiled once for all tests of this process.
pub(crate) fn raytracer() -> Command {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    Command::new(PROGRAM.get_or_init(|| raytracer_with("plain", &[])))
}

/// Returns the ray tracer with sanitizers, for files that are not trusted.
pub(crate) fn watched_raytracer() -> Command {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    Command::new(PROGRAM.get_or_init(|| raytracer_with("watched", &WATCHED)))
}

/// Compiles a ray tracer with flags of its own into a folder of this name.
pub(crate) fn raytracer_with(folder: &str, flags: &[&str]) -> PathBuf {
    kept(&format!("{folder}/raytracer"), |program| {
        compile(&drawing(&["raytracer.c", "heat.c"]), flags, program);
    })
}

/// Returns the program of two processes, with sanitizers.
pub(crate) fn watched_mapped() -> Command {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    Command::new(PROGRAM.get_or_init(|| {
        kept("watched/mapped", |program| compile(&drawing(&["mapped.c"]), &WATCHED, program))
    }))
}

/// Runs a program that may refuse its arguments, but must not crash.
pub(crate) fn attempt(program: &mut Command) -> Output {
    let output = output(program);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(!stderr.contains("Sanitizer") && !stderr.contains("runtime error"), "{stderr}");
    assert!(output.status.code().is_some_and(|code| code < 2), "{:?}: {stderr}", output.status);
    output
}

/// Returns the error message of a program that must refuse its arguments.
pub(crate) fn refusal(program: &mut Command) -> String {
    let name = Path::new(program.get_program()).file_name().expect("a program has a name");
    let name = name.to_string_lossy().into_owned();
    let output = attempt(program);
    let said = String::from_utf8(output.stderr).expect("text");
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.starts_with(&format!("{name}: ")) && said.ends_with('\n'), "{said:?}");
    said
}

/// Returns the output of a program that must succeed.
pub(crate) fn printed(program: &mut Command) -> String {
    String::from_utf8(run(program).stdout).expect("text")
}

#[test]
fn no_compiler_warns_about_them() {
    nobody_warns_about_them("c99");
}

#[test]
#[ignore = "slow: compiles all examples twice more"]
fn no_compiler_warns_about_them_in_a_later_dialect() {
    nobody_warns_about_them("c17");
}

fn nobody_warns_about_them(dialect: &str) {
    let sources = drawing(&["minimal.c", "raytracer.c", "heat.c", "mapped.c"]);
    let dir = TempDir::new().expect("a folder");
    for mut compiler in compilers(dialect) {
        compiler.current_dir(dir.path()).args(["-O2", "-Wconversion", "-c"]);
        run(compiler.args(&sources));
    }
}
