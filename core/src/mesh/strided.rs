//! An array of the caller's with any stride, as bytes.

use core::fmt;

use zerocopy::{FromBytes, Immutable, IntoBytes};

/// `count` elements in a slice of bytes, one every `stride` bytes.
#[derive(Clone, Copy)]
pub struct Strided<'a> {
    /// The bytes, from the first element's first to at least the last element's last.
    pub bytes: &'a [u8],
    /// Bytes from one element to the next.
    pub stride: usize,
    /// Number of elements.
    pub count: usize,
}

impl fmt::Debug for Strided<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Strided")
            .field("bytes", &self.bytes.len())
            .field("stride", &self.stride)
            .field("count", &self.count)
            .finish()
    }
}

impl<'a> Strided<'a> {
    /// Elements that lie side by side: numbers, arrays of them, and structs that derive these traits of the crate
    /// `zerocopy` (0.8, with its feature `derive`).
    ///
    /// ```
    /// use hgrid_core::Strided;
    /// use zerocopy::{Immutable, IntoBytes};
    ///
    /// #[derive(Clone, Copy, Immutable, IntoBytes)]
    /// #[repr(C)]
    /// struct Vertex {
    ///     position: [f32; 3],
    ///     color: u32,
    /// }
    ///
    /// let vertices = [Vertex { position: [0.0; 3], color: 7 }; 3];
    /// let view = Strided::new(&vertices);
    /// assert_eq!((view.stride, view.count), (16, 3));
    /// ```
    ///
    /// The fields take bytes from anywhere else, such as `bytemuck::cast_slice(&vertices)`.
    #[must_use]
    pub fn new<T: Immutable + IntoBytes>(elements: &'a [T]) -> Self {
        let count = elements.len();
        Self { bytes: elements.as_bytes(), stride: size_of::<T>(), count }
    }

    /// Element `index`, or zeros if there is none.
    #[inline(always)]
    pub(crate) fn read<T: FromBytes>(&self, index: usize) -> T {
        let start = index.saturating_mul(self.stride);
        let element = self.bytes.get(start..).and_then(|rest| T::read_from_prefix(rest).ok());
        element.map_or_else(T::new_zeroed, |(element, _)| element)
    }

    /// No elements.
    pub(super) const NONE: Self = Self { bytes: &[], stride: 0, count: 0 };

    /// The same elements of `size` bytes without the bytes after the last of them, if all lie inside.
    pub(crate) fn cut(self, size: usize) -> Option<Self> {
        let Some(last) = self.count.checked_sub(1) else {
            return Some(Self { bytes: &[], ..self });
        };
        let end = last.checked_mul(self.stride)?.checked_add(size)?;
        let bytes = self.bytes.get(..end).filter(|_| self.stride >= size)?;
        Some(Self { bytes, ..self })
    }

    /// The first `N` bytes of element `index`.
    #[inline(always)]
    pub(crate) fn element<const N: usize>(&self, index: usize) -> Option<&'a [u8; N]> {
        if index >= self.count {
            return None;
        }
        self.bytes.get(index * self.stride..)?.first_chunk::<N>()
    }

    /// Elements of `N` bytes from `first` on, if they lie side by side.
    #[inline(always)]
    pub(crate) fn tight<const N: usize>(&self, first: usize, count: usize) -> &'a [[u8; N]] {
        let bytes = self.bytes.get(first.saturating_mul(N)..).unwrap_or_default();
        let elements = if self.stride == N { bytes.as_chunks().0 } else { &[] };
        elements.get(..count).unwrap_or_default()
    }
}
