//! The paper's figures, measured here: the `figures` command.
//!
//! Figure 1 shows times against density for one scene; figure 2 shows memory and times of every method on
//! every scene. Each is an SVG and a PNG, with its numbers in a JSON file.

mod bars;
mod density;

use std::io::{self, Write as _};
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use hgrid_core::Method;
use plotters::prelude::RGBColor;
use serde::Serialize;

use crate::cli::FiguresArgs;
use crate::notices::say;
use crate::plot::{COLORS, Drawing, save, svg};
use crate::scene;
use crate::table::Results;
use crate::{file, image};

/// Measures, draws and writes.
///
/// # Errors
/// If the scene of figure 1 cannot be loaded or built, or a file cannot be written. If a scene of figure 2 cannot be
/// loaded or built, after the figure of the others is written.
pub fn run(args: &FiguresArgs) -> Result<()> {
    scene::check(&args.scenes)?;
    image::in_folder(&args.output, || measure(args))
}

/// Measures and draws into the folder, which is there.
fn measure(args: &FiguresArgs) -> Result<()> {
    let folder = &args.output;
    // Before the measurement, which takes long.
    for name in ["figure1", "figure2"] {
        for ending in ["svg", "png", "json"] {
            let path = folder.join(name).with_extension(ending);
            for scene in args.scenes.iter().chain(&args.figure1) {
                image::check_sources(&path, scene, "figure")?;
            }
            image::check_writable(&path)?;
        }
    }
    let curves = density::Curves::measure(args)?;
    curves.check()?;
    write(&density::Figure(&curves), &curves, folder, "figure1")?;
    curves.notes().iter().for_each(|note| say(note));
    let (results, failed) = Results::measure(&args.scenes, &args.race)?;
    write(&bars::Figure(&results), &results, folder, "figure2")?;

    let names = ["figure1", "figure2"].map(|name| folder.join(name).display().to_string());
    let wrote = writeln!(io::stdout(), "wrote {} as .svg, .png and .json", names.join(" and "));
    failed.map_or(Ok(()), Err)?;
    Ok(wrote?)
}

/// Draws figure 1 from the JSON file that the command wrote, as SVG.
///
/// # Errors
/// If the JSON is not that of figure 1, and those of drawing.
pub(crate) fn figure1(json: &str) -> Result<String> {
    let curves: density::Curves = serde_json::from_str(json).context("no numbers of figure 1")?;
    ensure!(curves.have_points(), "figure 1 would show nothing: the results have no points");
    svg(&density::Figure(&curves))
}

/// Draws figure 2 from the numbers of a table, as SVG.
///
/// # Errors
/// The errors of drawing.
pub(crate) fn figure2(results: &Results) -> Result<String> {
    svg(&bars::Figure(results))
}

fn write(
    drawing: &impl Drawing,
    numbers: &impl Serialize,
    folder: &Path,
    name: &str,
) -> Result<()> {
    // The numbers first: they took long, and pictures can be drawn from them again.
    let path = folder.join(name).with_extension("json");
    let json = serde_json::to_string_pretty(numbers)? + "\n";
    file::write(&path, |file| file.write_all(json.as_bytes()))?;
    save(drawing, folder, name)
}

/// Returns the colour of a method, the same in every picture.
fn color_of(name: &str) -> RGBColor {
    let place = Method::ALL.iter().position(|method| method.name() == name).unwrap_or(0);
    COLORS[place % COLORS.len()]
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::Parser as _;

    use super::*;

    #[test]
    fn every_file_is_written_and_names_what_it_shows() {
        let folder = std::env::temp_dir().join(format!("hgrid-figures-{}", std::process::id()));
        let words = "hgrid procedural:knot:800 procedural:soup:600 --size 16 --repeat 1 \
            --figure1 procedural:soup:900 --densities 1,8,32 -o";
        let words = words.split_whitespace().map(Into::into).chain([folder.clone().into()]);
        run(&FiguresArgs::parse_from::<_, std::ffi::OsString>(words)).unwrap();
        for (name, expected) in [("figure1", "soup:900"), ("figure2", "knot:800")] {
            let path = folder.join(name);
            let svg = fs::read_to_string(path.with_extension("svg")).unwrap();
            assert!(svg.contains(expected) && svg.contains("one-level"), "{svg}");
            assert!(path.with_extension("png").exists());
            let json = fs::read_to_string(path.with_extension("json")).unwrap();
            assert!(
                serde_json::from_str::<serde_json::Value>(&json).unwrap()["machine"].is_object()
            );
        }
        fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_numbers_are_there_if_a_picture_does_not_fit() {
        let folder = std::env::temp_dir().join(format!("hgrid-full-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        std::os::unix::fs::symlink("/dev/full", folder.join("figure1.png")).unwrap();
        let words = "hgrid procedural:knot:800 --size 16 --repeat 1 --densities 1,8 -o";
        let words = words.split_whitespace().map(Into::into).chain([folder.clone().into()]);
        let error = run(&FiguresArgs::parse_from::<_, std::ffi::OsString>(words)).unwrap_err();
        assert!(format!("{error:#}").contains("figure1.png"), "{error:#}");
        let json = fs::read_to_string(folder.join("figure1.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&json).unwrap();
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn methods_differ_in_colour() {
        let colors: Vec<_> = Method::ALL.iter().map(|method| color_of(method.name())).collect();
        assert!(colors.iter().all(|a| colors.iter().filter(|b| a == *b).count() == 1));
    }
}
