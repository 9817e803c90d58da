//! Groups bins into units, each of which is split into subtrees by itself.
//!
//! A unit should be a single bin: neighbours in Morton order may lie far apart, so a subtree over both has a large box.
//! But the memory bound allows only one subtree for [`TRIANGLES_PER_SUBTREE`] triangles. A running balance keeps to it.
//!
//! ```text
//! each crowded bin is a unit; balance = 0
//! for each other bin: add it to the unit
//!     left = balance + triangles of the unit - TRIANGLES_PER_SUBTREE * its subtrees; at a seam, at most 0
//!     if left is not negative, and no bin follows or left and the rest are enough for a subtree: end the unit,
//!         balance = left
//! ```

use core::ops::Range;

use super::layout::{CROWD, LEAST_PIECE, MOST_SUBTREE, TRIANGLES_PER_SUBTREE};

/// Returns the places at which the entries of crowded bins start, and those of the others: crowded bins come
/// first, so that the others lie side by side.
pub(crate) fn starts(sizes: &[u32]) -> [u32; 2] {
    [0, sizes.iter().filter(|&&size| size as usize > CROWD).sum()]
}

/// The balance: triangles that count towards further subtrees.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SubtreeBudget(usize);

impl SubtreeBudget {
    /// Subtracts the subtrees of a unit from the balance and returns true. Returns false if the balance is too small,
    /// or would be too small for a subtree over the `rest` entries behind the unit.
    pub(crate) fn take_subtrees(&mut self, unit: &Range<usize>, rest: usize) -> bool {
        let count = unit.len();
        let subtrees = if count > MOST_SUBTREE { count / LEAST_PIECE } else { 1 };
        let Some(left) = (self.0 + count).checked_sub(subtrees * TRIANGLES_PER_SUBTREE) else {
            return false;
        };
        let left = if is_seam(unit) { 0 } else { left };
        let is_enough = rest == 0 || left + rest >= TRIANGLES_PER_SUBTREE;
        if is_enough {
            self.0 = left;
        }
        is_enough
    }
}

/// Returns true if a task may end behind this unit. The balance starts again behind it, so that the subtrees of a task
/// depend on its own triangles alone.
pub(crate) const fn is_seam(unit: &Range<usize>) -> bool {
    unit.end - unit.start > CROWD || unit.start / SEAM != unit.end / SEAM
}

/// Triangles from one seam to the next, about.
pub(crate) const SEAM: usize = 16_384;

/// The units of some bins, given how many entries each bin has: first each crowded bin, then the
/// others, gathered until the balance is enough for a subtree. The rest belongs to the last unit.
#[derive(Clone)]
pub(crate) struct Units<'s> {
    sizes: &'s [u32],
    bin: usize,
    is_crowded: bool,
    start: usize,
    budget: SubtreeBudget,
    /// Entries of all bins.
    all: usize,
}

impl<'s> Units<'s> {
    pub(crate) fn new(sizes: &'s [u32]) -> Self {
        let all = sizes.iter().map(|&size| size as usize).sum();
        Self { sizes, bin: 0, is_crowded: true, start: 0, budget: SubtreeBudget::default(), all }
    }

    /// The size of the next crowded bin; after the last one, of the next other bin.
    fn next_bin(&mut self) -> Option<usize> {
        loop {
            let Some(&size) = self.sizes.get(self.bin) else {
                if !core::mem::take(&mut self.is_crowded) {
                    return None;
                }
                self.bin = 0;
                continue;
            };
            self.bin += 1;
            let size = size as usize;
            if size > 0 && (size > CROWD) == self.is_crowded {
                return Some(size);
            }
        }
    }
}

impl Iterator for Units<'_> {
    type Item = Range<usize>;

    fn next(&mut self) -> Option<Range<usize>> {
        let start = self.start;
        let mut end = start;
        while let Some(size) = self.next_bin() {
            end += size;
            if size > CROWD || self.budget.take_subtrees(&(start..end), self.all - end) {
                break;
            }
        }
        self.start = end;
        (end > start).then_some(start..end)
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::bvh::layout::{DIVISIONS, MOST_UNIT, most_nodes, most_of_subtree};
    use crate::random;

    /// The units of some bins. Checks that each unit keeps the promises of the layout.
    fn units(sizes: &[u32]) -> Vec<Range<usize>> {
        let all: usize = sizes.iter().map(|&size| size as usize).sum();
        let units: Vec<_> = Units::new(sizes).collect();
        let (mut end, mut balance) = (0, 0);
        let [_, others] = starts(sizes);
        for unit in &units {
            assert_eq!(unit.start, end, "{sizes:?}: {units:?}");
            end = unit.end;
            // A crowded bin is alone, and what is not crowded is never too much to sort.
            let is_crowded = unit.start < others as usize;
            assert_eq!(is_crowded, unit.end <= others as usize);
            assert!(if is_crowded { unit.len() > CROWD } else { unit.len() <= MOST_UNIT });
            if is_crowded {
                continue;
            }
            // Every subtree has its share of triangles, unless it is the only one or the last one behind crowded bins.
            let subtrees = if unit.len() > MOST_SUBTREE { unit.len() / LEAST_PIECE } else { 1 };
            let is_last = unit.end == all && (units.len() == 1 || others > 0);
            assert!(
                balance + unit.len() >= subtrees * TRIANGLES_PER_SUBTREE || is_last,
                "{sizes:?}: {units:?}"
            );
            balance = (balance + unit.len()).saturating_sub(subtrees * TRIANGLES_PER_SUBTREE);
            // The balance starts again behind a seam.
            balance = if is_seam(unit) { 0 } else { balance };
        }
        assert_eq!(end, all, "{sizes:?}: {units:?}");
        units
    }

    /// The bound of [`layout`](crate::bvh::layout) has room for the most nodes that its rules allow. Each crowd here is
    /// divided [`DIVISIONS`] times. Each division leaves one triangle that is a subtree by itself: behind a crowded
    /// bin, the last one outside of a dense box. The last one also makes subtrees with as many nodes as the budget
    /// allows. Above their roots are 4/7 nodes for each.
    #[test]
    fn the_bound_has_room_for_subtrees_behind_crowded_bins() {
        const CROWDS: usize = 100;
        const INSIDE: usize = MOST_UNIT + 1;
        let late = DIVISIONS as usize;
        let (mut budget, mut start) = (SubtreeBudget::default(), 0);
        let (mut roots, mut below) = (late, 0);
        while start < INSIDE {
            // The fewest triangles with a node below their root, and with two nodes.
            let fits = |&end: &usize| {
                end <= INSIDE && budget.clone().take_subtrees(&(start..end), INSIDE - end)
            };
            let end = [start + 13, start + 25].into_iter().find(fits).unwrap_or(INSIDE);
            budget.take_subtrees(&(start..end), INSIDE - end);
            (roots, below) =
                (roots + 1, below + most_of_subtree(end - start).min((end - start - 1) / 7));
            start = end;
        }
        let triangles = u32::try_from(CROWDS * (INSIDE + late)).unwrap();
        let nodes = CROWDS * (7 * below + 11 * roots) / 7;
        let most = most_nodes(triangles) as usize;
        assert!(nodes <= most, "{nodes} of {most}");
    }

    #[expect(clippy::cast_possible_truncation, reason = "small")]
    #[test]
    fn there_are_triangles_for_each_subtree() {
        let (least, crowd) = (TRIANGLES_PER_SUBTREE as u32, CROWD as u32);
        assert_eq!(units(&[]), []);
        assert_eq!(units(&[0, 0, 0]), []);
        assert_eq!(units(&[0, 1, 0]), vec![0..1]);
        assert_eq!(units(&[least, least]).len(), 2);
        // A bin with too few triangles joins the next one, and so does one before too few.
        assert_eq!(units(&[1, least]).len(), 1);
        assert_eq!(units(&[least, least - 1]).len(), 1);
        assert_eq!(units(&[least - 1, 1, least]).len(), 2);
        // The triangles that a large bin has to spare count for small bins behind it.
        assert_eq!(units(&[3 * least, 1, 0, 2, least - 3]).len(), 4);
        assert_eq!(units(&[least, 3 * least, 1, 0, 2, least - 3]).len(), 5);
        // Bins that are split into several subtrees have fewer to spare.
        assert_eq!(units(&[5 * 32, 5 * 8 - 1, 1]).len(), 3);
        assert_eq!(units(&[crowd, least, crowd]).len(), 3);
        // One triangle more than a single subtree takes makes four, which leave less for small bins.
        assert_eq!(units(&[MOST_SUBTREE as u32, 1, 1, least]).len(), 4);
        assert_eq!(units(&[MOST_SUBTREE as u32 + 1, 1, 1, least]).len(), 3);
        // Crowded bins come first, and the small rest is a unit of its own.
        let more = crowd as usize + 1;
        assert_eq!(units(&[1, crowd + 1, 2]), [0..more, more..more + 3]);
        // The balance starts again behind a seam, so a rest behind one joins what lies before it.
        assert_eq!(units(&[least - 1, crowd, least - 1]).len(), 1);
        let mut state = 1_u32;
        for _ in 0..if cfg!(miri) { 20 } else { 2000 } {
            let mut sizes = [0; 64];
            for size in &mut sizes {
                let some = [0, 1, least - 1, least, 100, crowd, crowd + 1, 5000];
                *size = some[(random::next(&mut state) >> 29) as usize];
            }
            units(&sizes);
        }
    }
}
