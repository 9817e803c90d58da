//! What the libraries export and what they need: nothing but the header's functions, and nothing
//! but moving memory.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use hgrid_tests::artefact::{compiler, is_installed, root, run, shared_library, static_library};
use tempfile::TempDir;

use crate::header::functions;

/// What compilers may ask of any C library, or of the compiler's own, behind the program's back.
const MEMORY: [&str; 5] = ["memcpy", "memmove", "memset", "memcmp", "bcmp"];

/// The symbols that `nm` lists with these flags.
fn symbols(library: &Path, flags: &[&str]) -> BTreeSet<String> {
    let output = run(Command::new("nm").args(flags).arg(library));
    let text = String::from_utf8(output.stdout).expect("text");
    let lines = text.lines().filter(|line| !line.is_empty() && !line.ends_with(':'));
    lines.filter_map(|line| Some(line.rsplit(' ').next()?.to_owned())).collect()
}

/// The object in the archive that is ours, put into a folder. The others are the compiler's run-time
/// library, from which the linker takes what a target lacks.
fn our_object(dir: &Path) -> PathBuf {
    let archive = static_library();
    let members = run(Command::new("ar").arg("t").arg(&archive)).stdout;
    let members = String::from_utf8(members).expect("text");
    let ours: Vec<_> = members.lines().filter(|name| name.starts_with("hgrid.")).collect();
    let [ours] = ours[..] else { panic!("one object after link-time optimisation, not {ours:?}") };
    run(Command::new("ar").current_dir(dir).arg("x").arg(&archive).arg(ours));
    dir.join(ours)
}

fn symbols_of_our_object(flags: &[&str]) -> BTreeSet<String> {
    let dir = TempDir::new().expect("a folder");
    symbols(&our_object(dir.path()), flags)
}

/// Functions and source lines from which a symbol with one of the words is called.
fn callers(words: &[&str]) -> String {
    let dir = TempDir::new().expect("a folder");
    let object = our_object(dir.path());
    let code =
        run(Command::new("objdump").args(["-drlC", "--no-show-raw-insn"]).arg(object)).stdout;
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
fn the_shared_library_exports_the_headers_functions() {
    if is_installed("nm") {
        let exported = symbols(&shared_library(), &["-D", "--defined-only"]);
        assert_eq!(exported, functions().into_iter().collect());
    }
}

#[test]
fn the_static_library_exports_the_headers_functions() {
    if is_installed("nm") {
        let exported = symbols_of_our_object(&["--defined-only", "--extern-only"]);
        assert_eq!(exported, functions().into_iter().collect());
    }
}

#[test]
fn the_static_library_needs_nothing_but_memory_moves() {
    if is_installed("nm") {
        let needed = symbols_of_our_object(&["--undefined-only"]);
        let more: Vec<_> = needed.iter().filter(|name| !MEMORY.contains(&name.as_str())).collect();
        assert!(more.is_empty(), "{more:?}");
    }
}

/// A panic would end the program of a user who never heard of one. No symbol, no panic.
#[test]
fn nothing_panics_allocates_or_starts_threads() {
    if is_installed("nm") {
        let all = symbols_of_our_object(&[]);
        let words = ["panic", "_fail", "__rust_", "alloc", "pthread", "unwind"];
        let is_bad = |name: &&String| words.iter().any(|word| name.contains(word));
        let bad: Vec<_> = all.iter().filter(is_bad).collect();
        assert!(bad.is_empty(), "{bad:#?}, called from\n{}", callers(&words));
    }
}

/// Two libraries may each have taken in a copy of this one. Nothing but the names that C sees can
/// meet, so with others for these the second copy lies beside the first.
#[test]
fn two_copies_in_one_program_do_not_clash() {
    if !is_installed("objcopy") {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let [copy, program] = ["copy.o", "copies"].map(|name| dir.path().join(name));
    let mut objcopy = Command::new("objcopy");
    for function in functions() {
        objcopy.arg("--redefine-sym").arg(format!("{function}=other_{function}"));
    }
    run(objcopy.arg(our_object(dir.path())).arg(&copy));
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

#[test]
fn the_shared_library_needs_nothing_but_libc() {
    if is_installed("nm") {
        let needed = symbols(&shared_library(), &["-D", "--undefined-only"]);
        let is_known = |name: &&String| {
            let name = name.split('@').next().unwrap_or_default();
            // Hooks that the C start-up code offers every library, weak and unused.
            let hooks = ["__cxa_finalize", "__gmon_start__"];
            MEMORY.contains(&name) || hooks.contains(&name) || name.starts_with("_ITM_")
        };
        let more: Vec<_> = needed.iter().filter(|name| !is_known(name)).collect();
        assert!(more.is_empty(), "{more:?}");
    }
}
