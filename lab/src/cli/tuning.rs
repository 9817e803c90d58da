//! The arguments for the parameters of single methods.

use anyhow::{Result, ensure};
use clap::Args;
use hgrid_core::{Config, MAX_DEPTH, Method, Parameters, Quality};

use super::values::{quality_parser, whole};

/// Parameters of single methods.
#[derive(Debug, Clone, Copy, Args)]
pub struct Tuning {
    /// For `fixed`: cells in a macrocell on each axis, 2 or more [default: the paper's, 6]
    #[arg(long, value_name = "CELLS", allow_negative_numbers = true, value_parser = whole(2..=u32::MAX))]
    pub macrocell_factor: Option<u32>,
    /// For `variable`: a cell with more triangles than this gets a subgrid [default: 16]
    #[arg(long, value_name = "TRIANGLES", allow_negative_numbers = true, value_parser = whole(0..=u32::MAX))]
    pub subdivide_above: Option<u32>,
    /// For `recursive`: levels of grids, 1 to 4 [default: the paper's, 3]
    #[arg(long, value_name = "LEVELS", allow_negative_numbers = true, value_parser = whole(1..=MAX_DEPTH))]
    pub depth: Option<u32>,
    /// For `bvh`: `high` takes a longer build, after which most rays are faster [default: fast]
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

    /// Refuses parameters of methods that are not built. `choice` is the option that chooses methods.
    ///
    /// # Errors
    /// If there is one; the message names the parameter and its method.
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
        Ok(())
    }
}
