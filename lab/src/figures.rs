//! The numbers of a rendering: the same ones as a table for people and as JSON for programs.
//!
//! Seconds are wall-clock of one thread. Counts per ray are those of the paper's Table 1 and come
//! from a pass of their own, so that counting is in none of the times.

use core::fmt;

use comfy_table::{Table, presets};
use indicatif::HumanCount;
use serde::Serialize;

/// What was rendered, what it took and how long.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// The scene's name.
    pub scene: String,
    /// Triangles in the scene.
    pub triangles: usize,
    /// Triangles without finite coordinates, which the grid leaves out.
    pub skipped_triangles: u32,
    /// Vertices in the scene.
    pub vertices: usize,
    /// The structure.
    pub method: &'static str,
    /// Cells per triangle that the grid was built for.
    pub density: f32,
    /// Cells per axis.
    pub resolution: [u32; 3],
    /// Triangle ids in all cells together.
    pub references: u32,
    /// Bytes of the built grid, without the mesh.
    pub index_bytes: usize,
    /// The same for each triangle.
    pub index_bytes_per_triangle: f64,
    /// Bytes that only the build needed.
    pub scratch_bytes: usize,
    /// Pixels on each side of the picture.
    pub size: u16,
    /// One for each pixel.
    pub rays: u64,
    /// Rays that hit something.
    pub hits: u64,
    /// Work of all rays divided by their number.
    pub primitive_tests_per_ray: f64,
    /// Cells entered, likewise.
    pub cell_steps_per_ray: f64,
    /// Subgrids and levels entered, likewise.
    pub grid_steps_per_ray: f64,
    /// The most tests and steps that one ray took.
    pub largest_ray_cost: u32,
    /// Reading or generating the scene.
    pub load_seconds: f64,
    /// Asking for sizes, allocating and building.
    pub build_seconds: f64,
    /// Tracing and shading every pixel.
    pub render_seconds: f64,
    /// Build and render: from a mesh in memory to a picture.
    pub time_to_image_seconds: f64,
    /// How many builds and renderings the times are medians of.
    pub repeats: u32,
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.resolution;
        let skipped = match self.skipped_triangles {
            0 => String::new(),
            count => format!(", {} skipped", HumanCount(count.into())),
        };
        let median =
            if self.repeats > 1 { format!(" (median of {})", self.repeats) } else { String::new() };
        let rows = [
            ("scene", self.scene.clone()),
            ("triangles", format!("{}{skipped}", HumanCount(self.triangles as u64))),
            ("vertices", HumanCount(self.vertices as u64).to_string()),
            ("method", format!("{}, density {}", self.method, self.density)),
            ("resolution", format!("{x} x {y} x {z}")),
            ("references", HumanCount(self.references.into()).to_string()),
            (
                "index",
                format!(
                    "{} bytes, {:.1} per triangle",
                    HumanCount(self.index_bytes as u64),
                    self.index_bytes_per_triangle
                ),
            ),
            ("scratch", format!("{} bytes", HumanCount(self.scratch_bytes as u64))),
            ("rays", format!("{} ({size} x {size})", HumanCount(self.rays), size = self.size)),
            (
                "hits",
                format!("{} ({:.1} %)", HumanCount(self.hits), 100.0 * ratio(self.hits, self.rays)),
            ),
            ("primitive tests / ray", format!("{:.2}", self.primitive_tests_per_ray)),
            ("cell steps / ray", format!("{:.2}", self.cell_steps_per_ray)),
            ("grid steps / ray", format!("{:.2}", self.grid_steps_per_ray)),
            ("most steps and tests", HumanCount(self.largest_ray_cost.into()).to_string()),
            ("load", seconds(self.load_seconds)),
            ("build", seconds(self.build_seconds) + &median),
            ("render", seconds(self.render_seconds) + &median),
            ("time to image", seconds(self.time_to_image_seconds)),
        ];
        let mut table = Table::new();
        table.load_style(presets::NOTHING);
        for (name, value) in rows {
            table.add_row([name.to_owned(), value]);
        }
        f.write_str(&table.trim_fmt())
    }
}

/// `a / b`, or 0 where there is nothing to divide by.
#[expect(clippy::cast_precision_loss, reason = "figures for people: 15 digits are enough")]
#[must_use]
pub fn ratio(a: u64, b: u64) -> f64 {
    if b == 0 { 0.0 } else { a as f64 / b as f64 }
}

/// The middle value, the upper one of two.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
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

    #[test]
    fn medians_and_ratios_of_nothing_are_zero() {
        assert!(median(vec![]).abs() < 1e-9 && ratio(3, 0).abs() < 1e-9);
        assert!((median(vec![3.0, 1.0, 2.0]) - 2.0).abs() < 1e-9);
    }
}
