//! A tree that was refitted to moved vertices answers as brute force does on the moved mesh.

use hgrid_core::{
    Block, BuildFlags, ClosestPoint, Config, Error, Grid, IndexType, MAX_COORDINATE, MeshPart,
    Method, Parameters, Quality, QueryOptions, Ray, Strided, TriangleMesh, refit,
};
use hgrid_tests::copy::Copy;
use hgrid_tests::meshes::{Mesh, ball, one_triangle, room, soup};
use hgrid_tests::methods::configs;
use hgrid_tests::oracle;
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;

/// Builds a tree and returns a copy of its blob.
fn tree(mesh: &TriangleMesh<'_>) -> Copy {
    Copy::of(Owned::build(mesh, &Config::new(Method::Bvh)).unwrap().bytes())
}

/// Compares rays and closest points all around with brute force; returns the number of rays that hit.
fn agrees(grid: &Grid<'_>) -> usize {
    let (mut random, mut hits) = (Random(41), 0);
    let (min, max) = grid.bounds();
    for round in 0..40 {
        let mut inside = |width: f32| -> [f32; 3] {
            let unit = random.point();
            std::array::from_fn(|k| {
                0.5 * min[k] + 0.5 * max[k] + width * unit[k] * (0.5 * max[k] - 0.5 * min[k])
            })
        };
        let (from, to) = (inside([0.9, 3.0][round % 2]), inside(0.9));
        let direction = std::array::from_fn(|k| to[k] - from[k]);
        hits += usize::from(oracle::check(grid, &Ray::new(from, direction)));
        let found = grid.closest_point(from, f32::INFINITY, &mut QueryOptions::default());
        let all = (0..grid.mesh().triangle_count()).filter_map(|id| {
            ClosestPoint::on_triangle(&grid.mesh().triangle(id).unwrap(), id, from)
        });
        let expected = all.reduce(|a, b| if b.distance < a.distance { b } else { a });
        assert_eq!(found, expected, "{from:?}");
    }
    hits
}

#[test]
fn a_refitted_tree_answers_as_brute_force_and_is_valid() {
    let mut uneven = soup(300, 0.1, 3);
    uneven.append(&soup(900, 0.01, 4).scaled(1e-3));
    let mut random = Random(7);
    for mesh in [one_triangle(), ball(8, 1.0), soup(500, 0.2, 5), uneven, room(), Mesh::default()] {
        let mut copy = tree(&mesh.view());
        let built = copy.bytes().to_vec();
        let still = refit(copy.bytes_mut(), &mesh.view()).unwrap();
        assert_eq!(still.cost_before.to_bits(), still.cost_after.to_bits());
        assert!(copy.bytes() == built, "vertices that did not move");

        let jitter: Vec<_> = mesh.positions.iter().map(|_| random.point()).collect();
        let scattered = Mesh { positions: jitter, indices: mesh.indices.clone() };
        let moved = [
            mesh.map(|[x, y, z]| [x + 0.5 * y * y, y - 0.2 * z, z + 0.3 * x]),
            scattered,
            mesh.map(|[x, y, _]| [x, y, 0.0]),
            mesh.map(|_| [1.0, 2.0, 3.0]),
            mesh.scaled(1e-30),
            mesh.scaled(1e30),
            mesh.scaled(0.125 * MAX_COORDINATE),
            mesh.map(|[x, y, z]| [x + 1e6, y, z - 1e6]),
            mesh.map(|[x, y, z]| [1e-40 * x, y, 1e20 * z]),
            mesh.clone(),
        ];
        let mut met = 0;
        for (which, moved) in moved.iter().enumerate() {
            let costs = refit(copy.bytes_mut(), &moved.view()).unwrap();
            assert!(costs.cost_before >= 1.0 && costs.cost_after.is_finite(), "{which} {costs:?}");
            let view = moved.view();
            let grid = Grid::open(copy.bytes(), view).unwrap();
            prove(&grid).unwrap_or_else(|error| panic!("{which} {error}"));
            met += usize::from(agrees(&grid) > 2);
            // The box is that of a new build.
            let built = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
            assert_eq!(grid.bounds(), built.open(&view).unwrap().bounds(), "{which}");
        }
        assert!(copy.bytes() == built, "vertices that moved back");
        // Rays hit all but the mesh in one point and the one that is as good as a line.
        assert!(met == 8 || mesh.indices.is_empty(), "{met}");
    }
}

/// Expects a refit to vertices that did not move to change no byte of a tree.
fn stays_as_it_is(mesh: &TriangleMesh<'_>, config: &Config) {
    let mut copy = Copy::of(Owned::build(mesh, config).unwrap().bytes());
    let built = copy.bytes().to_vec();
    refit(copy.bytes_mut(), mesh).unwrap();
    assert!(copy.bytes() == built, "{config:?}");
}

#[test]
fn vertices_that_did_not_move_leave_trees_of_all_kinds_as_they_are() {
    // Smaller triangles nearer to a corner: a tree of more levels than most.
    let mut deep = Mesh::default();
    for size in 0..60 {
        deep.append(&soup(10, 0.1, size).scaled(0.5_f32.powi(i32::try_from(size).unwrap())));
    }
    // A vertex that no triangle uses is no part of the scene.
    let mut loose = soup(300, 0.2, 6);
    loose.positions.push([1e20; 3]);
    let high = Config::from(Parameters::Bvh { quality: Quality::High });
    for mesh in [soup(700, 0.2, 5), deep, loose, room()] {
        let narrow: Vec<_> =
            mesh.indices.iter().map(|all| all.map(|at| u16::try_from(at).unwrap())).collect();
        let (positions, indices) = (Strided::new(&mesh.positions), Strided::new(&narrow));
        let narrow = TriangleMesh::strided(positions, indices, IndexType::U16).unwrap();
        for config in [Config::new(Method::Bvh), high] {
            let mut parts = [MeshPart::new(narrow), MeshPart::new(mesh.view())];
            let joined = TriangleMesh::join(&mut parts).unwrap();
            for mesh in [narrow, mesh.view(), joined] {
                stays_as_it_is(&mesh, &config);
            }
        }
    }
}

#[test]
fn the_cost_tells_when_to_build_again() {
    let mesh = ball(30, 1.0);
    let mut copy = tree(&mesh.view());
    let bent = mesh.map(|[x, y, z]| [x + 0.1 * y, y, z]);
    let little = refit(copy.bytes_mut(), &bent.view()).unwrap();
    assert!(little.cost_after < 1.2 * little.cost_before, "{little:?}");
    let mut random = Random(3);
    let positions = mesh.positions.iter().map(|_| random.point()).collect();
    let scattered = Mesh { positions, indices: mesh.indices.clone() };
    let much = refit(copy.bytes_mut(), &scattered.view()).unwrap();
    assert_eq!(much.cost_before.to_bits(), little.cost_after.to_bits());
    assert!(much.cost_after > 3.0 * much.cost_before, "{much:?}");
    // The cost is relative to the surface of the tree's box, which one vertex can enlarge.
    let mut positions = scattered.positions.clone();
    positions[0] = [1000.0; 3];
    let spread = Mesh { positions, indices: mesh.indices.clone() };
    let small = refit(copy.bytes_mut(), &spread.view()).unwrap();
    assert!(small.cost_after < little.cost_before, "{small:?}");
    assert!(
        small.cost_after * surface(&spread) > 3.0 * little.cost_before * surface(&mesh),
        "{small:?}"
    );
    let back = refit(copy.bytes_mut(), &mesh.view()).unwrap();
    assert_eq!(back.cost_after.to_bits(), little.cost_before.to_bits());
}

/// Returns half the surface of the box that all vertices have.
fn surface(mesh: &Mesh) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let all = mesh.positions.iter().map(|position| f64::from(position[axis]));
        all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min)
    });
    x * y + y * z + z * x
}

/// Expects a refit to fail and to leave the bytes unchanged.
fn refused(copy: &mut Copy, mesh: &TriangleMesh<'_>, expected: Error) {
    let before = copy.bytes().to_vec();
    assert_eq!(refit(copy.bytes_mut(), mesh), Err(expected));
    assert!(copy.bytes() == before, "{expected:?}");
}

#[test]
fn what_cannot_be_refitted_is_left_as_it_was() {
    let mesh = soup(100, 0.2, 1);
    for config in configs().filter(|config| config.method() != Method::Bvh) {
        let owned = Owned::build(&mesh.view(), &config).unwrap();
        refused(&mut Copy::of(owned.bytes()), &mesh.view(), Error::CannotRefit);
    }
    let mut copy = tree(&mesh.view());
    let view = mesh.view();
    let grid = Grid::open(copy.bytes(), view).unwrap();
    let mut packed = vec![Block::ZERO; Block::count_for(grid.packed_bytes() as usize)];
    let mut packed = Copy::of(grid.pack(Block::bytes_mut(&mut packed)).unwrap());
    refused(&mut packed, &mesh.view(), Error::CannotRefit);

    let fewer = TriangleMesh::new(&mesh.positions, &mesh.indices[1..]).unwrap();
    refused(&mut copy, &fewer, Error::MeshMismatch);
    let short = TriangleMesh::new(&mesh.positions[1..], &mesh.indices).unwrap();
    refused(&mut copy, &short, Error::MeshMismatch);
    let mut wrong = mesh.clone();
    wrong.indices[70][1] = wrong.positions.len() as u32;
    refused(&mut copy, &wrong.view(), Error::IndexOutOfRange { triangle: 70 });
    refused(&mut Copy::of(&[0; 256]), &mesh.view(), Error::NotAGrid);

    for bad in [f32::NAN, f32::NEG_INFINITY, MAX_COORDINATE.next_up()] {
        let mut holed = mesh.clone();
        holed.positions[3 * 40 + 2][1] = bad;
        refused(&mut copy, &holed.view(), Error::NonFiniteTriangle { triangle: 40 });
        // A tree that was built without the triangle is refitted without it.
        let mut without = tree(&holed.view());
        let moved = holed.map(|p| p.map(|c| 2.0 * c));
        refit(without.bytes_mut(), &moved.view()).unwrap();
        let view = moved.view();
        let grid = Grid::open(without.bytes(), view).unwrap();
        assert_eq!(grid.skipped_count(), 1);
        prove(&grid).unwrap();
        assert!(agrees(&grid) > 2);
        refused(&mut without, &mesh.view(), Error::MeshMismatch);
        // A bad coordinate in another triangle instead, then in both.
        let mut other = mesh.clone();
        other.positions[3 * 7][0] = bad;
        refused(&mut without, &other.view(), Error::NonFiniteTriangle { triangle: 7 });
        other.positions[3 * 40][0] = bad;
        refused(&mut without, &other.view(), Error::NonFiniteTriangle { triangle: 7 });
    }
    // A vertex that no triangle uses may have any value.
    let mut loose = mesh.clone();
    loose.positions.push([f32::NAN; 3]);
    let config = Config { flags: BuildFlags::STRICT, ..Config::new(Method::Bvh) };
    let mut copy = Copy::of(Owned::build(&loose.view(), &config).unwrap().bytes());
    refit(copy.bytes_mut(), &loose.view()).unwrap();
}

#[test]
fn damaged_trees_are_refused_untouched_or_refitted_somehow() {
    let mesh = soup(90, 0.2, 2);
    let built = tree(&mesh.view());
    let moved = mesh.map(|[x, y, z]| [x + y, y, 2.0 * z]);
    let mut refusals = 0;
    for byte in 0..built.bytes().len() {
        for flip in [1, 0x80, 0xff] {
            let mut copy = Copy::of(built.bytes());
            copy.bytes_mut()[byte] ^= flip;
            if byte < 128 {
                copy.sign();
            }
            let before = copy.bytes().to_vec();
            if refit(copy.bytes_mut(), &moved.view()).is_err() {
                assert!(copy.bytes() == before, "byte {byte}");
                refusals += 1;
            } else if let Ok(grid) = Grid::open(copy.bytes(), moved.view()) {
                let _ = grid.intersect(&Ray::new([0.0; 3], [1.0, 0.5, 0.2]));
            }
        }
    }
    assert!(refusals > 100, "{refusals}");
    for length in 0..built.bytes().len() {
        let mut copy = Copy::of(&built.bytes()[..length]);
        assert!(refit(copy.bytes_mut(), &moved.view()).is_err(), "{length}");
    }
}
