//! The parts of hgrid that need an operating system: scenes, pictures, measurements.
//!
//! The binary `hgrid` is a thin layer over these modules. Tests and benches use the same scenes and the same
//! camera, so that numbers and pictures are always about the same rays.
//!
//! ```text
//! scene -> render: a picture, by all threads
//!       -> pack: grid and mesh in a file; info and validate look at such files
//!       -> measure (hgrid_core::Grid, tiles, shade) -> table: the paper's Table 1
//!                                                   '-> figures: its charts, by plot
//!       -> animate: the mesh deformed, built and rendered frame after frame, alone or as a field of instances
//!       -> compare: hgrid and other structures, over the same rays
//! results in JSON -> pages: the tables and charts of README.md and docs/
//! ```

#![deny(unsafe_code)]

extern crate alloc;

pub mod animate;
pub mod blob;
pub mod camera;
pub mod cli;
pub mod compare;
pub mod field;
pub mod figures;
mod file;
pub mod heat;
pub mod image;
pub mod info;
pub mod light;
pub mod machine;
pub mod measure;
pub mod notices;
pub mod pack;
pub mod pages;
mod plot;
mod plural;
pub mod progress;
mod regions;
pub mod render;
pub mod resident;
pub mod scene;
pub mod shade;
pub mod table;
pub mod threads;
pub mod tiles;
pub mod validate;
mod vector;
pub mod world;
