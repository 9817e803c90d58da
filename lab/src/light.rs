//! Occlusion of light: shadows of the lamp, and ambient occlusion.
//!
//! ```text
//! spots of a tile -> rays toward the lamp                    -> one call for any hit -> lit
//!                 -> some rays of each toward sky and ground -> one call for any hit -> open
//! ```
//!
//! The rays of a call are in the order of the tile's pixels, those of a pixel side by side. So successive
//! rays start near each other, and a tree can trace them in groups whatever their directions.

use hgrid_core::Ray;

use crate::tiles::TILE_RAYS;
use crate::vector::{Vector, cross, dot, offset, round, unit};
use crate::world::World;

/// The kinds of occlusion in a picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Lights {
    /// The lamp casts shadows.
    pub has_shadows: bool,
    /// Rays from each sample toward sky and ground; 0 for no ambient occlusion.
    pub sky_rays: u16,
}

/// A point of a surface that a pixel shows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    /// The pixel's number in its tile.
    pub(crate) at: usize,
    /// The unit normal on the viewer's side.
    pub(crate) normal: [f32; 3],
    /// The origin of rays that leave the surface on that side.
    pub(crate) start: [f32; 3],
    /// Two numbers from 0 to 1 that differ from pixel to pixel.
    pub(crate) noise: [f64; 2],
}

/// The direction of the lamp, and the distance within which surfaces hide the sky.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Around {
    /// The direction toward the lamp.
    pub(crate) lamp: [f32; 3],
    /// The length of rays toward the sky.
    pub(crate) reach: f32,
}

/// One of the samples of a pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) number: u16,
    pub(crate) count: u16,
}

/// The light that reaches the spots of a tile, from 0 to 1.
#[derive(Debug)]
pub(crate) struct Reached {
    /// The light of the lamp.
    pub(crate) lit: [f32; TILE_RAYS],
    /// The light of sky and ground.
    pub(crate) open: [f32; TILE_RAYS],
    /// The number of rays that this took.
    pub(crate) rays: u64,
}

impl Lights {
    /// Returns true if there is no occlusion.
    #[must_use]
    pub const fn are_everywhere(&self) -> bool {
        !self.has_shadows && self.sky_rays == 0
    }

    /// Computes the light that reaches the spots of a tile.
    pub(crate) fn reach(
        self,
        world: World<'_>,
        around: &Around,
        sample: Sample,
        spots: &[Spot],
    ) -> Reached {
        let mut reached = Reached { lit: [1.0; TILE_RAYS], open: [1.0; TILE_RAYS], rays: 0 };
        if self.has_shadows {
            let lamp = wide(around.lamp);
            let is_lit = |spot: &&Spot| dot(wide(spot.normal), lamp) > 0.0;
            let probes = spots.iter().filter(is_lit);
            let probes = probes.map(|spot| (spot.at, Ray::new(spot.start, around.lamp)));
            reached.rays += send(world, probes, |at| reached.lit[at] = 0.0);
        }
        if self.sky_rays > 0 {
            let t_max = around.reach;
            // The samples of a pixel share one set of directions and take turns in it.
            let all = u32::from(self.sky_rays) * u32::from(sample.count);
            let numbers = (u32::from(sample.number)..all).step_by(sample.count.into());
            let probes = spots.iter().flat_map(|spot| {
                numbers.clone().map(move |number| {
                    let toward = scatter(wide(spot.normal), spot.noise, number, all);
                    (spot.at, Ray { t_max, ..Ray::new(spot.start, round(toward)) })
                })
            });
            let part = 1.0 / f32::from(self.sky_rays);
            reached.rays += send(world, probes, |at| reached.open[at] -= part);
        }
        reached
    }
}

/// Traces all rays with one call, calls `hidden` with the pixel of each occluded ray, and counts the rays.
fn send(
    world: World<'_>,
    probes: impl Iterator<Item = (usize, Ray)>,
    mut hidden: impl FnMut(usize),
) -> u64 {
    let (pixels, rays): (Vec<_>, Vec<_>) = probes.unzip();
    let mut occluded = vec![0_u8; rays.len()];
    world.occluded_all(&rays, &mut occluded);
    for (at, _) in pixels.into_iter().zip(occluded).filter(|(_, occluded)| *occluded != 0) {
        hidden(at);
    }
    rays.len() as u64
}

/// Returns two numbers from 0 to 1 for a pixel, unlike those of the pixels around it. Interleaved gradient
/// noise (Jimenez 2014): the numbers of any 3 x 3 pixels are spread over the whole range, so that the noise
/// averages out over a few pixels.
pub(crate) fn noise([column, row]: [f32; 2]) -> [f64; 2] {
    let of =
        |x: f64, y: f64| (52.982_918_9 * (0.067_110_56 * x + 0.005_837_15 * y).fract()).fract();
    let [x, y] = [column, row].map(|c| f64::from(c.round().max(0.0)));
    [of(x, y), of(y + 47.0, x + 17.0)]
}

fn wide(vector: [f32; 3]) -> Vector {
    vector.map(f64::from)
}

/// Returns one of the directions from a surface to the sky above it. Points on a disk, lifted to the
/// hemisphere above it, have a cosine distribution. On the disk they lie like the seeds of a sunflower,
/// rotated by a different angle for each pixel.
fn scatter(normal: Vector, [turn, part]: [f64; 2], number: u32, count: u32) -> Vector {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let area = (f64::from(number) + part) / f64::from(count);
    let angle = core::f64::consts::TAU * (f64::from(number) * GOLDEN + turn);
    let helper = if normal[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let first = unit(cross(helper, normal)).unwrap_or(helper);
    let (radius, height) = (area.sqrt(), (1.0 - area).sqrt());
    let lifted = offset(normal.map(|c| c * height), radius * angle.cos(), first);
    offset(lifted, radius * angle.sin(), cross(normal, first))
}

#[cfg(test)]
mod tests {
    use hgrid_core::{Config, Grid, Hit, Method, TriangleMesh};

    use super::*;
    use crate::regions::Regions;
    use crate::vector::length;

    /// A floor, and a roof over one half of it; rays straight down at both halves and beside them.
    #[test]
    fn a_roof_hides_lamp_and_sky() {
        let square = |left: f32, z: f32| {
            [[left, -4.0, z], [left + 4.0, -4.0, z], [left + 4.0, 4.0, z], [left, 4.0, z]]
        };
        let positions = [square(-4.0, 0.0), square(0.0, 0.0), square(0.0, 0.5)].concat();
        let indices = [0, 4, 8].map(|at| [[at, at + 1, at + 2], [at, at + 2, at + 3]]).concat();
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let lights = Lights { has_shadows: true, sky_rays: 64 };
        for method in [Method::Bvh, Method::OneLevel] {
            let regions = Regions::build(mesh, &Config::new(method)).unwrap();
            let grid = Grid::open(&regions.index, mesh).unwrap();
            let rays = [-2.0, 2.0, 9.0].map(|x| Ray::new([x, 0.0, 0.3], [0.0, 0.0, -1.0]));
            let hits = rays.map(|ray| grid.intersect(&ray).unwrap_or(Hit::MISS));
            let spots: Vec<_> = (0..)
                .zip(rays.iter().zip(&hits))
                .filter_map(|(at, (ray, hit))| {
                    let surface = mesh.surface(ray, hit)?;
                    let (normal, start) = (surface.normal, surface.above);
                    Some(Spot { at, normal, start, noise: [0.3, 0.6] })
                })
                .collect();
            let around = Around { lamp: [0.0, 0.0, 1.0], reach: 3.0 };
            let reached =
                lights.reach(World::Mesh(&grid), &around, Sample { number: 1, count: 2 }, &spots);
            assert_eq!((spots.len(), reached.rays), (2, 2 * (1 + 64)));
            assert_eq!(reached.lit[..3], [1.0, 0.0, 1.0]);
            assert!(reached.open[0] > 0.9 && reached.open[1] < 0.1, "{:?}", &reached.open[..3]);
            assert_eq!(reached.open[2].to_bits(), 1.0_f32.to_bits());
        }
    }

    #[test]
    fn directions_lie_above_the_surface() {
        for normal in [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.6, 0.0, -0.8]] {
            let mean = (0..100).map(|i| scatter(normal, [0.2, 0.5], i, 100)).fold(
                [0.0; 3],
                |sum, toward| {
                    assert!(dot(toward, normal) > 0.0 && (length(toward) - 1.0).abs() < 1e-9);
                    offset(sum, 0.01, toward)
                },
            );
            assert!((dot(mean, normal) - 2.0 / 3.0).abs() < 0.01, "{mean:?}");
        }
    }
}
