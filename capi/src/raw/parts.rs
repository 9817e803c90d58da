//! Meshes that are joined: their descriptions, and the caller's memory for what core knows of them.
//!
//! ```text
//! hgrid_part[0]                hgrid_part[1]               hgrid_part[2]
//! | Head | MeshPart | MeshPart | MeshPart | rest            |
//! ```
//!
//! The parts lie side by side, as core takes them, and the head says that they are there.

use core::ffi::c_void;
use core::ptr::NonNull;
use core::slice;

use hgrid_core::{MeshPart, TriangleMesh};

use super::{mesh, read, read_sized, shares, write};
use crate::addresses::Addresses;
use crate::status::{
    HGRID_ERROR_INVALID_PARTS, HGRID_ERROR_NULL_ARGUMENT, HGRID_ERROR_OVERLAP,
    HGRID_ERROR_STRUCT_SIZE, hgrid_status, status_of,
};
use crate::types::{Elements, hgrid_mesh, hgrid_part};

/// The head of memory for parts.
#[repr(C)]
#[derive(Clone, Copy)]
struct Head {
    tag: u64,
    count: usize,
}

/// The tag of parts that were joined.
const TAG: u64 = u64::from_le_bytes(*b"hgridpt1");

const _: () = assert!(size_of::<Head>() + size_of::<MeshPart<'_>>() <= size_of::<hgrid_part>());
const _: () = assert!(size_of::<Head>().is_multiple_of(align_of::<MeshPart<'_>>()));
const _: () = assert!(align_of::<Head>() <= align_of::<hgrid_part>());
const _: () = assert!(align_of::<MeshPart<'_>>() <= align_of::<hgrid_part>());

/// Returns the address of the first part, behind a head.
const fn first_part(parts: *const hgrid_part) -> *const MeshPart<'static> {
    parts.wrapping_byte_add(size_of::<Head>()).cast()
}

/// Returns the address of the memory for the parts of a mesh; NULL if it was not joined here.
pub(crate) fn parts_of(mesh: &TriangleMesh<'_>) -> *const hgrid_part {
    if mesh.parts().is_empty() {
        return core::ptr::null();
    }
    // The caller's pointer again, head included: [`join`] or [`joined`] has exposed it.
    core::ptr::with_exposed_provenance(mesh.parts().as_ptr().addr() - size_of::<Head>())
}

/// The bytes that the parts of a mesh take.
pub(super) fn addresses_of(mesh: &TriangleMesh<'_>) -> Addresses {
    let count = mesh.parts().len();
    let bytes = if count == 0 { 0 } else { size_of::<Head>() + size_of_val(mesh.parts()) };
    Addresses::new(parts_of(mesh).cast(), bytes)
}

/// The mesh that a description names by its parts.
///
/// # Safety
/// The caller's promise; and parts with the right tag were written by [`join`], and what they were
/// joined from is where it was.
pub(super) unsafe fn joined(
    description: &hgrid_mesh,
) -> Result<TriangleMesh<'static>, hgrid_status> {
    let hgrid_mesh { positions, indices, masks, parts, part_count, .. } = *description;
    // SAFETY: the caller's promise; the head comes first.
    let head = unsafe { read(parts.cast::<Head>()) }?;
    let has_arrays = !(positions.is_null() && indices.is_null() && masks.is_null());
    if head.tag != TAG || head.count != part_count || has_arrays {
        return Err(HGRID_ERROR_INVALID_PARTS);
    }
    parts.expose_provenance();
    // SAFETY:
    // * not NULL, aligned as the assertions above say, and so many by the head;
    // * unchanged for as long as the reference lives: see "Lifetimes".
    let parts = unsafe { slice::from_raw_parts(first_part(parts), part_count) };
    let mesh = TriangleMesh::joined(parts).map_err(status_of)?;
    let hgrid_mesh { vertex_count, triangle_count, .. } = *description;
    if (vertex_count, triangle_count) != (mesh.vertex_count(), mesh.triangle_count() as usize) {
        return Err(HGRID_ERROR_INVALID_PARTS);
    }
    Ok(mesh)
}

/// Descriptions in an array, whose elements are as large as the first one says.
struct Meshes {
    start: *const hgrid_mesh,
    size: usize,
    count: usize,
}

impl Meshes {
    /// # Safety
    /// The caller's promise.
    unsafe fn new(start: *const hgrid_mesh, count: usize) -> Result<Self, hgrid_status> {
        // SAFETY: the caller's promise.
        let hgrid_mesh { struct_size, .. } = unsafe { read_sized(start) }?;
        Ok(Self { start, size: struct_size as usize, count })
    }

    /// A mesh with arrays of its own.
    ///
    /// # Safety
    /// The caller's promise.
    unsafe fn get(&self, at: usize) -> Result<TriangleMesh<'static>, hgrid_status> {
        let description = self.start.wrapping_byte_add(at * self.size);
        if !description.is_aligned() {
            return Err(HGRID_ERROR_STRUCT_SIZE);
        }
        // Before what a larger one would have: it may lie behind the array.
        // SAFETY: the caller's promise, and within the array; the size comes first.
        if unsafe { read(description.cast::<u32>()) }? as usize != self.size {
            return Err(HGRID_ERROR_STRUCT_SIZE);
        }
        // SAFETY: the caller's promise, and within the array.
        let description = unsafe { read_sized(description) }?;
        if description.has_parts() {
            return Err(HGRID_ERROR_INVALID_PARTS);
        }
        // SAFETY: the caller's promise.
        unsafe { mesh(&description) }
    }

    fn addresses(&self) -> Option<Addresses> {
        let elements = Elements::new(self.start.cast(), self.size, self.count, self.size)?;
        Some(Addresses::new(elements.start, elements.bytes))
    }
}

/// Joins meshes in memory for their parts.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn join(
    meshes: *const hgrid_mesh,
    count: usize,
    parts: *mut hgrid_part,
) -> Result<TriangleMesh<'static>, hgrid_status> {
    if count == 0 {
        return TriangleMesh::new(&[], &[]).map_err(status_of);
    }
    let to = NonNull::new(parts).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
    // SAFETY: the caller's promise.
    let meshes = unsafe { Meshes::new(meshes, count) }?;
    let start: *const c_void = parts.cast_const().cast();
    let memory = Elements::new(start, 0, count, size_of::<hgrid_part>());
    let memory = Addresses::new(start, memory.ok_or(HGRID_ERROR_INVALID_PARTS)?.bytes);
    if meshes.addresses().ok_or(HGRID_ERROR_INVALID_PARTS)?.overlaps(memory) {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // All of them are looked at before anything is written.
    for at in 0..count {
        // SAFETY: the caller's promise.
        let mesh = unsafe { meshes.get(at) }?;
        if shares(&mesh, memory) {
            return Err(HGRID_ERROR_OVERLAP);
        }
    }
    // SAFETY: aligned as the assertions above say, and writable by the caller's promise.
    unsafe { write(to.cast(), Head { tag: 0, count: 0 }) };
    parts.expose_provenance();
    let first = first_part(parts).cast_mut();
    for at in 0..count {
        // SAFETY: the caller's promise.
        let part = MeshPart::new(unsafe { meshes.get(at) }?);
        // SAFETY: within the memory, as a part with a head takes no more than its share.
        unsafe { first.wrapping_add(at).write(part) };
    }
    // SAFETY:
    // * all of them were written just now;
    // * nothing else refers to them, as the memory overlaps nothing else that this call reads;
    // * unchanged for as long as the reference lives: see "Lifetimes".
    let parts = unsafe { slice::from_raw_parts_mut(first, count) };
    let mesh = TriangleMesh::join(parts).map_err(status_of)?;
    // SAFETY: aligned as the assertions above say, and writable by the caller's promise.
    unsafe { write(to.cast(), Head { tag: TAG, count }) };
    Ok(mesh)
}
