//! Invariants of the header of every method.

use hgrid_core::{Error, Grid, Method};
use hgrid_tests::copy::{Copy, MESH};
use hgrid_tests::hostile::{Seed, seeds};

use super::sections::*;
use super::{Case, case, refused};

fn small(method: Method) -> &'static Seed {
    // A mesh of a dozen triangles.
    seeds().find(|seed| seed.config.method() == method && seed.mesh.indices.len() == 12).unwrap()
}

/// Returns cases for fields that mean nothing to a method, and for fields that every method must have right.
fn fields(seed: &Seed) -> Vec<Case<'static>> {
    let method = seed.config.method();
    let mut cases = vec![
        case("a triangle skipped", SKIPPED_COUNT..SKIPPED_COUNT + 4, |b| add(b, SKIPPED_COUNT, 1)),
        case("unknown method", METHOD..METHOD + 4, |b| b.set_word(METHOD, 0)),
        case("unknown method", METHOD..METHOD + 4, |b| b.set_word(METHOD, 7)),
        case("longer than its sections", 16..24, |b| {
            let longer = Copy::of(&[b.bytes(), &[0; 64]].concat());
            *b = longer;
            add(b, BLOB_BYTES, 64);
        }),
        case("a mesh behind it that is none", MESH..MESH + 4, |b| b.set_word(MESH, 3)),
    ];
    for axis in 0..3 {
        let [min, max] = [BOUNDS_MIN, BOUNDS_MAX].map(|at| at + 4 * axis);
        let resolution = RESOLUTION + 4 * axis;
        cases.extend([
            case("a box that is larger", 0..HEAD, move |b| add(b, max, 1)),
            case("a box that is larger", 0..HEAD, move |b| {
                b.set_word(min, f32::from_bits(b.word(min)).next_down().to_bits());
            }),
            case("no box: NaN", BOUNDS_MIN..RESOLUTION, move |b| {
                b.set_word(min, f32::NAN.to_bits());
            }),
            case("no box: infinite", BOUNDS_MIN..RESOLUTION, move |b| {
                b.set_word(max, f32::INFINITY.to_bits());
            }),
            case("no box: turned round", BOUNDS_MIN..RESOLUTION, move |b| {
                b.set_word(max, b.word(min));
            }),
            case("no cells", RESOLUTION..HASH_COUNT, move |b| b.set_word(resolution, 0)),
            case("too many cells", RESOLUTION..HASH_COUNT, move |b| b.set_word(resolution, 4097)),
            case("a cell more", 0..HEAD + 64, move |b| add(b, resolution, 1)),
        ]);
    }
    // Set the bytes after the last known field, and fields of other methods.
    let unused = RESERVED - 20..RESERVED + 12;
    // A tree has the numbers of nodes and levels there (see bvh.rs), and its quality.
    let is_tree = method == Method::Bvh;
    let used = if is_tree { 2 } else { 0 };
    for reserved in [0, 4, 8].map(|at| RESERVED + at).into_iter().skip(used) {
        cases.push(case("a field that nobody knows", unused.clone(), move |b| {
            b.set_word(reserved, if is_tree { 2 } else { 1 });
        }));
    }
    let of_others = [
        (MACROCELL_FACTOR, method == Method::Fixed),
        (SUBDIVIDE_ABOVE, method == Method::Variable),
        (DEPTH, method == Method::Recursive),
        (CELL_SIZE, false),
        (DENSITY, !is_tree),
    ];
    for (at, _) in of_others.into_iter().filter(|(_, is_used)| !is_used) {
        cases.push(case("a field of another method", unused.clone(), move |b| {
            b.set_word(at, 1.0_f32.to_bits());
        }));
    }
    if !is_tree {
        for density in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            cases.push(case("a density that is none", DENSITY..DENSITY + 4, move |b| {
                b.set_word(DENSITY, density.to_bits());
            }));
        }
        cases.push(case("a density of other cells", RESOLUTION..HASH_COUNT, |b| {
            b.set_word(DENSITY, 1000.0_f32.to_bits());
        }));
    }
    let counts = 0..HEAD + 64;
    cases.push(case("fewer references", counts, |b| add(b, REFERENCE_COUNT, -20)));
    cases
}

#[test]
fn what_a_header_says_is_so() {
    for &method in Method::ALL {
        refused(small(method), &fields(small(method)));
    }
}

#[test]
fn parameters_that_no_build_takes_are_refused() {
    let is = |at: usize, value: u32| {
        case("no build takes it", at..at + 4, move |b: &mut Copy| {
            b.set_word(at, value);
        })
    };
    refused(small(Method::Fixed), &[is(MACROCELL_FACTOR, 0), is(MACROCELL_FACTOR, 1)]);
    refused(small(Method::Recursive), &[is(DEPTH, 0), is(DEPTH, 5), is(HASH_COUNT, 1)]);
}

/// The padding between sections is zero.
#[test]
fn what_fills_up_sections_is_zero() {
    let mut found = 0;
    for seed in seeds().filter(|seed| !seed.mesh.indices.is_empty()) {
        // The last section ends with padding, if any; macrocells fill their words.
        let count = |at| Copy::of(&seed.blob).word(at) as usize;
        let is_tree = seed.config.method() == Method::Bvh;
        let words = if is_tree { 20 * count(RESERVED) } else { count(REFERENCE_COUNT) };
        let is_full = words.is_multiple_of(16) || seed.config.method() == Method::Fixed;
        for back in (1..=(16 - words % 16) * 4).take(if is_full { 0 } else { 64 }) {
            let at = seed.blob.len() - back;
            refused(seed, &[case("filled up with something", 16..24, move |b| b.set(at, &[1]))]);
            found += 1;
        }
    }
    assert!(found > 100, "{found}");
}

#[test]
fn a_blob_of_another_number_of_vertices_or_triangles_is_another_meshs() {
    for &method in Method::ALL {
        let Seed { mesh, blob, .. } = small(method);
        for at in [24, 32] {
            let mut copy = Copy::of(blob);
            add(&mut copy, at, 1);
            copy.sign();
            let result = Grid::open(copy.bytes(), mesh.view()).map(|_| ());
            assert_eq!(result, Err(Error::MeshMismatch));
        }
    }
}
