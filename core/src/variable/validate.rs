//! Proof that a foreign blob is a variable grid of its mesh.
//!
//! The same count as for one level, over the cells of the top and of the subgrids: every listed triangle covers the
//! cell that lists it and none is listed twice, so there are as many of them as the triangles have cells if and only if
//! none is missing. Only lists that a cell names are counted. A table may hold further lists, which no query reads.
//!
//! The words of all cells together are the words of the pool, and those of a subgrid's lists the words behind its
//! table. Queries rely on that: a query stops once it was shown more words than the pool has, so that it ends on
//! damaged bytes.
//!
//! A subgrid has the frame and the resolution that a build gives to the primitives in it, and separates them well
//! enough. It would take memory to prove that a list is long because nothing would separate its primitives, so a list
//! may have any length. No answer depends on it: a query reads a list from its start to its end, however long it is.

use super::subgrid::Subgrid;
use super::{CellContent, Variable};
use crate::aabb::Aabb;
use crate::bits::{WORD_BITS, extent};
use crate::blob::{Header, corrupt};
use crate::bump::GRID;
use crate::cell::{CellRange, Lattice};
use crate::error::Error;
use crate::lists::{ascends, pairs};
use crate::mesh::TriangleMesh;
use crate::one_level::{check_header, is_list_of, slots_are_sound};
use crate::survey::{boxes, reference_limit};

impl Variable<'_> {
    /// Proves that this is what a build makes of the mesh.
    pub(crate) fn validate(
        &self,
        header: &Header,
        lattice: &Lattice,
        blob: &[u8],
        mesh: &TriangleMesh<'_>,
    ) -> Result<(), Error> {
        check_header(header, lattice, mesh)?;
        self.check_table(header, lattice, blob)?;
        let at = |words: &[u32]| corrupt(words.as_ptr().addr() - blob.as_ptr().addr());

        // Every list ascends, and its triangles cover its cell.
        let (mut listed, mut words_of_cells) = (0_u64, 0_u64);
        for cell in CellRange::all(lattice.resolution).cells() {
            match self.content(cell) {
                None if self.top.is_marked(cell) => return Err(at(self.top.sections.references)),
                None => {}
                Some(CellContent::List(ids)) => {
                    if ids.is_empty() || !is_list_of(ids, cell, lattice, mesh) {
                        return Err(at(ids));
                    }
                    listed += ids.len() as u64;
                    words_of_cells += ids.len() as u64;
                }
                Some(CellContent::Subgrid(words)) => {
                    let grid = Subgrid::open(words).ok_or(at(words))?;
                    let inside = Inside { grid, cell, lattice, mesh };
                    let in_cells = inside.listed().ok_or(at(words))?;
                    if in_cells != grid.reference_count() as u64 || !inside.is_built(header) {
                        return Err(at(words));
                    }
                    listed += in_cells;
                    words_of_cells += words.len() as u64;
                }
            }
        }
        if words_of_cells != u64::from(header.reference_count) {
            return Err(at(self.top.sections.references));
        }

        // There are as many as there must be.
        let mut expected = 0_u64;
        for (_, bounds) in boxes(mesh) {
            for cell in lattice.range(&bounds).cells() {
                match self.content(cell) {
                    Some(CellContent::Subgrid(words)) => {
                        let grid = Subgrid::open(words).ok_or(at(words))?;
                        expected += grid.frame.range(cell, &lattice.reach(&bounds)).count();
                    }
                    _ => expected += 1,
                }
            }
        }
        if listed == expected { Ok(()) } else { Err(at(self.top.sections.references)) }
    }

    /// Proves that the table of the top cuts the pool into parts, as displaced rows leave it.
    fn check_table(&self, header: &Header, lattice: &Lattice, blob: &[u8]) -> Result<(), Error> {
        let at = |section: usize, byte: usize| corrupt(section - blob.as_ptr().addr() + byte);
        let hash = self.top.sections.hash;
        let at_slot = |slot: usize| at(hash.as_ptr().addr(), slot * size_of::<u32>());
        let place = |word: u32| word & !GRID;
        if hash.first().is_none_or(|&first| place(first) != 0) {
            return Err(at_slot(0));
        }
        for (slot, (start, end)) in pairs(hash).enumerate() {
            let is_nothing = place(start) == place(end);
            if place(start) > place(end) || is_nothing && start & GRID != 0 {
                return Err(at_slot(slot));
            }
        }
        if hash.last() != Some(&header.reference_count) {
            return Err(at_slot(header.hash_count as usize));
        }
        // The table ends with the last part.
        if matches!(hash, [.., start, end] if place(*start) == *end) {
            return Err(corrupt(core::mem::offset_of!(Header, hash_count)));
        }
        let rows = self.top.sections.row_offsets;
        let is_full = pairs(hash).map(|(start, end)| place(start) < place(end));
        let offset = |row: usize| rows.get(row).copied();
        if !slots_are_sound(lattice.resolution, offset, |cell| self.top.is_marked(cell), is_full) {
            return Err(at(rows.as_ptr().addr(), 0));
        }
        // No bit is set behind the last cell.
        let (bits, cells) =
            (self.top.sections.domain_bits, rows.len() * lattice.resolution[0] as usize);
        match extent(bits, cells, WORD_BITS) {
            Some((first, _)) => Err(at(bits.as_ptr().addr(), (cells + first) / 8)),
            None => Ok(()),
        }
    }
}

/// A subgrid and the cell that holds it.
struct Inside<'a> {
    grid: Subgrid<'a>,
    cell: [u32; 3],
    lattice: &'a Lattice,
    mesh: &'a TriangleMesh<'a>,
}

impl Inside<'_> {
    /// The lists, each with its cell in the subgrid.
    fn lists(&self) -> impl Iterator<Item = ([u32; 3], &[u32])> {
        let all = CellRange::all(self.grid.frame.resolution);
        all.cells().filter_map(|sub| Some((sub, self.grid.references(sub)?)))
    }

    /// The cells of the top that a triangle covers, and its reach.
    fn reach(&self, id: u32) -> Option<(CellRange, Aabb)> {
        let bounds = self.mesh.corners(id).and_then(Aabb::of)?;
        Some((self.lattice.range(&bounds), self.lattice.reach(&bounds)))
    }

    /// Returns the reaches of the triangles in it, each once: in the list of the first cell that it covers.
    fn reaches(&self) -> impl Iterator<Item = Aabb> {
        self.lists().flat_map(|(sub, ids)| ids.iter().map(move |&id| (sub, id))).filter_map(
            |(sub, id)| {
                let (_, reach) = self.reach(id)?;
                (self.grid.frame.range(self.cell, &reach).min == sub).then_some(reach)
            },
        )
    }

    /// The ids in the lists of all cells; `None` unless every list ascends and its triangles cover its cell.
    fn listed(&self) -> Option<u64> {
        let mut listed = 0;
        let are_right = self.lists().all(|(sub, ids)| {
            listed += ids.len() as u64;
            let covers = |&id: &u32| {
                self.reach(id).is_some_and(|(range, reach)| {
                    range.contains(self.cell)
                        && self.grid.frame.range(self.cell, &reach).contains(sub)
                })
            };
            !ids.is_empty() && ascends(ids) && ids.iter().all(covers)
        });
        are_right.then_some(listed)
    }

    /// Returns true if a build makes this subgrid of the triangles in it.
    fn is_built(&self, header: &Header) -> bool {
        let (mut count, mut all) = (0_u32, Aabb::EMPTY);
        for reach in self.reaches() {
            all = all.union(&reach);
            count = count.saturating_add(1);
        }
        let references = self.grid.reference_count() as u64;
        // It separates them.
        let separates = 4 * references <= 3 * u64::from(count) * u64::from(self.grid.list_count());
        self.grid.is_sound()
            && count > header.subdivide_above
            && self.grid.frame.is_around(&all, self.cell)
            && references <= u64::from(reference_limit(count))
            && separates
            && self.is_settled(header.density, count)
    }

    /// Returns true if it is the finest of the grids that have not too many references.
    fn is_settled(&self, density: f32, count: u32) -> bool {
        let mut density = f64::from(density);
        let mut frame = self.grid.frame;
        loop {
            let is_refined = frame.refine(self.lattice.cell_size(), density, count);
            density *= 0.5;
            if !is_refined {
                continue;
            }
            if frame.resolution == self.grid.frame.resolution {
                return true;
            }
            let references: u64 =
                self.reaches().map(|reach| frame.range(self.cell, &reach).count()).sum();
            if references <= u64::from(reference_limit(count)) {
                return false;
            }
        }
    }
}
