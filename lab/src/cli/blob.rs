//! The arguments of `hgrid info`, `hgrid pack` and `hgrid validate`.

use std::ffi::OsString;
use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::Parser;
use hgrid_core::{Method, Parameters};

use super::Tuning;
use super::values::{density, method_parser, output_parser};

/// The endings of files with C source.
const SOURCES: [&str; 5] = ["c", "h", "cpp", "hpp", "cc"];

/// The endings of blobs, which may have none.
const BLOBS: [&str; 2] = ["hgrid", "bin"];

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
    /// The file to write: x.hgrid, x.bin or a name without an ending; with --c-array, x.c, .h, .cpp, .hpp or .cc
    #[arg(short, long, value_name = "FILE", value_parser = output_parser())]
    pub output: PathBuf,
    /// Write C: an array of this name, aligned as `hgrid_open` wants it
    #[arg(long, value_name = "NAME")]
    pub c_array: Option<String>,
    /// The structure to build
    #[arg(long, value_parser = method_parser(), default_value = Method::default().name())]
    pub method: Method,
    /// Cells per triangle, for other methods than bvh, a number above 0 [default: the paper's for the method]
    #[arg(long, value_name = "CELLS", allow_negative_numbers = true, value_parser = density)]
    pub density: Option<f32>,
    #[expect(missing_docs, reason = "a doc would become the help of all its options")]
    #[command(flatten)]
    pub tuning: Tuning,
}

impl PackArgs {
    /// Refuses options without effect, and output names that are those of other formats.
    ///
    /// # Errors
    /// If there is one; the message says what to write instead.
    pub fn check(&self) -> Result<()> {
        let (method, output) = (self.method, self.output.display());
        ensure!(
            self.density.is_none() || Parameters::new(method).density().is_some(),
            "--density is not for {}, which has none: name another --method, or leave it out",
            method.name()
        );
        self.tuning.check("--method", &[method])?;
        match &self.c_array {
            None => {
                let is_source = self.has_ending(&SOURCES);
                ensure!(!is_source, "`{output}` is C by its name: add --c-array NAME");
                ensure!(
                    self.output.extension().is_none() || self.has_ending(&BLOBS),
                    "`{output}` would be no blob by its name: name a file like x.hgrid or x.bin"
                );
            }
            Some(name) => {
                ensure!(
                    self.has_ending(&SOURCES),
                    "`{output}` is not C by its name: name a file like x.c"
                );
                ensure!(
                    is_identifier(name),
                    "`{name}` is no name in C: take letters, digits and _"
                );
                let is_free = !is_reserved(name);
                ensure!(
                    is_free,
                    "`{name}` is a name of C, C++ or hgrid.h, or may become one: take another"
                );
            }
        }
        Ok(())
    }

    /// Returns true if the output is a C or C++ header by its name.
    #[must_use]
    pub fn is_header(&self) -> bool {
        self.has_ending(&["h", "hpp"])
    }

    fn has_ending(&self, endings: &[&str]) -> bool {
        let ending = self.output.extension();
        ending.is_some_and(|ending| endings.iter().any(|known| ending.eq_ignore_ascii_case(known)))
    }
}

fn is_identifier(name: &str) -> bool {
    let is_word = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    is_word && name.bytes().next().is_some_and(|first| !first.is_ascii_digit())
}

/// The words of C and C++ that can be no names, the function that every program has, and macros of compilers and of
/// stddef.h.
const RESERVED: &str = "\
    _Alignas _Alignof _Atomic _BitInt _Bool _Complex _Decimal128 _Decimal32 _Decimal64 _Generic _Imaginary \
    _Noreturn _Static_assert _Thread_local alignas alignof and and_eq asm auto bitand bitor bool break case \
    catch char char16_t char32_t char8_t class co_await co_return co_yield compl concept const const_cast \
    consteval constexpr constinit continue decltype default delete do double dynamic_cast else enum explicit \
    export extern false float for friend goto if inline int long main mutable namespace new noexcept not \
    not_eq nullptr operator or or_eq private protected public register reinterpret_cast requires restrict \
    return short signed sizeof static static_assert static_cast struct switch template this thread_local \
    throw true try typedef typeid typename typeof typeof_unqual union unsigned using virtual void volatile \
    wchar_t while xor xor_eq NULL linux unix";

/// Returns true for words of the language, and for names that hgrid.h or the system has or may have one day.
fn is_reserved(name: &str) -> bool {
    let is_of_header = ["hgrid_", "HGRID_", "__"].iter().any(|start| name.starts_with(start));
    let is_of_stdint = ["_t", "_MAX", "_MIN", "_WIDTH"].iter().any(|end| name.ends_with(end));
    is_of_header || is_of_stdint || RESERVED.split(' ').any(|word| word == name)
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
