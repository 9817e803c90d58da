//! The parts that all charts share: a frame with axes, a heading, a legend.

use plotters::coord::cartesian::Cartesian2d;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{Area, AreaResult, FAINT, INK, MUTED, Pen, Scale, Stops, centred};

/// The font size of most words, and of titles.
pub(crate) const WORDS: u32 = 13;
const TITLE: u32 = 18;

/// Units of the heading's height.
pub(crate) const HEADING: u32 = 88;

/// A frame with axes, ready for its data.
pub(crate) type Chart<'a, B> = ChartContext<'a, B, Cartesian2d<Stops, Scale>>;

/// The words of a chart: its title and the quantities of its axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Words<'a> {
    /// The text above the chart.
    pub(crate) title: &'a str,
    /// The text below the x axis; may be empty.
    pub(crate) x: &'a str,
    /// The text above the y axis.
    pub(crate) y: &'a str,
}

/// Draws a frame with axes that fills an area.
pub(crate) fn chart<'a, B: DrawingBackend>(
    area: &'a Area<B>,
    pen: Pen,
    words: Words<'_>,
    (x, y): (Stops, Scale),
) -> Result<Chart<'a, B>, DrawingAreaErrorKind<B::ErrorType>> {
    let (width, _) = area.dim_in_pixel();
    let middle = i32::midpoint(pen.at(64), width.cast_signed());
    area.draw(&Text::new(words.title.to_owned(), (middle, pen.at(14)), centred(&pen.title(15))))?;

    // Plotters would write it beside the axis, half outside the area.
    let style = pen.text(WORDS, MUTED).pos(Pos::new(HPos::Right, VPos::Center));
    area.draw(&Text::new(words.y.to_owned(), (pen.at(58), pen.at(14)), style))?;

    let bottom = if words.x.is_empty() { 40 } else { 46 };
    let mut chart = ChartBuilder::on(area)
        .margin_top(pen.px(30))
        .margin_right(pen.px(16))
        .margin_bottom(pen.px(8))
        .set_label_area_size(LabelAreaPosition::Left, pen.px(64))
        .set_label_area_size(LabelAreaPosition::Bottom, pen.px(bottom))
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .bold_line_style(pen.line(FAINT, 1))
        .light_line_style(pen.line(FAINT.mix(0.45), 1))
        .axis_style(pen.line(MUTED, 1))
        .label_style(pen.text(WORDS, INK))
        .axis_desc_style(pen.text(WORDS, MUTED))
        .set_all_tick_mark_size(pen.px(4))
        .x_desc(words.x)
        .draw()?;
    Ok(chart)
}

/// Writes a title, the origin of the numbers, and a legend in one row.
pub(crate) fn heading<B: DrawingBackend>(
    area: &Area<B>,
    pen: Pen,
    [title, source]: [&str; 2],
    legend: &[(String, RGBColor)],
) -> AreaResult<B> {
    let line = |text: &str, y, style| {
        area.draw(&Text::new(text.to_owned(), (pen.at(16), pen.at(y)), style))
    };
    line(title, 22, pen.title(TITLE))?;
    // Letters are about 7/15 as wide as the font is high: a long text gets a smaller font.
    let (width, _) = area.dim_in_pixel();
    let room = (width / pen.scale).saturating_sub(32);
    let letters = u32::try_from(source.len()).unwrap_or(u32::MAX).max(1);
    let fitting = room.saturating_mul(15) / letters.saturating_mul(7);
    line(source, 45, pen.text(WORDS.min(fitting), MUTED))?;

    let mut left = 16;
    for (name, color) in legend {
        let corners = [(pen.at(left), pen.at(64)), (pen.at(left + 14), pen.at(78))];
        area.draw(&Rectangle::new(corners, color.filled()))?;
        let place = (pen.at(left + 20), pen.at(71));
        area.draw(&Text::new(name.clone(), place, pen.text(WORDS + 1, INK)))?;
        // Letters are about half as wide as the font is high.
        left += 20 + 7 * i32::try_from(name.len()).unwrap_or(0) + 24;
    }
    Ok(())
}
