//! A moving mesh, built anew or refitted for every frame: the `animate` command.
//!
//! Every vertex swings along its normal. A wave that travels through the mesh gives the phase, and all
//! vertices are back in place after the last frame. Each frame does what a game does: it moves the vertices,
//! builds into the same memory and traces all rays in tiles. The sizes are computed in the first frame, and
//! again only if a later frame needs more. A field of instances is a scene over the mesh's grid,
//! and is built or refitted after it.

use core::f64::consts::TAU;
use core::fmt;
use core::sync::atomic::{AtomicU64, Ordering};
use std::io::{self, Write as _};
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use hgrid_core::{
    Config, Grid, Hit, INVALID_ID, Method, Object, Ray, Scene as Instances, TriangleMesh, refit,
};
use indicatif::HumanBytes;
use serde::Serialize;

use crate::camera::Up;
use crate::cli::AnimateArgs;
use crate::field::{self, Field, Memory};
use crate::image;
use crate::measure::median;
use crate::notices::{say, tell};
use crate::plural::{self, counted};
use crate::progress::Progress;
use crate::regions::Regions;
use crate::render::unseen;
use crate::scene::{Bounds, Scene};
use crate::shade::{Rgb, Shader, normal_of};
use crate::threads::Threads;
use crate::tiles::{TILE_RAYS, Tiles, intersect};
use crate::vector::{Vector, offset, round, unit};

/// The swing of a vertex to either side, and the distance from one crest of the wave to the next,
/// as parts of the largest extent of the scene.
const AMPLITUDE: f64 = 0.01;
const WAVELENGTH: f64 = 0.3;

/// Animates and prints.
///
/// # Errors
/// If the scene cannot be loaded or built, no picture shows anything, or a picture cannot be written.
pub fn run(args: &AnimateArgs) -> Result<()> {
    let scene = Scene::load(&args.scene)?;
    let name = args.scene.display();
    ensure!(!scene.indices.is_empty(), "`{name}` has no triangles: nothing to animate");
    tell(&scene);
    let up = args.picture.up.unwrap_or_else(|| Up::of(&scene));
    let field = Field::over(&scene, args.instances, Some(up));
    let focus = field.map(|field| field.bounds()).or(scene.focus);
    let shown = Scene { focus, is_z_up: Some(up == Up::Z), ..scene.clone() };
    let tiles = args.picture.tiles(&shown)?;
    if let Some(folder) = &args.output {
        image::make_folder(folder)?;
    }
    let config = args.tuning.config(args.method, None);
    let threads = Threads::new(args.threads)?;
    let mut progress = Progress::new("frames", args.frames.into());
    let write = |frame: u32, pixels: &[Rgb]| match &args.output {
        Some(folder) => write_frame(folder, frame, args.picture.size, pixels),
        None => Ok(()),
    };
    let is_refitted = args.refit;
    let plan = Plan { frames: args.frames, config, tiles, threads: &threads, field, is_refitted };
    let cannot = || format!("cannot animate `{name}`");
    let (report, hits) = animate(&scene, &plan, write, &mut progress).with_context(cannot)?;
    drop(progress);
    let note =
        if args.output.is_some() { ". The pictures that were written are empty" } else { "" };
    ensure!(hits > 0, "{}: {}{note}", cannot(), unseen(&args.picture, &scene, None));

    let mut out = io::stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        writeln!(out, "{report}")?;
    }
    if let Some(folder) = &args.output {
        let pictures = counted(args.frames, "picture", "pictures");
        say(&format!("wrote {pictures} into {}", folder.display()));
    }
    Ok(())
}

fn write_frame(folder: &Path, frame: u32, size: u16, pixels: &[Rgb]) -> Result<()> {
    let path = folder.join(format!("frame-{frame:05}.png"));
    image::write_png(&path, (size.into(), size.into()), pixels)
}

/// The settings of an animation.
struct Plan<'a> {
    frames: u32,
    config: Config,
    tiles: Tiles,
    threads: &'a Threads,
    /// The places of the mesh's instances, if there are any.
    field: Option<Field>,
    /// Refit instead of building, from the second frame on.
    is_refitted: bool,
}

/// The times of a frame in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Frame {
    /// Building or refitting the mesh's grid, in memory that is already allocated.
    pub build_ms: f64,
    /// Building or refitting the scene of its instances; 0 without instances.
    pub scene_ms: f64,
    /// Tracing and shading every pixel.
    pub render_ms: f64,
    /// Moving the vertices, building and rendering.
    pub frame_ms: f64,
}

/// The times of all frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The scene's name.
    pub scene: String,
    /// Triangles of the scene.
    pub triangles: usize,
    /// Moving instances of it; 0 if the mesh itself is shown.
    pub instances: u32,
    /// True if later frames are refitted, not built.
    pub is_refitted: bool,
    /// The method's name.
    pub method: &'static str,
    /// Threads that build, if the method is built in parallel, and render.
    pub threads: u32,
    /// Pixels on each side.
    pub size: u16,
    /// Regions that were too small for a frame and had to grow: a frame can have two.
    pub grown: u32,
    /// Bytes of the largest grid.
    pub index_bytes: usize,
    /// Bytes of the scene of instances, index and scratch; 0 without instances.
    pub scene_bytes: usize,
    /// The middle values of all frames.
    pub median: Frame,
    /// One for each frame. The first is the slowest: it computes the sizes, and the system provides pages when they
    /// are first written.
    pub frames: Vec<Frame>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, triangles, instances, method, threads, size, .. } = self;
        write!(f, "{scene}: {}, ", plural::triangles(*triangles))?;
        if *instances > 0 {
            write!(f, "{}, ", counted(*instances, "instance", "instances"))?;
        }
        let refitted = if self.is_refitted { ", refitted" } else { "" };
        let threads = counted(*threads, "thread", "threads");
        writeln!(f, "{method}{refitted}, {size} x {size} pixels, {threads}\n")?;
        writeln!(
            f,
            "{:>6}  {:>10}  {:>10}  {:>11}  {:>10}",
            "frame", "build (ms)", "scene (ms)", "render (ms)", "all (ms)"
        )?;
        let mut row = |name: &str, frame: &Frame| {
            let Frame { build_ms, scene_ms, render_ms, frame_ms } = frame;
            write!(f, "{name:>6}  {build_ms:>10.2}  {scene_ms:>10.2}")?;
            writeln!(f, "  {render_ms:>11.2}  {frame_ms:>10.2}")
        };
        for (number, frame) in self.frames.iter().enumerate() {
            row(&number.to_string(), frame)?;
        }
        row("median", &self.median)?;
        write!(f, "\nThe grid took up to {}", HumanBytes(self.index_bytes as u64))?;
        match self.grown {
            0 => f.write_str(" of memory that was there from the first frame on.")?,
            grown => write!(f, "; its memory grew {}.", counted(grown, "time", "times"))?,
        }
        if self.scene_bytes > 0 {
            let scene_bytes = HumanBytes(self.scene_bytes as u64);
            write!(f, " The scene of its instances has {scene_bytes}.")?;
        }
        Ok(())
    }
}

/// Runs all frames and shows each picture. Returns the number of rays that hit something, too.
fn animate(
    scene: &Scene,
    plan: &Plan<'_>,
    mut show: impl FnMut(u32, &[Rgb]) -> Result<()>,
    progress: &mut Progress,
) -> Result<(Report, u64)> {
    let wave = Wave::new(scene);
    let mut positions = scene.positions.clone();
    let mut pixels = vec![[0; 3]; plan.tiles.pixels()];
    let mut kept = None;
    let instances = plan.field.map_or(0, |field| field.count());
    let tree = match plan.config.method() {
        Method::Bvh => plan.config,
        _ => Config::default(),
    };
    let mut memory = Memory::new(instances, &tree, plan.threads.count())?;
    let (mut frames, mut index_bytes, mut grown, mut hits) = (Vec::new(), 0, 0, 0);
    for number in 0..plan.frames {
        let start = Instant::now();
        wave.at(scene, f64::from(number) / f64::from(plan.frames), &mut positions);
        let mesh = TriangleMesh::new(&positions, &scene.indices)?;
        let mut regions = match kept.take() {
            Some(regions) => regions,
            None => plan.threads.parallel(|all| Regions::empty(&mesh, &plan.config, all))?,
        };

        let building = Instant::now();
        let is_refitted = plan.is_refitted && number > 0;
        if is_refitted {
            refit(&mut regions.index, &mesh)?;
        } else {
            grown += plan.threads.parallel(|all| regions.rebuild(mesh, &plan.config, all))?;
        }
        let build_ms = milliseconds(building);

        let grid = Grid::open(&regions.index, mesh)?;
        index_bytes = index_bytes.max(grid.blob_bytes());
        let placing = Instant::now();
        let objects = [Object::Grid(&grid)];
        let field = match &plan.field {
            Some(field) => {
                let instances = field.instances(f64::from(number) / f64::from(plan.frames));
                Some(if is_refitted {
                    memory.refit(&instances, &objects)?
                } else {
                    plan.threads
                        .parallel(|all| memory.build(&instances, &objects, &plan.config, all))?
                })
            }
            None => None,
        };
        let scene_ms = field.map_or(0.0, |_| milliseconds(placing));
        let rendering = Instant::now();
        hits += render(&grid, field.as_ref(), plan, &mut pixels);
        frames.push(Frame {
            build_ms,
            scene_ms,
            render_ms: milliseconds(rendering),
            frame_ms: milliseconds(start),
        });
        show(number, &pixels)?;
        kept = Some(regions);
        progress.advance(1);
    }
    let middle = |time: fn(&Frame) -> f64| median(&frames.iter().map(time).collect::<Vec<_>>());
    let report = Report {
        scene: scene.name.clone(),
        triangles: scene.indices.len(),
        instances,
        is_refitted: plan.is_refitted,
        method: plan.config.method().name(),
        threads: plan.threads.count(),
        size: plan.tiles.size,
        grown,
        index_bytes,
        scene_bytes: if instances > 0 { memory.bytes() } else { 0 },
        median: Frame {
            build_ms: middle(|frame| frame.build_ms),
            scene_ms: middle(|frame| frame.scene_ms),
            render_ms: middle(|frame| frame.render_ms),
            frame_ms: middle(|frame| frame.frame_ms),
        },
        frames,
    };
    Ok((report, hits))
}

fn milliseconds(start: Instant) -> f64 {
    1000.0 * start.elapsed().as_secs_f64()
}

/// Traces and shades all pixels, a band of tiles at a time; returns the number of rays that hit something.
#[expect(clippy::cast_possible_truncation, reason = "fewer bands than pixels of a side")]
fn render(
    grid: &Grid<'_>,
    field: Option<&Instances<'_>>,
    plan: &Plan<'_>,
    pixels: &mut [Rgb],
) -> u64 {
    let shader = Shader::new(*grid.mesh(), &plan.tiles.camera);
    let bands: Vec<_> = plan.tiles.bands(pixels).map(Mutex::new).collect();
    let hit = AtomicU64::new(0);
    plan.threads.each(bands.len() as u32, |at| {
        let Some(Ok(mut band)) = bands.get(at as usize).map(|band| band.lock()) else { return };
        let mut hits = [Hit::MISS; TILE_RAYS];
        band.fill(|rays: &[Ray], colors: &mut [Rgb]| {
            let hits = &mut hits[..rays.len()];
            if let Some(field) = field {
                field::shade(field, &plan.tiles.camera, rays, hits, colors);
            } else {
                intersect(grid, rays, hits);
                shader.diffuse(rays, hits, colors);
            }
            let count = hits.iter().filter(|hit| hit.primitive != INVALID_ID).count();
            hit.fetch_add(count as u64, Ordering::Relaxed);
        });
    });
    hit.into_inner()
}

/// The wave in which the vertices of a scene swing.
struct Wave {
    /// The unit normal of each vertex, 0 where it has none.
    normals: Vec<[f32; 3]>,
    /// The swing of a vertex to either side.
    amplitude: f64,
    /// Crests in a unit of length, along x, y and z.
    frequency: Vector,
}

impl Wave {
    fn new(scene: &Scene) -> Self {
        let mut sums = vec![[0.0; 3]; scene.positions.len()];
        for triangle in &scene.indices {
            let corners = triangle.map(|vertex| scene.positions.get(vertex as usize).copied());
            let [Some(a), Some(b), Some(c)] = corners else { continue };
            let Some(normal) = normal_of(&[a, b, c]) else { continue };
            for &vertex in triangle {
                if let Some(sum) = sums.get_mut(vertex as usize) {
                    *sum = offset(*sum, 1.0, normal);
                }
            }
        }
        let normals = sums.into_iter().map(|sum| round(unit(sum).unwrap_or_default())).collect();
        let extent = largest_extent(scene.framed_bounds());
        let crests = if extent > 0.0 { 1.0 / (WAVELENGTH * extent) } else { 0.0 };
        Self {
            normals,
            amplitude: AMPLITUDE * extent,
            frequency: [0.6 * crests, 0.8 * crests, 0.0],
        }
    }

    /// Moves the vertices to their positions at a time between 0 and 1.
    fn at(&self, scene: &Scene, time: f64, positions: &mut [[f32; 3]]) {
        for ((to, from), normal) in positions.iter_mut().zip(&scene.positions).zip(&self.normals) {
            let place = from.map(f64::from);
            let phase = crate::vector::dot(place, self.frequency) - time;
            let swing = self.amplitude * (TAU * phase).sin();
            *to = round(offset(place, swing, normal.map(f64::from)));
        }
    }
}

fn largest_extent((min, max): Bounds) -> f64 {
    (0..3).map(|axis| f64::from(max[axis]) - f64::from(min[axis])).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::Parser as _;
    use hgrid_core::Method;

    use super::*;
    use crate::camera::{Camera, Up, View};

    fn film(method: Method, threads: u32, frames: u32) -> (Report, Vec<Vec<Rgb>>) {
        film_of(method, threads, frames, 0, false)
    }

    fn film_of(
        method: Method,
        threads: u32,
        frames: u32,
        instances: u32,
        is_refitted: bool,
    ) -> (Report, Vec<Vec<Rgb>>) {
        let scene = Scene::load("procedural:knot:3000").unwrap();
        let field = Field::new(scene.framed_bounds(), instances, Up::Y);
        let field = (instances > 0).then_some(field);
        let bounds = field.map_or_else(|| scene.framed_bounds(), |field| field.bounds());
        let camera = Camera::framing(bounds, View::ThreeQuarter, Up::Y);
        let threads = Threads::new(threads).unwrap();
        let config = Config::new(method);
        let tiles = Tiles { camera, size: 37 };
        let plan = Plan { frames, config, tiles, threads: &threads, field, is_refitted };
        let mut pictures = Vec::new();
        let show = |number: u32, pixels: &[Rgb]| {
            assert_eq!(number as usize, pictures.len());
            pictures.push(pixels.to_vec());
            Ok(())
        };
        let (report, hits) = animate(&scene, &plan, show, &mut Progress::new("", 0)).unwrap();
        assert!(hits > 0);
        (report, pictures)
    }

    #[test]
    fn a_film_does_not_depend_on_the_method_nor_on_the_threads() {
        let (report, expected) = film(Method::Bvh, 1, 4);
        assert_eq!((report.frames.len(), report.grown), (4, 0));
        for (method, threads) in [(Method::Bvh, 3), (Method::OneLevel, 1), (Method::Fixed, 2)] {
            assert!(film(method, threads, 4).1 == expected, "{method:?}, {threads} threads");
        }
    }

    #[test]
    fn instances_move_and_a_refit_shows_the_same() {
        let (report, expected) = film_of(Method::Bvh, 1, 4, 9, false);
        assert!(expected.windows(2).all(|pair| pair[0] != pair[1]));
        assert_eq!(report.instances, 9);
        assert!(report.frames.iter().all(|frame| frame.scene_ms > 0.0));
        assert!(report.to_string().contains("9 instances"));
        assert!(film_of(Method::Bvh, 2, 4, 9, true).1 == expected);
        assert!(film_of(Method::Bvh, 1, 4, 0, true).1 == film(Method::Bvh, 1, 4).1);
    }

    #[test]
    fn it_moves_and_comes_back() {
        let (_, pictures) = film(Method::Bvh, 1, 4);
        assert!(pictures.windows(2).all(|pair| pair[0] != pair[1]));
        let scene = Scene::load("procedural:knot:3000").unwrap();
        let wave = Wave::new(&scene);
        let (mut first, mut last) = (scene.positions.clone(), scene.positions.clone());
        wave.at(&scene, 0.0, &mut first);
        wave.at(&scene, 1.0, &mut last);
        let far = largest_extent(scene.framed_bounds());
        for (a, b) in first.iter().zip(&last) {
            assert!((0..3).all(|axis| f64::from((a[axis] - b[axis]).abs()) < 1e-6 * far));
        }
        assert!(first != scene.positions);
    }

    #[test]
    fn a_report_has_a_row_for_each_frame_and_the_medians() {
        let (report, _) = film(Method::Bvh, 2, 3);
        let text = report.to_string();
        assert!(text.contains("2 threads") && text.contains("median"), "{text}");
        assert_eq!(text.lines().filter(|line| line.contains('.')).count(), 5, "{text}");
        for frame in &report.frames {
            assert!(frame.frame_ms >= frame.build_ms + frame.render_ms);
        }
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["frames"].as_array().unwrap().len(), 3);
    }

    #[test]
    fn frames_are_written() {
        let folder = std::env::temp_dir().join(format!("hgrid-animate-{}", std::process::id()));
        let words = "hgrid procedural:knot:500 --frames 2 --size 9 --threads 2 --json -o";
        let words = words.split(' ').map(Into::into).chain([folder.clone().into_os_string()]);
        run(&AnimateArgs::parse_from(words)).unwrap();
        assert!(folder.join("frame-00000.png").exists() && folder.join("frame-00001.png").exists());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_scene_of_nothing_is_animated() {
        let scene = Scene::default();
        let camera = Camera::framing(scene.framed_bounds(), View::Front, Up::Y);
        let threads = Threads::new(1).unwrap();
        let config = Config::new(Method::Bvh);
        let (tiles, field) = (Tiles { camera, size: 3 }, None);
        let plan = Plan { frames: 2, config, tiles, threads: &threads, field, is_refitted: false };
        let (report, hits) =
            animate(&scene, &plan, |_, _| Ok(()), &mut Progress::new("", 0)).unwrap();
        assert_eq!((report.frames.len(), hits), (2, 0));
    }
}
