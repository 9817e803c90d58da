//! Bytes that are not the grid they claim to be: refused, or answered within bounds; never a crash.

use hgrid_core::{BLOB_VERSION, Block, Config, Error, Grid, Method, Ray, Region};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle};

/// The bytes in memory that is aligned as blobs must be.
pub(crate) struct Copy(Vec<Block>, usize);

impl Copy {
    pub(crate) fn of(bytes: &[u8]) -> Self {
        let mut blocks = vec![Block::ZERO; Block::count_for(bytes.len())];
        Block::bytes_mut(&mut blocks)[..bytes.len()].copy_from_slice(bytes);
        Self(blocks, bytes.len())
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        &Block::bytes(&self.0)[..self.1]
    }

    /// Makes the header's checksum right again: FNV-1a over its words, folded.
    pub(crate) fn sign(&mut self) {
        let bytes = Block::bytes_mut(&mut self.0);
        let words = bytes[..124].chunks_exact(4).map(|word| word.try_into().unwrap());
        let sum = words.map(u32::from_ne_bytes).fold(0xcbf2_9ce4_8422_2325, |sum: u64, word| {
            (sum ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
        });
        let sum = sum ^ (sum >> 29);
        let folded = u32::try_from(sum & 0xffff_ffff).unwrap() ^ u32::try_from(sum >> 32).unwrap();
        bytes[124..128].copy_from_slice(&folded.to_ne_bytes());
    }

    pub(crate) fn set(&mut self, at: usize, bytes: &[u8]) {
        Block::bytes_mut(&mut self.0)[at..at + bytes.len()].copy_from_slice(bytes);
    }
}

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
    moved.validate().unwrap();
    assert_eq!(moved.resolution(), grid.resolution());
    for _ in 0..500 {
        let ray = Ray::new(random.point(), random.point());
        assert_eq!(moved.intersect(&ray), grid.intersect(&ray));
    }
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

    // More bytes than the grid has are not its business.
    let longer = Copy::of(&[bytes, &[0xff; 100]].concat());
    let grid = open(&longer, &mesh).unwrap();
    assert_eq!(grid.blob_bytes(), bytes.len());
    grid.validate().unwrap();
}

#[test]
fn every_truncation_is_refused() {
    methods::configs().for_each(|config| truncations(&config));
}

fn truncations(config: &Config) {
    let mesh = ball(3, 1.0);
    let owned = Owned::build(&mesh.view(), config).unwrap();
    for length in 0..owned.bytes().len() {
        let copy = Copy::of(&owned.bytes()[..length]);
        let error = open(&copy, &mesh).unwrap_err();
        if length < 8 {
            assert_eq!(error, Error::NotAGrid);
        } else {
            assert!(matches!(error, Error::Truncated { needed_bytes, available_bytes }
                if needed_bytes > length as u64 && available_bytes == length as u64));
        }
    }
}

/// Rays of every kind; what they answer does not matter, that they do does.
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
fn every_flipped_bit_is_refused_or_harmless_and_validate_finds_it() {
    methods::configs().for_each(|config| flipped_bits(&config));
}

fn flipped_bits(config: &Config) {
    let mesh = soup(12, 0.5, 51);
    let owned = Owned::build(&mesh.view(), config).unwrap();
    let mut copy = Copy::of(owned.bytes());
    let (mut refused, mut found, mut harmless) = (0, 0, 0);
    let mut random = Random(61);
    for at in 0..owned.bytes().len() {
        for bit in 0..8 {
            copy.set(at, &[owned.bytes()[at] ^ 1 << bit]);
            if at < 124 {
                assert!(open(&copy, &mesh).is_err(), "the header has a checksum");
                copy.sign();
            }
            match open(&copy, &mesh) {
                Err(_) => refused += 1,
                Ok(grid) => {
                    query(&grid);
                    if grid.validate().is_err() {
                        found += 1;
                        continue;
                    }
                    // Valid is what a build makes, perhaps with other parameters; in structures
                    // that a bump allocator filled also words that no query reads.
                    let is_rebuilt = Owned::build(&mesh.view(), &grid.config())
                        .is_ok_and(|rebuilt| rebuilt.bytes() == copy.bytes());
                    let is_bumped = matches!(grid.method(), Method::Variable | Method::Recursive);
                    assert!(is_rebuilt || is_bumped, "bit {bit} of byte {at}");
                    harmless += 1;
                    for _ in 0..100 {
                        let ray = Ray::new(random.point().map(|c| c * 2.0), random.point());
                        assert_eq!(grid.intersect(&ray), oracle::brute_force(&grid, &ray));
                    }
                }
            }
        }
        copy.set(at, &[owned.bytes()[at]]);
        copy.sign();
    }
    assert!(refused > 600 && found > 5 * harmless, "{refused} {found} {harmless}");
    open(&copy, &mesh).unwrap().validate().unwrap();
}

#[test]
fn many_damaged_bytes_are_harmless() {
    methods::configs().for_each(|config| damaged_bytes(&config));
}

fn damaged_bytes(config: &Config) {
    let mesh = soup(200, 0.1, 53);
    let owned = Owned::build(&mesh.view(), config).unwrap();
    let mut random = Random(59);
    for _ in 0..3000 {
        let mut copy = Copy::of(owned.bytes());
        for _ in 0..=random.below(20) {
            // Behind the magic, the byte order and the version, or open sees to it.
            let at = 16 + random.below(owned.bytes().len() - 16);
            let value = [0x00, 0xff, 0x7f, 0x80][random.below(4)];
            copy.set(at, &[value]);
        }
        copy.sign();
        if let Ok(grid) = open(&copy, &mesh) {
            query(&grid);
            let _ = grid.validate();
        }
    }
}

#[test]
fn a_grid_of_another_mesh_of_the_same_size_is_not_valid() {
    let (mesh, other) = (soup(50, 0.2, 3), soup(50, 0.2, 4));
    let copy = Copy::of(built(&mesh).bytes());
    let grid = open(&copy, &other).unwrap();
    query(&grid);
    assert!(matches!(grid.validate(), Err(Error::Corrupt { .. })));

    // The same box, but two triangles changed places.
    let mut swapped = mesh.clone();
    swapped.indices.swap(3, 40);
    assert!(matches!(open(&copy, &swapped).unwrap().validate(), Err(Error::Corrupt { .. })));
    open(&copy, &mesh).unwrap().validate().unwrap();
}
