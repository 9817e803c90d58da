//! The README says what is so: its C program runs, and the files it names are there.

use std::fs;
use std::path::Path;
use std::process::Command;

use hgrid_tests::artefact::{root, run};
use tempfile::TempDir;

use crate::programs::compile;

fn page(name: &str) -> String {
    fs::read_to_string(root().join(name)).expect("a page of the project")
}

#[test]
fn its_c_program_prints_the_hit() {
    let readme = page("README.md");
    let (_, rest) = readme.split_once("```c\n").expect("a program in C");
    let (program, _) = rest.split_once("```").expect("the end of the program");
    let dir = TempDir::new().expect("a folder");
    let source = dir.path().join("prog.c");
    // What the README includes as installed lies beside nothing here but the header's own folder.
    fs::write(&source, program).expect("a file");
    let example = dir.path().join("prog");
    compile(&[source], &[], &example);
    let printed = run(&mut Command::new(example)).stdout;
    assert_eq!(String::from_utf8(printed).as_deref(), Ok("hit at t = 1\n"));
    assert!(program.lines().count() <= 40);
}

#[test]
fn the_files_that_pages_name_are_there() {
    let folders = ["core", "capi", "include", "c_examples", "tests", "lab", ".ci"];
    for name in ["README.md", "core/DESIGN.md", "tests/README.md", "lab/results/README.md"] {
        let page = page(name);
        let words = page.split(|c: char| c.is_whitespace() || "`()|:;,".contains(c));
        for word in words.map(|word| word.trim_end_matches('.')) {
            let is_path = folders.iter().any(|folder| word.starts_with(&format!("{folder}/")));
            assert!(!is_path || Path::exists(&root().join(word)), "{name} names {word}");
            assert!(!word.starts_with('@'), "{name} has a gap: {word}");
        }
    }
}
