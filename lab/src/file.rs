//! Files that are read: what is opened can be read twice, once to recognise it and once for its content.

use std::fs::{self, File};
use std::path::Path;

use anyhow::{Context as _, Result, ensure};

/// Opens a file, and refuses folders, pipes and devices.
///
/// # Errors
/// If it cannot be opened, or is none.
pub(crate) fn open(path: &Path) -> Result<File> {
    // Look first: to open a pipe without a writer would wait for one.
    let kind = fs::metadata(path).context("cannot open it")?.file_type();
    ensure!(!kind.is_dir(), "it is a folder: name a file in it");
    ensure!(
        kind.is_file(),
        "it is a pipe or a device: write what it holds into a file, and name that"
    );
    File::open(path).context("cannot open it")
}
