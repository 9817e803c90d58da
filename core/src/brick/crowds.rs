//! What the crowded cells of a chunk list, before they are divided.
//!
//! They are many where a small object lies in a large scene. So the entries are gone through
//! for all of them at once, not for each: as many as there is room for.
//!
//! ```text
//! room | cell, count, ids | cell, count, ids | ...
//! ```

#![expect(clippy::cast_possible_truncation, reason = "numbers of cells")]

use super::groups::Groups;
use super::halves::Format;
use super::layout::{BLOCK_CELLS, Bench, Entry, MASK_BITS};
use super::sort::each_listed;
use crate::bits::{is_set, ones};

/// Words before the ids of a cell.
pub(super) const HEAD_WORDS: usize = 2;

/// The cursor of a cell that is not asked for.
const NOWHERE: u32 = u32::MAX;

/// A crowded cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crowd<'i> {
    /// Its number.
    pub(super) cell: u32,
    /// The triangles that it lists.
    pub(super) ids: &'i [u32],
}

/// The crowded cells of a chunk.
pub(super) struct Crowds<'e, 's> {
    entries: &'e [Entry],
    groups: &'e Groups,
    format: Format,
    room: &'s mut [u32],
    /// Words of the room that are lists.
    used: usize,
    /// Whether they are those of all cells that were asked for.
    is_all: bool,
}

impl<'e, 's> Crowds<'e, 's> {
    /// Those of a chunk with these entries. There must be room for the longest list.
    pub(super) const fn new(
        entries: &'e [Entry],
        groups: &'e Groups,
        format: Format,
        room: &'s mut [u32],
    ) -> Self {
        Self { entries, groups, format, room, used: 0, is_all: false }
    }

    /// The room, for the next chunk.
    pub(super) const fn into_room(self) -> &'s mut [u32] {
        self.room
    }

    /// Shows the cells whose bits are set, in order, and clears the bits of those
    /// that `visit` says no to. It gets the benches, of which the first one
    /// is used in between. How much each cell lists is counted again if `counts` does not say it.
    pub(super) fn each(
        &mut self,
        cells: &mut [u64],
        counts: Option<&[u32; BLOCK_CELLS]>,
        benches: &mut [Bench<'_>],
        mut visit: impl FnMut(Crowd<'_>, &mut [Bench<'_>]) -> bool,
    ) {
        let mut next = 0;
        while next < BLOCK_CELLS {
            // Once is enough where all found room.
            next =
                if self.is_all { BLOCK_CELLS } else { self.gather(cells, counts, next, benches) };
            let mut rest = self.room.get(..self.used).unwrap_or_default();
            while let Some((&[cell, count], behind)) = rest.split_first_chunk::<HEAD_WORDS>() {
                let Some((ids, behind)) = behind.split_at_checked(count as usize) else { break };
                rest = behind;
                let number = cell as usize;
                if is_set(cells, number)
                    && !visit(Crowd { cell, ids }, benches)
                    && let Some(bits) = cells.get_mut(number / MASK_BITS)
                {
                    *bits &= !(1 << (number % MASK_BITS));
                }
            }
        }
    }

    /// Gathers the lists of cells, from one on, and tells how far it came.
    fn gather(
        &mut self,
        cells: &[u64],
        counts: Option<&[u32; BLOCK_CELLS]>,
        first: usize,
        benches: &mut [Bench<'_>],
    ) -> usize {
        let Some(bench) = benches.first_mut() else { return BLOCK_CELLS };
        let cursors = &mut *bench.cells;

        // Count.
        cursors.fill(NOWHERE);
        for number in numbers(cells, first) {
            if let Some(cursor) = cursors.get_mut(number) {
                *cursor = counts.map_or(0, |counts| counts.get(number).copied().unwrap_or(0));
            }
        }
        if counts.is_none() {
            each_listed(self.groups, self.entries, self.format, |cell, _| {
                if let Some(cursor) = cursors.get_mut(cell) {
                    *cursor += u32::from(*cursor != NOWHERE);
                }
            });
        }

        // Give room to one cell after the other.
        let (mut used, mut end) = (0, BLOCK_CELLS);
        for number in numbers(cells, first) {
            let Some(cursor) = cursors.get_mut(number) else { break };
            let ids = used + HEAD_WORDS;
            let behind = ids + *cursor as usize;
            if end < BLOCK_CELLS || behind > self.room.len() {
                // One for which there is never room would be waited for for ever.
                let skipped = number + usize::from(used == 0);
                end = end.min(skipped);
                *cursor = NOWHERE;
                continue;
            }
            let head = self.room.get_mut(used..).and_then(|room| room.first_chunk_mut());
            if let Some(head) = head {
                *head = [number as u32, *cursor];
            }
            *cursor = ids as u32;
            used = behind;
        }

        // Fill.
        let (room, format) = (&mut *self.room, self.format);
        each_listed(self.groups, self.entries, format, |cell, reference| {
            if let Some(cursor) = cursors.get_mut(cell)
                && let Some(slot) = room.get_mut(*cursor as usize)
            {
                *slot = format.id(reference);
                *cursor += 1;
            }
        });
        (self.used, self.is_all) = (used, first == 0 && end == BLOCK_CELLS);
        end
    }
}

/// The numbers of the cells whose bits are set, from one on.
fn numbers(cells: &[u64], first: usize) -> impl Iterator<Item = usize> + '_ {
    let numbers = cells
        .iter()
        .enumerate()
        .flat_map(|(brick, &bits)| ones(bits).map(move |bit| brick * MASK_BITS + bit as usize));
    numbers.filter(move |&number| number >= first)
}
