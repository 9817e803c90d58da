//! Batches: queries of many rays, from the caller's structs into the caller's structs.

use hgrid_core::{Grid, QueryOptions};

use crate::query_types::{self, hgrid_coherence, hgrid_hit, hgrid_query_options, hgrid_ray};
use crate::raw;
use crate::raw::BatchArrays;
use crate::status::{HGRID_OK, hgrid_status};
use crate::types::hgrid_grid;

/// Finds the closest triangle that each of many rays hits: what `hgrid_intersect` would find for
/// each, bit for bit, but faster.
///
/// A ray lies every `ray_stride` bytes from `rays` on, and its hit goes to the same place of
/// `hits`. A miss writes a hit, too: with `primitive` equal to `HGRID_INVALID_ID`, `t` equal to
/// `INFINITY`, `u` and `v` equal to 0. Here is a tile of 8 x 8 pixels:
///
/// ```c
/// static size_t trace_tile(const hgrid_grid *grid, const hgrid_ray rays[64], float depth[64])
/// {
///     hgrid_hit hits[64];
///     size_t found = 0;
///     if (hgrid_intersect_n(grid, rays, 0, hits, 0, 64, HGRID_COHERENCE_COHERENT, NULL) != HGRID_OK)
///         return 0;
///     for (size_t i = 0; i < 64; i++) {
///         depth[i] = hits[i].t;
///         found += hits[i].primitive != HGRID_INVALID_ID;
///     }
///     return found;
/// }
/// ```
///
/// Rays and hits may lie in structs of yours, also in the same ones: with `struct {hgrid_ray ray;
/// hgrid_hit hit; int pixel;}` both strides are the size of the struct. A stride of 0 means side by
/// side. Neither array needs any alignment, and bytes between elements are neither read nor written.
/// No hit may overlap a ray, nor anything else that the call uses, such as blob and mesh with the bytes
/// between its vertices; the call compares hits only with rays and `scratch`. If rays and hits interleave, their
/// strides must be equal.
///
/// `coherence` is what you know about the rays, one of `HGRID_COHERENCE_...`; it has no influence on
/// the hits. For rays without any order lend memory to sort them in, and pass as many as you have in
/// one call:
///
/// ```c
/// static hgrid_status trace_all(const hgrid_grid *grid, const hgrid_ray *rays, hgrid_hit *hits,
///                               size_t count, void *scratch, size_t scratch_bytes)
/// {
///     hgrid_query_options options = HGRID_QUERY_OPTIONS_INIT;
///     options.scratch = scratch, options.scratch_bytes = scratch_bytes;
///     return hgrid_intersect_n(grid, rays, 0, hits, 0, count, HGRID_COHERENCE_INCOHERENT, &options);
/// }
/// ```
///
/// With `count` 0 the arguments are checked and nothing is traced. Rays are read and hits are written in any
/// order, and a ray perhaps more than once, before its hit is written.
///
/// `rays` and `hits` may be NULL if `count` is 0. `options` may be NULL: the defaults. They are for
/// all rays.
///
/// Returns `HGRID_OK` and has written all hits, or returns the reason and has written none:
/// `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_STRUCT_SIZE` and
/// `HGRID_ERROR_INVALID_CULL` (the options), `HGRID_ERROR_INVALID_RAYS` and
/// `HGRID_ERROR_INVALID_ANSWERS` (a stride, or a count that is impossible), `HGRID_ERROR_OVERLAP`
/// (also of `scratch`),
/// `HGRID_ERROR_INVALID_COHERENCE`. An invalid ray (a NaN, say, or no direction) is no error: it misses.
///
/// The call allocates nothing and needs at most 40 KiB of stack.
///
/// Threads: any number of queries on the same grid at once; each thread with hits and counters of
/// its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_intersect_n(
    grid: *const hgrid_grid,
    rays: *const hgrid_ray,
    ray_stride: usize,
    hits: *mut hgrid_hit,
    hit_stride: usize,
    count: usize,
    coherence: hgrid_coherence,
    options: *const hgrid_query_options,
) -> hgrid_status {
    let call = || {
        let batch = BatchArrays::new((rays, ray_stride), (hits, hit_stride), count)?;
        let coherence = query_types::coherence(coherence)?;
        let trace = |grid: &Grid<'_>,
                     rays: &mut raw::RunningBatch<'_, hgrid_ray, hgrid_hit>,
                     options: &mut QueryOptions<'_>| {
            grid.intersect_batch(rays, coherence, options);
        };
        // SAFETY: the caller's promise.
        unsafe { raw::batch(grid, &batch, options, trace) }
    };
    call().err().unwrap_or(HGRID_OK)
}

/// Tells for each of many rays whether it hits anything: what `hgrid_occluded` would say for each,
/// but faster.
///
/// Writes a byte for each ray, 1 if it hits anything and 0 if not, every `occluded_stride` bytes
/// from `occluded` on. All else is as with `hgrid_intersect_n`: strides, structs that
/// hold a ray and its byte, coherence, options and their `scratch`, stack. `rays` and `occluded` may be
/// NULL if `count` is 0, `options` may be NULL. Returns `HGRID_OK` and has written all
/// bytes, or returns what `hgrid_intersect_n` returns and has written none. For the
/// shadow rays of a tile, towards one light, which start where `hgrid_surface_at` says:
///
/// ```c
/// static size_t count_lit(const hgrid_grid *grid, const hgrid_ray *rays, size_t count)
/// {
///     unsigned char occluded[64];
///     size_t lit = 0;
///     for (size_t first = 0; first < count; first += 64) {
///         const size_t n = count - first < 64 ? count - first : 64;
///         if (hgrid_occluded_n(grid, rays + first, 0, occluded, 0, n, HGRID_COHERENCE_COHERENT,
///                              NULL) != HGRID_OK)
///             return 0;
///         for (size_t i = 0; i < n; i++)
///             lit += !occluded[i];
///     }
///     return lit;
/// }
/// ```
///
/// Threads: any number of queries on the same grid at once; each thread with bytes and counters of
/// its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluded_n(
    grid: *const hgrid_grid,
    rays: *const hgrid_ray,
    ray_stride: usize,
    occluded: *mut u8,
    occluded_stride: usize,
    count: usize,
    coherence: hgrid_coherence,
    options: *const hgrid_query_options,
) -> hgrid_status {
    let call = || {
        let batch = BatchArrays::new((rays, ray_stride), (occluded, occluded_stride), count)?;
        let coherence = query_types::coherence(coherence)?;
        let trace = |grid: &Grid<'_>,
                     rays: &mut raw::RunningBatch<'_, hgrid_ray, u8>,
                     options: &mut QueryOptions<'_>| {
            grid.occluded_batch(rays, coherence, options);
        };
        // SAFETY: the caller's promise.
        unsafe { raw::batch(grid, &batch, options, trace) }
    };
    call().err().unwrap_or(HGRID_OK)
}

/// Names for each of many rays a triangle that blocks it: as `hgrid_occluder` would, but faster.
///
/// Writes a `uint32_t` for each ray, a triangle or `HGRID_INVALID_ID`, every `occluder_stride` bytes
/// from `occluders` on. It is `HGRID_INVALID_ID` where `hgrid_occluded_n` writes 0. Where several
/// triangles block a ray, it may be another one than `hgrid_occluder` names. All else is as with
/// `hgrid_occluded_n`. `rays` and `occluders` may be NULL if `count` is 0, `options` may be NULL.
/// Returns `HGRID_OK` and has written all names, or returns what `hgrid_intersect_n` returns and has
/// written none.
///
/// Threads: any number of queries on the same grid at once; each thread with names and counters of
/// its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluder_n(
    grid: *const hgrid_grid,
    rays: *const hgrid_ray,
    ray_stride: usize,
    occluders: *mut u32,
    occluder_stride: usize,
    count: usize,
    coherence: hgrid_coherence,
    options: *const hgrid_query_options,
) -> hgrid_status {
    let call = || {
        let batch = BatchArrays::new((rays, ray_stride), (occluders, occluder_stride), count)?;
        let coherence = query_types::coherence(coherence)?;
        let trace = |grid: &Grid<'_>,
                     rays: &mut raw::RunningBatch<'_, hgrid_ray, u32>,
                     options: &mut QueryOptions<'_>| {
            grid.occluder_batch(rays, coherence, options);
        };
        // SAFETY: the caller's promise.
        unsafe { raw::batch(grid, &batch, options, trace) }
    };
    call().err().unwrap_or(HGRID_OK)
}
