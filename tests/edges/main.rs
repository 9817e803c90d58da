//! What happens at the edges: odd meshes, odd rays, odd numbers, damaged bytes?

mod blobs;
mod bounds;
mod format;
mod inputs;
mod joined;
mod mixed;
mod packed;
mod printed;
mod progress;
mod rays;
mod scenes;
mod shapes;
