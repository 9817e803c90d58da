#![no_main]

use hgrid_tests::hostile::c_abi;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    c_abi(data);
});
