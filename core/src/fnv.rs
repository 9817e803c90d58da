//! A hash of words (FNV-1a), the same in either byte order: against accidents, not against forgery.

/// FNV-1a over words instead of bytes.
pub(crate) struct Fnv(u64);

impl Fnv {
    pub(crate) const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    pub(crate) fn add(&mut self, word: u32) {
        self.0 = (self.0 ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3);
    }

    /// The hash, its high bits mixed into the low ones: a product carries bits only upwards.
    pub(crate) const fn finish(self) -> u64 {
        self.0 ^ (self.0 >> 29)
    }
}
