//! The C ABI of hgrid.
//!
//! Every function checks what it was given, calls core, and writes the answer. The docs of all that
//! is public are the text of `include/hgrid.h`, which a test makes with cbindgen: they are written
//! for C readers, and the header's own head (in `cbindgen.toml`) holds the rules for pointers,
//! structs and threads that they rely on. `build`, `query`, `batch`, `blob`, `shapes`, `scene`, `scene_path`,
//! `scene_surface`, `scene_batch`, `box_of`, `status` and `version` hold the functions, `types`, `query_types` and
//! `blob_types` the structs, and `raw` every use of a caller's pointer.
//!
//! This package allocates nothing, starts no thread, and has no panic that a caller could reach; a test looks in the
//! library for symbols of these. Its only state is a byte in which core remembers which vector instructions the
//! processor has. Debug builds panic at the mistakes in `misuse`.
//!
//! The feature `malloc` adds the module `create`, which does allocate: it gets memory from the caller's
//! allocator or the system's, and keeps the pointers to it.
#![no_std]

// The modules that C sees, in the order of the header.
mod types;

mod query_types;

mod blob_types;

mod build;

mod query;

mod batch;

mod blob;

mod shapes;

mod scene;

mod scene_path;

mod scene_surface;

mod scene_batch;

mod box_of;

#[cfg(feature = "malloc")]
mod create;

mod status;

mod version;

// The modules behind them.
mod addresses;
#[cfg(all(target_arch = "arm", target_endian = "little", unix))]
mod division;
mod input;
mod misuse;
mod raw;
#[cfg(not(feature = "rlib"))]
mod runtime;
#[cfg(all(not(feature = "rlib"), debug_assertions, any(unix, windows)))]
mod stop;
#[cfg(feature = "malloc")]
mod system;

pub use crate::batch::*;
pub use crate::blob::*;
pub use crate::blob_types::*;
pub use crate::box_of::*;
pub use crate::build::*;
#[cfg(feature = "malloc")]
pub use crate::create::*;
pub use crate::query::*;
pub use crate::query_types::*;
pub use crate::scene::*;
pub use crate::scene_batch::*;
pub use crate::scene_path::*;
pub use crate::scene_surface::*;
pub use crate::shapes::*;
pub use crate::status::*;
pub use crate::types::*;
pub use crate::version::*;

#[cfg(all(not(feature = "rlib"), not(doc), panic = "unwind"))]
compile_error!(
    "the library cannot unwind: build it in its own folder, whose .cargo/config.toml says abort, or in the \
     workspace with --release"
);

/// Nothing in a release build of this library or of core panics, so link-time optimisation drops this again. A debug
/// build without a C library stays here at a failed assertion; others have the handler in `stop`.
#[cfg(not(any(feature = "rlib", all(debug_assertions, any(unix, windows)))))]
#[panic_handler]
const fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
