//! Grid and mesh in one file: the `pack` command.
//!
//! The file is a blob as in core/src/packed/mod.rs, or C source with its bytes: an array that a program for a
//! microcontroller keeps in flash and opens there.

use std::io::{self, BufWriter, Write};

use anyhow::{Context as _, Result};
use hgrid_core::{Config, Grid, TriangleMesh};
use indicatif::HumanCount;

use crate::blob::Blob;
use crate::cli::blob::PackArgs;
use crate::file;
use crate::image::{check_sources, check_writable};
use crate::notices::tell;
use crate::plural::triangles;
use crate::regions::Regions;
use crate::scene::Scene;

/// Bytes in a line of C.
const IN_LINE: usize = 24;

/// Builds, packs and writes the file.
///
/// # Errors
/// If the scene cannot be loaded or built, or the file cannot be written.
pub fn run(args: &PackArgs) -> Result<()> {
    check_sources(&args.output, &args.scene, "blob")?;
    check_writable(&args.output)?;
    let scene = Scene::load(&args.scene)?;
    tell(&scene);
    let cannot = || format!("cannot pack `{}`", args.scene.display());
    let config = args.tuning.config(args.method, args.density);
    let blob = pack(&scene, &config, args.density).with_context(cannot)?;
    file::write(&args.output, |file| match &args.c_array {
        None => file.write_all(blob.bytes()),
        Some(name) => {
            let mut file = BufWriter::new(file);
            write_c(&mut file, name, args.is_header(), &scene.name, blob.bytes())?;
            file.flush()
        }
    })?;
    let bytes = HumanCount(blob.bytes().len() as u64);
    let triangles = triangles(scene.indices.len());
    let (output, method) = (args.output.display(), args.method.name());
    let note = if scene.indices.is_empty() {
        format!("\n`{}` has no triangles: every ray misses", args.scene.display())
    } else {
        String::new()
    };
    writeln!(
        io::stdout(),
        "wrote {output}: {bytes} bytes, a grid by {method} and its mesh of {triangles}{note}"
    )?;
    Ok(())
}

/// Builds a grid of a scene, with the density that was asked for if one was, and writes both into one blob.
fn pack(scene: &Scene, config: &Config, density: Option<f32>) -> Result<Blob> {
    let mesh = TriangleMesh::new(&scene.positions, &scene.indices)?;
    let regions = Regions::build(mesh, config)?;
    let grid = Grid::open(&regions.index, mesh)?;
    Regions::refuse_thinner(&grid, density)?;
    let mut blob = Blob::zeroed(usize::try_from(grid.packed_bytes())?);
    grid.pack(blob.bytes_mut())?;
    Ok(blob)
}

/// Writes bytes as an array of C.
fn write_c(
    out: &mut impl Write,
    name: &str,
    is_header: bool,
    scene: &str,
    bytes: &[u8],
) -> io::Result<()> {
    let order = if cfg!(target_endian = "little") { "little" } else { "big" };
    // A file's name may contain the end of a comment.
    let scene = scene.replace("*/", "* /");
    writeln!(out, "/* {scene}, packed by `hgrid pack` for machines of {order}-endian order:")?;
    writeln!(out, " *   hgrid_open({name}, sizeof {name}, NULL, &grid) */")?;
    writeln!(out, "#include <hgrid.h>\n")?;
    if !is_header {
        // In C++ a constant has internal linkage unless it is declared `extern` first.
        writeln!(out, "extern const unsigned char {name}[{}];", bytes.len())?;
    }
    let linkage = if is_header { "static " } else { "" };
    writeln!(out, "HGRID_ALIGNED {linkage}const unsigned char {name}[{}] = {{", bytes.len())?;
    for line in bytes.chunks(IN_LINE) {
        let line: Vec<_> = line.iter().map(u8::to_string).collect();
        writeln!(out, "{},", line.join(","))?;
    }
    writeln!(out, "}};")
}
