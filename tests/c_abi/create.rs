//! `hgrid_create`, which only one flavour of the library has: the tests that `programs` does not have.

use std::fs;
use std::process::Command;

use hgrid_tests::artefact::{Flavour, compiler, compilers, run};
use hgrid_tests::tools::{command, is_installed};
use tempfile::TempDir;

use crate::header::{examples, seen_by};
use crate::programs::compile;

#[test]
#[ignore = "slow: valgrind"]
fn it_leaks_nothing() {
    if !is_installed("valgrind") {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let program =
        compile("create", compiler("c99"), &[], &Flavour::Malloc.static_library(), dir.path());
    let mut valgrind = command("valgrind");
    valgrind.args(["--quiet", "--error-exitcode=99", "--leak-check=full"]);
    run(valgrind.args(["--show-leak-kinds=all", "--errors-for-leak-kinds=all"]).arg(program));
}

#[test]
fn its_example_runs_by_every_compiler() {
    let all = examples(&seen_by(Flavour::Malloc));
    let common = examples(&seen_by(Flavour::Bare));
    let [example] = &all.iter().filter(|example| !common.contains(example)).collect::<Vec<_>>()[..]
    else {
        panic!("one example")
    };
    let dir = TempDir::new().expect("a folder");
    let [source, program] = ["example.c", "example"].map(|name| dir.path().join(name));
    fs::write(&source, include_str!("created.c").replace("FUNCTIONS", example)).expect("a file");
    for mut compiler in compilers("c99") {
        compiler.arg(&source).arg(Flavour::Malloc.static_library()).arg("-o").arg(&program);
        run(&mut compiler);
        run(&mut Command::new(&program));
    }
}
