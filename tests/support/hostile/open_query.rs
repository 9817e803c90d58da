//! Any bytes as a blob: a grid that opens answers every query, in bounds and after bounded work.

use arbitrary::Unstructured;

use super::ask::ends;
use super::damage::Damaged;

/// Runs the target; see the head of this file. Returns true if a grid was queried.
pub fn run(data: &[u8]) -> bool {
    let mut u = Unstructured::new(data);
    let Ok(damaged) = Damaged::new(&mut u) else { return false };
    let Ok(grid) = damaged.open() else { return false };
    ends(&grid, &Damaged::rays(&mut u, &grid));
    // Asking the grid about itself is harmless, too.
    let _ = (grid.config(), grid.skipped_count(), grid.reference_count());
    let _ = (grid.scratch_bytes(), grid.packed_bytes(), grid.method());
    true
}
