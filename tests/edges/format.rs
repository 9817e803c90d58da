//! docs/format.md is enough to read a blob: this reader follows the page and shares nothing with the library.
//!
//! The reader turns the blob of any method into boxes with ids, checks the statements of the page, and
//! answers rays: it finds the boxes that a ray meets and tests their triangles with a triangle test of its
//! own.

use hgrid_core::{Block, Config, Grid, MeshPart, Ray, TriangleMesh};
use hgrid_tests::joined::{Parts, merged};
use hgrid_tests::meshes::{Mesh, ball, room};
use hgrid_tests::methods::configs;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;

pub(super) type Point = [f64; 3];

/// A part of space with the triangles in it.
pub(super) struct Leaf {
    pub(super) min: Point,
    pub(super) max: Point,
    pub(super) ids: Vec<u32>,
}

/// The bytes of a blob, with functions that read numbers at offsets.
#[derive(Clone, Copy)]
pub(super) struct Bytes<'a>(pub(super) &'a [u8]);

impl Bytes<'_> {
    pub(super) fn u32(self, at: usize) -> u32 {
        u32::from_ne_bytes(self.0[at..at + 4].try_into().unwrap())
    }

    pub(super) fn u64(self, at: usize) -> u64 {
        u64::from_ne_bytes(self.0[at..at + 8].try_into().unwrap())
    }

    pub(super) fn f32(self, at: usize) -> f64 {
        f64::from(f32::from_bits(self.u32(at)))
    }

    pub(super) fn f32s(self, at: usize) -> Point {
        [0, 4, 8].map(|axis| self.f32(at + axis))
    }

    fn u32s(self, at: usize) -> [u32; 3] {
        [0, 4, 8].map(|axis| self.u32(at + axis))
    }
}

/// The header's fields, named as in the page.
pub(super) struct Header {
    pub(super) blob_bytes: usize,
    pub(super) vertex_count: usize,
    pub(super) triangle_count: usize,
    pub(super) skipped_count: usize,
    pub(super) method: u32,
    pub(super) bounds_min: Point,
    pub(super) bounds_max: Point,
    pub(super) resolution: [u32; 3],
    pub(super) hash_count: usize,
    pub(super) reference_count: usize,
    pub(super) macrocell_factor: u32,
    pub(super) content: u32,
    pub(super) mesh: u32,
    pub(super) node_count: usize,
}

pub(super) fn header(blob: Bytes<'_>) -> Header {
    assert_eq!(&blob.0[..8], b"hgrid\x0d\x0a\x1a");
    assert_eq!((blob.u32(8), blob.u32(12)), (0x0102_0304, 4));
    let mut h = 0xcbf2_9ce4_8422_2325_u64;
    for word in 0..31 {
        h = (h ^ u64::from(blob.u32(4 * word))).wrapping_mul(0x0100_0000_01b3);
    }
    h ^= h >> 29;
    assert_eq!(blob.u32(124), (h & 0xffff_ffff) as u32 ^ (h >> 32) as u32);
    Header {
        blob_bytes: blob.u64(16) as usize,
        vertex_count: blob.u64(24) as usize,
        triangle_count: blob.u32(32) as usize,
        skipped_count: blob.u32(36) as usize,
        method: blob.u32(40),
        bounds_min: blob.f32s(48),
        bounds_max: blob.f32s(60),
        resolution: blob.u32s(72),
        hash_count: blob.u32(84) as usize,
        reference_count: blob.u32(88) as usize,
        macrocell_factor: blob.u32(92),
        content: blob.u32(104),
        mesh: blob.u32(108),
        node_count: blob.u32(112) as usize,
    }
}

/// Reads sections one after the other.
pub(super) struct Sections<'a> {
    pub(super) blob: Bytes<'a>,
    pub(super) at: usize,
}

impl Sections<'_> {
    /// Returns the start of the next section, which has `bytes` bytes, and asserts that its padding is zero.
    pub(super) fn next(&mut self, bytes: usize) -> usize {
        let (at, end) = (self.at, self.at + bytes);
        self.at = end.next_multiple_of(64);
        assert!(self.blob.0[end..self.at].iter().all(|&byte| byte == 0));
        at
    }
}

pub(super) fn bvh(blob: Bytes<'_>, header: &Header) -> Vec<Leaf> {
    assert_eq!(header.resolution, [1; 3]);
    assert_eq!(header.reference_count, header.triangle_count - header.skipped_count);
    let mut sections = Sections { blob, at: 128 };
    let ids = sections.next(4 * header.reference_count);
    let nodes = sections.next(80 * header.node_count);
    let fine = sections.next(196 * header.hash_count);
    assert_eq!(sections.at, header.blob_bytes);

    let (mut leaves, mut met, mut met_fine) = (Vec::new(), 0, 0);
    // Each node on the way down stands with the box that it may fill: the intersection of the fine boxes above it.
    let everywhere = ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
    let mut open = vec![(0, everywhere)];
    while let Some((number, (min, max))) = open.pop() {
        let node = nodes + 80 * number;
        let (origin, word) = (blob.f32s(node), blob.u32(node + 12));
        met += 1;
        let (mut child, mut first) = (blob.u32(node + 16) as usize, blob.u32(node + 20) as usize);
        let step = |axis: usize| 2f64.powi((word >> (8 * axis) & 0xff) as i32 - 127);
        let sides = (first >> 31 == 1).then_some(fine + 196 * (first & 0x7fff_ffff));
        if let Some(sides) = sides {
            assert_eq!(blob.u32(sides + 192) as usize, number);
            assert_eq!(blob.0[node + 24..node + 32], [0; 8]);
            met_fine += 1;
        }
        for s in 0..8 {
            let count = usize::from(blob.0[node + 24 + s]);
            let (mut min, mut max) = (min, max);
            if let Some(sides) = sides {
                for axis in 0..3 {
                    let at = |side: usize| blob.f32(sides + 32 * side + 4 * s);
                    let [low, high] = [at(axis), at(axis + 3)];
                    let none = [f64::from(f32::MAX), f64::from(f32::MIN)];
                    assert!(word >> (24 + s) & 1 == 1 || [low, high] == none);
                    (min[axis], max[axis]) = (min[axis].max(low), max[axis].min(high));
                }
            }
            if word >> (24 + s) & 1 == 1 {
                assert_eq!(count, 0);
                open.push((child, (min, max)));
                child += 1;
            } else if count > 0 {
                let side = |side: usize| {
                    let bound = f64::from(blob.0[node + 32 + 8 * side + s]);
                    origin[side % 3] + bound * step(side % 3)
                };
                let ids = (first..first + count).map(|at| blob.u32(ids + 4 * at)).collect();
                let (low, high) = ([0, 1, 2].map(side), [3, 4, 5].map(side));
                let min = [0, 1, 2].map(|axis: usize| low[axis].max(min[axis]));
                let max = [0, 1, 2].map(|axis: usize| high[axis].min(max[axis]));
                leaves.push(Leaf { min, max, ids });
                first += count;
            } else {
                let bounds = [0, 1, 2, 3, 4, 5].map(|side| blob.0[node + 32 + 8 * side + s]);
                assert_eq!(bounds, [255, 255, 255, 0, 0, 0]);
            }
        }
    }
    assert_eq!((met, met_fine), (header.node_count, header.hash_count));
    let sum: usize = leaves.iter().map(|leaf| leaf.ids.len()).sum();
    assert_eq!(sum, header.reference_count);
    leaves
}

/// Returns the part of the grid's box between two fractions of its sides.
fn part(header: &Header, low: Point, high: Point) -> (Point, Point) {
    let at = |position: Point| {
        [0, 1, 2].map(|axis| {
            let (min, max) = (header.bounds_min[axis], header.bounds_max[axis]);
            min + (max - min) * position[axis] / f64::from(header.resolution[axis])
        })
    };
    (at(low), at(high))
}

/// Returns the coordinates of all cells, given the number of cells along x, y and z.
fn cells([x, y, z]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..z).flat_map(move |z| (0..y).flat_map(move |y| (0..x).map(move |x| [x, y, z])))
}

const TOP: u32 = 1 << 31;

/// Reads the methods one-level, fixed and variable.
fn hashed(blob: Bytes<'_>, header: &Header) -> Vec<Leaf> {
    let [width, height, depth] = header.resolution;
    let rows = (height * depth) as usize;
    let mut sections = Sections { blob, at: 128 };
    let offsets = sections.next(4 * rows);
    let bits = sections.next(8 * (rows * width as usize).div_ceil(64));
    let hash = sections.next(4 * (header.hash_count + 1));
    let references = sections.next(4 * header.reference_count);
    let is_set = |[x, y, z]: [u32; 3]| {
        let bit = (y + height * z) as usize * width as usize + x as usize;
        blob.u64(bits + 8 * (bit / 64)) >> (bit % 64) & 1 == 1
    };
    if header.method == 2 {
        macrocells(blob, header, &mut sections, &is_set);
    }
    assert_eq!(sections.at, header.blob_bytes);

    let mut leaves = Vec::new();
    for cell in cells(header.resolution).filter(|&cell| is_set(cell)) {
        let [x, y, z] = cell;
        let offset = blob.u32(offsets + 4 * (y + height * z) as usize).cast_signed();
        let slot = (offset + x.cast_signed()) as usize;
        let [start, end] = [slot, slot + 1].map(|slot| blob.u32(hash + 4 * slot));
        let words = (start & !TOP)..(end & !TOP);
        let words: Vec<_> = words.map(|at| blob.u32(references + 4 * at as usize)).collect();
        assert!(!words.is_empty());
        let corner = cell.map(f64::from);
        if start & TOP == 0 {
            let (min, max) = part(header, corner, corner.map(|c| c + 1.0));
            leaves.push(Leaf { min, max, ids: words });
        } else {
            assert_eq!(header.method, 3);
            leaves.extend(subgrid(header, corner, &words));
        }
    }
    leaves
}

fn macrocells(
    blob: Bytes<'_>,
    header: &Header,
    sections: &mut Sections<'_>,
    is_set: &dyn Fn([u32; 3]) -> bool,
) {
    let factor = header.macrocell_factor;
    let (mut below, mut full): (_, Vec<_>) =
        (header.resolution, cells(header.resolution).filter(|&cell| is_set(cell)).collect());
    let start = sections.at;
    let mut words = 0;
    for _ in 0..4 {
        let level = below.map(|cells| cells.div_ceil(factor));
        full = full.into_iter().map(|cell| cell.map(|c| c / factor)).collect();
        full.sort_unstable();
        full.dedup();
        for (number, cell) in cells(level).enumerate() {
            let bit = blob.u64(start + 8 * (words + number / 64)) >> (number % 64) & 1 == 1;
            assert_eq!(bit, full.binary_search(&cell).is_ok(), "{cell:?}");
        }
        let count = level.iter().map(|&cells| cells as usize).product::<usize>();
        words += count.div_ceil(64);
        below = level;
        if count <= 10_000 {
            break;
        }
    }
    sections.next(8 * words);
}

fn subgrid(header: &Header, corner: Point, words: &[u32]) -> Vec<Leaf> {
    let axes = |word: u32| [0, 8, 16].map(|shift| f64::from(word >> shift & 0xff));
    let [width, height, depth] = [0, 1, 2].map(|word| words[word] >> 24);
    let (low, high, slots) = (axes(words[0]), axes(words[1]), (words[2] & 0x00ff_ffff) as usize);
    let offsets = 3;
    let bits = offsets + (height * depth) as usize;
    let hash = bits + (width * height * depth).div_ceil(32) as usize;
    let references = &words[hash + slots + 1..];
    let mut leaves = Vec::new();
    for [x, y, z] in cells([width, height, depth]) {
        let row = y + height * z;
        let bit = row * width + x;
        if words[bits + bit as usize / 32] >> (bit % 32) & 1 == 0 {
            continue;
        }
        let slot = (words[offsets + row as usize].cast_signed() + x.cast_signed()) as usize;
        let [start, end] = [slot, slot + 1].map(|slot| words[hash + slot] as usize);
        let at = |cell: [u32; 3]| {
            [0, 1, 2].map(|k| {
                let inside = f64::from(cell[k]) / f64::from([width, height, depth][k]);
                corner[k] + (low[k] + (high[k] + 1.0 - low[k]) * inside) / 256.0
            })
        };
        let (min, max) = part(header, at([x, y, z]), at([x + 1, y + 1, z + 1]));
        leaves.push(Leaf { min, max, ids: references[start..end].to_vec() });
    }
    leaves
}

fn recursive(blob: Bytes<'_>, header: &Header) -> Vec<Leaf> {
    let mut sections = Sections { blob, at: 128 };
    let pool = sections.next(4 * header.reference_count);
    assert_eq!(sections.at, header.blob_bytes);
    let word = |at: u32| blob.u32(pool + 4 * at as usize);
    let mut leaves = Vec::new();
    let mut open = vec![0];
    while let Some(grid) = open.pop() {
        let at = pool + 4 * grid as usize;
        let (origin, scale) = (blob.f32s(at), blob.f32s(at + 12));
        let resolution = [0, 10, 20].map(|shift| word(grid + 6) >> shift & 0x3ff);
        for (number, cell) in (grid + 7..).zip(cells(resolution)) {
            let (start, end) = (word(number), word(number + 1) & !TOP);
            if start & TOP != 0 {
                open.push(start & !TOP);
                continue;
            }
            let at = |cell: [u32; 3]| {
                [0, 1, 2].map(|axis| origin[axis] + f64::from(cell[axis]) / scale[axis])
            };
            let (min, max) = part(header, at(cell), at(cell.map(|c| c + 1)));
            leaves.push(Leaf { min, max, ids: (start..end).map(word).collect() });
        }
    }
    leaves
}

/// Reads positions and indices after the grid, and compares masks and first triangles with those of the mesh.
fn packed(
    blob: Bytes<'_>,
    header: &Header,
    mesh: &TriangleMesh<'_>,
) -> (Vec<Point>, Vec<[u32; 3]>) {
    let (kind, parts) = (header.mesh & 3, (header.mesh >> 2) as usize);
    // Without masks every triangle has all bits.
    let has_masks = (0..mesh.triangle_count()).any(|id| mesh.mask(id) != u32::MAX);
    assert_eq!(kind, if has_masks { 2 } else { 1 });
    let mut sections = Sections { blob, at: header.blob_bytes };
    let positions = sections.next(12 * header.vertex_count);
    let indices = sections.next(12 * header.triangle_count);
    if kind == 2 {
        let masks = sections.next(4 * header.triangle_count);
        for id in 0..header.triangle_count as u32 {
            assert_eq!(blob.u32(masks + 4 * id as usize), mesh.mask(id));
        }
    }
    let firsts = sections.next(4 * parts);
    let expected = mesh.parts().iter().map(MeshPart::first);
    assert!((0..parts).map(|part| blob.u32(firsts + 4 * part)).eq(expected));
    assert_eq!(sections.at, blob.0.len());
    let positions = (0..header.vertex_count).map(|vertex| blob.f32s(positions + 12 * vertex));
    let indices = (0..header.triangle_count).map(|triangle| blob.u32s(indices + 12 * triangle));
    (positions.collect(), indices.collect())
}

fn sub(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

fn cross(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the t at which a ray meets a triangle (Möller and Trumbore 1997).
fn meets([origin, direction]: [Point; 2], [a, b, c]: [Point; 3]) -> Option<f64> {
    let (ab, ac, from) = (sub(b, a), sub(c, a), sub(origin, a));
    let p = cross(direction, ac);
    let q = cross(from, ab);
    let area = dot(ab, p);
    let (u, v, t) = (dot(from, p) / area, dot(direction, q) / area, dot(ac, q) / area);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some(t)
}

/// Returns true if a ray meets a box that is a little larger.
fn enters([origin, direction]: [Point; 2], leaf: &Leaf, slack: f64) -> bool {
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let to = |side: f64| (side - origin[axis]) / direction[axis];
        let (a, b) = (to(leaf.min[axis] - slack), to(leaf.max[axis] + slack));
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    near <= far
}

/// Reads a blob by the page, and checks that its boxes hold all triangles and answer rays.
fn check(mesh: &Mesh, grid: &Grid<'_>) {
    let mut kept = vec![Block::ZERO; Block::count_for(grid.packed_bytes() as usize)];
    let blob = Bytes(grid.pack(Block::bytes_mut(&mut kept)).unwrap());
    let header = header(blob);
    assert_eq!(header.content, 0);
    let leaves = match header.method {
        1..=3 => hashed(blob, &header),
        4 => recursive(blob, &header),
        6 => bvh(blob, &header),
        other => panic!("no method {other}"),
    };
    let (positions, indices) = packed(blob, &header, grid.mesh());
    let expected = |p: &[f32; 3]| p.map(f64::from).map(f64::to_bits);
    let are_equal = |(a, b): (&Point, &[f32; 3])| a.map(f64::to_bits) == expected(b);
    assert!(positions.iter().zip(&mesh.positions).all(are_equal));
    assert_eq!(indices, mesh.indices);

    // Every triangle is in some leaf, except those that are skipped.
    let corners = |id: u32| indices[id as usize].map(|vertex| positions[vertex as usize]);
    let is_finite = |id: &u32| corners(*id).iter().flatten().all(|c| c.is_finite());
    let mut ids: Vec<_> = leaves.iter().flat_map(|leaf| leaf.ids.iter().copied()).collect();
    ids.sort_unstable();
    let with_twins = ids.len();
    ids.dedup();
    assert!(ids.iter().copied().eq((0..header.triangle_count as u32).filter(is_finite)));
    assert_eq!(ids.len(), header.triangle_count - header.skipped_count);
    assert!(header.method != 6 || ids.len() == with_twins);
    for leaf in &leaves {
        assert!(header.method == 6 || leaf.ids.is_sorted_by(|a, b| a < b));
        for &id in leaf.ids.iter().filter(|_| header.method == 6) {
            for corner in corners(id) {
                let inside =
                    |axis: usize| leaf.min[axis] < corner[axis] && corner[axis] < leaf.max[axis];
                assert!((0..3).all(inside), "{id} outside of its leaf");
            }
        }
    }

    // The boxes that a ray meets contain the triangle that the library hits.
    let mut random = Random(7);
    let mut hits = 0;
    for _ in 0..200 {
        let (from, to) = (random.point().map(|c| 3.0 * c), random.point());
        let ray = Ray::new(from, [0, 1, 2].map(|axis| to[axis] - from[axis]));
        let line = [ray.origin, ray.direction].map(|point| point.map(f64::from));
        let entered = leaves.iter().filter(|leaf| enters(line, leaf, 1e-5));
        let tests = entered.flat_map(|leaf| &leaf.ids);
        let tests = tests.filter_map(|&id| Some((meets(line, corners(id))?, id)));
        let found = tests.min_by(|a, b| a.partial_cmp(b).unwrap());
        let expected = grid.intersect(&ray);
        assert_eq!(found.is_some(), expected.is_some(), "{ray:?}");
        if let Some(((t, id), hit)) = found.zip(expected) {
            assert!((t - f64::from(hit.t)).abs() < 1e-6, "{ray:?}");
            assert_eq!(id, hit.primitive, "{ray:?}");
            hits += 1;
        }
    }
    assert!(hits > 40 || header.triangle_count < 100, "{hits}");
}

#[test]
fn the_page_is_enough_to_read_a_blob() {
    let mut odd = ball(12, 0.8);
    odd.push([[f32::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    // Crowded cells, so that there are subgrids and several levels of nodes.
    odd.append(&ball(16, 1.0).scaled(0.07));
    let mut one = Mesh::default();
    one.push([[0.0, 0.0, 0.1], [1.0, 0.1, 0.0], [0.1, 1.0, 0.2]]);
    for mesh in [Mesh::default(), one, ball(10, 0.7), odd] {
        for config in configs() {
            let view = mesh.view();
            let owned = Owned::build(&view, &config).unwrap();
            check(&mesh, &owned.open(&view).unwrap());
        }
    }
    // Nodes with fine sides.
    let (room, config) = (room(), Config::default());
    let view = room.view();
    let owned = Owned::build(&view, &config).unwrap();
    let grid = owned.open(&view).unwrap();
    assert!(header(Bytes(grid.blob())).hash_count > 1);
    check(&room, &grid);
    // Several meshes joined as one, some of them with masks.
    let meshes = [ball(6, 0.5), ball(9, 1.0).scaled(0.3), ball(4, 0.2).scaled(0.6)];
    let kept = Parts::of(&meshes);
    let mut parts = kept.parts();
    let view = TriangleMesh::join(&mut parts).unwrap();
    for config in configs() {
        let owned = Owned::build(&view, &config).unwrap();
        check(&merged(&meshes), &owned.open(&view).unwrap());
    }
}
