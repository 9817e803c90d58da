//! The method of a grid, the quality of a tree, and the kind of thing that a blob is built over.

/// The number of `brick`, a removed method. No other method gets it.
pub(crate) const REMOVED_METHOD: u32 = 5;

/// The structure to build.
#[non_exhaustive]
#[repr(u32)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Method {
    /// One level, row displacement compression (Lagae and Dutré 2008), on which the paper's grids build.
    OneLevel = 1,
    /// A fine one-level grid under macrocell levels (the paper's multi-level fixed grid, §3.2).
    Fixed = 2,
    /// A one-level grid whose crowded cells hold one-level grids of their own (the paper's
    /// multi-level variable grid, §3.1).
    Variable = 3,
    /// An uncompressed recursive grid, as in the Manta ray tracer: what the paper compares with.
    Recursive = 4,
    /// A bounding volume hierarchy with eight children a node, for all rays in all scenes, in memory that the number
    /// of triangles bounds. It is not from the paper.
    #[default]
    Bvh = 6, // 5 was `brick`, a removed method; see `REMOVED_METHOD`.
}

impl Method {
    /// All methods: the paper's hashed grids in the order of its Table 1, the recursive grid, and the tree; also those
    /// that this library has not ([`is_available`](Self::is_available)).
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

    /// Returns true if this library was built with the method. Without its feature, a call with the method returns
    /// [`Error::MethodLeftOut`](crate::Error::MethodLeftOut); the default, `Bvh`, is no exception.
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
            Self::OneLevel => cfg!(feature = "one-level"),
            Self::Fixed => cfg!(feature = "fixed"),
            Self::Variable => cfg!(feature = "variable"),
            Self::Recursive => cfg!(feature = "recursive"),
            Self::Bvh => cfg!(feature = "bvh"),
        }
    }
}

/// The quality of a tree ([`Method::Bvh`]): a higher quality takes a longer build and makes most rays faster.
///
/// Trees of both qualities have the same format, and the same rays have the same hits.
#[non_exhaustive]
#[repr(u32)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Quality {
    /// Triangles are binned by centre, and SAH chooses the nodes above small groups of them: the shortest build.
    #[default]
    Fast = 0,
    /// SAH chooses every node, each triangle on its own: for scenes that are traced for long. Measure it in
    /// architecture, where some rays take longer.
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

/// The primitives that a blob is built over.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// The triangles of a mesh: [`Grid`](crate::Grid).
    Triangles = 0,
    /// The boxes of the caller's own shapes: [`Shapes`](crate::Shapes).
    Shapes = 1,
    /// Instances of other blobs: [`Scene`](crate::Scene).
    Instances = 2,
    /// A scene with all that it shows: [`Scene::pack`](crate::Scene::pack).
    Packed = 3,
}

impl Content {
    /// Returns the content that a number in a blob means.
    pub(crate) const fn from_u32(value: u32) -> Option<Self> {
        match value {
            0 => Some(Self::Triangles),
            1 => Some(Self::Shapes),
            2 => Some(Self::Instances),
            3 => Some(Self::Packed),
            _ => None,
        }
    }
}
