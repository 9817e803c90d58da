//! Stacks: the children that wait until a ray, or a group of rays, has been through those before them.
//!
//! A ray goes on with the nearest child of a node and pushes the others, the nearest last. A child that begins
//! behind the end of the ray when it is popped is dropped.

use zerocopy::{FromBytes, FromZeros, IntoBytes, transmute_mut};

use super::Bvh;
use super::layout::LEVELS;
use super::node::Child;

/// Entries of the first stack of a ray. It is short, because every query zeroes it; the few rays that need more entries
/// go on with a larger stack.
pub(crate) const FIRST_STACK: usize = 32;

/// Entries of the largest stack: seven a level, and one.
pub(crate) const STACK: usize = 7 * LEVELS as usize + 1;

/// The most levels of a tree for which the small stack is large enough, as it is for nearly all.
pub(crate) const FEW_LEVELS: u32 = 14;
/// Entries of a small stack.
const SMALL_STACK: usize = 7 * FEW_LEVELS as usize + 1;

/// A child on the stack: in the high half the bits of the distance at which the ray enters it, in the low
/// half its node and slot.
pub(crate) type StackEntry = u64;

/// Lends a small stack. Out of line, as the next function is: inlined, both arrays would take stack in one frame.
#[inline(never)]
pub(super) fn with_small_stack<R>(walk: impl FnOnce(&mut [StackEntry]) -> R) -> R {
    walk(&mut [0; SMALL_STACK])
}

#[inline(never)]
pub(super) fn with_deep_stack<R>(walk: impl FnOnce(&mut [StackEntry]) -> R) -> R {
    walk(&mut [0; STACK])
}

/// The entry of a child that is `near` away, as the bits of an f32.
#[inline(always)]
pub(super) fn entry(node: u32, slot: u32, near: u32) -> StackEntry {
    u64::from(near) << 32 | u64::from(node << 3 | slot)
}

/// Pushes a child so that the nearest child of a node is popped first. `near` holds the bits of a distance: distance
/// and child are stored as one integer, because a pop that spans two stores would wait for both.
#[inline(always)]
pub(super) fn push(
    stack: &mut [StackEntry],
    top: &mut usize,
    base: usize,
    node: u32,
    slot: u32,
    near: u32,
) {
    let waiting = entry(node, slot, near);
    let mut at = *top;
    let Some(_) = stack.get(at) else { return };
    *top += 1;
    while at > base
        && let Some(&below) = stack.get(at - 1)
        && f32::from_bits((below >> 32) as u32) < f32::from_bits(near)
    {
        if let Some(slot) = stack.get_mut(at) {
            *slot = below;
        }
        at -= 1;
    }
    if let Some(slot) = stack.get_mut(at) {
        *slot = waiting;
    }
}

/// Pops the next child that does not begin behind the end of the ray.
#[inline(always)]
pub(super) fn pop(bvh: &Bvh<'_>, stack: &[StackEntry], top: &mut usize, end: f32) -> Option<Child> {
    loop {
        *top = top.checked_sub(1)?;
        let waiting = *stack.get(*top)?;
        let is_behind = f32::from_bits((waiting >> 32) as u32) > end;
        if !is_behind {
            #[expect(clippy::cast_possible_truncation, reason = "the low half")]
            let (node, slot) = ((waiting as u32) >> 3, waiting as u32 & 7);
            return Some(bvh.nodes.get(node as usize).map_or(Child::NONE, |node| node.child(slot)));
        }
    }
}

/// A child that waits, and the rays that met it.
#[repr(C)]
#[derive(Clone, Copy, FromBytes, IntoBytes)]
pub(super) struct GroupEntry {
    /// The number of the node, and three bits for the slot.
    pub(super) node_and_slot: u32,
    /// The least distance at which one of the rays enters; any number if children may come in any order.
    pub(super) near: f32,
    pub(super) rays: u64,
}

/// The stack of a group.
#[derive(FromZeros)]
pub(crate) struct GroupStack([GroupEntry; STACK]);

impl GroupStack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self::new_zeroed()
    }

    #[inline(always)]
    pub(super) fn entries(&mut self) -> &mut [GroupEntry; STACK] {
        &mut self.0
    }

    /// Cuts the stack into shares for single rays.
    #[inline(always)]
    pub(super) fn shares(&mut self, size: usize) -> impl Iterator<Item = &mut [StackEntry]> {
        let entries: &mut [StackEntry; 2 * STACK] = transmute_mut!(&mut self.0);
        entries.chunks_exact_mut(size)
    }
}
