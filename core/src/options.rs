//! The options of queries: masks, culling, a triangle to skip, filters, counters.

use core::fmt;

use zerocopy::FromZeros;

use crate::counters::Counters;
use crate::mesh::TriangleMesh;
use crate::ray::{Hit, INVALID_ID};

/// The sides of triangles that a ray does not hit.
///
/// The front is where a triangle's vertices appear counter-clockwise. A triangle seen exactly edge
/// on shows neither side, and is never hit.
#[repr(u32)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, FromZeros)]
pub enum Cull {
    /// Both sides are hit.
    #[default]
    None = 0,
    /// A ray passes through triangles that show it their back.
    Back = 1,
    /// A ray passes through triangles that show it their front.
    Front = 2,
}

/// The answer of a filter about a hit.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The ray goes on as if the triangle were not there.
    Reject = 0,
    /// The hit counts.
    Accept = 1,
    /// The hit counts, and it is the last one: the same as [`Accept`](Self::Accept), but for
    /// [`Grid::intersect_all`](crate::Grid::intersect_all).
    AcceptAndStop = 2,
}

/// Decides whether a hit counts. Gets the number of the ray in its batch, 0 for a single ray, and the hit.
pub type Filter<'q> = dyn FnMut(usize, &Hit) -> Verdict + 'q;

/// The options of a query. `QueryOptions::default()` changes nothing.
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
    /// [`TriangleMesh::with_masks`](crate::TriangleMesh::with_masks). The default
    /// is all bits: every triangle is seen, even one whose mask is 0.
    pub mask: u32,
    /// The sides that are not hit.
    pub cull: Cull,
    /// A triangle that is not hit: usually the one that the ray leaves, so no epsilon is needed. Its neighbour across
    /// an edge may still be hit, if the origin was rounded to just below it. The default is [`INVALID_ID`], which
    /// names none.
    pub skip: u32,
    /// Decides whether a hit counts: see [`Filter`]. It is asked about hits by ascending `t`, then id, about each
    /// triangle at most once for each ray, and about all hits of one ray of a batch before those of the next. Queries
    /// for any hit ([`occluded_with`](crate::Grid::occluded_with)) need not ask about a ray that an opaque triangle
    /// blocks.
    pub filter: Option<&'q mut Filter<'q>>,
    /// The filter is asked about a triangle if a bit of this is set in its mask, too. The others are opaque: their hits
    /// count, and rays that meet only them cost what they cost without a filter. The default is all bits: the filter is
    /// asked about every triangle, even one whose mask is 0. With 0 it is asked about none (in C, 0 stands for all
    /// bits).
    pub filter_mask: u32,
    /// Counters that add up the work. With them, the rays of a batch are traced one by one, because the rays of a
    /// group share work that belongs to no single ray.
    pub counters: Option<&'q mut Counters>,
    /// Memory in which rays of [`Coherence::Incoherent`](crate::Coherence::Incoherent) may be sorted, 16 bytes a ray:
    /// see there. It holds anything before and after. Queries of one ray or point do not use it.
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

    /// Adds up work, if it is counted.
    pub(crate) fn count(&mut self, work: &Counters) {
        if let Some(counters) = &mut self.counters {
            counters.add(work);
        }
    }

    /// Returns true if rays have to be traced one by one.
    pub(crate) const fn are_for_single_rays(&self) -> bool {
        self.counters.is_some()
    }

    /// Returns true if they change nothing.
    pub(crate) fn are_plain(&self) -> bool {
        self.choice() == Choice::ALL && self.filter.is_none() && !self.are_for_single_rays()
    }

    /// Returns the choice of triangles that is made without asking the filter.
    pub(crate) const fn choice(&self) -> Choice {
        let asked = if self.filter.is_some() { self.filter_mask } else { 0 };
        Choice { mask: self.mask, skip: self.skip, cull: self.cull, asked }
    }
}

/// Masks, culling, the triangle to skip, and which triangles the filter is asked about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromZeros)]
pub(crate) struct Choice {
    mask: u32,
    skip: u32,
    pub(crate) cull: Cull,
    /// The mask of the filter; no bits without one.
    asked: u32,
}

impl Choice {
    /// All triangles, from both sides, without a filter.
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
    pub(crate) mesh: &'q TriangleMesh<'q>,
    choice: Choice,
}

impl<'q> Selection<'q> {
    pub(crate) const fn new(mesh: &'q TriangleMesh<'q>, options: &QueryOptions<'_>) -> Self {
        Self { mesh, choice: options.choice() }
    }

    /// Returns true if a triangle is one of them.
    pub(crate) fn has(&self, primitive: u32) -> bool {
        self.choice.has(self.mesh, primitive)
    }
}
