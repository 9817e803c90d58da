//! What a caller chooses before a build.

use bitflags::bitflags;

use crate::error::{ConfigField, Error};
use crate::limits::MAX_DEPTH;
use crate::method::{Method, Quality};

bitflags! {
    /// Choices that are either on or off.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
    pub struct BuildFlags: u32 {
        /// Refuse a mesh with a non-finite triangle instead of skipping the triangle.
        const STRICT = 1;
    }
}

/// Everything a build can be told.
///
/// ```
/// use hgrid_core::{Config, Method, Quality};
/// // A tree for a scene that is traced for long, and a grid with more cells than usual.
/// let tree = Config { quality: Quality::High, ..Config::default() };
/// let grid = Config { density: 8.0, ..Config::new(Method::OneLevel) };
/// assert_eq!((tree.method, grid.quality), (Method::Bvh, Quality::Fast));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// The structure to build.
    pub method: Method,
    /// Cells per primitive (the paper's rho): more cells mean fewer tests, more steps, more memory.
    pub density: f32,
    /// For [`Method::Fixed`]: cells of a level in one macrocell of the level above, on each
    /// axis (the paper's S), at least 2.
    pub macrocell_factor: u32,
    /// For [`Method::Variable`]: a cell with more primitives than this gets a subgrid.
    pub subdivide_above: u32,
    /// For [`Method::Recursive`]: levels of grids, 1 to [`MAX_DEPTH`](crate::MAX_DEPTH).
    pub depth: u32,
    /// For [`Method::Bvh`]: how much time the build takes for rays that are faster.
    pub quality: Quality,
    /// Choices that are either on or off.
    pub flags: BuildFlags,
}

impl Config {
    /// The paper's parameters for a method.
    #[must_use]
    pub const fn new(method: Method) -> Self {
        Self {
            method,
            density: method.default_density(),
            macrocell_factor: 6,
            subdivide_above: 16,
            depth: 3,
            quality: Quality::Fast,
            flags: BuildFlags::empty(),
        }
    }

    /// Refuses values that no build can use.
    pub(crate) const fn check(&self) -> Result<(), Error> {
        if !self.method.is_available() {
            return Err(Error::MethodLeftOut(self.method));
        }
        if self.method.has_density() && !self.density_is_valid() {
            return Err(Error::InvalidConfig(ConfigField::Density));
        }
        if self.method.has_macrocells() && self.macrocell_factor < 2 {
            return Err(Error::InvalidConfig(ConfigField::MacrocellFactor));
        }
        if self.method.has_depth() && (self.depth < 1 || self.depth > MAX_DEPTH) {
            return Err(Error::InvalidConfig(ConfigField::Depth));
        }
        if self.flags.bits() & !BuildFlags::all().bits() != 0 {
            return Err(Error::InvalidConfig(ConfigField::Flags));
        }
        Ok(())
    }

    /// Whether the density is one: above zero, not NaN, not infinite.
    pub(crate) const fn density_is_valid(&self) -> bool {
        self.density > 0.0 && self.density.is_finite()
    }
}

impl Default for Config {
    fn default() -> Self {
        Self::new(Method::default())
    }
}
