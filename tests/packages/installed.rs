//! The results of `cargo cinstall`: the files, the name that programs look for, and the libraries, which are
//! built in another way than those of the tests.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use hgrid_program_tests::symbols::{symbols, symbols_of_ours};
use hgrid_tests::artefact::{Flavour, root};
use hgrid_tests::tools::is_installed;

use crate::prefix::{VERSION, assets, dynamic, files, installed};

/// Returns the library name that programs look for, which all compatible versions share.
pub(crate) fn soname() -> String {
    let numbers: Vec<_> = VERSION.split('.').collect();
    let kept = if numbers[0] == "0" { &numbers[..2] } else { &numbers[..1] };
    format!("libhgrid.so.{}", kept.join("."))
}

#[test]
fn every_header_and_every_cmake_file_is_on_the_list() {
    for (kind, folder) in [("include", "include"), ("data", "capi/cmake")] {
        let listed: BTreeSet<_> =
            assets(kind).into_iter().filter_map(|(from, _)| name(&from)).collect();
        let there = files(&root().join(folder)).into_iter().filter_map(|file| name(&file));
        // Leave out a file that another test is writing anew.
        let there: BTreeSet<_> = there.filter(|name| !name.ends_with(".fresh")).collect();
        assert_eq!(listed, there);
    }
}

fn name(path: &Path) -> Option<String> {
    path.file_name()?.to_str().map(str::to_owned)
}

#[test]
fn cargo_c_installs_what_is_listed_and_no_more() {
    let Some(prefix) = installed(Flavour::Bare) else { return };
    let lib = prefix.lib.strip_prefix(&prefix.dir).expect("below");
    let full_name = format!("libhgrid.so.{VERSION}");
    let names = ["libhgrid.a", "libhgrid.so", &soname(), &full_name, "pkgconfig/hgrid.pc"];
    let mut expected: Vec<PathBuf> = names.iter().map(|name| lib.join(name)).collect();
    for (kind, place) in [("include", "include"), ("data", "share")] {
        for (from, to) in assets(kind) {
            let to = Path::new(place).join(to);
            let [ours, theirs] = [&from, &prefix.dir.join(&to)].map(fs::read);
            assert_eq!(ours.expect("a file"), theirs.expect("a copy"), "{}", to.display());
            expected.push(to);
        }
    }
    expected.sort();
    assert_eq!(files(&prefix.dir), expected);
}

#[test]
fn the_shared_library_has_the_name_of_its_compatible_versions() {
    let Some(prefix) = installed(Flavour::Bare) else { return };
    if is_installed("binutils") {
        assert_eq!(dynamic(&prefix.lib.join("libhgrid.so"), "SONAME"), [soname()]);
        for name in ["libhgrid.so", &soname()] {
            let target = fs::read_link(prefix.lib.join(name)).expect("a link");
            assert_eq!(target, Path::new(&format!("libhgrid.so.{VERSION}")));
        }
    }
}

/// Without optimisation across the whole library there would be several objects, with panics in them.
#[test]
fn the_installed_libraries_are_those_of_the_tests() {
    if !is_installed("binutils") {
        return;
    }
    for flavour in Flavour::ALL {
        let Some(prefix) = installed(flavour) else { return };
        let exported = ["-D", "--defined-only"];
        let [installed, ours] = [prefix.lib.join("libhgrid.so"), flavour.shared_library()]
            .map(|library| symbols(&library, &exported));
        assert_eq!(installed, ours, "{flavour:?}");
        let [installed, ours] = [prefix.lib.join("libhgrid.a"), flavour.static_library()]
            .map(|archive| symbols_of_ours(&archive, &["--undefined-only"]));
        assert_eq!(installed, ours, "{flavour:?}");
        let all = symbols_of_ours(&prefix.lib.join("libhgrid.a"), &[]);
        assert!(!all.iter().any(|name| name.contains("panic")), "{flavour:?}");
    }
}
