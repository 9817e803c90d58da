//! The instances that lead to a hit in a scene.

use core::ptr::NonNull;

use crate::raw;
use crate::scene::{hgrid_instance, hgrid_scene, hgrid_scene_hit};
use crate::types::hgrid_grid;

/// Tells what a hit names: the innermost instance on its path, with the object's number and your id, and the grid
/// that it shows.
///
/// `grid` becomes a copy of your own view, or of the one in the `views` of a packed scene.
/// The matrix of the instance is yours but for rounding. For shapes, `grid` becomes a view of zeros. `instance` and
/// `grid` may be NULL. Returns true and has written those that are not NULL; or returns false and has written nothing:
/// `scene` or `hit` is NULL, the view is one of zeros, or the hit names nothing in the scene.
///
/// Threads: any number of calls and queries on the same scene at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_scene_locate(
    scene: *const hgrid_scene,
    hit: *const hgrid_scene_hit,
    instance: *mut hgrid_instance,
    grid: *mut hgrid_grid,
) -> bool {
    let to = (NonNull::new(instance), NonNull::new(grid));
    // SAFETY: the caller's promise.
    matches!(unsafe { raw::scene_locate(scene, hit, to) }, Ok(Some(())))
}

/// Tells which instance is at a level of the path of a hit. `hgrid_scene_locate` tells the innermost one, and its grid.
///
/// At level 0 is an instance of `scene` itself. If it shows a scene, an instance of that is at level 1, and so on. The
/// number of the instance is `path[level]` of the hit. Returns true and writes `instance`; or returns false and writes
/// nothing: a pointer is NULL, the view is one of zeros, the hit names nothing in the scene, or its path has no such
/// level.
///
/// Threads: any number of calls and queries on the same scene at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_scene_instance(
    scene: *const hgrid_scene,
    hit: *const hgrid_scene_hit,
    level: u32,
    instance: *mut hgrid_instance,
) -> bool {
    let Some(to) = NonNull::new(instance) else { return false };
    // SAFETY: the caller's promise.
    let Ok(Some(found)) = (unsafe { raw::scene_instance(scene, hit, level) }) else {
        return false;
    };
    // SAFETY: the caller's promise; the two are laid out the same.
    unsafe { raw::write(to.cast(), found) };
    true
}
