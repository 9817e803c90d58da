//! Bytes that somebody chose to do harm.

mod flips;
mod invariants;
mod mutants;
mod random;
mod replay;
mod scenes;
mod truncations;
