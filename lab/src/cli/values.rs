//! Parsers for the values of options. Their errors say which values an option takes.

use core::fmt;
use core::ops::RangeInclusive;
use std::path::PathBuf;

use clap::builder::{PathBufValueParser, PossibleValuesParser, TypedValueParser};
use hgrid_core::{Control, Method, Quality};

/// Parses a number of threads, at most as many as a build can use.
pub(super) fn thread_parser() -> impl TypedValueParser<Value = u32> {
    whole(1..=Control::MAX_TASKS)
}

/// Parses a whole number in a range. The error names the range, for words like `1e9` or `1920x1080`, too.
pub(super) fn whole<T>(range: RangeInclusive<T>) -> impl TypedValueParser<Value = T>
where
    T: Copy + PartialOrd + fmt::Display + TryFrom<i64> + Send + Sync + 'static,
{
    move |word: &str| {
        let number = word.parse::<i64>().ok().and_then(|number| T::try_from(number).ok());
        number.filter(|number| range.contains(number)).ok_or_else(|| {
            let (start, end) = (range.start(), range.end().to_string());
            let is_too_large = word.parse::<u128>().is_ok_and(|number| number > u32::MAX.into());
            // Users need not know the greatest number of 32 bits, unless they name a greater one.
            if end == u32::MAX.to_string() && !is_too_large {
                format!("it is no whole number, {start} or more")
            } else {
                format!("it is no whole number from {start} to {end}")
            }
        })
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

/// Parses a density. How many cells a mesh can have is known only once its triangles are counted in them.
pub(super) fn density(word: &str) -> Result<f32, &'static str> {
    let density = word.parse().ok().filter(|density: &f32| *density > 0.0 && density.is_finite());
    density.ok_or("a density is a finite number above 0, like 4 or 0.5")
}

/// Parses the name of a file or a folder to write.
pub(super) fn output_parser() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| match path.to_str() {
        // The numbers go there, too, and would mix with a picture.
        Some("-" | "/dev/stdout" | "/dev/fd/1" | "/proc/self/fd/1") => {
            Err("it cannot be standard output: name a file or a folder")
        }
        _ => Ok(path),
    })
}

/// Parses the name of a picture, and refuses those that promise another format.
pub(super) fn picture_parser() -> impl TypedValueParser<Value = PathBuf> {
    output_parser().try_map(|path| {
        let is_png = path.extension().is_none_or(|ending| ending.eq_ignore_ascii_case("png"));
        let name = path.with_extension("png");
        let refusal = || format!("pictures are PNG, so name it {}", name.display());
        if is_png { Ok(path) } else { Err(refusal()) }
    })
}
