//! Libraries with fewer methods, for devices with little flash.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use hgrid_core::Method;
use hgrid_tests::artefact::{compiler, library_with, plain_library_with, run, static_library};
use tempfile::TempDir;

use crate::programs::{SANITIZERS, compile};

/// Cargo features, and the methods that they bring.
const ONE: (&str, &[Method]) = ("fixed", &[Method::OneLevel, Method::Fixed]);
const ALL: [(&str, &[Method]); 4] = [
    ONE,
    ("variable", &[Method::OneLevel, Method::Variable]),
    ("bvh,recursive", &[Method::Bvh, Method::Recursive]),
    ("bvh", &[Method::Bvh]),
];

/// Returns the output of `left_out.c` with these libraries, about grids of a library that has all methods.
fn print(libraries: &[(&str, &[Method])], library_with: fn(&str) -> PathBuf) -> String {
    let dir = TempDir::new().expect("a folder");
    let program = |name: &str, library: &Path| {
        let dir = dir.path().join(name);
        fs::create_dir(&dir).expect("a folder");
        compile("left_out", compiler("c99"), &SANITIZERS, library, &dir)
    };
    run(Command::new(program("all", &static_library())).arg("write").arg(dir.path()));
    let outputs = libraries.iter().map(|(features, methods)| {
        let mut reads = Command::new(program(features, &library_with(features)));
        reads.arg("read").arg(dir.path());
        reads.args(methods.iter().map(|&method| (method as u32).to_string()));
        String::from_utf8(run(&mut reads).stdout).expect("text")
    });
    outputs.collect()
}

/// Returns the output with one of the libraries, computed once.
pub(crate) fn printed() -> &'static str {
    static PRINTED: OnceLock<String> = OnceLock::new();
    PRINTED.get_or_init(|| print(&[ONE], plain_library_with))
}

#[test]
fn what_is_left_out_is_refused_and_what_is_there_is_the_same() {
    assert!(printed().contains("reached -38 hgrid_build"));
}

#[test]
#[ignore = "slow: four more libraries"]
fn any_methods_may_be_left_out() {
    assert!(print(&ALL, library_with).contains("reached -38 hgrid_build"));
}
