//! Entries with the same number of cells together, so that going
//! through their cells needs no branch.

use super::layout::{AXES, Entry, OTHERS};
use super::quarters::Format;

/// Entries of a block, together those that have two cells on the same axes.
///
/// How many cells an entry has is as good as random, and a loop over them, or a choice between
/// eight ways, costs a mispredicted branch or two: more than all else together. Among equals there
/// is nothing to predict, a third of the time with the grouping in it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Groups {
    /// Where each group starts, and the end.
    starts: [u32; Self::COUNT + 1],
}

impl Groups {
    /// One for every set of axes, and one for entries that are in
    /// three cells on an axis or in none.
    const COUNT: usize = 1 + Self::OTHERS;
    pub(super) const OTHERS: usize = OTHERS as usize;

    /// Puts entries that can be gone through twice where they are sorted.
    #[inline(always)]
    pub(super) fn collect<I: Iterator<Item = Entry>>(
        source: impl Fn() -> I,
        entries: &mut [Entry],
    ) -> Option<Self> {
        let mut counts = [0; Self::COUNT];
        for entry in source() {
            *counts.get_mut(entry.group() as usize)? += 1;
        }
        let mut starts = [0; Self::COUNT + 1];
        let mut start = 0;
        for (slot, count) in starts.iter_mut().zip(&mut counts) {
            *slot = start;
            start += core::mem::replace(count, start);
        }
        starts[Self::COUNT] = start;
        let mut cursors = counts;
        for entry in source() {
            let cursor = cursors.get_mut(entry.group() as usize)?;
            *entries.get_mut(*cursor as usize)? = entry;
            *cursor += 1;
        }
        Some(Self { starts })
    }

    /// Number of entries.
    pub(super) const fn count(&self) -> usize {
        self.starts[Self::COUNT] as usize
    }

    pub(super) fn group<'e>(&self, group: usize, entries: &'e [Entry]) -> &'e [Entry] {
        let ends = self.starts.get(group).zip(self.starts.get(group + 1));
        let range = ends.map(|(&start, &end)| start as usize..end as usize);
        range.and_then(|range| entries.get(range)).unwrap_or_default()
    }

    /// Shows every cell of the small entries, and what it lists of the entry.
    #[inline(always)]
    pub(super) fn each_small(
        &self,
        entries: &[Entry],
        format: Format,
        mut visit: impl FnMut(usize, u32),
    ) {
        // On its axes it is in a cell behind the near ones, and in one before the far ones.
        let mut show = |entry: &Entry, cell: u32, axes: u32, far: u32| {
            visit(cell as usize, entry.reference(format, far, axes & !far));
        };
        for entry in self.group(0, entries) {
            show(entry, entry.min(), 0, 0);
        }
        for axis in [1, 2, 4] {
            for entry in self.group(axis as usize, entries) {
                show(entry, entry.min(), axis, 0);
                show(entry, entry.max(), axis, axis);
            }
        }
        // Four cells: one of the two axes is x, or it is z.
        for (axes, axis, bits) in [(3, 1, AXES[0]), (5, 4, AXES[2]), (6, 4, AXES[2])] {
            for entry in self.group(axes as usize, entries) {
                let (min, max) = (entry.min(), entry.max());
                let step = (min ^ max) & bits;
                show(entry, min, axes, 0);
                show(entry, min ^ step, axes, axis);
                show(entry, max ^ step, axes, axes & !axis);
                show(entry, max, axes, axes);
            }
        }
        for entry in self.group(7, entries) {
            let (min, max) = (entry.min(), entry.max());
            let [x, y, z] = AXES.map(|axis| (min ^ max) & axis);
            let cells = [min, min ^ x, min ^ y, max ^ z, min ^ z, max ^ y, max ^ x, max];
            for (far, cell) in (0..).zip(cells) {
                show(entry, cell, 7, far);
            }
        }
    }
}
