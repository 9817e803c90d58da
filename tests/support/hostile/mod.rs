//! Targets of fuzzing: functions of any bytes that panic if the library breaks a promise.
//!
//! `tests/fuzz` feeds them the bytes that a fuzzer invents, `tests/hostile` those that were kept. The types
//! of each target define the meaning of the bytes, through `arbitrary`: most bytes mean something, and
//! missing bytes at the end are zero.
//!
//! A new entry point of the library belongs in `ask`, which queries the grid of every target that has one,
//! and in `c_abi`, which calls it through C.

mod ask;
mod build_mesh;
mod c_abi;
mod c_joined;
mod c_options;
mod c_queries;
mod c_stored;
mod caller;
mod damage;
mod limits;
mod memory;
mod open_query;
mod rays;
mod seeds;
mod shape;
mod validate;

pub use ask::{agrees, ends};
pub use build_mesh::run as build_mesh;
pub use c_abi::{Reached, reach as c_abi_reach, run as c_abi};
pub use damage::Edit;
pub use open_query::run as open_query;
pub use rays::fixed_rays;
pub use seeds::{Seed, nested, seeds};
pub use validate::run as validate;

/// A function that a fuzzer runs, and the folder of its bytes.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// The name of the target and of its folders.
    pub name: &'static str,
    /// The function, which returns true if the bytes lead to a grid that was queried.
    pub run: fn(&[u8]) -> bool,
}

/// All targets.
pub const TARGETS: [Target; 4] = [
    Target { name: "open_query", run: open_query },
    Target { name: "validate", run: validate },
    Target { name: "build_mesh", run: build_mesh },
    Target { name: "c_abi", run: c_abi },
];
