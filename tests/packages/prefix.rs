//! Folders with the library installed in them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use hgrid_tests::artefact::{Flavour, bare_cargo, root, run, target_dir};
use hgrid_tests::tools::{command, is_installed};
use serde_json::Value;
use tempfile::TempDir;

/// The line that minimal.c prints about its hit, whatever the size of its grid.
pub(crate) const HIT: &str = "hit triangle 0 at t = 1, u = 0.25, v = 0.5\n";

/// The version of the package.
pub(crate) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// An install folder, and the folder of its libraries.
#[derive(Debug)]
pub(crate) struct Prefix {
    pub(crate) dir: PathBuf,
    pub(crate) lib: PathBuf,
}

/// Returns what cargo-c installs of a flavour; `None` after a message if there is no cargo-c.
pub(crate) fn installed(flavour: Flavour) -> Option<&'static Prefix> {
    static PREFIXES: [OnceLock<Prefix>; 2] = [const { OnceLock::new() }; 2];
    if !is_installed("cargo-c") {
        return None;
    }
    Some(PREFIXES[flavour as usize].get_or_init(|| {
        let target = target_dir().join(format!("cargo_c_{flavour:?}"));
        let dir = target.join("prefix");
        if dir.exists() {
            fs::remove_dir_all(&dir).expect("what an earlier test installed");
        }
        let mut install = bare_cargo("cinstall");
        install.args(["-p", "hgrid-capi"]).args(flavour.features());
        run(install.arg("--prefix").arg(&dir).arg("--target-dir").arg(&target));
        let is_library_dir = |path: &&PathBuf| path.join("libhgrid.a").is_file();
        let lib = files(&dir).into_iter().filter_map(|file| Some(dir.join(file).parent()?.into()));
        let lib = lib.collect::<Vec<PathBuf>>().iter().find(is_library_dir).cloned();
        Prefix { dir, lib: lib.expect("a static library") }
    }))
}

/// Lays out a folder by the lists that cargo-c uses, with the usual libraries in the subfolder `lib`: enough
/// for the CMake package, which needs no SONAME and no pkg-config.
pub(crate) fn laid_out(lib: &str) -> (TempDir, Prefix) {
    let temporary = TempDir::new().expect("a folder");
    let dir = temporary.path().join("prefix");
    for (kind, place) in [("include", "include"), ("data", "share")] {
        for (from, to) in assets(kind) {
            copy(&from, &dir.join(place).join(to));
        }
    }
    let lib = dir.join(lib);
    for library in [Flavour::static_library, Flavour::shared_library].map(|of| of(Flavour::Bare)) {
        let name = library.file_name().expect("a name");
        copy(&library, &lib.join(name));
    }
    (temporary, Prefix { dir, lib })
}

/// Returns the files that the package's metadata lists for installation, each with its place in the install folder.
pub(crate) fn assets(kind: &str) -> Vec<(PathBuf, PathBuf)> {
    let metadata = run(bare_cargo("metadata").args(["--no-deps", "--format-version", "1"])).stdout;
    let metadata: Value = serde_json::from_slice(&metadata).expect("JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    let capi = packages.iter().find(|package| package["name"] == "hgrid-capi").expect("capi");
    let list = capi["metadata"]["capi"]["install"][kind]["asset"].as_array().expect("a list");
    let mut assets = Vec::new();
    for asset in list {
        let pattern = root().join("capi").join(asset["from"].as_str().expect("a pattern"));
        let to = Path::new(asset["to"].as_str().unwrap_or_default());
        let (dir, name) = (pattern.parent().expect("a folder"), pattern.file_name());
        let suffix = name.and_then(|name| name.to_str()?.strip_prefix('*'));
        let suffix = suffix.expect("a pattern like *.h");
        for entry in fs::read_dir(dir).expect("the folder") {
            let path = entry.expect("a file").path();
            let name = path.file_name().and_then(|name| name.to_str()).expect("a name");
            if name.ends_with(suffix) {
                assets.push((path.clone(), to.join(name)));
            }
        }
    }
    assets
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to.parent().expect("a folder")).expect("a folder");
    fs::copy(from, to).expect("a copy");
}

/// Returns all files and links below a folder as relative paths, sorted.
pub(crate) fn files(dir: &Path) -> Vec<PathBuf> {
    let listed = run(Command::new("find").arg(dir).args(["-not", "-type", "d"])).stdout;
    let listed = String::from_utf8(listed).expect("text");
    let from_here = |line| Path::new(line).strip_prefix(dir).expect("below").to_owned();
    let mut files: Vec<_> = listed.lines().map(from_here).collect();
    files.sort();
    files
}

/// Returns a command that finds shared libraries as users' programs do, and not by the folders that cargo
/// sets for tests.
pub(crate) fn program(path: &Path) -> Command {
    let mut program = Command::new(path);
    program.env_remove("LD_LIBRARY_PATH");
    program
}

/// Returns the output of a program that must succeed.
pub(crate) fn output_of(program: &mut Command) -> String {
    String::from_utf8(run(program).stdout).expect("text")
}

/// Returns the entries of one kind in the dynamic section: the text between the brackets.
pub(crate) fn dynamic(file: &Path, kind: &str) -> Vec<String> {
    let section = output_of(command("readelf").args(["-d", "-W"]).arg(file));
    let lines = section.lines().filter(|line| line.contains(&format!("({kind})")));
    let names = lines.filter_map(|line| Some(line.split_once('[')?.1.split_once(']')?.0));
    names.map(str::to_owned).collect()
}
