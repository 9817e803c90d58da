//! The end of a program at a failed assertion: debug builds where there is a C library to end it with.

use core::ffi::{c_int, c_void};
use core::fmt::{self, Write};
use core::panic::PanicInfo;

#[cfg(unix)]
unsafe extern "C" {
    fn write(file: c_int, bytes: *const c_void, count: usize) -> isize;
    fn abort() -> !;
}

#[cfg(windows)]
unsafe extern "C" {
    fn _write(file: c_int, bytes: *const c_void, count: core::ffi::c_uint) -> c_int;
    fn abort() -> !;
}

/// The number of stderr.
const STDERR: c_int = 2;

struct Stderr;

impl Write for Stderr {
    /// Writes what it can: a program that is about to end has no use for an error.
    #[cfg(unix)]
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // SAFETY: a text is so many readable bytes.
        unsafe { write(STDERR, text.as_ptr().cast(), text.len()) };
        Ok(())
    }

    /// Writes what it can: a program that is about to end has no use for an error.
    #[cfg(windows)]
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let count = text.len().try_into().unwrap_or(0);
        // SAFETY: a text is so many readable bytes.
        unsafe { _write(STDERR, text.as_ptr().cast(), count) };
        Ok(())
    }
}

/// Says what is wrong and aborts, so that a debugger shows the call.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    let message = info.message();
    // The program ends in any case.
    let _ = match info.location() {
        Some(place) => writeln!(Stderr, "hgrid: {message} ({}:{})", place.file(), place.line()),
        None => writeln!(Stderr, "hgrid: {message}"),
    };
    // SAFETY: the C library's function takes nothing and does not return.
    unsafe { abort() }
}
