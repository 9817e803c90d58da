//! From a scene to a picture and its numbers: the `render` command.

use std::io::{self, Write as _};
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use hgrid_core::{Counters, TriangleMesh};

use crate::cli::{RenderArgs, Shading};
use crate::heat::{self, Counter, Picture};
use crate::image;
use crate::light::Lights;
use crate::measure::{SceneFacts, Subject, measure, rows};
use crate::progress::Progress;
use crate::report::Report;
use crate::scene::Scene;
use crate::shade::Shade;
use crate::threads::Threads;

/// Renders, writes the picture and prints the numbers.
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

    let size = args.picture.size;
    let mesh = TriangleMesh::new(&scene.positions, &scene.indices)?;
    let threads = Threads::new(args.builders.threads)?;
    let lights = Lights { has_shadows: args.shadows, sky_rays: args.ao };
    ensure!(
        lights.are_everywhere() || args.shading == Shading::Diffuse,
        "--shadows and --ao are for --shading diffuse"
    );
    let subject = Subject { mesh, tiles: args.picture.tiles(&scene)?, lights, threads: &threads };
    let shade: Shade = match args.shading {
        Shading::Normals => |shader, rays, hits, colors| shader.normals(rays, hits, colors),
        Shading::Diffuse | Shading::Heat => {
            |shader, rays, hits, colors| shader.diffuse(rays, hits, colors)
        }
    };
    let counter = args.counter.unwrap_or(Counter::Cost);
    let cost = |work: &Counters| counter.of(work);
    let mut progress = Progress::new(String::new(), rows(size, 1, args.repeat));
    ensure!(
        args.density.is_none() || args.method.has_density(),
        "{} has no density: leave out --density",
        args.method.name()
    );
    let configs = [args.config()];
    let outcome = measure(&subject, &configs, args.repeat, shade, cost, &mut progress)
        .with_context(|| format!("no picture of `{}`", args.scene))?;
    drop(progress);

    let mut notes = vec![format!("wrote {}", args.output.display())];
    let picture = if args.shading == Shading::Heat {
        let (picture, top) = heat::picture(&outcome.costs, size, counter, args.heat_top)?;
        notes.push(format!("red is {top} {} or more", counter.words()));
        picture
    } else {
        Picture { size: (size.into(), size.into()), pixels: outcome.pixels }
    };
    image::write_png(&args.output, picture.size, &picture.pixels)?;

    // Not println, which panics when the reader of a pipe has gone.
    let mut out = io::stdout();
    for measurement in outcome.measurements {
        let report = Report { scene: SceneFacts::of(&scene), load_seconds, measurement };
        if args.json {
            writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
        } else {
            writeln!(out, "{report}\n\n{}", notes.join("; "))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;

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
    fn shadows_and_occlusion_give_a_picture() {
        for method in ["bvh", "one-level"] {
            let words = ["procedural:knot:500", "--size", "20", "--shadows", "--ao", "5"];
            let words = words.into_iter().chain(["--method", method]).collect::<Vec<_>>();
            let (result, is_written) = run_words("lights", &words, None);
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
        let cases: [(&[&str], _, &str); 5] = [
            (&["procedural:teapot"], None, "knot, stage, soup"),
            (&["--method", "fixed", "--density", "-1"], Some(("a.obj", triangle)), "density"),
            (&["--ao", "4", "--shading", "normals"], Some(("d.obj", triangle)), "diffuse"),
            (&["--density", "8"], Some(("c.obj", triangle)), "bvh has no density"),
            (&[], Some(("b.ply", triangle)), "not a PLY file"),
        ];
        for (at, (words, file, expected)) in cases.into_iter().enumerate() {
            let (result, is_written) = run_words(&format!("failure-{at}"), words, file);
            let message = format!("{:#}", result.unwrap_err());
            assert!(message.contains(expected), "{message}");
            assert!(!is_written);
        }
    }
}
