//! Moves the entry of every triangle into its bin.
//!
//! ```text
//! counts of each task and bin --> where the entries of each task start in each bin (place_tasks)
//! for each task: for each triangle of its share: write the entry, move the start of its bin by one (scatter)
//! ```

use super::key::{KEY_BITS, NO_KEY};
use super::layout::{CROWD, Entry};
use super::units::starts;
use crate::control::Control;
use crate::error::Error;
use crate::invariant::OrBug;
use crate::simd::IS_SMALL;
#[cfg(target_has_atomic = "32")]
use crate::tasks::{Shared, run, share, take};

/// Turns the bin counts of all tasks into write positions: within a bin, entries are in the order of the tasks.
pub(super) fn place_tasks(sizes: &mut [u32], counts: &mut [u32], bits: u32) {
    let mut next = starts(sizes);
    for (bin, &size) in sizes.iter().enumerate() {
        let next = &mut next[usize::from(size as usize <= CROWD)];
        for task in 0..counts.len() >> bits {
            let count =
                counts.get_mut(task << bits | bin).or_bug("a bin of a task without a count");
            let Some(count) = count else { continue };
            *next += core::mem::replace(count, *next);
        }
    }
}

/// Moves every triangle's entry to its bin.
pub(super) fn scatter(
    keys: &[u32],
    entries: &mut [Entry],
    counts: &mut [u32],
    bits: u32,
    control: &Control<'_>,
) -> Result<(), Error> {
    let tasks = counts.len() >> bits;
    let shift = KEY_BITS - bits;
    if IS_SMALL || tasks == 1 {
        move_each(0, keys, counts, shift, |place, moved| {
            let entry = entries.get_mut(place).or_bug("a bin has more entries than were counted");
            if let Some(entry) = entry {
                *entry = moved;
            }
        });
        return Ok(());
    }
    #[cfg(target_has_atomic = "32")]
    {
        scatter_by_tasks(keys, entries, counts, bits, control)
    }
    #[cfg(not(target_has_atomic = "32"))]
    {
        let _ = control;
        debug_assert!(false, "several tasks without atomics");
        Err(Error::InvalidParallelFor)
    }
}

/// Passes `put` the entry of each triangle and its place, the next one of its bin. `first` is the first triangle.
#[inline(always)]
fn move_each(
    first: u32,
    keys: &[u32],
    heads: &mut [u32],
    shift: u32,
    mut put: impl FnMut(usize, Entry),
) {
    for (id, &key) in (first..).zip(keys) {
        // A triangle that is left out has a key behind that of all bins.
        let Some(head) = heads.get_mut((key >> shift) as usize) else {
            debug_assert!(key == NO_KEY, "a key behind those of all bins");
            continue;
        };
        put(*head as usize, [key, id]);
        *head += 1;
    }
}

/// [`scatter`] with several tasks.
#[cfg(target_has_atomic = "32")]
#[expect(clippy::cast_possible_truncation, reason = "numbers of triangles, which fit into 32 bits")]
fn scatter_by_tasks(
    keys: &[u32],
    entries: &mut [Entry],
    counts: &mut [u32],
    bits: u32,
    control: &Control<'_>,
) -> Result<(), Error> {
    let (tasks, shift) = (counts.len() >> bits, KEY_BITS - bits);
    let entries = Shared::new(entries.as_flattened_mut());
    let mut counts = counts;
    let parts = (0..tasks).map(|task| {
        let heads = take(&mut counts, 1 << bits);
        let range = share(keys.len(), task, tasks);
        let first = range.start as u32;
        (first, keys.get(range).or_bug("a task behind the keys").unwrap_or_default(), heads)
    });
    let move_all = |(first, keys, heads): (u32, &[u32], &mut [u32])| {
        move_each(first, keys, heads, shift, |place, moved| entries.set(2 * place, moved));
    };
    run(control, parts, move_all, |()| Ok(()))
}
