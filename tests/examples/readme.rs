//! The README says what is so: its C program runs, and the files it names are there.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use hgrid_tests::artefact::{bare_compiler, library_dir, root, run};
use hgrid_tests::tools::OPTIONAL;
use tempfile::TempDir;

fn page(name: &str) -> String {
    fs::read_to_string(root().join(name)).expect("a page of the project")
}

/// The first block of a language behind a place in the README.
fn block<'a>(readme: &'a str, language: &str) -> (&'a str, &'a str) {
    let (_, rest) = readme.split_once(&format!("```{language}\n")).expect("a block");
    rest.split_once("```").expect("the end of the block")
}

/// The program in C and the commands below it, in a folder that looks like the repository.
#[test]
fn its_c_program_prints_the_hit() {
    let readme = page("README.md");
    let (program, behind) = block(&readme, "c");
    assert!(program.lines().count() <= 40);
    let (commands, _) = block(behind, "sh");
    let commands: Vec<_> = commands.lines().collect();
    // The library is there already, and the last line has a test of its own.
    let ["cargo build --release -p hgrid-capi", compile, start, _] = commands[..] else {
        panic!("{commands:?}")
    };
    assert_eq!([compile, start], ["cc prog.c -Iinclude target/release/libhgrid.a", "./a.out"]);

    let dir = TempDir::new().expect("a folder");
    fs::write(dir.path().join("prog.c"), program).expect("a file");
    fs::create_dir(dir.path().join("target")).expect("a folder");
    symlink(root().join("include"), dir.path().join("include")).expect("a link");
    symlink(library_dir(), dir.path().join("target/release")).expect("a link");
    let arguments = compile.split(' ').skip(1);
    let compiled = run(bare_compiler().args(arguments).current_dir(dir.path()));
    let printed = run(Command::new(dir.path().join(start)).current_dir(dir.path()));
    assert!(compiled.stderr.is_empty(), "{}", String::from_utf8_lossy(&compiled.stderr));
    assert_eq!(String::from_utf8(printed.stdout).as_deref(), Ok("hit at t = 1\n"));
}

/// Each has a row in the table of tests/README.md, and `.ci/run` leaves out all but make once.
#[test]
fn programs_that_may_be_missing_are_listed() {
    let names = OPTIONAL.map(|(name, _)| name);
    let table = page("tests/README.md");
    let (_, table) = table.split_once("| name | how to install it").expect("the table");
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let rows = rows.map(|row| row.split('`').nth(1).unwrap_or_default());
    assert_eq!(rows.collect::<Vec<_>>(), names);

    let ci = page(".ci/run");
    let list = ci.lines().find_map(|line| line.strip_prefix("HGRID_WITHOUT="));
    let list = list.and_then(|line| line.split(' ').next()).expect("a run without them");
    let without: Vec<_> = names.into_iter().filter(|name| *name != "make").collect();
    assert_eq!(list.split(',').collect::<Vec<_>>(), without);
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
