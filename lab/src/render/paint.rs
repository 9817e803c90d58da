//! A picture from samples: every pixel is the mean of several rays, on all threads.
//!
//! Each thread paints one band of tiles at a time. A sample shifts all rays of a tile by the same part of a
//! pixel. The samples of a pixel are spread over it:
//!
//! ```text
//! +---------+
//! |     1   |     Places by the R2 sequence (Roberts 2018): any number of samples is
//! |  3      |     spread well, without a grid that edges could line up with.
//! |       2 |
//! +---------+
//! ```

use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::Mutex;

use hgrid_core::{INVALID_ID, Ray, SceneHit};

use crate::light::Sample;
use crate::progress::Progress;
use crate::shade::Rgb;
use crate::threads::Threads;
use crate::tiles::{TILE_RAYS, Tiles};
use crate::world::World;

/// The rays of a tile with their hits, and the number of their sample.
pub(super) struct Seen<'a> {
    pub(super) rays: &'a [Ray],
    pub(super) hits: &'a [SceneHit],
    /// The rays through the middle of the pixels.
    pub(super) middles: &'a [Ray],
    pub(super) sample: Sample,
}

/// Counts of a picture's rays.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// Rays from the eye and from their hits.
    pub(super) rays: AtomicU64,
    /// Rays from the eye that hit something.
    pub(super) hits: AtomicU64,
}

/// Paints a picture. The function `shade` writes the light of each ray, before a screen's square root, and
/// returns the number of rays that it has traced.
#[expect(clippy::cast_possible_truncation, reason = "fewer bands than pixels of a side")]
pub(super) fn paint(
    world: World<'_>,
    tiles: &Tiles,
    samples: u16,
    threads: &Threads,
    shade: impl Fn(&Seen<'_>, &mut [[f32; 3]]) -> u64 + Sync,
) -> (Vec<Rgb>, Tally) {
    let mut pixels = vec![[0; 3]; tiles.pixels()];
    let tally = Tally::default();
    let progress = Mutex::new(Progress::new("rendering", tiles.size.into()));
    let bands: Vec<_> = tiles.bands(&mut pixels).map(Mutex::new).collect();
    threads.each(bands.len() as u32, |at| {
        let Some(Ok(mut band)) = bands.get(at as usize).map(|band| band.lock()) else { return };
        band.fill(|middles, colors| tile(world, tiles, samples, middles, colors, &shade, &tally));
        if let Ok(mut progress) = progress.lock() {
            progress.advance(band.height().into());
        }
    });
    drop(bands);
    (pixels, tally)
}

/// Paints the pixels of a tile.
fn tile(
    world: World<'_>,
    tiles: &Tiles,
    samples: u16,
    middles: &[Ray],
    colors: &mut [Rgb],
    shade: impl Fn(&Seen<'_>, &mut [[f32; 3]]) -> u64,
    tally: &Tally,
) {
    let mut hits = [SceneHit::MISS; TILE_RAYS];
    let hits = &mut hits[..middles.len()];
    let mut light = [[0.0; 3]; TILE_RAYS];
    let light = &mut light[..middles.len()];
    let mut sums = [[0.0; 3]; TILE_RAYS];
    let (mut traced, mut struck) = (0, 0);
    for number in 0..samples {
        let shift = tiles.camera.shift(place(number, samples), tiles.size);
        let rays: Vec<_> = middles
            .iter()
            .map(|ray| {
                Ray::new(ray.origin, [0, 1, 2].map(|axis| ray.direction[axis] + shift[axis]))
            })
            .collect();
        world.intersect(&rays, hits);
        let sample = Sample { number, count: samples };
        traced += rays.len() as u64 + shade(&Seen { rays: &rays, hits, middles, sample }, light);
        struck += hits.iter().filter(|hit| hit.primitive != INVALID_ID).count() as u64;
        for (sum, light) in sums.iter_mut().zip(&*light) {
            *sum = [0, 1, 2].map(|c| sum[c] + light[c]);
        }
    }
    for (color, sum) in colors.iter_mut().zip(sums) {
        *color = sum.map(|c| display(c / f32::from(samples)));
    }
    tally.rays.fetch_add(traced, Ordering::Relaxed);
    tally.hits.fetch_add(struck, Ordering::Relaxed);
}

/// Returns the place of a sample, in pixels from the middle.
fn place(number: u16, samples: u16) -> [f32; 2] {
    if samples == 1 {
        return [0.0; 2];
    }
    [0.754_877_7, 0.569_840_3].map(|step| (0.5 + step * f32::from(number)).fract() - 0.5)
}

/// Converts linear light to a screen's value; a square root is close to a screen's curve.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 255")]
fn display(light: f32) -> u8 {
    (light.clamp(0.0, 1.0).sqrt() * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_spread_over_the_pixel() {
        assert_eq!(place(0, 1).map(f32::to_bits), [0; 2]);
        for count in [4, 16, 64] {
            let mut sum = [0.0; 2];
            for place in (0..count).map(|number| place(number, count)) {
                assert!(place.iter().all(|c| (-0.5..0.5).contains(c)));
                sum = [0, 1].map(|axis| sum[axis] + place[axis]);
            }
            let most = 0.2 * f32::from(count);
            assert!(sum.iter().all(|c| c.abs() < most), "{sum:?} of {count}");
        }
    }

    #[test]
    fn light_is_shown_from_black_to_white() {
        assert_eq!([-1.0, 0.0, 0.25, 1.0, 9.0].map(display), [0, 0, 128, 255, 255]);
    }
}
