#![no_main]

use hgrid_tests::hostile::build_mesh;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    build_mesh(data);
});
