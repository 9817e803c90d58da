//! The archive that `dist/make` makes for this machine, used without Rust.

use std::env;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use hgrid_program_tests::symbols::symbols;
use hgrid_tests::artefact::{bare_compiler, output, root, run, target_dir};
use hgrid_tests::tools::{command, is_installed, skip};
use tempfile::TempDir;

use crate::cmake::{build_and_run_by, cmake, configure, has_cmake};
use crate::installed::soname;
use crate::prefix::{HIT, VERSION, dynamic, files, output_of, program};

/// The first line that hello.cpp prints.
const HELLO: &str = "triangle 2 at t = 2\n";

/// Returns the archive, made once; `None` after a message if tools for it are missing.
fn archive() -> Option<&'static Path> {
    static ARCHIVE: OnceLock<PathBuf> = OnceLock::new();
    for program in ["bash", "tar", "gzip", "sha256sum"] {
        if Command::new(program).arg("--version").output().is_err() {
            skip(&format!("`{program}` is not installed"));
            return None;
        }
    }
    Some(ARCHIVE.get_or_init(|| {
        let mut make = Command::new(root().join("dist/make"));
        make.env("CARGO", env!("CARGO")).env("CARGO_NET_OFFLINE", "true");
        make.env("CARGO_TARGET_DIR", target_dir()).env("HGRID_DIST", target_dir().join("dist"));
        make.env("CC", bare_compiler().get_program());
        let Output { stdout, stderr, .. } = run(&mut make);
        let tried = String::from_utf8(stderr).expect("text");
        let methods = "bvh one-level fixed variable recursive";
        assert_eq!(tried, format!("hgrid {VERSION}: {methods}: right\n"));
        String::from_utf8(stdout).expect("text").trim_end().into()
    }))
}

/// Unpacks the archive into a folder of its own.
fn unpacked() -> Option<(TempDir, PathBuf)> {
    let archive = archive()?;
    let dir = TempDir::new().expect("a folder");
    run(Command::new("tar").arg("-xzf").arg(archive).current_dir(dir.path()));
    let name = archive.file_name().and_then(|name| name.to_str()?.strip_suffix(".tar.gz"));
    let folder = dir.path().join(name.expect("NAME.tar.gz"));
    Some((dir, folder))
}

/// Returns a folder with links to all programs of this machine except those of Rust.
fn programs_without_rust() -> &'static Path {
    static DIR: OnceLock<TempDir> = OnceLock::new();
    let dir = DIR.get_or_init(|| {
        let dir = TempDir::new().expect("a folder");
        let path = env::var_os("PATH").expect("a path");
        let folders = env::split_paths(&path).filter_map(|folder| fs::read_dir(folder).ok());
        for program in folders.flatten().flatten() {
            let name = program.file_name();
            let is_of_rust = ["cargo", "rust"]
                .iter()
                .any(|rust| name.as_encoded_bytes().starts_with(rust.as_bytes()));
            if !is_of_rust {
                // The first program of a name is the one that a shell would run.
                let _ = symlink(program.path(), dir.path().join(name));
            }
        }
        dir
    });
    dir.path()
}

/// Removes Rust from a command's environment.
fn without_rust(mut command: Command) -> Command {
    for (name, _) in env::vars_os() {
        if name.to_str().is_some_and(|name| name.starts_with("CARGO") || name.starts_with("RUST")) {
            command.env_remove(name);
        }
    }
    let programs = programs_without_rust();
    command.env("PATH", programs).env("HOME", programs);
    command
}

/// Returns a cmake command that finds no Rust.
fn rustless_cmake() -> Command {
    without_rust(cmake())
}

#[test]
#[ignore = "slow: an archive for this machine, made from nothing"]
fn the_archive_has_what_it_says() {
    let Some((_dir, folder)) = unpacked() else { return };
    let shared = format!("lib/libhgrid.so.{VERSION}");
    let short = format!("lib/{}", soname());
    let mut expected: Vec<&Path> = [
        "CMakeLists.txt",
        "LICENSE-APACHE",
        "LICENSE-MIT",
        "README.md",
        "check/check.c",
        "include/hgrid.h",
        "include/hgrid.hpp",
        "lib/libhgrid.a",
        "lib/libhgrid.so",
        "lib/pkgconfig/hgrid.pc",
        "share/cmake/hgrid/hgrid-build.cmake",
        "share/cmake/hgrid/hgrid-config-version.cmake",
        "share/cmake/hgrid/hgrid-config.cmake",
        &shared,
        &short,
    ]
    .map(Path::new)
    .to_vec();
    expected.sort();
    assert_eq!(files(&folder), expected);
    for name in ["README.md", "lib/pkgconfig/hgrid.pc", "share/cmake/hgrid/hgrid-build.cmake"] {
        let text = fs::read_to_string(folder.join(name)).expect("text");
        assert!(!text.contains('@'), "{name} has an unfilled @ placeholder:\n{text}");
    }
    // No library contains the path where it was made.
    let here = root().to_str().expect("a path in UTF-8").as_bytes();
    for name in ["libhgrid.a", "libhgrid.so"] {
        let library = fs::read(folder.join("lib").join(name)).expect("a library");
        assert!(!library.windows(here.len()).any(|window| window == here), "{name}");
    }
    if is_installed("binutils") {
        let library = folder.join("lib/libhgrid.so");
        assert_eq!(dynamic(&library, "SONAME"), [soname()]);
        assert!(dynamic(&library, "NEEDED").iter().all(|name| name.starts_with("libc.")));
        let exported = symbols(&library, &["-D", "--defined-only"]);
        assert!(exported.contains("hgrid_create"), "{exported:?}");
    }
}

#[test]
#[ignore = "slow: an archive for this machine, made from nothing"]
fn the_archive_has_a_name_and_a_sum() {
    let Some(archive) = archive() else { return };
    let name = archive.file_name().and_then(|name| name.to_str()).expect("a name");
    let target = name.strip_prefix(&format!("hgrid-{VERSION}-"));
    let target = target.and_then(|rest| rest.strip_suffix(".tar.gz")).expect("a target");
    let said = run(Command::new("rustc").arg("-vV")).stdout;
    assert!(String::from_utf8_lossy(&said).contains(&format!("host: {target}\n")), "{target}");
    let mut check = Command::new("sha256sum");
    run(check
        .args(["-c", &format!("{name}.sha256")])
        .current_dir(archive.parent().expect("a folder")));
}

/// Follows the README in the archive.
#[test]
#[ignore = "slow: an archive for this machine, made from nothing"]
fn the_archive_brings_a_program_that_checks_it() {
    let Some((_dir, folder)) = unpacked() else { return };
    let mut compile = without_rust(bare_compiler());
    compile.args(["-Iinclude", "check/check.c", "lib/libhgrid.a", "-o", "hgrid-check"]);
    run(compile.current_dir(&folder));
    let printed = output_of(&mut program(&folder.join("hgrid-check")));
    assert!(printed.ends_with(": right\n"), "{printed}");
}

#[test]
#[ignore = "slow: an archive for this machine, made from nothing"]
fn an_empty_project_finds_the_package_in_the_archive() {
    if !has_cmake() {
        return;
    }
    let Some((_dir, folder)) = unpacked() else { return };
    let (_dir, [shared, static_]) = build_and_run_by(rustless_cmake, &folder);
    if is_installed("binutils") {
        assert!(dynamic(&shared, "NEEDED").contains(&soname()));
        assert!(!dynamic(&static_, "NEEDED").contains(&soname()));
    }
}

#[test]
#[ignore = "slow: an archive for this machine, made from nothing"]
fn pkg_config_finds_the_library_in_the_archive() {
    if !is_installed("pkg-config") {
        return;
    }
    let Some((dir, folder)) = unpacked() else { return };
    let mut ask = without_rust(command("pkg-config"));
    ask.env("PKG_CONFIG_PATH", folder.join("lib/pkgconfig"));
    let answer = output_of(ask.args(["--cflags", "--libs", "hgrid"]));
    let path = dir.path().join("program");
    let mut compile = without_rust(bare_compiler());
    compile.arg(root().join("c_examples/minimal.c")).args(answer.split_whitespace());
    run(compile.arg("-o").arg(&path));
    let printed = output_of(program(&path).env("LD_LIBRARY_PATH", folder.join("lib")));
    assert!(printed.ends_with(HIT), "{printed}");

    // The static library of hgrid alone, as docs/install.md links it: with `--static` alone the linker takes
    // the shared one.
    let mut ask = without_rust(command("pkg-config"));
    ask.env("PKG_CONFIG_PATH", folder.join("lib/pkgconfig"));
    let libdir = output_of(ask.args(["--variable=libdir", "hgrid"]));
    let library = Path::new(libdir.trim()).join("libhgrid.a");
    let includes = answer.split_whitespace().filter(|flag| !flag.starts_with("-l"));
    let mut compile = without_rust(bare_compiler());
    compile.arg(root().join("c_examples/minimal.c")).args(includes).arg(library);
    run(compile.arg("-o").arg(&path));
    assert!(!dynamic(&path, "NEEDED").contains(&soname()));
    let printed = output_of(&mut program(&path));
    assert!(printed.ends_with(HIT), "{printed}");
}

/// Builds a project that has hgrid in a subfolder, and runs its two programs.
pub(crate) fn build_within(cmake: fn() -> Command, hgrid: &Path, options: &[String]) -> TempDir {
    let dir = TempDir::new().expect("a folder");
    let mut ask = cmake();
    ask.arg(format!("-DHGRID={}", hgrid.display())).args(options);
    ask.arg(format!("-DSOURCE={}", root().join("c_examples/hello.cpp").display()));
    let Output { status, stderr, .. } =
        configure(ask, &root().join("tests/packages/within"), dir.path());
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    run(cmake().arg("--build").arg(dir.path()));
    for name in ["shared", "static"] {
        let printed = output_of(&mut program(&dir.path().join(name)));
        assert!(printed.starts_with(HELLO), "{printed}");
    }
    dir
}

#[test]
#[ignore = "slow: an archive for this machine, made from nothing"]
fn a_project_has_the_archive_in_a_folder_of_its_own() {
    if !has_cmake() || !is_installed("c++") {
        return;
    }
    let Some((_dir, folder)) = unpacked() else { return };
    build_within(rustless_cmake, &folder, &[]);
    // CMake can unpack the archive itself.
    build_within(rustless_cmake, archive().expect("it was unpacked"), &[]);
}

#[test]
#[ignore = "slow: an archive for this machine, made from nothing"]
fn a_checkout_takes_an_archive_in_place_of_cargo() {
    if !has_cmake() || !is_installed("c++") {
        return;
    }
    let Some((_dir, folder)) = unpacked() else { return };
    build_within(rustless_cmake, root(), &[format!("-DHGRID_PREBUILT={}", folder.display())]);
}

/// Without cargo or an archive, the message names both ways to get the library.
#[test]
fn a_checkout_without_cargo_says_how_to_get_it() {
    if !has_cmake() {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let Output { status, stderr, .. } = configure(rustless_cmake(), root(), dir.path());
    let said = String::from_utf8(stderr).expect("text");
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    let line = "hgrid: no cargo: install Rust from https://rustup.rs, or set HGRID_PREBUILT to an \
                unpacked archive";
    assert!(!status.success() && said.contains(line), "{said}");

    let mut cmake = rustless_cmake();
    cmake.arg(format!("-DHGRID_PREBUILT={}", dir.path().display()));
    let Output { status, stderr, .. } = configure(cmake, root(), &dir.path().join("build"));
    let said = String::from_utf8(stderr).expect("text");
    assert!(!status.success() && said.contains("HGRID_PREBUILT is no unpacked"), "{said}");
}

/// The README of an archive for a microcontroller does not send its reader to this machine's compiler.
#[test]
fn an_archive_for_a_bare_machine_asks_for_a_cross_compiler() {
    let tools = ["bash", "tar", "gzip"];
    if tools.iter().any(|tool| Command::new(tool).arg("--version").output().is_err()) {
        skip("`bash`, `tar` or `gzip` is not installed");
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let target = "thumbv6m-none-eabi";
    let library = dir.path().join("archives").join(target).join("release");
    fs::create_dir_all(&library).expect("a folder");
    fs::write(library.join("libhgrid.a"), "").expect("a library");
    let mut make = Command::new(root().join("dist/make"));
    // `echo` builds nothing: the library is there.
    make.arg(target).env("CARGO", "echo").env("CARGO_TARGET_DIR", dir.path());
    let archive = output_of(make.env("HGRID_DIST", dir.path()));
    let readme = format!("hgrid-{VERSION}-{target}/README.md");
    let mut tar = Command::new("tar");
    let readme = output_of(tar.args(["-xzOf", archive.trim_end(), &readme]));
    let (before, _) = readme.split_once("cc -Iinclude").expect("a command");
    assert!(before.contains("`cc` stands for your cross compiler"), "{readme}");
    assert!(!readme.contains('@'), "{readme}");
}

#[test]
#[ignore = "slow: an archive for this machine, made from nothing"]
fn an_archive_for_an_unknown_target_is_refused() {
    let mut make = Command::new(root().join("dist/make"));
    make.arg("pdp11-dec-rsx")
        .env("CARGO", env!("CARGO"))
        .env("HGRID_DIST", target_dir().join("dist"));
    if archive().is_some() {
        let Output { status, stderr, .. } = output(&mut make);
        let said = String::from_utf8(stderr).expect("text");
        assert!(!status.success() && said.contains("Rust knows no target pdp11-dec-rsx"), "{said}");
    }
}
