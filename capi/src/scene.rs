//! Scenes of instances.

use core::ffi::c_void;
use core::mem::MaybeUninit;
use core::ptr::{NonNull, null_mut};

use hgrid_core::{Cull, Instance, MAX_NESTING, Object, RayF64, SceneHit};

use crate::addresses::RawRegion;
use crate::blob_types::hgrid_refit_report;
use crate::query_types::{cull, hgrid_counters, hgrid_verdict};
use crate::raw;
use crate::shapes::hgrid_shapes;
use crate::status::{HGRID_ERROR_NULL_ARGUMENT, HGRID_OK, hgrid_status};
use crate::types::{hgrid_config, hgrid_grid, hgrid_report};

/// Scenes inside one another, at most, the outermost included.
pub const HGRID_MAX_NESTING: usize = 4;

const _: () = assert!(HGRID_MAX_NESTING == MAX_NESTING);

/// An object at a place in a scene: 72 bytes. Initialise it with `HGRID_INSTANCE_INIT`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_instance {
    /// Rows of the matrix that takes the object's directions to the scene's: `scene = linear * object + translation`.
    /// Rotations, mirrors, shears and scales of any kind, as long as the matrix times its inverse in `float` is the
    /// identity to 2^-10. That allows axis-aligned scales of any ratio; with rotation or shear a condition number up to
    /// about 10^4.
    pub linear: [[f32; 3]; 3],
    /// The object's number in the scene, from 0.
    pub object: u32,
    /// The place of the object's origin in the scene. Places are computed in double: far from the scene's origin rays
    /// are traced as exactly as near it.
    pub translation: [f64; 3],
    /// A query sees the instance if its mask and this have a bit in common. A query whose mask has all bits, the
    /// default, sees every instance, even one whose mask is 0.
    pub mask: u32,
    /// Yours: not read.
    pub id: u32,
}

/// A grid, a tree of shapes or a scene that instances show, by the address of its view. `hgrid_object_grid`,
/// `hgrid_object_shapes` and `hgrid_object_scene` make it. `HGRID_OBJECT_INIT`, which is all zeros, shows nothing: rays
/// miss its instances.
///
/// The view stays where it is, with all that it refers to, for as long as scenes that show it are queried.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_object {
    /// Private.
    pub opaque: [MaybeUninit<usize>; 4],
}

// The tag of `Object::Nothing` is 0, so that it is `HGRID_OBJECT_INIT`: see `Object` in core.
const _: () = assert!(size_of::<Object<'_>>() == size_of::<hgrid_object>());
const _: () = assert!(align_of::<Object<'_>>() <= align_of::<hgrid_object>());

/// A built scene and its objects, ready for queries: a view, held by value as a `hgrid_grid`. It holds the addresses
/// of its blob and of the array of its objects, or of the `views` of a packed scene.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_scene {
    /// Private; some of its bytes may never have been written.
    pub opaque: [MaybeUninit<u64>; 72],
}

impl hgrid_scene {
    /// The view of no scene.
    pub const NONE: Self = Self { opaque: [MaybeUninit::zeroed(); 72] };
}

/// A ray whose origin is in double: 48 bytes, for scenes in which float is too coarse for an origin. It has the fields
/// of `hgrid_ray` in another order: `t_min` stands behind `direction`. An origin beyond the range of float misses.
/// A call for a single ray stops a debug build of the library if all numbers of the ray are 0.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_ray_f64 {
    /// The point at which `t` is 0, in scene units.
    pub origin: [f64; 3],
    /// The direction, any length but zero.
    pub direction: [f32; 3],
    /// The smallest `t` that is accepted.
    pub t_min: f32,
    /// The largest `t` that is accepted.
    pub t_max: f32,
    /// Not read.
    pub reserved: u32,
}

/// The hit of a ray in a scene: 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_scene_hit {
    /// Distance in multiples of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second vertex, 0 to 1; of a shape what its test says.
    pub u: f32,
    /// Weight of the triangle's third vertex, 0 to 1; of a shape what its test says.
    pub v: f32,
    /// The triangle or shape in its object.
    pub primitive: u32,
    /// Numbers of the instances that lead to the hit, from the outermost scene inwards; the rest is `HGRID_INVALID_ID`.
    pub path: [u32; HGRID_MAX_NESTING],
}

/// The options of a query of a scene. Initialise them with `HGRID_SCENE_OPTIONS_INIT`; NULL means these defaults.
///
/// With a `filter` or `counters` the rays of a batch are traced one by one, in their order. With options that break the
/// rules for structs, a query of one ray returns a miss; a debug build of the library stops.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct hgrid_scene_options {
    /// `sizeof(hgrid_scene_options)`.
    pub struct_size: u32,
    /// An instance is seen if its mask and this have a bit in common. In it, each triangle and shape is seen if its own
    /// mask has one. With all bits, the default, everything is seen, even with a mask of 0. 0 sees nothing, and no
    /// error tells: begin with `HGRID_SCENE_OPTIONS_INIT`, not with zeros.
    pub mask: u32,
    /// The sides of triangles that are not hit: one of `HGRID_CULL_...`. The front is that of the triangle in its own
    /// mesh: an instance that mirrors does not turn it round.
    pub cull: u32,
    /// `filter` is called for the triangles whose mask in their mesh has a bit in common with this one. The others are
    /// opaque: their hits count without a call. With 0, the default, and with all bits it is called for every triangle,
    /// even one whose mask is 0.
    pub filter_mask: u32,
    /// Yours: passed on to `filter`.
    pub context: *mut c_void,
    /// Returns whether a `hit` counts. NULL means that all hits count. `ray` is the number of the ray in its batch, 0
    /// for a single ray.
    ///
    /// Within an instance the filter is asked from near to far, and about each triangle at most once. Instances come
    /// roughly front to back, so a hit that it accepts may be replaced by a closer one of another instance. Hits behind
    /// one that it accepted are not shown to it, and shapes never are. In a batch it gets all hits of one ray before
    /// those of the next. `HGRID_ACCEPT_AND_STOP` is the same as `HGRID_ACCEPT`. The filter runs on the calling thread,
    /// may query the same scene, and must not be left by `longjmp` or by a C++ exception.
    pub filter: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            ray: usize,
            hit: *const hgrid_scene_hit,
        ) -> hgrid_verdict,
    >,
    /// The counters that the work is added to, or NULL. An instance that a ray is tested against counts in
    /// `primitive_tests`.
    pub counters: *mut hgrid_counters,
    /// Memory in which a batch with `HGRID_COHERENCE_INCOHERENT` may sort its rays, or NULL: as `scratch` of
    /// `hgrid_query_options`. It may overlap neither rays nor answers, nor anything that the scene refers to: each
    /// batch compares it with every object, those of a scene inside once for each way that leads there. So lend it to
    /// batches of more rays than there are objects, and not to others. Queries of one ray do not look at it.
    pub scratch: *mut c_void,
    /// Bytes of `scratch`. With 16 bytes for each ray a whole batch is sorted at once.
    pub scratch_bytes: usize,
}

impl hgrid_scene_options {
    /// The defaults, which NULL means.
    #[expect(clippy::cast_possible_truncation, reason = "a few words")]
    pub(crate) const DEFAULT: Self = Self {
        struct_size: size_of::<Self>() as u32,
        mask: u32::MAX,
        cull: 0,
        filter_mask: 0,
        context: null_mut(),
        filter: None,
        counters: null_mut(),
        scratch: null_mut(),
        scratch_bytes: 0,
    };

    /// The sides as core knows them.
    pub(crate) fn cull(&self) -> Result<Cull, hgrid_status> {
        cull(self.cull)
    }
}

const _: () = assert!(size_of::<hgrid_instance>() == size_of::<Instance>());
const _: () = assert!(size_of::<hgrid_ray_f64>() == size_of::<RayF64>());
const _: () = assert!(size_of::<hgrid_scene_hit>() == size_of::<SceneHit>());

impl From<SceneHit> for hgrid_scene_hit {
    fn from(SceneHit { t, u, v, primitive, path }: SceneHit) -> Self {
        Self { t, u, v, primitive, path }
    }
}

impl From<hgrid_scene_hit> for SceneHit {
    fn from(hgrid_scene_hit { t, u, v, primitive, path }: hgrid_scene_hit) -> Self {
        Self { t, u, v, primitive, path }
    }
}

impl From<hgrid_ray_f64> for RayF64 {
    fn from(ray: hgrid_ray_f64) -> Self {
        let hgrid_ray_f64 { origin, direction, t_min, t_max, .. } = ray;
        Self { t_min, t_max, ..Self::new(origin, direction) }
    }
}

/// Makes an object of a grid. The object keeps the address of this view, so the view stays where it is for as long as
/// scenes that show the object are queried.
///
/// Neither argument may be NULL. Returns `HGRID_OK`, `HGRID_ERROR_NULL_ARGUMENT`, or `HGRID_ERROR_NOT_A_GRID` for a
/// view of zeros.
///
/// Threads: any number of calls at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_object_grid(
    grid: *const hgrid_grid,
    object: *mut hgrid_object,
) -> hgrid_status {
    // SAFETY: the caller's promise.
    let made = unsafe { raw::grid(grid) }.and_then(|grid| {
        let to = NonNull::new(object).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        unsafe { raw::write_object(to, Object::Grid(grid)) };
        Ok(())
    });
    made.err().unwrap_or(HGRID_OK)
}

/// Makes an object of a tree of shapes, which brings its test. The object keeps the address of the view, as that of
/// `hgrid_object_grid` does.
///
/// The test gets the ray in the object's space, with a direction and a range of its own. The `t` of its answer is
/// along this ray. Any number of threads may call it at once. No argument may be NULL. Returns `HGRID_OK`, or what
/// `hgrid_object_grid` returns.
///
/// Threads: any number of calls at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_object_shapes(
    shapes: *const hgrid_shapes,
    object: *mut hgrid_object,
) -> hgrid_status {
    // SAFETY: the caller's promise.
    let made = unsafe { raw::shapes(shapes) }.and_then(|tested| {
        let to = NonNull::new(object).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        unsafe { raw::write_object(to, Object::Shapes(&tested.shapes, tested)) };
        Ok(())
    });
    made.err().unwrap_or(HGRID_OK)
}

/// Makes an object of a scene, to be shown in another one. The object keeps the address of the view, as that of
/// `hgrid_object_grid` does. No argument may be NULL. Returns `HGRID_OK`, or what
/// `hgrid_object_grid` returns.
///
/// Threads: any number of calls at once.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_object_scene(
    scene: *const hgrid_scene,
    object: *mut hgrid_object,
) -> hgrid_status {
    // SAFETY: the caller's promise.
    let made = unsafe { raw::scene(scene) }.and_then(|scene| {
        let to = NonNull::new(object).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        // SAFETY: the caller's promise.
        unsafe { raw::write_object(to, Object::Scene(scene)) };
        Ok(())
    });
    made.err().unwrap_or(HGRID_OK)
}

/// Tells how much memory is enough for any scene of so many instances: `hgrid_bound` for scenes. `HGRID_SCENE_BOUND`
/// and `HGRID_SCRATCH_BOUND` are the same as constants, rounded up a little.
///
/// `config` may be NULL: the defaults. `report` may not be NULL. Returns what `hgrid_bound` returns, and
/// `HGRID_ERROR_INVALID_METHOD` for another method than bvh.
///
/// Threads: any number of calls at once, each with a report of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_scene_bound(
    instance_count: usize,
    config: *const hgrid_config,
    report: *mut hgrid_report,
) -> hgrid_status {
    if report.is_null() {
        return HGRID_ERROR_NULL_ARGUMENT;
    }
    let call = |report: &mut hgrid_report| {
        // SAFETY: the caller's promise.
        unsafe { raw::settings(config) }?.scene_bound(instance_count, report)
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting(report, call) }
}

/// Builds a scene: a tree over instances of objects, in O(n).
///
/// The instances are copied. The array of objects is not: it stays where it is, with the views that it names, for as
/// long as the scene is queried. Every object in it, shown or not, begins as `HGRID_OBJECT_INIT` or comes from
/// `hgrid_object_grid` or its like; other bytes are undefined behaviour. Any number of instances may show one. Scenes
/// may be shown in scenes, `HGRID_MAX_NESTING` deep. The index is a blob, as after every build: it names objects by
/// number, and `hgrid_open_scene` opens it elsewhere with the same objects.
///
/// ```c
/// static hgrid_status put_twice(const hgrid_grid *grid, void *index, size_t index_bytes, void *scratch,
///                               size_t scratch_bytes, hgrid_object *object, hgrid_scene *scene)
/// {
///     hgrid_instance two[2] = {HGRID_INSTANCE_INIT, HGRID_INSTANCE_INIT};
///     hgrid_status status = hgrid_object_grid(grid, object);
///     if (status != HGRID_OK)
///         return status;
///     two[1].translation[0] = 10;
///     return hgrid_build_scene(two, 2, object, 1, NULL, index, index_bytes, scratch, scratch_bytes, scene,
///                              NULL);
/// }
/// ```
///
/// `instances` may be NULL if there are none, and `objects` likewise; `index` and `scratch` may be NULL if their size
/// is 0; `scene` may not be NULL. `config` may be NULL: the defaults; its method is `HGRID_METHOD_BVH`. `report` may be
/// NULL. Index and scratch are compared with view, blob and arrays of each object, `scene` with each object's view
/// alone. What an inner scene shows is not looked at, and must lie elsewhere.
/// The call writes anywhere in as much of the index as `hgrid_scene_bound` tells for this configuration, and touches
/// none of what is behind.
///
/// Returns `HGRID_OK` and writes the view to `scene`; or returns the reason, leaves `scene` as it was, and the index
/// holds nothing of use:
/// - with the call: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE`, `HGRID_ERROR_MISALIGNED`,
///   `HGRID_ERROR_OVERLAP`, `HGRID_ERROR_TOO_MANY_TRIANGLES`;
/// - with an instance, whose number is the report's `triangle`: `HGRID_ERROR_INSTANCE_OBJECT`,
///   `HGRID_ERROR_INSTANCE_MATRIX`;
/// - with the objects: `HGRID_ERROR_TOO_DEEP`;
/// - with the configuration: `HGRID_ERROR_INVALID_METHOD`, also for another method than bvh, and what `hgrid_build`
///   returns;
/// - with the memory: `HGRID_ERROR_INDEX_TOO_SMALL`, `HGRID_ERROR_SCRATCH_TOO_SMALL`.
///
/// Threads: as for `hgrid_build`.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_build_scene(
    instances: *const hgrid_instance,
    instance_count: usize,
    objects: *const hgrid_object,
    object_count: usize,
    config: *const hgrid_config,
    index: *mut c_void,
    index_bytes: usize,
    scratch: *mut c_void,
    scratch_bytes: usize,
    scene: *mut hgrid_scene,
    report: *mut hgrid_report,
) -> hgrid_status {
    let index = RawRegion { start: index, bytes: index_bytes };
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    let call = |report: &mut hgrid_report| {
        let to = NonNull::new(scene).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        let (instances, objects) = ((instances, instance_count), (objects, object_count));
        // SAFETY: the caller's promise.
        unsafe { raw::build_scene(instances, objects, config, [index, scratch], to, report) }
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting(report, call) }
}

/// Opens a scene that was built earlier, with the same objects in the same order: `hgrid_open` for scenes.
///
/// `blob` and `scene` may not be NULL; `objects` may be if there are none. Returns `HGRID_OK` and writes the view to
/// `scene`; or returns what `hgrid_open` returns, `HGRID_ERROR_OTHER_CONTENT` for a blob that is no scene,
/// `HGRID_ERROR_OVERLAP` if `scene` is the view of an object, `HGRID_ERROR_MISSING_OBJECTS` or
/// `HGRID_ERROR_TOO_DEEP`, and leaves `scene` as it was. What an inner scene shows is not compared with `scene`, and
/// must lie elsewhere.
///
/// Threads: any number of calls at once, also on the same blob, each with a view of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_open_scene(
    blob: *const c_void,
    blob_bytes: usize,
    objects: *const hgrid_object,
    object_count: usize,
    scene: *mut hgrid_scene,
) -> hgrid_status {
    let (false, Some(to)) = (blob.is_null(), NonNull::new(scene)) else {
        return HGRID_ERROR_NULL_ARGUMENT;
    };
    // SAFETY: the caller's promise.
    let opened = unsafe { raw::open_scene((blob, blob_bytes), (objects, object_count), to) };
    opened.err().unwrap_or(HGRID_OK)
}

/// Gives a built scene instances that moved: in place, without scratch, in less than the time of a build. Call it also
/// if an object changed and no instance moved: a scene keeps the boxes that its objects had.
///
/// There are as many instances as in the build; `hgrid_refit` says when to build anew. Arguments are as those of
/// `hgrid_build_scene`; `report` may be NULL. Returns `HGRID_OK` and writes the view to `scene`; or returns the reason
/// and leaves `scene` as it was: `HGRID_ERROR_MESH_MISMATCH` for another number of instances; what `hgrid_open_scene`
/// returns; `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_STRUCT_SIZE` or `HGRID_ERROR_OVERLAP`;
/// `HGRID_ERROR_INSTANCE_OBJECT` or `HGRID_ERROR_INSTANCE_MATRIX` for the instance whose number is the report's
/// `triangle`. After the last two, and if it was corrupt, the blob may hold nothing of use; after all others it is as
/// it was.
///
/// Threads: as for `hgrid_refit`.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_refit_scene(
    instances: *const hgrid_instance,
    instance_count: usize,
    objects: *const hgrid_object,
    object_count: usize,
    blob: *mut c_void,
    blob_bytes: usize,
    scene: *mut hgrid_scene,
    report: *mut hgrid_refit_report,
) -> hgrid_status {
    let blob = RawRegion { start: blob, bytes: blob_bytes };
    let call = |report: &mut hgrid_refit_report| {
        let to = NonNull::new(scene).ok_or(HGRID_ERROR_NULL_ARGUMENT)?;
        let (instances, objects) = ((instances, instance_count), (objects, object_count));
        // SAFETY: the caller's promise.
        unsafe { raw::refit_scene(instances, objects, blob, to, report) }
    };
    // SAFETY: the caller's promise.
    unsafe { raw::reporting_refit(report, call) }
}

/// Proves that a scene's tree and the box of every instance fit its objects, in
/// `HGRID_VALIDATE_BOUND(instance_count)` bytes of scratch. The objects have proofs of their own.
///
/// `scene` may not be NULL; `scratch` may be if `scratch_bytes` is 0. Returns `HGRID_OK`, or what
/// `hgrid_validate_shapes` returns.
///
/// Threads: any number of calls and queries on the same scene at once, each with scratch of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_validate_scene(
    scene: *const hgrid_scene,
    scratch: *mut c_void,
    scratch_bytes: usize,
) -> hgrid_status {
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    // SAFETY: the caller's promise.
    unsafe { raw::validate_scene(scene, scratch) }.err().unwrap_or(HGRID_OK)
}

/// Writes a scene and all grids, meshes and scenes that it shows as one blob for `hgrid_open_packed_scene`:
/// `hgrid_pack` for scenes.
///
/// A grid or scene is stored once, however many instances and scenes show it: the same address of a view is the same
/// grid. Shapes cannot be stored: their boxes and test are yours.
///
/// `to` starts at a multiple of `HGRID_ALIGNMENT` and overlaps nothing that the scene refers to, nor any argument of
/// this call. It may be NULL if `capacity` is 0: to ask for the size. `scene` and `bytes` may not be NULL. The call
/// copies everything, and compares each object with every other.
///
/// Returns `HGRID_OK` and has written the blob, or `HGRID_ERROR_INDEX_TOO_SMALL` and has written none of it; in both
/// cases `bytes` becomes its size. Or returns the reason: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_NOT_A_GRID`
/// (also for a cleared view among the objects), `HGRID_ERROR_MISALIGNED`, `HGRID_ERROR_OVERLAP`,
/// `HGRID_ERROR_OTHER_CONTENT` for shapes, and has written nothing. If the blob of one of the scenes was overwritten,
/// it returns what `hgrid_open_scene` returns for that, and has written nothing, either. Or it returns
/// `HGRID_ERROR_INDEX_OUT_OF_RANGE` if a mesh is damaged, after which `to` holds nothing of use. More than is
/// needed is not touched.
///
/// Threads: any number of calls and queries on the same scene at once, each with memory of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_pack_scene(
    scene: *const hgrid_scene,
    to: *mut c_void,
    capacity: usize,
    bytes: *mut u64,
) -> hgrid_status {
    let Some(size) = NonNull::new(bytes) else { return HGRID_ERROR_NULL_ARGUMENT };
    // SAFETY: the caller's promise.
    let packed = unsafe { raw::pack_scene(scene, RawRegion { start: to, bytes: capacity }, size) };
    packed.err().unwrap_or(HGRID_OK)
}

/// Opens a blob that `hgrid_pack_scene` wrote where it lies: in time proportional to the grids in it, without a copy.
///
/// `blob` starts at a multiple of `HGRID_ALIGNMENT`; bytes behind it are ignored. `views` is memory for the views of
/// what is in it, at a multiple of `HGRID_ALIGNMENT` as well: like the blob, it stays where it is and as it is for as
/// long as the scene is queried. It may be NULL if `views_bytes` is 0: to ask for the size. A scene without instances
/// takes no views: then the call that asks for the size opens it, and returns `HGRID_OK`.
///
/// With `scratch` all grids and scenes in the blob are proven, as `hgrid_validate` and `hgrid_validate_scene` do: a
/// 64th of the blob's bytes is enough, at any address. With NULL, and `scratch_bytes` 0, nothing is proven, and what
/// `hgrid_open` says of damaged bytes holds. Blob, views and scratch do not overlap.
///
/// `blob`, `bytes` and `scene` may not be NULL. Returns `HGRID_OK` and writes the view to `scene`, or
/// `HGRID_ERROR_INDEX_TOO_SMALL` if the views have too little memory; in both cases `bytes` becomes what the views
/// take. Or returns the reason: `HGRID_ERROR_NULL_ARGUMENT`, `HGRID_ERROR_MISALIGNED`, `HGRID_ERROR_OVERLAP`,
/// `HGRID_ERROR_OTHER_CONTENT` for a blob that is no packed scene, `HGRID_ERROR_TRUNCATED`, `HGRID_ERROR_CORRUPT`,
/// `HGRID_ERROR_SCRATCH_TOO_SMALL`, what `hgrid_open_scene` returns and what `hgrid_validate` returns. Unless it
/// returns `HGRID_OK`, `scene` stays as it was, and the views hold nothing of use.
///
/// Threads: any number of calls at once, also on the same blob, each with a view and memory of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_open_packed_scene(
    blob: *const c_void,
    blob_bytes: usize,
    views: *mut c_void,
    views_bytes: usize,
    scratch: *mut c_void,
    scratch_bytes: usize,
    bytes: *mut u64,
    scene: *mut hgrid_scene,
) -> hgrid_status {
    let (false, Some(size), Some(to)) = (blob.is_null(), NonNull::new(bytes), NonNull::new(scene))
    else {
        return HGRID_ERROR_NULL_ARGUMENT;
    };
    let views = RawRegion { start: views, bytes: views_bytes };
    let scratch = RawRegion { start: scratch, bytes: scratch_bytes };
    // SAFETY: the caller's promise.
    let opened = unsafe { raw::open_packed_scene((blob, blob_bytes), [views, scratch], size, to) };
    opened.err().unwrap_or(HGRID_OK)
}

/// Finds the closest thing in a scene that a ray hits.
///
/// Returns true and writes `hit`; or returns false and writes nothing. Where several are hit at the same `t`, that of
/// the first instance is reported, and in it the lowest number. `options` may be NULL: the defaults. With another
/// NULL, a view of zeros, or options that break the rules for structs nothing is hit.
///
/// A query allocates nothing and always ends. It takes up to 8 KiB of stack for the scene and for each scene inside
/// it, and 9 KiB for a grid.
///
/// Threads: any number of queries on the same scene at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_intersect_scene(
    scene: *const hgrid_scene,
    ray: *const hgrid_ray_f64,
    options: *const hgrid_scene_options,
    hit: *mut hgrid_scene_hit,
) -> bool {
    let Some(to) = NonNull::new(hit) else { return false };
    // SAFETY: the caller's promise.
    let Ok(Some(found)) = (unsafe { raw::query_scene(scene, ray, options, false) }) else {
        return false;
    };
    // SAFETY: the caller's promise.
    unsafe { raw::write(to, found.into()) };
    true
}

/// Tells whether a ray hits anything in a scene: what `hgrid_intersect_scene` would return, but faster.
///
/// `options` may be NULL. With another NULL, and in all cases in which that function hits nothing, the answer is false.
///
/// Threads: any number of queries on the same scene at once; each thread with counters of its own.
///
/// # Safety
/// Pointers are as the head of this file says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hgrid_occluded_scene(
    scene: *const hgrid_scene,
    ray: *const hgrid_ray_f64,
    options: *const hgrid_scene_options,
) -> bool {
    // SAFETY: the caller's promise.
    matches!(unsafe { raw::query_scene(scene, ray, options, true) }, Ok(Some(_)))
}
