//! The build of quality high, for trees that many rays traverse: binned SAH from the root down, over single triangles.
//!
//! ```text
//! boxes     the box of each triangle, with its id: an item                  (mod.rs)
//! top       nodes over all items, until ranges are small enough for tasks   (grow.rs)
//! below     the nodes over each of these ranges
//!
//! index   | header | ids: of top nodes' leaves, then of each range | nodes: top | below each range | fine sides |
//! scratch | items: 32 B a triangle; the record of a range that is done replaces its items  | fine sides |
//! ```
//!
//! A node splits the range of its triangles until it has eight children, or all have four triangles or fewer, so that
//! none is a node. Only a range of nine or more is a node. So `n` triangles have one node, or (n - 2) / 7 at most. By
//! induction: let `j` of the children be nodes. For `j` = 0 one node is enough. Otherwise there are eight children;
//! those that are no nodes have a triangle or more each, so the others have n - (8 - j) at most, and there are 1 + (n -
//! (8 - j) - 2 j) / 7 = (n - 1 - j) / 7 nodes at most. A chain of nodes with seven leaves of one triangle has as many.
//!
//! The tree does not depend on the number of tasks: the ranges that tasks take are the same for any number, and
//! their nodes end up side by side in the order of the triangles.

#![expect(
    clippy::cast_possible_truncation,
    reason = "numbers of triangles and nodes, which fit into 32 bits"
)]

mod grow;

use fearless_simd::Simd;
use zerocopy::transmute;

use super::fine::{FineList, FineSides, most_fine};
use super::index::{Contents, clear_header, cut_index, finish, move_nodes};
use super::layout::index_bytes;
use super::node::Node;
use super::sah::{Item, item};
use crate::aabb::Aabb;
use crate::arena::{first_mut, move_down, section_bytes, split_mut};
use crate::blob::Header;
use crate::cell::Lattice;
use crate::config::BuildFlags;
use crate::control::{Control, Watch};
use crate::error::{Error, Region};
use crate::invariant::OrBug;
use crate::mesh::TriangleMesh;
use crate::method::Quality;
use crate::simd::{IS_SMALL, Kernel, SimdLevel, dispatch};
use crate::survey::finite_box;
use crate::tasks::{self, run, share, take, take_up_to, task_count};
use grow::{Cursor, Grow, Grown, RECORD, RangeRecord};

/// The most nodes of a tree over so many triangles.
const fn most_high_nodes(triangles: u32) -> u32 {
    let nodes = triangles.saturating_sub(2) / 7;
    if nodes < 1 { 1 } else { nodes }
}

/// The memory that any mesh with so many triangles needs, for a build with any number of tasks.
pub(crate) const fn bound(triangles: u32) -> (u64, u64) {
    let nodes = most_high_nodes(triangles) as u64;
    let triangles = triangles as u64;
    // Never ask for 0 bytes of scratch: callers allocate what they are told.
    let items = if triangles < 1 { 1 } else { triangles };
    let index = index_bytes(triangles, nodes, most_fine(triangles));
    let scratch = section_bytes::<Item>(items);
    (index, scratch + section_bytes::<FineSides>(most_fine(triangles)))
}

/// Triangles of the ranges that tasks take, at most: a part of all, so that there are enough for many tasks.
fn most_of_range(triangles: usize) -> u32 {
    (triangles / 64).max(4096) as u32
}

/// The progress at which each step of a build begins, as an approximate fraction.
const BOXES: f32 = 0.02;
const TOP: f32 = 0.1;
const BELOW: f32 = 0.35;
const DONE: f32 = 0.98;

/// No task has fewer triangles.
const LEAST_TASK: usize = 4096;

/// Builds everything but the header, which it returns. Without an index it only computes the size.
#[inline(never)]
pub(super) fn build_in(
    mesh: &TriangleMesh<'_>,
    flags: BuildFlags,
    mut index: Option<&mut [u8]>,
    scratch: &mut [u8],
    control: &Control<'_>,
    watch: &Watch<'_>,
) -> Result<Header, Error> {
    let triangles = mesh.triangle_count();
    let index_available = index.as_ref().map_or(0, |index| index.len()) as u64;
    let (index_bound, needed_bytes) = bound(triangles);
    let scratch = first_mut(scratch, needed_bytes, Region::Scratch)?;
    let split = split_mut::<Item>(scratch, triangles.into()).or_bug("too little scratch");
    let (items, rest) = split.unwrap_or_default();
    let most = most_fine(triangles.into());
    let room = split_mut::<FineSides>(rest, most).or_bug("too little scratch");
    let mut fine = FineList::new(room.unwrap_or_default().0);
    // Tasks fill their parts of the index side by side, which takes the bound. With less room, run one task.
    let mut tasks = task_count(control, triangles as usize / LEAST_TASK);
    if index_available < index_bound {
        tasks = 1;
    }
    clear_header(&mut index);

    // Find the boxes.
    watch.at(BOXES)?;
    let (finite, bounds) = boxes(mesh, flags, items, tasks, control)?;
    let items = items.get_mut(..finite).or_bug("more triangles than items").unwrap_or_default();

    // Make the nodes.
    watch.at(TOP)?;
    let bounds = Lattice::pad(&bounds);
    let work = HighInputs { bounds, tasks };
    let (ids, nodes) = cut_index(&mut index, finite as u32);
    let (nodes, levels) = work.make(items, ids, nodes, &mut fine, control, watch)?;

    watch.at(DONE)?;
    let contents = Contents { nodes, levels, fine: fine.finish() };
    finish(mesh, Quality::High, bounds, index, finite as u32, contents)
}

/// A task of the first pass: some triangles, and room for their items.
struct ItemsTask<'w> {
    mesh: &'w TriangleMesh<'w>,
    flags: BuildFlags,
    first: u32,
    items: &'w mut [Item],
}

/// Writes the items of all triangles that are finite, and returns how many there are and the box around them.
fn boxes(
    mesh: &TriangleMesh<'_>,
    flags: BuildFlags,
    items: &mut [Item],
    tasks: u32,
    control: &Control<'_>,
) -> Result<(usize, Aabb), Error> {
    let (all, tasks) = (items.len(), tasks as usize);
    let mut rest = &mut *items;
    let parts = (0..tasks).map(|task| {
        let share = share(all, task, tasks);
        ItemsTask { mesh, flags, first: share.start as u32, items: take(&mut rest, share.len()) }
    });
    let level = SimdLevel::detect();
    let mut bounds = Aabb::EMPTY;
    let mut counts = [0; tasks::MOST];
    let mut slots = counts.iter_mut();
    run(
        control,
        parts,
        |part| dispatch(level, part),
        |result| {
            let (count, bounds_of) = result?;
            bounds = bounds.union(&bounds_of);
            if let Some(slot) = slots.next().or_bug("more results than tasks") {
                *slot = count;
            }
            Ok(())
        },
    )?;
    let mut finite = 0;
    for (task, count) in counts.into_iter().enumerate().take(tasks) {
        let first = share(all, task, tasks).start;
        // Move the items of a task down over the places that earlier tasks left empty.
        if finite < first {
            move_down(items, first..first + count, finite);
        }
        finite += count;
    }
    Ok((finite, bounds))
}

impl Kernel for ItemsTask<'_> {
    type Output = Result<(usize, Aabb), Error>;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Self::Output {
        let Self { mesh, flags, first, items } = self;
        let mut bounds = Aabb::EMPTY;
        let mut count = 0;
        let triangles = first..first + items.len() as u32;
        let mut left = items.len();
        for piece in mesh.pieces(triangles) {
            for (triangle, corners) in piece.each() {
                left = left.wrapping_sub(1);
                let Some(box_of) = finite_box(triangle, corners, flags)? else { continue };
                bounds = bounds.union(&box_of);
                if let Some(slot) = items.get_mut(count).or_bug("more triangles than items") {
                    *slot = item(&box_of, triangle, 1);
                }
                count += 1;
            }
        }
        debug_assert!(left == 0, "a part of the mesh has other triangles than were asked for");
        Ok((count, bounds))
    }
}

/// The inputs that the steps after the first pass share.
struct HighInputs {
    /// The box of the tree.
    bounds: Aabb,
    tasks: u32,
}

/// The work of a task: ranges that wait.
struct RangesTask<'w> {
    work: &'w HighInputs,
    /// Before the first of its ranges.
    cursor: Cursor,
    /// The nodes at the top.
    top: &'w [Node],
    /// The number of ranges.
    ranges: u32,
    /// The number of its first item among all.
    start: u32,
    items: &'w mut [Item],
    ids: &'w mut [u32],
    /// Place of its first id in the index.
    first: u32,
}

/// Ranges that follow one another.
#[derive(Debug, Clone, Copy, Default)]
struct Ranges {
    count: u32,
    /// End of the last one.
    end: u32,
    /// Triangles in them.
    triangles: u32,
    /// Nodes below their roots, at most.
    nodes: u32,
}

impl Ranges {
    /// Takes ranges until one ends at `goal` or behind it.
    fn until(goal: u32, cursor: &mut Cursor, top: &[Node]) -> Self {
        let mut all = Self::default();
        while all.end < goal
            && let Some(waiter) = cursor.next(top)
        {
            let triangles = waiter.end - waiter.start;
            all.count += 1;
            all.end = waiter.end;
            all.triangles += triangles;
            all.nodes += most_high_nodes(triangles) - 1;
        }
        all
    }
}

impl RangesTask<'_> {
    /// Makes the nodes over its ranges into `nodes`, which lie in the index from `child` on, and leaves a record
    /// in the place of each range; returns how many nodes are below their roots. By reference: a copy of the cursor
    /// would take stack.
    fn make(&mut self, nodes: &mut [Node], child: u32) -> u32 {
        let Self { work, cursor, top, ranges, start, items, ids, first } = self;
        let (start, first) = (*start, *first);
        let (mut node_count, mut id_count) = (0, 0);
        for _ in 0..*ranges {
            let Some(waiter) = cursor.next(top).or_bug("a range is missing") else { break };
            let range = (waiter.start - start) as usize..(waiter.end - start) as usize;
            let Some(items) = items.get_mut(range).or_bug("a range too long") else { break };
            // Too little room for nodes and ids is legal: they are counted.
            let grow = Grow {
                bounds: &work.bounds,
                items,
                level: waiter.level,
                wait: 0,
                fine: None,
                nodes: nodes.get_mut(node_count as usize..).unwrap_or_default(),
                child: child + node_count,
                ids: ids.get_mut(id_count as usize..).unwrap_or_default(),
                first: first + id_count,
            };
            let Grown { root, nodes, ids, levels } = grow.run();
            node_count += nodes;
            id_count += ids;
            if let Some(place) = items.first_chunk_mut::<RECORD>().or_bug("a range too short") {
                *place = transmute!(RangeRecord { root, nodes, levels, unused: [0; 2] });
            }
        }
        node_count
    }
}

impl HighInputs {
    /// Makes all nodes and ids; returns how many nodes and levels there are.
    fn make(
        &self,
        items: &mut [Item],
        ids: &mut [u32],
        nodes: &mut [Node],
        fine: &mut FineList<'_>,
        control: &Control<'_>,
        watch: &Watch<'_>,
    ) -> Result<(u32, u32), Error> {
        let all = items.len() as u32;
        if all == 0 {
            // Empty `nodes` are legal: nodes are only counted then.
            if let Some(root) = nodes.first_mut() {
                *root = Node::EMPTY;
            }
            return Ok((1, 1));
        }
        let grow = Grow {
            bounds: &self.bounds,
            items,
            level: 0,
            wait: most_of_range(all as usize),
            fine: Some(fine),
            nodes: nodes.get_mut(1..).unwrap_or_default(),
            child: 1,
            ids,
            first: 0,
        };
        let Grown { root, nodes: below, ids: top_ids, levels } = grow.run();
        // Empty `nodes` and `ids` are legal, here and below: they are only counted then.
        if let Some(slot) = nodes.first_mut() {
            *slot = root;
        }
        let top_count = below + 1;
        watch.at(BELOW)?;
        let ids = ids.get_mut(top_ids as usize..).unwrap_or_default();
        let plans = self.below(items, ids, nodes, [top_count, top_ids], control, watch)?;
        Ok(gather(items, nodes, &plans, [top_count, levels]))
    }

    /// Makes the nodes over each range that waits among the first `top_count` nodes; returns how many ranges each task
    /// had, and where their nodes lie. `ids` follow the first `top_ids`.
    fn below(
        &self,
        items: &mut [Item],
        mut ids: &mut [u32],
        nodes: &mut [Node],
        [top_count, top_ids]: [u32; 2],
        control: &Control<'_>,
        watch: &Watch<'_>,
    ) -> Result<[TaskRanges; tasks::MOST], Error> {
        let all = items.len();
        let (top, mut rest) = nodes.split_at_mut((top_count as usize).min(nodes.len()));
        let mut plans = [TaskRanges::default(); tasks::MOST];
        let (mut first, mut start, mut cursor, mut items_left) = (top_ids, 0, Cursor::new(), items);
        let mut next = |goal: u32| {
            let before = cursor;
            let ranges = Ranges::until(goal, &mut cursor, top);
            let end = ranges.end.max(start);
            let part = RangesTask {
                work: self,
                cursor: before,
                top,
                ranges: ranges.count,
                start,
                items: take(&mut items_left, (end - start) as usize),
                ids: take_up_to(&mut ids, ranges.triangles as usize),
                first,
            };
            first += ranges.triangles;
            start = end;
            (part, ranges)
        };
        if IS_SMALL || self.tasks == 1 {
            let mut made = 0;
            plans[0].child = top_count;
            for step in 0..STEPS {
                let (mut part, ranges) = next(share(all, step, STEPS).end as u32);
                let nodes = rest.get_mut(made as usize..).unwrap_or_default();
                plans[0].ranges += ranges.count;
                made += part.make(nodes, top_count + made);
                watch.between(step as u32 + 1, STEPS as u32, [BELOW, DONE])?;
            }
        } else {
            let mut child = top_count;
            let tasks = self.tasks as usize;
            let parts = plans.iter_mut().take(tasks).enumerate().map(|(task, plan)| {
                let (part, ranges) = next(share(all, task, tasks).end as u32);
                let nodes = take_up_to(&mut rest, ranges.nodes as usize);
                *plan = TaskRanges { ranges: ranges.count, child };
                child += ranges.nodes;
                (part, nodes, plan.child)
            });
            let make = |(mut part, nodes, child): (RangesTask<'_>, _, _)| part.make(nodes, child);
            run(control, parts, make, |_| Ok(()))?;
        }
        Ok(plans)
    }
}

/// Moves the nodes of all tasks together, and the root of each range to where it waits; returns how many nodes and
/// levels there are. So far they are those of the top.
fn gather(
    items: &[Item],
    nodes: &mut [Node],
    plans: &[TaskRanges],
    [top_count, mut levels]: [u32; 2],
) -> (u32, u32) {
    let mut cursor = Cursor::new();
    let mut count = top_count;
    for &TaskRanges { ranges, mut child } in plans {
        for _ in 0..ranges {
            let top = nodes.get(..(top_count as usize).min(nodes.len())).unwrap_or_default();
            let Some(waiter) = cursor.next(top).or_bug("a range is missing") else { break };
            let behind = items.get(waiter.start as usize..).unwrap_or_default();
            let record = behind.first_chunk::<RECORD>().or_bug("a range without a record");
            let Some(record) = record else { break };
            let RangeRecord { mut root, nodes: below, levels: most, .. } = transmute!(*record);
            let moved = child - count;
            move_nodes(nodes, child..child + below, count);
            root.child -= moved;
            if let Some(slot) = nodes.get_mut(waiter.place as usize).or_bug("no such node") {
                *slot = root;
            }
            child += below;
            count += below;
            levels = levels.max(most);
        }
    }
    let top = nodes.get(..(top_count as usize).min(nodes.len())).unwrap_or_default();
    debug_assert!(cursor.next(top).is_none(), "a range that no task made");
    (count, levels)
}

/// The steps of the work of a single task. It reports progress after each.
const STEPS: usize = 64;

/// The ranges of a task, and where their nodes lie.
#[derive(Debug, Clone, Copy, Default)]
struct TaskRanges {
    ranges: u32,
    child: u32,
}
