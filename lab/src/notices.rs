//! Notices on standard error: what of a scene no picture shows.

use std::io::{self, Write as _};

use crate::plural::counted;
use crate::scene::Scene;

/// Tells of what the files of a scene have that is not read.
///
/// # Errors
/// Those of writing.
pub(crate) fn tell_hidden(scene: &Scene) -> io::Result<()> {
    scene.hidden.iter().try_for_each(|hidden| writeln!(io::stderr(), "{hidden}"))
}

/// Tells of the same, and of triangles that are left out.
///
/// # Errors
/// Those of writing.
pub(crate) fn tell(scene: &Scene) -> io::Result<()> {
    tell_hidden(scene)?;
    match left_out(scene.not_finite_count()) {
        Some(left_out) => writeln!(io::stderr(), "{}: {left_out}", scene.name),
        None => Ok(()),
    }
}

/// Returns the words for triangles that a build leaves out; nothing if there are none.
pub(crate) fn left_out(count: impl TryInto<u64>) -> Option<String> {
    match count.try_into().unwrap_or(u64::MAX) {
        0 => None,
        1 => Some("one triangle that is not finite is left out".to_owned()),
        count => {
            let triangles = counted(count, "triangle", "triangles");
            Some(format!("{triangles} that are not finite are left out"))
        }
    }
}
