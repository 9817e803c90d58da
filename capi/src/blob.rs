//! Blobs, which are grids as they are stored: opening, proving, packing, and looking at all of one.

use core::ffi::c_void;
use core::ptr::NonNull;

use hgrid_core::Grid;

use crate::addresses::RawRegion;
use crate::blob_types::{hgrid_blob_info, hgrid_refit_report, hgrid_statistics};
use crate::raw;
use crate::status::{
    HGRID_ERROR_INDEX_TOO_SMALL, HGRID_ERROR_NULL_ARGUMENT, HGRID_OK, hgrid_status,
};
use crate::types::{hgrid_grid, hgrid_mesh};

/// Opens a blob that was built earlier, in another process or on another machine: O(1), no copy.
///
/// `blob` is the index of a build, or a copy of it, at a multiple of `HGRID_ALIGNMENT`: in memory, in a mapped file, in
/// flash. It is `index_bytes` of the build's report long, or `bytes` of `hgrid_pack`; bytes behind it are ignored. It
/// says itself which method built it and how. The mesh is the one it was built for, of which only the counts are
/// compared. A blob that `hgrid_pack` wrote has its mesh in it: then `mesh` may be NULL. If you pass a mesh, it
/// replaces the one in the blob, with its masks and with what `hgrid_locate` knows of meshes that were joined.
///
/// The call does not check the whole blob. On damaged bytes queries may answer wrongly, but they end, and
/// they read nothing outside the blob and the mesh. `hgrid_validate` proves a blob. The bytes must not
/// change while the grid is in use: do not map a file that others may write, read it into your own memory.
///
/// `blob` and `grid` may not be NULL. Returns `HGRID_OK` and writes the view to `grid`; or returns
/// what is wrong and leaves `grid` as it was:
/// - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_MISALIGNED`;
/// - with the mesh: `HGRID_ERROR_INVALID_POSITIONS`, `HGRID_ERROR_INVALID_INDICES`,
///   `HGRID_ERROR_INVALID_INDEX_TYPE`, `HGRID_ERROR_INVALID_MASKS`, `HGRID_ERROR_INVALID_PARTS`,
///   `HGRID_ERROR_TOO_MANY_TRIANGLES`;
/// - with the blob: `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_TRUNCATED`, `HGRID_ERROR_WRONG_BYTE_ORDER`,
///   `HGRID_ERROR_UNSUPPORTED_VERSION`, `HGRID_ERROR_METHOD_REMOVED`, `HGRID_ERROR_METHOD_LEFT_OUT`,
///   `HGRID_ERROR_CORRUPT`, and `HGRID_ERROR_OTHER_CONTENT` for shapes and scenes;
/// - with both: `HGRID_ERROR_MESH_MISMATCH`, `HGRID_ERROR_NO_MESH`.
///
/// Threads: any number of calls at once, also on the same blob, each with a view of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_open(
    blob: *const c_void,
    blob_bytes: usize,
    mesh: *const hgrid_mesh,
    grid: *mut hgrid_grid,
) -> hgrid_status {
    let (false, Some(to)) = (blob.is_null(), NonNull::new(grid)) else {
        return HGRID_ERROR_NULL_ARGUMENT;
    };
    // SAFETY: the caller's promise.
    match unsafe { raw::open(blob, blob_bytes, mesh) } {
        Ok(opened) => {
            // SAFETY: the caller's promise.
            unsafe { raw::write_grid(to, &opened) };
            HGRID_OK
        }
        Err(status) => status,
    }
}

/// Gives a tree (`HGRID_METHOD_BVH`) the boxes of a mesh whose vertices moved: in place, in a fraction of
/// the time of a build, without scratch.
///
/// `blob` is the index of a build, or a copy of it, at a multiple of `HGRID_ALIGNMENT`; `blob_bytes` is its size, and
/// bytes behind the blob are not touched. `mesh` has the same triangles as the mesh that the tree was built for, with
/// the vertices where they are now; blob and mesh do not overlap. Queries on the view that the call writes answer as
/// those of a new build do. Do not use views that were made before the call: queries on them do no harm, but may
/// answer anything.
///
/// The leaves stay as they were built, so rays take longer the more the mesh changes. Remember `cost_before` of
/// the first refit after a build, and build anew once `cost_after` is well above it, say by half: times of rays grow
/// about as the cost does, if the box of the tree stays about as large. A cost is relative to the surface of this box,
/// so one vertex that moves far away makes it small. Where that may be, multiply each cost by the surface of the box
/// around all vertices at that time, and compare the products.
///
/// A triangle that the build left out, because a coordinate was not finite or beyond 2^120, is in no leaf. If it fits
/// now, the call fails: build again. Scenes that show the grid need `hgrid_refit_scene` next, the innermost first: they
/// keep its box.
///
/// `mesh`, `blob` and `grid` may not be NULL. `report` may be NULL. Returns `HGRID_OK` and writes the view
/// to `grid`; or returns the reason, and blob and `grid` are as they were:
/// - `HGRID_ERROR_CANNOT_REFIT` for a blob of another method, and for one that `hgrid_pack` wrote;
/// - `HGRID_ERROR_MESH_MISMATCH` for a mesh with other counts, and if a triangle became finite;
/// - `HGRID_ERROR_NON_FINITE` if a triangle of a leaf is not finite any more, whatever the flags of the build;
/// - `HGRID_ERROR_INDEX_OUT_OF_RANGE`, `HGRID_ERROR_OVERLAP`, `HGRID_ERROR_NULL_ARGUMENT`,
///   `HGRID_ERROR_STRUCT_SIZE`;
/// - what `hgrid_open` returns.
///
/// The report is written in both cases. The call allocates nothing, and takes the stack of a build.
///
/// Threads: any number of calls at once, each with a blob, a view and a report of its own. No query may run
/// on the blob during the call.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_refit(
    mesh: *const hgrid_mesh,
    blob: *mut c_void,
    blob_bytes: usize,
    grid: *mut hgrid_grid,
    report: *mut hgrid_refit_report,
) -> hgrid_status {
    let blob = RawRegion { start: blob, bytes: blob_bytes };
    let call = |report: &mut hgrid_refit_report| {
        let to = NonNull::new(grid).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        let refitted = unsafe { raw::refit(mesh, blob, report) }?;
        // SAFETY: the caller's promise.
        unsafe { raw::write_grid(to, &refitted) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting_refit(report, call) }
}

/// Tells what a blob is from its first 128 bytes: before there is memory for the rest, say.
///
/// The bytes may lie at any address. `info` may not be NULL; `blob` may be NULL if
/// `blob_bytes` is 0.
/// Returns `HGRID_OK` and fills `info`, or returns the reason and leaves it as it was:
/// `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_NOT_A_GRID`,
/// `HGRID_ERROR_TRUNCATED`, `HGRID_ERROR_WRONG_BYTE_ORDER`,
/// `HGRID_ERROR_UNSUPPORTED_VERSION`, `HGRID_ERROR_METHOD_REMOVED`, `HGRID_ERROR_CORRUPT`.
///
/// Threads: any number of calls at once, each with an info of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_peek(
    blob: *const c_void,
    blob_bytes: usize,
    info: *mut hgrid_blob_info,
) -> hgrid_status {
    let call = |info: &mut hgrid_blob_info| {
        // SAFETY: the caller's promise.
        info.note(&unsafe { raw::peek(blob, blob_bytes) }?);
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { raw::filling(info, call) }
}

/// Writes a grid and its mesh as one blob, for which `hgrid_open` needs no mesh: to be stored where
/// the mesh is not, or mapped by several processes.
///
/// It holds the grid, then positions, indices (of 32 bits) and masks if there are any, tight, each
/// at a multiple of 64; about 12 bytes for each vertex and for each triangle more than the grid.
/// Nothing is copied when it is opened. Meshes that were joined become one mesh with the same triangles and numbers;
/// the blob keeps where each of them begins, in 4 bytes, and `hgrid_locate` answers as before.
///
/// `to` starts at a multiple of `HGRID_ALIGNMENT` and overlaps neither blob nor mesh nor
/// any argument of this call. It may be NULL if `capacity` is 0: to ask for the size.
/// `grid` and `bytes` may not be NULL.
///
/// Returns `HGRID_OK` and has written the blob, or `HGRID_ERROR_INDEX_TOO_SMALL` and has
/// written none of it; in both cases `bytes` becomes its size. Or returns the reason and has
/// written nothing: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_NOT_A_GRID`,
/// `HGRID_ERROR_MISALIGNED`, `HGRID_ERROR_OVERLAP`, `HGRID_ERROR_INDEX_OUT_OF_RANGE` if the
/// mesh is damaged. More than is needed is not touched.
///
/// Threads: any number of calls and queries on the same grid at once, each with memory of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_pack(
    grid: *const hgrid_grid,
    to: *mut c_void,
    capacity: usize,
    bytes: *mut u64,
) -> hgrid_status {
    let call = || {
        let size = NonNull::new(bytes).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        let grid = unsafe { raw::grid(grid) }?;
        // SAFETY: the caller's promise.
        let packed = unsafe { raw::pack(grid, RawRegion { start: to, bytes: capacity }) };
        if matches!(packed, Ok(()) | Err(HGRID_ERROR_INDEX_TOO_SMALL)) {
            // SAFETY: the caller's promise.
            unsafe { raw::write(size, grid.packed_bytes()) };
        }
        packed
    };
    call().err().unwrap_or(HGRID_OK)
}

/// Tells where the mesh of a grid is: the arrays that were given to the build or to `hgrid_open`, or
/// those in a blob that `hgrid_pack` wrote (tight, with indices of 32 bits).
///
/// `mesh` was initialised with `HGRID_MESH_INIT`, and describes the mesh as for a build: with strides that are not 0,
/// and arrays that are NULL if they are empty; without masks both of their fields are 0. Of meshes that were joined it
/// is the joined one, with `parts`, without arrays and with strides of 0, unless they were packed: a packed mesh is
/// one. It is good for as long as the grid is. Neither argument may be NULL. Returns `HGRID_OK` and fills `mesh`; or
/// `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_NULL_ARGUMENT` or `HGRID_ERROR_STRUCT_SIZE`, and leaves it as it was.
///
/// Threads: any number of calls and queries on the same grid at once, each with a mesh of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_mesh_of(
    grid: *const hgrid_grid,
    mesh: *mut hgrid_mesh,
) -> hgrid_status {
    let call = |mesh: &mut hgrid_mesh| {
        // SAFETY: the caller's promise.
        mesh.note(unsafe { raw::grid(grid) }?.mesh());
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { raw::filling(mesh, call) }
}

/// Proves that a blob is the grid of its mesh, and so that every answer will be right.
///
/// Takes a small multiple of the time of a build. On damaged bytes a grid of another method than `HGRID_METHOD_BVH` may
/// take much longer, within docs/bounds.md. A grid that was just built needs no proof; a blob from a file, a network or
/// another process may.
///
/// A tree (`HGRID_METHOD_BVH`) is proven in scratch: a bit for each triangle, of which `hgrid_validate_bytes`
/// and `HGRID_VALIDATE_BOUND` tell the bytes. The other methods take none. The scratch may lie at any
/// address, overlaps neither blob nor mesh nor any argument of this call, and may be NULL if
/// `scratch_bytes` is 0. It may hold anything before and holds nothing of use afterwards.
///
/// Returns `HGRID_OK`; `HGRID_ERROR_CORRUPT`; `HGRID_ERROR_INDEX_OUT_OF_RANGE` if the mesh is damaged;
/// `HGRID_ERROR_SCRATCH_TOO_SMALL` or `HGRID_ERROR_OVERLAP` if the scratch is too small or overlaps;
/// `HGRID_ERROR_NOT_A_GRID` for a view of zeros (`HGRID_GRID_INIT`);
/// `HGRID_ERROR_NULL_ARGUMENT`.
///
/// Threads: any number of calls and queries on the same grid at once, each with scratch of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_validate(
    grid: *const hgrid_grid,
    scratch: *mut c_void,
    scratch_bytes: usize,
) -> hgrid_status {
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    // SAFETY: the caller's promise.
    let proof = unsafe { raw::grid(grid) }.and_then(|grid| {
        // SAFETY: the caller's promise.
        unsafe { raw::validate(grid, scratch) }
    });
    proof.err().unwrap_or(HGRID_OK)
}

/// Tells how much scratch `hgrid_validate` takes for a grid: 0, or for a tree a bit for each
/// triangle, rounded up to four bytes.
///
/// 0 also for NULL and for a view of zeros (`HGRID_GRID_INIT`).
///
/// Threads: any number of calls and queries on the same grid at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_validate_bytes(grid: *const hgrid_grid) -> usize {
    // SAFETY: the caller's promise.
    unsafe { raw::grid(grid) }.map_or(0, Grid::validate_bytes)
}

/// Looks at all of a grid and its mesh: O(cells + ids + triangles), no memory.
///
/// Neither argument may be NULL. Returns `HGRID_OK` and fills `statistics`; or
/// `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_NULL_ARGUMENT` or `HGRID_ERROR_STRUCT_SIZE`, and leaves
/// it as it was. On damaged bytes it counts what is there.
///
/// Threads: any number of calls and queries on the same grid at once,
/// each with statistics of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_inspect(
    grid: *const hgrid_grid,
    statistics: *mut hgrid_statistics,
) -> hgrid_status {
    let call = |statistics: &mut hgrid_statistics| {
        // SAFETY: the caller's promise.
        statistics.note(&unsafe { raw::grid(grid) }?.inspect());
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { raw::filling(statistics, call) }
}
