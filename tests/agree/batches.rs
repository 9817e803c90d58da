//! A batch answers as each of its rays alone, bit for bit, whatever coherence the caller declares and at
//! every SIMD level.

use std::ops::Range;

use hgrid_core::{
    Coherence, Config, Counters, Cull, Grid, Hit, INVALID_ID, Method, QueryOptions, Ray, SimdLevel,
    Strided, StridedMut, Verdict,
};
use hgrid_lab::camera::{Camera, Up, View};
use hgrid_tests::meshes::{Mesh, ball, room, soup};
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;
use hgrid_tests::{methods, oracle};

pub(crate) const COHERENCES: [Coherence; 2] = [Coherence::Coherent, Coherence::Incoherent];

/// Returns a ball in a soup of small and large triangles, with a crowd of tiny ones on it.
pub(crate) fn scene() -> Mesh {
    let mut mesh = ball(12, 1.0);
    mesh.append(&soup(300, 0.1, 5));
    mesh.append(&soup(6, 2.0, 7));
    mesh.append(&soup(500, 0.05, 11).scaled(0.02).map(|[x, y, z]| [x + 0.9, y, z]));
    mesh
}

/// Returns an 8 x 8 tile of camera rays.
fn tile(bounds: ([f32; 3], [f32; 3]), view: View, [left, top]: [u16; 2]) -> Vec<Ray> {
    let camera = Camera::framing(bounds, view, Up::Y);
    let ray = |i: u16| camera.ray(left + i % 8, top + i / 8, 64);
    (0..64).map(ray).collect()
}

/// Returns two adjacent 8 x 8 tiles of a large picture, whose rays all pass through a few cells.
fn close(bounds: ([f32; 3], [f32; 3]), view: View, size: u16, [left, top]: [u16; 2]) -> Vec<Ray> {
    let camera = Camera::framing(bounds, view, Up::Y);
    let ray = |i: u16| camera.ray(left + i % 8 + i / 64 * 8, top + i / 8 % 8, size);
    (0..128).map(ray).collect()
}

/// The number of rays from tiles of large pictures; `rays` returns them first.
pub(crate) const CLOSE: usize = 40 * 128;

/// The rays among them that lie in pairs of tiles of which one has other ray ends than the other.
const LIMITED: Range<usize> = 28 * 128..36 * 128;

/// Returns valid and invalid rays with special values, which every kernel for many rays must handle.
pub(crate) fn odd_rays() -> Vec<Ray> {
    let sound = Ray::new([0.1, 0.2, 3.0], [0.01, 0.02, -1.0]);
    let mut rays = vec![
        sound,
        Ray { direction: [0.0, -0.0, 0.0], ..sound },
        Ray { direction: [f32::NAN, 0.0, 1.0], ..sound },
        Ray { origin: [0.0, f32::NAN, 0.0], ..sound },
        Ray { origin: [0.0, f32::INFINITY, 0.0], ..sound },
        Ray { t_min: f32::NAN, ..sound },
        Ray { t_max: f32::NAN, ..sound },
        Ray { t_min: 5.0, t_max: 1.0, ..sound },
        Ray { t_min: 1.5, t_max: 1.5, ..sound },
        Ray { t_min: f32::NEG_INFINITY, ..sound },
        Ray { t_min: f32::INFINITY, ..sound },
        Ray { direction: sound.direction.map(|c| c * 1e-30), ..sound },
        Ray { direction: sound.direction.map(|c| c * 1e30), ..sound },
        Ray::new([0.0; 3], [1e-45, 0.0, 1.0]),
        Ray::new([1e6, 2e6, 3e6], [-1.0, -2.0, -3.0]),
        Ray::new([-1e20, 0.0, 0.0], [1.0, 0.0, 0.0]),
    ];
    for axis in 0..3 {
        for along in [1.0, -1.0] {
            let mut direction = [0.0_f32, -0.0, -0.0];
            direction[axis] = along;
            let inside = [0.25, -0.5, 0.0];
            let mut outside = inside;
            outside[axis] = -2.0 * along;
            rays.extend([Ray::new(outside, direction), Ray::new(inside, direction)]);
        }
    }
    rays
}

/// Returns rays of every kind: tiles, tiles with unrelated rays in them, random rays, and odd rays alone and mixed.
pub(crate) fn rays(bounds: ([f32; 3], [f32; 3])) -> Vec<Ray> {
    let mut random = Random(73);
    let mut rays = Vec::new();
    // Put these first, so that both tiles of a pair are traversed together. They cross the ball, its edges
    // and the crowd.
    for size in [256, 512, 1024, 2048] {
        for at in 1..8 {
            let view = if at % 2 == 0 { View::Front } else { View::ThreeQuarter };
            rays.extend(close(bounds, view, size, [at * size / 8, size / 2 - 24]));
        }
    }
    // One tile ends before the other, or the other starts where it ends.
    assert_eq!(rays.len(), LIMITED.start);
    for at in 1..9_u16 {
        let mut piece = close(bounds, View::Front, 512, [40 * at + 70, 230]);
        let (near, far) = piece.split_at_mut(64);
        let (near, far) = if at % 2 == 0 { (near, far) } else { (far, near) };
        let end = 8.0 + 0.5 * f32::from(at / 2);
        near.iter_mut().for_each(|ray| ray.t_max = end);
        far.iter_mut().filter(|_| at > 4).for_each(|ray| ray.t_min = end);
        rays.extend(piece);
    }
    assert_eq!(rays.len(), LIMITED.end);
    // Rays that start and end anywhere, and unrelated directions among them.
    for at in [700, 900, 1100, 1300] {
        let mut piece = close(bounds, View::Front, 2048, [at, 1000]);
        for ray in &mut piece {
            ray.t_min = 6.0 + random.unit() * 4.0;
            ray.t_max = ray.t_min + random.unit() * 6.0;
            if random.below(16) == 0 {
                ray.direction.rotate_left(1);
            }
        }
        rays.extend(piece);
    }
    assert_eq!(rays.len(), CLOSE);
    for view in [View::Front, View::ThreeQuarter] {
        for corner in [[0, 0], [24, 24], [32, 24], [40, 8]] {
            rays.extend(tile(bounds, view, corner));
        }
    }
    // After a tile that hits, a tile that misses and contains an invalid ray.
    rays.extend(tile(bounds, View::Front, [24, 24]));
    rays.extend(tile(bounds, View::Front, [0, 0]));
    if let Some(last) = rays.last_mut() {
        last.direction = [0.0; 3];
    }
    // One origin and all directions; one direction and many origins; ends before and behind the surface.
    rays.extend((0..64).map(|_| Ray::new([0.1, 0.2, 0.3], random.point())));
    rays.extend((0..64).map(|_| Ray::new(random.point().map(|c| 2.0 * c), [0.3, -0.5, 0.7])));
    rays.extend(
        (0..64)
            .map(|i| Ray { t_max: i as f32 * 0.1, ..Ray::new([-3.0, 0.1, 0.1], [1.0, 0.01, 0.0]) }),
    );
    // Tiles whose rays start and end anywhere, also behind the first surface or between two.
    for corner in [[24, 16], [24, 24], [32, 24]] {
        rays.extend(tile(bounds, View::Front, corner).into_iter().map(|ray| {
            let t_min = random.unit() * 6.0;
            Ray { t_min, t_max: t_min + random.unit() * 6.0, ..ray }
        }));
    }
    rays.extend((0..100).map(|_| Ray::new(random.point().map(|c| 3.0 * c), random.point())));
    rays.extend(odd_rays());
    // Unrelated rays among neighbours: other octants, other axes, invalid rays.
    let odd = odd_rays();
    for corner in [[16, 24], [24, 32], [32, 32]] {
        let mut mixed = tile(bounds, View::Front, corner);
        for slot in &mut mixed {
            match random.below(8) {
                0 => *slot = odd[random.below(odd.len())],
                1 => *slot = Ray { direction: slot.direction.map(|c| -c), ..*slot },
                2 => slot.direction.rotate_left(1),
                3 => slot.t_max = random.unit() * 4.0,
                4 => *slot = Ray::new(random.point(), random.point()),
                _ => {}
            }
        }
        rays.extend(mixed);
    }
    assert!(rays.len() >= 3500, "{}", rays.len());
    rays
}

/// Returns the bits of a hit or a miss, which tell -0.0 from 0.0.
pub(crate) fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}

pub(crate) fn alone(grid: &Grid<'_>, rays: &[Ray]) -> Vec<Hit> {
    rays.iter().map(|ray| grid.intersect(ray).unwrap_or(Hit::MISS)).collect()
}

fn levels() -> Vec<SimdLevel> {
    SimdLevel::available().collect()
}

#[test]
fn every_method_coherence_level_and_number_of_rays_agrees() {
    let mesh = scene();
    let view = mesh.view();
    let tree = Owned::build(&view, &Config::default()).unwrap();
    let tree = tree.open(&view).unwrap();
    let rays = rays(tree.bounds());
    let closest = |ray| oracle::brute_force(&tree, ray).unwrap_or(Hit::MISS);
    let expected: Vec<_> = rays.iter().map(closest).collect();
    for config in methods::configs() {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        for (ray, (hit, expected)) in rays.iter().zip(alone(&grid, &rays).iter().zip(&expected)) {
            assert_eq!(hit, expected, "{:?} {ray:?}", config.method());
        }
        let hits = expected.iter().filter(|hit| **hit != Hit::MISS).count();
        assert!(hits > 200 && hits < rays.len() - 200, "{hits} of {}", rays.len());
        // Ends that only one tile of a pair has lie among the triangles.
        let limited = LIMITED.filter(|&i| {
            let whole = Ray::new(rays[i].origin, rays[i].direction);
            grid.intersect(&whole).unwrap_or(Hit::MISS) != expected[i]
        });
        let limited = limited.count();
        let met = expected[LIMITED].iter().filter(|hit| **hit != Hit::MISS).count();
        assert!(limited > 100 && met > 200, "{limited} {met}");
        // Only trees have SIMD kernels.
        let levels = levels_of(config.method());
        for (level, coherence) in levels.into_iter().flat_map(|l| COHERENCES.map(|c| (l, c))) {
            let grid = grid.with_simd(level);
            for n in [0, 1, 7, 63, 64, 65, 128, 1000, rays.len() - 37] {
                // Start at another ray too, so that tiles are cut at other places.
                for from in [0, rays.len() - n] {
                    let what = format!("{:?} {level:?} {coherence:?} {n} {from}", config.method());
                    let rays = &rays[from..from + n];
                    let expected = &expected[from..from + n];
                    let mut hits = vec![Hit { t: 7.0, u: 7.0, v: 7.0, primitive: 7 }; n];
                    let mut occluded = vec![7_u8; n];
                    let strided = Strided::new(rays);
                    grid.intersect_n(&strided, &mut StridedMut::new(&mut hits), coherence).unwrap();
                    grid.occluded_n(&strided, &mut StridedMut::new(&mut occluded), coherence)
                        .unwrap();
                    for (i, (hit, expected)) in hits.iter().zip(expected).enumerate() {
                        assert_eq!(bits(hit), bits(expected), "{what}: ray {i} {:?}", rays[i]);
                        let is_hit = u8::from(*expected != Hit::MISS);
                        assert_eq!(occluded[i], is_hit, "{what}: ray {i} {:?}", rays[i]);
                    }
                }
            }
        }
    }
}

/// Rays whose direction is much shorter or longer than a cell is wide.
#[test]
fn rays_of_any_speed_agree_at_any_scale() {
    for scale in [1e-30_f32, 1e-20, 1e-10, 1.0, 1e10, 1e20, 1e30] {
        let mesh = scene().scaled(scale);
        let view = mesh.view();
        let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
        let grid = owned.open(&view).unwrap();
        let (mut hits, mut counts) = ([Hit::MISS; 64], Vec::new());
        for length in [1e-37_f32, 1e-30, 1e-20, 1e-10, 1.0, 1e10, 1e20, 5e29, 1e37] {
            let at_speed = |ray: &Ray| Ray { direction: ray.direction.map(|c| c * length), ..*ray };
            let straight = |i: u16| {
                let place = |i: u16| (f32::from(i) - 3.5) * 0.2 * scale;
                let origin = [place(i % 8), place(i / 8), 3.0 * scale];
                at_speed(&Ray::new(origin, [0.0, 0.0, -1.0]))
            };
            let tilted: Vec<_> =
                tile(grid.bounds(), View::Front, [24, 24]).iter().map(at_speed).collect();
            let straight: Vec<_> = (0..64).map(straight).collect();
            for rays in [tilted, straight] {
                let answers = &mut StridedMut::new(&mut hits);
                grid.intersect_n(&Strided::new(&rays), answers, Coherence::Coherent).unwrap();
                assert_eq!(hits.as_slice(), alone(&grid, &rays), "{scale:e} {length:e}");
                let (rays, mut occluded) = (Strided::new(&rays), [0_u8; 64]);
                for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                    let answers = &mut StridedMut::new(&mut occluded);
                    grid.occluded_n(&rays, answers, coherence).unwrap();
                    let expected = hits.map(|hit| u8::from(hit != Hit::MISS));
                    assert_eq!(occluded, expected, "{scale:e} {length:e} {coherence:?}");
                }
                counts.push(hits.iter().filter(|hit| **hit != Hit::MISS).count());
            }
        }
        let most = counts.iter().filter(|&&count| count > 10).count();
        assert!(most >= counts.len() / 3, "{scale:e}: {counts:?}");
    }
}

/// Tiles through a scene that is flat on one axis, or nearly.
#[test]
fn tiles_through_a_flat_scene_agree() {
    for (axis, thick) in [(0, 0.0), (1, 0.0), (2, 0.0), (2, 1e-3)] {
        let mut mesh = soup(2000, 0.05, 3);
        mesh.append(&soup(2000, 0.05, 5).scaled(2e-3));
        let mesh = mesh.map(|mut p| {
            p[axis] *= thick;
            p
        });
        let view = mesh.view();
        let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
        let grid = owned.open(&view).unwrap();
        let (mut hits, mut count) = ([Hit::MISS; 64], 0);
        for (i, target) in mesh.positions.iter().step_by(97).enumerate() {
            let along = [1.0, -1.0][i % 2];
            let mut direction = [0.0; 3];
            direction[axis] = along;
            direction[(axis + 1) % 3] = [0.0, 0.7, -1.9, 1.99][i / 2 % 4];
            let ray = |i: u16| {
                let mut origin = *target;
                origin[(axis + 1) % 3] += f32::from(i % 8) * 3e-4;
                origin[(axis + 2) % 3] += f32::from(i / 8) * 3e-4;
                Ray::new(std::array::from_fn(|k| origin[k] - 2.25 * direction[k]), direction)
            };
            let rays: Vec<_> = (0..64).map(ray).collect();
            let answers = &mut StridedMut::new(&mut hits);
            grid.intersect_n(&Strided::new(&rays), answers, Coherence::Coherent).unwrap();
            assert_eq!(hits.as_slice(), alone(&grid, &rays), "axis {axis}: {direction:?}");
            oracle::check(&grid, &rays[0]);
            count += hits.iter().filter(|hit| **hit != Hit::MISS).count();
        }
        assert!(count > 1000, "{count} hits");
    }
}

/// Returns a group of rays that end at their hits, or soon behind them. `place` moves and scales points.
fn short_rays(
    grid: &Grid<'_>,
    random: &mut Random,
    round: usize,
    place: impl Fn([f32; 3]) -> [f32; 3],
) -> [Ray; 64] {
    let middle = random.point().map(|c| c * 0.6);
    let odd = odd_rays()[round / 4 % odd_rays().len()];
    std::array::from_fn(|i| {
        let (beside, mut direction) = (random.point(), random.point());
        let mut origin: [f32; 3] = std::array::from_fn(|k| middle[k] + beside[k] * 1e-3);
        match round % 4 {
            // From many places.
            1 => origin = beside.map(|c| c * 0.8),
            // From both sides of a wall, all along its normal.
            2 => {
                origin = std::array::from_fn(|k| [-1.1, 0.0, 0.0][k] + beside[k] * 0.4);
                direction[0] = direction[0].abs();
            }
            _ => {}
        }
        let ray = Ray::new(place(origin), direction);
        let hit = grid.intersect(&ray);
        let unit = place([1.0; 3])[0] - place([0.0; 3])[0];
        // A `t` that was rounded down ends a ray before its hit.
        let end = |hit: Hit| [hit.t.next_up(), hit.t * 1.2][i % 2];
        let t_max = hit.map_or(0.5 * unit, end);
        match (round % 4, i) {
            // One ray reaches its hit; the others are shorter, and some are odd.
            (3, 24..32) => Ray { t_max, ..odd },
            (3, 1..) => Ray { t_max: 0.05 * unit, ..ray },
            _ => Ray { t_max, ..ray },
        }
    })
}

/// Groups of short rays in all directions. Most hits are on flat walls, beyond which no ray of a group reaches.
#[test]
fn short_rays_in_all_directions_agree() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for (scale, shift) in [(1.0, 0.0), (1.0, 1e4), (1e-37, 0.0), (1e-20, 0.0), (1e12, 0.0)] {
        let place = |p: [f32; 3]| p.map(|c| (c + shift) * scale);
        let mesh = room().map(place);
        let view = mesh.view();
        let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
        let grid = owned.open(&view).unwrap();
        let mut count = 0;
        for round in 0..160 {
            let rays = short_rays(&grid, &mut random, round, place);
            let expected = alone(&grid, &rays);
            for level in levels() {
                let grid = grid.with_simd(level);
                let (mut hits, mut blocked) = ([Hit::MISS; 64], [7_u8; 64]);
                let (given, answers) = (Strided::new(&rays), &mut StridedMut::new(&mut hits));
                grid.intersect_n(&given, answers, Coherence::Coherent).unwrap();
                assert_eq!(hits.as_slice(), expected, "{scale:e} {shift} {level:?}");
                let answers = &mut StridedMut::new(&mut blocked);
                grid.occluded_n(&given, answers, Coherence::Coherent).unwrap();
                let is_hit = |hit: &Hit| u8::from(*hit != Hit::MISS);
                assert!(hits.iter().map(is_hit).eq(blocked), "{scale:e} {shift} {level:?}");
            }
            count += expected.iter().filter(|hit| **hit != Hit::MISS).count();
        }
        assert!(count > 2000, "{scale:e} {shift}: {count} hits");
    }
}

/// Single rays, too, give the same bits at every SIMD level.
#[test]
fn single_rays_agree_at_every_level() {
    let mesh = scene();
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
    let grid = owned.open(&view).unwrap();
    let rays = rays(grid.bounds());
    let sample: Vec<_> = rays.iter().step_by(9).collect();
    for level in levels() {
        let grid = grid.with_simd(level);
        let hits = sample.iter().filter(|ray| oracle::check(&grid, ray)).count();
        assert!(hits > 150 && hits < sample.len() - 150, "{hits} of {}", sample.len());
    }
}

/// Returns the SIMD levels that make a difference for a method.
pub(crate) fn levels_of(method: Method) -> Vec<SimdLevel> {
    if method == Method::Bvh { levels() } else { vec![SimdLevel::detect()] }
}

/// Returns a mask for each triangle: one of three bits, in turn.
fn masks(mesh: &Mesh) -> Vec<u32> {
    (0..mesh.view().triangle_count()).map(|id| 1 << (id % 3)).collect()
}

#[test]
fn masks_culling_and_a_triangle_to_skip_agree() {
    let mesh = scene();
    let masks = masks(&mesh);
    let view = mesh.view().with_masks(Strided::new(&masks)).unwrap();
    for config in methods::configs() {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        // Tiles, unrelated rays and odd rays.
        let rays = &rays(grid.bounds())[CLOSE - 256..];
        let hit = alone(&grid, rays).into_iter().find(|hit| *hit != Hit::MISS);
        let skip = hit.expect("some hit").primitive;
        let mut different = 0;
        for (mask, cull, skip) in [
            (u32::MAX, Cull::None, skip),
            (u32::MAX, Cull::Back, INVALID_ID),
            (u32::MAX, Cull::Front, skip),
            (5, Cull::None, INVALID_ID),
            (2, Cull::Back, skip),
            (8, Cull::None, INVALID_ID),
            (0, Cull::Front, INVALID_ID),
        ] {
            let options = || QueryOptions { mask, cull, skip, ..QueryOptions::default() };
            let expected: Vec<_> = rays
                .iter()
                .map(|ray| grid.intersect_with(ray, &mut options()).unwrap_or(Hit::MISS))
                .collect();
            different += usize::from(expected != alone(&grid, rays));
            for (level, coherence) in
                levels_of(config.method()).into_iter().flat_map(|l| COHERENCES.map(|c| (l, c)))
            {
                let grid = grid.with_simd(level);
                let what = format!("{:?} {level:?} {coherence:?} {mask} {cull:?}", config.method());
                let strided = Strided::new(rays);
                let mut hits = vec![Hit { primitive: 7, ..Hit::MISS }; rays.len()];
                let answers = &mut StridedMut::new(&mut hits);
                grid.intersect_n_with(&strided, answers, coherence, &mut options()).unwrap();
                let mut occluded = vec![7_u8; rays.len()];
                let answers = &mut StridedMut::new(&mut occluded);
                grid.occluded_n_with(&strided, answers, coherence, &mut options()).unwrap();
                for (i, expected) in expected.iter().enumerate() {
                    assert_eq!(bits(&hits[i]), bits(expected), "{what}: ray {i} {:?}", rays[i]);
                    let is_hit = u8::from(*expected != Hit::MISS);
                    assert_eq!(occluded[i], is_hit, "{what}: ray {i} {:?}", rays[i]);
                }
            }
        }
        assert_eq!(different, 7, "{:?}: every option changes something", config.method());
    }
}

/// Returns rays that start near a few points in turn and go anywhere; with more than two points, some odd rays too.
pub(crate) fn scattered(count: usize, points: usize) -> Vec<Ray> {
    let mut random = Random(91);
    let points: Vec<_> = (0..points).map(|_| random.point()).collect();
    let odd = odd_rays();
    let ray = |i: usize| {
        if points.len() > 2 && i % 50 == 49 {
            return odd[i / 50 % odd.len()];
        }
        let near = random.point();
        let at = points[i % points.len()];
        Ray::new(std::array::from_fn(|k| at[k] + 0.03 * near[k]), random.point())
    };
    (0..count).map(ray).collect()
}

/// Incoherent rays are sorted in scratch of any size and address, and no byte beside it is written.
#[test]
fn rays_in_any_order_agree_with_any_scratch() {
    let mesh = scene();
    let view = mesh.view();
    for config in [Config::new(Method::Bvh), Config::new(Method::OneLevel)] {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        // For a few points the windows on the stack are enough, for many they are not. The third set has rays
        // of all kinds.
        for rays in [scattered(3000, 2), scattered(9000, 40), rays(grid.bounds())] {
            let expected = alone(&grid, &rays);
            let all = 16 * rays.len();
            for level in levels() {
                let grid = grid.with_simd(level);
                for bytes in [0, 1, 8191, 8192, 8200, 16 * 1000, 16 * 2049 + 5, all, all + 100] {
                    for from in [0, 3] {
                        let mut memory = vec![0xa5_u8; from + bytes + 9];
                        let scratch = &mut memory[from..from + bytes];
                        let mut options = QueryOptions { scratch, ..QueryOptions::default() };
                        let strided = Strided::new(&rays);
                        let mut hits = vec![Hit { primitive: 7, ..Hit::MISS }; rays.len()];
                        let answers = &mut StridedMut::new(&mut hits);
                        grid.intersect_n_with(
                            &strided,
                            answers,
                            Coherence::Incoherent,
                            &mut options,
                        )
                        .unwrap();
                        assert_eq!(options.scratch.len(), bytes, "the scratch is returned whole");
                        let mut occluded = vec![7_u8; rays.len()];
                        let answers = &mut StridedMut::new(&mut occluded);
                        grid.occluded_n_with(
                            &strided,
                            answers,
                            Coherence::Incoherent,
                            &mut options,
                        )
                        .unwrap();
                        for (i, expected) in expected.iter().enumerate() {
                            let is_right = bits(&hits[i]) == bits(expected)
                                && occluded[i] == u8::from(*expected != Hit::MISS);
                            let (ray, hit, blocked) = (rays[i], hits[i], occluded[i]);
                            assert!(
                                is_right,
                                "{level:?} {bytes} {from}: ray {i} {ray:?}: {hit:?} and {blocked}, not {expected:?}"
                            );
                        }
                        let (before, rest) = memory.split_at(from);
                        let around = before.iter().chain(&rest[bytes..]);
                        assert!(around.copied().all(|byte| byte == 0xa5));
                    }
                }
            }
        }
    }
}

/// Filters see the index of each ray, and rays in order; counters add up to those of single rays.
#[test]
fn filters_and_counters_are_those_of_single_rays() {
    let mesh = scene();
    let view = mesh.view();
    for config in methods::configs() {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        let rays = &rays(grid.bounds())[CLOSE..][..300];
        for coherence in COHERENCES {
            let (mut shown, mut expected_shown) = (Vec::new(), Vec::new());
            let (mut work, mut expected_work) = (Counters::default(), Counters::default());
            let mut expected = Vec::new();
            let verdict = |hit: &Hit| {
                if hit.primitive.is_multiple_of(3) { Verdict::Accept } else { Verdict::Reject }
            };
            for (place, ray) in rays.iter().enumerate() {
                let mut filter = |at: usize, hit: &Hit| {
                    assert_eq!(at, 0);
                    expected_shown.push((place, *hit));
                    verdict(hit)
                };
                let options = QueryOptions::counting(&mut expected_work);
                let mut options = QueryOptions { filter: Some(&mut filter), ..options };
                expected.push(grid.intersect_with(ray, &mut options).unwrap_or(Hit::MISS));
            }
            let mut filter = |place: usize, hit: &Hit| {
                shown.push((place, *hit));
                verdict(hit)
            };
            let mut scratch = vec![0; 16 * rays.len()];
            let options = QueryOptions::counting(&mut work);
            let mut options =
                QueryOptions { filter: Some(&mut filter), scratch: &mut scratch, ..options };
            let mut hits = vec![Hit::MISS; rays.len()];
            let answers = &mut StridedMut::new(&mut hits);
            grid.intersect_n_with(&Strided::new(rays), answers, coherence, &mut options).unwrap();
            assert!(hits == expected && shown == expected_shown, "{:?}", config.method());
            assert_eq!(work, expected_work);

            // With counters, each ray is traced alone. Without them, a tree takes the rays in groups.
            shown.clear();
            let mut filter = |place: usize, hit: &Hit| {
                shown.push((place, *hit));
                verdict(hit)
            };
            let mut options = QueryOptions {
                filter: Some(&mut filter),
                scratch: &mut scratch,
                ..QueryOptions::default()
            };
            hits.fill(Hit::MISS);
            let answers = &mut StridedMut::new(&mut hits);
            grid.intersect_n_with(&Strided::new(rays), answers, coherence, &mut options).unwrap();
            assert!(hits == expected && shown == expected_shown, "{:?}", config.method());

            // Without a filter.
            let (mut work, mut expected_work) = (Counters::default(), Counters::default());
            let expected = rays.iter().map(|ray| {
                grid.occluded_with(ray, &mut QueryOptions::counting(&mut expected_work))
            });
            let expected: Vec<_> = expected.map(u8::from).collect();
            let mut occluded = vec![7_u8; rays.len()];
            let answers = &mut StridedMut::new(&mut occluded);
            let options = &mut QueryOptions::counting(&mut work);
            grid.occluded_n_with(&Strided::new(rays), answers, coherence, options).unwrap();
            assert_eq!((occluded, work), (expected, expected_work), "{:?}", config.method());
        }
    }
}
