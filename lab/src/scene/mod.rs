//! Scenes that can be rendered: a mesh from a file or from a formula, under one name.
//!
//! A scene is the two plain arrays that the core takes. Loaders write into them directly. They do not merge,
//! reorder or repair anything, because a measurement should see the file as it is. They only cut faces with
//! more than three corners into fans of triangles, as if all were convex.

pub mod format;
pub(crate) mod gltf;
mod knot;
pub mod model;
pub(crate) mod noise;
mod obj;
mod packed;
mod ply;
pub mod procedural;
mod stl;

use std::ffi::OsStr;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
use hgrid_core::{Error, MAX_COORDINATE, MeshPart, Triangle, TriangleMesh};

use self::format::{ENDINGS, Format};
use self::model::{Mesh, Model};

/// Two opposite corners of a box: the smallest and the largest coordinates.
pub type Bounds = ([f32; 3], [f32; 3]);

/// A triangle mesh, with the part of it that pictures show.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    /// The file's name, or the words that generate the scene.
    pub name: String,
    /// Vertices, in scene units.
    pub positions: Vec<[f32; 3]>,
    /// Three vertices for each triangle.
    pub indices: Vec<[u32; 3]>,
    /// The first triangle of each geometry, in ascending order from 0 on; empty for a scene of one geometry.
    pub geometries: Vec<usize>,
    /// The part that pictures show, if not all of it.
    pub focus: Option<Bounds>,
    /// The box around the triangles of a file, which may have vertices elsewhere.
    pub of_triangles: Option<Bounds>,
    /// The axis that the file's format says is up, if it does: true for z, false for y.
    pub is_z_up: Option<bool>,
    /// A sentence for each file of which parts are not read.
    pub hidden: Vec<String>,
}

impl Scene {
    /// Loads a file, makes a scene from `procedural:NAME[:TRIANGLES]`, or puts one scene into another:
    /// `bunny.ply+stadium.ply` is the bunny, at its own size, in the middle of the stadium. Pictures then
    /// show the bunny, and each of the two is a geometry. Instances become triangles.
    ///
    /// # Errors
    /// If the words name no scene or the file cannot be read; the message says how to correct it.
    ///
    /// ```
    /// let scene = hgrid_lab::scene::Scene::load("procedural:knot:2000")?;
    /// assert_eq!(scene.indices.len(), 2000);
    /// # Ok::<(), anyhow::Error>(())
    /// ```
    pub fn load(spec: impl AsRef<OsStr>) -> Result<Self> {
        Self::open(spec.as_ref(), false).map(|(scene, _)| scene)
    }

    /// Loads a scene. If the caller takes instances, and the file shows a mesh more than once, the instances
    /// are kept. The scene is then returned with its model, and has no triangles, only the two corners of its
    /// box as vertices.
    ///
    /// # Errors
    /// The errors of [`load`](Self::load).
    pub fn open(spec: &OsStr, takes_instances: bool) -> Result<(Self, Option<Model>)> {
        let path = Path::new(spec);
        match Source::of(spec)? {
            Source::Pair(inner, outer) => {
                return Ok((Self::load(inner)?.within(Self::load(outer)?), None));
            }
            Source::Formula(words) => {
                let scene = procedural::make(words).with_context(|| no_scene(spec))?;
                return Ok((scene, None));
            }
            Source::File => {}
        }
        let spec = spec.display();
        let (format, model) = read_model(path).with_context(|| format!("cannot load `{spec}`"))?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let hidden = model.hidden_in(&spec);
        let scene = Self { name, is_z_up: format.is_z_up(), hidden, ..Self::default() };
        if takes_instances && model.is_shared() {
            let positions = model.bounds().map_or_else(Vec::new, |(min, max)| vec![min, max]);
            return Ok((Self { positions, ..scene }, Some(model)));
        }
        let mesh = model.flatten().with_context(|| format!("cannot load `{spec}`"))?;
        let of_triangles = mesh.bounds();
        let Mesh { positions, indices } = mesh;
        Ok((Self { positions, indices, of_triangles, ..scene }, None))
    }

    /// Puts this scene in the middle of another, both at their own sizes; pictures show this one.
    fn within(self, outer: Self) -> Self {
        let middle = |scene: &Self| {
            let (min, max) = scene.whole_bounds().unwrap_or_default();
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
        let before = self.indices.len();
        let mut geometries = self.first_triangles();
        geometries.extend(outer.first_triangles().iter().map(|first| before + first));
        // An index out of range stays out of range, for the core to refuse.
        let [own, others] = [&self, &outer].map(|scene| scene.positions.len());
        let shift = u32::try_from(own).unwrap_or(u32::MAX);
        let vertex = |v: u32, count: usize, shift: u32| {
            if (v as usize) < count { v.saturating_add(shift) } else { u32::MAX }
        };
        let inside = self.indices.into_iter().map(|triangle| triangle.map(|v| vertex(v, own, 0)));
        let behind = outer.indices.into_iter();
        let behind = behind.map(|triangle| triangle.map(|v| vertex(v, others, shift)));
        let positions = self.positions.into_iter().map(place).chain(outer.positions).collect();
        let indices = inside.chain(behind).collect();
        let is_z_up = self.is_z_up;
        let hidden = [self.hidden, outer.hidden].concat();
        Self { name, positions, indices, geometries, focus, of_triangles: None, is_z_up, hidden }
    }

    /// Returns the first triangle of each geometry, or 0 for a scene of one.
    fn first_triangles(&self) -> Vec<usize> {
        if self.geometries.is_empty() { vec![0] } else { self.geometries.clone() }
    }

    /// Returns the meshes of several geometries, for [`mesh`](Self::mesh); nothing for one geometry.
    ///
    /// # Errors
    /// If a mesh is larger than the core takes.
    pub fn parts(&self) -> Result<Vec<MeshPart<'_>>, Error> {
        let ends = self.geometries.iter().skip(1).copied().chain([self.indices.len()]);
        let part = |(&first, end)| {
            let indices = self.indices.get(first..end).unwrap_or_default();
            Ok(MeshPart::new(TriangleMesh::new(&self.positions, indices)?))
        };
        self.geometries.iter().zip(ends).map(part).collect()
    }

    /// Returns all triangles as one mesh that knows each triangle's geometry; takes the scene's
    /// [`parts`](Self::parts).
    ///
    /// # Errors
    /// If there are more triangles or vertices than the core takes.
    pub fn mesh<'a>(&'a self, parts: &'a mut [MeshPart<'_>]) -> Result<TriangleMesh<'a>, Error> {
        if parts.is_empty() {
            return TriangleMesh::new(&self.positions, &self.indices);
        }
        TriangleMesh::join(parts)
    }

    /// Returns the number of triangles that are not finite, which every build leaves out.
    #[must_use]
    pub fn not_finite_count(&self) -> usize {
        let corners = |triangle| corners_of(&self.positions, triangle);
        self.indices.iter().filter_map(corners).filter(|triangle| !is_finite(triangle)).count()
    }

    /// Returns the box around all finite vertices, or `None` if there are none.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        model::bounds(self.positions.iter().copied())
    }

    /// Returns the box around all finite triangles of a file, or around all finite vertices of another scene; `None` if
    /// there are none.
    #[must_use]
    pub fn whole_bounds(&self) -> Option<Bounds> {
        self.of_triangles.or_else(|| self.bounds())
    }

    /// Returns the box that a picture shows: the focus, or all of the scene, or the origin if it is empty.
    #[must_use]
    pub fn framed_bounds(&self) -> Bounds {
        self.focus.or_else(|| self.whole_bounds()).unwrap_or_default()
    }
}

/// The kinds of scenes that a user may name.
enum Source<'s> {
    /// One scene inside another.
    Pair(&'s str, &'s str),
    /// A scene by a formula.
    Formula(&'s str),
    /// A file.
    File,
}

impl<'s> Source<'s> {
    fn of(spec: &'s OsStr) -> Result<Self> {
        let path = Path::new(spec);
        // A name that is no text is that of one file.
        let text = spec.to_str().unwrap_or_default();
        if !path.exists()
            && let Some((inner, outer)) = pair(text)
        {
            return Ok(Self::Pair(inner, outer));
        }
        if let Some(words) = text.strip_prefix("procedural:") {
            return Ok(Self::Formula(words));
        }
        if !path.exists() && Format::named(path).is_none() {
            bail!(
                "{}: name a file that ends in {ENDINGS}, or procedural:NAME:TRIANGLES, \
                 where NAME is {}; or one inside another, A+B",
                no_scene(spec),
                procedural::NAMES.join(", ")
            );
        }
        Ok(Self::File)
    }
}

/// Returns the start of the message for words that name no scene.
fn no_scene(spec: &OsStr) -> String {
    format!("no scene `{}`", spec.display())
}

/// Splits A+B behind the first file that is there: its name may have a plus, too.
fn pair(text: &str) -> Option<(&str, &str)> {
    let pluses = || text.match_indices('+').map(|(at, _)| (&text[..at], &text[at + 1..]));
    pluses().find(|(inner, _)| Path::new(inner).is_file()).or_else(|| pluses().next())
}

/// Returns the files that the words of a scene name; for words that name no scene, the file of that name.
pub(crate) fn files(spec: &OsStr) -> Vec<&Path> {
    match Source::of(spec) {
        Ok(Source::Pair(inner, outer)) => {
            [inner, outer].into_iter().flat_map(|of| files(of.as_ref())).collect()
        }
        Ok(Source::Formula(_)) => Vec::new(),
        Ok(Source::File) | Err(_) => vec![Path::new(spec)],
    }
}

/// Looks at the words of scenes and at the starts of their files, before long work with the first of them.
///
/// # Errors
/// If a scene is not there, or a file is of no format that is read.
pub(crate) fn check(scenes: &[impl AsRef<OsStr>]) -> Result<()> {
    for spec in scenes {
        let spec = spec.as_ref();
        match Source::of(spec)? {
            Source::Pair(inner, outer) => check(&[inner, outer])?,
            Source::Formula(words) => procedural::check(words).with_context(|| no_scene(spec))?,
            Source::File => {
                let format = Format::of(Path::new(spec));
                format.with_context(|| format!("cannot load `{}`", spec.display()))?;
            }
        }
    }
    Ok(())
}

/// Returns a word of a file in quotes for a message: its first letters, if it has many.
pub(crate) fn quoted(word: &str) -> String {
    let start: String = word.chars().take(40).collect();
    let rest = if start.len() < word.len() { "..." } else { "" };
    format!("`{start}{rest}`")
}

/// Returns the corners of a triangle; none if a vertex is not there.
fn corners_of(positions: &[[f32; 3]], triangle: &[u32; 3]) -> Option<Triangle> {
    let [a, b, c] = triangle.map(|vertex| positions.get(vertex as usize).copied());
    Some([a?, b?, c?])
}

/// Returns true if the core takes a triangle as finite.
pub(crate) fn is_finite(triangle: &Triangle) -> bool {
    triangle.as_flattened().iter().all(|c| c.abs() <= MAX_COORDINATE)
}

/// Reads the meshes of a file and their instances, in the file's format.
///
/// # Errors
/// If the file cannot be read.
pub fn read_model(path: &Path) -> Result<(Format, Model)> {
    let format = Format::of(path)?;
    Ok((format, format.read(path)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_scenes_are_refused_with_the_known_ones() {
        for spec in ["knot", "mesh.step", "", "procedural:bunny", "procedural:"] {
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
        let mut parts = scene.parts().unwrap();
        let joined = scene.mesh(&mut parts).unwrap();
        let merged = scene.mesh(&mut []).unwrap();
        let found = [0, 1999, 2000, 4999].map(|triangle| joined.locate(triangle).unwrap());
        assert_eq!(found, [(0, 0), (0, 1999), (1, 0), (1, 2999)]);
        for triangle in 0..5000 {
            assert_eq!(joined.triangle(triangle), merged.triangle(triangle));
        }
        // A vertex that no triangle uses moves nothing.
        let mut loose = Scene { of_triangles: small.bounds(), ..small.clone() };
        loose.positions.push([9000.0; 3]);
        let [at, of_loose] = [small.clone(), loose]
            .map(|scene| scene.within(small.clone()).positions[0].map(f32::to_bits));
        assert_eq!(at, of_loose);
        let three = Scene::load(format!("{spec}+procedural:soup:500")).unwrap();
        assert_eq!(three.geometries, [0, 2000, 5000]);
        assert!(small.parts().unwrap().is_empty());
        let bad = Scene { indices: vec![[0, 1, 999_999]], ..small.clone() };
        assert_eq!(bad.clone().within(small.clone()).indices[0], [0, 1, u32::MAX]);
        assert_eq!(small.clone().within(bad).indices[2000][2], u32::MAX);
        let message = format!("{:#}", Scene::load("procedural:knot+nothing").unwrap_err());
        assert!(message.contains("`nothing`"), "{message}");
    }

    #[test]
    fn names_of_files_may_have_a_plus() {
        let folder = std::env::temp_dir().join(format!("hgrid-plus-{}", std::process::id()));
        // A folder is no scene: what stands before the first plus is none.
        std::fs::create_dir_all(folder.join("a")).unwrap();
        let file = folder.join("a+b.obj");
        std::fs::write(&file, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let file = file.to_str().unwrap();
        let spec = format!("{file}+{file}+procedural:knot:2000");
        check(&[&spec]).unwrap();
        let scene = Scene::load(&spec).unwrap();
        assert_eq!(scene.geometries, [0, 1, 2]);
        let missing = format!("{spec}+none.obj");
        for message in [check(&[&missing]).unwrap_err(), Scene::load(&missing).unwrap_err()] {
            let message = format!("{message:#}");
            assert!(message.starts_with("cannot load `none.obj`: cannot open it"), "{message}");
        }
        let message = format!("{:#}", check(&["procedural:knot", "procedural:typo"]).unwrap_err());
        assert!(message.starts_with("no scene `procedural:typo`: NAME in"), "{message}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn words_in_messages_are_short() {
        assert_eq!(quoted("zero"), "`zero`");
        assert_eq!(quoted(&"7".repeat(41)), format!("`{}...`", "7".repeat(40)));
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
