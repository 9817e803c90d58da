//! The content of a file, a mesh or a blob: the `info` command.

use std::ffi::OsStr;
use std::io::{self, Write as _};
use std::path::Path;

use anyhow::{Context as _, Result};
use hgrid_core::{BlobInfo, Content, Grid, Parameters, Scene as Instances};
use indicatif::HumanCount;
use serde::Serialize;

use crate::blob::Blob;
use crate::camera::Up;
use crate::cli::blob::InfoArgs;
use crate::notices::tell_hidden;
use crate::plural::triangles;
use crate::scene::format::Format;
use crate::scene::model::Model;
use crate::scene::{Scene, is_finite, read_model};
use crate::shade::normal_of;

/// Prints the facts of a file.
///
/// # Errors
/// If the file cannot be read.
pub fn run(args: &InfoArgs) -> Result<()> {
    let facts = Facts::of(&args.file)?;
    let mut out = io::stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&facts)?)?;
        return Ok(());
    }
    let rows = facts.rows();
    let width = rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    for (name, value) in rows {
        writeln!(out, "{name:width$}  {value}")?;
    }
    Ok(())
}

/// A name and a value, as printed.
type Row = (&'static str, String);

fn count(count: impl TryInto<u64>) -> String {
    HumanCount(count.try_into().unwrap_or(u64::MAX)).to_string()
}

fn corners([min, max]: [[f32; 3]; 2]) -> String {
    let point = |[x, y, z]: [f32; 3]| [x, y, z].map(number).join(" ");
    format!("{}  to  {}", point(min), point(max))
}

/// Formats a coordinate; very large and very small ones with an exponent.
fn number(coordinate: f32) -> String {
    match coordinate.abs() {
        size if size > 0.0 && !(1e-5..1e16).contains(&size) => format!("{coordinate:e}"),
        _ => coordinate.to_string(),
    }
}

/// The content of a file.
#[derive(Debug, PartialEq, Serialize)]
#[serde(untagged)]
enum Facts {
    Mesh(MeshFacts),
    Blob(BlobFacts),
}

/// The facts of a mesh file.
#[derive(Debug, PartialEq, Serialize)]
struct MeshFacts {
    file: String,
    format: &'static str,
    /// Meshes of the file, and their instances.
    meshes: usize,
    instances: usize,
    /// Triangles and vertices of all instances together.
    triangles: usize,
    vertices: usize,
    /// The lowest and the highest corner of the box around its triangles, or around its vertices if it has none and
    /// shares no mesh.
    bounds: Option<[[f32; 3]; 2]>,
    up: &'static str,
    triangles_not_finite: usize,
    triangles_without_area: usize,
}

/// The facts of a blob.
#[derive(Debug, PartialEq, Serialize)]
struct BlobFacts {
    file: String,
    format: &'static str,
    version: u32,
    method: &'static str,
    /// The count of the things that it is built over, in one of these three.
    #[serde(skip_serializing_if = "Option::is_none")]
    triangles: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    shapes: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    instances: Option<u32>,
    /// Grids and scenes in a packed scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    grids_and_scenes: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    vertices: Option<u64>,
    grid_bytes: u64,
    total_bytes: u64,
    has_mesh: bool,
    #[serde(flatten)]
    grid: Option<GridFacts>,
}

/// The grid of a blob that has its mesh.
#[derive(Debug, PartialEq, Serialize)]
struct GridFacts {
    /// How a tree was built.
    #[serde(skip_serializing_if = "Option::is_none")]
    quality: Option<&'static str>,
    bounds: [[f32; 3]; 2],
    triangles_not_finite: u32,
    triangles_without_area: usize,
    lists: u64,
    references: u64,
    longest_list: u32,
    content_hash: String,
}

impl Facts {
    fn of(file: &OsStr) -> Result<Self> {
        let path = Path::new(file);
        let file = &*file.to_string_lossy();
        if file.starts_with("procedural:") || !path.exists() {
            let scene = Scene::load(path)?;
            tell_hidden(&scene);
            let parts = scene.geometries.len().max(1);
            let format = if parts > 1 { "A+B" } else { "formula" };
            return Ok(Self::Mesh(MeshFacts::of(file, format, [parts; 2], &scene)));
        }
        let cannot = || format!("cannot read `{file}`");
        if Format::of(path).with_context(cannot)? == Format::Blob {
            let facts = Blob::read(path).and_then(|blob| BlobFacts::of(file, &blob));
            return facts.map(Self::Blob).with_context(cannot);
        }
        let (format, model) = read_model(path).with_context(cannot)?;
        let counts = [model.meshes.len(), model.instances.len()];
        let hidden = model.hidden_in(file);
        let scene = Scene { is_z_up: format.is_z_up(), hidden, ..Scene::default() };
        tell_hidden(&scene);
        if model.is_shared() {
            return Ok(Self::Mesh(MeshFacts::of_model(file, format.name(), &model, scene)));
        }
        let mesh = model.flatten().with_context(cannot)?;
        let of_triangles = mesh.bounds();
        let scene =
            Scene { of_triangles, positions: mesh.positions, indices: mesh.indices, ..scene };
        Ok(Self::Mesh(MeshFacts::of(file, format.name(), counts, &scene)))
    }
}

impl Facts {
    fn rows(&self) -> Vec<Row> {
        match self {
            Self::Mesh(facts) => facts.rows(),
            Self::Blob(facts) => facts.rows(),
        }
    }
}

impl MeshFacts {
    fn rows(&self) -> Vec<Row> {
        let all = [
            ("file", self.file.clone()),
            ("format", self.format.to_owned()),
            ("meshes", count(self.meshes)),
            ("instances", count(self.instances)),
            ("triangles", count(self.triangles)),
            ("vertices", count(self.vertices)),
            ("bounds", self.bounds.map_or_else(|| "none".to_owned(), corners)),
            ("up", self.up.to_owned()),
        ];
        let flaws = [
            ("not finite", self.triangles_not_finite),
            ("without area", self.triangles_without_area),
        ];
        let flaws = flaws.into_iter().filter(|&(_, number)| number > 0);
        all.into_iter().chain(flaws.map(|(name, n)| (name, triangles(n)))).collect()
    }

    fn of(
        file: &str,
        format: &'static str,
        [meshes, instances]: [usize; 2],
        scene: &Scene,
    ) -> Self {
        let Scene { positions, indices, .. } = scene;
        let [not_finite, flat] = flaws(positions, indices);
        Self {
            file: file.to_owned(),
            format,
            meshes,
            instances,
            triangles: indices.len(),
            vertices: positions.len(),
            bounds: scene.whole_bounds().map(|(min, max)| [min, max]),
            up: match Up::of(scene) {
                Up::Y => "y",
                Up::Z => "z",
            },
            triangles_not_finite: not_finite,
            triangles_without_area: flat,
        }
    }

    /// The facts of a model whose meshes are shared, so that all its triangles may not fit into memory. Triangles
    /// with flaws are counted in each mesh, before its instances transform it.
    fn of_model(file: &str, format: &'static str, model: &Model, scene: Scene) -> Self {
        let Model { meshes, instances, .. } = model;
        let flaws: Vec<_> =
            meshes.iter().map(|mesh| flaws(&mesh.positions, &mesh.indices)).collect();
        let of_triangles = model.bounds();
        let positions = of_triangles.map_or_else(Vec::new, |(min, max)| vec![min, max]);
        let scene = Scene { positions, of_triangles, ..scene };
        let mut facts = Self::of(file, format, [meshes.len(), instances.len()], &scene);
        facts.vertices = 0;
        for &(mesh, _) in instances {
            let [not_finite, flat] = flaws[mesh];
            facts.triangles += meshes[mesh].indices.len();
            facts.vertices += meshes[mesh].positions.len();
            facts.triangles_not_finite += not_finite;
            facts.triangles_without_area += flat;
        }
        facts
    }
}

/// Counts triangles that are not finite, and those of the others that have no area.
fn flaws(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> [usize; 2] {
    let (mut not_finite, mut flat) = (0, 0);
    for triangle in indices {
        // The readers refuse indices of vertices that are not there.
        let corners = triangle.map(|vertex| positions.get(vertex as usize).copied());
        let [Some(a), Some(b), Some(c)] = corners else { continue };
        if !is_finite(&[a, b, c]) {
            not_finite += 1;
        } else if normal_of(&[a, b, c]).is_none() {
            flat += 1;
        }
    }
    [not_finite, flat]
}

impl BlobFacts {
    fn rows(&self) -> Vec<Row> {
        let mesh = if self.has_mesh { "in it" } else { "not in it" };
        let mut rows = vec![
            ("file", self.file.clone()),
            ("format", format!("{}, version {}", self.format, self.version)),
            ("method", self.method.to_owned()),
        ];
        let quality = self.grid.as_ref().and_then(|grid| grid.quality);
        rows.extend(quality.map(|quality| ("quality", quality.to_owned())));
        rows.extend(self.triangles.map(|_| ("mesh", mesh.to_owned())));
        let counts = [
            ("triangles", self.triangles.map(u64::from)),
            ("shapes", self.shapes.map(u64::from)),
            ("instances", self.instances.map(u64::from)),
            ("grids and scenes", self.grids_and_scenes.map(u64::from)),
            ("vertices", self.vertices),
        ];
        rows.extend(counts.into_iter().filter_map(|(name, number)| Some((name, count(number?)))));
        rows.extend([
            ("grid", format!("{} bytes", count(self.grid_bytes))),
            ("all", format!("{} bytes", count(self.total_bytes))),
        ]);
        if let Some(grid) = &self.grid {
            rows.extend([
                ("box (padded)", corners(grid.bounds)),
                ("lists", count(grid.lists)),
                ("longest list", count(grid.longest_list)),
                ("references", count(grid.references)),
                ("not finite", triangles(grid.triangles_not_finite)),
                ("without area", triangles(grid.triangles_without_area)),
                ("content hash", grid.content_hash.clone()),
            ]);
        }
        rows
    }

    fn of(file: &str, blob: &Blob) -> Result<Self> {
        let info = BlobInfo::peek(blob.bytes())?;
        let instances = match info.content {
            Content::Packed => {
                let (mut members, mut objects) = blob.views(&info)?;
                let scene = Instances::open_packed(blob.bytes(), &mut members, &mut objects)?;
                Some(scene.instance_count())
            }
            Content::Instances => Some(info.triangle_count),
            Content::Triangles | Content::Shapes => None,
        };
        let of = |content| (info.content == content).then_some(info.triangle_count);
        let is_mesh = info.content == Content::Triangles;
        let has_mesh = is_mesh && info.has_mesh;
        let grid = has_mesh.then(|| Grid::open_packed(blob.bytes())).transpose()?;
        Ok(Self {
            file: file.to_owned(),
            format: Format::Blob.name(),
            version: info.version,
            method: info.method.name(),
            triangles: of(Content::Triangles),
            shapes: of(Content::Shapes),
            instances,
            grids_and_scenes: of(Content::Packed),
            vertices: is_mesh.then_some(info.vertex_count),
            grid_bytes: info.grid_bytes,
            total_bytes: info.total_bytes,
            has_mesh,
            grid: grid.as_ref().map(GridFacts::of),
        })
    }
}

impl GridFacts {
    fn of(grid: &Grid<'_>) -> Self {
        let ((min, max), found) = (grid.bounds(), grid.inspect());
        let quality = match grid.config().parameters {
            Parameters::Bvh { quality } => Some(quality.name()),
            _ => None,
        };
        let triangles = (0..grid.mesh().triangle_count()).filter_map(|id| grid.mesh().triangle(id));
        let flat = triangles.filter(|corners| is_finite(corners) && normal_of(corners).is_none());
        Self {
            quality,
            bounds: [min, max],
            triangles_not_finite: found.skipped_count,
            triangles_without_area: flat.count(),
            lists: found.list_count,
            references: found.reference_count,
            longest_list: found.longest_list,
            content_hash: format!("{:016x}", found.content_hash),
        }
    }
}

#[cfg(test)]
mod tests {
    use hgrid_core::{Block, Config, Instance, Object, TriangleMesh};

    use super::*;
    use crate::regions::Regions;

    #[test]
    fn a_packed_scene_tells_its_instances() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]]).unwrap();
        let config = Config::default();
        let regions = Regions::build(mesh, &config).unwrap();
        let grid = Grid::open(&regions.index, mesh).unwrap();
        let placed = [Instance::new(0), Instance::new(0), Instance::new(0)];
        let sizes = Instances::bound(3, &config).unwrap();
        let [mut index, mut scratch] = [sizes.index_bytes, sizes.scratch_bytes]
            .map(|bytes| vec![Block::ZERO; Block::count_for(bytes)]);
        let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
        let objects = [Object::Grid(&grid)];
        let scene = Instances::build(&placed, &objects, &config, index, scratch).unwrap();
        let mut blob = Blob::zeroed(usize::try_from(scene.packed_bytes()).unwrap());
        scene.pack(blob.bytes_mut()).unwrap();

        let facts = BlobFacts::of("scene.hgrid", &blob).unwrap();
        assert_eq!((facts.instances, facts.grids_and_scenes), (Some(3), Some(1)));
        let rows = facts.rows();
        assert!(rows.contains(&("instances", "3".to_owned())), "{rows:?}");
        assert!(rows.contains(&("grids and scenes", "1".to_owned())), "{rows:?}");
    }

    #[test]
    fn scenes_of_two_and_of_nothing_are_described() {
        let facts = Facts::of("procedural:knot:800+procedural:soup:600".as_ref()).unwrap();
        let rows = facts.rows();
        assert!(rows.contains(&("format", "A+B".to_owned())), "{rows:?}");
        assert!(rows.contains(&("meshes", "2".to_owned())), "{rows:?}");
        let nothing = MeshFacts::of("a.obj", "OBJ", [1, 1], &Scene::default());
        assert!(nothing.rows().contains(&("bounds", "none".to_owned())));
        assert_eq!(
            corners([[-3e38, 0.5, 0.0], [1e-30, 7.0, 1e9]]),
            "-3e38 0.5 0  to  1e-30 7 1000000000"
        );
    }
}
