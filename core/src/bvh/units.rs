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

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::bvh::layout::MOST_UNIT;

    /// The units of some bins, of which each holds what the layout promises.
    fn units(sizes: &[u32]) -> Vec<Range<usize>> {
        let all: usize = sizes.iter().map(|&size| size as usize).sum();
        let units: Vec<_> = Units::new(sizes).collect();
        let mut end = 0;
        let [_, others] = starts(sizes);
        for unit in &units {
            assert_eq!(unit.start, end, "{sizes:?}: {units:?}");
            end = unit.end;
            // A crowded bin is alone, and what is not crowded is never too much to sort.
            let is_crowded = unit.start < others as usize;
            assert_eq!(is_crowded, unit.end <= others as usize);
            assert!(is_crowded == (unit.len() > CROWD) || unit.len() <= MOST_UNIT);
            // Only what is left behind crowded bins is too little for a root.
            let is_small = unit.len() < LEAST_ROOT;
            assert!(!is_small || units.len() == 1 || unit.end == all && others > 0, "{units:?}");
        }
        assert_eq!(end, all, "{sizes:?}: {units:?}");
        units
    }

    #[expect(clippy::cast_possible_truncation, reason = "small")]
    #[test]
    fn bins_are_gathered_until_they_are_enough() {
        let (least, crowd) = (LEAST_ROOT as u32, CROWD as u32);
        assert_eq!(units(&[]), []);
        assert_eq!(units(&[0, 0, 0]), []);
        assert_eq!(units(&[0, 1, 0]), vec![0..1]);
        assert_eq!(units(&[least, least]).len(), 2);
        assert_eq!(units(&[least, least - 1]).len(), 1);
        assert_eq!(units(&[least - 1, 1, least]).len(), 2);
        assert_eq!(units(&[crowd, least, crowd]).len(), 3);
        // Crowded ones come first, and a small rest stays by itself.
        let more = crowd as usize + 1;
        assert_eq!(units(&[1, crowd + 1, 2]), [0..more, more..more + 3]);
        assert_eq!(units(&[least - 1, crowd, least - 1]), vec![0..CROWD + 2 * (LEAST_ROOT - 1)]);
        let mut state = 1_u32;
        for _ in 0..if cfg!(miri) { 20 } else { 2000 } {
            let mut sizes = [0; 64];
            for size in &mut sizes {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *size =
                    [0, 1, least - 1, least, 100, crowd, crowd + 1, 5000][(state >> 29) as usize];
            }
            units(&sizes);
        }
    }
}
