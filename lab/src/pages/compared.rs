//! Tables from the results of `hgrid compare`: hgrid beside other libraries.

use anyhow::{Result, ensure};
use comfy_table::{Cell, CellAlignment, Table};
use serde::Deserialize;

use crate::compare::ratios::has_best_peer;
use crate::machine::Machine;
use crate::measure::ratio;
use crate::table::{count, display_name, markdown, seconds};

/// A file of `hgrid compare --json`: the part that tables show.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Comparison {
    machine: Machine,
    scenes: Vec<Scene>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[expect(clippy::struct_field_names, reason = "the names in the results")]
struct Scene {
    scene: String,
    triangles: usize,
    /// Missing in results older than instances.
    #[serde(default)]
    instances: usize,
    /// True if spheres replace the triangles. Missing in results older than spheres.
    #[serde(default)]
    spheres: bool,
    systems: Vec<System>,
    ratios: Vec<Ratio>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[expect(clippy::struct_field_names, reason = "the names in the results")]
struct System {
    system: String,
    is_peer: bool,
    first_build: Build,
    rebuild: Build,
    index_bytes: u64,
    peak_bytes: u64,
    runs: Vec<Run>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Build {
    seconds: f64,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Run {
    workload: String,
    mode: String,
    seconds: f64,
    rays: u64,
    differing: u64,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[expect(clippy::struct_field_names, reason = "the names in the results")]
struct Ratio {
    what: String,
    hgrid: String,
    value: f64,
    peer: String,
    peer_value: f64,
    ratio: f64,
    least: f64,
    most: f64,
}

const NO_RATIOS: &str = "no ratios: measure with peers beside hgrid";

/// The workloads, in the order of columns.
const WORKLOADS: [&str; 6] = ["primary", "ao", "bounce", "random", "near", "far"];

/// Returns the scenes of all files with their column names, which include a named view.
fn scenes(files: &[Comparison]) -> impl Iterator<Item = (String, &Scene)> {
    files.iter().flat_map(|file| {
        // The option's value is the next word, or stands behind `=`.
        let words = file.machine.command.split([' ', '=']);
        let view = words.skip_while(|word| *word != "--view").nth(1);
        let view = view.map(|view| format!(", {view}")).unwrap_or_default();
        file.scenes
            .iter()
            .map(move |scene| (format!("{}{view}", display_name(&scene.scene)), scene))
    })
}

/// Returns true if there are scenes, and all of them have something.
fn have_all(files: &[Comparison], something: impl Fn(&Scene) -> bool) -> bool {
    let mut all = scenes(files).peekable();
    all.peek().is_some() && all.all(|(_, scene)| something(scene))
}

impl Scene {
    /// Returns the ratios, except for those to a best peer in results that are older than the rule for these.
    fn ratios(&self) -> impl Iterator<Item = &Ratio> {
        let systems: Vec<_> = self.systems.iter().map(|system| &*system.system).collect();
        self.ratios.iter().filter(move |ratio| has_best_peer(&ratio.what, &systems))
    }

    /// Returns the number of triangles or spheres, and that of instances if there are any.
    fn size(&self) -> String {
        match self.instances {
            0 if self.spheres => format!("{} spheres", count(self.triangles)),
            0 => count(self.triangles),
            instances => format!("{} instances of {}", count(instances), count(self.triangles)),
        }
    }
}

/// Makes a table of the median ratios: a row for each ratio that a scene has, a column for each scene.
///
/// # Errors
/// If no scene has any.
pub(super) fn ratios(files: &[Comparison]) -> Result<String> {
    let columns = scenes(files).map(|(name, scene)| format!("{name} {}", scene.size()));
    let mut table = table("hgrid's default / peer", columns);
    let mut rows: Vec<&str> = Vec::new();
    for ratio in scenes(files).flat_map(|(_, scene)| scene.ratios()) {
        if !rows.contains(&&*ratio.what) {
            rows.push(&ratio.what);
        }
    }
    ensure!(!rows.is_empty(), NO_RATIOS);
    for row in rows {
        let cells = scenes(files).map(|(_, scene)| {
            let ratio = scene.ratios().find(|ratio| ratio.what == row);
            ratio.map_or_else(String::new, |ratio| format!("{:.2}", ratio.ratio))
        });
        table.add_row(core::iter::once(row.to_owned()).chain(cells));
    }
    Ok(markdown(&mut table, 1))
}

/// Makes a table for each scene: the ratios with their least and most, and the two numbers of each.
///
/// # Errors
/// If a scene has none, or there is no scene.
pub(super) fn ratios_in_full(files: &[Comparison]) -> Result<String> {
    ensure!(have_all(files, |scene| !scene.ratios.is_empty()), NO_RATIOS);
    let tables = scenes(files).map(|(name, scene)| {
        let columns = ["ratio", "least to most", "hgrid", "peer", "modes"].map(str::to_owned);
        let mut table = table(&format!("{name}, {}", scene.size()), columns);
        for Ratio { what, hgrid, value, peer, peer_value, ratio, least, most } in scene.ratios() {
            let is_exact = what.contains("bytes");
            let number = |value: f64| {
                if is_exact { format!("{value:.1}") } else { format!("{} s", seconds(value)) }
            };
            table.add_row([
                what.clone(),
                format!("{ratio:.2}"),
                if is_exact { String::new() } else { format!("{least:.2} to {most:.2}") },
                number(*value),
                number(*peer_value),
                format!("{hgrid} / {peer}"),
            ]);
        }
        markdown(&mut table, 1)
    });
    Ok(tables.collect::<Vec<_>>().join("\n\n"))
}

/// Makes a table for each scene: builds, bytes and the fastest mode of every workload, for each structure.
///
/// # Errors
/// If a scene has none, or there is no scene.
pub(super) fn systems(files: &[Comparison]) -> Result<String> {
    ensure!(have_all(files, |scene| !scene.systems.is_empty()), "no structures");
    let tables = scenes(files).map(|(name, scene)| {
        let columns = ["first build", "rebuild", "index", "peak"];
        let columns = columns.into_iter().chain(WORKLOADS).map(str::to_owned);
        let mut table = table(&format!("{name}, {}", scene.size()), columns);
        let items = if scene.instances > 0 { scene.instances } else { scene.triangles } as u64;
        for system in &scene.systems {
            let times = [&system.first_build, &system.rebuild];
            let times = times.map(|build| nanoseconds(build.seconds, items));
            let bytes = [system.index_bytes, system.peak_bytes];
            let bytes = bytes.map(|bytes| format!("{:.1}", ratio(bytes, items)));
            let cells = WORKLOADS.into_iter().map(|workload| system.fastest(workload));
            let name = &system.system;
            let name = if system.is_peer { name.clone() } else { format!("hgrid {name}") };
            let name = core::iter::once(name);
            table.add_row(name.chain(times).chain(bytes).chain(cells));
        }
        markdown(&mut table, 1)
    });
    Ok(tables.collect::<Vec<_>>().join("\n\n"))
}

impl System {
    /// Formats the nanoseconds a ray in the fastest mode whose answers are right, and that mode.
    fn fastest(&self, workload: &str) -> String {
        let runs = self.runs.iter().filter(|run| run.workload == workload);
        // The rule of the ratios: at most one answer in a thousand may differ.
        let right = runs.filter(|run| run.differing <= run.rays / 1000);
        let fastest = right.min_by(|a, b| a.seconds.total_cmp(&b.seconds));
        fastest.map_or_else(String::new, |run| {
            format!("{} {}", nanoseconds(run.seconds, run.rays), run.mode)
        })
    }
}

fn nanoseconds(seconds: f64, of: u64) -> String {
    match 1e9 * seconds / ratio(of, 1) {
        ns if ns >= 100.0 => format!("{ns:.0}"),
        ns => format!("{ns:.1}"),
    }
}

/// Makes a table with a column of words, then of numbers.
fn table(title: &str, columns: impl IntoIterator<Item = String>) -> Table {
    let mut table = Table::new();
    let header = core::iter::once(title.to_owned()).chain(columns);
    table.set_header(header.map(Cell::new).collect::<Vec<_>>());
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a file of `compare` with these scenes, each with one ratio or none.
    fn file(command: &str, scenes: &[(&str, &[&str])]) -> Comparison {
        let mut machine = Machine::here();
        machine.command = command.to_owned();
        let ratio = |what: &&str| Ratio {
            what: (*what).to_owned(),
            hgrid: "bvh".to_owned(),
            value: 1.0,
            peer: "peer".to_owned(),
            peer_value: 2.0,
            ratio: 0.5,
            least: 0.5,
            most: 0.5,
        };
        let scene = |&(name, rows): &(&str, &[&str])| Scene {
            scene: name.to_owned(),
            triangles: 2000,
            instances: 0,
            spheres: false,
            systems: Vec::new(),
            ratios: rows.iter().map(ratio).collect(),
        };
        Comparison { machine, scenes: scenes.iter().map(scene).collect() }
    }

    #[test]
    fn a_row_of_any_scene_is_shown() {
        let files = [file("hgrid compare", &[("a", &[]), ("b", &["build"]), ("c", &["rays"])])];
        let table = ratios(&files).unwrap();
        assert!(table.contains("| build ") && table.contains("| rays "), "{table}");
        let error = ratios(&[file("hgrid compare", &[("a", &[])])]).unwrap_err().to_string();
        assert!(error.contains("no ratios"), "{error}");
    }

    #[test]
    fn a_best_peer_of_older_results_is_shown_only_if_it_is_best() {
        let mut file = file("hgrid compare", &[("a", &["rays", "peak bytes / best peer"])]);
        let build = Build { seconds: 1.0 };
        let system = |name: &str| System {
            system: name.to_owned(),
            is_peer: true,
            first_build: build.clone(),
            rebuild: build.clone(),
            index_bytes: 1,
            peak_bytes: 1,
            runs: Vec::new(),
        };
        for (peer, is_shown) in [("embree-medium", false), ("embree-compact", true)] {
            file.scenes[0].systems = vec![system(peer)];
            for table in [ratios, ratios_in_full].map(|make| make(&[file.clone()]).unwrap()) {
                assert!(table.contains("| rays "), "{table}");
                assert_eq!(table.contains("| peak bytes "), is_shown, "{table}");
            }
        }
    }

    #[test]
    fn a_mode_with_wrong_answers_is_not_the_fastest() {
        let run = |mode: &str, seconds: f64, differing: u64| Run {
            workload: "primary".to_owned(),
            mode: mode.to_owned(),
            seconds,
            rays: 2999,
            differing,
        };
        let build = Build { seconds: 1.0 };
        let system = System {
            system: "bvh".to_owned(),
            is_peer: false,
            first_build: build.clone(),
            rebuild: build,
            index_bytes: 1,
            peak_bytes: 1,
            runs: vec![run("slow", 2.999, 2), run("wrong", 1.0, 3), run("damaged", 0.1, u64::MAX)],
        };
        assert_eq!(system.fastest("primary"), "1000000 slow");
    }

    #[test]
    fn titles_name_the_view() {
        for (command, title) in [
            ("hgrid compare a --view inside --size 9", "a, inside"),
            ("hgrid compare a --view=inside", "a, inside"),
            ("hgrid compare a --size 9", "a"),
        ] {
            let files = [file(command, &[("a", &[])])];
            assert_eq!(scenes(&files).map(|(title, _)| title).collect::<Vec<_>>(), [title]);
        }
    }

    #[test]
    fn sizes_tell_what_is_shown() {
        let size = |fields: &str| {
            let json = format!(
                r#"{{"scene": "a.ply", "triangles": 2000, {fields} "systems": [], "ratios": []}}"#
            );
            serde_json::from_str::<Scene>(&json).unwrap().size()
        };
        // Results older than instances and spheres have neither field.
        assert_eq!(size(""), "2.00K");
        assert_eq!(size(r#""instances": 40,"#), "40 instances of 2.00K");
        assert_eq!(size(r#""instances": 0, "spheres": true,"#), "2.00K spheres");
    }
}
