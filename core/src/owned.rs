//! A grid that owns its memory and its mesh, so that a struct can hold it (feature `alloc`).
//!
//! ```text
//! OwnedGrid
//!   mesh    positions, indices, masks: containers of the caller's, moved in or shared
//!   index   | up to 63 bytes | blob, from a multiple of 64 on | up to 63 bytes |
//! ```
//!
//! The struct holds no references, so it can move: a view is opened anew for each batch of queries,
//! which is O(1). The regions are allocated as zeros of alignment 1, because Rust's allocators then call `calloc` and
//! `realloc`: pages that the build does not touch are never mapped, and the rest is given back without a copy. With
//! alignment 64, zeros would be written one by one, and shrinking would move them.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;
use core::marker::PhantomData;

use zerocopy::{FromZeros, Immutable, IntoBytes};

use crate::config::Config;
use crate::control::Control;
use crate::error::{Error, Region};
use crate::grid::Grid;
use crate::limits::ALIGNMENT;
use crate::mesh::{IndexType, Strided, TriangleMesh};
use crate::method::Method;
use crate::refit::{Refit, refit};
use crate::sizes::sizes_with;

/// A container of any elements, as bytes.
trait Bytes: Send + Sync {
    fn bytes(&self) -> &[u8];
}

/// A container of the caller's.
struct Container<C, T>(C, PhantomData<fn() -> T>);

impl<C: AsRef<[T]> + Send + Sync, T: Immutable + IntoBytes> Bytes for Container<C, T> {
    fn bytes(&self) -> &[u8] {
        self.0.as_ref().as_bytes()
    }
}

/// Elements in a container that is owned or shared: what [`Strided`] is, without a lifetime.
///
/// A copy of it shares the elements.
///
/// ```
/// # use std::sync::Arc;
/// use hgrid_core::OwnedStrided;
/// let moved = OwnedStrided::new(vec![[0.0_f32, 0.0, 0.0]; 3]);
/// let shared: Arc<[[u32; 3]]> = Arc::new([[0, 1, 2]]);
/// let indices = OwnedStrided::new(Arc::clone(&shared));
///
/// // Positions behind four bytes of another kind, in structs of 16.
/// let field = OwnedStrided::new(vec![[7.0_f32, 0.0, 0.0, 0.0]; 3]).at(4);
/// assert_eq!((field.view().stride, field.view().bytes.len()), (16, 44));
/// ```
#[derive(Clone)]
pub struct OwnedStrided {
    container: Arc<dyn Bytes>,
    /// Bytes before the first element.
    offset: usize,
    stride: usize,
}

impl OwnedStrided {
    /// The elements of a container: of a `Vec`, an `Arc` of a slice, a static array, a mapped file of
    /// yours. It is kept as it is; nothing is copied. The elements are of a type that [`Strided::new`] takes.
    pub fn new<T: Immutable + IntoBytes + 'static>(
        elements: impl AsRef<[T]> + Send + Sync + 'static,
    ) -> Self {
        let container = Arc::new(Container(elements, PhantomData::<fn() -> T>));
        Self { container, offset: 0, stride: size_of::<T>() }
    }

    /// A field of each element, so many bytes behind its start (`offset_of!`).
    #[must_use]
    pub fn at(self, offset: usize) -> Self {
        Self { offset: self.offset.saturating_add(offset), ..self }
    }

    /// The elements where they lie.
    #[must_use]
    pub fn view(&self) -> Strided<'_> {
        let all = self.container.bytes();
        let count = all.len().checked_div(self.stride).unwrap_or(0);
        let bytes = all.get(self.offset..).unwrap_or_default();
        Strided { bytes, stride: self.stride, count }
    }
}

impl fmt::Debug for OwnedStrided {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Strided { bytes, stride, count } = self.view();
        f.debug_struct("OwnedStrided")
            .field("bytes", &bytes.len())
            .field("stride", &stride)
            .field("count", &count)
            .finish()
    }
}

/// A mesh whose vertices and triangles are owned or shared: what [`TriangleMesh`] is, without a lifetime.
///
/// A copy of it shares them.
#[derive(Clone)]
pub struct OwnedMesh {
    positions: OwnedStrided,
    indices: OwnedStrided,
    index_type: IndexType,
    masks: Option<OwnedStrided>,
}

impl OwnedMesh {
    /// A mesh in two tight arrays: in `Vec`s that are moved in, in shared slices, in statics.
    ///
    /// # Errors
    /// [`Error::TooManyTriangles`].
    ///
    /// ```
    /// use hgrid_core::OwnedMesh;
    /// let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let mesh = OwnedMesh::new(positions, vec![[0, 1, 2]])?;
    /// assert_eq!(mesh.view().triangle_count(), 1);
    /// # Ok::<(), hgrid_core::Error>(())
    /// ```
    pub fn new(
        positions: impl AsRef<[[f32; 3]]> + Send + Sync + 'static,
        indices: impl AsRef<[[u32; 3]]> + Send + Sync + 'static,
    ) -> Result<Self, Error> {
        let (positions, indices) = (OwnedStrided::new(positions), OwnedStrided::new(indices));
        Self::strided(positions, indices, IndexType::U32)
    }

    /// A mesh inside structs: vertices and triangles at any byte stride.
    ///
    /// # Errors
    /// The errors of [`TriangleMesh::strided`].
    pub fn strided(
        positions: OwnedStrided,
        indices: OwnedStrided,
        index_type: IndexType,
    ) -> Result<Self, Error> {
        let mesh = Self { positions, indices, index_type, masks: None };
        mesh.try_view()?;
        Ok(mesh)
    }

    /// The same mesh with a mask for each triangle, a `u32`.
    ///
    /// # Errors
    /// The errors of [`TriangleMesh::with_masks`].
    pub fn with_masks(self, masks: OwnedStrided) -> Result<Self, Error> {
        let mesh = Self { masks: Some(masks), ..self };
        mesh.try_view()?;
        Ok(mesh)
    }

    /// The mesh that builds and queries read. O(1).
    ///
    /// It is empty if the lengths of the containers have changed and do not fit together any more.
    #[must_use]
    pub fn view(&self) -> TriangleMesh<'_> {
        self.try_view().unwrap_or(TriangleMesh::EMPTY)
    }

    fn try_view(&self) -> Result<TriangleMesh<'_>, Error> {
        let (positions, indices) = (self.positions.view(), self.indices.view());
        let mesh = TriangleMesh::strided(positions, indices, self.index_type)?;
        self.masks.as_ref().map_or(Ok(mesh), |masks| mesh.with_masks(masks.view()))
    }
}

impl fmt::Debug for OwnedMesh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.view().describe(f.debug_struct("OwnedMesh"))
    }
}

/// A region on the heap.
struct HeapRegion {
    bytes: Vec<u8>,
    length: usize,
}

impl HeapRegion {
    /// Zeros, or an error where there is no memory.
    fn new(length: usize, region: Region) -> Result<Self, Error> {
        let missing =
            Error::OutOfMemory { region, needed_bytes: length as u64, available_bytes: 0 };
        let room = length.checked_add(ALIGNMENT - 1).ok_or(missing)?;
        Ok(Self { bytes: u8::new_vec_zeroed(room).map_err(|_| missing)?, length })
    }

    /// Bytes before the first multiple of [`ALIGNMENT`].
    fn start(&self) -> usize {
        self.bytes.as_ptr().addr().wrapping_neg() % ALIGNMENT
    }

    fn bytes(&self) -> &[u8] {
        self.bytes.get(self.start()..).and_then(|rest| rest.get(..self.length)).unwrap_or_default()
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        let start = self.start();
        self.bytes.get_mut(start..).and_then(|rest| rest.get_mut(..self.length)).unwrap_or_default()
    }

    /// Gives back all but the first `length` bytes.
    fn shrink(&mut self, length: usize) {
        let before = self.start();
        self.length = length.min(self.length);
        self.bytes.truncate(self.length.saturating_add(ALIGNMENT - 1));
        self.bytes.shrink_to_fit();
        // The allocator may move the bytes to an address with another offset from the alignment.
        let start = self.start();
        if start != before {
            self.bytes.copy_within(before..before + self.length, start);
        }
    }
}

/// A grid with its memory and its mesh: `'static`, `Send` and `Sync`, for a field of a struct.
///
/// [`grid`](Self::grid) gives the view that queries run on.
///
/// ```
/// use hgrid_core::{Config, OwnedGrid, OwnedMesh, Ray};
///
/// struct Scene {
///     grid: OwnedGrid,
/// }
///
/// let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mesh = OwnedMesh::new(positions, vec![[0, 1, 2]])?;
/// let scene = Scene { grid: OwnedGrid::build(mesh, &Config::default())? };
///
/// // Open the view once for many rays, not once for each.
/// let grid = scene.grid.grid();
/// assert!(grid.occluded(&Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0])));
/// # Ok::<(), hgrid_core::Error>(())
/// ```
pub struct OwnedGrid {
    mesh: OwnedMesh,
    index: HeapRegion,
}

impl OwnedGrid {
    /// Builds a grid in memory of the global allocator, and keeps as much of it as the grid takes.
    ///
    /// # Errors
    /// The errors of [`Grid::build`]; [`Error::OutOfMemory`] with 0 bytes available if the allocator has none.
    pub fn build(mesh: OwnedMesh, config: &Config) -> Result<Self, Error> {
        Self::build_with(mesh, config, &Control::SERIAL)
    }

    /// Builds a grid on the caller's threads: [`build`](Self::build), and bit by bit the same grid.
    ///
    /// # Errors
    /// The errors of [`build`](Self::build) and of [`Grid::build_with`].
    pub fn build_with(
        mesh: OwnedMesh,
        config: &Config,
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        let view = mesh.try_view()?;
        let mut sizes = sizes_with(&view, config, &mut [], control)?;
        let mut scratch = HeapRegion::new(sizes.scratch_bytes, Region::Scratch)?;
        // A tree's bound is about twice what it takes, and only what it takes is touched. The bounds of other
        // methods may exceed the memory: compute the exact size.
        if config.method() != Method::Bvh {
            sizes = sizes_with(&view, config, scratch.bytes_mut(), control)?;
        }
        let mut index = HeapRegion::new(sizes.index_bytes, Region::Index)?;
        let (to, scratch_bytes) = (index.bytes_mut(), scratch.bytes_mut());
        let bytes = Grid::build_with(view, config, to, scratch_bytes, control)?.blob_bytes();
        drop(scratch);
        index.shrink(bytes);
        Ok(Self { mesh, index })
    }

    /// Opens a copy of a grid that was built earlier or elsewhere: bytes at any address.
    ///
    /// # Errors
    /// The errors of [`Grid::open`]; [`Error::OutOfMemory`] as of [`build`](Self::build).
    pub fn open(blob: &[u8], mesh: OwnedMesh) -> Result<Self, Error> {
        let mut index = HeapRegion::new(blob.len(), Region::Index)?;
        index.bytes_mut().copy_from_slice(blob);
        let bytes = Grid::open(index.bytes(), mesh.try_view()?)?.blob_bytes();
        index.shrink(bytes);
        Ok(Self { mesh, index })
    }

    /// The view that queries run on. O(1), but more than a short query: take it once for many rays.
    ///
    /// It hits nothing if a container of the mesh has another length than at first. It does not notice other content.
    #[must_use]
    pub fn grid(&self) -> Grid<'_> {
        let grid = self.mesh.try_view().and_then(|mesh| Grid::open(self.index.bytes(), mesh));
        grid.unwrap_or_else(|_| Grid::nothing())
    }

    /// The mesh.
    #[must_use]
    pub const fn mesh(&self) -> &OwnedMesh {
        &self.mesh
    }

    /// Gives a tree the boxes of a mesh whose vertices moved, and takes that mesh: see [`refit`](crate::refit()).
    ///
    /// # Errors
    /// The errors of [`refit`](crate::refit()). After an error grid and mesh are as they were.
    pub fn refit(&mut self, mesh: OwnedMesh) -> Result<Refit, Error> {
        let refitted = refit(self.index.bytes_mut(), &mesh.try_view()?)?;
        self.mesh = mesh;
        Ok(refitted)
    }
}

impl fmt::Debug for OwnedGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.grid().describe(f.debug_struct("OwnedGrid"))
    }
}

const fn is_for_threads<T: Send + Sync + 'static>() {}
const _: () = is_for_threads::<OwnedGrid>();
