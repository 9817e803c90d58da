//! From a scene to a picture: the `render` command.
//!
//! ```text
//! scene -> build: a world -> camera (given, or viewpoint) -> studio (lamp, sky, floor) -> paint -> PNG
//!                                               '> heat: the work of each ray
//! ```

mod build;
mod paint;
mod studio;
mod summary;

use core::sync::atomic::Ordering;
use std::io::{self, Write as _};
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use hgrid_core::{Counters, Grid};

use self::build::{Built, build};
use self::paint::{Seen, paint};
use self::studio::Studio;
pub(crate) use self::summary::duration;
pub use self::summary::{Summary, Work};
use crate::cli::Picture as View;
use crate::cli::render::{RenderArgs, Shading};
use crate::heat::{self, Counter, Picture};
use crate::image;
use crate::light::Lights;
use crate::measure::{self, SceneFacts, ratio};
use crate::notices::tell_hidden;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::model::Model;
use crate::shade::{Rgb, Shader, normal_of};
use crate::threads::Threads;
use crate::tiles::Tiles;
use crate::world::{World, on_mesh};

/// The largest coordinate that rays are precise for.
const LARGEST: f32 = 1e30;

/// Renders, writes the picture and prints the numbers.
///
/// # Errors
/// If the scene cannot be loaded or built, there is nothing to see, or the picture cannot be written.
pub fn run(args: &RenderArgs) -> Result<()> {
    image::check_writable(&args.output)?;

    let start = Instant::now();
    let (scene, model) = Scene::open(&args.scene, args.takes_instances())?;
    let load_seconds = start.elapsed().as_secs_f64();
    tell_hidden(&scene);
    // Only now, because a file that is no mesh has an error of its own.
    image::check_sources(&args.output, &args.scene, "picture")?;
    let facts = match &model {
        None => SceneFacts::of(&scene),
        Some(model) => SceneFacts::of_model(&scene.name, model),
    };
    let none = || format!("no picture of `{}`", args.scene.display());
    ensure!(facts.triangles > 0, "{}: it has no triangles", none());
    ensure!(scene.bounds().is_some(), "{}: no vertex has finite coordinates", none());

    let threads = Threads::new(args.threads())?;
    threads.wake();
    let lights = args.lights();
    let render = |world: World<'_>, built: Built| {
        let tiles = args.picture.shot(&scene, world)?;
        let start = Instant::now();
        let outcome = draw(args, &scene, world, tiles, lights, &threads)?;
        Ok((built, outcome, start.elapsed().as_secs_f64()))
    };
    let rendered = build(&scene, model.as_ref(), (&args.config(), args.density), &threads, render);
    let (built, outcome, render_seconds) = rendered.with_context(none)?;
    ensure!(outcome.hits > 0, "{}: {}", none(), unseen(&args.picture, &scene, model.as_ref()));
    let Picture { size, pixels } = outcome.picture;
    image::write_png(&args.output, size, &pixels)?;

    let summary = Summary {
        scene: facts,
        geometries: scene.geometries.len().max(1),
        instances: built.instances,
        load_seconds,
        method: args.method.name(),
        threads: outcome.threads,
        build_seconds: built.seconds,
        index_bytes: built.index_bytes,
        skipped_triangles: built.skipped_triangles,
        size: args.picture.size,
        samples: args.samples(),
        shadows: lights.has_shadows,
        ao: lights.sky_rays,
        rays: outcome.rays,
        hits: outcome.hits,
        render_seconds,
        work: outcome.work,
    };
    // Not `println`, which panics if the reader has closed the pipe.
    let mut out = io::stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&summary)?)?;
    } else {
        let note = outcome.note.map(|note| format!("; {note}")).unwrap_or_default();
        writeln!(out, "{summary}\nwrote {}{note}", args.output.display())?;
    }
    Ok(())
}

/// Returns the reason why no ray of a picture hits anything, and the remedy.
pub(crate) fn unseen(picture: &View, scene: &Scene, model: Option<&Model>) -> &'static str {
    let shown = model.into_iter().flat_map(|model| &model.meshes);
    let shown = shown.map(|mesh| (&mesh.positions, &mesh.indices));
    let mut meshes = shown.chain([(&scene.positions, &scene.indices)]);
    let has_area = |positions: &[[f32; 3]], triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| positions.get(vertex as usize).copied());
        let (Some(a), Some(b), Some(c)) = (a, b, c) else { return false };
        [a, b, c].as_flattened().iter().all(|c| c.is_finite()) && normal_of(&[a, b, c]).is_some()
    };
    if !meshes.any(|(positions, indices)| indices.iter().any(|it| has_area(positions, it))) {
        return "no triangle has finite corners and an area; `hgrid info` counts those without";
    }
    let (min, max) = scene.framed_bounds();
    if min.iter().chain(&max).any(|c| c.abs() > LARGEST) {
        return "no ray hits anything: its coordinates are larger than 1e30; scale them down";
    }
    if picture.view.is_none() && picture.eye.is_none() {
        return "no ray hits anything: the mesh may be smaller than a pixel, or out of view. Take a larger --size, or \
                look from nearby, by --eye and --target";
    }
    "no ray hits anything; look from elsewhere, by --view, or by --eye and --target"
}

/// A picture, with the numbers of its rendering.
struct Outcome {
    picture: Picture,
    rays: u64,
    hits: u64,
    threads: u32,
    work: Option<Work>,
    note: Option<String>,
}

fn draw(
    args: &RenderArgs,
    scene: &Scene,
    world: World<'_>,
    tiles: Tiles,
    lights: Lights,
    threads: &Threads,
) -> Result<Outcome> {
    let square =
        |pixels: Vec<Rgb>| Picture { size: (tiles.size.into(), tiles.size.into()), pixels };
    let (pixels, tally) = match (args.shading, world) {
        (Shading::Heat, World::Mesh(grid)) => return heat(args, grid, &tiles),
        (Shading::Normals, World::Mesh(grid)) => {
            let shader = Shader::new(*grid.mesh(), &tiles.camera);
            paint(world, &tiles, args.samples(), threads, |seen: &Seen<'_>, light| {
                let mut colors = vec![[0; 3]; seen.rays.len()];
                let hits: Vec<_> = seen.hits.iter().copied().map(on_mesh).collect();
                shader.normals(seen.rays, &hits, &mut colors);
                for (light, color) in light.iter_mut().zip(colors) {
                    *light = color.map(|c| (f32::from(c) / 255.0).powi(2));
                }
                0
            })
        }
        // Only diffuse shading loads instances.
        (Shading::Diffuse, _) | (_, World::Instances(_)) => {
            let part = (scene.framed_bounds(), scene.focus.is_none());
            let studio = Studio::new(world, tiles, lights, part, args.picture.up(scene));
            paint(world, &tiles, args.samples(), threads, |seen, light| studio.shade(seen, light))
        }
    };
    let [rays, hits] = [tally.rays, tally.hits].map(|count| count.load(Ordering::Relaxed));
    let threads = threads.count();
    Ok(Outcome { picture: square(pixels), rays, hits, threads, work: None, note: None })
}

/// Draws the work of every ray, counted on one thread.
fn heat(args: &RenderArgs, grid: &Grid<'_>, tiles: &Tiles) -> Result<Outcome> {
    let counter = args.counter.unwrap_or(Counter::Cost);
    let mut progress = Progress::new("counting", tiles.size.into());
    let cost = |work: &Counters| counter.of(work);
    let measure::Work { counters, hits, largest, costs } =
        measure::count(grid, tiles, cost, &mut progress);
    let (picture, top) = heat::picture(&costs, tiles.size, counter, args.heat_top)?;
    let rays = costs.len() as u64;
    let work = Work {
        primitive_tests_per_ray: ratio(counters.primitive_tests, rays),
        cell_steps_per_ray: ratio(counters.cell_steps, rays),
        grid_steps_per_ray: ratio(counters.grid_steps, rays),
        largest_ray_cost: largest,
    };
    let note = Some(format!("red is {top} {} or more", counter.words()));
    Ok(Outcome { picture, rays, hits, threads: 1, work: Some(work), note })
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;
    use std::path::Path;

    use clap::Parser as _;

    use super::*;

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    /// Runs the command in a new folder, with a file if one is given, and returns the pixels of the picture
    /// if the command wrote one.
    fn run_words(
        name: &str,
        words: &[&str],
        file: Option<(&str, &str)>,
    ) -> (Result<()>, Option<Vec<u8>>) {
        let folder = std::env::temp_dir().join(format!("hgrid-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let output = folder.join("picture.png");
        let place = |path: &Path| path.to_str().unwrap().to_owned();
        let scene = file.map(|(name, text)| {
            std::fs::write(folder.join(name), text).unwrap();
            place(&folder.join(name))
        });
        let own = ["hgrid".to_owned(), "--size".to_owned(), "20".to_owned(), "-o".to_owned()];
        let own = own.into_iter().chain([place(&output)]);
        let words = own.chain(words.iter().map(|&word| word.to_owned())).chain(scene);
        let result = RenderArgs::try_parse_from(words).map_err(Into::into).and_then(|args| {
            args.check()?;
            run(&args)
        });
        let pixels = std::fs::read(&output).ok().map(|bytes| {
            let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            pixels
        });
        std::fs::remove_dir_all(&folder).unwrap();
        (result, pixels)
    }

    #[test]
    fn every_shading_and_method_gives_a_picture() {
        for (at, options) in [
            "--shading diffuse",
            "--shading normals --samples 2",
            "--shading heat --counter cell-steps",
            "--samples 1 --ao 0 --no-shadows --threads 1",
            "--method one-level --ao 2",
            "--view 30,40 --json",
        ]
        .into_iter()
        .enumerate()
        {
            let words: Vec<_> =
                ["procedural:knot:500"].into_iter().chain(options.split(' ')).collect();
            let (result, pixels) = run_words(&format!("shading-{at}"), &words, None);
            result.unwrap();
            assert!(pixels.is_some(), "{options}");
        }
    }

    #[test]
    fn geometries_have_colours_of_their_own() {
        let orange = |spec: &str| -> Vec<bool> {
            let (result, pixels) = run_words("geometries", &[spec, "--view", "30,60"], None);
            result.unwrap();
            let pixels = pixels.unwrap();
            let (pixels, _) = pixels.as_chunks();
            pixels.iter().map(|[red, _, blue]| red.saturating_sub(*blue) > 30).collect()
        };
        let [inner, outer] = ["procedural:knot:500", "procedural:stage:500"];
        assert!(!orange(inner).contains(&true));
        // The picture shows the outer scene's floor all around the knot.
        let both = orange(&format!("{inner}+{outer}"));
        let corners = [0, 19, 380, 399].map(|at| both[at]);
        assert!(corners == [true; 4], "{corners:?}");
        let floor = both.iter().filter(|is_orange| **is_orange).count();
        assert!((200..350).contains(&floor), "{floor} of 400 pixels");
    }

    #[test]
    fn vertices_without_a_triangle_do_not_change_the_picture() {
        let picture = |text: &str| {
            let (result, pixels) = run_words("loose", &["--ao", "0"], Some(("a.obj", text)));
            result.unwrap();
            pixels.unwrap()
        };
        assert!(picture(TRIANGLE) == picture(&format!("{TRIANGLE}v 1e9 1e9 1e9\n")));
    }

    #[test]
    fn failures_leave_no_picture_and_name_the_cause() {
        let nowhere = "v nan 0 0\nv nan 0 0\nv 0 nan 0\nf 1 2 3\n";
        let flat = "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n";
        let not_finite = "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n";
        let huge = "v 0 0 0\nv 3e38 0 0\nv 0 3e38 0\nf 1 2 3\n";
        let apart = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1e9 1e9 1e9\nf 1 2 3\nf 4 4 4\n";
        let cases: [(&str, &str, &str); 22] = [
            ("--method fixed --density -1", TRIANGLE, "density"),
            ("--ao 4 --shading normals", TRIANGLE, "--ao is for --shading diffuse"),
            ("--no-shadows --shading heat", TRIANGLE, "--no-shadows is for --shading diffuse"),
            ("--samples 4 --shading heat", TRIANGLE, "--samples"),
            ("--counter cost", TRIANGLE, "--counter is for --shading heat"),
            ("--heat-top 9", TRIANGLE, "--heat-top is for --shading heat"),
            ("--density 8", TRIANGLE, "--density is not for bvh"),
            ("--macrocell-factor 8", TRIANGLE, "--macrocell-factor is for --method fixed"),
            ("--depth 2", TRIANGLE, "--depth is for --method recursive"),
            ("--method fixed --macrocell-factor 1", TRIANGLE, "it is no whole number, 2 or more"),
            ("--method recursive --depth 5", TRIANGLE, "it is no whole number from 1 to 4"),
            ("--method fixed --quality high", TRIANGLE, "--quality is for --method bvh"),
            ("--eye 1,2,3 --target 1,2,3", TRIANGLE, "--eye and --target are the same point"),
            ("--eye 0.5,0.5,0", TRIANGLE, "--eye is in the middle of the scene, to which it looks"),
            ("--view close", TRIANGLE, "has no view `close`; its views are front, back, left"),
            ("--eye 1,2,3 --target 1,2,4", TRIANGLE, "no ray hits anything; look from elsewhere"),
            ("--json", flat, "no triangle has finite corners and an area"),
            ("--json", not_finite, "no triangle has finite corners and an area"),
            ("--json", huge, "its coordinates are larger than 1e30; scale them down"),
            (
                "--json",
                apart,
                "the mesh may be smaller than a pixel, or out of view. Take a larger",
            ),
            ("--json", "v 0 0 0\n", "it has no triangles"),
            ("--json", nowhere, "no vertex has finite coordinates"),
        ];
        for (at, (words, text, expected)) in cases.into_iter().enumerate() {
            let words: Vec<_> = words.split(' ').collect();
            let (result, pixels) =
                run_words(&format!("failure-{at}"), &words, Some(("a.obj", text)));
            let message = format!("{:#}", result.unwrap_err());
            assert!(message.contains(expected), "{message}");
            assert!(pixels.is_none());
        }
    }
}
