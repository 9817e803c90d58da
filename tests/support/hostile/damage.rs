//! Ways to damage a blob, as a fuzzer chooses them.

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_core::{BlobInfo, Error, Grid, Ray};

use super::memory::rarely;
use super::rays;
use super::seeds::{Seed, seed};
use crate::copy::Copy;

/// One change. Places are words, counted round and round.
#[derive(Debug, Clone, Copy, Arbitrary)]
pub enum Edit {
    /// Another word.
    Set { at: u16, word: u32 },
    /// Another bit.
    Flip { at: u16, bit: u8 },
    /// A little more or less.
    Add { at: u16, by: i8 },
    /// A byte.
    Byte { at: u32, byte: u8 },
    /// Words from elsewhere.
    Copy { from: u16, to: u16, words: u8 },
    /// Two words in each other's place.
    Swap { a: u16, b: u16 },
    /// Many equal bytes.
    Fill { at: u16, words: u8, byte: u8 },
    /// Fewer words: those behind move up.
    Remove { at: u16, words: u8 },
    /// More words, all zero: those behind move down.
    Insert { at: u16, words: u8 },
    /// Fewer bytes.
    Cut { bytes: u16 },
    /// More bytes.
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

/// A number of bytes that there are.
const fn place_of(count: u16, length: usize) -> usize {
    count as usize % (length + 1)
}

/// A seed and bytes to open with its mesh, or with the mesh in them.
#[derive(Debug)]
pub(super) struct Damaged {
    seed: &'static Seed,
    copy: Copy,
    is_packed: bool,
}

impl Damaged {
    /// Returns what the bytes describe: a seed with changes, or a blob of their own.
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

    /// The grid, if it opens.
    pub(super) fn open(&self) -> core::result::Result<Grid<'_>, Error> {
        let bytes = self.copy.bytes();
        // Harmless whatever it says.
        let _ = BlobInfo::peek(bytes);
        if self.is_packed {
            Grid::open_packed(bytes)
        } else {
            Grid::open(bytes, self.seed.mesh.view())
        }
    }

    /// The rays to ask about: those that are always asked about, and those that the bytes choose.
    pub(super) fn rays(u: &mut Unstructured<'_>, grid: &Grid<'_>) -> Vec<Ray> {
        let mut all = rays::fixed_rays(grid.bounds(), 8);
        all.extend(rays::chosen(u, grid).unwrap_or_default());
        all
    }
}
