//! Random mutants of the blobs of all methods: what `validate` accepts answers as brute force does.
//!
//! `HGRID_MUTANTS` sets the number of mutants, `HGRID_SEED` the seed.

use hgrid_core::{Config, Grid, Method, Parameters, Quality, Ray, refit};
use hgrid_tests::copy::{CHECKSUM, Copy};
use hgrid_tests::hostile::{Edit, Seed, agrees, ends, fixed_rays, seeds};
use hgrid_tests::meshes::{Mesh, room_with};
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

/// Offsets in the header of a tree (docs/format.md), and the sizes of a node and of its fine sides.
const SIDES_COUNT: usize = 84;
const ID_COUNT: usize = 88;
const NODE_COUNT: usize = 112;
const HEADER: usize = 128;
const NODE: usize = 80;
const FINE: usize = 196;

/// Returns rays from anywhere to anywhere on triangles, half of them to corners.
fn rays_to(mesh: &Mesh, random: &mut Random) -> Vec<Ray> {
    let ray = |number: usize| {
        let triangle = mesh.indices[random.below(mesh.indices.len())];
        let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
        let (u, v) = (random.unit(), random.unit());
        let inside = std::array::from_fn(|k| a[k] + (b[k] - a[k]) * u + (c[k] - b[k]) * u * v);
        let to = if number.is_multiple_of(2) { a } else { inside };
        let from = random.point().map(|c| c * [0.9, 3.0][number / 2 % 2]);
        Ray::new(from, std::array::from_fn(|k| to[k] - from[k]))
    };
    (0..12).map(ray).collect()
}

/// Only trees of more than 2048 triangles have fine sides, and no other seed is as large.
#[test]
#[cfg_attr(miri, ignore = "hours")]
fn accepted_mutants_of_fine_sides_answer_right() {
    for &quality in Quality::ALL {
        mutate_fine_sides(quality);
    }
}

fn mutate_fine_sides(quality: Quality) {
    let count = (setting("HGRID_MUTANTS", rounds(50_000) as u64) / 1000).max(20);
    let mut random = Random(setting("HGRID_SEED", 1));
    let seed = Seed::new(room_with(10), Config::from(Parameters::Bvh { quality }));
    let view = seed.mesh.view();
    let whole = Copy::of(&seed.blob);
    let [sides, ids, nodes] = [SIDES_COUNT, ID_COUNT, NODE_COUNT].map(|at| whole.word(at) as usize);
    let nodes_at = HEADER + (4 * ids).next_multiple_of(64);
    let fine_at = nodes_at + (NODE * nodes).next_multiple_of(64);
    assert!(sides > 0, "no fine sides");
    let (mut opened, mut accepted, mut refused) = (0, 0, 0);
    for round in 0..count {
        let mut copy = whole.clone();
        for _ in 0..=round % 3 {
            let at = fine_at + 4 * random.below(FINE / 4 * sides);
            let side = f32::from_bits(copy.word(at));
            let little = (2.0 * random.unit() - 1.0) * 0.5_f32.powi(5 + random.below(16) as i32);
            let word = match random.below(8) {
                0 => copy.word(at) ^ 1 << random.below(32),
                1 => copy.word(fine_at + 4 * random.below(FINE / 4 * sides)),
                2 => side.next_up().to_bits(),
                3 => side.next_down().to_bits(),
                _ => (side + little).to_bits(),
            };
            copy.set_word(at, word);
        }
        let Ok(grid) = Grid::open(copy.bytes(), view) else { continue };
        opened += 1;
        let rays = rays_to(&seed.mesh, &mut random);
        if prove(&grid).is_ok() {
            println!("round {round}: {quality:?}");
            agrees(&grid, &rays);
            accepted += 1;
        } else {
            ends(&grid, &rays[..4]);
            refused += 1;
        }
        // After a refit that succeeds, the grid is valid again.
        if refit(copy.bytes_mut(), &view).is_ok() {
            prove(&Grid::open(copy.bytes(), view).unwrap()).unwrap();
        }
    }
    let least = count as usize / 10;
    assert!(
        accepted > least && refused > least,
        "{opened} opened, {accepted} accepted, {refused} refused"
    );
}
