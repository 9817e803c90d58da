//! A tree over boxes: the caller's own shapes, of whatever kind, known to the tree by their boxes alone.
//!
//! ```text
//! build       boxes -> the tree of `bvh`, as if each box were a triangle
//! intersect   walk the tree; a leaf: offer each shape whose box the ray meets, the nearest first
//!             the caller's test answers where the ray hits the shape; the ray ends there
//! ```
//!
//! The boxes stay in the caller's memory, as the triangles of a mesh do. Building, sizes, proof, refit and
//! the format are those of a tree of triangles; the header tells them apart ([`Content`]).

mod batch;
#[cfg(feature = "bvh")]
pub(crate) mod groups;

use core::fmt;

use crate::arena::Sizes;
use crate::batch::{Batch, HitAnswer};
use crate::config::Config;
use crate::control::Control;
use crate::counters::Counters;
use crate::error::Error;
use crate::grid::Grid;
use crate::mesh::{Strided, TriangleMesh};
use crate::method::Content;
use crate::options::{QueryOptions, Selection};
use crate::ray::{Hit, Ray};
use crate::refit::{Refit, refit};
use crate::search::{self, Outcome};
use crate::sizes::sizes_with;

/// A view of the boxes of the caller's shapes: six floats each, two opposite corners.
///
/// A box should hold all of its shape. Its corners may come in any order on each axis; a box with a number that is not
/// finite, or above [`MAX_COORDINATE`](crate::MAX_COORDINATE), leaves its shape out, as the triangle of a mesh.
#[derive(Debug, Clone, Copy)]
pub struct Boxes<'a>(TriangleMesh<'a>);

impl<'a> Boxes<'a> {
    /// Boxes in a tight array: least x, y, z, then greatest x, y, z.
    ///
    /// # Errors
    /// [`Error::TooManyTriangles`] for more shapes than ids.
    pub fn new(boxes: &'a [[f32; 6]]) -> Result<Self, Error> {
        Self::strided(Strided::new(boxes))
    }

    /// Boxes inside the caller's own structs, at any byte stride.
    ///
    /// # Errors
    /// [`Error::InvalidMesh`] of the positions if the stride is below 24 or the bytes end before the last box;
    /// [`Error::TooManyTriangles`].
    ///
    /// ```
    /// use hgrid_core::{Boxes, Error, Strided};
    /// // A sphere behind its box.
    /// let spheres: [[f32; 10]; 1] = [[-1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]];
    /// assert_eq!(Boxes::strided(Strided::new(&spheres))?.count(), 1);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn strided(boxes: Strided<'a>) -> Result<Self, Error> {
        Ok(Self(TriangleMesh::of_boxes(boxes, Content::Shapes)?))
    }

    /// The same boxes with a mask for each shape, as [`TriangleMesh::with_masks`](crate::TriangleMesh::with_masks).
    ///
    /// # Errors
    /// [`Error::InvalidMesh`] of the masks.
    pub fn with_masks(self, masks: Strided<'a>) -> Result<Self, Error> {
        Ok(Self(self.0.with_masks(masks)?))
    }

    /// Number of boxes.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.0.triangle_count()
    }

    /// The corners of the boxes, where the caller keeps them.
    #[must_use]
    pub const fn corners(&self) -> Strided<'a> {
        self.0.positions()
    }

    /// The masks, where the caller keeps them; none if the boxes have no masks.
    #[must_use]
    pub const fn masks(&self) -> Strided<'a> {
        self.0.masks()
    }
}

/// The hit of a ray on a shape, as the caller's test says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeHit {
    /// Distance in multiples of the ray's direction.
    pub t: f32,
    /// The caller's own, handed on in the hit.
    pub u: f32,
    /// The caller's own, handed on in the hit.
    pub v: f32,
}

/// Tests a shape. The test receives the number of a shape and the ray; `t_max` is that of the closest hit so far. It
/// returns the hit, if any.
///
/// An answer outside the range, infinite or NaN is no hit. The test may be asked about a shape that the ray does not
/// meet; it is asked about each shape at most once for a ray, roughly front to back. It may query this tree
/// and others. In a batch, calls for different rays alternate.
///
/// All queries find the same hits if every hit lies inside the box of its shape, rounding included, and if the answer
/// depends on the range in no other way.
pub type ShapeTest<'q> = dyn FnMut(u32, &Ray) -> Option<ShapeHit> + 'q;

/// A tree over the boxes of the caller's shapes, ready for queries.
///
/// ```
/// use hgrid_core::{Block, Boxes, Config, Ray, ShapeHit, Shapes};
/// // Spheres of radius 1.
/// let centers = [[0.0_f32, 0.0, 0.0], [5.0, 0.0, 0.0]];
/// let boxes = centers.map(|[x, y, z]| [x - 1.0, y - 1.0, z - 1.0, x + 1.0, y + 1.0, z + 1.0]);
/// let boxes = Boxes::new(&boxes)?;
/// let config = Config::default();
///
/// let sizes = Shapes::sizes(&boxes, &config, &mut [])?;
/// let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
/// let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
/// let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
/// let shapes = Shapes::build(boxes, &config, index, scratch)?;
///
/// // A ray along z: the front of the sphere.
/// let mut sphere = |id: u32, ray: &Ray| {
///     let [x, y, z] = centers[id as usize];
///     let [ox, oy] = [ray.origin[0] - x, ray.origin[1] - y];
///     let inside = 1.0 - ox * ox - oy * oy;
///     let t = (z - inside.max(0.0).sqrt() - ray.origin[2]) / ray.direction[2];
///     (inside >= 0.0).then_some(ShapeHit { t, u: 0.0, v: 0.0 })
/// };
/// let hit = shapes.intersect(&Ray::new([5.0, 0.0, -9.0], [0.0, 0.0, 1.0]), &mut sphere);
/// assert_eq!(hit.map(|hit| (hit.t, hit.primitive)), Some((8.0, 1)));
/// # Ok::<(), hgrid_core::Error>(())
/// ```
#[derive(Clone, Copy)]
pub struct Shapes<'a> {
    grid: Grid<'a>,
}

impl fmt::Debug for Shapes<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shapes")
            .field("count", &self.count())
            .field("blob_bytes", &self.grid.blob_bytes())
            .finish_non_exhaustive()
    }
}

impl<'a> Shapes<'a> {
    /// The memory that a build over these boxes takes on one thread: [`sizes`](crate::sizes()) for shapes. Builds with
    /// tasks take more scratch, which [`Sizes::bound_parallel`] counts.
    ///
    /// # Errors
    /// The errors of [`sizes`](crate::sizes()); [`Error::InvalidConfig`] if the method is not
    /// [`Method::Bvh`](crate::Method::Bvh), here and in all builds.
    pub fn sizes(boxes: &Boxes<'_>, config: &Config, scratch: &mut [u8]) -> Result<Sizes, Error> {
        config.check_tree()?;
        sizes_with(&boxes.0, config, scratch, &Control::SERIAL)
    }

    /// Builds a tree in memory that the caller brings: [`Grid::build`] for shapes.
    /// [`Sizes::bound`] says what is enough for so many shapes.
    ///
    /// # Errors
    /// The errors of [`Grid::build`], with the number of a shape in place of that of a triangle.
    pub fn build(
        boxes: Boxes<'a>,
        config: &Config,
        index: &'a mut [u8],
        scratch: &mut [u8],
    ) -> Result<Self, Error> {
        Self::build_with(boxes, config, index, scratch, &Control::SERIAL)
    }

    /// Builds a tree on the caller's threads: [`Grid::build_with`] for shapes. With the scratch of one task, from
    /// [`sizes`](Self::sizes), the build runs on one thread; [`Sizes::bound_parallel`] is enough for all tasks.
    ///
    /// # Errors
    /// The errors of [`Grid::build_with`].
    pub fn build_with(
        boxes: Boxes<'a>,
        config: &Config,
        index: &'a mut [u8],
        scratch: &mut [u8],
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        config.check_tree()?;
        Ok(Self { grid: Grid::build_with(boxes.0, config, index, scratch, control)? })
    }

    /// Opens a tree that was built earlier or elsewhere, in O(1), on the same boxes: [`Grid::open`] for shapes.
    ///
    /// # Errors
    /// The errors of [`Grid::open`].
    pub fn open(blob: &'a [u8], boxes: Boxes<'a>) -> Result<Self, Error> {
        Ok(Self { grid: Grid::open(blob, boxes.0)? })
    }

    /// Proves that the blob is a tree of its boxes: [`Grid::validate`] for shapes.
    ///
    /// # Errors
    /// The errors of [`Grid::validate`].
    pub fn validate(&self, scratch: &mut [u8]) -> Result<(), Error> {
        self.grid.validate(scratch)
    }

    /// Bytes of scratch that [`validate`](Self::validate) takes.
    #[must_use]
    pub const fn validate_bytes(&self) -> usize {
        self.grid.validate_bytes()
    }

    /// Gives a built tree the boxes of shapes that moved: [`refit`](crate::refit()) for shapes.
    ///
    /// # Errors
    /// The errors of [`refit`](crate::refit()).
    pub fn refit(index: &mut [u8], boxes: &Boxes<'_>) -> Result<Refit, Error> {
        refit(index, &boxes.0)
    }

    /// The boxes that the tree was built or opened with.
    #[must_use]
    pub const fn boxes(&self) -> Boxes<'a> {
        Boxes(*self.grid.mesh())
    }

    /// Number of shapes, those included that were left out.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.grid.mesh().triangle_count()
    }

    /// Shapes left out because their box is not finite.
    #[must_use]
    pub fn skipped_count(&self) -> u32 {
        self.grid.skipped_count()
    }

    /// The tree as bytes: what to copy, store or send in order to [`open`](Self::open) it again.
    #[must_use]
    pub const fn blob(&self) -> &'a [u8] {
        self.grid.blob()
    }

    /// The least and the greatest corner of the box of all shapes, and a little more.
    #[must_use]
    pub const fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        self.grid.bounds()
    }

    /// The tree, as a grid.
    pub(crate) const fn grid(&self) -> &Grid<'a> {
        &self.grid
    }

    /// The closest hit of a ray; where several shapes are hit at the same `t`, the one with the lowest number.
    pub fn intersect(&self, ray: &Ray, test: &mut ShapeTest<'_>) -> Option<Hit> {
        self.intersect_with(ray, &mut QueryOptions::default(), test)
    }

    /// Returns true if any shape is hit.
    ///
    /// ```
    #[doc = include_str!("../../doc/shapes.txt")]
    /// // The middle of each box is in the way, whatever its shape.
    /// let mut middle = |_, _: &Ray| Some(ShapeHit { t: 2.0, u: 0.0, v: 0.0 });
    /// let ray = Ray::new([0.0, 0.0, 2.0], [0.0, 0.0, -1.0]);
    /// assert!(shapes.occluded(&ray, &mut middle));
    /// assert!(!shapes.occluded(&Ray { t_max: 1.5, ..ray }, &mut middle));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn occluded(&self, ray: &Ray, test: &mut ShapeTest<'_>) -> bool {
        self.occluded_with(ray, &mut QueryOptions::default(), test)
    }

    /// [`intersect`](Self::intersect) with options: `mask` and `skip` are looked up before a shape is tested. `cull`
    /// and `filter` are ignored: the test decides.
    pub fn intersect_with(
        &self,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
        test: &mut ShapeTest<'_>,
    ) -> Option<Hit> {
        self.search(ray, options, test, false)
    }

    /// [`occluded`](Self::occluded) with options.
    pub fn occluded_with(
        &self,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
        test: &mut ShapeTest<'_>,
    ) -> bool {
        self.search(ray, options, test, true).is_some()
    }

    /// Answers one ray of a batch. Out of line, so that a program has its code once.
    #[inline(never)]
    fn answer<A: HitAnswer>(
        &self,
        batch: &mut impl Batch<A>,
        place: usize,
        options: &mut QueryOptions<'_>,
        test: &mut ShapeTest<'_>,
    ) {
        let hit = self.search(&batch.ray(place), options, test, A::IS_ANY);
        batch.answer(place, A::of(&hit.unwrap_or(Hit::MISS)));
    }

    fn search(
        &self,
        ray: &Ray,
        options: &mut QueryOptions<'_>,
        test: &mut ShapeTest<'_>,
        is_any: bool,
    ) -> Option<Hit> {
        let selection = Selection::new(self.grid.mesh(), options);
        let mut offered =
            ShapeSearch { selection: &selection, ray: *ray, best: None, test, is_any };
        let mut work = Counters::default();
        let mut offer = search::BoxSearch(&mut |id| offered.offer(id));
        self.grid.search_boxes(&ray.into(), &mut offer, &mut work);
        let best = offered.best;
        options.count(&work);
        best
    }
}

/// The search over the shapes whose boxes a ray meets.
struct ShapeSearch<'q, 't> {
    selection: &'q Selection<'q>,
    /// The ray up to the closest hit so far.
    ray: Ray,
    best: Option<Hit>,
    test: &'q mut ShapeTest<'t>,
    is_any: bool,
}

impl ShapeSearch<'_, '_> {
    /// Tests a shape whose box the ray meets.
    fn offer(&mut self, id: u32) -> Outcome {
        if !self.selection.has(id) {
            return Outcome::Unchanged;
        }
        let Some(hit) = hit_of(id, &self.ray, self.test) else { return Outcome::Unchanged };
        if self.best.is_some_and(|best| !hit.is_closer(&best)) {
            return Outcome::Unchanged;
        }
        self.best = Some(hit);
        self.ray.t_max = hit.t;
        if self.is_any { Outcome::Done } else { Outcome::EndsAt(hit.t) }
    }
}

/// Tests a shape; returns a hit that lies in the range of the ray.
fn hit_of(id: u32, ray: &Ray, test: &mut ShapeTest<'_>) -> Option<Hit> {
    let ShapeHit { t, u, v } = test(id, ray)?;
    let is_in_range = ray.t_min <= t && t <= ray.t_max && t.is_finite();
    is_in_range.then_some(Hit { t, u, v, primitive: id })
}
