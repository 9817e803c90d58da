//! The most work that one ray can cost, whatever the bytes say.

use hgrid_core::{Counters, Grid, Method, Parameters};

/// The most that a query of one ray may count.
///
/// A walk moves one axis towards its end at every step, so it has no more steps than the cells
/// on the three axes of its box sum up to. Boxes within boxes multiply that; where bytes say
/// how deep, there is a last depth.
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
        // In every cell a subgrid of no more than 255 cells on an axis.
        Parameters::Variable { .. } => cells * (1 + 3 * 255),
        // One step for each entry.
        Parameters::Recursive { .. } => words,
        // A node for each node, and eight leaves; one more, and the budget is spent.
        Parameters::Bvh { .. } => 9 * nodes(grid) + 1,
        others => panic!("nobody has said what {others:?} may cost"),
    };
    // Lists hold each word once, but for leaves of a tree, which have eight ids or fewer; a ray from too
    // far away for any structure is shown every triangle.
    let primitive_tests = if grid.method() == Method::Bvh { 8 * cell_steps } else { words };
    let primitive_tests = primitive_tests.max(grid.mesh().triangle_count().into());
    Counters { primitive_tests, cell_steps, grid_steps: cell_steps }
}

/// Nodes of a tree, which lie behind the ids.
fn nodes(grid: &Grid<'_>) -> u64 {
    let ids = (4 * u64::from(grid.reference_count())).next_multiple_of(64);
    (grid.blob_bytes() as u64 - 128 - ids) / 80
}

/// Steps on all levels, if all macrocells were full.
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
