//! A separate project can use the installed library, and a program with it is as small as documented.
//!
//! `cargo cinstall`, CMake and the archive of `dist/make` install it, from one set of package files.
//! Installing cargo-c takes a quarter of an hour; without it the CMake package is still tried, in a folder
//! laid out by the same list of files.

mod archive;
mod checkout;
mod cmake;
mod crates;
mod imports;
mod installed;
mod pkg_config;
mod prefix;
mod size;
