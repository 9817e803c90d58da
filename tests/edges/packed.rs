//! Blobs that contain their mesh, and the facts that a header tells.

use hgrid_core::{
    ALIGNMENT, BLOB_VERSION, BlobInfo, Block, Error, Grid, IndexType, Ray, Region, Strided,
    TriangleMesh,
};
use hgrid_tests::meshes::{Mesh, ball, one_triangle};
use hgrid_tests::methods::configs;
use hgrid_tests::oracle;
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;

fn memory(bytes: u64) -> Vec<Block> {
    vec![Block::ZERO; Block::count_for(bytes as usize)]
}

/// Shows `visit` a grid of each method, without masks and with them; the mesh's arrays have other data
/// between their elements.
fn each(mesh: &Mesh, mut visit: impl FnMut(&Grid<'_>)) {
    let positions: Vec<[f32; 5]> =
        mesh.positions.iter().map(|&[x, y, z]| [x, y, z, 7.0, 8.0]).collect();
    let indices: Vec<[u16; 4]> =
        mesh.indices.iter().map(|&[a, b, c]| [a as u16, b as u16, c as u16, 9]).collect();
    let masks: Vec<u32> = (0..).take(indices.len()).collect();
    let view =
        TriangleMesh::strided(Strided::new(&positions), Strided::new(&indices), IndexType::U16)
            .unwrap();
    for view in [view, view.with_masks(Strided::new(&masks)).unwrap()] {
        for config in configs() {
            let owned = Owned::build(&view, &config).unwrap();
            visit(&owned.open(&view).unwrap());
        }
    }
}

#[test]
fn a_packed_blob_needs_nothing_else() {
    let mut random = Random(11);
    let mut hits = 0;
    for mesh in [Mesh::default(), one_triangle(), ball(10, 0.7)] {
        each(&mesh, |grid| {
            let mut kept = memory(grid.packed_bytes());
            grid.pack(Block::bytes_mut(&mut kept)).unwrap();
            // Open the blob at another address, with bytes after it.
            let moved = [kept, memory(64)].concat();
            let packed = Grid::open_packed(Block::bytes(&moved)).unwrap();
            prove(&packed).unwrap();
            assert_eq!(packed.inspect(), grid.inspect());
            assert_eq!(packed.blob_bytes(), grid.blob_bytes());
            for id in 0..grid.mesh().triangle_count() {
                assert_eq!(packed.mesh().triangle(id), grid.mesh().triangle(id));
                assert_eq!(packed.mesh().mask(id), grid.mesh().mask(id));
            }
            for _ in 0..20 {
                let ray = Ray::new(random.point().map(|c| 2.0 * c), random.point());
                assert_eq!(packed.intersect(&ray), grid.intersect(&ray));
                hits += usize::from(oracle::check(&packed, &ray));
            }
            // It also opens with the mesh as any other blob does, and packing it again gives the same bytes.
            let with_mesh = Grid::open(packed.blob(), *grid.mesh()).unwrap();
            prove(&with_mesh).unwrap();
            let mut again = memory(packed.packed_bytes());
            packed.pack(Block::bytes_mut(&mut again)).unwrap();
            assert_eq!(Block::bytes(&again), Block::bytes(&moved[..again.len()]));
        });
    }
    assert!(hits > 15, "{hits}");
}

#[test]
fn a_peek_tells_what_a_blob_is() {
    each(&ball(4, 1.0), |grid| {
        let info = BlobInfo::peek(&grid.blob()[..128]).unwrap();
        let expected = BlobInfo {
            content: hgrid_core::Content::Triangles,
            version: BLOB_VERSION,
            method: grid.method(),
            has_mesh: false,
            vertex_count: grid.mesh().vertex_count() as u64,
            triangle_count: grid.mesh().triangle_count(),
            grid_bytes: grid.blob_bytes() as u64,
            total_bytes: grid.blob_bytes() as u64,
        };
        assert_eq!(info, expected);
        let mut kept = memory(grid.packed_bytes());
        let packed = grid.pack(Block::bytes_mut(&mut kept)).unwrap();
        let expected = BlobInfo { has_mesh: true, total_bytes: packed.len() as u64, ..expected };
        assert_eq!(BlobInfo::peek(packed), Ok(expected));
        // A peek works at any address, and needs no less than a header.
        let moved = [&[0][..], packed].concat();
        assert_eq!(BlobInfo::peek(&moved[1..]), Ok(expected));
        assert!(matches!(BlobInfo::peek(&packed[..127]), Err(Error::Truncated { .. })));
        assert_eq!(BlobInfo::peek(&packed[1..]), Err(Error::NotAGrid));
        assert_eq!(BlobInfo::peek(&[]), Err(Error::NotAGrid));
    });
}

#[test]
fn too_little_memory_is_told_and_left_alone() {
    each(&ball(4, 1.0), |grid| {
        let needed_bytes = grid.packed_bytes();
        let mut kept = memory(needed_bytes + 64);
        let bytes = Block::bytes_mut(&mut kept);
        bytes.fill(0xa5);
        for available_bytes in [0, 1, needed_bytes - 1] {
            let to = &mut bytes[..available_bytes as usize];
            let error = Error::OutOfMemory { region: Region::Index, needed_bytes, available_bytes };
            assert_eq!(grid.pack(to).err(), Some(error));
        }
        let misaligned = Error::Misaligned { region: Region::Index };
        assert_eq!(grid.pack(&mut bytes[1..]).err(), Some(misaligned));
        assert!(bytes.iter().all(|&byte| byte == 0xa5), "something was written");
        assert_eq!(grid.pack(bytes).unwrap().len() as u64, needed_bytes);
        assert!(bytes[needed_bytes as usize..].iter().all(|&byte| byte == 0xa5));
        // Pack wrote every byte: over zeros it gives the same.
        let mut zeros = memory(needed_bytes);
        assert_eq!(
            grid.pack(Block::bytes_mut(&mut zeros)).unwrap(),
            &bytes[..needed_bytes as usize]
        );
    });
}

#[test]
fn what_is_no_packed_blob_is_refused() {
    each(&ball(4, 1.0), |grid| {
        assert_eq!(Grid::open_packed(grid.blob()).err(), Some(Error::NoMesh));
        assert_eq!(Grid::open_packed(&[]).err(), Some(Error::NotAGrid));
        let mut kept = memory(grid.packed_bytes());
        let bytes = grid.pack(Block::bytes_mut(&mut kept)).unwrap();
        for length in (0..bytes.len()).step_by(13) {
            let error = Grid::open_packed(&bytes[..length]).err().unwrap();
            assert!(matches!(error, Error::NotAGrid | Error::Truncated { .. }), "{error}");
        }
        assert_eq!(
            Grid::open_packed(&bytes[ALIGNMENT / 2..]).err(),
            Some(Error::Misaligned { region: Region::Index })
        );
        // Damage the mesh: validation finds an index out of range, or a mesh that the grid was not built for.
        let at = bytes.len() - ALIGNMENT - if grid.mesh().mask(0) == 0 { 1024 } else { 0 };
        bytes[at..][..4].fill(0xff);
        let damaged = Grid::open_packed(bytes).unwrap();
        let _ = damaged.intersect(&Ray::new([0.1, 0.2, 3.0], [0.0, 0.0, -1.0]));
        assert!(prove(&damaged).is_err(), "{:?}", grid.method());
    });
}
