//! What happens at the edges: odd meshes, odd rays, odd numbers, damaged bytes?

mod blobs;
mod bounds;
mod bricks;
mod chunks;
mod inputs;
mod packed;
mod progress;
mod rays;
mod shapes;
