//! Libraries with fewer methods, for little flash.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use hgrid_core::Method;
use hgrid_tests::artefact::{compiler, library_with, run, static_library};
use tempfile::TempDir;

use crate::programs::{SANITIZERS, compile};

/// Features, and the methods that they bring.
const LIBRARIES: [(&str, &[Method]); 4] = [
    ("fixed", &[Method::OneLevel, Method::Fixed]),
    ("variable", &[Method::OneLevel, Method::Variable]),
    ("bvh,recursive", &[Method::Bvh, Method::Recursive]),
    ("bvh", &[Method::Bvh]),
];

/// What `left_out.c` prints with each of them, about grids of a library that has all methods.
pub(crate) fn printed() -> &'static str {
    static PRINTED: OnceLock<String> = OnceLock::new();
    PRINTED.get_or_init(|| {
        let dir = TempDir::new().expect("a folder");
        let program = |name: &str, library: &Path| {
            let dir = dir.path().join(name);
            fs::create_dir(&dir).expect("a folder");
            compile("left_out", compiler("c99"), &SANITIZERS, library, &dir)
        };
        run(Command::new(program("all", &static_library())).arg("write").arg(dir.path()));
        let outputs = LIBRARIES.map(|(features, methods)| {
            let mut reads = Command::new(program(features, &library_with(features)));
            reads.arg("read").arg(dir.path());
            reads.args(methods.iter().map(|&method| (method as u32).to_string()));
            String::from_utf8(run(&mut reads).stdout).expect("text")
        });
        outputs.concat()
    })
}

#[test]
fn what_is_left_out_is_refused_and_what_is_there_is_the_same() {
    assert!(printed().contains("reached -38 hgrid_build"));
}
