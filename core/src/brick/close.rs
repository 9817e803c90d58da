//! Closing the gaps between the parts of a pool that several tasks have filled.

use super::layout::Block;
use super::pool::{Filled, Part};
use crate::control::Control;
use crate::error::Error;
use crate::tasks::{run, task_count};

/// Moves the chunks of all parts together and returns where they end.
#[expect(clippy::cast_possible_truncation, reason = "numbers of words in a region")]
pub(super) fn close<'p, const N: usize>(
    parts: impl Iterator<Item = (&'p Part, &'p Filled)>,
    blocks: &mut [Block],
    words: &mut [u32],
    parallel: &Control<'_>,
) -> Result<u64, Error> {
    let mut end = 0;
    for (part, filled) in parts {
        if part.start > end {
            let (from, to) = (part.start as usize, end as usize);
            shift::<N>(words, from, to, filled.taken as usize, parallel)?;
        }
        if end > 0 {
            let blocks = blocks.get_mut(part.blocks[0]..part.blocks[1]).unwrap_or_default();
            for block in blocks.iter_mut().filter(|block| **block != Block::default()) {
                block.base += end as u32;
            }
        }
        end += filled.taken;
    }
    Ok(end)
}

/// Fewer words would not be worth the caller's thread. In unit tests there are not many.
const LEAST_WORDS: usize = if cfg!(test) { 100 } else { 128 * 1024 };

/// Moves words down, or none if they are not there.
fn shift<const N: usize>(
    words: &mut [u32],
    from: usize,
    to: usize,
    count: usize,
    parallel: &Control<'_>,
) -> Result<(), Error> {
    let gap = from.saturating_sub(to);
    let end = from.checked_add(count);
    let mut window = end.and_then(|end| words.get_mut(to..end)).unwrap_or_default();
    // As many words as the gap is wide go to where nothing is left, so they may go in any order.
    let tasks = task_count::<N>(parallel, gap / LEAST_WORDS) as usize;
    while tasks > 1 && window.len().saturating_sub(gap) > LEAST_WORDS {
        let (free, rest) =
            core::mem::take(&mut window).split_at_mut_checked(gap).unwrap_or_default();
        let next = rest.get(..gap).unwrap_or(rest);
        let piece = next.len().div_ceil(tasks).max(LEAST_WORDS);
        let pieces = free.chunks_mut(piece).zip(next.chunks(piece));
        let copy = |(to, from): (&mut [u32], &[u32])| {
            to.iter_mut().zip(from).for_each(|(to, &word)| *to = word);
        };
        let _: [Option<()>; N] = run(parallel, pieces, copy)?;
        window = rest;
    }
    if gap <= window.len() {
        window.copy_within(gap.., 0);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;
    use core::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    #[test]
    fn words_are_moved_down_by_any_number_of_tasks() {
        const TO: usize = 7;
        let before: Vec<u32> = (0..3000).collect();
        for gap in [0, 1, 99, 199, 200, 201, 350, 500] {
            for count in [0, 1, 100, 101, gap, gap + 1, 2 * gap + 100, 2 * gap + 101, 3 * gap + 7] {
                let from = TO + gap;
                let mut expected = before.clone();
                expected.copy_within(from..from + count, TO);
                for tasks in 1..=4 {
                    let calls = AtomicU32::new(0);
                    let backward = |count: u32, task: &(dyn Fn(u32) + Sync)| {
                        assert!((2..=tasks).contains(&count));
                        calls.fetch_add(1, Ordering::Relaxed);
                        (0..count).rev().for_each(task);
                    };
                    let parallel = Control { tasks, run: &backward, progress: None };
                    let mut words = before.clone();
                    shift::<4>(&mut words, from, TO, count, &parallel).unwrap();
                    // What lies behind is not part of the pool any more.
                    assert_eq!(words[..TO + count], expected[..TO + count], "{gap} {count}");
                    assert_eq!(words[from + count..], expected[from + count..]);
                    // A round for every width of the gap, but for a few words left at the end.
                    let rounds = (count + gap).saturating_sub(100 + 1) / gap.max(1);
                    let rounds = if tasks > 1 && gap >= 200 { rounds } else { 0 };
                    let rounds = u32::try_from(rounds).unwrap();
                    assert_eq!(calls.into_inner(), rounds, "{gap} {count} {tasks}");
                }
            }
        }
    }

    #[test]
    fn a_loop_that_leaves_out_a_task_is_an_error() {
        let mut words: Vec<u32> = (0..2000).collect();
        let half = |count: u32, task: &(dyn Fn(u32) + Sync)| (1..count).for_each(task);
        let parallel = Control { tasks: 2, run: &half, progress: None };
        let moved = shift::<2>(&mut words, 500, 0, 1000, &parallel);
        assert_eq!(moved, Err(Error::InvalidParallelFor));
    }

    #[test]
    fn words_that_are_not_there_are_not_moved() {
        let before: Vec<u32> = (0..1000).collect();
        let mut words = before.clone();
        let none = |_: u32, _: &(dyn Fn(u32) + Sync)| panic!("there is nothing to do");
        let parallel = Control { tasks: 4, run: &none, progress: None };
        for (from, to, count) in
            [(500, 0, 501), (1, 0, 1000), (usize::MAX, 0, 1), (1001, 4, 0), (900, 0, usize::MAX)]
        {
            shift::<4>(&mut words, from, to, count, &parallel).unwrap();
            assert_eq!(words, before);
        }
    }
}
