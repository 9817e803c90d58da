//! The compared systems: each builds, and then traces slices of rays into slices of answers.
//!
//! A new peer is one [`System`] with its [`Tracer`]; a new way to trace is one more arm in the
//! [`Tracer`] of a system and one more word in its [`System::modes`].

use anyhow::Result;
use hgrid_core::{Hit, INVALID_ID, Ray};

use super::input::Input;
use super::mode::Mode;
use super::samples::Watch;
use super::shown::Shown;
use super::workloads::Workload;

/// Returns true if an answer is a hit.
#[must_use]
pub const fn is_hit(hit: &Hit) -> bool {
    hit.primitive != INVALID_ID
}

/// Bytes of a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bytes {
    /// Bytes that queries need, without the mesh.
    pub index: usize,
    /// The most bytes during the build.
    pub peak: usize,
}

/// A function that receives a complete build.
pub type Use<'a> = dyn FnMut(&dyn Tracer) -> Result<()> + 'a;

/// A way to build a structure.
pub trait System {
    /// Returns the name in tables.
    fn name(&self) -> String;

    /// Returns true if it is not hgrid.
    fn is_peer(&self) -> bool {
        true
    }

    /// Returns the library and its version, if known.
    fn version(&self) -> Option<String> {
        None
    }

    /// Returns the useful modes of a workload on what is shown; none if the system cannot answer it.
    fn modes(&self, workload: Workload, shown: Shown) -> &'static [Mode] {
        if shown == Shown::Mesh { one_by_one(workload) } else { &[] }
    }

    /// Builds and calls `then` with the structure. The time before that call is the time of the build.
    ///
    /// # Errors
    /// If it cannot be built, and those of `then`.
    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()>;

    /// Builds until a build takes no new memory, calls `start`, builds once more in the kept memory, and
    /// calls `then`. The time between the two calls is that of the rebuild. For instances it is that of the
    /// scene alone: the mesh's structure exists before `start`.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    fn rebuild(&self, input: &Input, start: &mut dyn FnMut(), then: &mut Use<'_>) -> Result<()> {
        rebuild_anew(self, input, start, then)
    }
}

/// Returns the modes of a system that takes one ray a call, and no points.
#[must_use]
pub const fn one_by_one(workload: Workload) -> &'static [Mode] {
    if workload.asks_points() { &[] } else { &[Mode::Single] }
}

/// Rebuilds with a system that keeps nothing but its heap.
///
/// # Errors
/// The errors of its builds.
pub fn rebuild_anew(
    system: &(impl System + ?Sized),
    input: &Input,
    start: &mut dyn FnMut(),
    then: &mut Use<'_>,
) -> Result<()> {
    warm_up(|| system.build(input, &mut |_| Ok(())))?;
    start();
    system.build(input, then)
}

/// The largest number of builds before a rebuild.
const WARM_UPS: u32 = 4;

/// The most pages that a build in kept memory may touch for the first time.
const FEW_PAGES: u64 = 16;

/// Builds repeatedly, until a build touches hardly any new pages.
///
/// # Errors
/// The errors of a build.
pub fn warm_up(mut build: impl FnMut() -> Result<()>) -> Result<()> {
    for _ in 0..WARM_UPS {
        let watch = Watch::start();
        build()?;
        let (_, faults) = watch.stop();
        if faults.is_some_and(|faults| faults <= FEW_PAGES) {
            break;
        }
    }
    Ok(())
}

/// A complete structure.
pub trait Tracer {
    /// Finds closest hits; [`Hit::MISS`] for a ray without one. Both slices are equally long.
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]);

    /// Writes 1 for a ray with any hit, 0 for a ray with none. Both slices are equally long.
    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [u8]);

    /// Finds distances to the closest points of the surface; infinite if none is in the radius. Both slices
    /// are equally long.
    fn closest_points(&self, _points: &[[f32; 3]], _radius: f32, distances: &mut [f32]) {
        distances.fill(f32::INFINITY);
    }

    /// Returns its bytes, unless they are all on the heap that the program counts.
    ///
    /// # Errors
    /// If they cannot be counted.
    fn bytes(&self) -> Result<Option<Bytes>> {
        Ok(None)
    }
}

/// Answers rays one by one.
pub fn each<T>(rays: &[Ray], answers: &mut [T], mut answer: impl FnMut(&Ray) -> T) {
    for (ray, place) in rays.iter().zip(answers) {
        *place = answer(ray);
    }
}
