//! Code that the tests which compile and run programs share: symbols of a library, and sizes on a page.

pub mod sizes;
pub mod symbols;
