//! A query through hgrid.hpp costs what the C call costs, because it is the C call.
//!
//! cost.c and cost.cpp contain the same functions. The test compares the compiled functions: the calls that
//! each makes, and its size.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use hgrid_tests::artefact::{clang, compiler, cpp_compiler, root, run};
use hgrid_tests::tools::{command, is_installed};
use tempfile::TempDir;

use crate::programs::printed;

/// The facts of a compiled function that the test compares.
#[derive(Debug, Default, PartialEq, Eq)]
struct Function {
    /// The library functions that it calls, sorted.
    calls: Vec<String>,
    bytes: u64,
}

/// Returns the functions of an object file, each of which has a section of its own.
fn functions(object: &Path) -> BTreeMap<String, Function> {
    let mut functions = BTreeMap::<String, Function>::new();
    let sizes = printed(command("nm").args(["--print-size", "--radix=d"]).arg(object));
    for line in sizes.lines() {
        if let [_, bytes, "T", name] = line.split_whitespace().collect::<Vec<_>>()[..] {
            functions.entry(name.to_owned()).or_default().bytes = bytes.parse().expect("a number");
        }
    }
    let mut section = String::new();
    for line in printed(command("objdump").arg("-r").arg(object)).lines() {
        if let Some(name) = line.strip_prefix("RELOCATION RECORDS FOR [.text.") {
            section = name.trim_end_matches("]:").to_owned();
        } else if line.starts_with("RELOCATION RECORDS") {
            section.clear();
        }
        let symbol = line.split_whitespace().nth(2).unwrap_or_default();
        let symbol = symbol.split(['-', '+']).next().unwrap_or_default();
        if let Some(function) = functions.get_mut(&section)
            && symbol.starts_with("hgrid_")
        {
            function.calls.push(symbol.to_owned());
            function.calls.sort();
        }
    }
    functions
}

/// Returns the symbols that an object file needs from others.
fn wanted(object: &Path) -> Vec<String> {
    let names = printed(command("nm").arg("--undefined-only").arg(object));
    let names = names.lines().filter_map(|line| line.split_whitespace().last());
    // A compiler may copy structs with or without a call.
    let names = names.filter(|name| !["memcpy", "memset", "_GLOBAL_OFFSET_TABLE_"].contains(name));
    names.map(str::to_owned).collect()
}

#[test]
fn queries_through_the_header_are_the_calls_in_c() {
    if !is_installed("binutils") {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let object = |mut compiler: Command, flags: &[&str], source: &str| {
        let object = dir.path().join("cost.o");
        compiler.args(["-O2", "-DNDEBUG", "-ffunction-sections", "-c", "-o"]).arg(&object);
        run(compiler.args(flags).arg(root().join("tests/examples").join(source)));
        (functions(&object), wanted(&object))
    };
    let usual = cpp_compiler("c++17").map(|cpp| (compiler("c99"), cpp));
    for (c, cpp) in usual.into_iter().chain(clang("c99").zip(clang("c++17"))) {
        let compiler_name = cpp.get_program().display().to_string();
        let (by_hand, wanted_by_hand) = object(c, &[], "cost.c");
        let flags = ["-fno-exceptions", "-fno-rtti"];
        let (through_header, wanted_through_header) = object(cpp, &flags, "cost.cpp");
        assert_eq!(by_hand.len(), 8, "{by_hand:?}");
        assert_eq!(wanted_through_header, wanted_by_hand, "{compiler_name}");
        for (name, by_hand) in &by_hand {
            let through_header = &through_header[name];
            assert_eq!(by_hand.calls.len(), 1, "{name}");
            assert_eq!(through_header.calls, by_hand.calls, "{compiler_name}: {name}");
            // A build takes time for every triangle, so a few more instructions that copy its arguments do no harm.
            let most = by_hand.bytes + by_hand.bytes / 4 + 16;
            assert!(
                name == "build" || through_header.bytes <= most,
                "{compiler_name}: {name} has {} bytes, {} by hand",
                through_header.bytes,
                by_hand.bytes
            );
        }
    }
}
