//! Meshes that are hard on a grid, a tree or a ray-triangle test.

use hgrid_tests::meshes::{Mesh, ball, soup};
use hgrid_tests::random::Random;

type Point = [f32; 3];

/// A function that makes a random mesh of one kind.
type Make = fn(&mut Random) -> Mesh;

const KINDS: [(&str, Make); 12] = [
    ("soup", any_soup),
    ("slivers", slivers),
    ("fan", fan),
    ("planes", planes),
    ("duplicates", duplicates),
    ("snapped", snapped),
    ("closed", closed),
    ("nested", nested),
    ("odd", odd),
    ("strip", strip),
    ("sizes", sizes),
    ("needles", needles),
];

/// Returns a random mesh and its name.
pub(crate) fn any(random: &mut Random) -> (String, Mesh) {
    let (name, make) = KINDS[random.below(KINDS.len())];
    let mut mesh = make(random);
    let mut name = name.to_owned();
    if random.below(3) == 0 {
        let far = 2_f32.powi(random.below(24) as i32);
        let by = random.point().map(|c| c * far);
        mesh = mesh.map(|p| std::array::from_fn(|k| p[k] + by[k]));
        name += ", far off";
    }
    if random.below(3) == 0 {
        let power = match random.below(4) {
            0 => random.below(40) as i32 - 20,
            1 => random.below(200) as i32 - 100,
            // Into denormal numbers, and up to coordinates at which triangles are left out.
            2 => -120 - random.below(28) as i32,
            _ => 100 + random.below(26) as i32,
        };
        // Scale in two steps: f32 does not hold such large and small powers of two.
        let (first, second) = (power / 2, power - power / 2);
        mesh = mesh.scaled(2_f32.powi(first)).scaled(2_f32.powi(second));
        name += &format!(", times 2^{power}");
    }
    if random.below(4) == 0 {
        let turn = random.below(3);
        mesh = mesh.map(|mut p| {
            p.rotate_left(turn);
            p
        });
    }
    if random.below(6) == 0 {
        let far = 10_f32.powi(random.below(12) as i32 - 2);
        for _ in 0..1 + random.below(4) {
            mesh.positions.push(random.point().map(|c| c * far));
        }
        name += ", unused vertices";
    }
    if random.below(4) == 0 {
        // Another order of triangles gives other ids and another build.
        for i in (1..mesh.indices.len()).rev() {
            mesh.indices.swap(i, random.below(i + 1));
        }
    }
    (name, mesh)
}

fn few(random: &mut Random) -> usize {
    3 + random.below(30)
}

fn any_soup(random: &mut Random) -> Mesh {
    let size = [1.0, 0.3, 0.05, 1e-3][random.below(4)];
    soup(few(random), size, random.bits())
}

/// Triangles with one corner near the line through the other two, down to the last bit.
fn slivers(random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    for _ in 0..few(random) {
        let (a, d) = (random.point(), random.point());
        let part = random.unit();
        let off = 10_f32.powi(-(random.below(12) as i32));
        let (b, e) = (plus(a, d, 1.0), random.point());
        mesh.push([a, b, plus(plus(a, d, part), e, off)]);
    }
    mesh
}

/// Triangles around one vertex, on rare occasions thousands of them.
fn fan(random: &mut Random) -> Mesh {
    let count = if random.below(250) == 0 { 2000 + random.below(2000) } else { few(random) };
    let mut mesh = Mesh::default();
    mesh.positions.push(random.point());
    let bend = [0.0, 0.1, 1.0][random.below(3)];
    for i in 0..count {
        // Go around a square that stands on a corner: this gives the same bits on every machine.
        let turn = 4.0 * i as f32 / count as f32;
        let (side, part) = (turn as u32, turn.fract());
        let [x, y] = [1.0 - part, part];
        let [x, y] = [[x, y], [-y, x], [-x, -y], [y, -x]][side as usize % 4];
        mesh.positions.push([x, y, bend * (random.unit() - 0.5)]);
    }
    let count = count as u32;
    mesh.indices.extend((0..count).map(|i| [0, 1 + i, 1 + (i + 1) % count]));
    mesh
}

/// Triangles in one plane, or in planes one bit apart.
fn planes(random: &mut Random) -> Mesh {
    let tilt = [random.below(3), random.below(3)].map(|t| t as f32 - 1.0);
    let is_apart = random.below(2) == 0;
    let mut z = random.unit();
    let mut mesh = Mesh::default();
    for _ in 0..few(random) {
        mesh.push(std::array::from_fn(|_| {
            let [x, y, _] = random.point().map(|c| (c * 8.0).round() / 8.0);
            [x, y, z + tilt[0] * x + tilt[1] * y]
        }));
        z = if is_apart { z.next_up() } else { z };
    }
    mesh
}

/// A few triangles, each repeated many times with its corners in any order.
fn duplicates(random: &mut Random) -> Mesh {
    let mut mesh = soup(1 + random.below(3), 0.8, random.bits());
    let count = mesh.indices.len();
    for _ in 0..few(random) {
        let mut triangle = mesh.indices[random.below(count)];
        triangle.rotate_left(random.below(3));
        if random.below(2) == 0 {
            triangle.swap(0, 1);
        }
        mesh.indices.push(triangle);
    }
    mesh
}

/// Corners at the points of a small lattice.
fn snapped(random: &mut Random) -> Mesh {
    let cells = 2.0 + random.below(4) as f32;
    soup(few(random), 1.0, random.bits()).map(|p| p.map(|c| (c * cells).round() / cells))
}

/// A closed surface, perhaps with corners out of place.
fn closed(random: &mut Random) -> Mesh {
    let roundness = [0.0, 1.0][random.below(2)];
    let cells = 1 + random.below(2) as u32;
    let shake = [0.0, 0.1][random.below(2)];
    let seed = random.bits();
    ball(cells, roundness).map(|p| {
        // Move equal corners alike, so that the surface stays closed.
        let key = p.iter().fold(seed, |key, c| key.rotate_left(20) ^ u64::from(c.to_bits()));
        plus(p, Random(key).point(), shake)
    })
}

/// Copies of a small soup around one point, each smaller than the one before.
fn nested(random: &mut Random) -> Mesh {
    let center = random.point().map(|c| c * 0.3);
    let shrink = [0.5, 0.1, 0.01, 1e-3][random.below(4)];
    let mut mesh = Mesh::default();
    let mut scale = 1.0;
    for _ in 0..2 + random.below(8) {
        let part = soup(2 + random.below(4), 0.5, random.bits());
        mesh.append(&part.map(|p| plus(center, p, scale)));
        scale *= shrink;
    }
    mesh
}

/// Triangles without area, and vertices with NaN, infinite or extreme coordinates.
fn odd(random: &mut Random) -> Mesh {
    let mut mesh = soup(few(random), 0.5, random.bits());
    let numbers = [f32::NAN, f32::INFINITY, 0.0, -0.0, 1e-45, f32::MIN_POSITIVE, 1e30, -1e36, 3e38];
    for _ in 0..1 + random.below(6) {
        let vertex = random.below(mesh.positions.len());
        mesh.positions[vertex][random.below(3)] = numbers[random.below(numbers.len())];
        let triangle = random.below(mesh.indices.len());
        mesh.indices[triangle][1] = mesh.indices[triangle][random.below(3)];
    }
    mesh
}

/// A strip of triangles along an axis; neighbours share edges.
fn strip(random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    let bend = [0.0, 0.01, 0.3][random.below(3)];
    for i in 0..2 + few(random) {
        let z = bend * random.unit();
        mesh.positions.push([(i / 2) as f32 / 8.0, (i % 2) as f32, z]);
    }
    let count = mesh.positions.len() as u32 - 2;
    mesh.indices.extend((0..count).map(|i| [i, i + 1 + i % 2, i + 2 - i % 2]));
    mesh
}

/// Triangles whose sizes differ by a factor of up to 2^30.
fn sizes(random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    for _ in 0..few(random) {
        let (at, size) = (random.point(), 2_f32.powi(-(random.below(31) as i32)));
        mesh.push(std::array::from_fn(|_| plus(at, random.point(), size)));
    }
    mesh
}

/// Long triangles along the axes, flat ones among them.
fn needles(random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    for _ in 0..few(random) {
        let (at, axis) = (random.point(), random.below(3));
        let width = [0.0, 1e-7, 1e-4, 0.01][random.below(4)];
        mesh.push([0.0, 1.0, 0.5].map(|along| {
            let mut p = plus(at, random.point(), width);
            p[axis] = at[axis] + along * 2.0;
            p
        }));
    }
    mesh
}

fn plus(a: Point, d: Point, scale: f32) -> Point {
    std::array::from_fn(|k| a[k] + d[k] * scale)
}
