//! A blob that ends anywhere: refused, whether its header knows of it or not; and where what is
//! left is a whole blob of fewer words, queries end and `validate` finds what is missing.

use hgrid_core::{Error, Grid, Method};
use hgrid_tests::copy::Copy;
use hgrid_tests::hostile::{Seed, ends, fixed_rays, seeds};
use hgrid_tests::owned::prove;

/// The header's fields for the length of the blob, the words of its lists or its pool, and its nodes.
const BLOB_BYTES: usize = 16;
const REFERENCE_COUNT: usize = 88;
const NODE_COUNT: usize = 112;

/// Returns the header's field that counts the items of the last section, and the bytes of each.
fn last_section(seed: &Seed) -> (usize, usize) {
    if seed.config.method() == Method::Bvh { (NODE_COUNT, 80) } else { (REFERENCE_COUNT, 4) }
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn every_truncation_is_refused() {
    for Seed { mesh, blob, .. } in seeds() {
        let view = mesh.view();
        for length in 0..blob.len() {
            let mut copy = Copy::of(&blob[..length]);
            let error = Grid::open(copy.bytes(), view).map(|_| ()).unwrap_err();
            if length < 8 {
                assert_eq!(error, Error::NotAGrid);
            } else {
                assert!(matches!(error, Error::Truncated { needed_bytes, available_bytes }
                    if needed_bytes > length as u64 && available_bytes == length as u64));
            }
            // A header that says so.
            if length >= 128 {
                copy.set(BLOB_BYTES, &(length as u64).to_ne_bytes());
                copy.sign();
                let error = Grid::open(copy.bytes(), view).map(|_| ()).unwrap_err();
                assert!(matches!(error, Error::Corrupt { .. }), "{length}: {error:?}");
            }
        }
    }
}

/// A blob with its mesh that ends anywhere: whatever its header says of its length,
/// nothing is opened that was not there.
#[test]
#[cfg_attr(miri, ignore = "hours")]
fn every_truncation_of_a_packed_blob_is_refused() {
    for Seed { packed, .. } in seeds() {
        for length in 0..packed.len() {
            let mut copy = Copy::of(&packed[..length]);
            assert!(Grid::open_packed(copy.bytes()).is_err(), "{length}");
            if length >= 128 {
                copy.set(BLOB_BYTES, &(length as u64).to_ne_bytes());
                copy.sign();
                assert!(Grid::open_packed(copy.bytes()).is_err(), "{length}");
            }
        }
    }
}

/// The blob with fewer words or nodes in its last section, and a header that says so. Macrocells, which lie
/// behind, are left out: they are of no number of lists.
fn shortened(seed: &Seed, words: u32) -> Copy {
    let (count_at, size) = last_section(seed);
    let before = Copy::of(&seed.blob).word(count_at) as usize;
    let start = seed.blob.len() - (size * before).next_multiple_of(64);
    let kept = &seed.blob[..start + size * words as usize];
    let length = start + (size * words as usize).next_multiple_of(64);
    let mut bytes = kept.to_vec();
    bytes.resize(length, 0);
    let mut copy = Copy::of(&bytes);
    copy.set(BLOB_BYTES, &(length as u64).to_ne_bytes());
    copy.set_word(count_at, words);
    copy.sign();
    copy
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn fewer_words_than_lists_need_are_found() {
    let mut found = 0;
    for seed in seeds().filter(|seed| seed.config.method() != Method::Fixed) {
        let view = seed.mesh.view();
        let words = Copy::of(&seed.blob).word(last_section(seed).0);
        assert_eq!(shortened(seed, words).bytes(), seed.blob);
        for words in (0..words).step_by((words as usize / 200).max(1)) {
            let copy = shortened(seed, words);
            let grid = Grid::open(copy.bytes(), view).unwrap();
            ends(&grid, &fixed_rays(grid.bounds(), 20));
            let result = prove(&grid);
            assert!(matches!(result, Err(Error::Corrupt { .. })), "{words} words: {result:?}");
            found += 1;
        }
    }
    assert!(found > 1000, "{found}");
}
