//! What can be rendered: a mesh from a file or from a formula, under one name.
//!
//! A scene is two plain arrays, the ones that the core takes. Loaders write into them directly;
//! nothing is merged, reordered or repaired, because a measurement should see the file as it is.
//! Only faces with more than three corners are cut into triangles.

mod knot;
mod noise;
mod obj;
mod ply;
pub mod procedural;

use std::path::Path;

use anyhow::{Context as _, Result, bail};

/// Two opposite corners of a box: the smallest and the largest coordinates.
pub type Bounds = ([f32; 3], [f32; 3]);

/// A triangle mesh and what a picture of it should show.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    /// The file's name, or the words that make the scene again.
    pub name: String,
    /// Vertices, in scene units.
    pub positions: Vec<[f32; 3]>,
    /// Three vertices for each triangle.
    pub indices: Vec<[u32; 3]>,
    /// The part that pictures are about, if that is not all of it.
    pub focus: Option<Bounds>,
}

impl Scene {
    /// Loads a `.ply` or `.obj` file, or makes a scene from `procedural:NAME[:TRIANGLES]`, or puts
    /// one of them into another: `bunny.ply+stadium.ply` is the bunny, as large as it is, in the
    /// middle of the stadium, and pictures are of the bunny.
    ///
    /// # Errors
    /// If the words name no scene or the file cannot be read; the message says what to do.
    ///
    /// ```
    /// let scene = hgrid_lab::scene::Scene::load("procedural:knot:2000")?;
    /// assert_eq!(scene.indices.len(), 2000);
    /// # Ok::<(), anyhow::Error>(())
    /// ```
    pub fn load(spec: &str) -> Result<Self> {
        if let Some((inner, outer)) = spec.split_once('+').filter(|_| !Path::new(spec).exists()) {
            return Ok(Self::load(inner)?.within(Self::load(outer)?));
        }
        if let Some(words) = spec.strip_prefix("procedural:") {
            return procedural::make(words).with_context(|| format!("no scene `{spec}`"));
        }
        let path = Path::new(spec);
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let loaded = match extension.to_str() {
            Some("ply") => ply::load(path),
            Some("obj") => obj::load(path),
            _ => bail!(
                "no scene `{spec}`: name a .ply file, an .obj file or procedural:NAME:TRIANGLES, \
                 where NAME is {}; or one inside another, A+B",
                procedural::NAMES.join(", ")
            ),
        };
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { name, ..loaded.with_context(|| format!("cannot load `{spec}`"))? })
    }

    /// This scene in the middle of another, as large as both are; pictures are of what this one is.
    fn within(self, outer: Self) -> Self {
        let middle = |scene: &Self| {
            let (min, max) = scene.bounds().unwrap_or_default();
            let at: [f32; 3] = core::array::from_fn(|axis| 0.5 * (min[axis] + max[axis]));
            at
        };
        let (from, to) = (middle(&self), middle(&outer));
        let place = |p: [f32; 3]| -> [f32; 3] {
            core::array::from_fn(|axis| p[axis] - from[axis] + to[axis])
        };
        let (min, max) = self.framed_bounds();
        let focus = Some((place(min), place(max)));
        let name = format!("{}+{}", self.name, outer.name);
        let first = u32::try_from(self.positions.len()).unwrap_or(u32::MAX);
        let behind = outer.indices.into_iter().map(|triangle| triangle.map(|v| v + first));
        let positions = self.positions.into_iter().map(place).chain(outer.positions).collect();
        let indices = self.indices.into_iter().chain(behind).collect();
        Self { name, positions, indices, focus }
    }

    /// The box around all finite vertices, or `None` if there are none.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        let is_finite = |position: &&[f32; 3]| position.iter().all(|c| c.is_finite());
        self.positions.iter().filter(is_finite).fold(None, |bounds, &position| {
            let (mut min, mut max) = bounds.unwrap_or((position, position));
            for axis in 0..3 {
                min[axis] = min[axis].min(position[axis]);
                max[axis] = max[axis].max(position[axis]);
            }
            Some((min, max))
        })
    }

    /// The box that a picture shows: the focus, or all of the scene, or the origin if it is empty.
    #[must_use]
    pub fn framed_bounds(&self) -> Bounds {
        self.focus.or_else(|| self.bounds()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_scenes_are_refused_with_the_known_ones() {
        for spec in ["knot", "mesh.stl", "", "procedural:bunny", "procedural:"] {
            let message = format!("{:#}", Scene::load(spec).unwrap_err());
            assert!(message.contains(spec) && message.contains("knot"), "{message}");
        }
    }

    #[test]
    fn one_scene_stands_in_the_middle_of_another() {
        let spec = "procedural:knot:2000+procedural:knot:3000";
        let (scene, small) =
            (Scene::load(spec).unwrap(), Scene::load("procedural:knot:2000").unwrap());
        assert_eq!(scene.indices.len(), 5000);
        let (min, max) = small.framed_bounds();
        let (low, high) = scene.framed_bounds();
        for axis in 0..3 {
            assert!(((high[axis] - low[axis]) - (max[axis] - min[axis])).abs() < 1e-5);
        }
        let message = format!("{:#}", Scene::load("procedural:knot+nothing").unwrap_err());
        assert!(message.contains("`nothing`"), "{message}");
    }

    #[test]
    fn a_missing_file_is_named() {
        let message = format!("{:#}", Scene::load("no/such.ply").unwrap_err());
        assert!(message.starts_with("cannot load `no/such.ply`: cannot open it"), "{message}");
    }

    #[test]
    fn bounds_leave_out_what_is_not_finite() {
        let positions = vec![[1.0, 2.0, 3.0], [f32::NAN, 9.0, 9.0], [-1.0, f32::INFINITY, 0.0]];
        let scene = Scene { positions, ..Scene::default() };
        assert_eq!(scene.bounds(), Some(([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])));
        assert_eq!(Scene::default().bounds(), None);
    }
}
