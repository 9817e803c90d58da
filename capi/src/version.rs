//! The identity of the library: its version, which is that of `Cargo.toml` (checked here), and its methods.

use core::ffi::{CStr, c_char};

use hgrid_core::Method;

/// Raised when programs must change to go on working.
pub const HGRID_VERSION_MAJOR: u32 = 0;

/// Raised when something was added. While the major version is 0, it may also break programs.
pub const HGRID_VERSION_MINOR: u32 = 1;

/// Raised when something was repaired.
pub const HGRID_VERSION_PATCH: u32 = 0;

/// The three numbers as one that can be compared.
pub const HGRID_VERSION: u32 =
    HGRID_VERSION_MAJOR << 16 | HGRID_VERSION_MINOR << 8 | HGRID_VERSION_PATCH;

/// The package's version with the zero that C wants behind it.
pub(crate) const VERSION: &CStr =
    match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(version) => version,
        Err(_) => c"",
    };

const _: () = {
    let package = [
        env!("CARGO_PKG_VERSION_MAJOR"),
        env!("CARGO_PKG_VERSION_MINOR"),
        env!("CARGO_PKG_VERSION_PATCH"),
    ];
    assert!(matches!(u32::from_str_radix(package[0], 10), Ok(HGRID_VERSION_MAJOR)));
    assert!(matches!(u32::from_str_radix(package[1], 10), Ok(HGRID_VERSION_MINOR)));
    assert!(matches!(u32::from_str_radix(package[2], 10), Ok(HGRID_VERSION_PATCH)));
};

/// The version of the library that is linked, to be compared with the `HGRID_VERSION` of the header
/// that was compiled against.
///
/// Threads: any number of calls at once.
#[unsafe(no_mangle)]
pub const extern "C" fn hgrid_version() -> u32 {
    HGRID_VERSION
}

/// The version of the library that is linked, as text: never NULL, static.
///
/// Threads: any number of calls at once.
#[unsafe(no_mangle)]
pub const extern "C" fn hgrid_version_string() -> *const c_char {
    VERSION.as_ptr()
}

/// Tells whether the linked library has a method, `HGRID_METHOD_ONE_LEVEL` and so on; false for a number
/// that is no method.
///
/// It has all of them unless it was built with fewer, to be smaller: `cargo build --release -p
/// hgrid-capi --no-default-features --features one-level`, say.
///
/// Threads: any number of calls at once.
#[unsafe(no_mangle)]
pub const extern "C" fn hgrid_has_method(method: u32) -> bool {
    matches!(Method::from_u32(method), Some(method) if method.is_available())
}
