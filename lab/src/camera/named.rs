//! The named views of the standard scenes.

use anyhow::{Context as _, Result};

use super::view::SIDES;
use super::{Camera, Lens, Point, Up, View};
use crate::scene::Scene;

/// A view of one scene.
struct Named {
    /// The name of the scene's file.
    scene: &'static str,
    name: &'static str,
    place: Place,
}

/// The place of the camera; y is up.
enum Place {
    /// All of the scene from a side.
    Around(View),
    /// At a point, looking at another.
    Between([Point; 2]),
}

const fn around(scene: &'static str, name: &'static str, view: View) -> Named {
    Named { scene, name, place: Place::Around(view) }
}

const fn between(
    scene: &'static str,
    name: &'static str,
    eye: [f64; 3],
    target: [f64; 3],
) -> Named {
    Named { scene, name, place: Place::Between([Point(eye), Point(target)]) }
}

const VIEWS: &[Named] = &[
    around("sponza.ply", "outside", View::Front),
    between("sponza.ply", "inside", [0.0, 3.0, 0.0], [10.0, 3.0, 0.0]),
    between("sponza.ply", "court", [8.0, 1.5, -0.5], [-8.0, 4.0, 0.5]),
    between("sponza.ply", "gallery", [-11.0, 9.0, -4.5], [10.0, 6.0, 2.0]),
    between("bunny.ply", "close", [-0.03, 0.09, 0.1], [-0.03, 0.09, 0.0]),
    between("dragon.ply", "close", [-0.05, 0.08, 0.06], [-0.05, 0.08, 0.0]),
    between("buddha.ply", "close", [-0.012, 0.13, 0.065], [-0.012, 0.13, 0.0]),
];

/// Returns the word itself if it names a view of any scene.
pub(super) fn name(word: &str) -> Option<&'static str> {
    VIEWS.iter().map(|view| view.name).find(|&name| name == word)
}

/// Returns the camera of a named view of a scene.
///
/// # Errors
/// If the scene has no such view; the message lists the names that it has.
pub(super) fn camera(scene: &Scene, name: &str, up: Up, lens: Lens) -> Result<Camera> {
    let views = || VIEWS.iter().filter(|view| view.scene == scene.name);
    let view = views().find(|view| view.name == name).with_context(|| {
        let names: Vec<_> = views().map(|view| view.name).chain([SIDES]).collect();
        format!("`{}` has no view `{name}`; its views are {}", scene.name, names.join(", "))
    })?;
    Ok(match view.place {
        Place::Around(view) => Camera::framing_through(lens, scene.framed_bounds(), view, up),
        Place::Between([eye, target]) => Camera::between(eye, target, up, lens),
    })
}

/// Lists the scenes and the names of their views, for the help.
#[must_use]
pub fn list() -> String {
    let mut lines: Vec<(&str, Vec<&str>)> = Vec::new();
    for view in VIEWS {
        match lines.last_mut().filter(|(scene, _)| *scene == view.scene) {
            Some((_, names)) => names.push(view.name),
            None => lines.push((view.scene, vec![view.name])),
        }
    }
    let lines = lines.iter().map(|(scene, names)| format!("  {scene}: {}", names.join(", ")));
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(name: &str) -> Scene {
        Scene { name: name.to_owned(), ..Scene::load("procedural:knot:500").unwrap() }
    }

    #[test]
    fn every_name_is_one_of_its_scene_and_of_no_other() {
        let lens = Lens::default();
        for view in VIEWS {
            assert_eq!(name(view.name), Some(view.name));
            camera(&scene(view.scene), view.name, Up::Y, lens).unwrap();
            assert!(list().contains(view.scene) && list().contains(view.name));
        }
        let eye = camera(&scene("sponza.ply"), "inside", Up::Y, lens).unwrap().ray(0, 0, 1);
        assert_eq!((eye.origin, eye.direction), ([0.0, 3.0, 0.0], [1.0, 0.0, 0.0]));
        let error = camera(&scene("bunny.ply"), "inside", Up::Y, lens).unwrap_err().to_string();
        assert!(
            error.contains("`bunny.ply`") && error.contains("are close, front, back"),
            "{error}"
        );
        assert!(name("nowhere").is_none());
    }
}
