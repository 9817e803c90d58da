//! A comparison as tables: builds and memory, times of rays, differing rays, and ratios.

use comfy_table::{Cell, CellAlignment, Table, presets};

use super::mode::Mode;
use super::numbers::{Comparison, Kind, Run, SceneNumbers, SystemNumbers};
use super::ratios::Ratio;
use super::shown::Shown;
use super::workloads::{AO_REACH, Workload};
use crate::measure::ratio;
use crate::plural::noun;
use crate::table::{count, display_name, markdown as as_markdown, seconds, times};

/// The mark after a time whose rays have too many differing answers.
const MARK: &str = " (!)";

/// The number of columns of words, from the left.
const WORDS: usize = 2;

/// Formats aligned tables and notes.
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

/// Formats the same as Markdown.
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
    /// Returns notes that explain the numbers.
    fn notes(&self) -> Vec<String> {
        let Self { size, repeats, .. } = self;
        let mut notes = vec![
            format!("{size} x {size} pixels, one ray each, diffuse shading; {}.", times(*repeats)),
            "First build: in a new process, three times at least. Rebuild: in memory that is kept from a \
             build before. An image is a build and the primary rays in the mode beside the name."
                .to_owned(),
            format!(
                "ao: a ray from every primary hit, {AO_REACH} of the scene's diagonal long, any \
                 hit; bounce: the same rays without an end, closest hit; random: rays between \
                 points of the scene's box, closest hit; near and far: the closest point of the \
                 surface to points near to it and far outside."
            ),
            "Bytes per triangle are without the mesh; faults are pages that were first touched, small \
             or large."
                .to_owned(),
            format!(
                "Differing rays and points have another answer than hgrid;{MARK} marks times where \
                 more than one in a thousand does: they count for no ratio."
            ),
            "A ratio is the median of those of the single repetitions, not that of the two times \
             beside it."
                .to_owned(),
        ];
        if self.scenes.iter().any(|scene| scene.shown.instances() > 0) {
            notes.push(format!(
                "Instances: first builds are of the mesh's structure and the scene over it, rebuilds of the \
                 scene alone; bytes are those of the scene alone. Primary rays are not shaded, and ao is \
                 {AO_REACH} of the mesh's diagonal long."
            ));
        }
        if self.scenes.iter().any(|scene| scene.shown == Shown::Spheres) {
            notes.push(
                "Spheres: one in place of each triangle, tested by the same function of the caller's for all. Bytes \
                 per sphere are without the spheres, and of hgrid with the boxes that it keeps. Primary rays are \
                 not shaded."
                    .to_owned(),
            );
        }
        notes.extend(self.versions());
        notes
    }

    /// Lists the systems with their library's version.
    fn versions(&self) -> Option<String> {
        let systems = &self.scenes.first()?.systems;
        let told = |system: &SystemNumbers| {
            Some(format!("{} is {}", system.system, system.version.as_ref()?))
        };
        let told: Vec<_> = systems.iter().filter_map(told).collect();
        (!told.is_empty()).then(|| format!("{}.", told.join("; ")))
    }

    fn source(&self) -> String {
        format!("{}, compiled for {}.", self.machine.summary(1), self.target)
    }
}

impl SceneNumbers {
    fn title(&self) -> String {
        let hits = |workload| {
            let run = self.systems.iter().find_map(|system| system.best(workload))?;
            Some(format!("{} {} of {}", workload.name(), run.hits, run.rays))
        };
        let hits: Vec<_> = Workload::ALL.into_iter().filter_map(hits).collect();
        let (name, triangles) = (display_name(&self.facts.scene), count(self.facts.triangles));
        let of_triangles = noun(self.facts.triangles, "triangle", "triangles");
        let shown = match self.shown {
            Shown::Mesh => format!("{triangles} {of_triangles}"),
            Shown::Instances(instances) => {
                let of_instances = noun(instances, "instance", "instances");
                let instances = count(instances as usize);
                format!("{instances} {of_instances} of {triangles} {of_triangles}")
            }
            Shown::Spheres => {
                format!("{triangles} {}", noun(self.facts.triangles, "sphere", "spheres"))
            }
        };
        format!("{name}: {shown}, hits: {}", hits.join(", "))
    }

    fn tables(&self) -> impl Iterator<Item = Table> + '_ {
        let ratios = (!self.ratios.is_empty()).then(|| ratios(&self.ratios));
        let time = |run: &Run| seconds(run.seconds);
        let differing = |run: &Run| run.differing.to_string();
        let queries = [self.runs("(s)", time), self.runs("differ", differing)];
        core::iter::once(self.builds()).chain(queries).chain(ratios)
    }

    /// Makes the table of builds, first images and memory. With instances or spheres, the build time of each
    /// replaces images.
    fn builds(&self) -> Table {
        let (has_images, item) = (self.shown == Shown::Mesh, self.shown.short_item());
        let images = ["first image (s)", "image, rebuilt (s)"].map(str::to_owned).to_vec();
        let header = ["structure", "primary rays", "first build (s)", "rebuild (s)"];
        let header = header.map(str::to_owned).into_iter();
        let header = header
            .chain(if has_images { images } else { vec![format!("rebuild (ns/{item})")] })
            .chain([format!("index (B/{item})"), format!("peak (B/{item})")])
            .chain(["first faults", "rebuild faults"].map(str::to_owned));
        let mut table = table(header);
        let told = |faults: Option<u64>| faults.map_or_else(|| "-".to_owned(), |f| f.to_string());
        for system in &self.systems {
            let image = |kind| system.time_to_image(kind).map(seconds).unwrap_or_default();
            let each = 1e9 * system.rebuild.seconds / ratio(system.items(), 1);
            let times = if has_images {
                vec![image(Kind::First), image(Kind::Rebuild)]
            } else {
                vec![format!("{each:.1}")]
            };
            let mode = system.best(Workload::Primary).map(|run| run.mode.name());
            let SystemNumbers { first_build, rebuild, .. } = system;
            let builds = [
                system.system.clone(),
                mode.unwrap_or_default().to_owned(),
                seconds(first_build.seconds),
                seconds(rebuild.seconds),
            ];
            let memory = [
                format!("{:.1}", system.index_bytes_per_item()),
                format!("{:.1}", system.peak_bytes_per_item()),
                told(first_build.page_faults),
                told(rebuild.page_faults),
            ];
            table.add_row(builds.into_iter().chain(times).chain(memory));
        }
        table
    }

    /// Makes a table of one number of every run: a row for each mode of each system.
    fn runs(&self, unit: &str, cell: impl Fn(&Run) -> String) -> Table {
        let runs = || self.systems.iter().flat_map(|system| &system.runs);
        let is_asked = |workload: &Workload| runs().any(|run| run.workload == *workload);
        let workloads: Vec<_> = Workload::ALL.into_iter().filter(is_asked).collect();
        let columns = workloads.iter().map(|workload| format!("{} {unit}", workload.name()));
        let mut table = table(["structure", "mode"].map(str::to_owned).into_iter().chain(columns));
        for system in &self.systems {
            let mut name = &*system.system;
            for mode in modes(system) {
                let cells = workloads.iter().map(|&workload| {
                    let run = system.run(workload, mode);
                    run.map_or_else(String::new, |run| {
                        cell(run) + if run.is_off() { MARK } else { "" }
                    })
                });
                table.add_row([name, mode.name()].map(str::to_owned).into_iter().chain(cells));
                name = "";
            }
        }
        table
    }
}

/// Returns the modes of a system.
fn modes(system: &SystemNumbers) -> Vec<Mode> {
    let mut modes: Vec<Mode> = Vec::new();
    for run in &system.runs {
        if !modes.contains(&run.mode) {
            modes.push(run.mode);
        }
    }
    modes
}

fn ratios(ratios: &[Ratio]) -> Table {
    let mut table = table(["hgrid / peer", "which", "hgrid", "peer", "ratio", "least to most"]);
    for Ratio { what, hgrid, value, peer, peer_value, ratio, least, most } in ratios {
        let is_exact = what.contains("bytes");
        let number = |value: &f64| if is_exact { format!("{value:.1}") } else { seconds(*value) };
        table.add_row([
            what.clone(),
            format!("{hgrid} / {peer}"),
            number(value),
            number(peer_value),
            format!("{ratio:.2}"),
            if is_exact { String::new() } else { format!("{least:.2} to {most:.2}") },
        ]);
    }
    table
}

/// Makes a table with columns of words, then of numbers.
fn table<T: Into<Cell>>(header: impl IntoIterator<Item = T>) -> Table {
    let mut table = Table::new();
    table.set_header(header.into_iter().map(Into::into).collect::<Vec<Cell>>());
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
        let ratio = |what: &str| Ratio {
            what: String::from(what),
            hgrid: "bvh".to_owned(),
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
