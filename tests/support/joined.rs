//! The same triangles as several meshes of every form, and as one.

use hgrid_core::{IndexType, MeshPart, Strided, TriangleMesh};

use crate::meshes::Mesh;

/// Meshes in different forms: with tight arrays, with strides of their own, with indices of 16 bits, with masks.
#[derive(Debug)]
pub struct Parts {
    parts: Vec<Part>,
}

/// One mesh; its arrays have junk between elements and nothing after the last.
#[derive(Debug)]
struct Part {
    positions: Vec<u8>,
    position_stride: usize,
    vertices: usize,
    indices: Vec<u8>,
    index_stride: usize,
    index_type: IndexType,
    masks: Option<Vec<u32>>,
    triangles: usize,
}

/// Returns elements as bytes, one every `stride` bytes.
fn scatter(elements: impl Iterator<Item = Vec<u8>>, stride: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (i, element) in elements.enumerate() {
        bytes.resize(i * stride, 0xa5);
        bytes.extend(element);
    }
    bytes
}

/// Returns the mask of a triangle, for a part that has masks.
const fn mask_of(part: usize, triangle: usize) -> u32 {
    1 << ((part + triangle) % 5)
}

impl Part {
    /// Returns the mesh in the form of its number.
    fn new(mesh: &Mesh, number: usize) -> Self {
        let (position_stride, index_stride, index_type) = match number % 4 {
            0 => (12, 12, IndexType::U32),
            1 => (16, 6, IndexType::U16),
            2 => (13, 15, IndexType::U32),
            _ => (12, 8, IndexType::U16),
        };
        let bytes = |vertex: u32| match index_type {
            IndexType::U32 => vertex.to_ne_bytes().to_vec(),
            // A vertex number that does not fit is out of range in either form.
            IndexType::U16 => u16::try_from(vertex).unwrap_or(u16::MAX).to_ne_bytes().to_vec(),
        };
        let position = |p: &[f32; 3]| p.iter().flat_map(|c| c.to_ne_bytes()).collect();
        let triangle = |t: &[u32; 3]| t.iter().flat_map(|&vertex| bytes(vertex)).collect();
        let masks = || (0..mesh.indices.len()).map(|id| mask_of(number, id)).collect();
        Self {
            positions: scatter(mesh.positions.iter().map(position), position_stride),
            position_stride,
            vertices: mesh.positions.len(),
            indices: scatter(mesh.indices.iter().map(triangle), index_stride),
            index_stride,
            index_type,
            masks: (number % 3 == 1).then(masks),
            triangles: mesh.indices.len(),
        }
    }

    fn view(&self) -> TriangleMesh<'_> {
        let Self { position_stride, index_stride, .. } = *self;
        let positions =
            Strided { bytes: &self.positions, stride: position_stride, count: self.vertices };
        let indices = Strided { bytes: &self.indices, stride: index_stride, count: self.triangles };
        let mesh =
            TriangleMesh::strided(positions, indices, self.index_type).expect("a sound mesh");
        match &self.masks {
            Some(masks) => mesh.with_masks(Strided::new(masks)).expect("one each"),
            None => mesh,
        }
    }
}

impl Parts {
    /// Stores meshes, each in another form.
    #[must_use]
    pub fn of(meshes: &[Mesh]) -> Self {
        Self { parts: meshes.iter().enumerate().map(|(at, mesh)| Part::new(mesh, at)).collect() }
    }

    /// Returns the parts, not numbered yet.
    #[must_use]
    pub fn parts(&self) -> Vec<MeshPart<'_>> {
        self.parts.iter().map(|part| MeshPart::new(part.view())).collect()
    }

    /// Returns the masks of all triangles.
    #[must_use]
    pub fn masks(&self) -> Vec<u32> {
        let masks = |part: &Part| part.masks.clone().unwrap_or(vec![u32::MAX; part.triangles]);
        self.parts.iter().flat_map(masks).collect()
    }
}

/// Returns the triangles of all meshes as one mesh.
#[must_use]
pub fn merged(meshes: &[Mesh]) -> Mesh {
    let mut all = Mesh::default();
    meshes.iter().for_each(|mesh| all.append(mesh));
    all
}
