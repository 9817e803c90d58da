//! The arguments for the parameters of single methods.

use core::fmt;
use core::num::IntErrorKind;
use core::ops::RangeInclusive;

use anyhow::{Result, ensure};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use hgrid_core::{Config, Control, MAX_DEPTH, Method, Parameters, Quality};

/// Parameters of single methods.
#[derive(Debug, Clone, Copy, Args)]
pub struct Tuning {
    /// For `fixed`: cells in a macrocell on each axis [default: the paper's, 6]
    #[arg(long, value_name = "CELLS", allow_negative_numbers = true, value_parser = whole(0..=u32::MAX))]
    pub macrocell_factor: Option<u32>,
    /// For `variable`: a cell with more triangles than this gets a subgrid [default: 16]
    #[arg(long, value_name = "TRIANGLES", allow_negative_numbers = true, value_parser = whole(0..=u32::MAX))]
    pub subdivide_above: Option<u32>,
    /// For `recursive`: levels of grids [default: the paper's, 3]
    #[arg(long, value_name = "LEVELS", allow_negative_numbers = true, value_parser = whole(0..=u32::MAX))]
    pub depth: Option<u32>,
    /// For `bvh`: `high` builds longer for rays that are faster [default: fast]
    #[arg(long, value_name = "QUALITY", value_parser = quality_parser())]
    pub quality: Option<Quality>,
}

impl Tuning {
    /// Returns the method's configuration with these parameters and this density; the paper's values replace
    /// missing ones.
    #[must_use]
    pub fn config(&self, method: Method, density: Option<f32>) -> Config {
        let mut parameters = Parameters::new(method);
        match &mut parameters {
            Parameters::Fixed { macrocell_factor, .. } => {
                *macrocell_factor = self.macrocell_factor.unwrap_or(*macrocell_factor);
            }
            Parameters::Variable { subdivide_above, .. } => {
                *subdivide_above = self.subdivide_above.unwrap_or(*subdivide_above);
            }
            Parameters::Recursive { depth, .. } => *depth = self.depth.unwrap_or(*depth),
            Parameters::Bvh { quality } => *quality = self.quality.unwrap_or(*quality),
            _ => {}
        }
        density.map_or(parameters, |density| parameters.with_density(density)).into()
    }

    /// Refuses parameters of methods that are not built, and those outside their range. `choice` is the option that
    /// chooses methods.
    ///
    /// # Errors
    /// If there is one; the message names the parameter, and its method or its range.
    pub fn check(&self, choice: &str, methods: &[Method]) -> Result<()> {
        for (option, is_there, method) in [
            ("--macrocell-factor", self.macrocell_factor.is_some(), Method::Fixed),
            ("--subdivide-above", self.subdivide_above.is_some(), Method::Variable),
            ("--depth", self.depth.is_some(), Method::Recursive),
            ("--quality", self.quality.is_some(), Method::Bvh),
        ] {
            ensure!(
                !is_there || methods.contains(&method),
                "{option} is for {choice} {}: ask for that, or leave out {option}",
                method.name()
            );
        }
        // The core would refuse these two by the names of its fields.
        let is_macrocell = self.macrocell_factor.is_none_or(|cells| cells >= 2);
        ensure!(is_macrocell, "--macrocell-factor must be at least 2");
        let is_depth = self.depth.is_none_or(|depth| (1..=MAX_DEPTH).contains(&depth));
        ensure!(is_depth, "--depth must be 1 to {MAX_DEPTH}");
        Ok(())
    }
}

/// Parses a number of threads, at most as many as a build can use.
pub(super) fn thread_parser() -> impl TypedValueParser<Value = u32> {
    whole(1..=Control::MAX_TASKS)
}

/// Parses a whole number in a range, and names the range to who writes `1e9` or `1920x1080`.
pub(super) fn whole<T>(range: RangeInclusive<T>) -> impl TypedValueParser<Value = T>
where
    T: Copy + PartialOrd + fmt::Display + TryFrom<i64> + Send + Sync + 'static,
{
    move |word: &str| {
        let (start, end) = (range.start(), range.end());
        let number = match word.parse::<i64>().map_err(|error| *error.kind()) {
            Ok(number) => T::try_from(number).ok(),
            Err(IntErrorKind::PosOverflow | IntErrorKind::NegOverflow) => None,
            Err(_) => return Err(format!("it is no whole number from {start} to {end}")),
        };
        let number = number.filter(|number| range.contains(number));
        number.ok_or_else(|| format!("{word} is not in {start}..={end}"))
    }
}

/// Parses the name of a method.
pub(super) fn method_parser() -> impl TypedValueParser<Value = Method> {
    let names = Method::ALL.iter().copied().map(Method::name);
    PossibleValuesParser::new(names).try_map(|word| {
        let method = Method::ALL.iter().copied().find(|method| method.name() == word);
        method.ok_or("no such method")
    })
}

/// Parses the name of a quality.
pub(super) fn quality_parser() -> impl TypedValueParser<Value = Quality> {
    let names = Quality::ALL.iter().copied().map(Quality::name);
    PossibleValuesParser::new(names).try_map(|word| {
        let quality = Quality::ALL.iter().copied().find(|quality| quality.name() == word);
        quality.ok_or("no such quality")
    })
}
