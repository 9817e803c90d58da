//! Any bytes as a blob: a grid that opens answers every query, in bounds and after bounded work.

use arbitrary::Unstructured;

use super::ask::ends;
use super::damage::Damaged;

/// Runs the target; see the head of this file.
pub fn run(data: &[u8]) {
    let mut u = Unstructured::new(data);
    let Ok(damaged) = Damaged::new(&mut u) else { return };
    let Ok(grid) = damaged.open() else { return };
    ends(&grid, &Damaged::rays(&mut u, &grid));
    // Asking the grid about itself is harmless, too.
    let _ = (grid.config(), grid.skipped_count(), grid.reference_count());
    let _ = (grid.scratch_bytes(), grid.packed_bytes(), grid.method());
}
