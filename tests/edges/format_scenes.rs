//! docs/format.md is enough to read trees of shapes, scenes and packed scenes: this reader follows the page.

use hgrid_core::{Block, Boxes, Config, Grid, Instance, Object, Scene, Shapes};
use hgrid_tests::meshes::ball;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::{Built, packed, scattered};

use super::format::{Bytes, Header, Leaf, Point, Sections, bvh, header};

/// The least and the greatest corner of a box.
type Corners = [Point; 2];

/// Asserts that each number stands in one leaf, unless it has no box, and that the leaf holds its box.
fn check_leaves(leaves: &[Leaf], boxes: &[Option<Corners>]) {
    let mut met = vec![0; boxes.len()];
    for leaf in leaves {
        for &id in &leaf.ids {
            met[id as usize] += 1;
            let [min, max] = boxes[id as usize].expect("a box");
            for axis in 0..3 {
                assert!(leaf.min[axis] < min[axis] && max[axis] < leaf.max[axis], "{id}");
            }
        }
    }
    assert!(met.iter().zip(boxes).all(|(&count, corners)| count == i32::from(corners.is_some())));
}

/// Returns two opposite corners in order.
fn in_order([a, b]: Corners) -> Corners {
    [[0, 1, 2].map(|k: usize| a[k].min(b[k])), [0, 1, 2].map(|k: usize| a[k].max(b[k]))]
}

#[test]
fn the_page_is_enough_to_read_a_tree_of_shapes() {
    let mut random = Random(3);
    for count in [0, 1, 9, 300] {
        let mut boxes: Vec<[f32; 6]> = (0..count)
            .map(|_| {
                let (a, b) = (random.point(), random.point().map(|c| 0.1 * c));
                std::array::from_fn(|k| if k < 3 { a[k] } else { a[k - 3] + b[k - 3] })
            })
            .collect();
        boxes.push([0.0, 0.0, f32::NAN, 1.0, 1.0, 1.0]);
        let view = Boxes::new(&boxes).unwrap();
        let built = Built::shapes(view, &Config::default()).unwrap();
        let blob = Bytes(Shapes::open(built.bytes(), view).unwrap().blob());
        let header = header(blob);
        assert_eq!((header.method, header.content, header.skipped_count), (6, 1, 1));
        assert_eq!([header.triangle_count, header.vertex_count], [count + 1, 2 * count + 2]);
        assert_eq!(header.blob_bytes, blob.0.len());
        let corners = |sides: &[f32; 6]| {
            let [a, b, c, d, e, f] = sides.map(f64::from);
            sides.iter().all(|c| c.is_finite()).then(|| in_order([[a, b, c], [d, e, f]]))
        };
        check_leaves(&bvh(blob, &header), &boxes.iter().map(corners).collect::<Vec<_>>());
    }
}

/// The sections behind the tree of a scene.
struct Behind {
    table: usize,
    boxes: usize,
    instances: usize,
    end: usize,
}

fn behind(blob: Bytes<'_>, header: &Header) -> Behind {
    assert_eq!((header.method, header.content), (6, 2));
    assert_eq!(header.vertex_count, 2 * header.triangle_count);
    let mut sections = Sections { blob, at: header.blob_bytes };
    let table = sections.next(64);
    let boxes = sections.next(24 * header.triangle_count);
    let instances = sections.next(72 * header.triangle_count);
    Behind { table, boxes, instances, end: sections.at }
}

/// Reads a scene of grids by the page, and compares it with its instances.
fn check(scene: &Scene<'_>, instances: &[Instance], grids: &[Grid<'_>]) {
    let blob = Bytes(scene.blob());
    let header = header(blob);
    let behind = behind(blob, &header);
    assert_eq!((header.triangle_count, behind.end), (instances.len(), blob.0.len()));
    let most = instances.iter().map(|instance| instance.object + 1).max().unwrap_or(0);
    assert_eq!(blob.u32(behind.table), most);
    assert!((1..16).all(|word| blob.u32(behind.table + 4 * word) == 0));

    let mut boxes = Vec::new();
    for (number, instance) in instances.iter().enumerate() {
        let at = behind.instances + 72 * number;
        assert_eq!(blob.u32(at + 36), instance.object);
        assert_eq!([blob.u32(at + 64), blob.u32(at + 68)], [instance.mask, instance.id]);
        for (axis, c) in instance.translation.iter().enumerate() {
            assert_eq!(blob.u64(at + 40 + 8 * axis), c.to_bits());
        }
        // The matrix times its inverse is one.
        let inverse = [0, 12, 24].map(|row| blob.f32s(at + row));
        let columns = [0, 1, 2].map(|j: usize| inverse.map(|row| row[j]));
        let linear = instance.linear.map(|row| row.map(f64::from));
        for (i, row) in linear.iter().enumerate() {
            for (j, column) in columns.iter().enumerate() {
                let product: f64 = row.iter().zip(column).map(|(a, b)| a * b).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-5, "{number}");
            }
        }
        // The box holds the mesh in its place, and is not larger than the grid's box there.
        let place = |p: Point| -> Point {
            [0, 1, 2].map(|i: usize| {
                let moved: f64 = (0..3).map(|k| linear[i][k] * p[k]).sum();
                moved + instance.translation[i]
            })
        };
        let at = behind.boxes + 24 * number;
        let [min, max] = in_order([blob.f32s(at), blob.f32s(at + 12)]);
        let grid = &grids[instance.object as usize];
        for id in 0..grid.mesh().triangle_count() {
            for corner in grid.mesh().triangle(id).unwrap() {
                let p = place(corner.map(f64::from));
                assert!((0..3).all(|k| min[k] <= p[k] && p[k] <= max[k]), "{number}");
            }
        }
        let (low, high) = grid.bounds();
        let corner = |bits: usize| [0, 1, 2].map(|k| f64::from([low, high][bits >> k & 1][k]));
        let corners: Vec<_> = (0..8).map(|bits| place(corner(bits))).collect();
        for axis in 0..3 {
            let sides = || corners.iter().map(|p| p[axis]);
            let (low, high) = (sides().fold(f64::MAX, f64::min), sides().fold(f64::MIN, f64::max));
            assert!(min[axis] > low - 1e-4 && max[axis] < high + 1e-4, "{number}");
        }
        boxes.push(Some([min, max]));
    }
    check_leaves(&bvh(blob, &header), &boxes);
}

/// Returns where a packed grid ends.
fn end_of_grid(blob: Bytes<'_>, header: &Header) -> usize {
    let mut sections = Sections { blob, at: header.blob_bytes };
    assert!(header.content == 0 && header.mesh & 3 == 1);
    sections.next(12 * header.vertex_count);
    sections.next(12 * header.triangle_count);
    sections.next(4 * (header.mesh >> 2) as usize);
    sections.at
}

/// Reads a packed scene that shows grids and one other scene, which shows the same grids.
fn check_packed(blob: Bytes<'_>, outer: &Scene<'_>, inner: &Scene<'_>, grids: &[Grid<'_>]) {
    let head = header(blob);
    assert_eq!((head.method, head.content, head.mesh), (6, 3, 1));
    assert_eq!((head.skipped_count, head.hash_count), (0, 0));
    assert_eq!((head.reference_count, head.node_count, blob.u32(116)), (0, 0, 0));
    assert_eq!((head.triangle_count, head.blob_bytes), (grids.len() + 1, blob.0.len()));
    let mut sections = Sections { blob, at: 128 };
    let count = head.vertex_count - head.triangle_count;
    let references = sections.next(4 * count);
    let mut references = (0..count).map(|number| blob.u32(references + 4 * number) as usize);

    // Each member is one of the grids, or the inner scene.
    let (mut at, mut members) = (sections.at, Vec::new());
    for number in 0..=head.triangle_count {
        let member = Bytes(&blob.0[at..]);
        let header = header(member);
        if header.content == 0 {
            let is_same = |grid: &Grid<'_>| {
                grid.blob_bytes() == header.blob_bytes
                    && grid.blob()[128..] == member.0[128..header.blob_bytes]
            };
            members.push(grids.iter().position(is_same).unwrap());
            at += end_of_grid(member, &header);
            continue;
        }
        // A scene has as many references as its table says.
        let behind = behind(member, &header);
        let is_last = number == head.triangle_count;
        let scene = if is_last { outer } else { inner };
        assert_eq!(&member.0[..behind.end], scene.blob());
        for object in 0..member.u32(behind.table) {
            let named = references.next().unwrap();
            // The last object of the outer scene is the inner one.
            assert!(named < number);
            let is_scene = is_last && object as usize == grids.len();
            assert_eq!(members[named], if is_scene { usize::MAX } else { object as usize });
        }
        members.push(usize::MAX);
        at += behind.end;
    }
    assert_eq!(at, blob.0.len());
    assert_eq!(references.next(), None);
}

#[test]
fn the_page_is_enough_to_read_a_scene() {
    let meshes = [ball(5, 1.0), ball(8, 0.3), ball(3, 0.7)];
    let views = meshes.each_ref().map(|mesh| mesh.view());
    let owned = views.each_ref().map(|view| Owned::build(view, &Config::default()).unwrap());
    let grids = [0, 1, 2].map(|k| owned[k].open(&views[k]).unwrap());
    let objects = grids.each_ref().map(Object::Grid);
    let build = |count: usize, objects: &[Object<'_>]| {
        let mut instances = scattered(count, objects.len() as u32, 8.0, count as u64);
        for instance in &mut instances {
            instance.mask = 0x8000_0001 + 2 * instance.id;
            instance.id = 1000 - instance.id;
        }
        if let Some(first) = instances.first_mut() {
            first.object = objects.len() as u32 - 1;
        }
        (Built::scene(&instances, objects, &Config::default()).unwrap(), instances)
    };
    for count in [0, 2, 70] {
        let (built, instances) = build(count, &objects);
        check(&built.open(&objects).unwrap(), &instances, &grids);
    }
    let (built, _) = build(2, &objects);
    let inner = built.open(&objects).unwrap();
    let [a, b, c] = objects;
    let all = [a, b, c, Object::Scene(&inner)];
    let (built, _) = build(9, &all);
    let outer = built.open(&all).unwrap();
    let file = packed(&outer).unwrap();
    check_packed(Bytes(Block::bytes(&file)), &outer, &inner, &grids);
}
