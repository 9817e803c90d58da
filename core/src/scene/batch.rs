//! Many rays at once in a scene: [`Grid::intersect_n`](crate::Grid::intersect_n) and its like for scenes.
//!
//! A batch answers each ray as [`Scene::intersect`] or [`Scene::occluded`] would, bit for bit. Rays go together
//! through the tree of the scene and through the trees of its objects ([`groups`](super::groups)). With a filter or
//! counters each ray is traced alone, in the order of the rays.

use super::Scene;
use super::query::{SceneAnswer, SceneHit, SceneOptions};
use crate::batch::{Arrays, Batch, Coherence, StridedMut};
use crate::error::Error;
use crate::mesh::Strided;
use crate::ray::RayF64;
use crate::simd::HAS_VECTORS;

impl Scene<'_> {
    /// Finds the closest hit of each ray. `rays` has elements of type [`RayF64`], `hits` as many of type
    /// [`SceneHit`]; a ray without a hit gets [`SceneHit::MISS`]. `coherence` changes the time alone. The options are
    /// for all rays.
    ///
    /// # Errors
    /// [`Error::InvalidBatch`] if a stride is below its element, an array ends before its last
    /// element, or there are not as many hits as rays. Nothing is written then.
    ///
    /// ```
    #[doc = include_str!("../../doc/scene.txt")]
    /// let rays = [0.25, 2.0].map(|x| RayF64::new([x, 0.25, 1.0], [0.0, 0.0, -1.0]));
    /// let mut hits = [SceneHit::MISS; 2];
    /// let (rays, answers) = (Strided::new(&rays), &mut StridedMut::new(&mut hits));
    /// scene.intersect_n_with(&rays, answers, Coherence::Coherent, &mut SceneOptions::default())?;
    /// assert_eq!([hits[0].t, hits[1].t], [1.0, f32::INFINITY]);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn intersect_n_with(
        &self,
        rays: &Strided<'_>,
        hits: &mut StridedMut<'_>,
        coherence: Coherence,
        options: &mut SceneOptions<'_>,
    ) -> Result<(), Error> {
        let mut arrays = Arrays::new::<RayF64, SceneHit>(rays, hits)?;
        self.intersect_batch(&mut arrays, coherence, options);
        Ok(())
    }

    /// The closest hit of each ray: [`intersect_n_with`](Self::intersect_n_with), wherever rays and hits lie.
    pub fn intersect_batch(
        &self,
        batch: &mut impl Batch<SceneHit, RayF64>,
        coherence: Coherence,
        options: &mut SceneOptions<'_>,
    ) {
        trace(self, batch, coherence, options);
    }

    /// Tells for each ray whether it hits anything. `rays` has elements of type [`RayF64`], `occluded` as many bytes: 1
    /// for a hit, 0 for none. `coherence` changes the time alone. The options are for all rays.
    ///
    /// # Errors
    /// The same as of [`intersect_n_with`](Self::intersect_n_with).
    pub fn occluded_n_with(
        &self,
        rays: &Strided<'_>,
        occluded: &mut StridedMut<'_>,
        coherence: Coherence,
        options: &mut SceneOptions<'_>,
    ) -> Result<(), Error> {
        let mut arrays = Arrays::new::<RayF64, bool>(rays, occluded)?;
        self.occluded_batch(&mut arrays, coherence, options);
        Ok(())
    }

    /// Tells for each ray whether it hits anything: [`occluded_n_with`](Self::occluded_n_with), wherever rays and
    /// answers lie.
    pub fn occluded_batch(
        &self,
        batch: &mut impl Batch<bool, RayF64>,
        coherence: Coherence,
        options: &mut SceneOptions<'_>,
    ) {
        trace(self, batch, coherence, options);
    }
}

/// Answers all rays of a batch.
fn trace<A: SceneAnswer>(
    scene: &Scene<'_>,
    batch: &mut impl Batch<A, RayF64>,
    coherence: Coherence,
    options: &mut SceneOptions<'_>,
) {
    #[cfg(feature = "bvh")]
    if HAS_VECTORS
        && options.filter.is_none()
        && options.counters.is_none()
        && let Some(tree) = scene.tree.tree()
    {
        return super::groups::trace(scene, tree, batch, coherence, options);
    }
    for place in 0..batch.count() {
        scene.answer(batch, place, options);
    }
}
