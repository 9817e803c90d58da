//! Proof that a foreign blob is a recursive grid of its mesh in which every query answers right.
//!
//! Grid by grid from the root: each cell's part of the pool starts where the part before it ends, so
//! everything is read once, and a grid's box holds what the triangles reach of the cell around it. Every listed triangle overlaps its cell
//! and the cells around that, and no list has it twice; so there are as many of them as the triangles
//! have cells if and only if none is missing: one sum against another.

use super::build::{Placed, Rule};
use super::node::{Content, Node};
use super::{MAX_DEPTH, Recursive};
use crate::blob::{HEADER_BYTES, Header, corrupt};
use crate::cell::{CellRange, Lattice};
use crate::error::Error;
use crate::mesh::TriangleMesh;

/// A cell and the grid that it is a cell of.
type Place = (Node, [u32; 3]);

/// What a check runs over.
struct Check<'a> {
    pool: &'a [u32],
    mesh: &'a TriangleMesh<'a>,
    lattice: &'a Lattice,
}

impl Recursive<'_> {
    /// Whether this is a grid of the mesh in which every query answers right.
    pub(crate) fn validate(
        &self,
        header: &Header,
        lattice: &Lattice,
        mesh: &TriangleMesh<'_>,
    ) -> Result<(), Error> {
        if !(1..=MAX_DEPTH).contains(&header.depth) {
            return Err(corrupt(core::mem::offset_of!(Header, depth)));
        }
        let rule = Rule { density: f64::from(header.density), depth: header.depth };
        header.check(lattice, mesh, |size, count| {
            rule.resolution(size.to_array().map(f64::from), count, 0)
        })?;
        let check = Check { pool: self.pool, mesh, lattice };
        let root = Node::open(self.pool, 0).filter(|root| root.resolution == lattice.resolution);
        let root = root.ok_or(corrupt(HEADER_BYTES))?;
        let mut cursor = 0;
        let listed = check.listed(&root, &mut cursor, &mut [None; MAX_DEPTH as usize], 0)?;
        if cursor != self.pool.len() {
            return Err(Check::wrong(cursor));
        }
        let mut expected = 0;
        for id in 0..mesh.triangle_count() {
            if let Some(placed) = Placed::new(mesh, lattice, id) {
                expected += check.expected(&root, &placed, 0)?;
            }
            if expected > listed {
                break;
            }
        }
        if listed == expected { Ok(()) } else { Err(corrupt(HEADER_BYTES)) }
    }
}

impl Check<'_> {
    /// The error for a grid whose words start here.
    fn wrong(at: usize) -> Error {
        corrupt(HEADER_BYTES + at * size_of::<u32>())
    }

    /// How many ids the lists below a grid hold, all of them rightly. `cursor` goes from where the
    /// grid's words start to where they end.
    fn listed(
        &self,
        node: &Node,
        cursor: &mut usize,
        places: &mut [Option<Place>; MAX_DEPTH as usize],
        depth: usize,
    ) -> Result<u64, Error> {
        let at = *cursor;
        *cursor = node.contents();
        let mut listed = 0;
        let all = CellRange { min: [0; 3], max: node.resolution.map(|cells| cells - 1) };
        for (number, cell) in all.cells().enumerate() {
            if node.start(self.pool, number) != Some(*cursor) {
                return Err(Self::wrong(at));
            }
            let place = places.get_mut(depth).ok_or_else(|| Self::wrong(at))?;
            *place = Some((*node, cell));
            match node.content(self.pool, cell) {
                None => {}
                Some(Content::List(ids)) => {
                    let ascends = ids.windows(2).all(|ids| matches!(ids, [a, b] if a < b));
                    let here = places.get(..=depth).unwrap_or_default();
                    if !ascends || !ids.iter().all(|&id| self.overlaps(id, here)) {
                        return Err(Self::wrong(at));
                    }
                    listed += ids.len() as u64;
                    *cursor += ids.len();
                }
                Some(Content::Grid(inner)) => {
                    let inner = Node::open(self.pool, inner).ok_or_else(|| Self::wrong(at))?;
                    listed += self.listed(&inner, cursor, places, depth + 1)?;
                }
            }
        }
        if node.start(self.pool, node.cells()) != Some(*cursor) {
            return Err(Self::wrong(at));
        }
        Ok(listed)
    }

    /// Whether a triangle overlaps all of these cells.
    fn overlaps(&self, id: u32, places: &[Option<Place>]) -> bool {
        let Some(placed) = Placed::new(self.mesh, self.lattice, id) else { return false };
        places.iter().flatten().all(|(node, cell)| {
            let mut is_there = false;
            placed.each_cell(node, |_, other| is_there |= other == *cell);
            is_there
        })
    }

    /// How many lists below a grid must have a triangle.
    fn expected(&self, node: &Node, placed: &Placed, depth: u32) -> Result<u64, Error> {
        let mut result = Ok(0);
        placed.each_cell(node, |_, cell| {
            let count = match node.content(self.pool, cell) {
                Some(Content::Grid(at)) if depth + 1 < MAX_DEPTH => {
                    let inner = Node::open(self.pool, at);
                    let inner = inner.filter(|inner| self.holds(inner, node, cell, placed));
                    inner
                        .ok_or_else(|| Self::wrong(at))
                        .and_then(|inner| self.expected(&inner, placed, depth + 1))
                }
                _ => Ok(1),
            };
            result = result.and_then(|sum| Ok(sum + count?));
        });
        result
    }

    /// Whether a grid's box holds what a triangle reaches of the cell around it, but for rounding.
    fn holds(&self, inner: &Node, outer: &Node, cell: [u32; 3], placed: &Placed) -> bool {
        let (around, within) = (outer.cell_box(cell), inner.bounds());
        let slack = self.lattice.margin() * 0.25;
        let low = placed.reach.min.max(around.min).min(around.max);
        let high = placed.reach.max.min(around.max).max(around.min);
        (within.min.cmple(low + slack) & within.max.cmpge(high - slack)).all()
    }
}
