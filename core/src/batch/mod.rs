//! Many rays at once: from the caller's own structs, into the caller's own structs.
//!
//! A batch answers each ray as [`Grid::intersect`] or [`Grid::occluded`] would, bit for bit. A tree
//! ([`Method::Bvh`](crate::Method::Bvh)) takes rays of any kind in groups of up to 64, as they are given or sorted
//! first. If the closest hits are asked for and the origins lie far apart, it traces the rays of a group one by one, or
//! in a large tree interleaved. The other methods trace one ray after the other.
//!
//! A filter sees all hits of one ray before those of the next, in the order of the rays. Groups keep this order:
//!
//! ```text
//! closest   the group finds the closest hit of each ray among all triangles; a miss or an opaque one is
//!           the answer
//! occluded  an opaque hit ends a ray and is the answer; else the group keeps the closest hit
//! then      in the order of the rays: ask the filter about the hit of each that is left; if it rejects
//!           the hit, go on behind it alone
//! ```

#[cfg(feature = "bvh")]
pub(crate) mod groups;

use core::fmt;

use zerocopy::{FromBytes, Immutable, IntoBytes};

use crate::error::{BatchField, Error};
use crate::grid::Grid;
use crate::mesh::Strided;
use crate::options::QueryOptions;
use crate::ray::{Hit, INVALID_ID, Ray};
use crate::simd::HAS_VECTORS;

/// The caller's hint about the rays of a batch, by which the grid chooses their order. The hint changes the speed,
/// never the answers.
#[repr(u32)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Coherence {
    /// Nothing is known about the rays: random ones, or those after several bounces. A tree may sort them by origin and
    /// direction, in windows of as many rays as [`QueryOptions::scratch`] holds, 16 bytes a ray: the larger, the sooner
    /// the answers, up to millions of rays. With less than 4 KiB it sorts windows of 256 rays on the stack. Other
    /// methods trace each ray alone.
    #[default]
    Incoherent = 0,
    /// Rays that follow one another start near each other: camera rays of a tile, shadow rays and
    /// ambient occlusion from its hits. They are traced in the order given, with a tree in groups of 64. The best
    /// order takes tile after tile of 8 x 8 pixels, and within a tile one square of 4 x 4 pixels after the other.
    Coherent = 1,
}

/// `count` elements to be written in a slice of bytes, one every `stride` bytes.
pub struct StridedMut<'a> {
    /// The bytes, from the first element's first to at least the last element's last.
    pub bytes: &'a mut [u8],
    /// Bytes from one element to the next.
    pub stride: usize,
    /// Number of elements.
    pub count: usize,
}

impl fmt::Debug for StridedMut<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StridedMut")
            .field("bytes", &self.bytes.len())
            .field("stride", &self.stride)
            .field("count", &self.count)
            .finish()
    }
}

impl<'a> StridedMut<'a> {
    /// Elements that lie side by side.
    ///
    /// ```
    /// use hgrid_core::{Hit, StridedMut};
    /// let mut hits = [Hit::MISS; 3];
    /// let hits = StridedMut::new(&mut hits);
    /// assert_eq!((hits.stride, hits.count), (16, 3));
    /// ```
    pub fn new<T: FromBytes + IntoBytes>(elements: &'a mut [T]) -> Self {
        let count = elements.len();
        Self { bytes: elements.as_mut_bytes(), stride: size_of::<T>(), count }
    }

    /// Returns true if all elements of `size` bytes lie inside `bytes` and do not overlap.
    fn holds(&self, size: usize) -> bool {
        let Some(last) = self.count.checked_sub(1) else { return true };
        let end = last.checked_mul(self.stride).and_then(|start| start.checked_add(size));
        self.stride >= size && end.is_some_and(|end| end <= self.bytes.len())
    }

    /// Writes element `index`; the bytes between the elements stay as they are.
    #[inline(always)]
    pub(crate) fn write<T: Immutable + IntoBytes>(&mut self, index: usize, value: &T) {
        let start = index.saturating_mul(self.stride);
        let slot = self.bytes.get_mut(start..).and_then(|rest| rest.get_mut(..size_of::<T>()));
        if let Some(slot) = slot {
            slot.copy_from_slice(value.as_bytes());
        }
    }
}

/// Rays that are traced together, and places for their answers, wherever they lie.
///
/// [`Grid::intersect_n`] takes arrays. This is for rays and answers in the same structs:
///
/// ```
#[doc = include_str!("../../doc/grid.txt")]
/// struct Shadow {
///     ray: Ray,
///     is_lit: bool,
/// }
/// struct Shadows<'a>(&'a mut [Shadow]);
///
/// impl Batch<bool> for Shadows<'_> {
///     fn count(&self) -> usize {
///         self.0.len()
///     }
///     fn ray(&self, place: usize) -> Ray {
///         self.0[place].ray
///     }
///     fn answer(&mut self, place: usize, is_occluded: bool) {
///         self.0[place].is_lit = !is_occluded;
///     }
/// }
///
/// let shadow = |x| Shadow { ray: Ray::new([x, 0.25, 1.0], [0.0, 0.0, -1.0]), is_lit: false };
/// let mut shadows = [0.25, 2.0].map(shadow);
/// let options = &mut QueryOptions::default();
/// grid.occluded_batch(&mut Shadows(&mut shadows), Coherence::Coherent, options);
/// assert_eq!(shadows.map(|shadow| shadow.is_lit), [false, true]);
/// # Ok::<(), Error>(())
/// ```
pub trait Batch<A, R = Ray> {
    /// Number of rays.
    fn count(&self) -> usize;

    /// Returns the ray at a place below the count: the same one each time.
    fn ray(&self, place: usize) -> R;

    /// Takes the answer to the ray at a place. There is one for each place, in any order.
    fn answer(&mut self, place: usize, answer: A);
}

/// Arrays of rays and answers.
pub(crate) struct Arrays<'r, 'a, 'b> {
    rays: &'r Strided<'a>,
    answers: &'r mut StridedMut<'b>,
}

impl<'r, 'a, 'b> Arrays<'r, 'a, 'b> {
    /// Arrays of rays `R` and of answers `A`, as many as rays.
    pub(crate) fn new<R, A: Answer>(
        rays: &'r Strided<'a>,
        answers: &'r mut StridedMut<'b>,
    ) -> Result<Self, Error> {
        if rays.cut(size_of::<R>()).is_none() {
            return Err(Error::InvalidBatch(BatchField::Rays));
        }
        if !answers.holds(size_of::<A>()) || answers.count != rays.count {
            return Err(Error::InvalidBatch(BatchField::Answers));
        }
        Ok(Self { rays, answers })
    }
}

impl<A: Answer, R: FromBytes> Batch<A, R> for Arrays<'_, '_, '_> {
    #[inline(always)]
    fn count(&self) -> usize {
        self.rays.count
    }

    #[inline(always)]
    fn ray(&self, place: usize) -> R {
        self.rays.read(place)
    }

    #[inline(always)]
    fn answer(&mut self, place: usize, answer: A) {
        self.answers.write(place, &answer);
    }
}

impl Grid<'_> {
    /// The closest hit of each ray; [`Hit::MISS`] where there is none.
    ///
    /// # Errors
    /// [`Error::InvalidBatch`] if a stride is below its element, an array ends before its last
    /// element, or there are not as many hits as rays. Nothing is written then.
    ///
    /// ```
    #[doc = include_str!("../../doc/grid.txt")]
    /// let rays = [0.25, 2.0].map(|x| Ray::new([x, 0.25, 1.0], [0.0, 0.0, -1.0]));
    /// let mut hits = [Hit::MISS; 2];
    /// grid.intersect_n(&Strided::new(&rays), &mut StridedMut::new(&mut hits), Coherence::Coherent)?;
    /// assert_eq!([hits[0].t, hits[1].t], [1.0, f32::INFINITY]);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn intersect_n(
        &self,
        rays: &Strided<'_>,
        hits: &mut StridedMut<'_>,
        coherence: Coherence,
    ) -> Result<(), Error> {
        self.intersect_n_with(rays, hits, coherence, &mut QueryOptions::default())
    }

    /// The closest hit of each ray, of those that the options let count; [`Hit::MISS`] where there
    /// is none. The options are for all rays.
    ///
    /// # Errors
    /// The same as of [`intersect_n`](Self::intersect_n).
    ///
    /// ```
    /// # use hgrid_core::*;
    /// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// # let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// # let config = Config::new(Method::Bvh);
    /// # let sizes = sizes(&mesh, &config, &mut [])?;
    /// # let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
    /// # let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
    /// # let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
    /// # let grid = Grid::build(mesh, &config, index, scratch)?;
    /// let along = [0.0, 0.0, -1.0];
    /// let rays: Vec<_> = (0..1000).map(|i| Ray::new([i as f32 * 1e-3, 0.25, 1.0], along)).collect();
    /// let mut hits = vec![Hit::MISS; rays.len()];
    /// let mut scratch = vec![0; 16 * rays.len()];
    /// let mut options =
    ///     QueryOptions { cull: Cull::Back, scratch: &mut scratch, ..QueryOptions::default() };
    /// let (rays, hits) = (Strided::new(&rays), &mut StridedMut::new(&mut hits));
    /// grid.intersect_n_with(&rays, hits, Coherence::Incoherent, &mut options)?;
    /// # Ok::<(), Error>(())
    /// ```
    pub fn intersect_n_with(
        &self,
        rays: &Strided<'_>,
        hits: &mut StridedMut<'_>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
    ) -> Result<(), Error> {
        let mut arrays = Arrays::new::<Ray, Hit>(rays, hits)?;
        self.intersect_batch(&mut arrays, coherence, options);
        Ok(())
    }

    /// The closest hit of each ray: [`intersect_n_with`](Self::intersect_n_with), wherever rays and hits lie.
    ///
    /// ```
    #[doc = include_str!("../../doc/grid.txt")]
    /// struct Pixels<'a>(&'a mut [(Ray, f32)]);
    ///
    /// impl Batch<Hit> for Pixels<'_> {
    ///     fn count(&self) -> usize {
    ///         self.0.len()
    ///     }
    ///     fn ray(&self, place: usize) -> Ray {
    ///         self.0[place].0
    ///     }
    ///     fn answer(&mut self, place: usize, hit: Hit) {
    ///         self.0[place].1 = hit.t;
    ///     }
    /// }
    ///
    /// let mut pixels = [0.25, 2.0].map(|x| (Ray::new([x, 0.25, 1.0], [0.0, 0.0, -1.0]), 0.0));
    /// let options = &mut QueryOptions::default();
    /// grid.intersect_batch(&mut Pixels(&mut pixels), Coherence::Coherent, options);
    /// assert_eq!(pixels.map(|(_, depth)| depth), [1.0, f32::INFINITY]);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn intersect_batch(
        &self,
        batch: &mut impl Batch<Hit>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
    ) {
        trace(self, batch, coherence, options);
    }

    /// For each ray a byte: 1 if anything is hit, 0 if not.
    ///
    /// # Errors
    /// The same as of [`intersect_n`](Self::intersect_n).
    ///
    /// ```
    #[doc = include_str!("../../doc/grid.txt")]
    /// let rays = [0.25, 2.0].map(|x| Ray::new([x, 0.25, 1.0], [0.0, 0.0, -1.0]));
    /// let mut occluded = [0_u8; 2];
    /// let answers = &mut StridedMut::new(&mut occluded);
    /// grid.occluded_n(&Strided::new(&rays), answers, Coherence::Incoherent)?;
    /// assert_eq!(occluded, [1, 0]);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn occluded_n(
        &self,
        rays: &Strided<'_>,
        occluded: &mut StridedMut<'_>,
        coherence: Coherence,
    ) -> Result<(), Error> {
        self.occluded_n_with(rays, occluded, coherence, &mut QueryOptions::default())
    }

    /// For each ray a byte: 1 if anything is hit that the options let count, 0 if not. The options are for all rays.
    ///
    /// # Errors
    /// The same as of [`intersect_n`](Self::intersect_n).
    ///
    /// ```
    #[doc = include_str!("../../doc/grid.txt")]
    /// let rays = [0.25, 2.0].map(|x| Ray::new([x, 0.25, 1.0], [0.0, 0.0, -1.0]));
    /// let mut occluded = [1_u8; 2];
    /// // Light comes through from the back.
    /// let mut options = QueryOptions { cull: Cull::Front, ..QueryOptions::default() };
    /// let answers = &mut StridedMut::new(&mut occluded);
    /// grid.occluded_n_with(&Strided::new(&rays), answers, Coherence::Coherent, &mut options)?;
    /// assert_eq!(occluded, [0, 0]);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn occluded_n_with(
        &self,
        rays: &Strided<'_>,
        occluded: &mut StridedMut<'_>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
    ) -> Result<(), Error> {
        let mut arrays = Arrays::new::<Ray, bool>(rays, occluded)?;
        self.occluded_batch(&mut arrays, coherence, options);
        Ok(())
    }

    /// Tells for each ray whether it hits anything: [`occluded_n_with`](Self::occluded_n_with) for rays and
    /// answers of any layout.
    pub fn occluded_batch(
        &self,
        batch: &mut impl Batch<bool>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
    ) {
        trace(self, batch, coherence, options);
    }

    /// For each ray a `u32`: a triangle that blocks it, of those that the options let count, as
    /// [`occluder`](Self::occluder) says; [`INVALID_ID`] if nothing does. The options are for all rays.
    ///
    /// # Errors
    /// The same as of [`intersect_n`](Self::intersect_n).
    pub fn occluder_n_with(
        &self,
        rays: &Strided<'_>,
        occluders: &mut StridedMut<'_>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
    ) -> Result<(), Error> {
        let mut arrays = Arrays::new::<Ray, u32>(rays, occluders)?;
        self.occluder_batch(&mut arrays, coherence, options);
        Ok(())
    }

    /// A triangle that blocks each ray: [`occluder_n_with`](Self::occluder_n_with), wherever rays and answers lie.
    pub fn occluder_batch(
        &self,
        batch: &mut impl Batch<u32>,
        coherence: Coherence,
        options: &mut QueryOptions<'_>,
    ) {
        trace(self, batch, coherence, options);
    }
}

/// The answer to one ray of a batch: a hit, a flag, or the id of a triangle.
pub(crate) trait Answer: Immutable + IntoBytes {
    /// True if any hit is an answer, false if it must be the closest.
    const IS_ANY: bool;
}

/// An answer that a hit gives.
pub(crate) trait HitAnswer: Answer {
    /// Makes the answer from a hit or [`Hit::MISS`].
    fn of(hit: &Hit) -> Self;
}

impl Answer for Hit {
    const IS_ANY: bool = false;
}

impl HitAnswer for Hit {
    #[inline(always)]
    fn of(hit: &Hit) -> Self {
        *hit
    }
}

impl Answer for bool {
    const IS_ANY: bool = true;
}

impl HitAnswer for bool {
    #[inline(always)]
    fn of(hit: &Hit) -> Self {
        hit.primitive != INVALID_ID
    }
}

impl Answer for u32 {
    const IS_ANY: bool = true;
}

impl HitAnswer for u32 {
    #[inline(always)]
    fn of(hit: &Hit) -> Self {
        hit.primitive
    }
}

/// Answers all rays of a batch: a tree's in groups, others one by one.
#[inline(always)]
fn trace<A: HitAnswer>(
    grid: &Grid<'_>,
    batch: &mut impl Batch<A>,
    coherence: Coherence,
    options: &mut QueryOptions<'_>,
) {
    #[cfg(feature = "bvh")]
    if HAS_VECTORS
        && !options.are_for_single_rays()
        && let Some(tree) = grid.tree()
    {
        return groups::trace(grid, tree, batch, coherence, options);
    }
    for place in 0..batch.count() {
        alone(grid, batch, place, options);
    }
}

/// Answers one ray.
#[inline(never)]
fn alone<A: HitAnswer>(
    grid: &Grid<'_>,
    batch: &mut impl Batch<A>,
    place: usize,
    options: &mut QueryOptions<'_>,
) {
    let ray = batch.ray(place);
    let hit = if A::IS_ANY {
        grid.occluder_at(place, &ray, options)
    } else {
        grid.intersect_at((place, &ray), ray.t_max, options)
    };
    batch.answer(place, A::of(&hit.unwrap_or(Hit::MISS)));
}
