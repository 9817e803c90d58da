//! Batches of rays against shapes, in groups.
//!
//! ```text
//! take up to 64 rays through the tree together
//! a shape whose box some of them meet: test it for each of them, up to its closest hit so far
//! ```

use core::marker::PhantomData;

use super::{ShapeTest, Shapes, hit_of};
use crate::batch::groups::in_groups;
use crate::batch::{Batch, Coherence, HitAnswer};
use crate::bvh::{Bvh, Group, Together, lanes};
use crate::options::{QueryOptions, Selection};
use crate::ray::{Hit, Ray};
use crate::simd::SimdLevel;

/// Answers all rays of a batch by a test.
pub(super) fn trace<A: HitAnswer, B: Batch<A>>(
    shapes: &Shapes<'_>,
    bvh: &Bvh<'_>,
    batch: &mut B,
    coherence: Coherence,
    options: &mut QueryOptions<'_>,
    test: &mut ShapeTest<'_>,
) {
    let lent = core::mem::take(&mut options.scratch);
    let asked = (QueryOptions::default().choice(), A::IS_ANY);
    let batch = &mut ShapesBatch { shapes, batch, options, test, answers: PhantomData::<A> };
    in_groups(&shapes.grid, bvh, asked, coherence, lent, batch);
    options.scratch = lent;
}

/// A batch with its shapes and their test.
struct ShapesBatch<'r, 'q, 't, B, A> {
    shapes: &'r Shapes<'r>,
    batch: &'r mut B,
    options: &'r mut QueryOptions<'q>,
    test: &'r mut ShapeTest<'t>,
    answers: PhantomData<A>,
}

impl<A: HitAnswer, B: Batch<A>> Together for ShapesBatch<'_, '_, '_, B, A> {
    fn count(&self) -> usize {
        self.batch.count()
    }

    fn ray(&self, place: usize) -> Ray {
        self.batch.ray(place)
    }

    fn trace(&mut self, group: &mut Group<'_>, level: SimdLevel, is_any: bool) -> u64 {
        let selection = Selection::new(self.shapes.grid.mesh(), self.options);
        offer_shapes(group, level, is_any, &selection, self.test)
    }

    fn found(&mut self, place: usize, _: usize, hit: &Hit) {
        self.batch.answer(place, A::of(hit));
    }

    fn alone(&mut self, place: usize) {
        self.shapes.answer(self.batch, place, self.options, self.test);
    }
}

/// Finds a hit of each ray of a group in a tree of shapes. Returns what [`Group::trace`] returns.
pub(crate) fn offer_shapes(
    group: &mut Group<'_>,
    level: SimdLevel,
    is_any: bool,
    selection: &Selection<'_>,
    test: &mut ShapeTest<'_>,
) -> u64 {
    group.offer(level, is_any, &mut |id, mask, rays| {
        if !selection.has(id) {
            return;
        }
        for lane in lanes(mask) {
            if let Some(hit) = hit_of(id, &rays.rest(lane), test) {
                rays.keep(lane, hit, is_any);
            }
        }
    })
}
