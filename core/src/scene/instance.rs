//! Instances: where an object stands in a scene, and the ray that the object sees.
//!
//! ```text
//! caller  scene = linear * object + translation         9 x f32, 3 x f64
//! blob    object = inverse * (scene - translation)      the same struct, with the inverse in `linear`
//! ```
//!
//! Origins and directions are moved in f64, through all scenes on the way, and rounded to f32 once, for the
//! object: near the object, not near the scene's zero. A direction that was rounded before would miss an object
//! at a distance of 2^24 extents. The direction is scaled by a power of two, which changes no digit, and the `t`
//! of the object's ray with it:
//!
//! ```text
//! t of the object's ray = t * scale - shift
//! shift   0; for an origin more than four extents away from the object the distance at which the ray
//!         enters its box
//! ```
//!
//! The `t` of a ray in a scene inside another is that of the outermost scene. The object's ray is a function of that
//! ray, the instances on the path and the object's box alone: so every query asks the object the same. The closest hit
//! so far only shortens the walk ([`ObjectRay::until`]). Only the test of a shape gets the range that is left, because
//! it compares its own `t` with it.

use glam::DVec3;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use crate::aabb::{greater, lesser};
use crate::approach::{FAR_EXTENTS, LineF64};
use crate::limits::MAX_COORDINATE;
use crate::ray::{Ray, RayF64, round};

/// An object at a place in a scene: 72 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, Immutable, IntoBytes, KnownLayout)]
pub struct Instance {
    /// Rows of the matrix that takes the object's directions to the scene's. It may mirror, shear and scale if the
    /// matrix times its inverse, rounded to f32, differs from the identity by at most 2^-10. Scales along the axes may
    /// have any ratio; a matrix that rotates or shears, too, may have a condition number up to about 10^4.
    pub linear: [[f32; 3]; 3],
    /// Number of the object among those of the scene.
    pub object: u32,
    /// Position of the object's origin in the scene.
    pub translation: [f64; 3],
    /// A query sees the instance if its mask and this have a bit in common. A query whose mask has all bits, the
    /// default, sees every instance, even one whose mask is 0.
    pub mask: u32,
    /// The caller's own, not read.
    pub id: u32,
}

impl Instance {
    /// An instance that does not move its object: the identity transform.
    #[must_use]
    pub const fn new(object: u32) -> Self {
        Self {
            linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            object,
            translation: [0.0; 3],
            mask: u32::MAX,
            id: 0,
        }
    }

    /// An object moved by a matrix of three rows and four columns, the last of which is the translation.
    ///
    /// ```
    /// use hgrid_core::Instance;
    /// // The third object of a scene, twice as large, and ten units along x.
    /// let matrix = [[2.0, 0.0, 0.0, 10.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]];
    /// let instance = Instance { id: 7, ..Instance::with_transform(2, matrix) };
    /// assert_eq!((instance.object, instance.translation), (2, [10.0, 0.0, 0.0]));
    /// ```
    #[must_use]
    pub fn with_transform(object: u32, [a, b, c]: [[f32; 4]; 3]) -> Self {
        let row = |[x, y, z, _]: [f32; 4]| [x, y, z];
        Self {
            linear: [row(a), row(b), row(c)],
            translation: [a[3], b[3], c[3]].map(f64::from),
            ..Self::new(object)
        }
    }
}

/// An instance as a blob has it: `linear` is the inverse.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, PartialEq, FromBytes, Immutable, IntoBytes)]
pub(super) struct StoredInstance(Instance);

/// The most that the product of a matrix and its rounded inverse may differ from one.
const RESIDUE: f64 = 1.0 / 1024.0;

/// Growth of an object's box, in parts of its coordinates and extents: more than the rounding of a ray that
/// starts within a few extents of it.
const GROWTH: f64 = 1.0 / 524_288.0; // 2^-19

/// Growth of an instance's box in the scene, in parts of its coordinates: more than they are rounded by.
const ROUNDING: f64 = 1.0 / 4_194_304.0; // 2^-22

type Matrix = [[f64; 3]; 3];

impl StoredInstance {
    /// The instance ready for rays; `None` if its matrix has no inverse in f32 or is not finite.
    pub(super) fn new(instance: &Instance) -> Option<Self> {
        let linear = instance.linear.map(|row| row.map(f64::from));
        let inverse = inverse_of(&linear)?.map(|row| row.map(round));
        let rounded = inverse.map(|row| row.map(f64::from));
        let [a, b, c] = rounded;
        for (row, line) in linear.iter().enumerate() {
            let mut product = [0, 1, 2].map(|k| line[0] * a[k] + line[1] * b[k] + line[2] * c[k]);
            product[row] -= 1.0;
            let is_near = product.iter().all(|residue| residue.abs() <= RESIDUE);
            if !is_near {
                return None;
            }
        }
        Some(Self(Instance { linear: inverse, ..*instance }))
    }

    pub(super) const fn object(&self) -> u32 {
        self.0.object
    }

    /// The caller's instance, but for the rounding of its matrix.
    pub(super) fn instance(&self) -> Option<Instance> {
        let linear = inverse_of(&self.inverse())?.map(|row| row.map(round));
        Some(Instance { linear, ..self.0 })
    }

    fn inverse(&self) -> Matrix {
        self.0.linear.map(|row| row.map(f64::from))
    }

    /// The box in the scene of an object with this box, least and greatest corner; `None` if it reaches beyond
    /// the largest coordinate.
    pub(super) fn bounds(&self, bounds: &([f32; 3], [f32; 3])) -> Option<[f32; 6]> {
        let (center, half) = grown(bounds);
        let linear = inverse_of(&self.inverse())?;
        let mut sides = [0.0; 6];
        for axis in 0..3 {
            let row = &linear[axis];
            let (mut middle, mut reach) = (self.0.translation[axis], 0.0);
            let mut terms = middle.abs();
            for k in 0..3 {
                middle += row[k] * center[k];
                terms += (row[k] * center[k]).abs();
                reach += row[k].abs() * half[k];
            }
            let growth = (middle.abs() + reach) * ROUNDING + terms * (16.0 * f64::EPSILON);
            sides[axis] = round(middle - reach - growth).next_down();
            sides[axis + 3] = round(middle + reach + growth).next_up();
        }
        sides.iter().all(|side| side.abs() <= MAX_COORDINATE).then_some(sides)
    }

    /// A normal of the object in the scene, of any length.
    pub(super) fn normal(&self, normal: DVec3) -> DVec3 {
        let [a, b, c] = self.inverse();
        let along = |axis: usize| normal.dot(DVec3::new(a[axis], b[axis], c[axis]));
        DVec3::new(along(0), along(1), along(2))
    }

    /// A point of the object in the scene.
    pub(super) fn point(&self, point: DVec3) -> Option<DVec3> {
        let [a, b, c] = inverse_of(&self.inverse())?.map(|row| point.dot(DVec3::from_array(row)));
        Some(DVec3::new(a, b, c) + DVec3::from_array(self.0.translation))
    }

    /// The line that the object sees, with the `t` of this one.
    pub(super) fn line(&self, line: &LineF64) -> LineF64 {
        let inverse = self.inverse();
        let turned = |[x, y, z]: [f64; 3]| inverse.map(|[a, b, c]| a * x + b * y + c * z);
        let from = [0, 1, 2].map(|axis| line.origin[axis] - self.0.translation[axis]);
        LineF64 { origin: turned(from), direction: turned(line.direction) }
    }
}

/// Center and half the extent of a box with its growth.
fn grown((min, max): &([f32; 3], [f32; 3])) -> ([f64; 3], [f64; 3]) {
    let (min, max) = (min.map(f64::from), max.map(f64::from));
    let center = [0, 1, 2].map(|axis| 0.5 * (min[axis] + max[axis]));
    let mut half = [0, 1, 2].map(|axis| 0.5 * (max[axis] - min[axis]));
    let largest = |[x, y, z]: [f64; 3]| greater(x, greater(y, z));
    let growth = (largest(center.map(f64::abs)) + 2.0 * largest(half)) * GROWTH;
    half = half.map(|half| half + growth);
    (center, half)
}

/// The inverse of a matrix; `None` if it has none.
fn inverse_of([a, b, c]: &Matrix) -> Option<Matrix> {
    let cross = |u: &[f64; 3], v: &[f64; 3]| {
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    };
    let [p, q, r] = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = a[0] * p[0] + a[1] * p[1] + a[2] * p[2];
    let inverse = 1.0 / determinant;
    let is_number = inverse.is_finite() && inverse.abs() > 0.0;
    is_number
        .then(|| [0, 1, 2].map(|axis| [p[axis] * inverse, q[axis] * inverse, r[axis] * inverse]))
}

/// A ray as an object sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct ObjectRay {
    /// The ray's line, its direction scaled: the largest component lies between 1 and 2.
    pub(super) line: LineF64,
    /// `t` of this ray = `t` of the scene's ray * scale - shift.
    pub(super) scale: f64,
    shift: f64,
}

/// From 2^29 extents away, roundings in f64 move an origin by less than 2^-21 extent; [`GROWTH`] covers 2^-19, the rest
/// is a margin.
const AFAR: f64 = 536_870_912.0; // 2^29

/// A direction that is smaller on an axis counts as parallel to the sides of boxes there: with one over it, a distance
/// might become infinite or NaN. A ray from less than 1e50 away moves by less than 1e-50 on such an axis.
const PARALLEL: f64 = 1e-100;

/// The exponents of a power of two and of one over it, added.
const EXPONENTS_OF_BOTH: u64 = (2 * 1023) << 52;

impl ObjectRay {
    /// No ray: fills the places of a group.
    pub(super) const NONE: Self = {
        let line = LineF64 { origin: [0.0; 3], direction: [0.0; 3] };
        Self { line, scale: 1.0, shift: 0.0 }
    };

    /// `None` if the line has no direction.
    pub(super) fn new(line: &LineF64) -> Option<Self> {
        let [x, y, z] = line.direction.map(f64::abs);
        let longest = greater(x, greater(y, z));
        let exponent = longest.to_bits() & 0x7ff0_0000_0000_0000;
        let scale = f64::from_bits(exponent);
        // Neither zero nor NaN, nor so large or small that one over it is no normal number.
        let is_ray = (1e-300..1e300).contains(&longest);
        is_ray.then(|| {
            // One over the power of two, without a division.
            let unit = f64::from_bits(EXPONENTS_OF_BOTH - exponent);
            let direction = line.direction.map(|d| d * unit);
            Self { line: LineF64 { direction, ..*line }, scale, shift: 0.0 }
        })
    }

    /// The ray in f32 for an object with this box, from near the box. `None` if it passes the box.
    pub(super) fn narrow(&mut self, ray: &RayF64, bounds: &([f32; 3], [f32; 3])) -> Option<Ray> {
        let LineF64 { origin, direction } = self.line;
        let (center, half) = grown(bounds);
        let away = |axis: usize| (origin[axis] - center[axis]).abs();
        let extent = 2.0 * greater(half[0], greater(half[1], half[2]));
        let away = greater(away(0), greater(away(1), away(2)));
        // An object that is far away is seen from where the ray enters its box.
        if away > f64::from(FAR_EXTENTS) * extent {
            self.shift = self.entry(&center, &half)?;
        }
        let at = |axis: usize| round(origin[axis] + self.shift * direction[axis]);
        let [t_min, t_max] = finite_part(ray);
        Some(Ray {
            origin: [at(0), at(1), at(2)],
            t_min: self.object_t(t_min),
            direction: direction.map(round),
            t_max: self.object_t(t_max),
        })
    }

    /// Returns true if the ray comes to this box from so far away that rounding may have put its new origin behind a
    /// surface. Hits may have a negative `t` then.
    pub(super) fn is_from_afar(&self, (min, max): &([f32; 3], [f32; 3])) -> bool {
        let size = |axis: usize| f64::from(max[axis]) - f64::from(min[axis]);
        self.shift.abs() > greater(size(0), greater(size(1), size(2))) * AFAR
    }

    /// Finds the distance at which the ray's line enters a box, in multiples of its direction.
    #[inline(never)]
    fn entry(&self, center: &[f64; 3], half: &[f64; 3]) -> Option<f64> {
        let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let direction = self.line.direction[axis];
            let away = center[axis] - self.line.origin[axis];
            let (low, high) = (away - half[axis], away + half[axis]);
            if direction.abs() > PARALLEL {
                let inverse = 1.0 / direction;
                let (a, b) = (low * inverse, high * inverse);
                near = greater(near, lesser(a, b));
                far = lesser(far, greater(a, b));
            } else if low > 0.0 || high < 0.0 {
                return None;
            }
        }
        (near <= far).then_some(near)
    }

    /// The `t` of the object's ray.
    fn object_t(&self, t: f32) -> f32 {
        round(f64::from(t) * self.scale - self.shift)
    }

    /// The `t` of the object's ray up to which hits matter, once the scene's ray has a hit at `t`. The function moves
    /// the next f32 after `t` into the object and rounds it. A hit in the object that has the same `t` in the scene
    /// lies before that place, and its own `t` is an f32. Rounding keeps the order of numbers, so the result is never
    /// less than the `t` of such a hit.
    ///
    /// For triangles it must not end the range of `inside`, the object's ray, because the exact place of a hit decides
    /// about the range. Where the ray grazes a triangle, this place may lie far behind the `t` that is reported.
    pub(super) fn until(&self, t: f32, inside: &Ray) -> f32 {
        let until = round(f64::from(t.next_up()) * self.scale - self.shift);
        lesser(until, inside.t_max)
    }

    /// The `t` of the scene's ray, which lies in that ray's range.
    pub(super) fn scene_t(&self, t: f32, ray: &RayF64) -> f32 {
        let t = round((f64::from(t) + self.shift) / self.scale);
        let [t_min, t_max] = finite_part(ray);
        lesser(greater(t, t_min), t_max)
    }
}

/// The finite part of a ray's range; empty if there is none. A hit has a finite `t`.
fn finite_part(ray: &RayF64) -> [f32; 2] {
    [greater(ray.t_min, -f32::MAX), lesser(ray.t_max, f32::MAX)]
}

const _: () = assert!(size_of::<Instance>() == 72);
