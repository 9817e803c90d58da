//! What do bytes do that somebody chose to do harm?

mod flips;
mod invariants;
mod replay;
mod truncations;
