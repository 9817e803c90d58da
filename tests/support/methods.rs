//! Configurations of every method, for tests that ask the same of all of them.

use hgrid_core::{Config, Method, Parameters, Quality};

/// Returns a configuration for each method, and one more for trees of high quality, with the default density
/// and small numbers elsewhere, so that small meshes have levels and subgrids too.
pub fn configs() -> impl Iterator<Item = Config> {
    let small = |&method: &Method| match Parameters::new(method) {
        Parameters::Fixed { density, .. } => Parameters::Fixed { density, macrocell_factor: 3 },
        Parameters::Variable { density, .. } => {
            Parameters::Variable { density, subdivide_above: 4 }
        }
        others => others,
    };
    let high = Parameters::Bvh { quality: Quality::High };
    Method::ALL.iter().map(small).chain([high]).map(Config::from)
}

/// Returns the same with another density.
pub fn configs_with(density: f32) -> impl Iterator<Item = Config> {
    configs().map(move |config| config.parameters.with_density(density).into())
}
