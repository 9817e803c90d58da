//! The systems of hgrid itself.

use core::cell::RefCell;

use anyhow::Result;
use hgrid_core::{
    Coherence, Config, Control, Grid, Hit, Method, Parameters, Quality, QueryOptions, Ray, Strided,
    StridedMut,
};

use super::input::Input;
use super::instanced;
use super::mode::Mode;
use super::points::distance;
use super::shown::Shown;
use super::spheres;
use super::system::{Bytes, System, Tracer, Use, each, one_by_one};
use super::workloads::Workload;
use crate::regions::{Regions, peak_bytes};
use crate::tiles::TILE_RAYS;

/// The ending of the name of a tree of high quality.
pub(super) const HIGH: &str = "-high";

/// The system of one method.
pub(super) struct GridSystem {
    config: Config,
}

impl GridSystem {
    pub(super) const fn new(config: Config) -> Self {
        Self { config }
    }
}

/// Returns true if a method is one of the paper's, which trace the rays of a batch one by one.
const fn is_of_paper(method: Method) -> bool {
    matches!(method, Method::OneLevel | Method::Variable | Method::Fixed | Method::Recursive)
}

impl System for GridSystem {
    fn name(&self) -> String {
        let Config { parameters, .. } = self.config;
        let is_high = parameters == Parameters::Bvh { quality: Quality::High };
        parameters.method().name().to_owned() + if is_high { HIGH } else { "" }
    }

    fn is_peer(&self) -> bool {
        false
    }

    fn modes(&self, workload: Workload, shown: Shown) -> &'static [Mode] {
        let method = self.config.method();
        match workload {
            // Scenes and shapes are built only as trees, and have no closest-point query.
            _ if shown != Shown::Mesh && method != Method::Bvh => &[],
            Workload::Near | Workload::Far if shown != Shown::Mesh => &[],
            // For a point far from the mesh, other methods can take as long as for a picture.
            Workload::Near | Workload::Far if method == Method::default() => &[Mode::Single],
            Workload::Near | Workload::Far => &[],
            _ if is_of_paper(method) => one_by_one(workload),
            Workload::Primary => &[Mode::Single, Mode::Coherent],
            Workload::Ao | Workload::Bounce => &[Mode::Single, Mode::Coherent, Mode::Batch],
            Workload::Random => &[Mode::Single, Mode::Batch],
        }
    }

    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()> {
        match input.shown() {
            Shown::Mesh => {}
            Shown::Instances(_) => return instanced::build(input, &self.config, None, then),
            Shown::Spheres => return spheres::build(input, &self.config, None, then),
        }
        let mesh = input.mesh()?;
        let regions = Regions::build(mesh, &self.config)?;
        let (grid, memory) = (Grid::open(&regions.index, mesh)?, RefCell::default());
        then(&GridTracer { grid, config: &self.config, memory })
    }

    fn rebuild(&self, input: &Input, start: &mut dyn FnMut(), then: &mut Use<'_>) -> Result<()> {
        match input.shown() {
            Shown::Mesh => {}
            Shown::Instances(_) => return instanced::build(input, &self.config, Some(start), then),
            Shown::Spheres => return spheres::build(input, &self.config, Some(start), then),
        }
        let mesh = input.mesh()?;
        let mut regions = Regions::build(mesh, &self.config)?;
        start();
        regions.rebuild(mesh, &self.config, &Control::default())?;
        let (grid, memory) = (Grid::open(&regions.index, mesh)?, RefCell::default());
        then(&GridTracer { grid, config: &self.config, memory })
    }
}

struct GridTracer<'a> {
    grid: Grid<'a>,
    config: &'a Config,
    /// Memory to sort rays in, kept from call to call.
    memory: RefCell<Vec<u8>>,
}

impl Tracer for GridTracer<'_> {
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]) {
        let Some(call) = Call::of(mode) else {
            return each(rays, hits, |ray| self.grid.intersect(ray).unwrap_or(Hit::MISS));
        };
        let memory = &mut self.memory.borrow_mut();
        let scratch = call.memory(rays.len(), memory);
        let options = &mut QueryOptions { scratch, ..QueryOptions::default() };
        for (rays, hits) in rays.chunks(call.rays).zip(hits.chunks_mut(call.rays)) {
            let (rays, answers) = (&Strided::new(rays), &mut StridedMut::new(&mut *hits));
            if self.grid.intersect_n_with(rays, answers, call.coherence, options).is_err() {
                hits.fill(Hit::MISS);
            }
        }
    }

    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [u8]) {
        let Some(call) = Call::of(mode) else {
            return each(rays, occluded, |ray| self.grid.occluded(ray).into());
        };
        let memory = &mut self.memory.borrow_mut();
        let scratch = call.memory(rays.len(), memory);
        let options = &mut QueryOptions { scratch, ..QueryOptions::default() };
        for (rays, occluded) in rays.chunks(call.rays).zip(occluded.chunks_mut(call.rays)) {
            let (rays, answers) = (&Strided::new(rays), &mut StridedMut::new(&mut *occluded));
            if self.grid.occluded_n_with(rays, answers, call.coherence, options).is_err() {
                occluded.fill(0);
            }
        }
    }

    fn closest_points(&self, points: &[[f32; 3]], radius: f32, distances: &mut [f32]) {
        for (&point, place) in points.iter().zip(distances) {
            *place = distance(&self.grid, point, radius);
        }
    }

    fn bytes(&self) -> Result<Option<Bytes>> {
        let peak = peak_bytes(*self.grid.mesh(), self.config, &Control::default())?;
        Ok(Some(Bytes { index: self.grid.blob_bytes(), peak }))
    }
}

/// The form of the calls that trace batches.
pub(super) struct Call {
    /// The largest number of rays in a call.
    pub(super) rays: usize,
    pub(super) coherence: Coherence,
}

impl Call {
    /// Returns the calls of a mode; none if the mode hands over rays one by one.
    pub(super) const fn of(mode: Mode) -> Option<Self> {
        match mode {
            Mode::Coherent => Some(Self { rays: TILE_RAYS, coherence: Coherence::Coherent }),
            Mode::Batch => Some(Self { rays: usize::MAX, coherence: Coherence::Incoherent }),
            _ => None,
        }
    }

    /// Returns memory to sort so many rays in. It grows only for calls that may sort.
    pub(super) fn memory<'m>(&self, rays: usize, memory: &'m mut Vec<u8>) -> &'m mut [u8] {
        if self.coherence == Coherence::Incoherent {
            // Sixteen bytes a ray, and up to sixteen to align the first.
            memory.resize(memory.len().max(16 * rays + 16), 0);
        }
        memory
    }
}
