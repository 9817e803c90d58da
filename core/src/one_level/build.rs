//! Building a one-level grid: plan in the scratch, then write the index exactly.
//!
//! ```text
//! survey     bounds, indices checked                                   (survey.rs)
//! settle     resolution from the density; mark domain bits, count references
//! displace   row offsets, number of slots              -> every size is exact from here
//! count      references per slot, then their sum up to each slot
//! fill       triangles in reverse: every list ascends by id           (compact grid, LD08)
//! ```
//!
//! The plan touches only the scratch, so a build that runs out of index memory has written nothing
//! there and knows exactly what it needs.
//!
//! The number of references has no bound in the number of triangles: a million triangles that each span the scene would
//! fill every cell a million times. [`reference_limit`] is the promise that this does not happen: a mesh that would
//! need more is built with half the density, again and again until it fits. Scans never come near it.

use super::displacement::displace;
use super::layout::{Layout, Scratch};
use super::spread::{count_references, fill, mark};
use super::triangles::MeshSpread;
use crate::arena::{Sizes, copy, first_mut};
use crate::blob::Header;
use crate::cell::{Lattice, woo};
use crate::config::{BuildFlags, Parameters};
use crate::control::Watch;
use crate::error::{ConfigField, Error, Region};
use crate::mesh::TriangleMesh;
use crate::survey::{Survey, reference_limit};

/// The words that a structure keeps behind the sections of its one-level grid.
pub(crate) trait Overlay {
    /// Words for a grid with this resolution.
    fn words(&self, resolution: [u32; 3]) -> u64;

    /// Writes the words.
    fn fill(&self, resolution: [u32; 3], domain_bits: &[u64], words: &mut [u64]);

    /// The parameters of the grid and its overlay, with this density.
    fn parameters(&self, density: f32) -> Parameters;
}

/// No overlay.
impl Overlay for () {
    fn words(&self, _: [u32; 3]) -> u64 {
        0
    }

    fn fill(&self, _: [u32; 3], _: &[u64], _: &mut [u64]) {}

    fn parameters(&self, density: f32) -> Parameters {
        Parameters::OneLevel { density }
    }
}

/// All that is known of a grid before its index is written.
#[derive(Debug)]
pub(crate) struct Plan<'s> {
    /// The sizes: exact if there was scratch enough to displace the rows, else a bound.
    pub(crate) layout: Layout,
    pub(crate) survey: Survey,
    pub(crate) lattice: Lattice,
    pub(crate) density: f32,
    /// The scratch, once rows are marked and displaced in it.
    pub(crate) rows: Option<Scratch<'s>>,
}

impl<'s> Plan<'s> {
    /// Plans as far as the scratch allows; without any, passes over the mesh give a bound.
    pub(crate) fn new(
        mesh: &TriangleMesh<'_>,
        mut density: f32,
        flags: BuildFlags,
        overlay: &dyn Overlay,
        scratch: &'s mut [u8],
        watch: &Watch<'_>,
    ) -> Result<Self, Error> {
        let survey = Survey::of(mesh, flags, watch)?;
        let bounds = Lattice::pad(&survey.bounds);
        let limit = reference_limit(mesh.triangle_count());

        // Settle the density: mark the cells, or only count where there is no room to mark.
        let (lattice, reference_count) = loop {
            let resolution = woo(bounds.size(), f64::from(density), survey.finite_count)
                .ok_or(Error::InvalidConfig(ConfigField::Density))?;
            let lattice = Lattice::new(bounds, resolution);
            let spread = MeshSpread::new(mesh, &lattice);
            let count = match Layout::new(resolution, 0, 0, 0).scratch(scratch) {
                Some(Scratch { domain_bits, .. }) => mark(&spread, domain_bits, limit, watch)?,
                None => count_references(&spread, limit, watch, |_, _| {})?,
            };
            match count {
                Some(count) => break (lattice, count),
                None => density *= 0.5,
            }
        };

        watch.at(0.4)?;
        // Displace the rows: only this tells the number of slots.
        let overlay_words = overlay.words(lattice.resolution);
        let mut layout = Layout::new(lattice.resolution, 0, reference_count, overlay_words);
        layout.hash_count = u32::try_from(layout.cells).unwrap_or(u32::MAX);
        let mut rows = layout.scratch(scratch);
        if let Some(Scratch { row_offsets, domain_bits, occupied, .. }) = &mut rows {
            let width = lattice.resolution[0] as usize;
            layout.hash_count = displace(domain_bits, width, row_offsets, occupied)
                .ok_or(Error::InvalidConfig(ConfigField::Density))?;
        }
        Ok(Self { layout, survey, lattice, density, rows })
    }

    /// The header of the grid, with the sizes of its layout.
    pub(crate) fn header(&self, parameters: Parameters, mesh: &TriangleMesh<'_>) -> Header {
        let mut header = Header::new(parameters, mesh, &self.lattice);
        header.blob_bytes = self.layout.index_bytes();
        header.skipped_count = self.survey.skipped_count;
        header.hash_count = self.layout.hash_count;
        header.reference_count = self.layout.reference_count;
        header
    }

    /// The memory that a mesh needs: exact if the scratch is large enough to displace the rows in.
    pub(crate) fn sizes(
        mesh: &TriangleMesh<'_>,
        density: f32,
        flags: BuildFlags,
        overlay: &dyn Overlay,
        scratch: &mut [u8],
    ) -> Result<Sizes, Error> {
        let plan = Plan::new(mesh, density, flags, overlay, scratch, &Watch::none())?;
        let (index_bytes, scratch_bytes) = plan.layout.bytes();
        Sizes::new(index_bytes, scratch_bytes, plan.rows.is_some())
    }
}

/// Builds into `index` and returns the part of it that is the blob.
pub(crate) fn build_under<'a>(
    mesh: &TriangleMesh<'_>,
    density: f32,
    flags: BuildFlags,
    overlay: &dyn Overlay,
    index: &'a mut [u8],
    scratch: &mut [u8],
    watch: &Watch<'_>,
) -> Result<&'a [u8], Error> {
    let available_bytes = scratch.len() as u64;
    let plan = Plan::new(mesh, density, flags, overlay, scratch, watch)?;
    let Some(rows) = &plan.rows else {
        let needed_bytes = plan.layout.scratch_bytes();
        return Err(Error::out_of_memory(Region::Scratch, needed_bytes, available_bytes));
    };
    let needed_bytes = plan.layout.index_bytes();
    let too_small = Error::out_of_memory(Region::Index, needed_bytes, index.len() as u64);
    let blob = first_mut(index, needed_bytes, Region::Index)?;
    let sections = plan.layout.sections_mut(blob).ok_or(too_small)?;

    // Clear the header first: if the build is cancelled, the region must not open as a grid.
    sections.header.fill(0);
    copy(rows.row_offsets, sections.row_offsets);
    copy(rows.domain_bits, sections.domain_bits);
    let spread = MeshSpread::new(mesh, &plan.lattice);
    fill(&spread, sections.row_offsets, sections.hash, sections.references, watch)?;
    overlay.fill(plan.lattice.resolution, sections.domain_bits, sections.overlay);
    *sections.header = plan.header(overlay.parameters(plan.density), mesh).to_bytes();
    Ok(blob)
}
