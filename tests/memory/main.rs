//! Memory is exactly what the library says: the size it answers is enough, less is refused with the size
//! needed, and nothing beside the regions is touched.

mod budget;
mod owned;
mod scenes;
mod trees;

use hgrid_core::{Config, Error, Grid, Method, Parameters, Region, Sizes, TriangleMesh, sizes};
use hgrid_tests::guarded::Guarded;
use hgrid_tests::joined::{Parts, merged};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::methods;
use hgrid_tests::owned::Owned;

/// Builds with every `step`th size of one region, from 0 to a little more than enough, and with the sizes
/// next to enough; the other region is ample.
fn every_size(mesh: &TriangleMesh<'_>, config: &Config, step: usize) {
    match config.method() {
        Method::Bvh => trees::every_size(mesh, config, step),
        _ => every_size_of_grid(mesh, config, step),
    }
}

fn every_size_of_grid(mesh: &TriangleMesh<'_>, config: &Config, step: usize) {
    let expected = Owned::build(mesh, config).unwrap();
    let exact = expected.bytes().len();
    let scratch_bytes = sizes(mesh, config, &mut []).unwrap().scratch_bytes;
    // Methods with a pool fill it as they go, and the variable method asks for more scratch than it needs.
    let is_planned = !matches!(config.method(), Method::Variable | Method::Recursive);

    for bytes in (0..exact + 200).step_by(step).chain([exact - 1, exact, exact + 1]) {
        let (mut index, mut scratch) = (Guarded::new(bytes), Guarded::new(scratch_bytes));
        let result = Grid::build(*mesh, config, index.region(), scratch.region())
            .map(|grid| assert_eq!(grid.blob(), expected.bytes()));
        if bytes < exact {
            let (needed_bytes, available_bytes) = (exact as u64, bytes as u64);
            let error = Error::OutOfMemory { region: Region::Index, needed_bytes, available_bytes };
            assert_eq!(result, Err(error));
            assert!(!is_planned || index.is_untouched(), "written before it was known to fit");
        } else {
            assert_eq!(result, Ok(()));
        }
        assert!(index.around_is_intact() && scratch.around_is_intact(), "{bytes} bytes");
    }

    for bytes in (0..scratch_bytes + 200).step_by(step).chain([scratch_bytes - 1, scratch_bytes]) {
        let (mut index, mut scratch) = (Guarded::new(exact), Guarded::new(bytes));
        let result = Grid::build(*mesh, config, index.region(), scratch.region())
            .map(|grid| assert_eq!(grid.blob(), expected.bytes()));
        let answer = sizes(mesh, config, scratch.region()).unwrap();
        assert_eq!(answer.scratch_bytes, scratch_bytes);
        assert_eq!(answer.is_exact, result.is_ok() && bytes > 0);
        if let Err(error) = result {
            let (needed_bytes, available_bytes) = (scratch_bytes as u64, bytes as u64);
            let region = Region::Scratch;
            assert_eq!(error, Error::OutOfMemory { region, needed_bytes, available_bytes });
            assert!(bytes < scratch_bytes);
            assert!(index.is_untouched(), "written before it was known to fit");
        } else {
            assert!(config.method() == Method::Variable || bytes >= scratch_bytes);
            assert_eq!(answer.index_bytes, exact);
        }
        assert!(index.around_is_intact() && scratch.around_is_intact(), "{bytes} bytes");
    }
}

#[test]
fn every_size_from_nothing_to_enough() {
    for config in methods::configs() {
        every_size(&Mesh::default().view(), &config, 1);
        every_size(&one_triangle().view(), &config, 1);
        every_size(&ball(2, 1.0).view(), &config, 7);
        every_size(&soup(60, 0.3, 1).view(), &config.parameters.with_density(20.0).into(), 5);
        every_size(&soup(3000, 0.05, 1).view(), &config, 1003);
    }
}

#[test]
#[ignore = "slow: tens of thousands of builds"]
fn every_size_byte_by_byte() {
    for config in methods::configs() {
        every_size(&ball(2, 1.0).view(), &config, 1);
        every_size(&soup(60, 0.3, 1).view(), &config.parameters.with_density(20.0).into(), 1);
    }
}

/// Joined meshes take as much memory as one mesh with the same triangles.
#[test]
fn every_size_for_joined_meshes() {
    let meshes = [ball(2, 1.0), Mesh::default(), soup(40, 0.3, 1), one_triangle()];
    let stored = Parts::of(&meshes);
    let mut parts = stored.parts();
    let mesh = TriangleMesh::join(&mut parts).unwrap();
    for config in methods::configs() {
        every_size(&mesh, &config, 7);
        assert_eq!(
            sizes(&mesh, &config, &mut []),
            sizes(&merged(&meshes).view(), &config, &mut [])
        );
    }
}

#[test]
fn misaligned_regions_are_refused() {
    let mesh = one_triangle();
    let (mut index, mut scratch) = (Guarded::new(4096), Guarded::new(4096));
    for shift in 1..64 {
        let config = Config::default();
        let result =
            Grid::build(mesh.view(), &config, &mut index.region()[shift..], scratch.region());
        assert_eq!(result.unwrap_err(), Error::Misaligned { region: Region::Index });
        let misaligned = &mut scratch.region()[shift..];
        let result = Grid::build(mesh.view(), &config, index.region(), misaligned);
        assert_eq!(result.unwrap_err(), Error::Misaligned { region: Region::Scratch });
        let misaligned = &mut scratch.region()[shift..];
        let result = sizes(&mesh.view(), &config, misaligned);
        assert_eq!(result.unwrap_err(), Error::Misaligned { region: Region::Scratch });
    }
    assert!(index.is_untouched() && scratch.is_untouched());
}

/// The bound from the number of triangles alone holds for the worst meshes.
#[test]
fn the_bound_is_one() {
    let mut meshes = vec![Mesh::default(), one_triangle(), ball(10, 0.5)];
    // Triangles that span the scene: some of the meshes need more references than the limit allows.
    meshes.extend([soup(1, 1.0, 2), soup(7, 2.0, 2), soup(800, 2.0, 3), soup(5000, 0.02, 4)]);
    meshes.push(ball(20, 1.0).map(|[x, y, z]| [x, y * 1e-3, z * 0.1]));
    for mesh in &meshes {
        for config in [1e-3, 0.7, 4.0, 32.0, 500.0].into_iter().flat_map(methods::configs_with) {
            let view = mesh.view();
            let bound = Sizes::bound(view.triangle_count(), &config).unwrap();
            let Sizes { index_bytes, scratch_bytes, .. } = sizes(&view, &config, &mut []).unwrap();
            assert!(scratch_bytes <= bound.scratch_bytes, "{config:?}");
            let exact = Owned::build(&view, &config).unwrap().bytes().len();
            assert!(exact <= index_bytes && exact <= bound.index_bytes, "{config:?}");
        }
    }
    for density in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(Sizes::bound(1, &Parameters::OneLevel { density }.into()), None);
    }
}

/// Building again in the same memory gives the same grid, whatever the memory held.
#[test]
fn regions_can_be_used_again() {
    methods::configs().for_each(|config| used_again(&config));
}

fn used_again(config: &Config) {
    let (large, small) = (soup(2000, 0.1, 1), ball(3, 1.0));
    let bytes = sizes(&large.view(), config, &mut []).unwrap();
    let (mut index, mut scratch) =
        (Guarded::new(bytes.index_bytes), Guarded::new(bytes.scratch_bytes));
    for mesh in [&large, &small, &large, &small] {
        let grid = Grid::build(mesh.view(), config, index.region(), scratch.region()).unwrap();
        assert_eq!(grid.blob(), Owned::build(&mesh.view(), config).unwrap().bytes());
    }
    assert!(index.around_is_intact() && scratch.around_is_intact());
}
