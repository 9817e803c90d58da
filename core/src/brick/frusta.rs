//! What rays that go together cannot meet: triangles outside the planes around them.
//!
//! A cell is often wider than they are apart, and most of its triangles lie beside them. All rays
//! lie between chords on u and v ([`Bounds`]), each of which is a plane; a triangle whose corners
//! all lie behind one of them meets no ray. Eight triangles are compared with the planes around all
//! rays, and what is left with those of each row of sixteen, which are squares of 4 x 4 pixels
//! if a tile is in Morton order: half of them are far from a small triangle.
//!
//! Hits lie between the planes of k between which the chords hold, wherever the corners lie: behind
//! means behind there, and a triangle is on one side of a plane if its corners are.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8, f32x16, mask32x16};

use super::bundle::{BUNDLES, Bundle, RAYS, WIDTH, below_three};
use super::chords::Bounds;
use crate::eight::Eight;
use crate::mesh::Triangle;

/// Rows of rays, and planes around each of them.
const ROWS: usize = RAYS / WIDTH;
const PLANES: usize = 4;

/// The planes around rays that go together.
#[derive(Debug)]
pub(super) struct Frusta {
    /// The axes u, v and k.
    axes: [u8; 3],
    /// Where u, v and k are 0, in scene units, and how many cells a unit is.
    corner: [f32; 3],
    rate: [f32; 3],
    /// What is added on k: a mirrored one counts from the other end.
    offset: f32,
    /// How far off a triangle may be, in cells.
    margin: f32,
    whole: Bounds,
    /// For every row of each bundle its planes.
    rows: [Rows; BUNDLES],
}

/// A number for each plane of a bundle's rows.
type PerPlane = [f32; ROWS * PLANES];

/// For every row of a bundle its planes: what lies behind `a * u + b * v + c * k + d = 0` is outside.
/// Of each it is c and d; a and b say on which side it is, [`ON_U`] and [`ON_V`].
type Rows = [PerPlane; 2];

/// What is below, what is above.
const ON_U: PerPlane = sides([1.0, -1.0, 0.0, 0.0]);
const ON_V: PerPlane = sides([0.0, 0.0, 1.0, -1.0]);

/// The same for every row.
const fn sides(row: [f32; PLANES]) -> PerPlane {
    let mut sides = [0.0; ROWS * PLANES];
    let mut at = 0;
    while at < sides.len() {
        sides[at] = row[at % PLANES];
        at += 1;
    }
    sides
}

impl Frusta {
    /// Around nothing.
    pub(super) const EMPTY: Self = Self {
        axes: [0; 3],
        corner: [0.0; 3],
        rate: [0.0; 3],
        offset: 0.0,
        margin: 0.0,
        whole: Bounds::NONE,
        rows: [[[0.0; ROWS * PLANES]; 2]; BUNDLES],
    };

    /// Replaces the planes by those around the rays of bundles that run along the same axis, and are
    /// between chords between two planes of it.
    #[inline(always)]
    pub(super) fn surround<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        bundles: &[Bundle; N],
        planes: [f32; 2],
        whole: Bounds,
    ) {
        let Some(bundle) = bundles.first() else { return };
        let [u, v, k] = bundle.axes();
        self.axes = bundle.axes;
        let in_order = |xyz: [f32; 3]| [xyz[u], xyz[v], xyz[k]];
        self.corner = in_order(bundle.corner);
        self.rate = in_order(bundle.rate);
        self.offset = 0.0;
        if bundle.is_mirrored {
            self.rate[2] = -self.rate[2];
            self.offset = bundle.width;
        }
        // A ray is as far off as a triangle.
        self.margin = 2.0 * bundle.margin;
        self.whole = whole;
        for (bundle, [c, d]) in bundles.iter().zip(&mut self.rows) {
            for row in 0..ROWS {
                let bounds = Bounds::around(planes, &bundle.extremes(simd, planes, row..row + 1));
                for side in 0..2 {
                    let (low, high) = (bounds.low[side], bounds.high[side]);
                    let place = (row * PLANES + side * 2) % (ROWS * PLANES);
                    let next = (place + 1) % (ROWS * PLANES);
                    (c[place], d[place]) = (-low.slope, self.margin - low.start);
                    (c[next], d[next]) = (high.slope, self.margin + high.start);
                }
            }
        }
    }

    /// Those of eight triangles that rays may meet before a plane of k, as bits.
    #[inline(always)]
    pub(super) fn meet<S: Simd>(&self, simd: S, triangles: &Eight<S>, far: f32) -> u32 {
        let [u, v, k] = below_three(self.axes);
        let splat = |number: f32| f32x8::splat(simd, number);
        let place = |xyz: &[f32x8<S>; 3], axis: usize, side: usize| {
            (xyz[axis % 3] - splat(self.corner[side])) * splat(self.rate[side])
        };
        let [a, b, c] = &triangles.corners;
        let on_k = |xyz| place(xyz, k, 2) + splat(self.offset);
        let ks = [on_k(a), on_k(b), on_k(c)];
        let margin = splat(self.margin);
        let nearest = ks[0].min(ks[1]).min(ks[2]) - margin;
        let mut outside = nearest.simd_gt(splat(far));
        for (side, axis) in [u, v].into_iter().enumerate() {
            let at = [place(a, axis, side), place(b, axis, side), place(c, axis, side)];
            let (low, high) = (self.whole.low[side], self.whole.high[side]);
            // Written out: what is mapped over an array is called, operation by operation.
            let low = |k| k * splat(low.slope) + splat(low.start) - margin;
            let high = |k| k * splat(high.slope) + splat(high.start) + margin;
            outside |=
                at[0].simd_lt(low(ks[0])) & at[1].simd_lt(low(ks[1])) & at[2].simd_lt(low(ks[2]));
            outside |= at[0].simd_gt(high(ks[0]))
                & at[1].simd_gt(high(ks[1]))
                & at[2].simd_gt(high(ks[2]));
        }
        #[expect(clippy::cast_possible_truncation, reason = "eight bits")]
        let outside = outside.to_bitmask() as u32;
        !outside & triangles.used
    }

    /// The rays of a bundle that may meet a triangle, row by row.
    #[inline(always)]
    pub(super) fn rays<S: Simd>(&self, simd: S, bundle: usize, triangle: &Triangle) -> u64 {
        /// The rays of each set of rows.
        const RAYS_OF: [u64; 1 << ROWS] = {
            let mut rays = [0; 1 << ROWS];
            let mut set = 0;
            while set < rays.len() {
                let mut row = 0;
                while row < ROWS {
                    if set >> row & 1 == 1 {
                        rays[set] |= 0xffff << (row * WIDTH);
                    }
                    row += 1;
                }
                set += 1;
            }
            rays
        };
        let [p, q, r] = triangle;
        let rows = &self.rows[bundle % BUNDLES];
        let behind =
            self.behind(simd, rows, p) & self.behind(simd, rows, q) & self.behind(simd, rows, r);
        let planes = behind.to_bitmask();
        // A row is out if the triangle is behind one of its four planes.
        let planes = planes | planes >> 1;
        let planes = planes | planes >> 2;
        let out = planes & 1 | planes >> 3 & 2 | planes >> 6 & 4 | planes >> 9 & 8;
        RAYS_OF[(!out & 0xf) as usize]
    }

    /// Behind which planes of the rows a corner lies.
    #[inline(always)]
    fn behind<S: Simd>(&self, simd: S, rows: &Rows, corner: &[f32; 3]) -> mask32x16<S> {
        let [u, v, k] = below_three(self.axes);
        let [c, d] = rows;
        let row = |numbers: &PerPlane| f32x16::simd_from(simd, *numbers);
        let splat = |number: f32| f32x16::splat(simd, number);
        let u = (corner[u] - self.corner[0]) * self.rate[0];
        let v = (corner[v] - self.corner[1]) * self.rate[1];
        let k = (corner[k] - self.corner[2]) * self.rate[2] + self.offset;
        (row(&ON_U) * splat(u) + row(&ON_V) * splat(v) + row(c) * splat(k) + row(d))
            .simd_lt(splat(0.0))
    }
}
