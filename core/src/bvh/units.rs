//! Bins gathered into units: what is made into roots in one go.

use core::ops::Range;

use super::layout::{CROWD, LEAST_ROOT};

/// Where the entries of crowded bins start, and where those of the others: crowded bins come first, so
/// that the others lie side by side.
pub(crate) fn starts(sizes: &[u32]) -> [u32; 2] {
    [0, sizes.iter().filter(|&&size| size as usize > CROWD).sum()]
}

/// The units of some bins, given how many entries each bin has: first each crowded bin, then the others,
/// gathered until a unit has enough entries for a root. What is left over belongs to the last unit.
#[derive(Clone)]
pub(crate) struct Units<'s> {
    sizes: &'s [u32],
    bin: usize,
    is_crowded: bool,
    start: usize,
    /// Entries of all bins.
    all: usize,
}

impl<'s> Units<'s> {
    pub(crate) fn new(sizes: &'s [u32]) -> Self {
        let all = sizes.iter().map(|&size| size as usize).sum();
        Self { sizes, bin: 0, is_crowded: true, start: 0, all }
    }

    /// The size of the next bin of its kind.
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
            let is_enough = end - start >= LEAST_ROOT;
            // A small rest joins its neighbour, but no crowded bin.
            let rest = self.all - end;
            if is_enough && (size > CROWD || rest >= LEAST_ROOT || rest == 0) {
                break;
            }
        }
        self.start = end;
        (end > start).then_some(start..end)
    }
}
