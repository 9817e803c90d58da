//! A bump allocator over words that the caller brought, for the structures whose size is known only
//! when they are built.
//!
//! It only moves forward and hands out each word once. When it runs out it goes on counting, so that the words
//! that a build used, or would have needed, are known at its end.
//!
//! ```text
//! blob | header | fixed sections, if any | pool of words, list after list ->     | padding |
//! ```

use crate::arena::{first_mut, section_bytes, whole};
use crate::blob::{HEADER_BYTES, Header};
use crate::error::{ConfigField, Error, Region};
use crate::invariant::OrBug;

/// The bit of an offset into a pool that tells a grid from a list.
pub(crate) const GRID: u32 = 1 << 31;

/// Words to give away, and how many were asked for.
#[derive(Debug)]
pub(crate) struct Bump<'a> {
    free: &'a mut [u32],
    /// Words asked for so far, given or not.
    asked: u64,
    is_exhausted: bool,
}

impl<'a> Bump<'a> {
    /// An allocator over the whole words of a pool.
    pub(crate) fn over(pool: &'a mut [u8]) -> Self {
        Self { free: whole(pool), asked: 0, is_exhausted: false }
    }

    /// The next `count` words, or `None` if they do not fit; from then on always `None`.
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

    /// Returns the offset at which the pool goes on: the words asked for so far, given or not. An error if
    /// it is not below [`GRID`].
    pub(crate) fn offset(&self) -> Result<u32, Error> {
        let offset = u32::try_from(self.asked).ok().filter(|offset| offset & GRID == 0);
        offset.ok_or(Error::InvalidConfig(ConfigField::Density))
    }
}

/// Ends a build: puts the header in front of the pool and zeros behind it, and returns the blob. An error tells what
/// the index would have needed.
pub(crate) fn finish(index: &mut [u8], header: Header) -> Result<&[u8], Error> {
    let blob = first_mut(index, header.blob_bytes, Region::Index)?;
    let words = u64::from(header.reference_count);
    let padding = section_bytes::<u32>(words) - words * size_of::<u32>() as u64;
    let padding = usize::try_from(padding).ok().and_then(|padding| blob.len().checked_sub(padding));
    let padding = padding.and_then(|start| blob.get_mut(start..));
    if let Some(padding) = padding.or_bug("padding before the blob") {
        padding.fill(0);
    }
    if let Some(head) = blob.first_chunk_mut::<HEADER_BYTES>().or_bug("a blob without a header") {
        *head = header.to_bytes();
    }
    Ok(blob)
}

#[cfg(test)]
mod tests {
    use zerocopy::IntoBytes;

    use super::*;

    #[test]
    fn it_gives_what_it_has_and_counts_what_it_has_not() {
        let mut words = [7; 10];
        let mut bump = Bump::over(words.as_mut_bytes());
        bump.take(4).unwrap().fill(1);
        bump.take(3).unwrap().fill(2);
        assert!(bump.take(4).is_none() && bump.take(1).is_none() && bump.take(0).is_none());
        assert_eq!(bump.offset(), Ok(12));
        assert_eq!(words, [1, 1, 1, 1, 2, 2, 2, 7, 7, 7]);
    }

    #[test]
    fn a_place_never_has_the_bit_of_a_grid() {
        let mut bump = Bump::over(&mut []);
        assert!(bump.take(GRID as usize - 1).is_none());
        assert_eq!(bump.offset(), Ok(GRID - 1));
        for count in [1, GRID as usize] {
            assert!(bump.take(count).is_none());
            assert_eq!(bump.offset(), Err(Error::InvalidConfig(ConfigField::Density)));
        }
    }
}
