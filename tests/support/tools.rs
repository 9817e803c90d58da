//! Programs that tests use if they are installed, and do without otherwise.
//!
//! A test that needs more than Rust, a C compiler, the C library and POSIX commands asks here. The variable
//! `HGRID_WITHOUT` lists programs to treat as missing, so that a machine with every program can run the tests
//! like one with few. With `HGRID_REQUIRE_ALL=1` every skip fails, except for programs in that list.

use std::collections::BTreeSet;
use std::env;
use std::ffi::OsString;
use std::io::{Write as _, stderr};
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use std::thread;

use crate::artefact::cpp_path;

/// The names that `HGRID_WITHOUT` takes, each with its programs. Those without a program are libraries, or
/// are needed only by scripts of .ci. tests/README.md tells how to install them.
pub const OPTIONAL: [(&str, &[&str]); 25] = [
    ("aarch64", &[]),
    ("armv7", &[]),
    ("asan", &[]),
    ("binutils", &["ar", "nm", "objcopy", "objdump", "readelf"]),
    ("c++", &["c++"]),
    ("cargo-c", &["cargo-cinstall"]),
    ("cargo-fuzz", &[]),
    ("clang", &["clang", "clang++"]),
    ("cmake", &["cmake"]),
    ("crates.io", &[]),
    ("embree", &[]),
    ("i686", &[]),
    ("libclang-rt", &[]),
    ("make", &["make"]),
    ("miri", &[]),
    ("mpi", &["mpicc", "mpirun"]),
    ("msrv", &[]),
    ("pkg-config", &["pkg-config"]),
    ("powerpc", &[]),
    ("rust-targets", &[]),
    ("rustup", &["rustup"]),
    ("script", &["script"]),
    ("tsan", &[]),
    ("valgrind", &["valgrind"]),
    ("wasm", &[]),
];

/// Returns the names in `HGRID_WITHOUT`.
fn left_out() -> BTreeSet<&'static str> {
    let list = env::var_os("HGRID_WITHOUT").unwrap_or_default();
    let list = list.to_string_lossy();
    let names = list.split(',').map(str::trim).filter(|name| !name.is_empty());
    let known = |name| {
        let mut all = OPTIONAL.iter().map(|(known, _)| *known);
        all.find(|known| *known == name).unwrap_or_else(|| {
            let all = OPTIONAL.map(|(known, _)| known).join(", ");
            panic!("HGRID_WITHOUT: `{name}` is none of {all}")
        })
    };
    names.map(known).collect()
}

/// Returns the path that starts a program.
fn path(program: &str) -> OsString {
    if program == "c++" { cpp_path().into() } else { program.into() }
}

fn runs(program: &str) -> bool {
    Command::new(path(program)).arg("--version").output().is_ok()
}

/// Returns true if all programs of a name in [`OPTIONAL`] are installed and not left out. If not, the test
/// prints what it does without.
///
/// # Panics
/// If there is no such name, here or in `HGRID_WITHOUT`.
pub fn is_installed(name: &str) -> bool {
    let entry = OPTIONAL.iter().find(|(known, _)| *known == name);
    let (_, programs) = entry.unwrap_or_else(|| panic!("`{name}` is not in OPTIONAL"));
    if left_out().contains(name) {
        leave_out(&format!("HGRID_WITHOUT names {name}"));
        return false;
    }
    let missing = programs.iter().find(|program| !runs(program));
    if let Some(program) = missing {
        skip(&format!("`{program}` is not installed"));
    }
    missing.is_none()
}

/// Returns a command that runs an optional program, for tests that asked [`is_installed`] before.
///
/// # Panics
/// If the program comes with no name in [`OPTIONAL`], or with one that is left out.
#[must_use]
pub fn command(program: &str) -> Command {
    let entry = OPTIONAL.iter().find(|(_, programs)| programs.contains(&program));
    let (name, _) = entry.unwrap_or_else(|| panic!("`{program}` is not in OPTIONAL"));
    assert!(!left_out().contains(name), "the test uses `{program}` and did not ask for {name}");
    Command::new(path(program))
}

/// Skips all or part of a test, because of something that another machine may have.
///
/// # Panics
/// If `HGRID_REQUIRE_ALL` is 1: then nothing may be missing.
pub fn skip(reason: &str) {
    let is_required = env::var_os("HGRID_REQUIRE_ALL").is_some_and(|value| value == "1");
    assert!(!is_required, "HGRID_REQUIRE_ALL forbids to skip this: {reason}");
    leave_out(reason);
}

/// Prints once per test why all or part of it is left out: because the user asked for that, or because it
/// does not apply to this machine.
///
/// The line bypasses the test harness, which shows a test's output only if the test fails.
pub fn leave_out(reason: &str) {
    static SAID: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let thread = thread::current();
    let line = format!("skipped in {}: {reason}\n", thread.name().unwrap_or("a thread"));
    let mut said = SAID.lock().unwrap_or_else(PoisonError::into_inner);
    if said.insert(line.clone()) {
        // If standard error is closed, the line is lost.
        let _ = stderr().write_all(line.as_bytes());
    }
}
