//! Grid and mesh in one file: the `pack` command.
//!
//! The file is a blob as in core/src/packed/mod.rs, or C source with its bytes: an array that a program for a
//! microcontroller keeps in flash and opens there.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use hgrid_core::{Config, Grid, Parameters, TriangleMesh};
use indicatif::HumanCount;

use crate::blob::Blob;
use crate::cli::blob::PackArgs;
use crate::image::{check_sources, check_writable};
use crate::plural::triangles;
use crate::regions::Regions;
use crate::scene::Scene;
use crate::scene::format::Format;

/// Bytes in a line of C.
const IN_LINE: usize = 24;

/// Builds, packs and writes the file.
///
/// # Errors
/// If the scene cannot be loaded or built, or the file cannot be written.
pub fn run(args: &PackArgs) -> Result<()> {
    check(args)?;
    check_sources(&args.output, &args.scene, "blob")?;
    check_writable(&args.output)?;
    let scene = Scene::load(&args.scene)?;
    let cannot = || format!("cannot pack `{}`", args.scene.display());
    let config = args.tuning.config(args.method, args.density);
    let blob = pack(&scene, &config).with_context(cannot)?;
    let written = match &args.c_array {
        None => fs::write(&args.output, blob.bytes()),
        Some(name) => File::create(&args.output).and_then(|file| {
            let is_header =
                args.output.extension().is_some_and(|ending| ending == "h" || ending == "hpp");
            let mut file = BufWriter::new(file);
            write_c(&mut file, name, is_header, &scene.name, blob.bytes())?;
            file.flush()
        }),
    };
    written.with_context(|| format!("cannot write `{}`", args.output.display()))?;
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

/// Refuses options without effect, and output names that are those of other formats.
fn check(args: &PackArgs) -> Result<()> {
    let (method, output) = (args.method, args.output.display());
    ensure!(
        args.density.is_none() || Parameters::new(method).density().is_some(),
        "--density is not for {}, which has none: name another --method, or leave it out",
        method.name()
    );
    args.tuning.check("--method", &[method])?;
    let is_mesh = Format::named(&args.output).is_some_and(|format| format != Format::Blob);
    ensure!(!is_mesh, "`{output}` would be a mesh by its name: name a file like x.hgrid or x.c");
    let pictures = ["png", "jpg", "jpeg", "svg", "gif", "webp", "bmp", "ppm", "exr", "hdr"];
    let is_picture = args
        .output
        .extension()
        .is_some_and(|ending| pictures.iter().any(|picture| ending.eq_ignore_ascii_case(picture)));
    ensure!(
        !is_picture,
        "`{output}` would be a picture by its name: name a file like x.hgrid, or draw one with \
         hgrid render"
    );
    let is_source = |path: &Path| {
        let endings = ["c", "h", "cpp", "hpp", "cc"];
        path.extension().is_some_and(|ending| endings.iter().any(|source| ending == *source))
    };
    match &args.c_array {
        None => {
            ensure!(!is_source(&args.output), "`{output}` is C by its name: add --c-array NAME");
        }
        Some(name) => {
            ensure!(
                is_source(&args.output),
                "`{output}` is not C by its name: name a file like x.c"
            );
            ensure!(is_identifier(name), "`{name}` is no name in C: take letters, digits and _");
            ensure!(!is_reserved(name), "`{name}` has a meaning in C or C++: take another name");
        }
    }
    Ok(())
}

fn is_identifier(name: &str) -> bool {
    let is_word = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    is_word && name.bytes().next().is_some_and(|first| !first.is_ascii_digit())
}

/// The words of C and C++ that can be no names, and the function that every program has.
const RESERVED: &str = "\
    _Alignas _Alignof _Atomic _BitInt _Bool _Complex _Decimal128 _Decimal32 _Decimal64 _Generic _Imaginary \
    _Noreturn _Static_assert _Thread_local alignas alignof and and_eq asm auto bitand bitor bool break case \
    catch char char16_t char32_t char8_t class co_await co_return co_yield compl concept const const_cast \
    consteval constexpr constinit continue decltype default delete do double dynamic_cast else enum explicit \
    export extern false float for friend goto if inline int long main mutable namespace new noexcept not \
    not_eq nullptr operator or or_eq private protected public register reinterpret_cast requires restrict \
    return short signed sizeof static static_assert static_cast struct switch template this thread_local \
    throw true try typedef typeid typename typeof typeof_unqual union unsigned using virtual void volatile \
    wchar_t while xor xor_eq";

fn is_reserved(name: &str) -> bool {
    RESERVED.split(' ').any(|word| word == name)
}

/// Builds a grid of a scene and writes both into one blob.
fn pack(scene: &Scene, config: &Config) -> Result<Blob> {
    let mesh = TriangleMesh::new(&scene.positions, &scene.indices)?;
    let regions = Regions::build(mesh, config)?;
    let grid = Grid::open(&regions.index, mesh)?;
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
