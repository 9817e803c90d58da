#![no_main]

use hgrid_tests::hostile::open_query;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    open_query(data);
});
