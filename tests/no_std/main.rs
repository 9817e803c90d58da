//! Does it build where there is no operating system?
//!
//! A host build proves little: a crate without `std` may still lean on one. So core and the C
//! library are built for machines that have none.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use hgrid_tests::artefact::{cargo_in, run, target_dir};

/// How long `rustup` may take to fetch a target.
const PATIENCE: Duration = Duration::from_secs(60);

/// Whether Rust can build for a target. If it cannot, the test says so and ends.
fn is_available(target: &str) -> bool {
    let sysroot = run(Command::new("rustc").args(["--print", "sysroot"])).stdout;
    let sysroot = String::from_utf8(sysroot).expect("text");
    let libraries = Path::new(sysroot.trim()).join("lib/rustlib").join(target).join("lib");
    if !libraries.is_dir() && !is_fetched(target) {
        println!("skipped: no Rust libraries for {target}, and rustup did not bring them");
        return false;
    }
    true
}

/// Asks rustup for a target, once and not for long.
fn is_fetched(target: &str) -> bool {
    let Ok(mut rustup) = Command::new("rustup").args(["--quiet", "target", "add", target]).spawn()
    else {
        return false;
    };
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

/// Builds the C library, and core for it, and returns the folder it is in: one for each target, so
/// that no build waits for the other.
fn build(target: &str) -> PathBuf {
    let dir = target_dir().join("no_std").join(target);
    run(cargo_in(&dir, "build").args(["--release", "-p", "hgrid-capi", "--target", target]));
    dir.join(target).join("release")
}

#[test]
fn a_microcontroller_gets_a_static_library() {
    let target = "thumbv7em-none-eabihf";
    if is_available(target) {
        let dir = build(target);
        let archive = fs::read(dir.join("libhgrid.a")).expect("the C library");
        assert!(archive.starts_with(b"!<arch>\n"));
    }
}

#[test]
fn a_web_page_gets_a_module_that_needs_nothing() {
    let target = "wasm32-unknown-unknown";
    if is_available(target) {
        let dir = build(target);
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
