//! Another library for C written in Rust without std, as another vendor ships it: with a panic
//! handler and with code that may panic. Not a part of these tests but compiled by one of them.
#![no_std]

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// The sum of some numbers over another number, in arithmetic that
/// needs the compiler's own library.
///
/// # Safety
/// There are `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vendor_mean(numbers: *const u64, count: usize) -> u64 {
    // SAFETY: the caller's promise.
    let numbers = unsafe { core::slice::from_raw_parts(numbers, count) };
    let mut sum = 0_u128;
    for index in 0..count {
        sum += u128::from(numbers[index]);
    }
    (sum / count as u128).try_into().expect("no more than the largest")
}
