//! Random mutants of the blobs of all methods: what `validate` accepts answers as brute force does.
//!
//! `HGRID_MUTANTS` sets the number of mutants, `HGRID_SEED` the seed.

use hgrid_core::{Grid, Method};
use hgrid_tests::copy::{CHECKSUM, Copy};
use hgrid_tests::hostile::{Edit, Seed, agrees, fixed_rays, seeds};
use hgrid_tests::owned::prove;
use hgrid_tests::random::Random;
use hgrid_tests::{rounds, setting};

/// Returns a small change: values that the blob has elsewhere, or close to the ones it has. Most such blobs open.
fn edit(random: &mut Random, words: usize) -> Edit {
    let mut at = || random.below(words) as u16;
    let (a, b) = (at(), at());
    // Close words mostly belong to the same section.
    let near = (usize::from(a) + 1 + random.below(8)) % words;
    match random.below(8) {
        0 => Edit::Flip { at: a, bit: random.below(32) as u8 },
        1 => Edit::Add { at: a, by: random.below(9) as i8 - 4 },
        2 => Edit::Set { at: a, word: random.below(64) as u32 },
        3 => Edit::Copy { from: a, to: b, words: 1 + random.below(4) as u8 },
        4 => Edit::Copy { from: a, to: near as u16, words: 1 },
        5 => Edit::Swap { a, b },
        6 => Edit::Swap { a, b: near as u16 },
        _ => Edit::Byte { at: random.below(4 * words) as u32, byte: random.bits() as u8 },
    }
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn accepted_mutants_answer_right() {
    let count = setting("HGRID_MUTANTS", rounds(50_000) as u64);
    let mut random = Random(setting("HGRID_SEED", 1));
    let seeds: Vec<&Seed> = seeds().filter(|seed| seed.blob.len() < 20_000).collect();
    let mut accepted = [0_u64; Method::ALL.len()];
    let (mut opened, mut hits) = ([0; Method::ALL.len()], 0);
    for round in 0..count {
        let which = random.below(seeds.len());
        let seed = seeds[which];
        let mut bytes = seed.blob.clone();
        for _ in 0..1 + random.below(3) {
            edit(&mut random, bytes.len() / 4).apply(&mut bytes);
        }
        let mut copy = Copy::of(&bytes);
        copy.sign();
        if copy.bytes() == seed.blob {
            continue;
        }
        let Ok(grid) = Grid::open(copy.bytes(), seed.mesh.view()) else { continue };
        let method = Method::ALL.iter().position(|&method| method == grid.method()).unwrap();
        opened[method] += 1;
        if prove(&grid).is_err() {
            continue;
        }
        // Shown if the test fails.
        println!("round {round}: {:?} with {} triangles", grid.method(), seed.mesh.indices.len());
        hits += agrees(&grid, &fixed_rays(grid.bounds(), 10));
        // If only the header differs, a build may make the same blob.
        let is_other = copy.bytes()[CHECKSUM + 4..] != seed.blob[CHECKSUM + 4..];
        accepted[method] += u64::from(is_other);
    }
    println!(
        "{count} mutants, {hits} hits; opened, and accepted with other bytes behind the header:"
    );
    for (method, counts) in Method::ALL.iter().zip(opened.iter().zip(accepted)) {
        println!("{method:?}: {counts:?}");
    }
    assert!(opened.iter().sum::<u64>() > count / 2, "{opened:?} of {count} opened");
    assert!(opened.iter().all(|&opened| opened > count / 40), "{opened:?} of {count} opened");
    assert!(accepted.iter().sum::<u64>() > count / 1000, "{accepted:?}");
    assert!(hits as u64 > count / 200, "{hits}");
}
