//! Code that the tests of hgrid share: the oracle, test meshes, a grid that owns its memory.

/// The example in the project's README runs as a test.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

#[cfg(feature = "full")]
pub mod artefact;
pub mod copy;
pub mod dyadic;
pub mod guarded;
pub mod hostile;
pub mod joined;
pub mod meshes;
pub mod methods;
pub mod oracle;
pub mod owned;
pub mod random;
pub mod reference;
#[cfg(feature = "full")]
pub mod scans;
pub mod scenes;
#[cfg(feature = "full")]
pub mod tools;

/// Returns `count` times the number in `HGRID_ROUNDS`, 1 unless set; `.ci/run` sets 4.
///
/// # Panics
/// If the value is not a number.
#[must_use]
pub fn rounds(count: usize) -> usize {
    count * usize::try_from(setting("HGRID_ROUNDS", 1)).expect("a count that fits")
}

/// Returns the number in an environment variable, or the default if it is not set.
///
/// # Panics
/// If the value is not a number.
#[must_use]
pub fn setting(name: &str, default: u64) -> u64 {
    let Some(value) = std::env::var_os(name) else { return default };
    let number = value.to_str().and_then(|text| text.parse().ok());
    number.unwrap_or_else(|| panic!("{name}: {} is no number", value.display()))
}
