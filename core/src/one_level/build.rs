//! Building a one-level grid: plan in the scratch, then write the index exactly.
//!
//! ```text
//! survey     bounds, indices checked                                   (survey.rs)
//! settle     resolution from the density; mark domain bits, count references
//! displace   row offsets, number of slots              -> every size is exact from here
//! count      references per slot, then their sum up to each slot
//! fill       triangles in reverse: every list ascends by id           (compact grid, LD08)
//! ```
//!
//! The plan touches only the scratch, so a build that runs out of index memory has written nothing
//! there and knows exactly what it needs.
//!
//! The number of references has no bound in the number of triangles: a million triangles that each
//! span the scene would fill every cell a million times. [`reference_limit`] is the promise that
//! this does not happen: a mesh that would need more is built with half the density, again and
//! again until it fits. Scans take 2 to 5 references a triangle and never come near it.

use super::displacement::displace;
use super::layout::{Layout, Scratch};
use super::{row, slot};
use crate::bits::set_range;
use crate::blob::Header;
use crate::cell::{CellRange, Lattice, woo};
use crate::config::{Config, Method};
use crate::error::{ConfigField, Error, Region};
use crate::mesh::TriangleMesh;
use crate::survey::{Survey, boxes};

/// The most references a grid of so many triangles may have.
pub(super) const fn reference_limit(triangles: u32) -> u32 {
    /// Several times what any scan needs, and what a scene of walls and floors needs.
    const PER_TRIANGLE: u32 = 16;
    /// So that a handful of triangles is not denied the few cells it asks for.
    const AT_LEAST: u32 = 64;
    triangles.saturating_mul(PER_TRIANGLE).saturating_add(AT_LEAST)
}

/// The rows of cells, once they are marked and displaced.
#[derive(Debug)]
struct Rows<'s> {
    offsets: &'s [i32],
    domain_bits: &'s [u64],
}

/// All that is known of a grid before its index is written.
#[derive(Debug)]
pub(super) struct Plan<'s> {
    /// The sizes: exact if there was scratch enough to displace the rows, else a bound.
    pub(super) layout: Layout,
    survey: Survey,
    lattice: Lattice,
    density: f32,
    rows: Option<Rows<'s>>,
}

impl<'s> Plan<'s> {
    /// Plans as far as the scratch allows; without any, two passes over the mesh give a bound.
    pub(super) fn new(
        mesh: &TriangleMesh<'_>,
        config: &Config,
        scratch: &'s mut [u8],
    ) -> Result<Self, Error> {
        let survey = Survey::of(mesh, config.flags)?;
        let bounds = Lattice::pad(&survey.bounds);
        let limit = reference_limit(mesh.triangle_count());

        // Settle the density: mark the cells, or only count where there is no room to mark.
        let mut density = config.density;
        let (lattice, reference_count) = loop {
            let resolution = woo(bounds.size(), f64::from(density), survey.finite_count)
                .ok_or(Error::InvalidConfig(ConfigField::Density))?;
            let lattice = Lattice::new(bounds, resolution);
            let count = match Layout::new(resolution, 0, 0).scratch(scratch) {
                Some(Scratch { domain_bits, .. }) => mark(mesh, &lattice, domain_bits, limit),
                None => count_references(mesh, &lattice, limit, |_| {}),
            };
            match count {
                Some(count) => break (lattice, count),
                None => density *= 0.5,
            }
        };

        // Displace the rows: the one number that no pass over the triangles can tell.
        let mut layout = Layout::new(lattice.resolution, 0, reference_count);
        layout.hash_count = u32::try_from(layout.cells).unwrap_or(u32::MAX);
        let rows = match layout.scratch(scratch) {
            Some(Scratch { row_offsets, domain_bits, occupied }) => {
                occupied.fill(0);
                let width = lattice.resolution[0] as usize;
                let slots = displace(domain_bits, width, row_offsets, occupied)
                    .ok_or(Error::InvalidConfig(ConfigField::Density))?;
                layout.hash_count = slots;
                Some(Rows { offsets: row_offsets, domain_bits })
            }
            None => None,
        };
        Ok(Self { layout, survey, lattice, density, rows })
    }

    /// Whether the sizes are exact.
    pub(super) const fn is_exact(&self) -> bool {
        self.rows.is_some()
    }
}

/// Builds into `index` and returns the part of it that is the blob.
pub(crate) fn build<'a>(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    index: &'a mut [u8],
    scratch: &mut [u8],
) -> Result<&'a [u8], Error> {
    let scratch_bytes = scratch.len() as u64;
    let plan = Plan::new(mesh, config, scratch)?;
    let Some(rows) = plan.rows else {
        return Err(Error::OutOfMemory {
            region: Region::Scratch,
            needed_bytes: plan.layout.scratch_bytes(),
            available_bytes: scratch_bytes,
        });
    };
    let available_bytes = index.len() as u64;
    let needed_bytes = plan.layout.index_bytes();
    let too_small = Error::OutOfMemory { region: Region::Index, needed_bytes, available_bytes };
    let bytes = usize::try_from(needed_bytes).ok();
    let blob = bytes.and_then(|bytes| index.get_mut(..bytes)).ok_or(too_small)?;
    let sections = plan.layout.sections_mut(blob).ok_or(too_small)?;

    let mut header = Header::new(Method::OneLevel, mesh, &plan.lattice);
    header.blob_bytes = needed_bytes;
    header.skipped_count = plan.survey.skipped_count;
    header.density = plan.density;
    header.hash_count = plan.layout.hash_count;
    header.reference_count = plan.layout.reference_count;
    *sections.header = bytemuck::cast(header);
    copy(rows.offsets, sections.row_offsets);
    copy(rows.domain_bits, sections.domain_bits);
    fill(mesh, &plan.lattice, sections.row_offsets, sections.hash, sections.references);
    Ok(blob)
}

/// Marks the cells that triangles overlap and counts the references, up to a limit.
fn mark(
    mesh: &TriangleMesh<'_>,
    lattice: &Lattice,
    domain_bits: &mut [u64],
    limit: u32,
) -> Option<u32> {
    domain_bits.fill(0);
    let [width, height, _] = lattice.resolution;
    count_references(mesh, lattice, limit, |range| {
        let [from, to] = [range.min[0] as usize, range.max[0] as usize];
        for_each_row(height, range, |row| {
            set_range(domain_bits, row * width as usize + from, to - from);
        });
    })
}

/// Counts the references of a grid, showing every triangle's cells to `visit`; `None` if there are
/// more than `limit`.
#[inline(always)]
pub(super) fn count_references(
    mesh: &TriangleMesh<'_>,
    lattice: &Lattice,
    limit: u32,
    mut visit: impl FnMut(&CellRange),
) -> Option<u32> {
    let mut count = 0;
    for (_, bounds) in boxes(mesh) {
        let range = lattice.range(&bounds);
        count += range.count();
        if count > u64::from(limit) {
            return None;
        }
        visit(&range);
    }
    u32::try_from(count).ok()
}

/// Sorts the triangles into the cells' lists: count, sum up, fill in reverse.
fn fill(
    mesh: &TriangleMesh<'_>,
    lattice: &Lattice,
    row_offsets: &[i32],
    hash: &mut [u32],
    references: &mut [u32],
) {
    let [_, height, _] = lattice.resolution;

    // Count the references of each slot.
    hash.fill(0);
    for (_, bounds) in boxes(mesh) {
        for_each_run(height, &lattice.range(&bounds), row_offsets, hash, |count| *count += 1);
    }

    // Sum up: every slot now says where its list ends.
    let mut end = 0_u32;
    for slot in &mut *hash {
        end = end.wrapping_add(*slot);
        *slot = end;
    }

    // Put every triangle before the end of its lists, the last one first: lists ascend by id.
    for (id, bounds) in boxes(mesh).rev() {
        for_each_run(height, &lattice.range(&bounds), row_offsets, hash, |end| {
            *end = end.wrapping_sub(1);
            if let Some(reference) = references.get_mut(*end as usize) {
                *reference = id;
            }
        });
    }
}

/// Shows `visit` the rows that a range of cells touches.
#[inline(always)]
fn for_each_row(height: u32, range: &CellRange, mut visit: impl FnMut(usize)) {
    for z in range.min[2]..=range.max[2] {
        for y in range.min[1]..=range.max[1] {
            visit(row(height, y, z));
        }
    }
}

/// Shows `visit` the slots of the hash table that a range of cells has, a run for each row.
#[inline(always)]
fn for_each_run(
    height: u32,
    range: &CellRange,
    row_offsets: &[i32],
    hash: &mut [u32],
    mut visit: impl FnMut(&mut u32),
) {
    let length = (range.max[0] - range.min[0]) as usize + 1;
    for_each_row(height, range, |row| {
        let Some(&offset) = row_offsets.get(row) else { return };
        let Some(start) = slot(offset, range.min[0]) else { return };
        for slot in hash.get_mut(start..start + length).into_iter().flatten() {
            visit(slot);
        }
    });
}

/// Copies words between sections of the same length.
fn copy<T: Copy>(from: &[T], to: &mut [T]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}
