//! A device and its scenes, and the bytes that Embree reports for them.

use core::ffi::c_void;
use core::ptr;
use core::sync::atomic::{AtomicIsize, Ordering::Relaxed};

use anyhow::{Result, ensure};

use super::ffi;
use super::query::Buffers;
use crate::compare::input::Input;
use crate::compare::system::Bytes;

/// One thread; everything else, the vector width too, is what Embree chooses.
const CONFIG: &core::ffi::CStr = c"threads=1";

/// How a scene is built.
#[derive(Debug, Clone, Copy)]
pub(in super::super) enum Quality {
    /// For scenes that change: Morton codes.
    Low,
    /// The same, in memory that the scene keeps for the next build.
    Dynamic,
    /// The default: binned SAH.
    Medium,
}

/// Bytes that a device holds, and the most since a build began.
#[derive(Default)]
struct Memory {
    current: AtomicIsize,
    peak: AtomicIsize,
}

/// An Embree device.
pub(super) struct Device {
    handle: ffi::Device,
    /// In a box, because Embree keeps its address.
    memory: Box<Memory>,
}

/// Called by Embree for what it gets and gives back.
extern "C" fn monitor(memory: *mut c_void, bytes: isize, _: bool) -> bool {
    // SAFETY: the pointer is the one that `Device::new` gave, and the device does not outlive it.
    let memory = unsafe { &*memory.cast::<Memory>() };
    let now = memory.current.fetch_add(bytes, Relaxed) + bytes;
    memory.peak.fetch_max(now, Relaxed);
    true
}

impl Device {
    pub(super) fn new() -> Result<Self> {
        // SAFETY: the configuration is a C string.
        let handle = unsafe { ffi::rtcNewDevice(CONFIG.as_ptr()) };
        ensure!(!handle.is_null(), "Embree does not start");
        let memory = Box::<Memory>::default();
        let address = ptr::from_ref(&*memory).cast_mut().cast();
        // SAFETY: the box lives as long as the device, and is only written through its atomics.
        unsafe { ffi::rtcSetDeviceMemoryMonitorFunction(handle, monitor, address) };
        Ok(Self { handle, memory })
    }

    /// The version of the library, as 3.13.5.
    pub(super) fn version(&self) -> String {
        // SAFETY: the device is a live one.
        let number = unsafe { ffi::rtcGetDeviceProperty(self.handle, ffi::PROPERTY_VERSION) };
        format!("{}.{}.{}", number / 10_000, number / 100 % 100, number % 100)
    }

    /// Builds a scene of one mesh.
    pub(super) fn build<'a>(&'a self, input: &'a Input, quality: Quality) -> Result<Scene<'a>> {
        let (quality, flags) = match quality {
            Quality::Low => (ffi::BUILD_QUALITY_LOW, ffi::SCENE_NONE),
            Quality::Dynamic => (ffi::BUILD_QUALITY_LOW, ffi::SCENE_DYNAMIC),
            Quality::Medium => (ffi::BUILD_QUALITY_MEDIUM, ffi::SCENE_NONE),
        };
        let before = self.memory.current.load(Relaxed);
        self.memory.peak.store(before, Relaxed);

        // SAFETY: the device is a live one, here and below.
        let handle = unsafe { ffi::rtcNewScene(self.handle) };
        let scene = Scene { handle, device: self, before, buffers: Buffers::new(), input };
        // SAFETY: as above.
        let geometry = unsafe { ffi::rtcNewGeometry(self.handle, ffi::GEOMETRY_TYPE_TRIANGLE) };
        ensure!(!handle.is_null() && !geometry.is_null(), "Embree has no memory left");
        // SAFETY: scene and geometry are live, here and below.
        unsafe { ffi::rtcSetSceneFlags(handle, flags) };
        // SAFETY: as above.
        unsafe { ffi::rtcSetSceneBuildQuality(handle, quality) };
        // SAFETY: as above.
        unsafe { ffi::rtcSetGeometryBuildQuality(geometry, quality) };
        share(geometry, ffi::BUFFER_TYPE_VERTEX, ffi::FORMAT_FLOAT3, input.positions());
        share(geometry, ffi::BUFFER_TYPE_INDEX, ffi::FORMAT_UINT3, input.indices());
        // SAFETY: as above.
        unsafe { ffi::rtcCommitGeometry(geometry) };
        // SAFETY: as above.
        unsafe { ffi::rtcAttachGeometry(handle, geometry) };
        // SAFETY: as above; the scene keeps a count of its own.
        unsafe { ffi::rtcReleaseGeometry(geometry) };
        // SAFETY: as above.
        unsafe { ffi::rtcCommitScene(handle) };
        self.check()?;
        Ok(scene)
    }

    /// What Embree says about the calls so far.
    fn check(&self) -> Result<()> {
        // SAFETY: the device is a live one.
        let error = unsafe { ffi::rtcGetDeviceError(self.handle) };
        ensure!(error == ffi::ERROR_NONE, "Embree reports error {error}");
        Ok(())
    }
}

/// Lets a geometry read an array where it is.
fn share<T>(geometry: ffi::Geometry, kind: u32, format: u32, items: &[[T; 3]]) {
    let stride = size_of::<[T; 3]>();
    // SAFETY: the array outlives the scene, which borrows the input. Embree reads sixteen bytes of
    // the last position, and `Input` has four more behind it.
    unsafe {
        ffi::rtcSetSharedGeometryBuffer(
            geometry,
            kind,
            0,
            format,
            items.as_ptr().cast(),
            0,
            stride,
            items.len(),
        );
    };
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the device is a live one, and scenes borrow it: there is none left.
        unsafe { ffi::rtcReleaseDevice(self.handle) };
    }
}

/// A scene that is built.
pub(super) struct Scene<'a> {
    handle: ffi::Scene,
    device: &'a Device,
    before: isize,
    buffers: Buffers,
    input: &'a Input,
}

impl Scene<'_> {
    pub(super) const fn handle(&self) -> ffi::Scene {
        self.handle
    }

    /// Builds again, as if all vertices had moved.
    pub(super) fn rebuild(&self) -> Result<()> {
        // SAFETY: the scene is a live one and holds the one geometry that was attached to it.
        let geometry = unsafe { ffi::rtcGetGeometry(self.handle, 0) };
        // SAFETY: as above, here and below.
        unsafe { ffi::rtcUpdateGeometryBuffer(geometry, ffi::BUFFER_TYPE_VERTEX, 0) };
        // SAFETY: as above.
        unsafe { ffi::rtcCommitGeometry(geometry) };
        // SAFETY: as above.
        unsafe { ffi::rtcCommitScene(self.handle) };
        self.device.check()
    }

    /// The mesh.
    pub(super) const fn input(&self) -> &Input {
        self.input
    }

    pub(super) const fn buffers(&self) -> &Buffers {
        &self.buffers
    }

    /// Bytes since the build began.
    pub(super) fn memory(&self) -> Bytes {
        let Memory { current, peak } = &*self.device.memory;
        let since =
            |bytes: &AtomicIsize| usize::try_from(bytes.load(Relaxed) - self.before).unwrap_or(0);
        Bytes { index: since(current), peak: since(peak) }
    }
}

impl Drop for Scene<'_> {
    fn drop(&mut self) {
        // SAFETY: the scene is a live one, or null, which Embree refuses with an error code.
        unsafe { ffi::rtcReleaseScene(self.handle) };
    }
}
