//! Stored grids through C calls: opening, packing, peeking, validating, and grids that own their memory.

use std::cell::RefCell;
use std::ffi::c_void;
use std::ptr::{from_mut, from_ref, null, null_mut};

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_capi::*;
use hgrid_core::BlobInfo;

use super::c_abi::{Caller, Opened, UNWRITTEN, is_unwritten, known};
use super::damage::Edit;
use super::memory::{Memory, Struct, rarely};
use crate::copy::Copy;
use crate::guarded::CANARY;
use crate::owned::prove;

impl Caller<'_> {
    /// Returns the bytes of the grid's blob, or none.
    fn blob(&self) -> &[u8] {
        let opened = self.opened.as_ref();
        opened.map_or(&[], |opened| &self.memory[opened.blob].bytes()[opened.from..])
    }

    /// Returns a copy of the blob and true if it was changed.
    fn damaged(&self, u: &mut Unstructured<'_>) -> Result<(Copy, bool)> {
        let mut bytes = self.blob().to_vec();
        let count = u.int_in_range(0..=3)?;
        for _ in 0..count {
            Edit::arbitrary(u)?.apply(&mut bytes);
        }
        let mut copy = Copy::of(&bytes);
        if count > 0 && !rarely(u, 8)? {
            copy.sign();
        }
        Ok((copy, count > 0))
    }

    /// Opens a copy of the blob, with a mesh or with its own.
    pub(super) fn open(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let (copy, is_changed) = self.damaged(u)?;
        let blob = Memory::of(copy.bytes());
        let start = if rarely(u, 32)? { u.int_in_range(0..=64)? } else { 0 };
        let start = start.min(copy.bytes().len());
        let mesh = if rarely(u, 4)? { None } else { Some(self.mesh(u)?) };
        let from = if rarely(u, 48)? { null_mut() } else { blob.at(start) };
        let mut grid = UNWRITTEN;
        let to = if rarely(u, 48)? { null_mut() } else { from_mut(&mut grid) };
        let of = mesh.as_ref().map_or(null(), Struct::as_ptr);
        // SAFETY: all pointers are NULL or valid for the given sizes.
        let status = known(unsafe { hgrid_open(from, copy.bytes().len() - start, of, to) });
        if status != HGRID_OK {
            assert!(is_unwritten(&grid), "{status}");
            return Ok(());
        }
        assert!(!to.is_null() && start % 64 == 0);
        let mesh = mesh.filter(|mesh| !mesh.is_null()).map(|mesh| *mesh.value());
        let is_right = !is_changed
            && self.opened.as_ref().is_some_and(|opened| {
                let is_same = match (&opened.mesh, &mesh) {
                    (None, None) => true,
                    (Some(one), Some(other)) => same(one, other),
                    _ => false,
                };
                opened.is_right && is_same
            });
        self.grid = grid;
        self.opened = Some(Opened { blob: self.memory.len(), from: start, mesh, is_right });
        self.memory.push(blob);
        self.reached.opened += usize::from(self.has_triangles());
        Ok(())
    }

    /// Packs grid and mesh, and goes on with the packed blob if there is enough memory.
    pub(super) fn pack(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let mut bytes = 7;
        let grid = if rarely(u, 48)? { null() } else { from_ref(&self.grid) };
        // SAFETY: the view is NULL or valid; nothing is written to.
        let status = known(unsafe { hgrid_pack(grid, null_mut(), 0, &raw mut bytes) });
        let core = self.core().filter(|_| !grid.is_null());
        let Some(core) = core.filter(|_| status == HGRID_ERROR_INDEX_TOO_SMALL) else {
            assert!(status != HGRID_OK && bytes == 7, "{status} {bytes}");
            return Ok(());
        };
        assert_eq!(bytes, core.packed_bytes());
        let mut capacity = usize::try_from(bytes).unwrap_or(0);
        if rarely(u, 16)? {
            capacity = capacity.saturating_sub(u8::arbitrary(u)?.into());
        }
        let memory = Memory::new(capacity);
        // Now and then pack over the blob itself, which is refused.
        let opened = self.opened.as_ref().filter(|_| rarely(u, 48).unwrap_or(false));
        let (to, capacity) = match opened {
            Some(opened) => {
                let blob = &self.memory[opened.blob];
                (blob.at(0), blob.bytes().len())
            }
            None => (memory.at(0), capacity),
        };
        // SAFETY: `to` has `capacity` bytes.
        let status = known(unsafe { hgrid_pack(grid, to, capacity, &raw mut bytes) });
        if status != HGRID_OK {
            assert!(
                memory.bytes().iter().all(|&byte| byte == CANARY),
                "written in spite of {status}"
            );
            return Ok(());
        }
        assert!(to == memory.at(0), "packed over its own blob");
        let is_right = self.opened.as_ref().is_some_and(|opened| opened.is_right);
        let mut grid = self.grid;
        // SAFETY: the blob contains its mesh.
        let status = known(unsafe { hgrid_open(to, capacity, null(), from_mut(&mut grid)) });
        assert_eq!(status, HGRID_OK, "what was packed opens");
        self.grid = grid;
        let blob = self.memory.len();
        self.opened = Some(Opened { blob, from: 0, mesh: None, is_right });
        self.memory.push(memory);
        self.reached.packed += usize::from(self.has_triangles());
        Ok(())
    }

    pub(super) fn peek(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let (copy, _) = self.damaged(u)?;
        let info = hgrid_blob_info {
            struct_size: 0,
            version: 7,
            method: 7,
            has_mesh: 7,
            vertex_count: 7,
            triangle_count: 7,
            grid_bytes: 7,
            total_bytes: 7,
            content: 7,
            reserved: 7,
        };
        let mut info = Struct::new(u, info)?;
        let from = if copy.bytes().is_empty() { null() } else { copy.bytes().as_ptr() };
        // SAFETY: the bytes can be read; the struct is valid or NULL.
        let status =
            known(unsafe { hgrid_peek(from.cast(), copy.bytes().len(), info.as_mut_ptr()) });
        let core = BlobInfo::peek(copy.bytes());
        let is_asked = info.is_sound();
        let found = info.value();
        assert_eq!(status == HGRID_OK, core.is_ok() && is_asked, "{status}");
        match core.ok().filter(|_| is_asked) {
            None => assert_eq!([found.version, found.method, found.has_mesh], [7; 3]),
            Some(core) => {
                assert_eq!(found.method, core.method as u32);
                assert_eq!(found.triangle_count, u64::from(core.triangle_count));
                let sizes = [found.vertex_count, found.grid_bytes, found.total_bytes];
                assert_eq!(sizes, [core.vertex_count, core.grid_bytes, core.total_bytes]);
                assert_eq!([found.version, found.has_mesh], [core.version, core.has_mesh.into()]);
                assert_eq!([found.content, found.reserved], [core.content as u32, 0]);
            }
        }
        Ok(())
    }

    pub(super) fn validate(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let grid = if rarely(u, 48)? { null() } else { from_ref(&self.grid) };
        // SAFETY: the view is NULL or valid.
        let bytes = unsafe { hgrid_validate_bytes(grid) };
        assert!(
            bytes <= self.core().map_or(0, |grid| grid.mesh().triangle_count() as usize / 8 + 4)
        );
        let mut scratch = vec![0xa5_u8; bytes];
        let to = if bytes == 0 { null_mut() } else { scratch.as_mut_ptr().cast() };
        // SAFETY: the view is NULL or valid, and `to` has so many bytes.
        let status = known(unsafe { hgrid_validate(grid, to, bytes) });
        let core = self.core().filter(|_| !grid.is_null());
        let is_valid = core.is_some_and(|grid| prove(&grid).is_ok());
        assert_eq!(status == HGRID_OK, is_valid, "{status}");

        let statistics = hgrid_statistics {
            struct_size: 0,
            skipped_count: 7,
            degenerate_count: 7,
            first_bad: 7,
            list_count: 7,
            reference_count: 7,
            longest_list: 7,
            reserved: 7,
            content_hash: 7,
        };
        let mut statistics = Struct::new(u, statistics)?;
        // SAFETY: view and struct are NULL or valid.
        let status = known(unsafe { hgrid_inspect(grid, statistics.as_mut_ptr()) });
        let core = core.filter(|_| statistics.is_sound());
        assert_eq!(status == HGRID_OK, core.is_some(), "{status}");
        let hash = core.map_or(7, |grid| grid.inspect().content_hash);
        assert_eq!(statistics.value().content_hash, hash);
        Ok(())
    }

    /// Creates a grid in memory that the library allocates and must give back to the byte.
    pub(super) fn create(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let mut input = self.input(u)?;
        let is_small = input.need().is_some();
        let heap = Heap { lent: RefCell::default(), patience: u.int_in_range(0..=7)? };
        let allocator = hgrid_allocator {
            struct_size: 0,
            reserved: u32::from(rarely(u, 48)?),
            context: from_ref(&heap).cast_mut().cast(),
            allocate: if rarely(u, 48)? { None } else { Some(allocate) },
            release: if rarely(u, 48)? { None } else { Some(release) },
        };
        let allocator = Struct::new(u, allocator)?;
        // Do not take too much of the system's memory.
        if allocator.is_null() && !is_small {
            return Ok(());
        }
        let mut grid = null_mut();
        let to = if rarely(u, 48)? { null_mut() } else { from_mut(&mut grid) };
        let (mesh, config, report) =
            (input.mesh.as_ptr(), input.config.as_ptr(), input.report.as_mut_ptr());
        // SAFETY: all pointers are NULL or valid.
        let status = known(unsafe { hgrid_create(mesh, config, allocator.as_ptr(), to, report) });
        assert_eq!(status == HGRID_OK, !grid.is_null(), "{status}");
        if !grid.is_null() {
            // SAFETY: the view was just made.
            let mut scratch = vec![0xa5_u8; unsafe { hgrid_validate_bytes(grid) }];
            // SAFETY: the view was just made, and the scratch has so many bytes.
            let status =
                known(unsafe { hgrid_validate(grid, scratch.as_mut_ptr().cast(), scratch.len()) });
            assert_eq!(status, HGRID_OK, "what was created is valid");
            self.reached.created += usize::from(input.mesh.value().triangle_count > 0);
        }
        // SAFETY: the grid was just made, or is NULL.
        unsafe { hgrid_destroy(grid) };
        assert!(heap.lent.borrow().is_empty(), "hgrid_create or hgrid_destroy kept memory");
        Ok(())
    }
}

/// Returns true if two descriptions are of the same mesh.
fn same(one: &hgrid_mesh, other: &hgrid_mesh) -> bool {
    let numbers = |mesh: &hgrid_mesh| {
        let addresses = [mesh.positions.addr(), mesh.indices.addr()];
        let strides = [mesh.position_stride, mesh.index_stride];
        (mesh.index_type, addresses, strides, [mesh.vertex_count, mesh.triangle_count])
    };
    numbers(one) == numbers(other)
}

/// An allocator for the library.
struct Heap {
    lent: RefCell<Vec<Memory>>,
    /// The most pieces that it lends at once.
    patience: usize,
}

/// The largest piece of a heap, in bytes.
const PIECE: usize = 1 << 22;

unsafe extern "C" fn allocate(context: *mut c_void, bytes: usize, alignment: usize) -> *mut c_void {
    // SAFETY: the library passes on the context of the allocator, a `Heap`.
    let heap = unsafe { &*context.cast::<Heap>() };
    assert!(alignment == 64 && bytes > 0);
    let mut lent = heap.lent.borrow_mut();
    if bytes > PIECE || lent.len() >= heap.patience {
        return null_mut();
    }
    lent.push(Memory::new(bytes));
    lent.last().map_or(null_mut(), |memory| memory.at(0))
}

unsafe extern "C" fn release(
    context: *mut c_void,
    memory: *mut c_void,
    bytes: usize,
    alignment: usize,
) {
    // SAFETY: the library passes on the context of the allocator, a `Heap`.
    let heap = unsafe { &*context.cast::<Heap>() };
    let mut lent = heap.lent.borrow_mut();
    let place = lent.iter().position(|lent| lent.at(0) == memory).expect("memory of this heap");
    let memory = lent.swap_remove(place);
    assert!(
        memory.bytes().len() == bytes && alignment == 64,
        "released with another size or alignment"
    );
}
