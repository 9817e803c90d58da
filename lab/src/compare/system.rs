//! Systems that take part: each builds, and then traces slices of rays into slices of answers.
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
    /// Bytes that are kept for queries, without the mesh.
    pub index: usize,
    /// The most that there was during the build.
    pub peak: usize,
}

/// Receives a build once it is complete.
pub type Use<'a> = dyn FnMut(&dyn Tracer) -> Result<()> + 'a;

/// Something that builds.
pub trait System {
    /// The name in tables.
    fn name(&self) -> String;

    /// Returns true if it is not hgrid.
    fn is_peer(&self) -> bool {
        true
    }

    /// The library and its version, if it tells.
    fn version(&self) -> Option<String> {
        None
    }

    /// The ways to ask for a workload that make sense, on what is shown; none if the
    /// system does not answer it.
    fn modes(&self, workload: Workload, shown: Shown) -> &'static [Mode] {
        if shown == Shown::Mesh { one_by_one(workload) } else { &[] }
    }

    /// Builds and calls `then` with the structure. What happens before that call is the build.
    ///
    /// # Errors
    /// If it cannot be built, and those of `then`.
    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()>;

    /// Builds until that takes no new memory, calls `start`, and builds once more in the memory
    /// that was kept; then calls `then`. What happens between the two calls is the rebuild. Of
    /// instances it is that of the scene alone: the mesh's structure is there before `start`.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    fn rebuild(&self, input: &Input, start: &mut dyn FnMut(), then: &mut Use<'_>) -> Result<()> {
        rebuild_anew(self, input, start, then)
    }
}

/// The modes of a system that takes one ray a call, and no points.
#[must_use]
pub const fn one_by_one(workload: Workload) -> &'static [Mode] {
    if workload.asks_points() { &[] } else { &[Mode::Single] }
}

/// A rebuild by a system that keeps no more than its heap.
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

/// Builds before a rebuild, at most.
const WARM_UPS: u32 = 4;

/// Pages that a build may touch for the first time and still be one in memory that was kept.
const FEW_PAGES: u64 = 16;

/// Builds again and again, until that touches no new pages.
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

/// A structure that is built.
pub trait Tracer {
    /// Closest hits; [`Hit::MISS`] where there is none. Both slices are equally long.
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]);

    /// 1 where there is any hit, 0 where there is none. Both slices are equally long.
    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [u8]);

    /// Distances to the closest points of the surface; infinite where none is in the radius. Both
    /// slices are equally long.
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
