//! Proof that a foreign blob is a recursive grid of its mesh.
//!
//! Grid by grid from the root: each cell's part of the pool starts where the part before it ends, so everything is
//! read once. Every listed triangle overlaps its cell and the cells around that, and no list has it twice; so there
//! are as many of them as the triangles have cells if and only if none is missing: one sum against another. A grid in
//! a cell has the box and the resolution that a build gives to the triangles in it, and separates them well enough.
//!
//! It would take memory to prove that a list is long because no grid would separate its triangles. So a list may have
//! any length, which changes no answer.

use super::build::{Fineness, PlacedTriangle, inside};
use super::node::{GridNode, HEAD_WORDS, NestedCell};
use super::{FEW, Recursive};
use crate::aabb::Aabb;
use crate::blob::{HEADER_BYTES, Header, corrupt};
use crate::cell::{CellRange, Lattice};
use crate::error::Error;
use crate::limits::MAX_DEPTH;
use crate::lists::ascends;
use crate::mesh::TriangleMesh;
use crate::survey::reference_limit;

/// A cell and the grid that it is a cell of.
type CellOfGrid = (GridNode, [u32; 3]);

const LEVELS: usize = MAX_DEPTH as usize;

/// The state of a check.
struct ListChecks<'a> {
    pool: &'a [u32],
    mesh: &'a TriangleMesh<'a>,
    lattice: &'a Lattice,
    rule: Fineness,
    /// Place in the pool at which its next part must start.
    cursor: usize,
    /// The cells around the list that is read, from the root on.
    places: [Option<CellOfGrid>; LEVELS],
    /// For each of them the triangles in its grid.
    contents: [Contents; LEVELS],
    /// Ids in all lists.
    listed: u64,
}

/// The triangles in a grid.
#[derive(Debug, Clone, Copy)]
struct Contents {
    /// Number of triangles; 0 for the root, where no check reads it.
    count: u32,
    /// Triangles of each of its cells, added up.
    references: u64,
    /// Number of cells that have any.
    lists: u64,
    reach: Aabb,
}

impl Contents {
    const NONE: Self = Self { count: 0, references: 0, lists: 0, reach: Aabb::EMPTY };
}

impl Recursive<'_> {
    /// Proves that this is what a build makes of the mesh.
    pub(crate) fn validate(
        &self,
        header: &Header,
        lattice: &Lattice,
        _: &[u8],
        mesh: &TriangleMesh<'_>,
    ) -> Result<(), Error> {
        if !(1..=MAX_DEPTH).contains(&header.depth) {
            return Err(corrupt(core::mem::offset_of!(Header, depth)));
        }
        if header.hash_count != 0 {
            return Err(corrupt(core::mem::offset_of!(Header, hash_count)));
        }
        let rule = Fineness { density: f64::from(header.density), depth: header.depth };
        header.check(lattice, mesh, |size, count| {
            rule.resolution(size.to_array().map(f64::from), count, 0)
        })?;
        let mut check = ListChecks {
            pool: self.pool,
            mesh,
            lattice,
            rule,
            cursor: 0,
            places: [None; LEVELS],
            contents: [Contents::NONE; LEVELS],
            listed: 0,
        };
        let root = GridNode::root(lattice.resolution);
        if !check.has_head(0, &root) || GridNode::open(self.pool, 0) != Some(root) {
            return Err(corrupt(HEADER_BYTES));
        }
        check.grid(&root, 0)?;
        if check.cursor != self.pool.len() {
            return Err(ListChecks::wrong(check.cursor));
        }
        let mut expected = 0;
        for id in 0..mesh.triangle_count() {
            if let Some(placed) = PlacedTriangle::new(mesh, lattice, id) {
                expected += check.expected(&root, &placed, 0);
            }
            if expected > check.listed {
                break;
            }
        }
        if check.listed == expected { Ok(()) } else { Err(corrupt(HEADER_BYTES)) }
    }
}

impl ListChecks<'_> {
    /// The error for a grid whose words start here.
    fn wrong(at: usize) -> Error {
        corrupt(HEADER_BYTES + at * size_of::<u32>())
    }

    /// Checks a grid that starts at the cursor, and what is in it, and moves the cursor behind it.
    fn grid(&mut self, node: &GridNode, depth: usize) -> Result<(), Error> {
        let at = self.cursor;
        let wrong = Self::wrong(at);
        *self.contents.get_mut(depth).ok_or(wrong)? = Contents::NONE;
        self.cursor = node.contents();
        let all = CellRange::all(node.resolution);
        for (number, cell) in all.cells().enumerate() {
            if node.start(self.pool, number) != Some(self.cursor) {
                return Err(wrong);
            }
            *self.places.get_mut(depth).ok_or(wrong)? = Some((*node, cell));
            let references = match node.content(self.pool, cell) {
                None => 0,
                Some(NestedCell::List(ids)) => {
                    if !ascends(ids) || !ids.iter().all(|&id| self.count(id, depth)) {
                        return Err(wrong);
                    }
                    self.listed += ids.len() as u64;
                    self.cursor += ids.len();
                    ids.len() as u64
                }
                Some(NestedCell::Grid(inner)) => {
                    let inner = GridNode::open(self.pool, inner).ok_or(wrong)?;
                    let start = self.cursor;
                    self.grid(&inner, depth + 1)?;
                    let contents = self.contents.get(depth + 1).ok_or(wrong)?;
                    let bounds = inside(self.lattice, node, cell, &contents.reach);
                    let built = GridNode::new(start, bounds.min, bounds.max, inner.resolution);
                    let is_built = self.is_built(&inner, &bounds, depth + 1, contents);
                    if !self.has_head(start, &built) || !is_built {
                        return Err(Self::wrong(start));
                    }
                    u64::from(contents.count)
                }
            };
            let contents = self.contents.get_mut(depth).ok_or(wrong)?;
            contents.references += references;
            contents.lists += u64::from(references > 0);
        }
        // The last entry is the end, without the bit of a grid.
        let end = self.pool.get(at + HEAD_WORDS + node.cells());
        if end.is_none_or(|&end| end as usize != self.cursor) {
            return Err(wrong);
        }
        Ok(())
    }

    /// Returns true if a triangle overlaps all of the cells around a list, down to a depth. Counts it in
    /// each of their grids where this is the first list that has it.
    fn count(&mut self, id: u32, depth: usize) -> bool {
        let Some(placed) = PlacedTriangle::new(self.mesh, self.lattice, id) else { return false };
        let mut is_first = true;
        let grids = self.places.iter().zip(&mut self.contents).take(depth + 1);
        for (level, (place, contents)) in grids.enumerate().rev() {
            let Some((node, cell)) = place else { return false };
            if !placed.is_in(node, *cell) {
                return false;
            }
            // No check reads the number of triangles in the root, and there the first cell may be far from this one.
            is_first = is_first && level > 0 && placed.first(node) == *cell;
            contents.count += u32::from(is_first);
            contents.reach = contents.reach.union(&placed.reach);
        }
        true
    }

    /// Returns true if the words of a grid start as its build writes them.
    fn has_head(&self, at: usize, node: &GridNode) -> bool {
        self.pool.get(at..).and_then(|words| words.first_chunk()) == Some(&node.head())
    }

    /// Returns true if a build puts this grid into this box, for what is in it.
    fn is_built(&self, grid: &GridNode, bounds: &Aabb, depth: usize, contents: &Contents) -> bool {
        let Contents { count, references, lists, .. } = *contents;
        let Ok(level) = u32::try_from(depth) else { return false };
        let is_worth_it = count as usize > FEW
            && level < self.rule.depth
            && 4 * references <= 3 * u64::from(count) * lists;
        if !is_worth_it {
            return false;
        }
        // The grid must be the finest that has not too many references.
        let limit = u64::from(reference_limit(count));
        let tries = core::iter::successors(Some(count), |&n| (n > 0).then_some(n / 2));
        for primitives in tries {
            let tried = self.rule.within(self.lattice, bounds, primitives, level);
            let Some(resolution) = tried else { continue };
            if resolution == grid.resolution {
                return references <= limit || primitives == 0;
            }
            let finer = GridNode::new(0, bounds.min, bounds.max, resolution);
            let mut references = 0;
            let mut around = [None; LEVELS];
            self.each_in(grid, &mut around, 0, &mut |placed| {
                placed.each_cell(&finer, |_, _| references += 1);
            });
            if references <= limit {
                return false;
            }
        }
        false
    }

    /// Shows `visit` the triangles in a grid, each once: in the first list that has it.
    fn each_in(
        &self,
        node: &GridNode,
        around: &mut [Option<CellOfGrid>; LEVELS],
        depth: usize,
        visit: &mut impl FnMut(&PlacedTriangle),
    ) {
        let all = CellRange::all(node.resolution);
        for cell in all.cells() {
            if let Some(place) = around.get_mut(depth) {
                *place = Some((*node, cell));
            }
            let here = around.get(..=depth).unwrap_or_default();
            match node.content(self.pool, cell) {
                None => {}
                Some(NestedCell::List(ids)) => {
                    let placed =
                        ids.iter().map(|&id| PlacedTriangle::new(self.mesh, self.lattice, id));
                    for placed in placed.flatten().filter(|placed| is_first(placed, here)) {
                        visit(&placed);
                    }
                }
                Some(NestedCell::Grid(at)) => {
                    if let Some(inner) =
                        GridNode::open(self.pool, at).filter(|_| depth + 1 < LEVELS)
                    {
                        self.each_in(&inner, around, depth + 1, visit);
                    }
                }
            }
        }
    }

    /// Counts the lists below a grid that must have a triangle.
    fn expected(&self, node: &GridNode, placed: &PlacedTriangle, depth: u32) -> u64 {
        let mut sum = 0;
        placed.each_cell(node, |_, cell| {
            sum += match node.content(self.pool, cell) {
                Some(NestedCell::Grid(at)) if depth + 1 < MAX_DEPTH => {
                    GridNode::open(self.pool, at)
                        .map_or(0, |inner| self.expected(&inner, placed, depth + 1))
                }
                _ => 1,
            };
        });
        sum
    }
}

/// Returns true if these cells are the first of their grids that a triangle overlaps.
fn is_first(placed: &PlacedTriangle, places: &[Option<CellOfGrid>]) -> bool {
    places.iter().flatten().all(|(node, cell)| placed.first(node) == *cell)
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;
    use crate::random;

    #[test]
    fn single_cells_are_those_that_the_build_fills() {
        let mut state = 1;
        let bounds = Aabb { min: glam::Vec3A::splat(-1.5), max: glam::Vec3A::splat(1.5) };
        let lattice = Lattice::new(bounds, [7, 5, 6]);
        let node = GridNode::root(lattice.resolution);
        for _ in 0..if cfg!(miri) { 2 } else { 100 } {
            let corners = [(); 3].map(|()| random::point(&mut state).to_array());
            // A large triangle, one without area, a point.
            let [a, b, c] = corners;
            for positions in [[a, b, c], [a, b, b], [c, c, c]] {
                let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]]).unwrap();
                let placed = PlacedTriangle::new(&mesh, &lattice, 0).unwrap();
                let mut shown = Vec::new();
                placed.each_cell(&node, |_, cell| shown.push(cell));
                assert_eq!(placed.first(&node), shown[0]);
                let all = CellRange::all(lattice.resolution).cells();
                assert!(all.filter(|&cell| placed.is_in(&node, cell)).eq(shown));
            }
        }
    }
}
