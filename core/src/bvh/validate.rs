//! Proof that a foreign blob is a tree of its mesh.
//!
//! A tree answers right if every finite triangle stands in a leaf, and every box on the way from the root to that leaf
//! holds it, with the margin that the slab test relies on ([`node`](super::node)). One walk over all nodes checks this:
//!
//! ```text
//! node   a build writes such a node; each child may fill its box, clipped to those above; fine sides, if it has
//!        some, are its own and clip that box, too
//! leaf   each triangle is finite, lies in what its leaf may fill, and has no bit in scratch yet: set it
//! end    as many nodes and ids were met as there are
//! ```
//!
//! A second leaf with the same triangle is an error, so no sum has to be trusted, and a walk that ends has met each
//! node once.

use glam::DVec3;

use super::Bvh;
use super::layout::LEVELS;
use super::node::{Child, LEAF, Node, WIDTH};
use crate::aabb::Aabb;
use crate::arena::first_mut;
use crate::blob::{Header, corrupt};
use crate::budget::Budget;
use crate::cell::Lattice;
use crate::error::{Error, Region};
use crate::mesh::TriangleMesh;
use crate::method::Quality;

/// Bytes of scratch that a proof takes.
pub(crate) const fn proof_bytes(triangles: u32) -> u64 {
    triangles.div_ceil(u32::BITS) as u64 * size_of::<u32>() as u64
}

/// The margin that a box must have, in steps: less than that of a build, whose rounding may take some of it.
const MARGIN: f64 = 1.0 / 128.0;

/// A node on the way down.
#[derive(Clone, Copy)]
struct OpenNode {
    node: u32,
    /// Children that are still to be looked at.
    rest: u32,
    /// The intersection of the boxes above.
    min: DVec3,
    max: DVec3,
}

impl Bvh<'_> {
    /// Proves that every query of this tree is answered correctly; the error names the first byte that is wrong.
    pub(crate) fn validate(
        &self,
        header: &Header,
        lattice: &Lattice,
        mesh: &TriangleMesh<'_>,
        scratch: &mut [u8],
    ) -> Result<(), Error> {
        let survey = header.survey(lattice, mesh)?;
        if header.resolution != [1; 3] {
            return Err(corrupt(core::mem::offset_of!(Header, resolution)));
        }
        if Quality::from_u32(header.quality).is_none() {
            return Err(corrupt(core::mem::offset_of!(Header, quality)));
        }
        if header.reference_count != survey.finite_count {
            return Err(corrupt(core::mem::offset_of!(Header, reference_count)));
        }
        let met = first_mut(scratch, proof_bytes(header.triangle_count), Region::Scratch)?;
        met.fill(0);

        let mut reader = mesh.reader();
        let bounds = lattice.bounds();
        let least = f64::from(bounds.size().max_element()) * LEAST_STEP;
        let mut levels =
            [OpenNode { node: 0, rest: 0, min: DVec3::ZERO, max: DVec3::ZERO }; LEVELS as usize];
        let (mut depth, mut deepest) = (0, 1);
        // Every node is met once.
        let mut budget = Budget::new(self.nodes.len());
        let (mut ids, mut fine_count) = (0, 0);
        let start = |node: u32, min, max| OpenNode { node, rest: 0xff, min, max };
        let everywhere = DVec3::INFINITY;
        if self.nodes.is_empty() {
            return Err(corrupt(core::mem::offset_of!(Header, node_count)));
        }
        levels[0] = start(0, -everywhere, everywhere);
        loop {
            let Some(level) = levels.get_mut(depth) else { return Err(self.wrong_node(0)) };
            let number = level.node;
            let wrong = self.wrong_node(number);
            let node = self.nodes.get(number as usize).ok_or(wrong)?;
            // Check the node when the walk comes from above.
            if level.rest == 0xff {
                if !budget.take(1) {
                    return Err(wrong);
                }
                node.check(least, number == 0 && self.ids.is_empty()).ok_or(wrong)?;
                if node.has_fine_sides() {
                    let fine = self.fine_sides(node).ok_or(wrong)?;
                    if !fine.are_of(number, node) {
                        return Err(wrong);
                    }
                    fine_count += 1;
                }
            }
            if level.rest == 0 {
                let Some(above) = depth.checked_sub(1) else { break };
                depth = above;
                continue;
            }
            // Intersect the box that the next child may fill with those above.
            let slot = level.rest.trailing_zeros();
            level.rest &= level.rest - 1;
            let (min, max) = node.holds(slot as usize);
            let (mut min, mut max) = (level.min.max(min), level.max.min(max));
            if let Some(fine) = self.fine_sides(node) {
                let holds = fine.holds(node, slot as usize);
                (min, max) = (min.max(holds.0), max.min(holds.1));
            }
            // Go down into a node; check the triangles of a leaf.
            match node.child(slot) {
                Child::Inner(child) => {
                    if child as usize >= self.nodes.len() {
                        return Err(wrong);
                    }
                    depth += 1;
                    deepest = deepest.max(depth + 1);
                    *levels.get_mut(depth).ok_or(wrong)? = start(child, min, max);
                }
                Child::Leaf { first, count } => {
                    for word in (u64::from(first)..).take(count as usize) {
                        let id = usize::try_from(word).ok().and_then(|word| self.ids.get(word));
                        let (id, wrong) = (*id.ok_or(wrong)?, Self::wrong_id(word));
                        let byte = met.get_mut(id as usize / 8).ok_or(wrong)?;
                        let bit = 1 << (id % 8);
                        let bounds = reader.corners(id).and_then(Aabb::of).ok_or(wrong)?;
                        let is_held = bounds.min.as_dvec3().cmpge(min).all()
                            && bounds.max.as_dvec3().cmple(max).all();
                        if *byte & bit != 0 || !is_held {
                            return Err(wrong);
                        }
                        *byte |= bit;
                        ids += 1;
                    }
                }
            }
        }
        if ids != self.ids.len() || !budget.is_used_up() {
            return Err(corrupt(core::mem::offset_of!(Header, node_count)));
        }
        if fine_count != self.fine.len() {
            return Err(corrupt(core::mem::offset_of!(Header, hash_count)));
        }
        if header.levels as usize != deepest {
            return Err(corrupt(core::mem::offset_of!(Header, levels)));
        }
        Ok(())
    }
}

/// No step is smaller than this part of the tree's extent: half of a build's.
const LEAST_STEP: f64 = 0.5 / (1_048_576.0 * 1_048_576.0 * 1_048_576.0); // 2^-61

/// No coordinate of an origin is more than so many steps: twice as many as in a build.
const MOST_STEPS: f64 = 4_194_304.0; // 2^22

impl Node {
    /// Returns `None` if no build writes such a node. Its origin and steps must be finite, its steps not too small,
    /// also beside the origin: the margin would be lost in the rounding of coordinates. Each child must be a node or a
    /// leaf, not both; the box of one that is not there is inside out. The node must have a child, unless it
    /// `may_be_empty`.
    fn check(&self, least: f64, may_be_empty: bool) -> Option<()> {
        let steps = self.steps().map(f64::from);
        let are_steps = self.exponents().iter().all(|exponent| (1..=253).contains(exponent))
            && steps.iter().all(|&step| step >= least)
            && self.origin().iter().zip(&steps).all(|(origin, step)| {
                // Also false of NaN and infinity.
                f64::from(origin.abs()) <= step * MOST_STEPS
            });
        let mut children = 0;
        for slot in 0..WIDTH {
            let is_inner = self.inner() >> slot & 1 == 1;
            let count = usize::from(self.counts[slot]);
            if count > LEAF || is_inner && count > 0 {
                return None;
            }
            let is_there = is_inner || count > 0;
            let sides = self.bounds.map(|side| side[slot]);
            if !is_there && sides != Self::EMPTY.bounds.map(|side| side[slot]) {
                return None;
            }
            children += usize::from(is_there);
        }
        (are_steps && (children > 0 || may_be_empty)).then_some(())
    }

    /// The box that child `slot` may fill: its quantised one without the margin.
    fn holds(&self, slot: usize) -> (DVec3, DVec3) {
        let (origin, step) = (self.origin().map(f64::from), self.steps().map(f64::from));
        let bound = |side: usize| f64::from(self.bounds[side][slot % WIDTH]);
        let low = |axis: usize| origin[axis] + (bound(axis) + MARGIN) * step[axis];
        let high = |axis: usize| origin[axis] + (bound(axis + 3) - MARGIN) * step[axis];
        (DVec3::new(low(0), low(1), low(2)), DVec3::new(high(0), high(1), high(2)))
    }
}
