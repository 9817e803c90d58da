//! Sorts the rays of a batch for groups, and remembers their places in the caller's order.
//!
//! ```text
//! window  as many rays as there is memory for, 16 bytes each
//! key     octant of the direction | cell of the origin in Morton order | direction in the octant
//! sort    by key, where keys are equal by place: two passes over digits of nine bits
//! ```
//!
//! Rays that follow one another then start near each other and go the same way, so that a group of them shares most of
//! its nodes, and the next group finds them in the cache. Rays that are near each other as they are given are not
//! sorted, nor are too few rays for groups to share anything: there sorting costs more than it gains.

use super::group::Together;
use super::per_ray::GROUP;
use crate::aabb::Aabb;
use crate::ray::Ray;

/// A ray that is sorted: its key above its place in the window.
pub(crate) type SortKey = u64;

/// Bits of a cell on each axis, and cells.
const CELL_BITS: u32 = 4;
const CELLS: f32 = 16.0;
/// Bits of a key below its cell.
const WITHIN_BITS: u32 = 3;
/// Bits of a digit: a key has two digits.
const DIGIT_BITS: u32 = 9;
const DIGITS: usize = 1 << DIGIT_BITS;

const _: () = assert!(3 + 3 * CELL_BITS + WITHIN_BITS == 2 * DIGIT_BITS);

/// Sorting pays if the coarse cells in which rays start, four on each axis, have at least this many rays on average.
const ENOUGH: usize = 2 * GROUP;

/// The stride at which rays of a group are sampled to tell whether it is scattered. It is odd, so that rays which start
/// at two or four places in turn count as scattered.
const SAMPLE: usize = GROUP / 4 + 1;

/// The rays of a window in order, and which of them wait until all others are done.
pub(crate) struct Sorted<'m> {
    order: &'m [SortKey],
    /// The deferred rays, by place in the window.
    waiting: &'m mut [SortKey],
}

/// The bit of a deferred ray; the bits below it hold the triangle of its first hit, or `INVALID_ID`.
const WAITS: SortKey = 1 << 32;

impl Sorted<'_> {
    /// Notes that the ray at a place of the window waits, and a triangle.
    pub(crate) fn defer(&mut self, place: usize, id: u32) {
        if let Some(slot) = self.waiting.get_mut(place) {
            *slot = WAITS | SortKey::from(id);
        }
    }

    /// The rays that wait, by ascending place, with their triangles. Only for a batch that keeps its order:
    /// otherwise this memory holds something else.
    #[expect(clippy::cast_possible_truncation, reason = "the low half")]
    pub(crate) fn deferred(&self) -> impl Iterator<Item = (usize, u32)> {
        let waiting = self.waiting.iter().enumerate().filter(|(_, slot)| **slot & WAITS != 0);
        waiting.map(|(place, slot)| (place, *slot as u32))
    }

    /// Returns the place in the window of ray `at` of the order.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the low half")]
    pub(crate) fn place(&self, at: usize) -> usize {
        self.order.get(at).map_or(0, |&entry| entry as u32) as usize
    }
}

/// Returns the number of rays that memory is enough to sort at once.
#[inline(always)]
pub(crate) const fn window(memory: &[SortKey]) -> usize {
    let rays = memory.len() / 2;
    if rays > i32::MAX as usize { i32::MAX as usize } else { rays }
}

/// Sorts `count` rays of a batch from `first` on, no more than a [`window`]; `None` if they are better taken as given.
///
/// Out of line: its counts take stack only while rays are sorted.
#[inline(never)]
pub(crate) fn sort<'m>(
    batch: &impl Together,
    first: usize,
    count: usize,
    bounds: &Aabb,
    memory: &'m mut [SortKey],
) -> Option<Sorted<'m>> {
    if !are_scattered(batch, first, count, bounds) {
        return None;
    }
    let (sorted, spare) = memory.split_at_mut(memory.len() / 2);
    let (sorted, spare) = (sorted.get_mut(..count)?, spare.get_mut(..count)?);
    // Compute the keys, and count the digits of both passes.
    let cells = Cells::of(bounds);
    let (mut low, mut high) = ([0_u32; DIGITS], [0_u32; DIGITS]);
    let mut met = 0_u64;
    for (at, (place, entry)) in (0..).zip((first..).zip(&mut *sorted)) {
        let key = cells.key(&batch.ray(place));
        *entry = u64::from(key) << 32 | at;
        met |= 1 << (key >> (WITHIN_BITS + 3 * (CELL_BITS - 2)) & 63);
        low[digit(*entry, 0)] += 1;
        high[digit(*entry, 1)] += 1;
    }
    if count < ENOUGH * met.count_ones() as usize {
        return None;
    }
    pass(sorted, spare, &mut low, 0);
    pass(spare, sorted, &mut high, 1);
    if batch.keeps_order() {
        spare.fill(0);
    }
    Some(Sorted { order: sorted, waiting: spare })
}

/// Returns true if rays that follow one another start far from each other, in more than a quarter of the groups.
fn are_scattered(batch: &impl Together, first: usize, count: usize, bounds: &Aabb) -> bool {
    let far = bounds.size().max_element() / 4.0;
    let (mut groups, mut scattered) = (0, 0);
    for start in (0..count).step_by(GROUP) {
        let origin = batch.ray(first + start).origin;
        let is_far = |at: usize| {
            let other = batch.ray(first + at).origin;
            origin.iter().zip(other).any(|(a, b)| (a - b).abs() > far)
        };
        let mut others = (start..count.min(start + GROUP)).step_by(SAMPLE).skip(1);
        groups += 1;
        scattered += usize::from(others.any(is_far));
    }
    4 * scattered > groups
}

/// Sorts rays by one digit of their keys, stably.
fn pass(from: &[SortKey], to: &mut [SortKey], counts: &mut [u32; DIGITS], number: u32) {
    let mut next = 0;
    for count in counts.iter_mut() {
        next += core::mem::replace(count, next);
    }
    for &key in from {
        let next = &mut counts[digit(key, number)];
        if let Some(slot) = to.get_mut(*next as usize) {
            *slot = key;
        }
        *next += 1;
    }
}

/// The lower or the upper digit of a key.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "nine bits")]
const fn digit(key: SortKey, number: u32) -> usize {
    (key >> (32 + DIGIT_BITS * number)) as usize % DIGITS
}

/// The cells of a box.
struct Cells {
    min: [f32; 3],
    rate: [f32; 3],
}

impl Cells {
    fn of(bounds: &Aabb) -> Self {
        let rate = bounds.size().to_array().map(|size| CELLS / size);
        Self { min: bounds.min.to_array(), rate }
    }

    /// The key of any ray, also of an invalid one or one that starts outside.
    #[inline(always)]
    fn key(&self, ray: &Ray) -> u32 {
        let Ray { origin, direction, .. } = ray;
        let (mut octant, mut cell, mut within) = (0, 0, 0);
        let [x, y, z] = direction.map(f32::abs);
        let half = 0.5 * x.max(y).max(z);
        for axis in 0..3 {
            let is_negative = direction[axis].to_bits() >> 31;
            let is_steep = u32::from(direction[axis].abs() > half);
            octant |= is_negative << axis;
            within |= is_steep << axis;
            let at = (origin[axis] - self.min[axis]) * self.rate[axis];
            // NaN is cell 0.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let at = at.clamp(0.0, CELLS - 1.0) as u32;
            // Two zeros between the bits: abcd to a00b00c00d.
            let at = (at | at << 4) & 0xc3;
            let at = (at | at << 2) & 0x249;
            cell |= at << axis;
        }
        octant << (3 * CELL_BITS + WITHIN_BITS) | cell << WITHIN_BITS | within
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use glam::Vec3A;

    use super::*;
    use crate::ray::Hit;

    const BOUNDS: Aabb = Aabb { min: Vec3A::ZERO, max: Vec3A::ONE };

    struct Rays(Vec<Ray>);

    impl Together for Rays {
        fn count(&self) -> usize {
            self.0.len()
        }

        fn ray(&self, place: usize) -> Ray {
            self.0[place]
        }

        fn found(&mut self, _: usize, _: usize, _: &Hit) {}

        fn alone(&mut self, _: usize) {}

        fn keeps_order(&self) -> bool {
            true
        }

        fn asks(&self, _: &Hit) -> bool {
            false
        }

        fn ask(&mut self, _: usize, _: &Hit) {}
    }

    /// Rays that start around some points in turn and go anywhere.
    #[expect(clippy::cast_precision_loss, reason = "24 bits")]
    fn scattered(count: usize, points: usize) -> Rays {
        let mut state = 3_u64;
        let mut random = || {
            state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
            (state >> 40) as f32 / 16_777_216.0
        };
        let points: Vec<_> = (0..points).map(|_| [0; 3].map(|_| random())).collect();
        let ray = |at: usize| {
            let origin = points[at % points.len()].map(|c| c + 0.01 * random());
            Ray::new(origin, [0; 3].map(|_| random() - 0.5))
        };
        Rays((0..count).map(ray).collect())
    }

    #[test]
    fn every_ray_has_one_place_in_the_order_of_keys_then_places() {
        for (first, count) in [(0, 512), (0, 3000), (7, 2500)] {
            let mut rays = scattered(3000, 2);
            for (at, odd) in [f32::NAN, f32::INFINITY, -1e30, 1e30].into_iter().enumerate() {
                rays.0[1000 + at].origin[at % 3] = odd;
                rays.0[2000 + at].direction[at % 3] = odd;
            }
            let mut memory = vec![0xa5a5; 2 * count + 3];
            let mut sorted = sort(&rays, first, count, &BOUNDS, &mut memory).expect("scattered");
            let places: Vec<_> = (0..count).map(|at| sorted.place(at)).collect();
            let cells = Cells::of(&BOUNDS);
            let key = |place: usize| (cells.key(&rays.ray(first + place)), place);
            assert!(places.windows(2).all(|pair| key(pair[0]) < key(pair[1])));
            assert!(places.iter().all(|&place| place < count));
            assert!(key(0).0 >> (2 * DIGIT_BITS) == 0);

            // Rays wait by place, whatever order they come in.
            for (place, id) in [(7, 3), (2, u32::MAX), (count - 1, 0)] {
                sorted.defer(place, id);
            }
            let deferred: Vec<_> = sorted.deferred().collect();
            assert_eq!(deferred, [(2, u32::MAX), (7, 3), (count - 1, 0)]);
        }
    }

    #[test]
    fn rays_that_gain_nothing_stay_as_they_are() {
        let memory = &mut vec![0; 6000];
        // The rays are too few for so many places, or start near each other, or there are none.
        assert!(sort(&scattered(512, 400), 0, 512, &BOUNDS, memory).is_none());
        assert!(sort(&scattered(3000, 1), 0, 3000, &BOUNDS, memory).is_none());
        assert!(sort(&Rays(Vec::new()), 0, 0, &BOUNDS, memory).is_none());
        // Rays of a camera start at one point, however many there are.
        let camera = Rays(vec![Ray::new([0.5; 3], [1.0; 3]); 3000]);
        assert!(sort(&camera, 0, 3000, &BOUNDS, memory).is_none());
    }

    #[test]
    fn a_window_is_half_of_the_memory() {
        assert_eq!([0, 1, 2, 5].map(|words| window(&vec![0; words])), [0, 0, 1, 2]);
    }
}
