//! The boxes of grids, of shapes and of scenes.

use core::ptr::NonNull;

use hgrid_core::{Grid, Scene};

use crate::raw;
use crate::scene::hgrid_scene;
use crate::shapes::hgrid_shapes;
use crate::types::hgrid_grid;

/// Tells the box of a grid: `corners` becomes six floats, the least x, y and z, then the greatest.
///
/// It is the box of the mesh, larger by about 1e-5 of its extent, or one around the origin and smaller than 1e-33 if no
/// triangle is finite. Returns true; or returns false and writes nothing, if `grid` or `corners` is NULL or the view is
/// one of zeros.
///
/// Threads: any number of calls and queries on the same grid at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_box_of(grid: *const hgrid_grid, corners: *mut f32) -> bool {
    // SAFETY: the caller's promise.
    let bounds = unsafe { raw::grid(grid) }.map(Grid::bounds);
    // SAFETY: the caller's promise: six floats.
    unsafe { write(bounds.ok(), corners) }
}

/// Tells the box of all shapes: `hgrid_box_of` for a tree of shapes.
///
/// Returns true; or returns false and writes nothing, if `shapes` or `corners` is NULL or the view is one of zeros.
///
/// Threads: any number of calls and queries on the same tree at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_box_of_shapes(
    shapes: *const hgrid_shapes,
    corners: *mut f32,
) -> bool {
    // SAFETY: the caller's promise.
    let bounds = unsafe { raw::shapes(shapes) }.map(|shapes| shapes.shapes.bounds());
    // SAFETY: the caller's promise: six floats.
    unsafe { write(bounds.ok(), corners) }
}

/// Tells the box of all instances: `hgrid_box_of` for a scene.
///
/// Returns true; or returns false and writes nothing, if `scene` or `corners` is NULL or the view is one of zeros.
///
/// Threads: any number of calls and queries on the same scene at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_box_of_scene(scene: *const hgrid_scene, corners: *mut f32) -> bool {
    // SAFETY: the caller's promise.
    let bounds = unsafe { raw::scene(scene) }.map(Scene::bounds);
    // SAFETY: the caller's promise: six floats.
    unsafe { write(bounds.ok(), corners) }
}

/// Writes the least and the greatest corner of a box, if there is one. Returns true if it did.
///
/// # Safety
/// The caller's promise: `corners` is NULL, or there is room for six floats.
unsafe fn write(bounds: Option<([f32; 3], [f32; 3])>, corners: *mut f32) -> bool {
    let to = NonNull::new(corners.cast::<[[f32; 3]; 2]>());
    let (Some((least, greatest)), Some(to)) = (bounds, to) else { return false };
    // SAFETY: this function's contract.
    unsafe { raw::write(to, [least, greatest]) };
    true
}
