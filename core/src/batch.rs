//! Many rays at once: from the caller's own structs, into the caller's own structs.
//!
//! A batch answers each ray as [`Grid::intersect`] or [`Grid::occluded`] would, bit for bit. What
//! the caller knows about the rays says how: neighbours, as those of a tile of pixels, share
//! their way through the grid; rays without order go one after the other (several at a time in
//! flight were slower: core/DESIGN.md). A tree ([`Method::Bvh`](crate::Method::Bvh)) takes rays of both
//! kinds in groups of 64, and one by one where their origins lie far apart.

use bytemuck::{Pod, bytes_of, pod_read_unaligned};

use crate::error::{BatchField, Error};
use crate::grid::Grid;
use crate::mesh::Strided;
use crate::ray::{Hit, INVALID_ID, Ray};

/// What the caller knows about the rays of a batch.
#[repr(u32)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Coherence {
    /// Nothing: rays after a bounce, random rays. Each is traced alone.
    #[default]
    Incoherent = 0,
    /// Rays that follow one another are neighbours: best are runs of 128 from two tiles of 8 x 8
    /// pixels side by side, each sixteen of them a square of 4 x 4.
    Coherent = 1,
}

/// `count` elements to be written in a slice of bytes, one every `stride` bytes.
#[derive(Debug)]
pub struct StridedMut<'a> {
    /// The bytes, from the first element's first to at least the last element's last.
    pub bytes: &'a mut [u8],
    /// Bytes from one element to the next.
    pub stride: usize,
    /// Number of elements.
    pub count: usize,
}

impl<'a> StridedMut<'a> {
    /// Elements that lie side by side.
    pub fn new<T: Pod>(elements: &'a mut [T]) -> Self {
        let count = elements.len();
        Self { bytes: bytemuck::cast_slice_mut(elements), stride: size_of::<T>(), count }
    }

    /// Whether all elements of `size` bytes lie inside the bytes and apart.
    fn holds(&self, size: usize) -> bool {
        let Some(last) = self.count.checked_sub(1) else { return true };
        let end = last.checked_mul(self.stride).and_then(|start| start.checked_add(size));
        self.stride >= size && end.is_some_and(|end| end <= self.bytes.len())
    }

    /// Writes element `index`; the bytes between the elements stay as they are.
    #[inline(always)]
    pub(crate) fn write<T: Pod>(&mut self, index: usize, value: &T) {
        let start = index.saturating_mul(self.stride);
        let slot = self.bytes.get_mut(start..).and_then(|rest| rest.get_mut(..size_of::<T>()));
        if let Some(slot) = slot {
            slot.copy_from_slice(bytes_of(value));
        }
    }

    /// Writes elements from `first` on.
    #[inline(always)]
    fn write_all<T: Pod>(&mut self, first: usize, values: &[T]) {
        let bytes = bytemuck::cast_slice(values);
        let start = first.saturating_mul(self.stride);
        let slots = self.bytes.get_mut(start..).and_then(|rest| rest.get_mut(..bytes.len()));
        match slots {
            Some(slots) if self.stride == size_of::<T>() => slots.copy_from_slice(bytes),
            _ => (first..).zip(values).for_each(|(index, value)| self.write(index, value)),
        }
    }
}

impl<'a> Strided<'a> {
    /// Elements that lie side by side.
    ///
    /// ```
    /// use hgrid_core::{Ray, Strided};
    /// let rays = [Ray::new([0.0; 3], [0.0, 0.0, 1.0]); 3];
    /// assert_eq!((Strided::new(&rays).stride, Strided::new(&rays).count), (32, 3));
    /// ```
    #[must_use]
    pub fn new<T: Pod>(elements: &'a [T]) -> Self {
        let count = elements.len();
        Self { bytes: bytemuck::cast_slice(elements), stride: size_of::<T>(), count }
    }

    /// Element `index`, or zeros if there is none.
    #[inline(always)]
    pub(crate) fn read<T: Pod>(&self, index: usize) -> T {
        let start = index.saturating_mul(self.stride);
        let bytes = self.bytes.get(start..).and_then(|rest| rest.get(..size_of::<T>()));
        bytes.map_or_else(T::zeroed, pod_read_unaligned)
    }
}

impl Hit {
    /// What a batch writes for a ray that hits nothing.
    pub const MISS: Self = Self { t: f32::INFINITY, u: 0.0, v: 0.0, primitive: INVALID_ID };
}

impl Grid<'_> {
    /// The closest hit of each ray; [`Hit::MISS`] where there is none.
    ///
    /// # Errors
    /// [`Error::InvalidBatch`] if a stride is below its element, an array ends before its last
    /// element, or there are not as many hits as rays. Nothing is written then.
    ///
    /// ```
    /// # use hgrid_core::*;
    /// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// # let mesh = TriangleMesh::new(&positions, &[[0, 1, 2]])?;
    /// # let sizes = sizes(&mesh, &Config::default(), &mut [])?;
    /// # let mut index = vec![Block::ZERO; Block::count_for(sizes.index_bytes)];
    /// # let mut scratch = vec![Block::ZERO; Block::count_for(sizes.scratch_bytes)];
    /// # let (index, scratch) = (Block::bytes_mut(&mut index), Block::bytes_mut(&mut scratch));
    /// # let grid = Grid::build(mesh, &Config::default(), index, scratch)?;
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
        check(rays, hits, size_of::<Hit>())?;
        self.each::<false>(rays, coherence, |index, found| {
            if found.is_empty() {
                hits.write(index, &self.intersect(&rays.read(index)).unwrap_or(Hit::MISS));
            } else {
                hits.write_all(index, found);
            }
        });
        Ok(())
    }

    /// For each ray a byte: 1 if anything is hit, 0 if not.
    ///
    /// # Errors
    /// Those of [`intersect_n`](Self::intersect_n).
    pub fn occluded_n(
        &self,
        rays: &Strided<'_>,
        occluded: &mut StridedMut<'_>,
        coherence: Coherence,
    ) -> Result<(), Error> {
        check(rays, occluded, size_of::<u8>())?;
        self.each::<true>(rays, coherence, |index, found| {
            if found.is_empty() {
                occluded.write(index, &u8::from(self.occluded(&rays.read(index))));
            }
            for (index, hit) in (index..).zip(found) {
                occluded.write(index, &u8::from(hit.primitive != INVALID_ID));
            }
        });
        Ok(())
    }

    /// Shows `answer` the place of every ray, and its hit if the rays were traced together: perhaps
    /// several at once.
    #[inline(always)]
    fn each<const ANY: bool>(
        &self,
        rays: &Strided<'_>,
        coherence: Coherence,
        mut answer: impl FnMut(usize, &[Hit]),
    ) {
        let is_done = (coherence == Coherence::Coherent
            || self.method() == crate::config::Method::Bvh)
            && self.tiles::<ANY>(rays, &mut answer);
        if !is_done {
            (0..rays.count).for_each(|index| answer(index, &[]));
        }
    }
}

fn check(rays: &Strided<'_>, answers: &StridedMut<'_>, size: usize) -> Result<(), Error> {
    if rays.cut(size_of::<Ray>()).is_none() {
        return Err(Error::InvalidBatch(BatchField::Rays));
    }
    if !answers.holds(size) || answers.count != rays.count {
        return Err(Error::InvalidBatch(BatchField::Answers));
    }
    Ok(())
}
