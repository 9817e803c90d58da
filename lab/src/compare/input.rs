//! The input that every system gets: a mesh, and the instances or spheres that are shown in its place.

use anyhow::Result;
use hgrid_core::{Instance, TriangleMesh};

use super::shown::Shown;
use super::spheres::Sphere;
use crate::field::Field;
use crate::scene::Scene;
use crate::vector::round;

/// A triangle mesh in two plain arrays, with one more position after the last one. Embree loads sixteen bytes
/// for a position of twelve, so the bytes after the last one must be readable. All other systems see only the
/// positions.
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

    /// Takes the arrays of a scene. If it shows spheres, makes them; if it shows instances, takes their
    /// places from a field.
    #[must_use]
    pub fn of(scene: Scene, shown: Shown, field: Option<&Field>) -> Self {
        let mut instances = field.map_or_else(Vec::new, |field| field.instances(0.0));
        for instance in &mut instances {
            // Embree takes places in f32; all systems get the same ones.
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

    /// Returns the vertices. The four bytes after the last one are readable.
    #[must_use]
    pub fn positions(&self) -> &[[f32; 3]] {
        self.padded.split_last().map_or(&[], |(_, positions)| positions)
    }

    /// Returns three vertices for each triangle.
    #[must_use]
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.indices
    }

    /// Returns the mesh as hgrid takes it.
    ///
    /// # Errors
    /// If an index is out of range or there are too many triangles.
    pub fn mesh(&self) -> Result<TriangleMesh<'_>> {
        Ok(TriangleMesh::new(self.positions(), &self.indices)?)
    }

    /// Returns the corners of every triangle, for systems that take no indices.
    #[must_use]
    pub fn triangles(&self) -> impl ExactSizeIterator<Item = [[f32; 3]; 3]> + '_ {
        self.indices.iter().map(|&triangle| triangle.map(|at| self.padded[at as usize]))
    }
}
