//! The mesh, and the instances or spheres that are shown in its place, as every system gets them.

use anyhow::Result;
use hgrid_core::{Instance, TriangleMesh};

use super::shown::Shown;
use super::spheres::Sphere;
use crate::field::Field;
use crate::scene::Scene;
use crate::vector::round;

/// A triangle mesh in two plain arrays, with one more position behind the last one.
///
/// Embree loads sixteen bytes of a twelve-byte position, so the memory after the last one must be
/// there. Everybody else sees the positions alone.
#[derive(Debug)]
pub struct Input {
    padded: Vec<[f32; 3]>,
    indices: Vec<[u32; 3]>,
    shown: Shown,
    instances: Vec<Instance>,
    spheres: Vec<Sphere>,
}

impl Input {
    /// Takes the arrays of a scene.
    #[must_use]
    pub fn new(scene: Scene) -> Self {
        let Scene { positions: mut padded, indices, .. } = scene;
        padded.push([0.0; 3]);
        let (shown, instances, spheres) = (Shown::Mesh, Vec::new(), Vec::new());
        Self { padded, indices, shown, instances, spheres }
    }

    /// Takes the arrays of a scene, and makes its spheres or takes the places of its instances from a field if it
    /// shows them.
    #[must_use]
    pub fn of(scene: Scene, shown: Shown, field: Option<&Field>) -> Self {
        let mut instances = field.map_or_else(Vec::new, |field| field.instances(0.0));
        for instance in &mut instances {
            // Embree takes places in f32: all systems get the same.
            instance.translation = round(instance.translation).map(f64::from);
        }
        let mut input = Self { shown, instances, ..Self::new(scene) };
        if shown == Shown::Spheres {
            input.spheres = input.triangles().map(|triangle| Sphere::of(&triangle)).collect();
        }
        input
    }

    /// Returns what the scene shows.
    #[must_use]
    pub const fn shown(&self) -> Shown {
        self.shown
    }

    /// Returns the instances of the mesh; none if it stands where it is.
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Returns a sphere for each triangle; none unless they are shown.
    #[must_use]
    pub fn spheres(&self) -> &[Sphere] {
        &self.spheres
    }

    /// The vertices. Four bytes behind the last one may be read.
    #[must_use]
    pub fn positions(&self) -> &[[f32; 3]] {
        self.padded.split_last().map_or(&[], |(_, positions)| positions)
    }

    /// Three vertices for each triangle.
    #[must_use]
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.indices
    }

    /// The same for hgrid.
    ///
    /// # Errors
    /// If an index is out of range or there are too many triangles.
    pub fn mesh(&self) -> Result<TriangleMesh<'_>> {
        Ok(TriangleMesh::new(self.positions(), &self.indices)?)
    }

    /// The corners of every triangle, for systems that take no indices.
    #[must_use]
    pub fn triangles(&self) -> impl ExactSizeIterator<Item = [[f32; 3]; 3]> + '_ {
        self.indices.iter().map(|&triangle| triangle.map(|at| self.padded[at as usize]))
    }
}
