//! The proof that a blob is a grid of its mesh: the `validate` command.

use std::io::{self, Write as _};
use std::path::Path;
use std::time::Instant;

use anyhow::{Context as _, Result, bail, ensure};
use hgrid_core::{BlobInfo, Content, Grid, Scene as Instances, TriangleMesh};
use indicatif::HumanCount;

use crate::blob::Blob;
use crate::cli::blob::ValidateArgs;
use crate::file;
use crate::plural::{counted, triangles};
use crate::render::duration;
use crate::scene::Scene;
use crate::scene::format::Format;

/// Proves a blob and prints the result.
///
/// # Errors
/// If the file cannot be read, or is no grid of its mesh; the message says where.
pub fn run(args: &ValidateArgs) -> Result<()> {
    let path = &args.blob;
    let file = path.display();
    let cannot = || format!("cannot read `{file}`");
    match Format::of(path) {
        Ok(Format::Blob) => {}
        Ok(format) => bail!("`{file}` is {}, not a blob: `hgrid pack` makes one", format.article()),
        // Of a name without an ending, the error would say which meshes are read.
        Err(_) if Format::named(path).is_none() && has_bytes(path) => {
            bail!("`{file}` is not a blob: `hgrid pack` makes one of a mesh")
        }
        Err(error) => return Err(error.context(cannot())),
    }
    let blob = Blob::read(path).with_context(cannot)?;
    let info = BlobInfo::peek(blob.bytes())?;
    if info.content == Content::Packed {
        ensure!(
            args.mesh.is_none(),
            "`{file}` is a packed scene, with its meshes in it: leave out --mesh"
        );
        return prove_scene(path, &blob, &info);
    }
    let what = match info.content {
        Content::Triangles | Content::Packed => None,
        Content::Shapes => Some("shapes"),
        Content::Instances => Some("instances"),
    };
    if let Some(what) = what {
        bail!("`{file}` is built over {what}: only the program that has these can prove it");
    }
    ensure!(
        info.has_mesh || args.mesh.is_some(),
        "`{file}` has no mesh in it: name the file that it was built for, by --mesh"
    );
    ensure!(!info.has_mesh || args.mesh.is_none(), "`{file}` has its mesh in it: leave out --mesh");
    let scene = args.mesh.as_ref().map(Scene::load).transpose()?;
    let opened = match &scene {
        Some(scene) => TriangleMesh::new(&scene.positions, &scene.indices)
            .and_then(|mesh| Grid::open(blob.bytes(), mesh)),
        None => Grid::open_packed(blob.bytes()),
    };
    let grid = opened.with_context(|| format!("`{file}` cannot be opened"))?;
    let start = Instant::now();
    grid.validate(&mut vec![0; grid.validate_bytes()]).with_context(|| match &args.mesh {
        Some(mesh) => {
            format!(
                "`{file}` is not valid, or was built for another mesh than `{}`",
                mesh.display()
            )
        }
        None => format!("`{file}` is not valid"),
    })?;
    let (method, triangles) = (grid.method().name(), triangles(info.triangle_count));
    let time = duration(start.elapsed().as_secs_f64());
    let rest = rest(&blob, &info);
    writeln!(
        io::stdout(),
        "{file}: valid, a grid by {method} of {triangles}, proved in {time}{rest}"
    )?;
    Ok(())
}

/// Returns true if a file can be opened and is not empty.
fn has_bytes(path: &Path) -> bool {
    let length = file::open(path).and_then(|file| Ok(file.metadata()?.len()));
    length.is_ok_and(|length| length > 0)
}

/// Tells of the bytes of the file behind the blob, which nothing reads; empty if there are none.
fn rest(blob: &Blob, info: &BlobInfo) -> String {
    match (blob.bytes().len() as u64).saturating_sub(info.total_bytes) {
        0 => String::new(),
        1 => "; one byte behind it is no part of it".to_owned(),
        count => format!("; {} bytes behind it are no part of it", HumanCount(count)),
    }
}

/// Proves a packed scene with all grids and scenes that it shows.
fn prove_scene(path: &Path, blob: &Blob, info: &BlobInfo) -> Result<()> {
    let file = path.display();
    let bytes = blob.bytes();
    let views = blob.views(info).with_context(|| format!("`{file}` is not valid"))?;
    let (mut members, mut objects) = views;
    let mut scratch = vec![0; bytes.len() / 64];
    let start = Instant::now();
    let scene = Instances::open_packed_proven(bytes, &mut members, &mut objects, &mut scratch)
        .with_context(|| format!("`{file}` is not valid"))?;
    let instances = counted(scene.instance_count(), "instance", "instances");
    let shown = counted(info.triangle_count, "grid or scene", "grids and scenes");
    let (time, rest) = (duration(start.elapsed().as_secs_f64()), rest(blob, info));
    writeln!(
        io::stdout(),
        "{file}: valid, a scene of {instances} with {shown}, proved in {time}{rest}"
    )?;
    Ok(())
}
