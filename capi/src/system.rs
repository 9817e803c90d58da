//! The system's memory, by the C library that the program has anyway.
//!
//! Not by Rust's std: that would bring its panic handler, its thread-locals and a list of libraries
//! to every program that links the archive, and two such archives do not link into one program. Nor
//! by the package libc, for which rustc tells C programmers to add `-lm -lrt -lpthread`.

use core::ffi::c_void;

#[cfg(unix)]
unsafe extern "C" {
    fn posix_memalign(memory: *mut *mut c_void, alignment: usize, bytes: usize)
    -> core::ffi::c_int;
    fn free(memory: *mut c_void);
}

#[cfg(windows)]
unsafe extern "C" {
    fn _aligned_malloc(bytes: usize, alignment: usize) -> *mut c_void;
    fn _aligned_free(memory: *mut c_void);
}

/// Gives memory, or NULL.
///
/// # Safety
/// `bytes` is not 0, and `alignment` is a power of two and at least the size of a pointer.
#[cfg(unix)]
pub(crate) unsafe extern "C" fn give(
    _: *mut c_void,
    bytes: usize,
    alignment: usize,
) -> *mut c_void {
    let mut memory = core::ptr::null_mut();
    // SAFETY: the address to write to is that of a variable; the rest is this function's contract.
    let error = unsafe { posix_memalign(&raw mut memory, alignment, bytes) };
    if error == 0 { memory } else { core::ptr::null_mut() }
}

/// Takes memory back.
///
/// # Safety
/// [`give`] gave it, and it is taken back once.
#[cfg(unix)]
pub(crate) unsafe extern "C" fn take(_: *mut c_void, memory: *mut c_void, _: usize, _: usize) {
    // SAFETY: what `posix_memalign` gives is for `free`.
    unsafe { free(memory) }
}

/// Gives memory, or NULL.
///
/// # Safety
/// `bytes` is not 0, and `alignment` is a power of two.
#[cfg(windows)]
pub(crate) unsafe extern "C" fn give(
    _: *mut c_void,
    bytes: usize,
    alignment: usize,
) -> *mut c_void {
    // SAFETY: this function's contract.
    unsafe { _aligned_malloc(bytes, alignment) }
}

/// Takes memory back.
///
/// # Safety
/// [`give`] gave it, and it is taken back once.
#[cfg(windows)]
pub(crate) unsafe extern "C" fn take(_: *mut c_void, memory: *mut c_void, _: usize, _: usize) {
    // SAFETY: what `_aligned_malloc` gives is for `_aligned_free`.
    unsafe { _aligned_free(memory) }
}

#[cfg(not(any(unix, windows)))]
compile_error!(
    "the feature `malloc` needs an operating system: build without it and bring the memory"
);
