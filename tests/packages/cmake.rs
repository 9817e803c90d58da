//! A project that uses CMake's `find_package(hgrid)` and two targets.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use hgrid_tests::artefact::{Flavour, compiler, output, root, run};
use hgrid_tests::tools::{command, is_installed};
use tempfile::TempDir;

use crate::installed::soname;
use crate::prefix::{HIT, Prefix, VERSION, dynamic, installed, laid_out, output_of, program};

/// Returns true if cmake and make are installed: CMake only writes files for make.
pub(crate) fn has_cmake() -> bool {
    is_installed("cmake") && is_installed("make")
}

/// Returns a cmake command without settings from the environment.
pub(crate) fn cmake() -> Command {
    let mut cmake = command("cmake");
    for name in ["CMAKE_PREFIX_PATH", "CMAKE_GENERATOR", "CFLAGS", "LDFLAGS", "MAKEFLAGS"] {
        cmake.env_remove(name);
    }
    cmake
}

/// Configures a project with a cmake command.
pub(crate) fn configure(mut cmake: Command, project: &Path, build: &Path) -> Output {
    output(cmake.arg("-S").arg(project).arg("-B").arg(build))
}

/// Configures a project that looks for packages in a folder.
fn configure_with(mut cmake: Command, project: &Path, prefix: &Path, build: &Path) -> Output {
    cmake.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display()));
    cmake.arg(format!("-DSOURCE={}", root().join("c_examples/minimal.c").display()));
    configure(cmake, project, build)
}

/// Builds the project in tests/packages/outside with the library in a folder, and runs its two programs.
fn build_and_run(prefix: &Path) -> (TempDir, [PathBuf; 2]) {
    build_and_run_by(cmake, prefix)
}

/// Does the same with another cmake command.
pub(crate) fn build_and_run_by(cmake: fn() -> Command, prefix: &Path) -> (TempDir, [PathBuf; 2]) {
    let dir = TempDir::new().expect("a folder");
    let project = root().join("tests/packages/outside");
    let Output { status, stderr, .. } = configure_with(cmake(), &project, prefix, dir.path());
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    run(cmake().arg("--build").arg(dir.path()));
    let programs = ["shared", "static"].map(|name| dir.path().join(name));
    for path in &programs {
        let printed = output_of(&mut program(path));
        assert!(printed.ends_with(HIT), "{printed}");
    }
    (dir, programs)
}

#[test]
fn a_project_links_what_cargo_c_installs() {
    if !has_cmake() || !is_installed("binutils") {
        return;
    }
    let Some(Prefix { dir, .. }) = installed(Flavour::Bare) else { return };
    let (_dir, [shared, static_]) = build_and_run(dir);
    assert!(dynamic(&shared, "NEEDED").contains(&soname()));
    assert!(!dynamic(&static_, "NEEDED").contains(&soname()));
}

/// Debian has a folder for each architecture, Fedora has lib64, most others lib; and packages may be moved
/// after they were laid out.
#[test]
fn a_project_finds_libraries_wherever_they_lie() {
    if !has_cmake() {
        return;
    }
    let architecture = output_of(compiler("c99").arg("-print-multiarch"));
    let mut places = vec!["lib".to_owned(), "lib64".to_owned()];
    if !architecture.trim().is_empty() {
        places.push(format!("lib/{}", architecture.trim()));
    }
    for place in places {
        let (temporary, prefix) = laid_out(&place);
        build_and_run(&prefix.dir);
        let moved = temporary.path().join("another place");
        fs::rename(&prefix.dir, &moved).expect("a new place");
        build_and_run(&moved);
    }
}

/// Where lib64 has the libraries of one machine and lib those of another, a program for 32 bits gets its own.
#[test]
fn a_project_for_32_bits_takes_no_libraries_for_64() {
    if !has_cmake() {
        return;
    }
    let (temporary, prefix) = laid_out("lib64");
    let ask = |build: &str| {
        let lists = "cmake_minimum_required(VERSION 3.16)\nproject(narrow C)\n\
                     set(CMAKE_SIZEOF_VOID_P 4)\nfind_package(hgrid REQUIRED)\n\
                     get_target_property(at hgrid::static IMPORTED_LOCATION)\nmessage(\"at ${at}\")\n";
        fs::write(temporary.path().join("CMakeLists.txt"), lists).expect("a file");
        let dir = temporary.path();
        let Output { stderr, .. } = configure_with(cmake(), dir, &prefix.dir, &dir.join(build));
        String::from_utf8(stderr).expect("text")
    };
    let said = ask("without");
    assert!(said.contains("there is no hgrid library beneath"), "{said}");
    let narrow = prefix.dir.join("lib/libhgrid.a");
    fs::create_dir(prefix.dir.join("lib")).expect("a folder");
    fs::copy(prefix.lib.join("libhgrid.a"), &narrow).expect("a copy");
    let said = ask("with");
    assert!(said.contains(&format!("at {}\n", narrow.display())), "{said}");
}

/// A project that prints which versions and targets it found.
const PROBE: &str = r#"
cmake_minimum_required(VERSION 3.19)
project(probe C)
foreach(wanted IN LISTS WANTED)
  unset(hgrid_DIR CACHE)
  find_package(hgrid ${wanted} QUIET)
  message("${wanted}: ${hgrid_FOUND}")
endforeach()
foreach(target hgrid::hgrid hgrid::static)
  if(TARGET ${target})
    message("has ${target}")
  endif()
endforeach()
find_package(hgrid REQUIRED)
"#;

/// Returns the messages of the probe, and whether it succeeded.
fn probe(prefix: &Path, wanted: &str) -> (String, bool) {
    let dir = TempDir::new().expect("a folder");
    let lists = format!("set(WANTED {wanted})\n{PROBE}");
    fs::write(dir.path().join("CMakeLists.txt"), lists).expect("a file");
    let build = dir.path().join("build");
    let Output { status, stderr, .. } = configure_with(cmake(), dir.path(), prefix, &build);
    (String::from_utf8(stderr).expect("text"), status.success())
}

#[test]
fn a_project_gets_the_versions_that_do_not_break_it() {
    if !has_cmake() {
        return;
    }
    let (_temporary, prefix) = laid_out("lib");
    let good = [VERSION, "0.1", "0.1.0", "0.1...<0.2", "0.0.5...1.0", "0.1.0...0.1.0"];
    let bad = ["0.0", "0.2", "0.1.99", "1", "1.0", "0.2...0.3", "0.0.1...<0.1"];
    let (said, _) = probe(&prefix.dir, &[&good[..], &bad[..]].concat().join(" "));
    let says = |line: String| assert!(said.lines().any(|said| said == line), "{line}\n{said}");
    good.iter().for_each(|wanted| says(format!("{wanted}: 1")));
    bad.iter().for_each(|wanted| says(format!("{wanted}: 0")));
}

#[test]
fn the_cmake_package_has_the_version_of_the_library() {
    let file = root().join("capi/cmake/hgrid-config-version.cmake");
    let text = fs::read_to_string(file).expect("the file");
    assert!(text.contains(&format!("set(PACKAGE_VERSION {VERSION})\n")), "{text}");
}

#[test]
fn a_project_is_told_what_is_missing() {
    if !has_cmake() {
        return;
    }
    let (_temporary, prefix) = laid_out("lib");
    let remove = |name| fs::remove_file(prefix.lib.join(name)).expect("a library");
    assert_eq!(probe(&prefix.dir, "0.1").0.matches("has hgrid::").count(), 2);
    remove("libhgrid.so");
    let (said, is_content) = probe(&prefix.dir, "0.1");
    assert!(is_content && said.contains("has hgrid::static"), "{said}");
    assert!(!said.contains("has hgrid::hgrid"), "{said}");
    remove("libhgrid.a");
    let (said, is_content) = probe(&prefix.dir, "0.1");
    assert!(!is_content && said.contains("0.1: 0\n"), "{said}");
    assert!(said.contains("there is no hgrid library beneath"), "{said}");
}
