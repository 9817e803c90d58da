//! Odd meshes, odd rays, odd numbers and damaged bytes.

mod blobs;
mod bounds;
mod format;
mod format_scenes;
mod inputs;
mod joined;
mod mixed;
mod packed;
mod printed;
mod progress;
mod rays;
mod scene_bounds;
mod scenes;
mod shapes;
