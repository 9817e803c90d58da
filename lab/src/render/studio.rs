//! The light of a picture: a lamp, sky and ground, and a floor under a thing.
//!
//! ```text
//!  lamp                  thing: the lamp over the viewer's left shoulder, and a floor under it that
//!     \    sky                  has the colours of the background, but is darker in the shade
//!      \  .---.          room:  of some lamps the one that lights most of the visible surfaces, with
//!       \ | * |                 sky and ground bright enough to show the rest
//!  -------floor-----
//! ```

use hgrid_core::{INVALID_ID, Ray, SceneHit};

use super::paint::Seen;
use crate::camera::{Camera, Up, View};
use crate::light::{Around, Lights, Sample, Spot, noise};
use crate::scene::Bounds;
use crate::shade::{background, lamp};
use crate::tiles::Tiles;
use crate::vector::{dot, length, offset, round};
use crate::world::World;

/// The three lights on a surface, as linear red, green and blue.
const KEY: [f32; 3] = [0.92, 0.86, 0.76];
const SKY: [f32; 3] = [0.21, 0.25, 0.31];
const GROUND: [f32; 3] = [0.11, 0.10, 0.085];

/// The red, green and blue that the geometries of a scene reflect, in turn. The first is grey, and so is a
/// scene of one geometry.
const TINTS: [[f32; 3]; 5] =
    [[1.0, 1.0, 1.0], [1.0, 0.74, 0.48], [0.55, 0.78, 1.0], [0.62, 0.92, 0.58], [1.0, 0.6, 0.62]];

/// The distance within which surfaces hide the sky: in parts of half the scene's diagonal, or in a room in
/// parts of the mean distance of its hits.
const REACH: f64 = 0.5;
const ROOM_REACH: f64 = 0.35;

/// The light in a room: the mean that exposure aims at, and the largest exposure.
const ROOM_MEAN: f32 = 0.34;
const MAX_EXPOSURE: f32 = 6.0;

/// The largest cosine that counts in the choice of a lamp: a lamp that lights many surfaces beats one that
/// lights a floor alone.
const GRAZING: f32 = 0.5;

/// The parts of the floor's light that remain without the lamp, and without the sky.
const FLOOR_SHADE: f32 = 0.5;
const FLOOR_CLOSED: f32 = 0.35;

/// The distances from the scene's middle at which the floor's shade begins to fade and ends, in its radii.
const FADE: [f64; 2] = [1.2, 3.5];

/// Rays on each side of the coarse picture that decides about the light of a room.
const COARSE: u16 = 48;

/// The lights on the surfaces of a scene, as a camera sees them.
#[derive(Debug)]
pub(super) struct Studio<'a> {
    world: World<'a>,
    tiles: Tiles,
    lights: Lights,
    around: Around,
    /// The direction to the sky.
    up: [f32; 3],
    /// The brightness of sky and ground: 1 except in rooms.
    exposure: f32,
    floor: Option<Floor>,
}

/// A level plane below a thing.
#[derive(Debug, Clone, Copy)]
struct Floor {
    middle: [f64; 3],
    radius: f64,
}

impl<'a> Studio<'a> {
    /// Lights a part of a scene for a camera.
    pub(super) fn new(
        world: World<'a>,
        tiles: Tiles,
        lights: Lights,
        (part, is_all): (Bounds, bool),
        up: Up,
    ) -> Self {
        let lamp = lamp(&tiles.camera);
        let (min, max) = (part.0.map(f64::from), part.1.map(f64::from));
        let diagonal = offset(max, -1.0, min);
        let radius = 0.5 * length(diagonal);
        let upward = up.direction();
        let middle = offset(min, 0.5, diagonal);
        let half_height = 0.5 * dot(diagonal, upward).abs();
        let floor = Floor { middle: offset(middle, -half_height, upward), radius };
        let eye = tiles.camera.ray(0, 0, 1).origin.map(f64::from);
        let is_above = dot(offset(eye, -1.0, floor.middle), upward) > 0.0;
        let [reach, ..] = round([REACH * radius, 0.0, 0.0]);
        let mut studio = Self {
            world,
            tiles,
            lights,
            around: Around { lamp, reach },
            up: round(upward),
            exposure: 1.0,
            floor: (is_all && is_above && !lights.are_everywhere()).then_some(floor),
        };
        let is_within = (0..3).all(|axis| (min[axis]..=max[axis]).contains(&eye[axis]));
        if is_within {
            studio.light_room(up);
        }
        studio
    }

    /// Chooses lamp, reach and exposure for a camera that stands in the scene.
    fn light_room(&mut self, up: Up) {
        self.floor = None;
        let coarse = Tiles { size: COARSE, ..self.tiles };
        let (mut rays, mut hits) = (Vec::new(), Vec::new());
        coarse.each(|tile, _| {
            let from = hits.len();
            hits.resize(from + tile.len(), SceneHit::MISS);
            self.world.intersect(tile, &mut hits[from..]);
            rays.extend_from_slice(tile);
        });
        let surfaces: Vec<_> =
            rays.iter().zip(&hits).filter_map(|(ray, hit)| self.world.surface(ray, hit)).collect();
        if surfaces.is_empty() {
            return;
        }
        let count = f64::from(u32::try_from(surfaces.len()).unwrap_or(u32::MAX));
        let distances = hits.iter().filter(|hit| hit.primitive != INVALID_ID);
        let mean = distances.map(|hit| f64::from(hit.t)).sum::<f64>() / count;
        [self.around.reach, ..] = round([ROOM_REACH * mean, 0.0, 0.0]);

        if self.lights.has_shadows {
            let lit = |lamp: [f32; 3]| -> f32 {
                let lit = surfaces.iter().map(|surface| {
                    let toward = crate::shade::dot(surface.normal, lamp).max(0.0);
                    let is_dark =
                        toward <= 0.0 || self.world.occluded(&Ray::new(surface.above, lamp));
                    if is_dark { 0.0 } else { toward.min(GRAZING) }
                });
                lit.sum()
            };
            let lamps = [30.0, 50.0, 70.0].into_iter().flat_map(|elevation| {
                (0..12).map(move |at| View::Angles { azimuth: 30.0 * f64::from(at), elevation })
            });
            let lamps = lamps.map(|view| view.unit(up)).chain([self.around.lamp]);
            let best = lamps.map(|lamp| (lit(lamp), lamp)).max_by(|a, b| a.0.total_cmp(&b.0));
            self.around.lamp = best.map_or(self.around.lamp, |(_, lamp)| lamp);
        }

        let (mut sum, mut pixels) = (0.0, 0.0);
        coarse.each(|tile, _| {
            let mut hits = vec![SceneHit::MISS; tile.len()];
            self.world.intersect(tile, &mut hits);
            let mut light = vec![[0.0; 3]; tile.len()];
            let sample = Sample { number: 0, count: 1 };
            self.shade(&Seen { rays: tile, hits: &hits, middles: tile, sample }, &mut light);
            for (_, [_, green, _]) in
                hits.iter().zip(light).filter(|(hit, _)| hit.primitive != INVALID_ID)
            {
                sum += green;
                pixels += 1.0;
            }
        });
        if sum > 0.0 {
            self.exposure = (ROOM_MEAN * pixels / sum).clamp(1.0, MAX_EXPOSURE);
        }
    }

    /// Returns the camera of the picture.
    fn camera(&self) -> &Camera {
        &self.tiles.camera
    }

    /// Computes the light of rays, and returns the number of rays that it has traced.
    pub(super) fn shade(&self, seen: &Seen<'_>, light: &mut [[f32; 3]]) -> u64 {
        let size = self.tiles.size;
        let mut spots = Vec::with_capacity(seen.rays.len());
        for (at, ((ray, hit), middle)) in
            (0..).zip(seen.rays.iter().zip(seen.hits).zip(seen.middles))
        {
            let noise = noise(self.camera().pixel(middle, size));
            if let Some(surface) = self.world.surface(ray, hit) {
                spots.push(Spot { at, normal: surface.normal, start: surface.above, noise });
            } else if let Some((start, _)) = self.on_floor(ray) {
                spots.push(Spot { at, normal: self.up, start, noise });
            }
        }
        let reached = self.lights.reach(self.world, &self.around, seen.sample, &spots);
        let [_, picture_up, _] = self.camera().axes();
        for (light, ray) in light.iter_mut().zip(seen.rays) {
            *light = background(picture_up, ray.direction);
        }
        for Spot { at, normal, .. } in spots {
            let (lit, open) = (reached.lit[at], reached.open[at]);
            if seen.hits[at].primitive == INVALID_ID {
                let fade = self.on_floor(&seen.rays[at]).map_or(0.0, |(_, fade)| fade);
                let shade = FLOOR_SHADE + (1.0 - FLOOR_SHADE) * lit;
                let closed = FLOOR_CLOSED + (1.0 - FLOOR_CLOSED) * open;
                let left = 1.0 - fade * (1.0 - shade * closed);
                light[at] = light[at].map(|c| c * left);
            } else {
                let geometry = self.world.geometry(&seen.hits[at]) as usize;
                light[at] = self.surface(normal, TINTS[geometry % TINTS.len()], lit, open);
            }
        }
        reached.rays
    }

    /// Returns the light of a surface, with a curve like that of film: bright light never quite becomes white.
    fn surface(&self, normal: [f32; 3], tint: [f32; 3], lit: f32, open: f32) -> [f32; 3] {
        let dot = crate::shade::dot;
        let key = lit * dot(normal, self.around.lamp).max(0.0);
        let sky = 0.5 + 0.5 * dot(normal, self.up);
        [0, 1, 2].map(|c| {
            let fill = open * (SKY[c] * sky + GROUND[c] * (1.0 - sky));
            1.0 - (-tint[c] * (KEY[c] * key + self.exposure * fill)).exp()
        })
    }

    /// Returns the point where a ray meets the floor, and the strength of the floor's shade there.
    fn on_floor(&self, ray: &Ray) -> Option<([f32; 3], f32)> {
        let Floor { middle, radius } = self.floor?;
        let (up, along) = (self.up.map(f64::from), ray.direction.map(f64::from));
        let from = offset(ray.origin.map(f64::from), -1.0, middle);
        let fall = -dot(along, up);
        let t = dot(from, up) / fall;
        if fall <= 0.0 || t <= 0.0 {
            return None;
        }
        let place = offset(from, t, along);
        let [near, far] = FADE;
        let part = ((far - length(place) / radius) / (far - near)).clamp(0.0, 1.0);
        let [fade, ..] = round([part * part * (3.0 - 2.0 * part), 0.0, 0.0]);
        (fade > 0.0).then(|| (round(offset(middle, 1.0, place)), fade))
    }
}
