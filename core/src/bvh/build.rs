//! Building a tree: passes that sort triangles into bins, then bin after bin in cache, then a tree on top.
//!
//! One pass over the vertices finds their box. One over the triangles finds their keys; it runs twice if unused
//! vertices widen the box. One over the keys moves entries into bins. The triangles are read again when their bin is
//! split.
//!
//! ```text
//! bounds    the box of the vertices; of the triangles if some vertices are unused  (mesh/)
//! census    each triangle's key, and how many there are in each bin             (census.rs, key.rs)
//! scatter   each triangle's entry into its bin                                  (scatter.rs)
//! subtrees  bins sorted and split into subtrees                                 (subtrees.rs, subtree.rs)
//! top       a tree over the subtrees                                            (top.rs)
//!
//! index   | header | ids (first the keys, then centres) | nodes: root | subtrees of all tasks (first centres) | top |
//!         | fine sides |
//! scratch | counts of tasks, sizes of bins | entries (then records of roots, items, fine sides) | spare |
//! ```
//!
//! `spare` is the second buffer when a unit is sorted. While a crowded bin is divided, its centres lie in the index;
//! `spare` holds those that have no room there. `sizes` computes the exact size by a build without an index: it also
//! puts the keys and the top tree into `spare`, and only counts ids and nodes; fine sides stay in `entries`. A build
//! puts the keys there, too, if they do not fit into the index: an index of exact size has no room for keys of
//! triangles that are skipped.
//!
//! Each step but the last is cut into tasks: the passes by triangles, the subtrees by units. The tree does not depend
//! on the number of tasks: a bin has its entries in the order of their ids, and subtrees end up side by side in the
//! order of the units, those of crowded bins first.

#![expect(
    clippy::cast_possible_truncation,
    reason = "numbers of triangles, bins and nodes, which fit into 32 bits"
)]

use core::ops::Range;

use fearless_simd::Simd;
use glam::Vec3A;
use zerocopy::{FromZeros, IntoBytes};

use super::census::{Census, count};
use super::fine::{FineList, FineSides, most_fine};
use super::high;
use super::index::{Contents, clear_header, cut_index, finish, move_nodes};
use super::key::{KEY_BITS, Keys};
use super::layout::{
    CROWD, Entry, MOST_TRIANGLES, bin_bits, index_bytes, most_below, most_nodes, scratch_bytes,
    small_spare,
};
use super::node::{Node, least_node};
use super::sah::{Item, item};
use super::scatter::{place_tasks, scatter};
use super::subtree::Subtree;
use super::subtrees::{RECORD, RootRecord, Subtrees};
use super::top::{self, ITEM, Top};
use super::units::{SEAM, Units, is_seam};
use crate::aabb::Aabb;
use crate::arena::{Sizes, first_mut, move_down, split_mut, whole};
use crate::blob::{HEADER_BYTES, Header};
use crate::cell::Lattice;
use crate::config::BuildFlags;
use crate::control::{Control, Watch};
use crate::error::{Error, Region};
use crate::invariant::OrBug;
use crate::mesh::TriangleMesh;
use crate::method::Quality;
use crate::simd::{IS_SMALL, Kernel, SimdLevel, dispatch};
use crate::tasks::{self, run, run_several, share, take, take_up_to, task_count};

/// The memory that any mesh with so many triangles and a build with so many tasks needs.
pub(crate) const fn bound(triangles: u32, quality: Quality, tasks: u32) -> Option<(u64, u64)> {
    if triangles > MOST_TRIANGLES { None } else { Some(bytes(triangles, quality, tasks)) }
}

/// Bytes of index and scratch that are enough.
pub(super) const fn bytes(triangles: u32, quality: Quality, tasks: u32) -> (u64, u64) {
    match quality {
        Quality::Fast => fast_bound(triangles, tasks),
        Quality::High => high::bound(triangles),
    }
}

const fn fast_bound(triangles: u32, tasks: u32) -> (u64, u64) {
    let nodes = most_nodes(triangles) as u64;
    let triangles = triangles as u64;
    let most = Control::MAX_TASKS;
    let tasks = if tasks > most { most } else { tasks };
    let tasks = if tasks < 1 { 1 } else { tasks } as u64;
    let index = index_bytes(triangles, nodes, most_fine(triangles));
    (index, scratch_bytes(triangles, tasks, triangles))
}

/// The memory that a mesh needs: exact for one task if the scratch is large enough for any mesh.
pub(crate) fn sizes(
    mesh: &TriangleMesh<'_>,
    quality: Quality,
    flags: BuildFlags,
    scratch: &mut [u8],
    control: &Control<'_>,
) -> Result<Sizes, Error> {
    check_count(mesh)?;
    let (index, needed) = bytes(mesh.triangle_count(), quality, control.tasks);
    if control.tasks <= 1 && scratch.len() as u64 >= needed {
        let watch = &Watch::none();
        let header = header_of(mesh, quality, flags, None, scratch, &Control::SERIAL, watch)?;
        return Sizes::new(header.blob_bytes, needed, true);
    }
    Sizes::new(index, needed, false)
}

fn check_count(mesh: &TriangleMesh<'_>) -> Result<(), Error> {
    if mesh.triangle_count() <= MOST_TRIANGLES { Ok(()) } else { Err(Error::TooManyTriangles) }
}

/// Builds into `index` and returns the part of it that is the blob.
pub(crate) fn build<'a>(
    mesh: &TriangleMesh<'_>,
    quality: Quality,
    flags: BuildFlags,
    index: &'a mut [u8],
    scratch: &mut [u8],
    control: &Control<'_>,
    watch: &Watch<'_>,
) -> Result<&'a [u8], Error> {
    check_count(mesh)?;
    let header = header_of(mesh, quality, flags, Some(&mut *index), scratch, control, watch)?;
    let blob = first_mut(index, header.blob_bytes, Region::Index)?;
    if let Some(head) = blob.first_chunk_mut::<HEADER_BYTES>().or_bug("a blob without a header") {
        *head = header.to_bytes();
    }
    Ok(blob)
}

/// Builds all but the header by the method that the quality names.
fn header_of(
    mesh: &TriangleMesh<'_>,
    quality: Quality,
    flags: BuildFlags,
    index: Option<&mut [u8]>,
    scratch: &mut [u8],
    control: &Control<'_>,
    watch: &Watch<'_>,
) -> Result<Header, Error> {
    match quality {
        Quality::Fast => build_in(mesh, flags, index, scratch, control, watch),
        Quality::High => high::build_in(mesh, flags, index, scratch, control, watch),
    }
}

/// The progress at which each step of a build begins, as an approximate fraction.
const CENSUS: f32 = 0.02;
const SCATTER: f32 = 0.15;
const SUBTREES: f32 = 0.25;
const TOP: f32 = 0.8;

/// Builds everything but the header, which it returns. Without an index it only computes the size.
#[inline(never)]
fn build_in(
    mesh: &TriangleMesh<'_>,
    flags: BuildFlags,
    mut index: Option<&mut [u8]>,
    scratch: &mut [u8],
    control: &Control<'_>,
    watch: &Watch<'_>,
) -> Result<Header, Error> {
    let triangles = mesh.triangle_count();
    let all = u64::from(triangles);
    let index_available = index.as_ref().map_or(0, |index| index.len()) as u64;
    let index_error = |needed| Error::out_of_memory(Region::Index, needed, index_available);
    let available_bytes = scratch.len() as u64;
    // Report the need of a whole `spare`: only the census, below, shows whether bins are crowded.
    let needed_bytes = scratch_bytes(all, 1, all);
    let scratch_error = Error::out_of_memory(Region::Scratch, needed_bytes, available_bytes);

    // Fewer tasks where there is no memory for more.
    let mut tasks = task_count(control, triangles as usize / SEAM);
    let fits = |tasks: u32| match tasks {
        1 => available_bytes >= scratch_bytes(all, 1, small_spare(all)),
        _ => {
            available_bytes >= scratch_bytes(all, tasks.into(), all)
                && index_available >= fast_bound(triangles, tasks).0
        }
    };
    while tasks > 1 && !fits(tasks) {
        tasks /= 2;
    }
    if !fits(tasks) {
        return Err(scratch_error);
    }

    // Cut the scratch, and the ids out of the index.
    let bits = bin_bits(all);
    let bins = 1_usize << bits;
    let (counts, rest) =
        split_mut::<u32>(scratch, u64::from(tasks) << bits).ok_or(scratch_error)?;
    counts.fill(0);
    let (sizes, rest) = split_mut::<u32>(rest, bins as u64).ok_or(scratch_error)?;
    let (entries, spare) = split_mut::<Entry>(rest, all).ok_or(scratch_error)?;
    let spare = whole::<Entry>(spare);
    let has_whole_spare = spare.len() as u64 >= all;
    clear_header(&mut index);
    let (mut keys, _) = cut_index(&mut index, triangles);
    if keys.len() < triangles as usize {
        // There are fewer ids than keys if triangles are skipped.
        let room = spare.as_flattened_mut().get_mut(..triangles as usize);
        keys = room.filter(|_| has_whole_spare).ok_or(index_error(fast_bound(triangles, 1).0))?;
    }

    // Find the box, then every triangle's key.
    watch.at(CENSUS)?;
    let census = find_keys(mesh, flags, keys, counts, bits, control)?;
    let Census { finite, bounds } = census;

    // Give each bin its place, and each task its place in it.
    watch.at(SCATTER)?;
    debug_assert!(counts.len() == tasks as usize * sizes.len(), "a bin of a task without a count");
    for (bin, size) in sizes.iter_mut().enumerate() {
        *size = (0..tasks as usize).filter_map(|task| counts.get(task << bits | bin)).sum();
    }
    let is_crowded = sizes.iter().any(|&size| size as usize > CROWD);
    if is_crowded && !has_whole_spare {
        return Err(scratch_error);
    }
    place_tasks(sizes, counts, bits);
    debug_assert!(finite as usize <= entries.len(), "more finite triangles than entries");
    let entries = entries.get_mut(..finite as usize).unwrap_or_default();
    scatter(keys, entries, counts, bits, control)?;

    // Split bins into subtrees.
    watch.at(SUBTREES)?;
    let (ids, nodes) = cut_index(&mut index, finite);
    let bounds = Lattice::pad(&bounds);
    let (least, shift) = (least_node(&bounds), KEY_BITS - bits);
    let work = BuildInputs { mesh, bounds, least, sizes, shift };
    let totals = if IS_SMALL || tasks == 1 {
        work.subtrees(entries, &mut *spare, ids, nodes, counts, watch)?
    } else {
        work.subtrees_of_tasks(entries, &mut *spare, ids, nodes, counts, control)?
    };

    // Build the tree on top of them.
    watch.at(TOP)?;
    let tree = work.top(entries, spare, nodes, &totals);
    let contents = tree.ok_or(index_error(fast_bound(triangles, 1).0))?;
    finish(mesh, Quality::Fast, bounds, index, finite, contents)
}

/// Finds the key of every triangle. Each task counts its triangles of each bin.
fn find_keys(
    mesh: &TriangleMesh<'_>,
    flags: BuildFlags,
    keys: &mut [u32],
    counts: &mut [u32],
    bits: u32,
    control: &Control<'_>,
) -> Result<Census, Error> {
    let vertices = vertex_bounds(mesh, counts.len() >> bits, control)?;
    let rule = Keys::new(&vertices);
    let census = count(mesh, flags, &rule, keys, counts, bits, control)?;
    if census.bounds == vertices || census.finite == 0 {
        return Ok(census);
    }
    // Unused vertices would coarsen the keys: compute them in the box of the triangles.
    counts.fill(0);
    let rule = Keys::new(&census.bounds);
    count(mesh, flags, &rule, keys, counts, bits, control)
}

/// The box of all vertices, used or not.
fn vertex_bounds(
    mesh: &TriangleMesh<'_>,
    tasks: usize,
    control: &Control<'_>,
) -> Result<Aabb, Error> {
    let vertices = mesh.vertex_count();
    let mut bounds = Aabb::EMPTY;
    run(
        control,
        (0..tasks).map(|task| share(vertices, task, tasks)),
        |part| mesh.vertex_bounds(part),
        |part| {
            bounds = bounds.union(&part);
            Ok(())
        },
    )?;
    Ok(bounds)
}

/// The inputs that the steps after binning share.
struct BuildInputs<'w> {
    mesh: &'w TriangleMesh<'w>,
    /// The box of the tree.
    bounds: Aabb,
    /// [`least_node`] of the tree.
    least: f32,
    /// Entries of each bin.
    sizes: &'w [u32],
    /// Number of low key bits that do not choose a bin.
    shift: u32,
}

/// A task: its share of the units, and the memory for their subtrees.
struct UnitsTask<'w, F> {
    work: &'w BuildInputs<'w>,
    /// The entries of the units among all.
    range: Range<usize>,
    entries: &'w mut [Entry],
    spare: &'w mut [Entry],
    ids: &'w mut [u32],
    nodes: &'w mut [Node],
    /// The number of the first of the nodes in the index.
    child: u32,
    counts: &'w mut [u32],
    /// Is told how many entries of all are done, and says whether to go on.
    goes_on: F,
}

/// The numbers of nodes and subtrees that a task made, and where its entries and nodes start.
#[derive(Clone, Copy, Default)]
struct Made {
    first: u32,
    child: u32,
    nodes: u32,
    subtrees: u32,
}

impl<F: FnMut(usize) -> bool> Kernel for UnitsTask<'_, F> {
    type Output = (Made, RootRecord);

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Self::Output {
        let Self { work, range, entries, spare, ids, nodes, child, counts, mut goes_on } = self;
        let BuildInputs { mesh, least, sizes, shift, .. } = *work;
        let first = range.start as u32;
        let mut subtrees = Subtrees {
            mesh,
            least,
            entries,
            spare,
            ids,
            first,
            nodes,
            child,
            counts,
            subtree: &mut Subtree::new(),
            simd_level: SimdLevel::detect(),
            node_count: 0,
            subtree_count: 0,
            last: RootRecord::new_zeroed(),
        };
        let units = Units::new(sizes).skip_while(|unit| unit.start < range.start);
        let mut end = range.start;
        for unit in units.take_while(|unit| unit.start < range.end) {
            debug_assert!(unit.start == end, "entries between units");
            end = unit.end;
            subtrees.unit(unit.start - range.start..unit.end - range.start, shift, 0);
            if !goes_on(end) {
                // The build was cancelled: nothing that it made is used.
                end = range.end;
                break;
            }
        }
        debug_assert!(end == range.end, "the units of a task end elsewhere than its entries");
        let made =
            Made { first, child, nodes: subtrees.node_count, subtrees: subtrees.subtree_count };
        (made, subtrees.last)
    }
}

impl BuildInputs<'_> {
    /// Makes the subtrees and their records in one task. `spare` may be shorter than the entries.
    fn subtrees(
        &self,
        entries: &mut [Entry],
        spare: &mut [Entry],
        ids: &mut [u32],
        nodes: &mut [Node],
        counts: &mut [u32],
        watch: &Watch<'_>,
    ) -> Result<TaskTotals, Error> {
        // The root of the tree is the first node.
        let (range, child, all) = (0..entries.len(), 1, entries.len() as u32);
        let mut result = Ok(());
        let goes_on = |done: usize| {
            result = watch.between(done as u32, all, [SUBTREES, TOP]);
            result.is_ok()
        };
        // Empty `nodes` are legal: nodes are only counted then.
        let nodes = nodes.get_mut(1..).unwrap_or_default();
        let task =
            UnitsTask { work: self, range, entries, spare, ids, nodes, child, counts, goes_on };
        let (made, last) = dispatch(SimdLevel::detect(), task);
        result?;
        Ok(TaskTotals { nodes: 1 + made.nodes, subtrees: made.subtrees, last })
    }

    /// [`subtrees`](Self::subtrees) with several tasks. Out of line: their results take stack.
    #[inline(never)]
    fn subtrees_of_tasks(
        &self,
        entries: &mut [Entry],
        spare: &mut [Entry],
        ids: &mut [u32],
        nodes: &mut [Node],
        counts: &mut [u32],
        control: &Control<'_>,
    ) -> Result<TaskTotals, Error> {
        let bits = KEY_BITS - self.shift;
        let tasks = counts.len() >> bits;
        let mut ends = [0; tasks::MOST];
        self.find_ends(&mut ends, tasks, entries.len());
        // The root of the tree is the first node.
        debug_assert!(!nodes.is_empty(), "several tasks without room for nodes");
        let (mut rest_of_nodes, mut child) = (nodes.get_mut(1..).unwrap_or_default(), 1);
        let (mut rest, mut spare, mut ids) = (&mut *entries, spare, ids);
        let mut start = 0;
        let mut all_counts = counts;
        let parts = (0..tasks).map(|task| {
            let counts = take(&mut all_counts, 1 << bits);
            let end = ends.get(task).copied().or_bug("too many tasks").unwrap_or(start);
            let (count, is_last) = (end - start, task + 1 == tasks);
            let entries = take(&mut rest, count);
            let ids = take_up_to(&mut ids, count);
            let room =
                if is_last { rest_of_nodes.len() } else { most_below(count as u32) as usize };
            let nodes = take_up_to(&mut rest_of_nodes, room);
            let room_to_sort = if is_last { spare.len() } else { count };
            let spare = take(&mut spare, room_to_sort);
            let range = start..end;
            // Only the thread that builds may report progress.
            let goes_on = |_| true;
            let part =
                UnitsTask { work: self, range, entries, spare, ids, nodes, child, counts, goes_on };
            start = end;
            child += room as u32;
            part
        });
        let simd_level = SimdLevel::detect();
        let mut results = [const { None }; tasks::MOST];
        let mut slots = results.iter_mut();
        run_several(
            control,
            parts,
            |part| dispatch(simd_level, part),
            |result| {
                if let Some(slot) = slots.next().or_bug("more results than tasks") {
                    *slot = Some(result);
                }
                Ok(())
            },
        )?;

        // Move nodes and records together.
        let mut all = TaskTotals { nodes: 1, subtrees: 0, last: RootRecord::new_zeroed() };
        for (made, last) in results.into_iter().flatten() {
            let moved = made.child - all.nodes;
            move_nodes(nodes, made.child..made.child + made.nodes, all.nodes);
            let to = all.subtrees as usize * RECORD;
            let from = made.first as usize;
            let records = from..from + made.subtrees as usize * RECORD;
            all.nodes += made.nodes;
            all.subtrees += made.subtrees;
            if made.subtrees == 1 {
                // Write the record again: a task with fewer entries than a record takes had no room for it.
                all.last = last;
                all.last.node.child -= moved;
                all.last.write(entries.get_mut(to..));
            } else if let Some(of_task) = entries.get_mut(records.clone()).or_bug("too few entries")
            {
                for record in whole::<RootRecord>(of_task.as_mut_bytes()) {
                    record.node.child -= moved;
                }
                move_down(entries, records, to);
            }
        }
        Ok(all)
    }

    /// Finds where the units of each task end: at the seam nearest to the end of an equal share of the entries. A task
    /// may have no entries, and the last one ends behind the last entry.
    fn find_ends(&self, ends: &mut [usize], tasks: usize, entries: usize) {
        let units = Units::new(self.sizes).filter(|unit| is_seam(unit) || unit.end == entries);
        let mut seams = units.map(|unit| unit.end).peekable();
        let mut end = 0_usize;
        for (task, slot) in ends.iter_mut().enumerate().take(tasks) {
            let goal = share(entries, task, tasks).end;
            while let Some(seam) = seams.next_if(|seam| seam.abs_diff(goal) <= end.abs_diff(goal)) {
                end = seam;
            }
            *slot = end;
        }
        debug_assert!(end == entries, "the units end before the entries");
    }

    /// Builds the tree over the roots, behind their nodes, or in `spare` if the index has no room; returns the contents
    /// of the index, or `None` if neither has room.
    fn top<'e>(
        &self,
        entries: &'e mut [Entry],
        spare: &mut [Entry],
        nodes: &mut [Node],
        all: &TaskTotals,
    ) -> Option<Contents<'e>> {
        // A single root is the whole tree.
        if all.subtrees < 2 {
            // Empty `nodes` are legal: nodes are only counted then.
            if let Some(root) = nodes.first_mut() {
                *root = if all.subtrees == 1 { all.last.node } else { Node::EMPTY };
            }
            return Some(Contents { nodes: all.nodes, levels: all.last.levels.max(1), fine: &[] });
        }
        let roots = all.subtrees as usize;
        debug_assert!(
            roots * (RECORD + ITEM) <= entries.len(),
            "too few entries for the records of the roots"
        );
        let (records, rest) = entries.split_at_mut_checked(roots * RECORD)?;
        let records = &*whole::<RootRecord>(records.as_mut_bytes());
        let (items, rest) = rest.split_at_mut_checked(roots * ITEM)?;
        let items = whole::<Item>(items.as_mut_bytes());
        let mut room = whole::<FineSides>(rest.as_mut_bytes());
        let most = most_fine(self.mesh.triangle_count().into());
        let mut fine = FineList::new(take_up_to(&mut room, most as usize));
        let record = |at: u32| {
            let record = records.get(at as usize).or_bug("an item without a record");
            record.map_or((Node::EMPTY, 0), |r| (r.node, r.levels))
        };
        let mut build = |nodes: &mut [Node]| {
            for (at, (slot, record)) in (0..).zip(items.iter_mut().zip(records)) {
                let (min, max) = (Vec3A::from_array(record.min), Vec3A::from_array(record.max));
                *slot = item(&Aabb { min, max }, at, record.count.div_ceil(4));
            }
            top::build(items, &self.bounds, record, nodes, all.nodes, &mut fine)
        };
        let behind = nodes.get_mut(all.nodes as usize..).and_then(&mut build);
        let Top { root, count, levels } = behind.or_else(|| build(whole(spare.as_mut_bytes())))?;
        // Empty `nodes` are legal: nodes are only counted then.
        if let Some(slot) = nodes.first_mut() {
            *slot = root;
        }
        Some(Contents { nodes: all.nodes + count, levels, fine: fine.finish() })
    }
}

/// The sums over all tasks.
struct TaskTotals {
    /// Nodes, with one for the root of all.
    nodes: u32,
    subtrees: u32,
    /// The record of the last root.
    last: RootRecord,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_end_at_the_seams_nearest_to_their_shares() {
        let (positions, indices) = ([[0.0; 3]; 3], [[0, 1, 2]]);
        let mesh = &TriangleMesh::new(&positions, &indices).unwrap();
        let sizes = &[64; 5 * SEAM / 64];
        let work = BuildInputs { mesh, bounds: Aabb::EMPTY, least: 1.0, sizes, shift: 0 };
        let ends_of = |tasks: usize| {
            let mut ends = [0; tasks::MOST];
            work.find_ends(&mut ends, tasks, 5 * SEAM);
            ends
        };
        let seam = |number: usize| number * SEAM;
        // Of two that are as near, the later one.
        assert_eq!(ends_of(2)[..2], [3, 5].map(seam));
        assert_eq!(ends_of(3)[..3], [2, 3, 5].map(seam));
        assert_eq!(ends_of(1)[0], seam(5));
        // More tasks than seams: the first has nothing.
        let ends = ends_of(tasks::MOST);
        assert!(ends[0] == 0 && ends.is_sorted() && ends[tasks::MOST - 1] == seam(5));
    }
}
