//! The layout of a blob, by the format's description (core/src/one_level/mod.rs and others).

use hgrid_tests::copy::Copy;

/// The offsets of a header's fields.
pub(super) const BLOB_BYTES: usize = 16;
pub(super) const SKIPPED_COUNT: usize = 36;
pub(super) const METHOD: usize = 40;
pub(super) const DENSITY: usize = 44;
pub(super) const BOUNDS_MIN: usize = 48;
pub(super) const BOUNDS_MAX: usize = 60;
pub(super) const RESOLUTION: usize = 72;
pub(super) const HASH_COUNT: usize = 84;
pub(super) const REFERENCE_COUNT: usize = 88;
pub(super) const MACROCELL_FACTOR: usize = 92;
pub(super) const SUBDIVIDE_ABOVE: usize = 96;
pub(super) const DEPTH: usize = 100;
pub(super) const CELL_SIZE: usize = 104;
pub(super) const RESERVED: usize = 112;

/// The size of a header.
pub(super) const HEAD: usize = 128;

/// The bit that marks a subgrid; lists do not have it.
pub(super) const GRID: u32 = 1 << 31;

/// The sections of a grid with a hash table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hashed {
    pub(super) resolution: [usize; 3],
    /// The start of each section, then the numbers of slots and of the pool's words.
    pub(super) rows: usize,
    pub(super) bits: usize,
    pub(super) hash: usize,
    pub(super) pool: usize,
    pub(super) overlay: usize,
    pub(super) slots: usize,
    pub(super) words: usize,
}

/// A cell with a list, and the place of the list.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    pub(super) cell: [usize; 3],
    pub(super) slot: usize,
    /// In words of the pool.
    pub(super) start: usize,
    pub(super) end: usize,
    pub(super) is_grid: bool,
}

impl Hashed {
    pub(super) fn of(blob: &[u8]) -> Self {
        let copy = Copy::of(&blob[..HEAD]);
        let word = |at: usize| copy.word(at) as usize;
        let resolution @ [x, y, z] = [0, 4, 8].map(|at| word(RESOLUTION + at));
        let (slots, words) = (word(HASH_COUNT), word(REFERENCE_COUNT));
        let rows = HEAD;
        let bits = rows + (4 * y * z).next_multiple_of(64);
        let hash = bits + (8 * (x * y * z).div_ceil(64)).next_multiple_of(64);
        let pool = hash + (4 * (slots + 1)).next_multiple_of(64);
        let overlay = pool + (4 * words).next_multiple_of(64);
        Self { resolution, rows, bits, hash, pool, overlay, slots, words }
    }

    pub(super) fn cells(&self) -> usize {
        self.resolution.iter().product()
    }

    pub(super) fn row_count(&self) -> usize {
        self.resolution[1] * self.resolution[2]
    }

    /// Returns the number of a cell's bit.
    pub(super) fn bit(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.resolution[1] + y) * self.resolution[0] + x
    }

    /// Returns the offset of a word of the pool.
    pub(super) fn at(&self, word: usize) -> usize {
        self.pool + 4 * word
    }

    /// Returns the cells with lists, in the order of their bits.
    pub(super) fn full(&self, blob: &[u8]) -> Vec<Cell> {
        let copy = Copy::of(blob);
        let [width, height, depth] = self.resolution;
        let all = (0..depth).flat_map(|z| (0..height).map(move |y| (y, z)));
        let all = all.flat_map(|(y, z)| (0..width).map(move |x| [x, y, z]));
        let is_marked = |cell| {
            let bit = self.bit(cell);
            blob[self.bits + bit / 8] >> (bit % 8) & 1 == 1
        };
        all.filter(|&cell| is_marked(cell))
            .map(|cell @ [x, y, z]| {
                let offset = copy.word(self.rows + 4 * (z * height + y)).cast_signed();
                let slot = usize::try_from(offset.checked_add_unsigned(x as u32).unwrap()).unwrap();
                let [start, end] = [slot, slot + 1].map(|slot| copy.word(self.hash + 4 * slot));
                let is_grid = start & GRID != 0;
                let [start, end] = [start, end].map(|word| (word & !GRID) as usize);
                Cell { cell, slot, start, end, is_grid }
            })
            .collect()
    }

    /// Returns a row without lists.
    pub(super) fn empty_row(&self, blob: &[u8]) -> usize {
        let full = self.full(blob);
        let row = |cell: &Cell| cell.cell[2] * self.resolution[1] + cell.cell[1];
        (0..self.row_count()).find(|&r| full.iter().all(|cell| row(cell) != r)).unwrap()
    }
}

/// Flips a bit.
pub(super) fn flip(copy: &mut Copy, section: usize, bit: usize) {
    copy.bytes_mut()[section + bit / 8] ^= 1 << (bit % 8);
}

/// Adds to a word.
pub(super) fn add(copy: &mut Copy, at: usize, by: i32) {
    copy.set_word(at, copy.word(at).wrapping_add_signed(by));
}

/// Removes words from the last section of a blob or adds some, and adapts the header.
pub(super) fn resized(copy: &mut Copy, section: usize, change: impl Fn(&mut Vec<u8>)) {
    let words = copy.word(REFERENCE_COUNT) as usize;
    let mut bytes = copy.bytes()[..section + 4 * words].to_vec();
    change(&mut bytes);
    let words = (bytes.len() - section) / 4;
    bytes.resize(section + (4 * words).next_multiple_of(64), 0);
    let length = bytes.len() as u64;
    *copy = Copy::of(&bytes);
    copy.set(BLOB_BYTES, &length.to_ne_bytes());
    copy.set_word(REFERENCE_COUNT, u32::try_from(words).unwrap());
}
