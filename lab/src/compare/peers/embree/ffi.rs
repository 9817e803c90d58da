//! The few functions and structs of embree3/rtcore.h (3.13) that the adapter needs.
//!
//! Functions keep their C names. Structs have the fields of C in the same order; fields that are not read
//! have short names.

use core::ffi::{c_char, c_int, c_uint, c_void};

/// `RTC_INVALID_GEOMETRY_ID`.
pub(super) const INVALID_ID: u32 = u32::MAX;

/// `RTC_FORMAT_UINT3` and `RTC_FORMAT_FLOAT3`.
pub(super) const FORMAT_UINT3: c_uint = 0x5003;
pub(super) const FORMAT_FLOAT3: c_uint = 0x9003;

/// `RTC_FORMAT_FLOAT3X4_ROW_MAJOR`.
pub(super) const FORMAT_FLOAT3X4: c_uint = 0x9134;

/// `RTC_GEOMETRY_TYPE_TRIANGLE`, `RTC_GEOMETRY_TYPE_USER`, `RTC_GEOMETRY_TYPE_INSTANCE`, `RTC_BUFFER_TYPE_INDEX`
/// and `RTC_BUFFER_TYPE_VERTEX`.
pub(super) const GEOMETRY_TYPE_TRIANGLE: c_uint = 0;
pub(super) const GEOMETRY_TYPE_USER: c_uint = 120;
pub(super) const GEOMETRY_TYPE_INSTANCE: c_uint = 121;
pub(super) const BUFFER_TYPE_INDEX: c_uint = 0;
pub(super) const BUFFER_TYPE_VERTEX: c_uint = 1;

/// `RTC_BUILD_QUALITY_LOW`, `RTC_BUILD_QUALITY_MEDIUM` and `RTC_BUILD_QUALITY_HIGH`.
pub(super) const BUILD_QUALITY_LOW: c_uint = 0;
pub(super) const BUILD_QUALITY_MEDIUM: c_uint = 1;
pub(super) const BUILD_QUALITY_HIGH: c_uint = 2;

/// `RTC_SCENE_FLAG_NONE`, `RTC_SCENE_FLAG_DYNAMIC`, `RTC_SCENE_FLAG_COMPACT` and `RTC_SCENE_FLAG_ROBUST`.
pub(super) const SCENE_NONE: c_uint = 0;
pub(super) const SCENE_DYNAMIC: c_uint = 1;
pub(super) const SCENE_COMPACT: c_uint = 2;
pub(super) const SCENE_ROBUST: c_uint = 4;

/// `RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT` and `RTC_INTERSECT_CONTEXT_FLAG_COHERENT`.
pub(super) const CONTEXT_INCOHERENT: c_uint = 0;
pub(super) const CONTEXT_COHERENT: c_uint = 1;

/// `RTC_DEVICE_PROPERTY_VERSION`: 31305 is 3.13.5.
pub(super) const PROPERTY_VERSION: c_uint = 0;

/// `RTC_ERROR_NONE`.
pub(super) const ERROR_NONE: c_uint = 0;

/// `RTCDevice`, `RTCScene`, `RTCGeometry`: opaque pointers of Embree.
pub(super) type Device = *mut c_void;
pub(super) type Scene = *mut c_void;
pub(super) type Geometry = *mut c_void;

/// `RTCMemoryMonitorFunction`.
pub(super) type MemoryMonitor = extern "C" fn(*mut c_void, isize, bool) -> bool;

/// `RTCIntersectContext`.
#[repr(C)]
pub(super) struct Context {
    pub(super) flags: c_uint,
    pub(super) filter: Option<extern "C" fn(*const c_void)>,
    pub(super) inst_id: [c_uint; 1],
}

/// `RTCRay`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct Ray1 {
    pub(super) origin: [f32; 3],
    pub(super) near: f32,
    pub(super) direction: [f32; 3],
    pub(super) time: f32,
    pub(super) far: f32,
    pub(super) mask: u32,
    pub(super) id: u32,
    pub(super) flags: u32,
}

/// `RTCHit`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct Hit1 {
    pub(super) normal: [f32; 3],
    pub(super) u: f32,
    pub(super) v: f32,
    pub(super) primitive: u32,
    pub(super) geometry: u32,
    pub(super) instance: u32,
}

/// `RTCRayHit`.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct RayHit1 {
    pub(super) ray: Ray1,
    pub(super) hit: Hit1,
}

/// `RTCRay4`, `RTCRay8` and `RTCRay16`: the coordinates of all rays, axis by axis. C aligns the smaller structs less.
#[repr(C, align(64))]
pub(super) struct Rays<const LANES: usize> {
    pub(super) origin: [[f32; LANES]; 3],
    pub(super) near: [f32; LANES],
    pub(super) direction: [[f32; LANES]; 3],
    pub(super) time: [f32; LANES],
    pub(super) far: [f32; LANES],
    pub(super) mask: [u32; LANES],
    pub(super) id: [u32; LANES],
    pub(super) flags: [u32; LANES],
}

/// `RTCHit4`, `RTCHit8` and `RTCHit16`.
#[repr(C, align(64))]
pub(super) struct Hits<const LANES: usize> {
    pub(super) normal: [[f32; LANES]; 3],
    pub(super) u: [f32; LANES],
    pub(super) v: [f32; LANES],
    pub(super) primitive: [u32; LANES],
    pub(super) geometry: [u32; LANES],
    pub(super) instance: [u32; LANES],
}

/// `RTCRayHit4`, `RTCRayHit8` and `RTCRayHit16`.
#[repr(C)]
pub(super) struct RayHits<const LANES: usize> {
    pub(super) rays: Rays<LANES>,
    pub(super) hits: Hits<LANES>,
}

/// `RTCPointQuery`.
#[repr(C, align(16))]
pub(super) struct PointQuery {
    pub(super) point: [f32; 3],
    pub(super) time: f32,
    pub(super) radius: f32,
}

/// `RTCPointQueryContext`: a stack of transformations, which is empty here.
#[repr(C, align(16))]
pub(super) struct PointContext {
    pub(super) world_to_instance: [f32; 16],
    pub(super) instance_to_world: [f32; 16],
    pub(super) inst_id: [c_uint; 1],
    pub(super) stack_size: c_uint,
}

/// `RTCPointQueryFunctionArguments`.
#[repr(C, align(16))]
pub(super) struct PointArguments {
    pub(super) query: *mut PointQuery,
    pub(super) user: *mut c_void,
    pub(super) primitive: c_uint,
    pub(super) geometry: c_uint,
    pub(super) context: *mut PointContext,
    pub(super) scale: f32,
}

/// `RTCPointQueryFunction`.
pub(super) type PointFunction = unsafe extern "C" fn(*mut PointArguments) -> bool;

/// `RTCBounds`.
#[repr(C, align(16))]
pub(super) struct Bounds {
    pub(super) lower: [f32; 3],
    pub(super) align0: f32,
    pub(super) upper: [f32; 3],
    pub(super) align1: f32,
}

/// `RTCBoundsFunctionArguments`.
#[repr(C)]
pub(super) struct BoundsArguments {
    pub(super) user: *mut c_void,
    pub(super) primitive: c_uint,
    pub(super) time_step: c_uint,
    pub(super) bounds: *mut Bounds,
}

/// `RTCIntersectFunctionNArguments` and `RTCOccludedFunctionNArguments`, which differ in what `rays` points to:
/// twelve numbers of each ray, and eight more of its hit in the first.
#[repr(C)]
pub(super) struct ShapeArguments {
    pub(super) valid: *const c_int,
    pub(super) user: *mut c_void,
    pub(super) primitive: c_uint,
    pub(super) context: *mut Context,
    pub(super) rays: *mut c_void,
    pub(super) lanes: c_uint,
    pub(super) geometry: c_uint,
}

/// `RTCBoundsFunction`.
pub(super) type BoundsFunction = unsafe extern "C" fn(*const BoundsArguments);

/// `RTCIntersectFunctionN` and `RTCOccludedFunctionN`.
pub(super) type ShapeFunction = unsafe extern "C" fn(*const ShapeArguments);

/// The marks of a packet's rays: -1 for rays to trace, 0 for unused lanes.
#[repr(C, align(64))]
pub(super) struct Valid<const LANES: usize>(pub(super) [c_int; LANES]);

/// `rtcIntersect4`, `rtcIntersect8` or `rtcIntersect16`.
pub(super) type IntersectPacket<const LANES: usize> =
    unsafe extern "C" fn(*const c_int, Scene, *mut Context, *mut RayHits<LANES>);

/// `rtcOccluded4`, `rtcOccluded8` or `rtcOccluded16`.
pub(super) type OccludedPacket<const LANES: usize> =
    unsafe extern "C" fn(*const c_int, Scene, *mut Context, *mut Rays<LANES>);

// The sizes that the C compiler gives.
const _: () = assert!(size_of::<Context>() == 24 && size_of::<RayHit1>() == 80);
const _: () = assert!(size_of::<PointQuery>() == 32 && size_of::<PointContext>() == 144);
const _: () = assert!(size_of::<PointArguments>() == 48);
const _: () = assert!(size_of::<Bounds>() == 32 && size_of::<BoundsArguments>() == 24);
const _: () = assert!(size_of::<ShapeArguments>() == 48);
const _: () = assert!(size_of::<Rays<4>>() == 12 * 16 && size_of::<RayHits<4>>() == 20 * 16);
const _: () = assert!(size_of::<Rays<8>>() == 12 * 32 && size_of::<RayHits<8>>() == 20 * 32);
const _: () = assert!(size_of::<Rays<16>>() == 12 * 64 && size_of::<RayHits<16>>() == 20 * 64);

unsafe extern "C" {
    pub(super) fn rtcNewDevice(config: *const c_char) -> Device;
    pub(super) fn rtcReleaseDevice(device: Device);
    pub(super) fn rtcGetDeviceProperty(device: Device, property: c_uint) -> isize;
    pub(super) fn rtcGetDeviceError(device: Device) -> c_uint;
    pub(super) fn rtcSetDeviceMemoryMonitorFunction(
        device: Device,
        monitor: MemoryMonitor,
        user: *mut c_void,
    );

    pub(super) fn rtcNewGeometry(device: Device, kind: c_uint) -> Geometry;
    pub(super) fn rtcSetGeometryBuildQuality(geometry: Geometry, quality: c_uint);
    pub(super) fn rtcSetSharedGeometryBuffer(
        geometry: Geometry,
        kind: c_uint,
        slot: c_uint,
        format: c_uint,
        data: *const c_void,
        byte_offset: usize,
        byte_stride: usize,
        item_count: usize,
    );
    pub(super) fn rtcSetGeometryUserPrimitiveCount(geometry: Geometry, count: c_uint);
    pub(super) fn rtcSetGeometryUserData(geometry: Geometry, user: *mut c_void);
    pub(super) fn rtcSetGeometryBoundsFunction(
        geometry: Geometry,
        bounds: BoundsFunction,
        user: *mut c_void,
    );
    pub(super) fn rtcSetGeometryIntersectFunction(geometry: Geometry, intersect: ShapeFunction);
    pub(super) fn rtcSetGeometryOccludedFunction(geometry: Geometry, occluded: ShapeFunction);
    pub(super) fn rtcSetGeometryInstancedScene(geometry: Geometry, scene: Scene);
    pub(super) fn rtcSetGeometryTransform(
        geometry: Geometry,
        time_step: c_uint,
        format: c_uint,
        transform: *const c_void,
    );
    pub(super) fn rtcUpdateGeometryBuffer(geometry: Geometry, kind: c_uint, slot: c_uint);
    pub(super) fn rtcCommitGeometry(geometry: Geometry);
    pub(super) fn rtcReleaseGeometry(geometry: Geometry);

    pub(super) fn rtcNewScene(device: Device) -> Scene;
    pub(super) fn rtcSetSceneFlags(scene: Scene, flags: c_uint);
    pub(super) fn rtcSetSceneBuildQuality(scene: Scene, quality: c_uint);
    pub(super) fn rtcAttachGeometry(scene: Scene, geometry: Geometry) -> c_uint;
    pub(super) fn rtcGetGeometry(scene: Scene, id: c_uint) -> Geometry;
    pub(super) fn rtcCommitScene(scene: Scene);
    pub(super) fn rtcReleaseScene(scene: Scene);

    pub(super) fn rtcPointQuery(
        scene: Scene,
        query: *mut PointQuery,
        context: *mut PointContext,
        function: PointFunction,
        user: *mut c_void,
    ) -> bool;

    pub(super) fn rtcIntersect1(scene: Scene, context: *mut Context, ray: *mut RayHit1);
    pub(super) fn rtcOccluded1(scene: Scene, context: *mut Context, ray: *mut Ray1);
    pub(super) fn rtcIntersect4(
        valid: *const c_int,
        scene: Scene,
        context: *mut Context,
        rays: *mut RayHits<4>,
    );
    pub(super) fn rtcOccluded4(
        valid: *const c_int,
        scene: Scene,
        context: *mut Context,
        rays: *mut Rays<4>,
    );
    pub(super) fn rtcIntersect8(
        valid: *const c_int,
        scene: Scene,
        context: *mut Context,
        rays: *mut RayHits<8>,
    );
    pub(super) fn rtcOccluded8(
        valid: *const c_int,
        scene: Scene,
        context: *mut Context,
        rays: *mut Rays<8>,
    );
    pub(super) fn rtcIntersect16(
        valid: *const c_int,
        scene: Scene,
        context: *mut Context,
        rays: *mut RayHits<16>,
    );
    pub(super) fn rtcOccluded16(
        valid: *const c_int,
        scene: Scene,
        context: *mut Context,
        rays: *mut Rays<16>,
    );
    pub(super) fn rtcIntersect1M(
        scene: Scene,
        context: *mut Context,
        rays: *mut RayHit1,
        count: c_uint,
        byte_stride: usize,
    );
    pub(super) fn rtcOccluded1M(
        scene: Scene,
        context: *mut Context,
        rays: *mut Ray1,
        count: c_uint,
        byte_stride: usize,
    );
}
