//! Recursive grids: a pool of grids, each with a head, entries, and the contents of its cells.

use hgrid_core::{Config, Method, Parameters};
use hgrid_tests::copy::Copy;
use hgrid_tests::hostile::{Seed, nested};
use hgrid_tests::meshes::soup;

use super::hashed::list;
use super::sections::*;
use super::{case, refused};

/// Returns grids in grids.
fn crowded() -> Seed {
    Seed::new(nested(), Config::new(Method::Recursive))
}

/// A grid: the offsets of its head and its entries, and the contents of each cell.
#[derive(Debug, Clone)]
struct Node {
    head: usize,
    entries: usize,
    /// Start and end of the contents of each cell, in bytes, and true if they are a grid.
    cells: Vec<(usize, usize, bool)>,
    depth: usize,
}

/// Returns all grids, the root first.
fn nodes(blob: &[u8]) -> Vec<Node> {
    let copy = Copy::of(blob);
    let mut todo = vec![(HEAD, 0)];
    let mut nodes = Vec::new();
    while let Some((head, depth)) = todo.pop() {
        let packed = copy.word(head + 24);
        let count: u32 = [0, 10, 20].map(|shift| packed >> shift & 0x3ff).iter().product();
        let entries = head + 28;
        let cells: Vec<_> = (0..count as usize)
            .map(|cell| {
                let [start, end] = [cell, cell + 1].map(|cell| copy.word(entries + 4 * cell));
                let [from, to] = [start, end].map(|word| HEAD + 4 * (word & !GRID) as usize);
                (from, to, start & GRID != 0)
            })
            .collect();
        let grids = cells.iter().filter(|cell| cell.2);
        todo.extend(grids.map(|&(from, ..)| (from, depth + 1)));
        nodes.push(Node { head, entries, cells, depth });
    }
    nodes
}

#[test]
fn every_word_of_a_head_counts() {
    let seed = crowded();
    let nodes = nodes(&seed.blob);
    assert!(nodes.iter().any(|node| node.depth == 2), "no grid at depth 2");
    for node in [&nodes[0], nodes.iter().find(|node| node.depth == 2).unwrap(), &nodes[1]] {
        let at = HEAD..seed.blob.len();
        for word in (0..7).map(|word| node.head + 4 * word) {
            let cases = [
                case("a little more", at.clone(), move |b| add(b, word, 1)),
                case("a little less", at.clone(), move |b| add(b, word, -1)),
                case("another sign", at.clone(), move |b| flip(b, word, 31)),
                case("nothing like it", at.clone(), move |b| b.set_word(word, u32::MAX)),
            ];
            refused(&seed, &cases);
        }
    }
}

#[test]
fn entries_lead_to_one_thing_after_the_other() {
    let seed = crowded();
    let end = seed.blob.len();
    let pool = HEAD..end;
    for node in nodes(&seed.blob).iter() {
        let count = node.cells.len();
        let last = node.entries + 4 * count;
        let mut cases = vec![
            case("the end is a grid", pool.clone(), move |b| flip(b, last, 31)),
            case("the end is early", pool.clone(), move |b| add(b, last, -1)),
        ];
        for cell in 0..count {
            let at = node.entries + 4 * cell;
            cases.extend([
                case("a cell begins later", pool.clone(), move |b| add(b, at, 1)),
                case("a cell begins earlier", pool.clone(), move |b| add(b, at, -1)),
                case("a list is a grid, or a grid a list", pool.clone(), move |b| flip(b, at, 31)),
            ]);
        }
        // A cell that leads to the grid around it.
        let head = u32::try_from((node.head - HEAD) / 4).unwrap();
        let first = node.entries;
        cases.push(case("a grid in itself", pool.clone(), move |b| b.set_word(first, head | GRID)));
        refused(&seed, &cases);
    }
}

#[test]
fn lists_hold_the_triangles_of_their_cells() {
    let seed = crowded();
    let pool = HEAD..seed.blob.len();
    let lists = nodes(&seed.blob).into_iter().flat_map(|node| node.cells);
    let lists: Vec<_> = lists.filter(|&(from, to, is_grid)| !is_grid && to - from >= 8).collect();
    assert!(lists.len() > 3, "{lists:?}");
    for (from, to, _) in lists {
        let mut cases = list(&seed.mesh, from..to, pool.clone());
        // A triangle of another cell, which keeps the ids ascending.
        let ids = |blob: &[u8]| {
            (from..to).step_by(4).map(|at| Copy::of(blob).word(at)).collect::<Vec<_>>()
        };
        let before = ids(&seed.blob);
        let free = |id: &u32| !before.contains(id);
        let stranger = (before[before.len() - 1] + 1..seed.mesh.indices.len() as u32).find(free);
        if let Some(stranger) = stranger.filter(|_| before.len() > 1) {
            let last = to - 4;
            cases.push(case("a triangle of another cell", pool.clone(), move |b| {
                b.set_word(last, stranger);
            }));
        }
        refused(&seed, &cases);
    }
}

#[test]
fn nothing_is_missing_and_nothing_is_left_over() {
    // One grid without subgrids.
    let parameters = Parameters::Recursive { density: 8.0, depth: 1 };
    let seed = Seed::new(soup(12, 0.5, 51), parameters.into());
    let nodes = nodes(&seed.blob);
    assert_eq!(nodes.len(), 1);
    let node = nodes[0].clone();
    let full = node.cells.iter().position(|&(from, to, _)| to - from > 4).unwrap();
    let (from, ..) = node.cells[full];
    let (entries, count) = (node.entries, node.cells.len());
    let end = seed.blob.len();
    refused(
        &seed,
        &[
            case("a triangle is missing", HEAD..end, move |b| {
                resized(b, HEAD, |bytes| {
                    bytes.drain(from..from + 4);
                });
                (full + 1..=count).for_each(|cell| add(b, entries + 4 * cell, -1));
            }),
            case("a word that nobody reads", HEAD..end + 64, |b| {
                resized(b, HEAD, |bytes| bytes.extend([0; 4]));
            }),
        ],
    );
}

#[test]
fn grids_are_no_deeper_than_the_header_says() {
    let seed = crowded();
    // The resolution of the root depends on the depth, so most other depths are refused because of it.
    for depth in [1, 2, 4] {
        refused(
            &seed,
            &[case("another depth", 0..seed.blob.len(), move |b| {
                b.set_word(DEPTH, depth);
            })],
        );
    }
}
