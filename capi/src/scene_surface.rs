//! The point of a scene where a ray met a triangle, and normals there.

use core::ptr::NonNull;

use hgrid_core::SceneSurface;

use crate::raw;
use crate::scene::{hgrid_ray_f64, hgrid_scene, hgrid_scene_hit};

/// A point of a scene where a ray met a triangle: 88 bytes. `hgrid_scene_surface_at` fills it.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_scene_surface {
    /// The point, in the scene.
    pub position: [f64; 3],
    /// Origin for rays that leave on the side that the ray came from: reflections, and rays to lights.
    pub above: [f64; 3],
    /// Origin for rays that go on through the triangle.
    pub below: [f64; 3],
    /// The triangle's normal in the scene, of length 1, on the side that the ray came from.
    pub normal: [f32; 3],
    /// 1 if the ray met the triangle's front, else 0; an instance that mirrors does not turn it.
    pub is_front: u32,
}

impl From<SceneSurface> for hgrid_scene_surface {
    fn from(surface: SceneSurface) -> Self {
        let SceneSurface { position, above, below, normal, is_front } = surface;
        Self { position, above, below, normal, is_front }
    }
}

/// Tells where a ray met a triangle of a scene, which way the triangle faces there, and where rays start that leave it.
///
/// It is to a scene what `hgrid_surface_at` is to a grid. `hit` is what a query has found for `ray`; the direction of
/// `ray` tells the side. Returns true and writes `surface`; or returns false and writes nothing, in these cases:
/// - the hit names no triangle, but a shape or nothing;
/// - the ray has no direction, the view is one of zeros, or a pointer is NULL;
/// - coordinates are too coarse to tell the sides of the triangle apart: `double` at this distance from the scene's
///   origin, or `float` in the object.
///
/// A ray from `above` to that side of the triangle's plane does not hit the triangle, nor one from `below` to the
/// other side: with `t_min` 0, at any place in the scene, alone and in a batch. Rays nearly along the plane, as the
/// object sees them, may hit it, because normal and direction are rounded. An origin is lifted as by
/// `hgrid_surface_at`, or by up to four times the rounding error of its transformation, if that is more. Do not round
/// an origin to `float`: it may lie below the plane then. What `hgrid_surface_at` says about triangles without area
/// holds here, too.
///
/// ```c
/// static bool sees_light_in_scene(const hgrid_scene *scene, const hgrid_ray_f64 *ray, const hgrid_scene_hit *hit,
///                                 const float toward[3])
/// {
///     hgrid_scene_surface at;
///     if (!hgrid_scene_surface_at(scene, ray, hit, &at))
///         return false;
///     const float height =
///         at.normal[0] * toward[0] + at.normal[1] * toward[1] + at.normal[2] * toward[2];
///     const hgrid_ray_f64 to_light = {{at.above[0], at.above[1], at.above[2]},
///                                     {toward[0], toward[1], toward[2]}, 0, INFINITY, 0};
///     return height > 0 && !hgrid_occluded_scene(scene, &to_light, NULL);
/// }
/// ```
///
/// Threads: any number of calls and queries on the same scene at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_scene_surface_at(
    scene: *const hgrid_scene,
    ray: *const hgrid_ray_f64,
    hit: *const hgrid_scene_hit,
    surface: *mut hgrid_scene_surface,
) -> bool {
    let Some(to) = NonNull::new(surface) else { return false };
    // SAFETY: the caller's promise.
    let Ok(Some(found)) = (unsafe { raw::scene_surface(scene, ray, hit) }) else { return false };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to, found.into()) };
    true
}

/// Takes a normal from the space of the object that a hit names to the scene's, of length 1.
///
/// `object_normal` is three floats of any length, or NULL: then it is the normal of the triangle that was hit,
/// cross(b - a, c - a). Returns true and writes three floats to `normal`; or returns false and writes nothing, if
/// - the hit names nothing in the scene,
/// - `object_normal` is three zeros, or one of its numbers is not finite,
/// - `object_normal` is NULL, and the hit names no triangle, or one without area,
/// - the view is one of zeros, or another pointer is NULL.
///
/// Threads: any number of calls and queries on the same scene at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_scene_normal(
    scene: *const hgrid_scene,
    hit: *const hgrid_scene_hit,
    object_normal: *const f32,
    normal: *mut f32,
) -> bool {
    let Some(to) = NonNull::new(normal.cast::<[f32; 3]>()) else { return false };
    // SAFETY: the caller's promise.
    let Ok(Some(found)) = (unsafe { raw::scene_normal(scene, hit, object_normal) }) else {
        return false;
    };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to, found) };
    true
}
