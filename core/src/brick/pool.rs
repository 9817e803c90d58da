//! The pool while it is filled: a part for each task, with chunks from
//! its start and bins at its end.
//!
//! ```text
//! part | chunk | chunk | ->      unread bins | bin | bin | bin |
//! ```
//!
//! An entry has two words and a sorted one takes nearly three, so that the chunks end about where
//! the bins began to. What a part needs is the largest sum of chunks written and bins unread; where
//! it ends before that, it goes on counting and says so.

#![expect(clippy::cast_possible_truncation, reason = "words of a region")]

use super::groups::Groups;
use super::layout::{Block, ENTRY_WORDS, Entry};

/// A task's share of the pool. Places are words of the pool.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Part {
    /// Its first block, and the one after its last.
    pub(super) blocks: [usize; 2],
    /// Entries of its blocks.
    pub(super) entries: u64,
    /// Words at its start that are taken already.
    pub(super) taken: u64,
    /// Where it starts.
    pub(super) start: u64,
    /// Where its bins start.
    pub(super) bins: u64,
    /// Where it ends.
    pub(super) end: u64,
}

impl Part {
    /// Words of its bins.
    pub(super) const fn bin_words(&self) -> u64 {
        self.entries * ENTRY_WORDS as u64
    }
}

/// How a part was filled.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Filled {
    /// Words taken, given or not.
    pub(super) taken: u64,
    /// The most words that chunks and unread bins took together.
    pub(super) most: u64,
    pub(super) is_exhausted: bool,
}

/// A part while it is filled. Places are words of the part.
pub(super) struct Pool<'a> {
    words: &'a mut [u32],
    /// Where the block that is being sorted starts.
    start: u64,
    /// Where the first unread bin lies.
    bins: usize,
    /// Words of unread bins.
    unread: usize,
    filled: Filled,
}

impl<'a> Pool<'a> {
    /// The words of a part whose bins are full.
    pub(super) fn new(part: &Part, words: &'a mut [u32]) -> Self {
        let Part { taken, start, bins, .. } = *part;
        let unread = part.bin_words();
        let filled = Filled { taken, most: taken + unread, is_exhausted: false };
        let (bins, unread) = ((bins - start) as usize, unread as usize);
        Self { words, start: taken, bins, unread, filled }
    }

    /// The next `count` words, or `None` if they are only counted.
    pub(super) fn take(&mut self, count: usize) -> Option<&mut [u32]> {
        let start = self.filled.taken;
        let taken = start + count as u64;
        self.filled.taken = taken;
        self.filled.most = self.filled.most.max(taken + self.unread as u64);
        let end = usize::try_from(taken).ok().filter(|&end| self.clear(end));
        self.filled.is_exhausted |= end.is_none();
        if self.filled.is_exhausted {
            return None;
        }
        self.words.get_mut(usize::try_from(start).ok()?..end?)
    }

    /// Writes words of the block that were taken before.
    pub(super) fn set(&mut self, at: u32, words: &[u32]) {
        let at = usize::try_from(self.start + u64::from(at)).unwrap_or(usize::MAX);
        let slots = self.words.get_mut(at..).filter(|_| !self.filled.is_exhausted);
        for (slot, &word) in slots.into_iter().flatten().zip(words) {
            *slot = word;
        }
    }

    /// Where the next word goes, behind the start of the block.
    pub(super) fn position(&self) -> u32 {
        u32::try_from(self.filled.taken - self.start).unwrap_or(u32::MAX)
    }

    /// Whether chunks may go up to `end`; the unread bins are moved to the end of the part if they
    /// are in the way.
    fn clear(&mut self, end: usize) -> bool {
        let last = self.words.len().saturating_sub(self.unread);
        if end > self.bins && self.bins < last {
            let window = self.words.get_mut(self.bins..).unwrap_or_default();
            if let Some(to) = window.len().checked_sub(self.unread) {
                window.copy_within(..self.unread, to);
            }
            self.bins = last;
        }
        end <= self.bins.min(last)
    }

    /// Moves the next bin to where it is sorted.
    #[inline(always)]
    pub(super) fn read_bin(&mut self, count: usize, to: &mut [Entry]) -> Option<Groups> {
        let count = count.min(self.unread);
        let bins = self.words.get(self.bins..self.bins + count)?;
        let bins: &[Entry] = bytemuck::try_cast_slice(bins).ok()?;
        let groups = Groups::collect(|| bins.iter().copied(), to);
        self.bins += count;
        self.unread -= count;
        self.start = self.filled.taken;
        groups
    }

    /// The block that was sorted since the last bin was read, at its place in the part.
    pub(super) fn placed(&self, block: Block) -> Block {
        Block { base: self.start as u32, ..block }
    }

    pub(super) const fn filled(&self) -> Filled {
        self.filled
    }
}
