//! Axes for charts: scales of amounts, and named places.

use core::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// The least ratio of the largest to the smallest amount for which a scale is logarithmic.
const WIDE: f64 = 12.0;

/// An axis of amounts above zero: linear from zero, or logarithmic if the amounts are far apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scale {
    range: Range<f64>,
    is_logarithmic: bool,
    /// Amounts with a label, then those of the light lines between them.
    labelled: Vec<f64>,
    light: Vec<f64>,
}

impl Scale {
    /// Makes the scale for these amounts; a part `headroom` of the axis stays free above the largest.
    pub(crate) fn fitting(amounts: impl Iterator<Item = f64>, headroom: f64) -> Self {
        let (low, high) = amounts
            .filter(|&amount| amount > 0.0)
            .fold((f64::MAX, 0.0f64), |(low, high), amount| (low.min(amount), high.max(amount)));
        let (low, high) = if high > 0.0 { (low, high) } else { (1.0, 1.0) };
        if high / low >= WIDE {
            Self::logarithmic(low, high, headroom)
        } else {
            Self::linear(high, headroom)
        }
    }

    fn linear(high: f64, headroom: f64) -> Self {
        let end = (high / (1.0 - headroom)).min(f64::MAX);
        let step = nice_above(end / 7.0);
        let below = |amounts: [f64; 8]| amounts.into_iter().filter(|&a| a <= end).collect();
        let steps = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let labelled = below(steps.map(|i| i * step));
        let light = below(steps.map(|i| (i + 0.5) * step));
        Self { range: 0.0..end, is_logarithmic: false, labelled, light }
    }

    fn logarithmic(low: f64, high: f64, headroom: f64) -> Self {
        // The axis starts well below the smallest amount, so that the shortest bar is visible.
        let start = nice_below((low / 1.5).max(f64::MIN_POSITIVE));
        // Decades are counted, so the start is above zero and the end is finite.
        let end = (start * (high / start).powf(1.0 / (1.0 - headroom))).min(f64::MAX);
        let decades = decade(start)..=decade(end);
        let few = (end / start).log10() < 2.5;
        let (mut labelled, mut light) = (Vec::new(), Vec::new());
        for decade in decades {
            for digit in 1..10 {
                let amount = f64::from(digit) * 10f64.powi(decade);
                if !(start * 0.999..=end).contains(&amount) {
                    continue;
                }
                let is_labelled = digit == 1 || few && (digit == 2 || digit == 5);
                if is_labelled { &mut labelled } else { &mut light }.push(amount);
            }
        }
        Self { range: start..end, is_logarithmic: true, labelled, light }
    }

    /// Returns the place of an amount, 0 at the start and 1 at the end.
    fn part(&self, amount: f64) -> f64 {
        let Range { start, end } = self.range;
        if self.is_logarithmic {
            // Not the logarithm of a quotient, which may be infinite.
            (amount.max(start).ln() - start.ln()) / (end.ln() - start.ln())
        } else {
            (amount.max(start) - start) / (end - start)
        }
    }
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, amount: &f64, limit: (i32, i32)) -> i32 {
        pixel(self.part(*amount), limit)
    }

    fn key_points<H: KeyPointHint>(&self, hint: H) -> Vec<f64> {
        let mut points = self.labelled.clone();
        if hint.weight().allow_light_points() {
            points.extend(&self.light);
        }
        points
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Scale {
    fn format(amount: &f64) -> String {
        number(*amount)
    }
}

/// An axis with names at some places.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stops {
    /// The places at the ends.
    pub(crate) range: Range<f64>,
    /// Places and their names.
    pub(crate) names: Vec<(f64, String)>,
}

impl Ranged for Stops {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, limit: (i32, i32)) -> i32 {
        pixel((place - self.range.start) / (self.range.end - self.range.start), limit)
    }

    fn key_points<H: KeyPointHint>(&self, _: H) -> Vec<f64> {
        self.names.iter().map(|&(place, _)| place).collect()
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Stops {
    fn format_ext(&self, place: &f64) -> String {
        let is_here = |(stop, _): &&(f64, String)| (stop - place).abs() < 1e-9;
        self.names.iter().find(is_here).map(|(_, name)| name.clone()).unwrap_or_default()
    }
}

/// Returns the least of 1, 2, 5, 10, 20, ... and their tenths that is at least an amount above zero.
pub(crate) fn nice_above(amount: f64) -> f64 {
    let power = 10f64.powi(decade(amount));
    let nice = [1.0, 2.0, 5.0].map(|digit| digit * power);
    nice.into_iter().find(|&nice| nice >= amount).unwrap_or(10.0 * power)
}

/// Returns the greatest of the same that is at most an amount above zero.
fn nice_below(amount: f64) -> f64 {
    let power = 10f64.powi(decade(amount));
    let nice = [5.0, 2.0, 1.0].map(|digit| digit * power);
    nice.into_iter().find(|&nice| nice <= amount).unwrap_or(power)
}

/// Formats a number with up to three significant digits, without trailing zeros.
pub(crate) fn number(amount: f64) -> String {
    let digits = usize::try_from(2 - decade(amount.abs().max(1e-9))).unwrap_or(0);
    let text = format!("{amount:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Returns the power of ten of a number's first digit.
#[expect(clippy::cast_possible_truncation, reason = "a logarithm")]
fn decade(amount: f64) -> i32 {
    amount.log10().floor() as i32
}

/// Returns the pixel at a part from 0 to 1 of the way between two.
#[expect(clippy::cast_possible_truncation, reason = "between two pixels")]
fn pixel(part: f64, (from, to): (i32, i32)) -> i32 {
    from + (part * f64::from(to - from)).round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn close_amounts_are_linear_from_zero() {
        let scale = Scale::fitting([2.0, 3.0, 11.0].into_iter(), 0.1);
        assert!(!scale.is_logarithmic && scale.range.start.abs() < 1e-9);
        assert_eq!(scale.labelled, [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0]);
        assert_eq!(scale.map(&0.0, (100, 0)), 100);
        assert_eq!(scale.map(&11.0, (100, 0)), 10);
    }

    #[test]
    fn distant_amounts_are_logarithmic() {
        let scale = Scale::fitting([0.006, 0.8].into_iter(), 0.0);
        assert!(scale.is_logarithmic);
        assert!(scale.range.start < 0.006 && scale.range.start > 0.001, "{}", scale.range.start);
        assert!(scale.labelled.iter().all(|a| scale.range.start * 0.99 <= *a && *a <= 0.8));
        assert_eq!(scale.map(&0.8, (0, 1000)), 1000);
        let [low, high] = [0.01, 0.1].map(|amount| scale.map(&amount, (0, 1000)));
        assert!((high - low - scale.map(&0.8, (0, 1000)) + scale.map(&0.08, (0, 1000))).abs() < 2);
    }

    #[test]
    fn scales_of_nothing_exist() {
        for amounts in [vec![], vec![0.0], vec![5.0]] {
            let scale = Scale::fitting(amounts.into_iter(), 0.2);
            assert!(scale.range.end > scale.range.start && !scale.labelled.is_empty());
        }
    }

    #[test]
    fn scales_of_any_amounts_end() {
        for amounts in [[f64::MAX, f64::MAX], [1.0, f64::MAX], [5e-324, 1.0], [5e-324, f64::MAX]] {
            let scale = Scale::fitting(amounts.into_iter(), 0.2);
            assert!(scale.range.end.is_finite(), "{:?}", scale.range);
            let [low, high] = amounts.map(|amount| scale.part(amount));
            assert!(0.0 <= low && low <= high && 0.25 < high && high <= 1.0, "{low} to {high}");
            assert!(scale.labelled.len() < 2000, "{amounts:?}");
        }
    }

    /// A damaged result may have any of them.
    #[test]
    fn amounts_below_zero_are_at_the_start() {
        let scale = Scale::fitting([2.0, 3.0].into_iter(), 0.1);
        assert_eq!([-1.0, -1e308].map(|amount| scale.map(&amount, (100, 0))), [100, 100]);
    }

    #[test]
    fn numbers_are_short() {
        let numbers = [0.0, 0.005, 0.05, 0.25, 1.0, 2.5, 20.0, 500.0, 1234.0].map(number);
        assert_eq!(numbers, ["0", "0.005", "0.05", "0.25", "1", "2.5", "20", "500", "1234"]);
    }

    #[test]
    fn nice_numbers_are_close() {
        for (amount, nice) in [(1.0, 1.0), (1.1, 2.0), (3.0, 5.0), (7.0, 10.0), (0.03, 0.05)] {
            assert!((nice_above(amount) / nice - 1.0).abs() < 1e-12, "{amount}");
        }
        for (amount, nice) in [(1.0, 1.0), (1.9, 1.0), (3.0, 2.0), (7.0, 5.0), (0.03, 0.02)] {
            assert!((nice_below(amount) / nice - 1.0).abs() < 1e-12, "{amount}");
        }
    }

    #[test]
    fn stops_have_their_names() {
        let stops = Stops { range: 0.0..2.0, names: vec![(0.5, "a".into()), (1.5, "b".into())] };
        assert_eq!(stops.format_ext(&1.5), "b");
        assert_eq!(stops.format_ext(&1.0), "");
        assert_eq!(stops.map(&0.5, (0, 100)), 25);
    }
}
