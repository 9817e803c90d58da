//! What the tests of hgrid share: the oracle, meshes to ask about, a grid that owns its memory.

#[cfg(feature = "full")]
pub mod artefact;
pub mod copy;
pub mod guarded;
pub mod hostile;
pub mod meshes;
pub mod methods;
pub mod oracle;
pub mod owned;
pub mod random;
#[cfg(feature = "full")]
pub mod readme;
#[cfg(feature = "full")]
pub mod scans;
#[cfg(feature = "full")]
pub mod symbols;
#[cfg(feature = "full")]
pub mod tools;
