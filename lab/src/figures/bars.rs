//! Figure 2: bars of every method on every scene: memory, build, render, time to image.

use plotters::coord::ranged1d::Ranged as _;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::color_of;
use crate::measure::Measurement;
use crate::plot::{
    Area, AreaResult, Drawing, HEADING, INK, MUTED, Pen, Scale, Stops, WORDS, Words, centred,
    chart, heading, number,
};
use crate::table::{Results, SceneResults, display_name, mebibytes, times};

/// The charts of figure 2.
pub(super) struct Figure<'a>(pub(super) &'a Results);

/// Units of a chart.
const WIDTH: u32 = 600;
const HEIGHT: u32 = 340;

/// The part of a scene's width that its bars fill, and the part of a bar's place that it fills.
const SCENE_PART: f64 = 0.84;
const BAR_PART: f64 = 0.88;

/// The quantity that one chart shows.
#[derive(Clone, Copy)]
enum Quantity {
    /// A time of every method.
    Seconds(&'static str, fn(&Measurement) -> f64),
    /// The mesh, and the index and the scratch of every method.
    Memory,
}

/// The charts in the order of the paper: "from bottom right clockwise: memory consumption; build time; render
/// time; time to image".
const QUANTITIES: [Quantity; 4] = [
    Quantity::Seconds("render", |m| m.render_seconds),
    Quantity::Seconds("time to image", |m| m.time_to_image_seconds),
    Quantity::Seconds("build", |m| m.build_seconds),
    Quantity::Memory,
];

/// A bar in a colour up to its amount, and paler from there to its peak.
struct Bar {
    color: RGBColor,
    amount: f64,
    peak: f64,
}

impl Quantity {
    /// The bars of a scene.
    fn bars(self, scene: &SceneResults) -> Vec<Bar> {
        let methods = scene.methods.iter();
        match self {
            Self::Seconds(_, time) => methods
                .map(|m| Bar { color: color_of(&m.method), amount: time(m), peak: time(m) })
                .collect(),
            Self::Memory => {
                let mesh = mebibytes(scene.facts.scene_bytes);
                let mesh = Bar { color: MUTED, amount: mesh, peak: mesh };
                let methods = methods.map(|m| Bar {
                    color: color_of(&m.method),
                    amount: mebibytes(m.index_bytes),
                    peak: mebibytes(m.peak_bytes),
                });
                core::iter::once(mesh).chain(methods).collect()
            }
        }
    }

    const fn words(self) -> Words<'static> {
        match self {
            Self::Seconds(title, _) => Words { title, x: "", y: "seconds" },
            Self::Memory => {
                let title = "memory: mesh, index, peak of the build (pale)";
                Words { title, x: "", y: "MiB" }
            }
        }
    }
}

impl Drawing for Figure<'_> {
    fn size(&self) -> (u32, u32) {
        (2 * WIDTH, HEADING + 2 * HEIGHT)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>, pen: Pen) -> AreaResult<B> {
        let Results { machine, size, repeats, threads, scenes } = self.0;
        let methods = scenes.first().map(|scene| &*scene.methods).unwrap_or_default();
        let legend = methods.iter().map(|m| (m.title(), color_of(&m.method)));
        let legend: Vec<_> = legend.chain([("mesh".to_owned(), MUTED)]).collect();
        let title = format!("Memory and times, {size} x {size} rays");
        let tiles =
            if methods.iter().any(Measurement::is_in_tiles) { "; bvh traces tiles" } else { "" };
        let source = format!("{}; {}{tiles}", machine.summary(*threads), times(*repeats));
        heading(area, pen, [&title, &source], &legend)?;

        let (_, below) = area.split_vertically(pen.px(HEADING));
        for (quantity, area) in QUANTITIES.iter().zip(&below.split_evenly((2, 2))) {
            draw(*quantity, area, pen, scenes)?;
        }
        Ok(())
    }
}

/// Draws one chart.
fn draw<B: DrawingBackend>(
    quantity: Quantity,
    area: &Area<B>,
    pen: Pen,
    scenes: &[SceneResults],
) -> AreaResult<B> {
    let groups: Vec<_> = scenes.iter().map(|scene| quantity.bars(scene)).collect();
    let amounts = groups.iter().flatten().flat_map(|bar| [bar.amount, bar.peak]);
    // The number of the highest bar stands above it, upright.
    let y = Scale::fitting(amounts, 0.16);
    let floor = y.range().start;
    let places = || (0u32..).map(f64::from);
    let end = places().nth(groups.len().max(1)).unwrap_or(1.0);
    let x = Stops { range: 0.0..end, names: Vec::new() };
    let mut chart = chart(area, pen, quantity.words(), (x, y))?;

    let (left, top) = area.get_base_pixel();
    let upright = pen.text(10, INK).transform(FontTransform::Rotate270);
    let upright = upright.pos(Pos::new(HPos::Left, VPos::Center));
    for (bars, place) in groups.iter().zip(places()) {
        let count = places().nth(bars.len().max(1)).unwrap_or(1.0);
        let width = SCENE_PART / count;
        let start = place + 0.5 * (1.0 - SCENE_PART);
        for (Bar { color, amount, peak }, bar) in bars.iter().zip(places()) {
            let middle = start + (bar + 0.5) * width;
            let side = 0.5 * BAR_PART * width;
            let from_to = |from, to| [(middle - side, from), (middle + side, to)];
            let pale = Rectangle::new(from_to(*amount, *peak), color.mix(0.35).filled());
            chart.draw_series((peak > amount).then_some(pale))?;
            chart.draw_series([Rectangle::new(from_to(floor, *amount), color.filled())])?;
            let (x, y) = chart.backend_coord(&(middle, *peak));
            let above = (x - left, y - top - pen.at(4));
            area.draw(&Text::new(number(*amount), above, upright.clone()))?;
        }
    }

    let letters = (WIDTH - 90) / 7 / u32::try_from(groups.len()).unwrap_or(1).max(1);
    for (scene, place) in scenes.iter().zip(places()) {
        let (x, y) = chart.backend_coord(&(place + 0.5, floor));
        let lines = broken(&display_name(&scene.facts.scene), letters as usize);
        for (line, below) in lines.into_iter().zip([13, 28]) {
            let place = (x - left, y - top + pen.at(below));
            area.draw(&Text::new(line, place, centred(&pen.text(WORDS, INK))))?;
        }
    }
    Ok(())
}

/// Breaks a name into lines of so many letters, between words; a longer word is cut.
fn broken(name: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in name.split(['_', '-', ' ']).filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= letters => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    for line in &mut lines {
        if line.chars().count() > letters.max(2) {
            *line = line.chars().take(letters.max(2) - 1).chain(['\u{2026}']).collect();
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_are_broken_between_words() {
        assert_eq!(broken("asian_dragon_standin", 12), ["asian dragon", "standin"]);
        assert_eq!(broken("bunny", 12), ["bunny"]);
        assert_eq!(broken("knot:10000000", 8), ["knot:10\u{2026}"]);
        assert!(broken("__", 0).is_empty());
    }
}
