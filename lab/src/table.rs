//! The paper's Table 1: every method on every scene, side by side.
//!
//! Rows come in groups, one for each method, and scenes are columns, as in the paper. Below the paper's six
//! rows of a method are its bytes, which the paper shows only in a chart.

use std::ffi::OsString;
use std::io::{self, Write as _};

use anyhow::{Context as _, Error, Result, ensure};
use comfy_table::{CellAlignment, Table, presets};
use hgrid_core::{Config, Counters, TriangleMesh};
use serde::{Deserialize, Serialize};

use crate::cli::{Race, TableArgs};
use crate::machine::Machine;
use crate::measure::{Measurement, SceneFacts, Subject, in_turn, measure, ratio, rows};
use crate::notices::tell;
use crate::progress::Progress;
use crate::render::unseen;
use crate::scene::{self, Scene};
use crate::shade::Shade;
use crate::threads::Threads;

/// Measures and prints the table.
///
/// # Errors
/// If a scene cannot be loaded or built, or the pictures of two methods differ.
pub fn run(args: &TableArgs) -> Result<()> {
    let (results, failed) = Results::measure(&args.scenes, &args.race)?;
    let text = if args.json {
        serde_json::to_string_pretty(&results)?
    } else if args.markdown {
        results.markdown()
    } else {
        results.text()
    };
    let printed = writeln!(io::stdout(), "{text}");
    failed.map_or(Ok(()), Err)?;
    Ok(printed?)
}

/// Every number of a race over some scenes, with the machine and the settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// The origin of the numbers.
    pub machine: Machine,
    /// Pixels on each side of the pictures.
    pub size: u16,
    /// Builds and renderings whose medians are the times.
    pub repeats: u32,
    /// Threads that built, if the method can use them.
    pub threads: u32,
    /// In the order of the command line.
    pub scenes: Vec<SceneResults>,
}

/// The numbers of all methods on one scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneResults {
    /// The scene.
    #[serde(flatten)]
    pub facts: SceneFacts,
    /// In the order of the command line.
    pub methods: Vec<Measurement>,
}

impl Results {
    /// Runs the race on each scene in turn. Returns the numbers of those that can be measured, and the errors of
    /// the others as one, if there are any.
    ///
    /// # Errors
    /// The errors of [`run`], if no scene can be measured.
    pub fn measure(scenes: &[OsString], race: &Race) -> Result<(Self, Option<Error>)> {
        scene::check(scenes)?;
        let configs = race.configs();
        let size = race.picture.size;
        let total = scenes.len() as u64 * rows(size, configs.len(), race.repeat);
        let mut progress = Progress::new("starting", total);
        let mut measured = Vec::new();
        let failed = in_turn(scenes, |spec| {
            let (scene, spec) = (Scene::load(spec)?, spec.display());
            ensure!(!scene.indices.is_empty(), "`{spec}` has no triangles: nothing to measure");
            tell(&scene);
            let facts = SceneFacts::of(&scene);
            progress.set_scope(&display_name(&facts.scene));
            let methods = measure_diffuse(&scene, &configs, race, &mut progress)
                .with_context(|| format!("cannot measure `{spec}`"))?;
            measured.push(SceneResults { facts, methods });
            Ok(())
        });
        let (repeats, threads) = (race.repeat, race.builders.threads);
        let scenes = measured;
        match failed {
            Some(error) if scenes.is_empty() => Err(error),
            _ => Ok((Self { machine: Machine::here(), size, repeats, threads, scenes }, failed)),
        }
    }

    /// Formats the table as aligned text, with notes and the origin of the numbers.
    #[must_use]
    pub fn text(&self) -> String {
        let mut table = self.table(|title| format!("\n{title}"), "  ");
        table.load_style(presets::NOTHING);
        let notes = self.notes().join("\n");
        [table.trim_fmt(), notes, self.machine.summary(self.threads)].join("\n\n")
    }

    /// Formats the same as Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let summary = self.machine.summary(self.threads);
        let source = format!("{summary}. Command: `{}`.", self.machine.command);
        [self.markdown_table(), source].join("\n\n")
    }

    /// Formats the table and the notes as Markdown, without the origin of the numbers.
    #[must_use]
    pub(crate) fn markdown_table(&self) -> String {
        let mut table = self.table(|title| format!("**{title}**"), "");
        [markdown(&mut table, 1), self.notes().join(" ")].join("\n\n")
    }

    /// Joins the scenes of separate races.
    ///
    /// # Errors
    /// If there is none, or they differ in picture size, methods, repetitions or threads.
    pub(crate) fn merged(races: Vec<Self>) -> Result<Self> {
        let mut races = races.into_iter();
        let mut merged = races.next().context("no results")?;
        let methods =
            |scene: &SceneResults| scene.methods.iter().map(Measurement::title).collect::<Vec<_>>();
        for race in races {
            ensure!(
                (race.size, race.repeats, race.threads)
                    == (merged.size, merged.repeats, merged.threads),
                "results of pictures, repetitions or threads that differ"
            );
            merged.scenes.extend(race.scenes);
        }
        let expected = merged.scenes.first().map(methods).context("results without a scene")?;
        let are_equal = merged.scenes.iter().all(|scene| methods(scene) == expected);
        ensure!(are_equal, "results of methods that differ");
        ensure!(!expected.is_empty(), "results without a method");
        Ok(merged)
    }

    /// Makes the rows; `titled` formats the title of a group, and `indent` indents the others.
    fn table(&self, titled: impl Fn(&str) -> String, indent: &str) -> Table {
        let mut table = Table::new();
        let names = self.scenes.iter().map(|scene| display_name(&scene.facts.scene));
        table.set_header(core::iter::once(String::new()).chain(names));
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        let mut row = |name: &str, cell: &dyn Fn(&SceneResults) -> String| {
            table.add_row(core::iter::once(name.to_owned()).chain(self.scenes.iter().map(cell)));
        };

        let indented = |name: &str| format!("{indent}{name}");
        row(&titled("scene"), &|_| String::new());
        row(&indented("triangles"), &|scene| count(scene.facts.triangles));
        row(&indented("memory (MiB)"), &|scene| {
            format!("{:.1}", mebibytes(scene.facts.scene_bytes))
        });
        let methods = self.scenes.first().map(|scene| &*scene.methods).unwrap_or_default();
        for (index, measurement) in methods.iter().enumerate() {
            row(&titled(&measurement.title()), &|_| String::new());
            let mut row = |name: &str, cell: &dyn Fn(&Measurement) -> String| {
                row(&indented(name), &|scene| {
                    scene.methods.get(index).map(cell).unwrap_or_default()
                });
            };
            row("primitive tests / ray", &|m| format!("{:.2}", m.primitive_tests_per_ray));
            row("cell steps / ray", &|m| format!("{:.2}", m.cell_steps_per_ray));
            row("grid steps / ray", &|m| format!("{:.2}", m.grid_steps_per_ray));
            row("build (s)", &|m| seconds(m.build_seconds));
            row("render (s)", &|m| seconds(m.render_seconds));
            row("time to image (s)", &|m| seconds(m.time_to_image_seconds));
            row("index (MiB)", &|m| format!("{:.1}", mebibytes(m.index_bytes)));
            row("index (bytes / triangle)", &|m| format!("{:.1}", m.index_bytes_per_triangle));
            row("peak (MiB)", &|m| format!("{:.1}", mebibytes(m.peak_bytes)));
        }
        table
    }

    /// Returns notes that explain the numbers, and name grids that differ from their headings.
    fn notes(&self) -> Vec<String> {
        let Self { size, repeats, .. } = self;
        let mut notes = vec![
            format!("{size} x {size} pixels, one ray each, diffuse shading; {}.", times(*repeats)),
            "Peak is what a build in small pages wrote: index and scratch. 1 MiB is 2^20 bytes, the \
             paper's MB."
                .to_owned(),
        ];
        let mut methods = self.scenes.iter().flat_map(|scene| &scene.methods);
        if methods.any(Measurement::is_in_tiles) {
            notes.push(format!("Trees {IN_TILES}."));
        }
        for scene in &self.scenes {
            let name = display_name(&scene.facts.scene);
            let is_thinner = |m: &&Measurement| m.density < m.configured_density;
            for Measurement { method, density, .. } in scene.methods.iter().filter(is_thinner) {
                let density = density.unwrap_or_default();
                notes.push(format!("{name}: {method} at density {density}, for its references."));
            }
        }
        notes
    }
}

/// Runs the race on one scene, for the pictures of the paper.
pub(crate) fn measure_diffuse(
    scene: &Scene,
    configs: &[Config],
    race: &Race,
    progress: &mut Progress,
) -> Result<Vec<Measurement>> {
    let mesh = TriangleMesh::new(&scene.positions, &scene.indices)?;
    let threads = Threads::new(race.builders.threads)?;
    let subject = Subject { mesh, tiles: race.picture.tiles(scene)?, threads: &threads };
    let cost = |_: &Counters| 0;
    let shade: Shade = |shader, rays, hits, colors| shader.diffuse(rays, hits, colors);
    let measurements = measure(&subject, configs, race.repeat, shade, cost, progress)?.measurements;
    ensure!(!measurements.is_empty(), unseen(&race.picture, scene, None));
    Ok(measurements)
}

/// Formats a table as Markdown, with its first columns of words aligned to the left.
pub(crate) fn markdown(table: &mut Table, words: usize) -> String {
    table.load_style(presets::ASCII_MARKDOWN);
    let mut lines: Vec<_> = table.trim_fmt().lines().map(str::to_owned).collect();
    if let Some(rule) = lines.get_mut(1) {
        // Markdown aligns a column to the right if its rule ends in a colon.
        *rule = rule.replace("-|", ":|").replacen(":|", "-|", words);
    }
    lines.join("\n")
}

/// The way in which trees trace pictures, as part of a sentence.
pub(crate) const IN_TILES: &str =
    "trace squares of 8 x 8 rays together; their tests and steps are those of each ray alone";

/// Returns the meaning of times, as part of a sentence.
pub(crate) fn times(repeats: u32) -> String {
    match repeats {
        1 => "times of one run".to_owned(),
        _ => format!("times are medians of {repeats} runs, the methods taking turns"),
    }
}

/// Returns a scene's name for people: without the ending of a PLY or OBJ file.
pub(crate) fn display_name(name: &str) -> String {
    let is_mesh = |ending: &str| matches!(ending, "ply" | "obj" | "PLY" | "OBJ");
    let stem = name.rsplit_once('.').filter(|(_, ending)| is_mesh(ending));
    let name = stem.map_or(name, |(stem, _)| stem);
    name.strip_prefix("procedural:").unwrap_or(name).to_owned()
}

/// Formats a count like the paper: 69.45K, 1.09M.
pub(crate) fn count(count: usize) -> String {
    let count = count as u64;
    match count {
        0..1000 => count.to_string(),
        1000..1_000_000 => format!("{:.2}K", ratio(count, 1000)),
        _ => format!("{:.2}M", ratio(count, 1_000_000)),
    }
}

/// Returns bytes in units of 2^20.
pub(crate) fn mebibytes(bytes: usize) -> f64 {
    ratio(bytes as u64, 1 << 20)
}

/// Formats a time in seconds with three significant digits, but at most four decimal places.
pub(crate) fn seconds(seconds: f64) -> String {
    match seconds {
        s if s >= 100.0 => format!("{s:.0}"),
        s if s >= 10.0 => format!("{s:.1}"),
        s if s >= 1.0 => format!("{s:.2}"),
        s if s >= 0.1 => format!("{s:.3}"),
        s => format!("{s:.4}"),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;
    use hgrid_core::{Method, Parameters};

    use super::*;

    fn results(words: &str) -> Result<Results> {
        let args = TableArgs::parse_from(["hgrid"].into_iter().chain(words.split(' ')));
        let (results, failed) = Results::measure(&args.scenes, &args.race)?;
        assert!(failed.is_none(), "{failed:?}");
        Ok(results)
    }

    #[test]
    fn a_scene_that_fails_leaves_the_others_their_numbers() {
        let folder = std::env::temp_dir().join(format!("hgrid-table-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let [empty, cut] = ["empty.obj", "cut.obj"].map(|name| folder.join(name));
        std::fs::write(&empty, "v 0 0 0\n").unwrap();
        std::fs::write(&cut, "v 0 0\n").unwrap();
        let words = format!("hgrid {} procedural:knot:500 {}", empty.display(), cut.display());
        let words = format!("{words} --size 16 --repeat 1");
        let args = TableArgs::parse_from(words.split(' '));
        let (results, failed) = Results::measure(&args.scenes, &args.race).unwrap();
        assert_eq!(results.scenes.len(), 1);
        let message = format!("{:#}", failed.unwrap());
        assert!(message.contains("empty.obj") && message.contains("cut.obj"), "{message}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn every_method_has_a_group_and_every_scene_a_column() {
        let results =
            results("procedural:knot:500 procedural:soup:300 --size 16 --repeat 2").unwrap();
        let text = results.text();
        assert!(text.contains("knot:"), "{text}");
        for method in Method::ALL {
            let title =
                if Parameters::new(*method).density().is_some() { ", density" } else { "\n" };
            assert!(text.contains(&format!(" {}{title}", method.name())), "{text}");
        }
        assert_eq!(text.matches("time to image").count(), Method::ALL.len());
        assert!(text.contains("medians of 2 runs"));
    }

    #[test]
    fn markdown_is_a_table() {
        let words = "procedural:knot:500 --size 16 --repeat 1 --methods fixed --threads 2";
        let results = results(words).unwrap();
        assert!(results.text().contains("built by 2 threads"));
        let markdown = results.markdown();
        let table: Vec<_> = markdown.lines().take_while(|line| !line.is_empty()).collect();
        assert!(table.iter().all(|line| line.matches('|').count() == 3), "{markdown}");
        assert!(table[1].starts_with("|--") && table[1].ends_with("--:|"), "{markdown}");
        assert!(markdown.contains("**fixed, density 32**"), "{markdown}");
        assert!(markdown.contains("fixed at density 16"), "{markdown}");
    }

    #[test]
    fn json_has_the_machine_and_every_number() {
        let results = results("procedural:knot:500 --size 16 --repeat 1").unwrap();
        let json = serde_json::to_value(&results).unwrap();
        assert!(json["machine"]["rustc"].is_string());
        let methods = json["scenes"][0]["methods"].as_array().unwrap();
        assert_eq!(methods.len(), Method::ALL.len());
        assert_eq!(methods[0]["build_samples"].as_array().unwrap().len(), 1);
    }

    #[test]
    fn failures_name_the_scene() {
        let message = format!("{:#}", results("no/such.ply").unwrap_err());
        assert!(message.contains("no/such.ply"), "{message}");
    }

    #[test]
    fn a_picture_that_shows_nothing_is_not_measured() {
        let words = "procedural:knot:500 --size 16 --repeat 1 --eye 9,9,9 --target 10,10,10";
        let message = format!("{:#}", results(words).unwrap_err());
        let expected =
            "cannot measure `procedural:knot:500`: no ray hits anything; look from elsewhere";
        assert!(message.starts_with(expected), "{message}");
    }

    #[test]
    fn numbers_read_like_the_papers() {
        assert_eq!(
            [999, 69_451, 871_414, 10_000_000].map(count),
            ["999", "69.45K", "871.41K", "10.00M"]
        );
        assert_eq!(display_name("some.bunny.ply"), "some.bunny");
        assert_eq!(display_name("procedural:knot:500"), "knot:500");
        let times = [123.4, 12.34, 1.234, 0.1234, 0.012_34].map(seconds);
        assert_eq!(times, ["123", "12.3", "1.23", "0.123", "0.0123"]);
    }
}
