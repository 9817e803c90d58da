//! Refit: new boxes for a tree whose triangles moved, in place.
//!
//! ```text
//! check   the mesh has the triangles of the tree; a walk down from the root makes as many visits as there are nodes
//! refit   depth first, a node after all nodes below it: read the boxes of all triangles in its leaves; unite those of
//!         each leaf (a short leaf repeats its last box, so that eight are united); quantise; hand the union of all to
//!         the parent
//! again   if unused vertices widened the box of the tree so far that a node was too thin for it
//! ```
//!
//! The check finds all errors, so nothing is written before an error. The boxes are those of a build with
//! the same leaves.

use core::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x4, f32x8};
use glam::Vec3A;

use super::Bvh;
use super::fine::{ExactBox, FineSides};
use super::layout::LEVELS;
use super::node::{Child, LEAF, Node, Sides, WIDTH, floats, least_node};
use super::stack::FEW_LEVELS;
use crate::aabb::{Aabb, lesser};
use crate::arena::split_mut;
use crate::blob::{HEADER_BYTES, Header, corrupt};
use crate::cell::Lattice;
use crate::config::BuildFlags;
use crate::control::Watch;
use crate::eight::load;
use crate::error::Error;
use crate::extremes::Extremes;
use crate::invariant::OrBug;
use crate::mesh::{LastPart, Reader, TriangleMesh};
use crate::simd::{Kernel, SimdLevel, dispatch};
use crate::survey::Survey;

/// Gives a tree the boxes of a mesh that moved, in a blob that opens; returns the SAH costs before and after.
pub(crate) fn refit(blob: &mut [u8], mesh: &TriangleMesh<'_>) -> Result<[f64; 2], Error> {
    let mut header = Header::read(blob, mesh)?;
    check_mesh(&header, mesh)?;
    let simd_level = SimdLevel::detect();
    let bvh = Bvh::open(&header, blob)?;
    bvh.check_ids(&header, mesh)?;
    let (levels, before) = dispatch(simd_level, CheckNodes(&bvh))?;
    let bounds = Lattice::pad(&mesh.vertex_bounds(0..mesh.vertex_count()));
    let sections = blob.get_mut(HEADER_BYTES..).and_then(|behind| {
        let (ids, behind) = split_mut::<u32>(behind, header.reference_count.into())?;
        let (nodes, behind) = split_mut::<Node>(behind, header.node_count.into())?;
        Some((&*ids, nodes, split_mut::<FineSides>(behind, header.fine_count())?.0))
    });
    let (ids, nodes, fine) = sections.ok_or(corrupt(core::mem::offset_of!(Header, blob_bytes)))?;
    let mut tree = Tree { mesh, ids, nodes, fine, least: least_node(&bounds) };
    let mut refitted = tree.refit(simd_level, levels);
    let bounds = Lattice::pad(&refitted.bounds);
    // Vertices that no triangle uses count for nothing in a build. If they made a step larger, start anew.
    let least = least_node(&bounds);
    if least < tree.least && refitted.thinnest < tree.least {
        tree.least = least;
        refitted = tree.refit(simd_level, levels);
    }
    debug_assert!(Lattice::pad(&refitted.bounds) == bounds, "the box of all triangles changed");
    (header.bounds_min, header.bounds_max) = (bounds.min.to_array(), bounds.max.to_array());
    if let Some(head) = blob.first_chunk_mut::<HEADER_BYTES>().or_bug("a blob without a header") {
        *head = header.to_bytes();
    }
    Ok([before, refitted.cost])
}

impl Bvh<'_> {
    /// Checks that all ids name triangles of the mesh, and finite ones.
    fn check_ids(&self, header: &Header, mesh: &TriangleMesh<'_>) -> Result<(), Error> {
        let triangles = mesh.triangle_count();
        // Test the largest id first: that takes less time than to test each, and mostly all are right.
        if self.ids.iter().fold(0, |largest, &id| largest.max(id)) >= triangles
            && let Some(word) = self.ids.iter().position(|&id| id >= triangles)
        {
            return Err(Self::wrong_id(word as u64));
        }
        // The build left triangles out, so the mesh may have non-finite ones: none of them may be in a leaf.
        if header.skipped_count > 0 {
            let mut reader = mesh.reader();
            for &triangle in self.ids {
                if reader.corners(triangle).and_then(Aabb::of).is_none() {
                    return Err(Error::NonFiniteTriangle { triangle });
                }
            }
        }
        Ok(())
    }
}

/// Checks what a refit relies on: a walk makes as many visits as there are nodes, each leaf lies among the ids, fine
/// sides are those of their node. Boxes are not checked, as they are replaced. Returns the levels of nodes and the SAH
/// cost.
struct CheckNodes<'b>(&'b Bvh<'b>);

impl Kernel for CheckNodes<'_> {
    type Output = Result<(u32, f64), Error>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Self(bvh) = self;
        // Every node on the way down, and its child nodes that are still to be looked at.
        let mut path = [(0, 0); LEVELS as usize];
        let (mut depth, mut deepest) = (0, 1);
        let mut unmet = bvh.nodes.len();
        let mut cost = Cost::default();
        let mut next = Some(0_u32);
        loop {
            // Check a node, and note its child nodes.
            if let Some(number) = next.take() {
                let node = bvh.nodes.get(number as usize).ok_or(bvh.wrong_node(number))?;
                unmet = unmet.checked_sub(1).ok_or(bvh.wrong_node(number))?;
                let ids = node.ids_of_leaves().and_then(|ids| bvh.ids.get(ids));
                ids.ok_or(bvh.wrong_node(number))?;
                *path.get_mut(depth).ok_or(bvh.wrong_node(number))? = (number, node.inner());
                depth += 1;
                deepest = deepest.max(depth);
                let fine = bvh.fine_sides(node);
                if node.has_fine_sides() && !fine.is_some_and(|fine| fine.are_of(number, node)) {
                    return Err(bvh.wrong_node(number));
                }
                cost.add(simd, node, number == 0);
            }
            // Go down to the next child node, or up if there is none left.
            let above = depth.checked_sub(1).and_then(|above| path.get_mut(above));
            let Some((number, rest)) = above else { break };
            if *rest == 0 {
                depth -= 1;
                continue;
            }
            let slot = rest.trailing_zeros();
            *rest &= *rest - 1;
            let node = bvh.nodes.get(*number as usize).ok_or(bvh.wrong_node(*number))?;
            if let Child::Inner(child) = node.child(slot) {
                next = Some(child);
            }
        }
        if unmet > 0 {
            return Err(corrupt(core::mem::offset_of!(Header, node_count)));
        }
        #[expect(clippy::cast_possible_truncation, reason = "no more than LEVELS")]
        Ok((deepest as u32, cost.total()))
    }
}

/// A tree that gets new boxes.
struct Tree<'b> {
    mesh: &'b TriangleMesh<'b>,
    ids: &'b [u32],
    nodes: &'b mut [Node],
    fine: &'b mut [FineSides],
    /// No step of a node is smaller than that of a box of this size.
    least: f32,
}

/// The new boxes of a tree.
struct Refitted {
    /// The box of the root.
    bounds: Aabb,
    /// The SAH cost.
    cost: f64,
    /// The least extent of a node on any axis.
    thinnest: f32,
}

impl Tree<'_> {
    /// Writes the boxes of all nodes, in a tree of so many levels.
    fn refit(&mut self, simd_level: SimdLevel, levels: u32) -> Refitted {
        if levels <= FEW_LEVELS {
            dispatch(simd_level, RefitNodes::<{ FEW_LEVELS as usize }>(self))
        } else {
            dispatch(simd_level, RefitNodes::<{ LEVELS as usize }>(self))
        }
    }
}

/// A tree of at most `N` levels that gets new boxes.
struct RefitNodes<'t, 'b, const N: usize>(&'t mut Tree<'b>);

/// A node on the way down. Small numbers, as the stack holds one for each level.
#[derive(Clone, Copy)]
struct RefitNode {
    number: u32,
    /// Child nodes that have no box yet.
    rest: u8,
    /// The child node that is about to get its box.
    slot: u8,
    /// The boxes of child nodes.
    boxes: [ExactBox; WIDTH],
}

impl<const N: usize> Kernel for RefitNodes<'_, '_, N> {
    type Output = Refitted;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Self(Tree { mesh, ids, nodes, fine, least }) = self;
        let least = *least;
        let mut near = mesh.part_around(ids.first().copied().unwrap_or(0));
        let mut levels = [RefitNode { number: 0, rest: 0, slot: 0, boxes: [[0.0; 6]; WIDTH] }; N];
        let mut reader = mesh.reader();
        // The boxes of the triangles of a node.
        let mut boxes = [[f32::INFINITY; 8]; WIDTH * LEAF];
        let (mut cost, mut thinnest) = (Cost::default(), f32::INFINITY);
        let (mut depth, mut next) = (0, Some(0_u32));
        while let Some(level) = levels.get_mut(depth) {
            // Enter a node, then go down into those of its children that are nodes.
            if let Some(number) = next.take() {
                let node = nodes.get(number as usize).or_bug("a child that is no node");
                let [inner, ..] = node.map_or(0, Node::inner).to_le_bytes();
                (level.number, level.rest) = (number, inner);
            }
            let node = nodes.get_mut(level.number as usize).or_bug("a child that is no node");
            let Some(node) = node else { break };
            if level.rest != 0 {
                let slot = level.rest.trailing_zeros();
                [level.slot, ..] = slot.to_le_bytes();
                level.rest &= level.rest - 1;
                if let Child::Inner(child) = node.child(slot) {
                    next = Some(child);
                    depth += 1;
                }
                continue;
            }

            // Read the boxes of all triangles in its leaves.
            let leaves = node.ids_of_leaves().and_then(|leaves| ids.get(leaves));
            for (&id, sides) in
                leaves.or_bug("a leaf behind the ids").unwrap_or_default().iter().zip(&mut boxes)
            {
                read(simd, mesh, &mut near, &mut reader, id, sides);
            }
            // Unite the boxes of each child, and quantise. A leaf repeats its last box up to eight, as a branch on the
            // number of its triangles would be mispredicted.
            let (used, mut first) = (node.used(), 0);
            let mut bounds = f32x8::splat(simd, f32::INFINITY);
            let mut children = [bounds; WIDTH];
            for (slot, child) in children.iter_mut().enumerate() {
                let count = usize::from(node.counts[slot]);
                if node.inner() >> slot & 1 == 1 {
                    let [x, y, z, u, v, w] = level.boxes[slot];
                    *child = f32x8::simd_from(simd, [x, y, z, 0.0, u, v, w, 0.0]);
                } else if let Some(last) = count.checked_sub(1) {
                    for lane in 0..LEAF {
                        let sides = boxes.get(first + lane.min(last)).copied();
                        let sides = sides.or_bug("a child without a box").unwrap_or([0.0; 8]);
                        *child = child.lesser(f32x8::simd_from(simd, sides));
                    }
                }
                first += count;
                bounds = bounds.lesser(*child);
            }
            let [x, y, z, _, u, v, w, _]: Sides = bounds.into();
            if used != 0 {
                node.set_sides(simd, bounds, &children, used, least);
            }
            cost.add(simd, node, level.number == 0);
            thinnest = lesser(thinnest, lesser(-(x + u), lesser(-(y + v), -(z + w))));
            if let Some(sides) = fine.get_mut(node.fine_index()) {
                for (slot, exact) in level.boxes.iter().enumerate() {
                    if node.inner() >> slot & 1 == 1 {
                        sides.set(node, slot, exact);
                    }
                }
            }
            let Some(above) = depth.checked_sub(1) else {
                let bounds = Aabb { min: Vec3A::new(x, y, z), max: -Vec3A::new(u, v, w) };
                return Refitted { bounds, cost: cost.total(), thinnest };
            };
            depth = above;
            if let Some(RefitNode { slot, boxes, .. }) = levels.get_mut(above)
                && let Some(sides) = boxes.get_mut(usize::from(*slot))
            {
                *sides = [x, y, z, u, v, w];
            }
        }
        debug_assert!(false, "the check did not walk the same way");
        Refitted { bounds: Aabb::EMPTY, cost: cost.total(), thinnest }
    }
}

/// Reads the box of a triangle: from the part that was read last, in vectors, or one by one where the mesh cannot be
/// read so.
#[inline(always)]
fn read<'m, S: Simd>(
    simd: S,
    mesh: &TriangleMesh<'m>,
    near: &mut LastPart<'m>,
    reader: &mut Reader<'_>,
    id: u32,
    sides: &mut Sides,
) {
    let mut found = near.corners(id);
    if found.is_none() && !near.own(id).0.is_empty() {
        *near = mesh.part_around(id);
        found = near.corners(id);
    }
    let Some([a, b, c]) = found else {
        let corners = reader.corners(id).or_bug("no such triangle").unwrap_or_default();
        let [a, b, c] = corners;
        let ([x, y, z], [u, v, w]) = (a.min(b).min(c).to_array(), (-a.max(b).max(c)).to_array());
        *sides = [x, y, z, 0.0, u, v, w, 0.0];
        return;
    };
    let (a, b, c) = (load(simd, a), load(simd, b), load(simd, c));
    let (low, high): (f32x4<S>, f32x4<S>) = (a.lesser(b).lesser(c), a.greater(b).greater(c));
    // Store all eight numbers at once: a load that spans two stores would wait for both.
    low.combine(f32x4::splat(simd, 0.0) - high).store_slice(sides);
}

/// Checks that every triangle names vertices of the mesh, and that at least as many triangles are non-finite as the
/// build left out.
fn check_mesh(header: &Header, mesh: &TriangleMesh<'_>) -> Result<(), Error> {
    // Most meshes are finite: a pass over the vertices shows that sooner than one over the triangles.
    if header.skipped_count == 0 && mesh.is_finite() {
        return match mesh.first_without_vertices() {
            Some(triangle) => Err(Error::IndexOutOfRange { triangle }),
            None => Ok(()),
        };
    }
    let strict = if header.skipped_count == 0 { BuildFlags::STRICT } else { BuildFlags::empty() };
    let survey = Survey::of(mesh, strict, &Watch::none())?;
    if survey.skipped_count < header.skipped_count {
        return Err(Error::MeshMismatch);
    }
    Ok(())
}

/// The SAH cost of a tree: the nodes visited and triangles tested by a random line that meets its box, on
/// average (Goldsmith and Salmon 1987).
#[derive(Default)]
struct Cost {
    /// Half the surfaces of children, weighted.
    sum: f64,
    /// Half the surface of the root.
    area: f64,
}

impl Cost {
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, node: &Node, is_root: bool) {
        self.sum += node.weight(simd);
        if is_root {
            self.area = node.surface();
        }
    }

    fn total(&self) -> f64 {
        // The root itself is visited.
        if self.area > 0.0 { 1.0 + self.sum / self.area } else { 1.0 }
    }
}

impl Node {
    /// The places of the ids in all leaves of a node; `None` if a leaf has too many.
    #[inline(always)]
    fn ids_of_leaves(&self) -> Option<Range<usize>> {
        let largest = self.counts.iter().fold(0, |largest, &count| largest.max(count));
        let count = self.counts.iter().fold(0, |sum, &count| sum + u32::from(count));
        if usize::from(largest) > LEAF {
            return None;
        }
        // The first id of a node without leaves may lie anywhere.
        let first = if count == 0 { 0 } else { self.first };
        Some(first as usize..(first as usize).checked_add(count as usize)?)
    }

    /// Half the surfaces of the children's boxes, each times what it costs to enter it: one for a node, and one for
    /// each triangle of a leaf. A leaf has no more than [`LEAF`], so the sums are below 2^23, and exact in f32.
    #[inline(always)]
    fn weight<S: Simd>(&self, simd: S) -> f64 {
        let inner = core::array::from_fn(|slot| (self.inner() >> slot & 1) as u8);
        let (inner, counts) = floats(simd, inner, self.counts);
        let cost = inner + counts;
        let [a, b, c, d, e, f] = self.bounds;
        let (x, y, z) = (floats(simd, a, d), floats(simd, b, e), floats(simd, c, f));
        let none = f32x8::splat(simd, 0.0);
        let x = (x.1 - x.0).greater(none);
        let y = (y.1 - y.0).greater(none);
        let z = (z.1 - z.0).greater(none);
        let (cost_x, cost_z) = (cost * x, cost * z);
        let products: [[f32; WIDTH]; 3] =
            [(cost_x * y).into(), (cost_z * y).into(), (cost_z * x).into()];
        self.area(products.map(|areas| areas.iter().sum()))
    }

    /// Half the surface of the box around all children.
    fn surface(&self) -> f64 {
        let extent = |low: &[u8; 8], high: &[u8; 8]| {
            let low = low.iter().min().copied().unwrap_or(0);
            let high = high.iter().max().copied().unwrap_or(0);
            f32::from(high.saturating_sub(low))
        };
        let [min_x, min_y, min_z, max_x, max_y, max_z] = &self.bounds;
        let [x, y, z] = [extent(min_x, max_x), extent(min_y, max_y), extent(min_z, max_z)];
        self.area([x * y, y * z, z * x])
    }

    /// Products of steps in x and y, y and z, z and x, as a surface.
    #[inline(always)]
    fn area(&self, products: [f32; 3]) -> f64 {
        let [x, y, z] = self.steps().map(f64::from);
        let [xy, yz, zx] = products.map(f64::from);
        xy * (x * y) + yz * (y * z) + zx * (z * x)
    }
}
