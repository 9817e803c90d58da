//! Does every query agree with brute force, at the boundaries above all?

mod batches;
mod closest;
mod exact;
mod filters;
mod forms;
mod hits;
mod range;
mod refit;
mod scans;
mod snapped;
mod surfaces;
mod watertight;
