//! Files that are read, and files that are written.
//!
//! A file that is opened can be read twice, once to recognise it and once for its content. A file that is written is
//! complete, or it is what it was before, if its folder allows that.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use tempfile::NamedTempFile;

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

/// Writes a file under another name and then renames it, so that a full disk leaves the older file of its name.
///
/// Pipes and devices are written to as they are. So is a file in a folder where others may not be made or renamed.
///
/// # Errors
/// The errors of writing, with the file's name.
pub(crate) fn write(path: &Path, content: impl FnOnce(&mut File) -> io::Result<()>) -> Result<()> {
    replace(path, content).with_context(|| format!("cannot write `{}`", path.display()))
}

fn replace(path: &Path, content: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    // Replace what a link leads to, not the link.
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let old = fs::metadata(&path).ok();
    if path.is_symlink() || !old.as_ref().is_none_or(Metadata::is_file) {
        return content(&mut File::create(path)?);
    }
    let mut new = match beside(&path) {
        Err(error) if is_forbidden(&error) => return content(&mut File::create(path)?),
        new => new?,
    };
    if let Some(old) = old {
        // A file that may not be written to may not be replaced.
        OpenOptions::new().write(true).open(&path)?;
        new.as_file().set_permissions(old.permissions())?;
    }
    content(new.as_file_mut())?;
    match new.persist(&path) {
        Ok(_) => Ok(()),
        Err(refused) => fs::copy(refused.file.path(), &path).map(drop),
    }
}

/// Returns true if a folder takes no new file from this user, whatever the file is.
fn is_forbidden(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem)
}

/// Makes a file in the folder of another one, with the permissions of any new file.
fn beside(path: &Path) -> io::Result<NamedTempFile> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.prefix(".hgrid-").tempfile_in(folder.unwrap_or(Path::new(".")))
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    #[test]
    fn a_file_is_whole_or_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let fails =
            |file: &mut File| file.write_all(b"half").and(Err(ErrorKind::StorageFull.into()));
        assert!(write(&path, fails).is_err() && !path.exists());
        write(&path, |file| file.write_all(b"whole")).unwrap();
        let error = format!("{:#}", write(&path, fails).unwrap_err());
        assert!(error.starts_with("cannot write `") && error.contains("a`: "), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        write(&path, |file| file.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        // Nothing else is left in the folder.
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn links_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt as _, symlink};

        let folder = tempfile::tempdir().unwrap();
        let [path, link] = ["a", "link"].map(|name| folder.path().join(name));
        write(&path, |file| file.write_all(b"old")).unwrap();
        // A file that any other program makes has the usual permissions.
        let usual = folder.path().join("usual");
        fs::write(&usual, "").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&usual));
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        symlink("a", &link).unwrap();
        write(&link, |file| file.write_all(b"new")).unwrap();
        assert!(link.is_symlink() && mode(&path) & 0o777 == 0o640);
        assert_eq!(fs::read(&path).unwrap(), b"new");
        // A link to what is not there makes that file.
        fs::remove_file(&path).unwrap();
        write(&link, |file| file.write_all(b"first")).unwrap();
        assert!(link.is_symlink() && fs::read(&path).unwrap() == b"first");
    }
}
