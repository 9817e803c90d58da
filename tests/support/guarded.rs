//! Memory regions between canaries, which show writes beside the region.

use hgrid_core::Block;

/// The initial value of every byte in and around a region.
pub const CANARY: u8 = 0xc7;

/// A region of memory with canaries before and after it.
#[derive(Debug)]
pub struct Guarded {
    blocks: Vec<Block>,
    bytes: usize,
}

impl Guarded {
    /// Returns a region that was not written to.
    #[must_use]
    pub fn new(bytes: usize) -> Self {
        let mut blocks = vec![Block::ZERO; Block::count_for(bytes) + 2];
        Block::bytes_mut(&mut blocks).fill(CANARY);
        Self { blocks, bytes }
    }

    /// Returns the region's bytes.
    pub fn region(&mut self) -> &mut [u8] {
        &mut Block::bytes_mut(&mut self.blocks)[64..64 + self.bytes]
    }

    /// Returns true if nothing was written beside the region.
    #[must_use]
    pub fn around_is_intact(&self) -> bool {
        let all = Block::bytes(&self.blocks);
        all[..64].iter().chain(&all[64 + self.bytes..]).all(|&byte| byte == CANARY)
    }

    /// Returns true if nothing was written to the region or beside it.
    #[must_use]
    pub fn is_untouched(&self) -> bool {
        Block::bytes(&self.blocks).iter().all(|&byte| byte == CANARY)
    }
}
