//! A batch of rays, group by group.

use fearless_simd::Simd;

use super::Bvh;
use super::group::{Group, Stack};
use super::rays::{GROUP, Rays};
use crate::aabb::Aabb;
use crate::mesh::{Strided, TriangleMesh};
use crate::ray::Hit;
use crate::simd::Kernel;

/// The rays of a batch, as given.
pub(crate) struct Groups<'r, A, const ANY: bool> {
    pub(crate) bvh: &'r Bvh<'r>,
    pub(crate) mesh: &'r TriangleMesh<'r>,
    pub(crate) bounds: Aabb,
    pub(crate) rays: &'r Strided<'r>,
    /// Gets the place of a ray and its hit and perhaps those of the next ones, or no hit for a ray that must
    /// be traced alone.
    pub(crate) answer: A,
}

impl<A: FnMut(usize, &[Hit]), const ANY: bool> Kernel for Groups<'_, A, ANY> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { bvh, mesh, bounds, rays: batch, mut answer } = self;
        let (rays, stack) = (&mut Rays::new(), &mut Stack::new());
        let mut first = 0;
        while first < batch.count {
            let count = (batch.count - first).min(GROUP);
            for (ray, at) in rays.slots().iter_mut().zip(first..first + count) {
                *ray = batch.read(at);
            }
            let mut alone = rays.prepare(simd, count, &bounds);
            if rays.are_scattered(&bounds) {
                alone |= rays.alive;
            } else {
                Group::<ANY> { bvh, mesh, rays, stack }.run(simd);
            }
            answer(first, rays.hits.get(..count).unwrap_or_default());
            while alone != 0 {
                answer(first + alone.trailing_zeros() as usize, &[]);
                alone &= alone - 1;
            }
            first += count;
        }
    }
}
