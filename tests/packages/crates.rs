//! The packages for crates.io: their metadata, and their files. `.ci/publish` builds them from these files.

use std::fs;
use std::path::Path;

use hgrid_tests::artefact::{bare_cargo, root, run};
use serde_json::Value;

use crate::prefix::VERSION;

/// The packages that are published, and their folders.
const PACKAGES: [(&str, &str); 3] =
    [("hgrid-core", "core"), ("hgrid-capi", "capi"), ("hgrid-lab", "lab")];

/// Returns the metadata that cargo prints for a package.
fn metadata(name: &str) -> Value {
    let metadata = run(bare_cargo("metadata").args(["--no-deps", "--format-version", "1"])).stdout;
    let metadata: Value = serde_json::from_slice(&metadata).expect("JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    packages.iter().find(|package| package["name"] == name).expect("the package").clone()
}

/// Returns the files of a package as it is uploaded.
fn listed(name: &str) -> Vec<String> {
    let mut list = bare_cargo("package");
    let list = run(list.args(["--list", "--allow-dirty", "--quiet", "-p", name])).stdout;
    String::from_utf8(list).expect("text").lines().map(str::to_owned).collect()
}

#[test]
fn packages_say_what_they_are() {
    for (name, _) in PACKAGES {
        let package = metadata(name);
        let text = |field: &str| package[field].as_str().unwrap_or_default().to_owned();
        assert!(package["publish"].is_null(), "{name} must not set `publish`");
        assert_eq!(text("version"), VERSION);
        assert_eq!(text("license"), "MIT OR Apache-2.0");
        assert!(text("description").to_lowercase().contains("ray tracing"), "{name}");
        assert_eq!(text("documentation"), format!("https://docs.rs/{name}"));
        // The project has no such address yet.
        assert!(package["repository"].is_null() && package["homepage"].is_null(), "{name}");
        for field in ["keywords", "categories"] {
            // crates.io accepts at most five.
            let count = package[field].as_array().map_or(0, Vec::len);
            assert!((1..=5).contains(&count), "{name} has {count} {field}");
        }
        assert!(!package["metadata"]["docs"]["rs"].is_null(), "{name}");
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let is_ours = dependency["name"].as_str().is_some_and(|name| name.starts_with("hgrid"));
            // A dependency of tests alone, given only by its path, is left out of the upload.
            let is_for_tests = dependency["kind"] == "dev" && dependency["req"] == "*";
            assert!(
                !is_ours || is_for_tests || dependency["req"] == format!("^{VERSION}"),
                "{name}: {dependency}"
            );
        }
    }
}

/// Files above a package's folder are not packed by themselves, so each folder needs its own.
#[test]
fn packages_have_their_licences_and_pages() {
    for (name, folder) in PACKAGES {
        let files = listed(name);
        let has = |file: &str| files.iter().any(|listed| listed == file);
        for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
            let [ours, theirs] =
                [root().join(licence), root().join(folder).join(licence)].map(fs::read);
            assert_eq!(ours.expect("a licence"), theirs.expect("a licence"), "{name}");
            assert!(has(licence), "{name}: {files:?}");
        }
        assert!(has("README.md"), "{name}: {files:?}");
        assert!(!files.iter().any(|file| file.starts_with("results/")), "{files:?}");
        if name == "hgrid-capi" {
            for file in ["include/hgrid.h", "include/hgrid.hpp", "cmake/hgrid-config.cmake"] {
                assert!(has(file), "{files:?}");
            }
        }
    }
}

/// A file outside a package exists in the repository, but not in the uploaded package.
#[test]
fn packages_name_no_file_outside_of_them() {
    fn look(dir: &Path, depth: usize) {
        for entry in fs::read_dir(dir).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                look(&path, depth + 1);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let source = fs::read_to_string(&path).expect("a source");
                for (_, rest) in source.match_indices("include_").map(|(at, _)| source.split_at(at))
                {
                    let Some((_, name)) =
                        rest.lines().next().and_then(|line| line.split_once("!(\""))
                    else {
                        continue;
                    };
                    let up = name.split('/').take_while(|part| *part == "..").count();
                    assert!(up <= depth, "{} includes {name}", path.display());
                }
            }
        }
    }
    for (_, folder) in PACKAGES {
        // src is one level below the package's folder.
        look(&root().join(folder).join("src"), 1);
    }
}

/// Outside the workspace, the C library is built with the workspace's profiles; debug builds also abort on a panic.
#[test]
fn the_c_library_has_its_profiles_in_its_package() {
    let [workspace, package] = ["Cargo.toml", "capi/.cargo/config.toml"]
        .map(|name| fs::read_to_string(root().join(name)).expect("a file"));
    for (profile, more) in [("[profile.release]\n", ""), ("[profile.dev]\n", "panic = \"abort\"\n")]
    {
        let [workspace, package] = [&workspace, &package].map(|text| {
            let behind = text.split_once(profile).expect(profile).1;
            behind.split("\n\n").next().expect("settings").trim_end().to_owned()
        });
        assert_eq!(more.to_owned() + &workspace, package, "{profile}");
    }
    assert!(listed("hgrid-capi").iter().any(|file| file == ".cargo/config.toml"));
}
