//! The searches of queries: they keep the closest hit of a traversal, stop at the first, or collect the
//! nearest in order.
//!
//! The traversal passes each hit to a [`Search`], roughly from near to far, and repeats a triangle that lies
//! in several cells. The search returns where the ray ends from then on.

use crate::counters::Tally;
use crate::limits::MAX_COORDINATE;
use crate::mesh::TriangleMesh;
use crate::options::Selection;
use crate::ray::{Hit, INVALID_ID};
use crate::triangle::TriangleTest;

/// The outcome of showing a hit to a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// The search goes on as before.
    Unchanged,
    /// Nothing behind this `t` matters any more.
    EndsAt(f32),
    /// The search is over.
    Done,
}

/// Receives the hits of a traversal.
pub(crate) trait Search {
    /// True if leaves hold boxes of the caller's shapes, which the traversal offers, and not triangles, which it tests.
    const OF_BOXES: bool = false;

    /// Receives a hit and tells where the ray ends.
    fn show(&mut self, hit: Hit) -> Outcome;

    /// Takes a shape whose box the ray meets.
    #[inline(always)]
    fn offer(&mut self, _: u32) -> Outcome {
        Outcome::Unchanged
    }

    /// Tests a triangle that passed the filter, and shows the hit if there is one.
    #[inline(always)]
    fn decide(&mut self, test: &TriangleTest, mesh: &TriangleMesh<'_>, id: u32) -> Outcome {
        self.decided(test.decide(mesh, id))
    }

    /// Receives the result of a triangle's test: a hit or [`Hit::MISS`].
    #[inline(always)]
    fn decided(&mut self, hit: Hit) -> Outcome {
        if hit.primitive == INVALID_ID { Outcome::Unchanged } else { self.show(hit) }
    }
}

/// One hit: the closest, and where several are equally close, that of the triangle with the lowest id; or any.
#[derive(Debug)]
pub(crate) struct One {
    /// The hit so far. Before the first it is a miss, whose `t` is the end.
    pub(crate) hit: Hit,
    pub(crate) is_any: bool,
}

impl Search for One {
    #[inline(always)]
    fn show(&mut self, hit: Hit) -> Outcome {
        if !hit.is_closer(&self.hit) {
            return Outcome::Unchanged;
        }
        self.hit = hit;
        if self.is_any { Outcome::Done } else { Outcome::EndsAt(hit.t) }
    }
}

/// Any other search for triangles. It is called through a pointer, because a traversal is compiled once for each type
/// of search and takes 10 KB each time.
pub(crate) struct TriangleSearch<'s>(pub(crate) &'s mut dyn FnMut(Hit) -> Outcome);

impl Search for TriangleSearch<'_> {
    #[inline(always)]
    fn show(&mut self, hit: Hit) -> Outcome {
        (self.0)(hit)
    }
}

/// Any search for boxes: gets the number of each that the ray meets.
pub(crate) struct BoxSearch<'s>(pub(crate) &'s mut dyn FnMut(u32) -> Outcome);

impl Search for BoxSearch<'_> {
    const OF_BOXES: bool = true;

    #[inline(always)]
    fn show(&mut self, _: Hit) -> Outcome {
        Outcome::Unchanged
    }

    #[inline(always)]
    fn offer(&mut self, id: u32) -> Outcome {
        (self.0)(id)
    }
}

/// The nearest hits in order, as many as there is room for, each triangle once. Only hits behind `after` count whose
/// `t` is no more than `until`, and only triangles of the selection.
#[derive(Debug)]
pub(crate) struct NearestHits<'q> {
    pub(crate) selection: &'q Selection<'q>,
    pub(crate) after: Option<Hit>,
    pub(crate) until: f32,
    pub(crate) hits: &'q mut [Hit],
    /// Number of hits in `hits`.
    pub(crate) count: usize,
    /// True if the search ends once the room is full, with any hits.
    pub(crate) is_any: bool,
}

/// The nearest hits of a tree, which shows each triangle once, and how many hits there are.
#[derive(Debug)]
pub(crate) struct AllHits<'q> {
    pub(crate) selection: &'q Selection<'q>,
    /// The nearest so far as a heap, the farthest first.
    pub(crate) hits: &'q mut [Hit],
    pub(crate) count: usize,
}

impl AllHits<'_> {
    /// Sorts the hits that there was room for, each triangle once.
    pub(crate) fn sort(&mut self) {
        let count = self.count.min(self.hits.len());
        let heap = self.hits.get_mut(..count).unwrap_or_default();
        for last in (1..heap.len()).rev() {
            if let Some((end, rest)) = heap.get_mut(..=last).and_then(<[Hit]>::split_last_mut)
                && let Some(first) = rest.first_mut()
            {
                core::mem::swap(first, end);
                sift_down(rest);
            }
        }
        // Damaged bytes may show a triangle again: keep it once.
        let mut kept = 0_usize;
        for at in 0..heap.len() {
            let Some(&hit) = heap.get(at) else { break };
            let before = kept.checked_sub(1).and_then(|before| heap.get(before));
            if before.is_some_and(|before| before.primitive == hit.primitive) {
                continue;
            }
            if let Some(slot) = heap.get_mut(kept) {
                *slot = hit;
            }
            kept += 1;
        }
        if kept < count {
            self.count = kept;
        }
    }

    /// Takes a hit.
    pub(crate) fn show(&mut self, hit: Hit) -> Outcome {
        if !self.selection.has(hit.primitive) {
            return Outcome::Unchanged;
        }
        let mut place = self.count;
        self.count += 1;
        if place >= self.hits.len() {
            // The farthest falls out.
            if let Some(farthest) = self.hits.first_mut().filter(|first| hit.is_closer(first)) {
                *farthest = hit;
                sift_down(self.hits);
            }
            return Outcome::Unchanged;
        }
        // Move parents down that are closer.
        while place > 0
            && let Some(&parent) = self.hits.get((place - 1) / 2)
            && parent.is_closer(&hit)
        {
            if let Some(slot) = self.hits.get_mut(place) {
                *slot = parent;
            }
            place = (place - 1) / 2;
        }
        if let Some(slot) = self.hits.get_mut(place) {
            *slot = hit;
        }
        Outcome::Unchanged
    }
}

/// Moves the first hit of a heap down to its place.
fn sift_down(heap: &mut [Hit]) {
    let Some(&hit) = heap.first() else { return };
    let mut place = 0;
    // A hit takes 16 bytes, so the place of a child does not overflow.
    while let Some(&left) = heap.get(2 * place + 1) {
        let (mut at, mut child) = (2 * place + 1, left);
        if let Some(&right) = heap.get(at + 1).filter(|right| child.is_closer(right)) {
            (at, child) = (at + 1, right);
        }
        if !hit.is_closer(&child) {
            break;
        }
        if let Some(slot) = heap.get_mut(place) {
            *slot = child;
        }
        place = at;
    }
    if let Some(slot) = heap.get_mut(place) {
        *slot = hit;
    }
}

impl NearestHits<'_> {
    /// Takes a hit.
    pub(crate) fn show(&mut self, hit: Hit) -> Outcome {
        let is_behind = self.after.is_none_or(|after| after.is_closer(&hit));
        if !is_behind || hit.t > self.until || !self.selection.has(hit.primitive) {
            return Outcome::Unchanged;
        }
        let found = self.hits.get(..self.count).unwrap_or_default();
        let place = found.partition_point(|other| other.is_closer(&hit));
        // The same triangle has the same `t`, to the bit, in whichever cell the ray meets it.
        if found.get(place).is_some_and(|other| other.primitive == hit.primitive) {
            return Outcome::Unchanged;
        }
        // Hits behind it move on by one; the last falls out if there is no room.
        self.count = (self.count + 1).min(self.hits.len());
        let mut moved = hit;
        for slot in self.hits.iter_mut().take(self.count).skip(place) {
            core::mem::swap(slot, &mut moved);
        }
        if self.count < self.hits.len() {
            return Outcome::Unchanged;
        }
        match self.hits.last() {
            Some(last) if !self.is_any => Outcome::EndsAt(last.t),
            _ => Outcome::Done,
        }
    }
}

/// Tests all triangles of the mesh, one by one.
#[cold]
#[inline(never)]
pub(crate) fn test_all<F: Search, T: Tally>(
    mesh: &TriangleMesh<'_>,
    test: &TriangleTest,
    search: &mut F,
    tally: &mut T,
) {
    for_finite(mesh, &mut |id| {
        tally.primitive_test();
        if F::OF_BOXES { search.offer(id) } else { search.decide(test, mesh, id) }
    });
}

/// Calls `ask` with each finite triangle, which are those in the structure, until the search is over. `ask` is a
/// pointer, so that this is compiled once.
#[cold]
#[inline(never)]
fn for_finite(mesh: &TriangleMesh<'_>, ask: &mut dyn FnMut(u32) -> Outcome) {
    for id in 0..mesh.triangle_count() {
        let is_finite = |corner: &[f32; 3]| corner.iter().all(|c| c.abs() <= MAX_COORDINATE);
        let is_there = mesh.triangle(id).is_some_and(|triangle| triangle.iter().all(is_finite));
        if is_there && ask(id) == Outcome::Done {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::arena::Block;
    use crate::config::Config;
    use crate::counters::Counters;
    use crate::grid::Grid;
    use crate::method::Method;
    use crate::options::{Cull, QueryOptions};
    use crate::random::point;
    use crate::ray::Ray;

    /// A plain query counts nothing, so no other test would see that its rays do not end at their hits.
    #[test]
    fn plain_rays_end_at_their_hits() {
        let mut state = 1;
        let count = if cfg!(miri) { 60 } else { 3000 };
        let positions: Vec<_> = (0..count)
            .flat_map(|_| {
                let middle = point(&mut state);
                [(); 3].map(|()| (middle + 0.1 * point(&mut state)).to_array())
            })
            .collect();
        let indices: Vec<_> = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        for &method in Method::ALL {
            let mut memory = [(); 2].map(|()| vec![Block::ZERO; 100_000]);
            let [index, scratch] = memory.each_mut().map(|blocks| Block::bytes_mut(blocks));
            let grid = Grid::build(mesh, &Config::new(method), index, scratch).unwrap();
            let mut sums = [0; 2];
            for _ in 0..if cfg!(miri) { 3 } else { 300 } {
                let ray = &Ray::new(point(&mut state).to_array(), point(&mut state).to_array());
                let [closest, any] = [false, true].map(|is_any| {
                    let mut one = One { hit: Hit { t: ray.t_max, ..Hit::MISS }, is_any };
                    let (mut work, interval) = (Counters::default(), [ray.t_min, ray.t_max]);
                    grid.search(ray, interval, Cull::None, &mut one, &mut work);
                    (one.hit.primitive != INVALID_ID, work)
                });
                let mut counted = Counters::default();
                let mut options = QueryOptions::counting(&mut counted);
                let is_hit = grid.intersect_with(ray, &mut options).is_some();
                assert_eq!((closest.0, any.0), (is_hit, is_hit), "{method:?} {ray:?}");
                let of = |work: &Counters| [work.primitive_tests, work.cell_steps, work.grid_steps];
                for [any, closest, counted] in
                    [0, 1, 2].map(|i| [&any.1, &closest.1, &counted].map(|work| of(work)[i]))
                {
                    assert!(any <= closest && closest <= counted, "{method:?} {ray:?}");
                }
                sums[0] += any.1.primitive_tests;
                sums[1] += closest.1.primitive_tests;
            }
            assert!(cfg!(miri) || sums[0] < sums[1], "{method:?}: {sums:?}");
        }
    }
}
