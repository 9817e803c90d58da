//! Mistakes that a query can only answer with a miss: release builds of the library do, debug builds stop.

use std::collections::BTreeSet;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use hgrid_tests::artefact::{Flavour, compiler, output, run, static_library};
use tempfile::TempDir;

use crate::header::{committed, functions, parameters};
use crate::programs::compile;

/// The number of the signal that `abort` raises.
const SIGABRT: i32 = 6;

/// Compiles `misuse.c` against a library.
fn program(library: &Path, dir: &TempDir) -> PathBuf {
    compile("misuse", compiler("c99"), &[], library, dir.path())
}

/// Returns the mistakes that the program knows: lines like `ray hgrid_intersect`.
fn mistakes(program: &Path) -> Vec<String> {
    let printed = String::from_utf8(run(&mut Command::new(program)).stdout).expect("text");
    printed.lines().map(str::to_owned).collect()
}

/// Returns what the mistakes are about, for every query of the header.
fn expected() -> BTreeSet<String> {
    let header = committed();
    let mut all = BTreeSet::new();
    for function in functions(Flavour::Malloc) {
        let has_status = header.contains(&format!("hgrid_status {function}("));
        for parameter in parameters(&function) {
            match &*parameter.name {
                "options" if !has_status => {
                    all.extend(
                        ["options", "struct", "cull"].map(|what| format!("{what} {function}")),
                    );
                }
                "ray" => drop(all.insert(format!("ray {function}"))),
                _ => {}
            }
        }
    }
    all
}

#[test]
fn release_builds_answer_mistakes_with_a_miss() {
    let dir = TempDir::new().expect("a folder");
    let program = program(&static_library(), &dir);
    let mistakes = mistakes(&program);
    assert_eq!(mistakes.iter().cloned().collect::<BTreeSet<_>>(), expected());
    assert!(mistakes.len() > 30, "{mistakes:?}");
    for name in mistakes.iter().map(String::as_str).chain(["legal"]) {
        let answer = run(Command::new(&program).arg(name));
        assert_eq!(String::from_utf8_lossy(&answer.stderr), "", "{name}");
    }
}

#[test]
#[ignore = "slow: compiles a debug build of the library"]
fn debug_builds_stop_at_mistakes_and_say_why() {
    let dir = TempDir::new().expect("a folder");
    let program = program(&Flavour::Bare.debug_build().library, &dir);
    run(Command::new(&program).arg("legal"));
    for name in mistakes(&program) {
        let stopped = output(Command::new(&program).arg(&name));
        let said = String::from_utf8(stopped.stderr).expect("text");
        assert_eq!(stopped.status.signal(), Some(SIGABRT), "{name}: {said}");
        let reason = match name.split(' ').next() {
            Some("options" | "struct") => "options that break the rules: wrong struct_size, ",
            Some("cull") => "options that break the rules: unknown cull",
            Some("ray") => "a ray of zeros",
            _ => panic!("{name}"),
        };
        assert!(said.starts_with(&format!("hgrid: a query got {reason}")), "{name}: {said}");
        assert!(said.ends_with(")\n") && said.lines().count() == 1, "{name}: {said}");
    }
}
