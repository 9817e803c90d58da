//! What fuzzing found, and what it found worth keeping: both run again.

use std::fs;
use std::path::Path;

use hgrid_tests::hostile::TARGETS;

/// Runs all files in a target's folder; how many there were.
fn run_all(kind: &str, name: &str, run: fn(&[u8])) -> usize {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("hostile").join(kind).join(name);
    let Ok(entries) = fs::read_dir(&folder) else { return 0 };
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    for file in &files {
        // Shown if the test fails.
        println!("{}", file.display());
        run(&fs::read(file).unwrap());
    }
    files.len()
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn what_fuzzing_kept_does_no_harm() {
    for target in TARGETS {
        assert!(run_all("corpus", target.name, target.run) > 100, "{}", target.name);
    }
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn what_fuzzing_found_does_no_harm_any_more() {
    let mut count = 0;
    for target in TARGETS {
        count += run_all("regressions", target.name, target.run);
    }
    assert!(count > 1, "{count}");
}
