//! Do the examples print what they are documented to print?
//!
//! Examples are copied by users, so each has to be right. The ray tracer shares scene, camera and
//! light with the lab, which makes the lab its oracle: the pictures are the same, byte by byte.

mod errors;
mod knot;
mod minimal;
mod pictures;
mod programs;
mod readme;
