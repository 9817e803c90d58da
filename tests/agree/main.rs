//! Compares every query with brute force, above all at boundaries.

mod arrays;
mod batches;
mod closest;
mod exact;
mod filters;
mod flat;
mod forms;
mod grazing;
mod hits;
mod joined;
mod large;
mod own_shapes;
mod range;
mod refit;
mod scans;
mod scene_batches;
mod scene_builds;
mod scene_filters;
mod scene_surfaces;
mod scenes;
mod snapped;
mod surfaces;
mod ties;
mod watertight;
