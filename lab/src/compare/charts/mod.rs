//! A comparison as charts: time to image against triangles, and bytes per triangle.

mod bytes;
mod times;

use std::path::Path;

use anyhow::Result;
use plotters::prelude::RGBColor;

use super::numbers::{Comparison, SceneNumbers, SystemNumbers};
use crate::plot::{COLORS, MUTED, save};

/// Draws both.
pub(super) fn draw(comparison: &Comparison, folder: &Path) -> Result<()> {
    save(&times::Figure(comparison), folder, "compare_times")?;
    save(&bytes::Figure(comparison), folder, "compare_bytes")
}

/// Names of the systems, in their order.
fn names(comparison: &Comparison) -> Vec<&SystemNumbers> {
    comparison.scenes.first().map(|scene| scene.systems.iter().collect()).unwrap_or_default()
}

/// A colour for the place of something among its like.
fn color(place: usize) -> RGBColor {
    COLORS.get(place).copied().unwrap_or(MUTED)
}

/// The numbers of a system on a scene.
fn find<'a>(scene: &'a SceneNumbers, name: &str) -> Option<&'a SystemNumbers> {
    scene.systems.iter().find(|system| system.system == name)
}
