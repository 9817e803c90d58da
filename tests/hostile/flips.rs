//! Single bits of a blob are flipped. Queries end after bounded work, and `validate` refuses the blob, or the
//! blob is one that a build makes with other parameters, and answers right.
//!
//! The usual tests flip every bit of the smallest blobs, and every 29th bit of others, so that each bit of a
//! byte gets its turn; the slow tests flip every bit of all.

use std::ops::Range;
use std::thread;

use hgrid_core::{Error, Grid, Method, refit};
use hgrid_tests::copy::{CHECKSUM, Copy, MESH};
use hgrid_tests::hostile::{Seed, agrees, ends, fixed_rays, seeds};
use hgrid_tests::owned::{Owned, prove};

/// The header's fields for a build's parameters: method, density, macrocell factor, the number of ids above
/// which a cell gets a subgrid, depth. Other parameters may well give the same grid.
const TOLD: [usize; 5] = [40, 44, 92, 96, 100];

/// The header's field `content`: the kind of primitives that the blob is built over.
const CONTENT: Range<usize> = 104..108;

/// The header's field for the quality of a tree.
const QUALITY: usize = 120;

/// Returns true if a blob may be valid in spite of a flipped bit in this byte, because a builder could have made it.
fn is_fit(at: usize, copy: &Copy, grid: &Grid<'_>) -> bool {
    let rebuilt = Owned::build(grid.mesh(), &grid.config()).unwrap();
    // `validate` does not check why a list was not subdivided: see core/src/variable/validate.rs.
    let is_built = rebuilt.bytes() == copy.bytes() || grid.method() == Method::Variable;
    // A tree may have larger boxes than a build makes, and its quality cannot be checked.
    if grid.method() == Method::Bvh && (at > CHECKSUM || at == QUALITY) {
        return true;
    }
    // The field for the mesh after the grid may have more than one value: it is not read if the caller has the mesh.
    is_built && TOLD.contains(&(at & !3)) || at == MESH && copy.word(MESH) <= 2
}

/// The numbers of flipped bits, by outcome.
#[derive(Debug, Default)]
struct Ends {
    /// Opening refused the blob.
    refused: u32,
    /// Opening refused the blob because field `content` names another kind, or none.
    other: u32,
    /// Only `validate` refused the blob.
    found: u32,
    /// The blob is valid, and answers right.
    valid: u32,
}

/// The distance from one flipped bit to the next.
const STEP: usize = 29;

fn flip_all(seed: &Seed, rays: usize, step: usize) -> Ends {
    let view = seed.mesh.view();
    let mut copy = Copy::of(&seed.blob);
    let mut ended = Ends::default();
    for (at, bit) in (0..8 * seed.blob.len()).step_by(step).map(|bit| (bit / 8, bit % 8)) {
        let what = format!("{:?}: bit {bit} of byte {at}", seed.config.method());
        copy.set(at, &[seed.blob[at] ^ 1 << bit]);
        if at < CHECKSUM + 4 {
            let error = Grid::open(copy.bytes(), view).map(|_| ()).unwrap_err();
            let is_fit = matches!(
                error,
                Error::NotAGrid
                    | Error::WrongByteOrder
                    | Error::UnsupportedVersion { .. }
                    | Error::Corrupt { offset: 124 }
            );
            assert!(is_fit, "{what}: not an error that a damaged header may give: {error:?}");
        }
        if at < CHECKSUM {
            copy.sign();
        }
        match Grid::open(copy.bytes(), view) {
            Err(error) if CONTENT.contains(&at) => {
                let is_fit = match error {
                    Error::OtherContent(content) => copy.word(CONTENT.start) == content as u32,
                    Error::Corrupt { offset } => offset == CONTENT.start as u64,
                    _ => false,
                };
                assert!(is_fit, "{what}: {error:?}");
                ended.other += 1;
            }
            Err(_) => ended.refused += 1,
            Ok(grid) => {
                let rays = fixed_rays(grid.bounds(), rays);
                ends(&grid, &rays);
                if seed.config.method() == Method::Bvh {
                    let mut refitted = Copy::of(copy.bytes());
                    if refit(refitted.bytes_mut(), &view).is_ok() {
                        ends(&Grid::open(refitted.bytes(), view).unwrap(), &rays);
                    }
                }
                if let Err(error) = prove(&grid) {
                    let length = seed.blob.len() as u64;
                    let is_fit = matches!(error, Error::Corrupt { offset } if offset < length);
                    assert!(is_fit, "{what}: {error:?}");
                    ended.found += 1;
                } else {
                    agrees(&grid, &rays);
                    assert!(is_fit(at, &copy, &grid), "{what}: valid, but no build makes it");
                    ended.valid += 1;
                }
            }
        }
        copy.set(at, &[seed.blob[at]]);
        copy.set(CHECKSUM, &seed.blob[CHECKSUM..CHECKSUM + 4]);
    }
    assert_eq!(copy.bytes(), seed.blob);
    ended
}

fn flip(method: Method, step: usize) {
    let is_one = |seed: &&Seed| seed.config.method() == method && seed.blob.len() < 6500;
    assert!(seeds().filter(is_one).count() > 1);
    for seed in seeds().filter(is_one) {
        // Flip every bit of the smallest blobs.
        let step = if seed.blob.len() < 1000 { 1 } else { step };
        // Send fewer rays where there are more bits.
        let rays = (12_000 / seed.blob.len().max(1000)).max(4);
        let ended = flip_all(seed, rays, step);
        println!("{} triangles, {} bytes: {ended:?}", seed.mesh.indices.len(), seed.blob.len());
        // Half of the bits of a tree belong to boxes, and half of those make a box larger or belong to an unused one.
        let is_tree = method == Method::Bvh;
        assert!(ended.refused > 400 / step as u32, "{ended:?}");
        assert!(is_tree || ended.valid < 80, "{ended:?}");
        let share = if is_tree { 1 } else { 2 };
        // Flips in the content field are refused when the blob is opened.
        let bits = 8 * CONTENT.start..8 * CONTENT.end;
        assert_eq!(ended.other as usize, bits.filter(|bit| bit % step == 0).count(), "{ended:?}");
        assert!(ended.found + ended.other > share * ended.valid, "{ended:?}");
    }
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn one_level() {
    flip(Method::OneLevel, STEP);
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn fixed() {
    flip(Method::Fixed, STEP);
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn variable() {
    flip(Method::Variable, STEP);
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn recursive() {
    flip(Method::Recursive, STEP);
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn bvh() {
    flip(Method::Bvh, STEP);
}

#[test]
#[ignore = "slow: half a minute"]
fn every_bit() {
    thread::scope(|scope| {
        for &method in Method::ALL {
            scope.spawn(move || flip(method, 1));
        }
    });
}

/// Flips in the mesh after a grid. The grid may be right for a mesh that differs a little.
#[test]
#[cfg_attr(miri, ignore = "hours")]
fn packed_meshes() {
    flip_meshes(STEP);
}

#[test]
#[ignore = "slow: some seconds"]
fn every_bit_of_packed_meshes() {
    flip_meshes(1);
}

fn flip_meshes(step: usize) {
    let is_small = |seed: &&Seed| seed.mesh.indices.len() == 12;
    for seed in seeds().filter(is_small) {
        let (mut refused, mut found, mut valid) = (0, 0, 0);
        let behind = 8 * seed.blob.len()..8 * seed.packed.len();
        for (at, bit) in behind.step_by(step).map(|bit| (bit / 8, bit % 8)) {
            let mut copy = Copy::of(&seed.packed);
            copy.set(at, &[seed.packed[at] ^ 1 << bit]);
            let Ok(grid) = Grid::open_packed(copy.bytes()) else {
                refused += 1;
                continue;
            };
            let rays = fixed_rays(grid.bounds(), 8);
            ends(&grid, &rays);
            if prove(&grid).is_ok() {
                agrees(&grid, &rays[..4]);
                valid += 1;
            } else {
                found += 1;
            }
        }
        // With 12 triangles and 36 vertices, the padding of the three sections is 48, 16 and 16 bytes.
        let rounding = if step == 1 { 0 } else { 3 };
        assert!(
            usize::abs_diff(8 * 80 / step, refused) <= rounding,
            "{refused} flips were refused, not those of all padding bits"
        );
        assert!(found.min(valid) > 1000 / step, "{found} {valid}");
    }
}

/// Flips of bits in the header of a blob that contains its mesh, including the field for the mesh.
#[test]
#[cfg_attr(miri, ignore = "hours")]
fn packed_headers() {
    flip_packed_headers(5);
}

#[test]
#[ignore = "slow: some seconds"]
fn every_bit_of_packed_headers() {
    flip_packed_headers(1);
}

fn flip_packed_headers(step: usize) {
    let mut opened = 0;
    for Seed { packed, .. } in seeds() {
        let bits = (0..8 * (CHECKSUM + 4)).step_by(step);
        for (at, bit) in bits.map(|bit| (bit / 8, bit % 8)) {
            let mut copy = Copy::of(packed);
            copy.set(at, &[packed[at] ^ 1 << bit]);
            assert!(Grid::open_packed(copy.bytes()).is_err(), "bit {bit} of byte {at}");
            copy.sign();
            if let Ok(grid) = Grid::open_packed(copy.bytes()) {
                let rays = fixed_rays(grid.bounds(), 4);
                ends(&grid, &rays);
                if prove(&grid).is_ok() {
                    agrees(&grid, &rays);
                }
                opened += 1;
            }
        }
    }
    assert!(opened > 1000 / step, "{opened}");
}
