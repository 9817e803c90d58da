//! The mesh, and its instances if there are any, as every system gets them.

use anyhow::Result;
use hgrid_core::{Instance, TriangleMesh};

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
    instances: Vec<Instance>,
}

impl Input {
    /// Takes the arrays of a scene.
    #[must_use]
    pub fn new(scene: Scene) -> Self {
        let Scene { positions: mut padded, indices, .. } = scene;
        padded.push([0.0; 3]);
        Self { padded, indices, instances: Vec::new() }
    }

    /// Takes the arrays of a scene that a field shows many times, or once and as it is without a field.
    #[must_use]
    pub fn of_field(scene: Scene, field: Option<&Field>) -> Self {
        let mut instances = field.map_or_else(Vec::new, |field| field.instances(0.0));
        for instance in &mut instances {
            // Embree takes places in f32: all systems get the same.
            instance.translation = round(instance.translation).map(f64::from);
        }
        Self { instances, ..Self::new(scene) }
    }

    /// Returns the instances of the mesh; none if it stands where it is.
    #[must_use]
    pub fn instances(&self) -> &[Instance] {
        &self.instances
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
