//! Reads many triangles fast, sixteen bytes a vertex, and boxes, 24 bytes each.
//!
//! ```text
//! x y z and the four bytes behind them, whatever they are: one check and one load a vertex, not three
//! ```
//!
//! The last vertex may have nothing behind it, and 16-bit indices are not read here: such triangles take the
//! reader of mesh/mod.rs.

use glam::{Vec3A, Vec4};
use zerocopy::transmute;

use super::{BOX_BYTES, IndexLayout, IndexType, Strided, TriangleMesh};

/// A mesh whose vertices are read in pieces of sixteen bytes, which is one load and one check each.
///
/// `index * stride` does not overflow 64 bits, because a stride has 16 bits. The bytes end with the last element, so
/// a read that ends inside them reads an element.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WideMesh<'a> {
    positions: &'a [u8],
    indices: &'a [u8],
    position_stride: u16,
    index_stride: u16,
}

impl<'a> WideMesh<'a> {
    /// Returns true if no triangle can be read this way.
    pub(crate) const fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The corners of a triangle, each with the four bytes behind it.
    ///
    /// `None` does not mean that there is no such triangle: one with the mesh's last vertex has
    /// nothing behind it, and some layouts are not read this way at all.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: u32) -> Option<[&'a [u8; 16]; 3]> {
        let indices = self.indices(triangle)?;
        self.vertices(self.position_stride, transmute!(*indices))
    }

    /// The indices of a triangle, as [`corners`](Self::corners) reads them.
    #[inline(always)]
    pub(crate) fn indices(&self, triangle: u32) -> Option<&'a [u8; 12]> {
        element(self.indices, self.index_stride, triangle)
    }

    /// The corners of four triangles that follow one another; `None` if one of them cannot be read this way.
    #[inline(always)]
    pub(crate) fn four(&self, first: u32) -> Option<[[&'a [u8; 16]; 3]; 4]> {
        // Most meshes are tight: load all indices at once, with strides that the compiler knows.
        if (self.index_stride, self.position_stride) == (12, 12) {
            let indices: &[u8; 48] = element(self.indices, 12, first)?;
            let [a, b, c, d]: [[u32; 3]; 4] = transmute!(*indices);
            let corners = |vertices| self.vertices(12, vertices);
            return Some([corners(a)?, corners(b)?, corners(c)?, corners(d)?]);
        }
        let corners = |place| self.corners(first.wrapping_add(place));
        Some([corners(0)?, corners(1)?, corners(2)?, corners(3)?])
    }

    /// The six numbers of a box, for a mesh of boxes. `None` does not mean that there is no such box: one with a large
    /// stride is not read this way.
    #[inline(always)]
    pub(crate) fn sides(&self, id: u32) -> Option<&'a [u8; BOX_BYTES]> {
        element(self.positions, self.position_stride, id)
    }

    /// Vertices, each with the four bytes behind it.
    #[inline(always)]
    fn vertices(&self, stride: u16, [a, b, c]: [u32; 3]) -> Option<[&'a [u8; 16]; 3]> {
        let vertex = |index| element(self.positions, stride, index);
        Some([vertex(a)?, vertex(b)?, vertex(c)?])
    }
}

impl<'a> TriangleMesh<'a> {
    /// This mesh for reading many triangles fast.
    #[inline(always)]
    pub(crate) fn wide(&self) -> WideMesh<'a> {
        let stride = |array: &Strided<'_>| u16::try_from(array.stride);
        match (stride(&self.positions), stride(&self.indices), self.layout) {
            (
                Ok(position_stride),
                Ok(index_stride),
                IndexLayout::Indexed(IndexType::U32)
                | IndexLayout::Packed(_)
                | IndexLayout::Boxes(_),
            ) => WideMesh {
                positions: self.positions.bytes,
                indices: self.indices.bytes,
                position_stride,
                index_stride,
            },
            _ => WideMesh { positions: &[], indices: &[], position_stride: 0, index_stride: 0 },
        }
    }
}

/// A corner from its bytes and those behind it.
#[inline(always)]
pub(crate) fn vector(bytes: &[u8; 16]) -> Vec3A {
    let row: [f32; 4] = transmute!(*bytes);
    Vec3A::from_vec4(Vec4::from_array(row))
}

/// `N` bytes from where an element starts, if all of them are there.
#[inline(always)]
fn element<const N: usize>(bytes: &[u8], stride: u16, index: u32) -> Option<&[u8; N]> {
    // Where pointers have 64 bits the compiler drops both checks.
    let start = (index as usize).checked_mul(usize::from(stride))?;
    let end = start.checked_add(N)?;
    bytes.get(start..end)?.first_chunk()
}
