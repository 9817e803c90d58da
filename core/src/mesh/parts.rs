//! Several meshes as one: each stays where it is, and triangles are numbered through all of them.
//!
//! ```text
//! parts:      | mesh 0     | mesh 1 | mesh 2  |      each with arrays, strides and index type of its own
//! first:        0            7        7              mesh 1 has no triangles
//! triangles:  | 0 1 2 3 4 5 6       | 7 8 9 10 |     what grids and hits know
//! ```
//!
//! So a grid over parts is the grid over one mesh with the same triangles, bit for bit, and a hit needs no number of
//! a part. Reading triangle `i` takes a binary search for its part. Code that reads many triangles in order goes from
//! [`Piece`] to piece, and code that reads triangles that lie near one another remembers the part of the last one
//! ([`Reader`]).

use core::ops::Range;

use glam::Vec3A;

use super::{Triangle, TriangleMesh, WideMesh};
use crate::error::{Error, MeshField};
use crate::limits::MAX_TRIANGLES;

/// The most parts of a mesh: their number shares a word with two bits in the header of a packed blob.
const MAX_PARTS: usize = u32::MAX as usize >> 2;

/// A mesh among others that are joined ([`TriangleMesh::join`]).
#[derive(Debug, Clone, Copy)]
pub struct MeshPart<'a> {
    mesh: TriangleMesh<'a>,
    /// Triangles of the parts before it.
    first: u32,
}

impl<'a> MeshPart<'a> {
    /// A mesh that has no number yet.
    #[must_use]
    pub const fn new(mesh: TriangleMesh<'a>) -> Self {
        Self { mesh, first: 0 }
    }

    /// The mesh.
    #[must_use]
    pub const fn mesh(&self) -> &TriangleMesh<'a> {
        &self.mesh
    }

    /// The number of its first triangle in the joined mesh.
    #[must_use]
    pub const fn first(&self) -> u32 {
        self.first
    }
}

/// The numbers of triangles and vertices that parts have before the next one.
#[derive(Debug, Default)]
struct Totals {
    triangles: u32,
    vertices: u32,
    has_masks: bool,
}

impl Totals {
    fn add(&mut self, mesh: &TriangleMesh<'_>) -> Result<(), Error> {
        let invalid = Error::InvalidMesh(MeshField::Parts);
        if !mesh.can_be_part() {
            return Err(invalid);
        }
        let triangles = self.triangles.checked_add(mesh.triangle_count());
        self.triangles = triangles
            .filter(|&all| all as usize <= MAX_TRIANGLES)
            .ok_or(Error::TooManyTriangles)?;
        let vertices = u32::try_from(mesh.vertex_count()).ok();
        self.vertices =
            vertices.and_then(|count| self.vertices.checked_add(count)).ok_or(invalid)?;
        self.has_masks |= mesh.has_masks();
        Ok(())
    }
}

impl<'a> TriangleMesh<'a> {
    /// Numbers the triangles of some meshes through all of them, and makes them one mesh.
    ///
    /// A hit of its grid names a triangle by that number, and [`locate`](Self::locate) tells which mesh it is of and
    /// which triangle there. Where several triangles are equally close, the first mesh wins. Each mesh has strides and
    /// an index type of its own, and masks or none. No vertex is copied. One mesh alone is read faster than parts are.
    ///
    /// # Errors
    /// [`Error::TooManyTriangles`] counts all parts. [`Error::InvalidMesh`] with [`MeshField::Parts`]: a part is joined
    /// itself, there are more than 2^30 - 1 parts, or more than 2^32 - 1 vertices in all.
    ///
    /// ```
    /// use hgrid_core::{MeshPart, TriangleMesh};
    /// let low = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let high = low.map(|[x, y, _]| [x, y, 5.0]);
    /// let (low, high) = (TriangleMesh::new(&low, &[[0, 1, 2]])?, TriangleMesh::new(&high, &[[0, 1, 2]])?);
    /// let mut parts = [MeshPart::new(low), MeshPart::new(high)];
    /// let mesh = TriangleMesh::join(&mut parts)?;
    /// assert_eq!(mesh.triangle_count(), 2);
    /// assert_eq!(mesh.locate(1), Some((1, 0)));
    /// # Ok::<(), hgrid_core::Error>(())
    /// ```
    pub fn join(parts: &'a mut [MeshPart<'_>]) -> Result<Self, Error> {
        let mut totals = Totals::default();
        for part in &mut *parts {
            part.first = totals.triangles;
            totals.add(&part.mesh)?;
        }
        Self::joined(parts)
    }

    /// Makes parts that [`join`](Self::join) has numbered one mesh again: all of them, in their order.
    ///
    /// # Errors
    /// The errors of [`join`](Self::join), and [`Error::InvalidMesh`] with [`MeshField::Parts`] if the
    /// numbers are not those that it gives.
    pub fn joined(parts: &'a [MeshPart<'a>]) -> Result<Self, Error> {
        let mut totals = Totals::default();
        for part in parts {
            if part.first != totals.triangles {
                return Err(Error::InvalidMesh(MeshField::Parts));
            }
            totals.add(&part.mesh)?;
        }
        if parts.len() > MAX_PARTS {
            return Err(Error::InvalidMesh(MeshField::Parts));
        }
        Ok(Self::of_parts(parts, totals.triangles, totals.vertices, totals.has_masks))
    }

    /// The part that a triangle lies in, and the triangle's number there; `None` if there is no such triangle.
    ///
    /// A mesh that was not joined is part 0 of itself. A mesh in a packed blob knows the parts that it was
    /// packed from. It takes a binary search.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "no more than MAX_PARTS")]
    pub fn locate(&self, triangle: u32) -> Option<(u32, u32)> {
        if triangle >= self.triangle_count() {
            return None;
        }
        let (part, first) = if let Some((at, part)) = self.place_of(triangle) {
            (at, part.first)
        } else {
            let numbering = self.numbering();
            match numbering.partition_point(|first| u32::from_ne_bytes(*first) <= triangle) {
                0 => (0, 0),
                behind => (behind - 1, u32::from_ne_bytes(*numbering.get(behind - 1)?)),
            }
        };
        Some((part as u32, triangle.checked_sub(first)?))
    }

    /// Finds the part that a triangle lies in, with its number, of a mesh that has parts.
    fn place_of(&self, triangle: u32) -> Option<(usize, &'a MeshPart<'a>)> {
        let parts = self.parts();
        let at = parts.partition_point(|part| part.first <= triangle).checked_sub(1)?;
        Some((at, parts.get(at)?))
    }

    /// The part that a triangle lies in, of a mesh that has parts.
    #[inline(never)]
    pub(crate) fn part_of(&self, triangle: u32) -> Option<&'a MeshPart<'a>> {
        Some(self.place_of(triangle)?.1)
    }

    /// A triangle of a part.
    #[inline(never)]
    pub(crate) fn triangle_of_part(&self, triangle: u32) -> Option<Triangle> {
        let part = self.part_of(triangle)?;
        part.mesh.own_triangle(triangle - part.first)
    }

    /// The corners of a triangle of a part.
    #[inline(never)]
    pub(crate) fn corners_of_part(&self, triangle: u32) -> Option<[Vec3A; 3]> {
        let part = self.part_of(triangle)?;
        part.mesh.own_corners(triangle - part.first)
    }

    /// The mesh itself, or its parts.
    pub(crate) fn each_mesh(&self) -> impl Iterator<Item = &Self> {
        let parts = self.parts();
        let alone = parts.is_empty().then_some(self);
        alone.into_iter().chain(parts.iter().map(|part| &part.mesh))
    }

    /// Some triangles, mesh by mesh.
    #[inline(always)]
    pub(crate) fn pieces(&self, triangles: Range<u32>) -> impl Iterator<Item = Piece<'_>> {
        let Range { start, end } = triangles;
        let parts = self.parts();
        let piece = move |mesh, first: u32, count: u32| {
            let triangles = start.max(first) - first..(end - first).min(count);
            Piece { mesh, first, triangles }
        };
        let alone = parts.is_empty().then(|| piece(self, 0, self.triangle_count()));
        let before = parts.partition_point(|part| part.first <= start).saturating_sub(1);
        let parts = parts.iter().skip(before).take_while(move |part| part.first < end);
        let others =
            parts.map(move |part| piece(&part.mesh, part.first, part.mesh.triangle_count()));
        alone.into_iter().chain(others).filter(|piece| !piece.triangles.is_empty())
    }

    /// A reader that knows no part yet.
    #[inline(always)]
    pub(crate) const fn reader(&self) -> Reader<'_> {
        Reader { whole: self, mesh: self, first: 0 }
    }

    /// The mesh or the part that has a triangle, to read further triangles from.
    #[inline(never)]
    pub(crate) fn part_around(&self, triangle: u32) -> LastPart<'a> {
        match self.place_of(triangle) {
            Some((_, part)) => LastPart { wide: part.mesh.wide(), first: part.first },
            None => LastPart { wide: self.wide(), first: 0 },
        }
    }
}

/// Triangles of one mesh or part.
#[derive(Debug, Clone)]
pub(crate) struct Piece<'m> {
    pub(crate) mesh: &'m TriangleMesh<'m>,
    /// The number of this mesh's first triangle in the whole.
    pub(crate) first: u32,
    /// The triangles, in this mesh's numbers.
    pub(crate) triangles: Range<u32>,
}

impl<'m> Piece<'m> {
    /// The corners of its triangles, with the numbers that they have in the whole.
    #[inline(always)]
    pub(crate) fn each(self) -> impl Iterator<Item = (u32, Option<[Vec3A; 3]>)> + use<'m> {
        let Self { mesh, first, triangles } = self;
        triangles.map(move |own| (first + own, mesh.own_corners(own)))
    }
}

/// The mesh or the part that was read last.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LastPart<'a> {
    wide: WideMesh<'a>,
    first: u32,
}

impl<'a> LastPart<'a> {
    /// The corners of a triangle, if it lies here and can be read this way.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: u32) -> Option<[&'a [u8; 16]; 3]> {
        self.wide.corners(triangle.wrapping_sub(self.first))
    }

    /// The mesh or part, and the number that a triangle of the whole has there.
    #[inline(always)]
    pub(crate) const fn own(self, triangle: u32) -> (WideMesh<'a>, u32) {
        (self.wide, triangle.wrapping_sub(self.first))
    }
}

/// Reads triangles. Many lie in the same part as the triangle before.
#[derive(Debug)]
pub(crate) struct Reader<'m> {
    whole: &'m TriangleMesh<'m>,
    mesh: &'m TriangleMesh<'m>,
    first: u32,
}

impl Reader<'_> {
    /// The corners of a triangle: [`TriangleMesh::triangle`].
    #[inline(always)]
    pub(crate) fn triangle(&mut self, triangle: u32) -> Option<Triangle> {
        let found = self.mesh.own_triangle(triangle.wrapping_sub(self.first));
        if found.is_some() || !self.turn(triangle) {
            return found;
        }
        self.mesh.own_triangle(triangle.wrapping_sub(self.first))
    }

    /// The corners of a triangle as vectors.
    #[inline(always)]
    pub(crate) fn corners(&mut self, triangle: u32) -> Option<[Vec3A; 3]> {
        let found = self.mesh.own_corners(triangle.wrapping_sub(self.first));
        if found.is_some() || !self.turn(triangle) {
            return found;
        }
        self.mesh.own_corners(triangle.wrapping_sub(self.first))
    }

    /// Turns to the part of a triangle; false if that is the current one.
    #[inline(never)]
    fn turn(&mut self, triangle: u32) -> bool {
        let Some(part) = self.whole.part_of(triangle) else { return false };
        let is_other = !core::ptr::eq(self.mesh, &raw const part.mesh);
        (self.mesh, self.first) = (&part.mesh, part.first);
        is_other
    }
}
