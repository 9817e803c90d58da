//! Proof that a foreign blob is a variable grid of its mesh.
//!
//! The same sum as for one level, over the cells of the top and of the subgrids: every listed
//! triangle covers the cell that lists it and none is listed twice, so there are as many of them as
//! the triangles have cells if and only if none is missing. What a triangle has in a subdivided cell
//! are the cells of the subgrid, whose frame must hold all that the triangle reaches there.

use glam::Vec3A;

use super::subgrid::Subgrid;
use super::{Content, Variable};
use crate::aabb::Aabb;
use crate::blob::{Header, corrupt};
use crate::cell::{CellRange, Lattice};
use crate::error::Error;
use crate::mesh::TriangleMesh;
use crate::one_level::check_header;
use crate::survey::boxes;

impl Variable<'_> {
    /// Whether this is a grid of the mesh in which every query answers right.
    pub(crate) fn validate(
        &self,
        header: &Header,
        lattice: &Lattice,
        blob: &[u8],
        mesh: &TriangleMesh<'_>,
    ) -> Result<(), Error> {
        check_header(header, lattice, mesh)?;
        let at = |words: &[u32]| corrupt(words.as_ptr().addr() - blob.as_ptr().addr());
        let reach = |id: u32| {
            let bounds = mesh.corners(id, Vec3A::new).and_then(Aabb::of)?;
            Some((lattice.range(&bounds), lattice.reach(&bounds)))
        };

        // Every list ascends, and its triangles cover its cell.
        let (mut listed, mut claimed) = (0_u64, 0);
        let all = CellRange { min: [0; 3], max: lattice.last() };
        for cell in all.cells() {
            match self.content(cell) {
                None if self.top.is_marked(cell) => return Err(at(self.top.lists())),
                None => {}
                Some(Content::List(words) | Content::Subgrid(words))
                    if claimed + words.len() > self.top.lists().len() =>
                {
                    // Cells that share their words would have them read again and again.
                    return Err(at(words));
                }
                Some(Content::List(ids)) => {
                    claimed += ids.len();
                    let covers = |id| reach(id).is_some_and(|(range, _)| range.contains(cell));
                    if ids.is_empty() || !ascends(ids) || !ids.iter().all(|&id| covers(id)) {
                        return Err(at(ids));
                    }
                    listed += ids.len() as u64;
                }
                Some(Content::Subgrid(words)) => {
                    claimed += words.len();
                    let grid = Subgrid::open(words).ok_or_else(|| at(words))?;
                    let last = grid.frame.resolution.map(|cells| cells - 1);
                    for sub in (CellRange { min: [0; 3], max: last }).cells() {
                        let Some(ids) = grid.references(sub) else { continue };
                        let covers = |id| {
                            reach(id).is_some_and(|(range, reach)| {
                                range.contains(cell) && grid.frame.range(cell, &reach).contains(sub)
                            })
                        };
                        if ids.is_empty() || !ascends(ids) || !ids.iter().all(|&id| covers(id)) {
                            return Err(at(words));
                        }
                        listed += ids.len() as u64;
                    }
                }
            }
        }

        // There are as many as there must be.
        let mut expected = 0_u64;
        for (_, bounds) in boxes(mesh) {
            for cell in lattice.range(&bounds).cells() {
                match self.content(cell) {
                    Some(Content::Subgrid(words)) => {
                        let grid = Subgrid::open(words).ok_or_else(|| at(words))?;
                        let reach = lattice.reach(&bounds);
                        if !grid.frame.holds(&reach, cell) {
                            return Err(at(words));
                        }
                        expected += grid.frame.range(cell, &reach).count();
                    }
                    _ => expected += 1,
                }
            }
        }
        if listed == expected { Ok(()) } else { Err(at(self.top.lists())) }
    }
}

/// Whether every id is larger than the one before it.
fn ascends(ids: &[u32]) -> bool {
    ids.windows(2).all(|ids| matches!(ids, [id, next] if id < next))
}
