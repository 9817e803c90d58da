//! Many instances of a mesh on a square field: what `animate` moves and `compare` traces.
//!
//! Each instance turns about its own axis on a small circle, is larger or smaller than the mesh, and is back
//! in place after a time of 1. Nothing depends on a clock.

use core::f64::consts::TAU;

use anyhow::{Context as _, Result};
use hgrid_core::{Block, Config, Control, Hit, Instance, Object, Ray, RayF64, Scene, TriangleMesh};

use crate::camera::{Camera, Up, is_flat};
use crate::scene::{Bounds, Scene as Model};
use crate::shade::{Rgb, Shader};
use crate::tiles::TILE_RAYS;
use crate::vector::{Vector, offset, round};

/// The step from the place of an instance to the next, and the radius of the circle on which each moves,
/// in extents of the mesh.
const STEP: f64 = 1.4;
const CIRCLE: f64 = 0.15;

/// The places of instances.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    count: u32,
    up: Up,
    middle: Vector,
    extent: f64,
    /// The height of the mesh, or its extent if it is not flat.
    height: f64,
}

impl Field {
    /// Makes a field of so many instances of a mesh in this box.
    #[must_use]
    pub fn new((min, max): Bounds, count: u32, up: Up) -> Self {
        let along = |f: fn(f64, f64) -> f64| {
            [0, 1, 2].map(|axis| f(f64::from(min[axis]), f64::from(max[axis])))
        };
        let (middle, size) = (along(|a, b| 0.5 * (a + b)), along(|a, b| b - a));
        let extent = size.into_iter().fold(0.0, f64::max);
        let extent = if extent > 0.0 { extent } else { 1.0 };
        let [_, height, _] = up.turned(size);
        let height = if is_flat((min, max), up) { height } else { extent };
        Self { count, up, middle, extent, height }
    }

    /// Makes a field of so many instances of a scene, on its ground plane; none for 0. An axis that is up may be named.
    #[must_use]
    pub fn over(scene: &Model, count: u32, up: Option<Up>) -> Option<Self> {
        let up = up.unwrap_or_else(|| Up::of(scene));
        (count > 0).then(|| Self::new(scene.framed_bounds(), count, up))
    }

    /// Sets the part of the scene that pictures show to the field.
    pub fn frame(&self, scene: &mut Model) {
        scene.is_z_up = Some(self.up == Up::Z);
        scene.focus = Some(self.bounds());
    }

    /// Returns the number of instances.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    fn side(&self) -> f64 {
        f64::from(self.count).sqrt().ceil().max(1.0)
    }

    /// Returns the box of the places of all instances, half a step around the outermost ones. Large instances at its
    /// border reach out of it, by less than two fifths of the mesh's extent.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let reach = 0.5 * self.side() * STEP * self.extent;
        // The largest instance, at any rotation.
        let height = 1.3 * 0.5 * self.height;
        let corner = self.up.turned_back([reach, height, reach]).map(f64::abs);
        (round(offset(self.middle, -1.0, corner)), round(offset(self.middle, 1.0, corner)))
    }

    /// Returns the instances at a time between 0 and 1, all of object 0.
    #[must_use]
    pub fn instances(&self, time: f64) -> Vec<Instance> {
        let side = self.side();
        (0..self.count)
            .map(|number| {
                let place = f64::from(number);
                let [column, row] = [place % side, (place / side).floor()];
                // The golden ratio spreads phases and sizes evenly.
                let phase = (place * 0.618_033_988_749_895).fract();
                let size = 0.7 + 0.6 * (place * 0.754_877_666_246_693).fract();
                let (sin, cos) = (TAU * (time + phase)).sin_cos();
                let across = |at: f64| at + 0.5 - 0.5 * side;
                let place =
                    [STEP * across(column) + CIRCLE * cos, 0.0, STEP * across(row) + CIRCLE * sin];
                let turned = |axis: usize| {
                    let mut unit = [0.0; 3];
                    unit[axis] = size;
                    let [x, y, z] = self.up.turned(unit);
                    self.up.turned_back([cos * x + sin * z, y, cos * z - sin * x])
                };
                let columns = [0, 1, 2].map(turned);
                let linear = [0, 1, 2].map(|row| round(columns.map(|column| column[row])));
                let moved = linear.map(|row| {
                    (0..3).map(|axis| f64::from(row[axis]) * self.middle[axis]).sum::<f64>()
                });
                let place = offset(self.middle, self.extent, self.up.turned_back(place));
                let translation = offset(place, -1.0, moved);
                Instance { linear, translation, id: number, ..Instance::new(0) }
            })
            .collect()
    }
}

/// Memory of a scene of so many instances.
pub(crate) struct Memory {
    index: Vec<Block>,
    scratch: Vec<Block>,
}

impl Memory {
    pub(crate) fn new(count: u32, config: &Config, tasks: u32) -> Result<Self> {
        let bound = Scene::bound_parallel(count, config, tasks);
        let bound = bound.context("scenes are built with bvh, and of fewer instances")?;
        let blocks = |bytes| vec![Block::ZERO; Block::count_for(bytes)];
        Ok(Self { index: blocks(bound.index_bytes), scratch: blocks(bound.scratch_bytes) })
    }

    /// Bytes of the index and the scratch.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.index) + size_of_val(&*self.scratch)
    }

    pub(crate) fn build<'a>(
        &'a mut self,
        instances: &[Instance],
        objects: &'a [Object<'a>],
        config: &Config,
        control: &Control<'_>,
    ) -> Result<Scene<'a>> {
        let Self { index, scratch } = self;
        let (index, scratch) = (Block::bytes_mut(index), Block::bytes_mut(scratch));
        Ok(Scene::build_with(instances, objects, config, index, scratch, control)?)
    }

    /// Refits the scene to other instances.
    pub(crate) fn refit<'a>(
        &'a mut self,
        instances: &[Instance],
        objects: &'a [Object<'a>],
    ) -> Result<Scene<'a>> {
        let index = Block::bytes_mut(&mut self.index);
        Scene::refit(index, instances, objects)?;
        Ok(Scene::open(index, objects)?)
    }
}

/// The vertices of each ray of a tile: three of its own.
#[expect(clippy::cast_possible_truncation, reason = "a tile has few rays")]
static CORNERS: [[u32; 3]; TILE_RAYS] = {
    let mut corners = [[0; 3]; TILE_RAYS];
    let mut at = 0;
    while at < 3 * TILE_RAYS as u32 {
        corners[at as usize / 3] = [at, at + 1, at + 2];
        at += 3;
    }
    corners
};

/// Traces the rays of a tile through a scene and shades the hits as a mesh of its own: each ray brings the
/// triangle that it hits, transformed as its instance is. `hits` tells which rays hit something.
pub(crate) fn shade(
    scene: &Scene<'_>,
    camera: &Camera,
    rays: &[Ray],
    hits: &mut [Hit],
    colors: &mut [Rgb],
) {
    let mut corners = [[0.0; 3]; 3 * TILE_RAYS];
    hits.fill(Hit::MISS);
    let places = hits.iter_mut().zip(corners.as_chunks_mut::<3>().0);
    for (number, (ray, (to, corners))) in (0..).zip(rays.iter().zip(places)) {
        let Some(hit) = scene.intersect(&RayF64::from(ray)) else { continue };
        let Some(Object::Grid(grid)) = scene.object_of(&hit) else { continue };
        let (Some(instance), Some(triangle)) =
            (scene.instance_of(&hit), grid.mesh().triangle(hit.primitive))
        else {
            continue;
        };
        *corners = triangle.map(|corner| instance.linear.map(|row| crate::shade::dot(row, corner)));
        *to = Hit { t: hit.t, u: hit.u, v: hit.v, primitive: number };
    }
    let Ok(mesh) = TriangleMesh::new(&corners, &CORNERS) else { return };
    Shader::new(mesh, camera).diffuse(rays, hits, colors);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_axis_goes_before_that_of_the_scene() {
        let scene = Model::load("procedural:knot:500").unwrap();
        let height = |up| {
            let (min, max) = Field::over(&scene, 100, up).unwrap().bounds();
            [1, 2].map(|axis| max[axis] - min[axis])
        };
        let ([y, z], [other_y, other_z]) = (height(None), height(Some(Up::Z)));
        assert!(y < z && other_z < other_y);
        assert!(Field::over(&scene, 0, None).is_none());
    }

    #[test]
    fn instances_stay_in_the_field_and_come_back() {
        let bounds = ([1.0, 2.0, 3.0], [2.0, 4.0, 3.5]);
        for up in [Up::Y, Up::Z] {
            let field = Field::new(bounds, 10, up);
            let (min, max) = field.bounds();
            for instance in field.instances(0.3) {
                let middle = [0, 1, 2].map(|row| {
                    let sum: f64 =
                        (0..3).map(|k| f64::from(instance.linear[row][k]) * field.middle[k]).sum();
                    sum + instance.translation[row]
                });
                for axis in 0..3 {
                    assert!(middle[axis] > f64::from(min[axis]), "{middle:?} in {min:?}");
                    assert!(middle[axis] < f64::from(max[axis]), "{middle:?} in {max:?}");
                }
            }
            let far = |a: &Instance, b: &Instance| {
                (0..3).map(|k| (a.translation[k] - b.translation[k]).abs()).fold(0.0, f64::max)
            };
            let [start, third, end] = [0.0, 0.3, 1.0].map(|time| field.instances(time));
            assert!(start.iter().zip(&third).all(|(a, b)| far(a, b) > 0.01));
            assert!(start.iter().zip(&end).all(|(a, b)| far(a, b) < 1e-5));
        }
    }
}
