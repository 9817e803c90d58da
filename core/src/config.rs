//! What a caller chooses before a build.

use bitflags::bitflags;

use crate::error::{ConfigField, Error};

/// The structure to build.
#[non_exhaustive]
#[repr(u32)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Method {
    /// One level, row displacement compression (Lagae and Dutré 2008; the paper's baseline).
    #[default]
    OneLevel = 1,
}

impl Method {
    /// The method that a number in a blob or from C means.
    #[must_use]
    pub const fn from_u32(value: u32) -> Option<Self> {
        match value {
            1 => Some(Self::OneLevel),
            _ => None,
        }
    }

    /// The density that the paper uses with this method.
    #[must_use]
    pub const fn default_density(self) -> f32 {
        match self {
            Self::OneLevel => 4.0,
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
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// The structure to build.
    pub method: Method,
    /// Cells per primitive (the paper's rho): more cells mean fewer tests, more steps, more memory.
    pub density: f32,
    /// Choices that are either on or off.
    pub flags: BuildFlags,
}

impl Config {
    /// The paper's parameters for a method.
    #[must_use]
    pub const fn new(method: Method) -> Self {
        Self { method, density: method.default_density(), flags: BuildFlags::empty() }
    }

    /// Refuses values that no build can use.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if !self.density_is_valid() {
            return Err(Error::InvalidConfig(ConfigField::Density));
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
