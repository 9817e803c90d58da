//! Truncated blobs are refused, even if the header has the new length. Where the rest is a complete blob with
//! fewer words, queries end and `validate` finds the missing ones.

use hgrid_core::{Error, Grid, Method};
use hgrid_tests::copy::Copy;
use hgrid_tests::hostile::{Seed, ends, fixed_rays, seeds};
use hgrid_tests::owned::prove;

/// The offsets of the header's fields for the length of the blob, the words of its lists or its pool, and its nodes.
const BLOB_BYTES: usize = 16;
const REFERENCE_COUNT: usize = 88;
const NODE_COUNT: usize = 112;

/// Returns the offset of the header's field that counts the items of the last section, and the size of an item.
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
            // Give the header the new length.
            if length >= 128 {
                copy.set(BLOB_BYTES, &(length as u64).to_ne_bytes());
                copy.sign();
                let error = Grid::open(copy.bytes(), view).map(|_| ()).unwrap_err();
                assert!(matches!(error, Error::Corrupt { .. }), "{length}: {error:?}");
            }
        }
    }
}

/// Truncations of a blob with its mesh are refused, whatever length the header has.
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

/// Returns the blob with fewer words or nodes in its last section, and a header to match. Fixed grids, whose
/// macrocells come last, are left out: their size does not depend on the number of list words.
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
