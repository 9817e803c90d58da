//! The most work that one ray can cost, whatever the bytes say.

use hgrid_core::{Counters, Grid, Method, Parameters};

use crate::copy::word;

/// The offset of the header's field for the nodes of a tree.
const NODE_COUNT: usize = 112;

/// Returns the most that a query of one ray may count.
///
/// A walk moves one axis towards its end at every step, so it has no more steps than the sum of the cells
/// along the three axes of its box. Nested boxes multiply that; where the bytes set the nesting, there is
/// a maximum depth.
#[must_use]
pub fn most(grid: &Grid<'_>) -> Counters {
    let sum = |cells: [u32; 3]| cells.iter().map(|&c| u64::from(c)).sum::<u64>();
    let words = grid.blob_bytes() as u64 / 4;
    let cells = sum(grid.resolution());
    let cell_steps = match grid.config().parameters {
        // One walk.
        Parameters::OneLevel { .. } => cells,
        Parameters::Fixed { macrocell_factor, .. } => {
            macrocells(grid.resolution(), macrocell_factor)
        }
        // A subgrid in every cell, with no more than 255 cells along an axis.
        Parameters::Variable { .. } => cells * (1 + 3 * 255),
        // One step for each entry.
        Parameters::Recursive { .. } => words,
        // Each node counts once, with at most eight leaves; one more step exhausts the budget.
        Parameters::Bvh { .. } => 9 * nodes(grid) + 1,
        others => panic!("no bound for {others:?}"),
    };
    // Each word of a list is tested once; leaves of a tree have at most eight ids. A ray from too far away
    // for any structure tests every triangle.
    let primitive_tests = if grid.method() == Method::Bvh { 8 * cell_steps } else { words };
    let primitive_tests = primitive_tests.max(grid.mesh().triangle_count().into());
    Counters { primitive_tests, cell_steps, grid_steps: cell_steps }
}

/// Returns the number of nodes of a tree, as its header has it.
fn nodes(grid: &Grid<'_>) -> u64 {
    word(grid.blob(), NODE_COUNT).into()
}

/// Returns the steps on all levels if all macrocells were full.
fn macrocells(resolution: [u32; 3], factor: u32) -> u64 {
    let sum = |cells: [u32; 3]| cells.iter().map(|&c| u64::from(c)).sum::<u64>();
    let few = |cells: [u32; 3]| cells.iter().map(|&c| u64::from(c)).product::<u64>() <= 10_000;
    let mut levels = vec![resolution];
    while levels.len() <= 4 {
        let above = levels[levels.len() - 1].map(|cells| cells.div_ceil(factor));
        levels.push(above);
        if few(above) {
            break;
        }
    }
    let mut walks = 1;
    let mut steps = 0;
    for (level, cells) in levels.iter().enumerate().rev() {
        let is_top = level + 1 == levels.len();
        let box_of_one = if is_top { *cells } else { cells.map(|c| c.min(factor)) };
        walks *= sum(box_of_one);
        steps += walks;
    }
    steps
}
