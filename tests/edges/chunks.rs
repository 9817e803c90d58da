//! Brick grids whose words are not what a build writes: refused by `validate`, each for its own
//! reason, and harmless to queries.
//!
//! The words are found here from the format's description alone
//! (core/src/brick/mod.rs and sort.rs).

use std::collections::HashMap;

use hgrid_core::{Config, Error, Grid, Method, Ray};
use hgrid_tests::copy::{Copy, word};
use hgrid_tests::meshes::{Mesh, soup};
use hgrid_tests::oracle;
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;

use crate::blobs::query;
use crate::bricks::crowds;

/// What a word of a brick grid is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Kind {
    /// Of the list of the grid.
    LargeCount,
    LargeId,
    /// Of a block, in front of the pool.
    BlockMask,
    BlockBase,
    BlockList,
    /// Of a brick.
    BrickMask,
    BrickCells,
    BrickList,
    /// Where the list of a cell starts, and where the last one ends.
    Start,
    End,
    /// The ids of cells, and what is in lists of bricks and blocks.
    CellId,
    BrickCount,
    BrickId,
    WholeCount,
    WholeId,
    /// Where the triangles of a list of a brick or block lie.
    Extent,
    /// Of a divided cell.
    ChildMask,
    ChildBase,
    ChildList,
    ChildCells,
}

/// A word of a blob.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Site {
    pub(crate) kind: Kind,
    /// The first byte.
    pub(crate) at: usize,
    /// How often the cell around it is divided; for a child's record, that around the child.
    pub(crate) depth: usize,
    /// Whether another word of the same list lies before it.
    follows: bool,
}

/// All words of a brick grid behind its header.
pub(crate) fn sites(blob: &[u8]) -> Vec<Site> {
    let blocks: usize =
        [72, 76, 80].map(|at| word(blob, at).div_ceil(16) as usize).into_iter().product();
    let pool = 128 + (blocks * 16).next_multiple_of(64);
    let mut sites = Vec::new();
    let mut push = |kind, at, depth, follows| sites.push(Site { kind, at, depth, follows });
    push(Kind::LargeCount, pool, 0, false);
    for i in 0..word(blob, pool) as usize {
        push(Kind::LargeId, pool + 4 + 4 * i, 0, i > 0);
    }
    let mut todo = Vec::new();
    for block in (0..blocks).map(|block| 128 + 16 * block) {
        let [low, high, base, list] = std::array::from_fn(|i| word(blob, block + 4 * i));
        for (i, kind) in [Kind::BlockMask, Kind::BlockMask, Kind::BlockBase, Kind::BlockList]
            .into_iter()
            .enumerate()
        {
            push(kind, block + 4 * i, 0, low | high | list != 0);
        }
        let start = pool + 4 * base as usize;
        todo.push((start, start, [low, high], list, 0));
    }
    let count = |mask: [u32; 2]| (mask[0].count_ones() + mask[1].count_ones()) as usize;
    while let Some((start, bricks, mask, list, depth)) = todo.pop() {
        let place = |word: u32| start + 4 * (word & !(1 << 31)) as usize;
        let mut large = vec![(list, Kind::WholeCount, Kind::WholeId)];
        let mut end = None;
        for brick in (0..count(mask)).map(|i| bricks + 16 * i) {
            let [low, high, cells, list] = std::array::from_fn(|i| word(blob, brick + 4 * i));
            for (i, kind) in [Kind::BrickMask, Kind::BrickMask, Kind::BrickCells, Kind::BrickList]
                .into_iter()
                .enumerate()
            {
                push(kind, brick + 4 * i, depth, true);
            }
            large.push((list, Kind::BrickCount, Kind::BrickId));
            for at in (0..count([low, high])).map(|i| place(cells) + 4 * i) {
                push(Kind::Start, at, depth, true);
                end = Some(at + 4);
                let (first, last) = (place(word(blob, at)), place(word(blob, at + 4)));
                if word(blob, at) >> 31 == 0 {
                    for id in (first..last).step_by(4) {
                        push(Kind::CellId, id, depth, id > first);
                    }
                    continue;
                }
                let [low, high, bricks, list, _] =
                    std::array::from_fn(|i| word(blob, first + 4 * i));
                for (i, kind) in
                    [Kind::ChildMask, Kind::ChildBase, Kind::ChildList, Kind::ChildCells]
                        .into_iter()
                        .enumerate()
                {
                    push(kind, first + 4 * (i + usize::from(i > 0)), depth, true);
                }
                todo.push((start, place(bricks), [low, high], list, depth + 1));
            }
        }
        if let Some(end) = end {
            push(Kind::End, end, depth, true);
        }
        for (list, counts, ids) in large.into_iter().filter(|(list, ..)| *list != 0) {
            let at = place(list) - 4;
            push(Kind::Extent, at - 8, depth, false);
            push(Kind::Extent, at - 4, depth, false);
            push(counts, at, depth, false);
            for i in 0..word(blob, at) as usize {
                push(ids, at + 4 + 4 * i, depth, i > 0);
            }
        }
    }
    sites
}

/// A mesh with all that a brick grid can have: a triangle in the list of the grid, some in those of
/// blocks and bricks, cells divided twice.
fn everything() -> Mesh {
    let mut mesh = soup(20_000, 0.002, 3);
    for (count, size) in [(3000, 0.02), (3000, 1e-3)] {
        mesh.append(&soup(count, 0.03, 5).map(|p| p.map(|c| 0.3 + size * c)));
    }
    // Each twice, so that lists of bricks have more than one.
    mesh.append(&soup(60, 0.05, 3));
    mesh.append(&soup(60, 0.05, 3));
    mesh.append(&soup(30, 0.3, 5));
    mesh.push([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0]]);
    mesh.push([[-1.0, 1.0, -1.0], [1.0, -1.0, 1.0], [-1.0, -1.0, 1.0]]);
    mesh
}

fn config() -> Config {
    Config { cell_size: 0.46, ..Config::new(Method::Brick) }
}

const KINDS: [Kind; 20] = [
    Kind::LargeCount,
    Kind::LargeId,
    Kind::BlockMask,
    Kind::BlockBase,
    Kind::BlockList,
    Kind::BrickMask,
    Kind::BrickCells,
    Kind::BrickList,
    Kind::Start,
    Kind::End,
    Kind::CellId,
    Kind::BrickCount,
    Kind::BrickId,
    Kind::WholeCount,
    Kind::WholeId,
    Kind::Extent,
    Kind::ChildMask,
    Kind::ChildBase,
    Kind::ChildList,
    Kind::ChildCells,
];

/// A blob and its mesh, with words changed one at a time.
struct Damage {
    mesh: Mesh,
    copy: Copy,
    sites: Vec<Site>,
}

impl Damage {
    fn new() -> Self {
        let mesh = everything();
        let owned = Owned::build(&mesh.view(), &config()).unwrap();
        let (copy, sites) = (Copy::of(owned.bytes()), sites(owned.bytes()));
        Self { mesh, copy, sites }
    }

    fn word(&self, at: usize) -> u32 {
        self.copy.word(at)
    }

    /// Some words of these kinds, spread over the blob.
    fn some(&self, kinds: &[Kind], follows: bool) -> Vec<Site> {
        let is_one = |site: &&Site| kinds.contains(&site.kind) && (site.follows || !follows);
        let all: Vec<Site> = self.sites.iter().filter(is_one).copied().collect();
        assert!(!all.is_empty(), "{kinds:?}");
        let step = all.len().div_ceil(12);
        all.into_iter().step_by(step).collect()
    }

    fn open(&self) -> Grid<'_> {
        Grid::open(self.copy.bytes(), self.mesh.view()).unwrap()
    }

    /// Writes words, asserts that `validate` refuses them and queries end, and takes them back.
    fn is_refused(&mut self, changes: &[(usize, u32)], why: &str) {
        let before: Vec<(usize, u32)> =
            changes.iter().map(|&(at, _)| (at, self.word(at))).collect();
        assert!(before != changes, "{why}: nothing changed");
        changes.iter().for_each(|&(at, word)| self.copy.set(at, &word.to_ne_bytes()));
        let grid = self.open();
        query(&grid);
        let result = prove(&grid);
        let length = self.copy.bytes().len() as u64;
        assert!(
            matches!(result, Err(Error::Corrupt { offset }) if (128..length).contains(&offset)),
            "{why}: {result:?} with {changes:?} for {before:?}"
        );
        before.iter().for_each(|&(at, word)| self.copy.set(at, &word.to_ne_bytes()));
    }
}

#[test]
fn the_mesh_has_everything_and_all_words_are_known() {
    let Damage { mesh, copy, sites } = Damage::new();
    let mut counts: HashMap<Kind, usize> = HashMap::new();
    sites.iter().for_each(|site| *counts.entry(site.kind).or_default() += 1);
    assert!(KINDS.iter().all(|kind| counts.contains_key(kind)), "{counts:?}");
    assert!(sites.iter().any(|site| site.depth == 2), "no cell is divided twice");

    // Every word of the pool but the upper halves of children's masks is one of them, once.
    let mut places: Vec<usize> = sites.iter().map(|site| site.at).collect();
    places.sort_unstable();
    assert!(places.windows(2).all(|pair| pair[0] < pair[1]), "two sites are one word");
    let words = word(copy.bytes(), 88) as usize;
    let pool = sites[0].at;
    let in_pool = sites.iter().filter(|site| site.at >= pool).count();
    assert_eq!(in_pool + counts[&Kind::ChildMask], words);

    let view = mesh.view();
    let grid = Grid::open(copy.bytes(), view).unwrap();
    prove(&grid).unwrap();
    let mut random = Random(89);
    for _ in 0..100 {
        oracle::check(&grid, &Ray::new(random.point(), random.point()));
    }
}

#[test]
fn every_kind_of_word_counts() {
    let mut damage = Damage::new();
    for kind in KINDS {
        for Site { at, .. } in damage.some(&[kind], false) {
            let word = damage.word(at);
            // The upper twelve bits of a cell's ids say in which quarters of the cell triangles lie.
            let flipped = [0, 20, 25, 26, 31].map(|bit| word ^ 1 << bit);
            let moved = [word.wrapping_add(1), word.wrapping_sub(1), !word];
            for value in flipped.into_iter().chain(moved) {
                damage.is_refused(&[(at, value)], &format!("{kind:?}"));
            }
            for value in [0, u32::MAX].into_iter().filter(|&value| value != word) {
                damage.is_refused(&[(at, value)], &format!("{kind:?}"));
            }
        }
    }
    prove(&damage.open()).unwrap();
}

#[test]
fn a_triangle_twice_or_elsewhere_is_refused() {
    let mut damage = Damage::new();
    let ids = [Kind::LargeId, Kind::CellId, Kind::BrickId, Kind::WholeId];
    for kind in ids {
        for Site { at, .. } in damage.some(&[kind], true) {
            let (before, id) = (damage.word(at - 4), damage.word(at));
            damage.is_refused(&[(at, before)], "a triangle twice, another missing");
            damage.is_refused(&[(at - 4, id)], "a triangle twice, another missing");
            let stranger = id ^ 0x400;
            damage.is_refused(&[(at, stranger)], "a triangle of another place");
            let absent = u32::try_from(damage.mesh.indices.len()).unwrap();
            damage.is_refused(&[(at, absent)], "a triangle that is not there");
        }
    }
    prove(&damage.open()).unwrap();
}

#[test]
fn lists_of_different_places_cannot_be_exchanged() {
    let mut damage = Damage::new();
    // A start one word on: a list has lost its first id to the one before it.
    for Site { at, .. } in damage.some(&[Kind::Start], false) {
        let start = damage.word(at);
        damage.is_refused(&[(at, start + 1)], "an id of a cell given to another");
    }
    // A list of a brick for another one of its block, in both directions.
    let lists = damage.some(&[Kind::BrickList], false);
    let lists: Vec<Site> = lists.into_iter().filter(|s| damage.word(s.at) != 0).collect();
    for site in lists {
        damage.is_refused(&[(site.at, 0)], "a brick has lost its list");
    }
    // A block for another one.
    let blocks: Vec<Site> =
        damage.sites.iter().filter(|s| s.kind == Kind::BlockBase && s.follows).copied().collect();
    for pair in blocks.windows(2).take(8) {
        let [a, b] = [pair[0].at - 8, pair[1].at - 8];
        let changes: Vec<(usize, u32)> = (0..4)
            .flat_map(|i| {
                [(a + 4 * i, damage.word(b + 4 * i)), (b + 4 * i, damage.word(a + 4 * i))]
            })
            .collect();
        damage.is_refused(&changes, "two blocks have changed places");
        let same: Vec<(usize, u32)> = (0..4).map(|i| (a + 4 * i, damage.word(b + 4 * i))).collect();
        damage.is_refused(&same, "two blocks have one chunk");
        let none: Vec<(usize, u32)> = (0..4).map(|i| (a + 4 * i, 0)).collect();
        damage.is_refused(&none, "a chunk belongs to no block");
    }
    prove(&damage.open()).unwrap();
}

/// A brick grid without one of its ids: what lies behind it moves up, and every place is said anew.
fn without(blob: &[u8], id: usize) -> Copy {
    let all = sites(blob);
    let pool = all[0].at;
    let start = |base: &Site| pool + 4 * word(blob, base.at) as usize;
    let starts: Vec<usize> =
        all.iter().filter(|site| site.kind == Kind::BlockBase).map(start).collect();
    let mut copy = Copy::of(blob);
    for site in &all {
        let said = word(blob, site.at);
        // From where places count. A block's list is said behind its base, in front of the pool.
        let block = match site.kind {
            Kind::BlockBase => pool,
            Kind::BlockList => pool + 4 * word(blob, site.at - 4) as usize,
            _ => starts.iter().copied().filter(|&start| start <= site.at).max().unwrap_or(pool),
        };
        let place = match site.kind {
            Kind::BlockBase | Kind::Start | Kind::End | Kind::BrickCells | Kind::ChildBase => said,
            Kind::BlockList | Kind::BrickList | Kind::ChildList if said != 0 => said - 1,
            _ => continue,
        };
        if block <= id && block + 4 * (place & !(1 << 31)) as usize > id {
            copy.set_word(site.at, said - 1);
        }
    }
    let words = word(blob, 88) - 1;
    copy.set_word(88, words);
    let mut bytes = copy.bytes().to_vec();
    bytes.drain(id..id + 4);
    bytes.resize((pool + 4 * words as usize).next_multiple_of(64), 0);
    let mut copy = Copy::of(&bytes);
    copy.set(16, &(bytes.len() as u64).to_ne_bytes());
    copy.sign();
    copy
}

/// Nothing about the words that are left is wrong: only a sum tells.
#[test]
fn a_list_that_has_lost_a_triangle_is_refused() {
    let damage = Damage::new();
    for depth in 0..3 {
        let ids = damage.sites.iter().filter(|s| (s.kind, s.depth) == (Kind::CellId, depth));
        let ids: Vec<&Site> = ids.filter(|site| site.follows).collect();
        for site in ids.iter().step_by(ids.len().div_ceil(24)) {
            let copy = without(damage.copy.bytes(), site.at);
            let mut kinds = [&damage.sites, &sites(copy.bytes())].map(|all| {
                let mut kinds: Vec<Kind> = all.iter().map(|site| site.kind).collect();
                kinds.sort_by_key(|kind| *kind as u32);
                kinds
            });
            let lost = kinds[0].iter().rposition(|&kind| kind == Kind::CellId).unwrap();
            kinds[0].remove(lost);
            assert!(kinds[0] == kinds[1], "the rest is a grid");
            let grid = Grid::open(copy.bytes(), damage.mesh.view()).unwrap();
            query(&grid);
            let result = prove(&grid);
            assert!(matches!(result, Err(Error::Corrupt { .. })), "{depth}: {result:?}");
        }
    }
}

/// Divided cells that lead to themselves, to those around them, or to anywhere.
#[test]
fn divided_cells_in_circles_end() {
    let mut damage = Damage::new();
    let mut count = 0;
    for Site { at, .. } in damage.some(&[Kind::ChildBase], false) {
        let (base, list) = (damage.word(at), damage.word(at + 4));
        damage.is_refused(&[(at, 0)], "a cell that holds its block");
        if [damage.word(at - 8), damage.word(at - 4)] != [u32::MAX; 2] {
            count += 1;
            damage.is_refused(&[(at - 8, u32::MAX), (at - 4, u32::MAX)], "a mask of all bricks");
        }
        damage.is_refused(
            &[(at - 8, u32::MAX), (at - 4, u32::MAX), (at, 0)],
            "all bricks, in a circle",
        );
        damage.is_refused(&[(at, base + 4)], "bricks one record on");
        damage.is_refused(&[(at + 4, base.max(list + 1))], "a list that is none");
        for cells in [0, 1, 17, u32::MAX] {
            damage.is_refused(&[(at + 8, cells)], "a number of cells that cannot be");
        }
    }
    // Lists that are said to be divided cells, and the other way round.
    for Site { at, .. } in damage.some(&[Kind::Start], false) {
        let start = damage.word(at);
        damage.is_refused(&[(at, start ^ 1 << 31)], "a list is no divided cell");
    }
    assert!(count > 0, "every divided cell has all bricks");
    prove(&damage.open()).unwrap();
}

#[test]
fn headers_of_other_grids_are_refused() {
    let mesh = soup(300, 0.1, 3);
    let owned = Owned::build(&mesh.view(), &config()).unwrap();
    // Skipped triangles, bounds, cells of another width, hash slots.
    for (at, what) in
        [(36, "skipped"), (44, "density"), (48, "bounds"), (84, "hash"), (104, "cell")]
    {
        for bit in [0, 12, 20] {
            let mut copy = Copy::of(owned.bytes());
            let changed = word(owned.bytes(), at) ^ 1 << bit;
            copy.set(at, &changed.to_ne_bytes());
            copy.sign();
            let Ok(grid) = Grid::open(copy.bytes(), mesh.view()) else { continue };
            query(&grid);
            let result = prove(&grid);
            // Another width may well give the same cells: then it is the header of this grid.
            let is_same = Owned::build(&mesh.view(), &grid.config())
                .is_ok_and(|rebuilt| what == "cell" && rebuilt.bytes() == copy.bytes());
            let is_refused = matches!(result, Err(Error::Corrupt { offset }) if offset < 128);
            assert!(is_same || is_refused, "{what} {bit}: {result:?}");
        }
    }
    for cell_size in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let mut copy = Copy::of(owned.bytes());
        copy.set(104, &cell_size.to_ne_bytes());
        copy.sign();
        let grid = Grid::open(copy.bytes(), mesh.view()).unwrap();
        assert!(matches!(prove(&grid), Err(Error::Corrupt { offset: 104 })), "{cell_size}");
    }
}

/// Random words anywhere in blocks and pool: whatever they say, queries end and answer with
/// triangles that there are, and what `validate` lets pass answers right.
#[test]
fn random_words_are_harmless() {
    let mesh = crowds();
    let view = mesh.view();
    let owned = Owned::build(&view, &config()).unwrap();
    let bytes = owned.bytes();
    let words = (bytes.len() - 128) / 4;
    let mut random = Random(97);
    let mut refused = 0;
    for round in 0..400 {
        let mut copy = Copy::of(bytes);
        for _ in 0..=random.below([1, 20, 2000][round % 3]) {
            let at = 128 + 4 * random.below(words);
            let value = match random.below(4) {
                0 => [0, u32::MAX, 1 << 31, 1][random.below(4)],
                1 => word(bytes, 128 + 4 * random.below(words)),
                _ => u32::try_from(random.below(words)).unwrap() ^ [0, 1 << 31][random.below(2)],
            };
            copy.set(at, &value.to_ne_bytes());
        }
        let Ok(grid) = Grid::open(copy.bytes(), view) else { continue };
        query(&grid);
        if prove(&grid).is_err() {
            refused += 1;
        } else {
            for _ in 0..20 {
                oracle::check(&grid, &Ray::new(random.point(), random.point()));
            }
        }
    }
    assert!(refused > 300, "{refused}");
}
