//! The few functions and structs of embree3/rtcore.h (3.13) that the adapter needs.
//!
//! Functions keep their C names. Structs have the fields of C in its order; what is not read has
//! a short name.

use core::ffi::{c_char, c_int, c_uint, c_void};

/// `RTC_INVALID_GEOMETRY_ID`.
pub(super) const INVALID_ID: u32 = u32::MAX;

/// `RTC_FORMAT_UINT3` and `RTC_FORMAT_FLOAT3`.
pub(super) const FORMAT_UINT3: c_uint = 0x5003;
pub(super) const FORMAT_FLOAT3: c_uint = 0x9003;

/// `RTC_GEOMETRY_TYPE_TRIANGLE`, `RTC_BUFFER_TYPE_INDEX` and `RTC_BUFFER_TYPE_VERTEX`.
pub(super) const GEOMETRY_TYPE_TRIANGLE: c_uint = 0;
pub(super) const BUFFER_TYPE_INDEX: c_uint = 0;
pub(super) const BUFFER_TYPE_VERTEX: c_uint = 1;

/// `RTC_BUILD_QUALITY_LOW` and `RTC_BUILD_QUALITY_MEDIUM`.
pub(super) const BUILD_QUALITY_LOW: c_uint = 0;
pub(super) const BUILD_QUALITY_MEDIUM: c_uint = 1;

/// `RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT` and `RTC_INTERSECT_CONTEXT_FLAG_COHERENT`.
pub(super) const CONTEXT_INCOHERENT: c_uint = 0;
pub(super) const CONTEXT_COHERENT: c_uint = 1;

/// `RTC_ERROR_NONE`.
pub(super) const ERROR_NONE: c_uint = 0;

/// Rays in a packet.
pub(super) const LANES: usize = 16;

/// `RTCDevice`, `RTCScene`, `RTCGeometry`: what is behind them is Embree's.
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
#[repr(C)]
pub(super) struct RayHit1 {
    pub(super) ray: Ray1,
    pub(super) hit: Hit1,
}

/// `RTCRay16`: coordinates of all rays, axis by axis.
#[repr(C, align(64))]
pub(super) struct Ray16 {
    pub(super) origin: [[f32; LANES]; 3],
    pub(super) near: [f32; LANES],
    pub(super) direction: [[f32; LANES]; 3],
    pub(super) time: [f32; LANES],
    pub(super) far: [f32; LANES],
    pub(super) mask: [u32; LANES],
    pub(super) id: [u32; LANES],
    pub(super) flags: [u32; LANES],
}

/// `RTCHit16`.
#[repr(C, align(64))]
pub(super) struct Hit16 {
    pub(super) normal: [[f32; LANES]; 3],
    pub(super) u: [f32; LANES],
    pub(super) v: [f32; LANES],
    pub(super) primitive: [u32; LANES],
    pub(super) geometry: [u32; LANES],
    pub(super) instance: [u32; LANES],
}

/// `RTCRayHit16`.
#[repr(C)]
pub(super) struct RayHit16 {
    pub(super) ray: Ray16,
    pub(super) hit: Hit16,
}

/// Which rays of a packet are there: -1, or 0 for those that are not.
#[repr(C, align(64))]
pub(super) struct Valid(pub(super) [c_int; LANES]);

// The sizes that the C compiler gives.
const _: () = assert!(size_of::<Context>() == 24 && size_of::<RayHit1>() == 80);
const _: () = assert!(size_of::<Ray16>() == 12 * 64 && size_of::<RayHit16>() == 20 * 64);

unsafe extern "C" {
    pub(super) fn rtcNewDevice(config: *const c_char) -> Device;
    pub(super) fn rtcReleaseDevice(device: Device);
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
    pub(super) fn rtcCommitGeometry(geometry: Geometry);
    pub(super) fn rtcReleaseGeometry(geometry: Geometry);

    pub(super) fn rtcNewScene(device: Device) -> Scene;
    pub(super) fn rtcSetSceneBuildQuality(scene: Scene, quality: c_uint);
    pub(super) fn rtcAttachGeometry(scene: Scene, geometry: Geometry) -> c_uint;
    pub(super) fn rtcCommitScene(scene: Scene);
    pub(super) fn rtcReleaseScene(scene: Scene);

    pub(super) fn rtcIntersect1(scene: Scene, context: *mut Context, ray: *mut RayHit1);
    pub(super) fn rtcIntersect16(
        valid: *const c_int,
        scene: Scene,
        context: *mut Context,
        rays: *mut RayHit16,
    );
    pub(super) fn rtcOccluded1(scene: Scene, context: *mut Context, ray: *mut Ray1);
    pub(super) fn rtcOccluded16(
        valid: *const c_int,
        scene: Scene,
        context: *mut Context,
        rays: *mut Ray16,
    );
}
