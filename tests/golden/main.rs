//! The amount of work, in numbers that do not depend on the machine.
//!
//! Bytes and counters of every method on a few scenes, as a table in counters.txt. A slower algorithm or a
//! larger blob shows as a difference there, in review and on any machine, and so does a blob with other bits:
//! `content` is a hash of the contents of the lists, `words` a hash of all words after the header, on
//! little-endian machines. If only `words` differs, `BLOB_VERSION` must change. `HGRID_BLESS=1` writes the table
//! anew.
//!
//! The counters are those of queries with options. A plain query of one ray counts nothing: a unit test in
//! core/src/search.rs counts that its search does no more work.

use std::fmt::Write as _;
use std::path::Path;

use hgrid_core::{Config, Counters, Method, Parameters, Quality, QueryOptions, Statistics};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_lab::scene::Scene;
use hgrid_tests::copy::hash;
use hgrid_tests::meshes::{Mesh, ball, soup};
use hgrid_tests::owned::Owned;

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

#[test]
fn work_is_what_it_was() {
    let Scene { positions, indices, .. } = Scene::load("procedural:knot:5000").unwrap();
    // On a plane, and small enough to be subdivided again.
    let mut crowd = soup(500, 0.05, 3);
    crowd.append(&soup(1500, 0.05, 5).scaled(2e-3));
    let scenes = [
        ("knot", Mesh { positions, indices }),
        ("ball", ball(16, 1.0)),
        ("soup", soup(3000, 0.05, 1)),
        ("crowd", crowd.map(|[x, _, z]| [x, 0.0, z])),
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
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/counters.txt");
    if std::env::var_os("HGRID_BLESS").is_some() {
        std::fs::write(&path, &table).unwrap();
    }
    let expected = std::fs::read_to_string(&path).unwrap();
    assert_eq!(table, expected, "HGRID_BLESS=1 writes the table anew");
}
