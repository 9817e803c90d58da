//! The arrays of a batch: answers do not depend on where rays and answers lie in memory, and no byte beside
//! the answers is written.

use hgrid_core::{BatchField, Coherence, Config, Error, Hit, Method, Ray, Strided, StridedMut};
use hgrid_tests::meshes::ball;
use hgrid_tests::methods;
use hgrid_tests::owned::Owned;

use crate::batches::{CLOSE, COHERENCES, alone, bits, rays, scene};

/// Returns elements as bytes, one every `stride` bytes, with junk between them and nothing after the last.
fn scatter<const N: usize>(elements: impl Iterator<Item = [u8; N]>, stride: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (i, element) in elements.enumerate() {
        bytes.resize(i * stride, 0xa5);
        bytes.extend(element);
    }
    bytes
}

fn ray_bytes(ray: &Ray) -> [u8; 32] {
    let Ray { origin: [a, b, c], t_min, direction: [d, e, f], t_max } = *ray;
    let words = [a, b, c, t_min, d, e, f, t_max].map(f32::to_ne_bytes);
    words.concat().try_into().expect("eight words")
}

fn hit_bytes(hit: &Hit) -> [u8; 16] {
    bits(hit).map(u32::to_ne_bytes).concat().try_into().expect("four words")
}

#[test]
fn elements_may_lie_anywhere_and_what_is_between_them_stays() {
    let mesh = scene();
    let view = mesh.view();
    for config in methods::configs() {
        let owned = Owned::build(&view, &config).unwrap();
        let grid = owned.open(&view).unwrap();
        let rays = &rays(grid.bounds())[CLOSE - 128..][..840];
        let expected = alone(&grid, rays);
        let misses = expected.iter().filter(|hit| **hit == Hit::MISS).count();
        assert!(misses > 200 && misses < 640, "{misses}");
        for (ray_stride, hit_stride, byte_stride) in [(32, 17, 2), (33, 16, 1), (48, 64, 100)] {
            let bytes = scatter(rays.iter().map(ray_bytes), ray_stride);
            let strided = Strided { bytes: &bytes, stride: ray_stride, count: rays.len() };
            for coherence in COHERENCES {
                let last = rays.len() - 1;
                let mut hits = vec![0xa5_u8; last * hit_stride + 16];
                let mut answers =
                    StridedMut { bytes: &mut hits, stride: hit_stride, count: rays.len() };
                grid.intersect_n(&strided, &mut answers, coherence).unwrap();
                let expected_hits = scatter(expected.iter().map(hit_bytes), hit_stride);
                assert!(hits == expected_hits, "{:?} {coherence:?} {hit_stride}", config.method());

                let mut occluded = vec![0xa5_u8; last * byte_stride + 1];
                let mut answers =
                    StridedMut { bytes: &mut occluded, stride: byte_stride, count: rays.len() };
                grid.occluded_n(&strided, &mut answers, coherence).unwrap();
                let is_hit = expected.iter().map(|hit| [u8::from(*hit != Hit::MISS)]);
                assert!(
                    occluded == scatter(is_hit, byte_stride),
                    "{:?} {coherence:?}",
                    config.method()
                );
            }
        }
    }
}

#[test]
fn arrays_that_cannot_be_are_refused_and_nothing_is_written() {
    let mesh = ball(3, 1.0);
    let view = mesh.view();
    let owned = Owned::build(&view, &Config::new(Method::Bvh)).unwrap();
    let grid = owned.open(&view).unwrap();
    let sound = Ray::new([0.1, 0.2, 3.0], [0.0, 0.0, -1.0]);
    let bytes = scatter([sound; 3].iter().map(ray_bytes), 32);
    let (no_rays, no_answers) =
        (Err(Error::InvalidBatch(BatchField::Rays)), Err(Error::InvalidBatch(BatchField::Answers)));
    // Bytes, stride and count of the rays, then of the hits.
    for (rays, hits, expected) in [
        ((96, 32, 3), (48, 16, 3), Ok(())),
        ((0, 0, 0), (0, 0, 0), Ok(())),
        ((96, 0, 0), (48, 0, 0), Ok(())),
        ((32, 0, 1), (16, 16, 1), no_rays),
        ((96, 31, 3), (48, 16, 3), no_rays),
        ((95, 32, 3), (48, 16, 3), no_rays),
        ((96, 33, 3), (48, 16, 3), no_rays),
        ((96, usize::MAX, 3), (48, 16, 3), no_rays),
        ((96, 32, usize::MAX), (48, 16, usize::MAX), no_rays),
        ((96, 32, 3), (48, 15, 3), no_answers),
        ((96, 32, 3), (47, 16, 3), no_answers),
        ((96, 32, 3), (48, 17, 3), no_answers),
        ((96, 32, 3), (48, usize::MAX, 3), no_answers),
        ((96, 32, 3), (48, 16, 2), no_answers),
        ((64, 32, 2), (48, 16, 3), no_answers),
        ((96, 32, 3), (48, 16, 0), no_answers),
    ] {
        for coherence in COHERENCES {
            let mut answers = [0xa5_u8; 48];
            let (length, stride, count) = rays;
            let rays = Strided { bytes: &bytes[..length], stride, count };
            let (length, stride, count) = hits;
            let mut strided = StridedMut { bytes: &mut answers[..length], stride, count };
            assert_eq!(grid.intersect_n(&rays, &mut strided, coherence), expected, "{hits:?}");
            let is_untouched = answers.iter().all(|&byte| byte == 0xa5);
            assert_eq!(is_untouched, expected.is_err() || count == 0);
        }
    }
    let rays = Strided { bytes: &bytes, stride: 32, count: 3 };
    for (length, stride, count) in [(3, 0, 3), (2, 1, 3), (3, 2, 3), (3, 1, 2)] {
        let mut answers = [7_u8; 3];
        let mut strided = StridedMut { bytes: &mut answers[..length], stride, count };
        let result = grid.occluded_n(&rays, &mut strided, Coherence::Coherent);
        assert_eq!((result, answers), (no_answers, [7; 3]));
    }
}
