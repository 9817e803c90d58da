//! The paper's Table 1 beside the lab's numbers.

use anyhow::{Result, ensure};
use comfy_table::{Cell, CellAlignment, Table};
use serde::Deserialize;

use crate::measure::Measurement;
use crate::table::{Results, count, display_name, markdown, seconds};

/// The paper's numbers: lab/results/paper.json.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Paper {
    scenes: Vec<String>,
    methods: Vec<Method>,
}

/// A method's rows, a number for each scene.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[expect(clippy::struct_field_names, reason = "the names in the results")]
struct Method {
    method: String,
    primitive_tests_per_ray: Vec<f64>,
    cell_steps_per_ray: Vec<f64>,
    grid_steps_per_ray: Vec<f64>,
    build_seconds: Vec<f64>,
    render_seconds: Vec<f64>,
    time_to_image_seconds: Vec<f64>,
}

/// A row of a method: its name, the paper's numbers, the lab's, and their format.
type Row = (&'static str, fn(&Method) -> &[f64], fn(&Measurement) -> f64, fn(f64) -> String);

const ROWS: [Row; 6] = [
    ("tests / ray", |p| &p.primitive_tests_per_ray, |m| m.primitive_tests_per_ray, two_places),
    ("cell steps / ray", |p| &p.cell_steps_per_ray, |m| m.cell_steps_per_ray, two_places),
    ("grid steps / ray", |p| &p.grid_steps_per_ray, |m| m.grid_steps_per_ray, two_places),
    ("build (s)", |p| &p.build_seconds, |m| m.build_seconds, seconds),
    ("render (s)", |p| &p.render_seconds, |m| m.render_seconds, seconds),
    ("time to image (s)", |p| &p.time_to_image_seconds, |m| m.time_to_image_seconds, seconds),
];

fn two_places(number: f64) -> String {
    format!("{number:.2}")
}

impl Paper {
    /// Makes a table with the lab's numbers, and the paper's in brackets. Scenes match by their order.
    pub(super) fn beside(&self, results: &Results) -> Result<String> {
        ensure!(
            results.scenes.len() == self.scenes.len(),
            "the paper has {} scenes, these results {}",
            self.scenes.len(),
            results.scenes.len()
        );
        ensure!(!self.methods.is_empty(), "the paper has no methods");
        for paper in &self.methods {
            for (name, theirs, ..) in ROWS {
                let (method, count) = (&paper.method, theirs(paper).len());
                ensure!(
                    count == self.scenes.len(),
                    "the paper has {count} numbers of `{name}` by `{method}` for {} scenes",
                    self.scenes.len()
                );
            }
        }
        let mut table = Table::new();
        let columns = results.scenes.iter().zip(&self.scenes).map(|(scene, paper)| {
            let (name, count) = (display_name(&scene.facts.scene), count(scene.facts.triangles));
            if name == *paper { format!("{name} {count}") } else { format!("{name} ({paper})") }
        });
        let header = ["", ""].map(str::to_owned).into_iter().chain(columns);
        table.set_header(header.map(Cell::new).collect::<Vec<_>>());
        for column in table.column_iter_mut().skip(2) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        for (name, theirs, ours, words) in ROWS {
            for (place, paper) in self.methods.iter().enumerate() {
                let cells = results.scenes.iter().enumerate().map(|(column, scene)| {
                    let ours = scene.methods.iter().find(|m| m.method == paper.method).map(ours);
                    let theirs = theirs(paper).get(column).copied();
                    let [ours, theirs] = [ours, theirs].map(|n| n.map(words).unwrap_or_default());
                    format!("{ours} (*{theirs}*)")
                });
                let name = if place == 0 { format!("**{name}**") } else { String::new() };
                table.add_row([name, paper.method.clone()].into_iter().chain(cells));
            }
        }
        Ok(markdown(&mut table, 2))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;

    #[test]
    fn a_number_that_is_missing_is_named() {
        let results = Path::new(env!("CARGO_MANIFEST_DIR")).join("results");
        let text = |name: &str| fs::read_to_string(results.join(name)).unwrap();
        let mut paper: Paper = serde_json::from_str(&text("paper.json")).unwrap();
        let race: Results =
            serde_json::from_str(&text("2026-11-25_zen5_table_bunny.json")).unwrap();
        let results = Results::merged(vec![race; paper.scenes.len()]).unwrap();
        paper.beside(&results).unwrap();
        paper.methods[1].build_seconds.pop();
        let error = paper.beside(&results).unwrap_err().to_string();
        let expected = "the paper has 4 numbers of `build (s)` by `variable` for 5 scenes";
        assert_eq!(error, expected);
        paper.methods.clear();
        let error = paper.beside(&results).unwrap_err().to_string();
        assert_eq!(error, "the paper has no methods");
    }
}
