//! The libraries export nothing but the header's functions, and need nothing but functions that move memory.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use hgrid_program_tests::symbols::{extract_ours, symbols, symbols_of_ours};
use hgrid_tests::artefact::{Flavour, compiler, root, run, static_library};
use hgrid_tests::tools::{command, is_installed};
use tempfile::TempDir;

use crate::header::functions;

/// Functions of the C library, or of the compiler's own, that compilers may call on their own.
const MEMORY: [&str; 5] = ["memcpy", "memmove", "memset", "memcmp", "bcmp"];

/// Functions of the C library that `hgrid_create` calls.
const ALLOCATOR: [&str; 2] = ["posix_memalign", "free"];

/// Returns true if a flavour may need a symbol.
fn may_need(flavour: Flavour, name: &str) -> bool {
    MEMORY.contains(&name) || flavour == Flavour::Malloc && ALLOCATOR.contains(&name)
}

/// Returns the committed list of a flavour's exports: `symbols.txt`, a name a line, with `malloc` after those
/// that only that flavour has.
fn exports(flavour: Flavour) -> BTreeSet<String> {
    let lines = include_str!("symbols.txt").lines();
    let names = lines.filter_map(|line| match line.split_once(' ') {
        None => Some(line),
        Some((name, "malloc")) => (flavour == Flavour::Malloc).then_some(name),
        Some((_, other)) => panic!("no flavour: {other}"),
    });
    names.map(str::to_owned).collect()
}

/// Returns the functions and source lines that call a symbol with one of the words in its name.
fn callers(archive: &Path, words: &[&str]) -> String {
    let dir = TempDir::new().expect("a folder");
    let object = extract_ours(archive, dir.path());
    let code = run(command("objdump").args(["-drlC", "--no-show-raw-insn"]).arg(object)).stdout;
    let (mut function, mut place, mut found) = ("", "", BTreeSet::new());
    let code = String::from_utf8_lossy(&code);
    for line in code.lines() {
        if line.ends_with(">:") {
            function = line;
        } else if line.starts_with('/') {
            place = line;
        } else if line.contains("R_X86") && words.iter().any(|word| line.contains(word)) {
            found.insert(format!("{place}\n    in {function}"));
        }
    }
    found.into_iter().collect::<Vec<_>>().join("\n")
}

#[test]
fn the_committed_list_is_what_the_header_declares() {
    let path = root().join("tests/c_abi/symbols.txt");
    let all = functions(Flavour::Malloc);
    let common = functions(Flavour::Bare);
    let line = |name: &String| {
        let flavour = if common.contains(name) { "" } else { " malloc" };
        format!("{name}{flavour}\n")
    };
    let list: String = all.iter().map(line).collect();
    if std::env::var_os("HGRID_BLESS").is_some() {
        fs::write(&path, &list).expect("tests/ can be written");
    }
    assert_eq!(fs::read_to_string(path).expect("the list"), list, "HGRID_BLESS=1 writes it anew");
}

#[test]
fn both_flavours_export_what_is_listed_and_no_more() {
    if !is_installed("binutils") {
        return;
    }
    for flavour in Flavour::ALL {
        let shared = symbols(&flavour.shared_library(), &["-D", "--defined-only"]);
        assert_eq!(shared, exports(flavour), "{flavour:?}");
        let ours = symbols_of_ours(&flavour.static_library(), &["--defined-only", "--extern-only"]);
        assert_eq!(ours, exports(flavour), "{flavour:?}");
    }
}

#[test]
fn the_static_libraries_need_nothing_but_memory() {
    if !is_installed("binutils") {
        return;
    }
    for flavour in Flavour::ALL {
        let needed = symbols_of_ours(&flavour.static_library(), &["--undefined-only"]);
        let more: Vec<_> = needed.iter().filter(|name| !may_need(flavour, name)).collect();
        assert!(more.is_empty(), "{flavour:?}: {more:?}");
    }
}

/// Fails if a library has a symbol with one of the words, and names its callers.
fn has_none(words: &[&str]) {
    if !is_installed("binutils") {
        return;
    }
    for flavour in Flavour::ALL {
        let archive = flavour.static_library();
        let all = symbols_of_ours(&archive, &[]);
        let is_bad = |name: &&String| words.iter().any(|word| name.contains(word));
        let bad: Vec<_> = all.iter().filter(is_bad).collect();
        assert!(bad.is_empty(), "{bad:#?}, called from\n{}", callers(&archive, words));
    }
}

/// A panic would end a C program without explanation. Without the symbols there is no panic.
#[test]
fn nothing_panics_allocates_or_starts_threads() {
    has_none(&["panic", "_fail", "__rust_", "alloc", "pthread", "unwind"]);
}

/// A vector operation that is a function passes its operands in memory: the compiler did not inline a
/// closure. Such calls once took a seventh to a fifth of a tile's time, and only in programs compiled for any
/// machine. (The word is in the names of fearless_simd's functions as of 1.2.)
#[test]
fn no_vector_operation_is_a_function() {
    has_none(&["fearless_simd_kernel"]);
}

/// The libraries that rustc would tell a C programmer to link. They do not depend on the profile, so a quick
/// one serves.
#[test]
#[ignore = "slow: compiles both flavours again"]
fn neither_flavour_asks_for_a_library() {
    for flavour in Flavour::ALL {
        assert_eq!(flavour.debug_build().links, "", "{flavour:?}");
    }
}

/// Two libraries may each contain a copy of this one. Only the names that C sees can clash, so with other
/// names for these the second copy can be linked beside the first.
#[test]
fn two_copies_in_one_program_do_not_clash() {
    if !is_installed("binutils") {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let [copy, program] = ["copy.o", "copies"].map(|name| dir.path().join(name));
    let mut objcopy = command("objcopy");
    for function in functions(Flavour::Bare) {
        objcopy.arg("--redefine-sym").arg(format!("{function}=other_{function}"));
    }
    run(objcopy.arg(extract_ours(&static_library(), dir.path())).arg(&copy));
    let source = root().join("tests/c_abi/copies.c");
    run(compiler("c99")
        .arg("-D_DEFAULT_SOURCE")
        .arg(source)
        .arg(copy)
        .arg(static_library())
        .arg("-o")
        .arg(&program));
    run(&mut Command::new(program));
}

/// Another Rust library that does not know this one has the same run-time parts.
#[test]
fn the_library_of_another_vendor_in_rust_does_not_clash() {
    let dir = TempDir::new().expect("a folder");
    let [vendor, program] = ["libvendor.a", "vendors"].map(|name| dir.path().join(name));
    let source = |name: &str| root().join("tests/c_abi").join(name);
    // Unused parts of core must be left out: they need unwinding, which no_std does not have.
    for level in ["3", "s"] {
        run(Command::new("rustc")
            .args(["--edition", "2024", "--crate-type", "staticlib", "-C", "panic=abort"])
            .args(["-C", "lto=fat", "-C", &format!("opt-level={level}")])
            .arg(source("vendor.rs"))
            .arg("-o")
            .arg(&vendor));
        for flavour in Flavour::ALL {
            let ours = flavour.static_library();
            for order in [[&vendor, &ours], [&ours, &vendor]] {
                let mut compiler = compiler("c99");
                compiler.arg("-D_DEFAULT_SOURCE").arg(source("vendors.c")).args(order);
                run(compiler.arg("-o").arg(&program));
                run(&mut Command::new(&program));
            }
        }
    }
}

#[test]
fn the_shared_libraries_need_nothing_but_libc() {
    if !is_installed("binutils") {
        return;
    }
    for flavour in Flavour::ALL {
        let needed = symbols(&flavour.shared_library(), &["-D", "--undefined-only"]);
        let is_known = |name: &&String| {
            let name = name.split('@').next().unwrap_or_default();
            // Hooks that the C start-up code offers every library, weak and unused.
            let hooks = ["__cxa_finalize", "__gmon_start__"];
            may_need(flavour, name) || hooks.contains(&name) || name.starts_with("_ITM_")
        };
        let more: Vec<_> = needed.iter().filter(|name| !is_known(name)).collect();
        assert!(more.is_empty(), "{flavour:?}: {more:?}");
    }
}
