//! The amount of work, in numbers that do not depend on the machine.
//!
//! Bytes and counters of every method on a few scenes, and bytes of a tree of shapes and a scene of instances, as
//! a table in counters.txt. A slower algorithm or a larger blob shows as a difference there, in review and on any
//! machine, and so does a blob with other bits: `content` is a hash of the contents of the lists, `words` a hash
//! of all words after the header, on little-endian machines. If only `words` differs, `BLOB_VERSION` must change.
//! `HGRID_BLESS=1` writes the table anew.
//!
//! The counters are those of queries with options. A plain query of one ray counts nothing: a unit test in
//! core/src/search.rs counts that its search does no more work.

use std::fmt::Write as _;
use std::path::Path;

use hgrid_core::{
    Boxes, Config, Counters, Method, Object, Parameters, Quality, QueryOptions, Shapes, Statistics,
};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_lab::scene::Scene;
use hgrid_tests::copy::hash;
use hgrid_tests::meshes::{Mesh, ball, soup};
use hgrid_tests::owned::Owned;
use hgrid_tests::scenes::{Built, scattered};

/// Pixels along a side of the picture.
const SIZE: u16 = 64;

/// Bytes of a blob's header.
const HEADER_BYTES: usize = 128;

/// Returns the table's line for a method on a scene.
fn line(name: &str, mesh: &Mesh, config: &Config) -> String {
    let view = mesh.view();
    let owned = Owned::build(&view, config).unwrap();
    let grid = owned.open(&view).unwrap();
    let camera = Camera::framing(grid.bounds(), View::ThreeQuarter, Up::Y);
    let mut counters = Counters::default();
    let pixels = (0..SIZE).flat_map(|row| (0..SIZE).map(move |column| (column, row)));
    let hits = pixels
        .filter(|&(column, row)| {
            grid.intersect_with(
                &camera.ray(column, row, SIZE),
                &mut QueryOptions::counting(&mut counters),
            )
            .is_some()
        })
        .count();
    let Counters { primitive_tests, cell_steps, grid_steps } = counters;
    let Statistics { longest_list, content_hash, .. } = grid.inspect();
    let [x, y, z] = grid.resolution();
    let resolution = format!("{x}x{y}x{z}");
    let method = match config.parameters {
        Parameters::Bvh { quality: Quality::High } => "bvh-high",
        others => others.method().name(),
    };
    format!(
        "{name:8} {method:10} {resolution:>9} {:>8} {hits:>5} {primitive_tests:>7} {cell_steps:>7} \
         {grid_steps:>6} {longest_list:>7} {content_hash:016x} {:016x}",
        grid.blob_bytes(),
        hash(&grid.blob()[HEADER_BYTES..]),
    )
}

/// Returns the table's line for a tree of shapes or a scene, whose queries the table does not count.
fn line_of_bytes(name: &str, blob: &[u8]) -> String {
    let none = "-";
    format!(
        "{name:8} {:10} {none:>9} {:>8} {none:>5} {none:>7} {none:>7} {none:>6} {none:>7} {none:16} {:016x}",
        "bvh",
        blob.len(),
        hash(&blob[HEADER_BYTES..]),
    )
}

/// Returns the lines for a tree of shapes and for a scene of grids.
fn lines_of_bytes() -> [String; 2] {
    let boxes = soup(3000, 0.05, 1);
    let boxes: Vec<[f32; 6]> = boxes
        .indices
        .iter()
        .map(|&[a, b, _]| {
            let [a, b] = [a, b].map(|vertex| boxes.positions[vertex as usize]);
            std::array::from_fn(|side| if side < 3 { a[side] } else { b[side - 3] })
        })
        .collect();
    let boxes = Boxes::new(&boxes).unwrap();
    let config = Config::default();
    let built = Built::shapes(boxes, &config).unwrap();
    let shapes = line_of_bytes("shapes", Shapes::open(built.bytes(), boxes).unwrap().blob());
    let meshes = [ball(16, 1.0), soup(3000, 0.05, 1)];
    let views = meshes.each_ref().map(Mesh::view);
    let owned = views.each_ref().map(|view| Owned::build(view, &config).unwrap());
    let grids = [0, 1].map(|number| owned[number].open(&views[number]).unwrap());
    let objects = grids.each_ref().map(Object::Grid);
    let built = Built::scene(&scattered(300, 2, 6.0, 8), &objects, &config).unwrap();
    [shapes, line_of_bytes("scene", built.open(&objects).unwrap().blob())]
}

#[test]
fn work_is_what_it_was() {
    let Scene { positions, indices, .. } = Scene::load("procedural:knot:5000").unwrap();
    // On a plane, and small enough to be subdivided again.
    let mut crowd = soup(500, 0.05, 3);
    crowd.append(&soup(1500, 0.05, 5).scaled(2e-3));
    // A small object in one bin of a tree, with a few of the other triangles. If each of these few were a subtree by
    // itself, the blob would be larger.
    let mut object = soup(5000, 0.05, 7).map(|p| p.map(|c| 0.01 * c + 0.3));
    object.append(&soup(200, 0.05, 9));
    let scenes = [
        ("knot", Mesh { positions, indices }),
        ("ball", ball(16, 1.0)),
        ("soup", soup(3000, 0.05, 1)),
        ("crowd", crowd.map(|[x, _, z]| [x, 0.0, z])),
        ("object", object),
    ];
    let mut table = String::from(
        "scene    method     resolution    bytes  hits   tests   steps  grids longest content          words\n",
    );
    for (name, mesh) in &scenes {
        let high = Config::from(Parameters::Bvh { quality: Quality::High });
        for config in Method::ALL.iter().map(|&method| Config::new(method)).chain([high]) {
            writeln!(table, "{}", line(name, mesh, &config)).unwrap();
        }
    }
    for line in lines_of_bytes() {
        writeln!(table, "{line}").unwrap();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/counters.txt");
    if std::env::var_os("HGRID_BLESS").is_some() {
        std::fs::write(&path, &table).unwrap();
    }
    let expected = std::fs::read_to_string(&path).unwrap();
    assert_eq!(table, expected, "HGRID_BLESS=1 writes the table anew");
}
