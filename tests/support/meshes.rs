//! Small test meshes.

use hgrid_core::TriangleMesh;

use crate::random::Random;

/// Vertices and triangles.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Three coordinates per vertex.
    pub positions: Vec<[f32; 3]>,
    /// Three vertices per triangle.
    pub indices: Vec<[u32; 3]>,
}

impl Mesh {
    /// Returns the mesh in the library's form.
    pub fn view(&self) -> TriangleMesh<'_> {
        TriangleMesh::new(&self.positions, &self.indices).expect("a sound mesh")
    }

    /// Returns the mesh with every vertex mapped by a function.
    #[must_use]
    pub fn map(&self, change: impl Fn([f32; 3]) -> [f32; 3]) -> Self {
        let positions = self.positions.iter().map(|&p| change(p)).collect();
        Self { positions, indices: self.indices.clone() }
    }

    /// Returns the mesh at another size.
    #[must_use]
    pub fn scaled(&self, scale: f32) -> Self {
        self.map(|p| p.map(|c| c * scale))
    }

    /// Adds a triangle with vertices of its own.
    pub fn push(&mut self, triangle: [[f32; 3]; 3]) {
        let first = u32::try_from(self.positions.len()).expect("a small mesh");
        self.positions.extend(triangle);
        self.indices.push([first, first + 1, first + 2]);
    }

    /// Adds a whole mesh.
    pub fn append(&mut self, other: &Self) {
        let first = u32::try_from(self.positions.len()).expect("a small mesh");
        self.positions.extend(&other.positions);
        self.indices.extend(other.indices.iter().map(|t| t.map(|i| i + first)));
    }
}

/// Returns one triangle in the plane z = 0.
pub fn one_triangle() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.push([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    mesh
}

/// Returns a closed cube from -1 to 1 whose faces are cut into `cells * cells` squares; `roundness` 1 bulges
/// it into a ball. IEEE square roots give the same bits on every machine.
pub fn ball(cells: u32, roundness: f32) -> Mesh {
    let mut mesh = Mesh::default();
    let mut vertices = std::collections::HashMap::new();
    let at = |i: u32| i as f32 / cells as f32 * 2.0 - 1.0;
    let mut vertex = |p: [f32; 3]| {
        *vertices.entry(p.map(f32::to_bits)).or_insert_with(|| {
            let length = p.iter().map(|c| c * c).sum::<f32>().sqrt();
            let stretch = 1.0 + roundness * (1.0 / length - 1.0);
            mesh.positions.push(p.map(|c| c * stretch));
            u32::try_from(mesh.positions.len() - 1).expect("a small mesh")
        })
    };
    for axis in 0..3 {
        for side in [-1.0_f32, 1.0] {
            for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
                let mut corner = |i: u32, j: u32| {
                    let mut p = [side, at(i), at(j)];
                    p.rotate_right(axis);
                    vertex(p.map(|c| if c == 0.0 { 0.0 } else { c }))
                };
                let [a, b, c, d] =
                    [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                if side > 0.0 {
                    mesh.indices.extend([[a, b, c], [a, c, d]]);
                } else {
                    mesh.indices.extend([[a, c, b], [a, d, c]]);
                }
            }
        }
    }
    mesh
}

/// Returns a small ball of many triangles above a floor and between two walls, which are flat: nodes of a tree over them
/// have fine sides.
pub fn room() -> Mesh {
    room_with(24)
}

/// Returns the same with a ball of `12 * cells * cells` triangles, beside 864 of the floor and the walls.
pub fn room_with(cells: u32) -> Mesh {
    let mut mesh = ball(cells, 1.0).scaled(0.02);
    let at = |i: u32| i as f32 / 6.0 - 1.0;
    for (i, j) in (0..12).flat_map(|i| (0..12).map(move |j| (i, j))) {
        for [a, b] in [[0, 1], [1, 2], [2, 0]] {
            let corner = |u: u32, v: u32| {
                let mut p = [-1.0; 3];
                (p[a], p[b]) = (at(i + u), at(j + v));
                p
            };
            mesh.push([corner(0, 0), corner(1, 0), corner(1, 1)]);
            mesh.push([corner(0, 0), corner(1, 1), corner(0, 1)]);
        }
    }
    mesh
}

/// Returns triangles of about `size` anywhere in the cube from -1 to 1.
pub fn soup(count: usize, size: f32, seed: u64) -> Mesh {
    let mut random = Random(seed);
    let mut mesh = Mesh::default();
    for _ in 0..count {
        let center = random.point();
        mesh.push(std::array::from_fn(|_| {
            let offset = random.point();
            std::array::from_fn(|axis| center[axis] + offset[axis] * size)
        }));
    }
    mesh
}
