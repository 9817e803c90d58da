//! Joined meshes: empty ones, none, too many, and ones with wrong triangles.

use hgrid_core::{
    BuildFlags, Config, Error, Grid, MeshField, MeshPart, Ray, Strided, TriangleMesh, sizes,
};
use hgrid_tests::copy::{Copy, MESH};
use hgrid_tests::joined::{Parts, merged};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::methods;
use hgrid_tests::owned::{Owned, prove};

#[test]
fn nothing_and_empty_meshes_hit_nothing() {
    for meshes in [Vec::new(), vec![Mesh::default()], vec![Mesh::default(); 5]] {
        let stored = Parts::of(&meshes);
        let mut parts = stored.parts();
        let mesh = TriangleMesh::join(&mut parts).unwrap();
        assert_eq!((mesh.triangle_count(), mesh.vertex_count()), (0, 0));
        assert_eq!((mesh.triangle(0), mesh.locate(0)), (None, None));
        for config in methods::configs() {
            let owned = Owned::build(&mesh, &config).unwrap();
            let grid = owned.open(&mesh).unwrap();
            prove(&grid).unwrap();
            assert_eq!(grid.intersect(&Ray::new([0.0; 3], [1.0, 0.0, 0.0])), None);
        }
    }
}

#[test]
fn a_triangle_that_is_wrong_is_named_by_its_number_among_all() {
    let sound = [ball(4, 1.0), Mesh::default(), soup(30, 0.2, 3), one_triangle(), soup(20, 0.2, 4)];
    let first: usize = sound.iter().take(2).map(|mesh| mesh.indices.len()).sum();
    let triangle = u32::try_from(first + 17).unwrap();
    for config in methods::configs() {
        let check = |meshes: &[Mesh], config: &Config, expected: Error| {
            let stored = Parts::of(meshes);
            let mut parts = stored.parts();
            let mesh = TriangleMesh::join(&mut parts).unwrap();
            assert_eq!(Owned::build(&mesh, config).unwrap_err(), expected, "{config:?}");
            assert_eq!(mesh.locate(triangle), Some((2, 17)));
        };
        let mut meshes = sound.clone();
        // An index may not reach the vertices of the next part.
        meshes[2].indices[17][1] = u32::try_from(meshes[2].positions.len()).unwrap();
        meshes[4].indices[3][0] = u32::MAX;
        check(&meshes, &config, Error::IndexOutOfRange { triangle });

        let mut meshes = sound.clone();
        let vertex = meshes[2].indices[17][2] as usize;
        meshes[2].positions[vertex][1] = f32::NAN;
        let strict = Config { flags: BuildFlags::STRICT, ..config };
        check(&meshes, &strict, Error::NonFiniteTriangle { triangle });
    }
}

#[test]
fn a_mesh_that_became_wrong_is_found() {
    let mut meshes = [ball(4, 1.0), soup(30, 0.2, 3)];
    let sound = Parts::of(&meshes);
    meshes[1].indices[5][0] = 90;
    let damaged = Parts::of(&meshes);
    let (mut sound, mut damaged) = (sound.parts(), damaged.parts());
    let sound = TriangleMesh::join(&mut sound).unwrap();
    let damaged = TriangleMesh::join(&mut damaged).unwrap();
    let triangle = damaged.triangle_count() - 25;
    for config in methods::configs() {
        let owned = Owned::build(&sound, &config).unwrap();
        let grid = owned.open(&damaged).unwrap();
        let error = Error::IndexOutOfRange { triangle };
        assert_eq!(prove(&grid).unwrap_err(), error);
        let mut room = Copy::of(&vec![0xa5; usize::try_from(grid.packed_bytes()).unwrap()]);
        assert_eq!(grid.pack(room.bytes_mut()).unwrap_err(), error);
        assert!(room.bytes().iter().all(|&byte| byte == 0xa5));
    }
}

#[test]
fn parts_that_are_not_numbered_are_refused() {
    let meshes = [ball(3, 1.0), one_triangle(), one_triangle()];
    let views = meshes.each_ref().map(Mesh::view);
    let invalid = Error::InvalidMesh(MeshField::Parts);
    let new = views.map(MeshPart::new);
    assert_eq!(TriangleMesh::joined(&new).unwrap_err(), invalid);
    let mut parts = new;
    let joined = TriangleMesh::join(&mut parts).unwrap();
    let masks = vec![1_u32; 110];
    let with_masks = joined.with_masks(Strided::new(&masks));
    assert_eq!(with_masks.unwrap_err(), Error::InvalidMesh(MeshField::Masks));
    assert_eq!(joined.positions().count + joined.triangles().count + joined.masks().count, 0);
    assert_eq!(joined.parts().len(), 3);
    assert_eq!(joined.parts()[2].first(), 109);
    let again = TriangleMesh::joined(joined.parts()).unwrap();
    assert_eq!(again.triangle_count(), 110);
    // The first two parts are numbered as if joined alone; the last two are not.
    assert!(TriangleMesh::joined(&joined.parts()[..2]).is_ok());
    assert_eq!(TriangleMesh::joined(&joined.parts()[1..]).unwrap_err(), invalid);
    // No part may itself be joined.
    let mut nested = [MeshPart::new(views[1]), MeshPart::new(joined)];
    assert_eq!(TriangleMesh::join(&mut nested).unwrap_err(), invalid);
}

#[test]
fn one_mesh_is_its_own_first_part() {
    let mesh = ball(3, 1.0);
    let view = mesh.view();
    assert!(view.parts().is_empty());
    assert_eq!(view.locate(5), Some((0, 5)));
    assert_eq!(view.locate(view.triangle_count()), None);
    // A mesh that is the only part gives the same grid.
    let mut parts = [MeshPart::new(view)];
    let joined = TriangleMesh::join(&mut parts).unwrap();
    for config in methods::configs() {
        let (one, other) = (Owned::build(&view, &config), Owned::build(&joined, &config));
        assert_eq!(one.unwrap().bytes(), other.unwrap().bytes());
        assert_eq!(sizes(&view, &config, &mut []), sizes(&joined, &config, &mut []));
    }
}

#[test]
fn a_grid_of_joined_meshes_is_for_these_counts_only() {
    let meshes = [ball(3, 1.0), one_triangle()];
    let stored = Parts::of(&meshes);
    let mut parts = stored.parts();
    let mesh = TriangleMesh::join(&mut parts).unwrap();
    let owned = Owned::build(&mesh, &Config::default()).unwrap();
    assert!(owned.open(&merged(&meshes).view()).is_ok());
    assert_eq!(owned.open(&ball(3, 1.0).view()).unwrap_err(), Error::MeshMismatch);
}

/// Tables of parts that no pack would write: the opened blob still answers, and `validate` finds the damage.
#[test]
fn damaged_parts_of_a_packed_blob_are_found() {
    let meshes = [ball(3, 1.0), one_triangle(), Mesh::default(), soup(7, 0.3, 1)];
    let stored = Parts::of(&meshes);
    let mut parts = stored.parts();
    let mesh = TriangleMesh::join(&mut parts).unwrap();
    let owned = Owned::build(&mesh, &Config::default()).unwrap();
    let grid = owned.open(&mesh).unwrap();
    let mut packed = Copy::of(&vec![0; usize::try_from(grid.packed_bytes()).unwrap()]);
    grid.pack(packed.bytes_mut()).unwrap();
    let table = packed.bytes().len() - 64;
    let expected = [0, 108, 109, 109];
    for (at, first) in expected.into_iter().enumerate() {
        assert_eq!(packed.word(table + 4 * at), first);
        for wrong in [0, 1, 50, 107, 109, 116, 117, u32::MAX] {
            packed.set_word(table + 4 * at, wrong);
            let grid = Grid::open_packed(packed.bytes()).unwrap();
            for id in [0, 1, 107, 108, 109, 115, 116, u32::MAX] {
                let found = grid.mesh().locate(id);
                assert!(found.is_none_or(|(part, own)| part < 4 && own <= id && id < 116));
            }
            let is_sorted = {
                let all: Vec<u32> = (0..4).map(|at| packed.word(table + 4 * at)).collect();
                all[0] == 0 && all.is_sorted() && all[3] <= 116
            };
            assert_eq!(prove(&grid).is_ok(), is_sorted, "{wrong} at {at}");
            if let Err(error) = prove(&grid) {
                let is_fit = |offset: u64| (table..table + 16).contains(&(offset as usize));
                assert!(matches!(error, Error::Corrupt { offset } if is_fit(offset)), "{error:?}");
            }
        }
        packed.set_word(table + 4 * at, first);
    }
    prove(&Grid::open_packed(packed.bytes()).unwrap()).unwrap();

    // A count of parts that needs more bytes than there are, or parts without a mesh.
    let word = packed.word(MESH);
    assert_eq!(word, 4 << 2 | 2);
    for (wrong, is_short) in
        [(100 << 2 | 2, true), (u32::MAX - 1, true), (4 << 2, false), (19, false)]
    {
        packed.set_word(MESH, wrong);
        packed.sign();
        let error = Grid::open_packed(packed.bytes()).unwrap_err();
        assert_eq!(matches!(error, Error::Truncated { .. }), is_short, "{wrong}: {error:?}");
        assert_eq!(matches!(error, Error::Corrupt { offset: 108 }), !is_short, "{error:?}");
    }
}
