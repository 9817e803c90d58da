//! The two regions of a grid, and builds in them: first builds in new pages of the system, and rebuilds in
//! regions that are kept.

use anyhow::{Context as _, Result, bail};
use hgrid_core::{Config, Control, Error, Grid, Method, Region, Sizes, TriangleMesh, sizes_with};
#[cfg(target_os = "linux")]
use memmap2::Advice;
use memmap2::{MmapMut, MmapOptions};

use crate::resident::resident_bytes;
use crate::threads::Threads;

/// The reason why a grid has fewer cells than its configuration asks for: a limit of the core (docs/bounds.md).
pub(crate) const TOO_DENSE: &str = "a grid has at most 16 references to each triangle";

/// The index and the scratch of a grid.
pub(crate) struct Regions {
    pub(crate) index: MmapMut,
    pub(crate) scratch: MmapMut,
}

impl Regions {
    /// Builds on one thread as a user does: computes the sizes, allocates, builds.
    pub(crate) fn build(mesh: TriangleMesh<'_>, config: &Config) -> Result<Self> {
        Threads::new(1)?.parallel(|parallel| Self::fresh(mesh, config, parallel))
    }

    /// Builds the same way, with a control for threads.
    pub(crate) fn fresh(
        mesh: TriangleMesh<'_>,
        config: &Config,
        parallel: &Control<'_>,
    ) -> Result<Self> {
        Self::built(mesh, config, parallel, memory)
    }

    /// Builds the same way, in memory from `pages`.
    fn built(
        mesh: TriangleMesh<'_>,
        config: &Config,
        parallel: &Control<'_>,
        pages: fn(usize) -> Result<MmapMut>,
    ) -> Result<Self> {
        // A tree's bound only needs the number of triangles, and memory that is not written costs nothing.
        let bound = match config.method() {
            Method::Bvh => Sizes::bound_parallel(mesh.triangle_count(), config, parallel.tasks),
            _ => None,
        };
        let sizes = match bound {
            Some(bound) => bound,
            None => sizes_with(&mesh, config, &mut [], parallel)?,
        };
        let mut regions = Self::mapped(sizes, pages)?;
        Grid::build_with(mesh, config, &mut regions.index, &mut regions.scratch, parallel)?;
        Ok(regions)
    }

    /// Refuses a grid that has fewer cells than the density that was asked for, if one was.
    ///
    /// # Errors
    /// If it has; the message names the density that it has.
    pub(crate) fn refuse_thinner(grid: &Grid<'_>, asked: Option<f32>) -> Result<()> {
        if let Some(asked) = asked
            && let Some(built) = grid.config().parameters.density()
            && built < asked
        {
            bail!(
                "--density {asked} is too much for this mesh, because {TOO_DENSE}; --density {built} fits"
            );
        }
        Ok(())
    }

    fn mapped(sizes: Sizes, pages: fn(usize) -> Result<MmapMut>) -> Result<Self> {
        Ok(Self { index: pages(sizes.index_bytes)?, scratch: pages(sizes.scratch_bytes)? })
    }

    /// Maps as many bytes as `sizes` says.
    pub(crate) fn of(sizes: Sizes) -> Result<Self> {
        Self::mapped(sizes, memory)
    }

    /// Maps them in small pages, so that [`written_bytes`](Self::written_bytes) counts closely.
    pub(crate) fn counted(sizes: Sizes) -> Result<Self> {
        Self::mapped(sizes, small_pages)
    }

    /// Returns the bytes that were written, in whole pages; if the system does not tell, the used bytes of
    /// the index and all of the scratch.
    pub(crate) fn written_bytes(&self, index_bytes: usize) -> usize {
        let Self { index, scratch } = self;
        match resident_bytes(index).zip(resident_bytes(scratch)) {
            Some((index, scratch)) => index + scratch,
            None => index_bytes + scratch.len(),
        }
    }

    /// Maps as much as the mesh needs at present.
    pub(crate) fn empty(
        mesh: &TriangleMesh<'_>,
        config: &Config,
        parallel: &Control<'_>,
    ) -> Result<Self> {
        Self::of(sizes_with(mesh, config, &mut [], parallel)?)
    }

    /// Builds in these regions, and replaces those that are too small; returns the number of replacements.
    pub(crate) fn rebuild(
        &mut self,
        mesh: TriangleMesh<'_>,
        config: &Config,
        parallel: &Control<'_>,
    ) -> Result<u32> {
        let mut grown = 0;
        loop {
            let Self { index, scratch } = self;
            match Grid::build_with(mesh, config, index, scratch, parallel).map(drop) {
                Ok(()) => return Ok(grown),
                Err(Error::OutOfMemory { region, needed_bytes, .. }) => {
                    let larger = memory(usize::try_from(needed_bytes)?)?;
                    *(if region == Region::Index { index } else { scratch }) = larger;
                    grown += 1;
                }
                Err(error) => return Err(error.into()),
            }
        }
    }
}

/// Returns the bytes of index and scratch that a build writes, in whole small pages; if the system does not
/// tell, the bytes of the grid and of all scratch.
pub(crate) fn peak_bytes(
    mesh: TriangleMesh<'_>,
    config: &Config,
    parallel: &Control<'_>,
) -> Result<usize> {
    let regions = Regions::built(mesh, config, parallel, small_pages)?;
    let index_bytes = Grid::open(&regions.index, mesh)?.blob_bytes();
    Ok(regions.written_bytes(index_bytes))
}

/// The least number of bytes for which large pages are requested: one page of 2 MiB.
#[cfg(target_os = "linux")]
const MANY_BYTES: usize = 2 << 20;

/// Maps memory whose pages the system provides when they are first written, large ones if it has them. They
/// make first builds of 150 000 triangles and more faster, and Embree requests them, too. A smaller build would
/// write little of each, and wait until the system has cleared all of it.
pub(crate) fn memory(bytes: usize) -> Result<MmapMut> {
    let memory = map(bytes)?;
    // A system without large pages provides small ones.
    #[cfg(target_os = "linux")]
    if bytes >= MANY_BYTES {
        let _ = memory.advise(Advice::HugePage);
    }
    Ok(memory)
}

/// Maps memory in small pages, so that little more than the written bytes is counted.
fn small_pages(bytes: usize) -> Result<MmapMut> {
    let memory = map(bytes)?;
    #[cfg(target_os = "linux")]
    let _ = memory.advise(Advice::NoHugePage);
    Ok(memory)
}

fn map(bytes: usize) -> Result<MmapMut> {
    let mut options = MmapOptions::new();
    options
        .len(bytes.max(1))
        .no_reserve_swap()
        .map_anon()
        .with_context(|| format!("cannot get {bytes} bytes of memory"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn small_pages_are_small() {
        const LARGE: usize = 1 << 21;
        let mut memory = small_pages(32 * LARGE).unwrap();
        for byte in memory.iter_mut().step_by(LARGE) {
            *byte = 1;
        }
        if let Some(bytes) = resident_bytes(&memory) {
            assert!((32 * 4096..=32 * LARGE / 8).contains(&bytes), "{bytes}");
        }
    }

    #[test]
    fn kept_regions_grow_when_a_mesh_needs_more_and_hold_the_same_grid() {
        let [small, large] =
            ["procedural:knot:200", "procedural:knot:3000"].map(|spec| Scene::load(spec).unwrap());
        let [small, large] = [&small, &large]
            .map(|scene| TriangleMesh::new(&scene.positions, &scene.indices).unwrap());
        for config in Method::ALL.iter().copied().map(Config::new) {
            let expected = Regions::build(large, &config).unwrap();
            let blob = |regions: &Regions| {
                let bytes = Grid::open(&regions.index, large).unwrap().blob_bytes();
                regions.index[..bytes].to_vec()
            };
            let control = Control::default();
            let mut kept = Regions::empty(&small, &config, &control).unwrap();
            kept.rebuild(small, &config, &control).unwrap();
            assert!(kept.rebuild(large, &config, &control).unwrap() > 0);
            assert_eq!(kept.rebuild(large, &config, &control).unwrap(), 0);
            assert!(blob(&kept) == blob(&expected), "{}", config.method().name());
        }
    }
}
