//! Every method, for tests that ask the same of all of them.

use hgrid_core::{Config, Method};

/// A configuration for each method, with its own density and small numbers elsewhere, so that small
/// meshes have levels and subgrids too.
pub fn configs() -> impl Iterator<Item = Config> {
    Method::ALL.iter().map(|&method| Config {
        macrocell_factor: 3,
        subdivide_above: 4,
        ..Config::new(method)
    })
}

/// The same with another density, or for a method that has none with cells as much
/// smaller or larger as that makes them.
pub fn configs_with(density: f32) -> impl Iterator<Item = Config> {
    configs().map(move |config| Config {
        density,
        cell_size: if density > 0.0 { (4.0 / density).cbrt() } else { 1.0 },
        ..config
    })
}
