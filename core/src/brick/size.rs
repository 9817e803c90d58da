//! How large a cell is: as large as the triangles make it, not as their number does.
//!
//! A box with extents `e` lies in `(1 + e.x/h) (1 + e.y/h) (1 + e.z/h)` cells of width `h`,
//! wherever the cells begin. The width is the one with which a sample of the triangles lies
//! in [`REFERENCES`] cells on average: so many references and bytes a triangle takes,
//! whatever the mesh, and cells grow in number with the surface. (A number of cells
//! proportional to the triangles, as in [`woo`](crate::cell::woo), fills cells of a surface
//! more and more: as the cube root of N.)
//!
//! A triangle counts for no more than [`MOST`] cells: large ones are listed elsewhere and must not
//! make the cells of all others coarse. Memory has the last word: cells are made larger until there
//! are no more than one block for 32 triangles, and no more than [`reference_limit`] references.

#![expect(
    clippy::cast_possible_truncation,
    reason = "counts that are no larger than others of their type"
)]

use core::ops::Range;

use super::budget::least_words;
use super::frame::MOST_BLOCKS;
use super::layout::Layout;
use super::pass::{Census, Count, Ground};
use crate::aabb::{Aabb, greater, lesser};
use crate::cell::{Lattice, MAX_RESOLUTION, as_f32};
use crate::config::{BuildFlags, Config};
use crate::control::{Control, Watch};
use crate::error::{ConfigField, Error};
use crate::mesh::TriangleMesh;
use crate::survey::Survey;
use crate::tasks::{run, task_count};

/// The most references of a mesh with so many triangles.
pub(super) const fn reference_limit(triangles: u32) -> u64 {
    /// Half as many again as scans need.
    const PER_TRIANGLE: u64 = 4;
    const AT_LEAST: u64 = 64;
    triangles as u64 * PER_TRIANGLE + AT_LEAST
}

/// The most blocks for so many triangles.
pub(super) const fn block_limit(triangles: u32) -> u64 {
    triangles as u64 / 32 + 8
}

/// What a cell grows by where there are too many: half as many cells.
const LARGER: f64 = 1.26;

/// The most triangles in the list of the whole grid.
pub(super) const MOST_LARGE: u32 = 256;

/// What is settled before anything is sorted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settled {
    pub(super) lattice: Lattice,
    /// With all triangles in the fullest block where nobody counted.
    pub(super) layout: Layout,
    pub(super) census: Census,
    /// A triangle in more blocks than this is in the list of the whole grid.
    pub(super) most_blocks: u64,
    /// Whether the entries of each block were counted.
    pub(super) is_counted: bool,
}

impl Settled {
    /// The ground that the passes over the triangles go over.
    pub(super) const fn ground<'g>(
        &'g self,
        mesh: &'g TriangleMesh<'g>,
        flags: BuildFlags,
    ) -> Ground<'g> {
        let Self { lattice, layout, most_blocks, .. } = self;
        Ground { mesh, lattice, blocks: layout.blocks, most_blocks: *most_blocks, flags }
    }
}

/// The triangles of each task.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shares<const N: usize> {
    pub(super) tasks: u32,
    /// How many there would be with scratch for all.
    pub(super) wanted: u32,
    pub(super) censuses: [Census; N],
}

impl<const N: usize> Shares<N> {
    /// The triangles of a task.
    pub(super) fn ids(triangles: u32, task: u32, tasks: u32) -> Range<u32> {
        let at = |task: u32| u64::from(triangles) * u64::from(task) / u64::from(tasks.max(1));
        at(task) as u32..at(task + 1) as u32
    }
}

/// [`settle_in`] without scratch.
pub(super) fn settle(mesh: &TriangleMesh<'_>, config: &Config) -> Result<Settled, Error> {
    Ok(settle_in::<1>(mesh, config, &mut [], &Control::SERIAL)?.0)
}

/// Chooses the cells of a mesh and counts what they will hold. The heads of each task get the
/// entries of every block if there is room for them; nothing else is written.
pub(super) fn settle_in<const N: usize>(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    scratch: &mut [u8],
    parallel: &Control<'_>,
) -> Result<(Settled, Shares<N>), Error> {
    let sample = Sample::of(mesh);
    let bounds = Lattice::pad(&bounds::<N>(mesh, &sample, config.flags, parallel)?);
    let size = bounds.size();
    let mut cell = f64::from(config.cell_size) * sample.cell(mesh, size.max_element());
    loop {
        let resolution = size.to_array().map(|extent| cells(extent, cell));
        let layout = Layout::new(resolution, mesh.triangle_count());
        let most = block_limit(mesh.triangle_count());
        if layout.block_count() > most || resolution.iter().any(|&r| r > MAX_RESOLUTION) {
            cell *= LARGER;
            continue;
        }
        let lattice = Lattice::new(bounds, resolution).with_cubes();
        let mut ground = Ground {
            mesh,
            lattice: &lattice,
            blocks: layout.blocks,
            most_blocks: MOST_BLOCKS,
            flags: config.flags,
        };
        let (mut settled, shares) = loop {
            let (settled, shares) = census(&ground, layout, scratch, parallel)?;
            if settled.census.large <= MOST_LARGE {
                break (settled, shares);
            }
            ground.most_blocks = u64::MAX;
        };
        let limit = reference_limit(mesh.triangle_count());
        if settled.census.entries.max(settled.census.references) <= limit {
            // A word of the pool has a number of 32 bits.
            if least_words(&settled.census) > u32::MAX.into() {
                return Err(Error::InvalidConfig(ConfigField::CellSize));
            }
            if settled.is_counted {
                settled.layout.fullest = fullest::<N>(&layout, shares.tasks, scratch);
            }
            return Ok((settled, shares));
        }
        cell *= LARGER;
    }
}

/// Counts the entries of every block.
fn census<const N: usize>(
    ground: &Ground<'_>,
    layout: Layout,
    scratch: &mut [u8],
    parallel: &Control<'_>,
) -> Result<(Settled, Shares<N>), Error> {
    /// Fewer would not be worth the caller's thread.
    const LEAST_TRIANGLES: u32 = 256;
    let triangles = ground.mesh.triangle_count();
    let wanted = task_count::<N>(parallel, (triangles / LEAST_TRIANGLES) as usize);
    let room = layout.tasks_in(scratch, wanted);
    let (is_counted, tasks) = (room > 0, if room > 0 { room } else { wanted });
    let heads = if is_counted { layout.heads::<N>(scratch, tasks) } else { None };
    let heads =
        heads.map_or_else(|| core::array::from_fn(|_| Default::default()), |(heads, _)| heads);
    let counts = (0..tasks).zip(heads).map(|(task, heads)| {
        let ids = Shares::<N>::ids(triangles, task, tasks);
        Count { ids, heads }
    });
    let results: [_; N] = run(parallel, counts, |count: Count<'_>| count.run(ground))?;
    // The first error is that of the first triangle.
    let mut censuses = [Census::default(); N];
    let mut census = Census::default();
    for (slot, result) in censuses.iter_mut().zip(results.into_iter().flatten()) {
        *slot = result?;
        census = census.plus(*slot);
    }
    let (lattice, most_blocks) = (*ground.lattice, ground.most_blocks);
    let settled = Settled { lattice, layout, census, most_blocks, is_counted };
    Ok((settled, Shares { tasks, wanted, censuses }))
}

/// The entries of the fullest block.
fn fullest<const N: usize>(layout: &Layout, tasks: u32, scratch: &mut [u8]) -> u32 {
    let heads = layout.heads::<N>(scratch, tasks);
    let Some((heads, _)) = heads else { return 0 };
    let sums = (0..layout.block_count() as usize)
        .map(|block| heads.iter().take(tasks as usize).filter_map(|heads| heads.get(block)).sum());
    sums.max().unwrap_or(0)
}

/// Cells of a size along an extent, one more than [`MAX_RESOLUTION`] where it is too many.
#[expect(clippy::cast_sign_loss, reason = "clamped before")]
fn cells(extent: f32, cell: f64) -> u32 {
    let most = f64::from(MAX_RESOLUTION + 1);
    ((f64::from(extent) / cell).min(most) as u32).max(1)
}

/// The box of the mesh.
///
/// That of all finite vertices takes a tenth of the time of that of all triangles. It is too large
/// where vertices lie about that no triangle uses: the sample tells.
fn bounds<const N: usize>(
    mesh: &TriangleMesh<'_>,
    sample: &Sample,
    flags: BuildFlags,
    parallel: &Control<'_>,
) -> Result<Aabb, Error> {
    const SUSPICIOUS: f32 = 2.0;
    /// Fewer would not be worth the caller's thread.
    const LEAST_VERTICES: usize = 128 * 1024;
    let count = mesh.vertex_count();
    let tasks = task_count::<N>(parallel, count / LEAST_VERTICES) as usize;
    let piece = count.div_ceil(tasks.max(1)).max(1);
    let pieces = (0..count).step_by(piece).map(|first| first..count.min(first + piece));
    let boxes: [_; N] = run(parallel, pieces, |vertices| mesh.vertex_bounds(vertices))?;
    let all = boxes.iter().flatten().fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
    let (size, sampled) = (all.size().max_element(), sample.bounds.size().max_element());
    if size <= SUSPICIOUS * sampled {
        Ok(all)
    } else {
        Ok(Survey::of(mesh, flags, &Watch::none())?.bounds)
    }
}

/// Cells in which a triangle lies on average.
const REFERENCES: f32 = 2.2;
/// Cells in which a triangle lies at most, for the average.
const MOST: f32 = 8.0;
/// Widths that are compared at once.
const WIDTHS: usize = 16;

/// Some triangles of the mesh, evenly spread over their ids.
struct Sample {
    step: u32,
    bounds: Aabb,
}

impl Sample {
    const TRIANGLES: u32 = 1024;

    fn of(mesh: &TriangleMesh<'_>) -> Self {
        // An odd step does not keep time with meshes made of pairs.
        let step = (mesh.triangle_count() / Self::TRIANGLES) | 1;
        let all = boxes(mesh, step).fold(Aabb::EMPTY, |all, bounds| all.union(&bounds));
        Self { step, bounds: all }
    }

    /// The width of cells, to 3 percent, with which triangles of the sample lie in [`REFERENCES`]
    /// of them, for a box with this extent.
    fn cell(&self, mesh: &TriangleMesh<'_>, extent: f32) -> f64 {
        /// How often an extent is halved at most: finer cells than that there could not be.
        const HALVINGS: u32 = 14;
        const { assert!(WIDTHS > HALVINGS as usize) };
        let halved = core::array::from_fn(|step| 1.0 / as_f32(1 << HALVINGS.min(step as u32)));
        let octave = self.finest(mesh, extent, halved);
        // From all of it to a little more than half.
        let parts = |step| as_f32((2 * WIDTHS - step) as u32) / as_f32(2 * WIDTHS as u32);
        let width = self.finest(mesh, extent, core::array::from_fn(|step| octave * parts(step)));
        f64::from(extent) * f64::from(width)
    }

    /// The last of some widths before triangles lie in too many cells: parts of an extent, from
    /// the coarsest, which is taken unasked, to the finest.
    fn finest(&self, mesh: &TriangleMesh<'_>, extent: f32, widths: [f32; WIDTHS]) -> f32 {
        let [coarsest, ..] = widths;
        let references = self.references(mesh, extent, widths);
        let finer = widths.into_iter().zip(references).skip(1);
        finer
            .take_while(|&(_, mean)| mean <= REFERENCES)
            .last()
            .map_or(coarsest, |(width, _)| width)
    }

    /// The mean number of cells of each width in which a triangle lies. The sample is read once for
    /// all of them.
    fn references(
        &self,
        mesh: &TriangleMesh<'_>,
        extent: f32,
        widths: [f32; WIDTHS],
    ) -> [f32; WIDTHS] {
        let cells = widths.map(|width| 1.0 / width);
        let (mut sums, mut count) = ([0.0; WIDTHS], 0.0);
        for bounds in boxes(mesh, self.step) {
            let [x, y, z] = (bounds.size() / extent).to_array();
            for (sum, cells) in sums.iter_mut().zip(cells) {
                let lies_in = (1.0 + x * cells) * (1.0 + y * cells) * (1.0 + z * cells);
                *sum += lesser(lies_in, MOST);
            }
            count += 1.0;
        }
        sums.map(|sum| sum / greater(count, 1.0))
    }
}

/// The boxes of every `step`-th triangle that has one.
fn boxes(mesh: &TriangleMesh<'_>, step: u32) -> impl Iterator<Item = Aabb> {
    let ids = (0..mesh.triangle_count()).step_by(step.max(1) as usize);
    ids.filter_map(|id| mesh.corners(id).and_then(Aabb::of))
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    /// Whole numbers of 24 bits.
    fn random() -> impl FnMut() -> f32 {
        let mut state = 1_u32;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            as_f32(state >> 8)
        }
    }

    /// One width after the other, all numbers with twice the digits.
    fn cell(mesh: &TriangleMesh<'_>, step: u32, extent: f64) -> f64 {
        let is_enough = |cell: f64| {
            let (mut sum, mut count) = (0.0, 0.0);
            for bounds in boxes(mesh, step) {
                let [x, y, z] = bounds.size().to_array().map(|e| 1.0 + f64::from(e) / cell);
                sum += (x * y * z).min(8.0);
                count += 1.0;
            }
            sum / f64::max(count, 1.0) <= 2.2
        };
        let mut high = extent;
        while high > extent / 16_384.0 && is_enough(0.5 * high) {
            high *= 0.5;
        }
        let mut low = 0.5 * high;
        for _ in 0..4 {
            let middle = 0.5 * (low + high);
            *(if is_enough(middle) { &mut high } else { &mut low }) = middle;
        }
        high
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn widths_compared_at_once_give_the_cell_that_one_after_the_other_does() {
        let mut whole = random();
        let mut random = || whole() / 16_777_216.0;
        let mut cells = Vec::new();
        for scale in [1e-30, 1.0, 1e30] {
            for (count, size, large) in [
                (0, 0.1, 0.0),
                (1, 1.0, 0.0),
                (300, 0.3, 0.0),
                (900, 0.02, 0.1),
                (5000, 1e-3, 0.02),
                (2500, 0.0, 0.0),
            ] {
                let mut positions = Vec::new();
                for _ in 0..count {
                    let at = [random(), random(), random()];
                    // Some are as large as the scene.
                    let size = if random() < large { 1.0 } else { size * random() };
                    let mut corner = || at.map(|at| scale * (at + size * random()));
                    positions.extend([corner(), corner(), corner()]);
                }
                let indices: Vec<_> =
                    (0..count).map(|id| [3 * id, 3 * id + 1, 3 * id + 2]).collect();
                let mesh = TriangleMesh::new(&positions, &indices).unwrap();
                let sample = Sample::of(&mesh);
                let extent = 2.0 * scale;
                let found = sample.cell(&mesh, extent);
                let expected = cell(&mesh, sample.step, extent.into());
                assert_eq!(found.to_bits(), expected.to_bits(), "{count} {size} {scale}");
                cells.push(found / f64::from(extent));
            }
        }
        // From most of the extent to the least.
        let (least, most) =
            (cells.iter().copied().fold(1.0, f64::min), cells.iter().copied().fold(0.0, f64::max));
        assert!(least < 1e-4 && most > 0.7, "{cells:?}");
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours")]
    fn any_number_of_tasks_finds_the_box_of_the_vertices() {
        let mut whole = random();
        let mut coordinate = || whole() - 8_388_608.0;
        let positions: Vec<_> =
            (0..400_001).map(|_| [coordinate(), coordinate(), coordinate()]).collect();
        let extremes = [0, 1, 2].map(|axis| {
            let of_axis = positions.iter().map(|position| position[axis]);
            (of_axis.clone().fold(f32::MAX, f32::min), of_axis.fold(f32::MIN, f32::max))
        });
        let expected = Aabb {
            min: extremes.map(|(min, _)| min).into(),
            max: extremes.map(|(_, max)| max).into(),
        };
        let mesh = TriangleMesh::new(&positions, &[]).unwrap();
        let sample = Sample { step: 1, bounds: expected };
        let found =
            |parallel: &Control<'_>| bounds::<4>(&mesh, &sample, BuildFlags::empty(), parallel);
        let backward = |count: u32, task: &(dyn Fn(u32) + Sync)| {
            assert!(count == 2 || count == 3);
            (0..count).rev().for_each(task);
        };
        for tasks in 1..=4 {
            assert_eq!(found(&Control { tasks, run: &backward, progress: None }), Ok(expected));
        }
        let half = |count: u32, task: &(dyn Fn(u32) + Sync)| (1..count).for_each(task);
        let found = found(&Control { tasks: 2, run: &half, progress: None });
        assert_eq!(found, Err(Error::InvalidParallelFor));

        // No vertices, no tasks.
        let nothing = TriangleMesh::new(&[], &[]).unwrap();
        let none = |_: u32, _: &(dyn Fn(u32) + Sync)| panic!("there is nothing to do");
        let parallel = Control { tasks: 4, run: &none, progress: None };
        settle_in::<4>(&nothing, &Config::default(), &mut [], &parallel).unwrap();
    }
}
