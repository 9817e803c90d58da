//! The caller's triangles, read where they lie: never copied, never changed, never read past.
//!
//! ```text
//! positions: | x y z ...... | x y z ...... | x y z |      indices: | a b c .. | a b c .. | a b c |
//!            '- stride -----'                              '- stride -'
//! ```
//!
//! The last element needs only its own bytes, not its stride. Nothing has to be aligned: every
//! read goes through bytes, which costs nothing on the machines that matter and removes a rule.

use crate::error::{Error, MeshField};

/// The most triangles a mesh may have: ids are 32 bits and one of them means "none".
pub const MAX_TRIANGLES: usize = u32::MAX as usize - 1;

/// Three corners, in scene units.
pub type Triangle = [[f32; 3]; 3];

/// The width of a vertex index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IndexType {
    /// Two bytes.
    U16,
    /// Four bytes.
    U32,
}

impl IndexType {
    /// Bytes of the three indices of a triangle.
    const fn triangle_bytes(self) -> usize {
        match self {
            Self::U16 => 6,
            Self::U32 => 12,
        }
    }
}

/// `count` elements in a slice of bytes, one every `stride` bytes.
#[derive(Debug, Clone, Copy)]
pub struct Strided<'a> {
    /// The bytes, from the first element's first to at least the last element's last.
    pub bytes: &'a [u8],
    /// Bytes from one element to the next.
    pub stride: usize,
    /// Number of elements.
    pub count: usize,
}

impl<'a> Strided<'a> {
    /// Whether all elements of `size` bytes lie inside the bytes.
    fn holds(&self, size: usize) -> bool {
        let Some(last) = self.count.checked_sub(1) else { return true };
        let end = last.checked_mul(self.stride).and_then(|start| start.checked_add(size));
        self.stride >= size && end.is_some_and(|end| end <= self.bytes.len())
    }

    /// The first `N` bytes of element `index`.
    #[inline(always)]
    fn element<const N: usize>(&self, index: usize) -> Option<&'a [u8; N]> {
        if index >= self.count {
            return None;
        }
        self.bytes.get(index * self.stride..)?.first_chunk::<N>()
    }
}

/// A view of the caller's triangle mesh: vertices of three floats, triangles of three indices.
#[derive(Debug, Clone, Copy)]
pub struct TriangleMesh<'a> {
    positions: Strided<'a>,
    indices: Strided<'a>,
    index_type: IndexType,
}

impl<'a> TriangleMesh<'a> {
    /// A mesh in two tight arrays.
    ///
    /// # Errors
    /// [`Error::TooManyTriangles`].
    ///
    /// ```
    /// use hgrid_core::TriangleMesh;
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// assert_eq!(mesh.triangle(0), Some(positions));
    /// # Ok::<(), hgrid_core::Error>(())
    /// ```
    pub fn new(positions: &'a [[f32; 3]], indices: &'a [[u32; 3]]) -> Result<Self, Error> {
        let positions = Strided {
            bytes: bytemuck::cast_slice(positions),
            stride: size_of::<[f32; 3]>(),
            count: positions.len(),
        };
        let indices = Strided {
            bytes: bytemuck::cast_slice(indices),
            stride: size_of::<[u32; 3]>(),
            count: indices.len(),
        };
        Self::strided(positions, indices, IndexType::U32)
    }

    /// A mesh inside the caller's own structs: vertices and triangles at any byte stride.
    ///
    /// # Errors
    /// [`Error::InvalidMesh`] if a stride is below its element (12 bytes a vertex, three indices a
    /// triangle) or an array ends before its last element; [`Error::TooManyTriangles`].
    pub fn strided(
        positions: Strided<'a>,
        indices: Strided<'a>,
        index_type: IndexType,
    ) -> Result<Self, Error> {
        if !positions.holds(size_of::<[f32; 3]>()) {
            return Err(Error::InvalidMesh(MeshField::Positions));
        }
        if !indices.holds(index_type.triangle_bytes()) {
            return Err(Error::InvalidMesh(MeshField::Indices));
        }
        if indices.count > MAX_TRIANGLES {
            return Err(Error::TooManyTriangles);
        }
        Ok(Self { positions, indices, index_type })
    }

    /// Number of triangles.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "at most MAX_TRIANGLES by construction")]
    pub const fn triangle_count(&self) -> u32 {
        self.indices.count as u32
    }

    /// Number of vertices.
    #[must_use]
    pub const fn vertex_count(&self) -> usize {
        self.positions.count
    }

    /// The corners of a triangle, or `None` if the triangle or one of its vertices does not exist.
    #[inline(always)]
    #[must_use]
    pub fn triangle(&self, triangle: u32) -> Option<Triangle> {
        self.corners(triangle, |x, y, z| [x, y, z])
    }

    /// The corners of a triangle as any type: an array that becomes a vector costs a detour
    /// through memory.
    #[inline(always)]
    pub(crate) fn corners<T>(
        &self,
        triangle: u32,
        corner: impl Fn(f32, f32, f32) -> T,
    ) -> Option<[T; 3]> {
        let [a, b, c] = self.vertices_of(triangle)?;
        let read = |vertex| self.vertex(vertex).map(|[x, y, z]| corner(x, y, z));
        Some([read(a)?, read(b)?, read(c)?])
    }

    #[inline(always)]
    fn vertices_of(&self, triangle: u32) -> Option<[usize; 3]> {
        match self.index_type {
            IndexType::U32 => {
                let b = self.indices.element::<12>(triangle as usize)?;
                let index = |at: usize| {
                    u32::from_ne_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]) as usize
                };
                Some([index(0), index(4), index(8)])
            }
            IndexType::U16 => {
                let b = self.indices.element::<6>(triangle as usize)?;
                let index = |at: usize| usize::from(u16::from_ne_bytes([b[at], b[at + 1]]));
                Some([index(0), index(2), index(4)])
            }
        }
    }

    #[inline(always)]
    fn vertex(&self, vertex: usize) -> Option<[f32; 3]> {
        let b = self.positions.element::<12>(vertex)?;
        let coordinate = |at: usize| f32::from_ne_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
        Some([coordinate(0), coordinate(4), coordinate(8)])
    }
}
