//! Walking a ray through cells without drift (Amanatides and Woo 1987; robust as in LD08).
//!
//! Distances are measured in cells along the ray's longest axis, from where the walk starts; so
//! they need no scene scale. The distance to the next cell border is computed from the integer
//! cell at every step, `base + cell * delta`, and never summed up: its error stays a few roundings
//! however long the walk, and what error remains lies inside the margin by which triangles were
//! spread over cells.

use crate::approach::Approach;
use crate::cell::{Lattice, as_f32};
use crate::ray::{Ray, round};

/// A walk through the cells of a lattice.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Dda {
    /// The cell the walk is in.
    pub(crate) cell: [u32; 3],
    /// Distance at which the ray leaves the cell through its border on each axis.
    next: [f32; 3],
    /// Distance from one border to the next, negative where the ray runs downwards.
    delta: [f32; 3],
    /// Distance of border 0 (for the side the ray leaves by).
    base: [f32; 3],
    /// What to add to the cell on each axis: 1 or, in wrapping arithmetic, -1.
    step: [u32; 3],
    /// The first cell outside on each axis.
    outside: [u32; 3],
    /// Distance at which the ray ends.
    pub(crate) end: f32,
    /// The `t` at which the walk starts.
    start: f64,
    /// Distance for each unit of `t`.
    scale: f64,
}

/// A direction component this much smaller than the largest moves the ray by less than the margin
/// of the cells over the whole box: the axis counts as parallel.
const PARALLEL: f64 = 1.0 / 1_099_511_627_776.0; // 2^-40

impl Dda {
    /// Starts a walk for a ray that was brought to the lattice's box; `None` if it ends before.
    #[inline]
    pub(crate) fn new(lattice: &Lattice, ray: &Ray, approach: &Approach) -> Option<Self> {
        // A `t` is rounded to f32 before it is compared: what it was before may lie half an ulp out.
        let start = approach.near.max(f64::from(ray.t_min.next_down()) - approach.t);
        let end = approach.far.min(f64::from(ray.t_max.next_up()) - approach.t);
        if start > end {
            return None;
        }
        let direction = ray.direction.map(f64::from);
        let longest = direction.map(f64::abs).into_iter().fold(0.0, f64::max);
        let scale = longest * lattice.finest();

        let mut walk = Self {
            cell: [0; 3],
            next: [f32::INFINITY; 3],
            delta: [0.0; 3],
            base: [f32::INFINITY; 3],
            step: [0; 3],
            outside: [u32::MAX; 3],
            end: round((end - start) * scale),
            scale,
            start: approach.t + start,
        };
        for (axis, &direction) in direction.iter().enumerate() {
            let point = f64::from(approach.anchor[axis]) + start * direction;
            let position = lattice.position(axis, point);
            walk.cell[axis] = lattice.clamp(axis, position);
            if direction.abs() < longest * PARALLEL {
                continue;
            }
            let delta = scale / (direction * lattice.cells_per_unit(axis));
            let upwards = direction > 0.0;
            walk.delta[axis] = round(delta);
            walk.base[axis] = round((f64::from(u8::from(upwards)) - position) * delta);
            walk.step[axis] = if upwards { 1 } else { u32::MAX };
            walk.outside[axis] = if upwards { lattice.resolution[axis] } else { u32::MAX };
            walk.aim(axis);
        }
        Some(walk)
    }

    /// The distance behind which every `t` is larger than this one, its rounding included.
    #[inline(always)]
    pub(crate) fn distance(&self, t: f32) -> f32 {
        round((f64::from(t.next_up()) - self.start) * self.scale)
    }

    /// Enters the next cell, unless the ray leaves the grid or has `limit` behind it by then.
    ///
    /// Every call moves one axis towards its end, whatever the floats say: a walk takes at most as
    /// many steps as the three resolutions sum up to.
    #[inline(always)]
    pub(crate) fn advance(&mut self, limit: f32) -> bool {
        let [x, y, z] = self.next;
        // One arm for each axis: an axis chosen at run time would keep the walk in memory.
        if x < y && x < z {
            self.step::<0>(limit)
        } else if y < z {
            self.step::<1>(limit)
        } else {
            self.step::<2>(limit)
        }
    }

    #[inline(always)]
    fn step<const AXIS: usize>(&mut self, limit: f32) -> bool {
        if limit <= self.next[AXIS] {
            return false;
        }
        self.cell[AXIS] = self.cell[AXIS].wrapping_add(self.step[AXIS]);
        self.aim(AXIS);
        self.cell[AXIS] != self.outside[AXIS]
    }

    /// Computes the distance to the next border on an axis from the cell.
    #[inline(always)]
    fn aim(&mut self, axis: usize) {
        self.next[axis] = self.base[axis] + as_f32(self.cell[axis]) * self.delta[axis];
    }
}
