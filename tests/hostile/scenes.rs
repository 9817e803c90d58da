//! Damaged scenes: opening and queries end, and a scene that `validate` accepts answers as the one that was built.

use hgrid_core::{Block, Config, Error, Grid, Instance, Object, RayF64, Scene, SceneHit};
use hgrid_tests::copy::Copy;
use hgrid_tests::meshes::ball;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::{Built, packed, prove_packed, scattered, with_packed};
use hgrid_tests::{rounds, setting};

/// Offsets in a header (docs/format.md).
const SKIPPED_COUNT: usize = 36;
const MESH: usize = 108;

/// Returns the number of mutants of each kind of scene.
fn mutants() -> u64 {
    setting("HGRID_MUTANTS", rounds(50_000) as u64) / 20
}

fn rays() -> Vec<RayF64> {
    let mut random = Random(3);
    (0..40)
        .map(|round| {
            let far = [0.5, 3.0, 1e6][round % 3];
            let from = random.point().map(|c| f64::from(c) * far);
            let to = random.point();
            #[expect(clippy::cast_possible_truncation, reason = "a direction")]
            let direction = std::array::from_fn(|k| to[k] - from[k] as f32);
            RayF64::new(from, direction)
        })
        .collect()
}

fn answers(scene: &Scene<'_>, rays: &[RayF64]) -> Vec<(Option<SceneHit>, bool)> {
    rays.iter().map(|ray| (scene.intersect(ray), scene.occluded(ray))).collect()
}

/// Asks for the surface of a ray's hit, and of a hit that no query found.
fn ask_for_surfaces(scene: &Scene<'_>, ray: &RayF64, random: &mut Random) {
    let number = |random: &mut Random| [0, random.below(40) as u32, u32::MAX][random.below(3)];
    let path = [0; 4].map(|_| number(random));
    let weight = |random: &mut Random| [0.5, -1e30, f32::INFINITY, f32::NAN][random.below(4)];
    let (u, v, primitive) = (weight(random), weight(random), number(random));
    let _ = scene.surface(ray, &SceneHit { t: 1.0, u, v, primitive, path });
    let _ = scene.intersect(ray).map(|hit| scene.surface(ray, &hit));
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn damaged_scenes_end_and_accepted_ones_answer_right() {
    let mesh = ball(2, 1.0);
    let owned = Owned::build(&mesh.view(), &Config::default()).unwrap();
    let grid: Grid<'_> = owned.open(&mesh.view()).unwrap();
    let objects = [Object::Grid(&grid), Object::Grid(&grid)];
    let instances = scattered(25, 2, 1.0, 6);
    let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
    let scene = built.open(&objects).unwrap();
    let (rays, bytes) = (rays(), scene.blob());
    let expected = answers(&scene, &rays);
    assert!(expected.iter().filter(|(hit, _)| hit.is_some()).count() > 5);
    let mut random = Random(setting("HGRID_SEED", 1));
    let (mut opened, mut accepted, mut compared) = (0, 0, 0);
    for round in 0..mutants() {
        let mut copy = Copy::of(bytes);
        for _ in 0..=round % 3 {
            let at = random.below(bytes.len() / 4) * 4;
            let word = match random.below(4) {
                0 => copy.word(at) ^ 1 << random.below(32),
                1 => copy.word(at).wrapping_add(1),
                2 => copy.word(random.below(bytes.len() / 4) * 4),
                _ => random.below(64) as u32,
            };
            copy.set_word(at, word);
        }
        // Correct the checksum now and then, so that the header is read.
        if random.below(2) == 0 {
            copy.sign();
        }
        let Ok(mutant) = Scene::open(copy.bytes(), &objects) else { continue };
        opened += 1;
        let found = answers(&mutant, &rays);
        rays.iter().for_each(|ray| ask_for_surfaces(&mutant, ray, &mut random));
        if mutant.validate(&mut vec![0; mutant.validate_bytes()]).is_err() {
            continue;
        }
        accepted += 1;
        // No proof can know the place, object and mask that the caller gave an instance.
        let same = (0..25).all(|number| {
            let (one, other) = (mutant.instance(number), scene.instance(number));
            let key = |i: hgrid_core::Instance| (i.linear, i.translation, i.object, i.mask);
            one.map(key) == other.map(key)
        });
        compared += usize::from(same);
        assert!(!same || found == expected, "round {round}");
    }
    assert!(
        opened > mutants() / 10 && accepted > mutants() / 1000 && compared > 0,
        "{opened} opened, {accepted} accepted, {compared} compared"
    );
    // All truncations are refused.
    for length in (0..bytes.len()).step_by(13) {
        let copy = Copy::of(&bytes[..length]);
        assert!(Scene::open(copy.bytes(), &objects).is_err(), "{length}");
    }
    // A refit that refuses a header has changed nothing.
    for offset in [SKIPPED_COUNT, MESH] {
        let mut copy = Copy::of(bytes);
        copy.set_word(offset, 1);
        copy.sign();
        let before = copy.bytes().to_vec();
        let refused = Scene::refit(copy.bytes_mut(), &scattered(25, 2, 1.0, 7), &objects);
        assert_eq!(refused.map(|_| ()), Err(Error::Corrupt { offset: offset as u64 }));
        assert!(copy.bytes() == before);
    }
}

/// Returns the offsets of words in a packed scene's header, its references, and the headers of all members.
fn heads(bytes: &[u8]) -> Vec<usize> {
    let mut words: Vec<usize> = (0..64).map(|word| 4 * word).collect();
    let starts = (0..bytes.len()).step_by(64).filter(|&at| bytes[at..].starts_with(b"hgrid"));
    words.extend(starts.flat_map(|at| (at..at + 128).step_by(4)));
    words
}

#[test]
#[cfg_attr(miri, ignore = "hours")]
fn damaged_packed_scenes_end_and_accepted_ones_answer_right() {
    let mesh = ball(2, 1.0);
    let owned = Owned::build(&mesh.view(), &Config::default()).unwrap();
    let grid: Grid<'_> = owned.open(&mesh.view()).unwrap();
    let grids = [Object::Grid(&grid), Object::Nothing];
    let inner = Built::scene(&scattered(9, 2, 1.0, 4), &grids, &Config::default()).unwrap();
    let inner = inner.open(&grids).unwrap();
    let objects = [Object::Scene(&inner), Object::Grid(&grid)];
    let instances = [Instance::new(1), Instance::new(0), Instance::new(0)];
    let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
    let scene = built.open(&objects).unwrap();
    let file = packed(&scene).unwrap();
    let (rays, bytes) = (rays(), Block::bytes(&file));
    let heads = heads(bytes);
    let mut random = Random(setting("HGRID_SEED", 1));
    let (mut opened, mut accepted, mut hits) = (0, 0, 0);
    for round in 0..mutants() {
        let mut copy = Copy::of(bytes);
        for _ in 0..=round % 3 {
            let anywhere = random.below(bytes.len() / 4) * 4;
            let at = if random.below(2) == 0 { heads[random.below(heads.len())] } else { anywhere };
            let word = match random.below(4) {
                0 => copy.word(at) ^ 1 << random.below(32),
                1 => copy.word(at).wrapping_add(1),
                2 => copy.word(random.below(bytes.len() / 4) * 4),
                _ => random.below(64) as u32,
            };
            copy.set_word(at, word);
        }
        // Correct the checksums now and then, so that the headers are read.
        if random.below(2) == 0 {
            copy.sign();
            for at in (64..bytes.len()).step_by(64) {
                if copy.bytes()[at..].starts_with(b"hgrid") {
                    let mut own = Copy::of(&copy.bytes()[at..]);
                    own.sign();
                    copy.set(at, own.bytes());
                }
            }
        }
        let is_opened = with_packed(copy.bytes(), |mutant| {
            mutant.is_ok_and(|mutant| answers(&mutant, &rays).len() == rays.len())
        });
        opened += u64::from(is_opened);
        if prove_packed(copy.bytes()).is_err() {
            continue;
        }
        assert!(is_opened, "round {round}: proven, and not opened");
        accepted += 1;
        // In any case each hit is on a triangle of the hit object's mesh.
        with_packed(copy.bytes(), |mutant| {
            let mutant = mutant.unwrap();
            for hit in rays.iter().filter_map(|ray| mutant.intersect(ray)) {
                let Some(Object::Grid(grid)) = mutant.object_of(&hit) else { panic!("a grid") };
                assert!(hit.primitive < grid.mesh().triangle_count(), "round {round}");
                hits += 1;
            }
        });
    }
    assert!(
        opened > mutants() / 10 && accepted > mutants() / 1000 && hits > accepted,
        "{opened} opened, {accepted} accepted, {hits} hits"
    );
}

/// Offset of the bytes of the tree in a header.
const BLOB_BYTES: usize = 16;

/// Returns the place of the table in the blob of a scene: behind its tree.
fn table_of(blob: &[u8]) -> usize {
    let bytes: [u8; 8] = blob[BLOB_BYTES..][..8].try_into().unwrap();
    (u64::from_ne_bytes(bytes) as usize).next_multiple_of(64)
}

#[test]
fn a_table_says_how_many_objects_instances_name_and_nothing_else() {
    let mesh = ball(1, 1.0);
    let owned = Owned::build(&mesh.view(), &Config::default()).unwrap();
    let grid: Grid<'_> = owned.open(&mesh.view()).unwrap();
    let objects = [Object::Grid(&grid), Object::Grid(&grid), Object::Nothing];
    let built = Built::scene(&[Instance::new(1)], &objects, &Config::default()).unwrap();
    let table = table_of(built.bytes());
    let proven = |at: usize, word: u32| {
        let mut copy = Copy::of(built.bytes());
        copy.set_word(table + at, word);
        let scene = Scene::open(copy.bytes(), &objects).unwrap();
        scene.validate(&mut vec![0; scene.validate_bytes()])
    };
    let damaged = Err(hgrid_core::Error::Corrupt { offset: table as u64 });
    assert_eq!(proven(0, 2), Ok(()));
    for (at, word) in [(0, 0), (0, 1), (0, 3), (4, 1), (60, 1)] {
        assert_eq!(proven(at, word), damaged, "{at} {word}");
    }
}

#[test]
fn a_packed_scene_refers_to_what_lies_before() {
    let mesh = ball(1, 1.0);
    let owned = Owned::build(&mesh.view(), &Config::default()).unwrap();
    let grid: Grid<'_> = owned.open(&mesh.view()).unwrap();
    let grids = [Object::Grid(&grid)];
    let inner = Built::scene(&[Instance::new(0)], &grids, &Config::default()).unwrap();
    let inner = inner.open(&grids).unwrap();
    let objects = [Object::Scene(&inner)];
    let built = Built::scene(&[Instance::new(0)], &objects, &Config::default()).unwrap();
    let scene = built.open(&objects).unwrap();
    let file = packed(&scene).unwrap();
    let bytes = Block::bytes(&file);
    prove_packed(bytes).unwrap();
    // The inner scene shows member 0, the outer one member 1; after these references there is only padding.
    let with = |at: usize, word: u32| {
        let mut copy = Copy::of(bytes);
        copy.set_word(at, word);
        with_packed(copy.bytes(), |opened| opened.map(|_| ()))
    };
    let damaged = Err(hgrid_core::Error::Corrupt { offset: 32 });
    assert_eq!((with(128, 0), with(132, 1)), (Ok(()), Ok(())));
    // A reference to itself, to a later member, to none, and a word in the padding.
    assert_eq!(
        (with(128, 1), with(128, 2), with(132, 2), with(132, 9)),
        (damaged, damaged, damaged, damaged)
    );
    assert_eq!(with(136, 1), damaged);
    // Bytes behind the last scene, which the header counts.
    let mut copy = Copy::of(&[bytes, &[0; 64]].concat());
    copy.set(BLOB_BYTES, &(bytes.len() as u64 + 64).to_ne_bytes());
    copy.sign();
    assert_eq!(with_packed(copy.bytes(), |opened| opened.map(|_| ())), damaged);
    // The place of an error in a member is one of the whole: here in the table of the inner scene.
    let table = table_of(inner.blob()) as u64;
    let inside = bytes.len() - scene.blob().len() - inner.blob().len();
    let mut copy = Copy::of(bytes);
    copy.set_word(inside + table as usize + 4, 1);
    let offset = inside as u64 + table;
    assert_eq!(prove_packed(copy.bytes()), Err(hgrid_core::Error::Corrupt { offset }));
    // The outer scene may show the grid in place of the inner scene; only the proof finds that.
    assert_eq!(with(132, 0), Ok(()));
    let mut copy = Copy::of(bytes);
    copy.set_word(132, 0);
    assert!(
        prove_packed(copy.bytes()).is_err(),
        "the box of a ball is that of the scene around it"
    );
}
