//! Memory that a C program lends to the library, to the byte, and structs of any size.

use std::alloc::{Layout, alloc, dealloc, handle_alloc_error};
use std::ffi::c_void;
use std::ops::Deref;
use std::ptr::{NonNull, from_mut, from_ref, null, null_mut};

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_core::ALIGNMENT;

use crate::guarded::CANARY;

/// Returns true about once in `n` times, and false where the bytes have ended.
pub(super) fn rarely(u: &mut Unstructured<'_>, n: u8) -> Result<bool> {
    Ok(!u.ratio(n - 1, n)?)
}

/// Memory at a multiple of 64, of exactly the given size: no byte after the last may be touched.
pub(super) struct Memory {
    start: NonNull<u8>,
    layout: Layout,
    bytes: usize,
}

impl Memory {
    pub(super) fn new(bytes: usize) -> Self {
        let layout = Layout::from_size_align(bytes.max(1), ALIGNMENT).expect("not too large");
        // SAFETY: the size is not 0.
        let start = unsafe { alloc(layout) };
        let Some(start) = NonNull::new(start) else { handle_alloc_error(layout) };
        // SAFETY: so many bytes were just allocated.
        unsafe { start.as_ptr().write_bytes(CANARY, layout.size()) };
        Self { start, layout, bytes }
    }

    pub(super) fn of(bytes: &[u8]) -> Self {
        let mut memory = Self::new(bytes.len());
        memory.bytes_mut().copy_from_slice(bytes);
        memory
    }

    /// Returns the address of a byte, or of the end.
    pub(super) fn at(&self, byte: usize) -> *mut c_void {
        assert!(byte <= self.bytes);
        self.start.as_ptr().wrapping_add(byte).cast()
    }

    pub(super) fn bytes(&self) -> &[u8] {
        // SAFETY: the bytes are allocated and written, and live as long as `self`.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.bytes) }
    }

    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        // SAFETY: as above, and `self` is borrowed mutably.
        unsafe { std::slice::from_raw_parts_mut(self.start.as_ptr(), self.bytes) }
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: the memory was allocated with this layout.
        unsafe { dealloc(self.start.as_ptr(), self.layout) };
    }
}

/// A value that a program lends to the library by its address and also reads itself: a box that may be moved.
pub(super) struct Lent<T>(NonNull<T>);

impl<T> Lent<T> {
    pub(super) fn new(value: T) -> Self {
        Self(NonNull::from(Box::leak(Box::new(value))))
    }

    pub(super) const fn as_ptr(&self) -> *mut T {
        self.0.as_ptr()
    }
}

impl<T> Deref for Lent<T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: the pointer is that of a box; only calls of the library write to it, and none is under way.
        unsafe { self.0.as_ref() }
    }
}

impl<T> Drop for Lent<T> {
    fn drop(&mut self) {
        // SAFETY: the box was leaked to be given back here.
        drop(unsafe { Box::from_raw(self.0.as_ptr()) });
    }
}

/// The largest size that a struct may claim; so many bytes exist.
const LARGEST: usize = 4096;

/// A struct that starts with its size, right or wrong, with bytes after it; or NULL.
pub(super) struct Struct<T> {
    all: Box<Padded<T>>,
    is_null: bool,
}

#[repr(C)]
struct Padded<T> {
    value: T,
    behind: [u8; LARGEST],
}

impl<T: Copy> Struct<T> {
    /// Returns the struct with a size that is mostly right.
    pub(super) fn new(u: &mut Unstructured<'_>, value: T) -> Result<Self> {
        let right = size_of::<T>() as u32;
        let mut all = Box::new(Padded { value, behind: [0; LARGEST] });
        let mut size = right;
        if rarely(u, 24)? {
            size = match u.int_in_range(0..=3)? {
                0 => u32::arbitrary(u)?,
                1 => right - u.int_in_range(0..=right)?,
                2 => right + u.int_in_range(0..=64)?,
                _ => LARGEST as u32,
            };
            if bool::arbitrary(u)? {
                all.behind[usize::from(u8::arbitrary(u)?)] = 1;
            }
        }
        // SAFETY: every struct in use here starts with its size.
        unsafe { (&raw mut all.value).cast::<u32>().write(size) };
        Ok(Self { all, is_null: rarely(u, 48)? })
    }

    /// Returns the struct with its right size.
    pub(super) fn right(value: T) -> Self {
        let mut all = Box::new(Padded { value, behind: [0; LARGEST] });
        // SAFETY: every struct in use here starts with its size.
        unsafe { (&raw mut all.value).cast::<u32>().write(size_of::<T>() as u32) };
        Self { all, is_null: false }
    }

    /// Returns true if the library accepts the struct.
    pub(super) fn is_sound(&self) -> bool {
        // SAFETY: as above.
        let size = unsafe { (&raw const self.all.value).cast::<u32>().read() } as usize;
        let right = size_of::<T>();
        let unknown = size.checked_sub(right);
        !self.is_null
            && size <= LARGEST
            && unknown.is_some_and(|unknown| self.all.behind[..unknown].iter().all(|&b| b == 0))
    }

    pub(super) const fn is_null(&self) -> bool {
        self.is_null
    }

    pub(super) const fn value(&self) -> &T {
        &self.all.value
    }

    pub(super) fn as_ptr(&self) -> *const T {
        if self.is_null { null() } else { from_ref(&*self.all).cast() }
    }

    pub(super) fn as_mut_ptr(&mut self) -> *mut T {
        if self.is_null { null_mut() } else { from_mut(&mut *self.all).cast() }
    }
}

/// Returns a stride and a count of elements that fit into so many bytes, or that exceed any memory.
pub(super) fn array(u: &mut Unstructured<'_>, bytes: usize, size: usize) -> Result<(usize, usize)> {
    let number = |u: &mut Unstructured<'_>| {
        Ok(if rarely(u, 4)? { usize::arbitrary(u)? } else { usize::from(u8::arbitrary(u)? % 64) })
    };
    let (stride, count) = (number(u)?, number(u)?);
    let step = if stride == 0 { size } else { stride };
    let span =
        count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(step)?.checked_add(size));
    Ok(match span {
        Some(span) if span <= bytes => (stride, count),
        Some(span) if isize::try_from(span).is_ok() => match bytes.checked_sub(size) {
            Some(rest) => (stride, rest / step + 1),
            None => (stride, 0),
        },
        _ => (stride, count),
    })
}
