//! Spreading primitives over cells: mark, count, and sort them into lists.
//!
//! Two passes of a compact grid (LD08) over a hash table:
//!
//! ```text
//! count    for each primitive and each of its cells: hash[slot of the cell] += 1
//! sum up   hash[slot] += hash[slot - 1]: where the list of the slot ends
//! fill     for each primitive, the last first, and each of its cells: references[--hash[slot of the cell]] = primitive
//! ```
//!
//! So every list ascends, and the table says where it starts. The primitives come from a [`Spread`]: the triangles of a
//! mesh over a lattice, or those of one cell over a subgrid; batch after batch is placed (`placed.rs`) and then spread.

use core::ops::Range;

use super::placed::{PlacedBatch, Spread};
use super::slot;
use crate::bits::set_range;
use crate::control::Watch;
use crate::error::Error;
use crate::invariant::OrBug;

/// Marks the cells that primitives overlap and counts the references, up to a limit.
pub(crate) fn mark(
    spread: &dyn Spread,
    domain_bits: &mut [u64],
    limit: u32,
    watch: &Watch<'_>,
) -> Result<Option<u32>, Error> {
    domain_bits.fill(0);
    let [width, ..] = spread.resolution();
    count_references(spread, limit, watch, |batch, numbers| {
        batch.each_row::<false>(spread, numbers, |_, row, x, length| {
            set_range(domain_bits, row * width as usize + x as usize, length as usize - 1);
        });
    })
}

/// Counts the references of a grid, showing every batch to `visit`; `None` if there are more than `limit`.
#[inline(always)]
pub(crate) fn count_references(
    spread: &dyn Spread,
    limit: u32,
    watch: &Watch<'_>,
    mut visit: impl FnMut(&PlacedBatch, Range<u32>),
) -> Result<Option<u32>, Error> {
    let mut count = 0;
    let is_all = PlacedBatch::each::<false>(spread, watch, [0.15, 0.4], |batch, numbers| {
        count += batch.references(spread, numbers.clone());
        let goes_on = count <= u64::from(limit);
        if goes_on {
            visit(batch, numbers);
        }
        goes_on
    })?;
    Ok(u32::try_from(count).ok().filter(|_| is_all))
}

/// Sorts the primitives into the cells' lists: count, sum up, fill in reverse.
pub(crate) fn fill(
    spread: &dyn Spread,
    row_offsets: &[i32],
    hash: &mut [u32],
    references: &mut [u32],
    watch: &Watch<'_>,
) -> Result<(), Error> {
    // Count the references of each slot.
    hash.fill(0);
    PlacedBatch::each::<false>(spread, watch, [0.5, 0.7], |batch, numbers| {
        batch.each_row::<false>(spread, numbers, |_, row, x, length| {
            for count in slots(row_offsets, hash, row, x, length) {
                *count += 1;
            }
        });
        true
    })?;

    // Sum up: every slot now says where its list ends.
    let mut end = 0_u32;
    for slot in &mut *hash {
        end = end.wrapping_add(*slot);
        *slot = end;
    }
    debug_assert!(end as usize == references.len(), "not as many references as were counted");

    // Put every primitive before the end of its lists, the last one first: lists ascend.
    PlacedBatch::each::<true>(spread, watch, [0.7, 1.0], |batch, numbers| {
        batch.each_row::<true>(spread, numbers, |number, row, x, length| {
            for end in slots(row_offsets, hash, row, x, length) {
                *end = end.wrapping_sub(1);
                let reference = references.get_mut(*end as usize);
                if let Some(reference) = reference.or_bug("a cell has too many references") {
                    *reference = number;
                }
            }
        });
        true
    })?;
    Ok(())
}

/// The slots that cells side by side have in the hash table.
#[inline(always)]
fn slots<'h>(
    row_offsets: &[i32],
    hash: &'h mut [u32],
    row: usize,
    x: u32,
    length: u32,
) -> &'h mut [u32] {
    let start = row_offsets.get(row).and_then(|&offset| slot(offset, x));
    let slots = start.and_then(|start| hash.get_mut(start..start + length as usize));
    slots.or_bug("cells without slots in the table").unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::bits::is_set;
    use crate::cell::{CellRange, row};
    use crate::one_level::displace;
    use crate::random;

    /// Primitives whose cells are written down.
    struct Written {
        resolution: [u32; 3],
        ranges: Vec<Option<CellRange>>,
    }

    impl Spread for Written {
        fn resolution(&self) -> [u32; 3] {
            self.resolution
        }

        fn count(&self) -> u32 {
            u32::try_from(self.ranges.len()).unwrap()
        }

        fn range(&self, number: u32) -> Option<CellRange> {
            self.ranges[number as usize]
        }

        fn place(&self, numbers: Range<u32>, batch: &mut PlacedBatch) {
            batch.place_each(self, numbers);
        }
    }

    /// Primitives of up to four cells an axis, a few with none and one that has a whole row.
    fn written(count: usize, resolution: [u32; 3]) -> Written {
        let mut state = 1_u32;
        let mut below = |end: u32| (random::next(&mut state) >> 8) % end;
        let mut ranges = Vec::new();
        for number in 0..count {
            let min: [u32; 3] = resolution.map(&mut below);
            let most = below(4) + 1;
            let max =
                core::array::from_fn(|axis| (min[axis] + below(most)).min(resolution[axis] - 1));
            let all = CellRange { min: [0; 3], max: [resolution[0] - 1, 0, 0] };
            ranges.push(match number % 50 {
                7 => None,
                49 => Some(all),
                _ => Some(CellRange { min, max }),
            });
        }
        Written { resolution, ranges }
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn every_primitive_is_in_the_lists_of_its_cells_and_in_no_others() {
        // A row of more cells than a batch can say, and a count on either side of a batch's end.
        for resolution in [[5, 7, 6], [1, 1, 1], [1030, 3, 2]] {
            for count in [0, 1, 50, 63, 64, 65, 300] {
                let spread = written(count, resolution);
                let [width, height, depth] = resolution.map(|cells| cells as usize);
                let mut expected = vec![Vec::new(); width * height * depth];
                for (number, range) in (0..).zip(&spread.ranges) {
                    for [x, y, z] in range.iter().flat_map(|range| range.cells()) {
                        let cell = row(resolution[1], y, z) * width + x as usize;
                        expected[cell].push(number);
                    }
                }
                let sum: usize = expected.iter().map(Vec::len).sum();
                let sum = u32::try_from(sum).unwrap();

                let mut domain_bits = vec![u64::MAX; expected.len().div_ceil(64)];
                let mut mark = |limit| mark(&spread, &mut domain_bits, limit, &Watch::none());
                if sum > 0 {
                    assert_eq!(mark(sum - 1), Ok(None));
                }
                assert_eq!(mark(sum), Ok(Some(sum)));
                for (cell, ids) in expected.iter().enumerate() {
                    assert_eq!(is_set(&domain_bits, cell), !ids.is_empty());
                }

                let mut offsets = vec![0; height * depth];
                let mut occupied = vec![7; expected.len().div_ceil(64) + 1];
                let slots = displace(&domain_bits, width, &mut offsets, &mut occupied).unwrap();
                let mut hash = vec![7; slots as usize + 1];
                let mut references = vec![0; sum as usize];
                fill(&spread, &offsets, &mut hash, &mut references, &Watch::none()).unwrap();
                for (cell, ids) in expected.iter().enumerate().filter(|(_, ids)| !ids.is_empty()) {
                    let x = u32::try_from(cell % width).unwrap();
                    let slot = slot(offsets[cell / width], x).unwrap();
                    let list = hash[slot] as usize..hash[slot + 1] as usize;
                    assert_eq!(references[list], **ids);
                }
            }
        }
    }
}
