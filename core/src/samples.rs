//! Triangles and lines that pass them closely, for tests; the same in every run.

use crate::aabb::greater;
use crate::mesh::Triangle;
use crate::ray::round;

/// Random numbers as in Marsaglia's xorshift.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.bits() >> 32) as usize % end
    }

    /// From -1 to 1; now and then one of few numbers, so that rays meet edges exactly.
    pub(crate) fn coordinate(&mut self) -> f32 {
        let fine = f64::from((self.bits() >> 32) as u32) / f64::from(1_u32 << 31) - 1.0;
        round(if self.below(3) == 0 { (fine * 4.0).round() / 4.0 } else { fine })
    }

    pub(crate) fn point(&mut self) -> [f32; 3] {
        [self.coordinate(), self.coordinate(), self.coordinate()]
    }
}

/// `a + share * b`.
pub(crate) fn along(a: [f32; 3], b: [f32; 3], share: f32) -> [f32; 3] {
    core::array::from_fn(|axis| a[axis] + b[axis] * share)
}

/// Triangles of all shapes in the box from -1 to 1: any, small, slivers, needles, flat on an axis, without area.
pub(crate) fn triangle(random: &mut Random) -> Triangle {
    let [a, b, c] = [random.point(), random.point(), random.point()];
    let share = [1.0, 1e-2, 1e-4, 1e-6, 1e-9, 1e-20][random.below(6)];
    let a = a.map(|coordinate| coordinate * 0.5);
    match random.below(8) {
        0 => [a, along(a, b, 0.5), along(a, along(b, c, share), 0.25)],
        1 => [a, along(a, b, 0.5), along(along(a, b, 0.2), c, 0.2 * share)],
        2 => {
            let axis = random.below(3);
            [a, along(a, b, share * 0.5), along(a, c, share * 0.5)].map(|mut corner| {
                corner[axis] = a[axis];
                corner
            })
        }
        3 => [a, along(a, b, 0.5), a],
        4 => [a.map(|coordinate| coordinate * share), b, c],
        _ => [a, along(a, b, share * 0.5), along(a, c, share * 0.5)],
    }
}

/// A line that passes a triangle at a point of it, closely or not, from nearby or afar: where
/// it starts and its direction.
pub(crate) fn line(random: &mut Random, [a, b, c]: &Triangle) -> ([f32; 3], [f32; 3]) {
    let ab: [f32; 3] = core::array::from_fn(|axis| b[axis] - a[axis]);
    let ac: [f32; 3] = core::array::from_fn(|axis| c[axis] - a[axis]);
    let shares = [0.0, 1.0, 0.5, 0.25, 0.3, 1e-7, -1e-7];
    let (u, v) = (shares[random.below(7)], shares[random.below(7)]);
    let target = along(along(*a, ab, u), ac, v);
    let beside = [0.0, 1e-8, 1e-5, 1e-2, 1.0][random.below(5)];
    let target = along(target, random.point(), beside);
    let distance = [1.0, 0.1, 1e-3, 4.0][random.below(4)];
    let mut direction = random.point();
    match random.below(6) {
        // Along an edge or in the plane; along an axis; nearly along it.
        0 => direction = ab,
        1 => direction = along(ab, ac, 0.7),
        2 => direction = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]][random.below(3)],
        3 => {
            let axis = random.below(3);
            direction = direction.map(|d| d * 1e-7);
            direction[axis] = 1.0;
        }
        _ => {}
    }
    let origin = along(target, direction, -distance);
    if random.below(2) == 0 {
        direction = core::array::from_fn(|axis| target[axis] - origin[axis]);
    }
    (origin, direction)
}

/// The largest magnitude of a coordinate.
pub(crate) fn largest(points: &[[f32; 3]]) -> f32 {
    points.iter().flatten().fold(0.0, |largest, x| greater(largest, x.abs()))
}
