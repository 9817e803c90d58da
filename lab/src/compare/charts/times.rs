//! Time to image against triangles: a line for each system, stronger for those of hgrid.

use plotters::element::{DynElement, IntoDynElement as _};
use plotters::prelude::*;

use super::{color, find, names};
use crate::compare::numbers::{Comparison, Kind, SystemNumbers};
use crate::measure::ratio;
use crate::plot::{
    Area, AreaResult, Drawing, HEADING, INK, Pen, Scale, Stops, WORDS, Words, chart, heading,
};
use crate::table::{display_name, times};

/// The chart of the times to image.
pub(super) struct Figure<'a>(pub(super) &'a Comparison);

/// Units of the chart and of the names beside it.
const WIDTH: u32 = 860;
const HEIGHT: u32 = 520;
const NAMES: u32 = 240;

/// A system and its points.
struct Line {
    name: String,
    color: RGBColor,
    is_peer: bool,
    /// True if an earlier line of its kind has the same colour.
    is_again: bool,
    points: Vec<(f64, f64)>,
}

impl Figure<'_> {
    fn lines(&self) -> Vec<Line> {
        let (mut methods, mut peers) = (0, 0);
        let line = |system: &SystemNumbers| {
            let place = if system.is_peer { &mut peers } else { &mut methods };
            let (again, at) = (*place / 6, *place % 6);
            *place += 1;
            let points = self.0.scenes.iter().filter_map(|scene| {
                let time = find(scene, &system.system)?.time_to_image(Kind::Rebuild)?;
                Some((triangles(scene.facts.triangles), time))
            });
            let mut points: Vec<_> = points.collect();
            points.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            Line {
                name: system.system.clone(),
                color: color(at),
                is_peer: system.is_peer,
                is_again: again > 0,
                points,
            }
        };
        names(self.0).into_iter().map(line).collect()
    }

    /// Returns the axes. The names are powers of ten and their multiples by 2 and 5, because scenes may lie
    /// between two powers.
    fn axes(&self, lines: &[Line]) -> (Stops, Scale) {
        let places = self.0.scenes.iter().map(|scene| triangles(scene.facts.triangles));
        let (low, high) =
            places.fold((f64::MAX, 0.0f64), |(low, high), at| (low.min(at), high.max(at)));
        let range = low.min(high) - 0.3..high + 0.3;
        let powers = core::iter::successors(Some(1), |power: &usize| power.checked_mul(10));
        let names = powers.flat_map(|power| [1, 2, 5].map(|digit| power.saturating_mul(digit)));
        let names = names
            .map(|number| (triangles(number), short(number)))
            .filter(|(place, _)| range.contains(place))
            .collect();
        let times = lines.iter().flat_map(|line| &line.points).map(|&(_, time)| time);
        (Stops { range, names }, Scale::fitting(times, 0.05))
    }
}

impl Drawing for Figure<'_> {
    fn size(&self) -> (u32, u32) {
        (WIDTH + NAMES, HEADING + HEIGHT)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>, pen: Pen) -> AreaResult<B> {
        let Comparison { machine, size, repeats, .. } = self.0;
        let title = format!("Time to image, {size} x {size} rays, against triangles");
        let source = format!("{}; {}", machine.summary(1), times(*repeats));
        heading(area, pen, [&title, &source], &[])?;

        let (_, below) = area.split_vertically(pen.px(HEADING));
        let (left, right) = below.split_horizontally(pen.px(WIDTH));
        let lines = self.lines();
        let scenes = self.0.scenes.iter().map(|scene| display_name(&scene.facts.scene));
        let scenes = scenes.collect::<Vec<_>>().join(", ");
        let title =
            format!("rebuild in kept memory and render, the fastest mode of each, on {scenes}");
        let words = Words { title: &title, x: "triangles", y: "seconds" };
        let mut chart = chart(&left, pen, words, self.axes(&lines))?;
        for line in &lines {
            let width = if line.is_peer { 1 } else { 3 };
            let path = PathElement::new(line.points.clone(), pen.line(line.color, width));
            chart.draw_series([path])?;
            for &point in &line.points {
                chart.draw_series([EmptyElement::at(point) + line.marker(pen, (0, 0))])?;
            }
        }
        for (line, row) in lines.iter().zip(0..) {
            let place = (pen.at(16), pen.at(40 + 24 * row));
            right.draw(&(EmptyElement::at(place) + line.marker(pen, (0, 0))))?;
            let style = pen.text(WORDS, INK);
            right.draw(&Text::new(line.name.clone(), (place.0 + pen.at(14), place.1), style))?;
        }
        Ok(())
    }
}

impl Line {
    /// Returns the marker: a filled circle for a method of hgrid, an open one for a peer, and a triangle for
    /// a peer whose colour is used again.
    fn marker<B: DrawingBackend>(
        &self,
        pen: Pen,
        at: (i32, i32),
    ) -> DynElement<'static, B, (i32, i32)> {
        let open = pen.line(self.color, 2);
        match (self.is_peer, self.is_again) {
            (false, _) => Circle::new(at, pen.px(5), self.color.filled()).into_dyn(),
            (true, false) => Circle::new(at, pen.px(5), open).into_dyn(),
            (true, true) => TriangleMarker::new(at, pen.px(6), self.color.filled()).into_dyn(),
        }
    }
}

/// Returns the place of a number of triangles on the axis.
fn triangles(count: usize) -> f64 {
    ratio(count as u64, 1).max(1.0).log10()
}

/// Formats a number that has one significant digit: 5000, 20K, 1M.
fn short(number: usize) -> String {
    match number {
        0..10_000 => number.to_string(),
        10_000..1_000_000 => format!("{}K", number / 1000),
        _ => format!("{}M", number / 1_000_000),
    }
}
