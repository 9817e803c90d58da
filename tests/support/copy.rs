//! The bytes of a grid, for tests that change them.

use hgrid_core::Block;

/// The offset of the header's checksum, which follows all that it covers.
pub const CHECKSUM: usize = 124;

/// The offset of the header's field for the mesh after the grid.
pub const MESH: usize = 108;

/// Bytes in memory with the alignment of blobs.
#[derive(Debug, Clone)]
pub struct Copy {
    blocks: Vec<Block>,
    length: usize,
}

impl Copy {
    /// Copies the bytes.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        let mut blocks = vec![Block::ZERO; Block::count_for(bytes.len())];
        Block::bytes_mut(&mut blocks)[..bytes.len()].copy_from_slice(bytes);
        Self { blocks, length: bytes.len() }
    }

    /// Returns the bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &Block::bytes(&self.blocks)[..self.length]
    }

    /// Returns the bytes for changes.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut Block::bytes_mut(&mut self.blocks)[..self.length]
    }

    /// Returns the word at an offset.
    ///
    /// # Panics
    /// If the bytes end before the word does.
    #[must_use]
    pub fn word(&self, at: usize) -> u32 {
        word(self.bytes(), at)
    }

    /// Writes bytes at an offset.
    ///
    /// # Panics
    /// If the copy ends before they do.
    pub fn set(&mut self, at: usize, bytes: &[u8]) {
        self.bytes_mut()[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// Writes a word at an offset.
    ///
    /// # Panics
    /// If the copy ends before it does.
    pub fn set_word(&mut self, at: usize, word: u32) {
        self.set(at, &word.to_ne_bytes());
    }

    /// Corrects the header's checksum: FNV-1a over its words, folded. A copy too short for a header stays as it is.
    pub fn sign(&mut self) {
        let Some((covered, behind)) = self.bytes_mut().split_at_mut_checked(CHECKSUM) else {
            return;
        };
        let Some(checksum) = behind.first_chunk_mut::<4>() else { return };
        let sum = hash(covered);
        let sum = sum ^ (sum >> 29);
        *checksum = (sum as u32 ^ (sum >> 32) as u32).to_ne_bytes();
    }
}

/// Returns a hash of the words of a blob: FNV-1a, word by word.
#[must_use]
pub fn hash(words: &[u8]) -> u64 {
    let words = words.as_chunks::<4>().0.iter().map(|word| u32::from_ne_bytes(*word));
    words.fold(0xcbf2_9ce4_8422_2325, |sum, word| {
        (sum ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Returns the word at an offset of a blob.
///
/// # Panics
/// If the blob ends before it does.
#[must_use]
pub fn word(blob: &[u8], at: usize) -> u32 {
    u32::from_ne_bytes(blob[at..at + 4].try_into().expect("four bytes"))
}
