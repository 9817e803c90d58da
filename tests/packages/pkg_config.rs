//! A project that uses pkg-config to get its compiler flags.

use std::path::Path;

use hgrid_tests::artefact::{Flavour, bare_compiler, root, run};
use hgrid_tests::tools::{command, is_installed};
use tempfile::TempDir;

use crate::installed::soname;
use crate::prefix::{HIT, Prefix, VERSION, dynamic, installed, output_of, program};

/// Returns the answer of pkg-config about the installed library.
fn ask(prefix: &Prefix, question: &[&str]) -> String {
    let mut pkg_config = command("pkg-config");
    pkg_config.args(question).arg("hgrid").env("PKG_CONFIG_PATH", prefix.lib.join("pkgconfig"));
    output_of(&mut pkg_config).trim().to_owned()
}

/// Compiles a program with the flags of the answer and nothing else.
fn compile(source: &Path, flags: &[&str], answer: &str, to: &Path) {
    let mut compiler = bare_compiler();
    compiler.args(flags).arg(source).args(answer.split_whitespace()).arg("-o").arg(to);
    run(&mut compiler);
}

/// Returns the prefix of a flavour, if the tools to make and to use it are installed.
fn prefix(flavour: Flavour) -> Option<&'static Prefix> {
    ["binutils", "pkg-config"].into_iter().all(is_installed).then(|| installed(flavour))?
}

#[test]
fn a_program_links_the_shared_library() {
    let Some(prefix) = prefix(Flavour::Bare) else { return };
    assert_eq!(ask(prefix, &["--modversion"]), VERSION);
    let dir = TempDir::new().expect("a folder");
    let path = dir.path().join("minimal");
    let answer = ask(prefix, &["--cflags", "--libs"]);
    compile(&root().join("c_examples/minimal.c"), &[], &answer, &path);
    assert!(dynamic(&path, "NEEDED").contains(&soname()));
    let printed = output_of(program(&path).env("LD_LIBRARY_PATH", &prefix.lib));
    assert!(printed.ends_with(HIT), "{printed}");
}

#[test]
fn a_program_links_the_static_library() {
    let Some(prefix) = prefix(Flavour::Bare) else { return };
    let answer = ask(prefix, &["--static", "--cflags", "--libs"]);
    // The library itself is the only one named: no -lm, no -lpthread.
    assert_eq!(answer.matches(" -l").count(), 1, "{answer}");
    let dir = TempDir::new().expect("a folder");
    let path = dir.path().join("minimal");
    compile(&root().join("c_examples/minimal.c"), &["-static"], &answer, &path);
    assert!(dynamic(&path, "NEEDED").is_empty());
    let printed = output_of(&mut program(&path));
    assert!(printed.ends_with(HIT), "{printed}");
}

#[test]
fn a_program_links_the_flavour_that_gets_memory_itself() {
    let Some(prefix) = prefix(Flavour::Malloc) else { return };
    let dir = TempDir::new().expect("a folder");
    let path = dir.path().join("created");
    let source = root().join("tests/packages/outside/created.c");
    for (flags, question) in [(vec![], vec![]), (vec!["-static"], vec!["--static"])] {
        let question = [&question[..], &["--cflags", "--libs"]].concat();
        compile(&source, &flags, &ask(prefix, &question), &path);
        let printed = output_of(program(&path).env("LD_LIBRARY_PATH", &prefix.lib));
        assert_eq!(printed, "hit at t = 1\n");
    }
}
