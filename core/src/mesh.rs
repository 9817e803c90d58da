//! The caller's triangles, read where they lie: never copied, never changed, never read past.
//!
//! ```text
//! positions: | x y z ...... | x y z ...... | x y z |      indices: | a b c .. | a b c .. | a b c |
//!            '- stride -----'                              '- stride -'
//! ```
//!
//! The last element needs only its own bytes, not its stride. Nothing has to be aligned: every
//! read goes through bytes, which costs nothing on the machines that matter and removes a rule.

use core::fmt;
use core::ops::Range;

use glam::{Vec3A, Vec4};

use crate::aabb::{Aabb, MAX_COORDINATE};
use crate::error::{Error, MeshField};

/// The most triangles a mesh may have: ids are 32 bits and one of them means "none". A tree
/// takes half as many.
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
#[derive(Clone, Copy)]
pub struct Strided<'a> {
    /// The bytes, from the first element's first to at least the last element's last.
    pub bytes: &'a [u8],
    /// Bytes from one element to the next.
    pub stride: usize,
    /// Number of elements.
    pub count: usize,
}

impl fmt::Debug for Strided<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Strided")
            .field("bytes", &self.bytes.len())
            .field("stride", &self.stride)
            .field("count", &self.count)
            .finish()
    }
}

impl<'a> Strided<'a> {
    /// The same elements of `size` bytes without the bytes after the
    /// last of them, if all lie inside.
    pub(crate) fn cut(self, size: usize) -> Option<Self> {
        let Some(last) = self.count.checked_sub(1) else {
            return Some(Self { bytes: &[], ..self });
        };
        let end = last.checked_mul(self.stride)?.checked_add(size)?;
        let bytes = self.bytes.get(..end).filter(|_| self.stride >= size)?;
        Some(Self { bytes, ..self })
    }

    /// The first `N` bytes of element `index`.
    #[inline(always)]
    pub(crate) fn element<const N: usize>(&self, index: usize) -> Option<&'a [u8; N]> {
        if index >= self.count {
            return None;
        }
        self.bytes.get(index * self.stride..)?.first_chunk::<N>()
    }

    /// Elements of `N` bytes from `first` on, if they lie side by side.
    #[inline(always)]
    pub(crate) fn tight<const N: usize>(&self, first: usize, count: usize) -> &'a [[u8; N]] {
        let bytes = self.bytes.get(first.saturating_mul(N)..).unwrap_or_default();
        let elements = if self.stride == N { bytes.as_chunks().0 } else { &[] };
        elements.get(..count).unwrap_or_default()
    }
}

/// A view of the caller's triangle mesh: vertices of three floats, triangles of three indices.
#[derive(Clone, Copy)]
pub struct TriangleMesh<'a> {
    positions: Strided<'a>,
    indices: Strided<'a>,
    index_type: IndexType,
    /// No elements: every triangle has all bits.
    masks: Strided<'a>,
}

impl fmt::Debug for TriangleMesh<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.describe(f.debug_struct("TriangleMesh"))
    }
}

impl<'a> TriangleMesh<'a> {
    /// A mesh of nothing.
    #[cfg(feature = "alloc")]
    pub(crate) const EMPTY: Self = {
        let none = Strided { bytes: &[], stride: 0, count: 0 };
        Self { positions: none, indices: none, index_type: IndexType::U32, masks: none }
    };

    /// Says in one line what it is.
    pub(crate) fn describe(&self, mut to: fmt::DebugStruct<'_, '_>) -> fmt::Result {
        to.field("vertices", &self.vertex_count())
            .field("triangles", &self.triangle_count())
            .field("indices", &self.index_type)
            .field("has_masks", &self.has_masks())
            .finish()
    }

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
        let positions =
            positions.cut(size_of::<[f32; 3]>()).ok_or(Error::InvalidMesh(MeshField::Positions))?;
        let indices = indices
            .cut(index_type.triangle_bytes())
            .ok_or(Error::InvalidMesh(MeshField::Indices))?;
        if indices.count > MAX_TRIANGLES {
            return Err(Error::TooManyTriangles);
        }
        let masks = Strided { bytes: &[], stride: 0, count: 0 };
        Ok(Self { positions, indices, index_type, masks })
    }

    /// The same mesh with a mask for each triangle, a `u32`, which queries that have one look at
    /// ([`QueryOptions::mask`](crate::QueryOptions::mask)). Without
    /// masks every triangle has all bits.
    ///
    /// # Errors
    /// [`Error::InvalidMesh`] if there are not as many masks as triangles, the stride is below four
    /// or the bytes end before the last mask.
    ///
    /// ```
    /// use hgrid_core::{Strided, TriangleMesh};
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?.with_masks(Strided::new(&[5_u32]))?;
    /// assert_eq!(mesh.mask(0), 5);
    /// # Ok::<(), hgrid_core::Error>(())
    /// ```
    pub fn with_masks(self, masks: Strided<'a>) -> Result<Self, Error> {
        let masks = masks.cut(size_of::<u32>()).filter(|masks| masks.count == self.indices.count);
        Ok(Self { masks: masks.ok_or(Error::InvalidMesh(MeshField::Masks))?, ..self })
    }

    /// The mask of a triangle; all bits where there is none.
    #[inline(always)]
    #[must_use]
    pub fn mask(&self, triangle: u32) -> u32 {
        self.masks.element(triangle as usize).map_or(u32::MAX, |bytes| u32::from_ne_bytes(*bytes))
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
        let [a, b, c] = self.vertices_of(triangle)?;
        Some([self.vertex(a)?, self.vertex(b)?, self.vertex(c)?])
    }

    /// The vertices, where the caller has them.
    #[must_use]
    pub const fn positions(&self) -> Strided<'a> {
        self.positions
    }

    /// The triangles, where the caller has them.
    #[must_use]
    pub const fn triangles(&self) -> Strided<'a> {
        self.indices
    }

    /// The width of the vertex indices.
    #[must_use]
    pub const fn index_type(&self) -> IndexType {
        self.index_type
    }

    /// The masks, where the caller has them; none if there are none.
    #[must_use]
    pub const fn masks(&self) -> Strided<'a> {
        self.masks
    }

    /// Whether triangles have masks of their own.
    pub(crate) const fn has_masks(&self) -> bool {
        self.masks.count > 0
    }

    /// The bytes of every vertex.
    pub(crate) fn each_vertex(&self, mut visit: impl FnMut(&[u8; 12])) {
        (0..self.positions.count).filter_map(|at| self.positions.element(at)).for_each(&mut visit);
    }

    /// The vertices of a triangle.
    #[expect(clippy::cast_possible_truncation, reason = "they were 32 bits or less")]
    pub(crate) fn indices(&self, triangle: u32) -> Option<[u32; 3]> {
        Some(self.vertices_of(triangle)?.map(|vertex| vertex as u32))
    }

    /// The first triangle that names a vertex that there is not.
    pub(crate) fn first_without_vertices(&self) -> Option<u32> {
        let count = self.vertex_count();
        let has_all = |id| self.vertices_of(id).is_some_and(|all| all.iter().all(|&at| at < count));
        (0..self.triangle_count()).find(|&id| !has_all(id))
    }

    /// Whether all coordinates of all vertices, used or not, are finite and no larger than
    /// `MAX_COORDINATE`.
    pub(crate) fn is_finite(&self) -> bool {
        let limit = MAX_COORDINATE;
        (0..self.vertex_count())
            .all(|at| self.vertex(at).is_some_and(|xyz| xyz.iter().all(|c| c.abs() <= limit)))
    }

    /// The corners of a triangle as vectors.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: u32) -> Option<[Vec3A; 3]> {
        if let Some([a, b, c]) = self.wide().corners(triangle) {
            return Some([vector(a), vector(b), vector(c)]);
        }
        // Number by number: an array that becomes a vector costs a detour through memory.
        let [a, b, c] = self.vertices_of(triangle)?;
        let read = |vertex| self.vertex(vertex).map(|[x, y, z]| Vec3A::new(x, y, z));
        Some([read(a)?, read(b)?, read(c)?])
    }

    /// The box of some vertices, used or not: of those whose coordinates are finite and no larger
    /// than `MAX_COORDINATE`.
    pub(crate) fn vertex_bounds(&self, vertices: Range<usize>) -> Aabb {
        // Four vertices that lie side by side are three vectors: x y z x | y z x y | z x y z.
        let fours = self.positions.tight::<12>(vertices.start, vertices.len()).as_chunks::<4>().0;
        let mut low = [Vec4::INFINITY; 3];
        let mut high = [Vec4::NEG_INFINITY; 3];
        let mut bounds = Aabb::EMPTY;
        let mut add = |vertex: usize| {
            let limit = Vec3A::splat(MAX_COORDINATE);
            let at = self.vertex(vertex).map(|[x, y, z]| Vec3A::new(x, y, z));
            if let Some(at) = at.filter(|at| at.abs().cmple(limit).all()) {
                bounds.min = bounds.min.min(at);
                bounds.max = bounds.max.max(at);
            }
        };
        let mut first = vertices.start;
        for bytes in fours {
            let [a, b, c] = bytemuck::cast::<_, [[f32; 4]; 3]>(*bytes).map(Vec4::from_array);
            let limit = Vec4::splat(MAX_COORDINATE);
            let is_inside = a.abs().cmple(limit) & b.abs().cmple(limit) & c.abs().cmple(limit);
            if is_inside.all() {
                low = [low[0].min(a), low[1].min(b), low[2].min(c)];
                high = [high[0].max(a), high[1].max(b), high[2].max(c)];
            } else {
                (first..first + 4).for_each(&mut add);
            }
            first += 4;
        }
        (first..vertices.end).for_each(&mut add);
        let axes = |[a, b, c]: [Vec4; 3]| {
            let [a, b, c] = [a, b, c].map(|row| row.to_array());
            let xyz =
                [[a[0], a[1], a[2]], [a[3], b[0], b[1]], [b[2], b[3], c[0]], [c[1], c[2], c[3]]];
            xyz.map(Vec3A::from_array)
        };
        bounds.min = axes(low).into_iter().fold(bounds.min, Vec3A::min);
        bounds.max = axes(high).into_iter().fold(bounds.max, Vec3A::max);
        bounds
    }

    /// This mesh for reading many triangles fast.
    #[inline(always)]
    pub(crate) fn wide(&self) -> WideMesh<'a> {
        let stride = |array: &Strided<'_>| u16::try_from(array.stride);
        match (stride(&self.positions), stride(&self.indices), self.index_type) {
            (Ok(position_stride), Ok(index_stride), IndexType::U32) => WideMesh {
                positions: self.positions.bytes,
                indices: self.indices.bytes,
                position_stride,
                index_stride,
            },
            _ => WideMesh { positions: &[], indices: &[], position_stride: 0, index_stride: 0 },
        }
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

/// A mesh whose vertices are read in pieces of sixteen bytes, which is one load and one check each.
///
/// Strides of 16 bits leave products of an index without overflow, so that the end of the bytes is
/// all there is to check: they end with the last element, so what lies inside is an element.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WideMesh<'a> {
    positions: &'a [u8],
    indices: &'a [u8],
    position_stride: u16,
    index_stride: u16,
}

impl<'a> WideMesh<'a> {
    /// Whether nothing can be read this way.
    pub(crate) const fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The corners of a triangle, each with the four bytes behind it.
    ///
    /// `None` does not mean that there is no such triangle: one with the mesh's last vertex has
    /// nothing behind it, and some layouts are not read this way at all.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: u32) -> Option<[&'a [u8; 16]; 3]> {
        let indices: &[u8; 12] = element(self.indices, self.index_stride, triangle)?;
        self.vertices(self.position_stride, bytemuck::cast(*indices))
    }

    /// Those of four triangles that follow one another, if all of them can be read this way.
    #[inline(always)]
    pub(crate) fn four(&self, first: u32) -> Option<[[&'a [u8; 16]; 3]; 4]> {
        // What most meshes have: one load of indices, and products that the compiler knows.
        if (self.index_stride, self.position_stride) == (12, 12) {
            let indices: &[u8; 48] = element(self.indices, 12, first)?;
            let [a, b, c, d]: [[u32; 3]; 4] = bytemuck::cast(*indices);
            let corners = |vertices| self.vertices(12, vertices);
            return Some([corners(a)?, corners(b)?, corners(c)?, corners(d)?]);
        }
        let corners = |place| self.corners(first.wrapping_add(place));
        Some([corners(0)?, corners(1)?, corners(2)?, corners(3)?])
    }

    /// Vertices, each with the four bytes behind it.
    #[inline(always)]
    fn vertices(&self, stride: u16, [a, b, c]: [u32; 3]) -> Option<[&'a [u8; 16]; 3]> {
        let vertex = |index| element(self.positions, stride, index);
        Some([vertex(a)?, vertex(b)?, vertex(c)?])
    }
}

/// A corner from its bytes and those behind it.
#[inline(always)]
fn vector(bytes: &[u8; 16]) -> Vec3A {
    let row: [f32; 4] = bytemuck::cast(*bytes);
    Vec3A::from_vec4(Vec4::from_array(row))
}

/// `N` bytes from where an element starts, if all of them are there.
#[inline(always)]
fn element<const N: usize>(bytes: &[u8], stride: u16, index: u32) -> Option<&[u8; N]> {
    // Not checked where pointers have 64 bits: the compiler sees that these two cannot overflow.
    let start = (index as usize).checked_mul(usize::from(stride))?;
    let end = start.checked_add(N)?;
    bytes.get(start..end)?.first_chunk()
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::ray::round;

    #[test]
    fn the_box_of_vertices_is_that_of_one_after_the_other() {
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, MAX_COORDINATE.next_up()];
        for count in 0..14_u8 {
            // All are good, or one coordinate of one is not; the extremes are at any of them.
            for bad in 0..=3 * usize::from(count) {
                let mut positions: Vec<[f32; 3]> = (0..count)
                    .map(|at| [7, 5, 11].map(|step| round(f64::from(at * step % 13) - 6.0)))
                    .collect();
                if let Some(number) = positions.as_flattened_mut().get_mut(bad) {
                    *number = odd[bad % 4];
                }
                let is_good = |p: &&[f32; 3]| p.iter().all(|c| c.abs() <= MAX_COORDINATE);
                let expected = positions.iter().filter(is_good).fold(Aabb::EMPTY, |bounds, &p| {
                    let at = Vec3A::from_array(p);
                    bounds.union(&Aabb { min: at, max: at })
                });

                for stride in [12, 16, 20] {
                    let mut bytes = Vec::new();
                    for (at, position) in positions.iter().enumerate() {
                        bytes.resize(at * stride, 0xff);
                        bytes.extend_from_slice(bytemuck::bytes_of(position));
                    }
                    let vertices = Strided { bytes: &bytes, stride, count: positions.len() };
                    let none = Strided { bytes: &[], stride: 12, count: 0 };
                    let mesh = TriangleMesh::strided(vertices, none, IndexType::U32).unwrap();
                    for cut in [0, 3, 6] {
                        let cut = positions.len().min(cut);
                        let [before, behind] = [0..cut, cut..positions.len()];
                        let [before, behind] =
                            [before, behind].map(|part| mesh.vertex_bounds(part));
                        let found = before.union(&behind);
                        assert_eq!(found, expected, "{stride}, {cut} {positions:?}");
                    }
                }
            }
        }
    }
}
