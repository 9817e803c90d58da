//! Answers a batch on a tree: in groups of up to 64 rays, which may be sorted first.
//!
//! ```text
//! rays that the caller calls coherent       groups in the order given
//! others                                    windows of rays, sorted by origin and direction (bvh/order.rs):
//!                                           in the memory that the caller lent, or 256 rays on the stack
//! rays that a group hands back              alone
//! a filter, and a hit that it must judge    one ray, from that hit on
//! ```

use core::marker::PhantomData;

use super::{Batch, Coherence, HitAnswer, alone};
use crate::arena::whole;
use crate::bvh::{Bvh, Groups, Scope, SortKey, Together};
use crate::grid::Grid;
use crate::options::{Choice, QueryOptions};
use crate::ray::{Hit, INVALID_ID, Ray};

/// A batch with its grid and its options; `ASKS` is true if the options have a filter.
struct GridBatch<'r, 'm, 'q, B, A, const ASKS: bool> {
    grid: &'r Grid<'m>,
    batch: &'r mut B,
    options: &'r mut QueryOptions<'q>,
    answers: PhantomData<A>,
}

impl<A: HitAnswer, B: Batch<A>, const ASKS: bool> Together for GridBatch<'_, '_, '_, B, A, ASKS> {
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
        alone(self.grid, self.batch, place, self.options);
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
pub(super) fn trace<A: HitAnswer>(
    grid: &Grid<'_>,
    tree: &Bvh<'_>,
    batch: &mut impl Batch<A>,
    coherence: Coherence,
    options: &mut QueryOptions<'_>,
) {
    let answers = PhantomData::<A>;
    let lent = core::mem::take(&mut options.scratch);
    let choice = options.choice();
    // If the filter is asked about every triangle, no hit ends a ray at once: search for the closest, which is asked
    // about first.
    let asked = (choice, A::IS_ANY && !choice.asks_all(grid.mesh()));
    if options.filter.is_none() {
        let batch = &mut GridBatch::<_, A, false> { grid, batch, options, answers };
        in_groups(grid, tree, asked, coherence, lent, batch);
    } else {
        let batch = &mut GridBatch::<_, A, true> { grid, batch, options, answers };
        in_groups(grid, tree, asked, coherence, lent, batch);
    }
    options.scratch = lent;
}

/// Traces rays in groups, in windows that are sorted in memory or as given.
#[inline(always)]
pub(crate) fn in_groups(
    grid: &Grid<'_>,
    bvh: &Bvh<'_>,
    (choice, is_any): (Choice, bool),
    coherence: Coherence,
    lent: &mut [u8],
    batch: &mut impl Together,
) {
    let Scope { mesh, bounds, simd } = grid.scope();
    with_window(coherence, lent, &mut |memory| {
        Groups { bvh, mesh, bounds, choice, memory, batch }.trace(simd, is_any);
    });
}

/// Passes `trace` the memory to sort rays in: what the caller lent, or a little on the stack; none for rays that keep
/// their order.
#[inline(always)]
fn with_window(coherence: Coherence, lent: &mut [u8], trace: &mut dyn FnMut(&mut [SortKey])) {
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
