//! The queries of one ray or one point.

use core::ptr::NonNull;

use hgrid_core::{Grid, INVALID_ID, QueryOptions};

use crate::query_types::{
    hgrid_closest, hgrid_hit, hgrid_point_query, hgrid_query_options, hgrid_ray, hgrid_surface,
};
use crate::raw;
use crate::status::{HGRID_ERROR_NULL_ARGUMENT, HGRID_OK, hgrid_status};
use crate::types::hgrid_grid;

/// Finds the closest triangle that a ray hits.
///
/// Returns true and writes `hit`; or returns false and writes nothing. Where several triangles are
/// hit at the same `t`, the one with the lowest number is reported. Both sides of a triangle
/// count, unless `cull` of the options says otherwise. A ray through an edge or a vertex
/// that triangles share hits at least one of them. A triangle without area, or one that is
/// seen exactly edge-on, is not hit, up to rounding.
///
/// `options` may be NULL: the defaults. With another NULL, with a view of zeros (`HGRID_GRID_INIT`),
/// or with options that break the rules for structs, nothing is hit. A query of an uninitialised view, or
/// of one whose blob or mesh is gone, is undefined behaviour.
///
/// A query allocates nothing and needs at most 9 KiB of stack, as all queries of one ray or point do. It
/// always ends: in a grid of one level after at most as many steps as the three resolutions add up to.
///
/// Threads: any number of queries on the same grid at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_intersect(
    grid: *const hgrid_grid,
    ray: *const hgrid_ray,
    options: *const hgrid_query_options,
    hit: *mut hgrid_hit,
) -> bool {
    let Some(to) = NonNull::new(hit) else { return false };
    let plain = |grid: &Grid<'_>, ray: &_| grid.intersect(ray);
    let with = |grid: &Grid<'_>, ray: &_, options: &mut QueryOptions<'_>| {
        grid.intersect_with(ray, options)
    };
    // SAFETY: the caller's promise.
    let Ok(Some(found)) = (unsafe { raw::query(grid, ray, options, plain, with) }) else {
        return false;
    };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to, found.into()) };
    true
}

/// Tells whether a ray hits anything: what `hgrid_intersect` would return, but faster.
///
/// This is the query for shadows and visibility. It stops at the first triangle it finds in the
/// ray's range, which need not be the closest.
///
/// `options` may be NULL: the defaults. With another NULL, with a view of zeros (`HGRID_GRID_INIT`),
/// or with options that break the rules for structs, the answer is false.
///
/// Threads: any number of queries on the same grid at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluded(
    grid: *const hgrid_grid,
    ray: *const hgrid_ray,
    options: *const hgrid_query_options,
) -> bool {
    let plain = |grid: &Grid<'_>, ray: &_| grid.occluded(ray);
    let with =
        |grid: &Grid<'_>, ray: &_, options: &mut QueryOptions<'_>| grid.occluded_with(ray, options);
    // SAFETY: the caller's promise.
    unsafe { raw::query(grid, ray, options, plain, with) }.unwrap_or(false)
}

/// Names a triangle that blocks a ray, or `HGRID_INVALID_ID` where `hgrid_occluded` would say false.
///
/// The ray hits this triangle in its range. It need not be the closest one, and another one may be named
/// in a batch or on another machine. Shadow rays that follow may be tested against it first:
///
/// ```c
/// static bool is_lit(const hgrid_grid *grid, const hgrid_ray *to_light, uint32_t *blocker)
/// {
///     *blocker = hgrid_occluder(grid, to_light, NULL);
///     return *blocker == HGRID_INVALID_ID;
/// }
/// ```
///
/// `options` may be NULL: the defaults. With another NULL, with a view of zeros (`HGRID_GRID_INIT`),
/// or with options that break the rules for structs, the answer is `HGRID_INVALID_ID`.
///
/// Threads: any number of queries on the same grid at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluder(
    grid: *const hgrid_grid,
    ray: *const hgrid_ray,
    options: *const hgrid_query_options,
) -> u32 {
    let with =
        |grid: &Grid<'_>, ray: &_, options: &mut QueryOptions<'_>| grid.occluder(ray, options);
    let plain = |grid: &Grid<'_>, ray: &_| grid.occluder(ray, &mut QueryOptions::default());
    // SAFETY: the caller's promise.
    let found = unsafe { raw::query(grid, ray, options, plain, with) };
    found.ok().flatten().unwrap_or(INVALID_ID)
}

/// Finds all triangles that a ray hits: by ascending `t`, where that is equal by number, each once.
///
/// Writes the nearest hits to `hits`, up to `capacity`, and the number of all hits to `count`, which may
/// be larger; `capacity` 0 only counts. In a tree without a filter, one traversal keeps the nearest hits in
/// a heap, in time proportional to the number of hits times the logarithm of `capacity`. With a filter, and
/// with the other methods if `capacity` is too small for all hits, the ray is traversed again for every
/// sixteen hits, each time from the last of them. That takes no memory, but the time for thousands of hits
/// in one cell grows with the square of their number. Options are as with `hgrid_intersect`: a filter gets
/// each hit, from near to far, and those that it accepts are written and counted.
///
/// The example computes how much light from the end of a ray (`t_max`) passes through panes of glass, one
/// triangle each. More than 64 panes count as a wall. (A ray through an edge that two panes share meets both.)
///
/// ```c
/// static float light_behind(const hgrid_grid *grid, const hgrid_ray *ray, const float *share)
/// {
///     hgrid_hit panes[64];
///     size_t count;
///     float light = 1;
///     if (hgrid_intersect_all(grid, ray, NULL, panes, 64, &count) != HGRID_OK || count > 64)
///         return 0;
///     for (size_t i = 0; i < count; i++)
///         light *= share[panes[i].primitive];
///     return light;
/// }
/// ```
///
/// `hits` may be NULL if `capacity` is 0, and overlaps nothing else that the call uses; a
/// filter may look at those that it has accepted. `options` may be NULL: the defaults.
/// Returns `HGRID_OK`, or returns the reason and writes nothing: `HGRID_ERROR_NULL_ARGUMENT`,
/// `HGRID_ERROR_NOT_A_GRID`, `HGRID_ERROR_STRUCT_SIZE` and `HGRID_ERROR_INVALID_CULL` (the
/// options), `HGRID_ERROR_INVALID_ANSWERS` (a capacity that is impossible). An invalid ray hits nothing: the
/// count is 0.
///
/// Threads: any number of queries on the same grid at once; each thread with hits and counters of
/// its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_intersect_all(
    grid: *const hgrid_grid,
    ray: *const hgrid_ray,
    options: *const hgrid_query_options,
    hits: *mut hgrid_hit,
    capacity: usize,
    count: *mut usize,
) -> hgrid_status {
    let call = || {
        let to = NonNull::new(count).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        let found = unsafe { raw::query_all(grid, ray, options, hits, capacity) }?;
        // SAFETY: the caller's promise.
        unsafe { raw::write(to, found) };
        Ok(())
    };
    call().err().unwrap_or(HGRID_OK)
}

/// Finds the point of the mesh that is closest to `point` of the query, `max_distance` away at most.
///
/// Returns true and writes `closest`; or returns false and writes nothing. Where several triangles
/// are equally close, the one with the lowest number is reported. `query` and `closest` may not be NULL.
///
/// ```c
/// static float distance_to(const hgrid_grid *grid, float x, float y, float z)
/// {
///     const hgrid_point_query query = {{x, y, z}, INFINITY};
///     hgrid_closest closest;
///     return hgrid_closest_point(grid, &query, NULL, &closest) ? closest.distance : INFINITY;
/// }
/// ```
///
/// Of the options, `mask`, `skip` and `counters` are used: `cell_steps` counts the lists or leaves that are
/// visited, `primitive_tests` the triangles in them, `grid_steps` the nodes of a tree. `options` may be
/// NULL: the defaults. The call returns false for invalid arguments: another NULL, a view of zeros, options
/// that break the rules, a point that is not finite, a distance that is NaN or negative. A triangle whose distance is
/// beyond the range of `float` is not found, whatever `max_distance` is.
///
/// The call allocates nothing and always ends. With `HGRID_METHOD_BVH` it visits the nodes that are no
/// farther than the answer, wherever the point lies. With the other methods the time grows with the
/// triangles in a cube around the point that reaches as far as the answer. So they are fast near the mesh;
/// for points far outside they test a large part of all triangles.
///
/// Threads: any number of queries on the same grid at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_closest_point(
    grid: *const hgrid_grid,
    query: *const hgrid_point_query,
    options: *const hgrid_query_options,
    closest: *mut hgrid_closest,
) -> bool {
    let Some(to) = NonNull::new(closest) else { return false };
    // SAFETY: the caller's promise.
    let Ok(Some(found)) = (unsafe { raw::closest_point(grid, query, options) }) else {
        return false;
    };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to, found.into()) };
    true
}

/// Tells where a ray met the mesh, which way the triangle faces there, and where rays start that leave
/// it.
///
/// `hit` is what a query has found for `ray`. The ray's direction tells the side. Returns true and writes `surface`;
/// or returns false and writes nothing: the hit names no triangle (as that of a miss), the ray has no direction, the
/// view is one of zeros, or a pointer is NULL. Takes about as long as a triangle test in `double`.
///
/// A ray from `above` to that side of the triangle's plane does not hit the triangle, nor one from
/// `below` to the other side: with `t_min` 0, at any scale, alone and in a batch. So rays to lights need
/// no epsilon, and no `skip`, which would be one triangle for all rays of a batch:
///
/// ```c
/// static bool sees_light(const hgrid_grid *grid, const hgrid_ray *ray, const hgrid_hit *hit,
///                        const float toward[3])
/// {
///     hgrid_surface at;
///     if (!hgrid_surface_at(grid, ray, hit, &at))
///         return false;
///     const float height =
///         at.normal[0] * toward[0] + at.normal[1] * toward[1] + at.normal[2] * toward[2];
///     const hgrid_ray to_light = {{at.above[0], at.above[1], at.above[2]}, 0,
///                                 {toward[0], toward[1], toward[2]}, INFINITY};
///     return height > 0 && !hgrid_occluded(grid, &to_light, NULL);
/// }
/// ```
///
/// An origin lies off the plane by 2^-20 of the distance from the point to the triangle's farthest corner, measured
/// along one axis, and is rounded away from the plane: far more than a test may be off. A ray nearly along the plane
/// may still hit the triangle, as the normal is rounded. A triangle without area, or a needle thinner than 1e-9 of its
/// length, has no normal to rely on; if there is none at all, `normal` faces the ray. `is_front` agrees with `cull`,
/// except for triangles that the ray sees nearly edge-on.
///
/// Threads: any number of calls and queries on the same grid at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_surface_at(
    grid: *const hgrid_grid,
    ray: *const hgrid_ray,
    hit: *const hgrid_hit,
    surface: *mut hgrid_surface,
) -> bool {
    let Some(to) = NonNull::new(surface) else { return false };
    // SAFETY: the caller's promise.
    let Ok(Some(found)) = (unsafe { raw::surface(grid, ray, hit) }) else { return false };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to, found.into()) };
    true
}

/// Tells which mesh a triangle is of, in a grid of meshes that `hgrid_join` joined.
///
/// `primitive` is the number that a hit has. Returns true and writes to `geometry` the place of its mesh in the
/// array that was joined, and to `triangle` its number in that mesh's own indices; or returns false and
/// writes nothing: if the grid has no such triangle, for NULL, and for a view of zeros
/// (`HGRID_GRID_INIT`).
///
/// In a grid of one mesh every triangle is of mesh 0. A grid that was opened from what `hgrid_pack` wrote knows
/// the meshes as well as the one that was packed. It takes a binary search among the meshes.
///
/// ```c
/// static uint32_t material_of(const hgrid_grid *grid, const hgrid_hit *hit,
///                             const uint32_t *const *materials)
/// {
///     uint32_t geometry, triangle;
///     if (!hgrid_locate(grid, hit->primitive, &geometry, &triangle))
///         return 0;
///     return materials[geometry][triangle];
/// }
/// ```
///
/// Threads: any number of calls and queries on the same grid at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_locate(
    grid: *const hgrid_grid,
    primitive: u32,
    geometry: *mut u32,
    triangle: *mut u32,
) -> bool {
    let (Some(to_geometry), Some(to_triangle)) = (NonNull::new(geometry), NonNull::new(triangle))
    else {
        return false;
    };
    // SAFETY: the caller's promise.
    let Ok(Some((geometry, triangle))) = (unsafe { raw::locate(grid, primitive) }) else {
        return false;
    };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to_geometry, geometry) };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to_triangle, triangle) };
    true
}
