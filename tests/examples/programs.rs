//! The examples, compiled the way their Makefile does.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use hgrid_tests::artefact::{compiler, output, root, run, static_library};
use tempfile::TempDir;

/// What the ray tracer is made of.
const RAYTRACER: [&str; 3] = ["raytracer.c", "knot.c", "ply.c"];

/// Compiles sources of `c_examples/` and others into a program.
pub(crate) fn compile(sources: &[PathBuf], flags: &[&str], program: &Path) {
    let mut compiler = compiler("c99");
    compiler.args(["-O2", "-ffp-contract=off"]).args(flags);
    compiler.arg("-I").arg(root().join("c_examples")).args(sources);
    run(compiler.arg(static_library()).arg("-lm").arg("-o").arg(program));
}

/// A source of `c_examples/`.
pub(crate) fn example(name: &str) -> PathBuf {
    root().join("c_examples").join(name)
}

/// A ray tracer in a folder that lasts as long as the test program, compiled once.
pub(crate) fn raytracer() -> Command {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    Command::new(PROGRAM.get_or_init(|| raytracer_with(&[])))
}

/// The same with sanitizers, for files that nobody trusts.
pub(crate) fn watched_raytracer() -> Command {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    Command::new(PROGRAM.get_or_init(|| {
        raytracer_with(&["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"])
    }))
}

fn raytracer_with(flags: &[&str]) -> PathBuf {
    let program = TempDir::new().expect("a folder").keep().join("raytracer");
    compile(&RAYTRACER.map(example), flags, &program);
    program
}

/// Runs a program that may refuse its arguments, but not crash.
pub(crate) fn attempt(program: &mut Command) -> Output {
    let output = output(program);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(!stderr.contains("Sanitizer") && !stderr.contains("runtime error"), "{stderr}");
    assert!(output.status.code().is_some_and(|code| code < 2), "{:?}: {stderr}", output.status);
    output
}
