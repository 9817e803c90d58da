//! Starts the traversals of a tree: a ray against triangles, a ray with an f64 origin against boxes, a point.
//!
//! ```text
//! ray     near the scene      traverse at once
//!         farther away        move the origin to the scene first (approach.rs), then traverse
//!         remote              test all triangles: distances in f32 would say nothing
//! point   traverse, nearest boxes first (nearest.rs)
//! ```

use super::Bvh;
use super::nearest::ClosestSearch;
use super::slab::Slab;
use super::walk::OneRay;
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
        part: [f32; 2],
        cull: Cull,
        search: &mut F,
        tally: &mut T,
    ) {
        if self.walk(scope, ray, part, cull, None, search, tally) {
            return;
        }
        let Some(approach) = Approach::new(ray, &scope.bounds) else { return };
        let test = TriangleTest::from(ray, &approach).culling(cull);
        if approach.is_remote {
            return test_all(scope.mesh, &test, search, tally);
        }
        let afar = (Slab::new(ray, part, &approach), test.filter);
        self.walk(scope, ray, part, cull, Some(&afar), search, tally);
    }

    /// Walks a ray whose origin is given in f64 through a tree of boxes, and offers a search those that it
    /// meets.
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
        let afar = (Slab::along(ray, &approach, scale), RayFilter::NONE);
        self.walk(scope, ray, [t_min, t_max], Cull::None, Some(&afar), search, counters);
    }

    /// Walks a ray through the tree; false if it starts too far away and needs an [`Approach`].
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "each is its own")]
    fn walk<F: Search, T: Tally>(
        &self,
        scope: &Scope<'_>,
        ray: &Ray,
        part: [f32; 2],
        cull: Cull,
        afar: Option<&(Slab, RayFilter)>,
        search: &mut F,
        tally: &mut T,
    ) -> bool {
        let Scope { mesh, bounds, simd } = scope;
        self.with_stack(
            #[inline(always)]
            |stack| {
                let bvh = self;
                let mut ray =
                    OneRay { bvh, mesh, ray, part, cull, bounds, afar, search, tally, stack };
                dispatch(*simd, &mut ray)
            },
        )
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
