//! Progress is drawn on terminals; into a pipe it goes only if asked for.

use std::process::Command;

use hgrid_tests::artefact::run;
use hgrid_tests::tools::{command, is_installed};
use tempfile::TempDir;

use crate::programs::raytracer;

/// Returns a command that draws a small picture into a folder.
fn small() -> (Command, TempDir) {
    let dir = TempDir::new().expect("a folder");
    let mut program = raytracer();
    program.args(["--size", "64", "-o"]).arg(dir.path().join("picture.ppm"));
    (program, dir)
}

#[test]
fn nothing_is_said_to_a_pipe_unless_it_is_asked_for() {
    let (mut program, _dir) = small();
    assert_eq!(run(&mut program).stderr, b"");
    let said = String::from_utf8(run(program.arg("--progress")).stderr).expect("text");
    let (build, render) = said.split_at(said.find("render").expect("two parts"));
    let tenths: String = (0..=10).map(|tenth| format!("render {} %\n", 10 * tenth)).collect();
    assert_eq!(render, tenths);
    // A build reports less often, but ends at 100 %.
    let steps: Vec<_> = build.lines().collect();
    assert!(steps.len() > 3 && steps.iter().all(|step| step.starts_with("build ")), "{build}");
    assert_eq!(steps.last(), Some(&"build 100 %"));
}

/// `script` runs a program as if at a terminal.
#[test]
fn a_terminal_gets_a_line_that_changes() {
    if !is_installed("script") {
        return;
    }
    let (program, _dir) = small();
    let words = [program.get_program()].into_iter().chain(program.get_args());
    // A shell reads them, and a folder's name may have a space.
    let words: Vec<_> = words.map(|word| format!("'{}'", word.display())).collect();
    let mut script = command("script");
    let typescript = run(script.args(["-qec", &words.join(" "), "/dev/null"]));
    let said = String::from_utf8(typescript.stdout).expect("text");
    assert!(said.contains("\rbuild 100 %\r\n"), "{said:?}");
    assert!(said.contains("\rrender   0 %"), "{said:?}");
    assert!(said.contains("\rrender 100 %\r\n"), "{said:?}");
}
