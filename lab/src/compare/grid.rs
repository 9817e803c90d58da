//! hgrid itself.

use anyhow::Result;
use hgrid_core::{Coherence, Config, Control, Grid, Hit, Method, Ray, Strided, StridedMut};

use super::input::Input;
use super::system::{Bytes, Mode, System, Tracer, Use, each};
use super::workloads::Workload;
use crate::regions::{Regions, peak_bytes};
use crate::tiles::{TILE_RAYS, intersect};

/// One method.
pub(super) struct GridSystem {
    config: Config,
}

impl GridSystem {
    pub(super) const fn new(config: Config) -> Self {
        Self { config }
    }
}

impl System for GridSystem {
    fn name(&self) -> String {
        self.config.method.name().to_owned()
    }

    fn is_peer(&self) -> bool {
        false
    }

    fn modes(&self, workload: Workload) -> &'static [Mode] {
        // The other methods trace a batch ray by ray.
        match workload {
            Workload::Primary | Workload::Ao if self.config.method == Method::Brick => {
                &[Mode::Single, Mode::Coherent]
            }
            _ => &[Mode::Single],
        }
    }

    fn build(&self, input: &Input, then: &mut Use<'_>) -> Result<()> {
        let mesh = input.mesh()?;
        let memory = Regions::build(mesh, &self.config)?;
        then(&GridTracer { grid: Grid::open(&memory.index, mesh)?, config: &self.config })
    }
}

struct GridTracer<'a> {
    grid: Grid<'a>,
    config: &'a Config,
}

impl Tracer for GridTracer<'_> {
    fn intersect(&self, mode: Mode, rays: &[Ray], hits: &mut [Hit]) {
        if mode == Mode::Coherent {
            return intersect(&self.grid, rays, hits);
        }
        each(rays, hits, |ray| self.grid.intersect(ray).unwrap_or(Hit::MISS));
    }

    fn occluded(&self, mode: Mode, rays: &[Ray], occluded: &mut [bool]) {
        if mode != Mode::Coherent {
            return each(rays, occluded, |ray| self.grid.occluded(ray));
        }
        let mut bytes = [0_u8; TILE_RAYS];
        for (rays, occluded) in rays.chunks(TILE_RAYS).zip(occluded.chunks_mut(TILE_RAYS)) {
            let answers = &mut StridedMut::new(&mut bytes[..rays.len()]);
            match self.grid.occluded_n(&Strided::new(rays), answers, Coherence::Coherent) {
                Ok(()) => occluded.iter_mut().zip(&bytes).for_each(|(to, &byte)| *to = byte != 0),
                Err(_) => each(rays, occluded, |ray| self.grid.occluded(ray)),
            }
        }
    }

    fn bytes(&self) -> Result<Option<Bytes>> {
        let peak = peak_bytes(*self.grid.mesh(), self.config, &Control::default())?;
        Ok(Some(Bytes { index: self.grid.blob_bytes(), peak }))
    }
}
