//! Proof that a foreign blob is a fixed grid of its mesh: the one-level grid is, and each macrocell
//! is full exactly where something below it is.

use super::Fixed;
use crate::blob::{Header, corrupt};
use crate::cell::Lattice;
use crate::error::Error;
use crate::mesh::TriangleMesh;

impl Fixed<'_> {
    /// Proves that this is what a build makes of the mesh; the error names the first byte that is not.
    pub(crate) fn validate(
        &self,
        header: &Header,
        lattice: &Lattice,
        blob: &[u8],
        mesh: &TriangleMesh<'_>,
    ) -> Result<(), Error> {
        self.cells.validate(header, lattice, blob, mesh)?;
        let words = self.cells.sections.overlay;
        match self.levels.first_wrong_word(
            lattice.resolution,
            self.cells.sections.domain_bits,
            words,
        ) {
            Some(word) => {
                let start = words.as_ptr().addr() - blob.as_ptr().addr();
                Err(corrupt(start + word * size_of::<u64>()))
            }
            None => Ok(()),
        }
    }
}
