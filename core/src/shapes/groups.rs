//! Batches of rays against shapes, in groups.
//!
//! ```text
//! take up to 64 rays through the tree together
//! a shape whose box some of them meet: test it for each of them, up to its closest hit so far
//! ```

use core::marker::PhantomData;

use super::batch::alone;
use super::{ShapeTest, Shapes, hit_of};
use crate::batch::groups::with_window;
use crate::batch::{Batch, Coherence, HitAnswer};
use crate::bvh::{Bvh, Group, Groups, Scope, SortKey, Together, lanes};
use crate::options::{QueryOptions, Selection};
use crate::ray::{Hit, Ray};
use crate::simd::SimdLevel;

/// Answers all rays of a batch by a test; if it is `true`, any hit is an answer.
pub(super) fn trace<A: HitAnswer, B: Batch<A>>(
    shapes: &Shapes<'_>,
    bvh: &Bvh<'_>,
    batch: &mut B,
    coherence: Coherence,
    options: &mut QueryOptions<'_>,
    (test, is_any): (&mut ShapeTest<'_>, bool),
) {
    let lent = core::mem::take(&mut options.scratch);
    let mut asked = Asked { shapes, batch, options, test, is_any, answers: PhantomData::<A> };
    with_window(coherence, lent, &mut |memory| asked.groups(bvh, memory));
    options.scratch = lent;
}

/// A batch with its shapes and their test.
struct Asked<'r, 'q, 't, B, A> {
    shapes: &'r Shapes<'r>,
    batch: &'r mut B,
    options: &'r mut QueryOptions<'q>,
    test: &'r mut ShapeTest<'t>,
    is_any: bool,
    answers: PhantomData<A>,
}

impl<A: HitAnswer, B: Batch<A>> Asked<'_, '_, '_, B, A> {
    /// Traces rays in groups, in windows that are sorted in memory or as given.
    #[inline(never)]
    fn groups(&mut self, bvh: &Bvh<'_>, memory: &mut [SortKey]) {
        let Scope { mesh, bounds, simd } = self.shapes.grid.scope();
        let (choice, is_any) = (QueryOptions::default().choice(), self.is_any);
        Groups { bvh, mesh, bounds, choice, memory, batch: self }.trace(simd, is_any);
    }
}

impl<A: HitAnswer, B: Batch<A>> Together for Asked<'_, '_, '_, B, A> {
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
        alone(self.shapes, self.batch, place, self.options, (self.test, self.is_any));
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
