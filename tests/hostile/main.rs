//! Damaged, random and forged bytes.

mod flips;
mod invariants;
mod mutants;
mod random;
mod replay;
mod scenes;
mod truncations;
