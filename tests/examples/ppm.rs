//! Reads pictures that the examples write, and writes scenes that they read.

use std::fs;
use std::path::{Path, PathBuf};

use hgrid_lab::scene::Scene;

/// Red, green and blue of each pixel, rows from the top.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// Reads a file, which must have exactly the pixels that its header promises.
    pub(crate) fn load(path: &Path) -> Self {
        let bytes = fs::read(path).expect("the picture");
        let mut parts = bytes.splitn(4, |&byte| byte == b'\n');
        let mut line = || parts.next().expect("a header of three lines, then pixels");
        assert_eq!(line(), b"P6");
        let size = String::from_utf8(line().to_vec()).expect("text");
        let (width, height) = size.split_once(' ').expect("two numbers");
        let [width, height] = [width, height].map(|n| n.parse().expect("a number"));
        assert_eq!(line(), b"255");
        let pixels = line().as_chunks::<3>();
        assert_eq!((pixels.0.len(), pixels.1), (width * height, &[][..]));
        Self { width, height, pixels: pixels.0.to_vec() }
    }
}

/// Writes a mesh to a folder and returns its path.
pub(crate) fn save(dir: &Path, scene: &Scene) -> PathBuf {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nelement face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        scene.positions.len(),
        scene.indices.len(),
    );
    for [x, y, z] in &scene.positions {
        text += &format!("{x:e} {y:e} {z:e}\n");
    }
    for [a, b, c] in &scene.indices {
        text += &format!("3 {a} {b} {c}\n");
    }
    let path = dir.join("scene.ply");
    fs::write(&path, text).expect("a file");
    path
}
