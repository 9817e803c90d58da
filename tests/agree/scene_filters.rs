//! Filters in scenes: they are asked about the right hits, and what they say counts.

use std::collections::HashSet;

use hgrid_core::{Coherence, Config, Object, SceneHit, SceneOptions, Strided, StridedMut, Verdict};
use hgrid_tests::meshes::{ball, soup};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::scenes::{Built, scattered};

use super::scenes::{Alone, ray, with_grids};

#[test]
fn filters_see_the_hits_of_the_scene() {
    with_grids(|objects, _| {
        let instances = scattered(30, 3, 3.0, 12);
        let built = Built::scene(&instances, objects, &Config::default()).unwrap();
        let scene = built.open(objects).unwrap();
        let alone = Alone::new(&instances, objects);
        let keeps = |hit: &SceneHit, number: u32| (hit.primitive + number).is_multiple_of(3);
        let mut random = Random(14);
        let mut changed = 0;
        for round in 0..300 {
            let ray = ray(&mut random, round, 3.0);
            let expected = alone.closest(objects, &ray, |number, scene, ray| {
                let mut filter = |_: usize, hit: &SceneHit| {
                    if keeps(hit, number) { Verdict::Accept } else { Verdict::Reject }
                };
                let filter = Some(&mut filter as &mut _);
                scene.intersect_with(ray, &mut SceneOptions { filter, ..SceneOptions::default() })
            });
            let mut filter = |place: usize, hit: &SceneHit| {
                assert_eq!(place, 0);
                if keeps(hit, hit.path[0]) { Verdict::Accept } else { Verdict::Reject }
            };
            let mut options = SceneOptions { filter: Some(&mut filter), ..SceneOptions::default() };
            let hit = scene.intersect_with(&ray, &mut options);
            assert_eq!(hit, expected);
            assert_eq!(scene.occluded_with(&ray, &mut options), expected.is_some());
            changed += usize::from(hit != scene.intersect(&ray));
        }
        assert!(changed > 10);
    });
}

/// Gives triangles masks, and asks the filter about some of them. The oracle is a filter that is asked about all, and
/// accepts the others.
#[test]
fn opaque_triangles_count_without_a_call() {
    const ASKED: u32 = 2;
    let meshes = [ball(6, 1.0), soup(200, 0.2, 5)];
    let masks = meshes.each_ref().map(|mesh| {
        let masks = (0..mesh.indices.len()).map(|triangle| [1, 2, 6, 0][triangle % 4]);
        masks.collect::<Vec<u32>>()
    });
    let views: Vec<_> = meshes
        .iter()
        .zip(&masks)
        .map(|(mesh, masks)| mesh.view().with_masks(Strided::new(masks)).unwrap())
        .collect();
    let owned: Vec<_> =
        views.iter().map(|view| Owned::build(view, &Config::default()).unwrap()).collect();
    let grids: Vec<_> =
        owned.iter().zip(&views).map(|(owned, view)| owned.open(view).unwrap()).collect();
    let objects: Vec<_> = grids.iter().map(Object::Grid).collect();
    let instances = scattered(20, 2, 3.0, 12);
    let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
    let inner = built.open(&objects).unwrap();
    let nested = [Object::Scene(&inner)];
    let built = Built::scene(&scattered(3, 1, 3.0, 5), &nested, &Config::default()).unwrap();
    let outer = built.open(&nested).unwrap();
    let keeps = |hit: &SceneHit| hit.primitive.is_multiple_of(5);
    let mut random = Random(15);
    for (scene, depth) in [(&inner, 0), (&outer, 1)] {
        let is_asked = |hit: &SceneHit| {
            let object = instances[hit.path[depth] as usize].object as usize;
            masks[object][hit.primitive as usize] & ASKED != 0
        };
        let [mut opaque, mut passed] = [0; 2];
        let rays: Vec<_> = (0..300).map(|round| ray(&mut random, round, 3.0)).collect();
        let mut answers = Vec::new();
        for &ray in &rays {
            let mut all = |_: usize, hit: &SceneHit| {
                if !is_asked(hit) || keeps(hit) { Verdict::Accept } else { Verdict::Reject }
            };
            let options = &mut SceneOptions { filter: Some(&mut all), ..SceneOptions::default() };
            let expected = scene.intersect_with(&ray, options);
            let mut some = |_: usize, hit: &SceneHit| {
                assert!(is_asked(hit));
                if keeps(hit) { Verdict::Accept } else { Verdict::Reject }
            };
            let filter = Some(&mut some as &mut _);
            let options =
                &mut SceneOptions { filter, filter_mask: ASKED, ..SceneOptions::default() };
            let hit = scene.intersect_with(&ray, options);
            assert_eq!(hit, expected);
            assert_eq!(scene.occluded_with(&ray, options), expected.is_some());
            answers.push(hit.unwrap_or(SceneHit::MISS));
            opaque += usize::from(hit.is_some_and(|hit| !is_asked(&hit)));
            passed += usize::from(hit != scene.intersect(&ray));
        }
        assert!(opaque > 20 && passed > 10, "{opaque} {passed}");

        // A batch answers alike. A mask of 0 asks about no triangle.
        let mut some = |_: usize, hit: &SceneHit| {
            if keeps(hit) { Verdict::Accept } else { Verdict::Reject }
        };
        let mut options = SceneOptions { filter: Some(&mut some), ..SceneOptions::default() };
        for filter_mask in [ASKED, 0] {
            options.filter_mask = filter_mask;
            let mut hits = vec![SceneHit::MISS; rays.len()];
            let given = Strided::new(&rays);
            let to = &mut StridedMut::new(&mut hits);
            scene.intersect_n_with(&given, to, Coherence::Incoherent, &mut options).unwrap();
            if filter_mask == 0 {
                let plain = rays.iter().map(|ray| scene.intersect(ray).unwrap_or(SceneHit::MISS));
                answers = plain.collect();
            }
            assert_eq!(hits, answers, "{filter_mask}");
        }
    }
}

/// The way to all hits of a ray. The oracle finds them one after the other, without a filter: each query starts
/// behind the hit of the last one. Of hits with the same `t` in an instance, it finds the one that a filter sees first.
#[test]
fn a_filter_that_rejects_all_hits_sees_each_once() {
    with_grids(|objects, _| {
        let instances = scattered(30, 3, 3.0, 12);
        let built = Built::scene(&instances, objects, &Config::default()).unwrap();
        let scene = built.open(objects).unwrap();
        let alone = Alone::new(&instances, objects);
        let mut random = Random(15);
        let mut most = 0;
        for round in 0..300 {
            let ray = ray(&mut random, round, 3.0);
            let mut seen = Vec::new();
            let mut filter = |_: usize, hit: &SceneHit| {
                seen.push((hit.path[0], hit.t.to_bits(), hit.primitive));
                Verdict::Reject
            };
            let mut options = SceneOptions { filter: Some(&mut filter), ..SceneOptions::default() };
            assert_eq!(scene.intersect_with(&ray, &mut options), None);

            let mut expected = Vec::new();
            alone.closest(objects, &ray, |number, scene, ray| {
                let mut rest = *ray;
                while let Some(hit) = scene.intersect(&rest) {
                    expected.push((number, hit.t.to_bits(), hit.primitive));
                    rest.t_min = hit.t.next_up();
                }
                None
            });
            most = most.max(expected.len());
            let once: HashSet<_> = seen.iter().collect();
            assert_eq!(once.len(), seen.len(), "{ray:?}");
            // Stable sorts: hits with the same `t` stay in the order in which they were seen.
            seen.sort_by_key(|&(number, t, _)| (number, t));
            seen.dedup_by_key(|&mut (number, t, _)| (number, t));
            expected.sort_by_key(|&(number, t, _)| (number, t));
            assert_eq!(seen, expected, "{ray:?}");
        }
        assert!(most > 4, "{most}");
    });
}
