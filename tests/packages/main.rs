//! Does what is installed serve a stranger's project, and is it as small as it is said to be?
//!
//! `cargo cinstall`, CMake and the archive of `dist/make` install it, from one set of package files.
//! cargo-c takes a quarter of an hour to get: without it the CMake package is still tried, in a folder
//! that is laid out by the same list of files.

mod archive;
mod checkout;
mod cmake;
mod crates;
mod imports;
mod installed;
mod pkg_config;
mod prefix;
mod size;
