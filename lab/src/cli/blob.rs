//! The arguments of `hgrid info`, `hgrid pack` and `hgrid validate`.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Parser;
use hgrid_core::Method;

use super::{Tuning, method_parser};

/// The arguments of `hgrid info`.
#[derive(Debug, Parser)]
pub struct InfoArgs {
    /// A mesh file, a blob or procedural:NAME:TRIANGLES
    pub file: OsString,
    /// Print the facts as a JSON object
    #[arg(long)]
    pub json: bool,
}

/// The arguments of `hgrid pack`.
#[derive(Debug, Parser)]
pub struct PackArgs {
    /// A mesh file or procedural:NAME:TRIANGLES
    pub scene: OsString,
    /// The file to write
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Write C: an array of this name, aligned as `hgrid_open` wants it
    #[arg(long, value_name = "NAME")]
    pub c_array: Option<String>,
    /// The structure to build
    #[arg(long, value_parser = method_parser(), default_value = Method::default().name())]
    pub method: Method,
    /// Cells per triangle, for other methods than bvh [default: the paper's for the method]
    #[arg(long, value_name = "CELLS", allow_negative_numbers = true)]
    pub density: Option<f32>,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub tuning: Tuning,
}

/// The arguments of `hgrid validate`.
#[derive(Debug, Parser)]
pub struct ValidateArgs {
    /// A blob, as `hgrid pack` writes it, `hgrid_pack` in C or `Grid::pack` in Rust
    pub blob: PathBuf,
    /// The mesh that a blob without one was built for
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<OsString>,
}
