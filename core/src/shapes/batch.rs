//! Many rays at once against shapes: [`Grid::intersect_n`](crate::Grid::intersect_n) and its like for shapes.
//!
//! A batch answers each ray as [`Shapes::intersect`] or [`Shapes::occluded`] would, bit for bit. Rays go through the
//! tree together ([`groups`](super::groups)); with counters each is traced alone.

use super::{ShapeTest, Shapes};
use crate::batch::{Arrays, Batch, Coherence, HitAnswer, StridedMut};
use crate::error::Error;
use crate::mesh::Strided;
use crate::options::QueryOptions;
use crate::ray::{Hit, Ray};
use crate::simd::HAS_VECTORS;

impl Shapes<'_> {
    /// The closest hit of each ray; [`Hit::MISS`] where there is none. The options are for all rays.
    ///
    /// # Errors
    /// The errors of [`Grid::intersect_n`](crate::Grid::intersect_n).
    ///
    /// ```
    #[doc = include_str!("../../doc/shapes.txt")]
    /// let rays = [0.0, 3.0].map(|x| Ray::new([x, 0.0, 2.0], [0.0, 0.0, -1.0]));
    /// let mut hits = [Hit::MISS; 2];
    /// let (rays, answers) = (Strided::new(&rays), &mut StridedMut::new(&mut hits));
    /// // The middle of each box is in the way, whatever its shape.
    /// let mut middle = |_, _: &Ray| Some(ShapeHit { t: 2.0, u: 0.0, v: 0.0 });
    /// let options = &mut QueryOptions::default();
    /// shapes.intersect_n_with(&rays, answers, Coherence::Coherent, options, &mut middle)?;
    /// assert_eq!([hits[0].t, hits[1].t], [2.0, f32::INFINITY]);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn intersect_n_with(
        &self,
        rays: &Strided<'_>,
        hits: &mut StridedMut<'_>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
        test: &mut ShapeTest<'_>,
    ) -> Result<(), Error> {
        let mut arrays = Arrays::new::<Ray, Hit>(rays, hits)?;
        self.intersect_batch(&mut arrays, coherence, options, test);
        Ok(())
    }

    /// The closest hit of each ray: [`intersect_n_with`](Self::intersect_n_with), wherever rays and hits lie.
    pub fn intersect_batch(
        &self,
        batch: &mut impl Batch<Hit>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
        test: &mut ShapeTest<'_>,
    ) {
        trace(self, batch, coherence, options, test);
    }

    /// For each ray a byte: 1 if any shape is hit, 0 if not. The options are for all rays.
    ///
    /// # Errors
    /// The errors of [`intersect_n_with`](Self::intersect_n_with).
    pub fn occluded_n_with(
        &self,
        rays: &Strided<'_>,
        occluded: &mut StridedMut<'_>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
        test: &mut ShapeTest<'_>,
    ) -> Result<(), Error> {
        let mut arrays = Arrays::new::<Ray, bool>(rays, occluded)?;
        self.occluded_batch(&mut arrays, coherence, options, test);
        Ok(())
    }

    /// Tells for each ray whether it hits any shape: [`occluded_n_with`](Self::occluded_n_with), wherever rays and
    /// answers lie.
    pub fn occluded_batch(
        &self,
        batch: &mut impl Batch<bool>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
        test: &mut ShapeTest<'_>,
    ) {
        trace(self, batch, coherence, options, test);
    }
}

/// Answers all rays of a batch by a test.
fn trace<A: HitAnswer>(
    shapes: &Shapes<'_>,
    batch: &mut impl Batch<A>,
    coherence: Coherence,
    options: &mut QueryOptions<'_>,
    test: &mut ShapeTest<'_>,
) {
    #[cfg(feature = "bvh")]
    if HAS_VECTORS
        && !options.are_for_single_rays()
        && let Some(tree) = shapes.grid.tree()
    {
        return super::groups::trace(shapes, tree, batch, coherence, options, test);
    }
    for place in 0..batch.count() {
        shapes.answer(batch, place, options, test);
    }
}
