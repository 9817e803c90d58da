//! Blobs forged with knowledge of the proof: their slot numbers have equal scrambled sums.

use std::collections::BTreeMap;

use hgrid_core::{Config, Error, Grid, Method, Parameters, Ray};
use hgrid_tests::copy::Copy;
use hgrid_tests::hostile::{Seed, ends, fixed_rays};
use hgrid_tests::meshes::Mesh;
use hgrid_tests::owned::prove;
use hgrid_tests::random::Random;

use super::answers_right;
use super::sections::*;
use super::variable::{Sub, subgrids};

/// Slots whose scrambled numbers have the same sum, to 64 bits; a birthday search found them. If cells share
/// the first four in pairs and no cell has the others, the sum over cells still equals the sum over slots.
const SHARED: [usize; 4] = [1535, 11_941, 20_919, 28_447];
const ORPHANED: [usize; 4] = [39_775, 45_454, 58_142, 63_241];

/// An id that no cell reads.
const JUNK: u32 = 0xdead_beef;

/// Returns a table of slots with these lists, and the lists one after the other.
fn table(lists: &BTreeMap<usize, Vec<u32>>) -> [Vec<u32>; 2] {
    let (mut ends, mut ids) = (vec![0], Vec::new());
    for slot in 0..=*lists.keys().last().unwrap() {
        ids.extend(lists.get(&slot).into_iter().flatten());
        ends.push(u32::try_from(ids.len()).unwrap());
    }
    [ends, ids]
}

/// Returns a sheet of small triangles across x, in one cell of a box that two other triangles span.
fn sheet() -> Mesh {
    let mut mesh = Mesh::default();
    for corner in [0.0, 1.0] {
        let inwards = if corner > 0.5 { 0.99 } else { 0.01 };
        mesh.push([[corner; 3], [inwards, corner, corner], [corner, inwards, corner]]);
    }
    let mut random = Random(2);
    for _ in 0..80 {
        let [_, y, z] = random.point();
        mesh.push(std::array::from_fn(|_| {
            let [_, b, c] = random.point();
            [0.51, 0.54 + 0.03 * y + 0.01 * b, 0.54 + 0.03 * z + 0.01 * c]
        }));
    }
    mesh
}

/// A cell of a subgrid with its list.
struct Listed {
    row: usize,
    ids: Vec<u32>,
}

/// Returns the cells of a subgrid that have lists. Each row has one cell, so each cell can have any slot.
fn listed(blob: &Copy, sub: &Sub) -> Vec<Listed> {
    assert_eq!(sub.resolution[0], 1, "rows of one cell");
    let word = |section: usize, at: usize| blob.word(section + 4 * at) as usize;
    let rows = 0..sub.resolution[1] * sub.resolution[2];
    let rows = rows.filter(|row| word(sub.bits, row / 32) >> (row % 32) & 1 == 1);
    rows.map(|row| {
        let slot = word(sub.rows, row);
        let ids = word(sub.hash, slot)..word(sub.hash, slot + 1);
        Listed { row, ids: ids.map(|id| word(sub.ids, id) as u32).collect() }
    })
    .collect()
}

/// Returns four pairs of cells that can share the ids that both list: the ids that they lose are listed in a
/// cell before them, where the proof counts them.
fn pairs(lists: &[Listed]) -> [(usize, usize, Vec<u32>); 4] {
    let is_listed_before =
        |cell: usize, id: &u32| lists[..cell].iter().any(|list| list.ids.contains(id));
    let mut pairs = Vec::new();
    for (i, one) in lists.iter().enumerate() {
        for (j, other) in lists.iter().enumerate().skip(i + 1) {
            let common: Vec<u32> =
                one.ids.iter().copied().filter(|id| other.ids.contains(id)).collect();
            let keeps = |cell: usize, id: &u32| common.contains(id) || is_listed_before(cell, id);
            let is_fit = one.ids.iter().all(|id| keeps(i, id))
                && other.ids.iter().all(|id| keeps(j, id))
                && !common.is_empty();
            if is_fit {
                pairs.push((one.ids.len() + other.ids.len() - 2 * common.len(), i, j, common));
            }
        }
    }
    pairs.sort_by_key(|(lost, ..)| std::cmp::Reverse(*lost));
    let mut chosen: Vec<(usize, usize, Vec<u32>)> = Vec::new();
    for (lost, i, j, common) in pairs {
        let is_new = chosen.iter().all(|(a, b, _)| ![i, j].contains(a) && ![i, j].contains(b));
        if lost > 0 && is_new && chosen.len() < 4 {
            chosen.push((i, j, common));
        }
    }
    chosen.try_into().expect("four pairs")
}

/// Forges a subgrid whose cells share lists in pairs, with as many ids in all as before.
fn forge(seed: &Seed) -> (Copy, std::ops::Range<usize>) {
    let mut copy = Copy::of(&seed.blob);
    let (s, subs) = subgrids(seed);
    let (cell, sub) = *subs.iter().max_by_key(|(cell, _)| cell.end - cell.start).unwrap();
    let cells = listed(&copy, &sub);
    let pairs = pairs(&cells);

    // Give each cell a slot, and both cells of a pair the same.
    let mut slots: Vec<usize> = (0..cells.len()).collect();
    let mut lists: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    for ((i, j, common), shared) in pairs.into_iter().zip(SHARED) {
        (slots[i], slots[j]) = (shared, shared);
        lists.insert(shared, common);
    }
    for (cell, &slot) in cells.iter().zip(&slots) {
        lists.entry(slot).or_insert_with(|| cell.ids.clone());
    }
    // Put the remaining ids into slots that no cell uses.
    let total = (sub.end - sub.ids) / 4;
    let mut rest = total - lists.values().map(Vec::len).sum::<usize>();
    for slot in ORPHANED {
        let count = if slot == ORPHANED[3] { rest } else { 1 };
        lists.insert(slot, vec![JUNK; count]);
        rest -= count;
    }

    // Write the subgrid, and the blob around it.
    let [ends, ids] = table(&lists);
    assert_eq!(ids.len(), total, "as many ids as before");
    let depth = copy.word(sub.head + 8) >> 24;
    copy.set_word(sub.head + 8, depth << 24 | u32::try_from(ends.len() - 1).unwrap());
    for (cell, slot) in cells.iter().zip(&slots) {
        copy.set_word(sub.rows + 4 * cell.row, u32::try_from(*slot).unwrap());
    }
    let words: Vec<u8> = ends.iter().chain(&ids).flat_map(|word| word.to_ne_bytes()).collect();
    let grown = (words.len() - (sub.end - sub.hash)) as i32 / 4;
    resized(&mut copy, s.pool, |bytes| drop(bytes.splice(sub.hash..sub.end, words.clone())));
    for slot in cell.slot + 1..=s.slots {
        add(&mut copy, s.hash + 4 * slot, grown);
    }
    copy.sign();
    (copy, sub.head..sub.hash + words.len())
}

#[test]
#[cfg_attr(miri, ignore = "minutes")]
fn lists_that_no_cell_names_do_not_count() {
    let seed = Seed::new(sheet(), Config::new(Method::Variable));
    let view = seed.mesh.view();
    let (copy, at) = forge(&seed);
    let forged = Grid::open(copy.bytes(), view).unwrap();
    ends(&forged, &fixed_rays(forged.bounds(), 12));

    // The forged blob answers wrongly, so the proof has something to find.
    let blob = Copy::of(&seed.blob);
    let built = Grid::open(blob.bytes(), view).unwrap();
    let mut random = Random(1);
    let lost = (0..4000).filter(|_| {
        let [y, z] = [0, 1].map(|_| 0.5 + 0.08 * random.unit());
        let ray = Ray::new([2.0, y, z], [-1.0, 0.0, 0.0]);
        forged.intersect(&ray) != built.intersect(&ray)
    });
    assert!(lost.count() > 0, "nothing is lost");
    let result = prove(&forged);
    let is_there = matches!(result, Err(Error::Corrupt { offset })
        if usize::try_from(offset).is_ok_and(|offset| at.contains(&offset)));
    assert!(is_there, "{result:?}");
}

/// Cells may share a list if all of them have the same ids: no build writes that, but the answers are right.
#[test]
#[cfg_attr(miri, ignore = "minutes")]
fn equal_lists_may_be_shared() {
    let mut mesh = Mesh::default();
    mesh.push([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let seed = Seed::new(mesh, Parameters::OneLevel { density: 40.0 }.into());
    let s = Hashed::of(&seed.blob);
    let rows = s.row_count();
    assert!(s.resolution[0] == 1 && rows > 8 && s.words == rows, "each row must be one cell");

    let mut lists: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    let mut copy = Copy::of(&seed.blob);
    for row in 0..rows {
        let slot = if row < 8 { SHARED[row / 2] } else { row };
        lists.insert(slot, vec![0]);
        copy.set_word(s.rows + 4 * row, u32::try_from(slot).unwrap());
    }
    lists.extend(ORPHANED.map(|slot| (slot, vec![JUNK])));
    let [ends, ids] = table(&lists);
    let mut bytes = copy.bytes()[..s.hash].to_vec();
    for section in [&ends, &ids] {
        bytes.extend(section.iter().flat_map(|word| word.to_ne_bytes()));
        bytes.resize(bytes.len().next_multiple_of(64), 0);
    }
    let mut copy = Copy::of(&bytes);
    copy.set(BLOB_BYTES, &(bytes.len() as u64).to_ne_bytes());
    copy.set_word(HASH_COUNT, u32::try_from(ends.len() - 1).unwrap());
    copy.sign();

    let view = seed.mesh.view();
    let grid = Grid::open(copy.bytes(), view).unwrap();
    prove(&grid).expect("the answers are right");
    answers_right(&grid, &seed.mesh);
    // With one orphan less there are more ids than the cells list.
    copy.set_word(s.rows, copy.word(s.rows + 4 * 9));
    let grid = Grid::open(copy.bytes(), view).unwrap();
    assert!(matches!(prove(&grid), Err(Error::Corrupt { .. })));
}

/// A crowded cell with a list instead of a subgrid is slower, but right.
#[test]
fn a_list_may_have_any_length() {
    let parameters = Parameters::Variable { density: 4.0, subdivide_above: 1000 };
    let seed = Seed::new(sheet(), parameters.into());
    let mut copy = Copy::of(&seed.blob);
    copy.set_word(SUBDIVIDE_ABOVE, 4);
    copy.sign();
    let grid = Grid::open(copy.bytes(), seed.mesh.view()).unwrap();
    prove(&grid).expect("the answers are right");
    answers_right(&grid, &seed.mesh);
}
