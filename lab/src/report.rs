//! The numbers of a rendering: the same ones as lines for people and as JSON for programs.
//!
//! Seconds are wall-clock of one thread. Counts per ray are those of the paper's Table 1 and come
//! from a pass of their own, ray by ray: counting is in none of the times, and where the rays of a
//! tile are traced together they do less than that.

use core::fmt;

use comfy_table::{Table, presets};
use indicatif::HumanCount;
use serde::Serialize;

use crate::measure::{Measurement, SceneFacts, ratio};

/// What was rendered, what it took and how long.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// What was rendered.
    #[serde(flatten)]
    pub scene: SceneFacts,
    /// Reading or generating it.
    pub load_seconds: f64,
    /// What it took.
    #[serde(flatten)]
    pub measurement: Measurement,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, load_seconds, measurement: m } = self;
        let [x, y, z] = m.resolution;
        let skipped = match m.skipped_triangles {
            0 => String::new(),
            count => format!(", {} skipped", HumanCount(count.into())),
        };
        let median = match m.build_samples.len() {
            0 | 1 => String::new(),
            count => format!(" (median of {count})"),
        };
        let tiles = if m.is_in_tiles() { ", in tiles of 8 x 8" } else { "" };
        let references = m.references.map(|count| HumanCount(count.into()).to_string());
        let (index, peak) = (HumanCount(m.index_bytes as u64), HumanCount(m.peak_bytes as u64));
        let peak_per_triangle = ratio(m.peak_bytes as u64, scene.triangles as u64);
        let rows = [
            ("scene", scene.scene.clone()),
            ("triangles", format!("{}{skipped}", HumanCount(scene.triangles as u64))),
            ("vertices", HumanCount(scene.vertices as u64).to_string()),
            ("method", m.built_title()),
            ("resolution", format!("{x} x {y} x {z}")),
            ("references", references.unwrap_or_default()),
            ("index", format!("{index} bytes, {:.1} per triangle", m.index_bytes_per_triangle)),
            ("peak", format!("{peak} bytes, {peak_per_triangle:.1} per triangle with scratch")),
            ("rays", format!("{} ({size} x {size})", HumanCount(m.rays), size = m.size)),
            ("hits", format!("{} ({:.1} %)", HumanCount(m.hits), 100.0 * ratio(m.hits, m.rays))),
            ("primitive tests / ray", format!("{:.2}", m.primitive_tests_per_ray)),
            ("cell steps / ray", format!("{:.2}", m.cell_steps_per_ray)),
            ("grid steps / ray", format!("{:.2}", m.grid_steps_per_ray)),
            ("most steps and tests", HumanCount(m.largest_ray_cost).to_string()),
            ("load", seconds(*load_seconds)),
            ("build", seconds(m.build_seconds) + &median),
            ("render", seconds(m.render_seconds) + tiles + &median),
            ("time to image", seconds(m.time_to_image_seconds)),
        ];
        let mut table = Table::new();
        table.load_style(presets::NOTHING);
        for (name, value) in rows.into_iter().filter(|(_, value)| !value.is_empty()) {
            table.add_row([name.to_owned(), value]);
        }
        f.write_str(&table.trim_fmt())
    }
}

/// A time with three digits that count.
fn seconds(seconds: f64) -> String {
    match seconds {
        s if s >= 100.0 => format!("{s:.0} s"),
        s if s >= 10.0 => format!("{s:.1} s"),
        s if s >= 1.0 => format!("{s:.2} s"),
        s if s >= 0.1 => format!("{:.0} ms", s * 1e3),
        s if s >= 0.01 => format!("{:.1} ms", s * 1e3),
        s => format!("{:.2} ms", s * 1e3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_read_well() {
        let times = [123.4, 12.34, 1.234, 0.1234, 0.012_34, 0.000_123].map(seconds);
        assert_eq!(times, ["123 s", "12.3 s", "1.23 s", "123 ms", "12.3 ms", "0.12 ms"]);
    }
}
