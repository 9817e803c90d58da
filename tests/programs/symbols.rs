//! The symbols in a library, as binutils list them. Tests ask `tools` for binutils first.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use hgrid_tests::artefact::run;
use hgrid_tests::tools::command;

/// Returns the symbols that `nm` lists with these flags.
///
/// # Panics
/// If it cannot read the library.
#[must_use]
pub fn symbols(library: &Path, flags: &[&str]) -> BTreeSet<String> {
    names(list(library, flags).lines())
}

/// Returns the same for our own object in an archive. The other objects are the compiler's run-time library,
/// from which the linker takes what a target lacks.
///
/// # Panics
/// If it cannot read the archive, or if our code is not one object, so that it was not optimised as a whole.
#[must_use]
pub fn symbols_of_ours(archive: &Path, flags: &[&str]) -> BTreeSet<String> {
    let heading = format!("{}:", ours(archive));
    let list = list(archive, flags);
    let behind = list.lines().skip_while(|line| *line != heading).skip(1);
    names(behind.take_while(|line| !line.is_empty()))
}

/// Extracts our object into a folder.
///
/// # Panics
/// If our code is not one object.
#[must_use]
pub fn extract_ours(archive: &Path, dir: &Path) -> PathBuf {
    let ours = ours(archive);
    run(command("ar").current_dir(dir).arg("x").arg(archive).arg(&ours));
    dir.join(ours)
}

/// Returns the name of our object.
fn ours(archive: &Path) -> String {
    let members = run(command("ar").arg("t").arg(archive)).stdout;
    let members = String::from_utf8(members).expect("text");
    let ours: Vec<_> = members.lines().filter(|name| name.starts_with("hgrid.")).collect();
    let [ours] = ours[..] else { panic!("one object after link-time optimisation, not {ours:?}") };
    ours.to_owned()
}

fn list(library: &Path, flags: &[&str]) -> String {
    let output = run(command("nm").args(flags).arg(library));
    String::from_utf8(output.stdout).expect("text")
}

/// Returns the names in lines like `0000000000000010 T name` and `U name`. Other lines are headings, and
/// messages of `nm` plug-ins about objects of newer compilers.
fn names<'a>(lines: impl Iterator<Item = &'a str>) -> BTreeSet<String> {
    let name = |line: &str| {
        let mut words = line.split_whitespace().rev();
        let (name, kind) = (words.next()?, words.next()?);
        (kind.len() == 1).then(|| name.to_owned())
    };
    lines.filter_map(name).collect()
}
