//! Scenes, by their addresses.
//!
//! "The caller's promise" is the contract at the head of `raw` (mod.rs).

use core::ffi::c_void;
use core::mem::{MaybeUninit, offset_of};
use core::ptr::NonNull;
use core::slice;

use hgrid_core::{
    ALIGNMENT, BlobInfo, Content, Counters, Cull, Instance, MAX_NESTING, Member, Object, Scene,
    SceneHit, SceneOptions, SceneSurface, Verdict,
};

use super::batch::{BatchArrays, RunningBatch};
use super::query::add;
use super::shapes::shapes_read;
use super::{
    addresses_around, addresses_of, addresses_of_view, apart, bytes, bytes_mut, config, read,
    read_sized, shares, write, write_grid,
};
use crate::addresses::{Addresses, RawRegion};
use crate::blob_types::hgrid_refit_report;
use crate::input::controlled;
use crate::misuse::{CallersRay as _, checked};
use crate::query_types::{self, hgrid_counters, verdict};
use crate::scene::{
    hgrid_instance, hgrid_object, hgrid_ray_f64, hgrid_scene, hgrid_scene_hit, hgrid_scene_options,
};
use crate::status::{
    HGRID_ERROR_INDEX_TOO_SMALL, HGRID_ERROR_MISALIGNED, HGRID_ERROR_NOT_A_GRID,
    HGRID_ERROR_NULL_ARGUMENT, HGRID_ERROR_OTHER_CONTENT, HGRID_ERROR_OVERLAP,
    HGRID_ERROR_TOO_MANY_TRIANGLES, hgrid_status, status_of,
};
use crate::types::{Elements, hgrid_config, hgrid_grid, hgrid_report};

/// The contents of a [`hgrid_scene`].
#[repr(C)]
struct SceneView {
    tag: u64,
    scene: Scene<'static>,
}

const SCENE_TAG: u64 = u64::from_le_bytes(*b"hgridsc1");

const _: () = assert!(size_of::<SceneView>() <= size_of::<hgrid_scene>());
const _: () = assert!(align_of::<SceneView>() <= align_of::<hgrid_scene>());

/// Writes an object.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn write_object(to: NonNull<hgrid_object>, object: Object<'static>) {
    // SAFETY: as large as an object and aligned, as assertions beside `hgrid_object` say.
    unsafe { write(to.cast(), object) }
}

/// The array of a scene's objects.
///
/// # Safety
/// The caller's promise; each object was written by [`write_object`], copied from such, or is all zeros.
unsafe fn objects(
    (start, count): (*const hgrid_object, usize),
) -> Result<&'static [Object<'static>], hgrid_status> {
    if start.is_null() {
        return if count == 0 { Ok(&[]) } else { Err(HGRID_ERROR_NULL_ARGUMENT) };
    }
    let fits = Elements::new(start.cast(), 0, count, size_of::<hgrid_object>());
    fits.ok_or(HGRID_ERROR_TOO_MANY_TRIANGLES)?;
    // SAFETY: not NULL, so aligned and readable by the caller's promise, and objects by this function's contract: zeros
    // are `Object::Nothing`, whose tag is 0. An object is as large as `hgrid_object`.
    Ok(unsafe { slice::from_raw_parts(start.cast(), count) })
}

/// The instances of a scene.
///
/// # Safety
/// The caller's promise.
unsafe fn instances(
    (start, count): (*const hgrid_instance, usize),
) -> Result<(&'static [Instance], Addresses), hgrid_status> {
    let all = Elements::new(start.cast(), 0, count, size_of::<hgrid_instance>());
    let all = all.ok_or(HGRID_ERROR_TOO_MANY_TRIANGLES)?;
    let addresses = Addresses::new(all.start, all.bytes);
    if start.is_null() {
        return if count == 0 { Ok((&[], addresses)) } else { Err(HGRID_ERROR_NULL_ARGUMENT) };
    }
    // SAFETY: not NULL, so aligned and readable by the caller's promise; any bytes are an instance, which is laid out
    // as `hgrid_instance`.
    Ok((unsafe { slice::from_raw_parts(start.cast(), count) }, addresses))
}

/// Writes a view of a scene.
///
/// # Safety
/// The caller's promise.
unsafe fn write_scene(to: NonNull<hgrid_scene>, scene: &Scene<'static>) {
    // SAFETY: large enough and aligned as the assertions above say.
    unsafe { write(to.cast(), SceneView { tag: SCENE_TAG, scene: *scene }) }
}

/// The scene of a view.
///
/// # Safety
/// The caller's promise; and a view with the right tag was written by [`write_scene`] or copied from one that was, and
/// all that it refers to is where it was.
pub(crate) unsafe fn scene<'a>(
    view: *const hgrid_scene,
) -> Result<&'a Scene<'static>, hgrid_status> {
    // SAFETY: the caller's promise; the tag comes first.
    if unsafe { read(view.cast::<u64>()) }? != SCENE_TAG {
        return Err(HGRID_ERROR_NOT_A_GRID);
    }
    // SAFETY: not NULL, aligned as the assertions above say, and a view by its tag.
    Ok(unsafe { &(*view.cast::<SceneView>()).scene })
}

/// Builds a scene.
///
/// # Safety
/// The caller's promise, and that of [`objects`].
pub(crate) unsafe fn build_scene(
    given: (*const hgrid_instance, usize),
    shown: (*const hgrid_object, usize),
    settings: *const hgrid_config,
    memory: [RawRegion; 2],
    to: NonNull<hgrid_scene>,
    report: &mut hgrid_report,
) -> Result<(), hgrid_status> {
    // SAFETY: the caller's promise.
    let (instances, addresses) = unsafe { instances(given) }?;
    // SAFETY: this function's contract.
    let objects = unsafe { objects(shown) }?;
    check_view(to, objects)?;
    // SAFETY: the caller's promise.
    let (config, caller) = unsafe { config(settings) }?;
    // SAFETY: the caller's promise.
    let [index, scratch] = unsafe { apart_from(addresses, objects, memory) }?;
    let built = controlled(caller, |control| {
        Scene::build_with(instances, objects, &config, index, scratch, control)
    });
    let count = u32::try_from(instances.len()).ok();
    let bound = count.and_then(|count| Scene::bound(count, &config));
    let built = built.map_err(|error| report.note_unbuilt(error, bound))?;
    report.note_built(built.blob(), bound);
    report.reference_count = built.instance_count();
    // SAFETY: the caller's promise.
    unsafe { write_scene(to, &built) };
    Ok(())
}

/// Opens a scene.
///
/// # Safety
/// The caller's promise, and that of [`objects`].
pub(crate) unsafe fn open_scene(
    (blob, blob_bytes): (*const c_void, usize),
    shown: (*const hgrid_object, usize),
    to: NonNull<hgrid_scene>,
) -> Result<(), hgrid_status> {
    // SAFETY: this function's contract.
    let objects = unsafe { objects(shown) }?;
    check_view(to, objects)?;
    // SAFETY: the caller's promise.
    let blob = unsafe { bytes(blob, blob_bytes) }?;
    let opened = Scene::open(blob, objects).map_err(status_of)?;
    // SAFETY: the caller's promise.
    unsafe { write_scene(to, &opened) };
    Ok(())
}

/// Gives a scene other instances.
///
/// # Safety
/// The caller's promise, and that of [`objects`].
pub(crate) unsafe fn refit_scene(
    given: (*const hgrid_instance, usize),
    shown: (*const hgrid_object, usize),
    blob: RawRegion,
    to: NonNull<hgrid_scene>,
    report: &mut hgrid_refit_report,
) -> Result<(), hgrid_status> {
    if blob.start.is_null() {
        return Err(HGRID_ERROR_NULL_ARGUMENT);
    }
    // SAFETY: the caller's promise.
    let (instances, addresses) = unsafe { instances(given) }?;
    // SAFETY: this function's contract.
    let objects = unsafe { objects(shown) }?;
    check_view(to, objects)?;
    // SAFETY: the caller's promise.
    let [blob, _] = unsafe { apart_from(addresses, objects, [blob, RawRegion::NONE]) }?;
    let refitted = Scene::refit(blob, instances, objects);
    report.note(&refitted);
    let opened = refitted.and_then(|_| Scene::open(blob, objects)).map_err(status_of)?;
    // SAFETY: the caller's promise.
    unsafe { write_scene(to, &opened) };
    Ok(())
}

/// Proves that a scene is right.
///
/// # Safety
/// The contract of [`scene`].
pub(crate) unsafe fn validate_scene(
    view: *const hgrid_scene,
    scratch: RawRegion,
) -> Result<(), hgrid_status> {
    // SAFETY: this function's contract.
    let scene = unsafe { scene(view) }?;
    if !scratch.addresses().is_empty() && reads(scene, scratch.addresses()) {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise; nothing else that this call reads lies there.
    let scratch = unsafe { bytes_mut(scratch.start, scratch.bytes) }?;
    scene.validate(scratch).map_err(status_of)
}

/// Returns true if a caller's view of a scene, or something that the scene reads, lies in a range of addresses.
fn reads(scene: &Scene<'_>, addresses: Addresses) -> bool {
    let view = addresses_around::<hgrid_scene, _>(scene, offset_of!(SceneView, scene));
    view.overlaps(addresses) || reads_within(scene, addresses, MAX_NESTING)
}

/// The same, with so many scenes inside one another at most. True if there are more: then a view was overwritten after
/// the scene was built, and may even show itself.
fn reads_within(scene: &Scene<'_>, addresses: Addresses, most: usize) -> bool {
    let Some(most) = most.checked_sub(1) else { return true };
    let within = |object: &Object<'_>| match object {
        Object::Scene(inner) => reads_within(inner, addresses, most),
        _ => touches(object, addresses),
    };
    holds(scene, addresses) || scene.objects().iter().any(within)
}

/// Refuses to write the view of a scene over the view of an object that the scene shows.
fn check_view(to: NonNull<hgrid_scene>, objects: &[Object<'_>]) -> Result<(), hgrid_status> {
    let to = Addresses::new(to.as_ptr().cast(), size_of::<hgrid_scene>());
    let is_over = |object| view_of(object).overlaps(to);
    if objects.iter().any(is_over) { Err(HGRID_ERROR_OVERLAP) } else { Ok(()) }
}

/// Returns the addresses of what an object keeps of the caller's view; none for an object of zeros.
fn view_of(object: &Object<'_>) -> Addresses {
    match object {
        Object::Grid(grid) => addresses_of_view(*grid),
        Object::Scene(scene) => addresses_of_view(*scene),
        Object::Shapes(_, test) => addresses_of_view(*test),
        Object::Nothing => addresses_of(&[]),
    }
}

/// Returns true if a view of a scene, its blob or its array of objects lies in a range of addresses.
fn holds(scene: &Scene<'_>, addresses: Addresses) -> bool {
    addresses_of_view(scene).overlaps(addresses)
        || addresses_of(scene.blob()).overlaps(addresses)
        || addresses_of_view(scene.objects()).overlaps(addresses)
}

/// Returns true if something of an object lies in a range of addresses, but for what a scene shows.
fn touches(object: &Object<'_>, addresses: Addresses) -> bool {
    let reads = match object {
        Object::Grid(grid) => {
            addresses_of(grid.blob()).overlaps(addresses) || shares(grid.mesh(), addresses)
        }
        Object::Scene(inner) => holds(inner, addresses),
        Object::Shapes(shapes, _) => shapes_read(shapes, addresses),
        Object::Nothing => false,
    };
    reads || view_of(object).overlaps(addresses)
}

/// Regions to write for a scene, once it is sure that its instances, the array of its objects and these themselves
/// lie elsewhere. What a scene among them shows is not looked at: that may be much more than the scene itself. Takes
/// a time that grows with the objects and the parts of their meshes.
///
/// # Safety
/// The caller's promise.
unsafe fn apart_from(
    instances: Addresses,
    objects: &[Object<'_>],
    regions: [RawRegion; 2],
) -> Result<[&'static mut [u8]; 2], hgrid_status> {
    let written = regions.map(RawRegion::addresses);
    let is_shared =
        |object: &Object<'_>| written.iter().any(|&addresses| touches(object, addresses));
    if objects.iter().any(is_shared) {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise.
    unsafe { apart([instances, addresses_of_view(objects)], regions) }
}

/// Writes a scene and all that it shows.
///
/// # Safety
/// The contract of [`scene`].
pub(crate) unsafe fn pack_scene(
    view: *const hgrid_scene,
    to: RawRegion,
    size: NonNull<u64>,
) -> Result<(), hgrid_status> {
    // SAFETY: this function's contract.
    let scene = unsafe { scene(view) }?;
    if !to.addresses().is_empty() && reads(scene, to.addresses()) {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise; nothing else that this call reads lies there.
    let to = unsafe { bytes_mut(to.start, to.bytes) }?;
    let packed = scene.pack(to).map(|_| ()).map_err(status_of);
    if matches!(packed, Ok(()) | Err(HGRID_ERROR_INDEX_TOO_SMALL)) {
        // SAFETY: the caller's promise.
        unsafe { write(size, scene.packed_bytes()) };
    }
    packed
}

/// Opens a scene with all that it shows, and proves it if there is scratch.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn open_packed_scene(
    blob: (*const c_void, usize),
    [views, scratch]: [RawRegion; 2],
    size: NonNull<u64>,
    to: NonNull<hgrid_scene>,
) -> Result<(), hgrid_status> {
    let is_proven = !scratch.start.is_null();
    let addresses = Addresses::new(blob.0, blob.1);
    // SAFETY: the caller's promise.
    let blob = unsafe { bytes(blob.0, blob.1) }?;
    let is_aligned =
        |bytes: &[u8]| bytes.is_empty() || bytes.as_ptr().addr().is_multiple_of(ALIGNMENT);
    if !is_aligned(blob) {
        return Err(HGRID_ERROR_MISALIGNED);
    }
    let info = BlobInfo::peek(blob).map_err(status_of)?;
    if info.content != Content::Packed {
        return Err(HGRID_ERROR_OTHER_CONTENT);
    }
    // SAFETY: the caller's promise.
    let [room, scratch] = unsafe { apart([addresses], [views, scratch]) }?;
    if !is_aligned(room) {
        return Err(HGRID_ERROR_MISALIGNED);
    }
    let member_bytes = u64::from(info.triangle_count) * size_of::<Member<'_>>() as u64;
    let object_bytes = info.vertex_count.saturating_mul(size_of::<Object<'_>>() as u64);
    let needed = member_bytes.saturating_add(object_bytes);
    if (room.len() as u64) < needed {
        // SAFETY: the caller's promise.
        unsafe { write(size, needed) };
        return Err(HGRID_ERROR_INDEX_TOO_SMALL);
    }
    // No more than there are bytes.
    let (members, objects) =
        (info.triangle_count as usize, usize::try_from(info.vertex_count).unwrap_or(0));
    let behind = views.start.wrapping_byte_add(members * size_of::<Member<'_>>());
    // SAFETY: so many fit, from an aligned start, and nothing else lies there.
    let members = unsafe { room_of(views.start, members, Member::EMPTY) };
    // SAFETY: the same; a member is a multiple of what objects are aligned to.
    let objects = unsafe { room_of(behind, objects, Object::Nothing) };
    let opened = if is_proven {
        Scene::open_packed_proven(blob, members, objects, scratch)
    } else {
        Scene::open_packed(blob, members, objects)
    };
    let opened = opened.map_err(status_of)?;
    // SAFETY: the caller's promise.
    unsafe { write(size, needed) };
    // SAFETY: the caller's promise.
    unsafe { write_scene(to, &opened) };
    Ok(())
}

/// An array in memory that may hold anything, each element made empty.
///
/// # Safety
/// There is room for so many, aligned, and nobody else uses it.
unsafe fn room_of<T: Copy>(start: *mut c_void, count: usize, empty: T) -> &'static mut [T] {
    if count == 0 {
        return &mut [];
    }
    // SAFETY: this function's contract.
    let places = unsafe { slice::from_raw_parts_mut(start.cast::<MaybeUninit<T>>(), count) };
    for place in places {
        place.write(empty);
    }
    // SAFETY: the same, and all of them were written.
    unsafe { slice::from_raw_parts_mut(start.cast::<T>(), count) }
}

const _: () = assert!(align_of::<Member<'_>>() <= ALIGNMENT);
const _: () = assert!(align_of::<Object<'_>>() <= align_of::<Member<'_>>());

/// The options that a caller gave a query of a scene.
struct SceneAsked {
    options: hgrid_scene_options,
    cull: Cull,
}

impl SceneAsked {
    /// Reads the options of a query of a scene; NULL means the defaults.
    ///
    /// # Safety
    /// The caller's promise.
    unsafe fn read(asked: *const hgrid_scene_options) -> Result<Self, hgrid_status> {
        let options = if asked.is_null() {
            hgrid_scene_options::DEFAULT
        } else {
            // SAFETY: the caller's promise.
            unsafe { read_sized(asked) }?
        };
        Ok(Self { options, cull: options.cull()? })
    }

    /// Asks a question with the options as core knows them, and adds the work to the caller's.
    ///
    /// # Safety
    /// The caller's promise.
    unsafe fn ask<T>(&self, ask: impl FnOnce(&mut SceneOptions<'_>) -> T) -> T {
        let hgrid_scene_options { mask, filter_mask, context, filter, counters, .. } = self.options;
        let mut offer = |ray: usize, hit: &SceneHit| {
            let hit = hgrid_scene_hit::from(*hit);
            let Some(filter) = filter else { return Verdict::Accept };
            // SAFETY: a function of this type by the caller's promise; the hit lives until it returns.
            verdict(unsafe { filter(context, ray, &raw const hit) })
        };
        let mut work = Counters::default();
        let mut options = SceneOptions { mask, cull: self.cull, ..SceneOptions::default() };
        if filter.is_some() {
            options.filter = Some(&mut offer);
            options.filter_mask = query_types::filter_mask(filter_mask);
        }
        if !counters.is_null() {
            options.counters = Some(&mut work);
        }
        let answer = ask(&mut options);
        if let Some(counters) = NonNull::<hgrid_counters>::new(counters) {
            // SAFETY: the caller's promise.
            unsafe { add(counters, &work) }
        }
        answer
    }
}

/// Asks a scene for the closest hit or any.
///
/// # Safety
/// The contract of [`scene`].
pub(crate) unsafe fn query_scene(
    view: *const hgrid_scene,
    ray: *const hgrid_ray_f64,
    asked: *const hgrid_scene_options,
    is_any: bool,
) -> Result<Option<SceneHit>, hgrid_status> {
    // SAFETY: this function's contract.
    let scene = unsafe { scene(view) }?;
    // SAFETY: the caller's promise.
    let ray = unsafe { read(ray) }?.checked().into();
    // SAFETY: the caller's promise.
    let asked = checked(unsafe { SceneAsked::read(asked) })?;
    let find = |options: &mut SceneOptions<'_>| {
        if is_any {
            scene.occluded_with(&ray, options).then_some(SceneHit::MISS)
        } else {
            scene.intersect_with(&ray, options)
        }
    };
    // SAFETY: the caller's promise.
    Ok(unsafe { asked.ask(find) })
}

/// Asks a scene for many rays: `trace` gets them as core asks for them, and the caller's options.
///
/// # Safety
/// The contract of [`scene`]; and the elements of both arrays are the caller's to be read and written.
pub(crate) unsafe fn scene_batch<T>(
    view: *const hgrid_scene,
    batch: &BatchArrays<hgrid_ray_f64, T>,
    asked: *const hgrid_scene_options,
    trace: impl FnOnce(&Scene<'static>, &mut RunningBatch<'_, hgrid_ray_f64, T>, &mut SceneOptions<'_>),
) -> Result<(), hgrid_status> {
    // SAFETY: this function's contract.
    let scene = unsafe { scene(view) }?;
    // SAFETY: the caller's promise.
    let asked = unsafe { SceneAsked::read(asked) }?;
    let hgrid_scene_options { scratch, scratch_bytes, .. } = asked.options;
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    let addresses = scratch.addresses();
    if batch.overlaps(addresses) || !addresses.is_empty() && reads(scene, addresses) {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise; nothing else that this call reads or writes lies there.
    let scratch = unsafe { bytes_mut(scratch.start, scratch.bytes) }?;
    // SAFETY: this function's contract, and any bytes are a ray.
    let mut arrays = unsafe { RunningBatch::new(batch) };
    let trace = |options: &mut SceneOptions<'_>| {
        options.scratch = scratch;
        trace(scene, &mut arrays, options);
    };
    // SAFETY: the caller's promise.
    unsafe { asked.ask(trace) };
    Ok(())
}

/// Returns the point of a scene where a ray met a triangle.
///
/// # Safety
/// The contract of [`scene`].
pub(crate) unsafe fn scene_surface(
    view: *const hgrid_scene,
    ray: *const hgrid_ray_f64,
    hit: *const hgrid_scene_hit,
) -> Result<Option<SceneSurface>, hgrid_status> {
    // SAFETY: this function's contract.
    let scene = unsafe { scene(view) }?;
    // SAFETY: the caller's promise.
    let ray = unsafe { read(ray) }?.checked();
    // SAFETY: the caller's promise.
    let hit = unsafe { read(hit) }?;
    Ok(scene.surface(&ray.into(), &hit.into()))
}

/// A normal in the space of a scene.
///
/// # Safety
/// The contract of [`scene`].
pub(crate) unsafe fn scene_normal(
    view: *const hgrid_scene,
    hit: *const hgrid_scene_hit,
    object_normal: *const f32,
) -> Result<Option<[f32; 3]>, hgrid_status> {
    // SAFETY: this function's contract.
    let scene = unsafe { scene(view) }?;
    // SAFETY: the caller's promise.
    let hit: SceneHit = unsafe { read(hit) }?.into();
    if object_normal.is_null() {
        return Ok(scene.triangle_normal(&hit));
    }
    // SAFETY: the caller's promise: three of them.
    let normal = unsafe { read(object_normal.cast::<[f32; 3]>()) }?;
    Ok(scene.normal_of(&hit, normal))
}

/// The instance at a level of the path of a hit.
///
/// # Safety
/// The contract of [`scene`].
pub(crate) unsafe fn scene_instance(
    view: *const hgrid_scene,
    hit: *const hgrid_scene_hit,
    level: u32,
) -> Result<Option<Instance>, hgrid_status> {
    // SAFETY: this function's contract.
    let scene = unsafe { scene(view) }?;
    // SAFETY: the caller's promise.
    let hit: SceneHit = unsafe { read(hit) }?.into();
    Ok(scene.instance_at(&hit, level as usize))
}

/// Writes the instance and the grid that a hit names.
///
/// # Safety
/// The contract of [`scene`].
pub(crate) unsafe fn scene_locate(
    view: *const hgrid_scene,
    hit: *const hgrid_scene_hit,
    (to_instance, to_grid): (Option<NonNull<hgrid_instance>>, Option<NonNull<hgrid_grid>>),
) -> Result<Option<()>, hgrid_status> {
    // SAFETY: this function's contract.
    let scene = unsafe { scene(view) }?;
    // SAFETY: the caller's promise.
    let hit: SceneHit = unsafe { read(hit) }?.into();
    let (Some(instance), Some(object)) = (scene.instance_of(&hit), scene.object_of(&hit)) else {
        return Ok(None);
    };
    if let Some(to) = to_instance {
        // SAFETY: the caller's promise; the two are laid out the same.
        unsafe { write(to.cast(), instance) };
    }
    if let Some(to) = to_grid {
        match object {
            // SAFETY: the caller's promise.
            Object::Grid(grid) => unsafe { write_grid(to, grid) },
            // SAFETY: the caller's promise.
            _ => unsafe { write(to, hgrid_grid::NONE) },
        }
    }
    Ok(Some(()))
}
