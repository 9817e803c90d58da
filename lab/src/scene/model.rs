//! The content of a file: meshes, and their instances.
//!
//! ```text
//! meshes     [ knot, floor ]
//! instances  (0, here) (0, there) (1, at the origin)      three things from two meshes
//! ```
//!
//! A file without transforms is one mesh with one instance, whose transform is the identity.

use core::fmt;

use anyhow::{Context as _, Result};
use hgrid_core::{Block, Config, Instance, Object, Scene as Instances};

use super::{Bounds, corners_of};
use crate::plural::counted;
use crate::vector::{Vector, dot, round};

/// The rows of a 3 x 4 matrix: a linear map, and a translation in the last column.
pub type Transform = [[f32; 4]; 3];

/// The transform that changes nothing.
pub const IDENTITY: Transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Vertices and triangles, in the arrays that the core takes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertices, in units of the file.
    pub positions: Vec<[f32; 3]>,
    /// Three vertices for each triangle.
    pub indices: Vec<[u32; 3]>,
}

impl Mesh {
    /// Returns the box around all finite triangles, or `None` if there are none. Vertices without a triangle may lie
    /// anywhere.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        bounds(self.vertices(&self.is_used()))
    }

    /// Tells of each vertex whether a finite triangle uses it.
    fn is_used(&self) -> Vec<bool> {
        let is_finite = |triangle: &&[u32; 3]| {
            corners_of(&self.positions, triangle).is_some_and(|corners| super::is_finite(&corners))
        };
        let mut is_used = vec![false; self.positions.len()];
        for triangle in self.indices.iter().filter(is_finite) {
            for &vertex in triangle {
                is_used[vertex as usize] = true;
            }
        }
        is_used
    }

    /// Returns the vertices that are used.
    fn vertices<'a>(&'a self, is_used: &'a [bool]) -> impl Iterator<Item = [f32; 3]> + 'a {
        let used = self.positions.iter().zip(is_used).filter(|(_, is_used)| **is_used);
        used.map(|(&position, _)| position)
    }
}

/// Meshes with their instances.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Model {
    /// The meshes, each stored once.
    pub meshes: Vec<Mesh>,
    /// The index of a mesh, and its transform.
    pub instances: Vec<(usize, Transform)>,
    /// The parts of the file that are not read, in words.
    pub hidden: Vec<String>,
}

impl From<Mesh> for Model {
    fn from(mesh: Mesh) -> Self {
        Self { meshes: vec![mesh], instances: vec![(0, IDENTITY)], hidden: Vec::new() }
    }
}

impl Model {
    /// Returns a sentence that names the parts of a file that are not read; nothing if there are none.
    pub(crate) fn hidden_in(&self, file: impl fmt::Display) -> Vec<String> {
        let hidden = self.hidden.join(", ");
        if hidden.is_empty() { Vec::new() } else { vec![format!("{file}: not shown: {hidden}")] }
    }

    /// Returns true if a mesh with triangles has more than one instance, and a scene can take all of them: no
    /// transform is flat, or so nearly that it has no inverse in f32.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        let mut is_seen = vec![false; self.meshes.len()];
        let has_triangles =
            |mesh: usize| self.meshes.get(mesh).is_some_and(|mesh| !mesh.indices.is_empty());
        let shown = self.instances.iter().filter(|(mesh, _)| has_triangles(*mesh));
        shown.clone().any(|&(mesh, _)| core::mem::replace(&mut is_seen[mesh], true))
            && have_inverses(shown.map(|&(_, transform)| transform))
    }

    /// Returns the box around all finite triangles of all instances, or `None` if there are none.
    ///
    /// The box around a mesh tells how far an instance may reach. For each side, instances are visited in the order of
    /// how far they may reach, until the next may reach no farther than a vertex that was found.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        let is_used: Vec<_> = self.meshes.iter().map(Mesh::is_used).collect();
        let of_meshes = self.meshes.iter().zip(&is_used);
        let boxes: Vec<_> =
            of_meshes.map(|(mesh, is_used)| bounds(mesh.vertices(is_used))).collect();
        let mut waiting = Vec::with_capacity(self.instances.len());
        let mut is_visited = vec![false; self.instances.len()];
        let mut found: Option<Bounds> = None;
        for axis in 0..3 {
            for is_up in [false, true] {
                let sign = if is_up { 1.0 } else { -1.0 };
                for (place, (mesh, transform)) in self.instances.iter().enumerate() {
                    let Some(of_mesh) = boxes.get(*mesh).copied().flatten() else { continue };
                    let farthest = farthest(transform, of_mesh, axis, is_up);
                    let reach = sign * moved(transform, farthest)[axis];
                    // A transform that is not finite may reach anywhere.
                    waiting.push((if reach.is_nan() { f32::INFINITY } else { reach }, place));
                }
                waiting.sort_by(|(a, _), (b, _)| a.total_cmp(b));
                while let Some((reach, place)) = waiting.pop() {
                    let side = found.map(|(min, max)| sign * if is_up { max } else { min }[axis]);
                    if side.is_some_and(|side| reach <= side) {
                        break;
                    }
                    if core::mem::replace(&mut is_visited[place], true) {
                        continue;
                    }
                    let (mesh, transform) = &self.instances[place];
                    let vertices = self.meshes[*mesh].vertices(&is_used[*mesh]);
                    let of_instance = bounds(vertices.map(|vertex| moved(transform, vertex)));
                    let corners = [found, of_instance].into_iter().flatten();
                    found = bounds(corners.flat_map(|(min, max)| [min, max]));
                }
                waiting.clear();
            }
        }
        found
    }

    /// Returns the triangles of all instances as one mesh.
    ///
    /// Fronts of triangles stay fronts: a mirroring transform swaps two corners.
    ///
    /// # Errors
    /// If it would have more than 2^32 vertices, or the system refuses the memory for it.
    pub fn flatten(mut self) -> Result<Mesh> {
        if let ([_], [(0, IDENTITY)]) = (&*self.meshes, &*self.instances) {
            return Ok(self.meshes.pop().unwrap_or_default());
        }
        let instances = || {
            let mesh = |&(mesh, transform)| Some((self.meshes.get(mesh)?, transform));
            self.instances.iter().filter_map(mesh)
        };
        let (mut vertices, mut triangles) = (0, 0);
        for (mesh, _) in instances() {
            vertices += mesh.positions.len();
            triangles += mesh.indices.len();
        }
        u32::try_from(vertices).context("it has more than 2^32 vertices")?;
        let mut all = Mesh::default();
        let positions = all.positions.try_reserve_exact(vertices);
        positions.and_then(|()| all.indices.try_reserve_exact(triangles)).with_context(|| {
            let triangles = counted(triangles, "triangle", "triangles");
            format!("there is not enough memory for the {triangles} of all its instances")
        })?;
        for (mesh, transform) in instances() {
            let first = u32::try_from(all.positions.len())?;
            all.positions.extend(mesh.positions.iter().map(|&p| moved(&transform, p)));
            let is_mirrored = determinant(&transform) < 0.0;
            // An index out of range stays out of range, for the core to refuse.
            let vertex =
                |v: u32| if (v as usize) < mesh.positions.len() { first + v } else { u32::MAX };
            all.indices.extend(mesh.indices.iter().map(|triangle| {
                let [a, b, c] = triangle.map(vertex);
                if is_mirrored { [a, c, b] } else { [a, b, c] }
            }));
        }
        Ok(all)
    }
}

/// Returns the corner of a box that lies farthest along an axis, up or down, once it is transformed. No point of the
/// box lies farther, not even after rounding: the sums for both are rounded alike, and rounding keeps their order.
fn farthest(transform: &Transform, (min, max): Bounds, axis: usize, is_up: bool) -> [f32; 3] {
    [0, 1, 2].map(|k| if (transform[axis][k] >= 0.0) == is_up { max[k] } else { min[k] })
}

fn is_finite(position: &[f32; 3]) -> bool {
    position.iter().all(|c| c.is_finite())
}

/// Returns true if these transforms have inverses that a scene takes.
fn have_inverses(mut transforms: impl Iterator<Item = Transform>) -> bool {
    let config = Config::default();
    let Some(sizes) = Instances::bound(1, &config) else { return false };
    let [mut index, mut scratch] = [sizes.index_bytes, sizes.scratch_bytes]
        .map(|bytes| vec![Block::ZERO; Block::count_for(bytes)]);
    let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
    // A scene takes or refuses each instance by itself, so one at a time is enough.
    transforms.all(|transform| {
        let instance = Instance::with_transform(0, transform);
        Instances::build(&[instance], &[Object::Nothing], &config, index, scratch).is_ok()
    })
}

/// Transforms a point in `f64`, and rounds the result.
pub(crate) fn moved(transform: &Transform, point: [f32; 3]) -> [f32; 3] {
    let point = point.map(f64::from);
    round(transform.map(|row| {
        let [x, y, z, offset] = row.map(f64::from);
        dot([x, y, z], point) + offset
    }))
}

/// Returns the determinant: the volume of the transformed unit cube, negative for a mirror.
pub(crate) fn determinant(transform: &Transform) -> f64 {
    let [a, b, c] = transform.map(|[x, y, z, _]| -> Vector { [x, y, z].map(f64::from) });
    dot(a, crate::vector::cross(b, c))
}

/// Returns the box around all finite points, or `None` if there are none.
pub(super) fn bounds(positions: impl Iterator<Item = [f32; 3]>) -> Option<Bounds> {
    positions.filter(is_finite).fold(None, |bounds, position| {
        let (mut min, mut max) = bounds.unwrap_or((position, position));
        for axis in 0..3 {
            min[axis] = min[axis].min(position[axis]);
            max[axis] = max[axis].max(position[axis]);
        }
        Some((min, max))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instances_become_triangles_with_their_fronts() {
        let mesh = Mesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            indices: vec![[0, 1, 2]],
        };
        assert_eq!(Model::from(mesh.clone()).flatten().unwrap(), mesh);
        let moved = [[2.0, 0.0, 0.0, 5.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 2.0, -1.0]];
        let mirror = [[-1.0, 0.0, 0.0, 0.0], IDENTITY[1], IDENTITY[2]];
        let model = Model {
            meshes: vec![mesh],
            instances: vec![(0, moved), (0, mirror), (7, mirror)],
            ..Model::default()
        };
        let all = model.flatten().unwrap();
        assert_eq!(all.indices, [[0, 1, 2], [3, 5, 4]]);
        let bits = |positions: &[[f32; 3]]| {
            positions.iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>()
        };
        let expected = [[7.0, 0.0, -1.0], [5.0, 2.0, -1.0], [0.0; 3], [-1.0, 0.0, 0.0]];
        assert_eq!(bits(&all.positions[1..5]), bits(&expected));
    }

    #[test]
    fn a_box_leaves_out_what_core_leaves_out() {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1e37, 0.0, 0.0]];
        let mesh = Mesh { positions, indices: vec![[0, 1, 2], [0, 1, 3], [0, 1, 9]] };
        let (min, max) = mesh.bounds().unwrap();
        assert_eq!(
            [min, max].map(|p| p.map(f32::to_bits)),
            [[0.0; 3], [1.0, 1.0, 0.0]].map(|p: [f32; 3]| p.map(f32::to_bits))
        );
    }

    #[test]
    fn meshes_are_shared_that_stand_twice_where_instances_can() {
        let mesh = Mesh {
            positions: vec![
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [9.0, 1.0, 7.0],
                [0.0, 1.0, 0.0],
                [f32::NAN; 3],
            ],
            indices: vec![[0, 1, 3], [2, 1, 4]],
        };
        let of = |instances: &[(usize, Transform)]| Model {
            meshes: vec![mesh.clone(), mesh.clone(), Mesh::default()],
            instances: instances.to_vec(),
            ..Model::default()
        };
        let beside = [[1.0, 0.0, 0.0, 5.0], IDENTITY[1], [0.0, 0.0, -1.0, 2.0]];
        let flat = [IDENTITY[0], IDENTITY[1], [0.0; 4]];
        // Turned first and flattened then.
        let nearly_flat = [[0.8, -0.6, 0.0, 0.0], [6e-7, 8e-7, 0.0, 0.0], IDENTITY[2]];
        assert!(of(&[(0, IDENTITY), (1, IDENTITY), (0, beside)]).is_shared());
        for alone in [
            &[(0, IDENTITY), (1, beside)][..],
            &[(2, IDENTITY), (2, beside), (0, beside)],
            &[(0, IDENTITY), (0, beside), (1, flat)],
            &[(0, IDENTITY), (0, beside), (1, nearly_flat)],
            &[(7, IDENTITY), (7, IDENTITY)],
            &[],
        ] {
            assert!(!of(alone).is_shared(), "{alone:?}");
        }
        let model = of(&[(0, IDENTITY), (0, beside), (7, beside)]);
        assert_eq!(model.bounds(), Some(([0.0; 3], [6.0, 1.0, 2.0])));
        assert_eq!(Model::default().bounds(), None);
    }

    #[test]
    fn the_box_of_instances_is_that_of_all_their_vertices() {
        let mut state = 1_u32;
        let mut number = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from(u16::try_from(state >> 16).unwrap()) / 32_768.0 - 1.0
        };
        for round in 0..200 {
            let mut mesh = || {
                let positions: Vec<_> = (0..9).map(|_| [number(), number(), number()]).collect();
                Mesh { positions, indices: vec![[0, 1, 2], [3, 4, 5], [6, 7, 7]] }
            };
            let meshes = vec![mesh(), mesh()];
            let instances: Vec<_> = (0..30)
                .map(|k| {
                    let mut transform = [(); 3].map(|()| [(); 4].map(|()| number()));
                    if round % 2 == 0 {
                        transform[1] = [0.0, 1.0, 0.0, 0.5];
                    }
                    if round % 50 == 0 && k == 7 {
                        transform[0] = [3e38; 4];
                    }
                    if round % 50 == 1 && k == 8 {
                        transform[2] = [f32::INFINITY, f32::NEG_INFINITY, 0.0, 0.0];
                    }
                    (k % 2, transform)
                })
                .collect();
            let model = Model { meshes, instances, ..Model::default() };
            let all = model.instances.iter().flat_map(|(mesh, transform)| {
                let used = &model.meshes[*mesh].positions[..8];
                used.iter().map(|&vertex| moved(transform, vertex)).collect::<Vec<_>>()
            });
            let expected = bounds(all).map(|(min, max)| [min, max].map(|p| p.map(f32::to_bits)));
            let found = model.bounds().map(|(min, max)| [min, max].map(|p| p.map(f32::to_bits)));
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn a_box_leaves_out_vertices_without_a_finite_triangle() {
        let mut positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN, 0.0, 0.0]];
        positions.extend([[1e6; 3], [-9.0; 3]]);
        let mesh = Mesh { positions, indices: vec![[0, 1, 2], [3, 4, 5], [4, 5, 6]] };
        assert_eq!(mesh.bounds(), Some(([0.0; 3], [1.0, 1.0, 0.0])));
        let points = Mesh { indices: Vec::new(), ..mesh };
        assert_eq!(points.bounds(), None);
    }

    #[test]
    fn bad_indices_stay_bad() {
        let mesh = |indices| Mesh { positions: vec![[0.0; 3]], indices };
        let meshes = vec![mesh(vec![[0, 0, 1]]), mesh(vec![[0; 3]])];
        let all =
            Model { meshes, instances: vec![(0, IDENTITY), (1, IDENTITY)], ..Model::default() }
                .flatten()
                .unwrap();
        assert_eq!(all.indices, [[0, 0, u32::MAX], [1; 3]]);
    }
}
