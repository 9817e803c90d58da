//! Everything about hgrid that needs an operating system: scenes, pictures, measurements.
//!
//! The binary `hgrid` is a thin layer over these modules; tests and benches use the same scenes
//! and the same camera, so that a number and a picture always speak of the same rays.
//!
//! ```text
//! scene -> hgrid_core::Grid -> render (camera, shade) -> image
//!                                   '-> figures: a table, or JSON
//! ```

pub mod camera;
pub mod cli;
pub mod figures;
pub mod image;
pub mod progress;
pub mod render;
pub mod scene;
pub mod shade;
mod vector;
