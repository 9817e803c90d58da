//! Building a recursive grid: count, then fill, one grid after the other, depth first.
//!
//! ```text
//! scratch | starts and ids of the root | of its child | of the child's child |   a stack
//! index   | header | pool, a bump allocator ->
//! ```
//!
//! The lists of a grid are made in the scratch, then moved into the pool cell by cell; a crowded
//! cell becomes a grid, whose own lists stack up behind. When the pool runs out the build goes on
//! and counts: at the end it knows, exactly, what index it would have needed.
//!
//! Nested detail, fans and plates would take a build without end: each triangle lies in many cells of each grid. So a
//! build has a budget of *looks*, [`LOOKS`] for each triangle. A grid below the root takes one for each of its cells,
//! and two for each cell in the box of each of its triangles, to count and to fill. It gets a share of the looks that
//! are left, as large as its share of the references. A cell whose grid would take more stays a list.
//!
//! Resolution as in Manta: with n primitives at depth d of D, `m = (density n)^(1 / (2 D + 1 - 2 d))` (by default 8 n)
//! and `m * size / cbrt(volume)` cells on each axis, rounded; at least 8 cells.

use glam::Vec3A;

use super::FEW;
use super::node::{GridNode, HEAD_WORDS};
use super::overlap::Overlap;
use crate::aabb::Aabb;
use crate::arena::{Sizes, copy, section_bytes, split_mut};
use crate::blob::{HEADER_BYTES, Header};
use crate::bump::{Bump, GRID, finish};
use crate::cell::{CellRange, Lattice, as_f32, row, whole};
use crate::config::{BuildFlags, Parameters};
use crate::control::Watch;
use crate::error::{ConfigField, Error, Region};
use crate::invariant::OrBug;
use crate::limits::MAX_RESOLUTION_OF_RECURSIVE;
use crate::mesh::TriangleMesh;
use crate::survey::{Survey, boxes, reference_limit};

/// Cells that grids below the root may look at for each triangle: several times what scans take.
const LOOKS: u64 = 512;
/// Added to them, for meshes of a few triangles.
const LEAST_LOOKS: u64 = 65_536;

/// Cells that all grids below the root together may look at.
const fn looks(triangles: u32) -> u64 {
    LOOKS * triangles as u64 + LEAST_LOOKS
}

/// Words of scratch for one grid of so many primitives: where lists start, and their ids.
///
/// The rule asks for at most `density * n` cells; rounding makes at most 1.5 times as many of them
/// on each of three axes, and no grid has fewer than 8.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a bound, rounded up")]
const fn scratch_words(primitives: u32, density: f32) -> u64 {
    let cells = (3.5 * density as f64 * primitives as f64) as u64;
    cells.saturating_add(64 + 1 + reference_limit(primitives) as u64)
}

/// Bytes of scratch for so many triangles, whatever they look like: their ids, and one grid on each level.
const fn most_scratch(triangles: u32, density: f32, depth: u32) -> u64 {
    let level = scratch_words(triangles, density);
    section_bytes::<u32>((triangles as u64).saturating_add(level.saturating_mul(depth as u64)))
}

/// The scratch that the build of a grid with this header takes.
pub(crate) const fn scratch_bytes(header: &Header) -> u64 {
    most_scratch(header.triangle_count, header.density, header.depth)
}

/// The most memory that a mesh with so many triangles can need, or all that a pool can address.
///
/// Grids on one level that share n references, at least 5 each, have at most
/// `(3.5 * density + 44) n` words and hand down at most `29 n` references. A grid below the root has 8 words,
/// one more for each cell, and at least 5 references. It took a look for each cell and two for each reference, or more:
/// no more than two words a look.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "a bound, rounded up; no more than 2^31"
)]
pub(crate) const fn bound(triangles: u32, density: f32, depth: u32) -> (u64, u64) {
    let mut references = triangles as f64 + 5.0;
    let mut words = 0.0;
    let mut level = 0;
    while level < depth {
        words += (3.5 * density as f64 + 44.0) * references;
        references *= 29.0;
        level += 1;
    }
    let most = scratch_words(triangles, density).saturating_add(2 * looks(triangles));
    let most = if most < GRID as u64 { most } else { GRID as u64 };
    let words = if words < most as f64 { words as u64 } else { most };
    (HEADER_BYTES as u64 + section_bytes::<u32>(words), most_scratch(triangles, density, depth))
}

/// The memory that a mesh needs: exact if the scratch is large enough to build in.
pub(crate) fn sizes(
    mesh: &TriangleMesh<'_>,
    density: f32,
    depth: u32,
    flags: BuildFlags,
    scratch: &mut [u8],
) -> Result<Sizes, Error> {
    let root = Root::of(mesh, density, depth, flags, &Watch::none())?;
    let (index_bytes, scratch_bytes) = bound(mesh.triangle_count(), root.density, depth);
    if (scratch.len() as u64) < scratch_bytes {
        return Sizes::new(index_bytes, scratch_bytes, false);
    }
    let header = run(mesh, &root, &mut [], scratch, &Watch::none())?;
    Sizes::new(header.blob_bytes, scratch_bytes, true)
}

/// Builds into `index` and returns the part of it that is the blob.
pub(crate) fn build<'a>(
    mesh: &TriangleMesh<'_>,
    density: f32,
    depth: u32,
    flags: BuildFlags,
    index: &'a mut [u8],
    scratch: &mut [u8],
    watch: &Watch<'_>,
) -> Result<&'a [u8], Error> {
    let root = Root::of(mesh, density, depth, flags, watch)?;
    let header = run(mesh, &root, index, scratch, watch)?;
    finish(index, header)
}

/// The outermost grid, as fine as its references allow, and the density that allows it.
struct Root {
    survey: Survey,
    /// The grid's own cells, which are the unit of all boxes below it.
    lattice: Lattice,
    density: f32,
    rule: Fineness,
}

impl Root {
    fn of(
        mesh: &TriangleMesh<'_>,
        mut density: f32,
        depth: u32,
        flags: BuildFlags,
        watch: &Watch<'_>,
    ) -> Result<Self, Error> {
        let survey = Survey::of(mesh, flags, watch)?;
        let bounds = Lattice::pad(&survey.bounds);
        let size = bounds.size().to_array().map(f64::from);
        let limit = u64::from(reference_limit(mesh.triangle_count()));
        loop {
            let rule = Fineness { density: f64::from(density), depth };
            let resolution = rule.resolution(size, survey.finite_count, 0).ok_or(TOO_FINE)?;
            let lattice = Lattice::new(bounds, resolution);
            if references(mesh, &lattice, limit) <= limit {
                return Ok(Self { survey, lattice, density, rule });
            }
            density *= 0.5;
        }
    }
}

/// Counts the references of the outermost grid, or returns some number above the limit.
fn references(mesh: &TriangleMesh<'_>, lattice: &Lattice, limit: u64) -> u64 {
    let node = GridNode::root(lattice.resolution);
    let mut references = 0;
    for id in 0..mesh.triangle_count() {
        if let Some(placed) = PlacedTriangle::new(mesh, lattice, id) {
            placed.each_cell(&node, |_, _| references += 1);
        }
        if references > limit {
            break;
        }
    }
    references
}

/// Builds as much as the index holds; the header says what all of it takes.
fn run(
    mesh: &TriangleMesh<'_>,
    root: &Root,
    index: &mut [u8],
    scratch: &mut [u8],
    watch: &Watch<'_>,
) -> Result<Header, Error> {
    let Root { survey, lattice, density, rule } = root;
    let (density, depth) = (*density, rule.depth);
    let available_bytes = scratch.len() as u64;
    let needed_bytes = most_scratch(mesh.triangle_count(), density, depth);
    let too_small = Error::OutOfMemory { region: Region::Scratch, needed_bytes, available_bytes };
    if available_bytes < needed_bytes {
        return Err(too_small);
    }
    let (scratch, _) = split_mut::<u32>(scratch, needed_bytes / 4).ok_or(too_small)?;

    // An index that is too small or missing is legal: the pool only counts then.
    let (header, pool) = index.split_at_mut_checked(HEADER_BYTES).unwrap_or_default();
    // Clear the header first: if the build ends with an error, the region must not open as a grid.
    header.fill(0);
    let mut builder = Builder { mesh, lattice, rule: *rule, pool: Bump::over(pool), watch };

    let finite = usize::try_from(survey.finite_count).unwrap_or(usize::MAX);
    let (ids, scratch) = scratch.split_at_mut_checked(finite).ok_or(too_small)?;
    let mut finite_ids = boxes(mesh).map(|(id, _)| id);
    for slot in ids.iter_mut() {
        *slot = finite_ids.next().or_bug("fewer triangles than were counted").unwrap_or_default();
    }
    debug_assert!(finite_ids.next().is_none(), "more triangles than were counted");
    let whole = Aabb { min: Vec3A::ZERO, max: Vec3A::from_array(lattice.resolution.map(as_f32)) };
    let mut looks = looks(mesh.triangle_count());
    builder.grid(ids, &whole, 0, &mut looks, scratch)?;
    let words = builder.pool.offset()?;

    let mut header = Header::new(Parameters::Recursive { density, depth }, mesh, lattice);
    header.blob_bytes = HEADER_BYTES as u64 + section_bytes::<u32>(words.into());
    header.skipped_count = survey.skipped_count;
    header.reference_count = words;
    Ok(header)
}

/// The parameters that decide how finely a grid is cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fineness {
    pub(super) density: f64,
    pub(super) depth: u32,
}

impl Fineness {
    /// Manta's resolution for a box of this size with so many primitives at this depth; `None` if
    /// an axis would need more cells than a grid can have.
    pub(super) fn resolution(
        &self,
        size: [f64; 3],
        primitives: u32,
        depth: u32,
    ) -> Option<[u32; 3]> {
        let cells = (self.density * f64::from(primitives)).max(1.0);
        let m = nth_root(cells, 2 * (self.depth - depth) + 1);
        let volume = size.iter().product::<f64>();
        let mut parts = size.map(|s| s * m / nth_root(volume, 3));

        // An axis with less than one cell gets one, and the others share the loss; if one of them then has less
        // than one, too, it gets one, and the third takes the loss alone.
        for axis in 0..3 {
            if parts[axis] < 1.0 {
                let share = nth_root(parts[axis], 2);
                let [next, last] = [(axis + 1) % 3, (axis + 2) % 3];
                parts[axis] = 1.0;
                parts[next] *= share;
                parts[last] *= share;
                for (small, large) in [(next, last), (last, next)] {
                    if parts[small] < 1.0 {
                        parts[large] *= parts[small];
                        parts[small] = 1.0;
                    }
                }
            }
        }
        if parts.iter().any(|&part| part + 0.5 >= f64::from(MAX_RESOLUTION_OF_RECURSIVE + 1)) {
            return None;
        }
        let resolution = parts.map(rounded);
        let is_coarse = resolution.iter().product::<u32>() < 8;
        Some(if is_coarse { [2; 3] } else { resolution })
    }

    /// The resolution of a grid in a cell, for so many primitives in this box in cells of the root;
    /// [1; 3] for none. No cell is so thin that the margin would put everything into it.
    pub(super) fn within(
        &self,
        lattice: &Lattice,
        bounds: &Aabb,
        primitives: u32,
        depth: u32,
    ) -> Option<[u32; 3]> {
        let cell_size = lattice.cell_size().to_array().map(f64::from);
        let (extent, margin) = (bounds.size().to_array(), lattice.margin().to_array());
        let size = core::array::from_fn(|axis| cell_size[axis] * f64::from(extent[axis]));
        let cells = self.resolution(size, primitives, depth);
        let cells = cells.map(|cells| {
            core::array::from_fn(|axis| {
                cells[axis].min(whole(extent[axis] / (8.0 * margin[axis]))).max(1)
            })
        });
        cells.or((primitives == 0).then_some([1; 3]))
    }
}

/// The part of a cell that its primitives reach.
pub(super) fn inside(lattice: &Lattice, node: &GridNode, cell: [u32; 3], reach: &Aabb) -> Aabb {
    let Aabb { min, max } = node.cell_box(cell);
    // A reach that only touches the cell leaves a sliver as wide as the margin.
    let least = lattice.margin();
    let low = reach.min.max(min).min(max - least);
    Aabb { min: low, max: reach.max.min(max).max(low + least) }
}

/// A root of a positive number by Newton's method, from above: the same bits everywhere.
fn nth_root(x: f64, degree: u32) -> f64 {
    const BIAS: i64 = 1023;
    let exponent = (x.to_bits() >> 52 & 0x7ff).cast_signed() - BIAS;
    let above = exponent.div_euclid(i64::from(degree)) + 1 + BIAS;
    let mut root = f64::from_bits(above.cast_unsigned() << 52);
    for _ in 0..24 {
        let power = (1..degree).fold(1.0, |power, _| power * root);
        root -= (root - x / power) / f64::from(degree);
    }
    root
}

/// The nearest whole number of cells, at least one.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "1 to MAX_RESOLUTION_OF_RECURSIVE"
)]
const fn rounded(part: f64) -> u32 {
    let cells = (part + 0.5) as u32;
    if cells > 1 { cells } else { 1 }
}

/// A triangle in the cells of the root.
pub(super) struct PlacedTriangle {
    /// The triangle's box, grown by the margin.
    pub(super) reach: Aabb,
    overlap: Overlap,
    margin: Vec3A,
}

impl PlacedTriangle {
    pub(super) fn new(mesh: &TriangleMesh<'_>, lattice: &Lattice, id: u32) -> Option<Self> {
        let corners = mesh.corners(id)?;
        let reach = lattice.reach(&Aabb::of(corners)?);
        let overlap = Overlap::new(corners.map(|corner| lattice.place(corner)));
        Some(Self { reach, overlap, margin: lattice.margin() })
    }

    /// Returns true if [`each_cell`](Self::each_cell) shows a cell. It looks at this cell alone, unless the cell is the
    /// first of its box and the triangle does not overlap it.
    pub(super) fn is_in(&self, node: &GridNode, cell: [u32; 3]) -> bool {
        let range = node.range(&self.reach);
        range.contains(cell)
            && (range.count() == 1
                || self.overlaps(node, cell)
                || cell == range.min && self.first(node) == cell)
    }

    /// The first cell that [`each_cell`](Self::each_cell) shows. It looks at no cell behind it, unless the triangle
    /// overlaps none.
    pub(super) fn first(&self, node: &GridNode) -> [u32; 3] {
        let range = node.range(&self.reach);
        range.cells().find(|&cell| self.overlaps(node, cell)).unwrap_or(range.min)
    }

    /// Returns true if the triangle overlaps a cell that its box meets.
    fn overlaps(&self, node: &GridNode, cell: [u32; 3]) -> bool {
        let (origin, scale) = (Vec3A::from_array(node.origin), Vec3A::from_array(node.scale));
        let size = 1.0 / scale;
        let center = origin + (Vec3A::from_array(cell.map(as_f32)) + 0.5) * size;
        self.overlap.with(center, size * 0.5 + self.margin)
    }

    /// Shows `visit` the cells of a grid that the triangle overlaps, with their
    /// numbers: one at least, so that a triangle which only touches a cell is not lost
    /// in the grid that the cell holds. Returns how many cells it looked at.
    pub(super) fn each_cell(&self, node: &GridNode, mut visit: impl FnMut(usize, [u32; 3])) -> u64 {
        let (origin, scale) = (Vec3A::from_array(node.origin), Vec3A::from_array(node.scale));
        let [width, height, _] = node.resolution;
        let number = |[x, y, z]: [u32; 3]| row(height, y, z) * width as usize + x as usize;
        let range = node.range(&self.reach);
        if range.count() == 1 {
            visit(number(range.min), range.min);
            return 1;
        }
        let size = 1.0 / scale;
        let half = size * 0.5 + self.margin;
        let mut is_anywhere = false;
        for cell in range.cells() {
            let center = origin + (Vec3A::from_array(cell.map(as_f32)) + 0.5) * size;
            if self.overlap.with(center, half) {
                visit(number(cell), cell);
                is_anywhere = true;
            }
        }
        if !is_anywhere {
            visit(number(range.min), range.min);
        }
        range.count()
    }
}

/// The error for a grid that does not fit into its scratch.
const TOO_FINE: Error = Error::InvalidConfig(ConfigField::Density);

/// The state of a build.
struct Builder<'m, 'p> {
    mesh: &'m TriangleMesh<'m>,
    lattice: &'m Lattice,
    rule: Fineness,
    pool: Bump<'p>,
    watch: &'m Watch<'m>,
}

impl Builder<'_, '_> {
    fn place(&self, id: u32) -> Option<PlacedTriangle> {
        PlacedTriangle::new(self.mesh, self.lattice, id)
            .or_bug("a list with a triangle that is not finite")
    }

    /// Puts a grid of these primitives in this box into the pool, and all grids in it.
    ///
    /// Answers `false`, and puts nothing, where a grid separates too little: if the lists of its cells hold on average
    /// more than three quarters of the primitives, as in a pile of equal triangles. Likewise where it would look at
    /// more than `looks` cells. It subtracts the cells that it looked at from `looks`. The root is always put.
    fn grid(
        &mut self,
        ids: &[u32],
        bounds: &Aabb,
        depth: u32,
        looks: &mut u64,
        scratch: &mut [u32],
    ) -> Result<bool, Error> {
        let count = u32::try_from(ids.len()).unwrap_or(u32::MAX);

        let settled = self.settle(ids, bounds, depth, looks, scratch)?;
        let Some((node, references, looked)) = settled else { return Ok(false) };
        let starts = scratch.get(..node.cells()).ok_or(TOO_FINE)?;
        let lists = starts.iter().filter(|&&start| start != 0).count() as u64;
        if depth > 0 && 4 * references > 3 * u64::from(count) * lists {
            return Ok(false);
        }

        if depth > 0 {
            debug_assert!(looked <= *looks, "more looks than there were");
            *looks = looks.saturating_sub(looked);
        }

        // Sum up, and fill in reverse: every list ascends by id.
        let (starts, rest) = scratch.split_at_mut_checked(node.cells() + 1).ok_or(TOO_FINE)?;
        let references = usize::try_from(references).unwrap_or(usize::MAX);
        let (lists, rest) = rest.split_at_mut_checked(references).ok_or(TOO_FINE)?;
        let mut end = 0;
        for start in &mut *starts {
            end += *start;
            *start = end;
        }
        for &id in ids.iter().rev() {
            let Some(placed) = self.place(id) else { continue };
            placed.each_cell(&node, |cell, _| {
                debug_assert!(cell < starts.len(), "a cell behind the last");
                let Some(start) = starts.get_mut(cell) else { return };
                *start = start.wrapping_sub(1);
                let reference = lists.get_mut(*start as usize);
                if let Some(reference) = reference.or_bug("a cell has too many references") {
                    *reference = id;
                }
            });
        }

        // Move list after list into the pool, crowded ones as grids.
        let words = HEAD_WORDS + node.cells() + 1;
        // An exhausted pool is legal, here and below: it counts.
        let mut entries = self.pool.take(words).and_then(|words| {
            let (head, entries) = words.split_first_chunk_mut()?;
            *head = node.head();
            Some(entries)
        });
        let mut entry = |cell: usize, value: u32| {
            debug_assert!(cell <= node.cells(), "a cell behind the last");
            if let Some(entry) = entries.as_mut().and_then(|entries| entries.get_mut(cell)) {
                *entry = value;
            }
        };
        let all = CellRange::all(node.resolution);
        let cells = u32::try_from(node.cells()).unwrap_or(u32::MAX);
        let mut later = references as u64;
        for (number, cell) in all.cells().enumerate() {
            if depth == 0 {
                self.watch.between(u32::try_from(number).unwrap_or(cells), cells, [0.2, 1.0])?;
            }
            let ends = starts.get(number..).and_then(|ends| ends.first_chunk::<2>());
            let list = ends.and_then(|ends| lists.get(ends[0] as usize..ends[1] as usize));
            let list = list.or_bug("a list behind the references").unwrap_or_default();
            let start = self.pool.offset()?;
            let is_crowded = list.len() > FEW && depth + 1 < self.rule.depth;
            let share = (*looks).checked_div(later).unwrap_or(0) * list.len() as u64;
            debug_assert!(list.len() as u64 <= later, "longer lists than references");
            later = later.saturating_sub(list.len() as u64);
            let mut left = share;
            let is_grid = is_crowded && {
                let bounds = self.inside(&node, cell, list);
                self.grid(list, &bounds, depth + 1, &mut left, rest)?
            };
            debug_assert!(share - left <= *looks, "more looks than there were");
            *looks = looks.saturating_sub(share - left);
            if is_grid {
                entry(number, start | GRID);
            } else {
                entry(number, start);
                if let Some(words) = self.pool.take(list.len()) {
                    copy(list, words);
                }
            }
        }
        entry(node.cells(), self.pool.offset()?);
        Ok(true)
    }

    /// Chooses the resolution of a grid, and counts the references of each cell where their starts will be.
    ///
    /// Returns the grid, its references and the cells that its triangles look at; `None` if those are more than
    /// `looks`. It subtracts what it looked at from `looks`.
    fn settle(
        &self,
        ids: &[u32],
        bounds: &Aabb,
        depth: u32,
        looks: &mut u64,
        scratch: &mut [u32],
    ) -> Result<Option<(GridNode, u64, u64)>, Error> {
        let count = u32::try_from(ids.len()).unwrap_or(u32::MAX);
        let at = self.pool.offset()?;
        // Count the references of each cell, in coarser grids while there are too many.
        let mut primitives = count;
        loop {
            let resolution = if depth == 0 {
                Some(self.lattice.resolution)
            } else {
                self.rule.within(self.lattice, bounds, primitives, depth)
            };
            let is_last = primitives == 0;
            primitives /= 2;
            let Some(resolution) = resolution.or(is_last.then_some([1; 3])) else { continue };
            let node = GridNode::new(at as usize, bounds.min, bounds.max, resolution);
            if depth > 0 && node.cells() as u64 > *looks {
                return Ok(None);
            }
            let starts = scratch.get_mut(..=node.cells()).ok_or(TOO_FINE)?;
            starts.fill(0);
            let limit = u64::from(reference_limit(count));
            let (mut references, mut looked) = (0_u64, 0_u64);
            // A grid looks at its cells once, and at those of its triangles twice: to count and to fill.
            let most =
                if depth == 0 { u64::MAX } else { looks.saturating_sub(node.cells() as u64) / 2 };
            for placed in ids.iter().filter_map(|&id| self.place(id)) {
                if looked > most || references > limit && !is_last {
                    break;
                }
                looked += placed.each_cell(&node, |cell, _| {
                    references += 1;
                    if let Some(start) = starts.get_mut(cell).or_bug("a cell behind the last") {
                        *start += 1;
                    }
                });
            }
            if looked > most {
                *looks = 0;
                return Ok(None);
            }
            if depth > 0 {
                *looks = looks.saturating_sub(node.cells() as u64 + looked);
            }
            if references <= limit || is_last {
                return Ok(Some((node, references, looked)));
            }
        }
    }

    /// The part of a cell that its primitives reach.
    fn inside(&self, node: &GridNode, cell: [u32; 3], ids: &[u32]) -> Aabb {
        let reaches = ids.iter().filter_map(|&id| Some(self.place(id)?.reach));
        let reach = reaches.fold(Aabb::EMPTY, |all, reach| all.union(&reach));
        inside(self.lattice, node, cell, &reach)
    }
}
