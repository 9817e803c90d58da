//! The caller's triangles, read where they lie: never copied, never changed, never read past.
//!
//! ```text
//! positions: | x y z ...... | x y z ...... | x y z |      indices: | a b c .. | a b c .. | a b c |
//!            '- stride -----'                              '- stride -'
//! ```
//!
//! The last element needs only its own bytes, not its stride. Nothing has to be aligned: every read goes through
//! bytes, which costs nothing on common processors.

mod parts;
mod strided;
mod wide;

use core::fmt;
use core::ops::Range;

use glam::{Vec3A, Vec4};
use zerocopy::transmute;

use crate::aabb::Aabb;
use crate::error::{Error, MeshField};
use crate::limits::{MAX_COORDINATE, MAX_TRIANGLES};
use crate::method::Content;
use crate::simd::{HAS_VECTORS, inline_unless_small};
pub use parts::MeshPart;
pub(crate) use parts::{LastPart, Piece, Reader};
pub use strided::Strided;
pub(crate) use wide::{WideMesh, vector};

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

/// The way in which the corners of a triangle are found.
#[derive(Debug, Clone, Copy)]
enum IndexLayout<'a> {
    /// By three indices of so many bytes.
    Indexed(IndexType),
    /// By three indices of four bytes, in a mesh that was joined before it was packed: here are the first triangles
    /// of its parts.
    Packed(&'a [[u8; 4]]),
    /// By boxes of six numbers: the corners of a "triangle" are the least corner of its box, the greatest, and the
    /// greatest again. So the code that builds and validates trees of triangles serves boxes, too.
    Boxes(Content),
    /// In the part where the triangle lies.
    Joined(&'a [MeshPart<'a>]),
}

/// Bytes of a box: least x, y, z, greatest x, y, z.
pub(crate) const BOX_BYTES: usize = size_of::<[f32; 6]>();

/// A view of the caller's triangle mesh: vertices of three floats, triangles of three indices.
#[derive(Clone, Copy)]
pub struct TriangleMesh<'a> {
    /// Vertices, or boxes. For parts only their number.
    positions: Strided<'a>,
    /// For boxes and parts only their number.
    indices: Strided<'a>,
    layout: IndexLayout<'a>,
    /// Empty if no triangle has a mask. A joined mesh keeps only their number, and only if a part has masks.
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
        let (none, layout) = (Strided::NONE, IndexLayout::Indexed(IndexType::U32));
        Self { positions: none, indices: none, layout, masks: none }
    };

    /// Writes its fields for `Debug`.
    pub(crate) fn describe(&self, mut to: fmt::DebugStruct<'_, '_>) -> fmt::Result {
        to.field("vertices", &self.vertex_count())
            .field("triangles", &self.triangle_count())
            .field("indices", &self.index_type())
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
        Self::strided(Strided::new(positions), Strided::new(indices), IndexType::U32)
    }

    /// A mesh inside the caller's own structs: vertices and triangles at any byte stride.
    ///
    /// # Errors
    /// [`Error::InvalidMesh`] if a stride is below its element (12 bytes a vertex, three indices a
    /// triangle) or an array ends before its last element; [`Error::TooManyTriangles`].
    ///
    /// ```
    /// use hgrid_core::{Error, IndexType, Strided, TriangleMesh};
    /// // Vertices with a colour behind each position, and indices of 16 bits.
    /// let vertices: [[f32; 6]; 3] = [
    ///     [0.0, 0.0, 0.0, 1.0, 0.5, 0.5],
    ///     [1.0, 0.0, 0.0, 0.5, 1.0, 0.5],
    ///     [0.0, 1.0, 0.0, 0.5, 0.5, 1.0],
    /// ];
    /// let indices: [[u16; 3]; 1] = [[0, 1, 2]];
    /// let mesh =
    ///     TriangleMesh::strided(Strided::new(&vertices), Strided::new(&indices), IndexType::U16)?;
    /// assert_eq!(mesh.triangle(0).map(|triangle| triangle[2]), Some([0.0, 1.0, 0.0]));
    /// # Ok::<(), Error>(())
    /// ```
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
        let layout = IndexLayout::Indexed(index_type);
        Ok(Self { positions, indices, layout, masks: Strided::NONE })
    }

    /// Boxes in place of triangles.
    ///
    /// # Errors
    /// [`Error::InvalidMesh`] and [`Error::TooManyTriangles`] as those of a mesh.
    pub(crate) fn of_boxes(boxes: Strided<'a>, content: Content) -> Result<Self, Error> {
        let positions = boxes.cut(BOX_BYTES).ok_or(Error::InvalidMesh(MeshField::Positions))?;
        if positions.count > MAX_TRIANGLES {
            return Err(Error::TooManyTriangles);
        }
        let indices = Strided { count: positions.count, ..Strided::NONE };
        let layout = IndexLayout::Boxes(content);
        Ok(Self { positions, indices, layout, masks: Strided::NONE })
    }

    /// Parts in place of triangles, with so many triangles and vertices in all.
    pub(crate) const fn of_parts(
        parts: &'a [MeshPart<'a>],
        triangles: u32,
        vertices: u32,
        has_masks: bool,
    ) -> Self {
        let positions = Strided { count: vertices as usize, ..Strided::NONE };
        let indices = Strided { count: triangles as usize, ..Strided::NONE };
        let masks = if has_masks { indices } else { Strided::NONE };
        Self { positions, indices, layout: IndexLayout::Joined(parts), masks }
    }

    /// The same mesh, with indices of four bytes, as one that was packed from parts with these first triangles.
    pub(crate) const fn numbered(self, numbering: &'a [[u8; 4]]) -> Self {
        debug_assert!(matches!(self.layout, IndexLayout::Indexed(IndexType::U32)));
        Self { layout: IndexLayout::Packed(numbering), ..self }
    }

    /// The first triangles of the parts that a packed mesh was made of.
    // For the overlap checks of the C library.
    #[doc(hidden)]
    #[must_use]
    pub const fn numbering(&self) -> &'a [[u8; 4]] {
        match self.layout {
            IndexLayout::Packed(numbering) => numbering,
            IndexLayout::Indexed(_) | IndexLayout::Boxes(_) | IndexLayout::Joined(_) => &[],
        }
    }

    /// Returns true for a mesh with arrays of its own.
    pub(crate) const fn can_be_part(&self) -> bool {
        matches!(self.layout, IndexLayout::Indexed(_) | IndexLayout::Packed(_))
    }

    /// The meshes that were joined ([`join`](Self::join)); none if this one was not.
    #[must_use]
    pub const fn parts(&self) -> &'a [MeshPart<'a>] {
        match self.layout {
            IndexLayout::Joined(parts) => parts,
            IndexLayout::Indexed(_) | IndexLayout::Packed(_) | IndexLayout::Boxes(_) => &[],
        }
    }

    /// Returns the content of blobs that are built over it.
    pub(crate) const fn content(&self) -> Content {
        match self.layout {
            IndexLayout::Indexed(_) | IndexLayout::Packed(_) | IndexLayout::Joined(_) => {
                Content::Triangles
            }
            IndexLayout::Boxes(content) => content,
        }
    }

    /// The six numbers of a box.
    #[inline(always)]
    pub(crate) fn box_bytes(&self, id: u32) -> Option<&'a [u8; BOX_BYTES]> {
        self.positions.element(id as usize)
    }

    /// The same mesh with a mask for each triangle, a `u32`, which queries that have one look at
    /// ([`QueryOptions::mask`](crate::QueryOptions::mask)). Without masks every triangle has all bits.
    ///
    /// # Errors
    /// [`Error::InvalidMesh`] if there are not as many masks as triangles, the stride is below four
    /// or the bytes end before the last mask; and for a joined mesh, whose parts bring their masks.
    ///
    /// ```
    /// use hgrid_core::{Strided, TriangleMesh};
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?.with_masks(Strided::new(&[5_u32]))?;
    /// assert_eq!(mesh.mask(0), 5);
    /// # Ok::<(), hgrid_core::Error>(())
    /// ```
    pub fn with_masks(self, masks: Strided<'a>) -> Result<Self, Error> {
        let is_one_each = |masks: &Strided<'_>| masks.count == self.indices.count;
        let is_joined = matches!(self.layout, IndexLayout::Joined(_));
        let masks = masks.cut(size_of::<u32>()).filter(is_one_each).filter(|_| !is_joined);
        Ok(Self { masks: masks.ok_or(Error::InvalidMesh(MeshField::Masks))?, ..self })
    }

    /// The mask of a triangle; all bits where there is none.
    #[inline(always)]
    #[must_use]
    pub fn mask(&self, triangle: u32) -> u32 {
        if let IndexLayout::Joined(_) = self.layout {
            return self.mask_of_part(triangle);
        }
        self.own_mask(triangle)
    }

    #[inline(always)]
    fn own_mask(&self, triangle: u32) -> u32 {
        self.masks.element(triangle as usize).map_or(u32::MAX, |bytes| u32::from_ne_bytes(*bytes))
    }

    #[inline(never)]
    fn mask_of_part(&self, triangle: u32) -> u32 {
        let part = self.part_of(triangle);
        part.map_or(u32::MAX, |part| part.mesh().own_mask(triangle - part.first()))
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
        match self.layout {
            IndexLayout::Indexed(_) | IndexLayout::Packed(_) | IndexLayout::Joined(_) => {
                self.positions.count
            }
            IndexLayout::Boxes(_) => 2 * self.positions.count,
        }
    }

    /// The corners of a triangle, or `None` if the triangle or one of its vertices does not exist.
    #[inline(always)]
    #[must_use]
    pub fn triangle(&self, triangle: u32) -> Option<Triangle> {
        // A joined mesh has nothing of its own.
        let found = self.own_triangle(triangle);
        if found.is_none() && matches!(self.layout, IndexLayout::Joined(_)) {
            return self.triangle_of_part(triangle);
        }
        found
    }

    /// The corners of a triangle of a mesh that was not joined.
    #[inline(always)]
    pub(crate) fn own_triangle(&self, triangle: u32) -> Option<Triangle> {
        let [a, b, c] = self.vertices_of(triangle)?;
        Some([self.vertex(a)?, self.vertex(b)?, self.vertex(c)?])
    }

    /// The vertices, where the caller has them; none for a joined mesh, whose [`parts`](Self::parts) have them.
    #[must_use]
    pub const fn positions(&self) -> Strided<'a> {
        self.own(self.positions)
    }

    /// The triangles, where the caller has them; none for a joined mesh.
    #[must_use]
    pub const fn triangles(&self) -> Strided<'a> {
        self.own(self.indices)
    }

    /// An array, if there is one.
    const fn own(&self, array: Strided<'a>) -> Strided<'a> {
        if matches!(self.layout, IndexLayout::Joined(_)) { Strided::NONE } else { array }
    }

    /// The width of the vertex indices; of a joined mesh, where each part has its own, four bytes.
    #[must_use]
    pub const fn index_type(&self) -> IndexType {
        match self.layout {
            IndexLayout::Indexed(index_type) => index_type,
            IndexLayout::Packed(_) | IndexLayout::Boxes(_) | IndexLayout::Joined(_) => {
                IndexType::U32
            }
        }
    }

    /// The masks, where the caller has them; no elements without masks, and for a joined mesh.
    #[must_use]
    pub const fn masks(&self) -> Strided<'a> {
        self.own(self.masks)
    }

    /// Returns true if triangles have masks of their own.
    pub(crate) const fn has_masks(&self) -> bool {
        self.masks.count > 0
    }

    /// The bytes of every vertex, the parts' one after the other.
    pub(crate) fn each_vertex(&self, mut visit: impl FnMut(&[u8; 12])) {
        for positions in self.each_mesh().map(|mesh| mesh.positions) {
            (0..positions.count).filter_map(|at| positions.element(at)).for_each(&mut visit);
        }
    }

    /// The vertices of every triangle, numbered as [`each_vertex`](Self::each_vertex) shows them; zeros where
    /// there are none.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "indices and all vertices of parts are 32 bits"
    )]
    pub(crate) fn each_indices(&self, mut visit: impl FnMut([u32; 3])) {
        let mut before = 0_usize;
        for mesh in self.each_mesh() {
            for triangle in 0..mesh.triangle_count() {
                let vertices = mesh.vertices_of(triangle).unwrap_or_default();
                visit(vertices.map(|vertex| before.wrapping_add(vertex) as u32));
            }
            before += mesh.vertex_count();
        }
    }

    /// The first triangle that names a vertex that does not exist.
    pub(crate) fn first_without_vertices(&self) -> Option<u32> {
        self.pieces(0..self.triangle_count()).find_map(|piece| {
            let count = piece.mesh.vertex_count();
            let has_all =
                |id| piece.mesh.vertices_of(id).is_some_and(|all| all.iter().all(|&at| at < count));
            // Skip triangles sixteen at a time, as long as their largest index is a vertex.
            let mut start = piece.triangles.start;
            if matches!(piece.mesh.layout, IndexLayout::Indexed(IndexType::U32)) {
                let tight = piece.mesh.indices.tight::<12>(start as usize, piece.triangles.len());
                for bytes in tight.as_chunks::<16>().0 {
                    let indices: [u32; 48] = transmute!(*bytes);
                    let largest = indices.iter().fold(0, |most, &at| most.max(at));
                    if largest as usize >= count {
                        break;
                    }
                    start += 16;
                }
            }
            Some(piece.first + (start..piece.triangles.end).find(|&id| !has_all(id))?)
        })
    }

    /// Returns true if all coordinates of all vertices, used or not, are finite and no larger than `MAX_COORDINATE`.
    pub(crate) fn is_finite(&self) -> bool {
        // The compiler uses vectors if no branch follows each number.
        let are_finite =
            |numbers: &[f32]| numbers.iter().fold(true, |are, c| are & (c.abs() <= MAX_COORDINATE));
        self.each_mesh().all(|mesh| {
            let count = mesh.vertex_count();
            let tight = mesh.positions.tight::<12>(0, count).as_chunks::<16>().0;
            let are_tight_finite = tight.iter().all(|bytes| {
                let numbers: [f32; 48] = transmute!(*bytes);
                are_finite(&numbers)
            });
            are_tight_finite
                && (tight.len() * 16..count)
                    .all(|at| mesh.vertex(at).is_some_and(|vertex| are_finite(&vertex)))
        })
    }

    /// The corners of a triangle as vectors.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: u32) -> Option<[Vec3A; 3]> {
        let found = self.own_corners(triangle);
        if found.is_none() && matches!(self.layout, IndexLayout::Joined(_)) {
            return self.corners_of_part(triangle);
        }
        found
    }

    inline_unless_small! {
        /// The corners of a triangle of a mesh that was not joined, as vectors.
        pub(crate) fn own_corners(&self, triangle: u32) -> Option<[Vec3A; 3]> {
            if let Some([a, b, c]) = self.wide().corners(triangle) {
                return Some([vector(a), vector(b), vector(c)]);
            }
            // Number by number: an array that becomes a vector costs a detour through memory.
            let [a, b, c] = self.vertices_of(triangle)?;
            let read = |vertex| self.vertex(vertex).map(|[x, y, z]| Vec3A::new(x, y, z));
            Some([read(a)?, read(b)?, read(c)?])
        }
    }

    /// The box of some vertices, used or not: of those whose coordinates are finite and no larger
    /// than `MAX_COORDINATE`.
    pub(crate) fn vertex_bounds(&self, vertices: Range<usize>) -> Aabb {
        let (mut bounds, mut before) = (Aabb::EMPTY, 0);
        for mesh in self.each_mesh() {
            let Range { start, end } = vertices;
            let [start, end] = [start, end].map(|vertex| vertex.saturating_sub(before));
            bounds = bounds.union(&mesh.own_vertex_bounds(start..end.min(mesh.vertex_count())));
            before += mesh.vertex_count();
        }
        bounds
    }

    /// [`vertex_bounds`](Self::vertex_bounds) of a mesh that was not joined.
    fn own_vertex_bounds(&self, vertices: Range<usize>) -> Aabb {
        // Four vertices that lie side by side are three vectors: x y z x | y z x y | z x y z. Without vectors of the
        // machine that would only be more code.
        let tight = self.positions.tight::<12>(vertices.start, vertices.len()).as_chunks::<4>().0;
        let fours = if HAS_VECTORS { tight } else { &[] };
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
            let rows: [[f32; 4]; 3] = transmute!(*bytes);
            let [a, b, c] = rows.map(Vec4::from_array);
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

    #[inline(always)]
    fn vertices_of(&self, triangle: u32) -> Option<[usize; 3]> {
        match self.layout {
            IndexLayout::Indexed(IndexType::U32) | IndexLayout::Packed(_) => {
                let b = self.indices.element::<12>(triangle as usize)?;
                let index = |at: usize| {
                    u32::from_ne_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]) as usize
                };
                Some([index(0), index(4), index(8)])
            }
            IndexLayout::Indexed(IndexType::U16) => {
                let b = self.indices.element::<6>(triangle as usize)?;
                let index = |at: usize| usize::from(u16::from_ne_bytes([b[at], b[at + 1]]));
                Some([index(0), index(2), index(4)])
            }
            IndexLayout::Boxes(_) => {
                let box_at = triangle as usize;
                let greatest = box_at.checked_mul(2)?.checked_add(1)?;
                (box_at < self.positions.count).then_some([greatest - 1, greatest, greatest])
            }
            IndexLayout::Joined(_) => None,
        }
    }

    #[inline(always)]
    fn vertex(&self, vertex: usize) -> Option<[f32; 3]> {
        let b = match self.layout {
            IndexLayout::Indexed(_) | IndexLayout::Packed(_) | IndexLayout::Joined(_) => {
                self.positions.element::<12>(vertex)?
            }
            IndexLayout::Boxes(_) => {
                let corners = self.positions.element::<BOX_BYTES>(vertex / 2)?.as_chunks::<12>().0;
                corners.get(vertex % 2)?
            }
        };
        let coordinate = |at: usize| f32::from_ne_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
        Some([coordinate(0), coordinate(4), coordinate(8)])
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use zerocopy::IntoBytes;

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
                        bytes.extend_from_slice(position.as_bytes());
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
