//! Batches in scenes: queries of many rays, from the caller's structs into the caller's structs.

use hgrid_core::{Scene, SceneOptions};

use crate::query_types::{self, hgrid_coherence};
use crate::raw;
use crate::raw::BatchArrays;
use crate::scene::{hgrid_ray_f64, hgrid_scene, hgrid_scene_hit, hgrid_scene_options};
use crate::status::{HGRID_OK, hgrid_status};

/// Finds the closest thing in a scene that each of many rays hits: what `hgrid_intersect_scene` would find
/// for each, bit for bit, and sooner for rays near each other.
///
/// It is to a scene what `hgrid_intersect_n` is to a grid, and the rules for arrays, strides and coherence are
/// the same: a ray lies every `ray_stride` bytes from `rays` on, and its hit goes to the same place of `hits`.
/// A miss writes a hit, too: with `primitive` and every number of `path` equal to `HGRID_INVALID_ID`, `t`
/// equal to `INFINITY`, `u` and `v` equal to 0. Rays that meet the same instances are traced together, so pass
/// at least a tile of 8 x 8 pixels in one call:
///
/// ```c
/// static size_t trace_tile_of_scene(const hgrid_scene *scene, const hgrid_ray_f64 rays[64],
///                                   hgrid_scene_hit hits[64])
/// {
///     size_t found = 0;
///     if (hgrid_intersect_scene_n(scene, rays, 0, hits, 0, 64, HGRID_COHERENCE_COHERENT, NULL) != HGRID_OK)
///         return 0;
///     for (size_t i = 0; i < 64; i++)
///         found += hits[i].primitive != HGRID_INVALID_ID;
///     return found;
/// }
/// ```
///
/// For rays without any order lend `scratch` of the options, and pass as many as you have in one call. With a
/// `filter` or `counters` the rays are traced one by one, in the order of the array: the filter is asked about all
/// hits of one ray before those of the next. Nested scenes are asked for each ray alone, too.
///
/// With `count` 0 the arguments are checked and nothing is traced. Rays are read and hits are written in any
/// order, and a ray perhaps more than once, before its hit is written.
///
/// `rays` and `hits` may be NULL if `count` is 0. `options` may be NULL: the defaults. They are for all rays.
///
/// Returns `HGRID_OK` and has written all hits, or returns the reason and has written none:
/// `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_NOT_A_GRID` for a view of zeros, `HGRID_ERROR_STRUCT_SIZE` and
/// `HGRID_ERROR_INVALID_CULL` (the options), `HGRID_ERROR_INVALID_RAYS` and `HGRID_ERROR_INVALID_ANSWERS` (a
/// stride, or a count that is impossible), `HGRID_ERROR_OVERLAP` (also of `scratch`),
/// `HGRID_ERROR_INVALID_COHERENCE`. An invalid ray (a NaN, say, or no direction) is no error: it misses.
///
/// The call allocates nothing. It needs at most 80 KiB of stack, and 8 KiB more for each scene inside the
/// scene, and what the tests of shapes need.
///
/// Threads: any number of queries on the same scene at once; each thread with hits and counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_intersect_scene_n(
    scene: *const hgrid_scene,
    rays: *const hgrid_ray_f64,
    ray_stride: usize,
    hits: *mut hgrid_scene_hit,
    hit_stride: usize,
    count: usize,
    coherence: hgrid_coherence,
    options: *const hgrid_scene_options,
) -> hgrid_status {
    let call = || {
        let batch = BatchArrays::new((rays, ray_stride), (hits, hit_stride), count)?;
        let coherence = query_types::coherence(coherence)?;
        let trace = |scene: &Scene<'_>,
                     rays: &mut raw::RunningBatch<'_, hgrid_ray_f64, hgrid_scene_hit>,
                     options: &mut SceneOptions<'_>| {
            scene.intersect_batch(rays, coherence, options);
        };
        // SAFETY: the caller's promise.
        unsafe { raw::scene_batch(scene, &batch, options, trace) }
    };
    call().err().unwrap_or(HGRID_OK)
}

/// Tells for each of many rays whether it hits anything in a scene: what `hgrid_occluded_scene` would say for
/// each, but faster.
///
/// Writes a byte for each ray, 1 if it hits anything and 0 if not, every `occluded_stride` bytes from
/// `occluded` on. All else is as with `hgrid_intersect_scene_n`. `rays` and `occluded` may be NULL if `count` is
/// 0, `options` may be NULL. Returns `HGRID_OK` and has written all bytes, or returns what
/// `hgrid_intersect_scene_n` returns and has written none.
///
/// Threads: any number of queries on the same scene at once; each thread with bytes and counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluded_scene_n(
    scene: *const hgrid_scene,
    rays: *const hgrid_ray_f64,
    ray_stride: usize,
    occluded: *mut u8,
    occluded_stride: usize,
    count: usize,
    coherence: hgrid_coherence,
    options: *const hgrid_scene_options,
) -> hgrid_status {
    let call = || {
        let batch = BatchArrays::new((rays, ray_stride), (occluded, occluded_stride), count)?;
        let coherence = query_types::coherence(coherence)?;
        let trace = |scene: &Scene<'_>,
                     rays: &mut raw::RunningBatch<'_, hgrid_ray_f64, u8>,
                     options: &mut SceneOptions<'_>| {
            scene.occluded_batch(rays, coherence, options);
        };
        // SAFETY: the caller's promise.
        unsafe { raw::scene_batch(scene, &batch, options, trace) }
    };
    call().err().unwrap_or(HGRID_OK)
}
