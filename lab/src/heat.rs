//! Heat pictures: the work of every ray as a colour, with a labelled colour bar.
//!
//! ```text
//! +-----------------------+
//! |                       |
//! |        picture        |  The scale ends at a round number no less than what 99 of 100 rays
//! |                       |  take: a few rays along an edge must not darken the picture.
//! +-----------------------+
//! | cell steps per ray    |
//! | [dark blue ..... red] |
//! | 0    20    40     60+ |
//! +-----------------------+
//! ```

use anyhow::{Result, anyhow};
use clap::ValueEnum;
use hgrid_core::Counters;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::plot::{Area, AreaResult, INK, Pen, Raster};
use crate::shade::Rgb;

/// The least width of a picture whose colour bar has words.
const LEGIBLE: u16 = 224;

/// The counter that a heat picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Counter {
    /// Tests and steps together
    Cost,
    /// Triangles tested
    PrimitiveTests,
    /// Leaves of a tree entered, or cells, empty ones included
    CellSteps,
    /// Nodes of a tree entered, or subgrids and levels
    GridSteps,
}

impl Counter {
    /// Returns this counter's number for a ray.
    #[must_use]
    pub const fn of(self, work: &Counters) -> u64 {
        match self {
            Self::Cost => work.primitive_tests + work.cell_steps + work.grid_steps,
            Self::PrimitiveTests => work.primitive_tests,
            Self::CellSteps => work.cell_steps,
            Self::GridSteps => work.grid_steps,
        }
    }

    /// Returns the name of the counter in words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Cost => "primitive tests and steps",
            Self::PrimitiveTests => "primitive tests",
            Self::CellSteps => "cell steps",
            Self::GridSteps => "grid steps",
        }
    }
}

/// A picture with its width and height, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Width and height.
    pub size: (u32, u32),
    /// Row by row.
    pub pixels: Vec<Rgb>,
}

/// Makes a picture of the costs of the rays of a square picture, with a colour bar if there is room. The colours end at
/// `top`, or by default at the cost that 99 of 100 rays do not exceed. Either is rounded up to a round number. The
/// number at the end is returned with the picture.
///
/// # Errors
/// If the bar's font cannot be read.
pub fn picture(
    costs: &[u32],
    size: u16,
    counter: Counter,
    top: Option<u32>,
) -> Result<(Picture, u32)> {
    let scale = top.map_or_else(|| Scale::of(costs), Scale::up_to);
    let mut pixels: Vec<_> = costs.iter().map(|&cost| scale.color(cost)).collect();
    let width = u32::from(size);
    let mut height = width;
    if size >= LEGIBLE {
        let bar = Bar { font: (width / 64).max(10), width, scale, counter };
        pixels.extend(bar.pixels()?);
        height += bar.height();
    }
    Ok((Picture { size: (width, height), pixels }, scale.top))
}

/// Numbers from 0 to `top`, with a tick at every `step`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Scale {
    step: u32,
    top: u32,
}

impl Scale {
    /// Returns the scale whose end 99 of 100 costs do not exceed.
    fn of(costs: &[u32]) -> Self {
        let mut costs = costs.to_vec();
        let rank = costs.len().saturating_sub(1) * 99 / 100;
        Self::up_to(if costs.is_empty() { 0 } else { *costs.select_nth_unstable(rank).1 })
    }

    /// Returns the scale up to a number, or up to the next round one.
    fn up_to(most: u32) -> Self {
        let powers = core::iter::successors(Some(1u32), |power| power.checked_mul(10));
        let steps = powers.flat_map(|power| [1, 2, 5].map(|digit| power.saturating_mul(digit)));
        let step = steps.into_iter().find(|step| step.saturating_mul(6) >= most).unwrap_or(most);
        let top = most.div_ceil(step).max(1).saturating_mul(step);
        Self { step, top }
    }

    fn color(self, cost: u32) -> Rgb {
        let part = f64::from(cost.min(self.top)) / f64::from(self.top);
        colorous::TURBO.eval_continuous(part).as_array()
    }
}

/// The colour bar under a picture; `font` is the size of its words and the unit of its other lengths.
struct Bar {
    font: u32,
    width: u32,
    scale: Scale,
    counter: Counter,
}

impl Bar {
    const fn height(&self) -> u32 {
        self.font * 9 / 2
    }

    fn pixels(&self) -> Result<Vec<Rgb>> {
        let size = (self.width, self.height());
        let mut bytes = vec![0; 3 * size.0 as usize * size.1 as usize];
        {
            let area = Raster::new(&mut bytes, size)?.into_drawing_area();
            let drawn = self.draw(&area).and_then(|()| area.present());
            drawn.map_err(|error| anyhow!("cannot draw the colour bar: {error}"))?;
        }
        let mut pixels = bytes.as_chunks::<3>().0.to_vec();
        let rows = pixels.chunks_exact_mut(self.width as usize);
        for row in rows.skip(self.font as usize * 7 / 4).take(self.font as usize) {
            let (left, length) = self.span();
            let colors = row.iter_mut().skip(left as usize).zip(0..length);
            colors.for_each(|(pixel, column)| {
                let part = f64::from(column) / f64::from(length - 1);
                *pixel = colorous::TURBO.eval_continuous(part).as_array();
            });
        }
        Ok(pixels)
    }

    /// Returns the column at which the colours start, and their number.
    const fn span(&self) -> (u32, u32) {
        (2 * self.font, self.width - 4 * self.font)
    }

    /// Draws everything but the colours.
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> AreaResult<B> {
        let Self { font, scale: Scale { step, top }, counter, .. } = *self;
        let (left, length) = self.span();
        area.fill(&INK)?;
        let words = Pen { scale: 1 }.text(font, RGBColor(0xf2, 0xf4, 0xf7));
        let line = font.cast_signed();
        let title = format!("{} per ray", counter.words());
        area.draw(&Text::new(title, (2 * line, line), words.clone()))?;

        for tick in (0..=top).step_by(step as usize) {
            let x = f64::from(left) + f64::from(length) * f64::from(tick) / f64::from(top);
            let label = format!("{tick}{}", if tick == top { "+" } else { "" });
            let style = words.pos(Pos::new(HPos::Center, VPos::Center));
            area.draw(&Text::new(label, (whole(x), line * 7 / 2), style))?;
        }
        Ok(())
    }
}

#[expect(clippy::cast_possible_truncation, reason = "inside a picture")]
fn whole(x: f64) -> i32 {
    x.round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_percent_does_not_set_the_scale() {
        let mut costs: Vec<u32> = (0..1000).collect();
        costs[999] = 1_000_000;
        let scale = Scale::of(&costs);
        assert_eq!(scale, Scale { step: 200, top: 1000 });
        assert_eq!(scale.color(1000), scale.color(1_000_000));
        assert_ne!(scale.color(0), scale.color(500));
    }

    #[test]
    fn scales_end_at_round_numbers() {
        for (most, step, top) in [(0, 1, 1), (1, 1, 1), (6, 1, 6), (7, 2, 8), (61, 20, 80)] {
            assert_eq!(Scale::of(&[most; 5]), Scale { step, top });
        }
        assert_eq!(Scale::of(&[]), Scale { step: 1, top: 1 });
        assert!(Scale::of(&[u32::MAX; 3]).top >= u32::MAX / 2);
    }

    #[test]
    fn the_bar_is_below_and_only_where_words_can_be_read() {
        let (small, top) = picture(&[3; 81], 9, Counter::Cost, Some(42)).unwrap();
        assert_eq!((small.size, small.pixels.len()), ((9, 9), 81));
        assert_eq!(top, 50);
        let (large, _) = picture(&vec![3; 224 * 224], 224, Counter::GridSteps, None).unwrap();
        assert_eq!(large.size, (224, 224 + 45));
        assert_eq!(large.pixels.len(), 224 * 269);
        let bar = &large.pixels[224 * 224 + 224 * 22..][..224];
        let ends = [0, u32::MAX].map(|cost| Scale { step: 1, top: 9 }.color(cost));
        assert_eq!([bar[20], bar[203]], ends);
    }

    #[test]
    fn counters_are_what_they_say() {
        let work = Counters { primitive_tests: 1, cell_steps: 20, grid_steps: 300 };
        let counts = Counter::value_variants().iter().map(|counter| counter.of(&work));
        assert_eq!(counts.collect::<Vec<_>>(), [321, 1, 20, 300]);
    }
}
