//! The formats of mesh files, recognised by a file's first bytes and by the ending of its name.
//!
//! For formats whose files start with a mark, the mark goes before the name. A file with the mark of a
//! foreign format gets an error that names that format.

use std::fs;
use std::io::Read as _;
use std::path::Path;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use hgrid_core::{BlobInfo, Error};

use super::model::Model;
use super::{gltf, obj, packed, ply, stl};
use crate::file;

/// The endings of readable files, for messages.
pub const ENDINGS: &str = ".ply, .obj, .stl, .gltf, .glb or .hgrid";

/// A readable format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Stanford's polygon files.
    Ply,
    /// Wavefront's text files.
    Obj,
    /// STL, the triangles of 3D printing.
    Stl,
    /// glTF as JSON, or GLB.
    Gltf,
    /// A blob of this library that contains its mesh.
    Blob,
}

impl Format {
    /// Returns the format for the ending of a name.
    #[must_use]
    pub fn named(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_ascii_lowercase();
        Some(match ending.to_str()? {
            "ply" => Self::Ply,
            "obj" => Self::Obj,
            "stl" => Self::Stl,
            "gltf" | "glb" => Self::Gltf,
            "hgrid" => Self::Blob,
            _ => return None,
        })
    }

    /// Returns the format of a file.
    ///
    /// # Errors
    /// If the file cannot be read, or has none of the formats.
    pub fn of(path: &Path) -> Result<Self> {
        let mut file = file::open(path)?;
        let mut start = Vec::new();
        file.by_ref().take(512).read_to_end(&mut start).context("cannot read it")?;
        let (named, length) = (Self::named(path), file.metadata().context("cannot read it")?.len());
        // A binary STL file may begin with any words, also with the mark of another format.
        if named == Some(Self::Stl) && stl::is_binary(&start, length) {
            return Ok(Self::Stl);
        }
        Self::of_content(&start, named)
    }

    fn of_content(start: &[u8], named: Option<Self>) -> Result<Self> {
        ensure!(!start.is_empty(), "it is empty");
        if start.starts_with(b"ply") {
            return Ok(Self::Ply);
        }
        if start.starts_with(b"glTF") {
            return Ok(Self::Gltf);
        }
        if BlobInfo::peek(start).err().is_none_or(|error| error != Error::NotAGrid) {
            return Ok(Self::Blob);
        }
        let foreign = foreign(start);
        let it_is = foreign.map(|name| format!("it is {name}"));
        match named {
            Some(named) if named.has_mark() => {
                let rest = it_is.map(|it_is| format!("; {it_is}")).unwrap_or_default();
                bail!("it is not {}, in spite of its name{rest}", named.article());
            }
            Some(named) => match it_is {
                Some(it_is) => Err(anyhow!("{it_is}, not {}", named.article())),
                None => Ok(named),
            },
            None if stl::starts_with_solid(start) => Ok(Self::Stl),
            None if start.trim_ascii_start().starts_with(b"{") => Ok(Self::Gltf),
            None => {
                let what = it_is.unwrap_or_else(|| "it has another format".to_owned());
                bail!("{what}: a mesh is read from {ENDINGS}")
            }
        }
    }

    /// Reads a file of this format.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn read(self, path: &Path) -> Result<Model> {
        let bytes = || fs::read(path).context("cannot read it");
        Ok(match self {
            Self::Ply => ply::load(path)?,
            Self::Obj => obj::read(&bytes()?)?,
            Self::Stl => stl::read(&bytes()?)?,
            Self::Gltf => gltf::read(&bytes()?, path)?,
            Self::Blob => packed::load(path)?.into(),
        })
    }

    /// Returns true if the format's z axis is up, false if y is, and none if it does not say.
    #[must_use]
    pub const fn is_z_up(self) -> Option<bool> {
        match self {
            Self::Gltf => Some(false),
            Self::Stl => Some(true),
            Self::Ply | Self::Obj | Self::Blob => None,
        }
    }

    /// Returns the name of the format.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ply => "PLY",
            Self::Obj => "OBJ",
            Self::Stl => "STL",
            Self::Gltf => "glTF",
            Self::Blob => "hgrid blob",
        }
    }

    /// Returns what a file of the format is, with an article.
    #[must_use]
    pub const fn article(self) -> &'static str {
        match self {
            Self::Ply => "a PLY file",
            Self::Obj => "an OBJ file",
            Self::Stl => "an STL file",
            Self::Gltf => "a glTF file",
            Self::Blob => "an hgrid blob",
        }
    }

    /// Returns true if every file of the format starts with the same bytes.
    const fn has_mark(self) -> bool {
        matches!(self, Self::Ply | Self::Blob)
    }
}

/// The marks of foreign files that are found under the names of meshes, or beside them.
const FOREIGN: [(&[u8], &str); 19] = [
    (b"version https://git-lfs", "a pointer of Git LFS: fetch the file with `git lfs pull`"),
    (b"<!DOCTYPE", "a web page: the download went wrong"),
    (b"<html", "a web page: the download went wrong"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"II*\0", "a TIFF picture"),
    (b"MM\0*", "a TIFF picture"),
    (b"#?RADIANCE", "an HDR picture"),
    (b"PK\x03\x04", "a ZIP archive (or 3MF, or USDZ): unpack it first"),
    (b"\x1f\x8b", "packed with gzip: unpack it first"),
    (b"BZh", "packed with bzip2: unpack it first"),
    (b"\xfd7zXZ", "packed with xz: unpack it first"),
    (b"Kaydara FBX", "an FBX file"),
    (b"ISO-10303-21", "a STEP file"),
    (b"BLENDER", "a Blender file"),
    (b"PXR-USDC", "a USD file"),
    (b"#usda", "a USD file"),
    (b"OFF", "an OFF file"),
];

fn foreign(start: &[u8]) -> Option<&'static str> {
    // PPM and its like: P, a digit, a white space, then a size or a comment. A binary STL file may begin with any
    // words.
    if let [b'P', b'1'..=b'6', space, next, ..] = start
        && space.is_ascii_whitespace()
        && (next.is_ascii_digit() || *next == b'#')
    {
        return Some("a PPM, PGM or PBM picture");
    }
    FOREIGN.iter().find(|(mark, _)| start.starts_with(mark)).map(|&(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_goes_before_the_name() {
        for (start, named, expected) in [
            (&b"ply\nformat"[..], Some(Format::Obj), Format::Ply),
            (b"glTF\x02\0", None, Format::Gltf),
            (b"solid a", None, Format::Stl),
            (b"SOLID A", None, Format::Stl),
            (b"P1 bracket", Some(Format::Stl), Format::Stl),
            (b"{ \"asset\"", None, Format::Gltf),
            (b"v 0 0 0", Some(Format::Obj), Format::Obj),
        ] {
            assert_eq!(Format::of_content(start, named).unwrap(), expected);
        }
    }

    #[test]
    fn any_words_may_start_an_stl_file() {
        let folder = tempfile::tempdir().unwrap();
        for words in ["ply", "plywood", "OFF", "GIF89a"] {
            let [stl, obj] = ["a.stl", "a.obj"].map(|name| folder.path().join(name));
            let mut bytes = words.as_bytes().to_vec();
            bytes.resize(80, b' ');
            bytes.extend([1, 0, 0, 0]);
            bytes.extend([0; 50]);
            fs::write(&stl, &bytes).unwrap();
            assert_eq!(Format::of(&stl).unwrap(), Format::Stl, "{words}");
            let is_stl = |path| Format::of(path).is_ok_and(|format| format == Format::Stl);
            // Another name or another length leaves the words to tell.
            fs::write(&obj, &bytes).unwrap();
            bytes.push(0);
            fs::write(&stl, &bytes).unwrap();
            assert!(!is_stl(&obj) && !is_stl(&stl), "{words}");
        }
    }

    #[test]
    fn another_format_is_named() {
        let message =
            |start: &[u8], named| Format::of_content(start, named).unwrap_err().to_string();
        let all = [Format::Ply, Format::Obj, Format::Stl, Format::Gltf, Format::Blob];
        for named in all.into_iter().map(Some).chain([None]) {
            assert_eq!(message(b"", named), "it is empty");
        }
        assert_eq!(
            message(b"v 0 0 0\n", Some(Format::Ply)),
            "it is not a PLY file, in spite of its name"
        );
        assert!(
            message(b"version https://git-lfs", Some(Format::Ply))
                .ends_with("name; it is a pointer of Git LFS: fetch the file with `git lfs pull`")
        );
        assert_eq!(
            message(b"\x89PNG\r\n", Some(Format::Obj)),
            "it is a PNG picture, not an OBJ file"
        );
        for ppm in [&b"P6\n4 4\n255\n"[..], b"P3 1 1 255"] {
            assert_eq!(
                message(ppm, Some(Format::Ply)),
                "it is not a PLY file, in spite of its name; it is a PPM, PGM or PBM picture"
            );
        }
        assert_eq!(message(b"GIF89a", Some(Format::Stl)), "it is a GIF picture, not an STL file");
        assert_eq!(
            message(b"ISO-10303-21;", None),
            format!("it is a STEP file: a mesh is read from {ENDINGS}")
        );
        assert!(message(b"what", None).starts_with("it has another format: "));
        assert_eq!(
            message(&[7; 200], Some(Format::Blob)),
            "it is not an hgrid blob, in spite of its name"
        );
    }
}
