//! Closing the gaps between the parts of a pool that several tasks have filled.

use super::layout::Block;
use super::pool::{Filled, Part};
use crate::control::Control;
use crate::error::Error;
use crate::tasks::run;

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

/// Moves words down, or none if they are not there.
fn shift<const N: usize>(
    words: &mut [u32],
    from: usize,
    to: usize,
    count: usize,
    parallel: &Control<'_>,
) -> Result<(), Error> {
    /// Fewer would not be worth the caller's thread.
    const LEAST_WORDS: usize = 128 * 1024;
    let gap = from.saturating_sub(to);
    let end = from.checked_add(count);
    let mut window = end.and_then(|end| words.get_mut(to..end)).unwrap_or_default();
    let tasks = N.min(parallel.tasks as usize);
    if tasks > 1 && gap >= tasks * LEAST_WORDS {
        // As many words as the gap has go where nothing is any more: in any order.
        while window.len() > gap {
            let (free, rest) =
                core::mem::take(&mut window).split_at_mut_checked(gap).unwrap_or_default();
            let next = rest.get(..gap).unwrap_or(rest);
            let piece = next.len().div_ceil(tasks).max(1);
            let pieces = free.chunks_mut(piece).zip(next.chunks(piece));
            let copy = |(to, from): (&mut [u32], &[u32])| {
                to.iter_mut().zip(from).for_each(|(to, &word)| *to = word);
            };
            let _: [Option<()>; N] = run(parallel, pieces, copy)?;
            window = rest;
        }
    } else if gap <= window.len() {
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
    #[cfg_attr(miri, ignore = "hours")]
    fn words_are_moved_down_by_any_number_of_tasks() {
        let before: Vec<u32> = (0..800_000).collect();
        for (from, to) in [(0, 0), (1, 0), (200_000, 5000), (300_000, 1000), (500_000, 3)] {
            for count in [0, 1, 194_999, 195_000, 195_001, 300_000] {
                let mut expected = before.clone();
                expected.copy_within(from..from + count, to);
                let calls = AtomicU32::new(0);
                let backward = |count: u32, task: &(dyn Fn(u32) + Sync)| {
                    calls.fetch_add(1, Ordering::Relaxed);
                    (0..count).rev().for_each(task);
                };
                for tasks in 1..=4 {
                    let parallel = Control { tasks, run: &backward, progress: None };
                    let mut words = before.clone();
                    shift::<4>(&mut words, from, to, count, &parallel).unwrap();
                    // What lies behind is not part of the pool any more.
                    assert!(words[..to + count] == expected[..to + count], "{from} {to} {count}");
                    assert!(words[from + count..] == expected[from + count..]);
                }
                let is_cut = from - to >= 2 * 128 * 1024 && count > 1;
                assert_eq!(calls.into_inner() > 0, is_cut, "{from} {to} {count}");
            }
        }
    }

    #[test]
    fn words_that_are_not_there_are_not_moved() {
        let mut words = [1, 2, 3, 4];
        for (from, to, count) in [(2, 0, 3), (1, 0, 4), (usize::MAX, 0, 1), (5, 4, 0)] {
            shift::<1>(&mut words, from, to, count, &Control::SERIAL).unwrap();
            assert_eq!(words, [1, 2, 3, 4]);
        }
    }
}
