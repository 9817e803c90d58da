//! What takes part: something that builds, and then traces slices of rays into slices of answers.
//!
//! A new peer is one [`System`] with its [`Tracer`]; a new way to trace is one more arm in the
//! [`Tracer`] of a system and one more word in its [`System::modes`].

use anyhow::Result;
use hgrid_core::{Hit, INVALID_ID, Ray};
use serde::Serialize;

use super::input::Input;
use super::workloads::Workload;

/// Whether an answer is a hit.
#[must_use]
pub const fn is_hit(hit: &Hit) -> bool {
    hit.primitive != INVALID_ID
}

/// How rays are handed to a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// One after the other.
    Single,
    /// Many in one call, for rays that stay together.
    Coherent,
    /// Many in one call, for rays that do not.
    Incoherent,
}

impl Mode {
    /// The word that tables use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Single => "single",
            Self::Coherent => "coherent",
            Self::Incoherent => "incoherent",
        }
    }
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

    /// The ways to trace a workload that make sense.
    fn modes(&self, _: Workload) -> &'static [Mode] {
        &[Mode::Single]
    }

    /// Builds and calls `then` with the structure. What happens before that call is the build.
    ///
    /// # Errors
    /// If it cannot be built, and those of `then`.
    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()>;
}

/// A structure that is built.
pub trait Tracer {
    /// Closest hits; [`Hit::MISS`] where there is none. Both slices are equally long.
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]);

    /// Whether there is any hit. Both slices are equally long.
    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [bool]);

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
