//! Refit: new boxes for a tree whose triangles moved, in place.
//!
//! ```text
//! check   the mesh has the triangles of the tree; walking down from the root meets each node once
//! refit   depth first: the boxes of a node's leaves, then those of its child nodes, which are on the stack
//!         once these are done; quantise all eight, hand their union to the parent
//! ```
//!
//! The check finds all errors, so nothing is written before an error. The boxes are those of a build with
//! the same leaves.

use glam::Vec3A;

use super::build::least_node;
use super::node::{Child, LEAF, Node, WIDTH};
use super::walk::FEW_LEVELS;
use super::{Bvh, LEVELS};
use crate::aabb::Aabb;
use crate::arena::split_mut;
use crate::blob::{HEADER_BYTES, Header, corrupt};
use crate::cell::Lattice;
use crate::config::BuildFlags;
use crate::control::Watch;
use crate::error::Error;
use crate::invariant::OrBug;
use crate::mesh::TriangleMesh;
use crate::survey::Survey;

/// Gives a tree the boxes of a mesh that moved, in a blob that opens; returns the SAH costs before and after.
pub(crate) fn refit(blob: &mut [u8], mesh: &TriangleMesh<'_>) -> Result<[f64; 2], Error> {
    let mut header = Header::read(blob, mesh)?;
    check_mesh(&header, mesh)?;
    let (levels, before) = Bvh::open(&header, blob)?.check(&header, mesh)?;
    let scene = Lattice::pad(&mesh.vertex_bounds(0..mesh.vertex_count()));
    let sections = blob.get_mut(HEADER_BYTES..).and_then(|behind| {
        let (ids, behind) = split_mut::<u32>(behind, header.reference_count.into())?;
        Some((&*ids, split_mut::<Node>(behind, header.node_count.into())?.0))
    });
    let (ids, nodes) = sections.ok_or(corrupt(core::mem::offset_of!(Header, blob_bytes)))?;
    let tree = Tree { mesh, ids, nodes, least: least_node(&scene) };
    let (bounds, after) = if levels <= FEW_LEVELS {
        tree.refit::<{ FEW_LEVELS as usize }>()
    } else {
        tree.refit::<{ LEVELS as usize }>()
    };
    let scene = Lattice::pad(&bounds);
    (header.bounds_min, header.bounds_max) = (scene.min.to_array(), scene.max.to_array());
    if let Some(head) = blob.first_chunk_mut::<HEADER_BYTES>().or_bug("a blob without a header") {
        *head = header.to_bytes();
    }
    Ok([before, after])
}

impl Bvh<'_> {
    /// Finds all that could be wrong with nodes and ids; returns the levels of nodes and the SAH cost.
    fn check(&self, header: &Header, mesh: &TriangleMesh<'_>) -> Result<(u32, f64), Error> {
        let triangles = mesh.triangle_count();
        if let Some(word) = self.ids.iter().position(|&id| id >= triangles) {
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
        // Every node on the way down, and its child nodes that are still to be looked at.
        let mut path = [(0, 0); LEVELS as usize];
        let (mut depth, mut deepest) = (0, 1);
        let mut unmet = self.nodes.len();
        let mut cost = Cost::default();
        let mut next = Some(0_u32);
        loop {
            if let Some(number) = next.take() {
                let node = self.nodes.get(number as usize).ok_or(self.wrong_node(number))?;
                unmet = unmet.checked_sub(1).ok_or(self.wrong_node(number))?;
                for slot in 0..8 {
                    let Child::Leaf { first, count } = node.child(slot) else { continue };
                    let end = u64::from(first) + u64::from(count);
                    let is_inside = count == 0 || end <= self.ids.len() as u64;
                    if count as usize > LEAF || !is_inside {
                        return Err(self.wrong_node(number));
                    }
                }
                *path.get_mut(depth).ok_or(self.wrong_node(number))? = (number, node.inner());
                depth += 1;
                deepest = deepest.max(depth);
                cost.add(node, number == 0);
            }
            let above = depth.checked_sub(1).and_then(|above| path.get_mut(above));
            let Some((number, rest)) = above else { break };
            if *rest == 0 {
                depth -= 1;
                continue;
            }
            let slot = rest.trailing_zeros();
            *rest &= *rest - 1;
            let node = self.nodes.get(*number as usize).ok_or(self.wrong_node(*number))?;
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
    /// No step of a node is smaller than that of a box of this size.
    least: f32,
}

/// The corners of a box, tight.
type BoxCorners = [[f32; 3]; 2];

/// A node whose children get their boxes.
#[derive(Clone, Copy)]
struct RefitNode {
    number: u32,
    /// Child nodes that have no box yet, and the one that is about to get it.
    rest: u32,
    slot: u32,
    boxes: [BoxCorners; WIDTH],
}

impl Tree<'_> {
    /// Writes the boxes of all nodes, in no more than `N` levels; returns the root's and the SAH cost.
    #[inline(never)]
    fn refit<const N: usize>(self) -> (Aabb, f64) {
        let Self { mesh, ids, nodes, least } = self;
        let mut reader = mesh.reader();
        let none = [[0.0; 3]; 2];
        let mut levels = [RefitNode { number: 0, rest: 0, slot: 0, boxes: [none; WIDTH] }; N];
        let mut cost = Cost::default();
        let (mut depth, mut next) = (0, Some(0_u32));
        while let Some(level) = levels.get_mut(depth) {
            if let Some(number) = next.take() {
                level.number = number;
                let node = nodes.get(number as usize).or_bug("a child that is no node");
                let Some(node) = node else { break };
                level.rest = node.inner();
                for (slot, corners) in (0..).zip(&mut level.boxes) {
                    let mut bounds = Aabb::EMPTY;
                    // The first id of an unused slot may lie anywhere: the check does not look at it.
                    if let Child::Leaf { first, count: count @ 1.. } = node.child(slot) {
                        let first = first as usize;
                        let leaf = ids.get(first..first.saturating_add(count as usize));
                        for &id in leaf.or_bug("a leaf behind the ids").unwrap_or_default() {
                            let corners = reader.corners(id).or_bug("no such triangle");
                            let Some([a, b, c]) = corners else { continue };
                            bounds.min = bounds.min.min(a.min(b).min(c));
                            bounds.max = bounds.max.max(a.max(b).max(c));
                        }
                    }
                    *corners = [bounds.min.to_array(), bounds.max.to_array()];
                }
            }
            let node = nodes.get_mut(level.number as usize).or_bug("a child that is no node");
            let Some(node) = node else { break };
            if level.rest != 0 {
                level.slot = level.rest.trailing_zeros();
                level.rest &= level.rest - 1;
                if let Child::Inner(child) = node.child(level.slot) {
                    next = Some(child);
                    depth += 1;
                }
                continue;
            }
            let boxes = level.boxes.map(|[min, max]| Aabb {
                min: Vec3A::from_array(min),
                max: Vec3A::from_array(max),
            });
            let bounds = boxes.iter().fold(Aabb::EMPTY, |all, child| all.union(child));
            if node.used() != 0 {
                node.set_boxes(&bounds, &boxes, least);
            }
            cost.add(node, level.number == 0);
            let Some(above) = depth.checked_sub(1) else { return (bounds, cost.total()) };
            depth = above;
            if let Some(RefitNode { slot, boxes, .. }) = levels.get_mut(above)
                && let Some(corners) = boxes.get_mut(*slot as usize)
            {
                *corners = [bounds.min.to_array(), bounds.max.to_array()];
            }
        }
        debug_assert!(false, "the check did not walk the same way");
        (Aabb::EMPTY, cost.total())
    }
}

/// Checks that every triangle names vertices of the mesh, and that at least as many triangles are non-finite as the
/// build left out.
fn check_mesh(header: &Header, mesh: &TriangleMesh<'_>) -> Result<(), Error> {
    // Most meshes are finite, which vertices tell sooner than triangles.
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
    fn add(&mut self, node: &Node, is_root: bool) {
        self.sum += node.weight();
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
    /// Half the surfaces of the children's boxes, each times what it costs to enter it: one for a node, and
    /// one for each triangle of a leaf.
    fn weight(&self) -> f64 {
        let mut sums = [0_u32; 3];
        for slot in 0..WIDTH {
            let is_inner = self.inner() >> slot & 1;
            let cost = is_inner + u32::from(self.counts[slot]);
            let [x, y, z] = [0, 1, 2].map(|axis| {
                u32::from(self.bounds[axis + 3][slot].saturating_sub(self.bounds[axis][slot]))
            });
            sums[0] += cost * x * y;
            sums[1] += cost * y * z;
            sums[2] += cost * z * x;
        }
        self.area(sums)
    }

    /// Half the surface of the box around all children.
    fn surface(&self) -> f64 {
        let extent = |low: &[u8; 8], high: &[u8; 8]| {
            let low = low.iter().min().copied().unwrap_or(0);
            let high = high.iter().max().copied().unwrap_or(0);
            u32::from(high.saturating_sub(low))
        };
        let [min_x, min_y, min_z, max_x, max_y, max_z] = &self.bounds;
        let [x, y, z] = [extent(min_x, max_x), extent(min_y, max_y), extent(min_z, max_z)];
        self.area([x * y, y * z, z * x])
    }

    /// Products of steps in x and y, y and z, z and x, as a surface.
    fn area(&self, products: [u32; 3]) -> f64 {
        let [x, y, z] = self.steps().map(f64::from);
        let [xy, yz, zx] = products.map(f64::from);
        xy * (x * y) + yz * (y * z) + zx * (z * x)
    }
}
