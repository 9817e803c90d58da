//! Odd scenes and odd shapes: a clear error or a defined answer.

use hgrid_core::{
    BlobInfo, Block, Boxes, BuildFlags, Coherence, Config, ConfigField, Content, Error, Grid,
    Instance, Member, Method, Object, Ray, RayF64, Region, Scene, SceneHit, SceneOptions, ShapeHit,
    Shapes, Strided, StridedMut, Verdict,
};
use hgrid_tests::meshes::{Mesh, one_triangle};
use hgrid_tests::owned::Owned;
use hgrid_tests::scenes::{Built, packed, prove_packed, scattered, with_packed};

fn with_triangle(run: impl FnOnce(&[Object<'_>])) {
    let mesh = one_triangle();
    let owned = Owned::build(&mesh.view(), &Config::default()).unwrap();
    let grid: Grid<'_> = owned.open(&mesh.view()).unwrap();
    run(&[Object::Grid(&grid)]);
}

fn scaled(scale: [f32; 3]) -> Instance {
    let [x, y, z] = scale;
    Instance { linear: [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]], ..Instance::new(0) }
}

#[test]
fn an_instance_without_an_inverse_is_named() {
    with_triangle(|objects| {
        let shear = |a: f32| Instance {
            linear: [[1.0, a, 0.0], [a, a * a, 0.0], [0.0, 0.0, 1.0]],
            ..Instance::new(0)
        };
        let flat = Instance {
            linear: [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]],
            ..Instance::new(0)
        };
        let nowhere = |c: f64| Instance { translation: [0.0, c, 0.0], ..Instance::new(0) };
        let bad = [
            scaled([1.0, 0.0, 1.0]),
            scaled([0.0; 3]),
            scaled([f32::NAN, 1.0, 1.0]),
            scaled([1.0, f32::INFINITY, 1.0]),
            scaled([1e-40, 1.0, 1.0]),
            scaled([3e38; 3]),
            shear(1.0),
            shear(3.0),
            flat,
            nowhere(f64::NAN),
            nowhere(f64::INFINITY),
            nowhere(1e40),
        ];
        for instance in bad {
            let all = [Instance::new(0), instance];
            let error = Built::scene(&all, objects, &Config::default()).unwrap_err();
            assert_eq!(error, Error::InstanceWithoutInverse { instance: 1 }, "{instance:?}");
        }
        let missing = [Instance::new(0), Instance::new(0), Instance::new(1)];
        let error = Built::scene(&missing, objects, &Config::default()).unwrap_err();
        assert_eq!(error, Error::InstanceWithoutObject { instance: 2 });
        let most = [Instance::new(u32::MAX)];
        let error = Built::scene(&most, objects, &Config::default()).unwrap_err();
        assert_eq!(error, Error::InstanceWithoutObject { instance: 0 });
    });
}

#[test]
fn scales_from_tiny_to_huge_are_traced() {
    with_triangle(|objects| {
        for scale in [1e-30_f32, 1e-20, 1e-6, 1.0, 1e6, 1e20, 1e30] {
            // Scales that differ between the axes, too.
            for [x, y, z] in [[1.0, 1.0, 1.0], [1.0, -0.5, 2.0], [0.25, 1.0, 1e-3]] {
                let instance = scaled([x * scale, y * scale, z * scale]);
                let built = Built::scene(&[instance], objects, &Config::default()).unwrap();
                let scene = built.open(objects).unwrap();
                let s = f64::from(scale);
                let from = [0.25 * f64::from(x) * s, 0.25 * f64::from(y) * s, s];
                for length in [1.0_f32, 1e-6, 1e6] {
                    let ray = RayF64::new(from, [0.0, 0.0, -length * scale]);
                    let hit = scene.intersect(&ray).unwrap_or_else(|| panic!("{scale} {length}"));
                    assert!((hit.t * length - 1.0).abs() < 1e-5, "{scale} {length} {hit:?}");
                    assert!((hit.u - 0.25).abs() < 1e-5 && (hit.v - 0.25).abs() < 1e-5);
                    assert!(scene.occluded(&ray));
                    let short = RayF64 { t_max: hit.t * 0.99, ..ray };
                    assert!(!scene.occluded(&short));
                }
            }
        }
    });
}

/// A hit has a finite `t`, in a scene as in a grid. An infinite `t_max` accepts no more hits than the largest number.
#[test]
fn no_hit_is_farther_than_all_numbers() {
    with_triangle(|objects| {
        let behind = Instance { translation: [0.0, 0.0, -3e9], ..Instance::new(0) };
        for instances in [vec![Instance::new(0)], vec![behind, Instance::new(0)]] {
            let built = Built::scene(&instances, objects, &Config::default()).unwrap();
            let scene = built.open(objects).unwrap();
            for (distance, length, is_hit) in [
                (1e9, 1e-30_f32, false),
                (1.0, 1e-44, false),
                (-1e9, 1e-30, false),
                (1e9, 1e-28, true),
                (-1e9, 1e-28, true),
                (1.0, 1e-38, true),
            ] {
                let ray = RayF64::new([0.25, 0.25, distance], [0.0, 0.0, -length]);
                for t_max in [f32::INFINITY, f32::MAX] {
                    let ray = RayF64 { t_min: -t_max, t_max, ..ray };
                    let hit = scene.intersect(&ray);
                    assert_eq!(hit.is_some(), is_hit, "{ray:?} {hit:?}");
                    assert_eq!(scene.occluded(&ray), is_hit, "{ray:?}");
                    let rays = vec![ray; 70];
                    let rays = Strided::new(&rays);
                    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                        let (mut hits, mut occluded) = ([SceneHit::MISS; 70], [0_u8; 70]);
                        let (to, options) =
                            (&mut StridedMut::new(&mut hits), &mut SceneOptions::default());
                        scene.intersect_n_with(&rays, to, coherence, options).unwrap();
                        let to = &mut StridedMut::new(&mut occluded);
                        scene.occluded_n_with(&rays, to, coherence, options).unwrap();
                        assert!(hits.iter().all(|found| *found == hit.unwrap_or(SceneHit::MISS)));
                        assert!(occluded.iter().all(|&found| found == u8::from(is_hit)));
                    }
                    // The last instance is the closer one.
                    let last = instances.len() as u32 - 1;
                    assert!(hit.is_none_or(|hit| hit.t.is_finite() && hit.path[0] == last));
                }
                let never = [[f32::INFINITY; 2], [f32::NEG_INFINITY; 2]];
                assert!(
                    never.iter().all(|&[t_min, t_max]| {
                        !scene.occluded(&RayF64 { t_min, t_max, ..ray })
                    })
                );
            }
        }
    });
}

#[test]
fn scenes_of_nothing_are_never_hit() {
    let nothing = Mesh::default();
    let owned = Owned::build(&nothing.view(), &Config::default()).unwrap();
    let grid = owned.open(&nothing.view()).unwrap();
    let objects = [Object::Grid(&grid)];
    for instances in [Vec::new(), vec![Instance::new(0)], scattered(30, 1, 3.0, 1)] {
        let built = Built::scene(&instances, &objects, &Config::default()).unwrap();
        let scene = built.open(&objects).unwrap();
        for origin in [[0.0; 3], [0.0, 0.0, 5.0], [1e30, 0.0, 0.0]] {
            let ray = RayF64::new(origin, [0.0, 0.5, -1.0]);
            assert_eq!(scene.intersect(&ray), None);
            assert!(!scene.occluded(&ray));
        }
        assert_eq!(scene.triangle_normal(&SceneHit::MISS), None);
        assert!(scene.object_of(&SceneHit::MISS).is_none());
    }
}

/// A hit names an object only if the path ends at one that has the triangle.
#[test]
fn hits_that_no_query_gives_name_nothing() {
    with_triangle(|objects| {
        let built = Built::scene(&[Instance::new(0)], objects, &Config::default()).unwrap();
        let inner = built.open(objects).unwrap();
        let shown = [objects[0], Object::Nothing, Object::Scene(&inner)];
        let instances = [0, 1, 2].map(Instance::new);
        let built = Built::scene(&instances, &shown, &Config::default()).unwrap();
        let scene = built.open(&shown).unwrap();
        let hit = |path: &[u32], primitive: u32| {
            let mut hit = SceneHit { primitive, ..SceneHit::MISS };
            hit.path[..path.len()].copy_from_slice(path);
            hit
        };
        for named in [hit(&[0], 0), hit(&[2, 0], 0)] {
            assert!(scene.object_of(&named).is_some() && scene.instance_of(&named).is_some());
            assert!(scene.normal_of(&named, [0.0, 0.0, 1.0]).is_some());
        }
        for nothing in [
            hit(&[], 0),
            hit(&[0], 1),
            hit(&[1], 0),
            hit(&[2], 0),
            hit(&[2, 0], 1),
            hit(&[2, 1], 0),
            hit(&[3], 0),
            hit(&[0, 0], 0),
            hit(&[2, 0, 0], 0),
        ] {
            assert!(scene.object_of(&nothing).is_none(), "{nothing:?}");
            assert!(scene.instance_of(&nothing).is_none(), "{nothing:?}");
            assert_eq!(scene.normal_of(&nothing, [0.0, 0.0, 1.0]), None, "{nothing:?}");
        }
    });
}

#[test]
fn rays_that_are_none_miss_everything() {
    with_triangle(|objects| {
        let built = Built::scene(&[Instance::new(0)], objects, &Config::default()).unwrap();
        let scene = built.open(objects).unwrap();
        let ray = RayF64::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
        assert!(scene.occluded(&ray));
        for k in 0..3 {
            for odd in [f64::NAN, f64::INFINITY, 1e39, f64::MAX] {
                let mut ray = ray;
                ray.origin[k] = odd;
                assert!(!scene.occluded(&ray) && scene.intersect(&ray).is_none(), "{ray:?}");
            }
            for odd in [f32::NAN, f32::INFINITY] {
                let mut ray = ray;
                ray.direction[k] = odd;
                assert!(!scene.occluded(&ray), "{ray:?}");
            }
        }
        assert!(!scene.occluded(&RayF64 { direction: [0.0; 3], ..ray }));
        assert!(!scene.occluded(&RayF64 { t_min: 2.0, t_max: 1.0, ..ray }));
        assert!(!scene.occluded(&RayF64 { t_min: f32::NAN, ..ray }));
        assert!(!scene.occluded(&RayF64 { t_max: f32::NAN, ..ray }));
        assert!(scene.occluded(&RayF64 { t_min: f32::NEG_INFINITY, ..ray }));
        assert!(scene.occluded(&RayF64 { t_min: 1.0, t_max: 1.0, ..ray }));
    });
}

#[test]
fn blobs_are_opened_as_what_they_are() {
    with_triangle(|objects| {
        let Object::Grid(grid) = objects[0] else { panic!("a grid") };
        let scene = Built::scene(&[Instance::new(0)], objects, &Config::default()).unwrap();
        let boxes = [[0.0, 0.0, 0.0, 1.0, 1.0, 1.0_f32]];
        let boxes = Boxes::new(&boxes).unwrap();
        let shapes = Built::shapes(boxes, &Config::default()).unwrap();
        let other = |content| Error::OtherContent(content);
        let error = Scene::open(grid.blob(), objects).unwrap_err();
        assert_eq!(error, other(Content::Triangles));
        let error = Scene::open(shapes.bytes(), objects).unwrap_err();
        assert_eq!(error, other(Content::Shapes));
        let error = Shapes::open(scene.bytes(), boxes).unwrap_err();
        assert_eq!(error, other(Content::Instances));
        let error = Grid::open(scene.bytes(), *grid.mesh()).unwrap_err();
        assert_eq!(error, other(Content::Instances));
        let error = Grid::open_packed(shapes.bytes()).unwrap_err();
        assert_eq!(error, other(Content::Shapes));
        let error = scene.open(&[]).unwrap_err();
        assert_eq!(error, Error::MissingObjects { needed: 1, available: 0 });
    });
}

#[test]
fn boxes_that_are_none_leave_their_shapes_out() {
    let one = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0_f32];
    let odd = |at: usize, number: f32| {
        let mut sides = one;
        sides[at] = number;
        sides
    };
    let boxes = [
        odd(0, f32::NAN),
        one,
        odd(5, f32::INFINITY),
        odd(3, 1e37),
        // Opposite corners in the other order.
        [1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
        // A flat box, and a point.
        [0.5, 0.0, 0.0, 0.5, 1.0, 1.0],
        [0.5; 6],
    ];
    let view = Boxes::new(&boxes).unwrap();
    let built = Built::shapes(view, &Config::default()).unwrap();
    let shapes = Shapes::open(built.bytes(), view).unwrap();
    assert_eq!((shapes.count(), shapes.skipped_count()), (7, 3));
    let mut offered = Vec::new();
    let mut test = |id: u32, _: &Ray| {
        offered.push(id);
        None::<ShapeHit>
    };
    assert_eq!(shapes.intersect(&Ray::new([0.5, 0.5, -1.0], [0.0, 0.0, 1.0]), &mut test), None);
    offered.sort_unstable();
    assert_eq!(offered, [1, 4, 5, 6]);

    let strict = Config { flags: BuildFlags::STRICT, ..Config::default() };
    let error = Built::shapes(view, &strict).unwrap_err();
    assert_eq!(error, Error::NonFiniteTriangle { triangle: 0 });
    let grid = Config::new(Method::OneLevel);
    let error = Shapes::sizes(&view, &grid, &mut []).unwrap_err();
    assert_eq!(error, Error::InvalidConfig(ConfigField::Method));
    let error = Shapes::build(view, &grid, &mut [], &mut []).unwrap_err();
    assert_eq!(error, Error::InvalidConfig(ConfigField::Method));
    assert_eq!(Scene::bound(7, &grid), None);
    let short = Strided { bytes: &[0; 47], stride: 24, count: 2 };
    assert!(Boxes::strided(short).is_err());
    let narrow = Strided { bytes: &[0; 48], stride: 23, count: 2 };
    assert!(Boxes::strided(narrow).is_err());
}

/// A shape that answers with an infinite distance is not hit, at any scale.
#[test]
fn infinite_distances_are_no_hits() {
    let boxes = [[-1.0_f32, -1.0, -1.0, 1.0, 1.0, 1.0]];
    let boxes = Boxes::new(&boxes).unwrap();
    let config = Config::default();
    let built = Built::shapes(boxes, &config).unwrap();
    let shapes = Shapes::open(built.bytes(), boxes).unwrap();
    for t in [f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
        let mut test = |_: u32, _: &Ray| Some(ShapeHit { t, u: 0.0, v: 0.0 });
        let ray = Ray { t_min: f32::NEG_INFINITY, ..Ray::new([0.0, 0.0, 9.0], [0.0, 0.0, -1.0]) };
        assert_eq!(shapes.intersect(&ray, &mut test), None, "{t}");
        assert!(!shapes.occluded(&ray, &mut test), "{t}");
        let member = |_: u32, _: &Ray| Some(ShapeHit { t, u: 0.0, v: 0.0 });
        let objects = [Object::Shapes(&shapes, &member)];
        for scale in [0.25, 1.0, 4.0] {
            let scene = Built::scene(&[scaled([scale; 3])], &objects, &config).unwrap();
            let scene = scene.open(&objects).unwrap();
            assert_eq!(scene.intersect(&RayF64::from(&ray)), None, "{t} at scale {scale}");
        }
    }
}

/// Returns the distances that a filter is shown, which accepts all of them. The closest is 1.
fn distances_shown(scene: &Scene<'_>) -> Vec<f32> {
    let mut shown = Vec::new();
    let mut filter = |_: usize, hit: &SceneHit| {
        shown.push(hit.t);
        Verdict::Accept
    };
    let mut options = SceneOptions { filter: Some(&mut filter), ..SceneOptions::default() };
    let ray = RayF64::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]);
    let hit = scene.intersect_with(&ray, &mut options).unwrap();
    assert_eq!(hit.t.to_bits(), 1.0_f32.to_bits());
    shown
}

/// A filter of a scene is not shown what lies behind a hit that it accepted, not even one step of f32.
#[test]
fn filters_are_shown_nothing_behind_a_hit() {
    with_triangle(|objects| {
        // The triangle lies in the plane z = 0.
        let at = |z: f64| Instance { translation: [0.0, 0.0, z], ..Instance::new(0) };
        let (step, config) = (2.0_f64.powi(-23), Config::default());
        for (first, second) in [(0.0, step), (step, 0.0)] {
            let instances = [at(-first), at(-second)];
            let built = Built::scene(&instances, objects, &config).unwrap();
            let shown = distances_shown(&built.open(objects).unwrap());
            assert!(shown.is_sorted_by(|before, after| before > after), "{shown:?}");
        }

        // In a nested scene, two instances lie a step behind the hit of an instance outside.
        let inner = Built::scene(&[at(-step), at(-step)], objects, &config).unwrap();
        let inner = inner.open(objects).unwrap();
        // A second triangle beside the ray enlarges the box of that instance, so that the ray enters it first.
        let mut deep = one_triangle();
        deep.push([[5.0, 5.0, 0.5], [6.0, 5.0, 0.5], [5.0, 6.0, 0.5]]);
        let owned = Owned::build(&deep.view(), &config).unwrap();
        let deep = owned.open(&deep.view()).unwrap();
        let both = [Object::Grid(&deep), Object::Scene(&inner)];
        let instances = [Instance::new(0), Instance::new(1)];
        let built = Built::scene(&instances, &both, &config).unwrap();
        let shown = distances_shown(&built.open(&both).unwrap());
        assert!(shown.is_sorted_by(|before, after| before >= after), "{shown:?}");
    });
}

#[test]
fn a_refit_of_other_instances_is_refused() {
    with_triangle(|objects| {
        let instances = scattered(20, 1, 5.0, 1);
        let mut built = Built::scene(&instances, objects, &Config::default()).unwrap();
        let before = built.bytes().to_vec();
        let fewer = Scene::refit(built.bytes_mut(), &instances[1..], objects).unwrap_err();
        assert_eq!(fewer, Error::MeshMismatch);
        let more = [&instances[..], &instances[..1]].concat();
        let more = Scene::refit(built.bytes_mut(), &more, objects).unwrap_err();
        assert_eq!(more, Error::MeshMismatch);
        let none = Scene::refit(built.bytes_mut(), &instances, &[]).unwrap_err();
        assert_eq!(none, Error::MissingObjects { needed: 1, available: 0 });
        assert!(built.bytes() == before);
        let mut bad = instances.clone();
        bad[7].linear[1] = bad[7].linear[0];
        let error = Scene::refit(built.bytes_mut(), &bad, objects).unwrap_err();
        assert_eq!(error, Error::InstanceWithoutInverse { instance: 7 });
        let blocks = [Block::ZERO; 2];
        assert_eq!(Scene::open(Block::bytes(&blocks), objects).unwrap_err(), Error::NotAGrid);
    });
}

#[test]
fn packed_scenes_are_refused_for_what_they_are() {
    with_triangle(|objects| {
        let twice = [objects[0], Object::Nothing, objects[0]];
        let instances = [Instance::new(0), Instance::new(1), Instance::new(2)];
        let built = Built::scene(&instances, &twice, &Config::default()).unwrap();
        let scene = built.open(&twice).unwrap();
        let file = packed(&scene).unwrap();
        let bytes = Block::bytes(&file);
        let info = BlobInfo::peek(bytes).unwrap();
        assert_eq!((info.content, info.has_mesh), (Content::Packed, true));
        assert_eq!((info.triangle_count, info.vertex_count), (1, 1 + 3));
        prove_packed(bytes).unwrap();

        // No ray hits `Object::Nothing`, and it stays `Nothing` in the packed blob.
        let ray = RayF64::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
        with_packed(bytes, |opened| {
            let opened = opened.unwrap();
            assert_eq!(opened.intersect(&ray).map(|hit| hit.path[0]), Some(0));
            assert!(matches!(
                opened.objects(),
                [Object::Grid(_), Object::Nothing, Object::Grid(_)]
            ));
        });
        let nothing = [Object::Nothing];
        let built = Built::scene(&[Instance::new(0)], &nothing, &Config::default()).unwrap();
        assert_eq!(built.open(&nothing).unwrap().intersect(&ray), None);

        // Too little room for members or objects.
        let open = |members: usize, objects: usize| {
            let (mut members, mut objects) =
                (vec![Member::EMPTY; members], vec![Object::Nothing; objects]);
            Scene::open_packed(bytes, &mut members, &mut objects).map(|_| ())
        };
        open(1, 4).unwrap();
        open(3, 9).unwrap();
        assert_eq!(open(0, 4), Err(Error::MissingObjects { needed: 1, available: 0 }));
        assert_eq!(open(1, 3), Err(Error::MissingObjects { needed: 4, available: 3 }));

        // Room that is not aligned.
        let mut room = vec![Block::ZERO; file.len() + 1];
        let error = scene.pack(&mut Block::bytes_mut(&mut room)[1..]).unwrap_err();
        assert_eq!(error, Error::Misaligned { region: Region::Index });
        assert!(Block::bytes(&room).iter().all(|&byte| byte == 0), "something was written");

        // Too little scratch.
        let (mut members, mut places) = ([Member::EMPTY; 1], [Object::Nothing; 4]);
        let proven = Scene::open_packed_proven(bytes, &mut members, &mut places, &mut [0; 3]);
        let (needed_bytes, available_bytes) = (4, 3);
        let region = Region::Scratch;
        let error = Error::OutOfMemory { region, needed_bytes, available_bytes };
        assert_eq!(proven.unwrap_err(), error);

        // Blobs of other content, and bytes that are no blob.
        let Object::Grid(grid) = objects[0] else { panic!("a grid") };
        let other = |content| Some(Error::OtherContent(content));
        let error = |blob: &[u8]| with_packed(blob, |opened| opened.err());
        assert_eq!(error(grid.blob()), other(Content::Triangles));
        assert_eq!(error(scene.blob()), other(Content::Instances));
        assert_eq!(Scene::open(bytes, objects).err(), other(Content::Packed));
        assert_eq!(Grid::open_packed(bytes).err(), other(Content::Packed));
        assert_eq!(Grid::open(bytes, *grid.mesh()).err(), other(Content::Packed));
        assert_eq!(error(&[]), Some(Error::NotAGrid));
        assert_eq!(error(&bytes[32..]), Some(Error::Misaligned { region: Region::Index }));
        for length in (128..bytes.len()).step_by(13) {
            let (needed_bytes, available_bytes) = (bytes.len() as u64, length as u64);
            let truncated = Error::Truncated { needed_bytes, available_bytes };
            assert_eq!(error(&bytes[..length]), Some(truncated));
        }
    });
}

#[test]
fn shapes_are_not_packed() {
    let boxes = [[0.0, 0.0, 0.0, 1.0, 1.0, 1.0_f32]];
    let boxes = Boxes::new(&boxes).unwrap();
    let built = Built::shapes(boxes, &Config::default()).unwrap();
    let shapes = Shapes::open(built.bytes(), boxes).unwrap();
    let test = |_: u32, _: &Ray| None;
    let objects = [Object::Shapes(&shapes, &test)];
    let built = Built::scene(&[Instance::new(0)], &objects, &Config::default()).unwrap();
    let scene = built.open(&objects).unwrap();
    assert_eq!(scene.packed_bytes(), 0);
    let error = scene.pack(Block::bytes_mut(&mut [Block::ZERO; 64])).err();
    assert_eq!(error, Some(Error::OtherContent(Content::Shapes)));
}

#[test]
fn an_empty_scene_is_packed_as_one() {
    let built = Built::scene(&[], &[], &Config::default()).unwrap();
    let file = packed(&built.open(&[]).unwrap()).unwrap();
    prove_packed(Block::bytes(&file)).unwrap();
    let count = with_packed(Block::bytes(&file), |opened| opened.unwrap().instance_count());
    assert_eq!(count, 0);
}
