//! Rays that are hard on a mesh: along its edges, through its corners, off its surfaces.

use hgrid_core::{Hit, Ray};
use hgrid_tests::meshes::Mesh;
use hgrid_tests::random::Random;

type Point = [f32; 3];

/// A mesh and the box of its vertices, to aim rays at.
#[derive(Debug)]
pub(crate) struct Aims<'m> {
    mesh: &'m Mesh,
    low: Point,
    high: Point,
}

impl<'m> Aims<'m> {
    pub(crate) fn new(mesh: &'m Mesh) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let used = mesh.indices.iter().flatten().map(|&v| mesh.positions[v as usize]);
        for p in used.filter(|p| p.iter().all(|c| c.abs() < 1e36)) {
            for k in 0..3 {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        if low[0] > high[0] {
            (low, high) = ([-1.0; 3], [1.0; 3]);
        }
        Self { mesh, low, high }
    }

    /// Returns a point in the box, after scaling the box by `factor` about its centre.
    fn inside(&self, random: &mut Random, factor: f32) -> Point {
        std::array::from_fn(|k| {
            let (center, half) =
                (self.low[k] / 2.0 + self.high[k] / 2.0, self.high[k] / 2.0 - self.low[k] / 2.0);
            center + half * factor * (2.0 * random.unit() - 1.0)
        })
    }

    fn extent(&self) -> f32 {
        (0..3).map(|k| self.high[k] - self.low[k]).fold(f32::MIN_POSITIVE, f32::max)
    }

    fn triangle(&self, random: &mut Random) -> [Point; 3] {
        match self.mesh.indices.len() {
            0 => [self.low, self.high, self.low],
            count => {
                self.mesh.indices[random.below(count)].map(|v| self.mesh.positions[v as usize])
            }
        }
    }

    /// Returns a point of a triangle as f32 rounds it: a corner, on an edge, or anywhere on it.
    fn on_surface(&self, random: &mut Random) -> Point {
        let [a, b, c] = self.triangle(random);
        match random.below(4) {
            0 => a,
            1 => between(a, b, 0.5),
            2 => between(a, b, random.unit()),
            _ => between(between(a, b, random.unit()), c, random.unit()),
        }
    }

    /// Returns a random ray. `last` is an earlier ray with its closest hit.
    pub(crate) fn ray(&self, random: &mut Random, last: Option<&(Ray, Hit)>) -> Ray {
        let mut ray = match random.below(16) {
            0 | 1 => towards(self.inside(random, 2.0), self.inside(random, 1.0)),
            2..=4 => towards(self.inside(random, 2.0), self.on_surface(random)),
            5 => towards(self.on_surface(random), self.on_surface(random)),
            6 => towards(self.on_surface(random), self.inside(random, 1.0)),
            7 => self.along_edge(random),
            8 | 9 => self.along_axis(random),
            10 => self.far_off(random),
            11 => self.in_plane(random),
            12 => Ray::new(self.on_surface(random), self.normal(random)),
            13 => Ray::new(self.inside(random, 1.5), random.point()),
            _ => match last {
                Some((ray, hit)) => return self.next(random, ray, hit),
                None => towards(self.inside(random, 1.5), self.on_surface(random)),
            },
        };
        self.stretch(random, &mut ray);
        self.limit(random, &mut ray);
        if random.below(200) == 0 {
            spoil(random, &mut ray);
        }
        ray
    }

    /// Returns a ray along the line of an edge, which starts outside the edge, at a corner or between the corners.
    fn along_edge(&self, random: &mut Random) -> Ray {
        let [a, b, _] = self.triangle(random);
        let before = [1.0, 0.0, -0.5, 16.0][random.below(4)];
        let direction: Point = std::array::from_fn(|k| b[k] - a[k]);
        Ray::new(std::array::from_fn(|k| a[k] - before * direction[k]), direction)
    }

    /// Returns a ray in the plane of a triangle, as far as f32 can express it.
    fn in_plane(&self, random: &mut Random) -> Ray {
        let [a, b, c] = self.triangle(random);
        let [s, t] = [0, 1].map(|_| (random.below(9) as f32 - 4.0) / 2.0);
        let origin: Point = std::array::from_fn(|k| a[k] + (b[k] - a[k]) * s + (c[k] - a[k]) * t);
        towards(origin, between(b, c, [0.0, 0.5, 1.0][random.below(3)]))
    }

    /// Returns a ray along one or two axes through a point of the surface, with zeros of both signs.
    fn along_axis(&self, random: &mut Random) -> Ray {
        let (target, axis) = (self.on_surface(random), random.below(3));
        let mut origin = target;
        let mut direction = [0, 1, 2].map(|_| [0.0, -0.0][random.below(2)]);
        let side = [1.0, -1.0][random.below(2)];
        direction[axis] = side * self.extent();
        origin[axis] -= side * self.extent() * [0.0, 0.5, 2.0][random.below(3)];
        if random.below(3) == 0 {
            let other = (axis + 1) % 3;
            direction[other] = [1.0, -1.0, 1e-30, 1e-45][random.below(4)] * self.extent();
        }
        Ray::new(origin, direction)
    }

    /// Returns a ray from up to 2^60 extents away.
    fn far_off(&self, random: &mut Random) -> Ray {
        let target = self.on_surface(random);
        let far = self.extent() * 2_f32.powi(random.below(60) as i32);
        let side = random.point();
        let origin = std::array::from_fn(|k| (target[k] + side[k] * far).clamp(-3e38, 3e38));
        towards(origin, target)
    }

    fn normal(&self, random: &mut Random) -> Point {
        let [a, b, c] = self.triangle(random);
        let scale = 1.0 / self.extent().clamp(1e-30, 1e30);
        let [d, e] = [b, c].map(|p| -> Point { std::array::from_fn(|k| (p[k] - a[k]) * scale) });
        std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            d[i] * e[j] - d[j] * e[i]
        })
    }

    /// Returns a ray that a renderer traces after a hit, or this one with a range that ends at the hit or next to it.
    fn next(&self, random: &mut Random, ray: &Ray, hit: &Hit) -> Ray {
        let (t, before, behind) = (hit.t, hit.t.next_down(), hit.t.next_up());
        let (t_min, t_max) = match random.below(9) {
            0 => (t, t),
            1 => (ray.t_min, t),
            2 => (t, ray.t_max),
            3 => (ray.t_min, before),
            4 => (behind, ray.t_max),
            5 => (before, behind),
            6 => (-t.abs(), t),
            _ => {
                let origin = std::array::from_fn(|k| ray.origin[k] + t * ray.direction[k]);
                let mut next = towards(origin, self.inside(random, 1.0));
                if random.below(2) == 0 {
                    next = towards(origin, self.on_surface(random));
                    next.t_max = 1.0;
                }
                return next;
            }
        };
        Ray { t_min, t_max, ..*ray }
    }

    /// Changes the length of the direction; the line stays almost the same.
    fn stretch(&self, random: &mut Random, ray: &mut Ray) {
        let by = match random.below(8) {
            0 => 2_f32.powi(random.below(200) as i32 - 100),
            1 => 3.0 / self.extent(),
            2 => 2_f32.powi(-140) / self.extent().max(1e-3),
            _ => return,
        };
        let stretched = ray.direction.map(|c| c * by);
        if stretched.iter().all(|c| c.is_finite()) {
            ray.direction = stretched;
        }
    }

    fn limit(&self, random: &mut Random, ray: &mut Ray) {
        match random.below(16) {
            0 => ray.t_max = 1.0,
            1 => ray.t_max = 1_f32.next_down(),
            2 => ray.t_min = f32::NEG_INFINITY,
            3 => (ray.t_min, ray.t_max) = (-1.0, 1.0),
            4 => (ray.t_min, ray.t_max) = (0.0, 0.0),
            5 => ray.t_min = 1.0,
            6 => ray.t_min = -1e-30,
            7 => ray.t_max = 2.0 * random.unit(),
            _ => {}
        }
    }
}

/// Makes a ray invalid, or nearly so.
fn spoil(random: &mut Random, ray: &mut Ray) {
    match random.below(6) {
        0 => ray.origin[random.below(3)] = [f32::NAN, f32::INFINITY][random.below(2)],
        1 => ray.direction[random.below(3)] = [f32::NAN, f32::NEG_INFINITY][random.below(2)],
        2 => ray.direction = [0.0, -0.0, 0.0],
        3 => ray.t_min = f32::NAN,
        4 => (ray.t_min, ray.t_max) = (1.0, 0.5),
        _ => (ray.t_min, ray.t_max) = (f32::INFINITY, f32::INFINITY),
    }
}

fn towards(origin: Point, target: Point) -> Ray {
    Ray::new(origin, std::array::from_fn(|k| target[k] - origin[k]))
}

fn between(a: Point, b: Point, part: f32) -> Point {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * part)
}
