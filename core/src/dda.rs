//! Walking a ray through cells without drift (Amanatides and Woo 1987; robust as in LD08).
//!
//! Distances are measured in cells along the ray's longest axis, from where the ray enters the box;
//! so they need no scene scale. The distance to the next border is computed from the integer cell
//! at every step, `base + cell * delta`, and never summed up: its error stays a few roundings
//! however long the walk, and what error remains lies inside the margin by which triangles were
//! spread over cells. A walk within a larger cell ends where the walk around it leaves that cell: a
//! border has one distance.
//!
//! A [`Line`] is the ray in a lattice; a [`Walk`] goes along it through equal cells, those of the
//! lattice or larger ones of a macrocell level.

use glam::Vec3A;

use crate::aabb::{Aabb, greater};
use crate::approach::Approach;
use crate::cell::{Lattice, WHOLE_BITS, WHOLE_SHIFT, as_f32};
use crate::ray::{Ray, round};

/// A ray in the cells of a lattice, from where it enters the box.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// Where the line starts, in cells.
    position: Vec3A,
    /// Cells for each unit of distance; zero on an axis that the ray runs parallel to.
    rate: Vec3A,
    /// Distance for each cell, negative where the ray runs downwards; zero if parallel.
    delta: Vec3A,
    /// Distance of the border between no cells and cell 0; infinite if parallel.
    base: Vec3A,
    /// What to add to the cell on each axis: 1 or, in wrapping arithmetic, -1; 0 if parallel.
    step: [u32; 3],
    /// How far off its cells a line may be, in cells.
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
pub(crate) struct Walk {
    /// The cell the walk is in.
    pub(crate) cell: [u32; 3],
    /// Distance at which it was entered.
    pub(crate) entered: f32,
    /// Distance at which the ray leaves the cell through its border on each axis.
    pub(crate) next: [f32; 3],
    /// Distance at which the ray leaves the walk's last cell on each axis.
    exits: [f32; 3],
    /// Distance from one border to the next, negative where the ray runs downwards.
    delta: [f32; 3],
    /// Distance of the border through which the ray leaves cell 0; infinite if parallel.
    base: [f32; 3],
    /// What to add to the cell on each axis: 1 or, in wrapping arithmetic, -1.
    step: [u32; 3],
    /// The last cell on each axis that the walk enters.
    last: [u32; 3],
}

/// The exits of a walk that only the end of the ray ends.
pub(crate) const NEVER: [f32; 3] = [f32::INFINITY; 3];

/// What became of a step.
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
    /// The line of a ray that was brought to the lattice's box; `None` if it ends before.
    #[inline]
    pub(crate) fn new(lattice: &Lattice, ray: &Ray, approach: &Approach) -> Option<Self> {
        // A `t` is rounded to f32 before it is compared: what it was before may lie half an ulp out.
        let start = approach.near.max(f64::from(ray.t_min.next_down()) - approach.t);
        let end = approach.far.min(f64::from(ray.t_max.next_up()) - approach.t);
        if start > end {
            return None;
        }
        let [x, y, z] = ray.direction;
        let direction = [f64::from(x), f64::from(y), f64::from(z)];
        let [x, y, z] = direction;
        let longest = greater(x.abs(), greater(y.abs(), z.abs()));
        let finest = lattice.finest();
        let scale = longest * finest;
        let inverse_scale = 1.0 / scale;

        // Axis by axis as numbers, vectors at last: one that is filled number by number is slow to read.
        let (mut position, mut rate, mut delta) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        let (mut base, mut step) = ([f32::INFINITY; 3], [0; 3]);
        for axis in 0..3 {
            let direction = direction[axis];
            let point = f64::from(approach.anchor[axis]) + start * direction;
            position[axis] = round(lattice.position(axis, point));
            if direction.abs() >= longest * PARALLEL {
                let speed = direction * lattice.cells_per_unit(axis);
                rate[axis] = round(speed * inverse_scale);
                let fineness = finest / lattice.cells_per_unit(axis);
                delta[axis] = round(longest * approach.inverse[axis] * fineness);
                base[axis] = -position[axis] * delta[axis];
                step[axis] = if direction > 0.0 { 1 } else { u32::MAX };
            }
        }
        Some(Self {
            position: Vec3A::from_array(position),
            rate: Vec3A::from_array(rate),
            delta: Vec3A::from_array(delta),
            base: Vec3A::from_array(base),
            step,
            margin: lattice.margin(),
            end: round((end - start) * scale),
            start: approach.t + start,
            scale,
        })
    }

    /// The distance behind which every `t` is larger than this one, its rounding included.
    #[inline(always)]
    pub(crate) fn distance(&self, t: f32) -> f32 {
        round((f64::from(t.next_up()) - self.start) * self.scale)
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
    pub(crate) fn walk_in(&self, entered: f32, resolution: [u32; 3]) -> Option<Walk> {
        let cells = Vec3A::from_array(resolution.map(as_f32));
        let [near, far] = self.inside(&Aabb { min: Vec3A::ZERO, max: cells });
        let near = entered.max(near);
        let last = resolution.map(|cells| cells.saturating_sub(1));
        (near <= far).then(|| self.walk(near, 1.0, [0; 3], last, [far; 3]))
    }

    /// Whether the line comes to a box before a distance, or along its border: one that is given in
    /// cells from a corner on.
    #[inline(always)]
    pub(crate) fn meets(&self, reach: &Aabb, corner: [f32; 3], limit: f32) -> bool {
        let corner = Vec3A::from_array(corner);
        let [near, far] = self.inside(&Aabb { min: corner + reach.min, max: corner + reach.max });
        near.max(0.0) <= far.min(limit)
    }

    /// On which axes a cell's lower half is not crossed between two distances, and on which its upper
    /// half is not.
    #[inline(always)]
    pub(crate) fn halves(&self, cell: [u32; 3], near: f32, far: f32) -> [u32; 2] {
        let middle = Vec3A::from_array(cell.map(as_f32)) + 0.5;
        let (from, near, far) = (self.position - middle, self.rate * near, self.rate * far);
        let is_above = (from + near.min(far)).cmpgt(self.margin);
        let is_below = (from + near.max(far)).cmplt(-self.margin);
        [is_above.bitmask(), is_below.bitmask()]
    }

    /// From where to where the line is inside a box given in cells, or along its border; the second is
    /// less than the first if it passes the box.
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
    /// They are those of the larger cell around these ([`Walk::next`]), not computed from these: along a
    /// border that the ray hardly crosses the two differ by many cells, and between them would be a gap.
    #[inline(always)]
    pub(crate) fn walk(
        &self,
        from: f32,
        size: f32,
        min: [u32; 3],
        max: [u32; 3],
        exits: [f32; 3],
    ) -> Walk {
        // All axes at once: a ray begins many walks, and most are short.
        let position = (self.position + self.rate * from) / size;
        let (low, high) = (Vec3A::from_array(min.map(as_f32)), Vec3A::from_array(max.map(as_f32)));
        let cell = position.max(low).min(high).trunc();
        let delta = self.delta * size;
        let base = self.base + self.delta.max(Vec3A::ZERO) * size;
        let last = Vec3A::select(delta.cmpgt(Vec3A::ZERO), high, low);
        let exit = Vec3A::from_array(exits);
        let next = Vec3A::select(cell.cmpeq(last), exit, base + cell * delta);
        let whole =
            |cells: Vec3A| (cells + WHOLE_SHIFT).to_array().map(|cell| cell.to_bits() & WHOLE_BITS);
        Walk {
            cell: whole(cell),
            entered: from,
            next: next.to_array(),
            exits,
            delta: delta.to_array(),
            base: base.to_array(),
            step: self.step,
            last: whole(last),
        }
    }
}

impl Walk {
    /// Enters the next cell, unless the walk leaves its cells or has `limit` behind it by then.
    ///
    /// Every call moves one axis towards its end, whatever the floats say: a walk takes at most as
    /// many steps as it has cells on the three axes together.
    #[inline(always)]
    pub(crate) fn advance(&mut self, limit: f32) -> Step {
        let [x, y, z] = self.next;
        // One arm for each axis: an axis chosen at run time would keep the walk in memory.
        if x < y && x < z {
            self.step_along::<0>(limit)
        } else if y < z {
            self.step_along::<1>(limit)
        } else {
            self.step_along::<2>(limit)
        }
    }

    #[inline(always)]
    fn step_along<const AXIS: usize>(&mut self, limit: f32) -> Step {
        self.entered = self.next[AXIS];
        // Damaged bytes make numbers that are none: whatever is not before the limit is behind it.
        let is_before = self.entered < limit;
        if !is_before {
            return Step::Ended;
        }
        if self.cell[AXIS] == self.last[AXIS] {
            return Step::Outside;
        }
        self.cell[AXIS] = self.cell[AXIS].wrapping_add(self.step[AXIS]);
        self.aim(AXIS);
        Step::Inside
    }

    /// Computes the distance to the next border on an axis from the cell.
    #[inline(always)]
    fn aim(&mut self, axis: usize) {
        let next = self.base[axis] + as_f32(self.cell[axis]) * self.delta[axis];
        self.next[axis] = if self.cell[axis] == self.last[axis] { self.exits[axis] } else { next };
    }
}
