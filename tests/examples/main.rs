//! The examples print and draw what they are documented to.
//!
//! Users copy the examples, so each has to be right. The ray tracer has the scene, camera and light of the
//! lab, so the lab is its oracle: the pictures are the same, byte by byte.

mod cost;
mod errors;
mod heat;
mod hpp;
mod knot;
mod mapped;
mod minimal;
mod mpi;
mod pictures;
mod ppm;
mod programs;
mod progress;
mod readme;
mod scenes;
mod shading;
mod threads;
