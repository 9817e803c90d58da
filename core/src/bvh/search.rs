//! Starts the traversals of a tree: a ray against triangles, a ray with an f64 origin against boxes, a point.
//!
//! ```text
//! ray     near the tree       traverse at once
//!         farther away        move the origin to the tree first (approach.rs), then traverse
//!         remote              test all triangles: distances in f32 would say nothing
//! point   traverse, nearest boxes first (nearest.rs)
//! ```

use super::Bvh;
use super::nearest::ClosestSearch;
use super::slab::SlabRay;
use super::stack::{FIRST_STACK, StackEntry};
use super::walk::{OneRay, Walk, Walked};
use crate::aabb::Aabb;
use crate::approach::{Approach, LineF64};
use crate::counters::{Counters, Tally};
use crate::filter::RayFilter;
use crate::mesh::TriangleMesh;
use crate::options::Cull;
use crate::ray::{Ray, RayF64, round};
use crate::search::{BoxSearch, Search, test_all};
use crate::simd::{SimdLevel, dispatch};
use crate::triangle::TriangleTest;

/// The mesh, its box and the vector instructions: what a traversal needs besides the tree.
pub(crate) struct Scope<'m> {
    pub(crate) mesh: &'m TriangleMesh<'m>,
    pub(crate) bounds: Aabb,
    pub(crate) simd: SimdLevel,
}

impl Bvh<'_> {
    /// Walks a ray through the tree and passes its hits to a search.
    #[inline(always)]
    pub(crate) fn search<F: Search, T: Tally>(
        &self,
        scope: &Scope<'_>,
        ray: &Ray,
        interval: [f32; 2],
        cull: Cull,
        search: &mut F,
        tally: &mut T,
    ) {
        if self.walk(scope, ray, interval, cull, None, search, tally) {
            return;
        }
        let Some(approach) = Approach::new(ray, &scope.bounds) else { return };
        let test = TriangleTest::from(ray, &approach).culling(cull);
        if approach.is_remote {
            return test_all(scope.mesh, &test, search, tally);
        }
        let afar = (SlabRay::new(ray, interval, &approach), test.filter);
        self.walk(scope, ray, interval, cull, Some(&afar), search, tally);
    }

    /// Walks a ray whose origin is given in f64 through a tree of boxes, and offers a search those that it meets.
    pub(crate) fn search_boxes(
        &self,
        scope: &Scope<'_>,
        ray: &RayF64,
        search: &mut BoxSearch<'_>,
        counters: &mut Counters,
    ) {
        let narrow = &ray.rounded();
        if ray.is_exact() {
            let range = [ray.t_min, ray.t_max];
            return self.search(scope, narrow, range, Cull::None, search, counters);
        }
        if !narrow.is_valid() {
            return;
        }
        self.search_boxes_along(scope, &ray.into(), 1.0, [ray.t_min, ray.t_max], search, counters);
    }

    /// [`search_boxes`](Self::search_boxes) along a line. A `t` of the range or of a hit is `scale` times as large
    /// along the line.
    pub(crate) fn search_boxes_along(
        &self,
        scope: &Scope<'_>,
        line: &LineF64,
        scale: f64,
        [t_min, t_max]: [f32; 2],
        search: &mut BoxSearch<'_>,
        counters: &mut Counters,
    ) {
        // An origin beyond the range of f32 is remote: clamp it.
        let most = f64::from(f32::MAX);
        let origin = line.origin.map(|c| round(c.clamp(-most, most)));
        let ray = &Ray { origin, t_min, direction: line.direction.map(round), t_max };
        let Some(approach) = Approach::of_line(ray, line, &scope.bounds) else { return };
        if approach.is_remote {
            return test_all(scope.mesh, &TriangleTest::from(ray, &approach), search, counters);
        }
        let afar = (SlabRay::along(ray, &approach, scale), RayFilter::NONE);
        self.walk(scope, ray, [t_min, t_max], Cull::None, Some(&afar), search, counters);
    }

    /// Walks a ray through the tree; false if it starts too far away and needs an [`Approach`].
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "each is its own")]
    fn walk<F: Search, T: Tally>(
        &self,
        scope: &Scope<'_>,
        ray: &Ray,
        interval: [f32; 2],
        cull: Cull,
        afar: Option<&(SlabRay, RayFilter)>,
        search: &mut F,
        tally: &mut T,
    ) -> bool {
        let Scope { mesh, bounds, simd } = scope;
        let (bvh, resume) = (self, None);
        let one =
            &mut OneRay { bvh, mesh, ray, interval, cull, bounds, afar, search, tally, resume };
        let mut stack = [0; FIRST_STACK];
        match walk_on(one, *simd, &mut stack) {
            Walked::Through => true,
            Walked::TooFar => false,
            Walked::Full => {
                walk_deep(one, *simd, &stack);
                true
            }
        }
    }

    /// Passes `test` the triangles that may lie within a distance of a point, roughly nearest first. `test` returns the
    /// distance within which triangles matter from then on.
    #[inline(always)]
    pub(crate) fn nearest<T: Tally>(
        &self,
        scope: &Scope<'_>,
        point: [f32; 3],
        within: f32,
        test: impl FnMut(u32) -> f32,
        tally: &mut T,
    ) {
        let Scope { mesh, bounds, simd } = scope;
        self.with_stack(
            #[inline(always)]
            |stack| {
                let bvh = self;
                let mut nearest =
                    ClosestSearch { bvh, mesh, bounds, point, within, test, tally, stack };
                dispatch(*simd, &mut nearest);
            },
        );
    }
}

/// Begins or resumes a walk. Out of line, so that a program has its code once.
#[inline(never)]
fn walk_on<F: Search, T: Tally>(
    one: &mut OneRay<'_, F, T>,
    simd: SimdLevel,
    stack: &mut [StackEntry],
) -> Walked {
    dispatch(simd, &mut Walk { one, stack })
}

/// Resumes a walk with a stack that is large enough for the tree.
#[cold]
#[inline(never)]
fn walk_deep<F: Search, T: Tally>(
    one: &mut OneRay<'_, F, T>,
    simd: SimdLevel,
    begun: &[StackEntry; FIRST_STACK],
) {
    one.bvh.with_stack(|stack| {
        if let Some(first) = stack.first_chunk_mut() {
            *first = *begun;
        }
        // A tree never fills this stack. Damaged bytes may, and then the walk ends.
        walk_on(one, simd, stack);
    });
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::*;
    use crate::arena::Block;
    use crate::bvh::stack::STACK;
    use crate::config::Config;
    use crate::grid::Grid;
    use crate::random::point;
    use crate::ray::Hit;
    use crate::search::One;

    #[test]
    fn a_walk_resumes_where_its_stack_was_full() {
        let mut state = 1;
        // Long triangles: their boxes overlap, so many children of a node are met.
        let count = if cfg!(miri) { 60 } else { 6000 };
        let positions: Vec<_> = (0..3 * count).map(|_| point(&mut state).to_array()).collect();
        let indices: Vec<_> = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let mut memory = [(); 2].map(|()| vec![Block::ZERO; 20_000]);
        let [index, scratch] = memory.each_mut().map(|blocks| Block::bytes_mut(blocks));
        let grid = Grid::build(mesh, &Config::default(), index, scratch).unwrap();
        let (scope, bvh) = (grid.scope(), grid.tree().unwrap());

        let mut most = 0;
        for _ in 0..if cfg!(miri) { 3 } else { 300 } {
            let ray = &Ray::new(point(&mut state).to_array(), point(&mut state).to_array());
            // Make room for one child more each time that the stack is full.
            let walk = |room: usize| {
                let mut one = One { hit: Hit::MISS, is_any: false };
                let mut counters = Counters::default();
                let mut walk = OneRay {
                    bvh,
                    mesh: scope.mesh,
                    ray,
                    interval: [0.0, f32::INFINITY],
                    cull: Cull::None,
                    bounds: &scope.bounds,
                    afar: None,
                    search: &mut one,
                    tally: &mut counters,
                    resume: None,
                };
                let mut stack = vec![0; room];
                let mut resumed = 0;
                while walk_on(&mut walk, scope.simd, &mut stack) == Walked::Full {
                    stack.push(0);
                    resumed += 1;
                }
                (one.hit, counters, resumed)
            };
            let (hit, counters, resumed) = walk(7);
            let (expected, expected_counters, none) = walk(STACK);
            assert_eq!((hit, counters, none), (expected, expected_counters, 0), "{ray:?}");
            assert_eq!(grid.intersect(ray).unwrap_or(Hit::MISS), expected);
            most = most.max(resumed);
        }
        // Some rays of queries are resumed, too.
        assert!(cfg!(miri) || 7 + most > FIRST_STACK, "{most}");
    }
}
