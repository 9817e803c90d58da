//! A bump allocator over words that the caller brought.
//!
//! It only moves forward and hands out words that nobody else has. When it runs out it goes on
//! counting: what a build used or would have needed is known at the end, to the word, either way.

/// Words to give away, and how many were asked for.
#[derive(Debug)]
pub(crate) struct Bump<'a> {
    free: &'a mut [u32],
    /// Words asked for so far, given or not.
    asked: u64,
    is_exhausted: bool,
}

impl<'a> Bump<'a> {
    /// An allocator over these words.
    pub(crate) fn new(words: &'a mut [u32]) -> Self {
        Self { free: words, asked: 0, is_exhausted: false }
    }

    /// The next `count` words, or `None` if they are not there. From then on there are none.
    pub(crate) fn take(&mut self, count: usize) -> Option<&'a mut [u32]> {
        self.asked += count as u64;
        match core::mem::take(&mut self.free).split_at_mut_checked(count) {
            Some((words, free)) if !self.is_exhausted => {
                self.free = free;
                Some(words)
            }
            _ => {
                self.is_exhausted = true;
                None
            }
        }
    }

    /// Words asked for so far, given or not.
    pub(crate) const fn asked(&self) -> u64 {
        self.asked
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_gives_what_it_has_and_counts_what_it_has_not() {
        let mut words = [7; 10];
        let mut bump = Bump::new(&mut words);
        bump.take(4).unwrap().fill(1);
        bump.take(3).unwrap().fill(2);
        assert!(bump.take(4).is_none() && bump.take(1).is_none() && bump.take(0).is_none());
        assert_eq!(bump.asked(), 12);
        assert_eq!(words, [1, 1, 1, 1, 2, 2, 2, 7, 7, 7]);
    }
}
