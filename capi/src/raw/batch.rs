//! The arrays of a batch of rays, checked as addresses before anything is read.
//!
//! Rays and answers may lie in the same structs of the caller, `{ray; hit}` after `{ray; hit}`. In
//! Rust, a mutable reference to bytes that another reference covers is undefined behaviour, and so
//! is a reference to the caller's other fields, which another thread may be writing. So this module
//! makes no references: it reads rays and writes answers through their addresses, one by one.

use core::ffi::c_void;

use hgrid_core::Batch;

use crate::addresses::Addresses;
use crate::status::{
    HGRID_ERROR_INVALID_ANSWERS, HGRID_ERROR_INVALID_RAYS, HGRID_ERROR_NULL_ARGUMENT,
    HGRID_ERROR_OVERLAP, hgrid_status,
};
use crate::types::Elements;

/// An array of the caller's, as it is passed: where it starts, and its stride.
pub(crate) type Array<T> = (T, usize);

/// Rays `R` and as many answers `T`, no byte of them in a ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BatchArrays<R, T> {
    rays: *const R,
    ray_stride: usize,
    answers: *mut T,
    answer_stride: usize,
    pub(crate) count: usize,
    /// From the first byte to the last of the rays, and of the answers.
    addresses: [Addresses; 2],
}

impl<R, T> BatchArrays<R, T> {
    /// Checks the arrays. A stride of 0 means that elements lie side by side.
    pub(crate) fn new(
        (rays, ray_stride): Array<*const R>,
        (answers, answer_stride): Array<*mut T>,
        count: usize,
    ) -> Result<Self, hgrid_status> {
        let ray_elements = elements::<R>(rays.cast(), ray_stride, count);
        let ray_elements = ray_elements.ok_or(HGRID_ERROR_INVALID_RAYS)?;
        let answer_elements = elements::<T>(answers.cast(), answer_stride, count);
        let answer_elements = answer_elements.ok_or(HGRID_ERROR_INVALID_ANSWERS)?;
        if count > 0 && (rays.is_null() || answers.is_null()) {
            return Err(HGRID_ERROR_NULL_ARGUMENT);
        }
        if overlap((&ray_elements, size_of::<R>()), (&answer_elements, size_of::<T>())) {
            return Err(HGRID_ERROR_OVERLAP);
        }
        let (ray_stride, answer_stride) = (ray_elements.stride, answer_elements.stride);
        let addresses = [&ray_elements, &answer_elements].map(addresses);
        Ok(Self { rays, ray_stride, answers, answer_stride, count, addresses })
    }

    /// Returns true if a region overlaps the bytes of the rays or of the answers.
    pub(crate) fn overlaps(&self, other: Addresses) -> bool {
        self.addresses.iter().any(|addresses| addresses.overlaps(other))
    }

    /// The address of a ray, of any alignment.
    pub(crate) const fn ray(&self, index: usize) -> *const R {
        self.rays.wrapping_byte_add(index.wrapping_mul(self.ray_stride))
    }

    /// The address of an answer, of any alignment.
    pub(crate) const fn answer(&self, index: usize) -> *mut T {
        self.answers.wrapping_byte_add(index.wrapping_mul(self.answer_stride))
    }
}

/// The arrays of a batch while it runs, as core asks for them.
pub(crate) struct RunningBatch<'b, R, T>(&'b BatchArrays<R, T>);

impl<'b, R, T> RunningBatch<'b, R, T> {
    /// # Safety
    /// Until it is dropped, the elements of both arrays are the caller's to be read and written, and any bytes are an
    /// `R`.
    pub(super) const unsafe fn new(batch: &'b BatchArrays<R, T>) -> Self {
        Self(batch)
    }
}

impl<A, T: From<A>, Q: From<R>, R> Batch<A, Q> for RunningBatch<'_, R, T> {
    #[inline(always)]
    fn count(&self) -> usize {
        self.0.count
    }

    #[inline(always)]
    fn ray(&self, place: usize) -> Q {
        // SAFETY: within the array by its place, readable and a ray by the contract of `new`.
        unsafe { self.0.ray(place).read_unaligned() }.into()
    }

    #[inline(always)]
    fn answer(&mut self, place: usize, answer: A) {
        // SAFETY: within the array by its place, writable by the contract of `new`.
        unsafe { self.0.answer(place).write_unaligned(answer.into()) };
    }
}

/// The elements of an array, if none lies in the next one and all fit into memory.
fn elements<T>(start: *const c_void, stride: usize, count: usize) -> Option<Elements> {
    let size = size_of::<T>();
    Elements::new(start, stride, count, size).filter(|elements| elements.stride >= size)
}

/// From the first element's first byte to the last element's last.
fn addresses(elements: &Elements) -> Addresses {
    Addresses::new(elements.start, elements.bytes)
}

/// Returns true if a byte of an answer lies in a ray.
///
/// With one stride for both, the distance from a ray's start to the start of the next answer is the
/// same everywhere: each answer lies between two rays, or each overlaps one. With fewer than two elements the stride
/// means nothing, and their addresses decide.
fn overlap(
    (rays, ray_bytes): (&Elements, usize),
    (answers, answer_bytes): (&Elements, usize),
) -> bool {
    if !addresses(rays).overlaps(addresses(answers)) {
        return false;
    }
    let distance = answers.start.addr().wrapping_sub(rays.start.addr()).cast_signed();
    let distance = distance.checked_rem_euclid(rays.stride.cast_signed());
    let is_between = distance.map(isize::cast_unsigned).is_some_and(|distance| {
        distance >= ray_bytes && distance.saturating_add(answer_bytes) <= rays.stride
    });
    rays.count < 2 || rays.stride != answers.stride || !is_between
}
