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
use super::layout::{BLOCK_CELLS, Bench, Entry, MASK_BITS};
use super::quarters::Format;
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

    /// Shows the cells whose bits are set, in order, and leaves the bits of those that `visit` says
    /// yes to. It gets the benches, of which the first one is used in between. How much each cell
    /// lists is counted again if `counts` does not say it. Later calls may ask for fewer cells, not
    /// for others.
    pub(super) fn each(
        &mut self,
        cells: &mut [u64],
        counts: Option<&[u32; BLOCK_CELLS]>,
        benches: &mut [Bench<'_>],
        mut visit: impl FnMut(Crowd<'_>, &mut [Bench<'_>]) -> bool,
    ) {
        let mut kept = [0; BLOCK_CELLS / MASK_BITS];
        let mut next = 0;
        while next < BLOCK_CELLS {
            // Once is enough where all found room.
            let gathered = self.is_all.then_some(BLOCK_CELLS);
            next = gathered.unwrap_or_else(|| self.gather(cells, counts, next, benches));
            let mut rest = self.room.get(..self.used).unwrap_or_default();
            while let Some((&[cell, count], behind)) = rest.split_first_chunk::<HEAD_WORDS>() {
                let Some((ids, behind)) = behind.split_at_checked(count as usize) else { break };
                rest = behind;
                let (brick, bit) = (cell as usize / MASK_BITS, cell as usize % MASK_BITS);
                if is_set(cells, cell as usize)
                    && visit(Crowd { cell, ids }, benches)
                    && let Some(bits) = kept.get_mut(brick)
                {
                    *bits |= 1 << bit;
                }
            }
        }
        for (bits, kept) in cells.iter_mut().zip(kept) {
            *bits = kept;
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
                // It is the next one, but not for ever if there is never room for it.
                end = end.min(number + usize::from(used == 0));
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

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::brick::layout::{Class, number};

    /// Entries of up to four cells an axis, and what each cell lists of them in order.
    fn entries(count: usize) -> (Vec<Entry>, Groups) {
        let mut state = 1_u32;
        let mut below = |end: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % end
        };
        let source: Vec<Entry> = (0_u32..)
            .take(count)
            .map(|id| {
                // More of them toward the first cells, and some that no cell lists.
                let min = [0; 3].map(|_| below(16).min(below(16)).min(below(16)));
                let most = below(4) + 1;
                let max = min.map(|at| (at + below(most)).min(15));
                let class = if id % 11 == 3 { Class::Bricks } else { Class::Cells };
                Entry::new(id, min, max, class)
            })
            .collect();
        let mut entries = vec![Entry::default(); count];
        let groups = Groups::collect(|| source.iter().copied(), &mut entries).unwrap();
        (entries, groups)
    }

    #[test]
    fn each_cell_is_shown_once_whatever_the_room() {
        let format = Format::of(1);
        let (entries, groups) = entries(if cfg!(miri) { 60 } else { 1500 });
        let mut lists = vec![Vec::new(); BLOCK_CELLS];
        each_listed(&groups, &entries, format, |cell, word| lists[cell].push(format.id(word)));
        let counts: Vec<_> = lists.iter().map(|list| list.len() as u32).collect();
        let counts: &[u32; BLOCK_CELLS] = counts.first_chunk().unwrap();
        let longest = lists.iter().map(Vec::len).max().unwrap();
        let crowded = |cell: usize| lists[cell].len() > longest / 4;
        let expected: Vec<usize> = (0..BLOCK_CELLS).filter(|&cell| crowded(cell)).collect();
        assert!(expected.len() > 9 && counts[number([0; 3]) as usize] > 1);

        let all = expected.iter().map(|&cell| HEAD_WORDS + lists[cell].len()).sum();
        for words in [HEAD_WORDS + longest, 2 * longest, all - 1, all, 2 * all] {
            for counts in [None, Some(counts)] {
                let mut bits = vec![0_u64; BLOCK_CELLS / MASK_BITS];
                for &cell in &expected {
                    bits[cell / MASK_BITS] |= 1 << (cell % MASK_BITS);
                }
                let (mut cells, mut room) = (vec![7; BLOCK_CELLS], vec![7; words]);
                let mut benches = [Bench { cells: &mut cells, ..Bench::default() }];
                let mut crowds = Crowds::new(&entries, &groups, format, &mut room);
                let mut show = |bits: &mut [u64], counts, is_kept: fn(usize) -> bool| {
                    let mut shown = Vec::new();
                    crowds.each(bits, counts, &mut benches, |Crowd { cell, ids }, benches| {
                        assert_eq!(ids, lists[cell as usize], "{words} words, cell {cell}");
                        // Whoever divides a cell counts on the bench.
                        benches[0].cells.fill(3);
                        shown.push(cell as usize);
                        is_kept(cell as usize)
                    });
                    shown
                };
                assert_eq!(show(&mut bits, counts, |cell| cell % 3 != 0), expected);
                let kept: Vec<_> = expected.iter().copied().filter(|cell| cell % 3 != 0).collect();
                assert_eq!(show(&mut bits, None, |_| true), kept);
                assert_eq!(show(&mut bits, None, |_| false), kept);
                assert_eq!(bits, [0; BLOCK_CELLS / MASK_BITS]);
            }
        }
    }

    #[test]
    fn a_list_without_room_is_not_waited_for() {
        let (entries, groups) = entries(200);
        let (mut cells, mut room) = (vec![0; BLOCK_CELLS], [0; HEAD_WORDS]);
        let mut benches = [Bench { cells: &mut cells, ..Bench::default() }];
        let mut crowds = Crowds::new(&entries, &groups, Format::of(1), &mut room);
        let mut bits = [u64::MAX; BLOCK_CELLS / MASK_BITS];
        crowds.each(&mut bits, None, &mut benches, |crowd, _| crowd.ids.is_empty());
        let empty: u32 = bits.iter().map(|bits| bits.count_ones()).sum();
        assert!(empty > 0 && (empty as usize) < BLOCK_CELLS);
    }
}
