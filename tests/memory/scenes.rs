//! Scenes: every size of both regions, with canaries around them.

use hgrid_core::{Config, Error, Grid, Object, Region, Scene};
use hgrid_tests::guarded::Guarded;
use hgrid_tests::meshes::ball;
use hgrid_tests::owned::Owned;
use hgrid_tests::scenes::{Built, scattered};

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
            assert!(bytes < enough && enough <= bound.index_bytes, "{enough} of {exact} bytes");
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
