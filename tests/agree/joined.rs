//! Several meshes in one grid answer as one mesh with the same triangles, bit for bit.

use hgrid_core::{
    Block, Coherence, Config, Control, Cull, Grid, Hit, INVALID_ID, Method, QueryOptions, Ray,
    SimdLevel, Strided, StridedMut, Task, TriangleMesh, fit, refit, sizes_with,
};
use hgrid_tests::copy::Copy;
use hgrid_tests::joined::{Parts, merged};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::owned::{Owned, prove};
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle};

/// Returns meshes of every size, two of them with the same triangles in the same place: some leaves lie in
/// one part and some in several.
fn scene() -> Vec<Mesh> {
    let mut odd = soup(40, 0.5, 3);
    odd.positions[7] = [f32::NAN; 3];
    odd.positions[9] = [0.0, f32::INFINITY, 0.0];
    vec![
        Mesh::default(),
        ball(9, 1.0),
        soup(300, 0.1, 5),
        one_triangle(),
        Mesh { positions: vec![[0.5; 3]; 4], indices: Vec::new() },
        Mesh::default(),
        odd,
        ball(9, 1.0).map(|[x, y, z]| [x + 0.125, y, z]),
        ball(9, 1.0),
        soup(500, 0.05, 11).scaled(0.02).map(|[x, y, z]| [x + 0.9, y, z]),
        one_triangle(),
        one_triangle(),
        Mesh::default(),
    ]
}

/// Returns many small meshes, so that most leaves lie in several parts.
fn crumbs() -> Vec<Mesh> {
    (0..150).map(|i| soup(i % 4, 0.3, i as u64)).collect()
}

fn rays(count: usize) -> Vec<Ray> {
    let mut random = Random(17);
    let ray = |round| {
        let scale = [0.9, 3.0][round % 2];
        let (from, to) = (random.point().map(|c| c * scale), random.point());
        Ray::new(from, std::array::from_fn(|k| to[k] - from[k]))
    };
    (0..count).map(ray).collect()
}

/// Puts every query to both grids and compares the answers.
fn answers_the_same(joined: &Grid<'_>, one: &Grid<'_>) {
    let all = rays(300);
    for ray in &all {
        let hit = one.intersect(ray);
        assert_eq!(joined.intersect(ray), hit, "{ray:?}");
        assert_eq!(joined.occluded(ray), one.occluded(ray), "{ray:?}");
        if let Some(hit) = hit {
            assert_eq!(joined.mesh().surface(ray, &hit), one.mesh().surface(ray, &hit));
        }
        let point = ray.origin;
        for mask in [u32::MAX, 4] {
            let closest = |grid: &Grid<'_>| {
                let mut options = QueryOptions { mask, ..QueryOptions::default() };
                grid.closest_point(point, 1.0, &mut options)
            };
            assert_eq!(closest(joined), closest(one), "{point:?}");
        }
    }
    let hits = all[..60].iter().filter(|ray| oracle::check(joined, ray)).count();
    assert!(hits > 20 || joined.mesh().triangle_count() == 0, "{hits}");
    let skip =
        all.iter().find_map(|ray| one.intersect(ray)).map_or(INVALID_ID, |hit| hit.primitive);
    for (mask, cull, skip) in
        [(u32::MAX, Cull::None, INVALID_ID), (6, Cull::Back, skip), (8, Cull::None, INVALID_ID)]
    {
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let answers = |grid: &Grid<'_>| {
                let mut hits = vec![Hit::MISS; all.len()];
                let mut blocked = vec![0_u8; all.len()];
                let options = || QueryOptions { mask, cull, skip, ..QueryOptions::default() };
                let (rays, mut to) = (Strided::new(&all), StridedMut::new(&mut hits));
                grid.intersect_n_with(&rays, &mut to, coherence, &mut options()).unwrap();
                let mut to = StridedMut::new(&mut blocked);
                grid.occluded_n_with(&rays, &mut to, coherence, &mut options()).unwrap();
                (hits, blocked)
            };
            let expected = answers(one);
            for level in SimdLevel::available() {
                let found = answers(&joined.with_simd(level));
                assert!(found == expected, "{mask} {cull:?} {skip} {coherence:?} {level:?}");
            }
        }
    }
}

/// Returns the origin of each triangle: the number of its mesh, and its id there.
fn places(meshes: &[Mesh]) -> Vec<(u32, u32)> {
    let counts =
        (0..).zip(meshes).map(|(at, mesh)| (at, u32::try_from(mesh.indices.len()).unwrap()));
    counts.flat_map(|(at, count)| (0..count).map(move |id| (at, id))).collect()
}

fn locates(mesh: &TriangleMesh<'_>, places: &[(u32, u32)]) {
    let found: Vec<_> = (0..mesh.triangle_count()).map(|id| mesh.locate(id).unwrap()).collect();
    assert_eq!(found, places);
    assert_eq!(mesh.locate(mesh.triangle_count()), None);
    assert_eq!(mesh.locate(INVALID_ID), None);
}

#[test]
fn a_grid_of_several_meshes_is_that_of_their_triangles() {
    for meshes in [scene(), crumbs(), vec![ball(8, 1.0)], vec![Mesh::default(); 3], Vec::new()] {
        let all = merged(&meshes);
        let stored = Parts::of(&meshes);
        let masks = stored.masks();
        let mut parts = stored.parts();
        let mesh = TriangleMesh::join(&mut parts).unwrap();
        let one = all.view().with_masks(Strided::new(&masks)).unwrap();
        locates(&mesh, &places(&meshes));
        assert_eq!(mesh.triangle_count(), one.triangle_count());
        assert_eq!(mesh.vertex_count(), one.vertex_count());
        for id in 0..=one.triangle_count() {
            let bits =
                |mesh: &TriangleMesh<'_>| mesh.triangle(id).map(|t| t.map(|p| p.map(f32::to_bits)));
            assert_eq!(bits(&mesh), bits(&one));
            assert_eq!(mesh.mask(id), one.mask(id));
        }
        for config in methods::configs() {
            let (joined, expected) = (Owned::build(&mesh, &config), Owned::build(&one, &config));
            let (joined, expected) = (joined.unwrap(), expected.unwrap());
            assert!(joined.bytes() == expected.bytes(), "{config:?}");
            let (joined, expected) = (joined.open(&mesh).unwrap(), expected.open(&one).unwrap());
            prove(&joined).unwrap();
            assert_eq!(joined.inspect(), expected.inspect());
            assert_eq!(joined.skipped_count(), expected.skipped_count());
            answers_the_same(&joined, &expected);
        }
    }
}

#[test]
fn fits_are_the_same() {
    let meshes = scene();
    let all = merged(&meshes);
    let stored = Parts::of(&meshes);
    let mut parts = stored.parts();
    let mesh = TriangleMesh::join(&mut parts).unwrap();
    for config in methods::configs() {
        let fitted = |mesh: &TriangleMesh<'_>| {
            let mut scratch = vec![Block::ZERO; 1 << 15];
            fit(mesh, &config, 40_000, Block::bytes_mut(&mut scratch))
        };
        assert_eq!(fitted(&mesh), fitted(&all.view()), "{config:?}");
    }
}

#[test]
fn tasks_build_the_same() {
    // Large enough for several tasks, cut where no task begins.
    let meshes = [soup(7001, 0.02, 1), soup(3, 1.0, 2), soup(13_000, 0.03, 3), ball(20, 1.0)];
    let all = merged(&meshes);
    let stored = Parts::of(&meshes);
    let mut parts = stored.parts();
    let mesh = TriangleMesh::join(&mut parts).unwrap();
    let run = |count: u32, task: &Task<'_>| (0..count).rev().for_each(task);
    let control = Control { tasks: 7, run: &run, progress: None };
    for config in methods::configs().filter(|config| config.method() == Method::Bvh) {
        let expected = Owned::build(&all.view(), &config).unwrap();
        let sizes = sizes_with(&mesh, &config, &mut [], &control).unwrap();
        let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
        let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
        let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
        let grid = Grid::build_with(mesh, &config, index, scratch, &control).unwrap();
        assert!(grid.blob() == expected.bytes());
    }
}

#[test]
fn a_refit_moves_the_vertices_of_all_parts() {
    let config = Config::new(Method::Bvh);
    for meshes in [scene(), crumbs(), vec![ball(8, 1.0), soup(200, 0.1, 3)]] {
        let moved: Vec<Mesh> = meshes
            .iter()
            .map(|mesh| mesh.map(|[x, y, z]| [x + 0.5 * y * y, y - 0.2 * z, z + 0.3 * x]))
            .collect();
        let (before, after) = (Parts::of(&meshes), Parts::of(&moved));
        let (mut before, mut after) = (before.parts(), after.parts());
        let before = TriangleMesh::join(&mut before).unwrap();
        let after = TriangleMesh::join(&mut after).unwrap();
        let all = merged(&moved);
        let built = Owned::build(&before, &config).unwrap();
        let (mut joined, mut one) = (Copy::of(built.bytes()), Copy::of(built.bytes()));
        let found = refit(joined.bytes_mut(), &after).unwrap();
        assert_eq!(refit(one.bytes_mut(), &all.view()).unwrap(), found);
        assert!(joined.bytes() == one.bytes());
        let grid = Grid::open(joined.bytes(), after).unwrap();
        prove(&grid).unwrap();
        let hits = rays(40).iter().filter(|ray| oracle::check(&grid, ray)).count();
        assert!(hits > 12 && hits < 40, "{hits}");
    }
}

#[test]
fn a_packed_grid_still_knows_the_parts() {
    for meshes in [scene(), crumbs(), vec![ball(3, 1.0)], vec![Mesh::default(); 3], Vec::new()] {
        let all = merged(&meshes);
        let stored = Parts::of(&meshes);
        let masks = stored.masks();
        let mut parts = stored.parts();
        let mesh = TriangleMesh::join(&mut parts).unwrap();
        let one = all.view().with_masks(Strided::new(&masks)).unwrap();
        for config in methods::configs() {
            let built = Owned::build(&mesh, &config).unwrap();
            let grid = built.open(&mesh).unwrap();
            let pack = |grid: &Grid<'_>| {
                let mut copy = Copy::of(&vec![0xa5; usize::try_from(grid.packed_bytes()).unwrap()]);
                grid.pack(copy.bytes_mut()).unwrap();
                copy
            };
            let packed = pack(&grid);
            let opened = Grid::open_packed(packed.bytes()).unwrap();
            prove(&opened).unwrap();
            locates(opened.mesh(), &places(&meshes));
            answers_the_same(&opened, &grid);
            assert!(pack(&opened).bytes() == packed.bytes(), "packing again changes bytes");

            // Before the table of parts the bytes are those of the one mesh, except in the header.
            if stored.parts().iter().any(|part| !part.mesh().masks().bytes.is_empty()) {
                let plain = pack(&built.open(&one).unwrap());
                let table = (4 * meshes.len()).next_multiple_of(64);
                assert_eq!(packed.bytes().len(), plain.bytes().len() + table);
                assert!(packed.bytes()[128..].starts_with(&plain.bytes()[128..]));
            }
        }
    }
}
