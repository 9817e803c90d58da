//! A grid with its memory, and the proof that it is valid.

use hgrid_core::{ALIGNMENT, Config, Error, Grid, TriangleMesh, sizes};

/// Aligned memory of zeros. Pages that are not touched cost nothing.
#[derive(Debug, Clone)]
struct Region {
    bytes: Vec<u8>,
    length: usize,
}

impl Region {
    fn new(length: usize) -> Self {
        Self { bytes: vec![0; length + ALIGNMENT], length }
    }

    fn start(&self) -> usize {
        self.bytes.as_ptr().align_offset(ALIGNMENT)
    }

    fn bytes(&self) -> &[u8] {
        &self.bytes[self.start()..][..self.length]
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        let start = self.start();
        &mut self.bytes[start..][..self.length]
    }
}

/// Memory with a built grid in it.
#[derive(Debug)]
pub struct Owned {
    index: Region,
}

/// Validates a grid, in scratch of exactly the size that it asks for, which may hold anything.
///
/// # Errors
/// The errors of the validation.
pub fn prove(grid: &Grid<'_>) -> Result<(), Error> {
    grid.validate(&mut vec![0xa5; grid.validate_bytes()])
}

impl Owned {
    /// Builds a grid in memory of exactly the size that it takes.
    ///
    /// # Errors
    /// The errors of the build.
    pub fn build(mesh: &TriangleMesh<'_>, config: &Config) -> Result<Self, Error> {
        let bound = sizes(mesh, config, &mut [])?;
        let mut scratch = Region::new(bound.scratch_bytes);
        let exact = sizes(mesh, config, scratch.bytes_mut())?;
        assert!(exact.is_exact && exact.index_bytes <= bound.index_bytes);
        assert!(exact.scratch_bytes <= bound.scratch_bytes);
        let mut index = Region::new(exact.index_bytes);
        let grid = Grid::build(*mesh, config, index.bytes_mut(), scratch.bytes_mut())?;
        let length = grid.blob_bytes();
        assert_eq!(length, exact.index_bytes);
        index.length = length;
        Ok(Self { index })
    }

    /// Returns the view for queries.
    ///
    /// # Errors
    /// The errors of opening, if the mesh is another one.
    pub fn open<'a>(&'a self, mesh: &TriangleMesh<'a>) -> Result<Grid<'a>, Error> {
        Grid::open(self.index.bytes(), *mesh)
    }

    /// Returns the grid's bytes.
    pub fn bytes(&self) -> &[u8] {
        self.index.bytes()
    }
}
