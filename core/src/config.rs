//! The choices that a caller makes before a build.

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

/// A method and its parameters.
///
/// The density is the number of cells per primitive (the paper's rho): more cells mean fewer tests, more steps,
/// more memory.
///
/// ```
/// use hgrid_core::{Config, Method, Parameters, Quality};
/// // A tree for a scene that is traced for long, and a grid with more cells than usual.
/// let tree = Config::from(Parameters::Bvh { quality: Quality::High });
/// let grid = Config::from(Parameters::new(Method::Fixed).with_density(64.0));
/// assert_eq!(tree.method(), Method::default());
/// assert_eq!(grid.parameters, Parameters::Fixed { density: 64.0, macrocell_factor: 6 });
/// ```
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Parameters {
    /// Parameters of [`Method::OneLevel`].
    OneLevel {
        /// Cells per primitive.
        density: f32,
    },
    /// Parameters of [`Method::Fixed`].
    Fixed {
        /// Cells per primitive.
        density: f32,
        /// Cells of a level in one macrocell of the level above, on each axis (the paper's S), at least 2.
        macrocell_factor: u32,
    },
    /// Parameters of [`Method::Variable`].
    Variable {
        /// Cells per primitive.
        density: f32,
        /// A cell with more primitives than this gets a subgrid, if that separates them.
        subdivide_above: u32,
    },
    /// Parameters of [`Method::Recursive`].
    Recursive {
        /// Cells per primitive.
        density: f32,
        /// Levels of grids, 1 to [`MAX_DEPTH`].
        depth: u32,
    },
    /// Parameters of [`Method::Bvh`].
    Bvh {
        /// A higher quality takes a longer build and makes most rays faster.
        quality: Quality,
    },
}

impl Parameters {
    /// The default parameters of a method: those of the paper, and ours where it names none.
    #[must_use]
    pub const fn new(method: Method) -> Self {
        match method {
            Method::OneLevel => Self::OneLevel { density: 4.0 },
            Method::Fixed => Self::Fixed { density: 32.0, macrocell_factor: 6 },
            Method::Variable => Self::Variable { density: 4.0, subdivide_above: 16 },
            Method::Recursive => Self::Recursive { density: 8.0, depth: 3 },
            Method::Bvh => Self::Bvh { quality: Quality::Fast },
        }
    }

    /// The method that they are for.
    #[must_use]
    pub const fn method(self) -> Method {
        match self {
            Self::OneLevel { .. } => Method::OneLevel,
            Self::Fixed { .. } => Method::Fixed,
            Self::Variable { .. } => Method::Variable,
            Self::Recursive { .. } => Method::Recursive,
            Self::Bvh { .. } => Method::Bvh,
        }
    }

    /// The density; `None` for a tree, which has no cells.
    #[must_use]
    pub const fn density(self) -> Option<f32> {
        match self {
            Self::OneLevel { density }
            | Self::Fixed { density, .. }
            | Self::Variable { density, .. }
            | Self::Recursive { density, .. } => Some(density),
            Self::Bvh { .. } => None,
        }
    }

    /// The same with another density; a tree stays as it is.
    #[must_use]
    pub const fn with_density(mut self, to: f32) -> Self {
        match &mut self {
            Self::OneLevel { density }
            | Self::Fixed { density, .. }
            | Self::Variable { density, .. }
            | Self::Recursive { density, .. } => *density = to,
            Self::Bvh { .. } => {}
        }
        self
    }
}

/// The configuration of a build.
///
/// ```
/// use hgrid_core::{BuildFlags, Config, Method};
/// let strict = Config { flags: BuildFlags::STRICT, ..Config::new(Method::OneLevel) };
/// assert_eq!(strict.parameters.density(), Some(4.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// The structure to build, and how.
    pub parameters: Parameters,
    /// Choices that are either on or off.
    pub flags: BuildFlags,
}

impl Config {
    /// The default parameters of a method: those of the paper, and ours where it names none.
    #[must_use]
    pub const fn new(method: Method) -> Self {
        Self { parameters: Parameters::new(method), flags: BuildFlags::empty() }
    }

    /// The structure to build.
    #[must_use]
    pub const fn method(&self) -> Method {
        self.parameters.method()
    }

    /// Refuses values that no build can use.
    pub(crate) const fn check(&self) -> Result<(), Error> {
        if !self.method().is_available() {
            return Err(Error::MethodLeftOut(self.method()));
        }
        let field = match (self.parameters, self.parameters.density()) {
            (_, Some(density)) if !density_is_valid(density) => ConfigField::Density,
            (Parameters::Fixed { macrocell_factor: 0..2, .. }, _) => ConfigField::MacrocellFactor,
            (Parameters::Recursive { depth, .. }, _) if depth < 1 || depth > MAX_DEPTH => {
                ConfigField::Depth
            }
            _ if self.flags.bits() & !BuildFlags::all().bits() != 0 => ConfigField::Flags,
            _ => return Ok(()),
        };
        Err(Error::InvalidConfig(field))
    }

    /// Refuses all methods but the tree.
    pub(crate) const fn check_tree(&self) -> Result<(), Error> {
        match self.method() {
            Method::Bvh => Ok(()),
            _ => Err(Error::InvalidConfig(ConfigField::Method)),
        }
    }
}

/// Returns true for a density above zero that is finite.
pub(crate) const fn density_is_valid(density: f32) -> bool {
    density > 0.0 && density.is_finite()
}

impl Default for Config {
    fn default() -> Self {
        Self::new(Method::default())
    }
}

impl From<Parameters> for Config {
    fn from(parameters: Parameters) -> Self {
        Self { parameters, flags: BuildFlags::empty() }
    }
}
