//! Ranges of memory by their addresses, compared before anything becomes a reference.
//!
//! Two mutable references to the same byte would be undefined behaviour in Rust, so whether the
//! caller's regions lie apart is asked while they are still numbers.

use core::ffi::c_void;
use core::ptr::null_mut;

/// A region as the caller passes it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RawRegion {
    pub(crate) start: *mut c_void,
    pub(crate) bytes: usize,
}

impl RawRegion {
    /// No bytes.
    pub(crate) const NONE: Self = Self { start: null_mut(), bytes: 0 };

    pub(crate) fn addresses(self) -> Addresses {
        Addresses::new(self.start, self.bytes)
    }
}

/// The addresses `start..end`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Addresses {
    start: usize,
    end: usize,
}

impl Addresses {
    pub(crate) fn new(start: *const c_void, bytes: usize) -> Self {
        let start = start.addr();
        Self { start, end: start.saturating_add(bytes) }
    }

    /// Returns true if there is no byte.
    pub(crate) const fn is_empty(self) -> bool {
        self.start >= self.end
    }

    /// Returns true if any byte lies in both; an empty range shares none.
    pub(crate) const fn overlaps(self, other: Self) -> bool {
        let start = if self.start > other.start { self.start } else { other.start };
        let end = if self.end < other.end { self.end } else { other.end };
        start < end
    }
}
