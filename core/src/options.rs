//! What a query may be told beyond its ray, and the queries that take it.
//!
//! Masks, culling and the triangle to skip are looked up when a ray hits. A filter is asked about
//! hits in order, from near to far and never twice about the same triangle, though a grid has
//! neither order nor memory of what it has shown: a walk collects the few nearest hits in order,
//! the filter is asked about those, and if it wants none of them the next walk starts where the
//! last hit was. The first walk collects one hit, the next two, and so on: whoever accepts the
//! first pays nothing for the order.

use core::fmt;

use crate::counters::Counters;
use crate::grid::Grid;
use crate::mesh::TriangleMesh;
use crate::ray::{Hit, INVALID_ID, Ray};
use crate::search::Nearest;

/// Which sides of triangles a ray does not hit.
///
/// The front is where a triangle's vertices appear counter-clockwise. A triangle seen exactly edge
/// on shows neither side, and is never hit.
#[repr(u32)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Cull {
    /// Both sides are hit.
    #[default]
    None = 0,
    /// A ray passes through triangles that show it their back.
    Back = 1,
    /// A ray passes through triangles that show it their front.
    Front = 2,
}

/// What a filter says of a hit.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The ray goes on as if the triangle were not there.
    Reject = 0,
    /// The hit counts.
    Accept = 1,
    /// The hit counts, and it is the last one: the same as [`Accept`](Self::Accept), but for
    /// [`Grid::intersect_all`].
    AcceptAndStop = 2,
}

/// What a query may be told. `QueryOptions::default()` changes nothing.
///
/// ```
/// use hgrid_core::{Cull, QueryOptions, Verdict};
/// let mut is_window = |primitive: u32| primitive < 10;
/// let mut filter = |hit: &hgrid_core::Hit| {
///     if is_window(hit.primitive) { Verdict::Reject } else { Verdict::Accept }
/// };
/// let options = QueryOptions {
///     cull: Cull::Back,
///     filter: Some(&mut filter),
///     ..QueryOptions::default()
/// };
/// ```
pub struct QueryOptions<'q> {
    /// A triangle is seen if a bit of this is set in its mask, too: see
    /// [`TriangleMesh::with_masks`](crate::TriangleMesh::with_masks). At first all bits, which sees
    /// every triangle, even one whose mask is 0.
    pub mask: u32,
    /// Which sides are not hit.
    pub cull: Cull,
    /// A triangle that is not hit: the one that the ray leaves, which it cannot hit again, without
    /// any epsilon. A neighbour across an edge still may be, where the origin was rounded to just
    /// below it. At first [`INVALID_ID`].
    pub skip: u32,
    /// Says of a hit whether it counts. Asked about hits from near to far, where `t` is equal by
    /// ascending id, and about each triangle at most once for each ray.
    pub filter: Option<&'q mut dyn FnMut(&Hit) -> Verdict>,
    /// Where to add up the work.
    pub counters: Option<&'q mut Counters>,
}

impl Default for QueryOptions<'_> {
    fn default() -> Self {
        Self { mask: u32::MAX, cull: Cull::None, skip: INVALID_ID, filter: None, counters: None }
    }
}

impl fmt::Debug for QueryOptions<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("QueryOptions")
            .field("mask", &self.mask)
            .field("cull", &self.cull)
            .field("skip", &self.skip)
            .field("filter", &self.filter.is_some())
            .field("counters", &self.counters)
            .finish()
    }
}

impl<'q> QueryOptions<'q> {
    /// Options that only count.
    #[must_use]
    pub fn counting(counters: &'q mut Counters) -> Self {
        Self { counters: Some(counters), ..Self::default() }
    }
}

/// The triangles that a query sees.
#[derive(Debug)]
pub(crate) struct Selection<'q> {
    mesh: &'q TriangleMesh<'q>,
    mask: u32,
    skip: u32,
}

impl<'q> Selection<'q> {
    pub(crate) const fn new(mesh: &'q TriangleMesh<'q>, options: &QueryOptions<'_>) -> Self {
        Self { mesh, mask: options.mask, skip: options.skip }
    }

    /// Whether a triangle is one of them.
    pub(crate) fn has(&self, primitive: u32) -> bool {
        let is_masked = self.mask != u32::MAX && self.mesh.mask(primitive) & self.mask == 0;
        primitive != self.skip && !is_masked
    }
}

/// The most hits that a walk collects.
const ROOM: usize = 16;

impl Grid<'_> {
    /// The closest hit of a ray, of those that the options let count.
    ///
    /// ```
    /// # use hgrid_core::*;
    /// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// # let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// # let sizes = sizes(&mesh, &Config::default(), &mut [])?;
    /// # let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
    /// # let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
    /// # let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
    /// # let grid = Grid::build(mesh, &Config::default(), index, scratch)?;
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
        let mut closest = None;
        self.in_order(ray, options, None, 1, |hit| {
            closest = Some(*hit);
            false
        });
        closest
    }

    /// Whether anything is hit that the options let count.
    #[must_use]
    pub fn occluded_with(&self, ray: &Ray, options: &mut QueryOptions<'_>) -> bool {
        if options.filter.is_some() {
            return self.intersect_with(ray, options).is_some();
        }
        // Nobody is promised an order.
        self.nearest(ray, options, None, &mut [Hit::MISS], true) > 0
    }

    /// All hits of a ray that the options let count: by ascending `t`, then id, each triangle once.
    ///
    /// Writes as many of them as `hits` has room for, the nearest, and returns how many there
    /// are. With room for more than there are, the ray is walked once. Otherwise, and with a
    /// filter, it is walked once more for each sixteen hits, from where it got to: so no
    /// memory is taken, whatever their number, but thousands of hits in one cell take long,
    /// as the square of their number.
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
        // Without a filter all that is found counts: collect it where it is wanted.
        if options.filter.is_none() && hits.len() > ROOM {
            count = self.nearest(ray, options, None, hits, false);
            match hits.last() {
                Some(last) if count == hits.len() => after = Some(*last),
                _ => return count,
            }
        }
        self.in_order(ray, options, after, ROOM, |hit| {
            if let Some(slot) = hits.get_mut(count) {
                *slot = *hit;
            }
            count += 1;
            true
        });
        count
    }

    /// Shows `take` the hits that count and lie behind one, in order, until it answers that it has
    /// enough. The first walk collects `room` hits.
    fn in_order(
        &self,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
        mut after: Option<Hit>,
        mut room: usize,
        mut take: impl FnMut(&Hit) -> bool,
    ) {
        let mut buffer = [Hit::MISS; ROOM];
        loop {
            let space = buffer.get_mut(..room).unwrap_or_default();
            let found = self.nearest(ray, options, after, space, false);
            for hit in buffer.iter().take(found) {
                let verdict = match &mut options.filter {
                    Some(filter) => filter(hit),
                    None => Verdict::Accept,
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
            // With room to spare, there is nothing behind the last one.
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
        options: &mut QueryOptions<'_>,
        after: Option<Hit>,
        hits: &mut [Hit],
        is_any: bool,
    ) -> usize {
        let selection = Selection::new(self.mesh(), options);
        let mut nearest = Nearest { selection: &selection, after, hits, count: 0, is_any };
        let begin = after.map_or(ray.t_min, |after| after.t);
        let mut work = Counters::default();
        self.search(ray, begin, options.cull, &mut nearest, &mut work);
        if let Some(counters) = &mut options.counters {
            counters.add(&work);
        }
        nearest.count
    }
}
