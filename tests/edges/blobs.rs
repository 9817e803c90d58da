//! Bytes that are not the grid they claim to be are refused or answered within bounds, and never crash. Tests
//! of every bit and every truncation are in tests/hostile.

use hgrid_core::{BLOB_VERSION, BlobInfo, Config, Error, Grid, Method, Ray, Region};
use hgrid_tests::copy::Copy;
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::methods;
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;

fn built(mesh: &Mesh) -> Owned {
    Owned::build(&mesh.view(), &Config::default()).unwrap()
}

fn open<'a>(copy: &'a Copy, mesh: &'a Mesh) -> Result<Grid<'a>, Error> {
    Grid::open(copy.bytes(), mesh.view())
}

#[test]
fn a_copy_is_the_same_grid() {
    let mesh = soup(300, 0.1, 3);
    let owned = built(&mesh);
    let copy = Copy::of(owned.bytes());
    let (view, mut random) = (mesh.view(), Random(3));
    let (grid, moved) = (owned.open(&view).unwrap(), open(&copy, &mesh).unwrap());
    prove(&moved).unwrap();
    assert_eq!(moved.resolution(), grid.resolution());
    let mut hits = 0;
    for _ in 0..500 {
        let ray = Ray::new(random.point(), random.point());
        assert_eq!(moved.intersect(&ray), grid.intersect(&ray));
        hits += usize::from(grid.occluded(&ray));
    }
    assert!(hits > 50, "{hits}");
}

#[test]
fn what_is_no_grid_is_refused_for_what_it_is() {
    let mesh = one_triangle();
    let owned = built(&mesh);
    let bytes = owned.bytes();
    let with = |at: usize, change: &[u8]| {
        let mut copy = Copy::of(bytes);
        copy.set(at, change);
        open(&copy, &mesh).map(|_| ())
    };
    assert_eq!(with(0, b"ply\n"), Err(Error::NotAGrid));
    assert_eq!(with(8, &0x0102_0304_u32.swap_bytes().to_ne_bytes()), Err(Error::WrongByteOrder));
    assert_eq!(with(8, &7_u32.to_ne_bytes()), Err(Error::NotAGrid));
    let found = BLOB_VERSION + 1;
    assert_eq!(with(12, &found.to_ne_bytes()), Err(Error::UnsupportedVersion { found }));
    assert_eq!(open(&Copy::of(&[]), &mesh).unwrap_err(), Error::NotAGrid);
    assert_eq!(open(&Copy::of(&[0; 4096]), &mesh).unwrap_err(), Error::NotAGrid);
    assert_eq!(open(&Copy::of(bytes), &ball(1, 0.0)).unwrap_err(), Error::MeshMismatch);

    let shifted = Copy::of(&[&[0], bytes].concat());
    let misaligned = Grid::open(&shifted.bytes()[1..], mesh.view()).unwrap_err();
    assert_eq!(misaligned, Error::Misaligned { region: Region::Index });

    // Bytes after the end of the grid are ignored.
    let longer = Copy::of(&[bytes, &[0xff; 100]].concat());
    let grid = open(&longer, &mesh).unwrap();
    assert_eq!(grid.blob_bytes(), bytes.len());
    prove(&grid).unwrap();
}

/// A blob that an older version built with the removed method `brick` is refused.
#[test]
fn a_grid_of_a_removed_method_is_refused_by_name() {
    let mesh = one_triangle();
    let owned = built(&mesh);
    let mut copy = Copy::of(owned.bytes());
    copy.set_word(40, 5);
    copy.sign();
    assert_eq!(open(&copy, &mesh).unwrap_err(), Error::MethodRemoved);
    assert_eq!(BlobInfo::peek(copy.bytes()), Err(Error::MethodRemoved));
    assert_eq!(Method::from_u32(5), None);
}

/// Sends rays of every kind; the answers do not matter, as long as there are answers.
pub(crate) fn query(grid: &Grid<'_>) {
    let mut random = Random(47);
    for _ in 0..8 {
        let ray = Ray::new(random.point().map(|c| c * 2.0), random.point());
        let hit = grid.intersect(&ray);
        assert!(hit.is_none_or(|hit| hit.primitive < grid.mesh().triangle_count()));
        let _ = grid.occluded(&ray);
    }
}

#[test]
fn many_damaged_bytes_are_harmless() {
    methods::configs().for_each(|config| damaged_bytes(&config));
}

fn damaged_bytes(config: &Config) {
    let mesh = soup(200, 0.1, 53);
    let owned = Owned::build(&mesh.view(), config).unwrap();
    let (mut random, mut opened) = (Random(59), 0);
    for _ in 0..3000 {
        let mut copy = Copy::of(owned.bytes());
        for _ in 0..=random.below(20) {
            // After the magic, the byte order and the version, which `open` would refuse at once.
            let at = 16 + random.below(owned.bytes().len() - 16);
            let value = [0x00, 0xff, 0x7f, 0x80][random.below(4)];
            copy.set(at, &[value]);
        }
        copy.sign();
        if let Ok(grid) = open(&copy, &mesh) {
            query(&grid);
            let _ = prove(&grid);
            opened += 1;
        }
    }
    assert!(opened > 800 && opened < 3000, "{opened}");
}

#[test]
fn a_grid_of_another_mesh_of_the_same_size_is_not_valid() {
    let (mesh, other) = (soup(50, 0.2, 3), soup(50, 0.2, 4));
    let copy = Copy::of(built(&mesh).bytes());
    let grid = open(&copy, &other).unwrap();
    query(&grid);
    assert!(matches!(prove(&grid), Err(Error::Corrupt { .. })));

    // The same box, but two triangles have changed places.
    let mut swapped = mesh.clone();
    swapped.indices.swap(3, 40);
    assert!(matches!(prove(&open(&copy, &swapped).unwrap()), Err(Error::Corrupt { .. })));
    prove(&open(&copy, &mesh).unwrap()).unwrap();
}
