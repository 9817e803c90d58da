//! Binaries with the static library in them: a program has the size that docs/embedded.md gives, and a shared library
//! exports none of hgrid's functions if it is linked with the flag of docs/install.md.

use std::fs;
use std::path::Path;

use hgrid_program_tests::sizes::check_sizes;
use hgrid_tests::artefact::{compiler, root, run, static_library};
use hgrid_tests::tools::{command, is_installed, leave_out};
use tempfile::TempDir;

use crate::prefix::output_of;

/// The largest acceptable size of a program with all methods.
const MOST_BYTES: u64 = 300_000;

#[test]
fn minimal_is_as_small_as_the_page_says() {
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        leave_out("docs/embedded.md has the size for x86-64 Linux");
        return;
    }
    let [program, library] = measure(&["-Wl,--gc-sections"]);
    assert!(program <= MOST_BYTES, "{program}");
    let words = ["stripped: ", " bytes, of which ", "it is ", " bytes, of which "];
    let [whole, whole_library] = measure(&[]);
    check_sizes(words, [program, library, whole, whole_library]);
}

#[test]
fn a_shared_library_can_keep_hgrid_inside() {
    if !cfg!(target_os = "linux") || !is_installed("binutils") {
        leave_out("the flag is that of linkers for ELF");
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let plugin = dir.path().join("plugin.so");
    let exports = |flags: &[&str]| {
        let mut compiler = compiler("c99");
        compiler.args(["-shared", "-fPIC"]).args(flags).arg(root().join("c_examples/minimal.c"));
        run(compiler.arg(static_library()).arg("-o").arg(&plugin));
        output_of(command("nm").args(["-D", "--defined-only"]).arg(&plugin))
    };
    assert!(exports(&[]).contains(" hgrid_build\n"));
    let inside = exports(&["-Wl,--exclude-libs,libhgrid.a"]);
    assert!(inside.contains(" main\n") && !inside.contains(" hgrid_"), "{inside}");
}

/// Returns the size of the stripped program, and the bytes in it that come from the library.
fn measure(flags: &[&str]) -> [u64; 2] {
    let dir = TempDir::new().expect("a folder");
    let [program, map] = ["minimal", "map"].map(|name| dir.path().join(name));
    let mut compiler = compiler("c99");
    compiler.args(["-Os", "-s"]).args(flags).arg(root().join("c_examples/minimal.c"));
    compiler.arg(static_library()).arg("-o").arg(&program);
    run(compiler.arg(format!("-Wl,-Map,{}", map.display())));
    [fs::metadata(program).expect("the program").len(), bytes_of_the_library(&map)]
}

/// Returns the bytes that the linker's map puts into memory from our archive. Its lines end with an address,
/// a size and a file; discarded sections are at address 0.
fn bytes_of_the_library(map: &Path) -> u64 {
    let map = fs::read_to_string(map).expect("a map");
    let number = |word: &str| u64::from_str_radix(word.strip_prefix("0x")?, 16).ok();
    let size = |line: &str| {
        let mut words = line.rsplit(' ').filter(|word| !word.is_empty());
        let (file, size, address) = (words.next()?, words.next()?, words.next()?);
        (file.contains("libhgrid.a(") && number(address)? > 0).then(|| number(size))?
    };
    let sum = map.lines().filter_map(size).sum();
    assert!(sum > 10_000, "{sum} bytes are too few; has the map's format changed?");
    sum
}
