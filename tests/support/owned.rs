//! A grid and the memory it lives in.

use hgrid_core::{Block, Config, Error, Grid, TriangleMesh, sizes};

/// Memory with a built grid in it.
#[derive(Debug, Clone)]
pub struct Owned {
    index: Vec<Block>,
}

impl Owned {
    /// Builds a grid in memory of exactly the size that it takes.
    ///
    /// # Errors
    /// Those of the build.
    pub fn build(mesh: &TriangleMesh<'_>, config: &Config) -> Result<Self, Error> {
        let bound = sizes(mesh, config, &mut [])?;
        let mut scratch = vec![Block::ZERO; Block::count_for(bound.scratch_bytes)];
        let exact = sizes(mesh, config, Block::bytes_mut(&mut scratch))?;
        assert!(exact.is_exact && exact.index_bytes <= bound.index_bytes);
        assert_eq!(exact.scratch_bytes, bound.scratch_bytes);
        let mut index = vec![Block::ZERO; Block::count_for(exact.index_bytes)];
        let grid = Grid::build(
            *mesh,
            config,
            Block::bytes_mut(&mut index),
            Block::bytes_mut(&mut scratch),
        )?;
        assert_eq!(grid.blob_bytes(), exact.index_bytes);
        Ok(Self { index })
    }

    /// The view that queries run on.
    ///
    /// # Errors
    /// Those of opening, if the mesh is another.
    pub fn open<'a>(&'a self, mesh: &TriangleMesh<'a>) -> Result<Grid<'a>, Error> {
        Grid::open(Block::bytes(&self.index), *mesh)
    }

    /// The grid's bytes.
    pub fn bytes(&self) -> &[u8] {
        Block::bytes(&self.index)
    }
}
