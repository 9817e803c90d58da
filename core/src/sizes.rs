//! The memory that a build takes, asked before the build.

use crate::arena::{Sizes, check_alignment};
use crate::config::Config;
use crate::control::Control;
use crate::error::{ConfigField, Error, Region};
use crate::mesh::TriangleMesh;
use crate::method::Method;
use crate::ray::round;
use crate::structure;

impl Sizes {
    /// Enough for any mesh with so many triangles, wherever they lie: O(1), usable in a constant.
    ///
    /// A one-level grid of a scan takes a sixth of it or less, a tree six tenths; for recursive grids it is too large
    /// to be of use. `None` if the configuration is invalid or its method left out, for a tree of more than 2^31
    /// triangles, and if the sizes do not fit the machine's address space.
    ///
    /// ```
    /// use hgrid_core::{Block, Config, Method, Sizes};
    /// const SIZES: Sizes = match Sizes::bound(100, &Config::new(Method::OneLevel)) {
    ///     Some(sizes) => sizes,
    ///     None => panic!("too large"),
    /// };
    /// static INDEX: [Block; Block::count_for(SIZES.index_bytes)] =
    ///     [Block::ZERO; Block::count_for(SIZES.index_bytes)];
    /// ```
    #[must_use]
    pub const fn bound(triangles: u32, config: &Config) -> Option<Self> {
        Self::bound_parallel(triangles, config, 1)
    }

    /// Enough for any mesh with so many triangles and a build with so many tasks ([`Control::tasks`]). A task of a tree
    /// takes no more than a byte of scratch for four triangles; the other methods have one task.
    ///
    /// ```
    /// use hgrid_core::{Config, Method, Sizes};
    /// const BVH: Config = Config::new(Method::Bvh);
    /// let bound = |tasks| Sizes::bound_parallel(1_000_000, &BVH, tasks).unwrap();
    /// assert!(bound(8).scratch_bytes <= bound(1).scratch_bytes + 8 * 250_000);
    /// ```
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "compared before")]
    pub const fn bound_parallel(triangles: u32, config: &Config, tasks: u32) -> Option<Self> {
        if config.check().is_err() {
            return None;
        }
        let Some((index, scratch)) = structure::bound(triangles, config, tasks) else {
            return None;
        };
        if index > usize::MAX as u64 || scratch > usize::MAX as u64 {
            return None;
        }
        let (index_bytes, scratch_bytes) = (index as usize, scratch as usize);
        Some(Self { index_bytes, scratch_bytes, is_exact: false })
    }
}

/// The memory that a build of this mesh takes.
///
/// With an empty `scratch`, `index_bytes` is an upper bound: for a scan up to twice what one level or a tree takes,
/// four times what a fixed grid takes, for the others a generous multiple. A grid of cells takes two passes over the
/// triangles for that, one more for each halving of the density. With `scratch_bytes` of scratch (aligned as for a
/// build) the grid is planned in it and `index_bytes` is exact, for about half the time of a build, up to all of it
/// for trees and recursive grids. The scratch holds nothing of use afterwards.
///
/// # Errors
/// The errors of [`Grid::build`](crate::Grid::build), except those of the index region.
///
/// ```
/// use hgrid_core::{Block, Config, TriangleMesh, sizes};
/// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
/// let enough = sizes(&mesh, &Config::default(), &mut [])?;
/// let mut scratch = vec![Block::ZERO; Block::count_for(enough.scratch_bytes)];
/// let exact = sizes(&mesh, &Config::default(), Block::bytes_mut(&mut scratch))?;
/// assert!(exact.is_exact && exact.index_bytes <= enough.index_bytes);
/// # Ok::<(), hgrid_core::Error>(())
/// ```
pub fn sizes(mesh: &TriangleMesh<'_>, config: &Config, scratch: &mut [u8]) -> Result<Sizes, Error> {
    sizes_with(mesh, config, scratch, &Control::SERIAL)
}

/// The memory that a parallel build of this mesh takes: [`sizes`], by the caller's threads.
///
/// Only [`Method::Bvh`] builds in parallel; for the others this is [`sizes`]. Each task fills a part of the index, and
/// with [`Quality::Fast`](crate::Quality::Fast) takes scratch of its own. Together they take as much as for any mesh
/// with so many triangles, so the answer for several tasks is never exact.
///
/// # Errors
/// The errors of [`Grid::build_with`](crate::Grid::build_with), except those of the index region.
///
/// ```
/// use hgrid_core::{Config, Control, Error, TriangleMesh, sizes, sizes_with};
/// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
/// let config = Config::default();
/// let control = Control { tasks: 8, ..Control::default() };
/// let parallel = sizes_with(&mesh, &config, &mut [], &control)?;
/// assert!(parallel.scratch_bytes >= sizes(&mesh, &config, &mut [])?.scratch_bytes);
/// # Ok::<(), Error>(())
/// ```
pub fn sizes_with(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    scratch: &mut [u8],
    control: &Control<'_>,
) -> Result<Sizes, Error> {
    config.check()?;
    check_alignment(scratch, Region::Scratch)?;
    structure::sizes(mesh, config, scratch, control)
}

/// The finest grid of a method that fits into `index_bytes`, and its sizes: the given configuration, or one with a
/// lower density, as a rule at most a step too low. [`Method::Bvh`] has no density: its tree fits or does not.
///
/// A step is a factor of the square root of 2 in the number of cells. It takes about a dozen calls of [`sizes`], and at
/// most 22. They use `scratch`: bring as much as [`sizes`] without scratch says. With less the grid may be coarser
/// than the index requires: one-level and fixed grids must then fit by their bound, variable and recursive grids and
/// trees must be small enough to plan in the scratch.
///
/// The search relies on coarser grids being smaller. But a coarser grid may take more memory than one a few steps
/// finer. Then the answer may be several steps too low, and a budget that only the finer grid fits into may be refused.
///
/// # Errors
/// [`Error::OutOfMemory`] with the bytes of index that the coarsest grid needs, or the scratch; those of [`sizes`].
///
/// ```
/// use hgrid_core::{Block, Config, TriangleMesh, fit, sizes};
/// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
/// let enough = sizes(&mesh, &Config::default(), &mut [])?;
/// let mut scratch = vec![Block::ZERO; Block::count_for(enough.scratch_bytes)];
/// let scratch = Block::bytes_mut(&mut scratch);
/// let (config, sizes) = fit(&mesh, &Config::default(), 10_000, scratch)?;
/// assert!(config == Config::default() && sizes.index_bytes <= 10_000);
/// # Ok::<(), hgrid_core::Error>(())
/// ```
pub fn fit(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    index_bytes: usize,
    scratch: &mut [u8],
) -> Result<(Config, Sizes), Error> {
    config.check()?;
    // A tree has no density.
    let most_steps = if config.parameters.density().is_some() { MOST_STEPS } else { 0 };
    let mut try_with = |steps: u32| fits(mesh, &coarsened(config, steps), index_bytes, scratch);
    // Double the number of steps until the grid fits, then bisect for the smallest.
    let (mut low, mut high) = (0, 0);
    let mut needed = loop {
        match try_with(high) {
            Ok(needed) => break needed,
            Err(error) if high >= most_steps || !is_too_large(error) => return Err(error),
            Err(_) => (low, high) = (high, (2 * high).max(1)),
        }
    };
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        match try_with(middle) {
            Ok(less) => (high, needed) = (middle, less),
            Err(_) => low = middle,
        }
    }
    Ok((coarsened(config, high), needed))
}

/// Steps from the largest density in f32 to one cell, at most.
const MOST_STEPS: u32 = 1024;

/// A configuration that asks for so many steps fewer cells.
fn coarsened(config: &Config, steps: u32) -> Config {
    match config.parameters.density() {
        Some(density) if steps > 0 => {
            let fewer = (0..steps).fold(1.0, |all, _| all * core::f64::consts::FRAC_1_SQRT_2);
            let density = round(f64::from(density) * fewer).max(f32::MIN_POSITIVE);
            Config { parameters: config.parameters.with_density(density), ..*config }
        }
        _ => *config,
    }
}

/// Returns the memory that a grid needs, if it fits into so much.
fn fits(
    mesh: &TriangleMesh<'_>,
    config: &Config,
    index_bytes: usize,
    scratch: &mut [u8],
) -> Result<Sizes, Error> {
    let needed = sizes(mesh, config, scratch)?;
    let missing = |region, needed: usize, available: usize| {
        Error::out_of_memory(region, needed as u64, available as u64)
    };
    // The bounds of the other methods say little about the need of a mesh: a plan in the scratch says it.
    let needs_plan = !matches!(config.method(), Method::OneLevel | Method::Fixed);
    if needs_plan && !needed.is_exact {
        return Err(missing(Region::Scratch, needed.scratch_bytes, scratch.len()));
    }
    if needed.index_bytes > index_bytes {
        return Err(missing(Region::Index, needed.index_bytes, index_bytes));
    }
    Ok(needed)
}

/// Returns true if a coarser grid may succeed: this one is too large for its memory or for the machine's addresses, or
/// its density is too high.
const fn is_too_large(error: Error) -> bool {
    matches!(
        error,
        Error::OutOfMemory { .. }
            | Error::TooManyTriangles
            | Error::InvalidConfig(ConfigField::Density)
    )
}
