//! Damaged scenes: opening and asking end, and what `validate` accepts answers as the scene that was built.

use hgrid_core::{Config, Grid, Object, RayF64, Scene, SceneHit};
use hgrid_tests::copy::Copy;
use hgrid_tests::meshes::ball;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::{Built, scattered};
use hgrid_tests::setting;

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
    let (mut opened, mut accepted) = (0, 0);
    for round in 0..setting("HGRID_MUTANTS", 200_000) / 20 {
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
        // A header whose sum is right is looked at.
        if random.below(2) == 0 {
            copy.sign();
        }
        let Ok(mutant) = Scene::open(copy.bytes(), &objects) else { continue };
        opened += 1;
        let found = answers(&mutant, &rays);
        if mutant.validate(&mut vec![0; mutant.validate_bytes()]).is_err() {
            continue;
        }
        accepted += 1;
        // What no proof can know: where the caller put an instance, which object it shows and who sees it.
        let same = (0..25).all(|number| {
            let (one, other) = (mutant.instance(number), scene.instance(number));
            let key = |i: hgrid_core::Instance| (i.linear, i.translation, i.object, i.mask);
            one.map(key) == other.map(key)
        });
        assert!(!same || found == expected, "round {round}");
    }
    assert!(opened > 1000 && accepted > 10, "{opened} opened, {accepted} accepted");
    // Every truncation is refused.
    for length in (0..bytes.len()).step_by(13) {
        let copy = Copy::of(&bytes[..length]);
        assert!(Scene::open(copy.bytes(), &objects).is_err(), "{length}");
    }
}
