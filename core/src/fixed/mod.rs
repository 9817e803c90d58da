//! The multi-level fixed hashed grid (CP10 §3.2): a fine hashed grid under macrocell levels.
//!
//! The cells are those of a one-level grid at a high density, 32 by default, so that each lists few
//! triangles. The macrocells save the steps that this costs: a ray crosses empty space in steps of
//! `factor`, `factor^2`, ... cells, and goes down a level only where something is.
//!
//! ```text
//! blob | header | sections of the one-level grid | level bits |
//! ```
//!
//! Every size follows from the one-level plan, the resolution and the factor: exact before anything
//! is written. With factor 6 the levels add one bit to 215 cells.

mod levels;
mod validate;

use crate::aabb::Aabb;
use crate::arena::Sizes;
use crate::blob::{Header, corrupt};
use crate::cell::{Lattice, as_f32};
use crate::config::{BuildFlags, Parameters};
use crate::control::Watch;
use crate::counters::Tally;
use crate::dda::{Line, NEVER, Step};
use crate::error::Error;
use crate::mesh::TriangleMesh;
pub(crate) use crate::one_level::scratch_bytes;
use crate::one_level::{Layout, OneLevel, Overlay, Plan, build_under, longest};
use crate::visit::Visitor;
use levels::{Levels, MAX_LEVELS};

/// The macrocell levels as the overlay of a one-level grid.
#[derive(Debug, Clone, Copy)]
struct Macrocells {
    factor: u32,
}

impl Overlay for Macrocells {
    fn words(&self, resolution: [u32; 3]) -> u64 {
        Levels::new(resolution, self.factor).words
    }

    fn fill(&self, resolution: [u32; 3], domain_bits: &[u64], words: &mut [u64]) {
        Levels::new(resolution, self.factor).fill(resolution, domain_bits, words);
    }

    fn parameters(&self, density: f32) -> Parameters {
        Parameters::Fixed { density, macrocell_factor: self.factor }
    }
}

/// The most memory that a mesh with so many triangles can need.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "MAX_RESOLUTION at most"
)]
pub(crate) const fn bound(triangles: u32, density: f32, factor: u32) -> (u64, u64) {
    // A box with the most cells on every axis has the most macrocells on every level.
    let most = longest(triangles, density) as u32 + 1;
    let levels = Levels::new([most; 3], factor);
    Layout::bound(triangles, density, levels.words).bytes()
}

/// The memory that a mesh needs: exact if the scratch is large enough to plan in.
pub(crate) fn sizes(
    mesh: &TriangleMesh<'_>,
    density: f32,
    factor: u32,
    flags: BuildFlags,
    scratch: &mut [u8],
) -> Result<Sizes, Error> {
    Plan::sizes(mesh, density, flags, &Macrocells { factor }, scratch)
}

/// Builds in as much memory as [`sizes`] says.
pub(crate) fn build<'a>(
    mesh: &TriangleMesh<'_>,
    density: f32,
    factor: u32,
    flags: BuildFlags,
    index: &'a mut [u8],
    scratch: &mut [u8],
    watch: &Watch<'_>,
) -> Result<&'a [u8], Error> {
    build_under(mesh, density, flags, &Macrocells { factor }, index, scratch, watch)
}

/// A view of a built fixed grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fixed<'a> {
    cells: OneLevel<'a>,
    levels: Levels,
}

impl<'a> Fixed<'a> {
    #[cfg(feature = "alloc")]
    pub(crate) const NOTHING: Self =
        Self { cells: OneLevel::NOTHING, levels: Levels::new([1; 3], 2) };

    /// The view of a blob, in O(1). Nothing behind the header is trusted, now or later.
    pub(crate) fn open(header: &Header, lattice: &Lattice, blob: &'a [u8]) -> Result<Self, Error> {
        let factor = header.macrocell_factor;
        if factor < 2 {
            return Err(corrupt(core::mem::offset_of!(Header, macrocell_factor)));
        }
        let cells = OneLevel::open_under(header, lattice, &Macrocells { factor }, blob)?;
        Ok(Self { cells, levels: Levels::new(lattice.resolution, factor) })
    }

    /// The most primitives that a ray is shown.
    pub(crate) const fn list_words(&self) -> usize {
        self.cells.list_words()
    }

    /// Shows the lists of all cells that a box, given in cells, meets; `false` if the visitor's budget is used up.
    pub(crate) fn visit(&self, reach: &Aabb, visitor: &mut Visitor<'_>) -> bool {
        self.cells.visit(reach, visitor)
    }

    /// Walks the cells of a ray in order and shows `leaf` the primitives of each that has any; see
    /// [`OneLevel::traverse`]. Empty macrocells are crossed in one step.
    #[inline(always)]
    pub(crate) fn traverse<T: Tally>(
        &self,
        line: &Line,
        tally: &mut T,
        mut leaf: impl FnMut(&[u32], &mut T) -> f32,
    ) {
        let words = self.cells.sections.overlay;
        let mut limit = line.end;
        let mut level = self.levels.count;
        let top = self.levels.level(level);
        let mut size = self.levels.size(level);
        let mut walk = line.walk(0.0, as_f32(size), [0; 3], top.resolution.map(|r| r - 1), NEVER);
        let mut above = [walk; MAX_LEVELS];
        loop {
            tally.cell_step();
            if level == 0 {
                if let Some(references) = self.cells.references(walk.cell()) {
                    limit = leaf(references, tally);
                }
            } else if self.levels.is_full(words, level, walk.cell()) {
                // Go down into the cells of this macrocell.
                tally.grid_step();
                if let Some(slot) = above.get_mut(level - 1) {
                    *slot = walk;
                }
                level -= 1;
                size /= self.levels.factor;
                let factor = self.levels.factor.get();
                let min = walk.cell().map(|cell| cell * factor);
                let last = self.last(level);
                let max = core::array::from_fn(|axis| (min[axis] + factor - 1).min(last[axis]));
                walk = line.walk(walk.entered, as_f32(size), min, max, walk.next);
                continue;
            }
            // Take a step; where a macrocell ends, take it on the level above.
            loop {
                match walk.advance(limit) {
                    Step::Inside => break,
                    Step::Ended => return,
                    Step::Outside => match above.get(level) {
                        Some(parent) if level < self.levels.count => walk = *parent,
                        _ => return,
                    },
                }
                level += 1;
                size *= self.levels.factor.get();
            }
        }
    }

    /// The last cell of a level on each axis.
    #[inline(always)]
    fn last(&self, level: usize) -> [u32; 3] {
        if level == 0 {
            self.cells.last()
        } else {
            self.levels.level(level).resolution.map(|cells| cells - 1)
        }
    }
}
