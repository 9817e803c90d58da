//! A comparison as tables: times and memory, page faults and differing rays, and ratios.

use comfy_table::{CellAlignment, Table, presets};

use super::numbers::{Comparison, Run, SceneNumbers, SystemNumbers};
use super::ratios::Ratio;
use super::system::Mode;
use super::workloads::{AO_REACH, Workload};
use crate::table::{count, display_name, markdown as as_markdown, seconds, times};

/// Behind a time whose rays have too many answers that differ.
const MARK: &str = " (!)";

/// Columns of words, from the left.
const WORDS: usize = 2;

/// Aligned tables and notes.
pub(super) fn text(comparison: &Comparison) -> String {
    let aligned = |mut table: Table| {
        table.load_style(presets::NOTHING);
        table.trim_fmt()
    };
    let scene = |scene: &SceneNumbers| {
        let tables = scene.tables().map(aligned);
        core::iter::once(scene.title()).chain(tables).collect::<Vec<_>>().join("\n\n")
    };
    let mut parts: Vec<_> = comparison.scenes.iter().map(scene).collect();
    parts.push(comparison.notes().join("\n"));
    parts.push(comparison.source());
    parts.join("\n\n")
}

/// The same as Markdown.
pub(super) fn markdown(comparison: &Comparison) -> String {
    let scene = |scene: &SceneNumbers| {
        let title = format!("### {}", scene.title());
        let tables = scene.tables().map(|mut table| as_markdown(&mut table, WORDS));
        core::iter::once(title).chain(tables).collect::<Vec<_>>().join("\n\n")
    };
    let mut parts: Vec<_> = comparison.scenes.iter().map(scene).collect();
    parts.push(comparison.notes().join(" "));
    parts.push(format!("{} Command: `{}`.", comparison.source(), comparison.machine.command));
    parts.join("\n\n")
}

impl Comparison {
    /// What the numbers mean.
    fn notes(&self) -> Vec<String> {
        let Self { size, repeats, .. } = self;
        vec![
            format!("{size} x {size} pixels, one ray each, diffuse shading; {}.", times(*repeats)),
            format!(
                "ao: a ray from every primary hit, {AO_REACH} of the scene's diagonal long, any \
                 hit; random: rays between points of the scene's box, closest hit."
            ),
            "Bytes per triangle are without the mesh; faults are pages that were first touched, small \
             or large."
                .to_owned(),
            format!(
                "Differing rays have another answer than hgrid;{MARK} marks times where more than \
                 one ray in a thousand does: they count for no ratio."
            ),
            "A ratio is the median of those of the single repetitions, not that of the two times \
             beside it."
                .to_owned(),
        ]
    }

    fn source(&self) -> String {
        format!("{}, compiled for {}.", self.machine.summary(), self.target)
    }
}

impl SceneNumbers {
    fn title(&self) -> String {
        let hits = |workload| {
            let first = self.systems.first().and_then(|system| system.best(workload));
            first.map_or_else(String::new, |run| {
                format!(", {} of {} {} rays hit", run.hits, run.rays, workload.name())
            })
        };
        let hits: String = Workload::ALL.into_iter().map(hits).collect();
        format!(
            "{}: {} triangles{hits}",
            display_name(&self.facts.scene),
            count(self.facts.triangles)
        )
    }

    fn tables(&self) -> impl Iterator<Item = Table> + '_ {
        let ratios = (!self.ratios.is_empty()).then(|| ratios(&self.ratios));
        [self.times(), self.checks()].into_iter().chain(ratios)
    }

    /// Times and memory.
    fn times(&self) -> Table {
        let mut table = table(&[
            "structure",
            "mode",
            "build (s)",
            "primary (s)",
            "time to image (s)",
            "ao (s)",
            "random (s)",
            "index (B/tri)",
            "peak (B/tri)",
        ]);
        for (system, mode, is_first) in self.rows() {
            let first = |text: String| if is_first { text } else { String::new() };
            let run = |workload| system.run(workload, mode);
            let time = |run: Option<&Run>, more: f64| {
                run.map_or_else(String::new, |run| {
                    seconds(run.seconds + more) + if run.is_off() { MARK } else { "" }
                })
            };
            table.add_row([
                first(system.system.clone()),
                mode.name().to_owned(),
                first(seconds(system.build_seconds)),
                time(run(Workload::Primary), 0.0),
                time(run(Workload::Primary), system.build_seconds),
                time(run(Workload::Ao), 0.0),
                time(run(Workload::Random), 0.0),
                first(format!("{:.1}", system.index_bytes_per_triangle())),
                first(format!("{:.1}", system.peak_bytes_per_triangle())),
            ]);
        }
        table
    }

    /// Page faults and differing rays.
    fn checks(&self) -> Table {
        let mut table = table(&[
            "structure",
            "mode",
            "build faults",
            "primary faults",
            "ao faults",
            "random faults",
            "primary differ",
            "ao differ",
            "random differ",
        ]);
        let told = |faults: Option<u64>| faults.map_or_else(|| "-".to_owned(), |f| f.to_string());
        for (system, mode, is_first) in self.rows() {
            let runs = Workload::ALL.map(|workload| system.run(workload, mode));
            let faults = runs.map(|run| run.map_or_else(String::new, |run| told(run.page_faults)));
            let differing = runs.map(|run| {
                run.map_or_else(String::new, |run| {
                    run.differing.to_string() + if run.is_off() { MARK } else { "" }
                })
            });
            let first = |text: String| if is_first { text } else { String::new() };
            let row = [
                first(system.system.clone()),
                mode.name().to_owned(),
                first(told(system.build_page_faults)),
            ];
            table.add_row(row.into_iter().chain(faults).chain(differing));
        }
        table
    }

    /// A row for each mode of each system.
    fn rows(&self) -> impl Iterator<Item = (&SystemNumbers, Mode, bool)> {
        self.systems.iter().flat_map(|system| {
            let mut modes: Vec<Mode> = Vec::new();
            for run in &system.runs {
                if !modes.contains(&run.mode) {
                    modes.push(run.mode);
                }
            }
            modes.into_iter().enumerate().map(move |(at, mode)| (system, mode, at == 0))
        })
    }
}

fn ratios(ratios: &[Ratio]) -> Table {
    let mut table = table(&["hgrid / peer", "which", "hgrid", "peer", "ratio", "least to most"]);
    for Ratio { what, hgrid, value, peer, peer_value, ratio, least, most } in ratios {
        let is_exact = what.contains("bytes");
        let number = |value: &f64| if is_exact { format!("{value:.1}") } else { seconds(*value) };
        table.add_row([
            (*what).to_owned(),
            format!("{hgrid} / {peer}"),
            number(value),
            number(peer_value),
            format!("{ratio:.2}"),
            if is_exact { String::new() } else { format!("{least:.2} to {most:.2}") },
        ]);
    }
    table
}

/// A table with columns of words, then of numbers.
fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.set_header(header);
    for column in table.column_iter_mut().skip(WORDS) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_a_range_and_bytes_have_none() {
        let ratio = |what| Ratio {
            what,
            hgrid: "brick".to_owned(),
            value: 3.0,
            peer: "embree-low".to_owned(),
            peer_value: 8.0,
            ratio: 0.5,
            least: 0.25,
            most: 0.75,
        };
        let mut table = ratios(&[ratio("time to image"), ratio("index bytes")]);
        let rows = as_markdown(&mut table, WORDS);
        let [time, bytes] = ["time to image", "index bytes"]
            .map(|what| rows.lines().find(|row| row.contains(what)).unwrap());
        assert!(time.contains("0.50") && time.contains("0.25 to 0.75"), "{time}");
        assert!(bytes.contains("0.50") && !bytes.contains(" to "), "{bytes}");
    }
}
