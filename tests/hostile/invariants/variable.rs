//! Variable grids: cells that hold grids of their own.

use hgrid_core::Parameters;
use hgrid_tests::copy::Copy;
use hgrid_tests::hostile::Seed;
use hgrid_tests::meshes::soup;

use super::hashed::list;
use super::sections::*;
use super::{Case, case, refused};

/// Returns a grid in which two cells hold subgrids.
fn crowded() -> Seed {
    let mut mesh = soup(20, 0.1, 3);
    for (count, at) in [(30, 0.3), (20, -0.5)] {
        mesh.append(&soup(count, 0.05, 5).map(|p| p.map(|c| at + 0.1 * c)));
    }
    Seed::new(mesh, Parameters::Variable { density: 4.0, subdivide_above: 4 }.into())
}

/// A subgrid: the offsets of its sections.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sub {
    pub(super) head: usize,
    pub(super) rows: usize,
    pub(super) bits: usize,
    pub(super) hash: usize,
    pub(super) ids: usize,
    pub(super) end: usize,
    pub(super) resolution: [usize; 3],
    slots: usize,
}

impl Sub {
    fn of(blob: &[u8], s: &Hashed, cell: &Cell) -> Self {
        let copy = Copy::of(blob);
        let head = s.at(cell.start);
        let [width, height, last] = [0, 4, 8].map(|at| copy.word(head + at));
        let resolution = [width, height, last].map(|word| (word >> 24) as usize);
        let slots = (last & 0x00ff_ffff) as usize;
        let [x, y, z] = resolution;
        let rows = head + 12;
        let bits = rows + 4 * y * z;
        let hash = bits + 4 * (x * y * z).div_ceil(32);
        let ids = hash + 4 * (slots + 1);
        Self { head, rows, bits, hash, ids, end: s.at(cell.end), resolution, slots }
    }
}

pub(super) fn subgrids(seed: &Seed) -> (Hashed, Vec<(Cell, Sub)>) {
    let s = Hashed::of(&seed.blob);
    let full = s.full(&seed.blob).into_iter();
    let subs = full.filter(|cell| cell.is_grid).map(|cell| (cell, Sub::of(&seed.blob, &s, &cell)));
    (s, subs.collect())
}

/// Returns cases that break the invariants of a subgrid.
fn inside(seed: &Seed, sub: Sub) -> Vec<Case<'static>> {
    let at = sub.head..sub.end;
    let copy = Copy::of(&seed.blob);
    let cells = sub.resolution.iter().product::<usize>();
    let mut cases = Vec::new();
    // Make the subgrid's box smaller and larger by 1/256 of the cell, where that is possible.
    for (name, byte) in (0..3).map(|k| ("low", k)).chain((4..7).map(|k| ("high", k))) {
        for by in [-1_i32, 1] {
            let before = i32::from(seed.blob[sub.head + byte]);
            if (0..256).contains(&(before + by)) {
                cases.push(case(name, at.clone(), move |b| {
                    let byte = sub.head + byte;
                    b.bytes_mut()[byte] = b.bytes()[byte].wrapping_add_signed(by as i8);
                }));
            }
        }
    }
    for byte in [3, 7, 11] {
        for by in [-1, 1] {
            cases.push(case("resolution", at.clone(), move |b| {
                let byte = sub.head + byte;
                b.bytes_mut()[byte] = b.bytes()[byte].wrapping_add_signed(by);
            }));
        }
    }
    for by in [-1, 1] {
        cases.push(case("slots", at.clone(), move |b| add(b, sub.head + 8, by)));
        cases.push(case("where lists begin", at.clone(), move |b| add(b, sub.hash, by)));
        cases.push(case("where they end", at.clone(), move |b| {
            add(b, sub.hash + 4 * sub.slots, by);
        }));
    }
    let row_count = sub.resolution[1] * sub.resolution[2];
    for row in 0..row_count {
        cases.push(case("a row elsewhere", at.clone(), move |b| add(b, sub.rows + 4 * row, 1)));
    }
    for bit in 0..cells.next_multiple_of(32) {
        cases.push(case("a mark", at.clone(), move |b| flip(b, sub.bits, bit)));
    }
    // Break the subgrid's first list of two or more.
    let ends: Vec<usize> =
        (0..=sub.slots).map(|slot| copy.word(sub.hash + 4 * slot) as usize).collect();
    let slot = ends.windows(2).position(|ends| ends[1] - ends[0] > 1).unwrap();
    let ids = sub.ids + 4 * ends[slot]..sub.ids + 4 * ends[slot + 1];
    cases.extend(list(&seed.mesh, ids.clone(), at.clone()));
    let in_ball = 0;
    cases.push(case("a triangle of another place", at, move |b| b.set_word(ids.start, in_ball)));
    cases
}

#[test]
fn subgrids_are_what_a_build_makes() {
    let seed = crowded();
    let (_, subs) = subgrids(&seed);
    assert!(subs.len() > 1, "{subs:?}");
    let is_rich = |sub: &&(Cell, Sub)| sub.1.resolution.iter().product::<usize>() > 8;
    let rich: Vec<_> = subs.iter().filter(is_rich).collect();
    assert!(!rich.is_empty(), "{subs:?}");
    for (_, sub) in rich {
        refused(&seed, &inside(&seed, *sub));
    }
}

#[test]
fn a_cell_has_a_list_or_a_subgrid_and_nothing_else_is_there() {
    let seed = crowded();
    let (s, subs) = subgrids(&seed);
    let list = *s.full(&seed.blob).iter().find(|cell| !cell.is_grid).unwrap();
    let (first, second) = (subs[0].0, subs[1].0);
    let end = s.overlay;
    let at_slot = |slot: usize| s.hash + 4 * slot;
    let cases = [
        case("a list is no subgrid", s.hash..end, move |b| {
            let word = b.word(at_slot(list.slot));
            b.set_word(at_slot(list.slot), word ^ GRID);
        }),
        case("a subgrid is no list", s.hash..end, move |b| {
            let word = b.word(at_slot(first.slot));
            b.set_word(at_slot(first.slot), word ^ GRID);
        }),
        case("the end is no subgrid", s.hash..s.pool, move |b| {
            let word = b.word(at_slot(s.slots));
            b.set_word(at_slot(s.slots), word | GRID);
        }),
        case("a subgrid of another cell", s.hash..end, move |b| {
            let [one, other] = [first, second].map(|cell| b.word(at_slot(cell.slot)));
            b.set_word(at_slot(first.slot), other);
            b.set_word(at_slot(second.slot), one);
        }),
        case("a word that nobody reads", s.rows..end + 64, move |b| {
            resized(b, s.pool, |bytes| bytes.extend([0; 4]));
        }),
        case("a word that only the table knows", s.rows..end + 64, move |b| {
            resized(b, s.pool, |bytes| bytes.extend([0; 4]));
            add(b, at_slot(s.slots), 1);
        }),
        case("subgrids of too few triangles", s.pool..end, |b| b.set_word(SUBDIVIDE_ABOVE, 1000)),
    ];
    refused(&seed, &cases);
}
