//! Queries of one ray that take options.
//!
//! The triangle test culls; masks and the triangle to skip are looked up when a ray hits. A filter gets the hits from
//! near to far, and each triangle at most once. No traversal finds hits in exact order, and one through cells repeats
//! triangles, so a walk collects a few nearest hits in order and passes them to the filter. If the filter rejects them
//! all, the next walk starts at the last of them. For a closest hit, the first walk collects one hit, the next two,
//! then four: a filter that accepts the first hit costs no further walk.

use crate::counters::Counters;
use crate::grid::Grid;
use crate::options::{QueryOptions, Selection, Verdict};
use crate::ray::{Hit, Ray};
use crate::search::{AllHits, NearestHits, TriangleSearch};
use crate::simd::IS_SMALL;

/// The most hits that a walk collects.
const ROOM: usize = 16;

impl Grid<'_> {
    /// The closest hit of a ray, of those that the options let count.
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
    /// let hit = grid.intersect(&ray).expect("in front of the camera");
    ///
    /// // Leave the surface: the triangle itself is named, and needs no epsilon.
    /// let from = Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]);
    /// let mut options = QueryOptions { skip: hit.primitive, ..QueryOptions::default() };
    /// assert!(grid.occluded(&from) && !grid.occluded_with(&from, &mut options));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn intersect_with(&self, ray: &Ray, options: &mut QueryOptions<'_>) -> Option<Hit> {
        self.intersect_at((0, ray), ray.t_max, options)
    }

    /// [`intersect_with`](Self::intersect_with) for the ray at a place of a batch, if the `t` of the hit is no more
    /// than `until`.
    pub(crate) fn intersect_at(
        &self,
        (place, ray): (usize, &Ray),
        until: f32,
        options: &mut QueryOptions<'_>,
    ) -> Option<Hit> {
        // Save flash as `intersect` does.
        if options.are_plain() && !IS_SMALL {
            return self.closest_hit(ray, until);
        }
        self.intersect_behind((place, ray), until, options, None, 1)
    }

    /// [`intersect_at`](Self::intersect_at) for a ray whose first hit is known: the filter is asked about it first.
    pub(crate) fn intersect_from(
        &self,
        place: usize,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
        first: &Hit,
    ) -> Option<Hit> {
        let verdict = options.filter.as_mut().map(|filter| filter(place, first));
        if verdict == Some(Verdict::Reject) {
            return self.intersect_behind((place, ray), ray.t_max, options, Some(*first), 2);
        }
        Some(*first)
    }

    /// The first hit behind `after` that counts, up to `until`. The first walk collects `room` hits.
    fn intersect_behind(
        &self,
        ray: (usize, &Ray),
        until: f32,
        options: &mut QueryOptions<'_>,
        after: Option<Hit>,
        room: usize,
    ) -> Option<Hit> {
        let mut closest = None;
        self.in_order(ray, until, options, after, room, |hit| {
            closest = Some(*hit);
            false
        });
        closest
    }

    /// Returns true if the ray hits a triangle that the options let count.
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// // The triangle is a window: the filter rejects its hit, so the ray reaches the light.
    /// let mut through_windows = |_, _: &Hit| Verdict::Reject;
    /// let mut options =
    ///     QueryOptions { filter: Some(&mut through_windows), ..QueryOptions::default() };
    /// let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
    /// assert!(!grid.occluded_with(&ray, &mut options));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn occluded_with(&self, ray: &Ray, options: &mut QueryOptions<'_>) -> bool {
        self.occluder_at(0, ray, options).is_some()
    }

    /// A triangle that blocks a ray, of those that the options let count; `None` if the ray is not
    /// [`occluded`](Grid::occluded_with).
    ///
    /// It is hit within the ray's range, but need not be the closest. A batch or another machine may name another one.
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
    /// assert_eq!(grid.occluder(&ray, &mut QueryOptions::default()), Some(0));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn occluder(&self, ray: &Ray, options: &mut QueryOptions<'_>) -> Option<u32> {
        self.occluder_at(0, ray, options).map(|hit| hit.primitive)
    }

    /// [`occluder`](Self::occluder) for the ray at a place of a batch, with the hit.
    pub(crate) fn occluder_at(
        &self,
        place: usize,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
    ) -> Option<Hit> {
        // Save flash as `intersect` does.
        if options.are_plain() && !IS_SMALL {
            return self.any(ray);
        }
        if options.filter.is_some() {
            return self.intersect_at((place, ray), ray.t_max, options);
        }
        // Without a filter no order is promised: any hit that counts will do.
        let mut hit = Hit::MISS;
        let found =
            self.nearest(ray, ray.t_max, options, None, core::slice::from_mut(&mut hit), true);
        (found > 0).then_some(hit)
    }

    /// All hits of a ray that the options let count: by ascending `t`, then id, each triangle once.
    ///
    /// Writes as many of them as `hits` has room for, the nearest, and returns how many there are. With empty `hits` it
    /// only counts. Without a filter, a tree ([`Method::Bvh`](crate::Method::Bvh)) is walked once and keeps the nearest
    /// in a heap, in time proportional to the number of hits times the logarithm of the room. With a filter, and with
    /// the other methods if `hits` is too short for all hits, the ray is traversed again for every sixteen hits, each
    /// time from the last of them. That takes no memory, but the time for thousands of hits in one cell grows with the
    /// square of their number.
    ///
    /// ```
    /// # use hgrid_core::*;
    /// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5]];
    /// # let mesh = TriangleMesh::new(&positions, &[[0, 1, 2], [3, 1, 2]])?;
    /// # let sizes = sizes(&mesh, &Config::default(), &mut [])?;
    /// # let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
    /// # let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
    /// # let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
    /// # let grid = Grid::build(mesh, &Config::default(), index, scratch)?;
    /// let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
    /// let mut hits = [Hit::MISS; 4];
    /// assert_eq!(grid.intersect_all(&ray, &mut QueryOptions::default(), &mut hits), 2);
    /// assert_eq!([hits[0].primitive, hits[1].primitive], [1, 0]);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn intersect_all(
        &self,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
        hits: &mut [Hit],
    ) -> usize {
        let mut count = 0;
        let mut after = None;
        if options.filter.is_none() && self.shows_once() {
            return self.heap(ray, options, hits);
        }
        // Without a filter all hits count: collect them in `hits` itself.
        if options.filter.is_none() && hits.len() > ROOM {
            count = self.nearest(ray, ray.t_max, options, None, hits, false);
            match hits.last() {
                Some(last) if count == hits.len() => after = Some(*last),
                _ => return count,
            }
        }
        self.in_order((0, ray), ray.t_max, options, after, ROOM, |hit| {
            if let Some(slot) = hits.get_mut(count) {
                *slot = *hit;
            }
            count += 1;
            true
        });
        count
    }

    /// Walks a ray through a tree once, and keeps the nearest hits in order; returns how many there are.
    fn heap(&self, ray: &Ray, options: &mut QueryOptions<'_>, hits: &mut [Hit]) -> usize {
        let selection = Selection::new(self.mesh(), options);
        let mut all = AllHits { selection: &selection, hits, count: 0 };
        let mut work = Counters::default();
        let mut show = TriangleSearch(&mut |hit| all.show(hit));
        self.search(ray, [ray.t_min, ray.t_max], options.cull, &mut show, &mut work);
        all.sort();
        options.count(&work);
        all.count
    }

    /// Passes the hits behind `after` and up to `until` that count to `take`, in order, until `take` returns false. The
    /// first walk collects `room` hits.
    fn in_order(
        &self,
        (place, ray): (usize, &Ray),
        until: f32,
        options: &mut QueryOptions<'_>,
        mut after: Option<Hit>,
        mut room: usize,
        mut take: impl FnMut(&Hit) -> bool,
    ) {
        let mut buffer = [Hit::MISS; ROOM];
        let choice = options.choice();
        loop {
            let space = buffer.get_mut(..room).unwrap_or_default();
            let found = self.nearest(ray, until, options, after, space, false);
            for hit in buffer.iter().take(found) {
                let verdict = match &mut options.filter {
                    Some(filter) if choice.asks(self.mesh(), hit.primitive) => filter(place, hit),
                    _ => Verdict::Accept,
                };
                let is_enough = match verdict {
                    Verdict::Reject => false,
                    Verdict::Accept => !take(hit),
                    Verdict::AcceptAndStop => {
                        take(hit);
                        true
                    }
                };
                if is_enough {
                    return;
                }
                after = Some(*hit);
            }
            // The walk had room for more hits, so there are no others.
            if found < room {
                return;
            }
            room = (2 * room).min(ROOM);
        }
    }

    /// Walks a ray from a hit on, collects as many of the hits behind it as there is room for, and
    /// returns how many: the nearest, or any.
    fn nearest(
        &self,
        ray: &Ray,
        until: f32,
        options: &mut QueryOptions<'_>,
        after: Option<Hit>,
        hits: &mut [Hit],
        is_any: bool,
    ) -> usize {
        let selection = Selection::new(self.mesh(), options);
        let mut nearest =
            NearestHits { selection: &selection, after, until, hits, count: 0, is_any };
        let begin = after.map_or(ray.t_min, |after| after.t);
        let mut work = Counters::default();
        let mut show = TriangleSearch(&mut |hit| nearest.show(hit));
        self.search(ray, [begin, until], options.cull, &mut show, &mut work);
        options.count(&work);
        nearest.count
    }
}
