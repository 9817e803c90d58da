//! The caller's memory: checked views of a region, and [`Block`], from which Rust callers make aligned regions.
//!
//! There is no allocator here. A region is a slice of bytes that starts at a multiple of 64; a layout says at which
//! byte each section starts, and the cast from bytes to words is checked (alignment and length), never assumed.

use core::fmt;
use core::ops::Range;

use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use crate::error::{Error, Region};
use crate::limits::ALIGNMENT;

/// Bytes of the two regions that a build takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// For the region that keeps the grid.
    pub index_bytes: usize,
    /// For the region that only the build needs.
    pub scratch_bytes: usize,
    /// True if `index_bytes` is exactly what the build needs; otherwise it is an upper bound. `scratch_bytes` is an
    /// upper bound, and exact for one-level and fixed grids.
    pub is_exact: bool,
}

impl Sizes {
    /// Sizes from counts in 64 bits; an error if they do not fit the machine's address space. A
    /// bound is never larger than the largest region that the machine can have.
    pub(crate) fn new(index_bytes: u64, scratch_bytes: u64, is_exact: bool) -> Result<Self, Error> {
        let largest = if is_exact { u64::MAX } else { isize::MAX.unsigned_abs() as u64 };
        let index_bytes = index_bytes.min(largest);
        let fit = |bytes: u64| usize::try_from(bytes).map_err(|_| Error::TooManyTriangles);
        let (index_bytes, scratch_bytes) = (fit(index_bytes)?, fit(scratch_bytes)?);
        Ok(Self { index_bytes, scratch_bytes, is_exact })
    }
}

/// 64 aligned bytes: the unit from which Rust callers make regions.
///
/// ```
/// use hgrid_core::Block;
/// static SCRATCH: [Block; 4] = [Block::ZERO; 4];
/// let mut index = vec![Block::ZERO; Block::count_for(1000)];
/// assert_eq!(Block::bytes_mut(&mut index).len(), 1024);
/// ```
#[repr(C, align(64))]
#[derive(Clone, Copy, FromBytes, Immutable, IntoBytes, KnownLayout)]
pub struct Block([u8; ALIGNMENT]);

impl fmt::Debug for Block {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Block")
    }
}

impl Block {
    /// A block of zeros.
    pub const ZERO: Self = Self([0; ALIGNMENT]);

    /// Returns the number of blocks that hold this many bytes.
    #[must_use]
    pub const fn count_for(bytes: usize) -> usize {
        bytes.div_ceil(ALIGNMENT)
    }

    /// The blocks as a region to build or open a grid in.
    #[must_use]
    pub fn bytes(blocks: &[Self]) -> &[u8] {
        blocks.as_bytes()
    }

    /// The blocks as a region to build a grid in.
    #[must_use]
    pub fn bytes_mut(blocks: &mut [Self]) -> &mut [u8] {
        blocks.as_mut_bytes()
    }
}

/// Refuses a region that does not start at a multiple of [`ALIGNMENT`], unless it is empty.
pub(crate) fn check_alignment(bytes: &[u8], region: Region) -> Result<(), Error> {
    let is_aligned = bytes.is_empty() || bytes.as_ptr().addr().is_multiple_of(ALIGNMENT);
    if is_aligned { Ok(()) } else { Err(Error::Misaligned { region }) }
}

/// The first bytes of a region, as many as a call needs.
pub(crate) fn first_mut(bytes: &mut [u8], needed: u64, region: Region) -> Result<&mut [u8], Error> {
    let too_small = Error::out_of_memory(region, needed, bytes.len() as u64);
    usize::try_from(needed).ok().and_then(|end| bytes.get_mut(..end)).ok_or(too_small)
}

/// The next multiple of [`ALIGNMENT`].
pub(crate) const fn align_up(bytes: u64) -> u64 {
    bytes.saturating_add(ALIGNMENT as u64 - 1) & !(ALIGNMENT as u64 - 1)
}

/// Bytes of a section of `count` words, padding included.
pub(crate) const fn section_bytes<T>(count: u64) -> u64 {
    align_up(count.saturating_mul(size_of::<T>() as u64))
}

/// A section of `count` words at the start of `bytes`, and the bytes behind it. The padding is
/// zeroed, the words are whatever was there.
pub(crate) fn split_mut<T: FromBytes + IntoBytes>(
    bytes: &mut [u8],
    count: u64,
) -> Option<(&mut [T], &mut [u8])> {
    let section = usize::try_from(section_bytes::<T>(count)).ok()?;
    let (section, rest) = bytes.split_at_mut_checked(section)?;
    let count = usize::try_from(count).ok()?;
    let (words, padding) = <[T]>::mut_from_prefix_with_elems(section, count).ok()?;
    padding.fill(0);
    Some((words, rest))
}

/// A section of `count` words at the start of `bytes`, and the bytes behind it. `None` also if the
/// padding is not zero, as every build leaves it.
pub(crate) fn split<T: FromBytes + Immutable>(bytes: &[u8], count: u64) -> Option<(&[T], &[u8])> {
    let (words, rest) = split_bytes(bytes, count, size_of::<T>() as u64)?;
    Some((<[T]>::ref_from_bytes(words).ok()?, rest))
}

/// [`split`] for words of any size, as bytes. Out of line: one copy serves all types.
#[inline(never)]
fn split_bytes(bytes: &[u8], count: u64, size: u64) -> Option<(&[u8], &[u8])> {
    let used = count.saturating_mul(size);
    let (section, rest) = bytes.split_at_checked(usize::try_from(align_up(used)).ok()?)?;
    let (words, padding) = section.split_at_checked(usize::try_from(used).ok()?)?;
    if padding.iter().any(|&byte| byte != 0) { None } else { Some((words, rest)) }
}

/// The bytes as elements, as many as fit whole; none if the bytes are not aligned for them.
pub(crate) fn whole<T: FromBytes + IntoBytes>(bytes: &mut [u8]) -> &mut [T] {
    let is_aligned = bytes.as_ptr().addr().is_multiple_of(align_of::<T>());
    debug_assert!(bytes.len() < size_of::<T>() || is_aligned, "memory of a build is not aligned");
    <[T]>::mut_from_prefix(bytes).map_or(&mut [], |(elements, _)| elements)
}

/// Copies words between sections of the same length.
pub(crate) fn copy<T: Copy>(from: &[T], to: &mut [T]) {
    debug_assert!(from.len() == to.len(), "sections of two lengths");
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

/// Moves elements to an earlier place, like `copy_within`, but without code to panic.
pub(crate) fn move_down<T: Copy>(elements: &mut [T], from: Range<usize>, to: usize) {
    debug_assert!(to <= from.start && from.end <= elements.len(), "elements move past an end");
    for (at, to) in from.zip(to..) {
        let Some(&element) = elements.get(at) else { return };
        if let Some(slot) = elements.get_mut(to) {
            *slot = element;
        }
    }
}
