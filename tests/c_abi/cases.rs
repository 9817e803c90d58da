//! One table of queries with answers by brute force, for every language: meshes, and for each of them
//! configurations, rays under options, and points.

use hgrid_core::{
    ClosestPoint, Config, Cull, Grid, Hit, INVALID_ID, Method, Parameters, Ray, Strided,
    TriangleMesh, Verdict,
};
use hgrid_tests::meshes::{Mesh, ball, one_triangle, soup};
use hgrid_tests::methods::configs;
use hgrid_tests::oracle::all_hits;
use hgrid_tests::owned::Owned;
use hgrid_tests::random::Random;

/// A mesh with its queries.
pub(crate) struct Case {
    mesh: Mesh,
    masks: Vec<u32>,
    pub(crate) configs: Vec<Config>,
    pub(crate) rays: Vec<Ray>,
    pub(crate) groups: Vec<Group>,
    pub(crate) points: Vec<Point>,
}

/// Options, and for each ray the hits that a filter is offered: from near to far, all that are not masked,
/// culled or skipped.
pub(crate) struct Group {
    pub(crate) mask: u32,
    pub(crate) cull: Cull,
    pub(crate) skip: u32,
    /// The rule of the filter, see [`verdict`]. Rule 0 is no filter at all.
    pub(crate) rule: u32,
    pub(crate) offered: Vec<Vec<Hit>>,
}

/// A point, and the point of the mesh that is closest to it.
pub(crate) struct Point {
    pub(crate) point: [f32; 3],
    pub(crate) max: f32,
    pub(crate) mask: u32,
    pub(crate) skip: u32,
    pub(crate) answer: Option<ClosestPoint>,
}

/// Returns the verdict of a rule's filter about a triangle. `answers.h` has the same in C.
pub(crate) fn verdict(rule: u32, primitive: u32) -> Verdict {
    match (rule, primitive) {
        (2, p) if p.is_multiple_of(5) => Verdict::AcceptAndStop,
        (2, p) if p.is_multiple_of(4) => Verdict::Reject,
        // Rule 3 returns an unknown value in C, which counts as a rejection.
        (1 | 3, p) if p.is_multiple_of(2) => Verdict::Reject,
        _ => Verdict::Accept,
    }
}

/// Returns the offered hits that count.
pub(crate) fn accepted(rule: u32, offered: &[Hit]) -> Vec<Hit> {
    let mut hits = Vec::new();
    for hit in offered {
        let verdict = verdict(rule, hit.primitive);
        if verdict != Verdict::Reject {
            hits.push(*hit);
        }
        if verdict == Verdict::AcceptAndStop {
            break;
        }
    }
    hits
}

impl Case {
    /// Returns the mesh in the library's form.
    pub(crate) fn view(&self) -> TriangleMesh<'_> {
        let view = self.mesh.view();
        if self.masks.is_empty() {
            return view;
        }
        view.with_masks(Strided::new(&self.masks)).expect("as many masks as triangles")
    }

    /// Makes the queries of a mesh and answers them.
    fn new(mesh: Mesh, has_masks: bool, seed: u64, configs: &[Config]) -> Self {
        let mut random = Random(seed);
        let masks = if has_masks { (0..).take(mesh.indices.len()).collect() } else { Vec::new() };
        let (rays, points) = (rays(&mesh, &mut random), points(&mesh, &mut random));
        let configs = configs.to_vec();
        let mut case = Self { mesh, masks, configs, rays, groups: Vec::new(), points: Vec::new() };

        // The grid only tells the mesh's bounds, and skips triangles that are not finite.
        let owned = Owned::build(&case.view(), &Config::default()).expect("a sound mesh");
        let grid = owned.open(&case.view()).expect("its own mesh");
        let some = random.below(case.mesh.indices.len().max(1)) as u32;
        let groups = [
            (u32::MAX, Cull::None, INVALID_ID, 0),
            (u32::MAX, Cull::Back, INVALID_ID, 0),
            (u32::MAX, Cull::Front, some, 1),
            (5, Cull::None, INVALID_ID, 0),
            (u32::MAX, Cull::None, some, 2),
            (3, Cull::Back, 0, 3),
            (0, Cull::None, INVALID_ID, 0),
        ];
        let groups = groups.map(|(mask, cull, skip, rule)| {
            let sees =
                |id: u32| id != skip && (mask == u32::MAX || grid.mesh().mask(id) & mask != 0);
            let offered = |ray| {
                let mut hits = all_hits(&grid, ray, cull);
                hits.retain(|hit| sees(hit.primitive));
                hits
            };
            let offered = case.rays.iter().map(offered).collect();
            Group { mask, cull, skip, rule, offered }
        });
        let points = points.into_iter().map(|(point, max)| {
            let (mask, skip) =
                if random.below(2) == 0 { (6, some) } else { (u32::MAX, INVALID_ID) };
            Point { point, max, mask, skip, answer: closest(&grid, point, max, mask, skip) }
        });
        let points = points.collect();
        drop(owned);
        (case.groups, case.points) = (groups.into(), points);
        case
    }
}

/// Returns the closest point, by a loop over all triangles.
fn closest(
    grid: &Grid<'_>,
    point: [f32; 3],
    max: f32,
    mask: u32,
    skip: u32,
) -> Option<ClosestPoint> {
    let sees = |&id: &u32| id != skip && (mask == u32::MAX || grid.mesh().mask(id) & mask != 0);
    let ids = (0..grid.mesh().triangle_count()).filter(sees);
    let all = ids.filter_map(|id| ClosestPoint::on_triangle(&grid.mesh().triangle(id)?, id, point));
    // Of equals, keep the first, which has the lowest id.
    let closest = all.reduce(|a, b| if b.distance < a.distance { b } else { a });
    closest.filter(|closest| closest.distance <= max)
}

/// Returns rays from around a mesh into it, through its corners and along the axes, some short, some from
/// inside, and some invalid.
fn rays(mesh: &Mesh, random: &mut Random) -> Vec<Ray> {
    let corner = |random: &mut Random| match mesh.positions.len() {
        0 => [0.0; 3],
        count => mesh.positions[random.below(count)],
    };
    let mut ray = |number: usize| {
        let (from, mut to) = (random.point().map(|c| 3.0 * c), random.point());
        if number.is_multiple_of(3) {
            to = corner(random);
        }
        let direction = std::array::from_fn(|axis| to[axis] - from[axis]);
        let mut ray = Ray::new(from, direction);
        match number % 10 {
            1 => ray.t_max = random.unit(),
            2 => (ray.origin, ray.direction) = (to, from),
            3 => ray.direction = [0.0, 0.0, -from[2]],
            4 => (ray.t_min, ray.t_max) = (-1.0, 1.0),
            5 if number.is_multiple_of(4) => ray.direction[number % 3] = f32::NAN,
            6 if number.is_multiple_of(4) => ray.direction = [0.0; 3],
            7 if number.is_multiple_of(3) => (ray.t_min, ray.t_max) = (1.0, 0.5),
            _ => {}
        }
        ray
    };
    // More than two chunks of a batch, and no multiple of one.
    (0..150).map(&mut ray).collect()
}

/// Returns points around a mesh, in it, and on its corners, each with a search distance.
fn points(mesh: &Mesh, random: &mut Random) -> Vec<([f32; 3], f32)> {
    let point = |number: usize| {
        let max = [f32::INFINITY, 1.0, 0.1, 0.0][number % 4];
        let far = [0.5, 1.0, 10.0][number % 3];
        match (number % 7, mesh.positions.len()) {
            (0, 1..) => (mesh.positions[random.below(mesh.positions.len())], max),
            (1, _) if number > 30 => ([f32::NAN, 0.0, 0.0], max),
            (2, _) if number > 30 => (random.point(), -1.0),
            _ => (random.point().map(|c| c * far), max),
        }
    };
    (0..40).map(point).collect()
}

/// Returns sheets one behind the other, each of them twice: more hits on a ray than one walk collects, in
/// pairs with the same `t`.
fn stack() -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..40 {
        let z = (i / 2) as f32 / 20.0 - 0.5;
        let [a, b, c] = [[-2.0, -2.0, z], [2.0, -2.0, z], [0.0, 2.0, z + 0.01]];
        mesh.push(if i % 3 == 0 { [a, b, c] } else { [b, a, c] });
    }
    mesh
}

/// Returns a ball with corners that are not finite, and triangles without area.
fn damaged() -> Mesh {
    let mut mesh = ball(6, 1.0);
    mesh.positions[3][1] = f32::NAN;
    mesh.positions[40][0] = f32::INFINITY;
    let triangle = mesh.indices[100];
    mesh.indices[100] = [triangle[0], triangle[0], triangle[2]];
    mesh
}

/// Returns the table: of all configurations, or of one for each method and quality.
pub(crate) fn cases(is_whole: bool) -> Vec<Case> {
    let more = Method::ALL.iter().copied().map(Config::new).filter(|_| is_whole);
    let configs: Vec<_> = more.chain(configs()).collect();
    vec![
        Case::new(Mesh::default(), false, 1, &configs),
        Case::new(one_triangle(), true, 2, &configs),
        Case::new(ball(12, 1.0), true, 3, &configs),
        Case::new(soup(1500, 0.1, 1), false, 4, &configs),
        Case::new(soup(150, 2.0, 2), true, 5, &configs),
        Case::new(stack(), true, 6, &configs),
        Case::new(damaged(), true, 7, &configs),
    ]
}

/// Returns the table as bytes for programs in C and C++, which `answers.h` reads.
pub(crate) fn bytes(cases: &[Case], grid: impl Fn(&Case, &Config) -> Built) -> Vec<u8> {
    let mut out = Bytes::default();
    out.count(cases.len());
    for case in cases {
        let Case { mesh, masks, configs, rays, groups, points } = case;
        for count in [mesh.positions.len(), mesh.indices.len(), masks.len()] {
            out.count(count);
        }
        for count in [rays.len(), groups.len(), points.len(), configs.len()] {
            out.count(count);
        }
        mesh.positions.iter().for_each(|position| out.floats(position));
        mesh.indices.iter().for_each(|triangle| out.words(triangle));
        out.words(masks);
        for Ray { origin, t_min, direction, t_max } in rays {
            out.floats(&[origin[0], origin[1], origin[2], *t_min]);
            out.floats(&[direction[0], direction[1], direction[2], *t_max]);
        }
        for Group { mask, cull, skip, rule, offered } in groups {
            out.words(&[*mask, *cull as u32, *skip, *rule]);
            for hits in offered {
                out.count(hits.len());
                hits.iter().for_each(|hit| out.hit(hit));
            }
        }
        for Point { point, max, mask, skip, answer } in points {
            out.floats(&[point[0], point[1], point[2], *max]);
            out.words(&[*mask, *skip, answer.is_some().into()]);
            let nothing =
                ClosestPoint { position: [0.0; 3], distance: 0.0, u: 0.0, v: 0.0, primitive: 0 };
            let ClosestPoint { position, distance, u, v, primitive } = answer.unwrap_or(nothing);
            out.floats(&position);
            out.floats(&[distance, u, v]);
            out.words(&[primitive]);
        }
        for config in configs {
            out.words(&fields(config));
            let Built { blob, counters } = grid(case, config);
            out.count(blob.len());
            counters.iter().for_each(|number| out.0.extend(number.to_ne_bytes()));
            out.0.extend(blob);
        }
    }
    out.0
}

/// Returns the fields of `hgrid_config` from `method` to `quality`, except `tasks`; those of other methods are 0.
fn fields(config: &Config) -> [u32; 8] {
    let (method, density) = (config.method() as u32, config.parameters.density().unwrap_or(0.0));
    let [factor, above, depth, quality] = match config.parameters {
        Parameters::Fixed { macrocell_factor, .. } => [macrocell_factor, 0, 0, 0],
        Parameters::Variable { subdivide_above, .. } => [0, subdivide_above, 0, 0],
        Parameters::Recursive { depth, .. } => [0, 0, depth, 0],
        Parameters::Bvh { quality } => [0, 0, 0, quality as u32],
        _ => [0; 4],
    };
    [method, density.to_bits(), factor, above, depth, 0, config.flags.bits(), quality]
}

/// A grid's bytes, and for each group the work of the closest-hit and any-hit queries of all rays.
pub(crate) struct Built {
    pub(crate) blob: Vec<u8>,
    pub(crate) counters: Vec<u64>,
}

/// Bytes in the byte order of this machine.
#[derive(Default)]
struct Bytes(Vec<u8>);

impl Bytes {
    fn words(&mut self, words: &[u32]) {
        self.0.extend(words.iter().flat_map(|word| word.to_ne_bytes()));
    }

    fn count(&mut self, count: usize) {
        self.words(&[u32::try_from(count).expect("a small number")]);
    }

    fn floats(&mut self, floats: &[f32]) {
        self.0.extend(floats.iter().flat_map(|float| float.to_ne_bytes()));
    }

    fn hit(&mut self, &Hit { t, u, v, primitive }: &Hit) {
        self.floats(&[t, u, v]);
        self.words(&[primitive]);
    }
}
