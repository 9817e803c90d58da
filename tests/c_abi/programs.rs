//! C programs that use the library as a stranger would: by the header and the archive alone.
//!
//! Each program ends at the first check that fails. They run with sanitizers, as C++, with the shared
//! library, and under valgrind, which unlike the sanitizers also watches what the library does.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use hgrid_tests::artefact::{
    Flavour, compiler, is_installed, library_dir, root, run, static_library,
};
use tempfile::TempDir;

use crate::header::statuses;

/// Programs that check for themselves and tell which statuses they reached, and the flavour of the
/// library that they need.
const PROGRAMS: [(&str, Flavour); 9] = [
    ("queries", Flavour::NoStd),
    ("batches", Flavour::NoStd),
    ("memory", Flavour::NoStd),
    ("methods", Flavour::NoStd),
    ("parallel", Flavour::NoStd),
    ("progress", Flavour::NoStd),
    ("refusals", Flavour::NoStd),
    ("blobs", Flavour::NoStd),
    ("create", Flavour::Std),
];

const SANITIZERS: [&str; 3] =
    ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer"];

/// Compiles a program of this folder against a library.
pub(crate) fn compile(
    name: &str,
    dialect: &str,
    flags: &[&str],
    library: &Path,
    dir: &Path,
) -> PathBuf {
    let program = dir.join(name);
    let language = if dialect.starts_with("c++") { "c++" } else { "c" };
    let source = root().join("tests/c_abi").join(name).with_extension("c");
    // The programs, not the library, want more than plain C: pages with protection, and threads.
    let mut compiler = compiler(dialect);
    compiler.args(["-D_DEFAULT_SOURCE", "-pthread", "-g", "-O1"]).args(flags);
    compiler.args(["-x", language]).arg(source).args(["-x", "none"]).arg(library);
    run(compiler.arg("-o").arg(&program));
    program
}

/// Compiles and runs all programs with a library of the flavour that they need.
fn run_all(dialect: &str, flags: &[&str], library: impl Fn(Flavour) -> PathBuf) {
    let dir = TempDir::new().expect("a folder");
    for (name, flavour) in PROGRAMS {
        let program = compile(name, dialect, flags, &library(flavour), dir.path());
        run(Command::new(program).env("LD_LIBRARY_PATH", flavour.dir()));
    }
}

#[test]
fn they_pass_as_c99_with_sanitizers() {
    run_all("c99", &SANITIZERS, Flavour::static_library);
}

#[test]
fn they_pass_as_cpp_with_sanitizers() {
    run_all("c++17", &SANITIZERS, Flavour::static_library);
}

#[test]
fn they_pass_with_the_shared_library() {
    run_all("c11", &[], Flavour::shared_library);
}

/// The flavour that can do more does the rest the same.
#[test]
fn they_pass_with_the_larger_flavour() {
    run_all("c11", &["-DHGRID_STD"], |_| Flavour::Std.static_library());
}

#[test]
fn they_pass_under_valgrind() {
    if !is_installed("valgrind") {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    for (name, flavour) in PROGRAMS {
        let program = compile(name, "c99", &[], &flavour.static_library(), dir.path());
        run(Command::new("valgrind").args(["--quiet", "--error-exitcode=99"]).arg(program));
    }
}

/// The header promises about 4 KiB for a ray and 16 KiB for a batch.
#[test]
fn queries_take_little_stack() {
    let dir = TempDir::new().expect("a folder");
    let program = compile("stack", "c99", &[], &static_library(), dir.path());
    let printed = String::from_utf8(run(&mut Command::new(program)).stdout).expect("text");
    let most = |name: &str| {
        let line = printed.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.and_then(|bytes| bytes.parse::<usize>().ok()).expect("a number")
    };
    let [one, many] = ["one", "many"].map(most);
    assert!(one > 500 && one < 9 << 9, "{one}");
    assert!(many > 64 * 48 && many < 16 << 10, "{many}");
}

#[test]
fn the_library_links_by_its_name_alone() {
    let dir = TempDir::new().expect("a folder");
    let program = dir.path().join("queries");
    let mut compiler = compiler("c99");
    compiler.arg("-D_DEFAULT_SOURCE").arg(root().join("tests/c_abi/queries.c"));
    compiler.arg("-L").arg(library_dir()).arg("-lhgrid").arg("-o").arg(&program);
    run(compiler.arg(format!("-Wl,-rpath,{}", library_dir().display())));
    // Cargo has a path of its own for shared libraries, and it would come first.
    run(Command::new(program).env_remove("LD_LIBRARY_PATH"));
}

#[test]
fn every_status_is_reached_and_described() {
    let dir = TempDir::new().expect("a folder");
    let [mut reached, mut described] = [BTreeSet::new(), BTreeSet::new()];
    for (name, flavour) in PROGRAMS {
        let program = compile(name, "c99", &[], &flavour.static_library(), dir.path());
        let printed = String::from_utf8(run(&mut Command::new(program)).stdout).expect("text");
        for (word, status) in printed.lines().filter_map(|line| line.split_once(' ')) {
            let set = if word == "reached" { &mut reached } else { &mut described };
            set.insert(status.parse::<i32>().expect("a number"));
        }
    }
    let all: BTreeSet<_> = statuses().into_values().collect();
    assert_eq!(described, all);
    assert_eq!(reached, all);
}
