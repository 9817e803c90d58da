//! What a caller chooses before a build.

use bitflags::bitflags;

use crate::error::{ConfigField, Error};
use crate::recursive::MAX_DEPTH;

// Which methods this library has. Every choice of a method names its constant beside it, so that no
// code stays for one that is left out.
pub(crate) const HAS_ONE_LEVEL: bool = cfg!(feature = "one-level");
pub(crate) const HAS_FIXED: bool = cfg!(feature = "fixed");
pub(crate) const HAS_VARIABLE: bool = cfg!(feature = "variable");
pub(crate) const HAS_RECURSIVE: bool = cfg!(feature = "recursive");
pub(crate) const HAS_BVH: bool = cfg!(feature = "bvh");
/// Whether there are methods with cells; fixed and variable bring one-level along.
pub(crate) const HAS_GRIDS: bool = HAS_ONE_LEVEL || HAS_RECURSIVE;

const _: () = assert!(
    HAS_GRIDS || HAS_BVH,
    "hgrid has no method to build grids with: turn on at least one of the features one-level, fixed, \
     variable, recursive and bvh"
);

/// The number of `brick`, a removed method. No other method gets it.
pub(crate) const REMOVED_METHOD: u32 = 5;

/// The structure to build.
#[non_exhaustive]
#[repr(u32)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Method {
    /// One level, row displacement compression (Lagae and Dutré 2008; the paper's baseline).
    OneLevel = 1,
    /// A fine one-level grid under macrocell levels (the paper's multi-level fixed grid, §3.2).
    Fixed = 2,
    /// A one-level grid whose crowded cells hold one-level grids of their own (the paper's
    /// multi-level variable grid, §3.1).
    Variable = 3,
    /// An uncompressed recursive grid, as in the Manta ray tracer: what the paper compares with.
    Recursive = 4,
    /// A wide tree of tight boxes over a grid of the triangles' centres: this project's own, for rays of
    /// every kind in scenes of every kind, in memory that the number of triangles bounds.
    #[default]
    Bvh = 6, // 5 was `brick`, a removed method; see `REMOVED_METHOD`.
}

impl Method {
    /// All methods, in the order of the paper's Table 1 but for its baseline, which comes last; also
    /// those that this library has not ([`is_available`](Self::is_available)).
    pub const ALL: &[Self] =
        &[Self::OneLevel, Self::Variable, Self::Fixed, Self::Recursive, Self::Bvh];

    /// The name that commands and tables use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::OneLevel => "one-level",
            Self::Fixed => "fixed",
            Self::Variable => "variable",
            Self::Recursive => "recursive",
            Self::Bvh => "bvh",
        }
    }

    /// The method that a number in a blob or from C means.
    #[must_use]
    pub const fn from_u32(value: u32) -> Option<Self> {
        match value {
            1 => Some(Self::OneLevel),
            2 => Some(Self::Fixed),
            3 => Some(Self::Variable),
            4 => Some(Self::Recursive),
            6 => Some(Self::Bvh),
            _ => None,
        }
    }

    /// Whether this library has it. A feature of the package that is off leaves its method out, and
    /// who asks for it gets [`Error::MethodLeftOut`]; the default, `Bvh`, is no exception.
    ///
    /// ```
    /// use hgrid_core::{Config, Method};
    /// let smallest = [Method::OneLevel, Method::Bvh].into_iter().find(|method| method.is_available());
    /// let config = smallest.map(Config::new);
    /// # assert!(config.is_some());
    /// ```
    #[must_use]
    pub const fn is_available(self) -> bool {
        match self {
            Self::OneLevel => HAS_ONE_LEVEL,
            Self::Fixed => HAS_FIXED,
            Self::Variable => HAS_VARIABLE,
            Self::Recursive => HAS_RECURSIVE,
            Self::Bvh => HAS_BVH,
        }
    }

    /// Whether [`Config::macrocell_factor`] means something to it.
    pub(crate) const fn has_macrocells(self) -> bool {
        matches!(self, Self::Fixed)
    }

    /// Whether [`Config::subdivide_above`] means something to it.
    pub(crate) const fn has_subgrids(self) -> bool {
        matches!(self, Self::Variable)
    }

    /// Whether [`Config::depth`] means something to it.
    pub(crate) const fn has_depth(self) -> bool {
        matches!(self, Self::Recursive)
    }

    /// Whether [`Config::density`] means something to it.
    #[must_use]
    pub const fn has_density(self) -> bool {
        !self.has_nodes()
    }

    /// Whether its index has nodes, not cells.
    pub(crate) const fn has_nodes(self) -> bool {
        matches!(self, Self::Bvh)
    }

    /// The density that the paper uses with this method.
    #[must_use]
    pub const fn default_density(self) -> f32 {
        match self {
            Self::OneLevel | Self::Variable | Self::Bvh => 4.0,
            Self::Fixed => 32.0,
            Self::Recursive => 8.0,
        }
    }
}

/// How much time a build of [`Method::Bvh`] takes for rays that are faster.
///
/// Trees of both qualities have the same format, and the same rays have the same hits.
#[non_exhaustive]
#[repr(u32)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Quality {
    /// Triangles are binned by centre, and SAH chooses the nodes above small groups of them: the shortest build.
    #[default]
    Fast = 0,
    /// SAH chooses every node, each triangle on its own: for scenes that are traced for long.
    High = 1,
}

impl Quality {
    /// All qualities, the shortest build first.
    pub const ALL: &[Self] = &[Self::Fast, Self::High];

    /// The name that commands and tables use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::High => "high",
        }
    }

    /// The quality that a number in a blob or from C means.
    #[must_use]
    pub const fn from_u32(value: u32) -> Option<Self> {
        match value {
            0 => Some(Self::Fast),
            1 => Some(Self::High),
            _ => None,
        }
    }
}

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
