//! Files that are read: what is opened can be read twice, once to recognise it and once for its content.

use std::fs::File;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};

/// Opens a file, and refuses folders, pipes and devices.
///
/// # Errors
/// If it cannot be opened, or is none.
pub(crate) fn open(path: &Path) -> Result<File> {
    let file = File::open(path).context("cannot open it")?;
    let kind = file.metadata().context("cannot read its size")?.file_type();
    ensure!(!kind.is_dir(), "it is a folder: name a file in it");
    ensure!(
        kind.is_file(),
        "it is a pipe or a device: write what it holds into a file, and name that"
    );
    Ok(file)
}
