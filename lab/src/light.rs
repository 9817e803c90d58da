//! What is in the way of light: shadows of the lamp, and ambient occlusion.
//!
//! ```text
//! tile of hits -> rays toward the lamp                     -> one call of occluded_n -> lit
//!              -> some rays of each hit toward sky, ground -> one call of occluded_n -> open
//! ```
//!
//! The rays of a call are in the order of the tile's pixels, those of a pixel side by side: rays that
//! follow one another start near each other, so that a tree takes them in groups, wherever they go.

use hgrid_core::{Coherence, Grid, Hit, INVALID_ID, Ray, Strided, StridedMut, Surface};

use crate::tiles::TILE_RAYS;
use crate::vector::{Vector, cross, dot, length, offset, round, unit};

/// How far away something may hide the sky, in parts of the scene's radius.
const SKY_REACH: f64 = 0.5;

/// The lights that something may be in the way of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Lights {
    /// The lamp casts shadows.
    pub has_shadows: bool,
    /// Rays from each hit that look for sky and ground; without any, all of these is seen.
    pub sky_rays: u16,
}

/// How much light reaches the hits of a tile, from 0 to 1.
#[derive(Debug)]
pub(crate) struct Reached {
    /// The lamp's.
    pub(crate) lit: [f32; TILE_RAYS],
    /// That of sky and ground.
    pub(crate) open: [f32; TILE_RAYS],
}

impl Lights {
    /// Returns true if nothing is in the way anywhere.
    #[must_use]
    pub const fn are_everywhere(&self) -> bool {
        !self.has_shadows && self.sky_rays == 0
    }

    /// Asks what reaches the hits of a tile's rays; `lamp` is the direction toward the lamp.
    pub(crate) fn reach(
        self,
        grid: &Grid<'_>,
        lamp: [f32; 3],
        rays: &[Ray],
        hits: &[Hit],
    ) -> Reached {
        let mut reached = Reached { lit: [1.0; TILE_RAYS], open: [1.0; TILE_RAYS] };
        let surfaces = rays.iter().zip(hits).enumerate().filter_map(|(at, (ray, hit))| {
            let surface = (hit.primitive != INVALID_ID).then(|| grid.mesh().surface(ray, hit));
            Some((at, seed(ray), surface??))
        });
        let surfaces: Vec<(usize, u32, Surface)> = surfaces.collect();
        if self.has_shadows {
            let is_lit = |surface: &Surface| dot(wide(surface.normal), wide(lamp)) > 0.0;
            let probes = surfaces.iter().filter(|(_, _, surface)| is_lit(surface));
            let probes = probes.map(|&(at, _, surface)| (at, Ray::new(surface.above, lamp)));
            send(grid, probes, |at| reached.lit[at] = 0.0);
        }
        if self.sky_rays > 0 {
            let (min, max) = grid.bounds();
            let [t_max, ..] =
                round([SKY_REACH * 0.5 * length(offset(wide(max), -1.0, wide(min))), 0.0, 0.0]);
            let probes = surfaces.iter().flat_map(|&(at, seed, surface)| {
                (0..self.sky_rays).map(move |number| {
                    let toward = scatter(wide(surface.normal), seed, number, self.sky_rays);
                    (at, Ray { t_max, ..Ray::new(surface.above, round(toward)) })
                })
            });
            let part = 1.0 / f32::from(self.sky_rays);
            send(grid, probes, |at| reached.open[at] -= part);
        }
        reached
    }
}

/// Traces all rays with one call and shows `hidden` the pixels of those that do not get through.
fn send(
    grid: &Grid<'_>,
    probes: impl Iterator<Item = (usize, Ray)>,
    mut hidden: impl FnMut(usize),
) {
    let (pixels, rays): (Vec<_>, Vec<_>) = probes.unzip();
    let mut occluded = vec![0_u8; rays.len()];
    let answers = &mut StridedMut::new(&mut occluded);
    let answered = grid.occluded_n(&Strided::new(&rays), answers, Coherence::Coherent);
    debug_assert_eq!(answered, Ok(()));
    for (at, _) in pixels.into_iter().zip(occluded).filter(|(_, occluded)| *occluded != 0) {
        hidden(at);
    }
}

fn wide(vector: [f32; 3]) -> Vector {
    vector.map(f64::from)
}

/// A number for the pixel of a ray, whichever tile it is in.
fn seed(ray: &Ray) -> u32 {
    ray.direction.iter().fold(0, |seed, c| mixed(seed ^ c.to_bits()))
}

/// A number that looks random: every bit of it depends on every bit of `x`.
const fn mixed(x: u32) -> u32 {
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// One of the directions from a surface to the sky above it.
///
/// Points on a disk, lifted to the hemisphere above it, have the cosine in them. On the disk they
/// lie like the seeds of a sunflower, turned by another angle for each pixel.
fn scatter(normal: Vector, seed: u32, number: u16, count: u16) -> Vector {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let part = |x: u32| f64::from(mixed(x)) / 4_294_967_296.0;
    let area = (f64::from(number) + part(seed)) / f64::from(count);
    let angle = core::f64::consts::TAU * (f64::from(number) * GOLDEN + part(!seed));
    let helper = if normal[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let first = unit(cross(helper, normal)).unwrap_or(helper);
    let (radius, height) = (area.sqrt(), (1.0 - area).sqrt());
    let lifted = offset(normal.map(|c| c * height), radius * angle.cos(), first);
    offset(lifted, radius * angle.sin(), cross(normal, first))
}

#[cfg(test)]
mod tests {
    use hgrid_core::{Config, Method, TriangleMesh};

    use super::*;
    use crate::regions::Regions;

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
            let reached = lights.reach(&grid, [0.0, 0.0, 1.0], &rays, &hits);
            assert_eq!(reached.lit[..3], [1.0, 0.0, 1.0]);
            assert!(reached.open[0] > 0.9 && reached.open[1] < 0.1, "{:?}", &reached.open[..3]);
            assert_eq!(reached.open[2].to_bits(), 1.0_f32.to_bits());
            assert!(!lights.are_everywhere() && Lights::default().are_everywhere());
        }
    }

    #[test]
    fn directions_lie_above_the_surface() {
        for normal in [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.6, 0.0, -0.8]] {
            let mean =
                (0..100).map(|i| scatter(normal, 7, i, 100)).fold([0.0; 3], |sum, toward| {
                    assert!(dot(toward, normal) > 0.0 && (length(toward) - 1.0).abs() < 1e-9);
                    offset(sum, 0.01, toward)
                });
            assert!((dot(mean, normal) - 2.0 / 3.0).abs() < 0.01, "{mean:?}");
        }
    }
}
