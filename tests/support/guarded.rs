//! Regions whose surroundings tell whether somebody wrote beside them.

use hgrid_core::Block;

/// The byte that the memory around and in the regions holds at first.
pub const CANARY: u8 = 0xc7;

/// A region of so many bytes with canaries before and behind.
#[derive(Debug)]
pub struct Guarded {
    blocks: Vec<Block>,
    bytes: usize,
}

impl Guarded {
    /// One that was not written to.
    #[must_use]
    pub fn new(bytes: usize) -> Self {
        let mut blocks = vec![Block::ZERO; Block::count_for(bytes) + 2];
        Block::bytes_mut(&mut blocks).fill(CANARY);
        Self { blocks, bytes }
    }

    /// The region.
    pub fn region(&mut self) -> &mut [u8] {
        &mut Block::bytes_mut(&mut self.blocks)[64..64 + self.bytes]
    }

    /// True if nothing was written beside it.
    #[must_use]
    pub fn around_is_intact(&self) -> bool {
        let all = Block::bytes(&self.blocks);
        all[..64].iter().chain(&all[64 + self.bytes..]).all(|&byte| byte == CANARY)
    }

    /// True if nothing was written to it, either.
    #[must_use]
    pub fn is_untouched(&self) -> bool {
        Block::bytes(&self.blocks).iter().all(|&byte| byte == CANARY)
    }
}
