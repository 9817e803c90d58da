//! OBJ files: all objects and groups of the file as one mesh.
//!
//! Materials, normals and texture coordinates are left out. Points and lines are not triangles
//! and are left out too.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use anyhow::{Context as _, Result};
use tobj::{LoadError, LoadOptions};

use super::Scene;
use crate::progress::Progress;

/// Reads a file.
///
/// # Errors
/// If the file cannot be opened, is not text, or has a face with a vertex that it does not have.
pub(super) fn load(path: &Path) -> Result<Scene> {
    let file = File::open(path).context("cannot open it")?;
    let byte_count = file.metadata().context("cannot read its size")?.len();
    read(&mut BufReader::new(Progress::new("loading", byte_count).reader(file)))
}

fn read(source: &mut impl BufRead) -> Result<Scene> {
    let options = LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..LoadOptions::default()
    };
    let no_materials = |_: &Path| Err(LoadError::GenericFailure);
    let (models, _) =
        tobj::load_obj_buf(source, &options, no_materials).context("it is not a valid OBJ file")?;

    let mut scene = Scene::default();
    for model in models {
        let base = u32::try_from(scene.positions.len()).context("it has too many vertices")?;
        let (positions, _) = model.mesh.positions.as_chunks::<3>();
        scene.positions.extend_from_slice(positions);
        let (triangles, _) = model.mesh.indices.as_chunks::<3>();
        scene.indices.extend(triangles.iter().map(|triangle| triangle.map(|i| base + i)));
    }
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_become_one_mesh_and_quads_two_triangles() {
        let text = "mtllib none.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\n\
                    f 1//1 2//1 3//1 4//1\no b\nv 0 0 1\nusemtl x\nf -1 1 2\np 1\nl 1 2\n";
        let scene = read(&mut text.as_bytes()).unwrap();
        let corners: Vec<_> = scene
            .indices
            .iter()
            .map(|triangle| triangle.map(|i| scene.positions[i as usize]))
            .collect();
        let [a, b, c, d] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
        assert_eq!(corners, [[a, b, c], [a, c, d], [[0., 0., 1.], a, b]]);
    }

    #[test]
    fn damaged_files_are_refused() {
        for text in [&b"v 0 0 0\nf 1 2 3\n"[..], b"v 0 zero 0\n", b"\xff\xfe\x00\x01\n"] {
            let message = format!("{:#}", read(&mut &*text).unwrap_err());
            assert!(message.starts_with("it is not a valid OBJ file: "), "{message}");
        }
    }
}
