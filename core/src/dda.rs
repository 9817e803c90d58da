//! Walking a ray through cells without drift (Amanatides and Woo 1987; robust as in LD08).
//!
//! ```text
//! loop: read the list of the cell; axis = the one whose border ahead is nearest
//!       done if the ray ends before that border, or the cell is the last on the axis
//!       cell += step on the axis; border ahead = base + cell * delta; in the last cell, the walk's end
//! ```
//!
//! Distances are measured in cells along the ray's longest axis, from where the ray enters the box; so they need no
//! scene scale. They are computed from the integer cell at every step and never summed up: the error stays a few
//! roundings however long the walk, and lies inside the margin by which triangles were spread over cells. A walk
//! within a larger cell ends where the walk around it leaves that cell: a border has one distance.
//!
//! A [`Line`] is the ray in a lattice; a [`CellWalk`] goes along it through equal cells, those of the lattice or larger
//! ones of a macrocell level.

use glam::{BVec3A, Vec3A, Vec3Swizzles as _};

use crate::aabb::{Aabb, greater, lesser};
use crate::approach::Approach;
use crate::cell::{Lattice, WHOLE_BITS, WHOLE_SHIFT, as_f32};
use crate::ray::{Ray, round};
use crate::simd::HAS_VECTORS;

/// A ray in the cells of a lattice, from where it enters the box.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// Start of the line, in cells.
    position: Vec3A,
    /// Cells for each unit of distance; zero on an axis that the ray runs parallel to.
    rate: Vec3A,
    /// Distance for each cell, negative where the ray runs downwards; zero if parallel.
    delta: Vec3A,
    /// Distance of the border at which cell 0 begins; infinite if parallel.
    base: Vec3A,
    /// The number to add to the cell on each axis: 1 or -1; 0 if parallel.
    step: Vec3A,
    /// The most that a line may be off its cells, in cells.
    margin: Vec3A,
    /// Distance at which the ray ends.
    pub(crate) end: f32,
    /// The `t` at which the line starts.
    start: f64,
    /// Distance for each unit of `t`.
    scale: f64,
}

/// A walk along a line through cells of one size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CellWalk {
    /// The cell the walk is in: whole numbers.
    cell: Vec3A,
    /// Distance at which it was entered.
    pub(crate) entered: f32,
    /// Distance at which the ray leaves the cell through its border on each axis.
    pub(crate) next: Vec3A,
    /// Distance at which the ray leaves the walk's last cell on each axis.
    exits: Vec3A,
    /// Distance from one border to the next, negative where the ray runs downwards.
    delta: Vec3A,
    /// Distance of the border through which the ray leaves cell 0; infinite if parallel.
    base: Vec3A,
    /// The number to add to the cell on each axis: 1 or -1; 0 if parallel.
    step: Vec3A,
    /// The last cell on each axis that the walk enters.
    last: Vec3A,
}

/// Exits that are never reached: only the end of the ray ends the walk.
pub(crate) const NEVER: Vec3A = Vec3A::INFINITY;

/// The outcome of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// The walk is in the next cell.
    Inside,
    /// The walk left its cells.
    Outside,
    /// The ray ended in the cell.
    Ended,
}

/// A direction component this much smaller than the largest moves the ray by less than the margin
/// of the cells over the whole box: the axis counts as parallel.
const PARALLEL: f64 = 1.0 / 1_099_511_627_776.0; // 2^-40

impl Line {
    /// The line of a ray that starts at the lattice's box; `None` if the ray's range lies outside of it.
    #[inline]
    pub(crate) fn new(lattice: &Lattice, ray: &Ray, approach: &Approach) -> Option<Self> {
        // A query may go on from the reported `t` of a hit, which is off by its rounding and by 2^-38 of the range of
        // the corners' `t`: the next numbers cover the first, the margin of cells the second.
        let start = approach.near.max(f64::from(ray.t_min.next_down()) - approach.t);
        let end = approach.far.min(f64::from(ray.t_max.next_up()) - approach.t);
        if start > end {
            return None;
        }
        let [x, y, z] = ray.direction;
        let direction = [f64::from(x), f64::from(y), f64::from(z)];
        let [x, y, z] = direction;
        let longest = greater(x.abs(), greater(y.abs(), z.abs()));
        let scale = longest * lattice.finest();
        // Multiply known inverses: a division is slow.
        let least = |[x, y, z]: [f64; 3]| lesser(x, lesser(y, z));
        let inverse_scale = least(approach.inverse.map(f64::abs))
            * least([0, 1, 2].map(|axis| lattice.units_per_cell(axis)));

        // Compute numbers axis by axis, and make vectors of them last: a vector that is filled number by number is
        // slow to read.
        let (mut position, mut rate, mut delta) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        let (mut base, mut step) = ([f32::INFINITY; 3], [0.0; 3]);
        for axis in 0..3 {
            let direction = direction[axis];
            let point = f64::from(approach.anchor[axis]) + start * direction;
            position[axis] = round(lattice.position(axis, point));
            if direction.abs() >= longest * PARALLEL {
                let speed = direction * lattice.cells_per_unit(axis);
                rate[axis] = round(speed * inverse_scale);
                delta[axis] = round(scale * approach.inverse[axis] * lattice.units_per_cell(axis));
                base[axis] = -position[axis] * delta[axis];
                step[axis] = if direction > 0.0 { 1.0 } else { -1.0 };
            }
        }
        Some(Self {
            position: Vec3A::from_array(position),
            rate: Vec3A::from_array(rate),
            delta: Vec3A::from_array(delta),
            base: Vec3A::from_array(base),
            step: Vec3A::from_array(step),
            margin: lattice.margin(),
            end: round((end - start) * scale),
            start: approach.t + start,
            scale,
        })
    }

    /// The distance at which a walk may end after a hit at `t`: all that lies farther away has a larger `t`, rounding
    /// included.
    #[inline(always)]
    pub(crate) fn distance(&self, t: f32) -> f32 {
        round((f64::from(t.next_up()) - self.start) * self.scale)
    }

    /// Returns the number that a step on each axis adds, in wrapping arithmetic, to the place of a cell in an array
    /// with these strides. No step is taken along an axis that the line runs parallel to.
    #[inline(always)]
    pub(crate) fn moves(&self, strides: [usize; 3]) -> [usize; 3] {
        let step = self.step.to_array();
        core::array::from_fn(|axis| {
            if step[axis] < 0.0 { strides[axis].wrapping_neg() } else { strides[axis] }
        })
    }

    /// The same line in the cells of a subgrid, whose corner lies at `origin` and which has `scale`
    /// cells for one of this line's. Distances stay what they are.
    #[inline]
    pub(crate) fn zoom(&self, origin: [f32; 3], scale: [f32; 3]) -> Self {
        let (origin, scale) = (Vec3A::from_array(origin), Vec3A::from_array(scale));
        let position = (self.position - origin) * scale;
        let delta = self.delta / scale;
        let is_parallel = self.delta.cmpeq(Vec3A::ZERO);
        Self {
            position,
            rate: self.rate * scale,
            delta,
            base: Vec3A::select(is_parallel, Vec3A::INFINITY, -position * delta),
            margin: self.margin * scale,
            ..*self
        }
    }

    /// A walk through a box of so many cells, from `entered` or where the line enters the box;
    /// `None` if it passes the box or has left it by then. A line that runs along the border is in.
    #[inline]
    pub(crate) fn walk_in(&self, entered: f32, resolution: [u32; 3]) -> Option<CellWalk> {
        let cells = Vec3A::from_array(resolution.map(as_f32));
        let [near, far] = self.inside(&Aabb { min: Vec3A::ZERO, max: cells });
        let near = entered.max(near);
        let last = resolution.map(|cells| cells.saturating_sub(1));
        (near <= far).then(|| self.walk(near, 1.0, [0; 3], last, Vec3A::splat(far)))
    }

    /// Finds the distances between which the line is inside a box given in cells, or along its border; the
    /// second is less than the first if it passes the box.
    #[inline(always)]
    fn inside(&self, reach: &Aabb) -> [f32; 2] {
        let low = reach.min - self.margin - self.position;
        let high = reach.max + self.margin - self.position;
        let is_outside = low.cmpgt(Vec3A::ZERO) | high.cmplt(Vec3A::ZERO);
        let (low, high) = (low * self.delta, high * self.delta);
        // On an axis that it runs parallel to, it is inside all the way or nowhere.
        let is_parallel = self.delta.cmpeq(Vec3A::ZERO);
        let leaves = Vec3A::select(is_outside, Vec3A::NEG_INFINITY, Vec3A::INFINITY);
        let near = Vec3A::select(is_parallel, Vec3A::NEG_INFINITY, low.min(high));
        let far = Vec3A::select(is_parallel, leaves, low.max(high));
        [near.max_element(), far.min_element()]
    }

    /// A walk from a distance on through the cells `min..=max`, each `size` cells of the lattice
    /// wide, which ends where the ray passes `exits`.
    ///
    /// `exits` are those of the larger cell around these ([`CellWalk::next`]). They are not computed from the last
    /// cells here: where the ray runs nearly along a border, the two differ by many cells, and the walk would leave a
    /// gap.
    #[inline(always)]
    pub(crate) fn walk(
        &self,
        from: f32,
        size: f32,
        min: [u32; 3],
        max: [u32; 3],
        exits: Vec3A,
    ) -> CellWalk {
        // All axes at once: a ray begins many walks, and most are short.
        let position = (self.position + self.rate * from) / size;
        let (low, high) = (Vec3A::from_array(min.map(as_f32)), Vec3A::from_array(max.map(as_f32)));
        let cell = position.max(low).min(high).trunc();
        let delta = self.delta * size;
        let base = self.base + self.delta.max(Vec3A::ZERO) * size;
        let last = Vec3A::select(delta.cmpgt(Vec3A::ZERO), high, low);
        let next = Vec3A::select(cell.cmpeq(last), exits, base + cell * delta);
        CellWalk { cell, entered: from, next, exits, delta, base, step: self.step, last }
    }
}

impl CellWalk {
    /// The cell the walk is in.
    #[inline(always)]
    pub(crate) fn cell(&self) -> [u32; 3] {
        (self.cell + WHOLE_SHIFT).to_array().map(|cell| cell.to_bits() & WHOLE_BITS)
    }

    /// Enters the next cell, unless the walk leaves its cells or reaches `limit` first.
    ///
    /// Every call moves one axis towards its end, whatever the floats say: a walk takes at most as
    /// many steps as it has cells on the three axes together.
    ///
    /// It compares all axes at once: in a walk of a few cells, the processor cannot predict which one is next.
    #[inline(always)]
    pub(crate) fn advance(&mut self, limit: f32) -> Step {
        if !HAS_VECTORS {
            return self.advance_far(limit, |_| {});
        }
        let (next, yzx, zxy) = (self.next, self.next.yzx(), self.next.zxy());
        let mut axis = next.cmplt(yzx) & next.cmplt(zxy);
        let mut border = next.min(yzx).min(zxy).x;
        // Two borders in one point, or NaN distances.
        if !axis.any() {
            (axis, border) = nearest_of(next);
        }
        self.step_along(axis, border, limit)
    }

    /// [`advance`](Self::advance) with a branch for each axis. `along` receives the axis, also if the step leaves the
    /// cells.
    ///
    /// In a walk of dozens of cells the processor predicts the axis and does not wait for
    /// distances, which [`advance`](Self::advance) always does.
    #[inline(always)]
    pub(crate) fn advance_far(&mut self, limit: f32, mut along: impl FnMut(usize)) -> Step {
        let [x, y, z] = self.next.to_array();
        if x < y && x < z {
            along(0);
            self.step_along(BVec3A::new(true, false, false), x, limit)
        } else if y < z {
            along(1);
            self.step_along(BVec3A::new(false, true, false), y, limit)
        } else {
            along(2);
            self.step_along(BVec3A::new(false, false, true), z, limit)
        }
    }

    /// Leaves the cell through a border.
    #[inline(always)]
    fn step_along(&mut self, axis: BVec3A, border: f32, limit: f32) -> Step {
        self.entered = border;
        // Damaged bytes make NaNs: they count as behind the limit.
        let is_before = border < limit;
        if !is_before {
            return Step::Ended;
        }
        if (axis & self.cell.cmpeq(self.last)).any() {
            return Step::Outside;
        }
        self.cell += Vec3A::select(axis, self.step, Vec3A::ZERO);
        let next = self.base + self.cell * self.delta;
        self.next = Vec3A::select(self.cell.cmpeq(self.last), self.exits, next);
        Step::Inside
    }
}

/// The axis with the nearest border, and its distance; of borders in one point the last
/// axis', as in [`CellWalk::advance_far`].
///
/// It takes a copy of the distances: a walk that is passed by reference lives in memory.
#[cold]
fn nearest_of(next: Vec3A) -> (BVec3A, f32) {
    let [x, y, z] = next.to_array();
    if x < y && x < z {
        (BVec3A::new(true, false, false), x)
    } else if y < z {
        (BVec3A::new(false, true, false), y)
    } else {
        (BVec3A::new(false, false, true), z)
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    const END: Vec3A = Vec3A::new(4.0, 3.0, 5.0);

    /// A walk with these distances: to the first borders, between borders, and to the last ones. Up
    /// from the first cell or, on some axes, down from the end.
    fn walk(first: [f32; 3], delta: [f32; 3], exits: [f32; 3], is_down: BVec3A) -> CellWalk {
        let [first, delta, exits] = [first, delta, exits].map(Vec3A::from_array);
        // As a line has it on axes that it runs parallel to.
        let is_parallel = delta.cmpeq(Vec3A::ZERO);
        let step = Vec3A::select(is_down, Vec3A::NEG_ONE, Vec3A::ONE);
        let (cell, last) = (Vec3A::select(is_down, END, Vec3A::ZERO), END * step.max(Vec3A::ZERO));
        let delta = delta * step;
        let base = Vec3A::select(is_parallel, Vec3A::INFINITY, first - cell * delta);
        let step = Vec3A::select(is_parallel, Vec3A::ZERO, step);
        CellWalk {
            cell,
            entered: 0.0,
            next: Vec3A::select(is_parallel, Vec3A::INFINITY, first),
            exits,
            delta,
            base,
            step,
            last,
        }
    }

    /// The cells of a walk and the distances at which they are entered, then how it ends.
    fn steps(
        mut walk: CellWalk,
        step: impl Fn(&mut CellWalk) -> Step,
    ) -> Vec<([u32; 3], u32, Step)> {
        let mut all = Vec::new();
        loop {
            let last = step(&mut walk);
            all.push((walk.cell(), walk.entered.to_bits(), last));
            if last != Step::Inside {
                return all;
            }
            assert!(all.len() <= 12, "a walk has an end: {walk:?}");
        }
    }

    fn is_down(axes: usize) -> BVec3A {
        BVec3A::new(axes & 1 != 0, axes & 2 != 0, axes & 4 != 0)
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn all_axes_at_once_step_as_one_after_the_other() {
        let values = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25];
        let at = |number: usize, place: u32| values[number / 6_usize.pow(place) % 6];
        let (mut lengths, mut ends) = ([0; 14], [0; 2]);
        for number in 0..6_usize.pow(6) {
            let first = [0, 1, 2].map(|axis| at(number, axis));
            let delta = [3, 4, 5].map(|axis| at(number, axis));
            for exits in [[2.5, 3.0, 3.0], [2.0; 3]] {
                let walk = walk(first, delta, exits, is_down(number % 8));
                let expected = steps(walk, |walk| walk.advance_far(2.75, |_| {}));
                assert_eq!(steps(walk, |walk| walk.advance(2.75)), expected, "{walk:?}");
                lengths[expected.len()] += 1;
                ends[usize::from(expected[expected.len() - 1].2 == Step::Ended)] += 1;
            }
        }
        assert!(lengths[3..].iter().all(|&count| count > 100), "{lengths:?}");
        assert!(ends.iter().all(|&count| count > 1000), "{ends:?}");
    }

    #[test]
    #[cfg_attr(miri, ignore = "hours of arithmetic")]
    fn walks_of_no_numbers_have_an_end() {
        let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, 0.5];
        let at = |number: usize, place: u32| values[number / 5_usize.pow(place) % 5];
        for number in 0..5_usize.pow(7) {
            let base = [0, 1, 2].map(|axis| at(number, axis));
            let delta = [3, 4, 5].map(|axis| at(number, axis));
            for limit in [f32::INFINITY, 3.0, f32::NAN] {
                let walk = walk(base, delta, [at(number, 6); 3], is_down(number % 8));
                steps(walk, |walk| walk.advance(limit));
                steps(walk, |walk| walk.advance_far(limit, |_| {}));
            }
        }
    }
}
