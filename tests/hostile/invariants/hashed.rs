//! One-level and fixed grids: a table of slots, lists, and macrocells above them.

use hgrid_core::{Method, Parameters};
use hgrid_tests::copy::Copy;
use hgrid_tests::hostile::Seed;
use hgrid_tests::meshes::{Mesh, one_triangle, soup};

use super::sections::*;
use super::{Case, case, refused};

fn parameters(method: Method, density: f32) -> Parameters {
    match method {
        Method::Fixed => Parameters::Fixed { density, macrocell_factor: 2 },
        Method::Variable => Parameters::Variable { density, subdivide_above: 1 << 20 },
        _ => Parameters::new(method).with_density(density),
    }
}

/// Returns a grid with empty rows, and with empty cells in other rows.
fn sparse(method: Method) -> Seed {
    Seed::new(soup(60, 0.05, 9), parameters(method, 4.0).into())
}

/// Returns cases that break the invariants of every hash table with its lists in the pool after it.
pub(super) fn table(seed: &Seed) -> Vec<Case<'static>> {
    let blob = &seed.blob;
    let s = Hashed::of(blob);
    let full = s.full(blob);
    let (first, last) = (full[0], full[full.len() - 1]);
    let in_rows = s.rows..s.bits;
    let in_bits = s.bits..s.hash;
    let in_hash = s.hash..s.pool;
    let empty_row = s.empty_row(blob);
    // A cell without a list, in a row that has lists.
    let bit = s.bit(first.cell) + 1;
    let beside = (bit..s.cells()).find(|&bit| full.iter().all(|cell| s.bit(cell.cell) != bit));
    let beside = beside.unwrap();
    assert!(!s.cells().is_multiple_of(64), "a bit behind the last cell");
    let mut cases = vec![
        case("an empty row that is somewhere", in_rows.clone(), move |b| {
            add(b, s.rows + 4 * empty_row, 1);
        }),
        case("a mark without a list", s.rows..s.overlay, move |b| flip(b, s.bits, beside)),
        case("a list without a mark", s.rows..s.overlay, move |b| {
            flip(b, s.bits, s.bit(last.cell));
        }),
        case("a mark behind the last cell", in_bits, move |b| flip(b, s.bits, s.cells())),
        case("lists begin later", in_hash.clone(), move |b| add(b, s.hash, 1)),
        case("a list ends before it begins", s.hash..s.overlay, move |b| {
            add(b, s.hash + 4 * last.slot, -(last.start as i32));
        }),
        case("the last list ends early", s.hash..s.overlay, move |b| {
            add(b, s.hash + 4 * s.slots, -1)
        }),
        case("the last list ends late", in_hash, move |b| add(b, s.hash + 4 * s.slots, 1)),
    ];
    // The padding after the last slot has room in this blob: one more slot fits without moving anything.
    assert!(!(s.slots + 1).is_multiple_of(16), "no room for a slot");
    cases.push(case("a slot without a list at the end", HASH_COUNT..HASH_COUNT + 4, move |b| {
        add(b, HASH_COUNT, 1);
        b.set_word(s.hash + 4 * (s.slots + 1), s.words as u32);
    }));
    // Exchange two rows.
    let rows: Vec<usize> =
        full.iter().map(|cell| cell.cell[2] * s.resolution[1] + cell.cell[1]).collect();
    let (one, other) = (rows[0], rows[rows.len() - 1]);
    cases.push(case("two rows have changed places", s.rows..s.overlay, move |b| {
        let [first, second] = [one, other].map(|row| b.word(s.rows + 4 * row));
        b.set_word(s.rows + 4 * one, second);
        b.set_word(s.rows + 4 * other, first);
    }));
    cases
}

/// Returns cases that break the invariants of any list of a cell: `ids` are its bytes, `at` the offsets of
/// the errors.
pub(super) fn list(
    mesh: &Mesh,
    ids: std::ops::Range<usize>,
    at: std::ops::Range<usize>,
) -> Vec<Case<'static>> {
    let count = mesh.indices.len() as u32;
    let (first, second) = (ids.start, ids.start + 4);
    assert!(ids.len() >= 8, "a list of two");
    vec![
        case("a triangle twice, another missing", at.clone(), move |b| {
            b.set_word(second, b.word(first));
        }),
        case("ids that descend", at.clone(), move |b| {
            let [a, c] = [first, second].map(|at| b.word(at));
            b.set_word(first, c);
            b.set_word(second, a);
        }),
        case("a triangle that is not there", at.clone(), move |b| b.set_word(second, count)),
        case("no triangle", at, move |b| b.set_word(second, u32::MAX)),
    ]
}

/// Returns a triangle that does not reach a cell.
fn stranger(seed: &Seed, s: &Hashed, cell: &Cell) -> u32 {
    let copy = Copy::of(&seed.blob);
    let ids: Vec<u32> = (cell.start..cell.end).map(|word| copy.word(s.at(word))).collect();
    // Take one that keeps the ids ascending.
    let last = ids[ids.len() - 1];
    (last + 1..seed.mesh.indices.len() as u32).find(|id| !ids.contains(id)).unwrap()
}

#[test]
fn tables_and_lists_are_what_a_build_makes() {
    for method in [Method::OneLevel, Method::Fixed, Method::Variable] {
        let seed = sparse(method);
        let s = Hashed::of(&seed.blob);
        let full = s.full(&seed.blob);
        let cell = *full.iter().find(|cell| cell.end - cell.start > 1).unwrap();
        let in_pool = s.hash..s.overlay;
        let mut cases = table(&seed);
        cases.extend(list(&seed.mesh, s.at(cell.start)..s.at(cell.end), in_pool.clone()));
        let (last, stranger) = (s.at(cell.end - 1), stranger(&seed, &s, &cell));
        cases.push(case("a triangle of another cell", in_pool.clone(), move |b| {
            b.set_word(last, stranger);
        }));
        // Give the last id of a list to the next list.
        let behind = full.iter().find(|other| other.slot == cell.slot + 1).map(|other| other.slot);
        let behind = behind.unwrap_or(cell.slot);
        cases.push(case("a triangle given to the next cell", in_pool, move |b| {
            add(b, s.hash + 4 * behind, if behind == cell.slot { 1 } else { -1 });
        }));
        refused(&seed, &cases);
    }
}

#[test]
fn a_missing_triangle_is_missed() {
    for method in [Method::OneLevel, Method::Variable] {
        let seed = sparse(method);
        let s = Hashed::of(&seed.blob);
        let cell = *s.full(&seed.blob).iter().find(|cell| cell.end - cell.start > 1).unwrap();
        let change = move |b: &mut Copy| {
            resized(b, s.pool, |bytes| {
                bytes.drain(s.at(cell.start)..s.at(cell.start + 1));
            });
            for slot in cell.slot + 1..=s.slots {
                add(b, s.hash + 4 * slot, -1);
            }
        };
        let at = if method == Method::OneLevel { 88..92 } else { s.pool..s.overlay };
        refused(&seed, &[case("a triangle is missing", at, change)]);
    }
}

/// Every cell of one triangle's box has the same list: rows could share slots, and all lists would be right.
#[test]
fn slots_are_not_shared() {
    for method in [Method::OneLevel, Method::Fixed, Method::Variable] {
        let seed = Seed::new(one_triangle(), parameters(method, 40.0).into());
        let s = Hashed::of(&seed.blob);
        assert!(s.row_count() > 1 && s.full(&seed.blob).len() == s.cells(), "{s:?}");
        let change = move |b: &mut Copy| {
            let first = b.word(s.rows);
            b.set_word(s.rows + 4, first);
        };
        refused(&seed, &[case("two rows have the same slots", s.rows..s.bits, change)]);
    }
}

#[test]
fn macrocells_are_full_where_something_is_below() {
    let seed = Seed::new(soup(300, 0.02, 3), parameters(Method::Fixed, 32.0).into());
    let s = Hashed::of(&seed.blob);
    let [x, y, z] = s.resolution;
    assert!(x * y * z / 8 > 64 && seed.blob.len() - s.overlay >= 64, "{s:?}");
    // All bits of the first level, one by one, and the bit after its last macrocell.
    let cells = s.resolution.map(|cells| cells.div_ceil(2)).iter().product::<usize>();
    let end = seed.blob.len();
    let words = s.overlay..(s.overlay + 8 * cells.div_ceil(64)).min(end);
    let mut cases: Vec<Case<'_>> = (0..cells)
        .step_by(7)
        .map(|bit| {
            let word = s.overlay + bit / 64 * 8;
            case("a macrocell is full, or empty", word..word + 8, move |b| flip(b, s.overlay, bit))
        })
        .collect();
    assert!(!cells.is_multiple_of(64));
    cases.push(case("a macrocell behind the last", words, move |b| flip(b, s.overlay, cells)));
    cases.push(case("other macrocells", 0..end, |b| b.set_word(MACROCELL_FACTOR, 3)));
    refused(&seed, &cases);
}
