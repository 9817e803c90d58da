//! Refits a tree to a mesh whose vertices moved: new boxes for the same leaves, in place.

use crate::blob::{HasMesh, Header};
use crate::error::Error;
use crate::grid::Grid;
use crate::mesh::TriangleMesh;
use crate::method::Method;
use crate::structure;

/// The costs of a tree before and after a refit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refit {
    /// The SAH cost that the tree had, with the boxes that it had: how many nodes a random line through its
    /// box visits and how many triangles it tests on average, added up (Goldsmith and Salmon 1987).
    pub cost_before: f64,
    /// The SAH cost that the tree has now.
    pub cost_after: f64,
}

/// Gives a built tree ([`Method::Bvh`]) the boxes of a mesh whose vertices moved: in place, O(n), without
/// scratch, in a fraction of the time of a build.
///
/// `index` holds the blob of a build, or a copy of it; bytes behind the blob are not touched. `mesh` has the
/// same triangles as the mesh that the tree was built for, at other places. Open the blob again afterwards:
/// [`Grid::open`] is O(1). Queries then answer as those of a new build do. The same blob and mesh give the
/// same bits, on every machine of the same byte order. The stack is that of a build.
///
/// The leaves stay as they were built, so rays take longer the more the mesh changes. Remember
/// `cost_before` of the first refit after a build, and build anew once `cost_after` is well above it: times
/// of rays grow about as the cost does, if the box of the tree stays about as large. A cost is relative to the surface
/// of this box, so one vertex that moves far away makes it small. Where that may be, multiply each cost by the surface
/// of the box around all vertices at that time, and compare the products.
///
/// A triangle that the build left out, because a coordinate was not finite or beyond
/// [`MAX_COORDINATE`](crate::MAX_COORDINATE), is in no leaf. If it fits now, the refit fails: build again.
///
/// # Errors
/// [`Error::CannotRefit`] for a grid of another method and for a packed one ([`pack`](Grid::pack) it after the refit);
/// [`Error::MeshMismatch`] for other counts, and if a triangle became finite; [`Error::NonFiniteTriangle`] if one of a
/// leaf is not finite any more, whatever the flags of the build; [`Error::IndexOutOfRange`]; [`Error::Corrupt`] if
/// nodes or ids of the tree are damaged; and those of [`Grid::open`]. After an error the blob is as it was.
///
/// ```
/// # use hgrid_core::*;
/// let mut positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let indices = [[0, 1, 2]];
/// let mesh = TriangleMesh::new(&positions, &indices)?;
/// let config = Config::new(Method::Bvh);
/// let sizes = sizes(&mesh, &config, &mut [])?;
/// let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
/// let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
/// let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
/// Grid::build(mesh, &config, index, scratch)?;
///
/// positions[2] = [0.0, 9.0, 5.0];
/// let mesh = TriangleMesh::new(&positions, &indices)?;
/// refit(index, &mesh)?;
/// let grid = Grid::open(index, mesh)?;
/// assert!(grid.occluded(&Ray::new([0.1, 8.0, 9.0], [0.0, 0.0, -1.0])));
/// # Ok::<(), Error>(())
/// ```
pub fn refit(index: &mut [u8], mesh: &TriangleMesh<'_>) -> Result<Refit, Error> {
    // `Shapes::refit` and `Scene::refit` call this with boxes in the form of a mesh.
    let grid = Grid::open(index, *mesh)?;
    let (method, blob_bytes) = (grid.method(), grid.blob_bytes());
    let header = Header::read(index, mesh)?;
    if method != Method::Bvh || header.has_mesh()? != HasMesh::No {
        return Err(Error::CannotRefit);
    }
    let [cost_before, cost_after] =
        structure::refit(index.get_mut(..blob_bytes).unwrap_or_default(), mesh)?;
    Ok(Refit { cost_before, cost_after })
}
