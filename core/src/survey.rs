//! The first pass over a mesh: checks its indices, counts its finite triangles and finds their box.

use glam::Vec3A;

use crate::aabb::Aabb;
use crate::config::BuildFlags;
use crate::control::Watch;
use crate::error::Error;
use crate::mesh::TriangleMesh;

/// The share of the survey in the progress of a build, about.
const SHARE: [f32; 2] = [0.0, 0.15];

/// The results of one pass over the triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Survey {
    /// The box around all finite triangles; unreferenced vertices do not stretch it.
    pub(crate) bounds: Aabb,
    /// Triangles that go into the grid.
    pub(crate) finite_count: u32,
    /// Triangles left out because a coordinate is not finite.
    pub(crate) skipped_count: u32,
}

impl Survey {
    /// Looks at every triangle once: O(n), no memory.
    pub(crate) fn of(
        mesh: &TriangleMesh<'_>,
        flags: BuildFlags,
        watch: &Watch<'_>,
    ) -> Result<Self, Error> {
        let mut survey = Self { bounds: Aabb::EMPTY, finite_count: 0, skipped_count: 0 };
        let count = mesh.triangle_count();
        for piece in mesh.pieces(0..count) {
            for (id, corners) in piece.each() {
                watch.step(id, count, SHARE)?;
                match finite_box(id, corners, flags)? {
                    Some(bounds) => survey.bounds = survey.bounds.union(&bounds),
                    None => survey.skipped_count += 1,
                }
            }
        }
        survey.finite_count = mesh.triangle_count() - survey.skipped_count;
        Ok(survey)
    }
}

/// The box of a triangle with these corners; `None` if a build with these flags leaves it out, because a coordinate is
/// not finite. An error for a corner without a vertex, and with `STRICT` for one that is not finite.
#[inline(always)]
pub(crate) fn finite_box(
    triangle: u32,
    corners: Option<[Vec3A; 3]>,
    flags: BuildFlags,
) -> Result<Option<Aabb>, Error> {
    let Some(corners) = corners else { return Err(Error::IndexOutOfRange { triangle }) };
    match Aabb::of(corners) {
        None if flags.contains(BuildFlags::STRICT) => Err(Error::NonFiniteTriangle { triangle }),
        bounds => Ok(bounds),
    }
}

/// The finite triangles of a mesh with their boxes, in the order of their ids.
#[inline(always)]
pub(crate) fn boxes<'m>(mesh: &'m TriangleMesh<'_>) -> impl Iterator<Item = (u32, Aabb)> + 'm {
    let mut reader = mesh.reader();
    (0..mesh.triangle_count()).filter_map(move |id| Some((id, Aabb::of(reader.corners(id)?)?)))
}

/// The most references a grid of so many triangles may have.
pub(crate) const fn reference_limit(triangles: u32) -> u32 {
    /// Several times what any scan needs, and what a scene of walls and floors needs.
    const PER_TRIANGLE: u32 = 16;
    /// Added so that a handful of triangles gets the few cells that it asks for.
    const AT_LEAST: u32 = 64;
    triangles.saturating_mul(PER_TRIANGLE).saturating_add(AT_LEAST)
}
