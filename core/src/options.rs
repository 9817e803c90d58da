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
use crate::search::{All, Nearest};

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

/// Says of a hit of the ray at a place of its batch, 0 for a single ray, whether it counts.
pub type Filter<'q> = dyn FnMut(usize, &Hit) -> Verdict + 'q;

/// What a query may be told. `QueryOptions::default()` changes nothing.
///
/// ```
/// use hgrid_core::{Cull, QueryOptions, Verdict};
/// let mut is_window = |primitive: u32| primitive < 10;
/// let mut filter = |_, hit: &hgrid_core::Hit| {
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
    /// Says of a hit whether it counts: gets the place of the ray in its batch, 0 for a single one,
    /// and the hit. Asked about hits from near to far, where `t` is equal by ascending id, and about
    /// each triangle at most once for each ray; all about one ray of a batch before the next, in their
    /// order. A ray of [`occluded_with`](Grid::occluded_with) and its like that an opaque triangle
    /// blocks may be asked about or not.
    pub filter: Option<&'q mut Filter<'q>>,
    /// The filter is asked about a triangle if a bit of this is set in its mask, too; the others are
    /// opaque: their hits count unasked, and rays that meet no others cost what they cost without a
    /// filter. At first all bits, which asks about every triangle, even one whose mask is 0.
    pub filter_mask: u32,
    /// Where to add up the work. The rays of a batch are then traced one by one: those of a group
    /// share their work, and none of it could be told to be one ray's.
    pub counters: Option<&'q mut Counters>,
    /// Memory in which rays of [`Coherence::Incoherent`](crate::Coherence::Incoherent) may be
    /// sorted, 16 bytes a ray: see there. It holds anything before and after. Queries of one ray or
    /// point do not use it.
    pub scratch: &'q mut [u8],
}

impl Default for QueryOptions<'_> {
    fn default() -> Self {
        Self {
            mask: u32::MAX,
            cull: Cull::None,
            skip: INVALID_ID,
            filter: None,
            filter_mask: u32::MAX,
            counters: None,
            scratch: &mut [],
        }
    }
}

impl fmt::Debug for QueryOptions<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("QueryOptions")
            .field("mask", &self.mask)
            .field("cull", &self.cull)
            .field("skip", &self.skip)
            .field("filter", &self.filter.is_some())
            .field("filter_mask", &self.filter_mask)
            .field("counters", &self.counters)
            .field("scratch", &self.scratch.len())
            .finish()
    }
}

impl<'q> QueryOptions<'q> {
    /// Options that only count.
    #[must_use]
    pub fn counting(counters: &'q mut Counters) -> Self {
        Self { counters: Some(counters), ..Self::default() }
    }

    /// Returns true if rays have to be traced one by one.
    pub(crate) const fn are_for_single_rays(&self) -> bool {
        self.counters.is_some()
    }

    /// Returns true if they change nothing.
    pub(crate) fn are_plain(&self) -> bool {
        self.choice() == Choice::ALL && self.filter.is_none() && !self.are_for_single_rays()
    }

    /// What can be said of triangles without asking the filter.
    pub(crate) const fn choice(&self) -> Choice {
        let asked = if self.filter.is_some() { self.filter_mask } else { 0 };
        Choice { mask: self.mask, skip: self.skip, cull: self.cull, asked }
    }
}

/// Masks, culling, the triangle to skip, and which triangles the filter is asked about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Choice {
    mask: u32,
    skip: u32,
    pub(crate) cull: Cull,
    /// The mask of the filter; no bits without one.
    asked: u32,
}

impl Choice {
    /// All triangles from both sides, unasked.
    pub(crate) const ALL: Self =
        Self { mask: u32::MAX, skip: INVALID_ID, cull: Cull::None, asked: 0 };

    /// Returns true if the filter is asked about a triangle.
    #[inline(always)]
    pub(crate) fn asks(&self, mesh: &TriangleMesh<'_>, primitive: u32) -> bool {
        self.asked != 0 && (self.asked == u32::MAX || mesh.mask(primitive) & self.asked != 0)
    }

    /// Returns true if the filter is asked about every triangle.
    pub(crate) const fn asks_all(&self, mesh: &TriangleMesh<'_>) -> bool {
        self.asked == u32::MAX || (self.asked != 0 && !mesh.has_masks())
    }

    /// Returns true if a triangle is seen, from whichever side.
    #[inline(always)]
    pub(crate) fn has(&self, mesh: &TriangleMesh<'_>, primitive: u32) -> bool {
        let is_masked = self.mask != u32::MAX && mesh.mask(primitive) & self.mask == 0;
        primitive != self.skip && !is_masked
    }
}

/// The triangles that a query sees.
#[derive(Debug)]
pub(crate) struct Selection<'q> {
    mesh: &'q TriangleMesh<'q>,
    choice: Choice,
}

impl<'q> Selection<'q> {
    pub(crate) const fn new(mesh: &'q TriangleMesh<'q>, options: &QueryOptions<'_>) -> Self {
        Self { mesh, choice: options.choice() }
    }

    /// Whether a triangle is one of them.
    pub(crate) fn has(&self, primitive: u32) -> bool {
        self.choice.has(self.mesh, primitive)
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
        self.intersect_at(0, ray, options)
    }

    /// The same for the ray at a place of a batch.
    pub(crate) fn intersect_at(
        &self,
        place: usize,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
    ) -> Option<Hit> {
        self.intersect_behind((place, ray), options, None, 1)
    }

    /// The same once the first hit is known, which the filter is asked about.
    pub(crate) fn intersect_from(
        &self,
        place: usize,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
        first: &Hit,
    ) -> Option<Hit> {
        let verdict = options.filter.as_mut().map(|filter| filter(place, first));
        if verdict == Some(Verdict::Reject) {
            return self.intersect_behind((place, ray), options, Some(*first), 2);
        }
        Some(*first)
    }

    /// The first hit behind another that counts. The first walk collects `room` hits.
    fn intersect_behind(
        &self,
        ray: (usize, &Ray),
        options: &mut QueryOptions<'_>,
        after: Option<Hit>,
        room: usize,
    ) -> Option<Hit> {
        let mut closest = None;
        self.in_order(ray, options, after, room, |hit| {
            closest = Some(*hit);
            false
        });
        closest
    }

    /// Whether anything is hit that the options let count.
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
    /// // Is a window before the light? The triangle lets it through.
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
    /// It is hit within the ray's range, but need not be the closest, and another one may be named in a
    /// batch or on another machine.
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
    /// assert_eq!(grid.occluder(&ray, &mut QueryOptions::default()), Some(0));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn occluder(&self, ray: &Ray, options: &mut QueryOptions<'_>) -> Option<u32> {
        self.occluder_at(0, ray, options)
    }

    /// The same for the ray at a place of a batch.
    pub(crate) fn occluder_at(
        &self,
        place: usize,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
    ) -> Option<u32> {
        if options.are_plain() {
            let id = self.any(ray);
            return (id != INVALID_ID).then_some(id);
        }
        if options.filter.is_some() {
            return self.intersect_at(place, ray, options).map(|hit| hit.primitive);
        }
        // Nobody is promised an order.
        let mut hit = Hit::MISS;
        let found = self.nearest(ray, options, None, core::slice::from_mut(&mut hit), true);
        (found > 0).then_some(hit.primitive)
    }

    /// All hits of a ray that the options let count: by ascending `t`, then id, each triangle once.
    ///
    /// Writes as many of them as `hits` has room for, the nearest, and returns how many there
    /// are. Without a filter, a tree ([`Method::Bvh`](crate::Method::Bvh)) is walked once and keeps
    /// the nearest in a heap, in time of the number of hits times the logarithm of the room. With a
    /// filter, and with the other methods where there is not room for more hits than there are, the
    /// ray is walked once more for each sixteen hits, from where it got to: so no memory is taken,
    /// whatever their number, but thousands of hits in one cell take long, as the square of their
    /// number.
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
        // Without a filter all that is found counts: collect it where it is wanted.
        if options.filter.is_none() && hits.len() > ROOM {
            count = self.nearest(ray, options, None, hits, false);
            match hits.last() {
                Some(last) if count == hits.len() => after = Some(*last),
                _ => return count,
            }
        }
        self.in_order((0, ray), options, after, ROOM, |hit| {
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
        let mut all = All { selection: &selection, hits, count: 0 };
        let mut work = Counters::default();
        self.search(ray, ray.t_min, options.cull, &mut all, &mut work);
        all.sort();
        if let Some(counters) = &mut options.counters {
            counters.add(&work);
        }
        all.count
    }

    /// Shows `take` the hits that count and lie behind one, in order, until it answers that it has
    /// enough. The first walk collects `room` hits.
    fn in_order(
        &self,
        (place, ray): (usize, &Ray),
        options: &mut QueryOptions<'_>,
        mut after: Option<Hit>,
        mut room: usize,
        mut take: impl FnMut(&Hit) -> bool,
    ) {
        let mut buffer = [Hit::MISS; ROOM];
        let choice = options.choice();
        loop {
            let space = buffer.get_mut(..room).unwrap_or_default();
            let found = self.nearest(ray, options, after, space, false);
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
