//! The structure that a picture queries: a grid of one mesh, or a scene of instances of several.
//!
//! ```text
//! World      closest hits       any hit               surface
//! mesh       a tile together    all rays together     the mesh's
//! instances  a tile together    all rays together     the scene's, with origins far enough off it for rays in f32
//! ```

use hgrid_core::{
    Batch, Coherence, Grid, Hit, INVALID_ID, Instance, MAX_NESTING, Object, Ray, RayF64, Scene,
    SceneHit, SceneOptions, SceneSurface, Strided, StridedMut, Surface,
};

use crate::scene::Bounds;
use crate::tiles::{TILE_RAYS, intersect};

/// A batch of f32 rays for a scene, with places for their answers and a conversion of each.
pub(crate) struct SceneBatch<'r, A, T> {
    pub(crate) rays: &'r [Ray],
    pub(crate) answers: &'r mut [T],
    pub(crate) write: fn(A) -> T,
}

impl<A, T> Batch<A, RayF64> for SceneBatch<'_, A, T> {
    fn count(&self) -> usize {
        self.rays.len()
    }

    fn ray(&self, place: usize) -> RayF64 {
        (&self.rays[place]).into()
    }

    fn answer(&mut self, place: usize, answer: A) {
        self.answers[place] = (self.write)(answer);
    }
}

/// A built structure, with the queries of a picture.
#[derive(Debug, Clone, Copy)]
pub enum World<'a> {
    /// A mesh without instances.
    Mesh(&'a Grid<'a>),
    /// Meshes placed by instances.
    Instances(&'a Scene<'a>),
}

/// The lift of a ray's start beyond that of a mesh, in parts of the extent and the coordinates of the object:
/// twice the error that docs/renderers.md gives.
const LIFT: f32 = 32.0 * f32::EPSILON; // 2^-18

/// The further lift for rounding a start to f32, in parts of its coordinates in the scene.
const ROUNDING: f32 = 2.0 * f32::EPSILON; // 2^-22

impl World<'_> {
    /// Finds the closest hits of rays, as many as there are rays.
    pub fn intersect(&self, rays: &[Ray], hits: &mut [SceneHit]) {
        match self {
            Self::Mesh(grid) => {
                let mut found = [Hit::MISS; TILE_RAYS];
                for (rays, hits) in rays.chunks(TILE_RAYS).zip(hits.chunks_mut(TILE_RAYS)) {
                    let found = &mut found[..rays.len()];
                    intersect(grid, rays, found);
                    for (hit, found) in hits.iter_mut().zip(found) {
                        *hit = of_mesh(found);
                    }
                }
            }
            Self::Instances(scene) => {
                let mut batch = SceneBatch { rays, answers: hits, write: |hit| hit };
                let options = &mut SceneOptions::default();
                scene.intersect_batch(&mut batch, Coherence::Coherent, options);
            }
        }
    }

    /// Returns the closest hit of a ray.
    #[must_use]
    pub fn closest(&self, ray: &Ray) -> Option<SceneHit> {
        match self {
            Self::Mesh(grid) => grid.intersect(ray).map(|hit| of_mesh(&hit)),
            Self::Instances(scene) => scene.intersect(&ray.into()),
        }
    }

    /// Returns true if a ray hits anything.
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        match self {
            Self::Mesh(grid) => grid.occluded(ray),
            Self::Instances(scene) => scene.occluded(&ray.into()),
        }
    }

    /// Writes 1 for each of many rays that hits anything, 0 for the others.
    pub fn occluded_all(&self, rays: &[Ray], occluded: &mut [u8]) {
        match self {
            Self::Mesh(grid) => {
                let answers = &mut StridedMut::new(occluded);
                let answered = grid.occluded_n(&Strided::new(rays), answers, Coherence::Coherent);
                debug_assert_eq!(answered, Ok(()));
            }
            Self::Instances(scene) => {
                let mut batch = SceneBatch { rays, answers: occluded, write: u8::from };
                let options = &mut SceneOptions::default();
                scene.occluded_batch(&mut batch, Coherence::Coherent, options);
            }
        }
    }

    /// Returns the number of the geometry of a hit; 0 for instances.
    #[must_use]
    pub fn geometry(&self, hit: &SceneHit) -> u32 {
        match self {
            Self::Mesh(grid) => {
                grid.mesh().locate(hit.primitive).map_or(0, |(geometry, _)| geometry)
            }
            Self::Instances(_) => 0,
        }
    }

    /// Returns the point where a ray met a triangle, with origins for rays that leave it.
    #[must_use]
    pub fn surface(&self, ray: &Ray, hit: &SceneHit) -> Option<Surface> {
        match self {
            Self::Mesh(grid) => grid.mesh().surface(ray, &on_mesh(*hit)),
            Self::Instances(scene) => surface(scene, ray, hit),
        }
    }
}

/// Converts a hit on a mesh without instances.
fn of_mesh(&Hit { t, u, v, primitive }: &Hit) -> SceneHit {
    SceneHit { t, u, v, primitive, path: [INVALID_ID; MAX_NESTING] }
}

/// Converts a hit, without its instance.
pub(crate) const fn on_mesh(SceneHit { t, u, v, primitive, .. }: SceneHit) -> Hit {
    Hit { t, u, v, primitive }
}

/// Returns the surface of a scene for rays in f32. Core's origins are f64; rounded, they need a further lift.
#[expect(clippy::cast_possible_truncation, reason = "to the precision of the rays")]
fn surface(scene: &Scene<'_>, ray: &Ray, hit: &SceneHit) -> Option<Surface> {
    let Object::Grid(grid) = scene.object_of(hit)? else { return None };
    let SceneSurface { position, above, below, normal, is_front } =
        scene.surface(&ray.into(), hit)?;
    let position = position.map(|c| c as f32);
    let far = position.iter().fold(0.0, |far: f32, c| far.max(c.abs()));
    let lift = LIFT * size(&scene.instance_of(hit)?, grid.bounds()) + ROUNDING * far;
    let lifted = |start: [f64; 3], by: f32| {
        core::array::from_fn(|axis| start[axis] as f32 + by * normal[axis])
    };
    let (above, below) = (lifted(above, lift), lifted(below, -lift));
    Some(Surface { position, normal, above, below, is_front })
}

/// Returns the extent of an object plus its largest coordinate, scaled by its instance.
fn size(instance: &Instance, (min, max): Bounds) -> f32 {
    let along = |axis: usize| max[axis] - min[axis] + min[axis].abs().max(max[axis].abs());
    let scale = instance.linear.as_flattened().iter().map(|c| c * c).sum::<f32>().sqrt();
    scale * (0..3).map(along).fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use hgrid_core::{Block, Config, Sizes, TriangleMesh};

    use super::*;
    use crate::camera::{Camera, Up, View};
    use crate::regions::Regions;
    use crate::scene::Scene as Shown;
    use crate::scene::model::{IDENTITY, Mesh, Model, Transform};
    use crate::shade::dot;
    use crate::tiles::Tiles;

    /// Rotated by a quarter turn, scaled and moved; and mirrored, far from its own origin and the scene's.
    const PLACES: [Transform; 3] = [
        IDENTITY,
        [[0.0, -2.0, 0.0, 7.0], [2.0, 0.0, 0.0, 1.0], [0.0, 0.0, 2.0, -3.0]],
        [[-1.0, 0.0, 0.0, 90.0], [0.0, 1.0, 0.0, 0.5], [0.0, 0.25, 1.0, 80.0]],
    ];

    #[test]
    fn instances_look_like_their_triangles() {
        let knot = Shown::load("procedural:knot:800").unwrap();
        let mesh = Mesh { positions: knot.positions, indices: knot.indices };
        let instances = PLACES.map(|place| (0, place)).to_vec();
        let model = Model { meshes: vec![mesh], instances, ..Model::default() };
        assert!(model.is_shared());
        let bounds = model.bounds().unwrap();
        let flat = model.clone().flatten().unwrap();

        let config = Config::default();
        let triangles = TriangleMesh::new(&flat.positions, &flat.indices).unwrap();
        let regions = Regions::build(triangles, &config).unwrap();
        let flat = Grid::open(&regions.index, triangles).unwrap();
        let mesh = &model.meshes[0];
        let mesh = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
        let regions = Regions::build(mesh, &config).unwrap();
        let grid = Grid::open(&regions.index, mesh).unwrap();
        let objects = [Object::Grid(&grid)];
        let placed = PLACES.map(|place| Instance::with_transform(0, place));
        let Sizes { index_bytes, scratch_bytes, .. } = Scene::bound(3, &config).unwrap();
        let [mut index, mut scratch] =
            [index_bytes, scratch_bytes].map(|bytes| vec![Block::ZERO; Block::count_for(bytes)]);
        let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
        let scene = Scene::build(&placed, &objects, &config, index, scratch).unwrap();

        let worlds = [World::Mesh(&flat), World::Instances(&scene)];
        let (mut rays_with_hits, mut other) = (0, 0);
        let alone = |&place: &Transform| {
            Model { instances: vec![(0, place)], ..model.clone() }.bounds().unwrap()
        };
        for part in PLACES.iter().map(alone).chain([bounds]) {
            let camera = Camera::framing(part, View::ThreeQuarter, Up::Y);
            Tiles { camera, size: 40 }.each(|rays, _| {
                let hits = worlds.map(|world| {
                    let mut hits = vec![SceneHit::MISS; rays.len()];
                    world.intersect(rays, &mut hits);
                    hits
                });
                for (ray, (a, b)) in rays.iter().zip(hits[0].iter().zip(&hits[1])) {
                    let [a, b] = [worlds[0].surface(ray, a), worlds[1].surface(ray, b)];
                    let (Some(a), Some(b)) = (a, b) else {
                        other += u32::from(a.is_some() != b.is_some());
                        continue;
                    };
                    rays_with_hits += 1;
                    let is_same = (0..3)
                        .all(|axis| (a.position[axis] - b.position[axis]).abs() < 1e-3)
                        && dot(a.normal, b.normal) > 0.999
                        && a.is_front == b.is_front;
                    other += u32::from(!is_same);
                    // On a closed surface nothing is just above the outside.
                    let t_max = 1e-4;
                    let up = Ray { t_max, ..Ray::new(b.above, b.normal) };
                    let down = Ray { t_max, ..Ray::new(b.above, b.normal.map(|c| -c)) };
                    let mut occluded = [0; 2];
                    worlds[1].occluded_all(&[up, Ray { t_max: 1.0, ..down }], &mut occluded);
                    assert_eq!((occluded, worlds[1].occluded(&up)), ([0, 1], false), "{b:?}");
                }
            });
        }
        assert!(rays_with_hits > 500 && other <= 3, "{other} of {rays_with_hits}");
    }
}
