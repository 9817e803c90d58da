//! Bytes on the heap: an allocator that counts for Rust, and a question to the C library.

#![expect(unsafe_code, reason = "an allocator is unsafe to implement")]

use core::alloc::{GlobalAlloc, Layout};
use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::alloc::System;

use super::system::Bytes;

static CURRENT: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The system's allocator, counting the bytes that are asked for.
struct Counting;

fn add(bytes: usize) {
    let now = CURRENT.fetch_add(bytes, Relaxed) + bytes;
    PEAK.fetch_max(now, Relaxed);
}

fn remove(bytes: usize) {
    CURRENT.fetch_sub(bytes, Relaxed);
}

// SAFETY: every call goes to the system's allocator as it came; counting does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        add(layout.size());
        // SAFETY: the caller's promise about the layout is the one that is needed.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        add(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        remove(layout.size());
        // SAFETY: the memory came from the system's allocator with this layout.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        remove(layout.size());
        add(size);
        // SAFETY: as above, and the caller promises that the size is no zero.
        unsafe { System.realloc(memory, layout, size) }
    }
}

/// Bytes of Rust's heap, from which a peak is counted anew.
pub(super) fn start_peak() -> usize {
    let now = CURRENT.load(Relaxed);
    PEAK.store(now, Relaxed);
    now
}

/// Returns the bytes that were put on Rust's heap since it held `before`, and the most at any time.
pub(super) fn since(before: usize) -> Bytes {
    Bytes {
        index: CURRENT.load(Relaxed).saturating_sub(before),
        peak: PEAK.load(Relaxed).saturating_sub(before),
    }
}

/// Keeps what is freed: heaps ask the system for no page twice.
pub(super) fn keep() {
    // SAFETY: the calls set numbers of the allocator, which it locks.
    let is_set = unsafe { libc::mallopt(libc::M_MMAP_MAX, 0) }
        // SAFETY: as above; -1 is never.
        & unsafe { libc::mallopt(libc::M_TRIM_THRESHOLD, -1) };
    debug_assert_eq!(is_set, 1, "the allocator knows both");
}

/// Gives the system what is free.
pub(super) fn give_back() {
    // SAFETY: the call takes a number and locks what it changes.
    let _ = unsafe { libc::malloc_trim(0) };
}

/// Bytes in use on the heap of C, where that of Rust is too.
pub(super) fn in_use() -> usize {
    // SAFETY: the call takes nothing and locks what it reads.
    let heap = unsafe { libc::mallinfo2() };
    heap.uordblks + heap.hblkhd
}

#[cfg(test)]
mod tests {
    use super::*;

    // Other tests allocate meanwhile: only much memory is told apart.
    const MUCH: usize = 1 << 28;

    #[test]
    fn bytes_are_counted_while_they_are_there() {
        let before = start_peak();
        let memory = Vec::<u8>::with_capacity(MUCH);
        assert!(since(before).index >= MUCH / 2);
        drop(memory);
        let after = since(before);
        assert!(after.index < MUCH / 2 && after.peak >= MUCH / 2, "{after:?}");
    }

    #[test]
    fn the_heap_of_c_holds_that_of_rust() {
        let before = in_use();
        let memory = Vec::<u8>::with_capacity(MUCH);
        assert!(in_use() >= before + MUCH / 2);
        drop(memory);
    }
}
