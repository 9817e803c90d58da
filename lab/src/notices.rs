//! Notices on standard error: the parts of a scene that no picture shows.

use std::io::{self, Write as _};

use crate::plural::counted;
use crate::scene::Scene;

/// Names the parts of a scene's files that are not read.
pub(crate) fn tell_hidden(scene: &Scene) {
    scene.hidden.iter().for_each(|hidden| say(hidden));
}

/// Names the same parts, and counts the triangles that are left out.
pub(crate) fn tell(scene: &Scene) {
    tell_hidden(scene);
    if let Some(left_out) = left_out(scene.not_finite_count()) {
        say(&format!("{}: {left_out}", scene.name));
    }
}

/// Writes a line to standard error. An error is ignored: a closed pipe there must not end the work.
pub fn say(line: &str) {
    // The line may contain words of a file, which must not move the cursor or change colours.
    let mut plain = String::with_capacity(line.len());
    for letter in line.chars() {
        if letter.is_control() && letter != '\n' {
            plain.extend(letter.escape_default());
        } else {
            plain.push(letter);
        }
    }
    // Not `eprintln`, which panics if nothing can be written.
    let _ = writeln!(io::stderr(), "{plain}");
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
