//! The README is right: its C program runs, and the files that it names exist.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use hgrid_tests::artefact::{
    bare_compiler, compiler, cpp_compiler, library_dir, root, run, static_library, warnings,
};
use hgrid_tests::tools::OPTIONAL;
use tempfile::TempDir;

fn page(name: &str) -> String {
    fs::read_to_string(root().join(name)).expect("a page of the project")
}

/// Returns the first code block of a language, and the text after it.
fn block<'a>(readme: &'a str, language: &str) -> (&'a str, &'a str) {
    let (_, rest) = readme.split_once(&format!("```{language}\n")).expect("a block");
    rest.split_once("```").expect("the end of the block")
}

/// The C program and the commands below it work in a folder laid out like the repository.
#[test]
fn its_c_program_prints_the_hit() {
    let readme = page("README.md");
    let (program, behind) = block(&readme, "c");
    assert!(program.lines().count() <= 16);
    let (commands, _) = block(behind, "sh");
    let commands: Vec<_> = commands.lines().collect();
    // The library is built already, and the last line has a test of its own.
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

/// Returns the programs of a page, each with the output that the page shows below it.
fn programs_of(page: &str, language: &str) -> Vec<(String, String)> {
    let page = self::page(page);
    let mut rest = page.as_str();
    let mut programs = Vec::new();
    while rest.contains(&format!("```{language}\n")) {
        let (program, behind) = block(rest, language);
        let (printed, behind) = block(behind, "text");
        programs.push((program.to_owned(), printed.to_owned()));
        rest = behind;
    }
    programs
}

/// Compiles a program of a page with the library, and returns what it prints.
fn printed(program: &str, mut compiler: Command, name: &str) -> String {
    let dir = TempDir::new().expect("a folder");
    fs::write(dir.path().join(name), program).expect("a file");
    let compiler = compiler.arg("-I").arg(root().join("include")).arg(name);
    run(compiler.arg(static_library()).args(["-o", "program"]).current_dir(dir.path()));
    let printed = run(&mut Command::new(dir.path().join("program"))).stdout;
    String::from_utf8(printed).expect("text")
}

#[test]
fn the_programs_of_docs_print_what_they_say() {
    let [(program, expected)] = &programs_of("docs/c.md", "c")[..] else { panic!("one program") };
    assert_eq!(printed(program, warnings(compiler("c99"), "c99"), "prog.c"), *expected);
    let programs = programs_of("docs/cpp.md", "cpp");
    assert_eq!(programs.len(), 2);
    for (program, expected) in programs {
        // The header is for all of these dialects, and so are its examples.
        for compiler in ["c++14", "c++17", "c++20"].into_iter().filter_map(cpp_compiler) {
            assert_eq!(printed(&program, compiler, "prog.cpp"), expected);
        }
    }
}

/// Pages stay short: few lines, and no long paragraphs.
#[test]
fn the_readme_is_short() {
    let readme = page("README.md");
    assert!(readme.lines().count() <= 130, "{} lines", readme.lines().count());
    let mut is_code = false;
    let mut length = 0;
    for line in readme.lines() {
        is_code ^= line.starts_with("```");
        let is_text = !is_code && !line.is_empty() && !line.starts_with(['|', '-', '#', '<', '`']);
        length = if is_text { length + 1 } else { 0 };
        assert!(length <= 5, "a paragraph of more than five lines ends with: {line}");
    }
    assert!(page("core/DESIGN.md").lines().count() <= 200);
    let rejected = page("core/REJECTED.md");
    let entries = rejected.lines().filter(|line| line.starts_with("- ")).count();
    assert!(rejected.lines().count() <= entries + 6, "one line each");
}

/// Each optional program has a row in the table of tests/README.md, and `.ci/run` leaves out all but make once.
#[test]
fn programs_that_may_be_missing_are_listed() {
    let names = OPTIONAL.map(|(name, _)| name);
    let table = page("tests/README.md");
    let (_, table) = table.split_once("| name | how to install it").expect("the table");
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let rows = rows.map(|row| row.split('`').nth(1).unwrap_or_default());
    assert_eq!(rows.collect::<Vec<_>>(), names);

    let ci = page(".ci/run");
    let list = ci.lines().find_map(|line| line.trim_start().strip_prefix("HGRID_WITHOUT="));
    let list = list.and_then(|line| line.split(' ').next()).expect(".ci/run sets HGRID_WITHOUT");
    let without: Vec<_> = names.into_iter().filter(|name| *name != "make").collect();
    assert_eq!(list.split(',').collect::<Vec<_>>(), without);
}

/// Returns the names of the project's pages: at its root, in docs, and in the folders.
fn pages() -> impl Iterator<Item = String> {
    let docs = fs::read_dir(root().join("docs")).expect("docs").map(|entry| {
        let name = entry.expect("an entry").file_name().into_string().expect("a name in UTF-8");
        format!("docs/{name}")
    });
    let docs = docs.filter(|name| Path::new(name).extension().is_some_and(|e| e == "md"));
    let others = ["README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md"];
    let folders =
        ["core/DESIGN.md", "core/REJECTED.md", "tests/README.md", "lab/results/README.md"];
    others.into_iter().chain(folders).map(str::to_owned).chain(docs)
}

#[test]
fn the_files_that_pages_name_are_there() {
    let folders = [
        "core",
        "capi",
        "include",
        "c_examples",
        "examples",
        "tests",
        "lab",
        "docs",
        "dist",
        ".ci",
    ];
    for name in pages() {
        let page = page(&name);
        let words = page.split(|c: char| c.is_whitespace() || "`()|:;,[]".contains(c));
        for word in words.map(|word| word.trim_end_matches('.')) {
            let is_path = folders.iter().any(|folder| word.starts_with(&format!("{folder}/")));
            assert!(!is_path || Path::exists(&root().join(word)), "{name} names {word}");
            assert!(!word.starts_with('@'), "{name} has an unfilled @ placeholder: {word}");
        }
    }
}

/// Links lead to files, relative to the folder of the page.
#[test]
fn links_lead_somewhere() {
    let mut count = 0;
    for name in pages() {
        let folder = Path::new(&name).parent().expect("a folder");
        let page = page(&name);
        for link in page.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let path = link.split('#').next().unwrap_or_default();
            let is_elsewhere = path.contains("://") || path.is_empty();
            assert!(is_elsewhere || root().join(folder).join(path).exists(), "{name}: {link}");
            count += 1;
        }
    }
    assert!(count > 15);
}
