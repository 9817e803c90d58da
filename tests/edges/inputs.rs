//! Wrong meshes and configurations get an error that names the fault; meshes that are only odd get a grid.

use hgrid_core::{
    BatchField, Block, BuildFlags, Config, ConfigField, Error, IndexType, Instance, MAX_COORDINATE,
    MeshField, Method, Object, Parameters, Ray, Scene, Sizes, Strided, TriangleMesh, sizes,
};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle};

fn build(mesh: &Mesh) -> Result<Owned, Error> {
    Owned::build(&mesh.view(), &Config::default())
}

#[test]
fn an_index_out_of_range_is_named() {
    let mut mesh = ball(4, 1.0);
    for bad in [u32::try_from(mesh.positions.len()).unwrap(), u32::MAX] {
        for corner in 0..3 {
            let good = mesh.indices[17];
            mesh.indices[17][corner] = bad;
            assert_eq!(build(&mesh).unwrap_err(), Error::IndexOutOfRange { triangle: 17 });
            mesh.indices[17] = good;
        }
    }
    assert!(build(&mesh).is_ok());
}

#[test]
fn triangles_that_are_not_finite_are_skipped_and_counted() {
    let sound = ball(6, 1.0);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, MAX_COORDINATE.next_up(), f32::MAX] {
        for axis in 0..3 {
            for corner in 0..3 {
                let mut mesh = sound.clone();
                let mut triangle = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 3.0]];
                triangle[corner][axis] = bad;
                mesh.push(triangle);
                let view = mesh.view();
                // The skipped triangle does not enlarge the box, and no list has its id.
                let one_level = Config::new(Method::OneLevel);
                let [owned, expected] =
                    [&mesh, &sound].map(|mesh| Owned::build(&mesh.view(), &one_level).unwrap());
                let expected = expected.open(&sound.view()).unwrap().bounds();
                assert_eq!(owned.open(&view).unwrap().bounds(), expected);
                let owned = build(&mesh).unwrap();
                let grid = owned.open(&view).unwrap();
                assert_eq!(grid.skipped_count(), 1);
                let (mut random, mut hits) = (Random(9), 0);
                for _ in 0..20 {
                    let (from, to) = (random.point().map(|c| c * 3.0), random.point());
                    let ray = Ray::new(from, std::array::from_fn(|k| to[k] - from[k]));
                    hits += usize::from(oracle::check(&grid, &ray));
                }
                assert!(hits > 5 && hits < 20, "{hits}");
                let strict = Config { flags: BuildFlags::STRICT, ..Config::default() };
                let triangle = view.triangle_count() - 1;
                let error = Owned::build(&view, &strict).unwrap_err();
                assert_eq!(error, Error::NonFiniteTriangle { triangle });
            }
        }
    }
}

#[test]
fn the_largest_coordinate_is_finite() {
    let mesh = ball(4, 1.0).scaled(MAX_COORDINATE);
    let view = mesh.view();
    let owned = build(&mesh).unwrap();
    let grid = owned.open(&view).unwrap();
    assert_eq!(grid.skipped_count(), 0);
    let ray = Ray::new([0.0; 3], [0.1, 0.2, 0.97]);
    assert!(oracle::check(&grid, &ray));
}

#[test]
fn densities_outside_the_range_are_refused() {
    let mesh = ball(4, 1.0);
    for density in [0.0, -0.0, -1.0, f32::NAN, f32::INFINITY, 1e30] {
        let config = Config::from(Parameters::OneLevel { density });
        let error = Error::InvalidConfig(ConfigField::Density);
        assert_eq!(sizes(&mesh.view(), &config, &mut []), Err(error), "{density}");
        assert_eq!(Owned::build(&mesh.view(), &config).unwrap_err(), error, "{density}");
    }
    for density in [f32::MIN_POSITIVE, 1e-10, 1000.0] {
        let config = Config::from(Parameters::OneLevel { density });
        assert!(Owned::build(&mesh.view(), &config).is_ok());
    }
    // A tree has no density.
    let tree = Parameters::new(Method::Bvh);
    assert_eq!((tree.with_density(f32::NAN), tree.density()), (tree, None));
}

/// Bounds grow with the density, even at densities that no build accepts.
#[test]
fn bounds_grow_with_the_density_however_high() {
    for config in methods::configs() {
        let (mut least, mut count) = (0, 0);
        for density in [1.0, 1e3, 1e10, 1e18, 1e19, 1e30, f32::MAX] {
            let bound = Sizes::bound(100, &config.parameters.with_density(density).into());
            let Some(Sizes { scratch_bytes, .. }) = bound else { continue };
            assert!(scratch_bytes >= least, "{:?} {density}", config.method());
            least = scratch_bytes;
            count += 1;
        }
        assert!(least > 0 && count > 1, "{count}");
    }
}

#[test]
fn unknown_flags_are_refused() {
    let flags = BuildFlags::from_bits_retain(1 << 31);
    let config = Config { flags, ..Config::default() };
    let error = Error::InvalidConfig(ConfigField::Flags);
    assert_eq!(Owned::build(&ball(1, 0.0).view(), &config).unwrap_err(), error);
    let (instances, objects) = ([Instance::new(0)], [Object::Nothing]);
    let [mut index, mut scratch] = [(); 2].map(|()| vec![Block::ZERO; 99]);
    let [index, scratch] = [&mut index, &mut scratch].map(|all| Block::bytes_mut(all));
    let scene = Scene::build(&instances, &objects, &config, index, scratch);
    assert_eq!(scene.unwrap_err(), error);
}

#[test]
fn arrays_that_end_early_are_refused() {
    let bytes = [0_u8; 100];
    let strided = |len: usize, stride, count| Strided { bytes: &bytes[..len], stride, count };
    let mesh = |positions, indices| TriangleMesh::strided(positions, indices, IndexType::U32);
    let positions = Err(MeshField::Positions);
    let indices = Err(MeshField::Indices);
    for (given, expected) in [
        (mesh(strided(36, 12, 3), strided(12, 12, 1)), Ok(())),
        (mesh(strided(35, 12, 3), strided(12, 12, 1)), positions),
        (mesh(strided(44, 16, 3), strided(12, 12, 1)), Ok(())),
        (mesh(strided(43, 16, 3), strided(12, 12, 1)), positions),
        (mesh(strided(36, 11, 3), strided(12, 12, 1)), positions),
        (mesh(strided(36, 0, 3), strided(12, 12, 1)), positions),
        (mesh(strided(36, usize::MAX, 3), strided(12, 12, 1)), positions),
        (mesh(strided(36, 12, usize::MAX), strided(12, 12, 1)), positions),
        (mesh(strided(36, 12, 3), strided(11, 12, 1)), indices),
        (mesh(strided(36, 12, 3), strided(27, 16, 2)), indices),
        (mesh(strided(36, 12, 3), strided(28, 16, 2)), Ok(())),
        (mesh(strided(36, 12, 3), strided(12, 11, 1)), indices),
        (mesh(strided(0, 0, 0), strided(0, 0, 0)), Ok(())),
    ] {
        assert_eq!(given.map(|_| ()), expected.map_err(Error::InvalidMesh));
    }
    let narrow =
        |len| TriangleMesh::strided(strided(36, 12, 3), strided(len, 6, 1), IndexType::U16);
    assert!(narrow(6).is_ok() && narrow(5).is_err());
}

#[test]
fn every_error_says_something_of_its_own() {
    let errors = [
        Error::Misaligned { region: hgrid_core::Region::Index },
        Error::InvalidMesh(MeshField::Positions),
        Error::InvalidMesh(MeshField::Indices),
        Error::TooManyTriangles,
        Error::IndexOutOfRange { triangle: 17 },
        Error::NonFiniteTriangle { triangle: 17 },
        Error::InvalidConfig(ConfigField::Method),
        Error::InvalidConfig(ConfigField::Density),
        Error::InvalidConfig(ConfigField::Flags),
        Error::MethodRemoved,
        Error::InvalidBatch(BatchField::Rays),
        Error::InvalidBatch(BatchField::Answers),
        Error::NotAGrid,
        Error::WrongByteOrder,
        Error::UnsupportedVersion { found: 17 },
        Error::Truncated { needed_bytes: 17, available_bytes: 3 },
        Error::MeshMismatch,
        Error::Corrupt { offset: 17 },
    ];
    let texts: std::collections::HashSet<String> = errors.iter().map(ToString::to_string).collect();
    assert_eq!(texts.len(), errors.len());
    assert!(texts.iter().all(|text| text.len() > 10));
}

#[test]
fn unused_vertices_do_not_matter() {
    let mut mesh = soup(50, 0.2, 5);
    let expected = build(&mesh).unwrap().open(&mesh.view()).unwrap().bounds();
    mesh.positions.push([1e20; 3]);
    mesh.positions.push([f32::NAN; 3]);
    let owned = build(&mesh).unwrap();
    let grid = owned.open(&mesh.view()).unwrap();
    assert_eq!((grid.bounds(), grid.skipped_count()), (expected, 0));
    assert!(build(&one_triangle()).is_ok());
}

/// A recursive grid of any accepted density has more cells or fails with an error; it never leaves triangles out.
#[test]
fn recursive_grids_of_every_density_answer_right() {
    let mesh = ball(6, 1.0);
    let view = mesh.view();
    let (mut built, mut hits) = (0, 0);
    for depth in 1..=hgrid_core::MAX_DEPTH {
        for density in [1e-3, 1.0, 32.0, 200.0, 5000.0, 1e6, 1e8, 1e12] {
            let config = Config::from(Parameters::Recursive { density, depth });
            let answer = sizes(&view, &config, &mut []);
            let is_too_fine = Err(Error::InvalidConfig(ConfigField::Density));
            if answer == is_too_fine || answer.is_ok_and(|need| need.scratch_bytes > 1 << 30) {
                continue;
            }
            let owned = Owned::build(&view, &config).unwrap();
            let grid = owned.open(&view).unwrap();
            let mut random = Random(67);
            for _ in 0..50 {
                let ray = Ray::new(random.point().map(|c| c * 2.0), random.point());
                hits += usize::from(oracle::check(&grid, &ray));
            }
            built += 1;
        }
    }
    assert!(built > 10 && hits > 40, "{built} {hits}");
}

#[test]
fn parameters_outside_their_range_are_refused() {
    let mesh = ball(2, 1.0);
    for macrocell_factor in [0, 1] {
        let config = Config::from(Parameters::Fixed { density: 32.0, macrocell_factor });
        let error = Error::InvalidConfig(ConfigField::MacrocellFactor);
        assert_eq!(Owned::build(&mesh.view(), &config).unwrap_err(), error);
    }
    for depth in [0, hgrid_core::MAX_DEPTH + 1, u32::MAX] {
        let config = Config::from(Parameters::Recursive { density: 8.0, depth });
        let error = Error::InvalidConfig(ConfigField::Depth);
        assert_eq!(Owned::build(&mesh.view(), &config).unwrap_err(), error);
    }
    for parameters in [
        Parameters::Fixed { density: 32.0, macrocell_factor: u32::MAX },
        Parameters::Fixed { density: 32.0, macrocell_factor: 5000 },
        Parameters::Variable { density: 4.0, subdivide_above: 0 },
        Parameters::Variable { density: 4.0, subdivide_above: u32::MAX },
    ] {
        let view = mesh.view();
        let owned = Owned::build(&view, &parameters.into()).unwrap();
        let grid = owned.open(&view).unwrap();
        prove(&grid).unwrap();
        assert!(oracle::check(&grid, &Ray::new([0.1, 0.2, 3.0], [0.0, 0.0, -1.0])));
    }
}
