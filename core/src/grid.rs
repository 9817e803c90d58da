//! [`Grid`], the view that queries run on: a blob bound to its mesh. Trees are grids here, too: every method
//! has this one type.

use core::fmt;

use glam::Vec3A;

use crate::aabb::Aabb;
use crate::approach::{Approach, LineF64};
use crate::arena::check_alignment;
use crate::blob::{Header, corrupt};
use crate::budget::Budget;
use crate::cell::Lattice;
use crate::config::Config;
use crate::control::{Control, Watch};
use crate::counters::{Counters, Tally};
use crate::dda::Line;
use crate::error::{Error, Region};
use crate::mesh::TriangleMesh;
use crate::method::Method;
use crate::options::{Cull, QueryOptions};
use crate::ray::{Hit, INVALID_ID, Ray, RayF64};
use crate::search::{BoxSearch, One, Outcome, Search, TriangleSearch, test_all};
use crate::simd::{IS_SMALL, SimdLevel};
use crate::structure::{self, Structure, by_kind};
use crate::triangle::TriangleTest;
use crate::visit::Visitor;

/// A built grid and the mesh it was built for, ready for queries.
///
/// The view is small and can be copied; it borrows the blob and the mesh, owns nothing, and any
/// number of threads may query it at once. Queries never fail, never allocate and never panic;
/// their steps are bounded (docs/bounds.md). A single query's stack is below 9 KiB, a batch's below 40 KiB.
#[derive(Clone, Copy)]
pub struct Grid<'a> {
    mesh: TriangleMesh<'a>,
    blob: &'a [u8],
    lattice: Lattice,
    structure: Structure<'a>,
    simd: SimdLevel,
}

impl<'a> Grid<'a> {
    /// Builds a grid in memory that the caller brings.
    ///
    /// `index` keeps the grid, `scratch` is free again when the build returns; both start at a multiple of
    /// [`ALIGNMENT`](crate::ALIGNMENT) and may hold anything. [`sizes`](crate::sizes()) tells how large they must be;
    /// more is not used. The same mesh and configuration give the same bits, on every machine of the same byte order.
    /// The stack of a build is below 18 KiB, with more than one task ([`Control`]) below 96 KiB, that of a task below
    /// 13 KiB, beside what the caller's own functions take.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] names the region and its need, [`Error::Misaligned`] the region;
    /// [`Error::IndexOutOfRange`] and, with [`STRICT`](crate::BuildFlags::STRICT), [`Error::NonFiniteTriangle`] the
    /// triangle; [`Error::InvalidConfig`] the field, [`Error::MethodLeftOut`] the method. A mesh that is too large is
    /// answered with [`Error::TooManyTriangles`]. After an error the index
    /// region is unchanged, except with trees, variable and recursive grids, which write to it while they build: then
    /// it holds nothing of use. Both regions can be used again.
    ///
    /// ```
    /// use hgrid_core::{Block, Config, Grid, Ray, TriangleMesh, sizes};
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// let config = Config::default();
    ///
    /// let sizes = sizes(&mesh, &config, &mut [])?;
    /// let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
    /// let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
    /// let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
    /// let grid = Grid::build(mesh, &config, index, scratch)?;
    ///
    /// let hit = grid.intersect(&Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0])).unwrap();
    /// assert_eq!((hit.t, hit.u, hit.v, hit.primitive), (1.0, 0.25, 0.25, 0));
    /// # Ok::<(), hgrid_core::Error>(())
    /// ```
    pub fn build(
        mesh: TriangleMesh<'a>,
        config: &Config,
        index: &'a mut [u8],
        scratch: &mut [u8],
    ) -> Result<Self, Error> {
        Self::build_with(mesh, config, index, scratch, &Control::SERIAL)
    }

    /// Builds a grid on the caller's threads. It is the same grid as that of [`build`](Self::build), bit for bit.
    ///
    /// Only [`Method::Bvh`] is cut into tasks; the other methods build on the thread that calls.
    /// [`sizes_with`](crate::sizes_with) and [`Sizes::bound_parallel`](crate::Sizes::bound_parallel) tell how much
    /// memory so many tasks take; where there is less, but enough for fewer, there are fewer.
    ///
    /// # Errors
    /// The errors of [`build`](Self::build), [`Error::InvalidParallelFor`] if a task was run twice or not at all, and
    /// [`Error::Cancelled`] if the progress callback returned false; after these two the index holds nothing of use.
    ///
    /// ```
    /// use hgrid_core::{Block, Config, Control, Error, Grid, TriangleMesh, sizes};
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// let config = Config::default();
    /// let sizes = sizes(&mesh, &config, &mut [])?;
    /// let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
    /// let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
    /// let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
    ///
    /// // The grid is no longer needed: cancel the build.
    /// let progress = |_| false;
    /// let control = Control { progress: Some(&progress), ..Control::default() };
    /// let built = Grid::build_with(mesh, &config, index, scratch, &control);
    /// assert_eq!(built.err(), Some(Error::Cancelled));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn build_with(
        mesh: TriangleMesh<'a>,
        config: &Config,
        index: &'a mut [u8],
        scratch: &mut [u8],
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        config.check()?;
        check_alignment(index, Region::Index)?;
        check_alignment(scratch, Region::Scratch)?;
        let watch = Watch::new(control);
        watch.at(0.0)?;
        let blob = structure::build(&mesh, config, index, scratch, control, &watch)?;
        let grid = Self::open(blob, mesh)?;
        watch.end();
        Ok(grid)
    }

    /// Opens a grid that was built earlier or elsewhere, in O(1); bytes behind the grid are ignored.
    ///
    /// The mesh must be the one it was built for. O(1) cannot find all damage: on damaged bytes queries may answer
    /// wrongly, but they stay inside the blob and end. Use [`validate`](Self::validate) to be sure.
    ///
    /// # Errors
    /// [`Error::Misaligned`], [`Error::NotAGrid`], [`Error::WrongByteOrder`], [`Error::UnsupportedVersion`],
    /// [`Error::Truncated`], [`Error::MeshMismatch`], [`Error::OtherContent`], [`Error::Corrupt`],
    /// [`Error::MethodLeftOut`] and [`Error::MethodRemoved`].
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// # let mesh = *grid.mesh();
    /// // The bytes of a build, say from a file, in memory at a multiple of 64.
    /// let mut memory = vec![Block::ZERO; Block::count_for(grid.blob_bytes())];
    /// Block::bytes_mut(&mut memory)[..grid.blob_bytes()].copy_from_slice(grid.blob());
    ///
    /// let grid = Grid::open(Block::bytes(&memory), mesh)?;
    /// assert!(grid.occluded(&Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0])));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn open(blob: &'a [u8], mesh: TriangleMesh<'a>) -> Result<Self, Error> {
        let header = Header::read(blob, &mesh)?;
        header.has_mesh()?;
        let lattice = header.lattice()?;
        let bytes = usize::try_from(header.blob_bytes).ok().and_then(|bytes| blob.get(..bytes));
        let blob = bytes.ok_or(corrupt(core::mem::offset_of!(Header, blob_bytes)))?;
        let method = Method::from_u32(header.method)
            .ok_or(corrupt(core::mem::offset_of!(Header, method)))?;
        let structure = Structure::open(method, &header, &lattice, blob)?;
        Ok(Self { mesh, blob, lattice, structure, simd: SimdLevel::detect() })
    }

    /// Proves that the blob is a grid of the mesh, and so that every answer is right.
    ///
    /// O(cells + triangles + references) time; on damaged bytes, a grid of another method than [`Method::Bvh`] may take
    /// longer (docs/bounds.md). `scratch` is a bit for each triangle of a grid of [`Method::Bvh`]
    /// ([`validate_bytes`](Self::validate_bytes)), nothing for the other methods; it need not be aligned. A grid that
    /// was just built needs no proof; one that came from a file, a network or another process may.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] if there is less scratch; [`Error::Corrupt`] with the position of a byte that no build
    /// writes; [`Error::IndexOutOfRange`] if the mesh itself is damaged.
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// let mut scratch = vec![0; grid.validate_bytes()];
    /// grid.validate(&mut scratch)?;
    /// # Ok::<(), Error>(())
    /// ```
    pub fn validate(&self, scratch: &mut [u8]) -> Result<(), Error> {
        let header = Header::read(self.blob, &self.mesh)?;
        if !header.unused_is_zero(self.method()) {
            return Err(corrupt(core::mem::offset_of!(Header, macrocell_factor)));
        }
        self.check_parts()?;
        self.structure.validate(&header, &self.lattice, self.blob, &self.mesh, scratch)
    }

    /// Bytes of scratch that [`validate`](Self::validate) takes: of a tree a bit for each triangle, rounded up to four
    /// bytes; of other methods 0.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "an eighth of what 32 bits count")]
    pub const fn validate_bytes(&self) -> usize {
        let triangles = self.mesh.triangle_count();
        by_kind!(self.structure, _ => crate::bvh::proof_bytes(triangles) as usize, 0)
    }

    /// The closest hit of a ray. Where several triangles are hit at the same `t`, the one with the
    /// lowest id. [`intersect_with`](Self::intersect_with) takes options.
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// let hit = grid.intersect(&Ray::new([0.25, 0.5, 1.0], [0.0, 0.0, -1.0]));
    /// assert_eq!(hit.map(|hit| (hit.t, hit.u, hit.v, hit.primitive)), Some((1.0, 0.25, 0.5, 0)));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        // Save flash: use the traversal for queries with options, so that the program has only that one.
        if IS_SMALL {
            return self.intersect_with(ray, &mut QueryOptions::default());
        }
        self.closest_hit(ray, ray.t_max)
    }

    /// The closest hit of a ray, if its `t` is no more than `until`: `t_max`, or the `t` of a hit in another instance.
    #[inline(never)]
    pub(crate) fn closest_hit(&self, ray: &Ray, until: f32) -> Option<Hit> {
        self.one(ray, until, false)
    }

    /// Returns true if [`intersect`](Self::intersect) would find a hit. It stops at the first hit, so it is faster.
    ///
    /// ```
    #[doc = include_str!("../doc/grid.txt")]
    /// // Is the light at (0.25, 0.25, 1) seen from there?
    /// let to_light = Ray { t_max: 1.0, ..Ray::new([0.25, 0.25, -1.0], [0.0, 0.0, 2.0]) };
    /// assert!(grid.occluded(&to_light));
    /// # Ok::<(), Error>(())
    /// ```
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if IS_SMALL {
            return self.occluded_with(ray, &mut QueryOptions::default());
        }
        self.any(ray).is_some()
    }

    /// Any hit of a ray.
    pub(crate) fn any(&self, ray: &Ray) -> Option<Hit> {
        self.one(ray, ray.t_max, true)
    }

    /// The closest hit of a ray up to a `t`, or any.
    #[inline(always)]
    fn one(&self, ray: &Ray, until: f32, is_any: bool) -> Option<Hit> {
        let mut one = One { hit: Hit { t: until, ..Hit::MISS }, is_any };
        let interval = [ray.t_min, until];
        by_kind!(
            &self.structure,
            tree => tree.search(&self.scope(), ray, interval, Cull::None, &mut one, &mut ()),
            {
                // Save 10 KB: use the traversal of cells for queries with options, so that there is only that one.
                let mut show = TriangleSearch(&mut |hit| one.show(hit));
                self.search_cells(ray, interval, Cull::None, &mut show, &mut Counters::default());
            }
        );
        (one.hit.primitive != INVALID_ID).then_some(one.hit)
    }

    /// Traverses the structure along a ray and passes the hits to a search: all whose `t` lies in an interval of its
    /// range, and perhaps others. The ray's own range decides what it hits.
    #[inline(always)]
    pub(crate) fn search<F: Search, T: Tally>(
        &self,
        ray: &Ray,
        interval: [f32; 2],
        cull: Cull,
        search: &mut F,
        tally: &mut T,
    ) {
        by_kind!(
            &self.structure,
            tree => tree.search(&self.scope(), ray, interval, cull, search, tally),
            self.search_cells(ray, interval, cull, search, tally)
        );
    }

    /// [`search`](Self::search) in a grid of cells.
    #[inline(always)]
    fn search_cells<F: Search, T: Tally>(
        &self,
        ray: &Ray,
        [t_min, t_max]: [f32; 2],
        cull: Cull,
        search: &mut F,
        tally: &mut T,
    ) {
        let Some(approach) = Approach::new(ray, &self.lattice.bounds()) else { return };
        let test = TriangleTest::from(ray, &approach).culling(cull);
        if approach.is_remote {
            return test_all(&self.mesh, &test, search, tally);
        }
        // The test keeps the ray's own range, so that a hit does not depend on the interval that is walked.
        let shortened = Ray { t_min, t_max, ..*ray };
        let Some(line) = Line::new(&self.lattice, &shortened, &approach) else { return };
        self.traverse(&line, &test, search, tally);
    }

    /// Traverses one of the four grids along a ray, and tests the triangles of each cell one by one.
    ///
    /// Out of line: otherwise traversals of a tree would take its stack, too.
    #[inline(never)]
    fn traverse<F: Search, T: Tally>(
        &self,
        line: &Line,
        test: &TriangleTest,
        search: &mut F,
        tally: &mut T,
    ) {
        let mut limit = line.end;
        // A ray meets every list at most once.
        let mut budget = Budget::new(self.structure.list_words());
        let may_drop = test.filter.may_drop();
        let leaf = |references: &[u32], tally: &mut T| {
            if !budget.take(references.len()) {
                return f32::NEG_INFINITY;
            }
            for &id in references {
                tally.primitive_test();
                let Some(triangle) = self.mesh.triangle(id) else { continue };
                if may_drop && !test.passes(&triangle) {
                    continue;
                }
                match search.decide(test, &self.mesh, id) {
                    Outcome::Unchanged => {}
                    Outcome::EndsAt(t) => limit = line.distance(t),
                    Outcome::Done => return f32::NEG_INFINITY,
                }
            }
            limit
        };
        self.structure.traverse(line, tally, leaf);
    }

    /// Shows the lists of all cells that a box meets, and perhaps some others.
    pub(crate) fn visit(&self, bounds: &Aabb, leaf: &mut dyn FnMut(&[u32])) {
        // Points outside belong to the cells at the border.
        let reach = self.lattice.reach(bounds);
        let visitor = &mut Visitor::new(self.structure.list_words(), leaf);
        self.structure.visit(&reach, visitor);
    }

    /// Returns what a traversal needs besides the tree.
    #[cfg(feature = "bvh")]
    #[inline(always)]
    pub(crate) fn scope(&self) -> crate::bvh::Scope<'_> {
        crate::bvh::Scope { mesh: &self.mesh, bounds: self.lattice.bounds(), simd: self.simd }
    }

    /// The tree, if it is one.
    #[cfg(feature = "bvh")]
    #[allow(clippy::unnecessary_wraps, reason = "in a build with other methods it may be none")]
    pub(crate) const fn tree(&self) -> Option<&crate::bvh::Bvh<'a>> {
        by_kind!(&self.structure, tree => Some(tree), None)
    }

    /// Walks a ray whose origin is given in f64 through a tree of boxes, and offers a search those that it meets.
    pub(crate) fn search_boxes(
        &self,
        ray: &RayF64,
        search: &mut BoxSearch<'_>,
        counters: &mut Counters,
    ) {
        by_kind!(&self.structure, tree => tree.search_boxes(&self.scope(), ray, search, counters), ());
    }

    /// [`search_boxes`](Self::search_boxes) along a line. A `t` of the range or of a hit is `scale` times as large
    /// along the line.
    pub(crate) fn search_boxes_along(
        &self,
        line: &LineF64,
        scale: f64,
        range: [f32; 2],
        search: &mut BoxSearch<'_>,
        counters: &mut Counters,
    ) {
        by_kind!(
            &self.structure,
            tree => tree.search_boxes_along(&self.scope(), line, scale, range, search, counters),
            ()
        );
    }

    /// Passes `test` the triangles of a tree that may be within a distance of a point, about from near to far; returns
    /// false for the four grids. `test` returns the distance within which triangles matter from then on.
    pub(crate) fn visit_nearest<T: Tally>(
        &self,
        point: [f32; 3],
        within: f32,
        test: impl FnMut(u32) -> f32,
        tally: &mut T,
    ) -> bool {
        by_kind!(
            &self.structure,
            tree => {
                tree.nearest(&self.scope(), point, within, test, tally);
                true
            },
            false
        )
    }

    /// The extent of a cell on each axis.
    pub(crate) fn cell_size(&self) -> Vec3A {
        self.lattice.cell_size()
    }

    /// The same grid with queries limited to these instructions: the same hits, slower.
    #[must_use]
    pub const fn with_simd(self, simd: SimdLevel) -> Self {
        Self { simd, ..self }
    }

    /// Returns true if a traversal passes each triangle to the search at most once.
    pub(crate) const fn shows_once(&self) -> bool {
        by_kind!(self.structure, _ => true, false)
    }

    /// The mesh that the grid was built for.
    #[must_use]
    pub const fn mesh(&self) -> &TriangleMesh<'a> {
        &self.mesh
    }

    /// The grid as bytes: what to copy, store or send in order to [`open`](Self::open) it again. Of a packed grid it is
    /// the grid alone, to be opened with its mesh; [`pack`](Self::pack) makes a packed one again.
    #[must_use]
    pub const fn blob(&self) -> &'a [u8] {
        self.blob
    }

    /// Bytes of the grid.
    #[must_use]
    pub const fn blob_bytes(&self) -> usize {
        self.blob.len()
    }

    /// Bytes of scratch that the build of this grid took; an upper bound where a bump allocator gave them.
    #[must_use]
    pub fn scratch_bytes(&self) -> u64 {
        self.header().map_or(0, |header| self.structure.scratch_bytes(&header))
    }

    /// The least and the greatest corner of the grid's box, in scene units: the mesh's box and a
    /// pad of about 1e-5 of its extent, and more where f32 has no such small steps.
    #[must_use]
    pub const fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        (self.lattice.min, self.lattice.max)
    }

    /// Cells per axis; a tree is one cell.
    #[must_use]
    pub const fn resolution(&self) -> [u32; 3] {
        self.lattice.resolution
    }

    /// The structure.
    #[must_use]
    pub const fn method(&self) -> Method {
        self.structure.method()
    }

    /// A configuration that builds this grid of this mesh again. Its density is the one that the grid has: the
    /// configured one, or a half, a quarter, ... of it where the mesh would have needed more than 16 references
    /// a triangle.
    #[must_use]
    pub fn config(&self) -> Config {
        let method = self.method();
        self.header().map_or(Config::new(method), |header| header.parameters(method).into())
    }

    /// Triangles left out because a coordinate is not finite.
    #[must_use]
    pub fn skipped_count(&self) -> u32 {
        self.header().map_or(0, |header| header.skipped_count)
    }

    /// Primitive ids in all cells or leaves together; words of the pool for a variable or recursive grid.
    #[must_use]
    pub fn reference_count(&self) -> u32 {
        self.header().map_or(0, |header| header.reference_count)
    }

    fn header(&self) -> Option<Header> {
        Header::read(self.blob, &self.mesh).ok()
    }

    /// A grid that hits nothing.
    #[cfg(feature = "alloc")]
    pub(crate) fn nothing() -> Self {
        let (mesh, blob) = (TriangleMesh::EMPTY, &[]);
        let (lattice, structure) = (Lattice::NOTHING, Structure::NOTHING);
        Self { mesh, blob, lattice, structure, simd: SimdLevel::detect() }
    }

    /// Writes its fields for `Debug`.
    pub(crate) fn describe(&self, mut to: fmt::DebugStruct<'_, '_>) -> fmt::Result {
        to.field("method", &self.method())
            .field("triangles", &self.mesh.triangle_count())
            .field("bytes", &self.blob_bytes())
            .finish()
    }
}

impl fmt::Debug for Grid<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.describe(f.debug_struct("Grid"))
    }
}
