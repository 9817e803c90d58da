//! Batches on a tree, in groups of rays.

use core::marker::PhantomData;

use super::{Batch, Coherence, GridAnswer, alone};
use crate::arena::whole;
use crate::bvh::{Bvh, Groups, Scope, SortKey, Together};
use crate::grid::Grid;
use crate::options::QueryOptions;
use crate::ray::{Hit, INVALID_ID, Ray};

/// A batch with its grid and its options; `ASKS` is true if the options have a filter.
struct Asked<'r, 'm, 'q, B, A, const ASKS: bool> {
    grid: &'r Grid<'m>,
    tree: &'r Bvh<'m>,
    batch: &'r mut B,
    options: &'r mut QueryOptions<'q>,
    /// True if the options change nothing.
    is_plain: bool,
    answers: PhantomData<A>,
}

impl<A: GridAnswer, B: Batch<A>, const ASKS: bool> Together for Asked<'_, '_, '_, B, A, ASKS> {
    #[inline(always)]
    fn count(&self) -> usize {
        self.batch.count()
    }

    #[inline(always)]
    fn ray(&self, place: usize) -> Ray {
        self.batch.ray(place)
    }

    #[inline(always)]
    fn found(&mut self, place: usize, _: usize, hit: &Hit) {
        self.batch.answer(place, A::of(hit));
    }

    #[inline(always)]
    fn alone(&mut self, place: usize) {
        alone(self.grid, self.batch, place, self.is_plain, self.options);
    }

    #[inline(always)]
    fn keeps_order(&self) -> bool {
        ASKS
    }

    #[inline(always)]
    fn asks(&self, hit: &Hit) -> bool {
        let (id, mesh) = (hit.primitive, self.grid.mesh());
        ASKS && id != INVALID_ID && self.options.choice().asks(mesh, id)
    }

    #[inline(never)]
    fn ask(&mut self, place: usize, hit: &Hit) {
        if ASKS {
            let ray = self.batch.ray(place);
            let found = self.grid.intersect_from(place, &ray, self.options, hit);
            self.batch.answer(place, A::of(&found.unwrap_or(Hit::MISS)));
        }
    }
}

/// Rays of a window that is sorted on the stack.
const FEW: usize = 256;

/// Answers all rays of a batch.
#[inline(always)]
pub(super) fn trace<A: GridAnswer, const ANY: bool>(
    grid: &Grid<'_>,
    tree: &Bvh<'_>,
    batch: &mut impl Batch<A>,
    coherence: Coherence,
    options: &mut QueryOptions<'_>,
) {
    let (is_plain, answers) = (options.are_plain(), PhantomData::<A>);
    let lent = core::mem::take(&mut options.scratch);
    if options.filter.is_none() {
        let mut asked = Asked::<_, A, false> { grid, tree, batch, options, is_plain, answers };
        with_window(coherence, lent, &mut |memory| asked.groups::<ANY>(memory));
    } else {
        let mut asked = Asked::<_, A, true> { grid, tree, batch, options, is_plain, answers };
        with_window(coherence, lent, &mut |memory| asked.groups::<ANY>(memory));
    }
    options.scratch = lent;
}

/// Passes `trace` the memory to sort rays in: what the caller lent, or a little on the stack; none for rays that keep
/// their order.
#[inline(always)]
pub(crate) fn with_window(
    coherence: Coherence,
    lent: &mut [u8],
    trace: &mut dyn FnMut(&mut [SortKey]),
) {
    if coherence == Coherence::Coherent {
        return trace(&mut []);
    }
    let start = lent.as_ptr().align_offset(align_of::<SortKey>());
    let memory = whole::<SortKey>(lent.get_mut(start..).unwrap_or_default());
    if memory.len() < 2 * FEW { with_few(trace) } else { trace(memory) }
}

/// Out of line: the window takes stack only where it is wanted.
#[inline(never)]
fn with_few(trace: &mut dyn FnMut(&mut [SortKey])) {
    trace(&mut [0; 2 * FEW]);
}

impl<A: GridAnswer, B: Batch<A>, const ASKS: bool> Asked<'_, '_, '_, B, A, ASKS> {
    /// Traces rays in groups, in windows that are sorted in memory or as given.
    #[inline(never)]
    fn groups<const ANY: bool>(&mut self, memory: &mut [SortKey]) {
        let Scope { mesh, bounds, simd } = self.grid.scope();
        let (bvh, choice) = (self.tree, self.options.choice());
        // If no hit can end a ray unasked, the first one is sooner found as the closest.
        let is_any = ANY && !choice.asks_all(mesh);
        Groups { bvh, mesh, bounds, choice, memory, batch: self }.trace(simd, is_any);
    }
}
