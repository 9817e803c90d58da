//! The hits of a ray, decided without rounding and without a line of the library.
//!
//! The documentation of `Hit` and the head of core/src/triangle.rs are the rule:
//!
//! ```text
//! z is the axis along which the direction is longest, of equally long ones the last
//! a corner's place     z = p.z - o.z, x = (p.x - o.x) - d.x / d.z * z, y likewise: every operation in f64
//! inside               the edge functions of the places have no two opposite signs and are not all 0
//! in the range         t_min <= T <= t_max, T where the line meets the plane of the corners as they are
//! grazed               nor are all corners outside, nor is the t of the places by more than 2^-21 Z + 2^-49 T,
//!                      where T is the largest |t| of a corner
//! ```
//!
//! The rule defines the places as f64 data. Everything that follows from them is decided in f64 with a proved
//! error where that is enough, and with [`Dyadic`] numbers where it is not. [`Line::holds_places`] shows
//! without rounding that the places are where the documentation says: within 2^-50 L of those of the corners.

use std::cmp::Ordering;

use hgrid_core::{Hit, MAX_COORDINATE, Ray};

use crate::dyadic::Dyadic;

type Corners = [[f32; 3]; 3];

/// The rule's answer about a ray and a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// A miss.
    Miss,
    /// A hit.
    Hit,
    /// The rule leaves it open: rounding decides, within the errors that are documented.
    Either,
}

/// A ray that can hit something.
#[derive(Debug)]
pub struct Line {
    /// The axes, the longest last.
    axes: [usize; 3],
    origin: [f64; 3],
    direction: [f64; 3],
    shear: [f64; 2],
    /// The range, cut to finite numbers.
    range: [f64; 2],
}

/// A corner's position across the ray, and its distance along it.
type Place = [f64; 3];

impl Line {
    /// Returns `None` for a ray that can hit nothing.
    #[must_use]
    pub fn new(ray: &Ray) -> Option<Self> {
        let Ray { origin, t_min, direction, t_max } = *ray;
        let is_ray = origin.iter().chain(&direction).all(|c| c.is_finite())
            && direction.iter().any(|&c| c != 0.0)
            && t_min <= t_max;
        if !is_ray {
            return None;
        }
        let longest = direction.iter().map(|c| c.abs()).fold(0.0, f32::max);
        let last = (0..3).rfind(|&axis| direction[axis].abs() >= longest)?;
        let axes = [(last + 1) % 3, (last + 2) % 3, last];
        let [o, d] = [origin, direction].map(|v| axes.map(|axis| f64::from(v[axis])));
        let range = [f64::from(t_min.max(-f32::MAX)), f64::from(t_max.min(f32::MAX))];
        Some(Self { axes, origin: o, direction: d, shear: [d[0] / d[2], d[1] / d[2]], range })
    }

    /// Returns a corner with the ray's longest axis as the last.
    // `turned`, `places` and `passes` use no closures over arrays: brute force is most of the time of many tests.
    fn turned(&self, corner: [f32; 3]) -> [f64; 3] {
        let [x, y, z] = self.axes;
        [corner[x].into(), corner[y].into(), corner[z].into()]
    }

    fn place(&self, corner: [f32; 3]) -> Place {
        let p = self.turned(corner);
        let z = p[2] - self.origin[2];
        let across = |k: usize| (p[k] - self.origin[k]) - self.shear[k] * z;
        [across(0), across(1), z]
    }

    fn places(&self, &[a, b, c]: &Corners) -> [Place; 3] {
        [self.place(a), self.place(b), self.place(c)]
    }

    /// Returns the rule's answer about a triangle.
    #[must_use]
    pub fn answer(&self, corners: &Corners) -> Answer {
        if self.passes(corners) { self.answer_of_passed(corners) } else { Answer::Miss }
    }

    /// Returns the rule's answer about a triangle that the whole line passes through.
    #[must_use]
    pub fn answer_of_passed(&self, corners: &Corners) -> Answer {
        self.range_answer(corners, &self.places(corners))
    }

    /// Returns true if the whole line, whatever the ray's range, passes through a triangle.
    #[must_use]
    pub fn passes(&self, corners: &Corners) -> bool {
        // A NaN is not small enough.
        let is_small = |[x, y, z]: [f32; 3]| {
            x.abs() <= MAX_COORDINATE && y.abs() <= MAX_COORDINATE && z.abs() <= MAX_COORDINATE
        };
        let [a, b, c] = *corners;
        if !(is_small(a) && is_small(b) && is_small(c)) {
            return false;
        }
        let places = self.places(corners);
        // A triangle that lies on one side of the line does not surround it: then two edge functions have
        // opposite signs, or all are 0.
        let [a, b, c] = &places;
        let is_beside = |k: usize| {
            (a[k] < 0.0 && b[k] < 0.0 && c[k] < 0.0) || (a[k] > 0.0 && b[k] > 0.0 && c[k] > 0.0)
        };
        if is_beside(0) || is_beside(1) {
            return false;
        }
        let signs = edges(&places).map(|(p, q)| edge_sign(p, q));
        let has = |sign| signs.contains(&sign);
        has(Ordering::Less) != has(Ordering::Greater)
    }

    /// Returns true if a triangle that the line passes through shows its front.
    #[must_use]
    pub fn sees_front(&self, corners: &Corners) -> bool {
        let signs = edges(&self.places(corners)).map(|(p, q)| edge_sign(p, q));
        signs.contains(&Ordering::Greater) == (self.direction[2] > 0.0)
    }

    /// Returns the positions of the range's ends and of the corners along the ray, ascending, in units of the
    /// longest axis.
    fn along(&self, places: &[Place; 3]) -> ([f64; 2], [f64; 3]) {
        // Products of two f32 numbers: exact.
        let ends = self.range.map(|t| t * self.direction[2].abs());
        (ends, places.map(|place| place[2] * self.direction[2].signum()))
    }

    fn range_answer(&self, corners: &Corners, places: &[Place; 3]) -> Answer {
        let ([from, to], along) = self.along(places);
        // Rounding is monotonic and the ends are exact, so these comparisons hold without rounding, too.
        if along.iter().all(|&z| from < z && z < to) {
            return Answer::Hit;
        }
        if along.iter().all(|&z| z < from) || along.iter().all(|&z| z > to) {
            return Answer::Miss;
        }
        let sides = [0, 1].map(|end| self.meets(corners, self.range[end]));
        let [Some(first), Some(last)] = sides else {
            // If there is no plane, or the line lies in it, the places decide.
            return self.places_answer(places, [0.0; 2]);
        };
        // If an end lies beyond all corners, so do all points between them.
        let is_ahead = along.iter().all(|&z| from < z);
        let is_before = along.iter().all(|&z| z < to);
        let is_in =
            (is_ahead || first != Ordering::Less) && (is_before || last != Ordering::Greater);
        match self.places_answer(places, [2_f64.powi(-21), 2_f64.powi(-49)]) {
            Answer::Miss => Answer::Miss,
            _ if !is_in => Answer::Miss,
            answer => answer,
        }
    }

    /// Returns a hit if the t of the places lies in the range, or no farther outside than a share of the corners' range
    /// and one of the largest t of a corner. That t is rounded: next to the limit the answer is `Either`.
    fn places_answer(&self, places: &[Place; 3], [of_width, of_largest]: [f64; 2]) -> Answer {
        let ([from, to], along) = self.along(places);
        let along = along.map(Dyadic::new);
        let [low, high] = extremes(&along);
        let width = &high - &low;
        let [_, largest] = extremes(&along.clone().map(Dyadic::abs));
        let outside = &(&width * &Dyadic::new(of_width)) + &(&largest * &Dyadic::new(of_largest));
        let weights = exact_edges(places).map(Dyadic::abs);
        let area = &(&weights[0] + &weights[1]) + &weights[2];
        let depth = dot(&weights, &along);
        // Multiply everything by the area, which is positive.
        let least = &(&Dyadic::new(from) - &outside) * &area;
        let most = &(&Dyadic::new(to) + &outside) * &area;
        // The weights are off by 2^-41 of themselves. Their mean has seven roundings, its comparison one: 2^-50, and
        // a little of second order.
        let roundings = &largest.clone().scaled(-50) + &largest.scaled(-90);
        let error = &(&width.scaled(-38) + &roundings) * &area;
        let margin = &depth - &least;
        let other = &most - &depth;
        if margin < -error.clone() || other < -error.clone() {
            Answer::Miss
        } else if margin < error || other < error {
            Answer::Either
        } else {
            Answer::Hit
        }
    }

    /// Compares T, where the line meets the plane of the corners, with `t`; `None` if they do not meet in one point.
    fn meets(&self, corners: &Corners, t: f64) -> Option<Ordering> {
        let exact = |v: [f64; 3]| v.map(Dyadic::new);
        let [a, b, c] = corners.map(|corner| exact(self.turned(corner)));
        let (origin, direction) = (exact(self.origin), exact(self.direction));
        let normal = cross(&minus(&b, &a), &minus(&c, &a));
        let slope = dot(&normal, &direction);
        // T slope = normal * (a - origin), so T - t has the sign of normal * (a - origin) - t slope.
        let rest = &dot(&normal, &minus(&a, &origin)) - &(&Dyadic::new(t) * &slope);
        match slope.sign() {
            Ordering::Less => Some(rest.sign().reverse()),
            Ordering::Equal => None,
            Ordering::Greater => Some(rest.sign()),
        }
    }

    /// Returns true if the numbers of a hit are as exact as documented: `u` and `v` to (2^-24 + 2^-38) of
    /// their value, `t` to 2^-24 |t| + 2^-38 (|t| + Z), all to 2^-149. The `t` must lie in the range; if a
    /// grazed triangle's `t` would not, it is the end of the range.
    #[must_use]
    pub fn holds_numbers(&self, corners: &Corners, hit: &Hit) -> bool {
        let [first, last] = self.range;
        let t = f64::from(hit.t);
        let is_in = first <= t && t <= last;
        let places = self.places(corners);
        is_in && (self.holds_surely(&places, hit) || self.holds_exactly(&places, hit))
    }

    /// Decides the same in f64; returns true if it holds by a margin.
    ///
    /// Where no edge function is smaller than 2^-9 of its products, it is off by 2^-43 of its value, and so is
    /// the sum, because all have one sign. A weight is off by 2^-41, and t by 2^-40 of the largest |t| of a
    /// corner, which is no more than |t| + Z. So half of the error allowed for each is enough here.
    fn holds_surely(&self, places: &[Place; 3], hit: &Hit) -> bool {
        let mut weights = [0.0; 3];
        for (weight, (p, q)) in weights.iter_mut().zip(edges(places)) {
            let (one, other) = (p[0] * q[1], p[1] * q[0]);
            *weight = one - other;
            if weight.abs() * 512.0 <= one.abs() + other.abs() && one.abs() + other.abs() > 0.0 {
                return false;
            }
        }
        let area: f64 = weights.iter().sum();
        let length = self.direction[2];
        let depths = places.map(|place| place[2]);
        let t = (0..3).map(|k| weights[k] * depths[k]).sum::<f64>() / area / length;
        let low = depths.iter().copied().fold(f64::INFINITY, f64::min);
        let high = depths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let reach = t.abs() + (high - low) / length.abs();
        let (digit, rest) = (2_f64.powi(-24), 2_f64.powi(-39));
        // Half of the smallest f32: rounding to nearest is off by no more.
        let least = 2_f64.powi(-150);
        let is_weight = |found: f32, weight: f64| {
            let value = weight / area;
            (f64::from(found) - value).abs() <= digit * value.abs() + rest * value.abs() + least
        };
        (f64::from(hit.t) - t).abs() <= digit * t.abs() + rest * reach + least
            && is_weight(hit.u, weights[1])
            && is_weight(hit.v, weights[2])
    }

    fn holds_exactly(&self, places: &[Place; 3], hit: &Hit) -> bool {
        let weights = exact_edges(places).map(Dyadic::abs);
        let area = &(&weights[0] + &weights[1]) + &weights[2];
        let least = Dyadic::new(1.0).scaled(-149);
        let part = &Dyadic::new(1.0).scaled(-24) + &Dyadic::new(1.0).scaled(-38);
        // Multiply by the area.
        let is_weight = |found: f32, weight: &Dyadic| {
            let off = (&(&Dyadic::new(found.into()) * &area) - weight).abs();
            off <= &(&part * weight) + &(&least * &area)
        };
        // Multiply by the area and the length of the direction.
        let depths = places.map(|place| Dyadic::new(place[2]));
        let [low, high] = extremes(&depths);
        let length = Dyadic::new(self.direction[2]);
        let scale = &area * &length;
        let t = dot(&weights, &depths);
        let width = &(&high - &low) * &area;
        let off = &(&Dyadic::new(hit.t.into()) * &scale) - &t;
        let allowed = &(&part * &t.abs()) + &width.scaled(-38);
        // Make the difference grow with t. A t beyond an end is cut there.
        let off = if scale.sign() == Ordering::Less { -off } else { off };
        let is_behind = off > Dyadic::new(0.0);
        let is_cut = f64::from(hit.t) == self.range[usize::from(!is_behind)];
        let is_t = is_cut || off.abs() <= &allowed + &(&least * &scale.abs());
        is_t && is_weight(hit.u, &weights[1]) && is_weight(hit.v, &weights[2])
    }

    /// Returns true if the places of a triangle's corners are within 2^-50 L of where the corners are; L is
    /// the largest difference of a coordinate between the origin and a corner.
    #[must_use]
    pub fn holds_places(&self, corners: &Corners) -> bool {
        let exact = |v: [f64; 3]| v.map(Dyadic::new);
        let (origin, direction) = (exact(self.origin), exact(self.direction));
        let from_origin = corners.map(|corner| minus(&exact(self.turned(corner)), &origin));
        let differences = from_origin.iter().flatten().map(|c| c.clone().abs());
        let most = differences.fold(Dyadic::new(0.0), |a, b| if a < b { b } else { a });
        let allowed = (&most.scaled(-50) * &direction[2]).abs();
        corners.iter().zip(&from_origin).all(|(corner, p)| {
            let place = self.place(*corner);
            (0..2).all(|k| {
                // Multiply by the direction's longest coordinate.
                let right = &(&p[k] * &direction[2]) - &(&direction[k] * &p[2]);
                let found = &Dyadic::new(place[k]) * &direction[2];
                (&found - &right).abs() <= allowed
            })
        })
    }
}

/// Returns the pairs of corners that define the weights of the three corners.
fn edges([a, b, c]: &[Place; 3]) -> [(Place, Place); 3] {
    [(*c, *b), (*a, *c), (*b, *a)]
}

/// Returns the sign of `p.x q.y - p.y q.x`.
///
/// Two products and a difference are off by 2^-53 of themselves, 2^-52 of the products in all: no place is
/// smaller than 2^-430 unless it is 0, so nothing underflows. Where that does not decide, the products are so
/// close that their difference is exact, and the rounding error of each product is an f64, too.
fn edge_sign(p: Place, q: Place) -> Ordering {
    let (one, other) = (p[0] * q[1], p[1] * q[0]);
    let edge = one - other;
    let size = one.abs() + other.abs();
    let compare = |a: f64, b: f64| a.partial_cmp(&b).expect("places are finite");
    if edge.abs() > 2_f64.powi(-51) * size || size == 0.0 {
        return compare(edge, 0.0);
    }
    // Take the sign of edge - (lost - kept). Rounding keeps the order, so only if both are equal does its
    // error matter (Knuth 1969: the error of a sum).
    let (kept, lost) = (p[0].mul_add(q[1], -one), p[1].mul_add(q[0], -other));
    let rounded = lost - kept;
    let part = lost - rounded;
    let error = (lost - (rounded + part)) + (part - kept);
    compare(edge, rounded).then(compare(0.0, error))
}

fn exact_edge(p: Place, q: Place) -> Dyadic {
    let ([px, py, _], [qx, qy, _]) = (p.map(Dyadic::new), q.map(Dyadic::new));
    &(&px * &qy) - &(&py * &qx)
}

fn exact_edges(places: &[Place; 3]) -> [Dyadic; 3] {
    edges(places).map(|(p, q)| exact_edge(p, q))
}

fn extremes([a, b, c]: &[Dyadic; 3]) -> [Dyadic; 2] {
    let low = if a < b { a } else { b };
    let high = if a < b { b } else { a };
    let low = if c < low { c } else { low };
    let high = if c > high { c } else { high };
    [low.clone(), high.clone()]
}

fn minus(a: &[Dyadic; 3], b: &[Dyadic; 3]) -> [Dyadic; 3] {
    std::array::from_fn(|k| &a[k] - &b[k])
}

fn dot(a: &[Dyadic; 3], b: &[Dyadic; 3]) -> Dyadic {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

fn cross(a: &[Dyadic; 3], b: &[Dyadic; 3]) -> [Dyadic; 3] {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        &(&a[i] * &b[j]) - &(&a[j] * &b[i])
    })
}

#[test]
fn edges_are_exact() {
    let mut random = crate::random::Random(7);
    let mut count = [0; 3];
    for round in 0..20_000 {
        let number = |random: &mut crate::random::Random| {
            let bits = random.bits() >> 12 | 1023 << 52;
            f64::from_bits(bits) * if random.below(2) == 0 { 1.0 } else { -1.0 }
        };
        let p = [number(&mut random), number(&mut random), 0.0];
        // Nearly a multiple of p, and now and then exactly one.
        let by = [1.0, 0.5, 3.0, number(&mut random)][round % 4];
        let off = [0.0, f64::EPSILON, -f64::EPSILON][random.below(3)];
        let q = [p[0] * by, p[1] * by * (1.0 + off), 0.0];
        let sign = edge_sign(p, q);
        assert_eq!(sign, exact_edge(p, q).sign(), "{p:?} {q:?}");
        count[(sign as i8 + 1) as usize] += 1;
    }
    assert!(count.iter().all(|&count| count > 1000), "{count:?}");
}
