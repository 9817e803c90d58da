//! What the tests of hgrid share: the oracle, meshes to ask about, a grid that owns its memory.

pub mod artefact;
pub mod meshes;
pub mod methods;
pub mod oracle;
pub mod owned;
pub mod random;
pub mod scans;
pub mod symbols;
