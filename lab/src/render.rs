//! From a scene to a picture and its figures: the `render` command.
//!
//! One thread, one ray per pixel, rows from the top. The timed pass traces and shades and does
//! nothing else; the work of the rays is counted in a second pass, which is also where heat
//! pictures come from.

use std::io::{self, Write as _};
use std::time::Instant;

use anyhow::{Context as _, Result};
use hgrid_core::{Block, Config, Counters, Grid, Ray, TriangleMesh, sizes};

use crate::camera::{Camera, Point, View};
use crate::cli::{RenderArgs, Shading};
use crate::figures::{Figures, median, ratio};
use crate::image;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::shade::{self, Shader};

/// Renders, writes the picture and prints the figures.
///
/// # Errors
/// If the scene cannot be loaded or built, or the picture cannot be written.
pub fn run(args: &RenderArgs) -> Result<()> {
    image::check_writable(&args.output)?;

    let start = Instant::now();
    let scene = Scene::load(&args.scene)?;
    let load_seconds = start.elapsed().as_secs_f64();
    if scene.indices.is_empty() {
        eprintln!("warning: `{}` has no triangles: the picture is empty", args.scene);
    }

    let method = args.method.method();
    let default = Config::new(method);
    let config = Config { density: args.density.unwrap_or(default.density), ..default };
    let mesh = TriangleMesh::new(&scene.positions, &scene.indices)?;
    let built = build(mesh, &config, args.repeat)
        .with_context(|| format!("cannot build a grid for `{}`", args.scene))?;
    let grid = Grid::open(Block::bytes(&built.index), mesh)?;

    let camera = camera(args, &scene);
    let shader = Shader::new(mesh, &camera);
    let mut renderings = Vec::new();
    let mut pixels = Vec::new();
    for _ in 0..args.repeat {
        let start = Instant::now();
        pixels = trace(&camera, args.size, "rendering", |ray| {
            let hit = grid.intersect(ray);
            match args.shading {
                Shading::Normals => shader.normals(ray, hit),
                Shading::Diffuse | Shading::Heat => shader.diffuse(ray, hit),
            }
        });
        renderings.push(start.elapsed().as_secs_f64());
    }
    let render_seconds = median(renderings);

    let work = count(&grid, &camera, args.size);
    let mut notes = vec![format!("wrote {}", args.output.display())];
    if args.shading == Shading::Heat {
        let (heat, top) = shade::heat(&work.costs);
        pixels = heat;
        notes.push(format!("red is {top} steps and tests or more"));
    }
    image::write_png(&args.output, args.size, &pixels)?;

    let rays = pixels.len() as u64;
    let index_bytes = grid.blob_bytes();
    let figures = Figures {
        triangles: scene.indices.len(),
        skipped_triangles: grid.skipped_count(),
        vertices: scene.positions.len(),
        scene: scene.name,
        method: args.method.name(),
        density: grid.density(),
        resolution: grid.resolution(),
        references: grid.reference_count(),
        index_bytes,
        index_bytes_per_triangle: ratio(index_bytes as u64, mesh.triangle_count().into()),
        scratch_bytes: built.scratch_bytes,
        size: args.size,
        rays,
        hits: work.hits,
        primitive_tests_per_ray: ratio(work.counters.primitive_tests, rays),
        cell_steps_per_ray: ratio(work.counters.cell_steps, rays),
        grid_steps_per_ray: ratio(work.counters.grid_steps, rays),
        largest_ray_cost: work.costs.iter().copied().max().unwrap_or(0),
        load_seconds,
        build_seconds: built.seconds,
        render_seconds,
        time_to_image_seconds: built.seconds + render_seconds,
        repeats: args.repeat,
    };
    // Not println, which panics when the reader of a pipe has gone.
    let mut out = io::stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&figures)?)?;
    } else {
        writeln!(out, "{figures}\n\n{}", notes.join("; "))?;
    }
    Ok(())
}

/// A grid's memory and what it took.
struct Built {
    index: Vec<Block>,
    scratch_bytes: usize,
    seconds: f64,
}

/// Builds as a user does who has nothing but the mesh: ask for sizes, allocate, build.
fn build(mesh: TriangleMesh<'_>, config: &Config, repeat: u32) -> Result<Built> {
    let mut built = Built { index: Vec::new(), scratch_bytes: 0, seconds: 0.0 };
    let mut times = Vec::new();
    for _ in 0..repeat {
        // Two grids at once would double the memory.
        built.index = Vec::new();
        let start = Instant::now();
        let sizes = sizes(&mesh, config, &mut [])?;
        let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
        let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
        Grid::build(mesh, config, Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch))?;
        times.push(start.elapsed().as_secs_f64());
        (built.index, built.scratch_bytes) = (index, sizes.scratch_bytes);
    }
    built.seconds = median(times);
    Ok(built)
}

/// The camera that the command line asks for.
fn camera(args: &RenderArgs, scene: &Scene) -> Camera {
    let bounds = scene.framed_bounds();
    if let Some(eye) = args.eye {
        let target = args.target.unwrap_or_else(|| Point::centre_of(bounds));
        Camera::between(eye, target, args.up)
    } else {
        let view = args.view.unwrap_or_else(|| View::of(bounds, args.up));
        Camera::framing(bounds, view, args.up)
    }
}

/// What becomes of the ray of every pixel, row by row from the upper left.
pub fn trace<T>(
    camera: &Camera,
    size: u16,
    what: &'static str,
    mut pixel: impl FnMut(&Ray) -> T,
) -> Vec<T> {
    let mut progress = Progress::new(what, size.into());
    let mut pixels = Vec::with_capacity(usize::from(size) * usize::from(size));
    for row in 0..size {
        pixels.extend((0..size).map(|column| pixel(&camera.ray(column, row, size))));
        progress.advance(1);
    }
    pixels
}

/// The work of every ray of a picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Work {
    /// Of all rays together.
    pub counters: Counters,
    /// Rays that hit something.
    pub hits: u64,
    /// Tests and steps of each ray.
    pub costs: Vec<u32>,
}

/// Traces a picture again and counts.
#[must_use]
pub fn count(grid: &Grid<'_>, camera: &Camera, size: u16) -> Work {
    let mut total = Counters::default();
    let mut hits = 0;
    let costs = trace(camera, size, "counting", |ray| {
        let mut counters = Counters::default();
        hits += u64::from(grid.intersect_counted(ray, &mut counters).is_some());
        total.primitive_tests += counters.primitive_tests;
        total.cell_steps += counters.cell_steps;
        total.grid_steps += counters.grid_steps;
        let cost = counters.primitive_tests + counters.cell_steps + counters.grid_steps;
        u32::try_from(cost).unwrap_or(u32::MAX)
    });
    Work { counters: total, hits, costs }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::camera::Up;

    /// Runs the command with the words and a picture in a folder of its own.
    fn run_words(name: &str, words: &[&str], file: Option<(&str, &str)>) -> (Result<()>, bool) {
        let folder = std::env::temp_dir().join(format!("hgrid-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let output = folder.join("picture.png");
        let scene = file.map(|(name, text)| {
            std::fs::write(folder.join(name), text).unwrap();
            folder.join(name).into_os_string()
        });
        let words = words.iter().map(Into::into).chain(scene);
        let words =
            ["hgrid".into(), "-o".into(), output.clone().into_os_string()].into_iter().chain(words);
        let result = run(&RenderArgs::parse_from(words));
        let is_written = output.exists();
        std::fs::remove_dir_all(&folder).unwrap();
        (result, is_written)
    }

    #[test]
    fn every_shading_gives_a_picture() {
        for shading in ["diffuse", "normals", "heat"] {
            let words =
                ["procedural:knot:500", "--size", "9", "--shading", shading, "--repeat", "2"];
            let (result, is_written) = run_words(shading, &words, None);
            result.unwrap();
            assert!(is_written);
        }
    }

    #[test]
    fn a_scene_without_triangles_gives_a_picture() {
        let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
            property float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n1 2 3\n";
        let (result, is_written) =
            run_words("empty", &["--size", "3"], Some(("empty.ply", header)));
        result.unwrap();
        assert!(is_written);
    }

    #[test]
    fn failures_leave_no_picture_and_name_the_cause() {
        let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        let cases: [(&[&str], _, &str); 3] = [
            (&["procedural:teapot"], None, "knot, stage, soup"),
            (&["--density", "-1"], Some(("a.obj", triangle)), "density"),
            (&[], Some(("b.ply", triangle)), "not a PLY file"),
        ];
        for (at, (words, file, expected)) in cases.into_iter().enumerate() {
            let (result, is_written) = run_words(&format!("failure-{at}"), words, file);
            let message = format!("{:#}", result.unwrap_err());
            assert!(message.contains(expected), "{message}");
            assert!(!is_written);
        }
    }

    #[test]
    fn counting_sees_the_same_hits() {
        let scene = Scene::load("procedural:knot:2000").unwrap();
        let mesh = TriangleMesh::new(&scene.positions, &scene.indices).unwrap();
        let built = build(mesh, &Config::default(), 1).unwrap();
        let grid = Grid::open(Block::bytes(&built.index), mesh).unwrap();
        let camera = Camera::framing(scene.framed_bounds(), View::ThreeQuarter, Up::Y);
        let hits = trace(&camera, 40, "", |ray| grid.intersect(ray).is_some());
        let work = count(&grid, &camera, 40);
        assert_eq!(work.hits, hits.iter().filter(|&&is_hit| is_hit).count() as u64);
        assert!((300..900).contains(&work.hits), "{}", work.hits);
        let sum: u64 = work.costs.iter().copied().map(u64::from).sum();
        assert_eq!(sum, work.counters.primitive_tests + work.counters.cell_steps);
    }
}
