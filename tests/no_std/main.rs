//! Does it build where there is no operating system?
//!
//! A host build proves little: a crate without `std` may still lean on one. So core and the C
//! library are built for machines that have none, and what a small one keeps of it is measured.

mod division;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use hgrid_tests::artefact::{cargo_in, run, target_dir};
use hgrid_tests::readme::check_sizes;
use hgrid_tests::tools::{command, is_installed, skip};
use tempfile::TempDir;

/// How long `rustup` may take to fetch a target.
const PATIENCE: Duration = Duration::from_secs(60);

/// What rustc says about itself.
fn rustc(what: &str) -> String {
    let said = run(Command::new("rustc").args(["--print", what])).stdout;
    String::from_utf8(said).expect("text").trim().to_owned()
}

/// Where Rust keeps what belongs to a target.
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

/// Asks rustup for a target, once and not for long.
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

/// What leaves out all methods but one.
fn only(method: &str) -> [&str; 3] {
    ["--no-default-features", "--features", method]
}

/// Builds the C library, and core for it, and returns the folder it is in: one for each target and its
/// methods, so that no build waits for the other. Arguments may leave methods out.
fn build(target: &str, arguments: &[&str]) -> PathBuf {
    let dir = target_dir().join("no_std").join(target).join(arguments.last().unwrap_or(&"all"));
    let mut build = cargo_in(&dir, "build");
    let library = ["--release", "-p", "hgrid-capi", "--target", target];
    run(build.args(library).args(arguments));
    dir.join(target).join("release")
}

const MICROCONTROLLER: &str = "thumbv7em-none-eabihf";

#[test]
fn a_microcontroller_gets_a_static_library() {
    if is_available(MICROCONTROLLER) {
        let archive = build(MICROCONTROLLER, &only("one-level")).join("libhgrid.a");
        let bytes = fs::read(&archive).expect("the C library");
        assert!(bytes.starts_with(b"!<arch>\n"));
        check_flash("| `one-level` | ", &archive);
    }
}

#[test]
#[ignore = "slow: three more libraries, optimised as a whole"]
fn each_method_takes_as_much_flash_as_the_page_says() {
    if is_available(MICROCONTROLLER) {
        check_flash("| all | ", &build(MICROCONTROLLER, &[]).join("libhgrid.a"));
        for method in ["fixed", "bvh"] {
            let archive = build(MICROCONTROLLER, &only(method)).join("libhgrid.a");
            check_flash(&format!("| `{method}` | "), &archive);
        }
    }
}

/// Links what programs need of the archive, and of nothing else, as the linker would for them, and
/// compares it with a row of the table in docs/embedded.md.
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
    let target = "wasm32-unknown-unknown";
    if is_available(target) {
        let dir = build(target, arguments);
        let module = fs::read(dir.join("hgrid.wasm")).expect("the module");
        let sections = sections(&module);
        assert!(sections.contains(&EXPORTS) && !sections.contains(&IMPORTS), "{sections:?}");
    }
}

/// Ids of sections in a WebAssembly module.
const IMPORTS: u8 = 2;
const EXPORTS: u8 = 7;

/// The ids of a module's sections: behind eight bytes, each is an id, a size and so many bytes.
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

/// A number in seven bits a byte, lowest first, and what is behind it.
fn leb128(bytes: &[u8]) -> (usize, &[u8]) {
    let length = bytes.iter().position(|byte| byte & 0x80 == 0).expect("its last byte") + 1;
    let (number, rest) = bytes.split_at(length);
    (number.iter().rev().fold(0, |sum, byte| sum << 7 | usize::from(byte & 0x7f)), rest)
}
