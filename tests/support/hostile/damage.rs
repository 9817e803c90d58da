//! Ways to damage a blob, as a fuzzer chooses them.

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_core::{BlobInfo, Error, Grid, Ray};

use super::memory::rarely;
use super::rays;
use super::seeds::{Seed, seed};
use crate::copy::Copy;

/// One change. Offsets are in words and wrap around.
#[derive(Debug, Clone, Copy, Arbitrary)]
pub enum Edit {
    /// Replaces a word.
    Set { at: u16, word: u32 },
    /// Flips a bit.
    Flip { at: u16, bit: u8 },
    /// Changes a word by a little.
    Add { at: u16, by: i8 },
    /// Replaces a byte.
    Byte { at: u32, byte: u8 },
    /// Copies words from elsewhere.
    Copy { from: u16, to: u16, words: u8 },
    /// Exchanges two words.
    Swap { a: u16, b: u16 },
    /// Writes many equal bytes.
    Fill { at: u16, words: u8, byte: u8 },
    /// Removes words; those after them move up.
    Remove { at: u16, words: u8 },
    /// Inserts words of zeros; those after them move down.
    Insert { at: u16, words: u8 },
    /// Cuts bytes off the end.
    Cut { bytes: u16 },
    /// Adds bytes at the end.
    Extend { bytes: u16, byte: u8 },
}

impl Edit {
    /// Makes the change.
    pub fn apply(self, bytes: &mut Vec<u8>) {
        let words = bytes.len() / 4;
        let place = |at: u16| usize::from(at) % words.max(1);
        let get = |bytes: &[u8], at: u16| {
            let word = bytes.as_chunks::<4>().0.get(place(at));
            u32::from_ne_bytes(word.copied().unwrap_or_default())
        };
        let set = |bytes: &mut [u8], at: u16, word: u32| {
            if let Some(slot) = bytes.as_chunks_mut::<4>().0.get_mut(place(at)) {
                *slot = word.to_ne_bytes();
            }
        };
        match self {
            Self::Set { at, word } => set(bytes, at, word),
            Self::Flip { at, bit } => {
                let word = get(bytes, at);
                set(bytes, at, word ^ 1 << (bit % 32));
            }
            Self::Add { at, by } => {
                let word = get(bytes, at);
                set(bytes, at, word.wrapping_add_signed(by.into()));
            }
            Self::Byte { at, byte } => {
                let length = bytes.len().max(1);
                if let Some(slot) = bytes.get_mut(at as usize % length) {
                    *slot = byte;
                }
            }
            Self::Copy { from, to, words: count } => {
                let (from, to) = (4 * place(from), 4 * place(to));
                let length = (4 * usize::from(count)).min(bytes.len() - from.max(to));
                bytes.copy_within(from..from + length, to);
            }
            Self::Swap { a, b } => {
                let (first, second) = (get(bytes, a), get(bytes, b));
                set(bytes, a, second);
                set(bytes, b, first);
            }
            Self::Fill { at, words: count, byte } => {
                let (start, length) = (4 * place(at), bytes.len());
                bytes[start..(start + 4 * usize::from(count)).min(length)].fill(byte);
            }
            Self::Remove { at, words: count } => {
                let (start, length) = (4 * place(at), bytes.len());
                bytes.drain(start..(start + 4 * usize::from(count)).min(length));
            }
            Self::Insert { at, words: count } => {
                let start = 4 * place(at);
                bytes.splice(start..start, std::iter::repeat_n(0, 4 * usize::from(count)));
            }
            Self::Cut { bytes: count } => {
                bytes.truncate(bytes.len() - place_of(count, bytes.len()))
            }
            Self::Extend { bytes: count, byte } => {
                bytes.resize(bytes.len() + usize::from(count % 4096), byte);
            }
        }
    }
}

/// Returns a number of bytes from 0 to `length`.
const fn place_of(count: u16, length: usize) -> usize {
    count as usize % (length + 1)
}

/// A seed, and a changed blob to open with the seed's mesh or with the mesh in the blob.
#[derive(Debug)]
pub(super) struct Damaged {
    seed: &'static Seed,
    copy: Copy,
    is_packed: bool,
}

impl Damaged {
    /// Reads a seed with changes, or a blob from the remaining bytes.
    pub(super) fn new(u: &mut Unstructured<'_>) -> Result<Self> {
        let seed = seed(u8::arbitrary(u)?.into());
        let (is_own, is_signed) = (rarely(u, 16)?, !rarely(u, 16)?);
        let is_packed = rarely(u, 4)?;
        let mut bytes = if is_packed { seed.packed.clone() } else { seed.blob.clone() };
        if is_own {
            bytes = u.arbitrary_iter::<u8>()?.collect::<Result<_>>()?;
        } else {
            for _ in 0..u.int_in_range(0..=15)? {
                Edit::arbitrary(u)?.apply(&mut bytes);
            }
        }
        let mut copy = Copy::of(&bytes);
        if is_signed {
            copy.sign();
        }
        Ok(Self { seed, copy, is_packed })
    }

    /// Opens the grid.
    pub(super) fn open(&self) -> core::result::Result<Grid<'_>, Error> {
        let bytes = self.copy.bytes();
        // A peek is harmless whatever the bytes say.
        let _ = BlobInfo::peek(bytes);
        if self.is_packed {
            Grid::open_packed(bytes)
        } else {
            Grid::open(bytes, self.seed.mesh.view())
        }
    }

    /// Returns the fixed rays, and rays that the bytes choose.
    pub(super) fn rays(u: &mut Unstructured<'_>, grid: &Grid<'_>) -> Vec<Ray> {
        let mut all = rays::fixed_rays(grid.bounds(), 8);
        all.extend(rays::chosen(u, grid).unwrap_or_default());
        all
    }
}
