//! Bytes per triangle: a group of bars for each system, a bar for each scene, its peak pale above.

use plotters::coord::ranged1d::Ranged as _;
use plotters::prelude::*;

use super::{color, find, names};
use crate::compare::numbers::Comparison;
use crate::machine::Machine;
use crate::plot::{
    Area, AreaResult, Drawing, HEADING, INK, Pen, Scale, Stops, WORDS, Words, centred, chart,
    heading,
};
use crate::table::display_name;

/// The chart of the bytes per triangle.
pub(super) struct Figure<'a>(pub(super) &'a Comparison);

/// Units of a group's width, of the width beside all groups, and of the chart's height.
const GROUP: u32 = 92;
const BESIDE: u32 = 100;
const HEIGHT: u32 = 440;

/// The part of a group's width that its bars fill.
const PART: f64 = 0.8;

impl Drawing for Figure<'_> {
    fn size(&self) -> (u32, u32) {
        let groups = u32::try_from(names(self.0).len()).unwrap_or(u32::MAX);
        ((BESIDE + GROUP.saturating_mul(groups)).max(700), HEADING + HEIGHT)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>, pen: Pen) -> AreaResult<B> {
        let Comparison { machine, scenes, .. } = self.0;
        // Bytes do not depend on large pages, so the caption leaves those out.
        let source = Machine { large_pages: None, ..machine.clone() }.summary(1);
        let legend = scenes.iter().zip(0..);
        let legend: Vec<_> =
            legend.map(|(scene, place)| (display_name(&scene.facts.scene), color(place))).collect();
        heading(area, pen, ["Bytes per triangle, without the mesh", &source], &legend)?;
        let (_, below) = area.split_vertically(pen.px(HEADING));

        let systems = names(self.0);
        let amounts = scenes
            .iter()
            .flat_map(|scene| &scene.systems)
            .flat_map(|system| [system.index_bytes_per_item(), system.peak_bytes_per_item()]);
        let y = Scale::fitting(amounts, 0.05);
        let floor = y.range().start;
        let place = |at: usize| u32::try_from(at).map_or(0.0, f64::from);
        let x = Stops { range: 0.0..place(systems.len().max(1)), names: Vec::new() };
        let title = "kept for queries, and the peak of the build (pale)";
        let words = Words { title, x: "", y: "bytes" };
        let mut chart = chart(&below, pen, words, (x, y))?;

        let (left, top) = below.get_base_pixel();
        let width = PART / place(scenes.len().max(1));
        for (group, system) in systems.iter().enumerate() {
            for (at, scene) in scenes.iter().enumerate() {
                let Some(numbers) = find(scene, &system.system) else { continue };
                let start = place(group) + 0.5 * (1.0 - PART) + place(at) * width;
                let from_to = |from, to| [(start, from), (start + 0.9 * width, to)];
                let kept = numbers.index_bytes_per_item();
                let peak = numbers.peak_bytes_per_item();
                let (full, pale) = (color(at).filled(), color(at).mix(0.35).filled());
                chart.draw_series(
                    (peak > kept).then_some(Rectangle::new(from_to(kept, peak), pale)),
                )?;
                chart.draw_series(
                    (kept > floor).then_some(Rectangle::new(from_to(floor, kept), full)),
                )?;
            }
            let (x, y) = chart.backend_coord(&(place(group) + 0.5, floor));
            let words = system.system.splitn(2, [' ', '-']);
            for (word, below_axis) in words.zip([13, 28]) {
                let place = (x - left, y - top + pen.at(below_axis));
                let style = centred(&pen.text(WORDS, INK));
                below.draw(&Text::new(word.to_owned(), place, style))?;
            }
        }
        Ok(())
    }
}
