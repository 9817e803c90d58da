//! The proof that a blob is a grid of its mesh: the `validate` command.

use std::io::{self, Write as _};
use std::time::Instant;

use anyhow::{Context as _, Result, bail, ensure};
use hgrid_core::{BlobInfo, Content, Grid, TriangleMesh};
use indicatif::HumanCount;

use crate::blob::Blob;
use crate::cli::blob::ValidateArgs;
use crate::render::seconds;
use crate::scene::Scene;

/// Proves and prints.
///
/// # Errors
/// If the file cannot be read, or is no grid of its mesh: the message says where.
pub fn run(args: &ValidateArgs) -> Result<()> {
    let path = &args.blob;
    let file = path.display();
    let blob = Blob::read(path).with_context(|| format!("cannot read `{file}`"))?;
    let info = BlobInfo::peek(blob.bytes())?;
    let what = match info.content {
        Content::Triangles => None,
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
    let scene = args.mesh.as_deref().map(Scene::load).transpose()?;
    let opened = match &scene {
        Some(scene) => TriangleMesh::new(&scene.positions, &scene.indices)
            .and_then(|mesh| Grid::open(blob.bytes(), mesh)),
        None => Grid::open_packed(blob.bytes()),
    };
    let grid = opened.with_context(|| format!("`{file}` cannot be opened"))?;
    let start = Instant::now();
    grid.validate(&mut vec![0; grid.validate_bytes()])
        .with_context(|| format!("`{file}` is not valid"))?;
    let (method, triangles) = (grid.method().name(), HumanCount(info.triangle_count.into()));
    let time = seconds(start.elapsed().as_secs_f64());
    writeln!(io::stdout(), "{file}: valid, a {method} of {triangles} triangles, proved in {time}")?;
    Ok(())
}
