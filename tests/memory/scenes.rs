//! Scenes with every size of both regions, with canaries around them.

use hgrid_core::{Block, Config, Error, Grid, Instance, Object, Region, Scene};
use hgrid_tests::guarded::Guarded;
use hgrid_tests::meshes::ball;
use hgrid_tests::owned::Owned;
use hgrid_tests::scenes::{Built, packed, scattered};

#[test]
fn scenes_take_what_they_ask_for_and_no_byte_beside_it() {
    let mesh = ball(3, 1.0);
    let owned = Owned::build(&mesh.view(), &Config::default()).unwrap();
    let grid: Grid<'_> = owned.open(&mesh.view()).unwrap();
    let objects = [Object::Grid(&grid)];
    let config = Config::default();
    for count in [0, 1, 9, 100] {
        let instances = scattered(count, 1, 5.0, 3);
        let built = Built::scene(&instances, &objects, &config).unwrap();
        let scene = built.open(&objects).unwrap();
        let exact = scene.blob().len();
        let bound = Scene::bound(count as u32, &config).unwrap();
        assert!(exact <= bound.index_bytes, "{exact} of {bound:?}");
        let build = |index: &mut Guarded, scratch: &mut Guarded| {
            let result =
                Scene::build(&instances, &objects, &config, index.region(), scratch.region())
                    .map(|made| assert!(made.blob() == scene.blob()));
            assert!(index.around_is_intact() && scratch.around_is_intact());
            result
        };
        let mut scratch = Guarded::new(bound.scratch_bytes);
        let sizes = (0..exact + 200).step_by(7).chain([exact - 1, exact, exact + 1]);
        for bytes in sizes {
            let result = build(&mut Guarded::new(bytes), &mut scratch);
            assert_eq!(result.is_ok(), bytes >= exact, "{bytes} of {exact} bytes");
            let Err(error) = result else { continue };
            let Error::OutOfMemory { region: Region::Index, needed_bytes, available_bytes } = error
            else {
                panic!("{error:?}");
            };
            assert_eq!(available_bytes, bytes as u64);
            let enough = usize::try_from(needed_bytes).unwrap();
            assert!(
                bytes < enough && enough <= bound.index_bytes,
                "the error needs {enough}, not above {bytes} and up to the bound"
            );
        }
        for bytes in (0..bound.scratch_bytes).step_by(31) {
            match build(&mut Guarded::new(exact), &mut Guarded::new(bytes)) {
                Ok(()) => {}
                Err(Error::OutOfMemory { region: Region::Scratch, needed_bytes, .. }) => {
                    assert!(
                        needed_bytes <= bound.scratch_bytes as u64 && needed_bytes > bytes as u64
                    );
                }
                Err(error) => panic!("{error:?}"),
            }
        }
    }
}

#[test]
fn packed_scenes_take_what_they_ask_for_and_no_byte_beside_it() {
    let mesh = ball(3, 1.0);
    let owned = Owned::build(&mesh.view(), &Config::default()).unwrap();
    let grid: Grid<'_> = owned.open(&mesh.view()).unwrap();
    let grids = [Object::Grid(&grid), Object::Nothing];
    let inner = Built::scene(&scattered(9, 2, 3.0, 4), &grids, &Config::default()).unwrap();
    let inner = inner.open(&grids).unwrap();
    let objects = [Object::Scene(&inner), Object::Grid(&grid)];
    let instances = [Instance::new(1), Instance::new(0)];
    let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
    let scene = built.open(&objects).unwrap();
    let file = packed(&scene).unwrap();
    let exact = scene.packed_bytes() as usize;
    for bytes in (0..exact + 200).step_by(7).chain([exact - 1, exact, exact + 1]) {
        let mut to = Guarded::new(bytes);
        let result = scene.pack(to.region()).map(|bytes| assert!(bytes == Block::bytes(&file)));
        assert!(to.around_is_intact());
        let (needed_bytes, available_bytes) = (exact as u64, bytes as u64);
        let region = Region::Index;
        let error = Error::OutOfMemory { region, needed_bytes, available_bytes };
        assert_eq!(result, if bytes < exact { Err(error) } else { Ok(()) });
    }
    assert_eq!(scene.pack(&mut Guarded::new(exact + 64).region()[32..]).err(), {
        Some(Error::Misaligned { region: Region::Index })
    });
}
