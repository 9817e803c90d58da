//! Trees of the caller's shapes, by their addresses.
//!
//! "The caller's promise" is the contract at the head of `raw` (mod.rs).

use core::ffi::c_void;
use core::ptr::NonNull;

use hgrid_core::{Boxes, Hit, ObjectTest, QueryOptions, Ray, ShapeHit, Shapes, Sizes};

use super::batch::{BatchArrays, RunningBatch};
use super::query::all_options;
use super::{
    addresses_of, addresses_of_view, apart, bytes, bytes_mut, config, read, read_sized, strided,
    write,
};
use crate::addresses::{Addresses, RawRegion};
use crate::blob_types::hgrid_refit_report;
use crate::input::controlled;
use crate::misuse::{CallersRay as _, checked};
use crate::query_types::{hgrid_query_options, hgrid_ray};
use crate::shapes::{hgrid_boxes, hgrid_shape_hit, hgrid_shapes};
use crate::status::{
    HGRID_ERROR_INVALID_MASKS, HGRID_ERROR_INVALID_POSITIONS, HGRID_ERROR_NOT_A_GRID,
    HGRID_ERROR_NULL_ARGUMENT, HGRID_ERROR_OVERLAP, HGRID_ERROR_STRUCT_SIZE, hgrid_status,
    status_of,
};
use crate::types::{Elements, hgrid_config, hgrid_report};

/// The test of [`hgrid_boxes`].
type CShapeTest =
    unsafe extern "C" fn(*mut c_void, u32, *const hgrid_ray, *mut hgrid_shape_hit) -> bool;

/// The contents of a [`hgrid_shapes`].
#[repr(C)]
pub(crate) struct Tested {
    tag: u64,
    pub(crate) shapes: Shapes<'static>,
    test: Option<CShapeTest>,
    context: *mut c_void,
}

// SAFETY: by the docs of `hgrid_object_shapes` any number of threads may call the test with its context.
unsafe impl Sync for Tested {}

const SHAPES_TAG: u64 = u64::from_le_bytes(*b"hgridsh1");

const _: () = assert!(size_of::<Tested>() <= size_of::<hgrid_shapes>());
const _: () = assert!(align_of::<Tested>() <= align_of::<hgrid_shapes>());

impl ObjectTest for Tested {
    #[inline]
    fn test(&self, shape: u32, ray: &Ray) -> Option<ShapeHit> {
        let test = self.test?;
        let ray = hgrid_ray::from(*ray);
        let mut hit = hgrid_shape_hit { t: f32::NAN, u: 0.0, v: 0.0 };
        // SAFETY: a function of this type by the caller's promise; ray and hit live until it returns.
        let is_hit = unsafe { test(self.context, shape, &raw const ray, &raw mut hit) };
        is_hit.then(|| hit.into())
    }
}

/// The arrays of some boxes.
fn elements(boxes: &hgrid_boxes) -> Result<[Elements; 2], hgrid_status> {
    let hgrid_boxes { reserved, boxes, box_stride, count, masks, mask_stride, .. } = *boxes;
    if reserved != 0 {
        return Err(HGRID_ERROR_STRUCT_SIZE);
    }
    let boxes = Elements::new(boxes, box_stride, count, size_of::<[f32; 6]>());
    let mask_count = if masks.is_null() { 0 } else { count };
    let masks = Elements::new(masks, mask_stride, mask_count, size_of::<u32>());
    let masks = masks.filter(|masks| mask_count == 0 || masks.stride >= size_of::<u32>());
    Ok([boxes.ok_or(HGRID_ERROR_INVALID_POSITIONS)?, masks.ok_or(HGRID_ERROR_INVALID_MASKS)?])
}

/// The caller's boxes.
///
/// # Safety
/// The caller's promise.
unsafe fn boxes(description: &hgrid_boxes) -> Result<Boxes<'static>, hgrid_status> {
    let [boxes, masks] = elements(description)?;
    // SAFETY: the caller's promise.
    let boxes = unsafe { strided(boxes) }?;
    // SAFETY: the caller's promise.
    let masks = unsafe { strided(masks) }?;
    let boxes = Boxes::strided(boxes).map_err(status_of)?;
    if masks.count == 0 { Ok(boxes) } else { boxes.with_masks(masks).map_err(status_of) }
}

/// Writes a view of shapes.
///
/// # Safety
/// The caller's promise.
unsafe fn write_shapes(
    to: NonNull<hgrid_shapes>,
    shapes: &Shapes<'static>,
    description: &hgrid_boxes,
) {
    let hgrid_boxes { test, context, .. } = *description;
    // SAFETY: large enough and aligned as the assertions above say.
    unsafe { write(to.cast(), Tested { tag: SHAPES_TAG, shapes: *shapes, test, context }) }
}

/// The shapes of a view.
///
/// # Safety
/// The caller's promise; and a view with the right tag was written by [`write_shapes`] or copied from one that was,
/// and all that it refers to is where it was.
pub(crate) unsafe fn shapes<'a>(view: *const hgrid_shapes) -> Result<&'a Tested, hgrid_status> {
    // SAFETY: the caller's promise; the tag comes first.
    if unsafe { read(view.cast::<u64>()) }? != SHAPES_TAG {
        return Err(HGRID_ERROR_NOT_A_GRID);
    }
    // SAFETY: not NULL, aligned as the assertions above say, and a view by its tag.
    Ok(unsafe { &*view.cast() })
}

/// Builds a tree of shapes.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn build_shapes(
    description: *const hgrid_boxes,
    settings: *const hgrid_config,
    memory: [RawRegion; 2],
    to: NonNull<hgrid_shapes>,
    report: &mut hgrid_report,
) -> Result<(), hgrid_status> {
    // SAFETY: the caller's promise.
    let description = unsafe { read_sized(description) }?;
    // SAFETY: the caller's promise.
    let boxes = unsafe { boxes(&description) }?;
    // SAFETY: the caller's promise.
    let (config, caller) = unsafe { config(settings) }?;
    let inputs = elements(&description)?.map(|array| Addresses::new(array.start, array.bytes));
    // SAFETY: the caller's promise.
    let [index, scratch] = unsafe { apart(inputs, memory) }?;
    let built =
        controlled(caller, |control| Shapes::build_with(boxes, &config, index, scratch, control));
    let bound = Sizes::bound(boxes.count(), &config);
    let built = built.map_err(|error| report.note_unbuilt(error, bound))?;
    report.note_built(built.blob(), bound);
    report.skipped_count = built.skipped_count();
    report.reference_count = built.count() - built.skipped_count();
    // SAFETY: the caller's promise.
    unsafe { write_shapes(to, &built, &description) };
    Ok(())
}

/// Opens a tree of shapes.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn open_shapes(
    blob: *const c_void,
    blob_bytes: usize,
    description: *const hgrid_boxes,
    to: NonNull<hgrid_shapes>,
) -> Result<(), hgrid_status> {
    // SAFETY: the caller's promise.
    let description = unsafe { read_sized(description) }?;
    // SAFETY: the caller's promise.
    let boxes = unsafe { boxes(&description) }?;
    // SAFETY: the caller's promise.
    let blob = unsafe { bytes(blob, blob_bytes) }?;
    let opened = Shapes::open(blob, boxes).map_err(status_of)?;
    // SAFETY: the caller's promise.
    unsafe { write_shapes(to, &opened, &description) };
    Ok(())
}

/// Gives a tree of shapes other boxes.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn refit_shapes(
    description: *const hgrid_boxes,
    blob: RawRegion,
    to: NonNull<hgrid_shapes>,
    report: &mut hgrid_refit_report,
) -> Result<(), hgrid_status> {
    if blob.start.is_null() {
        return Err(HGRID_ERROR_NULL_ARGUMENT);
    }
    // SAFETY: the caller's promise.
    let description = unsafe { read_sized(description) }?;
    // SAFETY: the caller's promise.
    let boxes = unsafe { boxes(&description) }?;
    let inputs = elements(&description)?.map(|array| Addresses::new(array.start, array.bytes));
    // SAFETY: the caller's promise.
    let [blob, _] = unsafe { apart(inputs, [blob, RawRegion::NONE]) }?;
    let refitted = Shapes::refit(blob, &boxes);
    report.note(&refitted);
    let opened = refitted.and_then(|_| Shapes::open(blob, boxes)).map_err(status_of)?;
    // SAFETY: the caller's promise.
    unsafe { write_shapes(to, &opened, &description) };
    Ok(())
}

/// Proves that a tree of shapes is right.
///
/// # Safety
/// The contract of [`shapes`].
pub(crate) unsafe fn validate_shapes(
    view: *const hgrid_shapes,
    scratch: RawRegion,
) -> Result<(), hgrid_status> {
    // SAFETY: this function's contract.
    let tested = unsafe { shapes(view) }?;
    let addresses = scratch.addresses();
    if addresses_of_view(tested).overlaps(addresses) || shapes_read(&tested.shapes, addresses) {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise; nothing else that this call reads lies there.
    let scratch = unsafe { bytes_mut(scratch.start, scratch.bytes) }?;
    tested.shapes.validate(scratch).map_err(status_of)
}

/// Asks a tree of shapes for the closest hit or any.
///
/// # Safety
/// The contract of [`shapes`].
pub(crate) unsafe fn query_shapes(
    view: *const hgrid_shapes,
    ray: *const hgrid_ray,
    asked: *const hgrid_query_options,
    is_any: bool,
) -> Result<Option<Hit>, hgrid_status> {
    // SAFETY: this function's contract.
    let tested = unsafe { shapes(view) }?;
    // SAFETY: the caller's promise.
    let ray: Ray = unsafe { read(ray) }?.checked().into();
    let mut test = |id: u32, ray: &Ray| tested.test(id, ray);
    let mut find = |options: &mut QueryOptions<'_>| {
        if is_any {
            let is_hit = tested.shapes.occluded_with(&ray, options, &mut test);
            is_hit.then_some(Hit::MISS)
        } else {
            tested.shapes.intersect_with(&ray, options, &mut test)
        }
    };
    // SAFETY: the caller's promise.
    match checked(unsafe { all_options(asked) })? {
        None => Ok(find(&mut QueryOptions::default())),
        // SAFETY: the caller's promise.
        Some(asked) => Ok(unsafe { asked.ask(find) }),
    }
}

/// Returns true if blob or boxes of a tree of shapes lie in a range of addresses.
pub(super) fn shapes_read(shapes: &Shapes<'_>, addresses: Addresses) -> bool {
    let boxes = shapes.boxes();
    let arrays = [shapes.blob(), boxes.corners().bytes, boxes.masks().bytes];
    arrays.iter().any(|array| addresses_of(array).overlaps(addresses))
}

/// Asks a tree of shapes for many rays: `trace` gets them as core asks for them, the caller's options, and the test.
///
/// # Safety
/// The contract of [`shapes`]; and the elements of both arrays are the caller's to be read and written.
pub(crate) unsafe fn shapes_batch<T>(
    view: *const hgrid_shapes,
    batch: &BatchArrays<hgrid_ray, T>,
    asked: *const hgrid_query_options,
    trace: impl FnOnce(
        &Shapes<'static>,
        &mut RunningBatch<'_, hgrid_ray, T>,
        &mut QueryOptions<'_>,
        &mut hgrid_core::ShapeTest<'_>,
    ),
) -> Result<(), hgrid_status> {
    // SAFETY: this function's contract.
    let tested = unsafe { shapes(view) }?;
    // SAFETY: the caller's promise.
    let asked = unsafe { all_options(asked) }?;
    // SAFETY: this function's contract, and any bytes are a ray.
    let mut arrays = unsafe { RunningBatch::new(batch) };
    let mut test = |id: u32, ray: &Ray| tested.test(id, ray);
    let Some(asked) = asked else {
        trace(&tested.shapes, &mut arrays, &mut QueryOptions::default(), &mut test);
        return Ok(());
    };
    let hgrid_query_options { scratch, scratch_bytes, .. } = asked.options;
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    let addresses = scratch.addresses();
    if batch.overlaps(addresses)
        || !addresses.is_empty()
            && (addresses_of_view(tested).overlaps(addresses)
                || shapes_read(&tested.shapes, addresses))
    {
        return Err(HGRID_ERROR_OVERLAP);
    }
    // SAFETY: the caller's promise; nothing else that this call reads or writes lies there.
    let scratch = unsafe { bytes_mut(scratch.start, scratch.bytes) }?;
    let trace = |options: &mut QueryOptions<'_>| {
        options.scratch = scratch;
        trace(&tested.shapes, &mut arrays, options, &mut test);
    };
    // SAFETY: the caller's promise.
    unsafe { asked.ask(trace) };
    Ok(())
}
