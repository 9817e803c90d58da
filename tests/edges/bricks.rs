//! Brick grids of meshes that mix sizes: answers as brute force gives them, bytes in proportion to
//! the triangles, and no ray that is shown most of the mesh.

use hgrid_core::{
    Config, Counters, Grid, IndexType, MAX_RESOLUTION, Method, QueryOptions, Ray, Strided,
    TriangleMesh,
};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::oracle;
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;

use crate::chunks::{Kind, sites};

/// A factor on the width of cells.
fn config(cell_size: f32) -> Config {
    Config { cell_size, ..Config::new(Method::Brick) }
}

/// What a mesh may cost.
struct Cost {
    /// Bytes of the blob for each triangle, beside a block or two.
    bytes: usize,
    /// Triangles that one ray is shown.
    tests: u64,
}

/// Rays between points of the mesh's box, at vertices and along the axes: as brute force answers,
/// at no more than this cost with cells as they come.
fn agrees(mesh: &Mesh, cost: &Cost) {
    let view = mesh.view();
    for cell_size in [1.0, 0.3, 4.0] {
        let owned = Owned::build(&view, &config(cell_size)).unwrap();
        let grid = owned.open(&view).unwrap();
        prove(&grid).unwrap();
        let longest = rays(mesh, &grid, 150)
            .into_iter()
            .map(|ray| {
                oracle::check(&grid, &ray);
                let mut counters = Counters::default();
                let _ = grid.intersect_with(&ray, &mut QueryOptions::counting(&mut counters));
                counters.primitive_tests
            })
            .max();
        if cell_size == 1.0 {
            let bytes = owned.bytes().len();
            let most = cost.bytes * mesh.indices.len() + 2048;
            assert!(bytes <= most, "{bytes} bytes, {most} expected");
            assert!(longest <= Some(cost.tests), "{longest:?} tests, {} expected", cost.tests);
        }
    }
}

fn rays(mesh: &Mesh, grid: &Grid<'_>, count: usize) -> Vec<Ray> {
    let (min, max) = grid.bounds();
    let mut random = Random(79);
    (0..count)
        .map(|i| {
            let mut point = |reach: f32| -> [f32; 3] {
                std::array::from_fn(|k| {
                    let half = (max[k] - min[k]) / 2.0;
                    min[k] + half + half * reach * (random.unit() * 2.0 - 1.0)
                })
            };
            let (origin, mut target) = (point([1.0, 3.0][i % 2]), point(1.0));
            if i % 3 != 0 {
                let triangle = mesh.indices[i * 7919 % mesh.indices.len()];
                target = mesh.positions[triangle[i % 3] as usize];
            }
            let mut direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
            if i % 5 == 0 {
                // Along an axis, through the target.
                let axis = i / 5 % 3;
                let mut origin = target;
                origin[axis] = min[axis] - 1.0;
                direction = [0.0, -0.0, 0.0];
                direction[axis] = 1.0;
                return Ray::new(origin, direction);
            }
            Ray::new(origin, direction)
        })
        .collect()
}

/// How many cells are divided, in blocks and in divided cells.
fn divided(owned: &Owned) -> [usize; 2] {
    let sites = sites(owned.bytes());
    [0, 1]
        .map(|depth| sites.iter().filter(|s| s.kind == Kind::ChildMask && s.depth == depth).count())
}

#[test]
fn a_detailed_ball_in_a_coarse_room() {
    let mut mesh = ball(2, 0.0).scaled(1000.0);
    mesh.append(&ball(30, 1.0));
    agrees(&mesh, &Cost { bytes: 60, tests: 400 });
    let owned = Owned::build(&mesh.view(), &config(1.0)).unwrap();
    let [children, grandchildren] = divided(&owned);
    assert!(children > 0 && grandchildren > 0, "{children} {grandchildren}");
}

#[test]
fn crowds_in_crowds_are_divided() {
    let mesh = crowds();
    let owned = Owned::build(&mesh.view(), &config(1.0)).unwrap();
    let [children, grandchildren] = divided(&owned);
    assert!(children > 0 && grandchildren > 0, "{children} {grandchildren}");
    agrees(&mesh, &Cost { bytes: 60, tests: 1000 });

    // Rays within the crowds, where every step is in a divided cell.
    let view = mesh.view();
    let grid = owned.open(&view).unwrap();
    let mut random = Random(83);
    for size in [0.02, 1e-3] {
        for _ in 0..300 {
            let mut point = || random.point().map(|c| 0.3 + size * c);
            let (origin, target) = (point(), point());
            oracle::check(&grid, &Ray::new(origin, std::array::from_fn(|k| target[k] - origin[k])));
        }
    }
}

/// A ball, a crowd in it, and one in that.
pub(crate) fn crowds() -> Mesh {
    let mut mesh = ball(20, 1.0);
    for (count, size) in [(3000, 0.02), (3000, 1e-3)] {
        mesh.append(&soup(count, 0.03, 5).map(|p| p.map(|c| 0.3 + size * c)));
    }
    mesh
}

#[test]
fn long_thin_triangles() {
    let mut random = Random(19);
    let mut mesh = Mesh::default();
    for i in 0..1500 {
        let a = random.point();
        let mut b = random.point();
        if i % 2 == 0 {
            // Along an axis: one brick high, many long.
            let x = b[i % 3];
            b = a;
            b[i % 3] = x;
        }
        mesh.push([a, b, b.map(|c| c + 1e-3)]);
    }
    agrees(&mesh, &Cost { bytes: 120, tests: 3000 });
}

#[test]
fn a_soup_of_all_sizes() {
    let mut mesh = Mesh::default();
    for exponent in 0..8_u8 {
        let size = 2.0 * 0.3_f32.powi(exponent.into());
        mesh.append(&soup(20 + 40 * usize::from(exponent), size, exponent.into()));
    }
    agrees(&mesh, &Cost { bytes: 120, tests: 1000 });
}

/// Nothing tells them apart: a list as long as the mesh, once for each cell, and no division.
#[test]
fn identical_triangles() {
    let mut mesh = Mesh::default();
    for _ in 0..20_000 {
        mesh.push([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]);
    }
    let view = mesh.view();
    let owned = Owned::build(&view, &config(1.0)).unwrap();
    let grid = owned.open(&view).unwrap();
    prove(&grid).unwrap();
    assert!(owned.bytes().len() <= 40 * mesh.indices.len(), "{}", owned.bytes().len());
    for ray in rays(&mesh, &grid, 12) {
        oracle::check(&grid, &ray);
    }
    let hit = grid.intersect(&Ray::new([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]));
    assert_eq!(hit.map(|hit| hit.primitive), Some(0));
}

#[test]
fn one_huge_triangle_among_many_tiny_ones() {
    for huge in [3.0, 100.0] {
        let mut mesh = soup(6000, 0.01, 13);
        mesh.push([[-huge, -huge, 0.0], [huge, -huge, 0.1], [0.0, 2.0 * huge, -0.1]]);
        agrees(&mesh, &Cost { bytes: 80, tests: 1000 });
    }
}

/// More cells than triangles would like, of which one holds them all.
#[test]
fn all_triangles_in_one_cell() {
    let mut mesh = soup(2000, 0.05, 29).scaled(1e-3);
    mesh.push([[100.0; 3], [100.0; 3], [100.0, 100.0, 99.999]]);
    agrees(&mesh, &Cost { bytes: 80, tests: 2001 });
}

/// Vertices that no triangle uses must not stretch the box, or one cell would hold the mesh.
#[test]
fn stray_vertices_far_away() {
    let mesh = ball(20, 1.0);
    let mut stray = mesh.clone();
    stray.positions.extend([[1e6; 3], [-1e9, 0.0, 3.0], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0]]);
    agrees(&stray, &Cost { bytes: 60, tests: 300 });
    let [views, strays] = [&mesh, &stray].map(|mesh| {
        let view = mesh.view();
        let owned = Owned::build(&view, &config(1.0)).unwrap();
        let grid = owned.open(&view).unwrap();
        (grid.bounds(), grid.resolution(), grid.blob_bytes())
    });
    assert_eq!(views, strays);
}

#[test]
fn flat_scenes() {
    for axis in 0..3 {
        // So far out that the margin is as wide as the scene, every cell lists them all.
        for (height, tests) in [(0.0, 1000), (5.0, 1000), (-1e10, 8000)] {
            let flat = soup(2000, 0.05, 3).map(|mut p| {
                p[axis] = height;
                p
            });
            agrees(&flat, &Cost { bytes: 80, tests });
        }
    }
}

/// The cells of a flat scene are cubes. As slabs they would list thousands: none could be divided.
#[test]
fn a_crowd_in_a_flat_scene() {
    for axis in 0..3 {
        let mut mesh = soup(2000, 0.05, 3);
        mesh.append(&soup(6000, 0.05, 5).scaled(2e-3));
        let flat = mesh.map(|mut p| {
            p[axis] = 0.0;
            p
        });
        // Rays in the plane meet most of the crowd.
        agrees(&flat, &Cost { bytes: 60, tests: 8000 });
        let owned = Owned::build(&flat.view(), &config(1.0)).unwrap();
        let view = flat.view();
        let grid = owned.open(&view).unwrap();
        assert_eq!(grid.resolution()[axis], 1);
        let longest = grid.inspect().longest_list;
        assert!(longest <= 256, "{longest} ids in a list");
    }
}

#[test]
fn a_single_triangle() {
    agrees(&one_triangle(), &Cost { bytes: 0, tests: 1 });
    for size in [1e-30, 1e-3, 1e30] {
        agrees(&one_triangle().scaled(size), &Cost { bytes: 0, tests: 1 });
    }
}

/// Where a cell of an axis begins.
fn at(min: f32, max: f32, cell: u32, cells: u32) -> f32 {
    min + (max - min) * (cell as f32 / cells as f32)
}

/// Adds squares in planes between cells, bricks and blocks.
fn squares(mesh: &mut Mesh, at: &impl Fn(usize, u32) -> f32) {
    for axis in 0..3 {
        for cell in [1, 3, 4, 5, 8, 12, 15, 16, 17] {
            let corner = |u: u32, v: u32| {
                let mut p = [0.0; 3];
                p[axis] = at(axis, cell);
                p[(axis + 1) % 3] = at((axis + 1) % 3, u);
                p[(axis + 2) % 3] = at((axis + 2) % 3, v);
                p
            };
            let [a, b, c, d] = [corner(4, 4), corner(8, 4), corner(8, 16), corner(4, 16)];
            mesh.push([a, b, c]);
            mesh.push([a, c, d]);
        }
    }
}

/// Squares in all planes between cells, bricks and blocks, and rays in those planes.
#[test]
fn triangles_and_rays_on_planes_of_cells_bricks_and_blocks() {
    // The squares move the planes a little, which moves the squares: until both stay.
    let base = soup(4000, 0.02, 31);
    let (mut mesh, mut planes) = (base.clone(), None);
    let (owned, min, max, resolution) = loop {
        let owned = Owned::build(&mesh.view(), &config(1.0)).unwrap();
        let view = mesh.view();
        let grid = owned.open(&view).unwrap();
        prove(&grid).unwrap();
        let ((min, max), resolution) = (grid.bounds(), grid.resolution());
        let found = Some((min, max, resolution));
        if found == planes {
            break (owned, min, max, resolution);
        }
        planes = found;
        mesh = base.clone();
        squares(&mut mesh, &|axis, cell| at(min[axis], max[axis], cell, resolution[axis]));
    };
    assert!(resolution.iter().all(|&cells| cells > 18), "{resolution:?}");
    let view = mesh.view();
    let grid = owned.open(&view).unwrap();
    let at = |axis: usize, cell: u32| at(min[axis], max[axis], cell, resolution[axis]);
    let mut hits = 0;
    for axis in 0..3 {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        for (i, j) in (0..18).flat_map(|i| (0..18).map(move |j| (i, j))) {
            // Along the line where two planes meet, both ways, and within one plane.
            for towards in [1.0, -1.0] {
                let mut origin = [0.0; 3];
                origin[u] = at(u, i);
                origin[v] = at(v, j);
                origin[axis] = -2.0 * towards;
                let mut direction = [0.0, -0.0, -0.0];
                direction[axis] = towards;
                oracle::check(&grid, &Ray::new(origin, direction));
                direction[v] = 0.3 * towards;
                oracle::check(&grid, &Ray::new(origin, direction));
                hits += usize::from(grid.occluded(&Ray::new(origin, direction)));
            }
        }
    }
    assert!(hits > 100, "{hits}");
}

/// What would want millions of cells on an axis gets as many as an axis may have.
#[test]
fn more_cells_wanted_than_an_axis_may_have() {
    let mut mesh = Mesh::default();
    for i in 0..40_000_u16 {
        let x = f32::from(i) / 10.0;
        mesh.push([[x, 0.0, 0.0], [x + 2e-3, 0.0, 0.0], [x, 2e-3, 2e-3]]);
    }
    let view = mesh.view();
    let owned = Owned::build(&view, &config(1.0)).unwrap();
    let grid = owned.open(&view).unwrap();
    prove(&grid).unwrap();
    let [cells, ..] = grid.resolution();
    assert!((MAX_RESOLUTION / 2..=MAX_RESOLUTION).contains(&cells), "{cells}");
    assert!(owned.bytes().len() <= 40 * mesh.indices.len(), "{}", owned.bytes().len());
    let mut hits = 0;
    for triangle in mesh.indices.iter().step_by(397) {
        let [x, ..] = mesh.positions[triangle[0] as usize];
        let ray = Ray::new([x + 5e-4, 5e-4, 1.0], [0.0, 0.0, -1.0]);
        oracle::check(&grid, &ray);
        hits += usize::from(grid.occluded(&ray));
    }
    assert!(hits > 90, "{hits}");
    oracle::check(&grid, &Ray::new([-1.0, 5e-4, 4e-4], [1.0, 0.0, 0.0]));
    oracle::check(&grid, &Ray::new([5000.0, 5e-4, 4e-4], [-1.0, 0.0, 0.0]));
}

/// Short indices, odd strides and odd addresses give the same bytes.
#[test]
fn meshes_in_any_form() {
    let mesh = crowds();
    let tight = mesh.view();
    let expected = Owned::build(&tight, &config(1.0)).unwrap();
    let short = [(12, 6), (16, 8), (29, 7)].map(|strides| (IndexType::U16, strides));
    let long = [(12, 12), (12, 16), (16, 12), (29, 13)].map(|strides| (IndexType::U32, strides));
    for (index_type, (position_stride, index_stride)) in short.into_iter().chain(long) {
        let mut positions = vec![0xa5; 1];
        for (i, position) in mesh.positions.iter().enumerate() {
            positions.resize(1 + i * position_stride, 0xa5);
            positions.extend(position.iter().flat_map(|c| c.to_ne_bytes()));
        }
        let mut indices = vec![0xa5; 1];
        for (i, triangle) in mesh.indices.iter().enumerate() {
            indices.resize(1 + i * index_stride, 0xa5);
            for &vertex in triangle {
                match index_type {
                    IndexType::U16 => indices.extend(u16::try_from(vertex).unwrap().to_ne_bytes()),
                    IndexType::U32 => indices.extend(vertex.to_ne_bytes()),
                }
            }
        }
        let strided = |bytes, stride, count| Strided { bytes, stride, count };
        let view = TriangleMesh::strided(
            strided(&positions[1..], position_stride, mesh.positions.len()),
            strided(&indices[1..], index_stride, mesh.indices.len()),
            index_type,
        )
        .unwrap();
        let owned = Owned::build(&view, &config(1.0)).unwrap();
        assert!(owned.bytes() == expected.bytes(), "{position_stride} {index_stride}");
        let grid = owned.open(&view).unwrap();
        prove(&grid).unwrap();
        for ray in rays(&mesh, &grid, 40) {
            oracle::check(&grid, &ray);
        }
    }
}

/// Triangles that span the scene make cells larger until the lists are as few as promised.
#[test]
fn spanning_triangles_make_cells_larger() {
    let mesh = soup(800, 2.0, 23);
    agrees(&mesh, &Cost { bytes: 80, tests: 800 });
    let view = mesh.view();
    let owned = Owned::build(&view, &config(0.01)).unwrap();
    let grid = owned.open(&view).unwrap();
    prove(&grid).unwrap();
    let rebuilt = Owned::build(&view, &grid.config()).unwrap();
    assert_eq!(rebuilt.bytes(), owned.bytes());
    assert!(owned.bytes().len() <= 120 * mesh.indices.len(), "{}", owned.bytes().len());
}
