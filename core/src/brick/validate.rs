//! Proof that a foreign blob is a brick grid of its mesh in which every query answers right.
//!
//! Block by block, each chunk starts where the one before it ended, and all in it lies in the
//! order in which [`sort`](super::sort) writes it: everything is read once and nothing is
//! left over. Every listed triangle belongs where it is listed and is there once; so there
//! are as many of them as the triangles have cells, bricks and blocks if and only if none is
//! missing: one sum against another.
//!
//! In a divided cell, the first of the lists that a triangle has there stands for the triangle in
//! the cell. So if the sum of the blocks is right, every triangle is in its first list in every
//! divided cell. Then it is known what these cells must list, and their sum is right if and only if
//! none is missing; and so on inward. Their own sum would not be proof: one list too few makes up
//! for a triangle whose first is missing.
//!
//! A list has no triangle twice if its ids ascend. They need to do so only among triangles of one
//! shape, as sorting leaves them: a triangle that came twice would have the same shape both times.
//!
//! Whether a build would have divided a crowded cell, and into as many cells, would take memory to
//! prove: any division is a right one. Queries do not mind.

use glam::Vec3A;

use super::extent::{EXTENT_WORDS, Extent, LIST_WORDS, Owner};
use super::frame::{Frame, Scene, classify, lists};
use super::layout::{
    BLOCK, Block, CHILD_WORDS, Class, Layout, MAX_CHILDREN, RECORD_WORDS, mask, place,
};
use super::pass::Home;
use super::quarters::{Format, Quarters};
use super::size::{Settled, settle};
use super::{Brick, Chunk, Content, Large, list};
use crate::aabb::Aabb;
use crate::bits::ones;
use crate::blob::{HEADER_BYTES, Header, corrupt};
use crate::bump::GRID;
use crate::cell::{CellRange, Lattice};
use crate::config::{Config, Method};
use crate::error::Error;
use crate::lists::ascends;
use crate::mesh::TriangleMesh;

impl Brick<'_> {
    /// Whether this is a grid of the mesh in which every query answers right; the error names
    /// a byte that no build writes so.
    pub(crate) fn validate(
        &self,
        header: &Header,
        lattice: &Lattice,
        mesh: &TriangleMesh<'_>,
    ) -> Result<(), Error> {
        // The header says what the mesh says.
        let config = header.config(Config::new(Method::Brick));
        if config.check().is_err() {
            return Err(corrupt(core::mem::offset_of!(Header, cell_size)));
        }
        let settled = settle(mesh, &config)?;
        if header.skipped_count != settled.census.skipped {
            return Err(corrupt(core::mem::offset_of!(Header, skipped_count)));
        }
        if lattice.bounds() != settled.lattice.bounds() {
            return Err(corrupt(core::mem::offset_of!(Header, bounds_min)));
        }
        if lattice.resolution != settled.lattice.resolution {
            return Err(corrupt(core::mem::offset_of!(Header, resolution)));
        }
        if header.hash_count != 0 {
            return Err(corrupt(core::mem::offset_of!(Header, hash_count)));
        }

        // What is listed belongs there, and nothing is missing.
        let mut check = Check {
            grid: self,
            mesh,
            settled: &settled,
            last: [0; SHAPES * SHAPES * SHAPES],
            listed: [0; DOMAINS],
            expected: [0; DOMAINS],
        };
        check.pool()?;
        for id in 0..mesh.triangle_count() {
            check.expected[0] += check.lists_of(id);
            if check.expected[0] > check.listed[0] {
                break;
            }
        }
        if check.listed == check.expected { Ok(()) } else { Err(check.wrong(0)) }
    }
}

/// Shapes of a triangle in a block: one or two cells on each axis, or more on any.
const SHAPES: usize = 9;

/// A block, a cell of it that is divided, and a cell of that.
const DOMAINS: usize = 1 + MAX_CHILDREN;

const _: () = assert!(DOMAINS == 3, "a triangle has a shape in each of three domains");

/// What a check runs over.
struct Check<'a> {
    grid: &'a Brick<'a>,
    mesh: &'a TriangleMesh<'a>,
    settled: &'a Settled,
    /// For each shape the last id of a list, plus 1.
    last: [u32; SHAPES * SHAPES * SHAPES],
    /// Ids in the lists of the grid and of blocks so far, of their divided cells, and of
    /// the divided cells of these. What is in its first list in a divided cell is one of
    /// those that the cell around lists.
    listed: [u64; DOMAINS],
    /// How many there must be: by the mesh, and in divided cells by
    /// what is in its first list there.
    expected: [u64; DOMAINS],
}

/// A block, or a cell that is divided like one.
struct Domain<'d> {
    frame: Frame,
    /// How many domains are around it.
    depth: usize,
    within: Within<'d>,
}

/// Where a domain lies.
enum Within<'d> {
    /// It is this block.
    Lattice([u32; 3]),
    /// It is this cell of that domain.
    Domain(&'d Domain<'d>, [u32; 3]),
}

/// A triangle in a domain.
struct Placed {
    range: CellRange,
    quarters: Quarters,
    class: Class,
    /// Its shapes in the domain and in those around it, as one number.
    shape: usize,
}

impl Placed {
    fn new((range, quarters): (CellRange, Quarters), class: Class, around: usize) -> Self {
        let [x, y, z] = core::array::from_fn(|axis| (range.max[axis] - range.min[axis]) as usize);
        let shape = if x | y | z <= 1 { x | y << 1 | z << 2 } else { SHAPES - 1 };
        Self { range, quarters, class, shape: around * SHAPES + shape }
    }

    /// The quarters of one of its cells in which it lies.
    fn quarters(&self, cell: [u32; 3]) -> Quarters {
        let CellRange { min, max } = self.range;
        let axes = |is: [bool; 3]| (0..3).map(|axis| u32::from(is[axis]) << axis).sum();
        let before = axes(core::array::from_fn(|axis| min[axis] < cell[axis]));
        let behind = axes(core::array::from_fn(|axis| cell[axis] < max[axis]));
        self.quarters.through(before, behind)
    }
}

impl Domain<'_> {
    /// A triangle in this domain, if it belongs to it.
    #[inline(always)]
    fn place(&self, settled: &Settled, corners: [Vec3A; 3]) -> Option<Placed> {
        let Within::Lattice(block) = self.within else {
            return self.place_within(settled, corners);
        };
        let home = Home::of(&settled.lattice, settled.most_blocks, corners)?;
        let CellRange { min, max } = home.range;
        let is_in = |k: usize| (min[k] / BLOCK..=max[k] / BLOCK).contains(&block[k]);
        let class = home.class.filter(|_| (0..3).all(is_in))?;
        Some(Placed::new(home.in_block(block), class, 0))
    }

    /// The same in a divided cell; `None` in a block.
    fn place_within(&self, settled: &Settled, corners: [Vec3A; 3]) -> Option<Placed> {
        let Within::Domain(around, cell) = self.within else { return None };
        let placed = around.place(settled, corners)?;
        let reach = settled.lattice.reach(&Aabb::of(corners)?);
        let (range, quarters) = self.frame.range(&reach);
        let class = classify(range.min, range.max, 1).unwrap_or(Class::Blocks);
        let is_in = placed.class == Class::Cells && placed.range.contains(cell);
        is_in.then(|| Placed::new((range, quarters), class, placed.shape))
    }
}

impl Check<'_> {
    /// The error for a word of the pool.
    fn wrong(&self, at: usize) -> Error {
        let head = Layout::new(self.settled.lattice.resolution, 0).head_bytes();
        let at = at.min(self.grid.pool.len().saturating_sub(1));
        Error::Corrupt { offset: head + (at * size_of::<u32>()) as u64 }
    }

    /// Checks every list, and that nothing else is in the pool.
    fn pool(&mut self) -> Result<(), Error> {
        let pool = self.grid.pool;
        let wrong = self.wrong(0);
        let large = list(pool, 1).ok_or(wrong)?;
        let Settled { lattice, most_blocks, .. } = self.settled;
        let is_large = |&id: &u32| {
            let corners = self.mesh.corners(id);
            let home = corners.and_then(|corners| Home::of(lattice, *most_blocks, corners));
            home.is_some_and(|home| home.class.is_none())
        };
        if !ascends(large) || !large.iter().all(is_large) {
            return Err(wrong);
        }
        self.listed[0] += large.len() as u64;

        let mut cursor = 1 + large.len();
        // Never 0, which the compiler cannot see.
        let [width, height, _] = self.grid.width.map(|blocks| blocks.max(1));
        for (number, block) in self.grid.blocks.iter().enumerate() {
            if *block == Block::default() {
                continue;
            }
            let wrong = corrupt(HEADER_BYTES + number * size_of::<Block>());
            let number = u32::try_from(number).map_err(|_| wrong)?;
            let at = [number % width, number / width % height, number / width / height];
            let chunk = self.grid.block(at).filter(|_| block.base as usize == cursor);
            let within = Within::Lattice(at);
            let domain = Domain { frame: Frame::of_block(at), depth: 0, within };
            cursor += self.chunk(cursor, &chunk.ok_or(wrong)?, &domain)?;
        }
        if cursor == pool.len() { Ok(()) } else { Err(self.wrong(cursor)) }
    }

    /// Checks a chunk and those of its divided cells. All places in it count from `base`, the start
    /// of the block; so does the answer, where they end.
    fn chunk(
        &mut self,
        base: usize,
        chunk: &Chunk<'_>,
        domain: &Domain<'_>,
    ) -> Result<usize, Error> {
        let mut record_at = chunk.bricks as usize;
        let wrong = self.wrong(base + record_at);
        if chunk.mask == 0 && chunk.list == 0 {
            return Err(wrong);
        }
        let mut cells = 0;
        for bit in ones(chunk.mask) {
            cells += ones(mask(chunk.brick(bit).ok_or(wrong)?.mask)).count();
        }

        // The lists of cells, each where the one before it ended.
        let mut start_at = record_at + RECORD_WORDS * ones(chunk.mask).count();
        let mut list_at = start_at + cells + usize::from(cells > 0);
        let mut is_divided = false;
        let start = |at: usize| chunk.words.get(at).copied();
        for bit in ones(chunk.mask) {
            let brick = chunk.brick(bit).ok_or(wrong)?;
            let is_empty = brick.mask == [0; 2] && brick.list == 0;
            if is_empty || brick.cells as usize != start_at {
                return Err(self.wrong(base + record_at));
            }
            for cell in ones(mask(brick.mask)) {
                let wrong = self.wrong(base + start_at);
                if start(start_at).is_none_or(|start| (start & !GRID) as usize != list_at) {
                    return Err(wrong);
                }
                match chunk.content(&brick, cell).ok_or(wrong)? {
                    Content::List(references) => {
                        let cell = place(bit << 6 | cell);
                        self.list(base + list_at, references, domain, Class::Cells, cell)?;
                        list_at += references.len();
                    }
                    Content::Chunk(..) => {
                        is_divided = true;
                        list_at += CHILD_WORDS;
                    }
                }
                start_at += 1;
            }
            record_at += RECORD_WORDS;
        }
        if cells > 0 && start(start_at).is_none_or(|end| end as usize != list_at) {
            return Err(self.wrong(base + start_at));
        }

        // Those of bricks and of all of it.
        let scene = Scene { mesh: self.mesh, lattice: &self.settled.lattice };
        let of_bricks =
            ones(chunk.mask).filter_map(|bit| Some((chunk.brick(bit)?.list, Owner::Brick(bit))));
        for (at, owner) in of_bricks.chain([(chunk.list, Owner::Chunk)]) {
            if at == 0 {
                continue;
            }
            let wrong = self.wrong(base + list_at);
            let large = Large::new(chunk.words, at, owner);
            let large = large.filter(|_| at as usize == list_at + LIST_WORDS).ok_or(wrong)?;
            let Large { ids, extent, .. } = large;
            let (class, cell) = match owner {
                Owner::Brick(bit) => (Class::Bricks, place(bit << 6)),
                Owner::Chunk => (Class::Blocks, [0; 3]),
            };
            self.list(base + list_at + EXTENT_WORDS, ids, domain, class, cell)?;
            if extent != Extent::of(&scene, &domain.frame, owner, ids) {
                return Err(wrong);
            }
            list_at += LIST_WORDS + ids.len();
        }

        // The divided cells.
        if !is_divided {
            return Ok(list_at);
        }
        for bit in ones(chunk.mask) {
            let brick = chunk.brick(bit).ok_or(wrong)?;
            for cell in ones(mask(brick.mask)) {
                let Some(Content::Chunk(child, count)) = chunk.content(&brick, cell) else {
                    continue;
                };
                if child.bricks as usize != list_at || domain.depth == MAX_CHILDREN {
                    return Err(self.wrong(base + list_at));
                }
                let cell = place(bit << 6 | cell);
                let frame = domain.frame.child(cell, count);
                let within = Within::Domain(domain, cell);
                let inner = Domain { frame, depth: domain.depth + 1, within };
                list_at = self.chunk(base, &child, &inner)?;
            }
        }
        Ok(list_at)
    }

    /// Checks a list of a cell, of the brick with that cell, or of all of a domain: some triangles,
    /// each once, that all belong there.
    fn list(
        &mut self,
        at: usize,
        words: &[u32],
        domain: &Domain<'_>,
        class: Class,
        cell: [u32; 3],
    ) -> Result<(), Error> {
        let wrong = self.wrong(at);
        if words.is_empty() {
            return Err(wrong);
        }
        let shapes = [SHAPES, SHAPES * SHAPES, self.last.len()];
        let shapes = shapes.get(domain.depth).and_then(|&count| self.last.get_mut(..count));
        shapes.ok_or(wrong)?.fill(0);
        let shift = class.shift();
        let format = Format::of(self.mesh.triangle_count());
        for &word in words {
            let id = format.id(word);
            let corners = self.mesh.corners(id).ok_or(wrong)?;
            let placed = domain.place(self.settled, corners).ok_or(wrong)?;
            let CellRange { min, max } = placed.range;
            let is_in =
                |k: usize| (min[k] >> shift..=max[k] >> shift).contains(&(cell[k] >> shift));
            let last = self.last.get_mut(placed.shape).ok_or(wrong)?;
            let written = match class {
                Class::Cells => format.word(id, placed.quarters(cell)),
                _ => id,
            };
            if placed.class != class || !(0..3).all(is_in) || *last > id || word != written {
                return Err(wrong);
            }
            *last = id + 1;
            if domain.depth > 0 {
                self.count(domain, &placed, cell, corners);
            }
        }
        *self.listed.get_mut(domain.depth).ok_or(wrong)? += words.len() as u64;
        Ok(())
    }

    /// Counts a triangle of a divided cell, if this is the first of the lists that it has there.
    fn count(&mut self, domain: &Domain<'_>, placed: &Placed, cell: [u32; 3], corners: [Vec3A; 3]) {
        let Within::Domain(around, of) = domain.within else { return };
        let (CellRange { min, max }, shift) = (placed.range, placed.class.shift());
        if (0..3).any(|k| min[k] >> shift != cell[k] >> shift) {
            return;
        }
        if let Some(expected) = self.expected.get_mut(domain.depth) {
            *expected += lists(min, max, shift);
        }
        if let Some(listed) = self.listed.get_mut(around.depth) {
            *listed += 1;
        }
        // The cell may be one of a divided cell itself.
        if let Some(placed) = around.place_within(self.settled, corners) {
            self.count(around, &placed, of, corners);
        }
    }

    /// How many lists of cells, bricks, blocks and the grid must have a triangle.
    fn lists_of(&self, id: u32) -> u64 {
        let Settled { lattice, most_blocks, .. } = self.settled;
        let corners = self.mesh.corners(id);
        match corners.and_then(|corners| Home::of(lattice, *most_blocks, corners)) {
            Some(Home { range, class: Some(class), .. }) => {
                lists(range.min, range.max, class.shift())
            }
            Some(_) => 1,
            None => 0,
        }
    }
}
