//! A comparison as charts: time to image against triangles, and bytes per triangle.

mod bytes;
mod times;

use std::path::Path;

use anyhow::Result;
use plotters::prelude::RGBColor;

use super::numbers::{Comparison, SceneNumbers, SystemNumbers};
use crate::plot::{COLORS, MUTED, save};

/// Draws both charts.
pub(super) fn draw(comparison: &Comparison, folder: &Path) -> Result<()> {
    save(&times::Figure(comparison), folder, "compare_times")?;
    save(&bytes::Figure(comparison), folder, "compare_bytes")
}

/// Returns the systems of the first scene, in their order.
fn names(comparison: &Comparison) -> Vec<&SystemNumbers> {
    comparison.scenes.first().map(|scene| scene.systems.iter().collect()).unwrap_or_default()
}

/// Returns the colour of a system by its place among the methods or peers, or of a scene among the scenes.
fn color(place: usize) -> RGBColor {
    COLORS.get(place).copied().unwrap_or(MUTED)
}

/// Finds the numbers of a system on a scene.
fn find<'a>(scene: &'a SceneNumbers, name: &str) -> Option<&'a SystemNumbers> {
    scene.systems.iter().find(|system| system.system == name)
}
