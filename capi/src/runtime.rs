//! The functions that compiled code asks of a language's runtime, so that the static library links alone.
//!
//! Where the processor cannot divide, the compiler calls functions that come with the library. Those of
//! Rust were compiled for programs that unwind, and ask for `rust_eh_personality`, which is in std. Those
//! of 32-bit ARM are assembly with names that libgcc has, too.

// Nothing unwinds through this library, so nothing calls it: it only has to have an address.
//
// A release build needs it where 64 bits are divided by a function, a debug build everywhere. It is weak
// and hidden: a program that links other libraries in Rust has one of theirs.
#[cfg(all(
    any(debug_assertions, target_pointer_width = "32"),
    unix,
    not(target_vendor = "apple"),
    any(
        target_arch = "aarch64",
        target_arch = "arm",
        target_arch = "riscv32",
        target_arch = "riscv64",
        target_arch = "x86",
        target_arch = "x86_64"
    )
))]
core::arch::global_asm!(
    ".pushsection .text.rust_eh_personality",
    ".weak rust_eh_personality",
    ".hidden rust_eh_personality",
    ".p2align 2",
    "rust_eh_personality:",
    ".long 0",
    ".popsection",
);

/// The same where Rust 1.89 has no assembly or the object format has no weak symbols.
#[cfg(all(
    any(debug_assertions, target_pointer_width = "32"),
    any(unix, all(windows, target_env = "gnu")),
    any(
        target_vendor = "apple",
        windows,
        not(any(
            target_arch = "aarch64",
            target_arch = "arm",
            target_arch = "riscv32",
            target_arch = "riscv64",
            target_arch = "x86",
            target_arch = "x86_64"
        ))
    )
))]
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

/// The divisions of 32-bit ARM, under names that nobody outside this object sees. (Rust's own take in
/// assembly whose names libgcc has, too: a program that is linked statically would have both.)
#[cfg(all(target_arch = "arm", target_endian = "little", unix))]
mod arm {
    use crate::division::{divide, divide_signed};

    // The quotient comes in r0 or in r0 and r1, the rest in the next one or the next two.
    core::arch::global_asm!(
        ".pushsection .text.hgrid_division, \"ax\", %progbits",
        ".p2align 2",
        "__aeabi_uidiv:",
        "b {quotient}",
        "__aeabi_uidivmod:",
        "b {both}",
        "__aeabi_idiv:",
        "__aeabi_idivmod:",
        "b {both_signed}",
        "__aeabi_uldivmod:",
        "push {{r4, lr}}",
        "sub sp, sp, #16",
        "add r12, sp, #8",
        "str r12, [sp]",
        "bl {long}",
        "b 2f",
        "__aeabi_ldivmod:",
        "push {{r4, lr}}",
        "sub sp, sp, #16",
        "add r12, sp, #8",
        "str r12, [sp]",
        "bl {long_signed}",
        "2:",
        "ldr r2, [sp, #8]",
        "ldr r3, [sp, #12]",
        "add sp, sp, #16",
        "pop {{r4, pc}}",
        ".popsection",
        quotient = sym quotient,
        both = sym both,
        both_signed = sym both_signed,
        long = sym long,
        long_signed = sym long_signed,
    );

    /// The lower half in r0, the upper one in r1.
    #[expect(clippy::cast_possible_truncation, reason = "both are no larger than the dividend")]
    fn pair([quotient, rest]: [u64; 2]) -> u64 {
        u64::from(quotient as u32) | u64::from(rest as u32) << 32
    }

    #[expect(clippy::cast_possible_truncation, reason = "the lower half")]
    extern "C" fn quotient(dividend: u32, divisor: u32) -> u32 {
        both(dividend, divisor) as u32
    }

    extern "C" fn both(dividend: u32, divisor: u32) -> u64 {
        pair(divide(dividend.into(), divisor.into()))
    }

    extern "C" fn both_signed(dividend: i32, divisor: i32) -> u64 {
        pair(divide_signed(dividend.into(), divisor.into()).map(i64::cast_unsigned))
    }

    extern "C" fn long(dividend: u64, divisor: u64, to: &mut u64) -> u64 {
        let [quotient, rest] = divide(dividend, divisor);
        *to = rest;
        quotient
    }

    extern "C" fn long_signed(dividend: i64, divisor: i64, to: &mut i64) -> i64 {
        let [quotient, rest] = divide_signed(dividend, divisor);
        *to = rest;
        quotient
    }
}
