//! Builds where there is no operating system.
//!
//! A build for the host proves little: a crate without `std` may still depend on one that needs it. So these
//! tests build core and the C library for targets that have none, and measure how much of it a small program
//! keeps.

mod division;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use hgrid_program_tests::sizes::check_sizes;
use hgrid_tests::artefact::{cargo_in, library_dir, run, start_with, target_dir};
use hgrid_tests::tools::{command, is_installed, skip};
use tempfile::TempDir;

/// The longest time that `rustup` may take to fetch a target.
const PATIENCE: Duration = Duration::from_secs(60);

/// Returns the output of `rustc --print`.
fn rustc(what: &str) -> String {
    let said = run(Command::new("rustc").args(["--print", what])).stdout;
    String::from_utf8(said).expect("text").trim().to_owned()
}

/// Returns the folder of a target's libraries.
fn rustlib(target: &str) -> PathBuf {
    Path::new(&rustc("sysroot")).join("lib/rustlib").join(target)
}

/// Returns true if Rust can build for a target. If it cannot, the test says so and ends.
fn is_available(target: &str) -> bool {
    if !is_installed("rust-targets") {
        return false;
    }
    let libraries = rustlib(target).join("lib");
    if !libraries.is_dir() && !is_fetched(target) {
        skip(&format!("no Rust libraries for {target}, and rustup did not bring them"));
        return false;
    }
    true
}

/// Asks rustup for a target, for at most `PATIENCE`.
fn is_fetched(target: &str) -> bool {
    if !is_installed("rustup") {
        return false;
    }
    let mut rustup = command("rustup");
    let mut rustup = rustup.args(["--quiet", "target", "add", target]).spawn().expect("rustup");
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        if let Some(status) = rustup.try_wait().expect("a child can be asked") {
            return status.success();
        }
        sleep(Duration::from_millis(100));
    }
    rustup.kill().and_then(|()| rustup.wait()).expect("a child can be stopped");
    false
}

/// Returns cargo arguments that leave out all methods but one.
fn only(method: &str) -> [&str; 3] {
    ["--no-default-features", "--features", method]
}

/// Builds core and the C library for a target, and returns their folder. `arguments` may leave methods out; each choice
/// has a folder of its own, so that none replaces another.
///
/// Other targets are built at the same time if they are installed: two tests that name each other's need one build.
/// The dependencies are compiled once, for the choice of the quick tests, which starts with those of the C library.
fn build(target: &str, others: &[&str], arguments: &[&str]) -> PathBuf {
    let folder = target_dir().join("no_std");
    let dir = folder.join(arguments.last().unwrap_or(&"all"));
    let first = only("one-level");
    if arguments == first {
        // Host dependencies are compiled already, for the C library.
        start_with(&dir.join("release"), library_dir);
    } else {
        build(target, &[if target == BROWSER { MICROCONTROLLER } else { BROWSER }], &first);
        start_with(&dir, || folder.join(first[2]));
    }
    let others = others.iter().copied().filter(|other| rustlib(other).join("lib").is_dir());
    let mut build = cargo_in(&dir, "build");
    build.args(["--release", "-p", "hgrid-capi", "--target", target]).args(arguments);
    run(build.args(others.flat_map(|other| ["--target", other])));
    dir.join(target).join("release")
}

const MICROCONTROLLER: &str = "thumbv7em-none-eabihf";
const BROWSER: &str = "wasm32-unknown-unknown";

#[test]
fn a_microcontroller_gets_a_static_library() {
    if is_available(MICROCONTROLLER) {
        let dir = build(MICROCONTROLLER, &[BROWSER], &only("one-level"));
        let archive = dir.join("libhgrid.a");
        let bytes = fs::read(&archive).expect("the C library");
        assert!(bytes.starts_with(b"!<arch>\n"));
        check_flash("| `one-level` | ", &archive);
    }
}

#[test]
#[ignore = "slow: one more library, optimised as a whole"]
fn a_tree_takes_as_much_flash_as_the_page_says() {
    if is_available(MICROCONTROLLER) {
        let archive = build(MICROCONTROLLER, &[], &only("bvh")).join("libhgrid.a");
        check_flash("| `bvh` | ", &archive);
    }
}

#[test]
#[ignore = "slow: two more libraries, optimised as a whole"]
fn other_methods_take_as_much_flash_as_the_page_says() {
    if is_available(MICROCONTROLLER) {
        check_flash("| all | ", &build(MICROCONTROLLER, &[], &[]).join("libhgrid.a"));
        let archive = build(MICROCONTROLLER, &[], &only("fixed")).join("libhgrid.a");
        check_flash("| `fixed` | ", &archive);
    }
}

/// Links what programs need of the archive, as a linker that drops unused sections would, and compares the
/// size with a row of the table in docs/embedded.md.
fn check_flash(row: &str, archive: &Path) {
    let host = rustc("host-tuple");
    let linker = rustlib(&host).join("bin/rust-lld");
    if !linker.is_file() {
        skip(&format!("no linker comes with Rust for {host}"));
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let image = dir.path().join("image");
    let flash = |functions: &[&str]| {
        let mut linker = Command::new(&linker);
        linker.args(["-flavor", "gnu", "--gc-sections", "--oformat=binary", "-e", functions[0]]);
        for function in functions {
            linker.args(["-u", function]);
        }
        run(linker.arg(archive).arg("-o").arg(&image));
        fs::metadata(&image).expect("an image").len()
    };
    let traces = flash(&["hgrid_open", "hgrid_intersect"]);
    let builds = flash(&["hgrid_open", "hgrid_intersect", "hgrid_build"]);
    check_sizes([row, " | "], [traces, builds]);
}

#[test]
fn a_web_page_gets_a_module_that_needs_nothing() {
    check_module(&only("one-level"));
}

#[test]
#[ignore = "slow: one more library, optimised as a whole"]
fn a_web_page_gets_all_methods() {
    check_module(&[]);
}

fn check_module(arguments: &[&str]) {
    if is_available(BROWSER) {
        let dir = build(BROWSER, &[MICROCONTROLLER], arguments);
        let module = fs::read(dir.join("hgrid.wasm")).expect("the module");
        let sections = sections(&module);
        assert!(sections.contains(&EXPORTS) && !sections.contains(&IMPORTS), "{sections:?}");
    }
}

/// Ids of sections in a WebAssembly module.
const IMPORTS: u8 = 2;
const EXPORTS: u8 = 7;

/// Returns the ids of a module's sections. After eight bytes, each section has an id, a size and its contents.
fn sections(module: &[u8]) -> Vec<u8> {
    let mut rest = module.strip_prefix(b"\0asm\x01\0\0\0").expect("a module of version 1");
    let mut ids = Vec::new();
    while let [id, behind @ ..] = rest {
        let (size, contents) = leb128(behind);
        ids.push(*id);
        rest = &contents[size..];
    }
    ids
}

/// Reads a number of seven bits per byte, lowest first; returns it with the rest of the bytes.
fn leb128(bytes: &[u8]) -> (usize, &[u8]) {
    let length = bytes.iter().position(|byte| byte & 0x80 == 0).expect("its last byte") + 1;
    let (number, rest) = bytes.split_at(length);
    (number.iter().rev().fold(0, |sum, byte| sum << 7 | usize::from(byte & 0x7f)), rest)
}
