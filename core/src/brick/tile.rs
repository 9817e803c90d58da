//! A tile: neighbouring rays, of which those of one bundle go through the grid together, or those of
//! both.
//!
//! Where cells are large, a triangle is read and compared with planes once for twice as many rays if
//! both bundles go together. Where they are small, so that rays at both ends of the tile have
//! no cell in common, it is more cells that every ray is compared with.
//!
//! Rays that turn off the axis of the others, and bundles that spread over too many cells, are
//! left to the walk of single rays.

use fearless_simd::Simd;

use super::Brick;
use super::bundle::{BUNDLES, Bundle, RAYS};
use super::hits::Tests;
use super::march::March;
use super::reach::Reach;
use crate::cell::Lattice;
use crate::mesh::{Strided, TriangleMesh};

/// So many cells are the corners of a tile less apart if both bundles go together. From 1.5 to 3
/// tiles take the same time within 2 %, with 4 those of dragon 1.06.
const NARROW: f32 = 2.0;

/// The rays of a tile, and what they are traced through.
#[derive(Debug)]
pub(super) struct Tile<'a, const ANY: bool> {
    brick: &'a Brick<'a>,
    lattice: &'a Lattice,
    mesh: &'a TriangleMesh<'a>,
    bundles: [Bundle; BUNDLES],
    /// The cells that rays of each may meet in the slice at hand, on u and v.
    reach: [[Reach; 2]; BUNDLES],
    tests: Tests,
}

impl<'a, const ANY: bool> Tile<'a, ANY> {
    /// A tile without rays.
    pub(super) const fn new(
        brick: &'a Brick<'a>,
        lattice: &'a Lattice,
        mesh: &'a TriangleMesh<'a>,
    ) -> Self {
        Self {
            brick,
            lattice,
            mesh,
            bundles: [const { Bundle::EMPTY }; BUNDLES],
            reach: [const { [Reach::NONE; 2] }; BUNDLES],
            tests: Tests::NONE,
        }
    }

    /// Traces a tile's rays, `count` of them, and tells which of each bundle: the others need a way
    /// of their own.
    #[inline(always)]
    pub(super) fn trace<S: Simd>(
        &mut self,
        simd: S,
        rays: &Strided<'_>,
        first: usize,
        count: usize,
    ) -> [u64; BUNDLES] {
        let mut members = [0; BUNDLES];
        for ((at, bundle), members) in
            (0..count).step_by(RAYS).zip(&mut self.bundles).zip(&mut members)
        {
            bundle.load(simd, self.brick, self.lattice, rays, first + at, RAYS.min(count - at));
            *members = bundle.members;
        }
        if !members.contains(&0) && self.are_neighbours() && self.go::<S, BUNDLES>(simd, 0) {
            return members;
        }
        for (at, members) in members.iter_mut().enumerate() {
            if *members != 0 && !self.go::<S, 1>(simd, at) {
                *members = 0;
            }
        }
        members
    }

    /// Whether the bundles share their way.
    #[inline(always)]
    pub(super) fn are_neighbours(&self) -> bool {
        let [a, b] = &self.bundles;
        a.runs_along(b) && a.distance(b) < NARROW
    }

    /// The rays of a bundle, once they were traced.
    pub(super) const fn bundle(&self, place: usize) -> &Bundle {
        &self.bundles[place % BUNDLES]
    }

    /// Lets `N` bundles go through the grid; `false` if they are too far apart for it.
    ///
    /// Out of line, and says once more what vectors it is compiled for.
    #[inline(never)]
    fn go<S: Simd, const N: usize>(&mut self, simd: S, first: usize) -> bool {
        simd.vectorize(
            #[inline(always)]
            || {
                let Self { brick, mesh, bundles, reach, tests, .. } = self;
                let (Some(bundles), Some(reach)) = (
                    bundles.get_mut(first..).and_then(|bundles| bundles.first_chunk_mut::<N>()),
                    reach.get_mut(first..).and_then(|reach| reach.first_chunk_mut::<N>()),
                ) else {
                    return false;
                };
                let mut march: March<'_, 'a, ANY, N> =
                    March { brick, mesh, bundles, reach, tests, unread: 0 };
                march.go(simd)
            },
        )
    }
}
