//! What takes part: something that builds, and then traces slices of rays into slices of answers.
//!
//! A new peer is one [`System`] with its [`Tracer`]; a new way to trace is one more arm in the
//! [`Tracer`] of a system and one more word in its [`System::modes`].

use anyhow::Result;
use hgrid_core::{Hit, INVALID_ID, Ray};

use super::input::Input;
use super::mode::Mode;
use super::workloads::Workload;

/// Whether an answer is a hit.
#[must_use]
pub const fn is_hit(hit: &Hit) -> bool {
    hit.primitive != INVALID_ID
}

/// Bytes of a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bytes {
    /// What is kept for queries, without the mesh.
    pub index: usize,
    /// The most that there was during the build.
    pub peak: usize,
}

/// What a build is handed to, once it is complete.
pub type Use<'a> = dyn FnMut(&dyn Tracer) -> Result<()> + 'a;

/// Something that builds.
pub trait System {
    /// The name in tables.
    fn name(&self) -> String;

    /// Whether it is not hgrid.
    fn is_peer(&self) -> bool {
        true
    }

    /// The library and its version, if it tells.
    fn version(&self) -> Option<String> {
        None
    }

    /// The ways to trace a workload that make sense.
    fn modes(&self, _: Workload) -> &'static [Mode] {
        &[Mode::Single]
    }

    /// Builds and calls `then` with the structure. What happens before that call is the build.
    ///
    /// # Errors
    /// If it cannot be built, and those of `then`.
    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()>;

    /// Builds, drops, calls `start`, and builds once more in the memory that was kept; then calls
    /// `then`. What happens between the two calls is the rebuild.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    fn rebuild(&self, input: &Input, start: &mut dyn FnMut(), then: &mut Use<'_>) -> Result<()> {
        self.build(input, &mut |_| Ok(()))?;
        start();
        self.build(input, then)
    }
}

/// A structure that is built.
pub trait Tracer {
    /// Closest hits; [`Hit::MISS`] where there is none. Both slices are equally long.
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]);

    /// 1 where there is any hit, 0 where there is none. Both slices are equally long.
    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [u8]);

    /// Its bytes, unless they are all on the heap that the program counts.
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
