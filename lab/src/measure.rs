//! One race for all numbers: every method builds and renders the same scene, in turn.
//!
//! ```text
//! repetition 1:  build A, render A | build B, render B | ...
//! repetition 2:  build A, render A | build B, render B | ...      medians of each column
//! last one:      build A, render A, count A | build B, ...
//! ```
//!
//! Methods take turns, so that warming up and other load on the machine disturb all alike; threads are awake
//! before a clock starts. Each build gets its own memory from the system, whose pages cost time when they are
//! first written. So every method pays for the pages that it writes, in every build, and not for memory that
//! it reserved and left alone. The build time includes computing the sizes, allocating and building, because
//! a first picture needs all of them. (A heap would hand pages of an earlier build to some methods and not to
//! others, depending on their sizes, and would zero memory that is only reserved.) Pages are large if a build
//! requests many bytes and the system has such pages. One more build, in small pages, counts the memory that
//! a build writes.
//!
//! Rendering is one thread, one ray per pixel, tile by tile: the timed pass hands the rays of a tile to the
//! grid, as a renderer does, shades them, and advances the progress bar. Trees trace the rays of a tile
//! together, the others one by one. A separate pass counts the work, ray by ray.

use alloc::borrow::Cow;
use std::ffi::{OsStr, OsString};
use std::time::Instant;

use anyhow::{Context as _, Error, Result, anyhow, ensure};
use hgrid_core::{Config, Counters, Grid, Hit, Method, QueryOptions, Ray, TriangleMesh};
use serde::{Deserialize, Serialize};

use crate::plural::counted;
use crate::progress::Progress;
use crate::regions::{Regions, peak_bytes};
use crate::scene::Scene;
use crate::scene::model::Model;
use crate::shade::{Rgb, Shade, Shader};
use crate::threads::Threads;
use crate::tiles::{TILE_RAYS, Tiles, intersect};

/// A scene as the paper's Table 1 describes it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneFacts {
    /// The scene's name.
    pub scene: String,
    /// Triangles in the scene.
    pub triangles: usize,
    /// Vertices in the scene.
    pub vertices: usize,
    /// Twelve bytes for each triangle and each vertex.
    pub scene_bytes: usize,
}

impl SceneFacts {
    /// Returns the facts of a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self {
            scene: scene.name.clone(),
            triangles: scene.indices.len(),
            vertices: scene.positions.len(),
            scene_bytes: size_of_val(&*scene.indices) + size_of_val(&*scene.positions),
        }
    }

    /// Returns the facts of meshes that instances show: the triangles and vertices of all instances, and the
    /// bytes of each mesh once.
    #[must_use]
    pub fn of_model(name: &str, model: &Model) -> Self {
        let (mut triangles, mut vertices, mut scene_bytes) = (0, 0, 0);
        for mesh in &model.meshes {
            scene_bytes += size_of_val(&*mesh.indices) + size_of_val(&*mesh.positions);
        }
        for mesh in model.instances.iter().filter_map(|&(mesh, _)| model.meshes.get(mesh)) {
            triangles += mesh.indices.len();
            vertices += mesh.positions.len();
        }
        Self { scene: name.to_owned(), triangles, vertices, scene_bytes }
    }
}

/// The numbers of a method for a picture of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// The structure.
    pub method: Cow<'static, str>,
    /// The requested cells per triangle, if the method has such a number.
    pub configured_density: Option<f32>,
    /// Cells per triangle of the built grid: fewer if it would hold too many ids.
    pub density: Option<f32>,
    /// Cells per axis.
    pub resolution: [u32; 3],
    /// Triangle ids in all cells together, for the methods that count them.
    pub references: Option<u32>,
    /// Triangles without finite coordinates, which the grid leaves out.
    pub skipped_triangles: u32,
    /// Bytes of the built grid, without the mesh.
    pub index_bytes: usize,
    /// Bytes of the built grid for each triangle.
    pub index_bytes_per_triangle: f64,
    /// Bytes of scratch that the build was given.
    pub scratch_bytes: usize,
    /// Bytes that were allocated for the grid, whose size is known only after the build.
    pub allocated_index_bytes: usize,
    /// Bytes of index and scratch that the build wrote, in whole small pages; if the system does not tell,
    /// the bytes of the grid and of all scratch.
    pub peak_bytes: usize,
    /// Pixels on each side of the picture.
    pub size: u16,
    /// Rays of the picture: one for each pixel.
    pub rays: u64,
    /// Rays that hit something.
    pub hits: u64,
    /// Work of all rays, each traced alone, divided by their number.
    pub primitive_tests_per_ray: f64,
    /// Leaves of a tree, or cells, empty ones included, that all rays enter, divided by their number.
    pub cell_steps_per_ray: f64,
    /// Nodes of a tree, or subgrids and levels, that all rays enter, divided by their number.
    pub grid_steps_per_ray: f64,
    /// The most tests and steps that one ray took.
    pub largest_ray_cost: u64,
    /// The time of computing the sizes, allocating and building.
    pub build_seconds: f64,
    /// The time of tracing and shading every pixel.
    pub render_seconds: f64,
    /// The time of both, from a mesh in memory to a picture.
    pub time_to_image_seconds: f64,
    /// The times of single builds, of which the time above is the median.
    pub build_samples: Vec<f64>,
    /// The renderings, likewise.
    pub render_samples: Vec<f64>,
}

impl Measurement {
    /// Returns the method and its requested density, if it has one.
    #[must_use]
    pub fn title(&self) -> String {
        self.titled(self.configured_density)
    }

    /// Returns the method and the density that was built.
    #[must_use]
    pub fn built_title(&self) -> String {
        self.titled(self.density)
    }

    /// Returns true if the timed pass traced the rays of a tile together; the counting pass never does.
    #[must_use]
    pub fn is_in_tiles(&self) -> bool {
        self.method == Method::Bvh.name()
    }

    fn titled(&self, density: Option<f32>) -> String {
        match density {
            Some(density) => format!("{}, density {density}", self.method),
            None => self.method.clone().into_owned(),
        }
    }
}

/// A mesh and the picture to take of it.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// The mesh that the grids are built for.
    pub mesh: TriangleMesh<'a>,
    /// The picture.
    pub tiles: Tiles,
    /// The threads that build.
    pub threads: &'a Threads,
}

/// The outcome of a race.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The numbers of every configuration.
    pub measurements: Vec<Measurement>,
    /// The picture of all of them, row by row from the upper left.
    pub pixels: Vec<Rgb>,
    /// The cost of each pixel's ray with the last configuration.
    pub costs: Vec<u32>,
}

/// Returns the number of rows that [`measure`] reports to its progress.
#[must_use]
pub fn rows(size: u16, methods: usize, repeat: u32) -> u64 {
    u64::from(size) * methods as u64 * (u64::from(repeat) + 1)
}

/// Builds and renders with every configuration in turn, `repeat` times, and counts once. Stops after the first picture
/// if it shows nothing: then there are no measurements.
///
/// The function `cost` selects a ray's cost among its counters.
///
/// # Errors
/// If a grid cannot be built, or if two methods do not give the same picture.
pub fn measure(
    subject: &Subject<'_>,
    configs: &[Config],
    repeat: u32,
    shade: Shade,
    cost: impl Fn(&Counters) -> u64,
    progress: &mut Progress,
) -> Result<Outcome> {
    let Subject { mesh, tiles, threads } = *subject;
    let shader = Shader::new(mesh, &tiles.camera);
    let mut samples = vec![(Vec::new(), Vec::new()); configs.len()];
    let mut outcome = Outcome { measurements: Vec::new(), pixels: Vec::new(), costs: Vec::new() };
    let (mut hits, mut is_seen) = ([Hit::MISS; TILE_RAYS], false);
    for repetition in 1..=repeat {
        for (config, (builds, renders)) in configs.iter().zip(&mut samples) {
            let name = config.method().name();
            let turn = format!("{name}, {repetition} of {repeat}:");
            progress.set_message(&format!("{turn} building"));
            threads.wake();
            let start = Instant::now();
            let built = threads
                .parallel(|parallel| Regions::fresh(mesh, config, parallel))
                .with_context(|| format!("cannot build the {name} grid"))?;
            builds.push(start.elapsed().as_secs_f64());
            let Regions { index, scratch } = built;
            let asked = [index.len(), scratch.len()];
            drop(scratch);
            let grid = Grid::open(&index, mesh)?;

            progress.set_message(&format!("{turn} rendering"));
            let start = Instant::now();
            let pixels = trace(&tiles, progress, [0; 3], |rays, pixels| {
                let hits = &mut hits[..rays.len()];
                intersect(&grid, rays, hits);
                shade(&shader, rays, hits, pixels);
            });
            renders.push(start.elapsed().as_secs_f64());

            if !(is_seen || is_seen_by(&tiles, &grid)) {
                return Ok(outcome);
            }
            is_seen = true;
            if repetition == repeat {
                progress.set_message(&format!("{turn} building again, to count its memory"));
                let [index, scratch] = asked;
                let peak = threads.parallel(|parallel| peak_bytes(mesh, config, parallel))?;
                let memory = Memory { index, scratch, peak };
                progress.set_message(&format!("{turn} counting"));
                let work = count(&grid, &tiles, &cost, progress);
                if let Some(first) = outcome.measurements.first() {
                    let differ = outcome.pixels.iter().zip(&pixels).filter(|(a, b)| a != b).count();
                    let pixels = counted(differ, "pixel", "pixels");
                    ensure!(
                        differ == 0,
                        "{} and {name} differ in {pixels}: please report this scene",
                        first.method
                    );
                }
                let samples = [&**builds, renders];
                outcome
                    .measurements
                    .push(numbers(&grid, config, memory, &work, tiles.size, samples));
                (outcome.pixels, outcome.costs) = (pixels, work.costs);
            }
        }
    }
    Ok(outcome)
}

/// Returns true if a ray of the picture hits something.
fn is_seen_by(tiles: &Tiles, grid: &Grid<'_>) -> bool {
    let mut is_seen = false;
    tiles.each(|rays, _| is_seen = is_seen || rays.iter().any(|ray| grid.occluded(ray)));
    is_seen
}

/// Bytes that a build requested, and the most that it used.
#[derive(Clone, Copy)]
struct Memory {
    index: usize,
    scratch: usize,
    peak: usize,
}

/// Returns true if a method counts its references: the others keep ids and grids in one pool.
const fn has_references(method: Method) -> bool {
    matches!(method, Method::OneLevel | Method::Fixed)
}

/// Returns the values that `tile` computes for the rays of all pixels, row by row, and advances the progress.
fn trace<T: Copy>(
    tiles: &Tiles,
    progress: &mut Progress,
    blank: T,
    mut tile: impl FnMut(&[Ray], &mut [T]),
) -> Vec<T> {
    let mut pixels = vec![blank; tiles.pixels()];
    for mut band in tiles.bands(&mut pixels) {
        band.fill(&mut tile);
        progress.advance(band.height().into());
    }
    pixels
}

/// The work of every ray of a picture.
pub(crate) struct Work {
    pub(crate) counters: Counters,
    pub(crate) hits: u64,
    /// The most tests and steps that one ray took.
    pub(crate) largest: u64,
    /// The cost of each pixel's ray.
    pub(crate) costs: Vec<u32>,
}

/// Traces a picture ray by ray, and counts the work.
pub(crate) fn count(
    grid: &Grid<'_>,
    tiles: &Tiles,
    cost: impl Fn(&Counters) -> u64,
    progress: &mut Progress,
) -> Work {
    let (mut total, mut hits, mut largest) = (Counters::default(), 0, 0);
    let costs = trace(tiles, progress, 0, |rays, costs| {
        for (ray, slot) in rays.iter().zip(costs) {
            let mut counters = Counters::default();
            let hit = grid.intersect_with(ray, &mut QueryOptions::counting(&mut counters));
            hits += u64::from(hit.is_some());
            let Counters { primitive_tests, cell_steps, grid_steps } = counters;
            total.primitive_tests += primitive_tests;
            total.cell_steps += cell_steps;
            total.grid_steps += grid_steps;
            largest = largest.max(primitive_tests + cell_steps + grid_steps);
            *slot = u32::try_from(cost(&counters)).unwrap_or(u32::MAX);
        }
    });
    Work { counters: total, hits, largest, costs }
}

fn numbers(
    grid: &Grid<'_>,
    config: &Config,
    memory: Memory,
    work: &Work,
    size: u16,
    [builds, renders]: [&[f64]; 2],
) -> Measurement {
    let rays = u64::from(size) * u64::from(size);
    let index_bytes = grid.blob_bytes();
    let (build_seconds, render_seconds) = (median(builds), median(renders));
    Measurement {
        method: grid.method().name().into(),
        configured_density: config.parameters.density(),
        density: grid.config().parameters.density(),
        resolution: grid.resolution(),
        references: has_references(grid.method()).then(|| grid.reference_count()),
        skipped_triangles: grid.skipped_count(),
        index_bytes,
        index_bytes_per_triangle: ratio(index_bytes as u64, grid.mesh().triangle_count().into()),
        scratch_bytes: memory.scratch,
        allocated_index_bytes: memory.index,
        peak_bytes: memory.peak,
        size,
        rays,
        hits: work.hits,
        primitive_tests_per_ray: ratio(work.counters.primitive_tests, rays),
        cell_steps_per_ray: ratio(work.counters.cell_steps, rays),
        grid_steps_per_ray: ratio(work.counters.grid_steps, rays),
        largest_ray_cost: work.largest,
        build_seconds,
        render_seconds,
        time_to_image_seconds: build_seconds + render_seconds,
        build_samples: builds.to_vec(),
        render_samples: renders.to_vec(),
    }
}

/// Measures scenes in turn. A scene that fails stops no other. Returns the errors of all that failed as one.
pub(crate) fn in_turn(
    scenes: &[OsString],
    mut measure: impl FnMut(&OsStr) -> Result<()>,
) -> Option<Error> {
    let failed = scenes.iter().filter_map(|scene| measure(scene).err());
    let join = |all: Error, next: Error| anyhow!("{all:#}; {next:#}");
    failed.reduce(join)
}

/// Returns `a / b`, or 0 if `b` is 0.
#[expect(clippy::cast_precision_loss, reason = "numbers for people: 15 digits are enough")]
#[must_use]
pub fn ratio(a: u64, b: u64) -> f64 {
    if b == 0 { 0.0 } else { a as f64 / b as f64 }
}

/// Returns the median: the mean of the two middle values if their number is even.
pub(crate) fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let middle = |at: usize| values.get(at).copied().unwrap_or(0.0);
    0.5 * (middle(values.len().saturating_sub(1) / 2) + middle(values.len() / 2))
}

#[cfg(test)]
mod tests {
    use hgrid_core::{INVALID_ID, Method};

    use super::*;
    use crate::camera::{Camera, Up, View};

    fn race(configs: &[Config], repeat: u32) -> Outcome {
        let scene = Scene::load("procedural:knot:2000").unwrap();
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).unwrap();
        let camera = Camera::framing(scene.framed_bounds(), View::ThreeQuarter, Up::Y);
        let threads = Threads::new(2).unwrap();
        let subject = Subject { mesh, tiles: Tiles { camera, size: 40 }, threads: &threads };
        let cost = |work: &Counters| work.primitive_tests + work.cell_steps + work.grid_steps;
        let mut progress = Progress::new("", 0);
        let is_hit: Shade = |_, _, hits, pixels| {
            for (hit, pixel) in hits.iter().zip(pixels) {
                *pixel = [u8::from(*hit != Hit::MISS); 3];
            }
        };
        measure(&subject, configs, repeat, is_hit, cost, &mut progress).unwrap()
    }

    #[test]
    fn every_method_sees_the_same() {
        let configs: Vec<_> = Method::ALL.iter().copied().map(Config::new).collect();
        let Outcome { measurements, pixels, .. } = race(&configs, 1);
        let hits = pixels.iter().filter(|pixel| pixel[0] == 1).count();
        assert!((300..900).contains(&hits), "{hits}");
        assert_eq!(measurements.len(), configs.len());
        for (m, config) in measurements.iter().zip(configs) {
            assert_eq!((&*m.method, m.hits), (config.method().name(), hits as u64));
            assert!(m.allocated_index_bytes >= m.index_bytes && m.peak_bytes >= m.index_bytes);
        }
    }

    #[test]
    fn counts_are_complete() {
        for &method in Method::ALL {
            let Outcome { measurements, costs, .. } = race(&[Config::new(method)], 1);
            let m = &measurements[0];
            let work = m.primitive_tests_per_ray + m.cell_steps_per_ray + m.grid_steps_per_ray;
            let sum: u64 = costs.iter().copied().map(u64::from).sum();
            assert!((work - ratio(sum, m.rays)).abs() < 1e-9);
            assert_eq!(m.largest_ray_cost, u64::from(*costs.iter().max().unwrap()));
        }
    }

    #[test]
    fn a_picture_of_nothing_is_taken_once() {
        let scene = Scene::load("procedural:knot:500").unwrap();
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).unwrap();
        let camera = Camera::framing(([90.0; 3], [91.0; 3]), View::Front, Up::Y);
        let threads = Threads::new(1).unwrap();
        let subject = Subject { mesh, tiles: Tiles { camera, size: 16 }, threads: &threads };
        let shade: Shade =
            |_, _, hits, _| assert!(hits.iter().all(|hit| hit.primitive == INVALID_ID));
        let mut progress = Progress::new("", 0);
        let configs = [Config::default(); 2];
        let outcome = measure(&subject, &configs, 3, shade, |_| 0, &mut progress).unwrap();
        assert!(outcome.measurements.is_empty());
    }

    #[test]
    fn times_are_medians_of_all_repetitions() {
        for m in race(&[Config::default(), Config::default()], 3).measurements {
            assert_eq!((m.build_samples.len(), m.render_samples.len()), (3, 3));
            assert!(m.build_samples.contains(&m.build_seconds));
            assert!(m.time_to_image_seconds > m.render_seconds);
        }
    }

    #[test]
    fn medians_and_ratios_of_nothing_are_zero() {
        assert!(median(&[]).abs() < 1e-9 && ratio(3, 0).abs() < 1e-9);
        assert!((median(&[3.0, 1.0, 2.0]) - 2.0).abs() < 1e-9);
        assert!((median(&[4.0, 1.0, 3.0, 2.0]) - 2.5).abs() < 1e-9);
    }

    #[test]
    fn a_scene_is_as_large_as_in_the_paper() {
        let scene = Scene::load("procedural:knot:2000").unwrap();
        let facts = SceneFacts::of(&scene);
        assert_eq!(facts.scene_bytes, 12 * (facts.triangles + facts.vertices));
    }
}
