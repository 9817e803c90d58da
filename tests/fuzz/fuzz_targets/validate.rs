#![no_main]

use hgrid_tests::hostile::validate;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    validate(data);
});
