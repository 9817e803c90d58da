//! Another library for C written in Rust without std, as another vendor might ship it: with a panic handler
//! and with code that may panic. It is no part of these tests; one of them compiles it.
#![no_std]

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// Returns the sum of some numbers divided by another number, in arithmetic that needs the compiler's own library.
///
/// # Safety
/// There are `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vendor_mean(numbers: *const u64, count: usize) -> u64 {
    // SAFETY: the caller promises that there are `count` numbers.
    let numbers = unsafe { core::slice::from_raw_parts(numbers, count) };
    let mut sum = 0_u128;
    for index in 0..count {
        sum += u128::from(numbers[index]);
    }
    (sum / count as u128).try_into().expect("no more than the largest")
}
