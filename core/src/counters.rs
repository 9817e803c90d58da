//! Counts work as the paper's Table 1 does, at no cost for queries without counters.

/// Work done by queries, summed over all of them, as in the paper's Table 1.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Ray-triangle tests ("primitive intersections").
    pub primitive_tests: u64,
    /// Cells and macrocells entered ("cell traversals"), empty ones included; leaves of a tree.
    pub cell_steps: u64,
    /// Macrocells descended into, subgrids and nodes entered ("grid traversals"); 0 for a one-level grid.
    pub grid_steps: u64,
}

impl Counters {
    /// Adds the work of other queries. Sums saturate.
    pub const fn add(&mut self, work: &Self) {
        self.primitive_tests = self.primitive_tests.saturating_add(work.primitive_tests);
        self.cell_steps = self.cell_steps.saturating_add(work.cell_steps);
        self.grid_steps = self.grid_steps.saturating_add(work.grid_steps);
    }
}

/// A query reports its work here; `()` ignores it and compiles to nothing.
pub(crate) trait Tally {
    fn primitive_test(&mut self);
    fn primitive_tests(&mut self, count: usize);
    fn cell_step(&mut self);
    fn grid_step(&mut self);
}

impl Tally for () {
    #[inline(always)]
    fn primitive_test(&mut self) {}
    #[inline(always)]
    fn primitive_tests(&mut self, _: usize) {}
    #[inline(always)]
    fn cell_step(&mut self) {}
    #[inline(always)]
    fn grid_step(&mut self) {}
}

impl Tally for Counters {
    #[inline(always)]
    fn primitive_test(&mut self) {
        self.primitive_tests += 1;
    }
    #[inline(always)]
    fn primitive_tests(&mut self, count: usize) {
        self.primitive_tests += count as u64;
    }
    #[inline(always)]
    fn cell_step(&mut self) {
        self.cell_steps += 1;
    }
    #[inline(always)]
    fn grid_step(&mut self) {
        self.grid_steps += 1;
    }
}
