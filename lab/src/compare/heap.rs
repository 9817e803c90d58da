//! Bytes on the heap: an allocator that counts those of Rust, and queries of the C library.

#![expect(unsafe_code, reason = "an allocator is unsafe to implement")]

use core::alloc::{GlobalAlloc, Layout};
use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::alloc::System;

use super::system::Bytes;

static CURRENT: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The system's allocator with counts of the bytes in use.
struct Counting;

fn add(bytes: usize) {
    let now = CURRENT.fetch_add(bytes, Relaxed) + bytes;
    PEAK.fetch_max(now, Relaxed);
}

fn remove(bytes: usize) {
    CURRENT.fetch_sub(bytes, Relaxed);
}

// SAFETY: every call goes to the system's allocator unchanged; counting does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        add(layout.size());
        // SAFETY: the caller's promise about the layout is all that the call needs.
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
        // SAFETY: as above, and the caller promises that the size is not zero.
        unsafe { System.realloc(memory, layout, size) }
    }
}

/// Returns the bytes on Rust's heap, and starts a new peak from there.
pub(super) fn start_peak() -> usize {
    let now = CURRENT.load(Relaxed);
    PEAK.store(now, Relaxed);
    now
}

/// Returns the bytes that Rust's heap has gained over `before`, and the most that it had gained at any time.
pub(super) fn since(before: usize) -> Bytes {
    Bytes {
        index: CURRENT.load(Relaxed).saturating_sub(before),
        peak: PEAK.load(Relaxed).saturating_sub(before),
    }
}

/// Makes the heap keep freed memory, so that it does not request the same pages twice.
pub(super) fn keep() {
    // SAFETY: the calls set numbers of the allocator, which locks them.
    let is_set = unsafe { libc::mallopt(libc::M_MMAP_MAX, 0) }
        // SAFETY: as above; a threshold of -1 means never.
        & unsafe { libc::mallopt(libc::M_TRIM_THRESHOLD, -1) };
    debug_assert_eq!(is_set, 1, "the allocator knows both");
}

/// Returns free memory of the heap to the system.
pub(super) fn give_back() {
    // SAFETY: the call takes a number and locks what it changes.
    let _ = unsafe { libc::malloc_trim(0) };
}

/// Returns the bytes in use on the C heap, which holds Rust's heap too.
pub(super) fn in_use() -> usize {
    // SAFETY: the call takes nothing and locks what it reads.
    let heap = unsafe { libc::mallinfo2() };
    heap.uordblks + heap.hblkhd
}

#[cfg(test)]
mod tests {
    use super::*;

    // Other tests allocate at the same time: only a large block stands out.
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
