//! Cuts a box into cells: chooses how many, and finds those that a triangle overlaps.
//!
//! The box of a grid is the mesh's box grown by a pad, cut into `resolution` cells per axis. A triangle
//! is inserted into every cell that its own box, grown by a margin, overlaps. The margin absorbs all float errors:
//! where the walk is a few roundings off at a border, or off the ray of the triangle test, the cell still lists the
//! triangle.
//!
//! ```text
//! error of             bound, in box extents E        why
//! spreading             4 * 2^-24                     v - min, * cells per unit, + margin
//! the triangle test     8 * 2^-24                     a hit's t outside of the range (triangle.rs)
//! a far origin         16 * 2^-24                     2^-49 of 2^29 extents (approach.rs)
//! the walk              4 * 2^-24                     base, cell * delta, their sum
//! a moved far origin   1 ulp of the coordinate        half an ulp on two axes (approach.rs)
//! margin               64 * 2^-24 + 1 ulp of the largest coordinate (pad: twice the margin)
//! ```

use glam::Vec3A;

use crate::aabb::Aabb;
use crate::limits::MAX_RESOLUTION;

/// Smallest margin: with it the box of a single point has an inside, and its cells per unit do not overflow.
const LEAST_MARGIN: f32 = f32::from_bits(0x0680_0000); // 2^-114

/// The cells that a box overlaps, both ends included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CellRange {
    pub(crate) min: [u32; 3],
    pub(crate) max: [u32; 3],
}

impl CellRange {
    /// All cells of a grid.
    pub(crate) fn all(resolution: [u32; 3]) -> Self {
        Self { min: [0; 3], max: resolution.map(|cells| cells - 1) }
    }

    /// Number of cells.
    #[inline(always)]
    pub(crate) fn count(&self) -> u64 {
        let [x, y, z] = self.lengths();
        x * y * z
    }

    #[inline(always)]
    fn lengths(&self) -> [u64; 3] {
        core::array::from_fn(|axis| u64::from(self.max[axis].saturating_sub(self.min[axis])) + 1)
    }

    /// The cells, along x, then y, then z.
    pub(crate) fn cells(self) -> impl Iterator<Item = [u32; 3]> {
        let Self { min, max } = self;
        let is_empty = (0..3).any(|axis| min[axis] > max[axis]);
        // In one closure: nested iterators take five times the code.
        core::iter::successors((!is_empty).then_some(min), move |&[x, y, z]| {
            if x < max[0] {
                Some([x + 1, y, z])
            } else if y < max[1] {
                Some([min[0], y + 1, z])
            } else {
                (z < max[2]).then(|| [min[0], min[1], z + 1])
            }
        })
    }

    /// Returns true if a cell is one of them.
    pub(crate) fn contains(&self, cell: [u32; 3]) -> bool {
        (0..3).all(|axis| (self.min[axis]..=self.max[axis]).contains(&cell[axis]))
    }
}

/// The row of the cells with this y and z.
#[inline(always)]
pub(crate) const fn row(height: u32, y: u32, z: u32) -> usize {
    z as usize * height as usize + y as usize
}

/// A box cut into equal cells. Plain arrays, so that views of grids need no special alignment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lattice {
    /// The box's least corner, pad included.
    pub(crate) min: [f32; 3],
    /// The box's greatest corner, pad included.
    pub(crate) max: [f32; 3],
    /// Cells per axis, 1 to [`MAX_RESOLUTION`].
    pub(crate) resolution: [u32; 3],
    cells_per_unit: [f32; 3],
    /// The inverse of each, which every ray asks for.
    units_per_cell: [f64; 3],
    /// The margin, in cells.
    margin: [f32; 3],
}

/// Woo's resolution (the paper's equation 1): `M_i = S_i / max(S) * cbrt(density * primitives)`,
/// rounded down, at least 1; `None` if an axis would need more than [`MAX_RESOLUTION`] cells.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to MAX_RESOLUTION")]
pub(crate) fn woo(size: Vec3A, density: f64, primitives: u32) -> Option<[u32; 3]> {
    let longest = cube_root(density * f64::from(primitives));
    let max = f64::from(size.max_element());
    let cells = |s: f32| ((f64::from(s) / max * longest) as u32).max(1);
    (longest < f64::from(MAX_RESOLUTION + 1)).then(|| size.to_array().map(cells))
}

/// The cube root of a positive number, by Newton's method: the same bits everywhere, and exact for
/// the cubes of whole numbers.
pub(crate) const fn cube_root(x: f64) -> f64 {
    // Adding and subtracting it rounds a smaller number to a whole one.
    const WHOLE: f64 = 4_503_599_627_370_496.0; // 2^52

    // A third of the exponent is a start that is right to a few percent; 5 rounds give all bits.
    let mut root = f64::from_bits(x.to_bits() / 3 + 0x2a9f_7893_782d_a1ce);
    let mut round = 0;
    while round < 5 {
        root -= (root - x / (root * root)) / 3.0;
        round += 1;
    }
    // The last bit may be off: prefer the whole number if it is the root.
    let whole = (root + WHOLE) - WHOLE;
    let error = whole * whole * whole - x;
    if error.abs() > 0.0 { root } else { whole }
}

impl Lattice {
    /// One cell at the origin.
    #[cfg(feature = "alloc")]
    pub(crate) const NOTHING: Self = Self {
        min: [0.0; 3],
        max: [0.0; 3],
        resolution: [1; 3],
        cells_per_unit: [1.0; 3],
        units_per_cell: [1.0; 3],
        margin: [0.0; 3],
    };

    /// Pads a mesh's box, so that no triangle and no float error lies on the outside.
    pub(crate) fn pad(bounds: &Aabb) -> Aabb {
        // Without a single finite triangle there is no box: any will do, nothing is in it.
        let bounds = if bounds.min.cmple(bounds.max).all() {
            *bounds
        } else {
            Aabb { min: Vec3A::ZERO, max: Vec3A::ZERO }
        };
        let pad = Vec3A::splat(2.0 * margin(&bounds));
        Aabb { min: bounds.min - pad, max: bounds.max + pad }
    }

    /// Cuts a padded box into cells. The same box and resolution give the same bits.
    pub(crate) fn new(bounds: Aabb, resolution: [u32; 3]) -> Self {
        let cells_per_unit = Vec3A::from_array(resolution.map(as_f32)) / bounds.size();
        Self {
            min: bounds.min.to_array(),
            max: bounds.max.to_array(),
            resolution,
            cells_per_unit: cells_per_unit.to_array(),
            units_per_cell: cells_per_unit.to_array().map(|cells| 1.0 / f64::from(cells)),
            margin: (cells_per_unit * margin(&bounds)).to_array(),
        }
    }

    /// The box, pad included.
    #[inline(always)]
    pub(crate) fn bounds(&self) -> Aabb {
        Aabb { min: self.min.into(), max: self.max.into() }
    }

    /// The cells to which a triangle with this box belongs.
    #[inline(always)]
    pub(crate) fn range(&self, triangle: &Aabb) -> CellRange {
        cells_between(self.reach(triangle), self.resolution)
    }

    /// A triangle's box, grown by the margin, in cells.
    #[inline(always)]
    pub(crate) fn reach(&self, triangle: &Aabb) -> Aabb {
        let origin = Vec3A::from_array(self.min);
        let cells_per_unit = Vec3A::from_array(self.cells_per_unit);
        let margin = Vec3A::from_array(self.margin);
        Aabb {
            min: (triangle.min - origin) * cells_per_unit - margin,
            max: (triangle.max - origin) * cells_per_unit + margin,
        }
    }

    /// A point in cells.
    #[inline(always)]
    pub(crate) fn place(&self, point: Vec3A) -> Vec3A {
        (point - Vec3A::from_array(self.min)) * Vec3A::from_array(self.cells_per_unit)
    }

    /// Cells per unit on each axis.
    #[inline(always)]
    pub(crate) fn scale(&self) -> Vec3A {
        Vec3A::from_array(self.cells_per_unit)
    }

    /// Returns the margin by which boxes are grown, in cells.
    #[inline(always)]
    pub(crate) fn margin(&self) -> Vec3A {
        Vec3A::from_array(self.margin)
    }

    /// The extent of a cell on each axis, in scene units.
    pub(crate) fn cell_size(&self) -> Vec3A {
        1.0 / Vec3A::from_array(self.cells_per_unit)
    }

    /// Returns the position of a coordinate, in cells from the box's corner.
    #[inline(always)]
    pub(crate) fn position(&self, axis: usize, coordinate: f64) -> f64 {
        (coordinate - f64::from(self.min[axis])) * self.cells_per_unit(axis)
    }

    /// The last cell on each axis.
    #[inline(always)]
    pub(crate) fn last(&self) -> [u32; 3] {
        self.resolution.map(|cells| cells - 1)
    }

    #[inline(always)]
    pub(crate) fn cells_per_unit(&self, axis: usize) -> f64 {
        f64::from(self.cells_per_unit[axis])
    }

    #[inline(always)]
    pub(crate) const fn units_per_cell(&self, axis: usize) -> f64 {
        self.units_per_cell[axis]
    }

    /// The most cells per unit on any axis.
    #[inline(always)]
    pub(crate) fn finest(&self) -> f64 {
        let [x, y, z] = self.cells_per_unit;
        f64::from(x.max(y).max(z))
    }
}

/// The cells that a box in cells overlaps; those at the border if it lies outside.
#[inline(always)]
pub(crate) fn cells_between(reach: Aabb, resolution: [u32; 3]) -> CellRange {
    let end = Vec3A::from_array(resolution.map(as_f32)) - 0.5;
    let clamp = |position: Vec3A| position.max(Vec3A::ZERO).min(end);
    CellRange { min: wholes(clamp(reach.min)), max: wholes(clamp(reach.max)) }
}

/// Returns the margin by which a triangle's box is grown before it is spread over cells; see the module's head.
fn margin(bounds: &Aabb) -> f32 {
    const EXTENT_SHARE: f32 = 1.0 / 262_144.0; // 2^-18
    let extent = bounds.size().max_element();
    let coordinate = bounds.min.abs().max(bounds.max.abs()).max_element();
    (extent * EXTENT_SHARE + coordinate * f32::EPSILON).max(LEAST_MARGIN)
}

/// A whole number below 2^24, as that of a cell, as f32: exact.
#[inline(always)]
#[expect(clippy::cast_precision_loss, reason = "below 2^24")]
pub(crate) const fn as_f32(cell: u32) -> f32 {
    cell as f32
}

/// The whole part of a position; 0 if it is negative or no number.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
pub(crate) const fn whole(position: f32) -> u32 {
    position as u32
}

/// The whole parts of positions from 0 to [`MAX_RESOLUTION`]. An odd whole number rounds down to the cell before it,
/// which the margin allows.
#[inline(always)]
fn wholes(position: Vec3A) -> [u32; 3] {
    let shifted = position - Vec3A::splat(0.5) + Vec3A::splat(WHOLE_SHIFT);
    shifted.to_array().map(|bits| bits.to_bits() & WHOLE_BITS)
}

/// Adding this rounds a small number to a whole one and leaves that in the low bits. A cast takes longer, because it
/// must saturate.
pub(crate) const WHOLE_SHIFT: f32 = 12_582_912.0; // 1.5 * 2^23
/// The bits of the sum that are the number.
pub(crate) const WHOLE_BITS: u32 = 0x003f_ffff;
