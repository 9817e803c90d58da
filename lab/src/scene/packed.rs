//! The mesh of a blob that contains it, so that packed grids can be rendered.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use hgrid_core::{BlobInfo, Content, Grid};

use super::Mesh;
use crate::blob::Blob;

/// Reads the mesh out of a packed blob.
///
/// # Errors
/// If the file is no blob of this version, or has no mesh.
pub(super) fn load(path: &Path) -> Result<Mesh> {
    let blob = Blob::read(path)?;
    let BlobInfo { content, has_mesh, .. } = BlobInfo::peek(blob.bytes())?;
    ensure!(
        content != Content::Packed,
        "it is a packed scene, which only `hgrid info` and `hgrid validate` take"
    );
    ensure!(
        has_mesh || content != Content::Triangles,
        "its mesh is not in it: name the file that it was built for"
    );
    let grid = Grid::open_packed(blob.bytes()).context("it cannot be opened")?;
    let mesh = grid.mesh();
    let (vertices, _) = mesh.positions().bytes.as_chunks::<12>();
    let (triangles, _) = mesh.triangles().bytes.as_chunks::<12>();
    let words = |bytes: &[u8; 12]| -> [[u8; 4]; 3] {
        let (words, _) = bytes.as_chunks::<4>();
        [words[0], words[1], words[2]]
    };
    Ok(Mesh {
        positions: vertices.iter().map(|bytes| words(bytes).map(f32::from_ne_bytes)).collect(),
        indices: triangles.iter().map(|bytes| words(bytes).map(u32::from_ne_bytes)).collect(),
    })
}
