//! Every method, for tests that ask the same of all of them.

use hgrid_core::{Config, Method, Quality};

/// A configuration for each method, and one more for trees of high quality, with its own density and small numbers elsewhere, so that small
/// meshes have levels and subgrids too.
pub fn configs() -> impl Iterator<Item = Config> {
    let high = Config { quality: Quality::High, ..Config::new(Method::Bvh) };
    let usual = Method::ALL.iter().map(|&method| Config::new(method));
    usual.chain([high]).map(|config| Config { macrocell_factor: 3, subdivide_above: 4, ..config })
}

/// The same with another density.
pub fn configs_with(density: f32) -> impl Iterator<Item = Config> {
    configs().map(move |config| Config { density, ..config })
}
