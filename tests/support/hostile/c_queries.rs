//! The queries of the C calls: their answers are those of Rust on the same bytes, bit for bit, and nothing
//! but the answers is written.

use std::ptr::{from_mut, from_ref, null, null_mut};

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_capi::*;
use hgrid_core::{ClosestPoint, Grid, Hit, IndexType, Ray, Strided, TriangleMesh};
use zerocopy::{FromBytes, IntoBytes};

use super::ask::{agrees, ends};
use super::c_abi::{Caller, known};
use super::c_options::{Options, Told, bits, c_bits};
use super::memory::{Memory, rarely};
use super::rays;

use crate::owned::prove;

/// A hit that was not written.
const UNTOUCHED: hgrid_hit = hgrid_hit { t: 7.0, u: 7.0, v: 7.0, primitive: 7 };

fn for_c(ray: &Ray) -> hgrid_ray {
    let Ray { origin, t_min, direction, t_max } = *ray;
    hgrid_ray { origin, t_min, direction, t_max }
}

/// Returns the bits of a closest point.
fn closest_bits(found: &ClosestPoint) -> [u32; 7] {
    let ClosestPoint { position: [x, y, z], distance, u, v, primitive } = *found;
    let [x, y, z] = [x, y, z].map(f32::to_bits);
    [x, y, z, distance.to_bits(), u.to_bits(), v.to_bits(), primitive]
}

impl Caller<'_> {
    /// Returns the grid as Rust opens it.
    pub(super) fn core(&self) -> Option<Grid<'_>> {
        let opened = self.opened.as_ref()?;
        let blob = &self.memory[opened.blob].bytes()[opened.from..];
        match &opened.mesh {
            None => Grid::open_packed(blob).ok(),
            Some(mesh) => Grid::open(blob, self.core_mesh(mesh)?).ok(),
        }
    }

    fn core_mesh(&self, mesh: &hgrid_mesh) -> Option<TriangleMesh<'_>> {
        let (index_type, size) = match mesh.index_type {
            HGRID_INDEX_U16 => (IndexType::U16, 6),
            _ => (IndexType::U32, 12),
        };
        let stride = |stride, size| if stride == 0 { size } else { stride };
        let strided = |bytes, stride, count| Strided { bytes, stride, count };
        let positions =
            strided(&self.shape.positions, stride(mesh.position_stride, 12), mesh.vertex_count);
        let indices =
            strided(&self.shape.indices, stride(mesh.index_stride, size), mesh.triangle_count);
        let view = TriangleMesh::strided(positions, indices, index_type).ok()?;
        if mesh.masks.is_null() || mesh.triangle_count == 0 {
            return Some(view);
        }
        let masks = strided(&self.shape.masks, stride(mesh.mask_stride, 4), mesh.triangle_count);
        view.with_masks(masks).ok()
    }

    /// Returns some rays, at least one.
    fn rays(&self, u: &mut Unstructured<'_>) -> Result<Vec<Ray>> {
        let Some(grid) = self.core() else {
            return Ok(rays::fixed_rays(([-1.0; 3], [1.0; 3]), 1));
        };
        let mut rays = rays::fixed_rays(grid.bounds(), 1);
        rays.extend(rays::chosen(u, &grid)?);
        Ok(rays)
    }

    /// Returns the view, or now and then NULL.
    fn view(&self, u: &mut Unstructured<'_>) -> Result<*const hgrid_grid> {
        Ok(if rarely(u, 48)? { null() } else { from_ref(&self.grid) })
    }

    /// Queries one ray after the other.
    pub(super) fn ask(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        for ray in self.rays(u)? {
            let ray_for_c = for_c(&ray);
            let to_ray = if rarely(u, 48)? { null() } else { from_ref(&ray_for_c) };
            let grid = self.view(u)?;
            let core = self.core().filter(|_| !to_ray.is_null() && !grid.is_null());

            let options = Options::new(u)?;
            let mut hit = UNTOUCHED;
            let to_hit = if rarely(u, 48)? { null_mut() } else { from_mut(&mut hit) };
            let asked = core.filter(|_| !to_hit.is_null() && options.are_sound());
            let is_answered = asked.is_some_and(|grid| grid.mesh().triangle_count() > 0);
            let mut told = Told::default();
            let expected = asked.and_then(|grid| {
                options.ask(&mut told, 0, |options| grid.intersect_with(&ray, options))
            });
            // SAFETY: all pointers are NULL or valid.
            let is_hit = unsafe { hgrid_intersect(grid, to_ray, options.as_ptr(), to_hit) };
            assert_eq!(is_hit, expected.is_some(), "{ray:?}");
            let expected = expected.map_or(c_bits(&UNTOUCHED), |hit| bits(&hit));
            assert_eq!(c_bits(&hit), expected, "{ray:?}");
            assert!(options.agree(&told), "{ray:?}");

            let options = Options::new(u)?;
            let asked = core.filter(|_| options.are_sound());
            let mut told = Told::default();
            let expected = asked.is_some_and(|grid| {
                options.ask(&mut told, 0, |options| grid.occluded_with(&ray, options))
            });
            // SAFETY: all pointers are NULL or valid.
            let is_hit = unsafe { hgrid_occluded(grid, to_ray, options.as_ptr()) };
            assert_eq!(is_hit, expected, "{ray:?}");
            assert!(options.agree(&told), "{ray:?}");
            self.reached.asked += usize::from(is_answered);
        }
        Ok(())
    }

    /// Queries all hits of rays, with room for some of them.
    pub(super) fn all(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        for ray in self.rays(u)? {
            let ray_for_c = for_c(&ray);
            let to_ray = if rarely(u, 48)? { null() } else { from_ref(&ray_for_c) };
            let grid = self.view(u)?;
            let options = Options::new(u)?;
            let room = u.int_in_range(0..=40)?;
            let mut hits = vec![UNTOUCHED; room];
            let to_hits = if rarely(u, 48)? { null_mut() } else { hits.as_mut_ptr() };
            let capacity = if rarely(u, 48)? { usize::MAX / 3 } else { room };
            let mut count = 777;
            let to_count = if rarely(u, 48)? { null_mut() } else { from_mut(&mut count) };
            let is_sound = !to_ray.is_null()
                && !grid.is_null()
                && !to_count.is_null()
                && capacity == room
                && (room == 0 || !to_hits.is_null())
                && options.are_sound();
            let core = self.core().filter(|_| is_sound);

            let (mut told, mut expected) = (Told::default(), vec![Hit::MISS; room]);
            let found = core.map(|grid| {
                options
                    .ask(&mut told, 0, |options| grid.intersect_all(&ray, options, &mut expected))
            });
            // SAFETY: all pointers are NULL or valid, that to hits for `capacity` of them, or `capacity` is larger
            // than any memory, which the call refuses.
            let status = known(unsafe {
                hgrid_intersect_all(grid, to_ray, options.as_ptr(), to_hits, capacity, to_count)
            });
            assert_eq!(status == HGRID_OK, found.is_some(), "{status} {ray:?}");
            assert_eq!(count, found.unwrap_or(777), "{ray:?}");
            let known = found.unwrap_or(0).min(room);
            for (i, hit) in hits.iter().enumerate() {
                let expected = if i < known { bits(&expected[i]) } else { c_bits(&UNTOUCHED) };
                assert_eq!(c_bits(hit), expected, "{i} of {ray:?}");
            }
            assert!(options.agree(&told), "{ray:?}");
        }
        Ok(())
    }

    /// Queries closest points.
    pub(super) fn closest(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        for ray in self.rays(u)? {
            let point = ray.origin;
            let query = hgrid_point_query { point, max_distance: ray.t_max };
            let to_query = if rarely(u, 48)? { null() } else { &raw const query };
            let grid = self.view(u)?;
            let options = Options::new(u)?;
            let untouched =
                hgrid_closest { position: [7.0; 3], distance: 7.0, u: 7.0, v: 7.0, primitive: 7 };
            let mut closest = untouched;
            let to = if rarely(u, 48)? { null_mut() } else { from_mut(&mut closest) };
            let is_sound = !to_query.is_null() && !grid.is_null() && !to.is_null();
            let core = self.core().filter(|_| is_sound && options.are_sound());
            let mut told = Told::default();
            let expected = core.and_then(|grid| {
                options.ask(&mut told, 0, |options| grid.closest_point(point, ray.t_max, options))
            });
            // SAFETY: all pointers are NULL or valid.
            let is_found = unsafe { hgrid_closest_point(grid, to_query, options.as_ptr(), to) };
            assert_eq!(is_found, expected.is_some(), "{point:?} {}", ray.t_max);
            let hgrid_closest { position, distance, u, v, primitive } = closest;
            let written = ClosestPoint { position, distance, u, v, primitive };
            let before =
                ClosestPoint { position: [7.0; 3], distance: 7.0, u: 7.0, v: 7.0, primitive: 7 };
            assert_eq!(closest_bits(&written), closest_bits(&expected.unwrap_or(before)));
            assert!(options.agree(&told), "{point:?} {}", ray.t_max);
        }
        Ok(())
    }

    /// Runs a batch with arrays that lie side by side, interleave, or overlap where they may not.
    pub(super) fn batch(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let rays = self.rays(u)?;
        let any = bool::arbitrary(u)?;
        let size = if any { 1 } else { size_of::<hgrid_hit>() };
        let arrays = Arrays::new(u, rays.len(), size)?;
        let Arrays { rays_at, ray_stride, answers_at, answer_stride, bytes } = arrays;
        let mut memory = Memory::new(bytes);
        for (i, ray) in rays.iter().enumerate() {
            let start = rays_at + i * if ray_stride == 0 { 32 } else { ray_stride };
            memory.bytes_mut()[start..start + 32].copy_from_slice(ray.as_bytes());
        }
        // Where rays overlap, take the bytes in memory.
        let read = |memory: &Memory, i: usize| -> Ray {
            let start = rays_at + i * if ray_stride == 0 { 32 } else { ray_stride };
            Ray::read_from_bytes(&memory.bytes()[start..start + 32]).unwrap()
        };
        let rays: Vec<Ray> = (0..rays.len()).map(|i| read(&memory, i)).collect();
        let before = memory.bytes().to_vec();
        let options = Options::new(u)?;
        let coherence = u.int_in_range(0..=2)?;
        let grid = self.view(u)?;
        let from = if rarely(u, 48)? { null() } else { memory.at(rays_at).cast_const().cast() };
        let to = if rarely(u, 48)? { null_mut() } else { memory.at(answers_at) };
        // Now and then, a count that exceeds any memory.
        let count = if rarely(u, 48)? { usize::MAX - 1 } else { rays.len() };

        // Ask Rust, if there is a grid and the options are valid.
        let core = self.core();
        let is_right = self.opened.as_ref().is_some_and(|opened| opened.is_right);
        let mut told = Told::default();
        let mut expected = before.clone();
        let mut is_blocked = vec![false; rays.len()];
        for (i, ray) in rays.iter().enumerate() {
            let Some(core) = core.filter(|_| options.are_sound()) else { break };
            let slot = answers_at + i * if answer_stride == 0 { size } else { answer_stride };
            let Some(answer) = expected.get_mut(slot..slot + size) else { break };
            if any {
                let found = options.ask(&mut told, i, |options| core.occluded_with(ray, options));
                answer.copy_from_slice(&[u8::from(found)]);
                is_blocked[i] = found;
            } else {
                let found = options.ask(&mut told, i, |options| core.intersect_with(ray, options));
                answer.copy_from_slice(found.unwrap_or(Hit::MISS).as_bytes());
            }
        }
        // SAFETY: all pointers are NULL or valid for so many elements, or the count exceeds any memory.
        let status = known(unsafe {
            let options = options.as_ptr();
            if any {
                let to = to.cast();
                hgrid_occluded_n(
                    grid,
                    from,
                    ray_stride,
                    to,
                    answer_stride,
                    count,
                    coherence,
                    options,
                )
            } else {
                let to = to.cast();
                hgrid_intersect_n(
                    grid,
                    from,
                    ray_stride,
                    to,
                    answer_stride,
                    count,
                    coherence,
                    options,
                )
            }
        });
        if status != HGRID_OK {
            assert!(memory.bytes() == before, "written before it failed with {status}");
            assert!(options.agree(&Told::default()), "asked before it failed with {status}");
            return Ok(());
        }
        assert!(core.is_some() && options.are_sound() && coherence <= HGRID_COHERENCE_COHERENT);
        // In damaged lists, rays that are traced together may find other triangles.
        let must_agree = is_right || !options.let_rays_go_together();
        if must_agree {
            assert!(
                memory.bytes() == expected,
                "other answers than core's, or bytes around them changed"
            );
        }
        if must_agree || !options.have_filter() {
            let agrees = if any {
                options.agree_but_for_blocked_rays(&told, &is_blocked)
            } else {
                options.agree(&told)
            };
            assert!(agrees, "other filter calls or counters than core's");
        }
        self.reached.batches += usize::from(self.has_triangles());
        Ok(())
    }

    /// Checks the last grid of the program; returns true if there is one.
    pub(super) fn settle(&self) -> bool {
        let Some(grid) = self.core() else { return false };
        let rays = rays::fixed_rays(grid.bounds(), 4);
        if self.opened.as_ref().is_some_and(|opened| opened.is_right) {
            prove(&grid).expect("what was built is valid");
            agrees(&grid, &rays);
        } else {
            ends(&grid, &rays);
        }
        true
    }
}

/// The offsets and strides of the rays and the answers of a batch.
struct Arrays {
    rays_at: usize,
    ray_stride: usize,
    answers_at: usize,
    answer_stride: usize,
    /// The bytes that both take together.
    bytes: usize,
}

impl Arrays {
    fn new(u: &mut Unstructured<'_>, count: usize, size: usize) -> Result<Self> {
        let small = |u: &mut Unstructured<'_>| u.int_in_range(0..=63_usize);
        let [mut rays_at, mut answers_at] = [small(u)?, small(u)?];
        let [mut ray_stride, mut answer_stride] = [32 + small(u)?, size + small(u)?];
        match u.int_in_range(0..=7)? {
            // In one struct, the ray first or the answer first.
            0 => {
                ray_stride += size;
                (answer_stride, answers_at) = (ray_stride, rays_at + 32);
            }
            1 => {
                ray_stride += size;
                (answer_stride, rays_at) = (ray_stride, answers_at + size);
            }
            // At any distance.
            2 => {}
            // With strides that are too small, or contiguous.
            3 => (ray_stride, answer_stride) = (small(u)?, small(u)?),
            4 => (ray_stride, answer_stride) = (0, 0),
            // Apart from each other.
            _ => answers_at += rays_at + ray_stride * count + 32,
        }
        let end = |at: usize, stride: usize, size: usize| {
            at + count.saturating_sub(1) * if stride == 0 { size } else { stride } + size
        };
        let bytes = end(rays_at, ray_stride, 32).max(end(answers_at, answer_stride, size));
        Ok(Self { rays_at, ray_stride, answers_at, answer_stride, bytes })
    }
}
