//! Pictures as PNG files.
//!
//! A check before the work tests that the file can be written, and leaves no empty file behind. The file
//! itself is written when the picture is complete.

use std::ffi::OsStr;
use std::fs::{self, OpenOptions};
use std::io::{Cursor, ErrorKind, Write as _};
use std::path::{Path, is_separator};

use anyhow::{Context as _, Error, Result, ensure};

use crate::file;
use crate::scene::files;
use crate::scene::gltf::files_of;
use crate::shade::Rgb;

/// Refuses a path where no file can be written. An existing file stays as it is; pipes and devices are not tried.
///
/// # Errors
/// The errors of opening the file.
pub fn check_writable(path: &Path) -> Result<()> {
    let attempt = match OpenOptions::new().write(true).create_new(true).open(path) {
        Ok(_) => fs::remove_file(path),
        // To open a pipe and close it again would tell its reader that nothing comes.
        Err(error) if error.kind() == ErrorKind::AlreadyExists && is_pipe_or_device(path) => Ok(()),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            OpenOptions::new().write(true).open(path).map(drop)
        }
        Err(error) => Err(error),
    };
    attempt.map_err(|error| {
        let cause = refusal(path).map_or_else(|| Error::new(error), Error::msg);
        cause.context(format!("cannot write `{}`", path.display()))
    })
}

fn is_pipe_or_device(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|what| !what.is_file() && !what.is_dir())
}

/// Refuses to overwrite a file of a scene by a blob, a picture or results of it. Files of a scene are those that its
/// words name, two in `A+B`, and the buffers of a glTF file.
///
/// # Errors
/// If the output is one of them.
pub fn check_sources(output: &Path, scene: &OsStr, what: &str) -> Result<()> {
    let Ok(target) = output.canonicalize() else { return Ok(()) };
    for path in files(scene) {
        let input = path.display();
        let is_output = |path: &Path| path.canonicalize().is_ok_and(|path| path == target);
        ensure!(
            !is_output(path),
            "`{input}` would be overwritten by its own {what}: name another file"
        );
        let buffers = files_of(path);
        ensure!(
            !buffers.iter().any(|file| is_output(file)),
            "`{}` holds a part of `{input}`, whose {what} would overwrite it: name another file",
            output.display()
        );
    }
    Ok(())
}

/// Returns the reason why no file of this name can be opened, with what to do; none if it is another one.
fn refusal(path: &Path) -> Option<String> {
    if path.is_dir() {
        return Some("it is a folder: name a file in it".to_owned());
    }
    if path.is_symlink() && !path.exists() {
        return Some("it is a link to a file that is not there: name that file".to_owned());
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty())?;
    let name = folder.display();
    // A folder that cannot be looked into may be there.
    match (folder.try_exists().unwrap_or(true), folder.is_dir()) {
        (false, _) => Some(format!("there is no folder `{name}`: make it, or name another one")),
        (true, false) if folder.exists() => {
            Some(format!("`{name}` is a file: name a folder in its place"))
        }
        (true, true) if path.as_os_str().to_string_lossy().ends_with(is_separator) => {
            Some("its name ends like that of a folder: name a file".to_owned())
        }
        _ => None,
    }
}

/// Makes a folder for several files, and those that it is in.
///
/// # Errors
/// If there is a file of its name, and those of making it.
pub fn make_folder(path: &Path) -> Result<()> {
    let cannot = || format!("cannot write into `{}`", path.display());
    let is_file = path.exists() && !path.is_dir();
    ensure!(!is_file, "{}: it is a file: name a folder", cannot());
    let is_link_to_nothing = path.is_symlink() && !path.exists();
    ensure!(!is_link_to_nothing, "{}: it is a link to what is not there", cannot());
    fs::create_dir_all(path).with_context(cannot)
}

/// Makes a folder for what `work` writes at its end. If it fails, new folders that are still empty are removed.
///
/// # Errors
/// The errors of [`make_folder`] and of the work.
pub fn in_folder<T>(path: &Path, work: impl FnOnce() -> Result<T>) -> Result<T> {
    let is_new = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    let new: Vec<_> = path.ancestors().take_while(is_new).collect();
    make_folder(path)?;
    let done = work();
    if done.is_err() {
        // It ends at the first folder that has something in it.
        let _ = new.into_iter().try_for_each(fs::remove_dir);
    }
    done
}

/// Writes a picture of this width and height, rows from the top.
///
/// # Errors
/// The errors of writing the file.
pub fn write_png(path: &Path, size: (u32, u32), pixels: &[Rgb]) -> Result<()> {
    let bytes =
        encode(size, pixels).with_context(|| format!("cannot draw `{}`", path.display()))?;
    file::write(path, |file| file.write_all(&bytes))
}

fn encode((width, height): (u32, u32), pixels: &[Rgb]) -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels.as_flattened())?;
    writer.finish()?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_png_reads_back() {
        let pixels = [[1, 2, 3], [4, 5, 6], [7, 8, 9], [250, 251, 252], [0; 3], [9; 3]];
        let bytes = encode((3, 2), &pixels).unwrap();
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
        let mut read = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut read).unwrap();
        assert_eq!((info.width, info.height), (3, 2));
        assert_eq!(read, pixels.as_flattened());
        assert!(encode((3, 2), &pixels[1..]).is_err());
    }

    #[test]
    fn a_check_leaves_nothing_behind() {
        let folder = std::env::temp_dir().join(format!("hgrid-image-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("picture.png");
        check_writable(&path).unwrap();
        assert!(!path.exists());
        fs::write(&path, "before").unwrap();
        check_writable(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"before");
        write_png(&path, (1, 1), &[[0; 3]]).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink("nowhere.png", folder.join("link.png")).unwrap();
        for (name, expected) in [
            ("", "`: it is a folder: name a file in it"),
            ("missing/picture.png", "missing`: make it, or name another one"),
            ("picture.png/other.png", "picture.png` is a file: name a folder in its place"),
            ("other.png/", "`: its name ends like that of a folder: name a file"),
            #[cfg(unix)]
            ("link.png", "`: it is a link to a file that is not there: name that file"),
        ] {
            let message = format!("{:#}", check_writable(&folder.join(name)).unwrap_err());
            assert!(message.starts_with("cannot write `"), "{message}");
            assert!(message.ends_with(expected), "{message}");
        }
        make_folder(&folder.join("one/two")).unwrap();
        make_folder(&folder.join("one")).unwrap();
        let message = make_folder(&path).unwrap_err().to_string();
        assert!(message.ends_with("`: it is a file: name a folder"), "{message}");
        for (name, is_kept) in [("new", false), ("one/two", true)] {
            let path = folder.join(name);
            assert!(in_folder(&path, || anyhow::bail!("no such scene") as Result<()>).is_err());
            assert_eq!(path.exists(), is_kept, "{name}");
        }
        let filled = folder.join("filled");
        let work = || -> Result<()> {
            fs::write(filled.join("a"), "")?;
            anyhow::bail!("no second scene")
        };
        assert!(in_folder(&filled, work).is_err() && filled.join("a").exists());
        fs::remove_dir_all(&folder).unwrap();
    }
}
