//! Real scans, where they are available.
//!
//! The scans are not part of the project, because their makers hold the rights. A test that needs one looks
//! in the folder that `HGRID_SCENES` names, or in `../shared/scenes` beside the checkout, and skips with one
//! line if it is not there, whatever `HGRID_REQUIRE_ALL` says.

use std::path::{Path, PathBuf};

use crate::meshes::Mesh;
use crate::tools::leave_out;

/// Returns the scan with this name, or `None` after a message.
///
/// # Panics
/// If the file is there but cannot be read.
pub fn load(name: &str) -> Option<Mesh> {
    let path = folder().join(name).with_extension("ply");
    if !path.is_file() {
        leave_out(&format!("{name}.ply is not here (HGRID_SCENES names the folder that has it)"));
        return None;
    }
    let path = path.to_str().expect("a path in UTF-8");
    let scene = hgrid_lab::scene::Scene::load(path).expect("a scan can be read");
    Some(Mesh { positions: scene.positions, indices: scene.indices })
}

fn folder() -> PathBuf {
    std::env::var_os("HGRID_SCENES").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes"),
        PathBuf::from,
    )
}
