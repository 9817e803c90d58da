//! Trees: nodes with quantised boxes, and leaves that hold each triangle once.

use hgrid_core::{Config, Error, Grid, Method, refit};
use hgrid_tests::copy::Copy;
use hgrid_tests::hostile::{Seed, agrees, ends, fixed_rays};
use hgrid_tests::meshes::{Mesh, ball, room, soup};
use hgrid_tests::owned::prove;
use hgrid_tests::random::Random;

use super::sections::*;
use super::{Case, answers_right, case, refused};

/// The fields of a header that a tree alone has.
const NODE_COUNT: usize = 112;
const LEVELS: usize = 116;

/// The size of a node, and the offsets of its fields.
const NODE: usize = 80;
const ORIGIN: usize = 0;
const EXPONENTS: usize = 12;
const INNER: usize = 15;
const CHILD: usize = 16;
const FIRST: usize = 20;
const COUNTS: usize = 24;
const BOUNDS: usize = 32;

/// The sections of a tree.
#[derive(Debug, Clone, Copy)]
struct Tree {
    ids: usize,
    id_count: usize,
    nodes: usize,
    node_count: usize,
}

/// A child of a node: another node, or a leaf of `count` ids from word `first` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Child {
    Node(usize),
    Leaf { first: usize, count: usize },
}

impl Tree {
    fn of(blob: &[u8]) -> Self {
        let copy = Copy::of(&blob[..HEAD]);
        let [id_count, node_count] = [REFERENCE_COUNT, NODE_COUNT].map(|at| copy.word(at) as usize);
        let nodes = HEAD + (4 * id_count).next_multiple_of(64);
        Self { ids: HEAD, id_count, nodes, node_count }
    }

    /// Returns the offset of a field of a node.
    const fn at(&self, node: usize, field: usize) -> usize {
        self.nodes + NODE * node + field
    }

    /// Returns the range of offsets in errors about a node.
    const fn node(&self, node: usize) -> core::ops::Range<usize> {
        self.at(node, 0)..self.at(node + 1, 0)
    }

    /// Returns the range of offsets in errors about ids.
    const fn all_ids(&self) -> core::ops::Range<usize> {
        self.ids..self.ids + 4 * self.id_count
    }

    /// Returns the range of offsets in errors about anything but the header.
    const fn all(&self) -> core::ops::Range<usize> {
        self.ids..self.at(self.node_count, 0)
    }

    /// Returns the children of a node with their slots.
    fn children(&self, blob: &[u8], node: usize) -> Vec<(usize, Child)> {
        let copy = Copy::of(blob);
        let mut child = copy.word(self.at(node, CHILD)) as usize;
        let mut first = copy.word(self.at(node, FIRST)) as usize;
        let mut children = Vec::new();
        for slot in 0..8 {
            let count = blob[self.at(node, COUNTS + slot)] as usize;
            if blob[self.at(node, INNER)] >> slot & 1 == 1 {
                children.push((slot, Child::Node(child)));
                child += 1;
            } else if count > 0 {
                children.push((slot, Child::Leaf { first, count }));
                first += count;
            }
        }
        children
    }

    /// Returns the path to the deepest leaf: each node with the slot of the next one, or of the leaf.
    fn deepest(&self, blob: &[u8]) -> Vec<(usize, usize)> {
        let mut ways = vec![vec![]];
        let mut deepest: Vec<(usize, usize)> = Vec::new();
        let mut nodes = vec![0];
        while let (Some(node), Some(way)) = (nodes.pop(), ways.pop()) {
            for (slot, child) in self.children(blob, node) {
                let way = [&way[..], &[(node, slot)]].concat();
                match child {
                    Child::Node(child) => {
                        nodes.push(child);
                        ways.push(way);
                    }
                    Child::Leaf { .. } if way.len() > deepest.len() => deepest = way,
                    Child::Leaf { .. } => {}
                }
            }
        }
        deepest
    }
}

/// Returns enough triangles for a tree on top of several roots, some of them in a crowd.
fn deep() -> Seed {
    let mut mesh = soup(400, 0.05, 3);
    mesh.append(&soup(300, 0.05, 5).map(|p| p.map(|c| 0.3 + 1e-3 * c)));
    Seed::new(mesh, Config::new(Method::Bvh))
}

#[test]
fn every_triangle_stands_in_one_leaf() {
    let seed = deep();
    let t = Tree::of(&seed.blob);
    let ids = t.all_ids();
    let way = t.deepest(&seed.blob);
    let &(last, slot) = way.last().unwrap();
    let leaf = t.children(&seed.blob, last).into_iter().find(|(s, _)| *s == slot).unwrap().1;
    let Child::Leaf { first, .. } = leaf else { panic!("{leaf:?}") };
    let word = move |at: usize| t.ids + 4 * at;
    let counts = REFERENCE_COUNT..REFERENCE_COUNT + 4;
    refused(
        &seed,
        &[
            case("an id that no triangle has", ids.clone(), move |b| {
                b.set_word(word(first), b.word(32));
            }),
            case("an id far away", ids.clone(), move |b| b.set_word(word(first), u32::MAX)),
            case("an id of a triangle elsewhere", ids.clone(), move |b| {
                let other = (0..t.id_count as u32).find(|&id| {
                    let [one, other] = [b.word(word(first)), id].map(|id| seed_center(id as usize));
                    (0..3).any(|axis| (one[axis] - other[axis]).abs() > 0.5)
                });
                b.set_word(word(first), other.unwrap());
            }),
            case("an id twice, and another one missing", ids.clone(), move |b| {
                b.set_word(word(first), b.word(word(first + 1)));
            }),
            case("two ids of distant leaves", ids.clone(), move |b| {
                let [one, other] = [0, t.id_count - 1].map(|at| b.word(word(at)));
                b.set_word(word(0), other);
                b.set_word(word(t.id_count - 1), one);
            }),
            case("a leaf that reaches into the next one", t.all(), move |b| {
                let at = t.at(last, COUNTS + slot);
                let count = b.bytes()[at];
                b.set(at, &[if count == 8 { 7 } else { count + 1 }]);
            }),
            case("a leaf without its first id", t.all(), move |b| add(b, t.at(last, FIRST), 1)),
            case("ids behind the last one", t.node(last), move |b| {
                b.set_word(t.at(last, FIRST), t.id_count as u32);
            }),
            case("ids that wrap", t.all(), move |b| b.set_word(t.at(last, FIRST), u32::MAX - 1)),
            case("fewer ids than triangles", counts.clone(), move |b| {
                // The ids take as many blocks as before, so nothing moves.
                assert!(t.id_count % 16 > 1);
                b.set_word(word(t.id_count - 1), 0);
                add(b, REFERENCE_COUNT, -1);
            }),
            case("more ids than triangles", counts, move |b| add(b, REFERENCE_COUNT, 1)),
        ],
    );
}

/// Returns the first corner of a triangle in the mesh of [`deep`].
fn seed_center(id: usize) -> [f32; 3] {
    let mesh = deep_mesh();
    mesh.positions[mesh.indices[id][0] as usize]
}

fn deep_mesh() -> &'static Mesh {
    static MESH: std::sync::OnceLock<Mesh> = std::sync::OnceLock::new();
    MESH.get_or_init(|| deep().mesh)
}

/// Boxes are tight: two steps less on any side loses a triangle or its margin, on every level of the path.
#[test]
fn boxes_hold_what_is_below_them() {
    let seed = deep();
    let t = Tree::of(&seed.blob);
    let way = t.deepest(&seed.blob);
    assert!(way.len() > 3, "{way:?}");
    let mut cases: Vec<Case<'static>> = Vec::new();
    for &(node, slot) in &way {
        for side in 0..6 {
            let at = t.at(node, BOUNDS + 8 * side + slot);
            let inwards = if side < 3 { 2 } else { u8::MAX - 1 };
            cases.push(case("a box two steps smaller", t.all_ids(), move |b| {
                b.set(at, &[b.bytes()[at].wrapping_add(inwards)]);
            }));
            cases.push(case("a box that is inside out", t.all_ids(), move |b| {
                b.set(at, &[if side < 3 { 0xff } else { 0 }]);
            }));
        }
        for axis in 0..3 {
            let origin = t.at(node, ORIGIN + 4 * axis);
            let exponent = t.at(node, EXPONENTS + axis);
            cases.push(case("a box elsewhere", t.all_ids(), move |b| {
                b.set_word(origin, (f32::from_bits(b.word(origin)) + 1.0).to_bits());
            }));
            cases.push(case("a box of half the size", t.all_ids(), move |b| {
                b.set(exponent, &[b.bytes()[exponent] - 1]);
            }));
        }
    }
    refused(&seed, &cases);
}

#[test]
fn nodes_are_what_a_build_writes() {
    let seed = deep();
    let t = Tree::of(&seed.blob);
    let way = t.deepest(&seed.blob);
    let (node, slot) = way[way.len() - 1];
    let (above, inner) = way[way.len() - 2];
    let mut cases = Vec::new();
    for axis in 0..3 {
        let exponent = t.at(node, EXPONENTS + axis);
        let origin = t.at(node, ORIGIN + 4 * axis);
        for value in [0, 20, 254, 255] {
            cases.push(case("a step that is none", t.node(node), move |b| {
                b.set(exponent, &[value]);
            }));
        }
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            cases.push(case("an origin that is none", t.node(node), move |b| {
                b.set_word(origin, value.to_bits());
            }));
        }
    }
    // Take a node that has an empty slot.
    let has_room = |&node: &usize| t.children(&seed.blob, node).len() < 8;
    let short = (0..t.node_count).find(has_room).expect("a node with fewer children");
    let empty = t.children(&seed.blob, short).len();
    for side in 0..6 {
        cases.push(case("a box without a child", t.node(short), move |b| {
            b.set(t.at(short, BOUNDS + 8 * side + empty), &[7]);
        }));
    }
    // The margin of a box is less than the last digit of its coordinates.
    cases.push(case("steps much smaller than the origin", t.node(short), move |b| {
        b.set_word(t.at(short, ORIGIN), 1e6_f32.to_bits());
        b.set(t.at(short, EXPONENTS), &[100]);
    }));
    let counts_at = move |slot: usize| t.at(node, COUNTS + slot);
    let header = NODE_COUNT..NODE_COUNT + 4;
    cases.extend([
        case("a child that is both", t.node(above), move |b| {
            b.set(t.at(above, COUNTS + inner), &[1]);
        }),
        case("a leaf that is a node, too", t.node(node), move |b| {
            let at = t.at(node, INNER);
            b.set(at, &[b.bytes()[at] | 1 << slot]);
        }),
        case("more than eight ids", t.node(node), move |b| b.set(counts_at(slot), &[9])),
        case("very many ids", t.node(node), move |b| b.set(counts_at(slot), &[0xff])),
        case("no children", t.node(node), move |b| {
            b.set(t.at(node, INNER), &[0]);
            b.set(counts_at(0), &[0; 8]);
        }),
        case("a child that is its parent", t.all(), move |b| {
            b.set_word(t.at(above, CHILD), above as u32);
        }),
        case("a child that is the root", t.all(), move |b| b.set_word(t.at(above, CHILD), 0)),
        case("a child that is another's", t.all(), move |b| add(b, t.at(above, CHILD), -1)),
        case("a child behind the last one", t.node(above), move |b| {
            b.set_word(t.at(above, CHILD), t.node_count as u32);
        }),
        case("a child far away", t.node(above), move |b| {
            b.set_word(t.at(above, CHILD), u32::MAX);
        }),
        case("a node that nobody has", header.clone(), move |b| {
            let bytes = [b.bytes(), &[0; 128]].concat();
            let length = (t.at(t.node_count + 1, 0)).next_multiple_of(64);
            *b = Copy::of(&bytes[..length]);
            b.set(BLOB_BYTES, &(length as u64).to_ne_bytes());
            add(b, NODE_COUNT, 1);
        }),
        case("a subtree that is left out", 0..seed.blob.len(), move |b| {
            let at = t.at(above, INNER);
            b.set(at, &[b.bytes()[at] & !(1 << inner)]);
        }),
        case("a level more", LEVELS..LEVELS + 4, |b| add(b, LEVELS, 1)),
        case("a level less", LEVELS..LEVELS + 4, |b| add(b, LEVELS, -1)),
        case("no levels", LEVELS..LEVELS + 4, |b| b.set_word(LEVELS, 0)),
        case("levels without end", LEVELS..LEVELS + 4, |b| b.set_word(LEVELS, u32::MAX)),
    ]);
    refused(&seed, &cases);
}

/// The size of a node's fine sides, and the offset of its number behind them.
const FINE: usize = 196;
const OWNER: usize = 192;

#[test]
fn fine_sides_belong_to_one_node_and_hold_its_children() {
    let seed = Seed::new(room(), Config::new(Method::Bvh));
    let t = Tree::of(&seed.blob);
    let copy = Copy::of(&seed.blob);
    let fine = t.at(t.node_count, 0).next_multiple_of(64);
    let count = copy.word(HASH_COUNT);
    assert!(count > 1);
    let of = |number: u32| {
        let is_owner = |&node: &usize| copy.word(t.at(node, FIRST)) == 1 << 31 | number;
        (0..t.node_count).find(is_owner).expect("a node for all fine sides")
    };
    let (root, other) = (of(0), of(1));
    assert_eq!((root, copy.word(fine + OWNER)), (0, 0));
    assert_eq!(copy.word(fine + FINE + OWNER) as usize, other);
    let side = |side: usize, slot: usize| fine + FINE + 32 * side + 4 * slot;
    let &(slot, _) = t.children(&seed.blob, other).first().unwrap();
    let mut cases = vec![
        case("sides of another node", t.node(other), move |b| {
            b.set_word(t.at(other, FIRST), 1 << 31);
        }),
        case("sides behind the last ones", t.node(other), move |b| {
            b.set_word(t.at(other, FIRST), 1 << 31 | count);
        }),
        case("another owner", t.node(other), move |b| add(b, fine + FINE + OWNER, 1)),
        case("sides that no node has", HASH_COUNT..HASH_COUNT + 4, move |b| {
            b.set_word(t.at(other, FIRST), 0);
        }),
        case("fewer sides", 0..HEAD, |b| add(b, HASH_COUNT, -1)),
        case("sides that no memory holds", 0..HEAD, |b| b.set_word(HASH_COUNT, u32::MAX)),
    ];
    for axis in 0..3 {
        // Sides in the middle of the box cut triangles off.
        let [low, high] = [side(axis, slot), side(axis + 3, slot)];
        let [from, to] = [low, high].map(|at| f32::from_bits(copy.word(at)));
        let middle = (0.5 * (from + to)).to_bits();
        for (what, at) in [("a least side inside", low), ("a greatest side inside", high)] {
            cases.push(case(what, t.all(), move |b| b.set_word(at, middle)));
        }
        // A number that is none holds nothing.
        cases.push(case("no number", t.all(), move |b| b.set_word(low, f32::NAN.to_bits())));
    }
    refused(&seed, &cases);

    // Wider sides are right.
    let mut copy = Copy::of(&seed.blob);
    for axis in 0..3 {
        copy.set_word(side(axis, slot), (-2.0_f32).to_bits());
        copy.set_word(side(axis + 3, slot), 2.0_f32.to_bits());
    }
    let grid = Grid::open(copy.bytes(), seed.mesh.view()).unwrap();
    prove(&grid).unwrap();
    answers_right(&grid, &seed.mesh);
}

#[test]
fn the_header_of_a_tree_has_nothing_else() {
    let seed = deep();
    let any = 0..HEAD + 64;
    let mut cases = vec![
        case("fewer nodes", any.clone(), |b| add(b, NODE_COUNT, -2)),
        case("no nodes", any.clone(), |b| b.set_word(NODE_COUNT, 0)),
        case("nodes that no memory holds", any.clone(), |b| b.set_word(NODE_COUNT, u32::MAX)),
        case("ids that no memory holds", any, |b| b.set_word(REFERENCE_COUNT, u32::MAX)),
    ];
    for axis in 0..3 {
        let at = RESOLUTION + 4 * axis;
        cases.push(case("more than one cell", RESOLUTION..HASH_COUNT, move |b| b.set_word(at, 2)));
    }
    for at in [HASH_COUNT, MACROCELL_FACTOR, SUBDIVIDE_ABOVE, DEPTH, CELL_SIZE, DENSITY] {
        // Contents 1 to 3 belong to other functions that open blobs.
        cases.push(case("a field of another method", 0..HEAD, move |b| b.set_word(at, 4)));
    }
    refused(&seed, &cases);
}

/// The padding after the ids and after the nodes is zero.
#[test]
fn what_fills_up_the_sections_of_a_tree_is_zero() {
    // Sections end at multiples of 64 bytes: take a tree in which both have padding.
    let behind = |seed: &Seed| {
        let t = Tree::of(&seed.blob);
        [t.ids + 4 * t.id_count..t.nodes, t.at(t.node_count, 0)..seed.blob.len()]
    };
    let seed = (101..120)
        .map(|count| Seed::new(soup(count, 0.05, 3), Config::new(Method::Bvh)))
        .find(|seed| behind(seed).iter().all(|range| !range.is_empty()));
    let seed = seed.expect("sizes of all kinds");
    let [behind_ids, behind_nodes] = behind(&seed);
    for at in behind_ids.chain(behind_nodes) {
        refused(&seed, &[case("filled up with something", 16..24, move |b| b.set(at, &[1]))]);
    }
}

/// A hostile tree: its nodes form cycles, and its leaves overlap.
#[test]
fn circles_end() {
    let seed = deep();
    let t = Tree::of(&seed.blob);
    for child in [0, 1, t.node_count as u32 / 2, u32::MAX - 3] {
        let mut copy = Copy::of(&seed.blob);
        for node in 0..t.node_count {
            copy.set(t.at(node, INNER), &[0x7f]);
            copy.set_word(t.at(node, CHILD), child);
            copy.set(t.at(node, COUNTS), &[0, 0, 0, 0, 0, 0, 0, 8]);
            copy.set(t.at(node, BOUNDS), &[0; 24]);
            copy.set(t.at(node, BOUNDS + 24), &[0xff; 24]);
        }
        copy.sign();
        let view = seed.mesh.view();
        let grid = Grid::open(copy.bytes(), view).unwrap();
        ends(&grid, &fixed_rays(grid.bounds(), 40));
        assert!(matches!(prove(&grid), Err(Error::Corrupt { .. })));
    }
}

/// A refit follows the nodes, too: it finds where they lead astray before it writes.
#[test]
fn a_refit_of_nodes_that_lead_astray_is_refused() {
    let seed = deep();
    let t = Tree::of(&seed.blob);
    let below = |node: usize| {
        let children = t.children(&seed.blob, node).into_iter();
        children.filter_map(
            |(_, child)| if let Child::Node(child) = child { Some(child) } else { None },
        )
    };
    let size = |node: usize| {
        let (mut count, mut rest) = (0, vec![node]);
        while let Some(node) = rest.pop() {
            count += 1;
            rest.extend(below(node));
        }
        count
    };
    let small = below(0).min_by_key(|&node| size(node)).expect("nodes below the root");
    let large = below(0).max_by_key(|&node| size(node)).expect("nodes below the root");
    assert!(size(small) < size(large));
    let way = t.deepest(&seed.blob);
    let &[.., (above, _), (last, leaf)] = &way[..] else { panic!("no deep tree") };
    let inner = |node: usize| seed.blob[t.at(node, INNER)];
    let highest = 7 - inner(above).leading_zeros() as usize;
    let count = NODE_COUNT..NODE_COUNT + 4;
    let cases = [
        case("a node that none leads to", count, |b| {
            b.set(t.at(above, INNER), &[inner(above) & !(1 << highest)]);
        }),
        case("a leaf of too many", t.node(last), |b| b.set(t.at(last, COUNTS + leaf), &[9])),
        case("a leaf behind the ids", t.node(last), |b| {
            b.set_word(t.at(last, FIRST), t.id_count as u32);
        }),
        case("a node behind the last one", t.node(t.node_count), |b| {
            b.set_word(t.at(0, CHILD), t.node_count as u32);
        }),
        case("a circle", t.all(), |b| b.set_word(t.at(above, CHILD), 0)),
        case("nodes that are met twice", t.all(), |b| {
            b.set(t.at(small, 0), &seed.blob[t.node(large)]);
        }),
    ];
    not_refitted(&seed, &cases);

    let seed = Seed::new(room(), Config::new(Method::Bvh));
    let t = Tree::of(&seed.blob);
    let fine = t.at(t.node_count, 0).next_multiple_of(64);
    let cases = [case("sides of another node", t.node(0), |b| add(b, fine + OWNER, 1))];
    not_refitted(&seed, &cases);
}

/// Changes a blob, corrects its checksum, and asserts that a refit refuses it at the right offset and leaves it alone.
fn not_refitted(seed: &Seed, cases: &[Case<'_>]) {
    for (what, at, change) in cases {
        let mut copy = Copy::of(&seed.blob);
        change(&mut copy);
        copy.sign();
        let before = copy.bytes().to_vec();
        assert!(before != seed.blob, "{what}: nothing has changed");
        let result = refit(copy.bytes_mut(), &seed.mesh.view());
        let is_there = matches!(result, Err(Error::Corrupt { offset })
            if usize::try_from(offset).is_ok_and(|offset| at.contains(&offset)));
        assert!(is_there, "{what}: {result:?}, expected at {at:?}");
        assert!(copy.bytes() == before, "{what}: bytes have changed");
    }
}

/// Trees that no build writes, but that are right: `validate` accepts them, and they answer as brute force does.
#[test]
#[cfg_attr(miri, ignore = "hours")]
fn what_is_proven_answers_right() {
    let mut random = Random(11);
    let (mut proven, mut tried) = (0, 0);
    for mesh in [soup(60, 0.2, 9), ball(5, 1.0), deep_mesh().clone()] {
        let seed = Seed::new(mesh, Config::new(Method::Bvh));
        let t = Tree::of(&seed.blob);
        for _ in 0..if seed.blob.len() < 5000 { 1500 } else { 300 } {
            let mut copy = Copy::of(&seed.blob);
            for _ in 0..1 + random.below(3) {
                let node = random.below(t.node_count);
                let field =
                    [BOUNDS + random.below(48), random.below(12), BOUNDS + random.below(48)];
                let at = t.at(node, field[random.below(3)]);
                let byte = copy.bytes()[at];
                let by = random.below(9) as u8;
                copy.set(at, &[byte.wrapping_add(by).wrapping_sub(4)]);
            }
            copy.sign();
            let grid = Grid::open(copy.bytes(), seed.mesh.view()).unwrap();
            let rays = fixed_rays(grid.bounds(), 12);
            tried += 1;
            if prove(&grid).is_ok() {
                agrees(&grid, &rays);
                proven += 1;
            } else {
                ends(&grid, &rays[..4]);
            }
        }
    }
    assert!(proven > 100 && proven < tried - 100, "{proven} of {tried}");
}

/// Two leaves of a node are exchanged: the tree is right, but no build makes it.
#[test]
fn children_in_any_order_are_right() {
    let seed = deep();
    let t = Tree::of(&seed.blob);
    let mut bytes = seed.blob.clone();
    // Exchange leaves of equal length, with their ids and boxes.
    let mut swapped = 0;
    for node in 0..t.node_count {
        let children = t.children(&seed.blob, node);
        let leaves = children.iter().filter_map(|&(slot, child)| match child {
            Child::Leaf { first, count } => Some((slot, first, count)),
            Child::Node(_) => None,
        });
        let leaves: Vec<_> = leaves.collect();
        let pair = leaves.windows(2).find(|pair| pair[0].2 == pair[1].2);
        let Some(&[(one, first, count), (other, second, _)]) = pair else { continue };
        for i in 0..4 * count {
            bytes.swap(t.ids + 4 * first + i, t.ids + 4 * second + i);
        }
        for side in 0..6 {
            let row = t.at(node, BOUNDS + 8 * side);
            bytes.swap(row + one, row + other);
        }
        swapped += 1;
    }
    assert!(swapped > 10, "{swapped}");
    let mut copy = Copy::of(&bytes);
    copy.sign();
    let grid = Grid::open(copy.bytes(), seed.mesh.view()).unwrap();
    prove(&grid).unwrap();
    answers_right(&grid, &seed.mesh);
}
