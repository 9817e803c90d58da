//! Do the examples print and draw what they are documented to?
//!
//! Examples are copied by users, so each has to be right. The ray tracer shares scene, camera and
//! light with the lab, which makes the lab its oracle: the pictures are the same, byte by byte.

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
