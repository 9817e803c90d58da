//! Spreading primitives over cells: mark, count, and sort them into lists.
//!
//! Two passes of a compact grid (LD08) over a hash table: count the references of every slot, sum
//! up, and fill in reverse, so that every list ascends by id. What is spread comes from a
//! [`Spread`]: the triangles of a mesh over a lattice, or the triangles of one cell over a subgrid.

use super::{row, slot};
use crate::bits::set_range;
use crate::cell::CellRange;
use crate::control::Watch;
use crate::error::Error;

/// Primitives with the cells that each belongs into.
pub(crate) trait Spread {
    /// Cells per axis.
    fn resolution(&self) -> [u32; 3];

    /// Number of places where a primitive may be.
    fn count(&self) -> u32;

    /// The primitive at a place and its cells, or nothing. Ids ascend; every call answers the same.
    fn at(&self, place: u32) -> Option<(u32, CellRange)>;
}

/// Marks the cells that primitives overlap and counts the references, up to a limit.
pub(crate) fn mark(
    spread: &impl Spread,
    domain_bits: &mut [u64],
    limit: u32,
    watch: &Watch<'_>,
) -> Result<Option<u32>, Error> {
    domain_bits.fill(0);
    let [width, height, _] = spread.resolution();
    count_references(spread, limit, watch, |range| {
        let [from, to] = [range.min[0] as usize, range.max[0] as usize];
        for_each_row(height, range, |row| {
            set_range(domain_bits, row * width as usize + from, to - from);
        });
    })
}

/// Counts the references of a grid, showing every primitive's cells to `visit`; `None` if there are
/// more than `limit`.
#[inline(always)]
pub(crate) fn count_references(
    spread: &impl Spread,
    limit: u32,
    watch: &Watch<'_>,
    mut visit: impl FnMut(&CellRange),
) -> Result<Option<u32>, Error> {
    let mut count = 0;
    for place in 0..spread.count() {
        watch.step(place, spread.count(), [0.15, 0.4])?;
        let Some((_, range)) = spread.at(place) else { continue };
        count += range.count();
        if count > u64::from(limit) {
            return Ok(None);
        }
        visit(&range);
    }
    Ok(u32::try_from(count).ok())
}

/// Sorts the primitives into the cells' lists: count, sum up, fill in reverse.
pub(crate) fn fill(
    spread: &impl Spread,
    row_offsets: &[i32],
    hash: &mut [u32],
    references: &mut [u32],
    watch: &Watch<'_>,
) -> Result<(), Error> {
    let [_, height, _] = spread.resolution();

    // Count the references of each slot.
    hash.fill(0);
    for place in 0..spread.count() {
        watch.step(place, spread.count(), [0.5, 0.7])?;
        let Some((_, range)) = spread.at(place) else { continue };
        for_each_slot(height, &range, row_offsets, hash, |count| *count += 1);
    }

    // Sum up: every slot now says where its list ends.
    let mut end = 0_u32;
    for slot in &mut *hash {
        end = end.wrapping_add(*slot);
        *slot = end;
    }

    // Put every primitive before the end of its lists, the last one first: lists ascend by id.
    for place in (0..spread.count()).rev() {
        watch.step(spread.count() - 1 - place, spread.count(), [0.7, 1.0])?;
        let Some((id, range)) = spread.at(place) else { continue };
        for_each_slot(height, &range, row_offsets, hash, |end| {
            *end = end.wrapping_sub(1);
            if let Some(reference) = references.get_mut(*end as usize) {
                *reference = id;
            }
        });
    }
    Ok(())
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

/// Shows `visit` the slots of the hash table that a range of cells has.
#[inline(always)]
fn for_each_slot(
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
        let Some(slots) = hash.get_mut(start..start + length) else { return };
        for slot in slots {
            visit(slot);
        }
    });
}
