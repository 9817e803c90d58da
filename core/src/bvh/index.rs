//! The index while a tree is built: cut into ids and nodes, filled from the front, closed by its header.
//!
//! ```text
//! | header | ids | nodes: root | nodes in the order in which they are made | fine sides | zeros |
//! ```
//!
//! Both builders use it, that of `fast` and that of `high`. A build without an index only counts what it would write.

#![expect(
    clippy::cast_possible_truncation,
    reason = "bytes of an index that exists, which fit into memory"
)]

use core::ops::Range;

use zerocopy::IntoBytes;

use super::fine::FineSides;
use super::layout::index_bytes;
use super::node::Node;
use crate::aabb::Aabb;
use crate::arena::{first_mut, move_down, section_bytes, split_mut, whole};
use crate::blob::{HEADER_BYTES, Header};
use crate::cell::Lattice;
use crate::config::Parameters;
use crate::error::{Error, Region};
use crate::invariant::OrBug;
use crate::mesh::TriangleMesh;
use crate::method::Quality;

/// Clears the header of an index: if the build ends early, the region must not open as a grid.
pub(super) fn clear_header(index: &mut Option<&mut [u8]>) {
    if let Some(header) = index.as_mut().and_then(|index| index.first_chunk_mut::<HEADER_BYTES>()) {
        header.fill(0);
    }
}

/// Returns the sections of an index for so many ids and for nodes. No index, or one that is too small, is legal: ids
/// and nodes for which there is no room are only counted.
pub(super) fn cut_index<'i>(
    index: &'i mut Option<&mut [u8]>,
    ids: u32,
) -> (&'i mut [u32], &'i mut [Node]) {
    let behind = index.as_mut().and_then(|index| index.get_mut(HEADER_BYTES..));
    let sections = behind.and_then(|behind| split_mut::<u32>(behind, ids.into()));
    let (ids, nodes) = sections.unwrap_or_default();
    (ids, whole(nodes))
}

/// Moves nodes together with their child nodes to an earlier place.
pub(super) fn move_nodes(nodes: &mut [Node], from: Range<u32>, to: u32) {
    let (moved, from) = (from.start - to, from.start as usize..from.end as usize);
    if moved > 0 {
        let found = nodes.get_mut(from.clone()).or_bug("nodes without room");
        for node in found.unwrap_or_default() {
            node.child -= moved;
        }
        move_down(nodes, from, to as usize);
    }
}

/// The nodes that a build has written, their levels, and the fine sides that it has yet to write.
#[derive(Clone, Copy)]
pub(super) struct Contents<'f> {
    pub(super) nodes: u32,
    pub(super) levels: u32,
    pub(super) fine: &'f [FineSides],
}

/// Ends a build: writes the fine sides, and zeros between and behind the sections, if there is an index; returns the
/// header. An index that is too small is an error.
pub(super) fn finish(
    mesh: &TriangleMesh<'_>,
    quality: Quality,
    bounds: Aabb,
    index: Option<&mut [u8]>,
    finite: u32,
    contents: Contents<'_>,
) -> Result<Header, Error> {
    let Contents { nodes, levels, fine } = contents;
    let needed_bytes = index_bytes(finite.into(), nodes.into(), fine.len() as u64);
    if let Some(index) = index {
        let blob = first_mut(index, needed_bytes, Region::Index)?;
        let ids_bytes = section_bytes::<u32>(finite.into()) as usize;
        let used = HEADER_BYTES + ids_bytes + nodes as usize * size_of::<Node>();
        if let Some(behind) = blob.get_mut(used..).or_bug("nodes behind the end of the index") {
            behind.fill(0);
        }
        let at = HEADER_BYTES + ids_bytes + section_bytes::<Node>(nodes.into()) as usize;
        for (slot, byte) in blob.get_mut(at..).into_iter().flatten().zip(fine.as_bytes()) {
            *slot = *byte;
        }
    }
    let lattice = Lattice::new(bounds, [1; 3]);
    let mut header = Header::new(Parameters::Bvh { quality }, mesh, &lattice);
    header.skipped_count = mesh.triangle_count() - finite;
    header.reference_count = finite;
    header.node_count = nodes;
    header.hash_count = fine.len() as u32;
    header.levels = levels;
    header.blob_bytes = needed_bytes;
    Ok(header)
}
