//! A device and its scenes, with the bytes that Embree reports for them.

use core::ffi::{c_uint, c_void};
use core::ptr;
use core::sync::atomic::{AtomicIsize, Ordering::Relaxed};

use anyhow::{Result, ensure};
use hgrid_core::Instance;

use super::ffi;
use super::query::{Buffers, bounds, intersect, occluded};
use crate::compare::heap;
use crate::compare::input::Input;
use crate::compare::shown::Shown;
use crate::compare::system::Bytes;
use crate::vector::round;

/// One thread; Embree chooses everything else, the vector width included.
const CONFIG: &core::ffi::CStr = c"threads=1";

/// A way to build a scene.
#[derive(Debug, Clone, Copy)]
pub(in super::super) enum Quality {
    /// For scenes that change: Morton codes.
    Low,
    /// The same, in memory that the scene keeps for the next build.
    Dynamic,
    /// The default: binned SAH.
    Medium,
    /// SAH with spatial splits, for scenes that are traced for long.
    High,
    /// Medium, with boxes and tests that let no ray through an edge.
    Robust,
    /// Medium, with leaves that read the mesh instead of copies of it.
    Compact,
    /// Low, with such leaves.
    LowCompact,
}

impl Quality {
    const fn number(self) -> c_uint {
        match self {
            Self::Low | Self::Dynamic | Self::LowCompact => ffi::BUILD_QUALITY_LOW,
            Self::Medium | Self::Robust | Self::Compact => ffi::BUILD_QUALITY_MEDIUM,
            Self::High => ffi::BUILD_QUALITY_HIGH,
        }
    }

    const fn flags(self) -> c_uint {
        match self {
            Self::Low | Self::Medium | Self::High => ffi::SCENE_NONE,
            Self::Dynamic => ffi::SCENE_DYNAMIC,
            Self::Robust => ffi::SCENE_ROBUST,
            Self::Compact | Self::LowCompact => ffi::SCENE_COMPACT,
        }
    }
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

/// Counts bytes that Embree allocates and frees; Embree calls it.
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
        // SAFETY: the device is valid.
        let number = unsafe { ffi::rtcGetDeviceProperty(self.handle, ffi::PROPERTY_VERSION) };
        format!("{}.{}.{}", number / 10_000, number / 100 % 100, number % 100)
    }

    /// Builds a scene of one mesh.
    pub(super) fn build<'a>(&'a self, input: &'a Input, quality: Quality) -> Result<Scene<'a>> {
        let scene = self.start(input, None, quality)?;
        let geometry = self.geometry(ffi::GEOMETRY_TYPE_TRIANGLE)?;
        // SAFETY: the geometry is valid.
        unsafe { ffi::rtcSetGeometryBuildQuality(geometry, quality.number()) };
        share(geometry, ffi::BUFFER_TYPE_VERTEX, ffi::FORMAT_FLOAT3, input.positions());
        share(geometry, ffi::BUFFER_TYPE_INDEX, ffi::FORMAT_UINT3, input.indices());
        scene.attach(geometry);
        scene.commit()?;
        Ok(scene)
    }

    /// Builds a scene of one geometry whose primitives are spheres.
    pub(super) fn build_spheres<'a>(
        &'a self,
        input: &'a Input,
        quality: Quality,
    ) -> Result<Scene<'a>> {
        let scene = self.start(input, None, quality)?;
        let geometry = self.geometry(ffi::GEOMETRY_TYPE_USER)?;
        let count = u32::try_from(input.spheres().len())?;
        let user = ptr::from_ref(input).cast_mut().cast();
        // SAFETY: the geometry is valid, here and below.
        unsafe { ffi::rtcSetGeometryBuildQuality(geometry, quality.number()) };
        // SAFETY: as above.
        unsafe { ffi::rtcSetGeometryUserPrimitiveCount(geometry, count) };
        // SAFETY: as above; the input outlives the scene, which borrows it, and is only read.
        unsafe { ffi::rtcSetGeometryUserData(geometry, user) };
        // SAFETY: as above; the function takes the arguments of the header and this user data.
        unsafe { ffi::rtcSetGeometryBoundsFunction(geometry, bounds, ptr::null_mut()) };
        // SAFETY: as above.
        unsafe { ffi::rtcSetGeometryIntersectFunction(geometry, intersect) };
        // SAFETY: as above.
        unsafe { ffi::rtcSetGeometryOccludedFunction(geometry, occluded) };
        scene.attach(geometry);
        scene.commit()?;
        Ok(scene)
    }

    /// Builds a scene of the instances of a mesh whose own scene is complete.
    pub(super) fn build_instances<'a>(
        &'a self,
        mesh: &Scene<'a>,
        quality: Quality,
    ) -> Result<Scene<'a>> {
        let scene = self.start(mesh.input, Some(mesh.handle), quality)?;
        scene.attach_instances(mesh.handle)?;
        scene.commit()?;
        Ok(scene)
    }

    /// Starts a scene without geometries.
    fn start<'a>(
        &'a self,
        input: &'a Input,
        mesh: Option<ffi::Scene>,
        quality: Quality,
    ) -> Result<Scene<'a>> {
        let before = self.memory.current.load(Relaxed);
        self.memory.peak.store(before, Relaxed);
        // SAFETY: the device is valid.
        let handle = unsafe { ffi::rtcNewScene(self.handle) };
        let scene = Scene { handle, device: self, before, buffers: Buffers::new(), input, mesh };
        ensure!(!handle.is_null(), "Embree has no memory left");
        // SAFETY: the scene is valid, here and below.
        unsafe { ffi::rtcSetSceneFlags(handle, quality.flags()) };
        // SAFETY: as above.
        unsafe { ffi::rtcSetSceneBuildQuality(handle, quality.number()) };
        Ok(scene)
    }

    /// Makes a geometry.
    fn geometry(&self, kind: c_uint) -> Result<ffi::Geometry> {
        // SAFETY: the device is valid.
        let geometry = unsafe { ffi::rtcNewGeometry(self.handle, kind) };
        ensure!(!geometry.is_null(), "Embree has no memory left");
        Ok(geometry)
    }

    /// Fails if any call so far has set Embree's error code.
    fn check(&self) -> Result<()> {
        // SAFETY: the device is valid.
        let error = unsafe { ffi::rtcGetDeviceError(self.handle) };
        ensure!(error == ffi::ERROR_NONE, "Embree reports error {error}");
        Ok(())
    }
}

/// Shares an array with a geometry, which reads it in place.
fn share<T>(geometry: ffi::Geometry, kind: u32, format: u32, items: &[[T; 3]]) {
    let stride = size_of::<[T; 3]>();
    // SAFETY: the array outlives the scene, which borrows the input. Embree reads sixteen bytes of the last
    // position, and `Input` has four more after it.
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

/// Sets the place of an instance.
fn place(geometry: ffi::Geometry, instance: &Instance) {
    let Instance { linear, translation, .. } = instance;
    let translation = round(*translation);
    let rows = [0, 1, 2].map(|axis| {
        let [x, y, z] = linear[axis];
        [x, y, z, translation[axis]]
    });
    // SAFETY: the geometry is valid, and Embree reads twelve floats, which it copies.
    unsafe {
        ffi::rtcSetGeometryTransform(geometry, 0, ffi::FORMAT_FLOAT3X4, rows.as_ptr().cast());
    };
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the device is valid, and no scene is left, because scenes borrow it.
        unsafe { ffi::rtcReleaseDevice(self.handle) };
    }
}

/// A scene, complete or being built.
pub(super) struct Scene<'a> {
    handle: ffi::Scene,
    device: &'a Device,
    before: isize,
    buffers: Buffers,
    input: &'a Input,
    /// The scene of the mesh, if this is a scene of its instances, which keep it alive.
    mesh: Option<ffi::Scene>,
}

impl Scene<'_> {
    pub(super) const fn handle(&self) -> ffi::Scene {
        self.handle
    }

    /// Commits a geometry and hands it to the scene.
    fn attach(&self, geometry: ffi::Geometry) {
        // SAFETY: the geometry is valid, here and below.
        unsafe { ffi::rtcCommitGeometry(geometry) };
        // SAFETY: the scene is valid, too.
        unsafe { ffi::rtcAttachGeometry(self.handle, geometry) };
        // SAFETY: as above; the scene keeps its own reference.
        unsafe { ffi::rtcReleaseGeometry(geometry) };
    }

    /// Attaches a geometry for each instance of a mesh.
    fn attach_instances(&self, mesh: ffi::Scene) -> Result<()> {
        for instance in self.input.instances() {
            let geometry = self.device.geometry(ffi::GEOMETRY_TYPE_INSTANCE)?;
            // SAFETY: geometry and scene are valid; the geometry keeps a reference to the scene.
            unsafe { ffi::rtcSetGeometryInstancedScene(geometry, mesh) };
            place(geometry, instance);
            self.attach(geometry);
        }
        Ok(())
    }

    fn commit(&self) -> Result<()> {
        // SAFETY: the scene is valid.
        unsafe { ffi::rtcCommitScene(self.handle) };
        self.device.check()
    }

    /// Builds again, as if all vertices, spheres or instances had moved.
    pub(super) fn rebuild(&self) -> Result<()> {
        // SAFETY: the scene is valid and holds the attached geometries, numbered from 0 on.
        let geometry = |number| unsafe { ffi::rtcGetGeometry(self.handle, number) };
        if self.mesh.is_some() {
            for (number, instance) in (0..).zip(self.input.instances()) {
                let geometry = geometry(number);
                place(geometry, instance);
                // SAFETY: as above.
                unsafe { ffi::rtcCommitGeometry(geometry) };
            }
        } else {
            let geometry = geometry(0);
            if self.input.shown() == Shown::Mesh {
                // SAFETY: as above.
                unsafe { ffi::rtcUpdateGeometryBuffer(geometry, ffi::BUFFER_TYPE_VERTEX, 0) };
            }
            // SAFETY: as above.
            unsafe { ffi::rtcCommitGeometry(geometry) };
        }
        self.commit()
    }

    /// Returns the input.
    pub(super) const fn input(&self) -> &Input {
        self.input
    }

    pub(super) const fn buffers(&self) -> &Buffers {
        &self.buffers
    }

    /// Returns the bytes since the build began.
    pub(super) fn memory(&self) -> Result<Bytes> {
        let Memory { current, peak } = &*self.device.memory;
        let since =
            |bytes: &AtomicIsize| usize::try_from(bytes.load(Relaxed) - self.before).unwrap_or(0);
        let (index, peak) = (since(current), since(peak));
        let untold = self.untold()?;
        Ok(Bytes { index: index + untold, peak: peak + untold })
    }

    /// Returns the bytes of instance geometries that Embree's monitor does not report. Attaches the same
    /// instances to another scene; the bytes are the growth of the C heap beyond what the monitor reports
    /// meanwhile.
    fn untold(&self) -> Result<usize> {
        let Some(mesh) = self.mesh else { return Ok(0) };
        let told = || self.device.memory.current.load(Relaxed);
        let other = self.device.start(self.input, self.mesh, Quality::Low)?;
        let (heap, told_before) = (heap::in_use(), told());
        other.attach_instances(mesh)?;
        let grown = heap::in_use().saturating_sub(heap);
        Ok(grown.saturating_sub(usize::try_from(told() - told_before).unwrap_or(0)))
    }
}

impl Drop for Scene<'_> {
    fn drop(&mut self) {
        // SAFETY: the scene is valid, or null, which Embree refuses with an error code.
        unsafe { ffi::rtcReleaseScene(self.handle) };
    }
}
