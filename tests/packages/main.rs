//! Does what is installed serve a stranger's project, and is it as small as it is said to be?
//!
//! `cargo cinstall` installs, and it takes a quarter of an hour to get. Where it is not, the CMake
//! package is still tried, in a folder that is laid out by the same list of files.

mod cmake;
mod crates;
mod installed;
mod pkg_config;
mod prefix;
mod size;
