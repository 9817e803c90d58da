//! A project with a checkout of hgrid in a subfolder: CMake calls cargo.

use std::env;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use hgrid_tests::artefact::{bare_compiler, root, run, target_dir};
use hgrid_tests::tools::{command, is_installed};
use tempfile::TempDir;

use crate::archive::build_within;
use crate::cmake::{build_and_run_by, cmake, configure, has_cmake};
use crate::installed::soname;
use crate::prefix::{HIT, VERSION, dynamic, output_of, program};

/// Returns a cmake command that finds the cargo of this test, which works offline.
fn cargo_cmake() -> Command {
    let mut cmake = cmake();
    for name in ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "CARGO_BUILD_TARGET"] {
        cmake.env_remove(name);
    }
    cmake.env("CARGO_NET_OFFLINE", "true");
    cmake
}

/// Returns the settings of all projects here, which share one compiled library.
fn options() -> Vec<String> {
    vec![
        format!("-DHGRID_CARGO={}", env!("CARGO")),
        format!("-DHGRID_TARGET_DIR={}", target_dir().join("cmake").display()),
        "-DHGRID_METHODS=bvh".to_owned(),
        "-DHGRID_MALLOC=ON".to_owned(),
    ]
}

/// A debug build of the project, too, gets an optimised library.
#[test]
#[ignore = "slow: CMake has the library built again"]
fn a_project_builds_a_checkout_and_installs_it() {
    if !has_cmake() || !is_installed("c++") {
        return;
    }
    let mut within = options();
    within.push("-DCMAKE_BUILD_TYPE=Debug".to_owned());
    let dir = build_within(cargo_cmake, root(), &within);
    if is_installed("binutils") {
        assert!(dynamic(&dir.path().join("shared"), "NEEDED").contains(&soname()));
        assert!(!dynamic(&dir.path().join("static"), "NEEDED").contains(&soname()));
    }
    // A second build compiles nothing.
    let shared = dir.path().join("shared");
    let built = || fs::metadata(&shared).and_then(|file| file.modified()).expect("a time");
    let before = built();
    run(cargo_cmake().arg("--build").arg(dir.path()));
    assert_eq!(built(), before);

    install("lib");
    install("odd/place");
}

/// Installs the checkout, with libraries in the folder `lib`, and uses the installed files.
fn install(lib: &str) {
    let dir = TempDir::new().expect("a folder");
    let [build, prefix] = ["build", "prefix"].map(|name| dir.path().join(name));
    let mut ask = cargo_cmake();
    ask.args(options()).arg(format!("-DCMAKE_INSTALL_LIBDIR={lib}"));
    let Output { status, stderr, .. } = configure(ask, root(), &build);
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    run(cargo_cmake().arg("--build").arg(&build));
    run(cargo_cmake().arg("--install").arg(&build).arg("--prefix").arg(&prefix));
    // The package finds its files relative to its own place, even after it was moved.
    let moved = dir.path().join("another place");
    fs::rename(&prefix, &moved).expect("a new place");
    build_and_run_by(cmake, &moved);
    asks_pkg_config(&moved, lib);
}

fn asks_pkg_config(prefix: &Path, lib: &str) {
    if !is_installed("pkg-config") {
        return;
    }
    let lib = prefix.join(lib);
    let mut ask = command("pkg-config");
    let ask = ask.env("PKG_CONFIG_PATH", lib.join("pkgconfig"));
    assert_eq!(output_of(ask.args(["--modversion", "hgrid"])).trim(), VERSION);
    let mut ask = command("pkg-config");
    let ask = ask.env("PKG_CONFIG_PATH", lib.join("pkgconfig"));
    let answer = output_of(ask.args(["--static", "--cflags", "--libs", "hgrid"]));
    assert!(answer.contains("-DHGRID_MALLOC"), "{answer}");
    // The folder's name has a space, which pkg-config escapes for the shell.
    let path = prefix.join("program");
    let source = root().join("c_examples/minimal.c");
    let compiler = bare_compiler();
    let line = format!(
        "{} '{}' {answer} -o '{}'",
        compiler.get_program().display(),
        source.display(),
        path.display()
    );
    run(Command::new("sh").arg("-c").arg(line.replace('\n', " ")));
    let printed = output_of(program(&path).env("LD_LIBRARY_PATH", &lib));
    assert!(printed.ends_with(HIT), "{printed}");
}

/// A toolchain file for a bare machine, with clang as the compiler.
const TOOLCHAIN: &str = "
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_C_COMPILER clang)
set(CMAKE_C_COMPILER_TARGET thumbv7em-none-eabihf)
";

#[test]
#[ignore = "slow: CMake has the library built again"]
fn a_cross_build_gets_a_static_library_for_the_target() {
    let target = "thumbv7em-none-eabihf";
    if !has_cmake() || !["clang", "rust-targets"].into_iter().all(is_installed) {
        return;
    }
    let libraries =
        run(Command::new("rustc").args(["--print", "target-libdir", "--target", target]));
    let libraries = String::from_utf8(libraries.stdout).expect("a path");
    if !Path::new(libraries.trim()).is_dir() {
        hgrid_tests::tools::skip(&format!("no Rust libraries for {target}"));
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let toolchain = dir.path().join("toolchain.cmake");
    fs::write(&toolchain, TOOLCHAIN).expect("a file");
    let ask = |options: &[&str]| {
        let mut cmake = cargo_cmake();
        cmake.args(self::options()).args(["-DHGRID_METHODS=one-level", "-DHGRID_MALLOC=OFF"]);
        cmake.arg(format!("-DCMAKE_TOOLCHAIN_FILE={}", toolchain.display())).args(options);
        configure(cmake, root(), &dir.path().join("build"))
    };
    // CMake does not name the target in Rust's terms, so the caller must.
    let Output { status, stderr, .. } = ask(&[]);
    let said = String::from_utf8(stderr).expect("text");
    assert!(!status.success() && said.contains("set HGRID_CARGO_TARGET"), "{said}");

    let Output { status, stderr, .. } = ask(&[&format!("-DHGRID_CARGO_TARGET={target}")]);
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    run(cargo_cmake().arg("--build").arg(dir.path().join("build")));
    let lib = dir.path().join("build/lib");
    let names: Vec<_> = fs::read_dir(&lib).expect("libraries").flatten().collect();
    assert!(names.len() == 1 && names[0].file_name() == "libhgrid.a", "{names:?}");
}

/// These settings imitate clang with Microsoft's ABI, for which CMake does not set MSVC.
const CLANG_ON_WINDOWS: &str = "
set(UNIX FALSE)
set(WIN32 TRUE)
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR AMD64)
set(CMAKE_C_SIMULATE_ID MSVC)
unset(CMAKE_LIBRARY_ARCHITECTURE)
";

#[test]
fn clang_with_the_abi_of_microsoft_gets_libraries_of_that_abi() {
    if !has_cmake() {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let (hook, build) = (dir.path().join("hook.cmake"), dir.path().join("build"));
    fs::write(&hook, CLANG_ON_WINDOWS).expect("a file");
    let mut ask = cargo_cmake();
    ask.args(options()).arg("-DHGRID_TARGET_DIR=/made");
    ask.arg(format!("-DCMAKE_PROJECT_hgrid_INCLUDE={}", hook.display()));
    let Output { status, stderr, .. } = configure(ask, root(), &build);
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    let rules = fs::read_to_string(build.join("CMakeFiles/hgrid_cargo.dir/build.make"));
    let rules = rules.expect("the rules of make");
    for name in ["hgrid.lib", "hgrid.dll", "hgrid.dll.lib"] {
        let from = format!("/made/x86_64-pc-windows-msvc/release/{name} ");
        assert!(rules.contains(&from), "{from}\n{rules}");
    }
    // rustc calls Microsoft's linker itself.
    assert!(!rules.contains("_LINKER="), "{rules}");

    // An installed package names the import library of that ABI.
    let prefix = dir.path().join("prefix");
    for name in ["bin/hgrid.dll", "lib/hgrid.lib", "lib/hgrid.dll.lib", "lib/libhgrid.dll.a"] {
        let path = prefix.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, "").expect("a file");
    }
    let package = prefix.join("share/cmake/hgrid");
    fs::create_dir_all(&package).expect("a folder");
    let config = root().join("capi/cmake/hgrid-config.cmake");
    fs::copy(config, package.join("hgrid-config.cmake")).expect("a copy");
    let lists = format!(
        "cmake_minimum_required(VERSION 3.16)\nproject(user C)\n{CLANG_ON_WINDOWS}\
         find_package(hgrid REQUIRED)\n\
         get_target_property(import hgrid::hgrid IMPORTED_IMPLIB)\nmessage(\"import ${{import}}\")\n"
    );
    fs::write(dir.path().join("CMakeLists.txt"), lists).expect("a file");
    let mut ask = cmake();
    ask.arg(format!("-Dhgrid_DIR={}", package.display()));
    let Output { status, stderr, .. } = configure(ask, dir.path(), &dir.path().join("used"));
    let said = String::from_utf8_lossy(&stderr);
    let import = format!("import {}\n", prefix.join("lib/hgrid.dll.lib").display());
    assert!(status.success() && said.contains(&import), "{said}");
}

/// CMake copies the library from where cargo writes it, though a target's name may have a dot.
#[test]
fn libraries_come_from_the_folder_that_cargo_names() {
    if !has_cmake() {
        return;
    }
    let dir = TempDir::new().expect("a folder");
    let targets = [
        ("thumbv8m.main-none-eabihf", "thumbv8m.main-none-eabihf"),
        ("/boards/my.board.json", "my.board"),
        ("x86_64-unknown-linux-gnu", "x86_64-unknown-linux-gnu"),
    ];
    for (place, (target, folder)) in targets.into_iter().enumerate() {
        let build = dir.path().join(place.to_string());
        let mut ask = cargo_cmake();
        ask.args(options()).arg("-DHGRID_SHARED=OFF");
        ask.arg("-DHGRID_TARGET_DIR=/made").arg(format!("-DHGRID_CARGO_TARGET={target}"));
        let Output { status, stderr, .. } = configure(ask, root(), &build);
        assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
        let rules = fs::read_to_string(build.join("CMakeFiles/hgrid_cargo.dir/build.make"));
        let rules = rules.expect("the rules of make");
        assert!(rules.contains(&format!("/made/{folder}/release/libhgrid.a")), "{rules}");
    }
}
